"""clients/micropython evaluates the shared cases, under MicroPython with a heap of 128 KB.

What its README says is not covered is not compared: the warnings of the checker, and the words of refusals beyond their
first finding.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from clients import board
from language.cases import Block, Case, Outcome, blocks, mismatch

BLOCKS = blocks()
PLACE = re.compile(r" at \d+:\d+")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    board.needed()
    return board.build(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="module")
def robot(folder: Path) -> Iterator[board.Talk]:
    with board.Talk(board.start(folder, "evaluator")) as talk:
        yield talk


def begin(robot: board.Talk, block: Block) -> None:
    setting = block.setting
    values = {name: None if math.isnan(value) else value for name, value in setting.values.items()}
    sensors = [sensor.name for sensor in setting.extra]
    robot.ask({"sensors": sensors, "values": values, "number": setting.number, "seed": setting.seed})


def fresh(robot: board.Talk, **values: float) -> None:
    robot.ask({"sensors": [], "values": values, "number": 0, "seed": 0})


def evaluate(robot: board.Talk, text: str) -> Outcome:
    said = robot.ask({"text": text})
    if "refused" in said:
        return Outcome(refused=str(said["refused"]))
    value = math.nan if said["value"] == "UNKNOWN" else float(str(said["value"]))
    found = {key: tuple(said[key]) for key in ("faults", "prints", "tells", "pings", "does")}  # type: ignore[arg-type]
    return Outcome(value, matched=bool(said["matched"]), **found)


def says(case: Case, outcome: Outcome) -> bool:
    """Whether a refusal has the wanted words, their place left out."""
    return case.refusal is not None and PLACE.sub("", case.refusal) in outcome.refused


def test_every_case_has_its_value_its_effects_and_its_refusal(robot: board.Talk) -> None:
    wrong, covered, worded, refused, warned = [], 0, 0, 0, 0
    for block in BLOCKS:
        begin(robot, block)
        for case in block.cases:
            outcome = evaluate(robot, case.text)
            covered += 1
            if case.refusal is not None:
                refused += 1
                worded += says(case, outcome)
                difference = "" if outcome.refused else f"wanted a refusal, got {outcome}"
            else:
                difference = mismatch(case, outcome, checks=False)
                warned += bool(case.words("warning"))
            if difference:
                wrong.append(f"{case.where}: {case.text}\n    wanted {case.expected}: {difference}")
    print(f"{covered} cases covered; words of {refused - worded} of {refused} refusals, warnings of {warned} are not")
    assert not wrong, "\n" + "\n".join(wrong)
    assert covered == sum(len(block.cases) for block in BLOCKS)
    assert worded >= 0.9 * refused


def test_rules_run_at_every_tick_in_their_order_until_their_lease_ends(robot: board.Talk) -> None:
    fresh(robot)
    for text in ("(DEFVAR n 0)", "(RULE count (SETQ n (+ n 1)))", "(SETQQ E7 (SETQ n (* 10 n)))", "(ACTIVATE E7)"):
        evaluate(robot, text)
    robot.ask({"ticks": 2, "values": {}, "seconds": 0.1})
    assert evaluate(robot, "n").value == 11.0  # 0, then E7 and count twice
    evaluate(robot, "(PROGN (DEACTIVATE E7) (LEASE count 0.25s))")
    robot.ask({"ticks": 10, "values": {}, "seconds": 0.1})
    assert evaluate(robot, "n").value == 13.0
    for text in ("(ACTIVATE count)", "(SLEEP)"):
        evaluate(robot, text)
    robot.ask({"ticks": 3, "values": {}, "seconds": 0.1})
    assert evaluate(robot, "n").value == 13.0


def test_a_rule_that_fails_ten_times_is_deactivated_and_rollback_restores_what_worked(robot: board.Talk) -> None:
    fresh(robot)
    for text in ("(DEFVAR n 0)", "(RULE good (SETQ n (+ n 1)))"):
        evaluate(robot, text)
    robot.ask({"ticks": 150, "values": {}, "seconds": 0.1})
    evaluate(robot, "(RULE bad (SETQ n (/ 1 0)))")
    robot.ask({"ticks": 9, "values": {}, "seconds": 0.1})
    assert math.isnan(evaluate(robot, "n").value)
    robot.ask({"ticks": 2, "values": {}, "seconds": 0.1})
    evaluate(robot, "(SETQ n 0)")
    robot.ask({"ticks": 1, "values": {}, "seconds": 0.1})
    assert evaluate(robot, "n").value == 1.0, "bad still runs"
    evaluate(robot, "(ROLLBACK)")
    assert evaluate(robot, "(KNOWN bad)").value == 0.0
    robot.ask({"ticks": 1, "values": {}, "seconds": 0.1})
    assert evaluate(robot, "n").value == 2.0


def test_a_text_that_does_not_fit_into_its_memory_is_refused_and_the_robot_goes_on(robot: board.Talk) -> None:
    fresh(robot)
    evaluate(robot, "(RULE keep 7)")
    long = f"(PROGN {' '.join(f'(SETQQ E{i % 63 + 1} (+ {i} fuel x y))' for i in range(150))})"
    assert "memory" in evaluate(robot, long).refused
    assert evaluate(robot, "(+ keep 1)").value == 8.0


def test_sixty_rules_fit(robot: board.Talk) -> None:
    fresh(robot, fuel=0.9, ordnance=0.9)
    for i in range(60):
        text = f"(RULE rule{i} (WHEN (AND (> fuel 50%) (NOT (< ordnance {i}%))) (SETQ throttle 0.{i:02})))"
        assert evaluate(robot, text).value == 1.0
    robot.ask({"ticks": 1, "values": {}, "seconds": 0.1})
    assert evaluate(robot, "throttle").value == 0.59
