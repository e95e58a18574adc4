"""The rows and the units of tables."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from exporting.coming import THERE, flock
from exporting.recorded import WORLD, YARD, one_picture, recorded
from sleepcast.core.errors import MisuseError
from sleepcast.exporting.run import RecordedRun
from sleepcast.exporting.tables import READINGS, TABLE_NAMES, CellType, ExportTable, TableSink, Values
from sleepcast.simulator.recording.recorder import READINGS as READINGS_TOPIC
from sleepcast.simulator.recording.recorder import Recorder, WorldChange
from sleepcast.simulator.recording.recording import Recording, load_recording
from sleepcast.simulator.world.world import Circle


class Kept:
    """Keeps tables in memory."""

    def __init__(self) -> None:
        self.tables: dict[str, ExportTable] = {}
        self.rows: dict[str, list[tuple[object, ...]]] = {}

    def begin(self, table: ExportTable) -> None:
        self.tables[table.name], self.rows[table.name] = table, []

    def add(self, table: str, columns: Sequence[Values]) -> None:
        self.rows[table] += zip(*(np.asarray(column).tolist() for column in columns), strict=True)

    def units(self, table: str) -> dict[str, str]:
        return {column.name: column.unit for column in self.tables[table].columns}


def kept(recording: Recording, *only: str) -> Kept:
    run, tables = RecordedRun(recording, only), Kept()
    sink = TableSink(run, tables)
    for event in run.events():
        if event is not None:
            sink.take(event)
    sink.close()
    assert sink.rows == {name: len(rows) for name, rows in tables.rows.items()}
    return tables


def test_a_run_is_told_in_tables() -> None:
    tables = kept(load_recording(YARD))
    assert set(tables.rows) == set(TABLE_NAMES)
    for name, rows in tables.rows.items():
        assert all(len(row) == len(tables.tables[name].columns) for row in rows)
    assert tables.rows["robots"][1] == ("scout2", 2, "scout", 0.17)
    assert [row[:2] for row in tables.rows["poses"][:4]] == [
        (0.0, "scout1"),
        (0.0, "scout2"),
        (0.0, "scout3"),
        (1.0, "scout1"),
    ]
    assert len(tables.rows["poses"]) == 33
    assert [row[4:6] for row in tables.rows["commands"]] == [
        ("command", "(WHEN (> x 9m) (JOIN east))"),
        ("command", '(WHEN (IN east) (RULE roll (DRIVE 0.5m/s 10deg/s)) (TK "off we go"))'),
        ("stop", ""),
    ]
    assert tables.rows["outcomes"][0][2:8] == ("(WHEN (> x 9m) (JOIN east))", 1, 2, 0, 0, 0)
    assert tables.rows["rules"] == [(10.0, "scout2", "roll", "(DRIVE 0.5m/s 10deg/s)", True, 0)]
    assert tables.rows["walls"] == [(0.0, 1, 5.0, 2.0, 5.0, 8.0, 0.0)]
    last = [row for row in tables.rows["marks"] if row[0] == 10.0]
    assert [row[1:7] for row in last] == [
        ("scout1", "", "", 0, True, False),
        ("scout2", "east", "", 0, True, False),
        ("scout3", "", "", 0, True, False),
    ]
    assert (2.0, "info", "scout2", "off we go") in tables.rows["log"]


def test_every_column_has_a_unit_or_none() -> None:
    tables = kept(load_recording(YARD))
    assert tables.units("poses") == {"time": "s", "robot": "", "x": "m", "y": "m", "heading": "rad"}
    units = tables.units(READINGS)
    assert units | {"sonar3": "m", "speed": "m/s", "battery": "1", "bumper": "1", "house_x": "m"} == units
    numbers = (CellType.NUMBER, CellType.SINGLE, CellType.WHOLE)
    for table in tables.tables.values():
        assert all(bool(column.unit) == (column.type in numbers) for column in table.columns)


def test_poses_of_robots_that_fly_have_their_heights(tmp_path: Path) -> None:
    flying = WORLD.replace("scout", "crazyflie").replace('"left-1"', '"left-1", z = "2m"')
    with sc.open(flying) as fleet, fleet.record(tmp_path / "flown.mcap"):
        fleet.run(1.0)
    tables = kept(load_recording(tmp_path / "flown.mcap"))
    assert tables.units("poses")["z"] == "m"
    assert [row[-1] for row in tables.rows["poses"][-3:]] == [2.0, 0.0, 0.0]


def test_only_the_robots_that_are_wanted_have_rows() -> None:
    tables = kept(load_recording(YARD), "scout3", "scout1")
    for name in ("robots", "poses", "marks", READINGS, "rules"):
        column = [each.name for each in tables.tables[name].columns].index("robot")
        assert {row[column] for row in tables.rows[name]} <= {"scout1", "scout3"}
    assert [row[0] for row in tables.rows["robots"]] == ["scout3", "scout1"]
    whole = kept(load_recording(YARD))
    assert tables.rows["poses"][1] == whole.rows["poses"][0]


def test_sensors_that_a_program_added_have_no_unit_and_keep_out_of_the_keys(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        recorder.note(READINGS_TOPIC, 0.0, {"x": [1.0, None, 3.0], "time": [7.0, 8.0, 9.0]})

    tables = kept(recorded(tmp_path, fill))
    assert tables.units(READINGS) == {"time": "s", "robot": "", "x": "m", "time_value": ""}
    first, second, _ = tables.rows[READINGS]
    assert first == (0.0, "left-1", 1.0, 7.0)
    assert isnan(float(str(second[2])))


def test_readings_of_other_sensors_than_before_are_refused(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        for time, name in ((0.0, "x"), (1.0, "y")):
            recorder.note(READINGS_TOPIC, time, {name: [1.0, 2.0, 3.0]})

    with pytest.raises(ValueError, match="readings of other sensors than before"):
        kept(recorded(tmp_path, fill))


def test_a_wall_that_is_gone_has_a_row_of_unknown_numbers(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        one_picture(recorder)
        recorder.obstacles(1.0, WorldChange(10, {"7": Circle(1.0, 2.0, 0.5)}, ()))
        recorder.obstacles(2.0, WorldChange(20, {}, (7,)))

    put, gone = kept(recorded(tmp_path, fill)).rows["walls"]
    assert put == (1.0, 7, 1.0, 2.0, 1.0, 2.0, 0.5)
    assert gone[:2] == (2.0, 7)
    assert all(isnan(float(str(cell))) for cell in gone[2:])


def test_a_run_without_readings_has_an_empty_table_of_them(tmp_path: Path) -> None:
    tables = kept(recorded(tmp_path, one_picture))
    assert tables.rows[READINGS] == []
    assert list(tables.units(READINGS)) == ["time", "robot"]


def test_of_robots_that_come_and_go_there_are_rows_while_they_are_there(tmp_path: Path) -> None:
    tables = kept(load_recording(flock(tmp_path / "flock.mcap")))
    for table in ("poses", READINGS):
        there = [[row[1] for row in tables.rows[table] if row[0] == second] for second in range(5)]
        assert there == [*THERE], table
    assert not any(isnan(x) for _, _, x, *_ in tables.rows["poses"] if isinstance(x, float))
    assert tables.rows["robots"] == [(f"sheep{number}", number, "sheep", 0.1) for number in range(1, 6)]
    assert tables.rows["turnover"] == [
        (1.0, "sheep3", True, "sheep1"),
        (1.0, "sheep4", True, "sheep1"),
        (2.0, "sheep1", False, ""),
        (3.0, "sheep5", True, "sheep3"),
        (4.0, "sheep4", False, ""),
    ]


def test_children_may_be_chosen_by_name(tmp_path: Path) -> None:
    recording = load_recording(flock(tmp_path / "flock.mcap"))
    tables = kept(recording, "sheep5", "sheep1")
    assert [row[:2] for row in tables.rows["poses"]] == [
        (0.0, "sheep1"),
        (1.0, "sheep1"),
        (3.0, "sheep5"),
        (4.0, "sheep5"),
    ]
    assert [row[1] for row in tables.rows["turnover"]] == ["sheep1", "sheep5"]
    with pytest.raises(MisuseError, match='no robot "sheep6" was recorded'):
        RecordedRun(recording, ["sheep6"])


def test_a_later_part_of_a_recording_knows_who_is_there(tmp_path: Path) -> None:
    flock(tmp_path / "flock.mcap", rotate="2s")
    tables = kept(load_recording(tmp_path / "flock-0002.mcap"))
    assert [row[1] for row in tables.rows["poses"] if row[0] == 2.0] == THERE[2]
    assert [row[1] for row in tables.rows["turnover"]] == ["sheep5", "sheep4"]
