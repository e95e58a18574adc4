"""The array backend with compiled kernels: takes and returns NumPy arrays, on one or more threads.

Threads divide the rows of cells, with about equally many robots each, or the robots by number. Handing work to
another thread takes longer than small tasks do, so one thread works alone below `ALONE` robots; the limit is `LIGHT`
for cheap work and `WATCHFUL` for expensive work.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import lru_cache
from math import cos, frexp, ldexp, pi, sin, sqrt
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.arrays import LINE, Arena
from sleepcast.core.records import NamedTuple
from sleepcast.core.threads import FEW, SIZES, ThreadPool, borders
from sleepcast.simulator.laser.beams import ROUGH, SLACK, BeamScene, far_of
from sleepcast.simulator.motion.driving import Laws
from sleepcast.simulator.motion.flying import FlightColumns, Power, TypeLaws
from sleepcast.simulator.motion.steps import SKIN, BodyColumns, Displacement, Draws, Settled, boxes_of, clear
from sleepcast.simulator.neighbours.neighbourhood import Formula, Neighbourhood, Vicinity
from sleepcast.simulator.scenario.scanners import LaserModel
from sleepcast.simulator.simd.cached import CachedKernels
from sleepcast.simulator.simd.formulas import LANES, sine_cosine
from sleepcast.simulator.sonar.cones import Cones, Ranges, VisibleScene
from sleepcast.simulator.sonar.fields import SPAN, Fields, Shots, beam_of, one_of_each, shots_of
from sleepcast.simulator.sonar.firing import Firing, Tick
from sleepcast.simulator.sonar.noise import Noise, SonarReceiver
from sleepcast.simulator.world.grid import CellLists, Floats, Grid, Short, Sorted, Whole
from sleepcast.simulator.world.sight import SightLines
from sleepcast.simulator.world.walls import Walls, walls_of

Result = TypeVar("Result")
Flags: TypeAlias = NDArray[np.bool_]

kernels, kernels_motion = CachedKernels("sonar.kernels"), CachedKernels("motion.kernels_motion")
kernels_flying = CachedKernels("motion.kernels_flying")
kernels_firing, kernels_sonar = CachedKernels("sonar.kernels_firing"), CachedKernels("sonar.kernels_sonar")
kernels_neighbours = CachedKernels("neighbours.kernels_neighbours")
kernels_shown = CachedKernels("neighbours.kernels_shown")
kernels_sight = CachedKernels("world.kernels_sight")
kernels_beams = CachedKernels("laser.kernels_beams")
wait = CachedKernels("simd.kernels_wait").wait

ALONE = 5_000
"""Number of robots up to which one thread is faster than several."""
LIGHT = 50_000
"""The same limit for work that only reorders numbers: some nanoseconds per robot."""
WATCHFUL = 2_000
"""The same limit for computing all sonars: some tenths of a microsecond per robot."""
CROWDED = 1_000
"""The same limit for contact between robots within reach of each other, which takes longer."""
MANY = 50_000
"""Number of robots from which on even the smallest slices take much longer than starting them."""
SCRATCH = 106
"""Scratch memory per robot that most tasks need, bytes."""
ROUNDING = 1e-3
"""Metres: a generous bound on the single-precision error of the distance between two bodies within reach."""
FINE = 1e-6
"""Metres: the kernel may use integer positions while their unit is at most this; in the large cells of a wide world
with few robots it computes everything in double precision."""
AGAIN = 1.1
"""Margin for the radius of the next contact search, relative to this one: the fastest body may have become faster."""
BEAMS = 5_000
"""Beams up to which one thread is faster than several."""
USUALLY_NEAR = 16
"""Neighbours of each robot for which there is room when they are listed; in a crowd they are listed again."""
FOLDED = 16
"""Number of sonars in a ring whose bearings the kernel can fold."""


class _Neighbourhood(NamedTuple):
    """What the sonars found out about points in this order: `close` is False for points with no other point within
    `reach` m."""

    order: Short
    reach: float
    close: Flags


class _Ring(NamedTuple):
    """Cones as the kernel expects them.

    axis_cos, axis_sin: of their axes, padded to whole LANES
    rear: which of them look behind
    lone: see `Cones.lone`
    measures: radii of the looking robot and of others, reach, most, cosine and sine of half the opening, and the
        grazing limit in both forms
    """

    axis_cos: Floats
    axis_sin: Floats
    rear: Flags
    lone: float
    measures: tuple[float, float, float, float, float, float, float, float]


@lru_cache(maxsize=16)
def ring_of(cones: Cones) -> _Ring:
    axes = np.append(cones.axes, np.zeros(-cones.count % LANES))
    graze = sin(cones.incidence) if cones.incidence < pi / 2 else 1.0
    return _Ring(
        *(np.cos(axes), np.sin(axes), np.cos(cones.axes) < -1e-9),
        cones.lone(2.0 * pi / cones.count) if cones.count == FOLDED else np.inf,
        (cones.radius, cones.radius, cones.reach, cones.most, cos(cones.half), sin(cones.half), graze, cones.grazing),
    )


class _ThreadArena(threading.local):
    def __init__(self) -> None:
        self.arena = Arena()


of_thread = _ThreadArena()
"""The scratch memory of each thread."""


class NumbaMachine:
    """See `engine.Machine`."""

    name = "numba"
    compiles = True

    def __init__(self, threads: int) -> None:
        self.pool = ThreadPool(threads, wait)
        self._own: Arena | None = None
        self._arena = of_thread.arena
        """Scratch memory of the task that began last."""
        self._fields = Fields()
        self._around: _Neighbourhood | None = None
        self._beside = np.inf
        """Metres within which other bodies can touch, as far as is known."""
        self._boxed: tuple[Floats, Floats] | None = None
        """Solids and their bounding boxes."""

    def forget(self) -> None:
        """What sonars have found out about the last points does not count any more."""
        self._around = None

    def sort(self, grid: Grid, x: Floats, y: Floats) -> Sorted:
        cells, order = np.empty(len(x), np.int32), np.empty(len(x), np.int32)
        start = np.empty(grid.cells + 1, np.int32)
        shares = 1 if len(x) <= LIGHT else self.pool.threads  # each share needs its own counts
        ends = [len(x) * share // shares for share in range(shares + 1)]
        counts = np.zeros((shares, grid.cells), np.int32)
        next_index = dict(zip(ends, counts, strict=False))  # indexed by the start of each slice

        def count(first: int, last: int) -> None:
            kernels.count(x, y, grid.size, grid.columns, grid.rows, first, last, cells, next_index[first])

        self.pool.share(count, ends)
        kernels.begin(counts, start)
        self.pool.share(lambda first, last: kernels.place(cells, first, last, next_index[first], order), ends)
        return Sorted(order, start)

    def candidates(self, grid: Grid, points: Sorted, x: Floats, y: Floats, reach: float) -> Whole:
        counts = np.empty(len(x), np.int64)
        kernels.candidates(x, y, points.start, grid.size, grid.columns, grid.rows, reach, counts)
        return counts

    def pairs(
        self, grid: Grid, points: Sorted, x: Floats, y: Floats, reach: float, first: Whole
    ) -> tuple[Whole, Whole]:
        most = int(self.candidates(grid, points, x[first], y[first], reach).sum())
        robots, others = np.empty((2, most), np.int64)
        count = kernels.pairs(x, y, *points, grid.size, grid.columns, grid.rows, reach, first, robots, others)
        return robots[:count], others[:count]

    def neighbours(self, vicinity: Vicinity, formula: Formula, robots: Whole, radius: Floats, colour: Floats) -> Floats:
        found = np.empty(len(robots))
        kernels_neighbours.prepare_one(vicinity.address)
        order = vicinity.order_of(robots)
        ask_many = kernels_neighbours.ask_many_in_ball if vicinity.ball else kernels_neighbours.ask_many

        def work(first: int, last: int) -> None:
            ask_many(vicinity.address, *formula, robots, radius, colour, order, first, last, found)

        self._share(len(robots), work, CROWDED)
        return found

    def near_lists(self, vicinity: Vicinity, robots: Whole, radius: Floats, colour: Floats) -> tuple[Whole, Whole]:
        counts = np.empty(len(robots), np.int64)
        kernels_neighbours.prepare_one(vicinity.address)
        list_many = kernels_neighbours.list_many_in_ball if vicinity.ball else kernels_neighbours.list_many
        room = USUALLY_NEAR * len(robots)
        while True:
            listed = np.empty(room + vicinity.points, np.int64)
            total = list_many(vicinity.address, robots, radius, colour, counts, listed.ctypes.data, room)
            if total >= 0:
                return counts, listed[:total]
            room *= 4

    def shown(
        self, near: Neighbourhood, quantity: int, row: int, robots: Whole, others: Floats, reach: float
    ) -> Floats:
        found = np.empty(len(robots))
        show_many = kernels_shown.show_many_in_ball if near.flies else kernels_shown.show_many
        show_many(near.address, quantity, row, robots, others, reach, found)
        return found

    def hidden(self, lines: SightLines, x: Floats, y: Floats, to_x: Floats, to_y: Floats) -> Flags:
        found = np.zeros(len(x), np.bool_)
        ends = [np.ascontiguousarray(each, np.float64) for each in (x, y, to_x, to_y)]

        def work(first: int, last: int) -> None:
            kernels_sight.hide(lines.address, *ends, first, last, found)

        if lines:
            self._share(len(x), work, CROWDED)
        return found

    def crossings(self, lines: SightLines, x: Floats, y: Floats, to_x: Floats, to_y: Floats) -> Whole:
        found = np.zeros(len(x), np.int64)
        ends = [np.ascontiguousarray(each, np.float64) for each in (x, y, to_x, to_y)]

        def work(first: int, last: int) -> None:
            looked = np.zeros(len(lines.solids), np.int32)
            kernels_sight.count(lines.address, *ends, first, last, looked, found)

        if lines:
            self._share(len(x), work, CROWDED)
        return found

    def scan(self, model: LaserModel, scene: BeamScene, which: Whole, key: int) -> Ranges:
        grid, (order, start), listed = scene.grid, scene.points, scene.listed
        sine, cosine = sine_cosine(model.angles)
        measured = np.empty((len(which), model.beams), np.float32)
        places = (scene.x, scene.y, scene.heading, scene.whose, scene.radii, order, start)
        seen = (*places, listed.start, listed.items, scene.solids, grid.size, grid.columns, grid.rows)
        far = far_of(model, 0.0), far_of(model, float(scene.radii.max(initial=0.0)))
        axes = (np.append(each, np.zeros(LANES)) for each in (cosine, sine))
        beams = (model.first, model.increment, SLACK + ROUGH / model.increment, *axes)
        limits = (model.least, model.reach, model.noise, *far)

        def work(first: int, last: int) -> None:
            kernels_beams.scan(seen, beams, limits, np.uint64(key), which, first, last, measured)

        self._share(len(which), work, BEAMS // model.beams)
        return measured

    def in_sight(self, listed: CellLists, solids: Floats) -> Walls:
        return walls_of(listed, solids)

    def ranges(self, view: VisibleScene, which: Whole) -> Ranges:
        squares = self._squares(view, which)
        seen = np.empty((len(which), view.cones.count), np.float32)
        kernels.collect(squares, seen)
        return seen

    def hear(self, view: VisibleScene, which: Whole, receiver: SonarReceiver, sensed: Floats) -> None:
        squares = self._squares(view, which, forward=not receiver.wanted[:-1][ring_of(view.cones).rear].any())
        noise = receiver.noise or Noise(0.0, 0.0, 0.0, 0, 0)
        noises = noise.share, noise.dropout, np.uint64(noise.key), np.uint64(noise.dropout_key)
        edge = -1 if sensed.strides[0] % LINE else -sensed.ctypes.data % LINE // sensed.itemsize

        def work(first: int, last: int) -> None:
            some = squares[first:last], which[first:last]
            kernels.hear(*some, noises, receiver.least, receiver.most, receiver.front, receiver.wanted, sensed, edge)

        self._share(len(which), work)

    def _squares(self, view: VisibleScene, which: Whole, *, forward: bool = False) -> Ranges:
        """The squared ranges seen by the robots `which`, one row each. forward: cones that look behind are not
        needed."""
        cones, grid, points, listed, solids, pose, radii = view
        robots, order = len(pose[0]), points.order
        arena = self._begun(robots)
        fixed_x, fixed_y = fixed = arena.take(np.int32, 2, robots + LANES)
        fixed[:, robots:] = 0
        units = ldexp(1.0, SPAN - frexp(grid.size)[1])
        self._share(
            robots, lambda first, last: kernels.fix(order, *pose[:2], units, first, last, fixed_x, fixed_y), LIGHT
        )
        rows = order
        if len(which) < robots:
            requested, rows = arena.take(np.int32, 2, robots)
            requested.fill(-1)
            requested[which] = np.arange(len(which))
            kernels.enlist(order, requested, rows)
        ring = ring_of(cones)
        squares = arena.take(np.float32, len(which), len(ring.axis_cos))
        mixed = radii is not None and bool((radii != cones.radius).any())
        wide = radii[order] if radii is not None and mixed else np.empty(0)
        walls = listed if isinstance(listed, Walls) else walls_of(listed, solids)
        beside = min(ring.lone, cones.reach, self._beside)
        close = self._looked_around(points, beside)
        lone = ring.lone if ring.lone < np.inf and 1.0 / units <= FINE else -1.0
        seen = (
            *(*pose, order, fixed_x, fixed_y, wide, rows, points.start, grid.size, grid.columns, grid.rows),
            *(walls.solids, walls.start, walls.items, walls.news, *ring.measures),
            *(lone, 1.0 / units, mixed, forward, ring.axis_cos, ring.axis_sin),
        )

        def see(first: int, last: int) -> None:
            kernels_sonar.see(*seen, first, last, beside, close, squares)

        self._share_rows(see, grid, points.start, alone=WATCHFUL)
        return squares

    def _looked_around(self, points: Sorted, reach: float) -> Flags:
        """The flags in which the sonars note, while looking at these points, which have another point within `reach`
        m."""
        if self._around is None or self._around.order is not points.order or self._around.reach != reach:
            self._around = _Neighbourhood(points.order, reach, np.ones(len(points.order), np.bool_))
        return self._around.close

    def _close(self, points: Sorted, reach: float) -> Flags:
        """Which of these points may have another one within `reach` m, as far as the sonars have found out."""
        known = self._around
        if known is not None and known.order is points.order and reach < known.reach - ROUNDING:
            return known.close
        return np.ones(len(points.order), np.bool_)

    def look(self, view: VisibleScene, which: Whole, sonars: Whole) -> Ranges:
        shots, ranges = one_of_each(view, which, sonars)
        self._shoot(view, shots)
        return ranges[which, sonars]

    def fire(self, firing: Firing, tick: Tick) -> None:
        self._shoot(tick.view, shots_of(firing, tick))

    def _shoot(self, view: VisibleScene, shots: Shots) -> None:
        arena = self._begun(len(view.points.order))
        field, beam = self._fields.of(view, self._share, arena), beam_of(view.cones)
        self._share_rows(
            lambda first, last: kernels_firing.fire(field, beam, shots, first, last), view.grid, field.start
        )

    def _begun(self, count: int) -> Arena:
        """Scratch memory for a task that begins, of so many robots. Few robots have that of the thread, which never
        makes two tasks at a time; many keep their own, which ends with them."""
        if count > ALONE and self._own is None:
            self._own = Arena()
        self._arena = self._own if count > ALONE and self._own is not None else of_thread.arena
        self._arena.begin(SCRATCH * count)
        return self._arena

    def room(self, count: int) -> tuple[Displacement, Floats]:
        rows = self._begun(count).take(np.float64, 4, count)
        return Displacement(*rows[:3]), rows[3]

    def propose(self, bodies: BodyColumns, laws: Laws, draws: Draws, proposal: Displacement) -> None:
        roam, left, right = (np.uint64(draw) for draw in draws)
        self._share(
            len(bodies.x),
            lambda first, last: kernels_motion.propose(bodies, laws, roam, left, right, proposal, first, last),
        )

    def commit(self, bodies: BodyColumns, laws: Laws, proposal: Displacement, settled: Settled) -> None:
        self._share(
            len(bodies.x),
            lambda first, last: kernels_motion.commit(bodies, laws, proposal, *settled, first, last),
        )

    def settle(
        self,
        grid: Grid,
        points: Sorted,
        listed: CellLists,
        solids: Floats,
        radii: Floats,
        positions: tuple[Floats, Floats],
        way: tuple[Floats, Floats],
        settled: Settled,
    ) -> None:
        count, (order, start), arena = len(positions[0]), points, self._arena
        x, y = rows = arena.take(np.float64, 2, count)
        gathered = self._share(
            count, lambda first, last: kernels_motion.gather(order, *positions, *way, first, last, rows), LIGHT
        )
        longest = sqrt(max(gathered))
        reach = 2.0 * float(radii.max(initial=0.0)) + SKIN + 2.0 * longest
        close, self._beside = self._close(points, reach), AGAIN * reach + ROUNDING
        near, stopped = arena.take(np.bool_, count), Settled(*arena.take(np.float64, 3, count))
        self.share(count, lambda first, last: clear(Settled(*(column[first:last] for column in settled))))
        boxes = self.boxes(solids)

        def at_old(first: int, last: int) -> None:
            kernels_motion.stop_at_old(
                *(x, y, *way, radii, order, start, grid.size, grid.columns, grid.rows, solids, boxes, *listed),
                *(SKIN, longest, reach, first, last, close, near, *stopped, *settled),
            )

        def at_ways(first: int, last: int) -> None:
            kernels_motion.stop_at_ways(
                *(x, y, *way, radii, order, start, grid.size, grid.columns, grid.rows),
                *(SKIN, reach, first, last, near, *stopped, *settled),
            )

        self._share_rows(at_old, grid, start)
        self._share_rows(at_ways, grid, start, int(np.count_nonzero(near)), CROWDED)

    def boxes(self, solids: Floats) -> Floats:
        """The bounding boxes of solids, see `boxes_of`; of the latest ones they are kept."""
        if self._boxed is None or self._boxed[0] is not solids:
            self._boxed = solids, boxes_of(solids)
        return self._boxed[1]

    def fly(self, bodies: FlightColumns, laws: TypeLaws, power: Power, which: slice) -> None:
        begin = which.start
        self._share(
            which.stop - begin,
            lambda first, last: kernels_flying.fly(bodies, laws, power, begin + first, begin + last),
        )

    def disturb(self, seen: Ranges, which: Whole, noise: Noise) -> None:
        keys = np.uint64(noise.key), np.uint64(noise.dropout_key)
        kernels.disturb(seen, which, noise.share, noise.dropout, np.float32(noise.most), *keys)

    def tell(self, seen: Ranges, which: Whole, receiver: SonarReceiver, sensed: Floats) -> None:
        if receiver.noise is not None:
            self.disturb(seen, which, receiver.noise)

        def work(first: int, last: int) -> None:
            some = seen[first:last], which[first:last]
            kernels.tell(*some, receiver.least, receiver.most, receiver.front, receiver.wanted, sensed)

        self._share(len(which), work)

    def share(self, count: int, work: Callable[[int, int], object]) -> None:
        self._share(count, work, LIGHT)

    def _share(self, count: int, work: Callable[[int, int], Result], alone: int = ALONE) -> list[Result]:
        """Run `work` on slices of `range(count)` and return the result of each. alone: count up to which one thread
        suffices."""
        if count <= alone:
            return [work(0, count)]
        return self.pool.share(work, self._borders(count))

    def _share_rows(
        self, work: Callable[[int, int], None], grid: Grid, start: Short, busy: int | None = None, alone: int = ALONE
    ) -> None:
        """Run `work` on slices of the rows of cells, with about equally many robots each. busy: number of robots with
        work to do, if not all; alone: number up to which one thread suffices."""
        count = int(start[-1])
        if self.pool.threads == 1 or (count if busy is None else busy) <= alone:
            work(0, grid.rows)
            return
        ends = start[grid.columns :: grid.columns]  # number of robots up to and including each row
        self.pool.share(work, [0, *(np.searchsorted(ends, self._borders(count)[1:-1]) + 1).tolist(), grid.rows])

    def _borders(self, count: int) -> list[int]:
        """Start indices of the slices of `range(count)`, followed by `count`."""
        return borders(count, self.pool.threads, FEW if count < MANY else SIZES, LANES)
