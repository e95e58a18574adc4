"""The robots of a scenario: the table [robots] of its file as plain frozen dataclasses in SI."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import inf, pi, tan

from sleepcast.core.quantities import Measure
from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.core.settings import Table, checked_name, shown_key
from sleepcast.core.units import ACCELERATION, LENGTH, NONE, RATE, SPEED, TIME, UNITS, Dimension
from sleepcast.robot import Geometry, Limits
from sleepcast.simulator.scenario.flight import PARTICLE, FlightSpec, read_flight, read_particle
from sleepcast.simulator.scenario.groups import RobotGroup
from sleepcast.simulator.scenario.signals import LIGHT_NAMES, PING_NAMES
from sleepcast.simulator.scenario.starts import STANDS, Starts, read_starts

MAX_ROBOTS = 1_000_000
"""Bodies in one world: a tick of so many takes about real time on two cores. Minds have their own bound."""
USUAL_ROOM = 4
"""Times as many robots of a sort that may hatch there may be as at the start, unless the scenario says."""
MAX_STORES = 16
"""Stores of one robot: each is a variable on every robot."""
MAX_SONARS = 64
"""Range sensors of one robot: each is a variable."""
MAX_BUMPERS = 24
"""Segments of a bumper: as many as fit into the bits of the Nomad protocol."""
MAX_ORDER = 256
"""Sonars in a firing order."""
MAX_PAUSE = 60.0
"""Longest pause between an echo and the next ping, s: the longest that Nomads have is one second."""
MAX_TIME = 10_000_000.0
"""Simulated seconds of one run: four months."""
MAX_TICKS = 10_000_000_000
"""Ticks of one run: the same time in the shortest ticks."""
MAX_WORLD = 10_000_000.0
"""Size of a world, m: a quarter of the way around the earth; beyond that, a flat world makes no sense."""
MAX_COUNTS = 1e7
"""Steps of an encoder in a metre of travel: a tenth of a micrometre each."""
LEAST = 1e-6
"""Least value of anything that must be above zero, in SI."""
WIDEST_BEAM = pi / 2
"""Widest opening of a sonar cone, rad: wider ones would look backwards."""
LEAST_ANGLE, WIDEST_ANGLE = pi / 180.0, 170.0 * pi / 180.0
"""Opening of a camera that looks down, rad: wider ones would see as far as the horizon."""
INCH = 0.0254
TENTH = INCH / 10
"""Unit of length in a Nomad's commands, m."""

BODY_NAMES = (
    *("x", "y", "heading", "speed", "drive_speed", "drive_turn", "bumper", "front_range"),
    *(f"sonar{number}" for number in range(MAX_SONARS)),
)
"""Variables that simulated bodies have or may have."""
SIDE_SPEED = "side_speed"
OMNI_NAMES = (SIDE_SPEED, "drive_side")
"""The variables that a body has because it drives in every direction."""
SIGNAL_NAMES = (*LIGHT_NAMES, *PING_NAMES, "FRONT", "REAR")
"""Further names that bodies have in worlds with lights or pings."""


@dataclass(frozen=True, slots=True)
class Supply:
    """A supply that robots carry: a variable `name` in SI, shown in `unit`.

    low, high: range of the uniform initial value, for the `share` of the robots that carry any
    full: capacity
    reach: distance that a body drives on a full store, m; inf if driving uses none of it
    lasts: time after which a full store is empty, whatever the body does, s; inf if time uses none of it
    """

    name: str
    unit: str
    low: float
    high: float
    full: float
    share: float = 1.0
    reach: float = inf
    lasts: float = inf
    about: str = ""

    @property
    def dimension(self) -> Dimension:
        return UNITS[self.unit].dimension if self.unit else NONE


@dataclass(frozen=True, slots=True)
class Wander:
    """How bodies roam on their own: at `speed` (m/s), with a turn rate that varies around 0 with standard deviation
    `turn_rate` (rad/s) and correlation time `steadiness` (s)."""

    speed: float
    turn_rate: float
    steadiness: float


