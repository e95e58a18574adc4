"""The reader: exact positions, one clear error with a caret, bounds, and text that reads back to the same form."""

from __future__ import annotations

import math
import time
from random import Random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from language.authors import Author
from sleepcast.core.errors import line_and_column
from sleepcast.core.units import LENGTH, NONE, RATE, SPEED, TIME, UNITS, Dimension
from sleepcast.language.reader import (
    MAX_NAME,
    MAX_NESTING,
    MAX_TEXT,
    PREFIXES,
    Form,
    List,
    Number,
    ReadError,
    Symbol,
    Text,
    format_literal,
    format_value,
    is_name,
    read,
    read_all,
    show,
    walk,
)

SLOWEST = 0.5
"""Seconds for the worst text of the greatest length: a hundred times what an honest one of that length takes."""


def refusal(text: str) -> ReadError:
    with pytest.raises(ReadError) as caught:
        read(text)
    return caught.value


def refused(text: str) -> ReadError | None:
    """The error of reading all of `text`, None if it can be read."""
    try:
        read_all(text)
    except ReadError as error:
        return error
    return None


# ---- strategies

NAMES = st.from_regex(r"[A-Za-z_*/<>=!?][A-Za-z0-9_*/<>=!?.+-]{0,8}", fullmatch=True).filter(is_name)
LABELS = st.text(st.characters(exclude_characters='"').filter(str.isprintable), max_size=MAX_NAME)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
ATOMS = st.one_of(NAMES.map(Symbol), LABELS.map(Text), FINITE.map(Number))


def lists(items: st.SearchStrategy[Form]) -> st.SearchStrategy[Form]:
    plain = st.lists(items, max_size=4).map(lambda found: List(tuple(found)))
    prefixed = st.tuples(st.sampled_from(sorted(PREFIXES)).map(Symbol), items).map(List)
    return plain | prefixed


FORMS = st.recursive(ATOMS, lists, max_leaves=15)
AUTHORS = st.integers(0, 2**32).map(lambda seed: Author(Random(seed)).text())


# ---- positions


def test_every_form_knows_where_it_stood() -> None:
    text = ' (SETQ  a ; why\n \'(+ 1.50m "lab el" ,x))'
    outer = read(text)
    spots = [(type(form).__name__, text[form.start : form.end]) for form in walk(outer)]
    assert spots == [
        ("List", text.strip()),
        ("Symbol", "SETQ"),
        ("Symbol", "a"),
        ("List", '\'(+ 1.50m "lab el" ,x)'),
        ("Symbol", "'"),
        ("List", '(+ 1.50m "lab el" ,x)'),
        ("Symbol", "+"),
        ("Number", "1.50m"),
        ("Text", '"lab el"'),
        ("List", ",x"),
        ("Symbol", ","),
        ("Symbol", "x"),
    ]


@given(AUTHORS)
def test_a_form_s_own_stretch_of_text_reads_as_that_form(text: str) -> None:
    for form in walk(read(text)):
        stretch = text[form.start : form.end]
        if stretch not in PREFIXES.values():
            assert read(stretch) == form


# ---- errors: the sentence, and the caret under the spot


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("(+ 1 2))", ") at 1:8 closes nothing: there is one ) too many\n  (+ 1 2))\n         ^"),
        ("(+ 1\n  (* 2 3", 'the "(" at 2:3 is not closed: add 2 ")" at the end\n    (* 2 3\n    ^'),
        ("(> fuel 5parsecs)", 'unknown unit "parsecs" at 1:10'),
        ("(+ 1 2", 'the "(" at 1:1 is not closed: add a ")" at the end'),
        ("stop all robots", 'this is no expression at 1:1: an expression starts with "("'),
        ("fuel > 50", "this is no expression at 1:1: write (> fuel 50)\n  fuel > 50\n  ^^^^^^^^^"),
        ("fuel > 50 %", "write (> fuel 50%)"),
        ("(+ 1 2) > 3", "write (> (+ 1 2) 3)"),
        ("x and y < 3", "write (AND x (< y 3))"),
        ("IN bravo", "write (IN bravo)"),
        ("not fuel > 50%", "write (not (> fuel 50%))"),
        ("GOTO 3 mi 4mi", "write (GOTO 3mi 4mi)"),
        ("MARK fuel > 50%", "write (WHEN (> fuel 50%) (MARK))"),
        ("JOIN bravo if fuel > 50%", "write (WHEN (> fuel 50%) (JOIN bravo))"),
        ("if fuel > 50% then ST", "write (WHEN (> fuel 50%) (ST))"),
        ("5 m", "write 5m"),
        ("> fuel", 'an expression starts with "("'),
        ("if then", 'an expression starts with "("'),
        ("(a) if", "one more expression at 1:5"),
        ("x " * 40, 'an expression starts with "("'),
        ("1 22", "one more expression at 1:3: a message is one expression"),
        ("(a b) (c d)", "one more expression at 1:7"),
        ("(a\n  b{c}\n  d)", '"b{c}" at 2:3 has a character that no name has'),
        ("5.5.5", '"5.5.5" at 1:1 is neither a number nor a name'),
        ("(a 'b ')", "' at 1:7 has nothing after it\n  (a 'b ')\n        ^"),
        ("(a `)", "` at 1:4 has nothing after it"),
        (",", ", at 1:1 has nothing after it"),
        ('(PRINT "abc)', 'a " without its closing " at 1:8\n  (PRINT "abc)\n         ^'),
        ("1e999", "1e999 at 1:1 is too large for a number\n  1e999\n  ^^^^^"),
        ("", "no expression at 1:1"),
        ("  ; only a comment", "no expression at 1:1"),
        ("(caf\u00e9 1)", '"caf\u00e9" at 1:2 has a character that no name has'),
    ],
)
def test_an_error_says_where_what_and_what_was_wanted(text: str, message: str) -> None:
    assert message in str(refusal(text))


