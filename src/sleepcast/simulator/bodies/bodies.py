"""Bodies: the state of all simulated robots as arrays, one column per robot.

Sensor values lie in one table (`sensed`), a row for each sensor of the model, so that a reading is a column.
Proprioception (`known`: encoder pose, speed, stores and so on) shares that memory unless sensors are noisy; `sense`
updates noise and sonars on request. A body on wheels has slip, so its true pose is stored apart from its encoder
pose. The last command of each body is stored beside its state. Everything is float64, SI, and changed in place;
random numbers depend on the seed and the robot's number only.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from copy import copy
from dataclasses import replace
from enum import IntEnum
from functools import partial
from hashlib import sha256
from math import pi
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.arrays import count_up, filled
from sleepcast.core.counter_rng import GOLDEN, key, mix, uniform
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.model import Quantity
from sleepcast.core.records import NamedTuple
from sleepcast.simulator.bodies import starting
from sleepcast.simulator.bodies.flight import Flight
from sleepcast.simulator.bodies.line_of_sight import LineOfSight
from sleepcast.simulator.bodies.particles import Particles
from sleepcast.simulator.bodies.population import Population, Turnover
from sleepcast.simulator.bodies.proximity import Bumpers, Neighbours, SonarGroups, Sonars, least_cell, reach
from sleepcast.simulator.bodies.scanner import Scanner
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion.driving import DRIVE, GOTO, WANDER, laws_of
from sleepcast.simulator.motion.omni import SideColumns
from sleepcast.simulator.motion.steps import BodyColumns
from sleepcast.simulator.scenario.groups import value_quantities, values_of
from sleepcast.simulator.scenario.robot_settings import SIDE_SPEED, RobotSpec
from sleepcast.simulator.scenario.robot_types import slices
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.sensors import sensors_of
from sleepcast.simulator.scenario.starts import start_columns
from sleepcast.simulator.simd.formulas import rotated, sine_cosine, wrap
from sleepcast.simulator.sonar.cones import Cones
from sleepcast.simulator.world.areas import barred
from sleepcast.simulator.world.torus import wrap_position
from sleepcast.simulator.world.world import World

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.intp]

MAX_REDRAWS = 200
"""Attempts to find a start outside of solid areas for every robot: enough if one place in ten is free."""
FARTHEST = 1e12
"""Greatest coordinate of a point to drive to on a torus, m."""
MAX_SAYINGS = 1_000
"""Number of latest spoken messages that are kept."""
NEWS_OF_ONE = 4
"""What may befall one body in a tick; of so much for each, the oldest go where nobody takes it."""
TURN = 2.0 * pi
ROW = 20.0
"""Distance between rows, m, where robots are numbered along rows: robots within sonar range are in the same row or the
next."""


_COLUMNS = attrgetter(*BodyColumns._fields)


class Mode(IntEnum):
    """What moves a body."""

    WANDER = WANDER
    DRIVE = DRIVE
    GOTO = GOTO


class Saying(NamedTuple):
    """What a robot has spoken (`TK`), or what has befallen its body: time (s), the robot's index, and the text."""

    time: float
    robot: int
    text: str


