"""What robots sense of their neighbours: distance, direction, heading and colour, and the numbers that they share.

A robot with a range-and-bearing sensor measures where its neighbours are relative to itself. The functions here turn
that into its own frame of reference, which is its sensed position and heading, errors included. It senses nothing
beyond the reach of its sensor. With a delay it senses its neighbours as they were so long ago, from where it is now
itself. A colour or a number that a robot shares in one tick is seen in the next one, so that
no result depends on the order of the robots. Walls hide neighbours if the scenario says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import ceil, inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sleepcast.core.angles import CANCELLED
from sleepcast.core.counter_rng import GOLDEN, key, mix, uniform
from sleepcast.core.model import BodyColumn, HostFunction, NativeCall, Writing
from sleepcast.core.neighbours import nearest_id
from sleepcast.core.units import LENGTH, NONE, UNITS, Dimension, is_angle
from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats
from sleepcast.simulator.bodies.body import Body, BodySenses, acting
from sleepcast.simulator.bodies.field_of_view import FieldOfView
from sleepcast.simulator.bodies.neighbour_view import NeighbourView
from sleepcast.simulator.bodies.places import Places
from sleepcast.simulator.bodies.population import Turnover
from sleepcast.simulator.bodies.voronoi import centroids
from sleepcast.simulator.neighbours.neighbourhood import (
    ABOVE,
    ACROSS,
    ANGLE,
    AS_IT_IS,
    AWAY,
    BEARING,
    DIRECTION,
    DX,
    DY,
    DZ,
    FROM_X,
    FROM_Y,
    FROM_Z,
    HEADING,
    LEAST,
    LOST,
    MAX_RECENT,
    MEAN,
    MOST,
    NEAREST,
    ONE,
    OUTLIER,
    PITCH,
    TOTAL,
    UP,
    VALUE,
    BodyTables,
    Formula,
    Neighbourhood,
    cells_of,
    question,
)
from sleepcast.simulator.neighbours.pairs import NeighbourQuery, Pairs, in_order, length
from sleepcast.simulator.scenario import flight
from sleepcast.simulator.scenario.signals import NeighbourModel
from sleepcast.simulator.simd.addresses import addresses
from sleepcast.simulator.simd.formulas import arc_tangent, rotated, shortest, sine_cosine, wrap
from sleepcast.simulator.sonar.noise import deviates
from sleepcast.simulator.world.grid import Grid, Sorted, Whole, only
from sleepcast.simulator.world.sight import SightLines

MAX_PAIRS = 1 << 20
"""Pairs of neighbours processed at once: some hundred megabytes."""
COLOUR = 0
"""The row of the colours in the table of shared numbers."""


class RangeAndBearing:
    """The range-and-bearing sensors of all `bodies`."""

    def __init__(self, bodies: Bodies, model: NeighbourModel) -> None:
        self._bodies, self._model = bodies, model
        self._hides, flies = bodies.scenario.sight.neighbours, bodies.flight is not None
        self._compiles = bodies.machine.compiles and bodies.population is None
        """Whether compiled code may be asked for formulas, which takes rows for numbers, each for a robot that is
        there."""
        self._first_group = 1 + len(model.shares)
        self._shared: Floats = np.full((self._first_group + len(model.shows_groups), bodies.count), np.nan)
        """What robots show in this tick: colours, shared numbers, NaN where a robot shares none, and who is in the
        groups that are shown; below what they will show in the next one."""
        self._shared[COLOUR] = self._shared[self._first_group :] = 0.0
        self._set: Floats = self._shared.copy()
        self._row_of_z = [sensor.name for sensor in bodies.sensors].index("z") if flies else 0
        heights = None if bodies.flight is None else (bodies.flight.z, bodies.sensed[self._row_of_z])
        self._seen = seen = NeighbourView(bodies, self._shared, model.delay)
        pitch = None if bodies.flight is None else bodies.flight.pitch
        self._field_of_view = FieldOfView(model, bodies.heading, pitch)
        pose = bodies.x, bodies.y, bodies.heading, *bodies.sensed[:3]
        tables = (*pose, seen.shared, self._set, heights, seen.poses, pitch, seen.pitch)
        sight = bodies.sight.walls if self._hides else SightLines((bodies.scenario.width, bodies.scenario.height))
        self._near = Neighbourhood(bodies.scenario, model, bodies.seed, BodyTables(*tables), sight)
        self._across = bodies.scenario.width + bodies.scenario.height
        """No two bodies are farther from each other over the ground, m."""
        self._reach = min(model.reach, self._across + (bodies.limits.ceiling if flies else 0.0))
        self._sorted: dict[float, tuple[Grid, Sorted, Places]] = {}
        """All bodies in cells as large as the greatest radius asked for, by that radius."""
        self._recent: list[tuple[NeighbourQuery, Pairs]] = []
        self._listed: list[tuple[NeighbourQuery, int, tuple[Whole, Whole]]] = []
        self._named: tuple[Whole, Floats, tuple[Whole, Pairs]] | None = None
        self._measured: tuple[Pairs, tuple[Floats, Floats]] | None = None
        """The cells that were measured last: rules ask for x and y of the same ones."""

    def step(self) -> None:
        """Begin a tick: bodies have moved, and what they set in the last tick can be seen."""
        self._shared[:] = self._set
        self._seen.step()
        self.forget()

    def beginning(self) -> tuple[int, int] | None:
        """The addresses of native code that begins a tick instead of `step`, and of its argument; None where chance or
        a delay has a part, or without compiled code."""
        simple = self._compiles and not self._near.chancy and not self._seen.delayed
        code = addresses(flies=self._near.flies) if simple else None
        return None if code is None else (code["begin"], self._near.address)

    def keep_up(self) -> None:
        """Take over what has changed in the world, also between two ticks."""
        if self._hides:
            self._bodies.sight.keep_up()
            if self._near.keep_up():
                self._recent.clear()
                self._listed.clear()
                self._named = self._measured = None

    def forget(self) -> None:
        """Bodies have moved."""
        self.keep_up()
        self._near.step(self._bodies.tick)
        self._sorted.clear()
        self._recent.clear()
        self._listed.clear()
        self._named = self._measured = None

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes and that the next ticks depend on."""
        return {"shared": self._shared, "shared next": self._set, **self._seen.arrays()}

    def delayed_poses(self) -> Iterator[tuple[Floats, ...]]:
        """See `NeighbourView.all_poses`."""
        return self._seen.all_poses()

    def share(self, row: int, robots: Whole, values: Floats) -> None:
        """Set what these robots show to their neighbours from the next tick on. row: COLOUR, or 1 for the first number
        that is shared."""
        self._set[row, robots] = values

    def show_groups(self, robots: Sequence[int] | slice, groups: Mapping[str, ArrayLike]) -> None:
        """Let neighbours of these robots see from the next tick on which of them are in which groups. groups: by their
        keys, for each of the robots whether it is in it; in all others none is."""
        for row, name in enumerate(self._model.shows_groups, self._first_group):
            self._set[row, robots] = groups.get(name.casefold(), 0.0)

    def turn_over(self, turnover: Turnover) -> None:
        """Robots have come and gone: children show what their parents do, and who is gone shows nothing."""
        for shown in (self._shared, self._set):
            shown[:, turnover.children] = shown[:, turnover.parents]
            shown[:, turnover.dead] = np.nan
            shown[COLOUR, turnover.dead] = 0.0
        self._seen.begin(turnover.changed)
        self.forget()

    def following(self, row: int) -> Floats:
        """What each robot shows from the next tick on."""
        following: Floats = self._set[row]
        return following

    def shows(self, row: int, others: Whole) -> Floats:
        """What these robots show now."""
        shows: Floats = self._shared[row, others]
        return shows

    def seen(self, row: int, others: Whole) -> Floats:
        """What their neighbours see that these robots show."""
        seen: Floats = self._seen.shared[row, others]
        return seen

    def sense(self, asked: Formula | OverPairs, robots: Whole, radius: Floats, *colour: Floats) -> Floats:
        """What is `asked`, for each of `robots`, from its neighbours within `radius` (m) and reach. colour: of the
        neighbours that count, one for each robot; none: all count."""
        query = self._query(robots, radius, *colour)
        if isinstance(asked, Formula) and self._asks_kernels:
            return self._compiled(asked, query)
        over = partial(_fold, asked) if isinstance(asked, Formula) else asked
        results = [over(self, each) for each in self._pairs(query)]
        return np.concatenate(results) if len(results) != 1 else results[0]

    def neighbours(self, robots: Whole, most: int, radius: Floats, *colour: Floats) -> tuple[Whole, Whole]:
        """Who is near each of `robots`, ascending, within `radius` (m) and reach, by their numbers: see
        `Pairs.listed`."""
        query = self._query(robots, radius, *colour)
        for before, limit, listed in self._listed:
            if limit == most and before.same(query):
                return listed
        lists = []
        if self._asks_kernels:
            vicinity = self._near.vicinity(_reach_of(query.radius), self._bodies.tick, turning=False)
            counts, keys = self._bodies.machine.near_lists(vicinity, *query)
            if counts.max(initial=0) <= most:
                lists.append(in_order(counts, keys))
        lists = lists or [self._numbered(pairs).listed(most) for pairs in self._pairs(query)]
        if len(lists) == 1:
            self._listed = [*self._listed[1 - MAX_RECENT :], (query, most, lists[0])]
            return lists[0]
        counts = np.concatenate([np.diff(first) for first, _ in lists])
        return np.append(0, np.cumsum(counts)), np.concatenate([others for _, others in lists])

    def nearest(self, robots: Whole, radius: Floats, *colour: Floats) -> Floats:
        """Number of the nearest neighbour of each of `robots`, within `radius` (m) and reach; NaN without one."""
        found = [self._numbered(pairs).nearest_one() for pairs in self._pairs(self._query(robots, radius, *colour))]
        return np.concatenate(found) if len(found) != 1 else found[0]

    def shown(self, field: str, robots: Whole, others: Floats) -> Floats:
        """What each of `robots` senses of one other robot: `field` of `core.neighbours.SHOWN`, a number that it shares,
        or whether it is in a group. NaN where it does not sense that one."""
        bodies = self._bodies
        asking = np.zeros(bodies.count, np.bool_)
        asking[robots] = True
        bodies.sense(np.flatnonzero(asking), sonars=False)
        shown = [*self._model.shares, *self._model.shows_groups]
        row = shown.index(field) + 1 if field in shown else COLOUR
        quantity = VALUE if field in shown else _QUANTITIES[field]
        self.keep_up()
        if self._asks_kernels:
            self._near.begin(bodies.tick)
            return bodies.machine.shown(self._near, quantity, row, robots, others, self._reach)
        index, pairs = self._pairs_named(robots, others)
        found = np.full(robots.size, np.nan)
        found[index[pairs.robot]] = self._field(quantity, row, pairs)
        return found

    @property
    def _asks_kernels(self) -> bool:
        """Whether compiled code may be asked at present."""
        return self._compiles and self._near.covered

    def _pairs_named(self, robots: Whole, others: Floats) -> tuple[Whole, Pairs]:
        """Which of `robots` name another robot that may be there, and the pairs of these that are sensed. The last are
        stored, since a rule asks for several fields of one neighbour."""
        if self._named is not None:
            *before, found = self._named
            if np.array_equal(before[0], robots) and np.array_equal(before[1], others, equal_nan=True):
                return found
        bodies, rows = self._bodies, others
        if bodies.population is not None:
            rows = bodies.population.rows_of(others)
        there = (rows >= 0.0) & (rows < bodies.count) & (rows == np.floor(rows)) & (rows != robots)
        index = np.flatnonzero(there)
        asked, other = robots[index], rows[index].astype(np.int64)
        around_x, around_y = bodies.scenario.around
        dx = shortest(self._seen.x[other] - bodies.x[asked], around_x)
        dy = shortest(self._seen.y[other] - bodies.y[asked], around_y)
        query = self._query(asked, np.full(asked.size, np.inf))
        found = index, self._sensed(query, np.arange(asked.size), other, dx, dy)
        self._named = robots.copy(), others.copy(), found
        return found

    def _field(self, quantity: int, row: int, pairs: Pairs) -> Floats:
        """A quantity of each neighbour, one for each pair. row: where it lies, if it is shared."""
        asked = pairs.asked[pairs.robot]
        if quantity in (DX, DY):
            way = pairs.dx if quantity == DX else pairs.dy
            place: Floats = self._bodies.sensed[(DX, DY).index(quantity), asked] + way
            return place
        if quantity == DZ and pairs.dz is not None:
            return self.own_z(pairs.asked)[pairs.robot] + pairs.dz
        if quantity == PITCH and self._seen.pitch is not None:
            pitch: Floats = self._seen.pitch[pairs.other]
            return pitch
        if quantity == AWAY:
            return pairs.away
        if quantity == HEADING:
            cosine, sine = self.headings(pairs)
            return arc_tangent(sine, cosine)
        if quantity == BEARING:
            beside = (pairs.dx == 0.0) & (pairs.dy == 0.0)
            return np.where(beside, np.nan, arc_tangent(pairs.dy, pairs.dx))
        return self.seen(row, pairs.other)

    def _query(self, robots: Whole, radius: Floats, *colour: Floats) -> NeighbourQuery:
        """What is asked for. colour: of the neighbours that count, one for each robot; none: all count."""
        self.keep_up()
        radius = np.clip(radius, 0.0, self._reach)
        return NeighbourQuery(robots, radius, colour[0] if colour else np.full(robots.size, np.nan))

    def _compiled(self, formula: Formula, query: NeighbourQuery) -> Floats:
        """What a formula comes to, without arrays of pairs."""
        if formula.frame != AS_IT_IS or self._near.turned:
            self._bodies.sense(query.robots, sonars=False)
        vicinity = self._near.vicinity(_reach_of(query.radius), self._bodies.tick, turning=formula.quantity == HEADING)
        return self._bodies.machine.neighbours(vicinity, formula, *query)

    def bound(self, formula: Formula, arguments: Sequence[float | None]) -> NativeCall | None:
        """How native code asks for a formula with these arguments; see `NativeForm`."""
        code = addresses(flies=self._near.flies) if self._compiles else None
        if code is None or arguments[0] is None:
            return None
        self.keep_up()
        radius = np.clip(np.array([arguments[0]]), 0.0, self._reach)
        vicinity = self._near.keep(_reach_of(radius), turning=formula.quantity == HEADING)
        if vicinity is None:
            return None
        asked = question(vicinity, formula, float(radius[0]), coloured=len(arguments) > 1)
        usable = self._is_covered if self._hides and self._near.flies else None
        near = self._near
        return NativeCall(code["ask_lanes"], asked.ctypes.data, code["prepare"], near.address, (near, asked), usable)

    def _is_covered(self) -> bool:
        """Whether kernels know all that hides neighbours at present."""
        self.keep_up()
        return self._near.covered

    @property
    def first_id(self) -> int:
        """The id of the robot with number 0."""
        return self._bodies.first_id

    def _numbered(self, pairs: Pairs) -> Pairs:
        """These pairs with the numbers of the neighbours instead of their rows."""
        population = self._bodies.population
        return pairs if population is None else pairs.known_as(population.numbers[pairs.other])

    def own_frame(self, robots: Whole) -> Floats:
        """Sensed x (m), y (m) and heading (rad) of these robots, shape (3, robots)."""
        self._bodies.sense(robots, sonars=False)
        frame: Floats = self._bodies.sensed[:3, robots]
        return frame

    def own_z(self, robots: Whole) -> Floats:
        """Sensed z of these robots, m; only where some fly."""
        self._bodies.sense(robots, sonars=False)
        z: Floats = self._bodies.sensed[self._row_of_z, robots]
        return z

    def cells(self, pairs: Pairs) -> tuple[Floats, Floats]:
        """Centroid x, y of the Voronoi cell of each robot that asked, m, within half the radius that it asked for: what
        is farther may be nearer to a robot that it does not sense."""
        if self._measured is None or self._measured[0] is not pairs:
            scenario = self._bodies.scenario
            x, y, _ = self.own_frame(pairs.asked)
            size = (inf, inf) if scenario.torus else (scenario.width, scenario.height)
            middles = centroids(pairs.robot, pairs.dx, pairs.dy, pairs.within / 2.0, x, y, size)
            self._measured = pairs, middles
        return self._measured[1]

    def headings(self, pairs: Pairs) -> tuple[Floats, Floats]:
        """Cosine and sine of the heading of each neighbour, in the frame of reference of the robot that senses it."""
        sine, cosine = sine_cosine(self._seen.heading)
        return self._turned(pairs.asked, pairs.robot, cosine[pairs.other], sine[pairs.other])

    def _turned(self, asked: Whole, robot: Whole, dx: Floats, dy: Floats) -> tuple[Floats, Floats]:
        """Vectors in the world's frame, as robots see them whose sensed heading is not their true one."""
        scenario = self._bodies.scenario
        if not scenario.noise and not scenario.robots.wheels and not scenario.sorts:
            return dx, dy
        sine, cosine = sine_cosine(wrap(self.own_frame(asked)[2] - self._bodies.heading[asked]))
        return rotated(dx, dy, sine[robot], cosine[robot])

    def _pairs(self, query: NeighbourQuery) -> list[Pairs]:
        """The pairs of these robots and their neighbours, in one block or several ones that fit into memory."""
        for before, pairs_before in self._recent:
            if before.same(query):
                return [pairs_before]
        bodies, reach = self._bodies, _reach_of(query.radius)
        block = np.zeros(query.robots.size, np.int64)
        if query.robots.size > MAX_PAIRS // bodies.count:
            grid, points, places = self._cells(reach)
            around = (2 * ceil(reach / grid.size) + 1) ** 2 * min(2 * ceil(reach / grid.size) + 1, grid.layers)
            if query.robots.size * around * int(np.diff(points.start).max()) > MAX_PAIRS:
                block = np.cumsum(places.candidates(grid, points, reach, query.robots)) // MAX_PAIRS
        ends = [0, *(np.flatnonzero(np.diff(block)) + 1).tolist(), query.robots.size]
        blocks = [self._block(query.part(slice(*each)), reach) for each in pairwise(ends)]
        if len(blocks) == 1:
            self._recent = [*self._recent[1 - MAX_RECENT :], (query, blocks[0])]
        return blocks

    def _cells(self, reach: float) -> tuple[Grid, Sorted, Places]:
        """All bodies, and on a torus their images, in cells of about `reach` m."""
        if reach not in self._sorted:
            bodies, cells = self._bodies, cells_of(self._bodies.scenario, self._bodies.count, reach)
            images = cells.images(self._seen.x, self._seen.y)
            if len(self._sorted) == MAX_RECENT:
                self._sorted.clear()
            z = None if self._seen.z is None else np.nan_to_num(self._seen.z)[images.of]
            places = Places(images, z, bodies.machine)
            points = places.sort(cells.grid)
            if bodies.population is not None:
                points = only(points, bodies.population.present[images.of])
            if self._seen.delayed:
                own_z = None if bodies.flight is None else np.nan_to_num(bodies.flight.z)
                places = places.looking_from(*cells.placed(bodies.x, bodies.y), own_z)
            self._sorted[reach] = cells.grid, points, places
        return self._sorted[reach]

    def _block(self, query: NeighbourQuery, reach: float) -> Pairs:
        """The pairs of one block, after losses and with noise."""
        bodies = self._bodies
        index = np.empty(bodies.count, np.int64)
        index[query.robots] = np.arange(query.robots.size)
        grid, points, places = self._cells(reach)
        first, other = places.pairs(grid, points, reach, query.robots)
        every = places.images
        dx, dy = every.x[other] - every.x[first], every.y[other] - every.y[first]
        return self._sensed(query, index[first - places.own], every.whose(other), dx, dy)

    def _sensed(self, query: NeighbourQuery, robot: Whole, other: Whole, dx: Floats, dy: Floats) -> Pairs:
        """Of the given pairs those that robots sense, as they sense them. robot: the index among those that asked;
        dx, dy: in the world's frame, m."""
        bodies, model, first = self._bodies, self._model, query.robots[robot]
        dz = None if bodies.flight is None else bodies.flight.rise(first, other, self._seen.z)
        away = length(dx, dy, dz)
        sensed: Flags = away <= query.radius[robot]
        if not np.isnan(query.colour).all():
            colour = query.colour[robot]
            sensed &= np.isnan(colour) | (colour == self.seen(COLOUR, other))
        if model.loss:
            drawn = uniform(key(bodies.seed, LOST, bodies.tick), self._tokens(other, first))
            sensed &= drawn >= model.loss
        if self._field_of_view.is_narrow:
            sensed &= self._field_of_view.holds(first, dx, dy, dz, away)
        if self._hides:
            asked = np.flatnonzero(sensed)
            seen = other[asked]
            place = self._seen.x[seen], self._seen.y[seen]
            sensed[asked] = ~bodies.sight.behind_walls(first[asked], *place, seen, self._seen.z)
        pairs = Pairs(query.robots, query.radius, robot, other, dx, dy, away, dz)
        if not sensed.all():
            pairs, first = pairs.where(sensed), first[sensed]
        dx, dy, away, dz = pairs.dx, pairs.dy, pairs.away, pairs.dz
        if model.noise:
            size, tokens = model.noise * away, self._tokens(pairs.other, first)
            dx = dx + size * self._normal(ACROSS, tokens)
            dy = dy + size * self._normal(UP, tokens)
            dz = None if dz is None else dz + size * self._normal(ABOVE, tokens)
            away = length(dx, dy, dz)
        dx, dy = self._turned(query.robots, pairs.robot, dx, dy)
        return Pairs(query.robots, query.radius, pairs.robot, pairs.other, dx, dy, away, dz)

    def _tokens(self, other: Whole, first: Whole) -> NDArray[np.uint64]:
        """A number of its own for each pair, for what is drawn by chance."""
        numbers = self._bodies.numbers
        return (numbers[other] << np.uint64(32)) + numbers[first]

    def _normal(self, purpose: str, tokens: NDArray[np.uint64]) -> Floats:
        """Normal noise of this tick, one number for each token."""
        drawn = np.uint64(key(self._bodies.seed, purpose, self._bodies.tick))
        return deviates(mix(tokens * np.uint64(GOLDEN) + drawn))


