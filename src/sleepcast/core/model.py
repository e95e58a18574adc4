"""What describes a robot, for minds and bodies alike: quantities, constants, functions of its own software; and the
commands that a scenario offers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any, Protocol

from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.core.units import Dimension, dimension_of


@dataclass(frozen=True, slots=True)
class Quantity:
    """A named physical value that a robot has: what minds and bodies both say of it.

    unit: a key of `UNITS` or "" for a plain number; the value itself is always held in SI.
    low, high: its declared range in SI, -inf..inf where none is.
    freshness: seconds after which a measured value counts as unknown, inf for never.
    shown_as: the unit in which people read it ("%", "mi"); the same as `unit` unless said otherwise.
    """

    name: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    freshness: float = math.inf
    doc: str = ""
    shown_as: str = ""

    @property
    def dimension(self) -> Dimension:
        return dimension_of(self.unit)

    @property
    def shown_unit(self) -> str:
        """The unit in which people read it, "" for a plain number."""
        return self.shown_as or self.unit


@dataclass(frozen=True, slots=True)
class Constant:
    """A named number. dimension None: it takes the unit of what it meets."""

    name: str
    value: float
    dimension: Dimension | None = None
    doc: str = ""


@dataclass(frozen=True, slots=True)
class NamedArea:
    """An area that robots know by its name. sizes: x, y and radius of a disc, or x and y of each corner of a polygon,
    m of the world's frame."""

    name: str
    sizes: tuple[float, ...]

    @property
    def is_disc(self) -> bool:
        return len(self.sizes) == 3


class MapOutline(NamedTuple):
    """What is drawn on maps under a name, as a line through points, m of the robots' frame. closed: back to the first
    one, around an area; else it is a way."""

    name: str
    points: tuple[tuple[float, float], ...]
    closed: bool


class NativeCall(NamedTuple):
    """How native code calls a function that only senses, for some robots at once; addresses.

    call: of `void f(void *context, int64_t first, int64_t mask, int64_t lanes, double *arguments, double *results)` for
        robots from `first` on whose bits are set, at most as many as `lanes`: so many are the numbers of each argument,
        one after the other, and the results, NaN for unknown
    context: of what it is given first
    prepare: of `void f(void *)`, to be called with `senses` before the first call after bodies have moved; a second
        time it does nothing
    senses: of what that is given; one for many functions
    owner: keeps alive what lies at these addresses
    usable: gives whether it may be called now, so that its rules are not walked instead; None if it always may be
    """

    call: int
    context: int
    prepare: int
    senses: int
    owner: object
    usable: Callable[[], bool] | None = None


class NativeForm(Protocol):
    """The native form of a function that only senses. arguments: the numbers that are the same in every call, None for
    others."""

    def takes(self, arguments: Sequence[float | None], /) -> bool:
        """Whether it may be called with these."""

    def bound(self, bodies: Any, arguments: Sequence[float | None], /) -> NativeCall | None:
        """How it is called with these from now on, for all robots of a fleet, whose bodies are given; None where that
        cannot be compiled. May take long, and may be called from any thread."""


class NeighbourSensor(NamedTuple):
    """How robots tell which neighbours they sense in this tick, and what of each. What they sense is noise and losses
    included, and in the robot's own frame of reference.

    call: of one robot, `call(body, most, radius, *colour)`: the ids of its neighbours within the radius (m), of this
        colour if one is given; the nearest ones if there are more than `most`
    many: the same for many, `many(bodies, robots, most, radii, *colours)` with an array for each argument: where the
        neighbours of each robot begin, and after the last one of all, then the ids of all, ascending for each robot
        and int64 as the first; None if their bodies cannot
    fields: what robots sense of one neighbour: functions of its id, unknown for one that is not sensed, with the names
        by which texts ask for them
    """

    call: Callable[..., Sequence[float]]
    many: Callable[..., Any] | None
    fields: tuple[tuple[str, HostFunction], ...]


