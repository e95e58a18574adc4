"""The bodies of a world as a block of words, for compiled code that lets many worlds make quiet ticks in one call.

`covered` tells which worlds can be such blocks. A block holds the addresses of the world's own arrays, which the
compiled code changes in place, and the arguments of the kernels that a tick calls: the same ones that
`fast.NumbaMachine` and `bodies.proximity` give them, so that every bit is the same.

Kernels write into scratch memory that worlds may share which are never stepped at one time.
"""

from __future__ import annotations

import threading
from bisect import bisect_left
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from itertools import pairwise
from math import frexp, ldexp
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.arrays import LINE, Arena
from sleepcast.core.memory import same
from sleepcast.core.records import NamedTuple
from sleepcast.core.threads import ThreadPool, borders
from sleepcast.simulator import fast
from sleepcast.simulator.bodies.closeness import kernels_touching
from sleepcast.simulator.bodies.proximity import Sonars
from sleepcast.simulator.motion.steps import SKIN, BodyColumns, Displacement, Settled
from sleepcast.simulator.quiet import layout as words
from sleepcast.simulator.simd.cached import CachedKernel, CachedKernels
from sleepcast.simulator.simd.formulas import LANES
from sleepcast.simulator.simulation import Simulator
from sleepcast.simulator.sonar.fields import SPAN
from sleepcast.simulator.world.grid import Sorted
from sleepcast.simulator.world.walls import Walls

Words: TypeAlias = NDArray[np.int64]

NOTHING: Words = np.zeros(1, np.int64)
"""An empty list."""
kernels_quiet = CachedKernels("quiet.kernels_quiet")
CALLED: tuple[CachedKernel, ...] = (
    *(fast.kernels_motion.propose, fast.kernels_motion.commit, fast.kernels_motion.gather),
    *(fast.kernels_motion.stop_at_old, fast.kernels_motion.stop_at_ways),
    *(fast.kernels.count, fast.kernels.begin, fast.kernels.place, fast.kernels.fix),
    *(fast.kernels_sonar.see, fast.kernels.hear, fast.kernels_motion.slide, fast.kernels_motion.displace),
    *(fast.kernels_flying.fly, kernels_touching.touching, fast.kernels_flying.at_fence),
)
"""The kernels that a tick calls, in the order of `layout`."""


@cache
def addresses(*, flies: bool = False) -> Words:
    """The addresses of the kernels, for their types of arguments; compiled now if they were not yet. flies: also of
    those for what flies."""
    called = list(zip(CALLED, words.SAMPLES, strict=True))[: words.KERNELS if flies else words.FLY]
    found = np.zeros(words.KERNELS, np.int64)
    found[: len(called)] = [each.address(*given) for each, given in called]
    return found


def compile_ticks() -> None:
    """Let what makes quiet ticks be compiled, if it was not yet."""
    kernels_quiet.quiet(np.zeros(0, np.int64), np.zeros(words.KERNELS, np.int64), 0, 0)


def flat(value: object) -> list[int]:
    """An argument as the words that tell it, signed: of an array, which lies in one piece, its place and shape."""
    if isinstance(value, np.ndarray):
        assert value.flags.c_contiguous
        return [value.ctypes.data, *value.shape]
    if isinstance(value, tuple):
        return [word for each in value for word in flat(each)]
    if isinstance(value, float):
        return [int(np.float64(value).view(np.int64))]
    return [int(np.uint64(int(cast(int, value)) & 0xFFFF_FFFF_FFFF_FFFF).view(np.int64))]


class Needs(NamedTuple):
    """What scratch memory a world needs, see `Scratch`."""

    robots: int
    sonars: int
    cells: int