def _reach_of(radius: Floats) -> float:
    """The reach of cells for these radii, m: a bit more than the greatest, against rounding."""
    return float(radius.max(initial=0.0)) * (1.0 + 1e-9)


# ---- the functions of expressions

DIRECTIONS = ("MEAN_HEADING", "GAP_BEARING")
"""Functions whose values are directions."""

_QUANTITIES = {"x": DX, "y": DY, "z": DZ, "heading": HEADING, "distance": AWAY, "bearing": BEARING}
_QUANTITIES |= {flight.PITCH: PITCH, "colour": VALUE}
"""Of fields that are not shared numbers."""

OverPairs = Callable[[RangeAndBearing, Pairs], Floats]
"""A number for each robot that asked, from what it senses of its neighbours."""


def _fold(formula: Formula, near: RangeAndBearing, pairs: Pairs) -> Floats:
    """What a formula comes to, from pairs."""
    quantity, fold, frame, row = formula
    if quantity in (VALUE, ANGLE):
        values = near.seen(row, pairs.other)
        given = ~np.isnan(values)
        pairs, values = pairs.where(given), values[given]
    else:
        rise = pairs.away if pairs.dz is None else pairs.dz
        values = {ONE: np.ones(pairs.other.size), DX: pairs.dx, DY: pairs.dy, DZ: rise}.get(quantity, pairs.away)
    if fold == DIRECTION:
        cosine, sine = near.headings(pairs) if quantity == HEADING else sine_cosine(wrap(values))[::-1]
        return _direction(pairs, cosine, sine)
    found = _FOLDS[fold](pairs, values)
    if frame == FROM_Z:
        return near.own_z(pairs.asked) + found
    return found if frame == AS_IT_IS else near.own_frame(pairs.asked)[frame - FROM_X] + found


