"""Cross-talk: a sonar mistakes a late echo of another ping for its own and reads too short a range.

A sonar listens from its own ping until the first sound that it takes for an echo, and ignores sounds from within the
least range. These sounds may interfere; path lengths are in m, and times follow from the speed of sound:

- an earlier ping of the same ring, reflected by something farther away in front of the listening sonar: that sonar
  itself sees it at range d, so the path is 2 d, travelled since the earlier ping;
- the second echo of an earlier ping, reflected by the robot and again by what it met: twice its path;
- the ping of another robot, on the direct path, of the same type or of another type with cross-talk.

A sound is received only within twice the greatest range, only by a sonar whose axis is within `spread` of the
sender's, and only with the model's probability. So a pause of twice the greatest range between an echo and the next
ping prevents cross-talk within a ring.

Bodies stand still for a tick, as in `bodies.proximity`, and pings that another robot sends after the tick's end are
not received in it. A reading that another robot has shortened does not make the next ping earlier, so the order in
which robots are processed does not matter.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import ceil, pi

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import key, uniform
from sleepcast.core.records import NamedTuple
from sleepcast.simulator.scenario.robot_settings import CrosstalkModel, Ring
from sleepcast.simulator.sonar.cones import Ranges
from sleepcast.simulator.world.grid import Floats, Grid, Whole, pairs, sort, spread

SOUND = 343.0
"""Speed of sound in air at 20 degrees Celsius, m/s."""
QUICKEST = 1e-3
"""Least time between two pings of a ring, s."""
MAX_PAIRS = 1 << 20
"""Pairs of pings processed at once: some hundred megabytes."""
CLEAR = 0.05
"""Share by which a noisy range may fall short of an audible robot: anything nearer than that blocks the sound."""


class Pings(NamedTuple):
    """Pings of one tick, arrays of equal length.

    robot, sonar: the sender
    axis: of the sonar, rad from the heading
    sent: time, s
    seen: the true range, and read: the measured range, m (equal for earlier ticks)
    """

    robot: Whole
    sonar: Whole
    axis: Floats
    sent: Floats
    seen: Floats
    read: Floats

    def of(self, which: NDArray[np.bool_] | Whole) -> Pings:
        return Pings._make(column[which] for column in self)

    @staticmethod
    def joined(parts: Iterable[Pings]) -> Pings:
        return Pings._make(np.concatenate(columns) for columns in zip(NONE, *parts, strict=True))


NONE = Pings(np.empty(0, np.int64), np.empty(0, np.int64), *np.empty((4, 0)))


class RingPoses(NamedTuple):
    """All bodies at the end of a tick: x, y (m), heading of their rings (rad), radii (m)."""

    x: Floats
    y: Floats
    heading: Floats
    radii: Floats


class Crosstalk:
    """Recent pings of the sonars of `count` robots; the first of these robots has index `first`.

    axes: of the sonars, rad
    radius: of the bodies, m
    grid: over the world
    """

    def __init__(
        self,
        model: CrosstalkModel,
        ring: Ring,
        axes: Floats,
        radius: float,
        count: int,
        grid: Grid,
        seed: int,
        first: int = 0,
    ) -> None:
        self._model, self._ring, self._axes, self._radius, self._seed = model, ring, axes, radius, seed
        self._longest = 2.0 * ring.most / SOUND
        """Seconds for which a ping can be received."""
        under_way = self._most_under_way(ring.pause or 0.0)
        self._sent: Floats = np.full((count, under_way), -np.inf)
        """Times of each robot's latest pings, s; the sonars that sent them, and the ranges seen, m."""
        self._by: Whole = np.zeros((count, under_way), np.int64)
        self._seen: Floats = np.zeros((count, under_way))
        self._next: Whole = np.zeros(count, np.int64)
        self._now: list[Pings] = []
        self._before = NONE
        self._draws = 0
        self._grid, self._first = grid, first

    def make_room(self) -> None:
        """Allocate for rings with any pause: as many pings as can be under way without a pause."""
        more = self._most_under_way(0.0) - self._sent.shape[1]
        oldest_first = (self._next[:, None] + np.arange(self._sent.shape[1])) % self._sent.shape[1]
        self._next[:] = self._sent.shape[1] if more else 0
        for name, empty in (("_sent", -np.inf), ("_by", 0), ("_seen", 0.0)):
            oldest_first_values = np.take_along_axis(getattr(self, name), oldest_first, axis=1)
            setattr(self, name, np.pad(oldest_first_values, ((0, 0), (0, more)), constant_values=empty))

    def _most_under_way(self, pause: float) -> int:
        """Number of pings of one ring that can be audible at once, with this pause (s)."""
        shortest = max(pause + 2.0 * self._ring.least / SOUND, QUICKEST)
        return max(1, ceil(self._longest / shortest))

    def columns(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes and that the next ticks depend on, by name."""
        return {"ping_sent": self._sent, "ping_by": self._by, "ping_seen": self._seen, "ping_next": self._next}

    def hear(self, tick: int, robots: Whole, sonar: Whole, sent: Floats, own: Ranges) -> Ranges:
        """Readings of one sonar of each of these robots, which ping at the times `sent` (s) and would read `own` (m)
        without cross-talk."""
        ring, seen = self._ring, own.astype(np.float64)
        if self._model.robots and not self._now:
            self._before = self._under_way()
        on_its_way = SOUND * (sent[:, None] - self._sent[robots]) / 2.0
        beside = self._near(self._axes[self._by[robots]], self._axes[sonar][:, None])
        farther, again = seen[:, None], 2.0 * self._seen[robots]
        read = seen.copy()
        for path, in_range in ((farther, farther < ring.most), (again, again <= ring.most)):
            taken = path - on_its_way
            heard = beside & in_range & (taken >= ring.least) & self._by_chance("own", tick, taken.shape)
            read = np.minimum(read, np.where(heard, taken, np.inf).min(axis=1))
        slot = self._next[robots]
        self._sent[robots, slot], self._by[robots, slot], self._seen[robots, slot] = sent, sonar, seen
        self._next[robots] = (slot + 1) % self._sent.shape[1]
        if self._model.robots:
            self._now.append(Pings(robots + self._first, sonar, self._axes[sonar], sent, seen, read))
        shortened: Ranges = read.astype(np.float32)
        return shortened

    def sent(self) -> tuple[Pings, Pings]:
        """The pings of this tick, and the earlier ones that are still audible; with global robot indices."""
        before = self._before if self._now else self._under_way() if self._model.robots else NONE
        return Pings.joined(self._now), before

    def end(self) -> None:
        """Finish the tick: keep the pings that are still audible."""
        self._now = []
        self._draws = 0  # each tick has its own random numbers

    def _under_way(self) -> Pings:
        """The pings that are still audible."""
        robot, slot = np.nonzero(self._sent > self._sent.max() - self._longest)
        seen, sonar = self._seen[robot, slot], self._by[robot, slot]
        return Pings(robot + self._first, sonar, self._axes[sonar], self._sent[robot, slot], seen, seen)

    def hear_others(self, tick: int, scene: RingPoses, mine: Pings, theirs: Pings, readings: Ranges) -> None:
        """Shorten the readings of this tick by pings of other robots.

        mine: pings of this tick, by these robots
        theirs: by all
        readings: shape (robots, sonars), changed in place
        """
        if not len(mine.robot):
            return
        mine = by_robot(mine)
        x, y, _, radii = scene
        reach = self._ring.most + self._radius + float(radii.max())
        i, j = pairs(self._grid, sort(self._grid, x, y), x, y, reach, np.unique(mine.robot))
        chances = [np.subtract(*_between(pings.robot, each)[::-1]) for pings, each in ((mine, i), (theirs, j))]
        block = np.cumsum(chances[0] * chances[1]) // MAX_PAIRS
        read = mine.read.copy()
        for some in np.split(np.arange(len(i)), np.flatnonzero(np.diff(block)) + 1):
            self._hear_some(tick, scene, mine, theirs, i[some], j[some], read)
        # A sonar may ping twice in a tick: only its last reading counts.
        changed, row = np.flatnonzero(read < mine.read), mine.robot - self._first
        latest = np.full(readings.shape, -1)
        np.maximum.at(latest, (row, mine.sonar), np.arange(len(read)))
        changed = changed[latest[row[changed], mine.sonar[changed]] == changed]
        readings[row[changed], mine.sonar[changed]] = read[changed]

    def _hear_some(
        self, tick: int, scene: RingPoses, mine: Pings, theirs: Pings, i: Whole, j: Whole, read: Floats
    ) -> None:
        """Shorten the ranges `read` by `mine` where the robots `i` receive pings of the robots `j`, pair by pair."""
        x, y, heading, radii = scene
        apart = np.hypot(x[j] - x[i], y[j] - y[i]) - (radii[i] + radii[j])
        direction = np.arctan2(y[j] - y[i], x[j] - x[i])
        direction[(x[j] == x[i]) & (y[j] == y[i])] = np.nan  # at one place: in every direction, see `_near`
        # Combine each pair with each ping of the receiver, then these with each ping of the sender.
        pair, ping = spread(np.arange(len(i)), *_between(mine.robot, i))
        faces = self._faces(mine, ping, heading[i][pair], direction[pair], apart[pair])
        pair, ping = pair[faces], ping[faces]
        index, other = spread(np.arange(len(pair)), *_between(theirs.robot, j[pair]))
        pair, ping = pair[index], ping[index]
        faces = self._faces(theirs, other, heading[j][pair], direction[pair] + pi, apart[pair])
        pair, ping, other = pair[faces], ping[faces], other[faces]
        taken = (apart[pair] + SOUND * (theirs.sent[other] - mine.sent[ping])) / 2.0
        heard = (taken >= self._ring.least) & (taken < mine.read[ping])
        heard &= self._by_chance("others", tick, taken.shape)
        np.minimum.at(read, ping[heard], taken[heard])

    def _faces(self, pings: Pings, which: Whole, heading: Floats, way: Floats, apart: Floats) -> NDArray[np.bool_]:
        """Whether the sonars of these pings face the direction `way` (rad) to a robot `apart` m away, with nothing
        nearer in between."""
        clear = pings.seen[which] >= (1.0 - CLEAR) * apart
        return self._near(pings.axis[which] + heading, way) & clear

    def _near(self, one: Floats, other: Floats) -> NDArray[np.bool_]:
        """Whether two directions are near each other; NaN is near all."""
        far: NDArray[np.bool_] = np.abs((one - other + pi) % (2.0 * pi) - pi) > self._model.spread
        return ~far

    def _by_chance(self, what: str, tick: int, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """Whether each sound is received, drawn with the model's probability."""
        if self._model.chance >= 1.0:
            return np.ones(shape, bool)
        numbers = np.arange(self._draws, self._draws + int(np.prod(shape)), dtype=np.uint64)
        self._draws += len(numbers)
        type_key = (self._first,) if self._first else ()  # each robot type has its own random numbers
        return (uniform(key(self._seed, "crosstalk", what, tick, *type_key), numbers) < self._model.chance).reshape(
            shape
        )


def add_crosstalk(tick: int, scene: RingPoses, talks: Sequence[tuple[Crosstalk, Ranges]]) -> None:
    """End the tick: shorten its readings by pings of other robots. talks: for each type its cross-talk and its
    readings, changed in place."""
    sent = [talk.sent() for talk, _ in talks]
    theirs = by_robot(Pings.joined([*(before for _, before in sent), *(now for now, _ in sent)]))
    for (talk, readings), (mine, _) in zip(talks, sent, strict=True):
        talk.hear_others(tick, scene, mine, theirs, readings)
        talk.end()


def by_robot(pings: Pings) -> Pings:
    """The pings sorted by robot, and by time for each robot."""
    return pings.of(np.lexsort((pings.sent, pings.robot)))


def _between(robots: Whole, which: Whole) -> tuple[Whole, Whole]:
    """Begin and end (exclusive) of the entries of each of these robots in a sorted list of robots."""
    return np.searchsorted(robots, which), np.searchsorted(robots, which, side="right")