@pytest.mark.parametrize(
    ("text", "marked"),
    [
        ("(> fuel 5parsecs)", "parsecs"),
        ("(+ 1 2.2.2 3)", "2.2.2"),
        ("(+ 1 a{b 3)", "a{b"),
        ("(+ 1 2) (3)", "(3)"),
        ("((a) b", "("),
        ("a)", ")"),
    ],
)
def test_the_caret_is_under_the_offending_characters(text: str, marked: str) -> None:
    error = refusal(text)
    assert text[error.start : error.end] == marked
    line, carets = str(error).splitlines()[-2:]
    assert line[carets.index("^") : carets.rindex("^") + 1] == marked


def test_an_unknown_unit_gets_a_suggestion_and_the_list() -> None:
    assert "did you mean min?" in str(refusal("5mins"))
    assert all(unit in str(refusal("5furlongs")) for unit in UNITS)


@given(st.text(max_size=60) | st.text("()'`,;\" \n\t5.eE+-%/aZ{}\u00e9", max_size=60))
@example("\x00")
@example("@@")
@example("(PRINT a@@b)")
@example("(\ud800)")
@example("5\u0663")
@example("a\u00a0b")
def test_any_text_is_read_or_refused_with_a_place_in_it(text: str) -> None:
    error = refused(text)
    if error is None:
        forms = read_all(text)
        assert [read(show(form)) for form in forms] == forms
        return
    assert 0 <= error.start < error.end <= max(1, len(text))
    line, column = line_and_column(text, error.start)
    assert f"at {line}:{column}" in error.reason
    assert str(error).startswith(error.reason)
    assert error.exit_status == 2


# ---- printing reads back


@given(FORMS)
def test_a_shown_form_reads_back_to_an_equal_one(form: Form) -> None:
    assert read(show(form)) == form


@given(AUTHORS)
def test_a_read_text_shows_as_a_text_of_the_same_form(text: str) -> None:
    form = read(text)
    assert read(show(form)) == form
    assert show(read(show(form))) == show(form)


@given(AUTHORS, st.randoms(use_true_random=False))
def test_blanks_lines_and_comments_between_words_change_nothing(text: str, chance: Random) -> None:
    spaced = ""
    for character in text:
        if character in "()" or (character == " " and spaced.count('"') % 2 == 0):
            character = f"{chance.choice(['', ' ', chr(10), chr(9), f' ;( a comment{chr(10)}'])}{character}"
        spaced += character
    assert read(spaced) == read(text)


@given(FINITE)
@example(-0.0)
@example(5e-324)
@example(1.7976931348623157e308)
@example(1e16)
@example(9007199254740993.0)
def test_a_literal_is_the_shortest_text_of_the_very_same_number(value: float) -> None:
    form = read(format_literal(value))
    assert isinstance(form, Number)
    assert form.value.hex() == value.hex()
    assert len(format_literal(value)) <= max(len(repr(value)), len(str(int(value))) if abs(value) < 1e16 else 0)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (5.0, "5"),
        (-10.0, "-10"),
        (0.0, "0"),
        (-0.0, "0"),
        (0.5, "0.5"),
        (0.1 + 0.2, "0.30000000000000004"),
        (1e15, "1000000000000000"),
        (1e300, "1e+300"),
        (1e-7, "1e-07"),
        (math.nan, "UNKNOWN"),
    ],
)
def test_a_value_prints_as_an_integer_or_the_shortest_form_or_unknown(value: float, shown: str) -> None:
    assert format_value(value) == shown


# ---- numbers, names, labels