class Scratch:
    """Memory for worlds that need no more than this, and are stepped one after the other. Everything lies in one block,
    at the same places for equal needs."""

    def __init__(self, needs: Needs) -> None:
        self.needs, arena = needs, Arena()
        for _ in range(2):  # the arena is large enough once it has been asked for all
            arena.begin()
            self._take(arena)
        self.near[:], self.ones[:], self.fixed[:], self.counts[:] = False, True, 0, 0
        self.everybody[:] = range(needs.robots)
        self.first, self.end = self.ways.dx.ctypes.data, self.everybody.ctypes.data + self.everybody.nbytes

    def _take(self, arena: Arena) -> None:
        robots, sonars, cells = self.needs
        reals = [arena.take(np.float64, robots) for _ in range(10)]
        self.ways = Displacement(*reals[:3])
        self.free = reals[3]
        self.stopped = Settled(*reals[4:7])
        self.before = Settled(*reals[7:])
        self.rows = arena.take(np.float64, 2, robots)
        self.near, self.ones = arena.take(np.bool_, robots), arena.take(np.bool_, robots)
        self.fixed = arena.take(np.int32, 2, robots + LANES)
        self.cells, self.counts = arena.take(np.int32, robots), arena.take(np.int32, 1, cells)
        self.squares = arena.take(np.float32, robots, sonars)
        self.everybody = arena.take(np.int64, robots)

    def serves(self, needs: Needs) -> bool:
        """Whether this is enough."""
        return all(each <= most for each, most in zip(needs, self.needs, strict=True))


class _ThreadScratch(threading.local):
    """What the worlds have in common that one thread steps, one after the other."""

    scratch: Scratch | None = None


_of_thread = _ThreadScratch()


def covered(simulator: Simulator) -> bool:
    """Whether the ticks of a world can be made by compiled code alone, as long as nothing comes from outside."""
    scenario, bodies = simulator.scenario, simulator.bodies
    if bodies.machine.name != "numba" or simulator.payload is not None or bodies.parts[1:]:
        return False
    if bodies.flight is not None and (bodies.flight.air is not None or not bodies.flight.compiles):
        return False
    if scenario.robots.omni or scenario.cuts or (bodies.flight is not None and bodies.flight.homes is not None):
        return False
    if scenario.lights or scenario.pings or scenario.stocks or scenario.fields or scenario.noise or bodies.counts:
        return False
    sonars = bodies.sonars
    if scenario.torus and (sonars is not None or bodies.contact is not None):  # whose images only Python makes
        return False
    rings = sonars is None or (isinstance(sonars, Sonars) and sonars.radii is None and not sonars.crosstalk)
    return rings and simulator.senses.beginnings is not None


