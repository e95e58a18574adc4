"""The table of robots at the desk: columns are expressions, sorted and filtered, in pieces."""

from __future__ import annotations

import csv
from io import StringIO
from itertools import count
from statistics import median
from time import thread_time

import numpy as np
import pytest

from console.test_backend import Stand, stand
from sleepcast.api.assembly import assemble
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.features.table import ASK, CSV_ROWS, GetCsv, GetRange, GetRows, RobotTable, TableRows
from sleepcast.console.values import TelemetryValues
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Changes, find_scenario

__all__ = ["stand"]

serials = count(1)


@pytest.fixture
def table(stand: Stand) -> RobotTable:
    return RobotTable(stand.desk.values)


def rows(table: RobotTable, *columns: str, count: int = 200, again: bool = True, **how: object) -> TableRows:
    asked = GetRows(next(serials), list(columns), count=count, again=again, **how)  # type: ignore[arg-type]
    return table.rows(asked)


def robots(found: TableRows) -> list[int]:
    return [row.robot for row in found.rows]


def levels(stand: Stand) -> list[float]:
    return [stand.level(name) for name in stand.swarm.minds]


def test_a_row_shows_what_people_read(stand: Stand, table: RobotTable) -> None:
    found = rows(table, "battery", "(DIST x y 0 0)", "(> battery 60%)")
    assert [(column.text, column.unit, column.problem) for column in found.columns] == [
        ("battery", "%", ""),
        ("(DIST x y 0 0)", "km", ""),
        ("(> battery 60%)", "", ""),
    ]
    level, distance, full = found.rows[3].cells
    assert level == f"{100 * levels(stand)[3]:.4g} %"
    mind = dict(stand.swarm.minds["rover4"].variables())
    assert distance == f"{np.hypot(mind['x'], mind['y']) / 1000:.4g} km"
    assert full == str(int(levels(stand)[3] > 0.6))
    assert (found.total, robots(found)) == (20, list(range(20)))


def test_it_is_sorted_by_any_column_both_ways(stand: Stand, table: RobotTable) -> None:
    expected = sorted(range(20), key=lambda robot: levels(stand)[robot])
    assert robots(rows(table, "x", "battery", sort=1)) == expected
    assert robots(rows(table, "x", "battery", sort=1, descending=True)) == expected[::-1]
    assert robots(rows(table, "x", descending=True)) == list(range(20))[::-1]


def test_a_piece_of_it_is_the_same_as_all_of_it(table: RobotTable) -> None:
    everything = rows(table, "battery", sort=0)
    piece = rows(table, "battery", sort=0, first=7, count=5, again=False)
    assert (piece.first, piece.rows, piece.total) == (7, everything.rows[7:12], 20)


def test_a_test_filters_it(stand: Stand, table: RobotTable) -> None:
    found = rows(table, "battery", where="(> battery 60%)")
    assert robots(found) == [robot for robot in range(20) if levels(stand)[robot] > 0.6]
    assert found.total == len(found.rows) < 20


def test_what_is_wrong_is_said_where_it_is(table: RobotTable) -> None:
    found = rows(table, "batery", "x", sort=0)
    assert "did you mean battery?" in found.columns[0].problem
    assert (found.rows[0].cells[0], found.columns[1].problem) == ("", "")
    assert robots(found) == list(range(20))
    wrong = rows(table, "x", where="(> batery 1)")
    assert (wrong.rows, wrong.total) == ([], 0)
    assert "did you mean battery?" in wrong.problem
    assert "cannot be previewed" in rows(table, "(MARK)").columns[0].problem


def test_what_only_robots_know_is_unknown(table: RobotTable) -> None:
    found = rows(table, "(SONAR 1)")
    assert (found.columns[0].problem, found.rows[0].cells) == (ASK, ["unknown"])


def test_the_order_stays_until_it_is_asked_for_anew(stand: Stand, table: RobotTable) -> None:
    before = robots(rows(table, "x", sort=0))
    stand.swarm.simulator.place(before[0], 990.0, 500.0, 0.0)
    stand.run()
    assert robots(rows(table, "x", sort=0, again=False)) == before
    assert robots(rows(table, "x", sort=0)) != before