def _direction(pairs: Pairs, cosine: Floats, sine: Floats) -> Floats:
    """The direction of the sum of unit vectors, one for each pair; NaN without neighbours, and where they cancel."""
    x, y = pairs.total(cosine), pairs.total(sine)
    known = np.sqrt(x * x + y * y) > CANCELLED * pairs.count()
    return np.where(known, arc_tangent(y, x), np.nan)


_FOLDS: dict[int, Callable[[Pairs, Floats], Floats]] = {
    TOTAL: Pairs.total,
    MEAN: Pairs.mean,
    LEAST: Pairs.least,
    MOST: Pairs.most,
    NEAREST: Pairs.nearest,
    OUTLIER: Pairs.outlier,
}
_ASKED: tuple[tuple[str, Dimension, str, Formula | OverPairs], ...] = (
    ("COUNT", NONE, "How many neighbours are within r.", Formula(ONE, TOTAL)),
    ("MEAN_X", LENGTH, "Mean x of the neighbours within r.", Formula(DX, MEAN, FROM_X)),
    ("MEAN_Y", LENGTH, "Mean y of the neighbours within r.", Formula(DY, MEAN, FROM_Y)),
    ("MEAN_HEADING", NONE, "Direction in which the neighbours within r head on average.", Formula(HEADING, DIRECTION)),
    ("NEAREST_X", LENGTH, "x of the nearest neighbour within r.", Formula(DX, NEAREST, FROM_X)),
    ("NEAREST_Y", LENGTH, "y of the nearest neighbour within r.", Formula(DY, NEAREST, FROM_Y)),
    (
        "NEAREST_DIST",
        LENGTH,
        "Distance of the nearest neighbour within r, from centre to centre.",
        Formula(AWAY, LEAST),
    ),
    ("FARTHEST_DIST", LENGTH, "Distance of the farthest neighbour within r.", Formula(AWAY, MOST)),
    (
        "OUTLIER_X",
        LENGTH,
        "x of the neighbour within r that is farthest from their mean position.",
        Formula(DX, OUTLIER, FROM_X),
    ),
    ("OUTLIER_Y", LENGTH, "y of that neighbour.", Formula(DY, OUTLIER, FROM_Y)),
    (
        "CELL_X",
        LENGTH,
        "x of the centroid of what is nearer to this robot than to its neighbours within r, up to r/2 away.",
        lambda near, pairs: near.cells(pairs)[0],
    ),
    ("CELL_Y", LENGTH, "y of that centroid.", lambda near, pairs: near.cells(pairs)[1]),
    (
        "GAP",
        NONE,
        "Widest angle that contains none of the neighbours within r.",
        lambda near, pairs: pairs.widest_gap()[0],
    ),
    (
        "GAP_BEARING",
        NONE,
        "Direction of the middle of that angle, as a heading.",
        lambda near, pairs: pairs.widest_gap()[1],
    ),
)
"""Name, dimension of the result, description, and what is asked."""
_ASKED_ABOVE = (
    ("MEAN_Z", LENGTH, "Mean z of the neighbours within r.", Formula(DZ, MEAN, FROM_Z)),
    ("NEAREST_Z", LENGTH, "z of the nearest neighbour within r.", Formula(DZ, NEAREST, FROM_Z)),
)
"""The same where robots fly."""


