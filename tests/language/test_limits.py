"""The limits that are too long to write as cases: the deepest chains, and how much one robot may be made to keep."""

from __future__ import annotations

import sys

import pytest

from language.cases import MACHINES, NodeMachine, Setting
from sleepcast.language.reader import MAX_NESTING
from sleepcast.language.vocabulary import (
    BUFFERS,
    MAX_GROUPS,
    MAX_OPERATORS,
    MAX_RULES,
    MAX_USER_VARIABLES,
)

MAX_CALLS = 32
WRAPPERS = [
    "(ABS {})", "(+ 0 {})", "(IF 1 {})", "(PROGN {})", "(AND 1 {})", "(OR 0 {})", "(LET () {})", "(LET ((p {})) p)",
    "(COND (0) (1 {}))", "(DICE (1 {}))", "(MAX {} {})", "(KNOWN {})", "(SETQ v {})", "(REPORT {})", "(GIVE {})",
]  # fmt: skip


def wrapped(text: str, wrapper: str) -> str:
    """`text` in as many wrappers as the reader lets through, the last place of each filled."""
    first, _, last = wrapper.rpartition("{}")
    deep = wrapper.count("(") if wrapper.startswith(("(COND", "(DICE", "(LET ((")) else 1
    for _ in range((MAX_NESTING - 3) // deep):
        text = first.replace("{}", "1") + text + last
    return text


@pytest.mark.parametrize("wrapper", WRAPPERS)
@pytest.mark.parametrize("name", sorted(MACHINES))
def test_the_deepest_chain_of_the_deepest_expressions_is_evaluated(name: str, wrapper: str) -> None:
    robot = MACHINES[name](Setting())
    robot.evaluate("(DEFVAR v 0)")
    robot.evaluate(f"(SETQQ E{MAX_CALLS + 1} 1)")
    for number in range(MAX_CALLS, 0, -1):
        stored = robot.evaluate(f"(SETQQ E{number} {wrapped(f'E{number + 1}', wrapper)})")
        assert not stored.refused
        assert not stored.faults
    limit = sys.getrecursionlimit()
    assert robot.evaluate("E2").value == 1
    assert not robot.evaluate("E2").faults
    assert any("nested too deeply" in fault for fault in robot.evaluate("E1").faults)
    assert sys.getrecursionlimit() == limit


def test_the_deepest_chain_can_be_explained() -> None:
    robot = NodeMachine(Setting())
    robot.evaluate(f"(SETQQ E{MAX_CALLS} 1)")
    for number in range(MAX_CALLS - 1, 0, -1):
        robot.evaluate(f"(SETQQ E{number} {wrapped(f'E{number + 1}', '(ABS {})')})")
    assert robot.evaluate("E1").value == 1
    assert robot.result.explanation.value == 1
    assert "E1" in robot.result.explanation.render()


@pytest.mark.parametrize(
    ("most", "text", "what"),
    [
        (MAX_RULES, "(RULE n{} 1)", "rule"),
        (MAX_OPERATORS, "(DEFUN n{} () 1)", "operator"),
        (MAX_GROUPS, "(JOIN n{})", "group"),
        (MAX_USER_VARIABLES, "(DEFVAR n{} 1)", "user variable"),
    ],
)
def test_what_one_robot_keeps_is_bounded(most: int, text: str, what: str) -> None:
    robot = NodeMachine(Setting())
    for i in range(most):
        kept = robot.evaluate(text.format(i))
        assert kept.value == 1, kept
    before = robot.state()
    past = robot.evaluate(text.format(most))
    said = past.refused or "; ".join(past.faults)
    assert "no room" in said
    assert what in said
    assert str(most) in said
    assert robot.state() == before
    assert robot.evaluate(text.format(0)).value == 1


def test_every_buffer_can_be_filled_and_used() -> None:
    robot = NodeMachine(Setting())
    for number in range(1, BUFFERS):
        assert robot.evaluate(f"(RULE E{number} (* 2 {number}))").value == 1
    assert all(robot.evaluate(f"E{number}").value == 2 * number for number in range(1, BUFFERS))
    assert all(robot.evaluate(f"active{number}").value == 1 for number in range(1, BUFFERS))


def test_more_faults_than_are_kept_end_no_evaluation() -> None:
    robot = NodeMachine(Setting())
    outcome = robot.evaluate("(PROGN (DOTIMES (i 1000) (/ 1 0)) 7)")
    assert outcome.value == 7
    assert 0 < len(outcome.faults) <= 1000
    assert set(outcome.faults) == {"division by zero"}
