"""The table of a neighbourhood: where everything lies that robots sense of each other, for compiled code.

Compiled code (`kernels_neighbours`) gets one address and finds all else in the table there, so that it can be called
from Python and from the native code of rules alike. A `Vicinity` is one radius with all bodies sorted into its cells;
what is asked about the bodies within it is a `Formula`: a quantity of each neighbour, and how all of these are folded
into one number.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import key
from sleepcast.core.records import NamedTuple
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.signals import WHOLE_TURN, NeighbourModel
from sleepcast.simulator.simd.formulas import LANES, sine_cosine, square_within
from sleepcast.simulator.world.grid import Floats, Short, Whole
from sleepcast.simulator.world.sight import SightLines, SolidsByCell
from sleepcast.simulator.world.torus import PLAIN, Cells, cells_over

# What a neighbour is asked for.
ONE, DX, DY, AWAY, HEADING, VALUE, ANGLE, BEARING, DZ, PITCH = range(10)
# How the answers of all neighbours become one number; or who they are.
TOTAL, MEAN, LEAST, MOST, NEAREST, DIRECTION, OUTLIER, LISTED = range(8)
# Whose own place is added to it: none's, or the x, y or z of the robot that asks.
AS_IT_IS, FROM_X, FROM_Y, FROM_Z = range(4)


class Formula(NamedTuple):
    """A number from what a robot senses of its neighbours.

    quantity: 1, the x, y or z of the vector to the neighbour, its length, its heading, the number of `row` that it
        shares, or that number as an angle
    fold: total, mean, least, most, that of the nearest one, direction of the sum of unit vectors, or that of the one
        farthest from the mean place
    frame: whether the robot's own x, y or z is added
    row: of the table of shared numbers
    """

    quantity: int
    fold: int
    frame: int = AS_IT_IS
    row: int = 0


class Near(IntEnum):
    """The words of the table of a neighbourhood, 64 bits each: numbers of things, addresses of arrays and, where it is
    said, numbers with a point. Arrays have one number for each robot."""

    COUNT = 0
    """Robots."""
    X = 1
    """Where neighbours are seen: their true poses, or those of some time ago. So are HEADING and Z."""
    Y = 2
    HEADING = 3
    SENSED_X = 4
    SENSED_Y = 5
    SENSED_HEADING = 6
    SHARED = 7
    """What neighbours see in this tick: rows of numbers, colours first."""
    SHARED_NEXT = 8
    SHARES = 9
    """Numbers of all its rows together."""
    TURNED = 10
    """Whether robots may sense another heading than their true one."""
    TORUS = 11
    WIDTH = 12
    """Of the torus, m, with a point; so is the height."""
    HEIGHT = 13
    LOSS = 14
    """With a point, as the noise."""
    NOISE = 15
    LOST_KEY = 16
    """Keys of chance in this tick."""
    ACROSS_KEY = 17
    UP_KEY = 18
    ABOVE_KEY = 19
    COSINE = 20
    """Of the true headings."""
    SINE = 21
    TURNING = 22
    """Whether cosines and sines are wanted."""
    SIGHT = 23
    """Address of the table of what hides neighbours, see `sight.Lines`."""
    Z = 24
    """NaN of what does not fly; 0 where nothing does, and neighbours lie in a disc instead of a ball."""
    SENSED_Z = 25
    OWN_X = 26
    """The true poses, for robots that ask."""
    OWN_Y = 27
    OWN_HEADING = 28
    OWN_Z = 29
    PITCH = 30
    """How far the true direction of each robot points up, rad; 0 where all look level."""
    EDGE = 31
    """With a point, as the next one: the cosine of the angle to the edge of what is seen, -2 for all sides."""
    ALL_ROUND = 32
    """m, within which all sides are sensed."""
    SEEN_PITCH = 33
    """The same as neighbours see it."""
    VICINITIES = 34
    """Vicinities to be kept up to date; their addresses follow from FIRST on."""
    FIRST = 35


class Of(IntEnum):
    """The words of the table of a vicinity."""

    NEAR = 0
    """Address of the table of its neighbourhood."""
    STALE = 1
    """Whether bodies have moved since they were sorted."""
    REACH = 2
    """m, with a point; so are size and margin."""
    SIZE = 3
    COLUMNS = 4
    ROWS = 5
    MARGIN = 6
    X = 7
    """Places of all points: bodies and, on a torus, their images."""
    Y = 8
    WHOSE = 9
    """The body of each point, int32, as all that follows but for the sorted places."""
    CELL = 10
    START = 11
    """First of the sorted points of each cell; with room for two more cells."""
    ORDER = 12
    """The sorted points, their bodies and their places."""
    SORTED_WHOSE = 13
    SORTED_X = 14
    SORTED_Y = 15
    WALLS = 16
    """Address of the table of all solids within reach of each cell, see `sight.SightLines.around`; 0 where the walk
    along cells takes less time."""
    LAYERS = 17
    """Of cells above each other."""
    SORTED_Z = 18


LOST, ACROSS, UP, ABOVE = "neighbour lost", "neighbour across", "neighbour up", "neighbour above"
"""What is drawn by chance for each pair in each tick."""
MAX_VICINITIES = 16
"""Radii of one run at most that are kept up to date for native code."""


class BodyTables(NamedTuple):
    """What robots sense of each other rests on these arrays, one number a robot, float64.

    x, y, heading: true pose, m and rad
    sensed_x, sensed_y, sensed_heading: the pose that the robot senses
    shared, following: what neighbours see in this tick, and in the next one; shape (rows, robots), colours first
    heights: true and sensed z, m; None where nothing flies
    seen: x, y and heading, and z where something flies, as neighbours see them, if they do not see the true ones
    pitch: how far the true direction points up, rad; None where all look level
    seen_pitch: the same as neighbours see it
    """

    x: Floats
    y: Floats
    heading: Floats
    sensed_x: Floats
    sensed_y: Floats
    sensed_heading: Floats
    shared: Floats
    following: Floats
    heights: tuple[Floats, Floats] | None = None
    seen: tuple[Floats, ...] | None = None
    pitch: Floats | None = None
    seen_pitch: Floats | None = None

    @property
    def own(self) -> tuple[Floats, ...]:
        """True x, y and heading, and z where something flies."""
        return (self.x, self.y, self.heading, *(self.heights or ())[:1])


class Vicinity:
    """All bodies around each one up to one radius. reach: m, with a margin for rounding. ball: whether they lie in a
    ball, not in a disc."""

    def __init__(self, near: Neighbourhood, count: int, cells: Cells, reach: float) -> None:
        grid, torus = cells.grid, cells.around != PLAIN
        doubling = 2.0 * reach <= min(cells.around)  # then each axis has an image of a body at most
        self.points = count * (1 if not torus else 4 if doubling else 9)
        """Bodies and their images, at most."""
        self._places = np.empty((4 + near.flies, self.points + LANES))  # kernels read LANES at once
        self._indices = np.empty((4, self.points + LANES), np.int32)
        self._start = np.empty(grid.cells + 2, np.int32)
        self.table = np.zeros(len(Of), np.int64)
        table, reals = self.table, self.table.view(np.float64)
        reals[Of.REACH], reals[Of.SIZE], reals[Of.MARGIN] = reach, grid.size, cells.margin[0]
        table[Of.NEAR], table[Of.STALE] = near.address, 1
        table[Of.COLUMNS], table[Of.ROWS], table[Of.START] = grid.columns, grid.rows, self._start.ctypes.data
        table[Of.LAYERS] = grid.layers
        words = (Of.X, Of.Y, Of.SORTED_X, Of.SORTED_Y, Of.SORTED_Z)
        for word, row in zip(words, self._places, strict=False):  # there is no z on the plane
            table[word] = row.ctypes.data
        indices = (row.ctypes.data for row in self._indices)
        table[Of.WHOSE], table[Of.CELL], table[Of.ORDER], table[Of.SORTED_WHOSE] = indices
        self.address = self.table.ctypes.data
        self._reach, self._count, self.ball = reach, count, near.flies
        self._walls: SolidsByCell | None = None

    def order_of(self, robots: Whole) -> Short:
        """In which order compiled code best looks at some robots, as indices of them: all bodies by cell, in which they
        are sorted, so that what lies around one serves the next."""
        if not np.array_equal(robots, np.arange(self._count)):
            return np.arange(robots.size, dtype=np.int32)
        points: Short = self._indices[2, : self._start[-2]]
        return points[points < self._count]

    def hide(self, sight: SightLines) -> None:
        """Let what is solid there hide neighbours."""
        self._walls = sight.around(self._reach) if sight else None
        self.table[Of.WALLS] = self._walls.address if self._walls is not None else 0


class Neighbourhood:
    """The tables of all bodies of a scenario. seed: of the run; sight: what hides neighbours, if walls do."""

    def __init__(
        self, scenario: Scenario, model: NeighbourModel, seed: int, tables: BodyTables, sight: SightLines
    ) -> None:
        count = len(tables.x)
        self._scenario, self._seed, self._count = scenario, seed, count
        self._turns: Floats = np.empty((2, count))
        self.turned = bool(scenario.noise or scenario.robots.wheels or scenario.sorts)
        """Whether robots may sense another heading than their true one."""
        self.table = np.zeros(Near.FIRST + MAX_VICINITIES, np.int64)
        self.address = self.table.ctypes.data
        self._passing: dict[float, Vicinity] = {}
        self._kept: dict[float, Vicinity] = {}
        self._sight, self._version = sight, sight.version
        self._rises = scenario.ground is not None and scenario.sight.neighbours
        self.flies = tables.heights is not None
        """Whether neighbours lie in a ball."""
        self._arrays = {
            (Near.SENSED_X, Near.SENSED_Y, Near.SENSED_HEADING, Near.SHARED, Near.SHARED_NEXT): tables[3:8],
            (Near.COSINE, Near.SINE): tuple(self._turns),
            (Near.OWN_X, Near.OWN_Y, Near.OWN_HEADING, Near.OWN_Z): tables.own,
            (Near.X, Near.Y, Near.HEADING, Near.Z): tables.seen or tables.own,
            (Near.SENSED_Z,): (tables.heights or ())[1:],
        }
        """By the words that have their addresses; those of heights are left 0 on the plane."""
        for words, arrays in self._arrays.items():
            for word, array in zip(words, arrays, strict=False):
                self.table[word] = array.ctypes.data
        self.table[Near.COUNT], self.table[Near.SHARES] = count, tables.shared.size
        self.table[Near.TURNED], self.table[Near.TORUS] = self.turned, scenario.around != PLAIN
        self.table[Near.SIGHT] = sight.address
        self._pitches = {Near.PITCH: tables.pitch, Near.SEEN_PITCH: tables.seen_pitch}
        for word, pitch in self._pitches.items():
            self.table[word] = 0 if pitch is None else pitch.ctypes.data
        reals = self.table.view(np.float64)
        reals[Near.WIDTH], reals[Near.HEIGHT] = scenario.around
        reals[Near.LOSS], reals[Near.NOISE] = model.loss, model.noise
        reals[Near.EDGE], reals[Near.ALL_ROUND] = edge_of(model), model.all_round
        self.chancy = bool(model.loss or model.noise)
        """Whether chance has a part in what robots sense."""
        self._drawn = -1

    @property
    def covered(self) -> bool:
        """Whether kernels know all that hides neighbours: nobody can look over anything, since for them it is endless
        upwards, and no ground that rises."""
        return not self.flies or (self._sight.levels is None and not self._rises)

    def keep_up(self) -> bool:
        """Take over what hides neighbours; gives whether it has changed."""
        if self._version == self._sight.version:
            return False
        self._version = self._sight.version
        for vicinity in (*self._kept.values(), *self._passing.values()):
            vicinity.hide(self._sight)
        return True

    def step(self, tick: int) -> None:
        """Bodies have moved."""
        self._draw(tick)
        self._passing.clear()
        for vicinity in list(self._kept.values()):
            vicinity.table[Of.STALE] = 1

    def _draw(self, tick: int) -> None:
        """Set the keys of chance of this tick."""
        if self.chancy and self._drawn != tick:
            purposes = (LOST, ACROSS, UP, *((ABOVE,) if self.flies else ()))
            keys = [key(self._seed, purpose, tick) for purpose in purposes]
            self.table[Near.LOST_KEY : Near.LOST_KEY + len(keys)].view(np.uint64)[:] = keys
            self._drawn = tick

    def begin(self, tick: int) -> int:
        """Prepare for questions about single neighbours in this tick; gives the address of the table."""
        self._draw(tick)
        return self.address

    def vicinity(self, reach: float, tick: int, *, turning: bool) -> Vicinity:
        """The vicinity of this reach (m) in this tick, to be prepared. turning: whether headings are asked for."""
        self._draw(tick)
        self._want(turning)
        vicinity = self._kept.get(reach) or self._passing.get(reach)
        if vicinity is None:
            if len(self._passing) == MAX_RECENT:
                self._passing.clear()
            vicinity = self._passing[reach] = self._made(reach)
        return vicinity

    def keep(self, reach: float, *, turning: bool) -> Vicinity | None:
        """The vicinity of this reach, kept up to date from now on; None if there are too many."""
        self._want(turning)
        vicinity = self._kept.get(reach)
        if vicinity is None and len(self._kept) < MAX_VICINITIES:
            vicinity = self._kept[reach] = self._made(reach)
            self.table[Near.FIRST + self.table[Near.VICINITIES]] = vicinity.address
            self.table[Near.VICINITIES] += 1
        return vicinity

    def _want(self, turning: bool) -> None:
        """Have cosines and sines of headings computed from now on, if they are asked for."""
        if turning and not self.table[Near.TURNING]:
            self.table[Near.TURNING] = 1
            for vicinity in (*self._kept.values(), *self._passing.values()):
                vicinity.table[Of.STALE] = 1

    def _made(self, reach: float) -> Vicinity:
        made = Vicinity(self, self._count, cells_of(self._scenario, self._count, reach), reach)
        made.hide(self._sight)
        return made


MAX_RECENT = 4
"""Radii, and sets of pairs, that are stored until the tick ends: rules often ask several things about the same
neighbours."""


def cells_of(scenario: Scenario, count: int, reach: float) -> Cells:
    """Cells of about `reach` m for so many bodies, and on a torus their images; in layers where some fly."""
    ceilings = [spec.limits.ceiling for spec in scenario.each_type if spec.flight is not None]
    top = max(ceilings, default=None)
    return cells_over((scenario.width, scenario.height), scenario.around, reach, reach, count, top)


ALL_SIDES = -2.0
"""The `edge_of` who senses on all sides: no cosine is as small."""


def edge_of(model: NeighbourModel) -> float:
    """Cosine of the angle between a robot's own direction and the edge of its field of view."""
    return float(sine_cosine(np.array(model.field / 2.0))[1]) if model.field < WHOLE_TURN else ALL_SIDES


def question(vicinity: Vicinity, formula: Formula, radius: float, *, coloured: bool) -> NDArray[np.int64]:
    """The table of one question, for native code: the address of a vicinity, a formula, the `square_within` of the
    radius (m), and whether it asks for neighbours of one colour."""
    within = np.float64(square_within(radius)).view(np.int64)
    return np.array([vicinity.address, *formula, within, coloured], np.int64)