def neighbour_functions(model: NeighbourModel, above: Mapping[str, str]) -> Iterator[HostFunction]:
    """What expressions may call of robots that sense their neighbours in this way. above: see `flight.seen_above`."""
    yield from (_sensing(*each) for each in (*_ASKED, *(_ASKED_ABOVE if above else ())))
    yield _ranking()
    yield _telling_apart(model, above)
    yield _sharing("COLOUR", "number", COLOUR, NONE)
    for row, share in enumerate(model.shares.items(), 1):
        yield from _of_share(row, *share)


def _of_share(row: int, name: str, unit: str) -> Iterator[HostFunction]:
    """The functions of one shared number."""
    dimension = UNITS[unit].dimension if unit else NONE
    yield _sharing(f"SHARE_{name.upper()}", name, row, dimension)
    reductions = (
        ("MEAN", "Mean", (ANGLE, DIRECTION) if is_angle(unit) else (VALUE, MEAN)),
        ("SUM", "Sum", (VALUE, TOTAL)),
        ("LEAST", "Least", (VALUE, LEAST)),
        ("MOST", "Greatest", (VALUE, MOST)),
        ("NEAREST", "Nearest neighbour's", (VALUE, NEAREST)),
    )
    for prefix, word, how in reductions:
        doc = f"{word} {name} among the neighbours within r that share one."
        yield _sensing(f"{prefix}_{name.upper()}", dimension, doc, Formula(*how, row=row), unit)