class Bodies:
    """`count` bodies at the start of a scenario; see the module.

    Arrays of shape (count,) unless stated otherwise.

    x, y: true position in the world's frame, m
    heading: true heading, rad, -pi..pi, counter-clockwise from the x axis
    encoder_x, encoder_y, encoder_heading: pose by odometry; the same arrays for bodies without wheels
    sensed: shape (sensors, count), NaN for values never measured
    known: its first rows, without noise
    speed: along the heading, m/s
    left, right: speeds of the wheels, m/s
    bumper: the segment that touches something, counter-clockwise from 1 in front, or 0
    hit_x, hit_y: vector from the body to what it touches, m, or 0
    stores: shape (stores, count)
    mode: a `Mode`
    wanted_speed, wanted_turn: command of DRIVE, m/s and rad/s
    wanted_side: of `drive_side`, m/s; empty where no body has it, as the next one
    side_speed: to the left of those that drive in every direction, m/s
    target_x, target_y: destination of GOTO, m
    stopped, held: latched by STOP, held still
    still: held still by minds that reach their bodies; `held` itself where no link is cut
    cut_off: whose mind does not reach the body, as `links` say; empty where no link is cut
    swing: remaining angle of a tumble, rad
    roaming: turn rate of a wandering body, rad/s
    uses, drains: what each store loses per metre and per second, shape (stores,)
    added: sensors besides those of the scenario
    sensors: all of them but those of sonars; None makes them
    population: which of them are there, where robots come and go; `first` has those at the start then, None for nobody
    numbers: of the robots, from 0 upwards by default
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        machine: Machine,
        added: tuple[Quantity, ...] = (),
        sensors: tuple[Quantity, ...] | None = None,
        population: Population | None = None,
        first: Bodies | None = None,
        numbers: Whole | None = None,
    ) -> None:
        self.population = population
        robots, specs = scenario.robots, scenario.each_type
        self.scenario, self.seed, self.count = scenario, seed, robots.count
        self.of_each_type = slices(specs, self.count)
        """The slice of bodies of each robot type."""
        self.radii: Floats = self.by_type([spec.geometry.radius for spec in specs])
        self.slides = self.by_type([float(spec.slides) for spec in specs]) > 0.0
        """Which bodies slide along what they touch."""
        self.rolls = self.by_type([float(spec.wheels is not None) for spec in specs]) > 0.0
        """Which bodies go on wheels, whose speeds are `left` and `right`."""
        self.omni = self.by_type([float(spec.omni) for spec in specs]) > 0.0
        """Which bodies on the ground drive in every direction."""
        self.brakes: Floats = self.by_type([spec.limits.acceleration for spec in specs])
        """How fast bodies change their speed, m/s2."""
        self.limits, self.geometry = robots.limits, robots.geometry
        self.fence = (0.0, 0.0, scenario.width, scenario.height)
        self.world = World(scenario.shapes)
        self.tick = 0
        self.sayings, self.news = list[Saying](), list[Saying]()
        """What robots have spoken, and what has befallen bodies and was not taken yet; the latest of both."""
        self.most_news = max(MAX_SAYINGS, NEWS_OF_ONE * self.count)
        self.sensors = (*sensors_of(scenario), *added) if sensors is None else sensors
        ring = robots.ring
        own, all_ = len(self.sensors), len(self.sensors) + (ring.count + 1 if ring else 0)
        self.sensed: Floats = filled(np.nan, np.float64, all_, self.count)
        self.known: Floats = filled(np.nan, np.float64, own, self.count) if scenario.noise else self.sensed[:own]
        numbers = population.numbers if population else numbers
        self.numbers = count_up(self.count, np.uint64) if numbers is None else numbers.astype(np.uint64)
        self.first_id = 1
        """What the first robot knows as its `id`; those of the others follow."""
        self.chance = self._chances()
        """A key for each robot, uint64."""
        self.encoder_x: Floats = self.known[0]
        self.encoder_y: Floats = self.known[1]
        self.encoder_heading: Floats = self.known[2]
        apart = filled(0.0, np.float64, 3, self.count) if robots.wheels else self.known
        self.x: Floats = apart[0]
        self.y: Floats = apart[1]
        self.heading: Floats = apart[2]
        self.speed: Floats = self.known[3]
        self.stores: Floats = self.known[4 : 4 + len(robots.stores)]
        self.store_names = tuple(store.name.casefold() for store in robots.stores)
        self.uses, self.drains = self._uses()
        self.left, self.right, self.wanted_speed, self.wanted_turn = filled(0.0, np.float64, 4, self.count)
        counts = any(spec.wheels is not None and spec.wheels.counts for spec in specs)
        self.uncounted: Floats = np.zeros((2, self.count if counts else 0))
        """What each wheel has turned since the last step that its encoder has counted, m: left, right."""
        self.hit_x, self.hit_y = np.zeros(self.count), np.zeros(self.count)
        names = [sensor.name for sensor in self.sensors]
        self.bumper: Floats = self.known[names.index("bumper")] if robots.bumpers else np.zeros(self.count)
        self.mode = np.zeros(self.count, np.int8)
        self.target_x, self.target_y = np.zeros(self.count), np.zeros(self.count)
        self.swing, self.roaming = np.zeros(self.count), np.zeros(self.count)
        self.stopped, self.held = np.zeros(self.count, bool), np.zeros(self.count, bool)
        self.still = self.held.copy() if scenario.cuts else self.held
        self.cut_off = np.zeros(self.count if scenario.cuts else 0, bool)
        self.side_speed: Floats = self.known[names.index(SIDE_SPEED)] if robots.omni else np.zeros(0)
        self.wanted_side = np.zeros(self.count if robots.omni or robots.flight else 0)
        self.flight: Flight | None = None
        if robots.flight:
            self.flight = Particles(self) if robots.flight.particle else Flight(self)
        """Those that fly; None where none does."""
        wings = self.flight.wings if self.flight else None
        self.takes_speeds: Flags = np.ones(self.count, bool) if wings is None else ~wings.planes
        """Which bodies can be driven: all but planes, which are told places only."""
        self.machine, self.laws = machine, laws_of(scenario)
        there = population.present if population else None
        heights = self.flight.z if self.flight else None
        self.sight = LineOfSight(scenario, self.world, machine, (self.x, self.y), self.radii, there, heights)
        self.parts = [self._part(*each) for each in zip(specs, self.of_each_type, strict=True)] if specs[1:] else [self]
        """The bodies of each robot type: views of these arrays, with the parameters of that type."""
        size, cones = (scenario.width, scenario.height), [self._cones(spec) for spec in specs]
        cell = max((each.cell for each in cones if each), default=least_cell(robots, size, scenario.tick))
        far = max(reach(spec, scenario.tick) for spec in specs)
        # A body may meet others up to twice `far` away, and they in turn others and solids beyond.
        farthest = max([4.0 * far, *(each.reach for each in cones if each)])
        laser, camera = scenario.laser, scenario.camera
        widest = float(self.radii.max())
        farthest = max([farthest, laser.reach + widest if laser else 0.0, camera.reach if camera else 0.0])
        farthest = max([farthest, *(spec.footprint for spec in specs)])
        near = partial(Neighbours, size, cell, self.count, self.world, machine, scenario.around, farthest, there)
        self.near = near()
        self.low = near(self.flight) if self.flight and (robots.bumpers or robots.ring) else self.near
        """Those whom bodies on the ground meet: all but what flies higher."""
        self.contact = Bumpers(self.radii, far, self.low, machine, self.flight) if robots.bumpers else None
        self.sonars = self._make_sonars(self.sensed[own:], cones)
        self.scanner = Scanner(laser, self.radii, self.near, seed, machine, heights, self.sight) if laser else None
        if population:
            self._begin_with(first, np.flatnonzero(population.present))
        else:
            self._start()
        if self.flight:
            self.flight.look_below()

    def _chances(self) -> NDArray[np.uint64]:
        """The key of each robot for what is by chance."""
        return mix(self.numbers * np.uint64(GOLDEN) + np.uint64(key(self.seed, "bodies")))

    @property
    def _columns(self) -> dict[str, NDArray[np.generic]]:
        """All arrays with a column for each robot that may be written, by name; some share their memory."""
        arrays = {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        arrays |= self.flight.columns if self.flight else {}
        fixed = {"numbers", "chance", "radii", "slides", "rolls", "omni", "takes_speeds", "brakes", "uses", "drains"}
        return {name: each for name, each in arrays.items() if each.shape[-1:] == (self.count,) and name not in fixed}

    def _begin_with(self, first: Bodies | None, rows: Whole) -> None:
        """Have these bodies in these rows, and none in all others, which stand at 0, 0."""
        for place in (self.x, self.y, self.heading, self.encoder_x, self.encoder_y, self.encoder_heading, self.speed):
            place[:] = 0.0
        self.mode[:] = Mode.DRIVE
        if first:
            self.take_in(first, rows)

    def take_in(self, others: Bodies, rows: Whole) -> None:
        """Have these bodies, of the same scenario, in these rows."""
        given = others._columns
        for name, column in self._columns.items():
            column[..., rows] = given[name]

    def renumber(self) -> None:
        """Other robots are there than at the start, as their numbers say."""
        if self.population:
            self.numbers[:] = self.population.numbers.astype(np.uint64)
            self.chance[:] = self._chances()

    def turn_over(self, turnover: Turnover) -> None:
        """Robots have come, each as a copy of its parent, but for what it gets of its stores; and others have gone."""
        parents, children, dead = turnover.parents, turnover.children, turnover.dead
        for column in self._columns.values():
            column[..., children] = column[..., parents]
        self._know_values(children)
        feels = self.by_type([float(spec.bumpers) for spec in self.scenario.each_type]) > 0.0
        for felt, has in ((self.side_speed, self.omni), (self.bumper, feels)):  # the parent may be of another type
            if felt.size:
                felt[children] = np.where(has[children], np.nan_to_num(felt[children]), np.nan)
        for row in self.stores:
            row[children] = row[parents] * turnover.shares
            row[turnover.givers] *= turnover.kept
        self.numbers[children] = turnover.numbers
        self.chance[children] = self._chances()[children]
        self.mode[dead], self.stopped[dead], self.held[dead] = Mode.DRIVE, False, False
        for still in (self.wanted_speed, self.wanted_turn, self.swing, *self._sides):
            still[dead] = 0.0
        if self.flight:
            self.flight.turn_over(turnover)
        for number in dead.tolist():
            self.settle(number)
        self.forget()

    def by_type(self, values: Sequence[float]) -> Floats:
        """One value for each body, by its type; read-only."""
        if len(values) == 1:
            return np.broadcast_to(values[0], self.count)
        column = np.empty(self.count)
        for value, which in zip(values, self.of_each_type, strict=True):
            column[which] = value
        return column

    def _part(self, spec: RobotSpec, which: slice) -> Bodies:
        """The bodies of one robot type."""
        part = copy(self)
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                setattr(part, name, value[..., which])
        part.count, part.parts = which.stop - which.start, [part]
        part.scenario = replace(self.scenario, robots=replace(spec, count=part.count), sorts=())
        part.limits, part.geometry, part.laws = spec.limits, spec.geometry, laws_of(part.scenario)
        part.uses, part.drains = part._uses()
        return part

    def moved(self) -> None:
        """Let bodies that have left a torus on one side come in on the opposite one, also in what they believe; and
        `forget` where they were."""
        if self.scenario.torus:
            width, height = self.scenario.around
            for x, y in ((self.x, self.y), (self.encoder_x, self.encoder_y)):
                wrap_position(x, width)
                wrap_position(y, height)
        self.forget()

    def displace(self, which: Whole, dx: Floats, dy: Floats) -> None:
        """Move these bodies by so many m without their wheels; odometry follows, as if it had seen it."""
        if self.scenario.robots.wheels:
            seen_dx, seen_dy = rotated(dx, dy, *sine_cosine(self.encoder_heading[which] - self.heading[which]))
            self.encoder_x[which] += seen_dx
            self.encoder_y[which] += seen_dy
        self.x[which] += dx
        self.y[which] += dy

    def go_to(self, which: Whole, x: Floats, y: Floats) -> None:
        """Send these bodies, none of which is stopped, to points x, y (m)."""
        self.mode[which] = Mode.GOTO
        self.target_x[which], self.target_y[which] = self.aimed(x, y)

    def aimed(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """The points x, y (m) of the world for any ones: around a torus, else the nearest ones."""
        left, bottom, right, top = self.fence
        if self.scenario.torus:
            x, y = np.clip((x, y), -FARTHEST, FARTHEST)
            return np.mod(x, right), np.mod(y, top)
        return np.clip(x, left, right), np.clip(y, bottom, top)

    def part_of(self, number: int) -> Bodies:
        """The bodies of the same type as body `number`."""
        each = zip(self.parts, self.of_each_type, strict=True)
        return next(part for part, which in each if which.start <= number < which.stop)

    def rings_of(self, number: int) -> Sonars | None:
        """The sonars of body `number`, if it has any."""
        return self.sonars.of(number) if isinstance(self.sonars, SonarGroups) else self.sonars

    @property
    def rings(self) -> Sequence[Sonars]:
        """The sonars of each robot type that has any."""
        if self.sonars is None:
            return ()
        return self.sonars.rings if isinstance(self.sonars, SonarGroups) else [self.sonars]

    def _cones(self, spec: RobotSpec) -> Cones | None:
        ring, widest = spec.ring, float(self.radii.max())
        return (
            Cones(ring.count, ring.beam / 2, ring.most, ring.incidence, spec.geometry.radius, widest) if ring else None
        )

    def _make_sonars(self, table: Floats, cones: Sequence[Cones | None]) -> Sonars | SonarGroups | None:
        """The sonars of all robot types, which have these cones. table: receives the readings."""
        rings = []
        for cone, spec, which in zip(cones, self.scenario.each_type, self.of_each_type, strict=True):
            if spec.ring and cone and len(cones) == 1:
                return Sonars(spec.ring, cone, table, self.low, self.seed, self.machine)
            if spec.ring and cone and which.start < which.stop:
                apart = np.full((spec.ring.count + 1, which.stop - which.start), np.nan)
                rings.append(Sonars(spec.ring, cone, apart, self.low, self.seed, self.machine, which, self.radii))
        return SonarGroups(rings, table) if rings else None

    @property
    def time(self) -> float:
        """Simulated time in s."""
        return self.tick * self.scenario.tick

    @property
    def columns(self) -> BodyColumns:
        """The state that motion changes."""
        return BodyColumns(*_COLUMNS(self))

    @property
    def sides(self) -> SideColumns:
        """What `columns` lack of bodies that drive in every direction."""
        return SideColumns(self.wanted_side, self.side_speed)

    @property
    def _sides(self) -> tuple[Floats, ...]:
        """The wanted speed to the side, where any body has one."""
        return (self.wanted_side,) if self.wanted_side.size else ()

    @property
    def counts(self) -> float:
        """Steps of the wheels' encoders in a metre, for bodies of one type; 0 for exact ones, or without wheels."""
        wheels = self.scenario.robots.wheels
        return wheels.counts if wheels else 0.0

    def _uses(self) -> tuple[Floats, Floats]:
        """What each store loses per metre and per second."""
        stores = {store.name.casefold(): store for store in self.scenario.robots.stores}
        carried = [stores.get(name) for name in self.store_names]
        return (
            np.array([store.full / store.reach if store else 0.0 for store in carried]),
            np.array([store.full / store.lasts if store else 0.0 for store in carried]),
        )

    def drain(self) -> None:
        """Let stores lose what a tick takes of them, whatever the bodies do."""
        for part in self.parts:
            for row, drain in zip(part.stores, part.drains.tolist(), strict=True):
                if drain:
                    row[:] = np.maximum(row - drain * self.scenario.tick, 0.0)

    def exhausted(self) -> NDArray[np.bool_] | None:
        """Which bodies have used up something that they drive with; None where no body can."""
        empty = self.flight.empty if self.flight else None
        if not any(use for part in self.parts for use in part.uses):
            return empty
        exhausted = np.zeros(self.count, bool) if empty is None else empty
        for part, which in zip(self.parts, self.of_each_type, strict=True):
            for row, use in zip(part.stores, part.uses, strict=True):
                if use:
                    exhausted[which] |= row <= 0.0
        return exhausted if self.population is None else exhausted & self.population.present

    def speak(self, robot: int, text: str) -> None:
        """Store what a robot speaks now."""
        self._keep(self.sayings, MAX_SAYINGS, robot, text)

    def say_of(self, robot: int, sentence: str) -> None:
        """Store what befalls a body now, until somebody takes it to tell its operator."""
        self._keep(self.news, self.most_news, robot, sentence)

    def _keep(self, sayings: list[Saying], most: int, robot: int, text: str) -> None:
        del sayings[: max(0, len(sayings) + 1 - most)]
        sayings.append(Saying(self.time, robot, text))

    def take_news(self) -> list[Saying]:
        """What has befallen bodies since the last call, in the order in which it did."""
        taken, self.news = self.news, []
        return taken

    def forget(self) -> None:
        """Invalidate the spatial index and the sonar readings: bodies have moved."""
        self.near.forget()
        self.low.forget()
        self.sight.moved = True
        if self.flight:
            self.flight.look_below()
        if self.scanner:
            self.scanner.forget()
        if self.sonars:
            self.sonars.forget()

    def place(self, number: int, x: float, y: float, heading: float) -> None:
        """Place a body at rest: sets its true and its encoder pose (m, rad)."""
        for column_x, column_y, column_heading in (
            (self.x, self.y, self.heading),
            (self.encoder_x, self.encoder_y, self.encoder_heading),
        ):
            column_x[number], column_y[number], column_heading[number] = x, y, heading
        self.uncounted[:, number : number + 1] = 0.0
        self.settle(number)
        self.forget()

    def settle(self, number: int) -> None:
        """Let a body be at rest at once, where it is."""
        for still in (self.speed, self.left, self.right, self.hit_x, self.hit_y):
            still[number] = 0.0
        for felt in (self.bumper, self.side_speed):  # unknown to types that have none
            felt[number : number + 1] = np.where(np.isnan(felt[number : number + 1]), np.nan, 0.0)
        if self.flight:
            self.flight.settle(np.array([number]))

    def rest_states(self, which: Whole) -> tuple[Floats, Floats]:
        """Speed of the fastest part of each of these bodies, m/s, and how far it goes until it is at rest if it brakes
        as fast as it may, m."""
        speed: Floats = np.abs(self.speed[which])
        if self.flight:
            speed = np.where(self.flight.flies[which], self.flight.speeds(which), speed)
        if self.scenario.robots.omni:
            side = np.where(self.omni[which], self.side_speed[which], 0.0)
            speed = np.sqrt(speed * speed + side * side)
        wheels = np.maximum(np.abs(self.left[which]), np.abs(self.right[which]))
        fastest: Floats = np.where(self.rolls[which], np.maximum(speed, wheels), speed)
        return fastest, speed * speed / (2.0 * self.brakes[which])

    def act(self, actuator: str, which: Whole | slice, values: Floats) -> None:
        """Set one actuator of these bodies to `values`, leaving the other one's wanted value; see `Body.act`."""
        wanted = {"drive_speed": self.wanted_speed, "drive_turn": self.wanted_turn}
        have = {"drive_side": self.omni} if self.scenario.robots.omni else {}
        if self.flight:
            have = {"drive_side": self.omni | self.flight.hovers, "drive_climb": self.flight.hovers}
            have |= dict.fromkeys(("drive_speed", "drive_turn"), self.takes_speeds) if self.flight.wings else {}
            wanted["drive_climb"] = self.flight.wanted_climb
        if self.wanted_side.size:
            wanted["drive_side"] = self.wanted_side
        stopped = self.stopped | ~have[actuator] if actuator in have else self.stopped
        stopped = stopped | self.cut_off if self.cut_off.size else stopped
        if actuator not in wanted:
            raise MisuseError(f'no actuator "{actuator}"{did_you_mean(actuator, wanted)}: wanted {" or ".join(wanted)}')
        if isinstance(which, slice):
            some, mode, column = stopped[which], self.mode[which], wanted[actuator][which]
            self.machine.share(values.size, lambda i, j: _drive(some[i:j], mode[i:j], column[i:j], values[i:j]))
            return
        free, named = ~stopped[which], ~np.isnan(values)
        self.mode[which[free]] = Mode.DRIVE
        wanted[actuator][which[free & named]] = values[free & named]

    def sense(self, which: Whole | None = None, sonars: bool | Collection[int] = True) -> None:
        """Bring the table up to date for the robots with these indices (None: all): noise and, if `sonars`, sonar
        readings, at least in these rows. A second call in the same tick gives the same values."""
        if self.scenario.noise:
            self._disturb(slice(None) if which is None else which)
        if sonars and self.sonars:
            rows = None if sonars is True else [row - len(self.sensors) for row in sonars]
            self.sonars.sense(which, self.tick, (self.x, self.y, self.heading), rows)

    def sonar_ranges(self, numbers: Sequence[int] | None = None, rows: Collection[int] | None = None) -> Floats:
        """Sonar readings of these robots (None: all), m, shape (robots, sonars), up to date in these `rows` (None: all)
        at least. Only for robots with sonars."""
        assert self.sonars
        which = None if numbers is None else np.asarray(numbers, np.int64)
        self.sonars.sense(which, self.tick, (self.x, self.y, self.heading), rows)
        return self.sensed[len(self.sensors) : -1, slice(None) if which is None else which].T

    def velocity(self) -> Floats:
        """The velocity of all bodies over the ground, to the east and to the north, m/s, shape (2, count)."""
        side = np.nan_to_num(self.side_speed) if self.side_speed.size else np.zeros(self.count)
        velocity: Floats = np.stack(rotated(self.speed, side, *sine_cosine(self.heading)))
        if self.flight is not None:
            flown = np.stack((self.flight.velocity_x, self.flight.velocity_y))
            velocity = np.where(self.flight.flies, flown, velocity)
        return velocity

    def scans(self, which: Whole) -> NDArray[np.float32]:
        """What the scanners of these bodies measure, see `Scanner.ranges`. Only for robots that have them."""
        assert self.scanner
        return self.scanner.ranges(which, self.tick, (self.x, self.y, self.heading))

    def readings(self, numbers: Sequence[int] | None = None) -> list[list[float]]:
        """Current sensor values of the robots with these indices (None: all): for each robot one value per sensor, in
        SI, NaN for values never measured."""
        which = None if numbers is None else np.asarray(numbers, np.int64)
        self.sense(which)
        rows: list[list[float]] = self.sensed[:, slice(None) if which is None else which].T.tolist()
        return rows

    def _disturb(self, which: Whole | slice) -> None:
        """Copy proprioception of these bodies into the table, with noise."""
        self.sensed[: len(self.known), which] = self.known[:, which]
        for row, sensor in enumerate(self.sensors):
            deviation = self.scenario.noise.get(sensor.name, 0.0)
            if deviation:
                size, angle = (
                    self.drawn(f"noise {half} {sensor.name} {self.tick}", self.numbers[which]) for half in "ab"
                )
                normal = np.sqrt(-2.0 * np.log(1.0 - size)) * np.cos(TURN * angle)  # Box and Muller's method
                noisy = self.known[row, which] + deviation * normal
                wraps = sensor.name == "heading"
                self.sensed[row, which] = wrap(noisy) if wraps else np.clip(noisy, sensor.low, sensor.high)

    def drawn(self, purpose: str, numbers: NDArray[np.uint64] | None = None) -> Floats:
        """For each robot (or those of `numbers`) a number from [0, 1) for `purpose`, the same in every run."""
        return uniform(key(self.seed, purpose), self.numbers if numbers is None else numbers)

    def state_hash(self, more: Iterable[NDArray[np.generic]] = ()) -> str:
        """SHA-256 of the whole state, as hexadecimal digits: equal for equal runs, in any process. more: state that is
        stored elsewhere."""
        digest = sha256(str(self.tick).encode())
        for array in (*self._state(), *more):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    def _state(self) -> Iterable[NDArray[np.generic]]:
        yield self.known
        yield from (self.wanted_speed, self.wanted_turn, self.target_x, self.target_y, self.swing, self.roaming)
        yield from (self.mode, self.stopped, self.held)
        if self.scenario.robots.omni:
            yield self.wanted_side
        if self.flight:
            yield from self.flight.columns.values()
        if self.scenario.robots.wheels:
            yield from (self.x, self.y, self.heading, self.left, self.right)
        if self.contact:
            yield from (self.hit_x, self.hit_y)
        if self.sonars:
            yield from self.sonars.state()
        yield self.world.solids
        if self.world.tops is not None:
            yield self.world.tops

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """All arrays, by name, that a run changes and that the next ticks depend on."""
        robots = self.scenario.robots
        names = ["sensed", "wanted_speed", "wanted_turn", "target_x", "target_y", "swing", "roaming"]
        names += ["mode", "stopped", "held"]
        names += ["known"] if self.scenario.noise else []
        names += ["x", "y", "heading", "left", "right"] if robots.wheels else []
        names += (["wanted_side"] if robots.omni else []) + (["uncounted"] if self.uncounted.size else [])
        names += ["hit_x", "hit_y"] if self.contact else []
        arrays: dict[str, NDArray[np.generic]] = {name: getattr(self, name) for name in names}
        arrays |= self.flight.columns if self.flight else {}
        for number, ring in enumerate(self.rings):
            arrays |= {f"{name} of ring {number}": values for name, values in ring.arrays().items()}
        return arrays

    def _start(self) -> None:
        robots = self.scenario.robots
        given = self.by_type([float(bool(spec.starts)) for spec in self.scenario.each_type]) > 0.0
        try:
            self.x[:], self.y[:] = self._places(given)
            starting.part(self, partial(self._places, given), given)
        except starting.StartError as error:
            raise starting.StartError(f"{self.scenario.path}: robots.starts: {error}") from None
        for part in self.parts:
            if part.scenario.robots.in_rows:
                order = np.lexsort((part.x, part.y // ROW))
                part.x[:], part.y[:] = part.x[order], part.y[order]
        self.heading[:] = _spread((-pi, pi), self.drawn("heading"))
        for part in self.parts:
            if starts := part.scenario.robots.starts:
                heading = start_columns(starts, part.count)[2]
                part.heading[:] = np.where(np.isnan(heading), part.heading, wrap(heading))
        self.encoder_x[:], self.encoder_y[:], self.encoder_heading[:] = self.x, self.y, self.heading
        for part in self.parts:
            part._start_alike()
        if self.flight:
            self.flight.start()
        first = 4 + len(robots.stores)
        for place in self.scenario.places:
            self.known[first], self.known[first + 1] = place.x, place.y
            first += 2
        self._know_values(slice(None))

    def _know_values(self, which: Whole | slice) -> None:
        """Let these bodies know the values of their groups."""
        groups, names = self.scenario.robots.groups, [sensor.name for sensor in self.sensors]
        for quantity in value_quantities(groups):
            self.known[names.index(quantity.name), which] = values_of(groups, self.count, quantity.name)[which]

    def _start_alike(self) -> None:
        """Set the initial state of the bodies of one type."""
        robots = self.scenario.robots
        self.speed[:] = robots.wander.speed if robots.wanders else 0.0
        self.left[:] = self.right[:] = self.speed
        self.mode[:] = Mode.WANDER if robots.wanders else Mode.DRIVE
        self.bumper[:] = 0.0 if robots.bumpers else np.nan
        self.side_speed[:] = 0.0 if robots.omni else np.nan
        for store in robots.stores:
            carried = self.drawn(f"{store.name} carried") < store.share
            row = self.stores[self.store_names.index(store.name.casefold())]
            row[:] = np.where(carried, _spread((store.low, store.high), self.drawn(store.name)), 0.0)

    def _places(self, given: Flags, attempt: int | None = None) -> tuple[Floats, Floats]:
        """Start positions outside of what is solid, for what flies perhaps on its roof; different ones for each further
        attempt, but for bodies whose start is `given`. Raises MisuseError if there is hardly any free place, or none
        where one is given."""
        again = "" if attempt is None else f" {attempt}"
        x, y = self.anywhere(again)
        for redraw in range(MAX_REDRAWS):
            wrong = np.flatnonzero(barred(self.world, x, y, self.lands))
            if not len(wrong):
                return x, y
            if given[wrong].any():
                first = wrong[given[wrong]][0]
                raise starting.StartError(
                    f"robot {first + 1} cannot start at {x[first]:g}, {y[first]:g} m: that is inside a wall"
                )
            other_x, other_y = self.anywhere(f"{again} redrawn {redraw}")
            x[wrong], y[wrong] = other_x[wrong], other_y[wrong]
        raise MisuseError("where the robots start nearly everything is solid: let them start elsewhere (x, y, disc)")

    @property
    def lands(self) -> Flags:
        """Which of them fly, and may stand on a roof; shape (count,)."""
        return np.zeros(self.count, bool) if self.flight is None else self.flight.flies

    def anywhere(self, again: str) -> tuple[Floats, Floats]:
        """Random points of the rectangles or discs in which the robots start."""
        if self.parts[1:]:
            places = [part.anywhere(again) for part in self.parts]
            return np.concatenate([x for x, _ in places]), np.concatenate([y for _, y in places])
        robots = self.scenario.robots
        if robots.starts:
            return start_columns(robots.starts, self.count)[:2]
        if robots.disc is None:
            return _spread(robots.x, self.drawn(f"x{again}")), _spread(robots.y, self.drawn(f"y{again}"))
        x, y, radius = robots.disc
        away, angle = radius * np.sqrt(self.drawn(f"away{again}")), TURN * self.drawn(f"angle{again}")
        return x + away * np.cos(angle), y + away * np.sin(angle)


def _spread(ends: tuple[float, float], drawn: Floats) -> Floats:
    return ends[0] + (ends[1] - ends[0]) * drawn


def _drive(stopped: NDArray[np.bool_], mode: NDArray[np.int8], wanted: Floats, values: Floats) -> None:
    """Drive those of these bodies that are not stopped with the `values` that are not NaN."""
    if not stopped.any() and not np.isnan(values.min(initial=0.0)):
        mode[:], wanted[:] = Mode.DRIVE.value, values  # the most common case
        return
    np.putmask(mode, ~stopped, Mode.DRIVE.value)
    np.putmask(wanted, ~(stopped | np.isnan(values)), values)
