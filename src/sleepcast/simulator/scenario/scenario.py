"""Scenarios: a world at its start, as data in a TOML file.

`load` reads a scenario's folder (or its scenario.toml) into plain frozen dataclasses in SI; it simulates nothing.
Errors are reported with their line and key. docs/scenarios.md explains the keys.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, inf, log, pi
from pathlib import Path

import numpy as np

from sleepcast.channel.simulated_radio import RadioModel
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.extensions import extensions
from sleepcast.core.given_numbers import MAX_SEED
from sleepcast.core.model import NamedArea, ReadyCommand
from sleepcast.core.records import dataclass
from sleepcast.core.settings import SettingsError, Table, checked_name, toml_document
from sleepcast.core.ticks import nearest_ticks
from sleepcast.core.units import LENGTH, SPEED, TIME
from sleepcast.robot import BodyConstant
from sleepcast.simulator.scenario.areas import read_areas
from sleepcast.simulator.scenario.events import Event, LinkCut, read_events
from sleepcast.simulator.scenario.fields import Field, field_sensors, read_fields
from sleepcast.simulator.scenario.flight import NAMES as FLIGHT_NAMES
from sleepcast.simulator.scenario.flight import PARTICLE_NAMES, refuse_mixture, seen_above
from sleepcast.simulator.scenario.groups import filled, read_constants, read_groups, refuse_clashes
from sleepcast.simulator.scenario.measures import MeasureSpec, read_measures
from sleepcast.simulator.scenario.mission import Order, read_mission
from sleepcast.simulator.scenario.operators import (
    NO_AUTHORITY,
    MindSettings,
    ScenarioOperator,
    read_minds,
    read_operators,
    refuse_robots,
)
from sleepcast.simulator.scenario.origin import written_origin
from sleepcast.simulator.scenario.predation import PredationModel, read_predation
from sleepcast.simulator.scenario.robot_settings import (
    BODY_NAMES,
    LEAST,
    MAX_ROBOTS,
    MAX_TIME,
    OMNI_NAMES,
    SIGNAL_NAMES,
    RobotSpec,
    is_omni,
    is_particle,
    read_count,
    read_robots,
)
from sleepcast.simulator.scenario.robot_types import combined, given_names, names_of, robot_tables, slices
from sleepcast.simulator.scenario.scanners import (
    CameraModel,
    LaserModel,
    read_camera,
    read_laser,
    refuse_blind,
    refuse_many,
)
from sleepcast.simulator.scenario.signals import (
    SIGHT_SINCE,
    THROUGH_ALL,
    Light,
    NeighbourModel,
    PingModel,
    SightModel,
    read_lights,
    read_neighbours,
    read_pings,
    read_sight,
    refuse_delay,
    refuse_sight,
)
from sleepcast.simulator.scenario.sliders import Slider, blanks_of, read_sliders
from sleepcast.simulator.scenario.starts import refuse_equal_names, refuse_misfits, rows_of_starts
from sleepcast.simulator.scenario.stocks import Stock, read_stocks
from sleepcast.simulator.scenario.wind import WindSpec, read_wind
from sleepcast.simulator.scenario.world_settings import Changes, read_world, refuse_overridden
from sleepcast.simulator.world.grey_picture import Picture, Stretched
from sleepcast.simulator.world.map_picture import MapPicture
from sleepcast.simulator.world.roofs import GROUND
from sleepcast.simulator.world.torus import PLAIN, Around
from sleepcast.simulator.world.world import Shape

FORMAT = 2
"""Version of the format; files of a newer one are refused."""
FILE = "scenario.toml"
MISSED = 0.002
"""The share of robots that may have missed what everybody must hear."""
MAX_REPEATS = 8
"""Times that such a command is said at once."""
MAX_QUEUED = 10_000
"""Messages queued for one transmitter: at one per second, three hours."""
MAX_PLACES = 32
"""Places of one world: each is two variables on every robot."""
PICTURES_PER_SECOND = 10.0
"""Pictures that are kept of a second of a person's time, when a scenario runs at its own speed: motion is seen as
such."""
MAX_COMMANDS = 32
"""Ready-made commands: as many as a page can offer without endless scrolling."""


@dataclass(frozen=True, slots=True)
class Place:
    """A point in the world that every robot knows, as the variables `<name>_x` and `<name>_y` (m)."""

    name: str
    title: str
    x: float
    y: float
    about: str = ""


@dataclass(frozen=True, slots=True)
class Scenario:
    """A world at its start. Lengths in m, times in s of simulated time.

    speed_up: simulated seconds per second of real time
    seconds: default length of a headless run
    telemetry: period of each robot's telemetry
    noise: standard deviation of each noisy sensor, by name
    length_unit: unit in which lengths are shown
    shapes: solid things in the world at the start
    absent: things that may be added later
    events: timed changes
    cuts: of links between minds and bodies, timed
    fenced: whether robots turn back at the world's edge on their own
    torus: whether it has no edge
    constants: named numbers for rules
    pings: how they are received, None if robots have none
    neighbours: how robots sense each other, None if they do not
    areas: what robots know by name from the start
    stocks: what robots take from and add to
    fields: values that fill the world
    measures: time series to record
    robots: all robots together
    sorts: each type of them with its count or proportion, empty if there is only one type
    nomad: whether VM takes tenths of inches, as a Nomad's programs do
    sliders: numbers that people are invited to change
    picture: of the map that the world was made of; in a recording or snapshot only the name of its file is left
    operators: who may command, none where whoever sends may do anything
    minds: what robots go by then
    sight: what walls and bodies hide
    laser, camera: of every robot, None without
    predation: how robots eat others, None if they do not
    wind: how the air moves that pushes what flies, None if it stands still
    ground: the ground map, whose values are m above the origin; None where the ground is flat
    format: of its file
    origin: where it was found and what was changed in it, see `origin`; "" for one that was not found
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
    shapes: tuple[Shape, ...]
    fenced: bool
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
    neighbours: NeighbourModel | None = None
    fields: tuple[Field, ...] = ()
    torus: bool = False
    measures: tuple[MeasureSpec, ...] = ()
    absent: tuple[Shape, ...] = ()
    events: tuple[Event, ...] = ()
    cuts: tuple[LinkCut, ...] = ()
    sorts: tuple[RobotSpec, ...] = ()
    nomad: bool = False
    areas: tuple[NamedArea, ...] = ()
    stocks: tuple[Stock, ...] = ()
    sliders: tuple[Slider, ...] = ()
    picture: MapPicture | None = None
    origin: str = ""
    operators: tuple[ScenarioOperator, ...] = ()
    minds: MindSettings = NO_AUTHORITY
    sight: SightModel = THROUGH_ALL
    format: int = 1
    laser: LaserModel | None = None
    camera: CameraModel | None = None
    predation: PredationModel | None = None
    wind: WindSpec | None = None
    ground: Picture | None = None

    @property
    def each_type(self) -> tuple[RobotSpec, ...]:
        """The types of robots, also if there is only one."""
        return self.sorts or (self.robots,)

    @property
    def named_points(self) -> tuple[Place | Stock, ...]:
        """What the map shows by its title: places and stocks."""
        return (*self.places, *self.stocks)

    @property
    def sees_through_walls(self) -> str:
        """A sentence for people if walls hide nothing here only because the file is of an older format; else ""."""
        senses = (("lights", self.lights), ("pings", self.pings), ("neighbours", self.neighbours))
        seen = " and ".join(name for name, given in senses if given)
        if self.format >= SIGHT_SINCE or not seen or not (self.shapes or self.absent):
            return ""
        return (
            f"{self.path} is of format {self.format}: robots sense {seen} through walls. With format = {SIGHT_SINCE} "
            "walls hide them"
        )

    @property
    def repeats(self) -> int:
        """How often a command that everybody must hear is said at once: the radio sends each once, and may lose it."""
        loss = self.radio.loss
        return 1 if loss <= MISSED else min(MAX_REPEATS, ceil(log(MISSED) / log(min(loss, 0.99))))

    def ticks_of_picture(self, least: int) -> int:
        """Ticks from one kept picture to the next, at least so many."""
        return max(least, nearest_ticks(self.speed_up / PICTURES_PER_SECOND, self.tick))

    @property
    def terrain(self) -> Stretched | None:
        """The ground map over the world, made anew with each call; None where the ground is flat."""
        if self.ground is None:
            return None
        return Stretched(self.ground, (self.width, self.height), wraps=self.torus)

    def ground_at(self, x: float, y: float) -> float:
        """How high the ground is at a place, m."""
        terrain = self.terrain
        return GROUND if terrain is None else float(terrain.at(np.array([x]), np.array([y]))[0][0])

    @property
    def around(self) -> Around:
        """Width and height of a torus; see `torus`."""
        return (self.width, self.height) if self.torus else PLAIN


