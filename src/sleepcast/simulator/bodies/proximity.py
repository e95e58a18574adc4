"""Proximity: `Neighbours` finds what is near each body, bumpers stop bodies at contact and sense where it is, and
sonars measure exact ranges of cones, with noise, dropouts, limits and age.

`motion.steps` computes how far each body gets.

Without a firing order every sonar fires in every tick, and readings are computed on request. With one, a robot's
sonars fire one after the other (see `sonar.firing`), and a sonar keeps its reading until it fires again.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from math import pi, sqrt
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.arrays import count_up
from sleepcast.core.counter_rng import key
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion.steps import SKIN, Settled
from sleepcast.simulator.scenario.robot_settings import Ring, RobotSpec
from sleepcast.simulator.simd.formulas import wrap
from sleepcast.simulator.sonar.cones import Cones, Ranges, Seen, VisibleScene
from sleepcast.simulator.sonar.crosstalk import Crosstalk, RingPoses, add_crosstalk
from sleepcast.simulator.sonar.firing import Firing, Tick, fire
from sleepcast.simulator.sonar.noise import Noise, SonarReceiver
from sleepcast.simulator.world.grid import (
    CellLists,
    Floats,
    Grid,
    Sorted,
    Whole,
    list_solids,
    only,
)
from sleepcast.simulator.world.torus import PLAIN, Around, Images, cells_over
from sleepcast.simulator.world.world import World

Made = TypeVar("Made")

SMALL, MAX_KEPT = 2_000, 32
"""Solids of a small world, whose cell lists are kept for others with the same solids; and lists that are kept."""
_kept: dict[tuple[str, Grid, float, bytes], Any] = {}


def _known(what: str, grid: Grid, reach: float, lines: Floats, make: Callable[[], Made]) -> Made:
    """What is made of a world's solids, `lines`; of a small one once for all worlds with the same."""
    if len(lines) > SMALL:
        return make()
    key = what, grid, reach, lines.tobytes()
    made: Made | None = _kept.get(key)
    if made is None:
        if len(_kept) >= MAX_KEPT:
            _kept.clear()
        made = _kept[key] = make()
    return made


class Flying(Protocol):
    """What flies among bodies, as far as it concerns those on the ground; see `flight.Flight`."""

    flies: NDArray[np.bool_]

    def low(self, x: Floats, y: Floats, /) -> NDArray[np.bool_]: ...


