"""How bodies fly that hover: formulas for arrays, one number for each body. SI.

What is wanted becomes a velocity over the ground and a climb rate. The edges of the world, floor and ceiling bring both
to what can still come to rest before them; then both change no faster than the acceleration allows.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from sleepcast.core.records import NamedTuple
from sleepcast.robot import BRAKING
from sleepcast.simulator.motion.driving import bounded
from sleepcast.simulator.simd.formulas import either, rotated, sine_cosine
from sleepcast.simulator.world.grid import Floats

FASTEST = 1e100
"""m/s that may be wanted of a body: the square of a greater speed is no number."""


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


def speed_before(laws: VectorLaws, room: Floats) -> Floats:
    """See `Limits.speed_before`, for a lag of one tick."""
    room = either(room > 0.0, room, 0.0)
    lag = laws.tick
    with np.errstate(invalid="ignore"):
        speed = 2.0 * room / (lag + np.sqrt(lag * lag + 2.0 * room / (BRAKING * laws.acceleration)))
    return either(room == np.inf, np.inf, speed)


def driven(laws: VectorLaws, heading: Floats, ahead: Floats, side: Floats) -> tuple[Floats, Floats]:
    """The velocity of a body that goes at these speeds ahead and to its left: the limit is that of the vector."""
    return rotated(*shortened(laws, ahead, side), *sine_cosine(heading))


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
        bounded(x + way_x, np.minimum(left, x), np.maximum(right, x)),
        bounded(y + way_y, np.minimum(bottom, y), np.maximum(top, y)),
    )


def steered(laws: VectorLaws, before: tuple[Floats, Floats], wanted: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """The velocity after a tick in which the one `before` became the wanted one, as far as acceleration allows."""
    dx, dy = wanted[0] - before[0], wanted[1] - before[1]
    change, most = np.sqrt(dx * dx + dy * dy), laws.acceleration * laws.tick
    fast = change > most
    share = either(fast, most / either(fast, change, 1.0), 1.0)
    return before[0] + share * dx, before[1] + share * dy


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


def _least(one: Floats, other: Floats | float) -> Floats:
    return either(other < one, other, one)
