"""How many steps an expression took on each robot, whoever says so: one number for all, or native code for each."""

from __future__ import annotations

from sleepcast.columns.values import Rows
from sleepcast.fleet.evaluation import RuleStatistics


def told_by_native_code(tally: RuleStatistics, *steps: int) -> None:
    sink = tally.sink(steps=True)
    assert sink.steps is not None
    sink.steps[:] = steps


def test_what_each_robot_used_counts_after_all_have_used_the_same() -> None:
    tally = RuleStatistics(3)
    told_by_native_code(tally, 1, 2, 3)
    assert [tally.steps_of(robot) for robot in range(3)] == [1, 2, 3]
    tally.used(7, Rows.run(0, 3))
    assert [tally.steps_of(robot) for robot in range(3)] == [7, 7, 7]
    tally.used(8, Rows.run(1, 2))
    assert [tally.steps_of(robot) for robot in range(3)] == [7, 8, 7]
    told_by_native_code(tally, 4, 5, 6)
    assert [tally.steps_of(robot) for robot in range(3)] == [4, 5, 6]
