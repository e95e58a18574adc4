"""Lights, pings and neighbours as a scenario file describes them, what hides them, and the variables in which robots
sense them.

After Hoskins's vehicles: a ping carries the caste of its sender and is received with its range and whether it came
from the front or the rear; a light is sensed in the same way. Pings are presented one at a time, in pFlag, pRange,
pBearing and pCaste, for one tick each; the light in sFlag, sRange and sBearing, for as long as it is visible.
`bodies.senses` simulates them. Neighbours are sensed by functions, see `bodies.range_and_bearing`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf, pi

from sleepcast.core.model import Quantity
from sleepcast.core.neighbours import SHOWN
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table, checked_name
from sleepcast.core.ticks import nearest_ticks
from sleepcast.core.units import LENGTH, TIME, UNITS
from sleepcast.robot import BodyConstant

MAX_LIGHTS = 32
"""Lights of one world: every robot looks for the nearest one at every tick."""
MAX_SHARES = 8
"""Numbers that robots show to their neighbours: a beacon of a real robot carries some bytes."""
MAX_DELAYED = 4_194_304
"""Robots times ticks of a delay: what is stored of them takes some 200 megabytes."""
MAX_SHOWN_GROUPS = 8
"""Groups that robots show to their neighbours: as many as other numbers."""
SENSED = ("x", "y", "heading", "dist")
"""What robots sense of neighbours without being told: `MEAN_X`, `NEAREST_DIST` and so on are about these."""
MAX_QUEUE = 64
"""Pings queued on one robot: at one per tick, the last of them is already stale."""
SIGHT_SINCE = 2
"""The format of scenarios in which walls hide lights, pings and neighbours, unless it is said otherwise."""
WHOLE_TURN = 2.0 * pi
FRONT, REAR = 1.0, -1.0
"""Bearings: within a quarter turn of the heading, or not."""
LIGHT_NAMES = ("sFlag", "sRange", "sBearing")
PING_NAMES = ("pFlag", "pRange", "pBearing", "pCaste")


@dataclass(frozen=True, slots=True)
class Light:
    """A light at (x, y), in m, visible up to `reach` m away."""

    name: str
    title: str
    x: float
    y: float
    reach: float


@dataclass(frozen=True, slots=True)
class PingModel:
    """How pings are received.

    reach: range, m
    loss: probability that a robot misses a ping
    queue: pings that a robot queues; a new one replaces the oldest
    """

    reach: float
    loss: float
    queue: int


@dataclass(frozen=True, slots=True)
class NeighbourModel:
    """How robots sense their neighbours.

    reach: range, m
    loss: probability of missing a neighbour in a tick
    noise: standard deviation, in each direction, of a neighbour's sensed place, as a share of its distance
    shares: the numbers that robots show to their neighbours, by name, each with its unit ("" for a plain number)
    shows_groups: the groups of which neighbours see who is in them
    delay: how old all is that robots sense of neighbours, s
    field: angle of view around a robot's own direction, rad; a whole turn for all sides
    all_round: distance within which it senses on all sides, m
    """

    reach: float
    loss: float
    noise: float
    shares: dict[str, str]
    shows_groups: tuple[str, ...] = ()
    delay: float = 0.0
    field: float = WHOLE_TURN
    all_round: float = 0.0


@dataclass(frozen=True, slots=True)
class SightModel:
    """What walls hide from robots: lights, pings, and neighbours with all that they show. bodies_hide: whether lights
    and pings are hidden behind other robots, too."""

    lights: bool
    pings: bool
    neighbours: bool
    bodies_hide: bool


THROUGH_ALL = SightModel(lights=False, pings=False, neighbours=False, bodies_hide=False)
"""Nothing hides anything, as in scenarios of format 1."""


def read_sight(root: Table, version: int) -> SightModel:
    """The table `[sight]`. version: of the scenario's format; from 2 on walls hide, unless it says otherwise."""
    refuse_sight(root, "sight", version)
    if version < SIGHT_SINCE:
        return THROUGH_ALL
    with root.table("sight") as table:
        return SightModel(
            lights=table.flag("lights", True),
            pings=table.flag("pings", True),
            neighbours=table.flag("neighbours", True),
            bodies_hide=table.flag("bodies_hide", False),
        )


def refuse_sight(table: Table, key: str, version: int) -> None:
    """Raise SettingsError if a file of a format in which walls hide nothing has this key, which says what they hide."""
    if version < SIGHT_SINCE and table.has(key):
        raise table.error(key, f"walls hide something in format {SIGHT_SINCE} only: write format = {SIGHT_SINCE}")


