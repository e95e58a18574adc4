"""One simulated body: a view of its column in the arrays, with the functions that expressions may call.

A `Body` is a `Robot`. It only stores commands; the next tick executes them within the limits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from math import isfinite, isnan, nan, pi
from operator import attrgetter
from typing import Any, Protocol, TypeVar

import numpy as np

from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import BodyColumn, HostFunction, Quantity, RestState, Writing
from sleepcast.core.units import LENGTH, NONE, RATE, SPEED, Dimension
from sleepcast.robot import DOES_NOTHING, Geometry, OutOfReachError, Reading, RobotModel, Setpoint, hovering
from sleepcast.simulator.bodies.bodies import TURN, Bodies, Floats, Mode, Whole
from sleepcast.simulator.bodies.particles import Particles
from sleepcast.simulator.bodies.pilot import Pilot, Results, pilot_of
from sleepcast.simulator.bodies.population import Population
from sleepcast.simulator.scenario.population import hatches, sort_constants
from sleepcast.simulator.scenario.robot_settings import TENTH, Ring, RobotSpec
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.sensors import by_link, sonar_sensors
from sleepcast.simulator.scenario.signals import signal_constants
from sleepcast.simulator.simd.formulas import shortest
from sleepcast.simulator.world.torus import PLAIN

TUMBLE = 67.0 * pi / 180.0
"""Angle of a tumble, to one side or the other, as of Hoskins's vehicles."""


Sense = TypeVar("Sense")


class BodySenses(Protocol):
    """What simulates the senses of all bodies of a world."""

    def of(self, kind: type[Sense], /) -> Sense:
        """The part of this kind. Raises KeyError where the world has none."""


class HatchError(SleepcastError):
    """A robot that is stopped was to HATCH or DIE."""


class LackError(SleepcastError):
    """A robot was asked for something that its type does not have."""