def _sharing(name: str, argument: str, row: int, dimension: Dimension) -> HostFunction:
    """A function that shares a number with the neighbours."""
    doc = f"Shows this {argument} to the neighbours from the next tick on."

    def share(senses: BodySenses, robots: Whole, values: Floats) -> None:
        senses.of(RangeAndBearing).share(row, robots, values)

    shown = BodyColumn(f"shared {row}", 8, lambda bodies: _near(bodies).following(row))
    return replace(acting(name, dimension, argument, doc, share), writes=(Writing(shown, 0),))


def _sensing(name: str, dimension: Dimension, doc: str, asked: Formula | OverPairs, unit: str = "") -> HostFunction:
    """A function of a radius, and of a colour if one is given. unit: see `HostFunction`."""

    def many(bodies: Any, robots: Whole, *columns: Floats) -> Floats:
        return _near(bodies).sense(asked, robots, *columns)

    return HostFunction(
        name,
        partial(_alone, many),
        (LENGTH, NONE),
        native=_Constant(asked) if isinstance(asked, Formula) else None,
        least=1,
        arguments="r [colour]",
        result=dimension,
        acts=False,
        doc=f"{doc} With a colour: of that colour only.",
        many=many,
        unit=unit or ("deg" if name in DIRECTIONS else ""),
    )


