"""Nomads: simulated robots driven axis by axis, as a Nomad server sees them (`robot.SimulatedWorld`).

The bodies are those of the simulator, with its encoders, slip, contact and sonars; this module adds what Nomads
need: motors that hold speeds or travel distances, a turret, zeroing, and obstacles given by their corners. At each
tick the motors set the speeds of the axes, and the simulator moves the bodies as far as they are free to go. Wheels
that steer together are simulated as two wheels that differ in speed: the body follows the same arcs.

A Nomad's frame has its 0, 0 at the origin of its site; the simulator's frame has it in a corner of the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, isnan, nan, pi, remainder

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.nomad.world.obstacles import PlacedObstacles
from sleepcast.nomad.world.paths import discs, first_along, first_round, has_room
from sleepcast.nomad.world.setups import Infrared, Setup
from sleepcast.robot import Axes, Condition, Contact, Corners, LidarKind, Pose, SonarKind
from sleepcast.simulator.bodies.bodies import Bodies, Mode
from sleepcast.simulator.bodies.proximity import Sonars, reach
from sleepcast.simulator.simd.formulas import wrap
from sleepcast.simulator.simulation import Simulator
from sleepcast.simulator.sonar import cones
from sleepcast.simulator.sonar.cones import Cones, VisibleScene
from sleepcast.simulator.world import grid
from sleepcast.simulator.world.grid import Floats, distance, nearest_point, pairs, spread
from sleepcast.simulator.world.world import Point

EDGE = 1
"""The number of the world's edge among its things: it is added first."""
HOME = 1e-6
"""Angle within which a turret counts as home, rad."""
TURN = 2.0 * pi


