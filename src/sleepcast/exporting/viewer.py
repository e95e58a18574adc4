"""A recorded run as a recording of Rerun (`.rrd`), on a timeline that is the run's own.

world/edge, areas, places, lights   what does not move
world/walls                         the solid things, whenever they have changed
robots, robots/headings             points in the colours of groups, and an arrow for each heading
readings/SENSOR                     a line for each robot; where they come and go, readings/SENSOR/ROBOT
groups/GROUP                        how many of the robots are in it
log, commands                       as text
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.extras import installing
from sleepcast.exporting.run import (
    ColoursEvent,
    CommandEvent,
    Event,
    LogLineEvent,
    MarksEvent,
    PosesEvent,
    ReadingsEvent,
    RecordedRun,
    RobotsEvent,
    SolidsEvent,
)
from sleepcast.exporting.table_files import MissingExtraError
from sleepcast.simulator.recording.foxglove import Level
from sleepcast.simulator.recording.scene import (
    AREA,
    EDGE,
    LIGHT,
    MAX_SEGMENTS,
    PLACE,
    SOLID,
    Colour,
    closed,
    edges,
    half_length,
    outline,
)
from sleepcast.simulator.world.world import Shape

TIMELINE = "run time"
"""The name of the timeline: simulated s since the start of the run."""
LEVELS = {Level.INFO: "INFO", Level.WARNING: "WARN", Level.ERROR: "ERROR"}
EVENTS_KEPT = 64
"""Events after which the library is to write what it has: some megabytes of a large swarm."""
PIECE = 1_048_576
"""Bytes that are written at once."""
PATIENCE = 120.0
"""Seconds for which the library may write a few megabytes: a slow disk over a network takes as many seconds."""
STUCK = "rerun-sdk does not go on writing"


class _Pump:
    """Takes what the library writes, through a pipe, and writes it into a file: the library itself waits for ever when
    the disk is full. path: where it is to write. Raises OSError."""

    def __init__(self, file: Path) -> None:
        self._output = file.open("wb")
        self._source, self._sink = os.pipe()
        self.path = f"/dev/fd/{self._sink}"
        self._error: OSError | None = None
        self._thread = Thread(target=self._run, name="rerun file", daemon=True)
        self._thread.start()

    def opened(self) -> None:
        """The library has opened `path`: when it closes it, that is the end."""
        os.close(self._sink)

    def check(self) -> None:
        """Raise what went wrong while writing."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Wait until the library has closed its end, and all is written."""
        self._thread.join(PATIENCE)
        if self._thread.is_alive():
            raise OSError(None, STUCK)
        try:
            self._output.close()
        except OSError as error:
            self._error = self._error or error
        self.check()

    def _run(self) -> None:
        while data := os.read(self._source, PIECE):
            try:
                if self._error is None:
                    self._output.write(data)
            except OSError as error:  # what comes is still taken, or the library would wait
                self._error = error
        os.close(self._source)


class ViewerFile:
    """A file that Rerun opens. counts: what was logged, by entity. Raises MissingExtraError, and OSError if it
    cannot be written."""

    def __init__(self, file: Path, name: str) -> None:
        try:
            import rerun
            import rerun.blueprint
        except ImportError as error:
            raise MissingExtraError(
                f"recordings of Rerun are written with rerun-sdk, which is not here; to install it: "
                f"{installing('rerun')}"
            ) from error
        self.rerun: Any = rerun
        self._stream = rerun.RecordingStream("sleepcast")
        self._pump = _Pump(file)
        self._stream.save(self._pump.path)
        self._pump.opened()
        self._stream.send_recording_name(name)
        self.counts: dict[str, int] = {}

    def log(self, entity: str, time: float | None, *parts: Any) -> None:
        """Log an entity at this time, s, or for all times."""
        if time is not None:
            self._stream.set_time(TIMELINE, duration=time)
        self._stream.log(entity, *parts, static=time is None)
        self.counts[entity] = self.counts.get(entity, 0) + 1

    def arrange(self) -> None:
        """Say how it is shown at first: the world, below it the log, and beside it what is plotted."""
        views = self.rerun.blueprint
        text = views.TextLogView(origin="/", contents=["log", "commands"], name="Log")
        parts = [views.Spatial3DView(origin="/", contents=["world/**", "robots/**"], name="World"), text]
        plots = [views.TimeSeriesView(origin=origin, name=origin.capitalize()) for origin in ("readings", "groups")]
        columns = views.Vertical(*parts, row_shares=[3, 1]), views.Vertical(*plots)
        shown = views.Horizontal(*columns, column_shares=[2, 1])
        self._stream.send_blueprint(views.Blueprint(shown, views.TimePanel(timeline=TIMELINE)))

    def save(self) -> None:
        """Let the library write what it has, so that little waits in memory."""
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except RuntimeError as error:
            raise OSError(None, f"{STUCK}: {error}") from error
        self._pump.check()

    def close(self) -> None:
        """Write the rest."""
        self.save()
        self._stream.disconnect()
        self._pump.close()

    def abort(self) -> None:
        """Close what is open."""
        with suppress(OSError):
            self._stream.disconnect()
            self._pump.close()


