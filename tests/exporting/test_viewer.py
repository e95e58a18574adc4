"""Recordings of Rerun, read by Rerun."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exporting.coming import THERE, flock
from exporting.recorded import YARD, flown, one_picture, recorded
from sleepcast.exporting import ExportError, ExportReport, export_recording, viewer
from sleepcast.exporting.run import PosesEvent, RecordedRun
from sleepcast.exporting.table_files import MissingExtraError
from sleepcast.exporting.viewer import TIMELINE, ViewerFile
from sleepcast.simulator.recording.recorder import READINGS, Recorder, WorldChange
from sleepcast.simulator.recording.recording import load_recording
from sleepcast.simulator.world.world import Circle, Polygon

pytestmark = pytest.mark.counterpart("rerun-sdk")


class Shown:
    """What Rerun reads of a file: values by entity and component, each with its time in s, None for all times."""

    def __init__(self, file: Path) -> None:
        from rerun.chunk import RrdReader

        self.rows: dict[str, list[tuple[float | None, Any]]] = {}
        for chunk in RrdReader(file).stream().to_chunks():
            batch = chunk.to_record_batch()
            times: list[float | None] = [None] * batch.num_rows
            if TIMELINE in batch.schema.names:
                times = [each / 1e9 for each in batch.column(TIMELINE).cast("int64").to_pylist()]
            for name in batch.schema.names:
                if ":" in name:
                    told = zip(times, batch.column(name).to_pylist(), strict=True)
                    rows = self.rows.setdefault(f"{chunk.entity_path} {name.partition(':')[2]}", [])
                    rows += [(time, value) for time, value in told if value is not None]

    def at(self, name: str) -> list[float | None]:
        return sorted((time for time, _ in self.rows[name]), key=lambda time: -1.0 if time is None else time)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ExportReport]:
    file = tmp_path_factory.mktemp("exported") / "yard.rrd"
    return file, export_recording(load_recording(YARD), "rrd", file)


@pytest.fixture(scope="module")
def shown(exported: tuple[Path, ExportReport]) -> Shown:
    return Shown(exported[0])


def test_rerun_itself_finds_nothing_wrong(exported: tuple[Path, ExportReport]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(exported[0])], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "1 file verified without error" in done.stdout + done.stderr


def test_robots_are_where_they_were_on_the_timeline_of_the_run(shown: Shown) -> None:
    run = RecordedRun(load_recording(YARD))
    wanted = [event for event in run.events() if isinstance(event, PosesEvent)]
    positions = dict(shown.rows["/robots positions"])
    assert sorted(positions) == [event.time for event in wanted]
    for event in wanted:
        np.testing.assert_allclose(np.array(positions[event.time])[:, :2], event.poses[:, :2])
    assert shown.rows["/robots labels"] == [(None, ["scout1", "scout2", "scout3"])]
    arrows = np.array(dict(shown.rows["/robots/headings vectors"])[10.0])
    np.testing.assert_allclose(np.arctan2(arrows[:, 1], arrows[:, 0]), wanted[-1].poses[:, 2], atol=1e-6)
    colours = dict(shown.rows["/robots colors"])
    assert sorted(colours) == sorted(positions)
    assert colours[10.0][0] == colours[10.0][2] != colours[10.0][1], "who is in a group has its colour"


def test_readings_are_lines_with_the_names_of_robots(shown: Shown) -> None:
    assert shown.rows["/readings/speed names"] == [(None, ["scout1", "scout2", "scout3"])]
    assert shown.at("/readings/speed scalars") == [0.0, 10.0]
    assert [len(value) for _, value in shown.rows["/readings/sonar3 scalars"]] == [3, 3]


def test_what_was_said_is_text(shown: Shown) -> None:
    assert (2.0, ["scout2: off we go"]) in shown.rows["/log text"]
    assert (8.0, ["STOP"]) in shown.rows["/commands text"]
    assert shown.rows["/groups/east scalars"][-1] == (10.0, [1.0])


def test_the_world_is_drawn(shown: Shown, tmp_path: Path) -> None:
    assert shown.at("/world/edge strips") == [None]
    assert shown.rows["/world/walls strips"] == [(0.0, [[[5.0, 2.0, 0.0], [5.0, 8.0, 0.0]]])]
    assert shown.rows["/world/places labels"] == [(None, ["house"])]

    def fill(recorder: Recorder) -> None:
        one_picture(recorder)
        recorder.obstacles(1.0, WorldChange(10, {"7": Circle(1.0, 1.0, 0.5)}, ()))
        recorder.obstacles(2.0, WorldChange(20, {}, (7,)))
        recorder.obstacles(3.0, WorldChange(30, {"8": Polygon(((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)), tall=4.0)}, ()))
        recorder.note(READINGS, 2.0, {"x": [1.0, None, 3.0], "a/b c": [1.0, 2.0, 3.0]})

    export_recording(recorded(tmp_path, fill), "rrd", tmp_path / "run.rrd")
    walls = Shown(tmp_path / "run.rrd")
    drawn = walls.rows["/world/walls strips"]
    assert [(time, len(lines)) for time, lines in drawn] == [(0.0, 0), (1.0, 32), (2.0, 0), (3.0, 9)]
    assert drawn[-1][1][-1] == [[2.0, 2.0, 0.0], [2.0, 2.0, 4.0]], "what has a height is a prism"
    ((_, values),) = walls.rows["/readings/x scalars"]
    assert np.isnan(values[1])
    assert any("a" in name and "b" in name for name in walls.rows if name.startswith("/readings/"))


def test_what_flies_is_drawn_above_the_ground(tmp_path: Path) -> None:
    export_recording(recorded(tmp_path, flown), "rrd", tmp_path / "run.rrd")
    ((_, positions),) = Shown(tmp_path / "run.rrd").rows["/robots positions"]
    assert np.array(positions)[:, 2].tolist() == [1.0, 2.0, 3.0]


def test_only_the_robots_that_are_wanted_are_drawn(tmp_path: Path) -> None:
    export_recording(load_recording(YARD), "rrd", tmp_path / "two.rrd", only=["scout3", "scout1"])
    two = Shown(tmp_path / "two.rrd")
    assert two.rows["/robots labels"] == [(None, ["scout3", "scout1"])]
    assert all(len(value) == 2 for name in two.rows for _, value in two.rows[name] if name.startswith("/readings/"))


def test_a_full_disk_ends_it_with_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library itself would wait for ever."""
    monkeypatch.setattr(viewer, "EVENTS_KEPT", 4)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        with pytest.raises(ExportError, match=r"cannot write .*yard\.rrd: File too large\. Nothing of it is left"):
            export_recording(load_recording(YARD), "rrd", tmp_path / "yard.rrd")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


def test_without_rerun_a_sentence_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtraError, match="written with rerun-sdk, which is not here; to install it: "):
        ViewerFile(tmp_path / "run.rrd", "run")
    assert list(tmp_path.iterdir()) == []


def test_robots_that_come_and_go_are_drawn_while_they_are_there(tmp_path: Path) -> None:
    file = tmp_path / "flock.rrd"
    export_recording(load_recording(flock(tmp_path / "flock.mcap")), "rrd", file)
    shown = Shown(file)
    assert [len(each) for _, each in sorted(shown.rows["/robots positions"])] == [len(each) for each in THERE]
    labels = dict(shown.rows["/robots labels"])
    assert [labels[float(second)] for second in range(5)] == [*THERE]
    assert shown.at("/readings/energy/sheep1 scalars") == [0.0, 1.0]
    assert shown.at("/readings/energy/sheep5 scalars") == [3.0, 4.0]