class BodyColumn(NamedTuple):
    """An array of a body's simulator.

    name: tells it from others
    size: bytes of its elements, one for each robot: one or eight
    of: gives the array of the bodies of a fleet
    """

    name: str
    size: int
    of: Callable[[Any], Any]


class Writing(NamedTuple):
    """What an acting function writes of a robot: nothing else, nothing that robots can sense before the next tick, and
    where the robot is not stopped nothing can refuse it.

    into: the column
    argument: the number of the argument that is written, None for `value`
    unless: flags of the robots of which nothing is written, None for none
    low, high: between which the argument is brought first, as `numpy.clip` does
    """

    into: BodyColumn
    argument: int | None = None
    value: float = 0.0
    unless: BodyColumn | None = None
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True, slots=True)
class HostFunction:
    """A function of the robot's own software: which one, and how it is called on whatever body. It holds nothing of any
    robot, so that those of one type share it, in however many worlds they live.

    dimensions: one for each argument, None where any will do; `least` arguments must be given.
    result: dimension of the value.
    acts: whether it does something to the world (then an unknown argument never reaches it).
    labelled: whether its only argument is a text in quotes.
    call: `call(body, *arguments)` returns a float or None (which counts as 1).
    many: does the same for many bodies at once, `many(bodies, robots, *arguments)` with an array for each argument and
        one of results (None: all 1), or a list of them in which an exception says why it failed; None if their bodies
        cannot. `bodies` are those of the whole fleet.
    irreversible: whether it cannot be undone, so that a desk asks for how many robots it is meant.
    moves: whether it moves the robot's body, if it acts.
    unit: in which people read the value, where its dimension does not say that: "deg" for a direction.
    value: the number that its name stands for where it is not called, if it has one: of a mode that has become a
        function, for instance.
    reads: the name of the sensor that it reads with such arguments (None for those that differ), if it does nothing
        else; "" where it does.
    native: how native code calls it, if it only senses; None where it cannot.
    writes: all that it does, if it acts and does no more than that; its value is 1.
    neighbours: how robots that have this function tell who is near them; None for all functions but NEAREST_ID.
    repeats: whether `many` takes a robot several times at once, with arguments that differ; else it is asked of each
        robot once at a time.
    """

    name: str
    call: Callable[..., float | None]
    dimensions: tuple[Dimension | None, ...] = ()
    least: int | None = None
    arguments: str = ""
    result: Dimension | None = None
    acts: bool = True
    labelled: bool = False
    doc: str = ""
    many: Callable[..., Any] | None = None
    irreversible: bool = False
    moves: bool = True
    unit: str = ""
    value: float | None = None
    reads: Callable[[Sequence[float | None]], str] | None = field(default=None, compare=False)
    native: NativeForm | None = field(default=None, compare=False)
    writes: tuple[Writing, ...] = field(default=(), compare=False)
    neighbours: NeighbourSensor | None = field(default=None, compare=False)
    repeats: bool = field(default=False, compare=False)

    @property
    def usage(self) -> str:
        return f"({self.name} {self.arguments})" if self.arguments else f"({self.name})"


@dataclass(frozen=True, slots=True)
class ReadyCommand:
    """A command that a scenario offers on its page, with the words that a person would say.

    blank: its text with the names of numbers in braces; "" where there are none.
    needs: the number of the one to be sent before, from 1; 0 for none.
    together: whether it works only with the others of which this is said, which a page sends in their order at one
        press.
    """

    title: str
    text: str
    about: str = ""
    blank: str = ""
    needs: int = 0
    together: bool = False


class RestState(NamedTuple):
    """Whether a body is at rest, and how far it may still go until it is. speed: m/s of its fastest part, 0 at rest;
    distance: m. NaN where it does not know."""

    speed: float
    distance: float

    @property
    def at_rest(self) -> bool:
        return self.speed == 0.0