class BodyBlock:
    """The block of a world that is `covered`.

    words: see `kernels_quiet`, which says what the others are for that a swarm puts there
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator, self._bodies = simulator, simulator.bodies
        bodies, grid = self._bodies, self._bodies.near.grid
        self.flies = bodies.flight is not None
        """Whether its bodies do: then ticks end early where they may have touched, or come to their fence."""
        last = words.KERNELS if self.flies else words.FLY if bodies.laws.slides else words.SLIDE
        self.words: Words = np.zeros(words.BLOCKS[last], np.int64)
        self.address = int(self.words.ctypes.data)
        self._alone, self._kernels = np.array([self.address]), addresses(flies=self.flies)
        """What is called to make the ticks of this world alone."""
        self._reals = self.words.view(np.float64)
        self._points = Sorted(np.zeros(bodies.count, np.int32), np.zeros(grid.cells + 1, np.int32))
        self._close = np.ones(bodies.count, np.bool_)
        self._kept: dict[str, object] = {}
        sonars = bodies.sonars
        self._sonars = sonars if isinstance(sonars, Sonars) else None
        padded = 0 if self._sonars is None else self._sonars.ring.count + -self._sonars.ring.count % LANES
        self.needs = Needs(bodies.count, padded, grid.cells)
        self._version = -1
        self._wanted: frozenset[int] | None = None
        self._some = np.zeros(0 if self._sonars is None else self._sonars.ring.count + 1, np.bool_)
        self._all = ~self._some
        self._scratch: Scratch | None = None
        self.think((), (), (), {}, 0)
        self.sample(0, None, sonars=False)
        self.put("senses", words.SENSES, listed(simulator.senses.beginnings or ()))

    @property
    def suits(self) -> bool:
        """Whether the sonars, if there are any, look ahead of their bodies and fire all at once, as they do unless
        somebody has arranged them otherwise; and whether there is nothing but the ground and each other that what flies
        may touch."""
        sonars, flight = self._sonars, self._bodies.flight
        if flight is not None and (not flight.compiles or len(self._bodies.near.lines)):
            return False
        return sonars is None or not (sonars.firing.in_order or sonars.turret is not None)

    @property
    def scratch(self) -> Scratch | None:
        """What kernels write into."""
        return self._scratch

    def use(self, scratch: Scratch) -> None:
        """Let kernels write into this memory."""
        before, self._scratch = self._scratch, scratch
        if before is None or before.needs != scratch.needs:
            self._version = -1
        elif before is not scratch:  # no number that a block holds looks like an address in there
            there = (self.words >= before.first) & (self.words < before.end)
            self.words[there] += scratch.first - before.first

    def put(self, name: str, place: int, numbers: Words) -> None:
        """Put the address of an array of words there."""
        self._kept[name] = numbers
        self.words[place] = numbers.ctypes.data

    # ---- before ticks

    def think(
        self,
        legs: Sequence[tuple[int, int]],
        moments: Sequence[tuple[int, int]],
        steps: Sequence[int],
        actuators: Mapping[str, tuple[int, int]],
        drawn: int,
    ) -> None:
        """What rules run, and which actuators they assign; none: robots do not think. See `fleet.quiet.QuietRules`."""
        bodies = self._bodies
        wanted = {"drive_speed": bodies.wanted_speed, "drive_turn": bodies.wanted_turn}
        if bodies.flight is not None:
            wanted |= {"drive_side": bodies.wanted_side, "drive_climb": bodies.flight.wanted_climb}
        acts = [(*places, wanted[name].ctypes.data) for name, places in actuators.items()]
        self.put("acts", words.ACTS, listed(acts))
        self.put("legs", words.LEGS, listed(legs))
        self.put("moments", words.MOMENTS, listed(moments))
        self._steps = listed([(address, 0) for address in steps])
        self.put("steps", words.MOST_STEPS, self._steps)
        self.words[words.DRAWN] = drawn
        self.words[words.AWAKE] = bool(legs)

    def sample(self, every: int, moves: Words | None, *, sonars: bool) -> None:
        """What is to be copied after ticks whose number is a multiple of `every` (0: none): how many pieces, then of
        each from which address to which one, and how many words. sonars: whether all of them are wanted then."""
        self.words[words.EVERY], self.words[words.HEARD] = every, sonars
        moves = NOTHING if moves is None else moves
        if moves is not self._kept.get("moves"):
            self.put("moves", words.MOVES, moves)

    def begin(self, ticks: int, sampled: bool) -> None:
        """The next call is to make so many ticks. sampled: whether all sonars are wanted in the last one."""
        self.words[words.TICKS], self.words[words.SAMPLED] = ticks, sampled
        self.words[words.DONE] = self.words[words.TROUBLE] = 0
        self._steps[2::2] = 0

    @property
    def moved(self) -> bool:
        """Whether ticks were made that are not noted yet."""
        return int(self.words[words.TICK]) != self._bodies.tick

    @property
    def done(self) -> int:
        """Whole ticks of the last call."""
        return int(self.words[words.DONE])

    @property
    def left(self) -> int | None:
        """Why the tick after those is not finished: the leg that has left robots to be walked, or `layout.TOUCHED`
        where bodies may have touched or come to their fence, and only the motion was made; None where there is none."""
        why = int(self.words[words.TROUBLE])
        if why == words.TOUCHED:
            return why
        return why - 1 if why else None

    @property
    def most_steps(self) -> list[int]:
        """The maxima of the columns of steps."""
        return cast("list[int]", self._steps[2::2].tolist())

    def lend(self) -> None:
        """Let kernels write into the memory of this thread, which is about to `make` this world's ticks alone."""
        before = _of_thread.scratch
        if before is None or not before.serves(self.needs):
            before = _of_thread.scratch = Scratch(
                self.needs if before is None else Needs(*map(max, self.needs, before.needs))
            )
        if self._scratch is not before:
            self.use(before)

    def make(self) -> None:
        """Make the ticks that are to be made, of this world alone."""
        kernels_quiet.quiet(self._alone, self._kernels, 0, 1)

    def prepare(self) -> None:
        """Bring the block up to date with the world."""
        bodies = self._bodies
        if self._version != bodies.world.version:
            self._version = bodies.world.version
            self._simulator.senses.keep_up()
            self._fill()
        if bodies.flight is not None:
            bodies.flight.keep_up()
            self._fill_pairs()
        self.words[words.TICK] = bodies.tick
        self.words[words.SORTED] = bodies.near.knows(self._points)

    def listen(self, rows: Collection[int]) -> None:
        """Which rows of `Simulator.sensed` that sonars fill are wanted in each tick; none: nothing is measured."""
        wanted = same(frozenset(rows))
        if wanted == self._wanted:
            return
        self._wanted = wanted
        self._some[:] = False
        self._some[[row - len(self._bodies.sensors) for row in wanted]] = True
        self.words[words.SEES] = bool(wanted)
        if self._sonars is not None:
            rear = fast.ring_of(self._sonars.cones).rear
            self.words[words.FORWARD] = not self._some[:-1][rear].any()

    def _fill(self) -> None:
        """Write everything that stays the same as long as the world does."""
        bodies, scratch = self._bodies, self._scratch
        assert scratch is not None
        own, count = self.words, bodies.count
        free = scratch.free[:count]
        own[words.COUNT], self._reals[words.STEP] = count, bodies.scenario.tick
        own[words.STOPPED], own[words.MODE] = bodies.stopped.ctypes.data, bodies.mode.ctypes.data
        own[words.DRAWS] = bodies.laws.slips
        own[words.FREE] = free.ctypes.data
        own[words.HIT_X], own[words.HIT_Y] = bodies.hit_x.ctypes.data, bodies.hit_y.ctypes.data
        self.put("texts", words.TEXTS, chance_texts(bodies.seed))
        self.put("keys", words.KEYS, np.zeros(2 * words.PURPOSES, np.int64))
        own[words.KEYED] = -1
        columns = bodies.columns
        proposal = scratch.ways.of(slice(0, count))
        draws = np.uint64(0), np.uint64(0), np.uint64(0)
        self._call(words.PROPOSE, columns, bodies.laws, *draws, proposal, 0, count)
        self._call(words.COMMIT, columns, bodies.laws, proposal, free, bodies.hit_x, bodies.hit_y, 0, count)
        places = [(bodies.x, bodies.y)] + ([(bodies.encoder_x, bodies.encoder_y)] if bodies.laws.track else [])
        sizes = [flat(float(each))[0] for each in bodies.scenario.around]
        rounds = [(axis.ctypes.data, size) for pair in places for axis, size in zip(pair, sizes, strict=True)]
        self.put("rounds", words.ROUNDS, listed(rounds if bodies.scenario.torus else ()))
        drained = [
            (row.ctypes.data, flat(drain * bodies.scenario.tick)[0])
            for row, drain in zip(bodies.stores, bodies.drains.tolist(), strict=True)
            if drain
        ]
        self.put("drains", words.DRAINS, listed(drained))
        self._fill_cells(scratch)
        if bodies.laws.slides and bodies.contact is not None:
            self._fill_slide(scratch, columns, proposal, free)
        if bodies.contact is not None:
            self._fill_contact(scratch, proposal, free)
        if self._sonars is not None:
            self._fill_sonars(scratch, self._sonars)
        if bodies.flight is not None:
            ((laws, power, which),) = bodies.flight.hovering
            own[words.FLIES] = 1
            self._call(words.FLY, bodies.flight.flight_columns, laws, power, which.start, which.stop)
            fences = self._simulator.fences
            own[words.FENCED] = fences is not None
            if fences is not None:
                told = bodies.flight.flight_columns, laws, fences.told, which.start, which.stop
                self._call(words.EDGES, *told)

    def _fill_pairs(self) -> None:
        """Bodies that may touch are listed in arrays that grow."""
        closeness = self._simulator.closeness
        assert closeness is not None
        if self._kept.get("pairs") is not closeness.pairs:
            self._kept["pairs"] = closeness.pairs
            self._call(words.TOUCHING, closeness.airborne, closeness.pairs)

    def _fill_cells(self, scratch: Scratch) -> None:
        bodies, own, grid = self._bodies, self.words, self._bodies.near.grid
        count, counts = bodies.count, scratch.counts[:, : grid.cells]
        cells, size = scratch.cells[:count], (grid.size, grid.columns, grid.rows)
        own[words.CELLS], own[words.COUNTS] = grid.cells, counts.ctypes.data
        self._call(words.COUNT_CELLS, bodies.x, bodies.y, *size, 0, count, cells, counts[0])
        self._call(words.BEGIN, counts, self._points.start)
        self._call(words.PLACE, cells, 0, count, counts[0], self._points.order)
        self._reals[words.BESIDE] = np.inf

    def _fill_slide(
        self, scratch: Scratch, columns: BodyColumns, proposal: Displacement, free: NDArray[np.float64]
    ) -> None:
        bodies, own, count = self._bodies, self.words, self._bodies.count
        before = [column[:count] for column in scratch.before]
        own[words.SLIDES] = 1
        own[words.BEFORE], own[words.BEFORE_X], own[words.BEFORE_Y] = (column.ctypes.data for column in before)
        self._call(words.SLIDE, columns, bodies.laws, proposal, free, bodies.hit_x, bodies.hit_y, 0, count)
        self._call(words.DISPLACE, columns, bodies.laws, proposal, free, before[0], 0, count)

    def _fill_contact(self, scratch: Scratch, proposal: Displacement, free: NDArray[np.float64]) -> None:
        bodies, own, near = self._bodies, self.words, self._bodies.near
        contact, grid, count = bodies.contact, near.grid, bodies.count
        assert contact is not None
        listed_, solids = near.solids(contact.reach), near.lines
        boxes = cast(fast.NumbaMachine, bodies.machine).boxes(solids)
        rows = np.frombuffer(scratch.rows, np.float64, 2 * count).reshape(2, count)
        stopped = [column[:count] for column in scratch.stopped]
        settled = free, bodies.hit_x, bodies.hit_y
        radii = contact.of_each
        self._kept["contact"] = listed_, solids, boxes, radii
        own[words.TOUCHES] = 1
        own[words.CLOSE], own[words.ONES] = self._close.ctypes.data, scratch.ones.ctypes.data
        own[words.NEAR] = scratch.near.ctypes.data
        self._reals[words.WIDE], self._reals[words.SKIN] = 2.0 * float(radii.max(initial=0.0)), SKIN
        self._reals[words.ROUNDING], self._reals[words.AGAIN] = fast.ROUNDING, fast.AGAIN
        way, size = (proposal.dx, proposal.dy), (grid.size, grid.columns, grid.rows)
        marks = scratch.ones[:count], scratch.near[:count]
        self._call(words.GATHER, self._points.order, bodies.x, bodies.y, *way, 0, count, rows)
        self._call(
            words.STOP_AT_OLD,
            *(rows[0], rows[1], *way, radii, *self._points, *size, solids, boxes, *listed_),
            *(SKIN, 0.0, 0.0, 0, grid.rows, *marks, *stopped, *settled),
        )
        self._call(
            words.STOP_AT_WAYS,
            *(rows[0], rows[1], *way, radii, *self._points, *size),
            *(SKIN, 0.0, 0, grid.rows, marks[1], *stopped, *settled),
        )

    def _fill_sonars(self, scratch: Scratch, sonars: Sonars) -> None:
        bodies, own, near, count = self._bodies, self.words, self._bodies.near, self._bodies.count
        cones, ring, grid = sonars.cones, fast.ring_of(sonars.cones), near.grid
        walls = near.in_sight(cones.radius + cones.most)
        assert isinstance(walls, Walls)
        units = ldexp(1.0, SPAN - frexp(grid.size)[1])
        fixed_x, fixed_y = (fixed[: count + LANES] for fixed in scratch.fixed)
        fixed_x[count:] = fixed_y[count:] = 0
        squares = np.frombuffer(scratch.squares, np.float32, count * len(ring.axis_cos)).reshape(count, -1)
        order, start = self._points
        lone = ring.lone if ring.lone < np.inf and 1.0 / units <= fast.FINE else -1.0
        heads = bodies.x, bodies.y, bodies.heading
        self._kept["sonars"] = walls, nothing = walls, np.empty(0)
        self._reals[words.LONE] = min(ring.lone, cones.reach)
        own[words.SOME_ROWS], own[words.ALL_ROWS] = self._some.ctypes.data, self._all.ctypes.data
        own[words.ECHOES] = bool(sonars.ring.noise or sonars.ring.dropout)
        own[words.CLOSE] = self._close.ctypes.data
        self._call(words.FIX, order, bodies.x, bodies.y, units, 0, count, fixed_x, fixed_y)
        self._call(
            words.SEE,
            *(*heads, order, fixed_x, fixed_y, nothing, order, start, grid.size, grid.columns, grid.rows),
            *(walls.solids, walls.start, walls.items, walls.news, *ring.measures),
            *(lone, 1.0 / units, False, False, ring.axis_cos, ring.axis_sin),
            *(0, grid.rows, 0.0, self._close, squares),
        )
        noise = (sonars.ring.noise, sonars.ring.dropout, np.uint64(0), np.uint64(0))
        sensed = sonars.sensed
        edge = -1 if sensed.strides[0] % LINE else -sensed.ctypes.data % LINE // sensed.itemsize
        which = scratch.everybody[:count]
        limits = sonars.ring.least, sonars.ring.most
        self._call(words.HEAR, squares, which, noise, *limits, sonars.front, self._all, sensed, edge)

    def _call(self, kernel: int, *arguments: object) -> None:
        """Write the arguments of a kernel."""
        address = CALLED[kernel].address(*arguments)
        assert address == self._kernels[kernel]  # the types of arguments are those of the samples
        begin, end = words.BLOCKS[kernel : kernel + 2]
        self.words[begin:end] = flat(arguments)

    # ---- after ticks

    def note(self) -> None:
        """Bring the bodies up to date with the block, after ticks."""
        bodies, own = self._bodies, self.words
        bodies.tick = int(own[words.TICK])
        bodies.forget()
        self._simulator.senses.begun()
        if own[words.SORTED]:
            bodies.near.know(self._points, bodies.x, bodies.y)
        last = own[words.DONE] + (own[words.TROUBLE] > 0) == own[words.TICKS]
        told = own[words.EVERY] and own[words.HEARD] and own[words.TICK] % own[words.EVERY] == 0
        every = bool(told or (own[words.SAMPLED] and last))
        if self._sonars is not None and (every or (own[words.AWAKE] and own[words.SEES])):
            self._sonars.note(self._all if every else self._some)