def _near(bodies: Any) -> RangeAndBearing:
    """The sensors of a fleet, whose bodies are given, or of a body."""
    senses: BodySenses = bodies.senses
    return senses.of(RangeAndBearing)


def _alone(many: Callable[..., Floats], body: Body, *arguments: float) -> float:
    """What a function of many bodies gives for one of them."""
    return float(many(body, np.array([body.number]), *(np.array([each]) for each in arguments))[0])


class _Constant:
    """The native form of a formula, for one radius of all robots alone: on it depends in which order neighbours are
    added up, and so the last bit of a sum."""

    def __init__(self, formula: Formula) -> None:
        self._formula = formula

    def takes(self, arguments: Sequence[float | None]) -> bool:
        return arguments[0] is not None

    def bound(self, bodies: Any, arguments: Sequence[float | None]) -> NativeCall | None:
        return _near(bodies).bound(self._formula, arguments)


def _ranking() -> HostFunction:
    """The function of a rank by distance, and of what the others take."""

    def many(bodies: Any, robots: Whole, rank: Floats, *columns: Floats) -> Floats:
        ranks = np.full(int(robots.max(initial=0)) + 1, np.nan)
        ranks[robots] = rank
        return _near(bodies).sense(lambda _, pairs: pairs.distance_of(ranks[pairs.asked]), robots, *columns)

    return HostFunction(
        "RANK_DIST",
        partial(_alone, many),
        (NONE, LENGTH, NONE),
        least=2,
        arguments="n r [colour]",
        result=LENGTH,
        acts=False,
        doc="Distance of the n-th nearest neighbour within r; of the farthest, if there are fewer. With a colour: of "
        "that colour only.",
        many=many,
    )


