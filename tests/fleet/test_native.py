"""Native code against nodes: random rules of what becomes native code, tick after tick, bit for bit."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from random import Random
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from fleet.twins import Twins
from language.cases import SENSORS
from sleepcast.core.threads import ThreadPool
from sleepcast.fleet import evaluation, state
from sleepcast.fleet.native import compiler, kernels
from sleepcast.fleet.native.formulas import FORMULAS
from sleepcast.fleet.native.kernels import Kernels, available, translatable

pytestmark = [
    pytest.mark.skipif(not available(), reason="native code needs llvmlite, the extra `fast`"),
    pytest.mark.usefixtures("rules_elsewhere"),
]

EXAMPLES = max(20, settings().max_examples // 2)
ROBOTS = compiler.LANES + 1
NUMBERS = ("0", "-0", "1", "-2", "0.1", "3", "1e308", "1e-320", "0.5", "7.5", "UNKNOWN", "-100", "1e6")
SENSED = (math.nan, 0.0, -0.0, 0.25, 1.0, 3.0, -2.0, 1e300, 6.5, -1e-310)
FUNCTIONS = (
    ("+", 0, 4), ("-", 1, 3), ("*", 0, 3), ("/", 1, 3), ("MIN", 1, 3), ("MAX", 1, 3), ("ABS", 1, 1), ("SQRT", 1, 1),
    ("DIST", 4, 4), ("CLAMP", 3, 3), ("NOT", 1, 1), ("<", 2, 2), (">=", 1, 3), ("=", 2, 2), (">", 2, 3), ("AND", 0, 3),
    ("OR", 0, 3), ("KNOWN", 1, 1), ("IF", 2, 3), ("WHEN", 1, 3), ("PROGN", 0, 3), ("PROB", 1, 1), ("<=", 2, 2),
    ("SIN", 1, 1), ("COS", 1, 1), ("TAN", 1, 1), ("EXP", 1, 1), ("LOG", 1, 1), ("ATAN2", 2, 2), ("BEARING", 4, 4),
    ("WRAP", 1, 1), ("MOD", 2, 2), ("^", 2, 2), ("FLOOR", 1, 1), ("CEIL", 1, 1), ("ROUND", 1, 1), ("/=", 1, 4),
    ("RANDOM", 2, 2), ("GAUSS", 2, 2), ("MARK", 0, 0), ("UNMARK", 0, 0), ("E1", 0, 0), ("twice", 1, 1),
)  # fmt: skip


class Writer:
    """Writes rules that become native code; now and then with something in them that has to be walked."""

    def __init__(self, chance: Random) -> None:
        self.chance = chance

    def expression(self, depth: int, local: tuple[str, ...] = ()) -> str:
        kind = self.chance.randrange(12)
        if depth == 0 or kind < 2:
            names = ("fuel", "x", "y", "sonar1", "id", "v1", "v2", "throttle", "lamp", "time", "tick", "marked", *local)
            return self.chance.choice(NUMBERS if self.chance.randrange(3) == 0 else names)
        if kind < 4:
            target = self.chance.choice(("v1", "v2", "throttle", "lamp", "marking", *(n for n in local if n != "i")))
            return f"(SETQ {target} {self.expression(depth - 1, local)})"
        if kind == 4:
            return f"(LET ((p {self.expression(depth - 1, local)})) {self.several(1, 2, depth - 1, (*local, 'p'))})"
        if kind == 5:
            clauses = (f"({self.several(1, 2, depth - 1, local)})" for _ in range(self.chance.randint(0, 3)))
            return f"(COND {' '.join(clauses)})"
        if kind == 6 and self.chance.random() < 0.4:
            return self.seldom(depth, local)
        name, least, most = self.chance.choice(FUNCTIONS)
        if name == "E1":
            return name
        return f"({name} {self.several(least, most, depth - 1, local)})"

    def seldom(self, depth: int, local: tuple[str, ...]) -> str:
        kind = self.chance.randrange(6)
        if kind == 0:
            sides = (f"(0.{self.chance.randrange(9)} {self.expression(depth - 1, local)})" for _ in range(2))
            return f"(DICE {' '.join(sides)})"
        if kind == 1:
            return f"(DOTIMES (i {self.chance.randrange(4)}) {self.expression(depth - 1, (*local, 'i'))})"
        return ("(IN bravo)", '(REPORT "a" x)', "(DEFVAR v3 x)", "(IF (> x 1) (JOIN bravo) (LEAVE bravo))")[kind - 2]

    def several(self, least: int, most: int, depth: int, local: tuple[str, ...]) -> str:
        return " ".join(self.expression(depth, local) for _ in range(self.chance.randint(least, most)))


def sensed(chance: Random, robots: int = ROBOTS) -> list[list[float]]:
    return [[chance.choice(SENSED) for _ in SENSORS] for _ in range(robots)]


def forced(twins: Twins, threads: int = 2) -> Kernels:
    """Let the fleet of the twins make native code of everything at once."""
    made = twins.fleet.kernels = twins.fleet.memory.kernels = Kernels(hot=0, pool=ThreadPool(threads))
    return made


@settings(max_examples=EXAMPLES)
@given(start=st.integers(0, 2**63), lanes=st.sampled_from([1, compiler.LANES]))
def test_native_code_gives_what_nodes_give(start: int, lanes: int) -> None:
    chance = Random(start)
    writer, twins = Writer(chance), Twins(ROBOTS, seed=start % 1_000)
    made = forced(twins)
    with patch.object(kernels, "LANES", lanes), patch.object(compiler, "SPLIT", chance.choice((1, compiler.SPLIT))):
        twins.sense(sensed(chance))
        twins.do("(PROGN (DEFVAR v1 x) (DEFVAR v2 1) (DEFUN twice (a) (* 2 a)) (WHEN (> x 0) (JOIN bravo)))")
        buffer = writer.expression(2).replace("E1", "v1")
        note(buffer)
        twins.do(f"(SETQQ E1 {buffer})")
        for name in "abc":
            text = f"(RULE {name} {writer.expression(4)})"
            some = sorted(chance.sample(range(ROBOTS), ROBOTS // 2)) if chance.random() < 0.2 else None
            note(f"{some}: {text}")
            twins.do(text, some)
            made.settle()
        for _ in range(3):
            made.settle()
            twins.sense(sensed(chance))
            twins.think(robots=None if chance.random() < 0.8 else [0, 3, 4])
            twins.compare()


def test_every_function_of_numbers_gives_the_same_bits() -> None:
    """Over numbers of all sizes, in all lanes at once."""
    chance = Random(7)
    robots = 200
    twins = Twins(robots)
    made = forced(twins)
    for name, function in sorted((name, Writer(chance)) for name in FORMULAS):
        count = {"DIST": 4, "BEARING": 4, "CLAMP": 3, "+": 3, "-": 2, "*": 3, "/": 2, "MIN": 3, "MAX": 3, "MOD": 2}.get(
            name
        )
        count = count or (2 if name in ("^", "ATAN2") else 1)
        assert function is not None
        arguments = " ".join(("x", "y", "speed", "sonar2")[:count])
        twins.do(f"(RULE r (SETQ lamp ({name} {arguments})))")
        for size in (1.0, 1e-3, 10.0, 1e6, 1e18, 1e-310):
            twins.sense([[chance.uniform(-size, size) for _ in SENSORS] for _ in range(robots)])
            twins.think()
            made.settle()
        twins.compare()


FORMS = (
    "(GAUSS x (ABS y))", "(GAUSS 0 1)", "(GAUSS 1 x)", "(GAUSS UNKNOWN 1)", "(RANDOM x y)", "(RANDOM 1 UNKNOWN)",
    "(PROB x)", "(PROB UNKNOWN)", "(DICE (x 1) (0.3 (RANDOM 0 1)) (y 2))", "(DICE (0.1 UNKNOWN) (fuel (SETQ v1 3)))",
    "(DOTIMES (i 5) (SETQ v1 (+ v1 (* i (RANDOM 0 1)))))", "(LET ((a x) (b y)) (DOTIMES (i 3) (SETQ a (+ a b i))) a)",
    "(IF (IN bravo) (MARK) (UNMARK))", "(SETQ marking x)", "(AND x (SETQ v1 1) (OR y 3) (SETQ v1 2))", "(/= x y 1)",
    "(OR x UNKNOWN y)", "(COND (x) ((> y 0) (RANDOM 0 1) 5) (UNKNOWN 3) (1 (PROB 0.5)))", "(twice (RANDOM x 2))",
    "(LET ((a E2)) (IF (> a 0.5) (twice a) E2))", "(WHEN (> x 0) (DEFVAR v1 7) (DEFVAR v9 x))", "(SLEEP)",
    "(PROGN (SETQ lamp x) (SETQ throttle (/ 1 y)) (SETQ lamp (SQRT fuel)))", "(MOD x y)", "(WRAP (* 100 x))",
    "(IF (< x 1) (SETQ active3 1) 4)", "(IF UNKNOWN 1)", "(CLAMP x y 2)", "(DOTIMES (i 0) (TELL 1))",
)  # fmt: skip


@pytest.mark.parametrize("lanes", [1, compiler.LANES])
def test_every_form_gives_the_same_and_draws_as_often(lanes: int) -> None:
    chance = Random(11)
    with patch.object(kernels, "LANES", lanes):
        for form in FORMS:
            twins = Twins(2 * ROBOTS, seed=3)
            forced(twins)
            twins.do("(PROGN (DEFVAR v1 0.5) (DEFVAR v2 1) (DEFUN twice (a) (* 2 a)) (SETQQ E2 (RANDOM 0 1)))")
            twins.sense(sensed(chance, 2 * ROBOTS))
            twins.do("(WHEN (> x 0) (JOIN bravo))")
            twins.do(f"(RULE r (PROGN (SETQ v2 {form}) (SETQ v2 (RANDOM 0 1))))")
            for _ in range(3):
                twins.sense(sensed(chance, 2 * ROBOTS))
                twins.think()
                twins.compare()
            assert any(
                leg.kernel for leg in twins.fleet.memory.kernels.plan(twins.views[0]._mind, twins.fleet.state).legs
            )


@pytest.mark.parametrize("some", [None, range(5, 200, 2)])
def test_threads_share_robots_and_none_is_evaluated_twice(some: Sequence[int] | None) -> None:
    chance = Random(5)
    robots = 3 * compiler.GRAIN + 11
    twins = Twins(robots, seed=4)
    forced(twins, threads=3)
    twins.do("(PROGN (DEFVAR v1 0) (DEFVAR v2 0))")
    twins.do("(RULE r (PROGN (SETQ v1 (+ v1 1)) (WHEN (> x 0) (SETQ v2 (RANDOM 0 1)) (SETQ lamp (/ v2 (- y 1))))))")
    with patch.object(compiler, "SPLIT", 1):
        for _ in range(20):
            twins.sense([[chance.choice((1.0, chance.uniform(-1, 2))) for _ in SENSORS] for _ in range(robots)])
            twins.think(robots=some)
    twins.compare()


def test_what_people_write_becomes_native_code_and_is_used() -> None:
    twins = Twins(ROBOTS)
    made = forced(twins)
    twins.sense([[float(i + 1)] * len(SENSORS) for i in range(ROBOTS)])
    twins.do("(RULE r (COND ((AND (< (DIST x y 3 4) 5) (> fuel 50%)) (SETQ lamp (+ x 1))) ((PROB 0.5) (SETQ lamp 0))))")
    twins.do('(RULE s (REPORT "here" x))')
    twins.do("(RULE t (SETQ throttle (SIN x)))")
    twins.think()
    made.settle()
    mind, state = twins.views[0]._mind, twins.fleet.state
    plan = made.plan(mind, state)
    assert plan is not None
    assert [(leg.rules, leg.kernel is not None) for leg in plan.legs] == [(1, True), (1, False), (1, True)]
    assert translatable(mind.rules["r"].program)
    assert not translatable(mind.rules["s"].program)
    twins.think()
    twins.compare()


def test_only_robots_that_meet_a_fault_are_walked() -> None:
    twins = Twins(ROBOTS)
    made = forced(twins)
    twins.sense([[float(i)] * len(SENSORS) for i in range(ROBOTS)])
    twins.do("(DEFVAR v1 0)")
    twins.do("(RULE r (PROGN (SETQ v1 (+ v1 1)) (PROB 0.5) (SETQ lamp (/ 1 (- x 3)))))")
    made.settle()
    walked = []
    evaluate = Kernels.evaluate

    def watching(self: Kernels, *given: object) -> state.Rows:
        left = evaluate(self, *given)  # type: ignore[arg-type]
        walked.append(left.robots.tolist())
        return left

    with patch.object(Kernels, "evaluate", watching):
        for _ in range(5):
            twins.think()
            twins.compare()
    assert walked == [[3]] * 5
    assert twins.views[3].rules()[0].last_fault == "division by zero in (/ 1 (- x 3))"


def test_a_new_rule_is_walked_beside_the_native_code_of_the_others() -> None:
    twins = Twins(ROBOTS)
    made = forced(twins)
    twins.sense([[float(i)] * len(SENSORS) for i in range(ROBOTS)])
    for i in range(4):
        twins.do(f"(RULE r{i} (SETQ lamp (+ x {i})))")
        made.settle()
    made._hot = 1_000
    twins.do("(RULE new (SETQ lamp (IF (KNOWN lamp) (* 2 lamp) 1)))")
    plan = made.plan(twins.views[0]._mind, twins.fleet.state)
    assert plan is not None
    assert [(leg.rules, leg.kernel is not None) for leg in plan.legs] == [(4, True), (1, False)]
    for robots in (None, [1, 2], None):
        twins.think(robots=robots)
        twins.compare()


def test_robots_with_rules_of_their_own_stay_native() -> None:
    """Also when only some of them think."""
    twins = Twins(ROBOTS)
    made = forced(twins)
    twins.sense([[float(i)] * len(SENSORS) for i in range(ROBOTS)])
    for i in range(3):
        twins.do(f"(WHEN (= (MOD id 3) {i}) (RULE r{i} (SETQ lamp (+ x {i}))))")
    twins.think(2)
    made.settle()
    with patch("sleepcast.fleet.scheduler.walk_through", side_effect=AssertionError("a robot has walked")):
        for robots in (None, [0, 2, 5], None):
            twins.think(robots=robots)
    twins.compare()


def test_a_thousand_matches_are_all_counted() -> None:
    twins = Twins(ROBOTS)
    made = forced(twins)
    twins.sense([[float(i)] * len(SENSORS) for i in range(ROBOTS)])
    twins.do("(RULE r (WHEN (> x 2) (SETQ lamp x)))")
    made.settle()
    with patch.object(evaluation, "MAX_FRESH", 7), patch.object(evaluation, "NARROW", 250):
        for tick in range(300):
            twins.think()
            if tick == 40:
                twins.compare()
                assert twins.fleet.memory.statistics["r"].firings.dtype == np.uint16
    assert twins.fleet.memory.statistics["r"].firings.dtype == np.uint32
    twins.compare()
    assert twins.views[3].rules()[0].firings == 301


def test_a_text_that_is_asked_again_and_again_becomes_native() -> None:
    twins = Twins(ROBOTS)
    made = forced(twins)
    twins.sense([[float(i - 4), 0.5, float(i - 4), *[1.0] * (len(SENSORS) - 3)] for i in range(ROBOTS)])
    text = "(AND (> (SQRT x) 1) (SETQ lamp x))"
    found = []
    for _ in range(3):
        (outcome,) = twins.fleet.evaluate(text)
        made.settle()
        faults = [(noted.reason, noted.robots.tolist()) for noted in outcome.faults]
        found.append(
            (list(map(float.hex, outcome.values.tolist())), outcome.matched.tolist(), outcome.steps.tolist(), faults)
        )
    assert found[0] == found[1] == found[2]
    assert found[0][3]


KEPT = """
from fleet.test_native import SENSORS, forced
from fleet.twins import Twins
from sleepcast.fleet.native import compiler