class WorldTable:
    """Blocks of worlds that make their ticks in one call. threads: that share the work."""

    def __init__(self, blocks: Sequence[BodyBlock], threads: int = 1) -> None:
        self._blocks = list(blocks)
        self._pool = ThreadPool(threads)
        self._borders = borders(len(blocks), threads)
        self._addresses = np.array([each.address for each in blocks], np.int64)
        self._scratch: list[Scratch] = []
        """Of each block: the worlds of a stretch have theirs in common."""
        for first, last in pairwise(self._borders):
            if first < last:
                needs = Needs(*map(max, zip(*(each.needs for each in blocks[first:last]), strict=True)))
                self._scratch += [Scratch(needs)] * (last - first)

    def provide(self) -> None:
        """Give each block its scratch memory, before it gets ready: it may have been stepped alone since."""
        for block, scratch in zip(self._blocks, self._scratch, strict=True):
            if block.scratch is not scratch:
                block.use(scratch)

    def replace(self, place: int, block: BodyBlock) -> None:
        """Put another world in the place of one."""
        self._blocks[place], self._addresses[place] = block, block.address
        if not self._scratch[place].serves(block.needs):
            self._scratch[place] = Scratch(block.needs)

    def begin(self, ticks: int, sampled: bool) -> None:
        """See `BodyBlock.begin`, of all worlds."""
        for each in self._blocks:
            each.begin(ticks, sampled)

    def make(self, which: Sequence[int]) -> None:
        """Let the worlds with these indices, ascending, make the ticks that they are to make."""
        called, table, ends = addresses(flies=any(each.flies for each in self._blocks)), self._addresses, self._borders
        if len(which) < len(self._blocks):
            table = table[list(which)]
            ends = [bisect_left(which, border) for border in ends]
        self._pool.share(lambda first, last: kernels_quiet.quiet(table, called, first, last), ends)


def listed(entries: Sequence[tuple[int, ...]]) -> Words:
    """A list as words: how many, then each."""
    if not entries:
        return NOTHING
    return np.array([len(entries), *(word for each in entries for word in each)], np.int64)


def chance_texts(seed: int) -> Words:
    """The texts of what a tick draws, up to its number: see `kernels_chance`."""
    texts = np.zeros(words.TEXTS_LENGTH, np.int64)
    for number, purpose in enumerate((("slip", "left"), ("slip", "right"), ("echo",), ("dropout",))):
        text = repr((seed, *purpose, 0)).encode()[:-2]
        assert len(text) + words.DIGITS <= words.TEXT
        texts[words.LENGTHS + number] = len(text)
        first = words.FIRST_TEXT + number * words.TEXT_WORDS
        texts[first : first + words.TEXT_WORDS].view(np.uint8)[: len(text)] = np.frombuffer(text, np.uint8)
    return texts