def load(path: Path, changes: Changes = Changes()) -> Scenario:  # noqa: B008  # frozen: nobody can change it
    """The scenario in the folder or file `path`, with the changes of this run. Raises SettingsError, and MissionError
    for its mission script."""
    return _read(*_file_of(path), changes)[0]


def read_scenario(text: str, changes: Changes = Changes()) -> Scenario:  # noqa: B008  # frozen: nobody can change it
    """The scenario in a TOML text; relative paths start at the working folder. Raises what `load` raises."""
    return _read(Path(FILE), "scenario", changes, text)[0]


def _file_of(path: Path) -> tuple[Path, str]:
    """The scenario's file in a folder, or the one at this path, and its name."""
    file = path / FILE if path.is_dir() else path
    return file, file.resolve().parent.name


def _read(file: Path, name: str, changes: Changes, text: str | None = None) -> tuple[Scenario, bool]:
    """The scenario in a file, and whether it is another one with another seed, apart from that. text: what is in the
    file; None to read it."""
    refuse_overridden(changes)
    document = toml_document(file, text)
    for key, value in changes.over:
        document.change(key, value)
    with document.root() as root:
        version = _checked_format(root)
        root.has("nomad")  # read by `sites`
        constants = read_constants(root)
        sliders = read_sliders(root, document, constants)
        numbers = (*constants, *blanks_of(sliders))
        tables = robot_tables(root)
        groups = [read_groups(table, constants, MAX_ROBOTS) for table in tables]
        rows = [rows_of_starts(table) for table in tables]

        def counts() -> list[int]:
            if changes.robots and len(tables) == 1:
                return [changes.robots]
            return [read_count(*each) for each in zip(tables, groups, rows, strict=True)]

        def count() -> int:
            return changes.robots or sum(counts())

        seed = root.whole("seed", 0, low=0, high=MAX_SEED)
        seed = seed if changes.seed is None else changes.seed
        world = read_world(root, count, changes, seed)
        size = (world.width, world.height)
        places = _places(root, size)
        lights = read_lights(root, size, [place.name for place in places])
        tick = root.number("tick", TIME, 0.1, low=0.001, high=60.0)
        taken = [*BODY_NAMES, *SIGNAL_NAMES, *(f"{place.name}_{axis}" for place in places for axis in "xy")]
        taken += FLIGHT_NAMES if any(table.has("flight") for table in tables) else ()
        taken += PARTICLE_NAMES if any(is_particle(table) for table in tables) else ()
        taken += OMNI_NAMES if any(is_omni(table) for table in tables) else ()
        local_fields = read_fields(root, size, tick, taken, version)
        taken += [sensor.name for sensor in field_sensors(local_fields)]
        specs = tuple(read_robots(*each, size, taken) for each in zip(tables, counts(), groups, rows, strict=True))
        refuse_mixture(tables, [spec.flight for spec in specs])
        robots = replace(combined(tables, specs), count=count())
        if robots.count > MAX_ROBOTS:
            raise root.error("robots", f"{robots.count} robots in all; at most {MAX_ROBOTS} fit")
        for table, spec, part in zip(tables, specs, slices(specs, robots.count), strict=True):
            refuse_misfits(table, spec.starts, part.stop - part.start, size)
        operators = read_operators(root)
        refuse_robots(root, operators, names_of(specs, robots.count))
        refuse_equal_names(given_names(specs, robots.count), (row for some in rows for row in some or ()))
        areas = read_areas(root, size)
        taken += [store.name for store in robots.stores]
        stocks = read_stocks(root, size, robots.stores, taken)
        taken += [name for stock in stocks for name in stock.names]
        refuse_clashes(root, tables, taken, constants, groups)
        radio, telemetry = _radio(root, size, version)
        points = {each.name: (each.x, each.y) for each in places} | {each.name: (each.x, each.y) for each in lights}
        names = () if any(spec.comes_and_goes for spec in specs) else names_of(specs, robots.count)
        events, cuts = read_events(root, world.shapes, world.absent, size, MAX_TIME, names, solid=changes.walls)
        scenario = Scenario(
            name=name,
            path=file,
            title=root.text("title"),
            about=root.text("about", "", most=2_000),
            seed=seed,
            tick=tick,
            speed_up=root.number("speed_up", default=1.0, low=0.001, high=1e6),
            seconds=root.number("seconds", TIME, low=LEAST, high=MAX_TIME),
            width=world.width,
            height=world.height,
            length_unit=world.unit,
            shapes=world.shapes,
            fenced=world.fenced,
            robots=robots,
            absent=world.absent,
            events=events,
            cuts=cuts,
            sorts=specs if len(specs) > 1 else (),
            places=places,
            noise=_noise(root, robots, local_fields),
            radio=radio,
            telemetry=telemetry,
            commands=_commands(root, numbers),
            mission=read_mission(root.file("mission"), numbers) if root.has("mission") else (),
            constants=constants,
            lights=lights,
            pings=read_pings(root),
            neighbours=read_neighbours(root, seen_above(robots.flight)),
            fields=local_fields,
            torus=world.torus,
            picture=world.picture,
            measures=read_measures(root, points, MAX_TIME),
            areas=areas,
            nomad=root.text("vocabulary", "standard", choices=("standard", "nomad")) == "nomad",
            stocks=stocks,
            sliders=sliders,
            operators=operators,
            minds=read_minds(root, operators),
            sight=read_sight(root, version),
            format=version,
            laser=read_laser(root, version),
            camera=read_camera(root, version),
            predation=read_predation(root, gone=any(spec.hatch for spec in specs)),
            wind=read_wind(root, size, flies=robots.flight is not None and not robots.flight.particle),
            ground=world.ground,
        )
        if scenario.ground is not None:
            _check_ground(root, scenario)
        refuse_many(root, scenario.laser, robots.count)
        refuse_delay(root, scenario.neighbours, robots.count, scenario.tick)
        refuse_blind(root, tables, version)
        if scenario.torus:
            _check_torus(root, scenario)
        return scenario, world.drawn