class Neighbours:
    """The spatial index of motion and sonar.

    size: of the world, m
    cell: least side, m
    count: of bodies
    around, reach: see `torus.cells_over`
    there: which of the bodies are there, None if all are; changed in place
    flight: of what flies only that is listed which is low enough for those on the ground to meet it; None for all
    """

    def __init__(
        self,
        size: tuple[float, float],
        cell: float,
        count: int,
        world: World,
        machine: Machine,
        around: Around = PLAIN,
        reach: float = 0.0,
        there: NDArray[np.bool_] | None = None,
        flight: Flying | None = None,
    ) -> None:
        self._there, self._flight = there, flight
        self._cells = cells_over(size, around, cell, reach, count)
        self.grid = self._cells.grid
        self.world = world
        self._machine = machine
        self._images: Images | None = None
        self._points: Sorted | None = None
        self._lines: tuple[Floats, NDArray[np.intp]] | None = None
        self._listed: dict[float, CellLists] = {}
        self._in_sight: dict[float, Seen] = {}
        self._version = -1

    def forget(self) -> None:
        """Invalidate the sorted bodies: they have moved."""
        self._images = self._points = None

    def know(self, points: Sorted, x: Floats, y: Floats) -> None:
        """These are the bodies at x, y (m) by cell, in arrays that may hold others later."""
        self._machine.forget()
        self.images(x, y)
        self._points = points

    def knows(self, points: Sorted) -> bool:
        """Whether these arrays are still the bodies by cell."""
        return self._points is points

    def images(self, x: Floats, y: Floats) -> Images:
        """The bodies at x, y (m), and on a torus their images."""
        if self._images is None:
            self._images = self._cells.images(x, y)
        return self._images

    def points(self, x: Floats, y: Floats) -> Sorted:
        """These bodies and images by cell."""
        if self._points is None:
            images = self.images(x, y)
            self._points = self._machine.sort(self.grid, images.x, images.y)
            if self._there is not None:
                self._points = only(self._points, self._there[images.of])
            if self._flight is not None:
                self._points = only(self._points, self._flight.low(x, y)[images.of])
        return self._points

    @property
    def lines(self) -> Floats:
        """The world's solids, and on a torus their images."""
        return self._lines_and_rows()[0]

    @property
    def tops(self) -> Floats:
        """How high these are, m above the ground; infinite without limit."""
        lines, rows = self._lines_and_rows()
        tops = self.world.tops
        return np.full(len(lines), np.inf) if tops is None else tops[rows]

    def _lines_and_rows(self) -> tuple[Floats, NDArray[np.intp]]:
        self._keep_up()
        if self._lines is None:
            self._lines = self._cells.solids(self.world.solids)
        return self._lines

    def solids(self, reach: float) -> CellLists:
        """The world's solids that come within `reach` m of each cell."""
        self._keep_up()
        if reach not in self._listed:
            grid, lines = self.grid, self.lines
            self._listed[reach] = _known("cells", grid, reach, lines, lambda: list_solids(grid, lines, reach))
        return self._listed[reach]

    def in_sight(self, reach: float) -> Seen:
        """The solids within `reach` m of each cell, in the form that the backend's sonars use."""
        self._keep_up()
        if reach not in self._in_sight:
            grid, lines, machine = self.grid, self.lines, self._machine
            make = lambda: machine.in_sight(list_solids(grid, lines, reach), lines)  # noqa: E731
            self._in_sight[reach] = _known(machine.name, grid, reach, lines, make)
        return self._in_sight[reach]

    def _keep_up(self) -> None:
        """Drop the lists if the world has changed."""
        if self._version != self.world.version:
            self._lines = None
            self._listed.clear()
            self._in_sight.clear()
            self._version = self.world.version


CELL = 3.0
"""Side of a cell in radii of a body, unless something else needs larger ones: about one body fits in."""


class Bumpers:
    """Contact of bodies on the ground with each other, with what flies low, and with solids.

    radii: of the bodies, m
    reach: greatest distance of a solid that a body can touch within one tick, m
    flight: whoever flies, and meets nobody itself: what it touches, `crashes` finds out
    """

    def __init__(
        self, radii: Floats, reach: float, near: Neighbours, machine: Machine, flight: Flying | None = None
    ) -> None:
        self.radii, self._flight = radii, flight
        alike = radii.min(initial=np.inf) == radii.max(initial=0.0)
        self.of_each = radii[:1].copy() if alike else radii
        """Radii by body, or one for all, m."""
        self._near, self._machine, self.reach = near, machine, reach

    def settle(self, x: Floats, y: Floats, dx: Floats, dy: Floats, settled: Settled) -> None:
        """Write into `settled` how far bodies at x, y (m) get along `dx` and `dy` (m); what flies has moved already."""
        near, listed = self._near, self._near.solids(self.reach)
        if self._flight:
            dx, dy = (np.where(self._flight.flies, 0.0, each) for each in (dx, dy))
        every_x, every_y, of = near.images(x, y)
        radii = self.of_each[of] if len(self.of_each) > 1 else self.of_each
        every = settled if len(every_x) == len(x) else Settled(*np.empty((3, len(every_x))))
        positions, way = (every_x, every_y), (dx[of], dy[of])
        self._machine.settle(near.grid, near.points(x, y), listed, near.lines, radii, positions, way, every)
        if every is not settled:
            for mine, each in zip(settled, every, strict=True):
                mine[:] = each[: len(x)]
        if self._flight:
            for column, nothing in zip(settled, (1.0, 0.0, 0.0), strict=True):
                column[self._flight.flies] = nothing