def test_groups_are_told_and_sorted_by(stand: Stand, table: RobotTable) -> None:
    stand.station.send("(WHEN (> battery 60%) (JOIN crew))", everybody=True)
    stand.run()
    members = [robot for robot in range(20) if levels(stand)[robot] > 0.6]
    found = rows(table, "x", sort=-2)
    assert robots(found)[: len(members)] == members
    assert {row.groups for row in found.rows[: len(members)]} == {"crew"}
    assert {row.groups for row in found.rows[len(members) :]} == {""}


def test_robots_of_a_range_come_in_the_order_of_the_table(table: RobotTable) -> None:
    order = robots(rows(table, "battery", sort=0))
    found = table.range(GetRange(next(serials), 4, 6))
    assert np.frombuffer(found.robots, "<i4").tolist() == order[4:10]


def test_unasked_for_it_shows_the_sensors_of_the_robots(table: RobotTable) -> None:
    texts = [column.text for column in rows(table).columns]
    assert texts[:3] == ["x", "y", "heading"]
    assert "battery" in texts
    assert not any(text.startswith("sonar") for text in texts)


def read(table: RobotTable, *picked: int) -> list[list[str]]:
    text, piece, done = "", 0, False
    while not done:
        found = table.csv(GetCsv(next(serials), piece, list(picked)))
        text, piece, done = text + found.text, piece + 1, found.done
    return list(csv.reader(StringIO(text)))


def test_csv_holds_all_rows_in_their_order(stand: Stand, table: RobotTable) -> None:
    order = robots(rows(table, "battery", "(SONAR 1)", sort=0, count=3))
    assert len(order) == 3
    head, *lines = read(table)
    assert head == ["robot", "groups", "battery (%)", "(SONAR 1) (km)"]
    assert [line[0] for line in lines[:3]] == [f"rover{robot + 1}" for robot in order]
    assert [float(line[2]) for line in lines] == pytest.approx(sorted(100 * level for level in levels(stand)))
    assert {line[3] for line in lines} == {""}
    assert [line[0] for line in read(table, 5, 2)[1:]] == [f"rover{r + 1}" for r in robots_of(table) if r in (5, 2)]


def test_a_variable_does_not_take_the_place_of_a_key_in_it(stand: Stand, table: RobotTable) -> None:
    rows(table, "robot", "groups")  # variables of robots may be called anything
    head, *lines = read(table)
    assert head == ["robot", "groups", "robot_value", "groups_value"]
    assert {line[0] for line in lines} == {f"rover{robot + 1}" for robot in range(20)}


def robots_of(table: RobotTable) -> list[int]:
    return np.frombuffer(table.range(GetRange(next(serials), 0, 20)).robots, "<i4").tolist()


def test_csv_is_of_one_moment_and_is_begun_at_its_beginning(
    stand: Stand, table: RobotTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sleepcast.console.features.table.CSV_ROWS", 15)
    rows(table, "x")
    first = table.csv(GetCsv(next(serials)))
    place = stand.swarm.simulator.x[19]
    stand.swarm.simulator.place(19, 1.0, 1.0, 0.0)
    stand.run()
    second = table.csv(GetCsv(next(serials), 1))
    assert (first.done, second.done) == (False, True)
    assert float(list(csv.reader(StringIO(second.text)))[-1][2]) == pytest.approx(place / 1000)
    with pytest.raises(MisuseError, match="from its beginning"):
        table.csv(GetCsv(next(serials), 2))
    assert CSV_ROWS > 15


def test_sorting_a_hundred_thousand_robots_is_done_within_a_few_frames() -> None:
    """So that a STOP waits no longer: the desk does one thing at a time."""
    swarm, station = assemble(find_scenario("bravo", Changes(100_000)), 7, mission=False)
    for _ in range(25):
        swarm.step()  # until telemetry holds what is asked for
    table = RobotTable(TelemetryValues(SwarmAdapter(swarm), station))
    taken = []
    for _ in range(5):
        rows(table, "(DIST x y vessel_x vessel_y)", "fuel", sort=0, where="(> fuel 50%)", count=60)
        swarm.step()
        begun = thread_time()
        found = rows(table, "(DIST x y vessel_x vessel_y)", "fuel", sort=0, where="(> fuel 50%)", count=60)
        taken.append(thread_time() - begun)
    assert 0 < found.total < 100_000
    assert median(taken) < 0.05, taken