def _check_ground(root: Table, scenario: Scenario) -> None:
    """Raise SettingsError where a ground map would mean nothing, or not enough."""
    flights = [spec.flight for spec in scenario.each_type if spec.flight]
    if not flights or any(flight.particle for flight in flights):
        why = "only copters and planes know how high the ground is: give robots a table flight, or leave this out"
        raise root.table("world").error("ground", why)


def _check_torus(root: Table, scenario: Scenario) -> None:
    """Raise SettingsError for what a world without edges cannot have."""
    least, tick = min(scenario.width, scenario.height), scenario.tick
    bodies = [4.0 * (spec.geometry.radius + 2.0 * spec.limits.speed * tick) for spec in scenario.each_type]
    sonars = [2.0 * spec.geometry.radius + spec.ring.most for spec in scenario.each_type if spec.ring]
    signals = [
        each.reach for each in (scenario.pings, scenario.neighbours, scenario.camera, scenario.predation) if each
    ]
    signals += [spec.footprint for spec in scenario.each_type]
    beams = [scenario.laser.reach + max(spec.geometry.radius for spec in scenario.each_type)] if scenario.laser else []
    for far, what in (
        (bodies, "their bodies move"),
        (sonars, "their sonars see"),
        (signals, "they sense others"),
        (beams, "their scanners see"),
    ):
        if 2.0 * max(far, default=0.0) >= least:
            raise root.table("world").error(
                "edge",
                f"a torus of {least:g} m is too small: {what} up to {max(far):g} m far, and it must be larger than "
                "twice that",
            )
    if any(spec.ring and spec.ring.pause is not None for spec in scenario.each_type):
        raise root.table("world").error("edge", "sonars with a pause do not look around a torus: leave the pause out")
    if scenario.measures:
        raise root.error("measures", "robots on a torus have no centre, from which these are measured: leave them out")


