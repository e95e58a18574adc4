"""The classic dialect: its cases in both modes, its bounds, and random text that must do no harm.

`tests/cases/classic.cases` explains the format of the cases. Random well-formed expressions are checked
against a plain evaluator over trees, which knows nothing of shorts in buffers or of a token pointer.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.language.classic import (
    MESSAGES,
    MODES,
    ClassicError,
    ClassicMachine,
    ClassicReadError,
    Mode,
    TranscriptEntry,
    run_transcript,
)
from sleepcast.language.classic_evaluator import (
    ARGUMENTS,
    BUFFER_TOKENS,
    EXPRESSION_NAMES,
    TEXT_CHARACTERS,
    TOKEN_CHARACTERS,
    VARIABLE_NAMES,
    display,
)

CASES = Path(__file__).parent.parent / "cases"
LISTING_A: Mode = "appendix-a"  # its cases are its own: where SETQ sets, the others' are not its
BOUNDED_SECONDS = 5.0  # some ten times what the worst known expression takes on a slow machine


@dataclass
class Case:
    """One line of a case file."""

    line: int
    expression: str
    result: str
    messages: list[str] = field(default_factory=list)
    shown: str | None = None


@dataclass
class Group:
    """The cases of a file that share a machine, in one mode."""

    title: str
    mode: Mode
    cases: list[Case]


def read_case(line: int, text: str) -> Case:
    expression, arrow, rest = text.partition("=>")
    assert arrow, f"line {line} has no '=>': {text}"
    result, *details = rest.split(" ; ")
    case = Case(line, expression.strip(), result.strip())
    for detail in details:
        key, _, value = detail.partition(":")
        match key.strip():
            case "message":
                case.messages.append(value.strip())
            case "shown":
                case.shown = value.strip()
            case other:
                pytest.fail(f"line {line}: a detail is 'message' or 'shown', not {other!r}")
    return case


def read_groups(path: Path) -> Iterator[Group]:
    groups: list[Group] = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        if line.startswith("---"):
            _, which, title = line.split(maxsplit=2)
            yield from groups
            groups = [
                Group(title, mode, []) for mode in MODES if which == mode or (which == "both" and mode != LISTING_A)
            ]
            assert groups, f"line {number}: a group is for both, or one of {MODES}, not {which!r}"
        else:
            for group in groups:
                group.cases.append(read_case(number, line))
    yield from groups


GROUPS = [(path, group) for path in sorted(CASES.glob("*.cases")) if path.stem in MODES for group in read_groups(path)]


@pytest.mark.parametrize(
    ("path", "group"), [pytest.param(path, group, id=f"{group.mode}-{group.title}") for path, group in GROUPS]
)
def test_cases(path: Path, group: Group) -> None:
    machine = ClassicMachine(group.mode)
    for case in group.cases:
        where = f"{path.name}:{case.line}: {case.expression}"
        if case.result.startswith("error:"):
            with pytest.raises(ClassicError) as caught:
                machine.evaluate(case.expression)
            assert case.result.removeprefix("error:").strip() in str(caught.value), where
        else:
            assert machine.evaluate(case.expression) == int(case.result), where
        assert [line.strip() for line in machine.messages] == case.messages, where
        if case.shown is not None:
            assert machine.show(case.expression) == " " + case.shown, where


def test_there_are_cases_for_all_modes() -> None:
    counts = {mode: sum(len(group.cases) for _, group in GROUPS if group.mode == mode) for mode in MODES}
    assert counts.pop(LISTING_A) >= 20
    assert min(counts.values()) > 200


# The original

SESSIONS = (Path(__file__).parent / "classic_sessions.jsonl").read_text(encoding="utf-8").splitlines()


def test_faithful_is_the_original() -> None:
    for number, session in enumerate(SESSIONS, 1):
        follow(session, f"session {number}")


def follow(session: str, where: str) -> None:
    """A session of the original: lists of [text, value, shown, messages, printed, memory].

    The memory is V0 to V5, then E1 to E5 in shorts; null if the input left it as it was.
    """
    machine = ClassicMachine("faithful")
    values, buffers = machine.variables, {name: machine.buffer(name) for name in EXPRESSION_NAMES[1:]}
    for text, value, shown, messages, printed, memory in json.loads(session):
        at = f"{where}: {text}"
        if memory is not None:
            first, *rest = ([int(short) for short in part.split()] for part in memory.split("|"))
            values = dict(zip(VARIABLE_NAMES, first, strict=True))
            buffers = {name: display(tokens).lstrip() for name, tokens in zip(EXPRESSION_NAMES[1:], rest, strict=True)}
        assert machine.evaluate(text) == value, at
        assert machine.show(text) == shown, at
        assert [line for line in machine.messages if line.startswith("eval")] == messages, at
        assert [line for line in machine.messages if not line.startswith("eval")] == printed, at
        assert machine.variables == values, at
        assert {name: machine.buffer(name) for name in buffers} == buffers, at


# The machine's interface


def test_variables_are_a_copy() -> None:
    machine = ClassicMachine()
    assert machine.variables == {"V0": 30, "V1": 31, "V2": 32, "V3": 33, "V4": 34, "V5": 35}
    machine.variables["V0"] = 99
    assert machine.evaluate("V0") == 30
    machine.evaluate("(SETQ V0 -1)")
    assert machine.variables["V0"] == -1


def test_a_buffer_reads_back() -> None:
    machine = ClassicMachine()
    machine.evaluate("(SETQQ E2 (cond((- v0 1)99)(0)))")
    assert machine.buffer("e2") == "(COND ((- V0 1) 99) (0))"
    assert machine.buffer("E1") == "125"
    assert machine.buffer("E5") == ""
    assert machine.show(machine.buffer("E2")) == " " + machine.buffer("E2")
    with pytest.raises(ClassicError, match="no buffer 'E6'"):
        machine.buffer("E6")


def test_the_original_prints_a_blank_first_but_not_before_a_closing_parenthesis() -> None:
    machine = ClassicMachine()
    assert machine.show("(+ 1 (- 2))") == " (+ 1 (- 2))"
    assert machine.show(")") == ")"
    assert machine.show("") == ""


def test_what_is_said_is_told_at_once_and_kept_until_the_next_evaluation() -> None:
    said: list[str] = []
    machine = ClassicMachine(say=said.append)
    machine.evaluate("(+ (PRINT V0) fuel)")
    expected = ["V0 = 30", "eval() found BAD without '('"]
    assert said == machine.messages == expected
    machine.evaluate("1")
    assert machine.messages == []
    assert said == expected
    with pytest.raises(ClassicError):
        machine.evaluate("(+ fuel (/ 1 0))")
    assert machine.messages == ["eval() found BAD without '('"]
    with pytest.raises(ClassicError):
        machine.evaluate("")
    assert machine.messages == []


def test_errors_are_the_projects_own_and_tell_unreadable_text_from_the_rest() -> None:
    machine = ClassicMachine()
    with pytest.raises(ClassicReadError) as unreadable:
        machine.evaluate("(+ 1 30500)")
    with pytest.raises(ClassicError) as crashed:
        machine.evaluate("(+ 1 (/ 4 0))")
    assert isinstance(unreadable.value, SleepcastError)
    assert unreadable.value.exit_status == 2
    assert crashed.value.exit_status == 1
    assert str(unreadable.value).startswith("30500 at character 6 reads as variable 500, and there are only 6")
    assert str(crashed.value).startswith("4 divided by 0 in E0 at token 5")


def test_text_that_cannot_be_stored_leaves_the_message_buffer_alone() -> None:
    machine = ClassicMachine()
    machine.evaluate("(+ 1 2)")
    with pytest.raises(ClassicReadError):
        machine.evaluate("(+ 1 (")
    assert machine.buffer("E0") == "(+ 1 2)"


def test_another_mode_is_refused() -> None:
    with pytest.raises(MisuseError, match="'Classic'"):
        ClassicMachine("Classic")  # type: ignore[arg-type]


# Bounds


@pytest.mark.parametrize("mode", MODES)
def test_a_buffer_holds_225_tokens(mode: Mode) -> None:
    machine = ClassicMachine(mode)
    full = "(COND" + "(0)" * 73 + "(7)" + ")"
    assert len(re.findall(r"[()]|\w+", full)) == BUFFER_TOKENS
    assert machine.evaluate(full) == 7
    with pytest.raises(ClassicReadError, match="more than 225 tokens"):
        machine.evaluate(full + "1")
    assert machine.evaluate("1") == 1


def test_a_token_has_24_characters() -> None:
    machine = ClassicMachine()
    assert machine.evaluate("0" * (TOKEN_CHARACTERS - 1) + "5") == 5
    with pytest.raises(ClassicReadError, match="25 characters"):
        machine.show("0" * TOKEN_CHARACTERS + "5")


def test_a_message_has_a_bounded_length() -> None:
    machine = ClassicMachine()
    assert machine.evaluate(" " * (TEXT_CHARACTERS - 1) + "5") == 5
    with pytest.raises(ClassicReadError, match=f"{TEXT_CHARACTERS + 1} characters"):
        machine.evaluate(" " * TEXT_CHARACTERS + "5")


@pytest.mark.parametrize("mode", MODES)
def test_a_function_takes_100_arguments(mode: Mode) -> None:
    machine = ClassicMachine(mode)
    assert machine.evaluate("(+" + " 1" * ARGUMENTS + ")") == 100
    assert machine.messages == []
    assert machine.evaluate("(+" + " 1" * (ARGUMENTS + 1) + ")") == 0
    assert machine.messages == ["eval numArgs > 100"]


def test_after_too_many_arguments_the_caller_goes_on_by_mode() -> None:
    expression = "(+ 5 (+" + " 1" * (ARGUMENTS + 3) + ") 7)"
    assert ClassicMachine("classic").evaluate(expression) == 12
    assert ClassicMachine("faithful").evaluate(expression) == 7  # 5, 0, and the last two of the ones


@pytest.mark.parametrize("mode", MODES)
def test_deep_nesting_within_a_message_is_no_problem(mode: Mode) -> None:
    machine = ClassicMachine(mode)
    for buffer in range(1, 6):
        inner = f"E{buffer - 1}" if buffer > 1 else "1"
        machine.evaluate(f"(SETQQ E{buffer} {'(- ' * 73}{inner}{')' * 73})")
    assert machine.evaluate("E5") == -1


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("rules", "words"),
    [
        (["(SETQQ E2 (+ E2 E2))"], "names itself"),
        (["(SETQQ E2 (COND (1 E2)))"], "names itself"),
        ([f"(SETQQ E{i} (+{f' E{i - 1}' * 100}))" for i in (2, 3, 4, 5)], "more than 100000 expressions"),
        (
            [
                f"(SETQQ E2 {'(+ ' * 73}1{')' * 73})",
                *(f"(SETQQ E{i} (+{f' E{i - 1}' * 100}))" for i in (3, 4, 5)),
            ],
            "more than 100000 expressions",
        ),
        (
            ["(SETQQ E2 (PRINT))", *(f"(SETQQ E{i} (+{f' E{i - 1}' * 100}))" for i in (3, 4, 5))],
            f"more than {MESSAGES} lines",
        ),
    ],
    ids=["itself", "itself in COND", "powers of 100", "powers of 100 of nests", "print"],
)
def test_no_rule_base_keeps_the_machine_busy(mode: Mode, rules: list[str], words: str) -> None:
    machine = ClassicMachine(mode)
    for rule in rules:
        assert machine.evaluate(rule) == 0
    start = time.process_time()
    with pytest.raises(ClassicError, match=words):
        machine.evaluate("E2" if len(rules) == 1 else "E5")
    assert time.process_time() - start < BOUNDED_SECONDS
    assert machine.evaluate("(+ 1 2)") == 3


# The interactive program


def entries(text: str, mode: Mode = "classic") -> list[TranscriptEntry]:
    return list(run_transcript(text, ClassicMachine(mode)))


def test_a_transcript_of_the_interactive_program() -> None:
    typed = "(setqq e2 (+ v0 v1)) @\nE2 @\n(SETQ V0\n\t100)@ E2@(+ E2 E2) @ $ (never read) @"
    found = entries(typed)
    assert [entry.value for entry in found] == [0, 61, 100, 131, 262]
    assert found[0] == TranscriptEntry("(setqq e2 (+ v0 v1))", " (SETQQ E2 (+ V0 V1))", (), 0, None)
    assert found[2].text == "(SETQ V0\n\t100)"
    assert found[2].shown == " (SETQ V0 100)"


def test_a_transcript_in_both_modes() -> None:
    typed = "(COND ((AND 1 0) 99) ((AND 1 1) 88)) @ $"
    assert entries(typed) == [TranscriptEntry(typed[:-4], " " + typed[:-4], (), 88, None)]
    said = ("eval(COND ) found COND instead of '('",)
    assert entries(typed, "faithful") == [TranscriptEntry(typed[:-4], " " + typed[:-4], said, 0, None)]


def test_a_transcript_goes_on_after_an_error() -> None:
    crashed, unreadable, empty, sound = entries("(+ fuel (/ 4 0)) @ (+ 1 30500) @ @ (+ 1 2) @ $")
    assert crashed.value is None
    assert crashed.shown == " (+ BAD (/ 4 0))"
    assert crashed.messages == ("eval() found BAD without '('",)
    assert "divided by 0" in str(crashed.error)
    assert (unreadable.shown, unreadable.messages, unreadable.value) == ("", (), None)
    assert "variable 500" in str(unreadable.error)
    assert "empty" in str(empty.error)
    assert (sound.value, sound.error) == (3, None)


def test_a_transcript_without_its_last_marks() -> None:
    assert [entry.value for entry in entries("1 @ 2 @ \n")] == [1, 2]
    assert entries(" \n$") == entries("") == []
    first, last = entries("1 @ (SETQ V0 5) $")
    assert first.value == 1
    assert last.text == "(SETQ V0 5)"
    assert last.value is None
    assert "no '@'" in str(last.error)


def test_a_transcript_is_evaluated_as_it_is_read() -> None:
    machine = ClassicMachine()
    transcript = run_transcript("(SETQ V0 1) @ (SETQ V0 2) @ $", machine)
    next(transcript)
    assert machine.variables["V0"] == 1


# Properties

WORDS = [
    *"()()()()()+-*/",
    "SETQ",
    "COND",
    "AND",
    "OR",
    "BAD",
    "SETQQ",
    "PRINT",
    "0",
    "1",
    "-1",
    "7",
    "32767",
]
WORDS += [f"{kind}{i}" for kind in "VE" for i in range(7)] + [
    "30001",
    "31002",
    "32000",
    "32001",
    "32100",
    "@",
]
Tree = int | str | tuple["Tree", ...]


def outcome(machine: ClassicMachine, text: str) -> int | ClassicError:
    """The value of `text`, or the one kind of exception that there may be instead."""
    try:
        return machine.evaluate(text)
    except ClassicError as error:
        return error


@given(st.sampled_from(MODES), st.lists(st.one_of(st.lists(st.sampled_from(WORDS)).map(" ".join), st.text())))
def test_any_text_gives_a_short_or_a_classic_error(mode: Mode, texts: list[str]) -> None:
    machine = ClassicMachine(mode)
    start = time.process_time()
    for text in texts:
        value = outcome(machine, text)
        if isinstance(value, int):
            assert -0x8000 <= value <= 0x7FFF
            shown = machine.show(text)
            assert machine.show(shown) == shown
        else:
            assert str(value)
    assert time.process_time() - start < BOUNDED_SECONDS * (len(texts) + 1)
    assert machine.evaluate("(+ 1 2)") == 3


@given(st.sampled_from(MODES), st.text())
def test_any_text_is_a_transcript(mode: Mode, text: str) -> None:
    for entry in entries(text, mode):
        assert (entry.value is None) == (entry.error is not None)


def trees(*, with_cond: bool) -> st.SearchStrategy[Tree]:
    def lists(children: st.SearchStrategy[Tree]) -> st.SearchStrategy[Tree]:
        some = st.lists(children, min_size=1, max_size=4)
        calls = st.builds(lambda name, rest: (name, *rest), st.sampled_from(["+", "-", "*", "AND", "OR"]), some)
        pairs = st.lists(st.tuples(st.sampled_from(["V0", "V1", "V5"]), children), min_size=1, max_size=3)
        setqs = pairs.map(lambda some: ("SETQ", *(part for pair in some for part in pair)))
        conds = st.lists(some.map(tuple), max_size=4).map(lambda clauses: ("COND", *clauses))
        return st.one_of(calls, setqs, conds) if with_cond else st.one_of(calls, setqs)

    atoms = st.one_of(st.integers(-32768, 29999), st.integers(0, 1), st.sampled_from(["V0", "V1", "V5"]))
    return st.recursive(atoms, lists, max_leaves=25)


def written(tree: Tree) -> str:
    return "(" + " ".join(map(written, tree)) + ")" if isinstance(tree, tuple) else str(tree)


def wrapped(value: int) -> int:
    return (value + 32768) % 65536 - 32768


def value_of(tree: Tree, variables: dict[str, int]) -> int:
    """What a tree means, said as plainly as possible."""
    if isinstance(tree, int):
        return tree
    if isinstance(tree, str):
        return variables[tree]
    name, *rest = tree
    if name == "COND":
        for clause in rest:
            assert isinstance(clause, tuple)
            value = value_of(clause[0], variables)
            if value != 0:
                for part in clause[1:]:
                    value = value_of(part, variables)
                return value
        return 0
    if name == "SETQ":
        for target, source in zip(rest[::2], rest[1::2], strict=True):
            assert isinstance(target, str)
            value = variables[target] = value_of(source, variables)
        return value
    if name in ("AND", "OR"):
        for part in rest:
            value = value_of(part, variables)
            if bool(value) == (name == "OR"):
                break
        return value
    values = [value_of(part, variables) for part in rest]
    match name:
        case "+":
            return wrapped(sum(values))
        case "-":
            return wrapped(values[0] - sum(values[1:]) if len(values) > 1 else -values[0])
    product = 1
    for value in values:
        product *= value
    return wrapped(product)


def agrees(machine: ClassicMachine, tree: Tree) -> None:
    text = written(tree)
    variables = machine.variables
    value = outcome(machine, text)
    if isinstance(value, ClassicError):
        assert "225 tokens" in str(value), text
        return
    assert value == value_of(tree, variables), text
    assert machine.variables == variables, text
    assert machine.messages == [], text
    assert machine.show(text) == " " + text


@given(trees(with_cond=True))
def test_the_default_mode_means_what_the_tree_means(tree: Tree) -> None:
    agrees(ClassicMachine(), tree)


@given(trees(with_cond=False))
def test_without_cond_and_errors_the_original_was_right(tree: Tree) -> None:
    agrees(ClassicMachine("faithful"), tree)


@given(st.integers(), st.integers())
def test_division_truncates_as_in_c(left: int, right: int) -> None:
    left, right = wrapped(left), wrapped(right)
    machine = ClassicMachine()
    # Made of two halves, since a literal cannot be more than 29999.
    text = f"(/ (+ {left // 2} {left - left // 2}) (+ {right // 2} {right - right // 2}))"
    if right == 0:
        with pytest.raises(ClassicError, match="divided by 0"):
            machine.evaluate(text)
        return
    quotient = machine.evaluate(text)
    exact = abs(left) // abs(right) * (1 if left * right >= 0 else -1)
    assert quotient == wrapped(exact)