@pytest.mark.parametrize(
    ("text", "value", "dimension"),
    [
        ("5", 5.0, None),
        ("-5", -5.0, None),
        ("+5", 5.0, None),
        (".5", 0.5, None),
        ("5.", 5.0, None),
        ("1e3", 1000.0, None),
        ("-1.5E-3", -0.0015, None),
        ("10in", 0.254, LENGTH),
        ("50%", 0.5, NONE),
        ("180deg", math.pi, NONE),
        ("24ms", 0.024, TIME),
        ("24MS", 0.024, TIME),
        ("0.5m/s", 0.5, SPEED),
        ("90deg/s", math.pi / 2, RATE),
        ("1e3mm", 1.0, LENGTH),
        ("-3km", -3000.0, LENGTH),
    ],
)
def test_numbers_and_units(text: str, value: float, dimension: Dimension | None) -> None:
    form = read(text)
    assert isinstance(form, Number)
    assert form.value == pytest.approx(value, rel=1e-15)
    assert form.dimension == dimension
    assert show(form) == text


def test_every_unit_can_be_written_after_a_number() -> None:
    for suffix, unit in UNITS.items():
        form = read(f"2{suffix}")
        assert isinstance(form, Number)
        assert form.value == pytest.approx(2 * unit.factor, rel=1e-15)
        assert form.dimension == unit.dimension


@pytest.mark.parametrize("text", ["-", "+", "*", "a", "a1", "distance-to-light", "<=", "/=", "+.", "a.b", "e5x", "$v"])
def test_names(text: str) -> None:
    form = read(text)
    assert isinstance(form, Symbol)
    assert show(form) == text
    assert is_name(text)


@pytest.mark.parametrize("text", ["", "5a", "-5x", ".5x", "a b", "a(b", "a;b", "caf\u00e9", "a,b", "'a", "a" * 65])
def test_what_is_no_name(text: str) -> None:
    assert not is_name(text)


def test_names_are_echoed_as_written_and_compared_without_case() -> None:
    assert show(read("(SetQ Fuel 5)")) == "(SetQ Fuel 5)"
    assert read("(SetQ Fuel 5)") == read("(setq FUEL 5.0)")
    assert hash(read("Fuel")) == hash(read("fuel"))


def test_forms_differ_by_value_kind_and_dimension() -> None:
    different = ["5", "-5", "0", "-0", "5m", "5s", "a", "b", '"a"', '"A"', "()", "(a)", "(a a)", "'a", "`a", ",a"]
    forms = [read(text) for text in different]
    assert all((a == b) == (i == j) for i, a in enumerate(forms) for j, b in enumerate(forms))
    assert read("1km") == read("1000m")
    assert read("'a") == read("(QUOTE a)")


# ---- bounds


def nested(depth: int, mark: str = "(") -> str:
    return mark * depth + "1" + (")" * depth if mark == "(" else "")


@pytest.mark.parametrize("mark", ["(", "'", "`", ","])
def test_nesting_is_bounded(mark: str) -> None:
    assert read(show(read(nested(MAX_NESTING, mark)))) == read(nested(MAX_NESTING, mark))
    error = refusal(nested(MAX_NESTING + 1, mark))
    assert f"nested too deeply at 1:{MAX_NESTING + 1}" in str(error)


def test_length_is_bounded() -> None:
    fits = "1" + " " * (MAX_TEXT - 1)
    assert read(fits) == Number(1.0)
    error = refusal(fits + " ")
    assert f"at most {MAX_TEXT}" in str(error)
    assert len(str(error)) < 300


@pytest.mark.parametrize("text", ['(REPORT "a\x1b[31mb")', "(fo\x1b[31mo)", '"\x9b"', "\x00"])
def test_nothing_that_a_terminal_obeys_gets_in_or_into_the_refusal(text: str) -> None:
    refusal = str(refused(text))
    assert all(c.isprintable() or c == "\n" for c in refusal)


def test_names_and_labels_are_bounded() -> None:
    assert show(read("a" * MAX_NAME)) == "a" * MAX_NAME
    assert f"at most {MAX_NAME}" in str(refusal("a" * (MAX_NAME + 1)))
    assert read('"' + "a" * MAX_NAME + '"') == Text("a" * MAX_NAME)
    assert f"at most {MAX_NAME}" in str(refusal('"' + "a" * (MAX_NAME + 1) + '"'))


@pytest.mark.parametrize(
    "piece",
    [
        "1",
        "1.",
        "1e",
        "1/",
        ".",
        "-",
        "a",
        "5m/",
        "(",
        ")",
        "'",
        '"',
        '"a',
        ";",
        "\n",
        "1 ",
        "() ",
        "5m ",
        "e5",
        "\\",
        "5%",
    ],
)
@pytest.mark.parametrize("end", ["", "#", "a{", ")", '"'])
def test_no_text_takes_long_to_read_or_refuse(piece: str, end: str) -> None:
    text = (piece * MAX_TEXT)[: MAX_TEXT - len(end)] + end
    assert any(seconds_for(text) < SLOWEST for _ in range(3)), "each time: not just a collection of garbage"


def seconds_for(text: str) -> float:
    begun = time.process_time()
    refused(text)
    return time.process_time() - begun