def _checked_format(root: Table) -> int:
    version = root.whole("format", low=1, high=MAX_SEED)
    if version > FORMAT:
        raise root.error(
            "format", f"format {version} is newer than this sleepcast, which reads format {FORMAT}: update sleepcast"
        )
    return version


def _places(root: Table, size: tuple[float, float]) -> tuple[Place, ...]:
    places, taken = [], dict[str, str]()
    for name, table in root.tables("places", most=MAX_PLACES).items():
        with table:
            around = root.table("places")
            folded = checked_name(around, name).casefold()
            if folded in taken:
                raise around.error(name, f"a place is called {taken[folded]} already; choose another name")
            taken[folded] = name
            x = table.number("x", LENGTH, low=0.0, high=size[0])
            y = table.number("y", LENGTH, low=0.0, high=size[1])
            title = table.text("title", name, most=60)
            places.append(Place(name, title, x, y, table.text("about", "")))
    return tuple(places)


def _radio(root: Table, size: tuple[float, float], version: int) -> tuple[RadioModel, float]:
    """The radio, and the telemetry period. version: of the scenario's format."""
    usual = RadioModel()
    with root.table("radio") as table:
        seated = table.has("operator")
        refuse_sight(table, "wall", version)
        wall = table.number("wall", default=usual.wall, low=0.0, high=1.0)
        if 0.0 < wall < 1.0 and not table.has("reach") and not seated:
            raise table.error("wall", "shortens a limited reach only: give a reach, or write 0 for walls that block")
        radio = RadioModel(
            wall=wall,
            reach=table.number("reach", LENGTH, usual.reach, low=0.0),
            operator=table.point("operator", (0.0, 0.0), size) if seated else None,
            operator_reach=table.number("operator_reach", LENGTH, None if seated else inf, low=0.0),
            loss=table.number("loss", default=usual.loss, low=0.0, high=1.0),
            delay=table.number("delay", TIME, usual.delay, low=0.0, high=MAX_TIME),
            jitter=table.number("jitter", TIME, usual.jitter, low=0.0, high=MAX_TIME),
            duplication=table.number("duplication", default=usual.duplication, low=0.0, high=1.0),
            reordering=table.number("reordering", default=usual.reordering, low=0.0, high=1.0),
            held_back=table.number("held_back", TIME, usual.held_back, low=0.0, high=MAX_TIME),
            rate=table.number("rate", default=usual.rate, low=1e-3),
            queue=table.whole("queue", usual.queue, low=0, high=MAX_QUEUED),
        )
        return radio, table.number("telemetry", TIME, 1.0, low=LEAST, high=MAX_TIME)