class ViewerSink:
    """Draws events. file: into which; run: of which."""

    def __init__(self, run: RecordedRun, file: ViewerFile) -> None:
        self._run, self._file, self._rerun = run, file, file.rerun
        self._size = half_length(run.scenario)
        self._named: set[str] = set()
        self._groups: set[str] = set()
        self._waiting = 0
        file.arrange()
        self._ground()

    def take(self, event: Event) -> None:
        """Log what an event says."""
        rerun, log = self._rerun, self._file.log
        match event:
            case PosesEvent():
                self._poses(event)
            case ColoursEvent(time, colours):
                log("robots", time, rerun.Points3D.from_fields(colors=colours[self._run.chosen]))
            case ReadingsEvent(time, values):
                for sensor, each in values.items():
                    self._readings(sensor, time, each[self._run.chosen])
            case MarksEvent():
                self._marks(event)
            case RobotsEvent(time):
                self._label(time)
            case LogLineEvent(time, level, name, text):
                log("log", time, rerun.TextLog(f"{name}: {text}", level=LEVELS[level]))
            case CommandEvent(time, _, message):
                log("commands", time, rerun.TextLog(message.text or message.kind.name, level="INFO"))
            case SolidsEvent(time, _, _, solids):
                self._walls(time, solids)
        self._waiting += 1
        if self._waiting >= EVENTS_KEPT:
            self._waiting = 0
            self._file.save()

    def _ground(self) -> None:
        """Log what does not move."""
        rerun, log, scenario = self._rerun, self._file.log, self._run.scenario
        log("/", None, rerun.ViewCoordinates.RIGHT_HAND_Z_UP)
        wide, high = scenario.width, scenario.height
        edge = closed(((0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high)))
        self._lines("world/edge", None, map(_flat, edge), EDGE)
        if scenario.areas:
            corners = [[*outline(area), outline(area)[0]] for area in scenario.areas]
            names = [area.name for area in scenario.areas]
            log("world/areas", None, rerun.LineStrips3D(list(map(_flat, corners)), colors=[_bytes(AREA)], labels=names))
        for entity, colour, points in (("places", PLACE, scenario.named_points), ("lights", LIGHT, scenario.lights)):
            if points:
                at, titles = _flat([(each.x, each.y) for each in points]), [each.title for each in points]
                drawn = rerun.Points3D(at, colors=[_bytes(colour)], labels=titles, radii=[self._size])
                log(f"world/{entity}", None, drawn)
        labels = None if self._run.changes else self._run.chosen_names  # what is said for all times cannot be changed
        log("robots", None, rerun.Points3D.from_fields(radii=[self._size], labels=labels, show_labels=False))
        if self._run.changes:
            self._label(self._run.recording.began)

    def _label(self, time: float) -> None:
        """Log the names of the robots that are there."""
        self._file.log("robots", time, self._rerun.Points3D.from_fields(labels=self._run.chosen_names))

    def _walls(self, time: float, solids: Mapping[int, Shape]) -> None:
        lines = [line for shape in solids.values() for line in edges(shape)]
        if len(lines) <= MAX_SEGMENTS:
            self._lines("world/walls", time, lines, SOLID)

    def _lines(self, entity: str, time: float | None, lines: Iterable[NDArray[np.floating]], ink: Colour) -> None:
        """lines: the points of each, m, shape (n, 3)."""
        self._file.log(entity, time, self._rerun.LineStrips3D(list(lines), colors=[_bytes(ink)]))

    def _poses(self, event: PosesEvent) -> None:
        x, y, heading = event.poses[self._run.chosen].T
        at, ahead = np.zeros((len(x), 3), np.float32), np.zeros((len(x), 3), np.float32)
        at[:, 0], at[:, 1], at[:, 2] = x, y, event.z[self._run.chosen]
        ahead[:, 0], ahead[:, 1] = 2.0 * self._size * np.cos(heading), 2.0 * self._size * np.sin(heading)
        self._file.log("robots", event.time, self._rerun.Points3D.from_fields(positions=at))
        arrows = self._rerun.Arrows3D(origins=at, vectors=ahead, radii=[self._size / 6.0])
        self._file.log("robots/headings", event.time, arrows)

    def _readings(self, sensor: str, time: float, values: NDArray[np.float64]) -> None:
        entity, names = f"readings/{self._rerun.escape_entity_path_part(sensor)}", self._run.chosen_names
        if not self._run.changes:
            self._lines_of(entity, time, names, values)
            return
        for name, value in zip(names, values.tolist(), strict=True):  # a row of many has others in it later
            self._lines_of(f"{entity}/{self._rerun.escape_entity_path_part(name)}", time, [name], value)

    def _lines_of(self, entity: str, time: float, names: Sequence[str], values: NDArray[np.float64] | float) -> None:
        if entity not in self._named:
            self._named.add(entity)
            self._file.log(entity, None, self._rerun.SeriesLines(names=names))
        self._file.log(entity, time, self._rerun.Scalars(values))

    def _marks(self, event: MarksEvent) -> None:
        group, second = event.group[self._run.chosen], event.second[self._run.chosen]
        for number, name in enumerate(event.names, 1):
            if name:
                members = int(((group == number) | (second == number)).sum())
                entity = f"groups/{self._rerun.escape_entity_path_part(name)}"
                self._file.log(entity, event.time, self._rerun.Scalars(members))


def _flat(points: Iterable[tuple[float, float]]) -> NDArray[np.float32]:
    """Points on the ground, shape (n, 3)."""
    corners = np.array(list(points), np.float32).reshape(-1, 2)
    return np.column_stack((corners, np.zeros(len(corners), np.float32)))


def _bytes(colour: Colour) -> tuple[int, ...]:
    return tuple(round(255 * part) for part in colour)