class Body:
    """The body of the robot with index `number`. senses: those of all bodies, for the functions that need them."""

    __slots__ = ("_bodies", "model", "number", "senses")

    def __init__(self, bodies: Bodies, senses: BodySenses, model: RobotModel, number: int) -> None:
        self._bodies, self.senses, self.model, self.number = bodies, senses, model, number

    @property
    def stopped(self) -> bool:
        return bool(self._bodies.stopped[self.number])

    def sense(self) -> Reading:
        bodies = self._bodies
        values = bodies.readings([self.number])[0]
        return Reading(bodies.time, tuple(values) if self.reached else (nan,) * len(values))

    @property
    def reached(self) -> bool:
        """Whether its mind reaches it."""
        return not self._bodies.cut_off.size or not self._bodies.cut_off[self.number]

    def act(self, wanted: Setpoint) -> None:
        if not self.reached:
            return
        speed = self._bodies.wanted_speed[self.number] if isnan(wanted.speed) else wanted.speed
        turn = self._bodies.wanted_turn[self.number] if isnan(wanted.turn_rate) else wanted.turn_rate
        if self._bodies.flight is None or not (isnan(wanted.speed) and isnan(wanted.turn_rate)):
            self._drive_on(speed, turn)
        for actuator, value in (("drive_side", wanted.side), ("drive_climb", wanted.climb)):
            if not isnan(value):
                self._bodies.act(actuator, np.array([self.number]), np.array([value]))

    def stop(self) -> None:
        if self.reached:
            self.halt()
        self._bodies.stopped[self.number] = True

    def release(self) -> None:
        self._bodies.stopped[self.number] = False

    def hold(self, still: bool) -> None:
        self._bodies.held[self.number] = still

    def rest_state(self) -> RestState:
        speed, distance = self._bodies.rest_states(np.array([self.number]))
        return RestState(float(speed[0]), float(distance[0]))

    def settle(self) -> None:
        self._bodies.settle(self.number)

    # ---- functions for expressions; see FUNCTIONS

    def drive(self, speed: float, turn_rate: float) -> None:
        self._drive_on(speed, turn_rate)
        if self._bodies.omni[self.number] and not self.stopped:
            self._bodies.wanted_side[self.number] = 0.0

    def _drive_on(self, speed: float, turn_rate: float) -> None:
        """Drive at this speed and turn rate, and to the side as before."""
        bodies, i = self._bodies, self.number
        if not bodies.stopped[i] and bodies.takes_speeds[i]:
            bodies.mode[i] = Mode.DRIVE
            bodies.wanted_speed[i], bodies.wanted_turn[i] = speed, turn_rate

    def go_to(self, x: float, y: float, z: float = nan) -> None:
        if self._bodies.flight is not None:
            self._told(Pilot.go_to, x, y, *(() if isnan(z) else (z,)))
        elif not self.stopped:
            self._bodies.go_to(np.array([self.number]), np.array([x]), np.array([y]))

    def wander(self) -> None:
        if not self._bodies.stopped[self.number]:
            self._bodies.mode[self.number] = Mode.WANDER

    def halt(self) -> None:
        self.drive(0.0, 0.0)
        self._bodies.swing[self.number] = 0.0
        if self._bodies.flight is not None and not self.stopped:
            self._bodies.flight.rest(np.array([self.number]))

    def tumble(self) -> float:
        """Turn by `TUMBLE` to the left (1) or right (-1), at random."""
        bodies, i = self._bodies, self.number
        side = 1.0 if bodies.drawn(f"tumble {bodies.tick}", bodies.numbers[i : i + 1])[0] < 0.5 else -1.0
        if not bodies.stopped[i]:
            bodies.swing[i] = side * TUMBLE
        return side

    def say(self, text: str) -> None:
        self._bodies.speak(self.number, text)

    def turn_wheels(self, right: float, left: float) -> None:
        wheels = self._bodies.part_of(self.number).scenario.robots.wheels
        if wheels is None:
            raise LackError("this robot has no wheels")
        self.drive((right + left) / 2.0, (right - left) / wheels.track)

    def turn_wheels_nomad(self, right: float, left: float) -> None:
        """As `turn_wheels`, in tenths of inches per second."""
        self.turn_wheels(right * TENTH, left * TENTH)

    def sonar(self, which: float) -> float:
        sonars = self._bodies.rings_of(self.number)
        if sonars:
            return float(self._bodies.sonar_ranges([self.number])[0, int(which) % sonars.ring.count])
        return self.nearest(*sector(self._sectors().sonars, which))

    def nearest(self, first: float, last: float) -> float:
        sonars = self._bodies.rings_of(self.number)
        if sonars is None:
            return nearest(self._bodies, self.number, self._sectors().sonar_range, first, last)
        within = np.mod(sonars.cones.axes - first, TURN) <= (
            last - first if last - first >= TURN else np.mod(last - first, TURN)
        )
        ranges = self._bodies.sonar_ranges([self.number])[0, : sonars.ring.count][within]
        return float(ranges.min()) if ranges.size else sonars.ring.most

    def hatch(self, sort: float, count: float, share: float = nan) -> float:
        if self.stopped:
            raise HatchError("this robot is stopped: nothing comes of HATCH until it is released")
        return self._population().hatch(self.number, sort, count, share)

    def die(self) -> None:
        if self.stopped:
            raise HatchError("this robot is stopped: it does not DIE until it is released")
        self._population().die(np.array([self.number]))

    # ---- where robots fly, see `hovering.Hovering`

    def arm(self) -> None:
        self._told(Pilot.arm)

    def disarm(self) -> None:
        self._told(Pilot.disarm)

    def take_off(self, height: float = nan) -> None:
        self._told(Pilot.take_off, *(() if isnan(height) else (height,)))

    def touch_down(self) -> None:
        self._told(Pilot.touch_down)

    def climb(self, speed: float) -> None:
        self._told(Pilot.climb, speed)

    def cut_motors(self) -> None:
        self._told(Pilot.cut_motors)

    def cut_all_motors(self) -> None:
        self._told(Pilot.cut_all_motors)

    def _told(self, command: Callable[..., Results], *numbers: float) -> None:
        """Tell this body alone what many can be told. Raises what it refuses it with."""
        numbers_of_many = (np.array([number]) for number in numbers)
        results = command(pilot_of(self._bodies), np.array([self.number]), *numbers_of_many)
        if results is not None and isinstance(results[0], Exception):
            raise results[0]

    # ---- where robots are particles

    def steer(self, x: float, y: float, z: float) -> None:
        flight = self._bodies.flight
        assert isinstance(flight, Particles)
        if not self.stopped:
            flight.steer(np.array([self.number]), (np.array([x]), np.array([y]), np.array([z])))

    def _population(self) -> Population:
        population = self._bodies.population
        assert population
        return population

    def _sectors(self) -> Geometry:
        geometry = self._bodies.part_of(self.number).geometry
        if not geometry.sonars:
            raise LackError("this robot has no sonars")
        return geometry