made = []
optimised = compiler._optimised
compiler._optimised = lambda *given: made.append(1) or optimised(*given)
twins = Twins(9)
kernels = forced(twins)
twins.sense([[float(i)] * len(SENSORS) for i in range(9)])
twins.do("(RULE r (PROGN (SETQ throttle (+ (SIN x) (^ 2 y) (LOG (ABS fuel)))) (SETQ lamp (+ (MOD x 3) (EXP y)))))")
kernels.settle()
for _ in range(3):
    twins.think()
    twins.compare()
print(len(made))
"""


@pytest.mark.parametrize("damaged", [False, True])
def test_code_of_another_process_is_found_and_does_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damaged: bool
) -> None:
    """Functions of the C library lie elsewhere in each process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def optimised() -> int:
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}
        done = subprocess.run(
            [sys.executable, "-c", KEPT], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return int(done.stdout)

    assert optimised() == 1
    (file,) = tmp_path.rglob("rules/*")
    if damaged:
        file.write_bytes(file.read_bytes()[:-7])
    assert optimised() == damaged
    assert optimised() == 0


def test_code_that_cannot_be_kept_is_made_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("where the folders should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "file"))
    twins = Twins(ROBOTS)
    forced(twins)
    twins.sense([[1.0] * len(SENSORS) for _ in range(ROBOTS)])
    twins.do("(RULE r (SETQ lamp (+ x 1)))")
    with patch("sleepcast.fleet.scheduler.walk_through", side_effect=AssertionError("a robot has walked")):
        twins.think()
    twins.compare()