def _noise(root: Table, robots: RobotSpec, local_fields: tuple[Field, ...]) -> dict[str, float]:
    with root.table("noise") as table:
        deviations = {
            "x": table.number("x", LENGTH, 0.0, low=0.0),
            "y": table.number("y", LENGTH, 0.0, low=0.0),
            "heading": table.number("heading", default=0.0, low=0.0, high=2 * pi),
            "speed": table.number("speed", SPEED, 0.0, low=0.0),
        }
        for store in robots.stores:
            deviations[store.name] = table.number(store.name, store.dimension, 0.0, low=0.0)
        for sensor in field_sensors(local_fields):
            deviations[sensor.name] = table.number(sensor.name, sensor.dimension, 0.0, low=0.0)
    return {name: deviation for name, deviation in deviations.items() if deviation}


def _commands(root: Table, numbers: Sequence[BodyConstant]) -> tuple[ReadyCommand, ...]:
    """numbers: those that commands may name in braces."""
    commands: list[ReadyCommand] = []
    for table in root.array("commands", most=MAX_COMMANDS):
        with table:
            blank = table.text("text", most=16_384)
            with table.answering("text"):
                text = filled(blank, numbers, "text")
            blank = "" if blank == text else blank
            needs = table.whole("needs", 0, low=0, high=len(commands))
            title, about = table.text("title", most=80), table.text("about", "")
            commands.append(ReadyCommand(title, text, about, blank, needs, table.flag("together", False)))
    return tuple(commands)


