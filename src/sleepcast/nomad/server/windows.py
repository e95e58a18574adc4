"""The content of the server's windows, as plain data of bounded size that a page reads.

Each robot has what its windows show: where it is and where it believes to be, what it received and what it sent, what
its sonars saw. The World window also has what clients draw. All in SI units and the world's frame. A client can have
each layer erased; a page that keeps a copy sees that from the counters in `erased`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import field
from math import cos, hypot, isnan, nan, pi, sin
from typing import Literal, NamedTuple

from sleepcast.core.records import dataclass
from sleepcast.nomad.wire.units import INCH, NOTHING_HEARD
from sleepcast.robot import Condition

MAX_TRACE = 2000
"""Points of a trace: 40 m and more."""
MAX_LINES = 200
"""Commands, and texts, that are kept: more than a person scrolls back."""
MAX_HISTORY = 120
HISTORY_STEP = 0.5
"""Looks at the sensors that are kept, and simulated seconds between two: the last minute, in 90 kB for each robot."""
MAX_ECHOES = 1000
"""Points that sonars saw: some sixty rings of sixteen."""
MAX_SKETCHES = 5000
"""Things that clients drew."""
TRACE_STEP = 0.02
"""m: a trace gets a new point when the body has moved farther than that."""
NOTHING = (NOTHING_HEARD - 0.5) * INCH
"""m: a sonar that reads this or more has heard nothing."""

Layer = Literal["actual", "encoder", "bumper", "infrared", "sonar", "laser", "graphics"]
LAYERS: tuple[Layer, ...] = ("actual", "encoder", "bumper", "infrared", "sonar", "laser", "graphics")
TRACES: tuple[Layer, ...] = ("actual", "encoder")
SENSORS: tuple[Layer, ...] = ("bumper", "infrared", "sonar", "laser")

Point = tuple[float, float]


def _trace() -> deque[Point]:
    return deque(maxlen=MAX_TRACE)


class SensorScan(NamedTuple):
    """What some sensors measured at `time`, simulated s. ranges: m, NaN for nothing; touched: as in `Condition`."""

    time: float
    ranges: tuple[float, ...]
    touched: tuple[float, ...] = ()


def _history() -> deque[SensorScan]:
    return deque(maxlen=MAX_HISTORY)


def _lines() -> deque[tuple[float, str]]:
    return deque(maxlen=MAX_LINES)


def _nothing_erased() -> dict[Layer, int]:
    return dict.fromkeys(LAYERS, 0)


@dataclass(frozen=True, slots=True)
class Sketch:
    """Something that a client drew: m and rad.

    numbers: of a "robot" x, y, heading, turret; of a "line" x1, y1, x2, y2; of an "arc" of an ellipse x, y of the upper
    left corner of the box around it, width, height, and the angles at which it begins and ends. mode: 1, 2, 3 are
    black with or without XOR, above that the named colours.
    """

    kind: Literal["robot", "line", "arc"]
    numbers: tuple[float, ...]
    mode: int


@dataclass(slots=True)
class RobotWindow:
    """What the windows of one robot show.

    actual, encoder: traces of where it was and of where it believed to be; a point of NaN is a gap, behind which it was
        put elsewhere.
    far, near: what its sonars, and its infrared sensors and bumper, measured in the last minute.
    commands, said: with the time (simulated s) at which each came.
    echoes: what its sonars saw, placed by where it believed to be.
    condition: the latest.
    waiting: how many clients wait for a click in this window.
    client: who is connected to it, "" for nobody.
    rivals: those who drive it together, "" while one alone does.
    held: who keeps it at rest, "" for nobody.
    erased: how often each layer was.
    """

    actual: deque[Point] = field(default_factory=_trace)
    encoder: deque[Point] = field(default_factory=_trace)
    commands: deque[tuple[float, str]] = field(default_factory=_lines)
    said: deque[tuple[float, str]] = field(default_factory=_lines)
    echoes: deque[Point] = field(default_factory=lambda: deque(maxlen=MAX_ECHOES))
    far: deque[SensorScan] = field(default_factory=_history)
    near: deque[SensorScan] = field(default_factory=_history)
    condition: Condition | None = None
    waiting: int = 0
    client: str = ""
    rivals: str = ""
    held: str = ""
    erased: dict[Layer, int] = field(default_factory=_nothing_erased)

    def look(self, condition: Condition, radius: float) -> None:
        """The robot's body, of `radius` m, is now like this."""
        before, self.condition = self.condition, condition
        if not self.far or condition.time - self.far[-1].time >= HISTORY_STEP:
            self.far.append(SensorScan(condition.time, condition.sonars))
        bumped = condition.touched and self.near and not self.near[-1].touched  # which may be over in less than a step
        if bumped or not self.near or condition.time - self.near[-1].time >= HISTORY_STEP:
            self.near.append(SensorScan(condition.time, condition.infrared, condition.touched))
        _trail(self.actual, (condition.real.x, condition.real.y))
        _trail(self.encoder, (condition.believed.x, condition.believed.y))
        heard = before.sonars if before is not None else ()
        if condition.sonars == heard:
            return
        x, y, _, turret = condition.believed
        for sonar, reading in enumerate(condition.sonars):
            if reading < NOTHING and (sonar >= len(heard) or reading != heard[sonar]):
                angle = turret + 2.0 * pi * sonar / len(condition.sonars)
                away = radius + reading
                self.echoes.append((x + away * cos(angle), y + away * sin(angle)))

    def lift(self, *traces: deque[Point]) -> None:
        """The robot is put elsewhere: no line of these traces leads there."""
        for trace in traces:
            if trace and not isnan(trace[-1][0]):
                trace.append((nan, nan))

    def erase(self, layers: Sequence[Layer]) -> None:
        """Clear these layers."""
        for layer in layers:
            self.erased[layer] += 1
        if "actual" in layers:
            self.actual.clear()
        if "encoder" in layers:
            self.encoder.clear()
        if "sonar" in layers:
            self.echoes.clear()
            self.far.clear()
        if "infrared" in layers or "bumper" in layers:
            self.near.clear()


class Windows:
    """The windows of a server with so many robots. robots: of each, by its index. sketches: what clients drew."""

    def __init__(self, robots: int) -> None:
        self.robots = [RobotWindow() for _ in range(robots)]
        self.sketches: deque[Sketch] = deque(maxlen=MAX_SKETCHES)

    def erase(self, robot: int, layers: Sequence[Layer]) -> None:
        """Clear these layers of one robot's windows; the graphics of clients are everybody's."""
        self.robots[robot].erase([layer for layer in layers if layer != "graphics"])
        if "graphics" in layers:
            self.sketches.clear()
            for window in self.robots:
                window.erase(["graphics"])


def _trail(trace: deque[Point], point: Point) -> None:
    if not trace or not hypot(point[0] - trace[-1][0], point[1] - trace[-1][1]) <= TRACE_STEP:  # NaN is no distance
        trace.append(point)
