"""Findings are few, short, and made only where they are shown, whatever a text may hold."""

from __future__ import annotations

import pytest

from sleepcast.channel.message import Kind, Message
from sleepcast.core.errors import MAX_LINE, with_caret
from sleepcast.language import CheckError, FreshNames, Vocabulary, check
from sleepcast.language import checker as checkers
from sleepcast.language import program as programs
from sleepcast.language.checker import MAX_FINDINGS
from sleepcast.language.symbols import Declared, Group
from sleepcast.node.node import Node

ROVER = Vocabulary("rover", ())
EACH = 90
"""Arguments that one list may have, and some to spare."""


def many(text: str, count: int) -> str:
    """So many of `text` (`{}` is their number) in lists of lists, as large as a list may be."""
    items = [text.format(i) for i in range(count)]
    while len(items) > EACH:
        items = [f"(+ {' '.join(items[i : i + EACH])})" for i in range(0, len(items), EACH)]
    return f"(+ {' '.join(items)})"


@pytest.mark.parametrize(("text", "severity"), [("(SQRT 1 2)", "error"), ("n{}", "warning"), ("(> 5m 5s)", "warning")])
def test_the_first_findings_are_kept_and_the_others_counted(
    text: str, severity: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    placed: list[str] = []
    place = checkers.placed
    monkeypatch.setattr(checkers, "placed", lambda *given: placed.append(given[0]) or place(*given))
    checked = check(many(text, 1_000), FreshNames(ROVER))
    assert [finding.severity for finding in checked.findings] == [severity] * MAX_FINDINGS
    assert checked.counts[severity] == checked.more + MAX_FINDINGS >= 1_000
    assert len(placed) <= 2 * MAX_FINDINGS


def test_what_matters_most_is_shown_wherever_it_stands() -> None:
    doubt = "(WHEN 1 (> 2 1) 3)"
    checked = check(f"(PROGN {many('n{}', 500)} (> 1m 1s) {doubt})", FreshNames(ROVER))
    assert len(checked.findings) == MAX_FINDINGS
    assert [finding.message for finding in checked.doubts]
    assert len(checked.unknown) == MAX_FINDINGS
    places = [finding.start for finding in checked.findings]
    assert places == sorted(places)


def test_unknown_names_are_known_to_be_so_however_much_else_is_doubted() -> None:
    checked = check(f"(PROGN {'(WHEN (PROB 50) 1)' * 30} zork)", FreshNames(ROVER))
    assert (checked.unknown, len(checked.findings)) == (["zork"], MAX_FINDINGS)


def test_an_answer_of_many_errors_is_short_and_says_how_many_there_are() -> None:
    with pytest.raises(CheckError) as refused:
        check(many("(SQRT 1 2)", 1_000), FreshNames(ROVER)).required()
    assert str(refused.value).endswith("\nand 980 more")
    assert len(str(refused.value)) < MAX_FINDINGS * 4 * MAX_LINE
    robot = Node("r1", ROVER)
    robot.receive(Message("desk", 1, 1, Kind.COMMAND, 0.0, text=many("(SQRT 1 2)", 1_000)))
    robot.think(1, 0.0)
    assert len(str(robot.outbox[0].body["fault"])) < 2 * MAX_LINE


@pytest.mark.parametrize("start", [0, 5, 49, 50, 500, 950, 999])
def test_of_a_long_line_what_stands_around_the_caret_is_shown(start: int) -> None:
    text = "".join(chr(ord("a") + i % 26) for i in range(1_000))
    for before, after in (("", ""), ("first\n", "\nlast")):
        whole = before + text + after
        place = len(before) + start
        message, line, carets = with_caret("no", whole, place, place + 3).split("\n")
        shown = line.strip("… ")
        assert (message, len(shown) <= MAX_LINE, shown in text) == ("no", True, True)
        marked = line[carets.index("^") : carets.rindex("^") + 1]
        assert marked == text[start : start + 3]
        assert line[2] == "…" or shown.startswith(text[:9])
        assert line.endswith("…") or shown.endswith(text[-9:])


@pytest.mark.parametrize(
    ("text", "zero"),
    [
        ("(/ 10 0)", "0"),
        ("(/ 0)", "0"),
        ("(/ 10m 2 0s)", "0s"),
        ("(/ 10 (- 2 2))", "(- 2 2)"),
        ("(MOD 7 0)", "0"),
        ("(MOD 7 (* 3 0))", "(* 3 0)"),
        ("(RULE guard (SETQ throttle (/ 1 0)))", "0"),
        ("(DEFUN inverse (a) (/ a 0))", "0"),
    ],
)
def test_a_division_by_a_constant_zero_is_a_warning(text: str, zero: str) -> None:
    found = [each for each in check(text, FreshNames(ROVER)).findings if "divides by zero" in each.message]
    assert [(each.severity, text[each.start : each.end]) for each in found] == [("warning", zero)]


@pytest.mark.parametrize(
    "text", ["(/ 0 5)", "(MOD 0 5)", "(/ 1 UNKNOWN)", "(/ 1 (RANDOM 0 1))", "(/ 1 (/ 1 0m))", "(LET ((n 0)) (/ 1 n))"]
)
def test_any_other_division_is_not(text: str) -> None:
    outer = [each.message for each in check(text, FreshNames(ROVER)).findings if each.message.startswith("(/ 1 (/")]
    found = [each.message for each in check(text, FreshNames(ROVER)).findings if "divides by zero" in each.message]
    assert found == [] if text != "(/ 1 (/ 1 0m))" else (len(found), outer) == (1, [])


def test_a_short_line_is_shown_whole() -> None:
    assert with_caret("no", "(+ 1 x)", 5, 6) == "no\n  (+ 1 x)\n       ^"


def test_a_robot_suggests_no_names_for_those_it_does_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(checkers, "did_you_mean", lambda name, known: asked.append(name) or "")
    robot = Node("r1", ROVER)
    robot.receive(Message("desk", 1, 1, Kind.COMMAND, 0.0, 9.0, "(RULE near (+ tme 1))"))
    robot.think(1, 0.1)
    assert (robot.outbox[0].body["outcome"], asked) == ("matched", [])
    check("(RULE near (+ tme 1))", FreshNames(ROVER))
    assert asked == ["tme"]


def test_a_text_is_compiled_once_although_it_learns_the_names_of_its_own_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[str] = []
    build = programs.build

    def counting(text: str, *given: object, **options: object) -> object:
        compiled.append(text)
        return build(text, *given, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(programs, "build", counting)
    robot = Node("r1", ROVER)
    robot.receive(Message("desk", 1, 1, Kind.COMMAND, 0.0, 9.0, "(RULE outer (RULE inner (+ tick 1)))"))
    for tick in range(1, 9):
        robot.think(tick, tick / 10)
    assert compiled == ["(RULE outer (RULE inner (+ tick 1)))", "(RULE inner (+ tick 1))", "(+ tick 1)"]


class Grouped(FreshNames):
    """The names of a robot that has heard of groups."""

    def __init__(self, *groups: str) -> None:
        super().__init__(ROVER)
        self._groups = {name.casefold(): Group(name) for name in groups}

    def declared(self, key: str) -> Declared | None:
        return self._groups.get(key)

    def heard(self) -> list[str]:
        return [group.name for group in self._groups.values()]


@pytest.mark.parametrize(
    "text", ["(WHEN (IN brvo) (SLEEP))", "(LEAVE Barvo)", "(RULE r (WHEN (NOT (IN BRAVOO)) (SLEEP)))"]
)
def test_a_group_that_is_probably_a_slip_is_doubted(text: str) -> None:
    """It passed without a word, and nobody obeyed."""
    checked = check(text, Grouped("bravo", "tango"))
    (doubt,) = checked.doubts
    assert doubt.message.startswith("unknown group ")
    assert "did you mean bravo?" in doubt.message.casefold()
    assert checked.unknown == [text[doubt.start : doubt.end]]


@pytest.mark.parametrize(
    "text",
    [
        "(WHEN (IN BRAVO) (SLEEP))",
        "(JOIN brvo)",
        "(WHEN (IN zulu) (SLEEP))",
        "(PROGN (JOIN brvo) (WHEN (IN brvo) (SLEEP)))",
        "(WHEN (IN team2) (SLEEP))",
        "(WHEN (IN southeast) (SLEEP))",
    ],
)
def test_new_groups_are_not(text: str) -> None:
    assert not check(text, Grouped("bravo", "team1", "southwest")).doubts


def test_a_robot_looks_for_no_group_that_may_be_meant(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkers, "slip_of", lambda *given: pytest.fail("it is looked for"))
    node = Node("r1", ROVER)
    for number, text in enumerate(("(JOIN bravo)", "(WHEN (IN brvo) (SLEEP))")):
        node.receive(Message("chief", 1, number, Kind.COMMAND, 0.0, text=text))
        node.think(number, 0.1 * number)
