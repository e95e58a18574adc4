"""Scenarios: what a world is like at the start, as data in a TOML file.

`load` reads a scenario's folder (or its scenario.toml) into plain frozen dataclasses in SI; nothing is
simulated here. Whatever is wrong in the file is told with its line and key. The keys are explained in
docs/scenarios.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi
from pathlib import Path

from sleepcast.channel.memory import RadioModel
from sleepcast.robot import BodyConstant, Geometry, Limits
from sleepcast.simulator.groups import Group, read_constants, read_groups, refuse_clashes
from sleepcast.simulator.measures import MeasureSpec, read_measures
from sleepcast.simulator.mission import Order, read_mission
from sleepcast.simulator.settings import Document, Measure, Table, checked_name
from sleepcast.simulator.signals import LIGHT_NAMES, PING_NAMES, Light, PingModel, read_lights, read_pings
from sleepcast.units import ACCELERATION, LENGTH, RATE, SPEED, TIME

FORMAT = 1
"""The version of the format; a file of a newer one is refused."""
FILE = "scenario.toml"
MAX_ROBOTS = 10_000
"""Robots whose minds are objects of their own; at more, a tick takes longer than a tick lasts."""
MAX_WORLD = 10_000_000.0
"""Metres, a quarter of the way round the earth: beyond, a flat world means nothing."""
MAX_TIME = 10_000_000.0
"""Seconds of one run: four months."""
MAX_PLACES = 32
MAX_STORES = 16
"""Each place and store is one or two variables on every robot."""
MAX_COMMANDS = 32
"""Ready-made commands that a page can offer without scrolling for ever."""
MAX_SEED = 2**63 - 1
LEAST = 1e-6
"""What must be more than nothing is at least this, in SI."""

BODY_NAMES = ("x", "y", "heading", "speed", "drive_speed", "drive_turn")
SIGNAL_NAMES = (*LIGHT_NAMES, *PING_NAMES, "FRONT", "REAR")
"""Names that every simulated body knows, or may know."""


@dataclass(frozen=True, slots=True)
class Place:
    """A point in the world that every robot knows, as the variables `<name>_x` and `<name>_y` (m)."""

    name: str
    title: str
    x: float
    y: float
    about: str = ""


@dataclass(frozen=True, slots=True)
class Store:
    """Something that robots carry: a variable `name` in SI, shown in `unit`.

    low, high: at the start, drawn evenly for the `share` of the robots that carry any. full: what a robot
    carries at most. reach: m that a full store drives a body; inf where driving uses none of it.
    """

    name: str
    unit: str
    low: float
    high: float
    full: float
    share: float = 1.0
    reach: float = inf
    about: str = ""


@dataclass(frozen=True, slots=True)
class Wander:
    """How bodies roam by themselves: at `speed` (m/s), their turn rate wandering slowly round 0 with the
    standard deviation `turn_rate` (rad/s), each turn lasting about `steadiness` s."""

    speed: float
    turn_rate: float
    steadiness: float


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """The robots: how many of which type, where they start (evenly in x and y, m), and how they are made.

    wanders: whether they roam from the start; otherwise they lie still until they are told to move.
    speed_unit: in which people read their speed. disc: x, y and radius (m) of the disc in which they start
    instead, if there is one. groups: the sorts of robots, none if all are alike.
    """

    type: str
    count: int
    x: tuple[float, float]
    y: tuple[float, float]
    limits: Limits
    geometry: Geometry
    wander: Wander
    wanders: bool
    stores: tuple[Store, ...]
    speed_unit: str
    disc: tuple[float, float, float] | None = None
    groups: tuple[Group, ...] = ()


@dataclass(frozen=True, slots=True)
class ReadyCommand:
    """A command that the scenario offers, with the words that a person would say."""

    title: str
    text: str
    about: str = ""


@dataclass(frozen=True, slots=True)
class Scenario:
    """A world at its start. Lengths in m, times in s of simulated time.

    speed_up: simulated seconds in a second of a person's time. seconds: how long a headless run lasts by
    default. telemetry: time between two samples of each robot. noise: standard deviation of each sensor that
    has any, by its name. length_unit: in which people read lengths. constants: numbers that rules know by name.
    pings: how they are heard, None where nobody hears any. measures: what is to be measured of a run.
    """

    name: str
    path: Path
    title: str
    about: str
    seed: int
    tick: float
    speed_up: float
    seconds: float
    width: float
    height: float
    length_unit: str
    robots: RobotSpec
    places: tuple[Place, ...]
    noise: dict[str, float]
    radio: RadioModel
    telemetry: float
    commands: tuple[ReadyCommand, ...]
    mission: tuple[Order, ...]
    constants: tuple[BodyConstant, ...] = ()
    lights: tuple[Light, ...] = ()
    pings: PingModel | None = None
    measures: tuple[MeasureSpec, ...] = ()


def load(path: Path) -> Scenario:
    """The scenario in the folder or file `path`. Raises SettingsError, and MissionError for its mission
    script."""
    file = path / FILE if path.is_dir() else path
    document = Document(file)
    with document.root() as root:
        _check_format(root)
        with root.table("world") as world:
            width = world.measure("width", LENGTH, low=LEAST, high=MAX_WORLD)
            height = world.measure("height", LENGTH, low=LEAST, high=MAX_WORLD)
        size = (width.value, height.value)
        places = _places(root, size)
        constants, lights = read_constants(root), read_lights(root, size, [place.name for place in places])
        robots = _robots(root, size, places, constants)
        refuse_clashes(root, _known_names(places, robots.stores), constants, robots.groups)
        radio, telemetry = _radio(root, size)
        return Scenario(
            name=file.resolve().parent.name,
            path=file,
            title=root.text("title"),
            about=root.text("about", "", most=2_000),
            seed=root.whole("seed", 0, low=0, high=MAX_SEED),
            tick=root.number("tick", TIME, 0.1, low=0.001, high=60.0),
            speed_up=root.number("speed_up", default=1.0, low=0.001, high=1e6),
            seconds=root.number("seconds", TIME, low=LEAST, high=MAX_TIME),
            width=width.value,
            height=height.value,
            length_unit=width.unit or "m",
            robots=robots,
            places=places,
            noise=_noise(root, robots),
            radio=radio,
            telemetry=telemetry,
            commands=_commands(root),
            mission=_mission(root, file.parent),
            constants=constants,
            lights=lights,
            pings=read_pings(root),
            measures=read_measures(root, _points(places, lights), MAX_TIME),
        )


def _check_format(root: Table) -> None:
    version = root.whole("format", low=1, high=MAX_SEED)
    if version > FORMAT:
        raise root.error(
            "format", f"format {version} is newer than this sleepcast, which reads format {FORMAT}: update sleepcast"
        )


def _places(root: Table, size: tuple[float, float]) -> tuple[Place, ...]:
    found = []
    for name, table in root.tables("places", most=MAX_PLACES).items():
        with table:
            checked_name(root.table("places"), name)
            x = table.number("x", LENGTH, low=0.0, high=size[0])
            y = table.number("y", LENGTH, low=0.0, high=size[1])
            title = table.text("title", name, most=60)
            found.append(Place(name, title, x, y, table.text("about", "")))
    return tuple(found)


def _robots(
    root: Table, size: tuple[float, float], places: tuple[Place, ...], constants: tuple[BodyConstant, ...]
) -> RobotSpec:
    whole_x, whole_y = ((Measure(0.0), Measure(end)) for end in size)
    with root.table("robots") as table:
        kind = checked_name(table, table.text("type", most=32))
        limits, speed_unit = _limits(table, size)
        x = table.span("x", LENGTH, whole_x, low=0.0, high=size[0])
        y = table.span("y", LENGTH, whole_y, low=0.0, high=size[1])
        groups = read_groups(table, constants, MAX_ROBOTS)
        return RobotSpec(
            type=kind,
            count=_count(table, groups),
            x=(x[0].value, x[1].value),
            y=(y[0].value, y[1].value),
            limits=limits,
            geometry=_geometry(table),
            wander=_wander(table, limits),
            wanders=table.text("motion", "wander", choices=("wander", "still")) == "wander",
            stores=_stores(table, places),
            speed_unit=speed_unit,
            disc=_disc(table, size),
            groups=groups,
        )


def _count(robots: Table, groups: tuple[Group, ...]) -> int:
    """How many robots there are; if they are in groups, that follows from them."""
    if not groups:
        return robots.whole("count", low=1, high=MAX_ROBOTS)
    total = sum(group.count for group in groups)
    if total > MAX_ROBOTS:
        raise robots.error("groups", f"{total} robots in all; at most {MAX_ROBOTS} fit")
    if robots.whole("count", total, low=1, high=MAX_ROBOTS) != total:
        raise robots.error("count", f"the groups add up to {total}: leave this out, or say the same")
    return total


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


def _points(places: tuple[Place, ...], lights: tuple[Light, ...]) -> dict[str, tuple[float, float]]:
    """Every point with a name."""
    return {place.name: (place.x, place.y) for place in places} | {light.name: (light.x, light.y) for light in lights}


def _known_names(places: tuple[Place, ...], stores: tuple[Store, ...]) -> list[str]:
    """What robots know by name besides constants and the values of groups."""
    points = [f"{place.name}_{axis}" for place in places for axis in "xy"]
    return [*BODY_NAMES, *SIGNAL_NAMES, *points, *(store.name for store in stores)]


def _limits(robots: Table, size: tuple[float, float]) -> tuple[Limits, str]:
    with robots.table("limits") as table:
        speed = table.measure("speed", SPEED, low=LEAST, high=10_000.0)
        turn_rate = table.number("turn_rate", RATE, low=LEAST, high=100.0)
        acceleration = table.number("acceleration", ACCELERATION, low=LEAST, high=10_000.0)
        return Limits(speed.value, turn_rate, acceleration, (0.0, 0.0, *size)), speed.unit or "m/s"


def _geometry(robots: Table) -> Geometry:
    with robots.table("body") as table:
        radius = table.number("radius", LENGTH, low=LEAST, high=MAX_WORLD)
        sonars = table.whole("sonars", 0, low=0, high=360)
        reach = table.number("sonar_range", LENGTH, None if sonars else 0.0, low=0.0, high=MAX_WORLD)
        return Geometry(radius, sonars, reach)


def _wander(robots: Table, limits: Limits) -> Wander:
    with robots.table("wander") as table:
        return Wander(
            speed=table.number("speed", SPEED, limits.speed, low=0.0, high=limits.speed),
            turn_rate=table.number("turn_rate", RATE, limits.turn_rate / 4, low=0.0, high=limits.turn_rate),
            steadiness=table.number("steadiness", TIME, 30.0, low=LEAST, high=MAX_TIME),
        )


def _stores(robots: Table, places: tuple[Place, ...]) -> tuple[Store, ...]:
    taken = {
        *(name.casefold() for name in (*BODY_NAMES, *SIGNAL_NAMES)),
        *(f"{place.name}_{axis}".casefold() for place in places for axis in "xy"),
    }
    found = []
    for name, table in robots.tables("stores", most=MAX_STORES).items():
        around = robots.table("stores")
        if checked_name(around, name).casefold() in taken:
            raise around.error(name, "every robot has a variable of this name already; choose another")
        taken.add(name.casefold())
        with table:
            found.append(_store(table, name))
    return tuple(found)


def _store(table: Table, name: str) -> Store:
    low, high = table.span("start", None, low=0.0)
    return Store(
        name=name,
        unit=high.unit,
        low=low.value,
        high=high.value,
        full=table.measure("full", None, Measure(max(high.value, LEAST)), low=max(high.value, LEAST)).value,
        share=table.number("share", default=1.0, low=0.0, high=1.0),
        reach=table.number("reach", LENGTH, inf, low=LEAST),
        about=table.text("about", ""),
    )


def _radio(root: Table, size: tuple[float, float]) -> tuple[RadioModel, float]:
    """The radio, and the time between two samples."""
    usual = RadioModel()
    with root.table("radio") as table:
        seated = table.has("operator")
        radio = RadioModel(
            reach=table.number("reach", LENGTH, usual.reach, low=0.0),
            operator=table.point("operator", (0.0, 0.0), size) if seated else None,
            operator_reach=table.number("operator_reach", LENGTH, None if seated else inf, low=0.0),
            loss=table.number("loss", default=usual.loss, low=0.0, high=1.0),
            delay=table.number("delay", TIME, usual.delay, low=0.0, high=MAX_TIME),
            jitter=table.number("jitter", TIME, usual.jitter, low=0.0, high=MAX_TIME),
            duplication=table.number("duplication", default=usual.duplication, low=0.0, high=1.0),
            reordering=table.number("reordering", default=usual.reordering, low=0.0, high=1.0),
            held_back=table.number("held_back", TIME, usual.held_back, low=0.0, high=MAX_TIME),
        )
        return radio, table.number("telemetry", TIME, 1.0, low=LEAST, high=MAX_TIME)


def _noise(root: Table, robots: RobotSpec) -> dict[str, float]:
    with root.table("noise") as table:
        found = {
            "x": table.number("x", LENGTH, 0.0, low=0.0),
            "y": table.number("y", LENGTH, 0.0, low=0.0),
            "heading": table.number("heading", default=0.0, low=0.0, high=2 * pi),
            "speed": table.number("speed", SPEED, 0.0, low=0.0),
        }
        for store in robots.stores:
            found[store.name] = table.measure(store.name, None, Measure(0.0), low=0.0).value
    return {name: deviation for name, deviation in found.items() if deviation}


def _commands(root: Table) -> tuple[ReadyCommand, ...]:
    found = []
    for table in root.array("commands", most=MAX_COMMANDS):
        with table:
            text = table.text("text", most=16_384)
            found.append(ReadyCommand(table.text("title", most=80), text, table.text("about", "")))
    return tuple(found)


def _mission(root: Table, folder: Path) -> tuple[Order, ...]:
    if not root.has("mission"):
        return ()
    file = folder / root.text("mission", most=200)
    if not file.is_file():
        raise root.error("mission", f"there is no file {file}")
    return read_mission(file)
