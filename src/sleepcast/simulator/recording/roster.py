"""Who was there in a recorded run, where robots come and go: the names of the robots by the rows of its arrays."""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.simulator.recording.json_messages import ArrivalBody, DepartureBody, RobotsBody
from sleepcast.simulator.scenario.population import NamesByRow, comes_and_goes
from sleepcast.simulator.scenario.robot_types import names_of
from sleepcast.simulator.scenario.scenario import Scenario


def names_at_first(scenario: Scenario) -> tuple[str, ...]:
    """The names at the start of a run, by row, "" for a row without a robot."""
    if comes_and_goes(scenario):
        return tuple(NamesByRow(scenario))
    return tuple(names_of(scenario.each_type, scenario.robots.count))


def names_after(names: Sequence[str], change: RobotsBody) -> tuple[str, ...]:
    """The names once robots have come and gone. Raises ValueError for rows that there are not."""
    later = [""] * len(names) if change.everybody else [*names]
    last = max((*(each.row for each in change.gone), *(each.row for each in change.came)), default=0)
    if last >= len(later):
        raise ValueError(f"a robot in row {last}, of {len(later)} rows")
    for gone in change.gone:
        later[gone.row] = ""
    for came in change.came:
        later[came.row] = came.robot
    return tuple(later)


def everybody(tick: int, names: Sequence[str], numbers: Sequence[int]) -> RobotsBody:
    """All robots that there are; `numbers`: of those in each row, from 0."""
    came = [ArrivalBody(name, numbers[row] + 1, row) for row, name in enumerate(names) if name]
    return RobotsBody(tick, came, [], everybody=True)


def departures(names: Sequence[str], rows: Sequence[int]) -> list[DepartureBody]:
    """The robots that had these names by row and have gone from these rows."""
    return [DepartureBody(names[row], row) for row in rows]
