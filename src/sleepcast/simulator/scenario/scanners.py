"""The laser scanner and the camera of robots, as a scenario file describes them.

`bodies.scanner` and `bodies.seeing` simulate them, and `bodies.looking_down` the cameras of what flies, whose angle is
a key of [robots]; expressions ask them by functions.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import pi

import numpy as np

from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table
from sleepcast.core.units import LENGTH
from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_WORLD
from sleepcast.simulator.scenario.signals import SIGHT_SINCE
from sleepcast.simulator.simd.formulas import TURN, Floats

MAX_BEAMS = 1_080
"""Beams of one scanner: those of common ones, a quarter of a degree apart over 270 degrees."""
MAX_RANGES = 100_000_000
"""Beams of all robots: what they measure in a tick takes 400 megabytes."""
LEAST_FIELD = 1e-3
"""Least angle between the first beam and the last, rad: narrower ones could not be told apart."""
WHOLE = 1e-9
"""By how much a field may differ from a whole turn, rad, and count as one."""


@dataclass(frozen=True, slots=True)
class LaserModel:
    """A scanner in the middle of each robot, whose beams are numbered counter-clockwise.

    beams: their number
    first: angle of beam 0 from the heading, rad, counter-clockwise
    increment: angle between neighbouring beams, rad
    least, reach: what is nearer or farther is not measured, m from the robot's centre
    noise: standard deviation of a range, m
    """

    beams: int
    first: float
    increment: float
    least: float
    reach: float
    noise: float

    @property
    def last(self) -> float:
        """Angle of the last beam, rad."""
        return self.first + self.increment * (self.beams - 1)

    @property
    def angles(self) -> Floats:
        """Angles of all beams from the heading, rad, shape (beams,)."""
        angles: Floats = self.first + self.increment * np.arange(self.beams, dtype=np.float64)
        return angles

    @property
    def closed(self) -> bool:
        """Whether beams go all the way around, so that the last one is the first one's neighbour."""
        return abs(self.increment * self.beams - TURN) <= WHOLE


@dataclass(frozen=True, slots=True)
class CameraModel:
    """A camera that looks all around. reach: how far away robots are recognized, m."""

    reach: float


def read_laser(root: Table, version: int) -> LaserModel | None:
    """The table `[laser]`, None if there is none. version: of the scenario's format."""
    if not root.has("laser"):
        return None
    _refuse_old(root, "laser", version)
    with root.table("laser") as table:
        beams = table.whole("beams", low=1, high=MAX_BEAMS)
        first = table.number("from", default=-pi, low=-TURN, high=TURN)
        last = table.number("to", default=first + TURN, low=-TURN, high=2.0 * TURN)
        if not LEAST_FIELD <= last - first <= TURN + WHOLE:
            raise table.error("to", "beams go counter-clockwise from `from` to `to`, which is greater by 0.1 to 360deg")
        reach = table.number("range", LENGTH, low=LEAST, high=MAX_WORLD)
        whole = last - first >= TURN - WHOLE
        return LaserModel(
            beams=beams,
            first=first,
            increment=TURN / beams if whole else (last - first) / max(beams - 1, 1),
            least=table.number("least", LENGTH, 0.0, low=0.0, high=reach),
            reach=reach,
            noise=table.number("noise", LENGTH, 0.0, low=0.0, high=reach),
        )


def refuse_many(root: Table, laser: LaserModel | None, robots: int) -> None:
    """Raise SettingsError where all robots together have more beams than fit."""
    if laser is not None and laser.beams * robots > MAX_RANGES:
        most = MAX_RANGES // robots
        raise root.table("laser").error(
            "beams", f"{robots} robots with {laser.beams} beams each are too many: at most {most} beams each fit"
        )


def read_camera(root: Table, version: int) -> CameraModel | None:
    """The table `[camera]`, None if there is none. version: of the scenario's format."""
    if not root.has("camera"):
        return None
    _refuse_old(root, "camera", version)
    if not root.has("neighbours"):
        raise root.error("camera", "robots show colours to their neighbours: add a table [neighbours] with its reach")
    with root.table("camera") as table:
        return CameraModel(table.number("range", LENGTH, low=LEAST, high=MAX_WORLD))


def refuse_blind(root: Table, tables: Iterable[Table], version: int) -> None:
    """Raise SettingsError for a camera of a robot that looks down where there is nothing that it could see."""
    for table in tables:
        if table.has("camera"):
            _refuse_old(table, "camera", version)
            if not (root.has("neighbours") or root.has("lights")):
                why = "it sees lights, and robots by what they show: add a table [neighbours] with its reach, or lights"
                raise table.error("camera", why)


def _refuse_old(root: Table, key: str, version: int) -> None:
    """Raise SettingsError in a file of a format in which nothing hides anything."""
    if version < SIGHT_SINCE:
        raise root.error(key, f"it does not see through walls, so it is of format {SIGHT_SINCE}: write format = 2")
