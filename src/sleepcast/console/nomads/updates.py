"""Pictures of the Nomads for one page: all that it lacks, and no more.

Where robots are goes out whole with every picture. Rows that grow (traces, echoes, drawings, texts) go out as what was
added since the picture before, or anew where they were erased. A page that draws slowly gets fewer pictures and still
every point, as far as the rows reach back.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from math import isnan
from typing import Generic, TypeVar

import msgspec

from sleepcast.console.nomads.view import Layer, Looked, Nomads, Point, RobotWindow, Saying, Sketch
from sleepcast.console.outgoing import Said
from sleepcast.robot import Condition, Pose

FASTEST = 10_000.0
"""Speed that stands for as fast as possible, where there is no number for it."""
MOST_TRACED = 200
"""Robots whose traces a page gets: beyond, the window would only be full of lines."""

T = TypeVar("T")


class Added(msgspec.Struct, Generic[T], array_like=True):
    """What came to a row. anew: forget what came before."""

    anew: bool
    items: list[T]


class Trace(msgspec.Struct, array_like=True):
    """What came to a trace. layer: 0 actual, 1 encoder. points: x, y of each in turn, m; None for both is a gap."""

    robot: int
    layer: int
    anew: bool
    points: list[float | None]


class ShownRobot(msgspec.Struct, array_like=True):
    """One robot on the map. real, believed: x, y, heading, turret; m and rad. touched: how many contacts it feels."""

    real: Pose
    believed: Pose
    touched: int
    waiting: bool
    client: str
    rivals: str


class ShownSketch(msgspec.Struct, array_like=True):
    """See `nomad.Sketch`."""

    kind: str
    numbers: Sequence[float]
    mode: int


class Look(msgspec.Struct, array_like=True):
    """What sensors measured, s of simulated time. ranges: m, None for nothing. touched: rad."""

    time: float
    ranges: list[float | None]
    touched: tuple[float, ...] = ()


class Chosen(msgspec.Struct):
    """The robot that the page looks at. sonars, infrared: m, None for nothing measured yet. touched: rad. far, near: as
    in `nomad.RobotWindow`."""

    robot: int
    speeds: list[float]
    moving: tuple[bool, bool, bool]
    sonars: list[float | None]
    infrared: list[float | None]
    touched: list[float]
    battery: float
    erased: Mapping[Layer, int]
    echoes: Added[Point]
    commands: Added[Saying]
    said: Added[Saying]
    far: Added[Look]
    near: Added[Look]


class Picture(Said):
    """The Nomads at one moment. wanted, achieved: simulated seconds in a second."""

    time: float
    running: bool
    wanted: float
    achieved: float
    robots: list[ShownRobot]
    traces: list[Trace]
    sketches: Added[ShownSketch]
    chosen: Chosen | None


class Tail(Generic[T]):
    """What a page lacks of a row that grows at its end and forgets its beginning. Entries are told apart by identity,
    so the row must keep the very objects."""

    def __init__(self) -> None:
        self._last: T | None = None

    def take(self, row: Sequence[T]) -> Added[T]:
        """What has come since this was last asked."""
        last, found = self._last, deque[T]()
        self._last = row[-1] if row else None
        for entry in reversed(row):
            if entry is last:
                return Added(False, list(found))
            found.appendleft(entry)
        return Added(last is not None or bool(found), list(found))


class Pictures:
    """The pictures of one page; one that goes away takes them along."""

    def __init__(self, nomads: Nomads) -> None:
        self._nomads = nomads
        self._traces: list[tuple[Tail[Point], Tail[Point]]] = [
            (Tail(), Tail()) for _ in range(min(nomads.count, MOST_TRACED))
        ]
        self._sketches: Tail[Sketch] = Tail()
        self._chosen = 0
        self._rows = _Rows()

    def choose(self, robot: int) -> None:
        """Look at this robot from now on."""
        if robot != self._chosen:
            self._chosen, self._rows = robot, _Rows()

    def take(self, wanted: float, achieved: float) -> Picture:
        """The next picture. wanted, achieved: as in `Picture`."""
        nomads = self._nomads
        sketches = self._sketches.take(nomads.sketches())
        return Picture(
            nomads.time,
            nomads.speed > 0.0,
            wanted,
            round(achieved, 2),
            [_shown(nomads.window(robot)) for robot in range(nomads.count)],
            list(self._traced()),
            Added(sketches.anew, [ShownSketch(each.kind, each.numbers, each.mode) for each in sketches.items]),
            self._rows.show(self._chosen, nomads.window(self._chosen)) if 0 <= self._chosen < nomads.count else None,
        )

    def _traced(self) -> list[Trace]:
        found = []
        for robot, tails in enumerate(self._traces):
            window = self._nomads.window(robot)
            for layer, (tail, row) in enumerate(zip(tails, (window.actual, window.encoder), strict=True)):
                added = tail.take(row)
                if added.anew or added.items:
                    points = [None if isnan(n) else round(n, 3) for point in added.items for n in point]
                    found.append(Trace(robot, layer, added.anew, points))
        return found


class _Rows:
    """The rows of the robot that a page looks at."""

    def __init__(self) -> None:
        self._echoes: Tail[Point] = Tail()
        self._commands: Tail[Saying] = Tail()
        self._said: Tail[Saying] = Tail()
        self._far: Tail[Looked] = Tail()
        self._near: Tail[Looked] = Tail()

    def show(self, robot: int, window: RobotWindow) -> Chosen | None:
        condition = window.condition
        if condition is None:
            return None
        return Chosen(
            robot,
            [0.0 if isnan(speed) else speed for speed in condition.speeds],
            condition.moving,
            _measured(condition.sonars),
            _measured(condition.infrared),
            list(condition.touched),
            condition.battery,
            window.erased,
            self._echoes.take(window.echoes),
            self._commands.take(window.commands),
            self._said.take(window.said),
            _looks(self._far.take(window.far)),
            _looks(self._near.take(window.near)),
        )


def _looks(added: Added[Looked]) -> Added[Look]:
    return Added(added.anew, [Look(time, _measured(ranges), touched) for time, ranges, touched in added.items])


def _shown(window: RobotWindow) -> ShownRobot:
    condition: Condition | None = window.condition
    nowhere = Pose(0.0, 0.0, 0.0, 0.0)
    real, believed = (nowhere, nowhere) if condition is None else (condition.real, condition.believed)
    touched = 0 if condition is None else len(condition.touched)
    return ShownRobot(real, believed, touched, window.waiting > 0, window.client, window.rivals)


def _measured(readings: Sequence[float]) -> list[float | None]:
    return [None if isnan(reading) else round(reading, 4) for reading in readings]
