"""The limits that are too long to write as cases: the deepest chains, and how much one robot may be made to keep."""

from __future__ import annotations

import sys
import time
from functools import cache

import pytest

from language.cases import MACHINES, Machine, NodeMachine, Setting
from language.reference_forms import height
from sleepcast.language.reader import MAX_NESTING, MAX_TEXT, read
from sleepcast.language.vocabulary import (
    BUFFERS,
    MAX_GROUPS,
    MAX_OPERATORS,
    MAX_RULES,
    MAX_USER_VARIABLES,
)

pytestmark = pytest.mark.usefixtures("rules_elsewhere")

MAX_CALLS = 32
MAX_LEVELS = 100
SLOWEST = 1.0
"""Seconds of the processor for the largest text, checked, compiled and evaluated; a slow computer takes a third."""
DEPTHS = 3, MAX_NESTING - 3, 8
"""Levels of each text of a chain: an ordinary run tries each machine and each wrapper with one of the first two."""
WRAPPERS = [
    "(ABS {})", "(+ 0 {})", "(IF 1 {})", "(PROGN {})", "(AND 1 {})", "(OR 0 {})", "(LET () {})", "(LET ((p {})) p)",
    "(COND (0) (1 {}))", "(DICE (1 {}))", "(MAX {} {})", "(KNOWN {})", "(SETQ v {})", "(REPORT {})", "(GIVE {})",
]  # fmt: skip


@cache
def wrapped(text: str, wrapper: str, levels: int) -> str:
    """`text` in as many wrappers as keep to `levels` lists inside one another, the last place of each filled."""
    first, _, last = wrapper.rpartition("{}")
    deeper = first.replace("{}", "1") + text + last
    while height(read(deeper)) <= levels:
        text, deeper = deeper, first.replace("{}", "1") + deeper + last
    return text


def fill_buffers(robot: Machine, wrapper: str, levels: int) -> int:
    """Let each of E1 to E32 evaluate the next in wrappers, E33 be 1; gives the levels of each."""
    robot.evaluate("(DEFVAR v 0)")
    robot.evaluate(f"(SETQQ E{MAX_CALLS + 1} 1)")
    for number in range(MAX_CALLS, 0, -1):
        text = wrapped(f"E{number + 1}", wrapper, levels)
        stored = robot.evaluate(f"(SETQQ E{number} {text})")
        assert not stored.refused
        assert not stored.faults
    return height(read(text))


@pytest.mark.parametrize(
    ("name", "wrapper", "levels"),
    [
        pytest.param(name, wrapper, levels, marks=() if levels == DEPTHS[(i + j) % 2] else pytest.mark.nightly)
        for i, name in enumerate(sorted(MACHINES))
        for j, wrapper in enumerate(WRAPPERS)
        for levels in DEPTHS
    ],
)
def test_the_deepest_chain_of_calls_is_evaluated_and_one_deeper_is_a_fault(
    name: str, wrapper: str, levels: int
) -> None:
    robot = MACHINES[name](Setting())
    each = fill_buffers(robot, wrapper, levels)
    last = MAX_CALLS + 1
    deepest = max(last - MAX_LEVELS // each, 2)
    limit = sys.getrecursionlimit()
    outcome = robot.evaluate(f"E{deepest}")
    assert outcome.value == 1
    assert not outcome.faults
    assert any("nested too deeply" in fault for fault in robot.evaluate(f"E{deepest - 1}").faults)
    assert sys.getrecursionlimit() == limit


@pytest.mark.parametrize("levels", [3, MAX_NESTING - 3])
def test_the_deepest_chain_can_be_explained(levels: int) -> None:
    robot = NodeMachine(Setting())
    each = fill_buffers(robot, "(ABS {})", levels)
    deepest = max(MAX_CALLS + 1 - MAX_LEVELS // each, 2)
    assert robot.evaluate(f"E{deepest}").value == 1
    assert robot.result.explanation.value == 1
    assert f"E{deepest}" in robot.result.explanation.render()


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


UNITS = [
    "1", "x", "(/ x 2)", "(DIST x y 1 2)", "(IF x 1 2)", "(COND (x 1) (2))", "(DICE (x 1))", "(AND x y)", "(SETQ v x)",
    "(LET ((p 1)) p)", "(PRINT 1)", "(TELL (a ,x))", "zork", "(zork)", "(JOIN a)",
]  # fmt: skip
STORING = ["(SETQQ E1 x)", "(DEFUN f (p) p)"]
"""What costs so much that the largest text has no room for as many as fit into it."""
HEADS = "+", "OR", "PROGN"


@pytest.mark.parametrize(
    ("name", "head", "unit"),
    [
        pytest.param(name, head, unit, marks=() if head == HEADS[(i + j) % len(HEADS)] else pytest.mark.nightly)
        for i, name in enumerate(["node", "node-compiled"])
        for j, unit in enumerate(UNITS + STORING)
        for head in HEADS
    ],
)
def test_the_largest_text_is_dealt_with_quickly(name: str, head: str, unit: str) -> None:
    robot = MACHINES[name](Setting(values={"x": 3.0, "y": 4.0}))
    robot.evaluate("(DEFVAR v 0)")
    row = f"({head} {' '.join([unit] * min(90, MAX_TEXT // len(unit) // 4))})"
    text = f"({head} {' '.join([row] * ((MAX_TEXT - 20) // (len(row) + 1)))})"
    assert MAX_TEXT / 2 < len(text) <= MAX_TEXT
    begun = time.process_time()
    assert bool(robot.evaluate(text).refused) is (unit in STORING)
    assert time.process_time() - begun < SLOWEST