def read_lights(root: Table, size: tuple[float, float], places: Sequence[str]) -> tuple[Light, ...]:
    """The tables `[lights.NAME]`. places: names already in use."""
    lights = []
    for name, table in root.tables("lights", most=MAX_LIGHTS).items():
        if checked_name(root.table("lights"), name) in places:
            raise root.table("lights").error(name, "a place has this name already; choose another")
        with table:
            x = table.number("x", LENGTH, low=0.0, high=size[0])
            y = table.number("y", LENGTH, low=0.0, high=size[1])
            reach = table.number("reach", LENGTH, inf, low=0.0)
            lights.append(Light(name, table.text("title", name, most=60), x, y, reach))
    return tuple(lights)


def read_pings(root: Table) -> PingModel | None:
    """The table `[pings]`, None if there is none."""
    if not root.has("pings"):
        return None
    with root.table("pings") as table:
        return PingModel(
            reach=table.number("reach", LENGTH, low=0.0),
            loss=table.number("loss", default=0.0, low=0.0, high=1.0),
            queue=table.whole("queue", 4, low=1, high=MAX_QUEUE),
        )


def read_neighbours(root: Table, above: Iterable[str] = ()) -> NeighbourModel | None:
    """The table `[neighbours]`, None if there is none. above: what robots that fly sense of others besides."""
    sensed = (*SENSED, *above)
    if not root.has("neighbours"):
        return None
    with root.table("neighbours") as table:
        with table.table("shares") as shares:
            if len(shares.values) > MAX_SHARES:
                raise table.error("shares", f"{len(shares.values)} of them; at most {MAX_SHARES} fit")
            units = {checked_name(shares, name): shares.text(name, choices=("", *UNITS)) for name in shares.values}
            for name in units:
                if name.casefold() in sensed:
                    raise shares.error(name, "robots sense this of every neighbour; choose another name")
        if table.has("all_round") and not table.has("field"):
            raise table.error(
                "all_round", "without a field robots sense on all sides: leave this out, or say the field"
            )
        return NeighbourModel(
            reach=table.number("reach", LENGTH, low=0.0),
            field=table.number("field", default=WHOLE_TURN, low=0.0, high=WHOLE_TURN),
            all_round=table.number("all_round", LENGTH, 0.0, low=0.0),
            loss=table.number("loss", default=0.0, low=0.0, high=1.0),
            noise=table.number("noise", default=0.0, low=0.0, high=1.0),
            shares=units,
            shows_groups=_shown_groups(table, (*units, *sensed)),
            delay=table.number("delay", TIME, 0.0, low=0.0),
        )


def refuse_delay(root: Table, model: NeighbourModel | None, robots: int, tick: float) -> None:
    """Raise SettingsError for a delay of what robots sense of neighbours that is no tick, or for which too much has to
    be stored. tick: s"""
    if model is None or not model.delay:
        return
    table, ticks = root.table("neighbours"), nearest_ticks(model.delay, tick)
    if ticks == 0:
        raise table.error("delay", f"shorter than a tick of {tick:g} s; leave it out, or make the tick shorter")
    if ticks * robots > MAX_DELAYED:
        most = MAX_DELAYED // robots * tick
        raise table.error("delay", f"too long to store what {robots} robots show: at most {most:g} s fit")


def _shown_groups(table: Table, others: Iterable[str]) -> tuple[str, ...]:
    """The groups that neighbours show, of none of which the name has another meaning to OF, as these others have."""
    names = table.texts("shows_groups", most=MAX_SHOWN_GROUPS)
    taken = {*SHOWN, *(name.casefold() for name in others)}
    for name in names:
        if checked_name(table, name, "shows_groups").casefold() in taken:
            raise table.error("shows_groups", f"neighbours show something else as {name:.60}; choose another name")
        taken.add(name.casefold())
    return names


def signal_sensors(lights: tuple[Light, ...], pings: PingModel | None, length: str) -> tuple[Quantity, ...]:
    """The sensors for lights and pings, if there are any. length: the unit in which ranges are shown."""
    return (
        *(_sensors(LIGHT_NAMES, "a light is seen", "of the nearest light", length) if lights else ()),
        *(_sensors(PING_NAMES[:3], "a ping is presented", "of its sender", length) if pings else ()),
        *((Quantity(PING_NAMES[3], doc="the caste that the ping carries"),) if pings else ()),
    )


def _sensors(names: tuple[str, ...], flag: str, whose: str, length: str) -> tuple[Quantity, ...]:
    return (
        Quantity(names[0], low=0.0, high=1.0, doc=f"whether {flag}"),
        Quantity(names[1], "m", 0.0, inf, doc=f"distance {whose}", shown_as=length),
        Quantity(names[2], low=REAR, high=FRONT, doc=f"FRONT or REAR: bearing {whose}"),
    )


def signal_constants(lights: tuple[Light, ...], pings: PingModel | None) -> tuple[BodyConstant, ...]:
    """The names of the bearings, if there are lights or pings."""
    if not lights and pings is None:
        return ()
    return (
        BodyConstant("FRONT", FRONT, doc="bearing of what lies ahead, within 90 degrees of the heading"),
        BodyConstant("REAR", REAR, doc="bearing of what lies behind"),
    )
