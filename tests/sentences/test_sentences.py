"""Sentences and expressions: what is said is what was meant, both ways, and what is not understood is told."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.cli.sentences import lexicon_of
from sleepcast.language import Form, ReadError, Vocabulary, read, show
from sleepcast.language.learned_names import LearnedNames
from sleepcast.sentences import MAX_SENTENCE, Lexicon, SentenceError, from_sentence, to_sentence
from sleepcast.sentences.lexicon import RESERVED
from sleepcast.simulator import find_scenario
from sleepcast.simulator.scenario.scenario import scenario_names

LONGEST = 0.5
"""Seconds in which any sentence is read, on a machine with other work."""


BRAVO = lexicon_of("bravo")

NEAR = "(< (DIST x y vessel_x vessel_y) 5mi)"
SAID = [
    # the mission of 1998, and the ways in which the specification says it
    (
        "All scouts within 5 miles of X with more than 50 % fuel and 70 % ordnance are now in Task Element Bravo.",
        f"(WHEN (AND {NEAR} (> fuel 50%) (> ordnance 70%)) (JOIN bravo))",
    ),
    (
        "Robots within 5 miles of X with fuel over 50 % and ordnance over 70 % join Bravo",
        f"(WHEN (AND {NEAR} (> fuel 50%) (> ordnance 70%)) (JOIN bravo))",
    ),
    (
        "scouts within 5mi of the vessel that have more than 50 percent fuel and 70 % of ordnance join team bravo",
        f"(WHEN (AND {NEAR} (> fuel 50%) (> ordnance 70%)) (JOIN bravo))",
    ),
    # who
    ("all scouts stop", "(ST)"),
    ("everybody stops", "(ST)"),
    ("every robot stops", "(ST)"),
    ("all stop and mark themselves", "(PROGN (ST) (MARK))"),
    ("members of bravo leave bravo", "(WHEN (IN bravo) (LEAVE bravo))"),
    ("members of the group bravo stop", "(WHEN (IN bravo) (ST))"),
    ("robot 7 stops", "(WHEN (= id 7) (ST))"),
    ("scout12 stops", "(WHEN (= id 12) (ST))"),
    ("robots 1, 2 and 5 with less than 20 % fuel stop",
     "(WHEN (AND (OR (= id 1) (= id 2) (= id 5)) (< fuel 20%)) (ST))"),
    # conditions
    ("scouts with at least 50 % fuel", "(>= fuel 50%)"),
    ("scouts with at most 50 % fuel", "(<= fuel 50%)"),
    ("scouts with exactly 50 % fuel", "(= fuel 50%)"),
    ("scouts with between 20 % and 50 % fuel", "(< 20% fuel 50%)"),
    ("scouts with 20 % to 50 % fuel", "(<= 20% fuel 50%)"),
    ("scouts whose speed is more than 5 knots", "(> speed 5kn)"),
    ("scouts whose speed is over 5 metres per second", "(> speed 5m/s)"),
    ("scouts whose heading is between -10 degrees and 0.5 rad", "(< -10deg heading 0.5rad)"),
    ("scouts whose x is not vessel_x", "(/= x vessel_x)"),
    ("scouts whose fuel is known and whose ordnance is unknown", "(AND (KNOWN fuel) (NOT (KNOWN ordnance)))"),
    ("scouts more than 5 nautical miles from X", "(> (DIST x y vessel_x vessel_y) 5nmi)"),
    ("scouts farther than 10in from (3 km, -4 km)", "(> (DIST x y 3km -4km) 10in)"),
    ("scouts between 1 and 2 miles from X", "(< 1 (DIST x y vessel_x vessel_y) 2mi)"),
    ("scouts in bravo, stopped", "(AND (IN bravo) (= speed 0m/s))"),
    ("scouts that are frozen or marked or sleeping", "(OR frozen marked sleeping)"),
    ("scouts not in bravo but inside harbour", "(AND (NOT (IN bravo)) (INSIDE harbour))"),
    ("scouts outside harbour", "(NOT (INSIDE harbour))"),
    ("scouts with a chance of 20 %", "(PROB 20%)"),
    ("scouts in a1 or in b1 and in c1", "(OR (IN a1) (AND (IN b1) (IN c1)))"),
    ("scouts (in a1 or in b1) and in c1", "(AND (OR (IN a1) (IN b1)) (IN c1))"),
    ("members of a1 in b1 or in c1", "(AND (IN a1) (OR (IN b1) (IN c1)))"),
    ("members of a1 (in b1 and in c1)", "(AND (IN a1) (AND (IN b1) (IN c1)))"),
    ("scouts with more than 50 % fuel or 70 % ordnance", "(OR (> fuel 50%) (> ordnance 70%))"),
    ("scouts with more than 50 % fuel and less than 70 % ordnance", "(AND (> fuel 50%) (< ordnance 70%))"),
    # acts
    ("all scouts go to X", "(GOTO vessel_x vessel_y)"),
    ("all scouts go to (1 mi, 2 mi)", "(GOTO 1mi 2mi)"),
    ("all scouts drive at 5 kn", "(DRIVE 5kn 0deg/s)"),
    ("all scouts drive at 5 kn straight ahead", "(DRIVE 5kn 0deg/s)"),
    ("all scouts drive at 5 kn turning at 6 degrees per second", "(DRIVE 5kn 6deg/s)"),
    ("all scouts set drive_speed to 5 kn, then wander", "(PROGN (SETQ drive_speed 5kn) (WANDER))"),
    ("all scouts follow the rule keep_off", "(ACTIVATE keep_off)"),
    ("all scouts suspend rule keep_off and forget keep_off", "(PROGN (DEACTIVATE keep_off) (FORGET keep_off))"),
    ('all scouts report "state" fuel, ordnance and speed', '(REPORT "state" fuel ordnance speed)'),
    ("all scouts report fuel and stop", "(PROGN (REPORT fuel) (ST))"),
    ('all scouts say "hello" and ping', '(PROGN (TK "hello") (PING))'),
    ("scout 1 tells scouts with more than 80 % fuel to join convoy",
     "(WHEN (= id 1) (TELL (WHEN (> fuel 80%) (JOIN convoy))))"),
    ("scouts with less than 10 % fuel tell scouts within 1 km of me to join help",
     "(WHEN (< fuel 10%) (TELL `(WHEN (< (DIST x y ,x ,y) 1km) (JOIN help))))"),
]  # fmt: skip


@pytest.mark.parametrize(("sentence", "expression"), SAID)
def test_a_sentence_means_its_expression_and_is_said_so_that_it_means_it_again(sentence: str, expression: str) -> None:
    heard = from_sentence(sentence, BRAVO)
    assert heard.unclear == ()
    assert heard.form == read(expression)
    again = to_sentence(read(heard.text), BRAVO)
    assert again is not None
    assert from_sentence(again.text, BRAVO).form == read(expression)


UNCLEAR = [
    ("robots with more fule join bravo", ["fule"], 'wanted "than"'),
    ("robots with more than 50 % fule join bravo", ["fule"], "did you mean fuel?"),
    ("robots within 5 parsecs of X join bravo", ["parsecs of X"], 'wanted "of"'),
    ("robots within 5 miles of Y join bravo", ["Y"], "no place"),
    ("robtos near X joyn bravo", ["robtos near X joyn bravo"], "who is meant"),
    ("robots near X join bravo", ["near X"], "nothing that these robots are known to do"),
    ("robots with 50 % fuel stop", ["50 % fuel"], '"more than"'),
    ("robots within 1,000 m of X stop", ["1,000 m of X"], "no commas"),
    ("robots within 1,5 km of X stop", ["1,5 km of X"], "Decimals have a point, not a comma: 1.5"),
    ("robots within 5 miles", [""], 'wanted "of" at the end'),
    ("robots within 5 miles of X with", [""], "the name of a variable at the end"),
    ("robots", [""], "what the robots are to do is missing"),
    ("", [""], "who is meant"),
    ("robots stop and", [""], "what else the robots are to do"),
    ("robots stop now", ["now"], "no place here"),
    ("robots within 5 miles of me stop", ["me"], "tell each other"),
    ("robots in bravo and stop", ["stop"], "is no condition"),
    ("robots in and stop", ["and"], "the name of a group"),
    ("robots with fule over 50 % and ordnanse over 70 % joyn bravo", ["fule", "ordnanse", "joyn bravo"], "fuel?"),
    ('robots say "' + "x" * 65 + '"', ['"' + "x" * 65 + '"'], "at most 64"),
    ("robots go to 3 km, 4 km", ["3 km"], "parentheses"),
    ("all scouts tell all scouts to tell all scouts to stop", ["tell all scouts to"], "do not tell on"),
]


@pytest.mark.parametrize(("sentence", "parts", "why"), UNCLEAR)
def test_what_is_not_understood_is_told_with_its_place_and_never_guessed(
    sentence: str, parts: list[str], why: str
) -> None:
    heard = from_sentence(sentence, BRAVO)
    assert heard.form is None
    assert heard.text == ""
    found = [sentence[each.start : each.end] for each in heard.unclear]
    assert found[: len(parts)] == parts
    assert why in heard.unclear[0].message


def test_a_body_without_a_function_is_told_so() -> None:
    heard = from_sentence("all robots go to (1 km, 2 km)", Lexicon(Vocabulary()))
    assert [each.message for each in heard.unclear] == ["these robots have no function GOTO"]


def test_a_place_is_called_by_name_title_or_a_word_of_the_title_that_is_its_own() -> None:
    lexicon = Lexicon(BRAVO.vocabulary, titles={"vessel": "the vessel X"})
    assert {("vessel",), ("x",), ("vessel", "x")} <= set(lexicon.places())
    vocabulary = lexicon_of("recruit").vocabulary
    shared = Lexicon(vocabulary, titles={"north": "north tower", "south": "south tower"})
    assert ("tower",) not in shared.places()
    assert shared.places()[("north", "tower")] == "north"


def test_an_expression_beyond_the_grammar_has_no_sentence() -> None:
    for text in (
        "(WHEN (> (+ fuel ordnance) 1) (ST))",
        "(COND ((> fuel 50%) (ST)))",
        "(WHEN (IN bravo) (GOTO (+ vessel_x 1mi) vessel_y))",
        "(WHEN (= (DIST x y vessel_x vessel_y) 5mi) (ST))",
        "(WHEN (< (DIST vessel_x vessel_y x y) 5mi) (ST))",
        "(JOIN stop)",
        "(AND (IN bravo))",
        "(WHEN (> fule 50%) (ST))",
        "(TELL (WHEN (> fuel 50%) (ST)) :hops 3)",
        "fuel",
        "5",
        "()",
        "(AND)",
        "((1) 2)",
    ):
        assert to_sentence(read(text), BRAVO) is None, text


def test_parts_of_a_sentence_stand_for_parts_of_the_expression() -> None:
    text = f"(WHEN (AND {NEAR}\n  (> fuel 50%) (> ordnance 70%))\n  (JOIN bravo))"
    sentence = to_sentence(read(text), BRAVO)
    assert sentence is not None
    pairs = [(sentence.text[part.start : part.end], text[part.shown_start : part.shown_end]) for part in sentence.parts]
    assert pairs == [
        ("within 5 mi of vessel X", NEAR),
        ("with more than 50 % fuel", "(> fuel 50%)"),
        ("70 % ordnance", "(> ordnance 70%)"),
        ("join bravo", "(JOIN bravo)"),
    ]


# ---- every expression of the grammar

numbers = st.sampled_from(
    ["0", "7", "-3", "0.5", "1e3", ".25", "1e-7", "12.", "50%", "5mi", "10in", "3kn", "2m/s", "90deg"]
)
variables = st.sampled_from(["fuel", "ordnance", "speed", "heading", "x", "vessel_x", "drive_speed", "pi", "TRUE"])
groups = st.sampled_from(["bravo", "Charlie", "task-force", "x2", "element"])
values = numbers | variables
points = st.sampled_from(["vessel_x vessel_y", "3km -4km", "x vessel_y", "vessel_y vessel_x"])


def call(head: str, *arguments: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.tuples(*arguments).map(lambda found: f"({' '.join((head, *found))})")


comparisons = st.one_of(*(call(operator, variables, values) for operator in ("<", ">", "<=", ">=", "=", "/=")))
ranges = st.one_of(*(call(operator, values, variables, values) for operator in ("<", "<=")))
distances = points.map(lambda point: f"(DIST x y {point})")
far = st.one_of(
    *(call(operator, distances, values) for operator in ("<", ">", "<=", ">=")), call("<", values, distances, values)
)
atoms = st.one_of(
    comparisons,
    ranges,
    far,
    call("IN", groups),
    call("INSIDE", groups),
    call("KNOWN", variables),
    call("PROB", numbers),
    st.sampled_from(["marked", "frozen", "sleeping", "(= speed 0m/s)"]),
    call("NOT", variables.filter(lambda name: name != "marked")),
)  # fmt: skip
conditions = st.recursive(
    atoms,
    lambda inside: st.one_of(
        call("AND", inside, inside),
        call("OR", inside, inside),
        call("AND", inside, inside, inside),
        call("NOT", inside),
    ),
    max_leaves=6,
)
robots = st.integers(0, 10**6).map(lambda number: f"(= id {number})")
subjects = st.one_of(robots, call("IN", groups), call("OR", robots, robots), call("OR", robots, robots, robots))
tests = st.one_of(
    conditions, subjects, call("AND", subjects, conditions), call("AND", subjects, conditions, conditions)
)
acts = st.one_of(
    call("JOIN", groups),
    call("LEAVE", groups),
    call("GOTO", points),
    call("DRIVE", values, values),
    call("SETQ", st.sampled_from(["drive_speed", "drive_turn", "marking"]), values),
    call("REPORT", variables),
    call("REPORT", st.just('"a label, and more"')),
    call("REPORT", st.just('"state"'), variables, variables),
    call("TK", st.just('"hello"')),
    call("ACTIVATE", groups),
    call("DEACTIVATE", groups),
    call("FORGET", groups),
    st.sampled_from(
        [
            "(ST)",
            "(WANDER)",
            "(TUMBLE)",
            "(FREEZE)",
            "(THAW)",
            "(MARK)",
            "(UNMARK)",
            "(SLEEP)",
            "(WAKE)",
            "(PING)",
            "(DRIVE 5kn 0deg/s)",
        ]
    ),
)
one_or_more = st.lists(acts, min_size=1, max_size=3)


def order(test: str, done: list[str]) -> str:
    if test:
        return f"(WHEN {test} {' '.join(done)})"
    return done[0] if len(done) == 1 else f"(PROGN {' '.join(done)})"


orders = st.builds(order, tests | st.just(""), one_or_more)
told = orders.map(lambda inside: f"(TELL {inside})") | st.builds(
    order, st.just("(< (DIST x y ,x ,y) 1km)"), one_or_more
).map(lambda inside: f"(TELL `{inside})")
expressions = st.one_of(
    orders,
    tests,
    st.builds(lambda test, done, last: order(test, [*done, last]), tests, st.lists(acts, max_size=2), told),
)


def is_bare(form: Form) -> bool:
    """Whether a test is a name alone, which is taken for a question."""
    return show(form) in ("marked", "frozen", "sleeping")


@given(expressions)
def test_whatever_is_said_comes_back(text: str) -> None:
    form = read(text)
    sentence = to_sentence(form, BRAVO)
    if is_bare(form):
        assert sentence is None
        return
    assert sentence is not None, text
    heard = from_sentence(sentence.text, BRAVO)
    assert heard.unclear == ()
    assert heard.form == form
    assert read(heard.text) == form


IN_GRAMMAR = {
    "bravo": ["scouts within 5 mi of vessel X with more than 50 % fuel and 70 % ordnance join bravo",
              "members of bravo go to vessel X"],
    "flood": ["rescuers within 2 km of the school with more than 50 % battery and 0 kg water join relief",
              "members of relief go to the school",
              "rescuers with exactly 0 kg water and with more than 30 % battery go to the depot"],
    "stop": ["all scouts set stopOrder to TRUE"],
}  # fmt: skip


def test_the_ready_made_commands_of_every_scenario_come_back_where_the_grammar_has_them() -> None:
    said: dict[str, list[str]] = {}
    for name in scenario_names():
        lexicon = lexicon_of(name)
        names = LearnedNames(lexicon.vocabulary)
        for command in find_scenario(name).commands:
            form = read(command.text)
            names.learn(form)
            sentence = to_sentence(form, lexicon)
            if sentence is not None:
                assert from_sentence(sentence.text, lexicon).form == form
                said.setdefault(name, []).append(sentence.text)
    assert {name: said[name] for name in IN_GRAMMAR} == IN_GRAMMAR
    assert sum(map(len, said.values())) >= 16


# ---- anything at all

WORDS = [
    *sorted(RESERVED),
    "scouts",
    "fuel",
    "x",
    "X",
    "bravo",
    "5",
    "50 %",
    "5mi",
    "(",
    ")",
    ",",
    '"',
    "1,000",
    "wander",
    ".",
]


def read_quickly(text: str) -> None:
    began = time.thread_time()
    heard = from_sentence(text, BRAVO)
    assert time.thread_time() - began < LONGEST
    assert (heard.form is None) == bool(heard.unclear)
    assert all(0 <= each.start <= each.end <= len(text) for each in heard.unclear)
    if heard.form is not None:
        assert read(heard.text) == heard.form


@given(st.lists(st.sampled_from(WORDS), max_size=60).map(" ".join))
def test_any_words_are_read_or_told(text: str) -> None:
    read_quickly(text)


@given(st.text(max_size=200))
def test_any_text_is_read_or_told(text: str) -> None:
    read_quickly(text)


@pytest.mark.parametrize(
    "piece", ["(", "not ", "and ", "in ( ", "x, ", "1, ", "robots ", "tell all to ", "fule ", "9", '"']
)
def test_a_long_sentence_takes_no_longer_than_it_is(piece: str) -> None:
    read_quickly(("robots " + piece * MAX_SENTENCE)[:MAX_SENTENCE])


def test_a_sentence_that_is_too_long_is_refused() -> None:
    with pytest.raises(SentenceError, match="at most 2,000"):
        from_sentence("x" * (MAX_SENTENCE + 1), BRAVO)


@given(st.text(alphabet="()'`, abcxy<>=0123456789%\"", max_size=60))
def test_any_expression_is_said_or_not(text: str) -> None:
    try:
        form = read(text)
    except ReadError:
        return
    sentence = to_sentence(form, BRAVO)
    assert sentence is None or from_sentence(sentence.text, BRAVO).form == form


@pytest.mark.parametrize(
    ("sentence", "slip"),
    [
        ("members of brvo sleep", "brvo"),
        ("all scouts in group Barvo leave brvo", "Barvo"),
        ("members of BRAVO sleep", ""),
        ("all scouts join brvo", ""),
        ("members of zulu sleep", ""),
    ],
)
def test_a_group_that_is_probably_a_slip_is_understood_and_doubted(sentence: str, slip: str) -> None:
    heard = from_sentence(sentence, replace(BRAVO, groups=("bravo",)))
    assert heard.text
    found = [sentence[doubt.start : doubt.end] for doubt in heard.doubts]
    assert found[:1] == [slip] * bool(slip)
    assert all("did you mean bravo?" in doubt.message for doubt in heard.doubts)
