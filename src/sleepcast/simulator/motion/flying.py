"""How bodies fly that hover: formulas for arrays, one number for each body, and for compiled kernels. SI.

What is wanted becomes a velocity over the ground and a climb rate. The edges of the world, floor and ceiling bring both
to what can still come to rest before them; then both change no faster than the acceleration allows.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple
from sleepcast.robot import BRAKING
from sleepcast.robot.hovering import FASTEST_CLIMB
from sleepcast.simulator.motion.driving import bounded
from sleepcast.simulator.scenario.flight import GRAVITY
from sleepcast.simulator.simd.formulas import either, rotated, sine_cosine
from sleepcast.simulator.world.grid import Floats

Flags = NDArray[np.bool_]

FASTEST = 1e100
"""m/s that may be wanted of a body: the square of a greater speed is no number."""
LANDS = -np.inf
"""The height to which a body goes that lands."""
AT_FENCE = 1e-3
"""m to an edge within which a body counts as at its fence: before it, it still comes nearer."""


class VectorLaws(Protocol):
    """The limits of what moves in every direction, one for all bodies or one for each; see `robot.Limits`. tick: s."""

    @property
    def speed(self) -> Floats | float: ...

    @property
    def acceleration(self) -> Floats | float: ...

    @property
    def tick(self) -> float: ...


class FlightLaws(NamedTuple):
    """Of each body its limits, see `robot.Limits`, and `sink`, its climb rate in a landing, downwards.

    edges: left, bottom, right and top ones between which it flies, m, infinite where there are none
    tick: s
    """

    speed: Floats
    turn_rate: Floats
    acceleration: Floats
    climb: Floats
    sink: Floats
    floor: Floats
    ceiling: Floats
    edges: tuple[Floats, Floats, Floats, Floats]
    tick: float


class TypeLaws(NamedTuple):
    """For kernels: the `FlightLaws` of all bodies of one type, one number of each, and the size of a torus, m, infinite
    without one."""

    speed: float
    turn_rate: float
    acceleration: float
    climb: float
    sink: float
    floor: float
    ceiling: float
    edges: tuple[float, float, float, float]
    tick: float
    around_x: float
    around_y: float


class FlightColumns(NamedTuple):
    """The state of bodies, those that fly among them, as `bodies.Bodies` and `bodies.flight.Flight` describe it, which
    is changed in place. way_x, way_y, way_z: see `Flight.way`; the last four: see `air.Air`, empty where it stands
    still."""

    mode: NDArray[np.int8]
    held: Flags
    wanted_speed: Floats
    wanted_turn: Floats
    wanted_side: Floats
    wanted_climb: Floats
    target_x: Floats
    target_y: Floats
    target_z: Floats
    x: Floats
    y: Floats
    z: Floats
    heading: Floats
    velocity_x: Floats
    velocity_y: Floats
    climb_rate: Floats
    armed: Floats
    flying: Floats
    height: Floats
    speed: Floats
    turn_rate: Floats
    way_x: Floats
    way_y: Floats
    way_z: Floats
    stores: Floats
    wind_east: Floats
    wind_north: Floats
    anchor_x: Floats
    anchor_y: Floats


class Power(NamedTuple):
    """What flying takes of the stores of bodies of one type.

    uses: of each store for a metre over the ground
    ends: whether who has used it up comes down
    battery: the number of the store that hovering and climbing use up, below 0 for none
    per_second, per_climb: how much of it they do, for a second and for a metre
    """

    uses: Floats
    ends: Flags
    battery: int
    per_second: float
    per_climb: float


def speed_before(laws: VectorLaws, room: Floats) -> Floats:
    """See `Limits.speed_before`, for a lag of one tick."""
    some = either((room > 0.0) & (room < np.inf), room, 0.0)
    lag = laws.tick
    speed = 2.0 * some / (lag + np.sqrt(lag * lag + 2.0 * some / (BRAKING * laws.acceleration)))
    return either(room == np.inf, np.inf, speed)


def driven(laws: VectorLaws, heading: Floats, ahead: Floats, side: Floats) -> tuple[Floats, Floats]:
    """The velocity of a body that goes at these speeds ahead and to its left: the limit is that of the vector."""
    ahead, side = shortened(laws, ahead, side)
    sine, cosine = sine_cosine(heading)
    return rotated(ahead, side, sine, cosine)


def shortened(laws: VectorLaws, ahead: Floats, side: Floats) -> tuple[Floats, Floats]:
    """These speeds ahead and to the left, in the same direction, as far as the limit of speed allows."""
    ahead, side = bounded(ahead, -FASTEST, FASTEST), bounded(side, -FASTEST, FASTEST)
    share = np.sqrt(ahead * ahead + side * side) / laws.speed
    share = either(share > 1.0, share, 1.0)
    return ahead / share, side / share


def homed(laws: VectorLaws, dx: Floats, dy: Floats) -> tuple[Floats, Floats]:
    """The velocity of a body on its way to a place `dx` and `dy` from it, where it comes to rest."""
    away = np.sqrt(dx * dx + dy * dy)
    speed = _least(_least(speed_before(laws, away), laws.speed), away / laws.tick)
    share = speed / either(away > 0.0, away, 1.0)
    return dx * share, dy * share


def within_edges(laws: FlightLaws, x: Floats, y: Floats, east: Floats, north: Floats) -> tuple[Floats, Floats]:
    """The velocity nearest to this one that can come to rest before the edges."""
    left, bottom, right, top = laws.edges
    return (
        bounded(east, -speed_before(laws, x - left), speed_before(laws, right - x)),
        bounded(north, -speed_before(laws, y - bottom), speed_before(laws, top - y)),
    )


def kept_within(laws: FlightLaws, x: Floats, y: Floats, way_x: Floats, way_y: Floats) -> tuple[Floats, Floats]:
    """Where a body comes to by this way, m, which does not lead beyond the edges; one that is beyond them may stay."""
    left, bottom, right, top = laws.edges
    return (
        bounded(x + way_x, _least(x, left), _most(x, right)),
        bounded(y + way_y, _least(y, bottom), _most(y, top)),
    )


def steered(laws: VectorLaws, before: tuple[Floats, Floats], wanted: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """The velocity after a tick in which the one `before` became the wanted one, as far as acceleration allows."""
    dx, dy = wanted[0] - before[0], wanted[1] - before[1]
    change, most = np.sqrt(dx * dx + dy * dy), laws.acceleration * laws.tick
    fast = change > most
    share = either(fast, most / either(fast, change, 1.0), 1.0)
    return before[0] + share * dx, before[1] + share * dy


def reached(laws: VectorLaws, wind: tuple[Floats, Floats], east: Floats, north: Floats) -> tuple[Floats, Floats]:
    """The velocity over the ground nearest to this one that a body reaches in this wind."""
    wind_x, wind_y = wind
    air_x, air_y = east - wind_x, north - wind_y
    share = np.sqrt(air_x * air_x + air_y * air_y) / laws.speed
    fast = share > 1.0
    share = either(fast, share, 1.0)
    return either(fast, wind_x + air_x / share, east), either(fast, wind_y + air_y / share, north)


def climbed(laws: FlightLaws, height: Floats, above_ground: Floats, wanted: Floats) -> Floats:
    """The climb rate nearest to the wanted one that comes to rest before the ceiling, which counts from the ground, or
    the floor, which counts from what lies below: `height` m under the body."""
    most = _least(laws.climb, speed_before(laws, laws.ceiling - above_ground))
    least = _least(laws.climb, speed_before(laws, height - laws.floor))
    return bounded(wanted, -least, most)


def raised(laws: FlightLaws, rest: Floats) -> Floats:
    """The climb rate of a body that is `rest` m below where it is to hover; negative above."""
    away = np.abs(rest)
    rate = _least(_least(laws.climb, speed_before(laws, away)), away / laws.tick)
    return either(rest < 0.0, -rate, rate)


def lifted(laws: FlightLaws, before: Floats, wanted: Floats) -> Floats:
    """The climb rate after a tick in which the one `before` became the wanted one, as far as acceleration allows."""
    most = laws.acceleration * laws.tick
    return before + bounded(wanted - before, -most, most)


def turned(laws: FlightLaws, turns: Flags, wanted: Floats) -> Floats:
    """rad by which a body turns that is to turn at this rate, if it turns at all."""
    return either(turns, bounded(wanted, -laws.turn_rate, laws.turn_rate) * laws.tick, 0.0)


def climb_for(laws: FlightLaws, target: Floats, rest: Floats, otherwise: Floats) -> Floats:
    """The climb rate that leads a body to its target height, `rest` m above it, or down where that is `LANDS`; without
    one another rate."""
    there = (target > LANDS) & (target < np.inf)
    wanted = either(there, raised(laws, either(there, rest, 0.0)), otherwise)
    return either(target == LANDS, -laws.sink, wanted)


def fallen(laws: FlightLaws, before: Floats) -> Floats:
    """The climb rate of a body that falls, after a tick."""
    return _most(before - GRAVITY * laws.tick, -FASTEST_CLIMB)


def left_of(store: Floats, used: Floats) -> Floats:
    """What is left of a store after so much of it was used."""
    return _most(store - used, 0.0)


def _least(one: Floats, other: Floats | float) -> Floats:
    return either(other < one, other, one)


def _most(one: Floats, other: Floats | float) -> Floats:
    return either(other > one, other, one)


FORMULAS = (
    *(speed_before, driven, shortened, homed, within_edges, kept_within, steered, climbed, raised, lifted),
    *(turned, reached, climb_for, fallen, left_of, _least, _most),
)
"""What kernels call."""