@dataclass(frozen=True, slots=True)
class Wheels:
    """A differential drive: two wheels `track` m apart. The limits of speed and acceleration hold for each wheel.

    A wheel that turns by w m moves the body by w * (1 + slip) m, with `slip_left` and `slip_right`, plus a random
    part: its standard deviation is `slip_noise` m after 1 m and grows with the square root of the distance. The
    encoders measure w, in whole steps if there are `counts` of them in a metre, exactly if that is 0.
    """

    track: float
    slip_left: float = 0.0
    slip_right: float = 0.0
    slip_noise: float = 0.0
    counts: float = 0.0


@dataclass(frozen=True, slots=True)
class CrosstalkModel:
    """How sonars mistake other pings for their own.

    chance: probability that an audible foreign ping is mistaken
    spread: largest angle between the axes of sending and receiving sonar, rad
    robots: whether pings of other robots count too
    """

    chance: float
    spread: float
    robots: bool


@dataclass(frozen=True, slots=True)
class Ring:
    """Sonars evenly spaced around the rim, number 0 in front, then counter-clockwise.

    beam: full opening angle of each cone, rad
    least, most: m; ranges outside are clamped to these
    noise: standard deviation as a share of the range
    dropout: probability of a missed echo
    incidence: angle from the perpendicular beyond which a surface reflects nothing back, rad
    pause: time between one sonar's echo and the next one's ping, s; None if all sonars fire in every tick
    order: firing order
    crosstalk: None without
    """

    count: int
    beam: float
    least: float
    most: float
    noise: float
    dropout: float
    incidence: float
    pause: float | None
    order: tuple[int, ...]
    crosstalk: CrosstalkModel | None = None


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """The robots: number and type, start area (uniform in x and y, m), and equipment.

    wanders: whether they roam from the start; otherwise they stand until commanded
    wheels: None for bodies that turn and drive without wheels
    ring: None without sonars
    bumpers: number of bumper segments; 0 for bodies that nothing stops
    speed_unit: unit in which speeds are shown
    disc: x, y and radius (m) of a disc to start in instead, or None
    in_rows: whether robots are numbered along rows of the world, so that neighbours have close numbers
    groups: empty if all robots are alike
    slides: whether bodies slide along what they touch, instead of stopping there
    starts: where each of them starts, empty if that is left to chance
    hatch: whether robots may hatch more of them during a run, and any robot go
    most: how many of them there may be at one time; 0 for as many as `count`, or `USUAL_ROOM` times that with hatch
    at: when they come, s; 0 for those that are there at the start
    flight: None for bodies on the ground
    z: of the start, m, uniform as x and y
    omni: whether it drives in every direction, on the ground
    camera: opening angle of a camera that looks down, rad; 0 without one
    """

    type: str
    count: int
    x: tuple[float, float]
    y: tuple[float, float]
    limits: Limits
    geometry: Geometry
    wander: Wander
    wanders: bool
    stores: tuple[Supply, ...]
    speed_unit: str
    wheels: Wheels | None = None
    ring: Ring | None = None
    bumpers: int = 0
    disc: tuple[float, float, float] | None = None
    in_rows: bool = False
    groups: tuple[RobotGroup, ...] = ()
    slides: bool = False
    starts: Starts = ()
    hatch: bool = False
    most: int = 0
    at: float = 0.0
    flight: FlightSpec | None = None
    z: tuple[float, float] = (0.0, 0.0)
    omni: bool = False
    camera: float = 0.0

    @property
    def footprint(self) -> float:
        """How far from the point below it the camera of such a robot sees at most, m."""
        return self.limits.ceiling * tan(self.camera / 2.0) if self.camera else 0.0

    @property
    def comes_and_goes(self) -> bool:
        """Whether such robots come, or go."""
        return bool(self.hatch or self.most or self.at)