class NomadWorld:
    """See `robot.SimulatedWorld`. simulator: has the bodies, all equipped as `setup` says, and the world's edge as its
    first thing; origin: position of the Nomads' 0, 0 in its frame, m. Use `nomad_worlds.nomad_world` to make one.

    Raises IndexError for an unknown robot, and MisuseError for invalid numbers.
    """

    def __init__(self, simulator: Simulator, setup: Setup, origin: Point) -> None:
        self.simulator, self.setup, self.origin = simulator, setup, origin
        self._bodies = bodies = simulator.bodies
        self._motors = Motors(bodies.count, setup.speeds, setup.accelerations)
        sonars = bodies.rings_of(0)
        assert sonars  # a setup has sonars
        self._sonars = sonars
        self._senses = NomadSenses(bodies, sonars, setup.infrared)
        self._obstacles = PlacedObstacles(simulator.world, origin, EDGE)
        self._turns_turret = not isnan(setup.speeds.third)
        self._turret_speed = np.zeros(bodies.count)
        # Angles of the turrets from the headings, rad: the true ones, and those of their encoders.
        self._turret, self._believed_turret = np.zeros((2, bodies.count))
        if self._turns_turret:
            sonars.turret = self._turret
        self._zeroing: set[int] = set()
        self._conditions: list[Condition | None] = [None] * bodies.count
        bodies.mode[:] = Mode.DRIVE

    @property
    def count(self) -> int:
        return self._bodies.count

    @property
    def time(self) -> float:
        return self._bodies.time

    @property
    def tick(self) -> float:
        return self.simulator.scenario.tick

    @property
    def area(self) -> tuple[float, float, float, float]:
        """The rectangle within the world's edge: least x and y, greatest x and y, m."""
        (x, y), (width, height) = self.origin, self.size
        return -x, -y, width - x, height - y

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the world's edge, m."""
        return self.simulator.scenario.width, self.simulator.scenario.height

    def steers(self, robot: int) -> bool:
        self._check(robot)
        return self.setup.steers

    def radius(self, robot: int) -> float:
        self._check(robot)
        return float(self._bodies.radii[robot])

    def track(self, robot: int) -> float:
        self._check(robot)
        return self.setup.track

    def sonar(self, robot: int) -> SonarKind:
        self._check(robot)
        ring = self._sonars.ring
        return SonarKind(ring.beam, ring.least, ring.most)

    def lidar(self, robot: int) -> LidarKind:
        self._check(robot)
        laser = self.simulator.scenario.laser
        assert laser  # every world of Nomads has one
        return LidarKind(laser.beams, laser.first, laser.increment, laser.least, laser.reach)

    # ---- driving

    def set_speeds(self, robot: int, speeds: Axes) -> None:
        self._command(robot)
        self._motors.keep_speeds(robot, speeds)

    def travel(self, robot: int, distances: Axes) -> None:
        self._command(robot)
        self._motors.travel(robot, distances)

    def cruise(self, robot: int, speeds: Axes) -> None:
        self._check(robot)
        self._conditions[robot] = None
        self._motors.set_cruise(robot, speeds)

    def accelerate(self, robot: int, accelerations: Axes) -> None:
        self._check(robot)
        self._motors.set_acceleration(robot, accelerations)

    def limp(self, robot: int, axes: tuple[bool, bool, bool]) -> None:
        self._command(robot)
        self._motors.let_go(robot, axes)

    def rest(self, robot: int) -> None:
        self._command(robot)
        self._motors.rest(robot)

    def zero(self, robot: int) -> None:
        self._command(robot)
        self._motors.rest(robot)
        self._zeroing.add(robot)

    def _command(self, robot: int) -> None:
        """A new command for this robot: cancel zeroing."""
        self._check(robot)
        self._zeroing.discard(robot)
        self._conditions[robot] = None

    # ---- time

    def step(self) -> None:
        bodies, motors, tick = self._bodies, self._motors, self.tick
        speeds = motors.next_speeds(self._speeds(), tick)
        if self.setup.steers:
            bodies.wanted_speed[:], bodies.wanted_turn[:] = speeds[0], speeds[1]
        else:
            bodies.wanted_speed[:] = (speeds[0] + speeds[1]) / 2.0
            bodies.wanted_turn[:] = (speeds[0] - speeds[1]) / self.setup.track
        self._turn_turrets(speeds[2] - speeds[1] if self.setup.steers else speeds[2])
        x, y, heading = bodies.encoder_x.copy(), bodies.encoder_y.copy(), bodies.encoder_heading.copy()
        uncounted = bodies.uncounted.copy()
        self.simulator.step()
        turned = wrap(bodies.encoder_heading - heading)
        way = _way(bodies.encoder_x - x, bodies.encoder_y - y, heading, turned)
        if uncounted.size:  # motors travel as far as they are told, and between two steps of their encoders, too
            left, right = bodies.uncounted - uncounted
            way, turned = way + (left + right) / 2.0, turned + (right - left) / self.setup.track
        aside = turned * self.setup.track / 2.0
        first, second = (way, turned) if self.setup.steers else (way + aside, way - aside)
        motors.count(np.stack((first, second, speeds[2] * tick)), speeds, tick)
        self._turret_speed[:] = speeds[2]
        if self.setup.steers:
            self._turn_turrets(speeds[1] - turned / tick)  # the steering that the wheels could not do
        for robot in sorted(self._zeroing):
            self._zero_on(robot)
        self._forget()

    def _turn_turrets(self, rates: Floats) -> None:
        """Turn the turrets relative to the headings for one tick at these rates. Where wheels steer, the base does not
        turn with them, so the turret turns back as far as they turn."""
        for turret in (self._turret, self._believed_turret):
            turret[:] = wrap(turret + rates * self.tick)

    def _speeds(self) -> Floats:
        """Speeds of the axes, shape (3, count)."""
        bodies = self._bodies
        if self.setup.steers:
            return np.stack((bodies.speed, (bodies.right - bodies.left) / self.setup.track, self._turret_speed))
        return np.stack((bodies.right, bodies.left, self._turret_speed))

    def _zero_on(self, robot: int) -> None:
        """Take the next step of zeroing, once all axes are at rest."""
        if any(self._motors.moving(robot, self._speeds_of(robot))):
            return
        away = float(-self._believed_turret[robot])
        if self._turns_turret and abs(away) > HOME:
            self._motors.travel(robot, Axes(third=away))
            if not self._motors.cruise[2, robot]:
                self._motors.set_cruise(robot, Axes(third=self.setup.speeds.third))
            return
        x, y = self.origin
        if has_room(self._bodies, x, y, robot):
            self.place(robot, Pose(0.0, 0.0, 0.0, 0.0))
        self.believe(robot, 0.0, 0.0, 0.0, 0.0)
        self._zeroing.discard(robot)

    # ---- where robots are, and what they sense

    def observe(self, robot: int) -> Condition:
        self._check(robot)
        known = self._conditions[robot]
        if known is None:
            known = self._conditions[robot] = self._condition(robot)
        return known

    def _condition(self, robot: int) -> Condition:
        bodies, (x, y), speeds = self._bodies, self.origin, self._speeds_of(robot)
        believed, real = float(bodies.encoder_heading[robot]), float(bodies.heading[robot])
        turrets = _wrap_one(believed + self._believed_turret[robot]), _wrap_one(real + self._turret[robot])
        moving = self._motors.moving(robot, speeds)
        if robot in self._zeroing:
            moving = (True, True, self._turns_turret)
        return Condition(
            time=bodies.time,
            believed=Pose(float(bodies.encoder_x[robot]) - x, float(bodies.encoder_y[robot]) - y, believed, turrets[0]),
            real=Pose(float(bodies.x[robot]) - x, float(bodies.y[robot]) - y, real, turrets[1]),
            speeds=speeds,
            moving=moving,
            sonars=self._senses.sonars(robot),
            infrared=self._senses.infrared(robot),
            touched=self._senses.touched(robot),
            battery=self._battery(robot),
        )

    def _speeds_of(self, robot: int) -> Axes:
        bodies, turret = self._bodies, float(self._turret_speed[robot])
        right, left = float(bodies.right[robot]), float(bodies.left[robot])
        if self.setup.steers:
            return Axes((right + left) / 2.0, (right - left) / self.setup.track, turret)
        return Axes(right, left, turret)

    def _battery(self, robot: int) -> float:
        """Battery charge as a share; full if the setup does not model it."""
        for store, row in zip(self._bodies.scenario.robots.stores, self._bodies.stores, strict=True):
            if store.name.casefold() == "battery":
                return float(row[robot]) / store.full
        return 1.0

    def believe(self, robot: int, x: float = nan, y: float = nan, heading: float = nan, turret: float = nan) -> None:
        self._check(robot)
        bodies = self._bodies
        looks = float(bodies.encoder_heading[robot] + self._believed_turret[robot])
        columns = (bodies.encoder_x, bodies.encoder_y, bodies.encoder_heading)
        values = (x + self.origin[0], y + self.origin[1], _wrap_one(heading))
        for column, value in zip(columns, values, strict=True):
            if isfinite(value):
                column[robot] = value
        if self._turns_turret:
            looks = turret if isfinite(turret) else looks
            self._believed_turret[robot] = _wrap_one(looks - bodies.encoder_heading[robot])
        self._conditions[robot] = None

    def place(self, robot: int, pose: Pose) -> None:
        """NaN leaves a number unchanged; positions beyond the world's edge are clamped to it."""
        self._command(robot)
        self._motors.rest(robot)
        bodies, radius = self._bodies, self.radius(robot)
        spot = []
        for value, now, shift, size in zip(pose[:2], (bodies.x, bodies.y), self.origin, self.size, strict=True):
            wanted = float(now[robot]) if isnan(value) else value + shift
            spot.append(max(radius, min(wanted, size - radius)))
        heading = pose.heading if isfinite(pose.heading) else float(bodies.heading[robot])
        turret = pose.turret if isfinite(pose.turret) else float(bodies.heading[robot] + self._turret[robot])
        bodies.place(robot, spot[0], spot[1], _wrap_one(heading))
        self._turret_speed[robot] = 0.0
        if self._turns_turret:
            self._turret[robot] = self._believed_turret[robot] = _wrap_one(turret - heading)
        self._forget()

    def fire(self, robot: int, order: Sequence[int], pause: float) -> None:
        """Raises MisuseError for an unknown sonar, or an invalid pause."""
        self._check(robot)
        self._sonars.arrange(robot, order, pause)

    # ---- the world

    def solids(self) -> Sequence[Corners]:
        return self._obstacles.shown()

    def add(self, corners: Corners) -> bool:
        return self._changed(self._obstacles.add(corners))

    def remove(self, corners: Corners) -> bool:
        return self._changed(self._obstacles.remove(corners))

    def move(self, corners: Corners, dx: float, dy: float) -> bool:
        return self._changed(self._obstacles.move(corners, dx, dy))

    def fill(self, polygons: Sequence[Corners]) -> bool:
        return self._changed(self._obstacles.fill(polygons))

    def clear(self) -> None:
        self._obstacles.clear()
        self._forget()

    def _changed(self, done: bool) -> bool:
        if done:
            self._forget()
        return done

    def predict(self, robot: int, pose: Pose) -> tuple[tuple[float, ...], tuple[float, ...]]:
        self._check(robot)
        _refuse_odd("a pose", pose)
        turret = pose.turret if self._turns_turret else pose.heading
        return self._senses.predict(Pose(pose.x + self.origin[0], pose.y + self.origin[1], pose.heading, turret))

    def scan(self, robot: int) -> tuple[float, ...]:
        self._check(robot)
        return tuple(self.simulator.scans(np.array([robot]))[0].tolist())

    def along(self, robot: int, start: tuple[float, float], end: tuple[float, float]) -> Contact | None:
        """Considers all solid things, and the other robots at their current positions."""
        things = self._things(robot)
        _refuse_odd("a way", (*start, *end))
        return self._own(first_along(things, self.radius(robot), self._shifted(start), self._shifted(end)))

    def round(self, robot: int, centre: tuple[float, float], radius: float, begin: float, end: float) -> Contact | None:
        """Like `along`, on a circular path."""
        things = self._things(robot)
        _refuse_odd("a way", (*centre, radius, begin, end))
        return self._own(first_round(things, self.radius(robot), self._shifted(centre), radius, begin, end))

    def _things(self, robot: int) -> Floats:
        """What robot `robot` may touch, rows as in `World.solids`."""
        self._check(robot)
        bodies = self._bodies
        others = np.delete(discs(bodies.x, bodies.y, bodies.radii), robot, axis=0)
        return np.concatenate((self.simulator.world.solids, others))

    def _shifted(self, point: Point) -> Point:
        return point[0] + self.origin[0], point[1] + self.origin[1]

    def _own(self, contact: Contact | None) -> Contact | None:
        """A contact in the frame of the Nomads."""
        if contact is None:
            return None
        return contact._replace(x=contact.x - self.origin[0], y=contact.y - self.origin[1])

    def _check(self, robot: int) -> None:
        if not 0 <= robot < self._bodies.count:
            raise IndexError(f"no robot {robot}: there are {self._bodies.count}, from 0 on")

    def _forget(self) -> None:
        """Invalidate the cached conditions of the robots."""
        self._senses.forget()
        self._conditions = [None] * self._bodies.count