def _telling_apart(model: NeighbourModel, above: Mapping[str, str]) -> HostFunction:
    """The function of who is nearest, with all that is sensed of each neighbour by its id."""

    def nearest(bodies: Any, robots: Whole, *columns: Floats) -> Floats:
        near = _near(bodies)
        return near.nearest(robots, *columns) + near.first_id

    def lists(bodies: Any, robots: Whole, most: int, *columns: Floats) -> tuple[Whole, Whole]:
        near = _near(bodies)
        first, others = near.neighbours(robots, most, *columns)
        return first, others + near.first_id

    def list_one(body: Body, most: int, *arguments: float) -> list[float]:
        columns = (np.array([each]) for each in arguments)
        ids: list[float] = lists(body, np.array([body.number]), most, *columns)[1].tolist()
        return ids

    def shown(field: str, bodies: Any, robots: Whole, others: Floats) -> Floats:
        near = _near(bodies)
        return near.shown(field, robots, others - near.first_id)

    def shown_by_one(field: str, body: Body, other: float) -> float:
        return _alone(partial(shown, field), body, other)

    sense, more = partial(_alone, nearest), model.shares | dict.fromkeys(model.shows_groups, "")
    more |= above
    return nearest_id(sense, list_one, shown_by_one, many=nearest, list_many=lists, field_of_many=shown, more=more)