class FlyingBody(Body):
    """A body where robots fly, which may be one that lands when nobody drives it any more."""

    __slots__ = ()

    def let_go(self) -> None:
        self.stop()
        self.release()
        if self.reached:
            pilot_of(self._bodies).let_go(np.array([self.number]))


@cache
def _reaching(function: HostFunction) -> HostFunction:
    """This function where links are cut: a fault of a robot whose mind does not reach its body."""

    def call(body: Body, *arguments: Any) -> float | None:
        if not body.reached:
            raise OutOfReachError(DOES_NOTHING)
        return function.call(body, *arguments)

    return replace(function, call=call, many=None, writes=())


def _by_link(scenario: Scenario, functions: Sequence[HostFunction]) -> Iterator[HostFunction]:
    """These functions, by a link that may be cut. All but the emergency stop for all, which a radio carries, and
    what no body does."""
    for each in functions:
        ends = each.call is not Body.cut_all_motors and (each.moves or each.irreversible)
        yield _reaching(each) if scenario.cuts and each.acts and ends else each


def acting(
    name: str, dimension: Dimension, argument: str, doc: str, act: Callable[[BodySenses, Whole, Floats], None]
) -> HostFunction:
    """A function that acts without moving the body.

    name, doc: of the function
    argument, dimension: of the one number that it takes
    act: does it for many bodies of these senses: their indices, and the number of each
    """

    def many(bodies: Any, robots: Whole, numbers: Floats) -> None:
        act(bodies.senses, robots, numbers)

    def call(body: Body, number: float) -> None:
        act(body.senses, np.array([body.number]), np.array([number]))

    return HostFunction(name, call, (dimension,), arguments=argument, doc=doc, many=many, moves=False)


def _by(method: str) -> Callable[..., Any]:
    """The function of many bodies that this method of `Robots` is."""

    def call(bodies: object, *arguments: object) -> object:
        return getattr(bodies, method)(*arguments)

    return call


FUNCTIONS = (
    HostFunction(
        "DRIVE",
        Body.drive,
        (SPEED, RATE),
        arguments="speed turn_rate",
        doc="Drives on at this speed and turn rate.",
        many=_by("drive"),
    ),
    HostFunction(
        "GOTO",
        Body.go_to,
        (LENGTH, LENGTH),
        arguments="x y",
        doc="Drives to a point and stays there.",
        many=_by("go_to"),
    ),
    HostFunction("WANDER", Body.wander, doc="Roams by itself again.", many=_by("wander")),
    HostFunction("ST", Body.halt, doc="Comes to rest.", many=_by("halt")),
    HostFunction(
        "TUMBLE", Body.tumble, result=NONE, doc="Turns by 67 degrees, left or right by chance.", many=_by("tumble")
    ),
    HostFunction("TK", Body.say, arguments='"text"', labelled=True, doc="Says the text aloud.", moves=False),
)
FLIGHT_FUNCTIONS = tuple(
    replace(each, many=_by(each.call.__name__), doc=each.doc.replace("its address", "its type"))
    for each in hovering.functions(Body)
)
"""Where robots fly."""
PARTICLE_FUNCTIONS = (
    HostFunction(
        "STEER",
        Body.steer,
        (None, None, None),
        arguments="x y z",
        doc="Turns towards this direction at its turn rate, until told another one. How long the vector is does not "
        "matter; 0 0 0 is straight on.",
        many=_by("steer"),
    ),
    *(each for each in FUNCTIONS if each.name in ("ST", "TK")),
)
"""Where robots are particles."""
OF_PLANES = {
    **hovering.OF_PLANES,
    "TAKEOFF": "Arms, rolls, climbs straight on, and then circles at this height; without one, at that of its type.",
    "LAND": "Circles down, and rolls out.",
}
"""What these functions do where all are planes."""
EMERGENCY_FUNCTIONS = tuple(
    replace(each, many=_by(each.call.__name__), doc=each.doc.replace("on its radio channel", "in this world"))
    for each in hovering.emergency_functions(Body)
)
"""Where some of them have an emergency stop."""
WHEEL_FUNCTIONS = (
    HostFunction(
        "VM",
        Body.turn_wheels,
        (SPEED, SPEED),
        arguments="right left",
        doc="Turns the right and the left wheel at these speeds.",
        many=_by("turn_wheels"),
    ),
)
NOMAD_FUNCTIONS = (
    replace(
        WHEEL_FUNCTIONS[0],
        call=Body.turn_wheels_nomad,
        dimensions=(NONE, NONE),
        doc="Turns the right and the left wheel at these speeds, in tenths of inches a second.",
        many=_by("turn_wheels_nomad"),
    ),
)
"""The wheel functions in the vocabulary `nomad`."""
POPULATION_FUNCTIONS = (
    HostFunction(
        "HATCH",
        Body.hatch,
        (NONE, NONE, NONE),
        least=2,
        arguments="sort n [share]",
        result=NONE,
        doc="At the end of the tick n robots of this sort come, copies of this one; with a share: of its stores they "
        "get so much together.",
        irreversible=True,
        moves=False,
    ),
    HostFunction("DIE", Body.die, doc="At the end of the tick this robot is gone.", irreversible=True, moves=False),
)
"""Where robots come and go."""
SONAR_FUNCTIONS = (
    HostFunction(
        "SONAR",
        Body.sonar,
        (NONE,),
        arguments="number",
        result=LENGTH,
        acts=False,
        doc="Distance to the nearest thing before this sonar; 0 is in front, then counter-clockwise.",
        many=_by("sonar"),
    ),
    HostFunction(
        "NEAREST",
        Body.nearest,
        (NONE, NONE),
        arguments="from to",
        result=LENGTH,
        acts=False,
        doc="Distance to the nearest thing between two angles, counter-clockwise from the heading.",
        many=_by("nearest"),
    ),
)