# Finding scenarios: those included with sleepcast and those of installed packages by name, others by path.

GALLERY = Path(__file__).resolve().parents[2] / "scenarios"
"""The folder of the included scenarios, one folder each."""
ADDED = "sleepcast.scenarios"
"""The entry point group for packages that add scenarios: a scenario's name, and the package in whose folder it is."""


def scenario_names() -> list[str]:
    """The names of the included scenarios, sorted."""
    return sorted(file.parent.name for file in GALLERY.glob(f"*/{FILE}"))


def added_scenarios() -> dict[str, str]:
    """The scenarios that installed packages add, sorted by name, each with its package."""
    return {name: entry.value for name, entry in extensions(ADDED).items()}


def find_scenario(name: str, changes: Changes = Changes()) -> Scenario:  # noqa: B008  # frozen: nobody can change it
    """The included scenario called `name`, or the one in the folder or file at that path, or the one that an installed
    package adds under this name, with `changes`.

    Raises MisuseError if there is none, and what `load` raises for errors in it.
    """
    return replace(load(_place(name), changes), origin=written_origin(name, changes))


class ScenarioOfSeeds:
    """The scenario that `find_scenario` gives with these changes, for one seed after the other. Its file is read once,
    and again for each seed only where its walls are drawn by chance. Raises what `find_scenario` raises.

    name: or TOML text, of more than a line; then what `read_scenario` gives and raises
    changes: without a seed
    """

    def __init__(self, name: str, changes: Changes = Changes()) -> None:  # noqa: B008  # frozen: nobody can change it
        self._name, self._changes = name, changes
        self._text = name if "\n" in name else None
        self._read: tuple[Scenario, bool] | None = None

    def __getitem__(self, seed: int) -> Scenario:
        changes = replace(self._changes, seed=seed)
        if self._read is None or self._read[1]:
            named = (Path(FILE), "scenario") if self._text is not None else _file_of(_place(self._name))
            self._read = _read(*named, changes, self._text)
        scenario = replace(self._read[0], seed=seed)
        return replace(scenario, origin=written_origin(self._name, changes)) if self._text is None else scenario


def is_scenario_file(file: Path) -> bool:
    """Whether a TOML file is a scenario, whatever its name: it has robots, and names no scenario as plans do."""
    if file.name == FILE:
        return True
    try:
        values = toml_document(file).values
    except SettingsError:
        return False  # whoever needs the file says it
    return "robots" in values and "scenario" not in values


def _place(name: str) -> Path:
    """The folder or file of a scenario. Raises MisuseError if there is none."""
    names = scenario_names()
    if name in names:
        return GALLERY / name
    path = Path(name)
    if path.exists():
        return path
    added = extensions(ADDED)
    if name in added:
        added[name].refuse_rivals("scenario")
        return _package_folder(name, added[name].value)
    names += added
    raise MisuseError(
        f'no scenario "{name}"{did_you_mean(name, names)}: wanted one of {", ".join(names)}, '
        f"or the path of a folder with a {FILE}"
    )


def _package_folder(name: str, package: str) -> Path:
    """The folder of a scenario's package. Raises MisuseError if it does not exist."""
    from importlib.util import find_spec

    try:
        spec = find_spec(package)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # this imports the parent packages, which may do anything
        raise MisuseError(f'scenario "{name}" cannot be found: its package {package} fails: {error}') from error
    folders = [Path(folder) for folder in (spec and spec.submodule_search_locations) or ()]
    for folder in folders:
        if (folder / FILE).is_file():
            return folder
    raise MisuseError(f'scenario "{name}" cannot be found: its package {package} has no {FILE}')