def read_count(robots: Table, groups: tuple[RobotGroup, ...], rows: Sequence[Table] | None) -> int:
    """Number of robots in the table `robots`; for groups it follows from their counts, else for poses (`rows`) from
    theirs. A run may use fewer robots than there are poses, but the file says the same of both."""
    poses = None if rows is None else len(rows)
    total = sum(group.count for group in groups) if groups else poses
    if total is not None and total > MAX_ROBOTS:
        raise robots.error("groups", f"{total} robots in all; at most {MAX_ROBOTS} fit")
    count = robots.whole("count", total, low=1, high=MAX_ROBOTS)
    if groups and count != total:
        raise robots.error("count", f"the groups add up to {total}: leave this out, or say the same")
    changed = robots.document.is_changed(shown_key((*robots.where, "count")))
    if poses is not None and count != poses and not changed:
        raise robots.error("starts", f"{poses} starts for {count} robots: write one for each")
    return count


def read_robots(
    table: Table,
    count: int,
    groups: tuple[RobotGroup, ...],
    rows: Sequence[Table] | None,
    size: tuple[float, float],
    taken: Iterable[str],
) -> RobotSpec:
    """A table of robots, except for `count`, `groups` and the poses of its starts, `rows`.

    count: number of robots, which may differ from the groups' sum
    size: of the world, m
    taken: names already in use
    """
    whole_x, whole_y = ((Measure(0.0), Measure(end)) for end in size)
    with table:
        table.has("count"), table.has("groups")
        kind = checked_name(table, table.text("type", most=32), "type")
        limits, speed_unit = _limits(table, size)
        x = table.span("x", LENGTH, whole_x, low=0.0, high=size[0])
        y = table.span("y", LENGTH, whole_y, low=0.0, high=size[1])
        geometry, bumpers, slides = _body(table)
        omni = is_omni(table)
        ring = _ring(table) if table.has("sonar") else None
        coming = _coming(table, count, groups)
        flight, limits = _flight(table, limits, size)
        highest = limits.ceiling if flight else 0.0
        if table.has("z") and not flight:
            raise table.error("z", STANDS)
        if table.has("z") and rows is not None:
            raise table.error("z", "the starts say how high each of them begins: leave this out, or give poses a z")
        z = table.span("z", LENGTH, (Measure(0.0), Measure(0.0)), low=0.0, high=highest)
        if ring and geometry.sonars:
            raise table.error("sonar", "a robot has either sonars of [robots.body] or those of [robots.sonar]")
        starts = read_starts(table, rows, size, highest)
        if coming.at and isinstance(starts, tuple) and any(pose.name for pose in starts):
            raise table.error("starts", "robots that come later are called by their numbers: leave their names out")
        return RobotSpec(
            type=kind,
            count=count,
            x=(x[0].value, x[1].value),
            y=(y[0].value, y[1].value),
            limits=limits,
            geometry=Geometry(geometry.radius, ring.count, ring.most) if ring else geometry,
            wander=_wander(table, limits),
            wanders=_wanders(table, flies=flight is not None),
            stores=_stores(table, taken),
            speed_unit=speed_unit,
            wheels=_wheels(table) if table.has("wheels") else None,
            ring=ring,
            bumpers=bumpers,
            disc=_disc(table, size),
            in_rows=table.text("numbers", "by chance", choices=("by chance", "along rows")) == "along rows",
            groups=groups,
            slides=slides,
            starts=starts,
            hatch=coming.hatch,
            most=coming.most,
            at=coming.at,
            flight=flight,
            z=(z[0].value, z[1].value),
            omni=omni,
            camera=_camera(table, flies=flight is not None) if table.has("camera") else 0.0,
        )


def _flight(robots: Table, limits: Limits, size: tuple[float, float]) -> tuple[FlightSpec | None, Limits]:
    """How they fly, if they do, and these limits with those of flying."""
    if is_particle(robots):
        return read_particle(robots, limits)
    return read_flight(robots, limits, size) if robots.has("flight") else (None, limits)


def _camera(robots: Table, *, flies: bool) -> float:
    """The opening angle of a camera that looks down."""
    if not flies:
        why = "it looks down from above, and these robots do not fly: leave it out, or give them [robots.flight]"
        raise robots.error("camera", why)
    with robots.table("camera") as table:
        return table.number("angle", low=LEAST_ANGLE, high=WIDEST_ANGLE)