def reach(robots: RobotSpec, tick: float) -> float:
    """Greatest distance of a solid that a body can touch in one tick, slip included, m."""
    return robots.geometry.radius + SKIN + 2.0 * robots.limits.speed * tick


def least_cell(robots: RobotSpec, size: tuple[float, float], tick: float) -> float:
    """Side of a cell for bodies without sonars, m; larger where they are sparse."""
    each = sqrt(size[0] * size[1] / robots.count)  # side of a square with one robot on average
    return max(CELL * robots.geometry.radius, reach(robots, tick), each)


# ---- sonars

AT_ONCE = 65_536
"""Robots whose stored readings are copied at a time: bounds the temporary arrays."""
FRONT = pi / 2
"""Sonars whose axis is at most this far from the heading count as front sonars, rad."""


class Sonars:
    """The sonars of many robots.

    sensed: readings, m, shape (sonars + 1, robots), updated by `sense`; the last row is the minimum of the front
        sonars
    firing: which sonar fires when
    readings: with a firing order, the last reading of each sonar, m, shape (robots, sonars), float32, NaN before the
        first
    turret: angle of the ring from each robot's heading, rad, changed by its owner between ticks; None: 0

    robots: with several robot types, the slice of robots that have these sonars: the arrays then hold only these, while
        indices in arguments are those of all
    radii: with several robot types, of all bodies, m
    """

    def __init__(
        self,
        ring: Ring,
        cones: Cones,
        sensed: Floats,
        near: Neighbours,
        seed: int,
        machine: Machine,
        robots: slice | None = None,
        radii: Floats | None = None,
    ) -> None:
        self.ring, self.cones, self.sensed = ring, cones, sensed
        count = sensed.shape[1]
        self.robots = robots or slice(0, count)
        self.radii = radii
        self.firing = Firing(ring, count)
        self.readings: Ranges = np.empty((0, ring.count), np.float32)
        self._make_room()
        self.turret: Floats | None = None
        self.front = np.flatnonzero(np.abs((self.cones.axes + pi) % (2.0 * pi) - pi) <= FRONT + 1e-9)
        """Numbers of the front sonars."""
        self._near, self._machine, self._seed = near, machine, seed
        self.crosstalk = (
            Crosstalk(ring.crosstalk, ring, cones.axes, cones.radius, count, near.grid, seed, self.robots.start)
            if ring.crosstalk
            else None
        )
        self._version = -1
        self._everybody: Whole = count_up(count, np.intp)
        self._fresh = np.zeros(count, bool)
        """Robots whose readings are up to date in the `_wanted` rows."""
        self._wanted = np.ones(ring.count + 1, bool)
        self._complete = False
        """Whether it is known at a glance that all of them are, in all rows."""

    def arrange(self, robot: int, order: Sequence[int], pause: float) -> None:
        """Set the firing order of one robot, each sonar `pause` s after the echo of the one before; an empty order
        turns all off. Takes effect after the ping under way and its pause. A sonar that does not fire keeps its
        reading. Raises MisuseError for an unknown sonar or too long an order or pause, IndexError for a robot without
        these sonars."""
        row = robot - self.robots.start
        if not 0 <= row < self.sensed.shape[1]:
            raise IndexError(f"robot {robot} has not got these sonars")
        self.firing.check(order, pause)
        self.part()
        self.firing.arrange(row, order, pause)

    def part(self) -> None:
        """Allocate a separate order and pause for each robot."""
        if self.crosstalk and not self.firing.arranged:
            self.crosstalk.make_room()
        self.firing.part()
        self._make_room()

    def _make_room(self) -> None:
        """Allocate readings if sonars fire in order."""
        if self.firing.in_order and not len(self.readings):
            self.readings = np.full((self.sensed.shape[1], self.ring.count), np.nan, np.float32)

    def forget(self) -> None:
        """Invalidate the readings: bodies or obstacles have moved."""
        self._fresh[:] = self._complete = False

    def note(self, wanted: NDArray[np.bool_]) -> None:
        """All readings are up to date in the `wanted` rows: somebody else has measured them. shape (sonars + 1,)"""
        self._version = self._near.world.version
        self._wanted = wanted.copy()
        self._fresh[:] = True
        self._complete = bool(np.count_nonzero(wanted) == len(wanted))  # sooner than `all` of so few

    def sense(
        self,
        which: Whole | None,
        tick: int,
        pose: tuple[Floats, Floats, Floats],
        rows: Collection[int] | None = None,
    ) -> None:
        """Update `sensed` for the robots `which` (indices; None: all with these sonars), at least in these `rows`
        (None: all). pose: true x, y (m) and heading (rad) of all bodies."""
        if self._version != self._near.world.version:
            self.forget()
            self._version = self._near.world.version
        if self._complete:
            return
        old = self._old(None if which is None else which - self.robots.start, rows)
        if not len(old):
            return
        self._fresh[slice(None) if which is None else old] = True
        if self.firing.in_order:
            at_once = self.firing.at_once(old)
            old, in_order = old[at_once], old[~at_once]
            for begin in range(0, len(in_order), AT_ONCE):
                some = in_order[begin : begin + AT_ONCE]
                their: slice | Whole = some
                if (np.diff(some) == 1).all():  # contiguous: nothing need be copied
                    their = slice(int(some[0]), int(some[-1]) + 1)
                self._machine.tell(self.readings[their], some, self._receiver(None), self.sensed)
        if not len(old):
            return
        receiver = self._receiver(self._noise(tick))
        if self.radii is not None:
            self._machine.tell(
                self._machine.ranges(self._view(pose), old + self.robots.start), old, receiver, self.sensed
            )
        else:
            self._machine.hear(self._view(pose), old, receiver, self.sensed)

    def _old(self, own: Whole | None, rows: Collection[int] | None) -> Whole:
        """Indices of those robots (None: all) whose readings in these rows are out of date."""
        wanted = np.full(len(self._wanted), rows is None)
        wanted[list(rows or ())] = True
        if not self._fresh.any():
            self._wanted = wanted
            return self._everybody if own is None else own
        if (wanted & ~self._wanted).any():
            self._wanted = wanted | self._wanted
            self._fresh[:] = False
        return np.flatnonzero(~self._fresh) if own is None else own[~self._fresh[own]]

    def fire(self, tick: int, until: float, pose: tuple[Floats, Floats, Floats]) -> None:
        """Fire the sonars that are due before the time `until` (s), store their readings, and apply cross-talk."""
        self.shoot(tick, until, pose)
        exchange_crosstalk(tick, pose, [self])

    def shoot(self, tick: int, until: float, pose: tuple[Floats, Floats, Floats]) -> None:
        """As `fire`, without cross-talk between robots."""
        firing = self.firing
        if not firing.in_order:
            return
        firing.begin(tick, until)
        view = self._view(pose, alone=True)
        now = Tick(view, self.robots.start, until, self.ring.least, self._noise(tick), self.readings)
        if self.crosstalk is None:
            self._machine.fire(firing, now)
        else:
            fire(firing, now, self._machine.look, partial(self.crosstalk.hear, tick))

    def turned(self, heading: Floats) -> Floats:
        """The headings of all bodies with the turrets of these robots added, rad."""
        if self.turret is None:
            return heading
        heading = heading.copy()
        heading[self.robots] = wrap(heading[self.robots] + self.turret)
        return heading

    def state(self) -> Iterable[NDArray[np.generic]]:
        """The arrays that the next ticks depend on, for the state hash."""
        yield from self.arrays().values()

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """These arrays by name, for snapshots."""
        if not self.firing.in_order:
            return {}
        return {
            "readings": self.readings,
            **self.firing.arrays(),
            **(self.crosstalk.columns() if self.crosstalk else {}),
        }

    def _view(self, pose: tuple[Floats, Floats, Floats], alone: bool = False) -> VisibleScene:
        """The scene that cones are computed in: for whole rings, or for single sonars (`alone`)."""
        near, (x, y, heading), far = self._near, pose, self.cones.radius + self.cones.most
        points, listed = near.points(x, y), near.solids(far) if alone else near.in_sight(far)
        every_x, every_y, of = near.images(x, y)
        radii = None if self.radii is None else self.radii[of]
        return VisibleScene(
            self.cones, near.grid, points, listed, near.lines, (every_x, every_y, self.turned(heading)[of]), radii
        )

    def _receiver(self, noise: Noise | None) -> SonarReceiver:
        return SonarReceiver(self.ring.least, self.ring.most, self.front, noise, self._wanted)

    def _noise(self, tick: int) -> Noise | None:
        """Noise and dropout of this tick, None for neither."""
        ring = self.ring
        if not (ring.noise or ring.dropout):
            return None
        type_key = (self.robots.start,) if self.robots.start else ()  # each robot type has its own random numbers
        keys = (key(self._seed, what, tick, *type_key) for what in ("echo", "dropout"))
        return Noise(ring.noise, ring.dropout, ring.most, *keys)