def _moving(scenario: Scenario) -> tuple[HostFunction, ...]:
    """The functions of bodies on the ground, where there are any, and of those that fly."""
    if scenario.robots.flight is None:
        return FUNCTIONS
    if scenario.robots.flight.particle:
        return PARTICLE_FUNCTIONS
    flights = [spec.flight for spec in scenario.each_type]
    flies = (*FLIGHT_FUNCTIONS, *(EMERGENCY_FUNCTIONS if any(each and each.cuts for each in flights) else ()))
    names, rolls = {each.name for each in flies}, None in flights
    if all(each and each.stall for each in flights):
        flies = tuple(replace(each, doc=OF_PLANES.get(each.name, each.doc)) for each in flies)
    return (*flies, *(each for each in FUNCTIONS if each.name not in names and (rolls or not each.moves)))


def _lacking(scenario: Scenario, functions: tuple[HostFunction, ...]) -> tuple[HostFunction, ...]:
    """With several robot types, functions that some types may lack are called robot by robot."""
    return tuple(replace(function, many=None) for function in functions) if scenario.sorts else functions


def _reading(ring: Ring) -> tuple[HostFunction, ...]:
    """The functions of sonars that form one ring: the number of a sonar may be known beforehand."""

    def reads(arguments: Sequence[float | None]) -> str:
        (which,) = arguments
        return f"sonar{int(which) % ring.count}" if which is not None and isfinite(which) else ""

    return tuple(replace(each, reads=reads) if each.name == "SONAR" else each for each in SONAR_FUNCTIONS)


def _column(name: str, size: int) -> BodyColumn:
    """The array of `Bodies` of this name."""
    return BodyColumn(name, size, attrgetter(f"bodies.{name}"))


def _writes(scenario: Scenario) -> dict[str, tuple[Writing, ...]]:
    """What those functions write that do nothing else, by name. Bodies move in the next tick, so nobody senses it in
    this one. Of what flies each ends something else besides."""
    if scenario.robots.flight is not None:
        return {}
    stopped, mode = _column("stopped", 1), _column("mode", 1)
    speed, turn = _column("wanted_speed", 8), _column("wanted_turn", 8)
    straight = (Writing(_column("wanted_side", 8), unless=stopped),) if scenario.robots.omni else ()
    driving = (Writing(mode, value=float(Mode.DRIVE), unless=stopped), *straight)
    going = (
        Writing(mode, value=float(Mode.GOTO), unless=stopped),
        Writing(_column("target_x", 8), 0, unless=stopped, low=0.0, high=scenario.width),
        Writing(_column("target_y", 8), 1, unless=stopped, low=0.0, high=scenario.height),
    )
    resting = (*driving, Writing(speed, unless=stopped), Writing(turn, unless=stopped))
    return {
        "DRIVE": (*driving, Writing(speed, 0, unless=stopped), Writing(turn, 1, unless=stopped)),
        "GOTO": going if scenario.around == PLAIN else (),  # a torus divides by size
        "WANDER": (Writing(mode, value=float(Mode.WANDER), unless=stopped),),
        "ST": (*resting, Writing(_column("swing", 8))),
    }


