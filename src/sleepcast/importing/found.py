"""What was found in a file of another program: a world in that file's own frame, m and rad, x to the right and y up.

Nothing here is a scenario yet: names may be taken twice and coordinates be negative. Each thing that a scenario has no
place for is noted with the reason, so that nobody believes it was taken over.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.scenario.scanners import LaserModel
from sleepcast.simulator.scenario.starts import StartPose

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Frame:
    """A place and a direction in which things stand: those of a child in its parent's frame."""

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0

    def at(self, point: Point) -> Point:
        """A point of this frame in the frame around it."""
        x, y = point
        return (
            self.x + x * cos(self.turn) - y * sin(self.turn),
            self.y + x * sin(self.turn) + y * cos(self.turn),
        )

    def inside(self, other: Frame) -> Frame:
        """This frame, which is written in `other`, in the frame around that."""
        return Frame(*other.at((self.x, self.y)), other.turn + self.turn)


def rectangle(frame: Frame, width: float, height: float) -> tuple[Point, ...]:
    """The corners of a rectangle with its middle at the frame's origin, counter-clockwise."""
    right, up = width / 2.0, height / 2.0
    return tuple(frame.at(each) for each in ((-right, -up), (right, -up), (right, up), (-right, up)))


@dataclass(frozen=True, slots=True)
class Outline:
    """Something solid with corners: closed, or an open line."""

    corners: tuple[Point, ...]
    closed: bool = True


@dataclass(frozen=True, slots=True)
class Disc:
    """A disc."""

    center: Point
    radius: float


@dataclass(frozen=True, slots=True)
class Bitmap:
    """Solid cells of a picture: shape (rows, columns), bottom row first; size of a cell; lower left corner and turn."""

    solid: NDArray[np.bool_]
    cell: float
    corner: Frame

    def corners(self) -> list[Point]:
        """The four corners of the picture."""
        rows, columns = self.solid.shape
        return [self.corner.at((x * self.cell, y * self.cell)) for x in (0, columns) for y in (0, rows)]


@dataclass(frozen=True, slots=True)
class Hardware:
    """What a type of robot can do. radius: of its body, m; speed: m/s; turn_rate: rad/s; acceleration: m/s2; track:
    between its two wheels, m, 0 for a body without wheels; solid: whether it stops where it touches something; like:
    the included type that it is, whose numbers these are, "" for one that only they describe."""

    radius: float
    speed: float
    turn_rate: float
    acceleration: float
    track: float = 0.0
    solid: bool = True
    like: str = ""


@dataclass(slots=True)
class FoundRobots:
    """Robots of one type: their poses, or a count of them by chance within `box` (lower left, upper right corner)."""

    type: str
    hardware: Hardware
    poses: list[StartPose] = field(default_factory=list)
    count: int = 0
    box: tuple[Point, Point] | None = None


@dataclass(slots=True)
class Found:
    """All that a scenario can hold of a file. box: lower left and upper right corner of its world, None for whatever
    holds all of it; margin: m of open space around what has no box; laser: of all robots; route: places in the order of
    a mission."""

    title: str
    about: str
    box: tuple[Point, Point] | None = None
    margin: float = 1.0
    seconds: float = 300.0
    tick: float = 0.1
    seed: int = 0
    reach: float = 0.0
    laser: LaserModel | None = None
    solids: list[Outline | Disc] = field(default_factory=list)
    cells: Bitmap | None = None
    robots: list[FoundRobots] = field(default_factory=list)
    places: dict[str, tuple[Point, str]] = field(default_factory=dict)
    areas: dict[str, tuple[Point, ...] | Disc] = field(default_factory=dict)
    lights: dict[str, Point] = field(default_factory=dict)
    route: list[str] = field(default_factory=list)
    notes: Counter[tuple[str, str]] = field(default_factory=Counter)

    def leave_out(self, what: str, why: str) -> None:
        """Note that something is not in the scenario, or is there otherwise."""
        self.notes[what, why] += 1

    def left_out(self) -> list[str]:
        """A sentence for each kind of thing that was noted."""
        return [f"{what}{f' ({count} times)' if count > 1 else ''}: {why}" for (what, why), count in self.notes.items()]

    def points(self) -> list[Point]:
        """Points that the world must hold: solid things, robots, places, areas and lights."""
        found: list[Point] = [] if self.cells is None else self.cells.corners()
        for each in [*self.solids, *self.areas.values()]:
            found += _around(each) if isinstance(each, Disc) else each.corners if isinstance(each, Outline) else each
        for robots in self.robots:
            found += [(pose.x, pose.y) for pose in robots.poses] + list(robots.box or ())
        return [*found, *(point for point, _ in self.places.values()), *self.lights.values()]


def _around(disc: Disc) -> Sequence[Point]:
    (x, y), r = disc.center, disc.radius
    return (x - r, y - r), (x + r, y + r)


def bounds(points: Iterable[Point]) -> tuple[Point, Point]:
    """Lower left and upper right corner of what holds these points. Raises ValueError if there is none."""
    xs, ys = zip(*points, strict=True)
    return (min(xs), min(ys)), (max(xs), max(ys))
