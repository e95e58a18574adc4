"""Native code against nodes: random rules of what becomes native code, tick after tick, bit for bit."""

from __future__ import annotations

import math
from random import Random
from unittest.mock import patch

import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from fleet.twins import Twins
from language.cases import SENSORS
from sleepcast.fleet import columns
from sleepcast.fleet.kernels import Kernels, available, translatable

pytestmark = pytest.mark.skipif(not available(), reason="native code needs llvmlite, the extra `fast`")

EXAMPLES = max(100, settings().max_examples // 2)
ROBOTS = 5
NUMBERS = ("0", "-0", "1", "-2", "0.1", "3", "1e308", "1e-320", "0.5", "7.5", "UNKNOWN")
SENSED = (math.nan, 0.0, -0.0, 0.25, 1.0, 3.0, -2.0, 1e300)
FUNCTIONS = (
    ("+", 0, 4), ("-", 1, 3), ("*", 0, 3), ("/", 1, 3), ("MIN", 1, 3), ("MAX", 1, 3), ("ABS", 1, 1), ("SQRT", 1, 1),
    ("DIST", 4, 4), ("CLAMP", 3, 3), ("NOT", 1, 1), ("<", 2, 2), (">=", 1, 3), ("=", 2, 2), (">", 2, 3), ("AND", 0, 3),
    ("OR", 0, 3), ("KNOWN", 1, 1), ("IF", 2, 3), ("WHEN", 1, 3), ("PROGN", 0, 3), ("PROB", 1, 1), ("<=", 2, 2),
)  # fmt: skip


class Writer:
    """Writes rules that become native code."""

    def __init__(self, chance: Random) -> None:
        self.chance = chance

    def expression(self, depth: int, local: tuple[str, ...] = ()) -> str:
        kind = self.chance.randrange(10)
        if depth == 0 or kind < 2:
            names = ("fuel", "x", "y", "sonar1", "id", "v1", "v2", "throttle", "lamp", *local)
            return self.chance.choice(NUMBERS if self.chance.randrange(3) == 0 else names)
        if kind < 4:
            target = self.chance.choice(("v1", "v2", "throttle", "lamp", *local))
            return f"(SETQ {target} {self.expression(depth - 1, local)})"
        if kind == 4:
            return f"(LET ((p {self.expression(depth - 1, local)})) {self.several(1, 2, depth - 1, (*local, 'p'))})"
        if kind == 5:
            clauses = (f"({self.several(1, 2, depth - 1, local)})" for _ in range(self.chance.randint(0, 3)))
            return f"(COND {' '.join(clauses)})"
        name, least, most = self.chance.choice(FUNCTIONS)
        return f"({name} {self.several(least, most, depth - 1, local)})"

    def several(self, least: int, most: int, depth: int, local: tuple[str, ...]) -> str:
        return " ".join(self.expression(depth, local) for _ in range(self.chance.randint(least, most)))


@settings(max_examples=EXAMPLES)
@given(start=st.integers(0, 2**63), chunk=st.sampled_from([2, 3, columns.CHUNK]))
def test_native_code_gives_what_nodes_give(start: int, chunk: int) -> None:
    chance = Random(start)
    writer, twins = Writer(chance), Twins(ROBOTS, seed=start % 1_000)
    kernels = twins.fleet.kernels = twins.fleet.memory.kernels = Kernels(hot=1)
    with patch.object(columns, "CHUNK", chunk), patch.object(columns, "STRETCH", 2 * chunk):
        twins.sense([[chance.choice(SENSED) for _ in SENSORS] for _ in range(ROBOTS)])
        twins.do("(PROGN (DEFVAR v1 x) (DEFVAR v2 1))")
        for name in "ab":
            text = f"(RULE {name} {writer.expression(4)})"
            note(text)
            twins.do(text)
        for _ in range(3):
            kernels.settle()
            twins.sense([[chance.choice(SENSED) for _ in SENSORS] for _ in range(ROBOTS)])
            twins.think()
            twins.compare()


def test_what_people_write_becomes_native_code_and_is_used() -> None:
    twins = Twins(ROBOTS)
    kernels = twins.fleet.kernels = twins.fleet.memory.kernels = Kernels(hot=1)
    twins.sense([[float(i + 1)] * len(SENSORS) for i in range(ROBOTS)])
    twins.do("(RULE r (COND ((AND (< (DIST x y 3 4) 5) (> fuel 50%)) (SETQ lamp (+ x 1))) ((PROB 0.5) (SETQ lamp 0))))")
    twins.think()
    kernels.settle()
    program = twins.views[0]._mind.rules["r"].program
    assert translatable(program)
    plan = kernels.plan(twins.views[0]._mind, twins.fleet.state)
    assert plan is not None
    assert [leg.kernel is not None for leg in plan.legs] == [True]


def test_a_fault_of_one_robot_leaves_nothing_half_done() -> None:
    twins = Twins(ROBOTS)
    kernels = twins.fleet.kernels = twins.fleet.memory.kernels = Kernels(hot=1)
    twins.sense([[float(i)] * len(SENSORS) for i in range(ROBOTS)])
    twins.do("(DEFVAR v1 0)")
    twins.do("(RULE r (PROGN (SETQ v1 (+ v1 1)) (PROB 0.5) (SETQ lamp (/ 1 (- x 3)))))")
    for _ in range(5):
        kernels.settle()
        twins.think()
        twins.compare()
    assert twins.views[3].rules()[0].last_fault == "division by zero in (/ 1 (- x 3))"