def _sideways(robots: RobotSpec) -> tuple[Quantity, ...]:
    """The actuators of what moves in every direction."""
    if robots.flight:
        return hovering.actuators(robots.limits)[2:]
    most, unit = robots.limits.speed, robots.speed_unit
    side = Quantity("drive_side", "m/s", -most, most, doc="drives at this speed to its left", shown_as=unit)
    return (side,) if robots.omni else ()


def model_of(
    scenario: Scenario,
    sensors: tuple[Quantity, ...],
    functions: tuple[HostFunction, ...] = (),
    actuators: tuple[Quantity, ...] = (),
) -> RobotModel:
    """The common model of all robots of the scenario. sensors: but those of sonars. functions, actuators: of their
    senses and their payload."""
    robots = scenario.robots
    speed, turn = robots.limits.speed, robots.limits.turn_rate
    wheels = NOMAD_FUNCTIONS if scenario.nomad else WHEEL_FUNCTIONS
    writes = _writes(scenario)
    sonars = _reading(robots.ring) if robots.ring and not scenario.sorts else SONAR_FUNCTIONS
    return RobotModel(
        robots.type,
        sensors=by_link(
            scenario, (*sensors, *(sonar_sensors(robots.ring, scenario.length_unit) if robots.ring else ()))
        ),
        actuators=(
            *(
                Quantity("drive_speed", "m/s", -speed, speed, doc="drives at this speed", shown_as=robots.speed_unit),
                Quantity("drive_turn", "rad/s", -turn, turn, doc="turns at this rate", shown_as="deg/s"),
                *_sideways(robots),
            )[: 1 if robots.flight and robots.flight.particle else None]
            * any(spec.flight is None or not spec.flight.stall for spec in scenario.each_type),
            *actuators,
        ),
        functions=(
            *_by_link(scenario, [replace(each, writes=writes.get(each.name, ())) for each in _moving(scenario)]),
            *_by_link(scenario, _lacking(scenario, wheels if robots.wheels else ())),
            *_lacking(scenario, sonars if robots.geometry.sonars else ()),
            *(POPULATION_FUNCTIONS if hatches(scenario) else ()),
            *functions,
        ),
        limits=robots.limits,
        geometry=robots.geometry,
        constants=(
            *signal_constants(scenario.lights, scenario.pings),
            *scenario.constants,
            *sort_constants(scenario),
        ),
        areas=scenario.areas,
    )


# Sonar of the first simulator: the exact distance to the nearest other robot in a sector.


def nearest(bodies: Bodies, number: int, reach: float, first: float, last: float) -> float:
    """Distance from robot `number`, on the ground, to the nearest other one as low, between the angles `first` and
    `last` (rad, counter-clockwise from its heading, counted from first to last), m; `reach` if there is none nearer."""
    around_x, around_y = bodies.scenario.around
    dx, dy = shortest(bodies.x - bodies.x[number], around_x), shortest(bodies.y - bodies.y[number], around_y)
    away = np.sqrt(dx * dx + dy * dy) - (bodies.radii + bodies.radii[number])
    away[number] = np.inf
    if bodies.population is not None:
        away[~bodies.population.present] = np.inf
    if bodies.flight is not None:
        away[~bodies.flight.low(bodies.x, bodies.y)] = np.inf
    near = np.flatnonzero(away < reach)
    width = last - first
    if width < TURN:
        bearing = np.arctan2(dy[near], dx[near]) - bodies.heading[number]
        at_one_place = (dx[near] == 0.0) & (dy[near] == 0.0)  # which is no direction: it is in every sector
        near = near[at_one_place | (np.mod(bearing - first, TURN) <= width % TURN)]
    return max(0.0, float(away[near].min())) if near.size else reach


def sector(sonars: int, which: float) -> tuple[float, float]:
    """The sector of sonar `which` out of `sonars`: number 0 looks ahead, the others follow
    counter-clockwise."""
    middle = (int(which) % sonars) * TURN / sonars
    return middle - pi / sonars, middle + pi / sonars
