"""What the windows of the Nomads show one page beside its frames: all that it lacks, and no more.

What each robot is like goes out whole. Rows that grow (traces, echoes, drawings, what sensors measured) go out as what
was added since the last time, or anew where they were erased. A page that draws slowly gets fewer frames and still
every point, as far as the rows reach back.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from math import isnan, pi
from typing import Generic, TypeVar

import msgspec

from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.sensing import BodyView, measured
from sleepcast.nomad.panes.view import Nomads
from sleepcast.nomad.server.windows import Layer, Point, RobotWindow, SensorScan, Sketch
from sleepcast.robot import Pose

NOTHING = 254.5
"""Inches: a sonar that reads this or more has heard nothing."""
SIGHT = 24
"""Inches: what an infrared sensor sees at most."""
NOWHERE = Pose(0.0, 0.0, 0.0, 0.0)
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
    """What a frame does not say of a robot on the map.

    turret: where it points, rad.
    believed: x, y, heading, turret; m and rad.
    touched: how many contacts it feels.
    client, rivals: as in `nomad.RobotWindow`.
    """

    turret: float
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


class ShownScan(msgspec.Struct, array_like=True):
    """What sensors measured, s of simulated time. ranges: m, None for nothing. touched: rad."""

    time: float
    ranges: list[float | None]
    touched: tuple[float, ...] = ()


class Chosen(msgspec.Struct):
    """The robot that the page looks at. erased, echoes, far, near: as in `nomad.RobotWindow`."""

    robot: int
    body: BodyView
    erased: Mapping[Layer, int]
    echoes: Added[Point]
    far: Added[ShownScan]
    near: Added[ShownScan]


class WindowsNews(DeskMessage, tag="windows"):
    """What the windows of the Nomads show beside a frame."""

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
        last, news = self._last, deque[T]()
        self._last = row[-1] if row else None
        for entry in reversed(row):
            if entry is last:
                return Added(False, list(news))
            news.appendleft(entry)
        return Added(last is not None or bool(news), list(news))


class PageWindows:
    """What one page is shown; one that goes away takes it along."""

    def __init__(self, nomads: Nomads) -> None:
        self._nomads = nomads
        self._traces: list[tuple[Tail[Point], Tail[Point]]] = [
            (Tail(), Tail()) for _ in range(min(nomads.count, MOST_TRACED))
        ]
        self._sketches: Tail[Sketch] = Tail()
        self._chosen = 0
        self._rows = _Rows()

    def choose(self, robot: int) -> None:
        """Look at this robot from now on. Of its rows the page lacks all, even if it has looked at it before."""
        self._chosen, self._rows = robot, _Rows()

    def take(self) -> WindowsNews:
        """What the page lacks now."""
        nomads = self._nomads
        sketches = self._sketches.take(nomads.sketches())
        return WindowsNews(
            [_shown(nomads.window(robot)) for robot in range(nomads.count)],
            list(self._traced()),
            Added(sketches.anew, [ShownSketch(each.kind, each.numbers, each.mode) for each in sketches.items]),
            self._rows.show(nomads, self._chosen) if 0 <= self._chosen < nomads.count else None,
        )

    def _traced(self) -> list[Trace]:
        traces = []
        for robot, tails in enumerate(self._traces):
            window = self._nomads.window(robot)
            for layer, (tail, row) in enumerate(zip(tails, (window.actual, window.encoder), strict=True)):
                added = tail.take(row)
                if added.anew or added.items:
                    points = [None if isnan(n) else round(n, 3) for point in added.items for n in point]
                    traces.append(Trace(robot, layer, added.anew, points))
        return traces


class _Rows:
    """The rows of the robot that a page looks at."""

    def __init__(self) -> None:
        self._echoes: Tail[Point] = Tail()
        self._far: Tail[SensorScan] = Tail()
        self._near: Tail[SensorScan] = Tail()

    def show(self, nomads: Nomads, robot: int) -> Chosen | None:
        window, body = nomads.window(robot), body_of(nomads, robot)
        if body is None:
            return None
        return Chosen(
            robot,
            body,
            window.erased,
            self._echoes.take(window.echoes),
            _looks(self._far.take(window.far)),
            _looks(self._near.take(window.near)),
        )


def body_of(nomads: Nomads, robot: int) -> BodyView | None:
    """What the body of this robot senses, None before it has sensed anything."""
    condition = nomads.window(robot).condition
    if condition is None:
        return None
    real, believed = condition.real, condition.believed
    inch = 10.0 * nomads.tenth
    return BodyView(
        (real.x, real.y, real.heading),
        nomads.radius(robot),
        (believed.x, believed.y, believed.heading),
        measured(condition.sonars),
        2.0 * pi / max(1, len(condition.sonars)),
        NOTHING * inch,
        condition.touched,
        (),
        real.turret,
        measured(condition.infrared),
        SIGHT * inch,
    )


def _looks(added: Added[SensorScan]) -> Added[ShownScan]:
    return Added(
        added.anew, [ShownScan(time, list(measured(ranges)), touched) for time, ranges, touched in added.items]
    )


def _shown(window: RobotWindow) -> ShownRobot:
    condition = window.condition
    if condition is None:
        return ShownRobot(0.0, NOWHERE, 0, window.waiting > 0, window.client, window.rivals)
    return ShownRobot(
        condition.real.turret,
        condition.believed,
        len(condition.touched),
        window.waiting > 0,
        window.client,
        window.rivals,
    )