def _wrap_one(angle: float) -> float:
    """The angle wrapped to -pi..pi."""
    return remainder(angle, TURN) if isfinite(angle) else nan


def _way(across: Floats, up: Floats, heading: Floats, turned: Floats) -> Floats:
    """Path lengths of bodies on arcs that began with these headings and turned by this much (rad), m; negative
    backwards."""
    middle = heading + turned / 2.0
    way: Floats = (across * np.cos(middle) + up * np.sin(middle)) / np.sinc(turned / TURN)
    return way


def _refuse_odd(what: str, numbers: Sequence[float]) -> None:
    if not all(map(isfinite, numbers)):
        raise MisuseError(f"{what} with a number that is not finite: {', '.join(map(str, numbers))}")


# Motors of bodies that are driven axis by axis: the speed of each axis in the next tick.

AXES = 3
ARRIVED = 1e-9
"""Remaining distance that counts as rounding, m or rad."""
SLOWEST = 1e-9
"""Slowest speed that counts as moving, m/s or rad/s."""
FARTHEST = 1e7
"""Longest travel in one command, m or rad: a quarter of the way around the earth."""
ROLL_OUT = 0.25
"""Share of its greatest acceleration with which friction slows an axis that is neither driven nor braked."""

SPEED, TRAVEL, LIMP = range(3)
"""Modes of an axis."""