def _wanders(robots: Table, *, flies: bool) -> bool:
    """Whether they roam at the start; what flies stands or hovers."""
    usual, choices = ("still", ("still",)) if flies else ("wander", ("wander", "still"))
    return robots.text("motion", usual, choices=choices) == "wander"


class _Coming(NamedTuple):
    """How robots of a table come and go; see `RobotSpec`."""

    hatch: bool
    most: int
    at: float


def _coming(robots: Table, count: int, groups: tuple[RobotGroup, ...]) -> _Coming:
    """How robots come and go."""
    hatch = robots.flag("hatch", False)
    most = robots.whole("most", low=1, high=MAX_ROBOTS) if robots.has("most") else 0
    at = robots.number("at", TIME, low=LEAST, high=MAX_TIME) if robots.has("at") else 0.0
    key = "hatch" if hatch else "at" if at else "most"
    if key != "most" or most:
        if robots.has("sonar") and robots.table("sonar").has("pause"):
            raise robots.error(key, "robots whose sonars fire one after the other do not come and go: leave pause out")
        if len(groups) > 1:
            raise robots.error(key, "robots of several groups do not come and go: make each group a table [[robots]]")
    changed = robots.document.is_changed(shown_key((*robots.where, "count")))
    if 0 < most < count and not changed:
        raise robots.error("most", f"the table has {count} robots: say at least as many")
    return _Coming(hatch, most, at)


def _disc(robots: Table, size: tuple[float, float]) -> tuple[float, float, float] | None:
    if not robots.has("disc"):
        return None
    for key in ("x", "y"):
        if robots.has(key):
            raise robots.error(key, f"the robots start within a disc, [robots.disc]: leave {key} out, or the disc")
    with robots.table("disc") as table:
        x = table.number("x", LENGTH, low=0.0, high=size[0])
        y = table.number("y", LENGTH, low=0.0, high=size[1])
        room = min(x, size[0] - x, y, size[1] - y)
        return x, y, table.number("radius", LENGTH, low=0.0, high=room)


def _limits(robots: Table, size: tuple[float, float]) -> tuple[Limits, str]:
    with robots.table("limits") as table:
        speed = table.measure("speed", SPEED, low=LEAST, high=10_000.0)
        turn_rate = table.number("turn_rate", RATE, low=LEAST, high=100.0)
        acceleration = table.number("acceleration", ACCELERATION, low=LEAST, high=10_000.0)
        return Limits(speed.value, turn_rate, acceleration, (0.0, 0.0, *size)), speed.unit or "m/s"


def _drive(robots: Table) -> str:
    return robots.table("body").text("drive", "ahead", choices=("ahead", "omni", PARTICLE))


def is_particle(robots: Table) -> bool:
    """Whether robots of this table are points that move in space."""
    return _drive(robots) == PARTICLE


def is_omni(robots: Table) -> bool:
    """Whether robots of this table drive in every direction. Raises SettingsError where they cannot."""
    table, omni = robots.table("body"), _drive(robots) == "omni"
    for key, why in (("wheels", "two wheels only drive ahead"), ("flight", "what flies moves in every direction")):
        if omni and robots.has(key):
            raise table.error("drive", f"{why}: leave this out, or [robots.{key}]")
    return omni


def _body(robots: Table) -> tuple[Geometry, int, bool]:
    with robots.table("body") as table:
        table.has("drive")
        radius = table.number("radius", LENGTH, low=LEAST, high=MAX_WORLD)
        sonars = table.whole("sonars", 0, low=0, high=360)
        reach = table.number("sonar_range", LENGTH, None if sonars else 0.0, low=0.0, high=MAX_WORLD)
        bumpers = table.whole("bumpers", 0, low=0, high=MAX_BUMPERS)
        slides = table.text("contact", "stop", choices=("stop", "slide")) == "slide"
        if slides and not bumpers:
            raise table.error("contact", "bodies without bumpers touch nothing: say bumpers = 1, or leave this out")
        return Geometry(radius, sonars, reach), bumpers, slides