def exchange_crosstalk(tick: int, pose: tuple[Floats, Floats, Floats], rings: Sequence[Sonars]) -> None:
    """Apply cross-talk among those of these rings that model it."""
    talks = [(ring.crosstalk, ring.readings) for ring in rings if ring.crosstalk]
    if not talks:
        return
    x, y, heading = pose
    radii = np.empty(len(x))
    for ring in rings:
        heading = ring.turned(heading)
        radii[:] = ring.cones.radius if ring.radii is None else ring.radii
    add_crosstalk(tick, RingPoses(x, y, heading, radii), talks)


class SonarGroups:
    """Sonars of several robot types: one ring for each type, one table for all. sensed: m, shape (sonars + 1, robots),
    NaN where a type has fewer sonars; the last row is the least of the front sonars."""

    def __init__(self, rings: Sequence[Sonars], sensed: Floats) -> None:
        self.rings, self.sensed = rings, sensed

    def of(self, robot: int) -> Sonars | None:
        """The sonars of the robot with this index, None without any."""
        return next((ring for ring in self.rings if ring.robots.start <= robot < ring.robots.stop), None)

    def forget(self) -> None:
        """See `Sonars.forget`."""
        for ring in self.rings:
            ring.forget()

    def sense(
        self,
        which: Whole | None,
        tick: int,
        pose: tuple[Floats, Floats, Floats],
        rows: Collection[int] | None = None,
    ) -> None:
        """Update all rows of `sensed` for the robots `which` (indices; None: all); see `Sonars.sense`."""
        for ring in self.rings:
            first, last = ring.robots.start, ring.robots.stop
            mine = None if which is None else which[(which >= first) & (which < last)]
            ring.sense(mine, tick, pose)
            columns = ring.robots if mine is None else mine
            heard = ring.sensed if mine is None else ring.sensed[:, mine - first]
            self.sensed[: len(heard) - 1, columns] = heard[:-1]
            self.sensed[-1, columns] = heard[-1]

    def fire(self, tick: int, until: float, pose: tuple[Floats, Floats, Floats]) -> None:
        """Fire the sonars that are due before the time `until` (s), then apply cross-talk among all of them."""
        for ring in self.rings:
            ring.shoot(tick, until, pose)
        exchange_crosstalk(tick, pose, self.rings)

    def state(self) -> Iterable[NDArray[np.generic]]:
        """See `Sonars.state`."""
        for ring in self.rings:
            yield from ring.state()