class Motors:
    """The axes of `count` bodies, arrays of shape (3, count), SI.

    most_speed, most_acceleration: the limits, NaN for an axis that a body lacks. drive: SPEED, TRAVEL or LIMP;
    speed: wanted in SPEED mode; left: remaining distance in TRAVEL mode; cruise: speed of travel; acceleration: rate
    of speed changes.
    """

    def __init__(self, count: int, speeds: Axes, accelerations: Axes) -> None:
        def each(values: Axes) -> Floats:
            return np.repeat(np.array(values, np.float64)[:, None], count, axis=1)

        self.most_speed, self.most_acceleration = each(speeds), each(accelerations)
        self.drive: NDArray[np.int8] = np.full((AXES, count), SPEED, np.int8)
        self.speed, self.left = np.zeros((AXES, count)), np.zeros((AXES, count))
        self.cruise, self.acceleration = each(speeds), each(accelerations)

    def keep_speeds(self, robot: int, speeds: Axes) -> None:
        """Turn these axes at these speeds from now on."""
        named = self._named(robot, speeds)
        most = self.most_speed[named, robot]
        self.drive[named, robot] = SPEED
        self.speed[named, robot] = np.clip(np.array(speeds)[named], -most, most)

    def travel(self, robot: int, distances: Axes) -> None:
        """Turn these axes by these distances and stop there."""
        named = self._named(robot, distances)
        self.drive[named, robot] = TRAVEL
        self.left[named, robot] = np.clip(np.array(distances)[named], -FARTHEST, FARTHEST)

    def set_cruise(self, robot: int, speeds: Axes) -> None:
        named = self._named(robot, speeds)
        self.cruise[named, robot] = np.clip(np.array(speeds)[named], 0.0, self.most_speed[named, robot])

    def set_acceleration(self, robot: int, accelerations: Axes) -> None:
        """Set accelerations within the limits; values of 0 or less change nothing."""
        wanted = np.array(accelerations)
        named = self._named(robot, accelerations)
        named = named[wanted[named] > 0.0]
        self.acceleration[named, robot] = np.minimum(wanted[named], self.most_acceleration[named, robot])

    def let_go(self, robot: int, axes: tuple[bool, bool, bool]) -> None:
        self.drive[np.flatnonzero(axes), robot] = LIMP

    def rest(self, robot: int) -> None:
        self.drive[:, robot] = SPEED
        self.speed[:, robot] = 0.0

    def next_speeds(self, speeds: Floats, tick: float) -> Floats:
        """Speeds of the axes for the next tick (s), shape (3, count). speeds: the current ones."""
        limp, travels = self.drive == LIMP, self.drive == TRAVEL
        change = np.where(limp, ROLL_OUT * self.most_acceleration, self.acceleration) * tick
        left = np.abs(self.left) / tick
        braking = np.floor((np.sqrt(1.0 + 8.0 * left / change) - 1.0) / 2.0)
        fastest = np.minimum(left / (braking + 1.0) + change * braking / 2.0, self.cruise)
        wanted = np.where(travels, np.copysign(fastest, self.left), np.where(limp, 0.0, self.speed))
        following: Floats = speeds + np.clip(wanted - speeds, -change, change)
        return np.nan_to_num(following)

    def count(self, gone: Floats, speeds: Floats, tick: float) -> None:
        """Account for axes that have turned by `gone` in a tick (s) at these `speeds`, both of shape (3, count)."""
        travels = self.drive == TRAVEL
        self.left -= np.where(travels, gone, 0.0)
        slow = np.abs(speeds) <= self.acceleration * tick + SLOWEST
        there = travels & (np.abs(self.left) < ARRIVED) & slow
        self.drive[there] = SPEED
        self.speed[there] = self.left[there] = 0.0

    def moving(self, robot: int, speeds: Axes) -> tuple[bool, bool, bool]:
        """Which of a body's axes turn, or are about to. speeds: the current ones."""
        first, second, third = speeds
        return self._moves(0, robot, first), self._moves(1, robot, second), self._moves(2, robot, third)

    def _moves(self, axis: int, robot: int, speed: float) -> bool:
        if abs(speed) > SLOWEST:
            return True
        drive = int(self.drive[axis, robot])
        if drive == TRAVEL:
            return bool(self.cruise[axis, robot] > 0.0)
        return drive == SPEED and bool(self.speed[axis, robot] != 0.0)

    def _named(self, robot: int, values: Axes) -> NDArray[np.intp]:
        """The axes that this body has and that have a value in `values`."""
        return np.flatnonzero(~np.isnan(np.array(values)) & ~np.isnan(self.most_speed[:, robot]))