def _wheels(robots: Table) -> Wheels:
    with robots.table("wheels") as table:
        return Wheels(
            track=table.number("track", LENGTH, low=LEAST, high=MAX_WORLD),
            slip_left=table.number("slip_left", default=0.0, low=-0.5, high=0.5),
            slip_right=table.number("slip_right", default=0.0, low=-0.5, high=0.5),
            slip_noise=table.number("slip_noise", LENGTH, 0.0, low=0.0, high=1.0),
            counts=_counts(table),
        )


def _counts(wheels: Table) -> float:
    counts = wheels.number("counts", default=0.0, low=0.0, high=MAX_COUNTS)
    if 0.0 < counts < 1.0:
        raise wheels.error("counts", "wanted at least 1 step a metre, or 0 for exact encoders")
    return counts


def _ring(robots: Table) -> Ring:
    with robots.table("sonar") as table:
        count = table.whole("count", 16, low=1, high=MAX_SONARS)
        least = table.number("least", LENGTH, 6 * INCH, low=0.0, high=MAX_WORLD)
        return Ring(
            count=count,
            beam=table.number("beam", default=25.0 * pi / 180.0, low=LEAST, high=WIDEST_BEAM),
            least=least,
            most=table.number("range", LENGTH, 255 * INCH, low=max(least, LEAST), high=MAX_WORLD),
            noise=table.number("noise", default=0.0, low=0.0, high=1.0),
            dropout=table.number("dropout", default=0.0, low=0.0, high=1.0),
            incidence=table.number("incidence", default=pi / 2, low=LEAST, high=pi / 2),
            pause=table.number("pause", TIME, low=0.0, high=MAX_PAUSE) if table.has("pause") else None,
            order=table.wholes("order", tuple(range(count)), low=0, high=count - 1, most=MAX_ORDER),
            crosstalk=_crosstalk(table) if table.has("crosstalk") else None,
        )


def _crosstalk(sonar: Table) -> CrosstalkModel:
    if not sonar.has("pause"):
        raise sonar.error("crosstalk", "needs sonars that fire one after the other: say their pause, such as 4ms")
    with sonar.table("crosstalk") as table:
        return CrosstalkModel(
            chance=table.number("chance", default=1.0, low=0.0, high=1.0),
            spread=table.number("spread", default=30.0 * pi / 180.0, low=0.0, high=pi),
            robots=table.flag("robots", True),
        )


def _wander(robots: Table, limits: Limits) -> Wander:
    with robots.table("wander") as table:
        return Wander(
            speed=table.number("speed", SPEED, limits.speed, low=0.0, high=limits.speed),
            turn_rate=table.number("turn_rate", RATE, limits.turn_rate / 4, low=0.0, high=limits.turn_rate),
            steadiness=table.number("steadiness", TIME, 30.0, low=LEAST, high=MAX_TIME),
        )


def _stores(robots: Table, others: Iterable[str]) -> tuple[Supply, ...]:
    taken = {name.casefold() for name in others}
    stores = []
    for name, table in robots.tables("stores", most=MAX_STORES).items():
        around = robots.table("stores")
        folded = checked_name(around, name).casefold()
        if folded in taken:
            raise around.error(name, "every robot has a variable of this name already; choose another")
        taken.add(folded)
        with table:
            stores.append(_store(table, name))
    return tuple(stores)


def _store(table: Table, name: str) -> Supply:
    low, high = table.span("start", None, low=0.0)
    least = max(high.value, LEAST)
    store = Supply(
        name=name,
        unit=high.unit,
        low=low.value,
        high=high.value,
        full=least,
        share=table.number("share", default=1.0, low=0.0, high=1.0),
        reach=table.number("reach", LENGTH, inf, low=LEAST),
        lasts=table.number("lasts", TIME, inf, low=LEAST),
        about=table.text("about", ""),
    )
    return replace(store, full=table.number("full", store.dimension, least, low=least))