# Sensors of Nomads: what they read now, and what they would read elsewhere.

FELT = 1e-3
"""Gap that a bumper still registers, m: bodies that were stopped keep a slightly smaller one between them."""

Values = tuple[float, ...]


class NomadSenses:
    """The sensors of `bodies`, all of one type, with `sonars` in a ring."""

    def __init__(self, bodies: Bodies, sonars: Sonars, infrared: Infrared | None) -> None:
        self._bodies, self._sonars = bodies, sonars
        robots = bodies.scenario.robots
        self._reach = reach(robots, bodies.scenario.tick)
        radius = robots.geometry.radius
        self._infrared = (
            Cones(infrared.count, infrared.beam / 2.0, infrared.most, np.pi / 2.0, radius) if infrared else None
        )
        self._known = False
        self._sonar_readings: list[Values] = []
        self._seen: list[Values] = []
        self._touched: list[Values] = []

    def forget(self) -> None:
        """Invalidate cached readings: something has changed."""
        self._known = False

    def sonars(self, robot: int) -> Values:
        """Last reading of each sonar, m; NaN before it has fired."""
        self._look()
        return self._sonar_readings[robot]

    def infrared(self, robot: int) -> Values:
        """Range of each infrared sensor, m; empty without such sensors."""
        self._look()
        return self._seen[robot]

    def touched(self, robot: int) -> Values:
        """Angles at which the bumper is pressed, rad from the heading, without repeats."""
        self._look()
        return self._touched[robot]

    def predict(self, pose: Pose) -> tuple[Values, Values]:
        """Readings that sonars and infrared sensors of a body at this pose would have, m, without other robots."""
        ring = self._sonars.ring
        at = np.array([pose.x]), np.array([pose.y]), np.array([pose.turret])
        heard = np.clip(self._lonely(self._sonars.cones, at), ring.least, ring.most)
        seen = self._lonely(self._infrared, at) if self._infrared else np.empty(0)
        return tuple(heard.tolist()), tuple(seen.tolist())

    def _lonely(self, ring: Cones, pose: tuple[Floats, Floats, Floats]) -> Floats:
        near = self._bodies.near
        points, listed = grid.sort(near.grid, pose[0], pose[1]), near.solids(ring.radius + ring.most)
        view = VisibleScene(ring, near.grid, points, listed, near.world.solids, pose)
        seen: Floats = cones.ranges(view, np.zeros(1, np.int64))[0].astype(np.float64)
        return seen

    def _look(self) -> None:
        if self._known:
            return
        self._known = True
        bodies, ring = self._bodies, self._sonars.ring
        read = self._sonars.readings
        exact = np.where(read <= np.float32(ring.least), ring.least, np.minimum(read.astype(np.float64), ring.most))
        self._sonar_readings = [tuple(row) for row in exact.tolist()]
        self._seen = [()] * bodies.count
        if self._infrared:
            aim = bodies.heading if self._sonars.turret is None else bodies.heading + self._sonars.turret
            pose, near = (bodies.x, bodies.y, aim), bodies.near
            listed = near.in_sight(self._infrared.radius + self._infrared.most)
            view = VisibleScene(
                self._infrared, near.grid, near.points(bodies.x, bodies.y), listed, near.world.solids, pose
            )
            seen = bodies.machine.ranges(view, np.arange(bodies.count))
            self._seen = [tuple(row) for row in np.minimum(seen.astype(np.float64), self._infrared.most).tolist()]
        self._touched = self._pressed()

    def _pressed(self) -> list[Values]:
        """The angles at which each robot's bumper is pressed."""
        bodies, every = self._bodies, np.arange(self._bodies.count)
        x, y, radius, near = bodies.x, bodies.y, bodies.geometry.radius, bodies.near
        listed, solids, cell = near.solids(self._reach), near.world.solids, near.grid.cells_of(x, y)
        i, item = spread(every, listed.start[cell], listed.start[cell + 1])
        lines = solids[listed.items[item]]
        close = distance(x[i], y[i], *lines[:, :4].T) <= radius + lines[:, 4] + FELT
        i, lines = i[close], lines[close]
        j, other = pairs(near.grid, near.points(x, y), x, y, 2.0 * radius + FELT, every)
        if not len(i) and not len(j):
            return [()] * bodies.count
        lines = np.concatenate((lines, discs(x[other], y[other], bodies.radii[other])))
        i = np.concatenate((i, j))
        across, up = nearest_point(x[i], y[i], *lines[:, :4].T)
        angles = np.round(np.arctan2(up, across) - bodies.heading[i], 9) % (2.0 * np.pi)
        felt: list[set[float]] = [set() for _ in every]
        for robot, angle in zip(i.tolist(), angles.tolist(), strict=True):
            felt[robot].add(angle)
        return [tuple(sorted(each)) for each in felt]
