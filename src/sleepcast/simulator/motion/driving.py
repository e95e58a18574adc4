"""How one body drives, as formulas that hold for arrays and, within compiled kernels, for one body: to the same bits.

What a body wants becomes a wanted speed and turn rate, the limits cut it, and two wheels make an arc of it. While both
wheels keep their speed the middle of a body moves on an arc: it turns by (right - left) / track, and the straight line
to where it gets is the way of the middle times sin(h) / h, at half the turn h. That is exact.
"""

from __future__ import annotations

from math import inf, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simd.formulas import arc_tangent, either, sine_cosine, wrap
from sleepcast.simulator.world.grid import Floats

BRAKING = 0.8
"""Share of the acceleration that an approach to a point counts on, so that there is some left to correct
with."""
AT_ONCE = 1e9
"""rad/s2 of a craft without wheels, which has no inertia in turning."""
MOST_SLIP = 1.0
"""Share of a wheel's way that slip may add or take in one tick, so that no body gets farther than it could reach."""
WANDER, DRIVE, GOTO = 0, 1, 2
"""What moves a body, see `bodies.Mode`."""


class Laws(NamedTuple):
    """What holds for the bodies of one type, SI.

    tick: s. speed, turn_rate, acceleration: the limits; turn_acceleration: how fast the turn rate can change. radius:
    m. track: between the wheels, m, 0 without wheels; slip_left, slip_right, slip_noise: see `robot_settings.Wheels`.
    roam_speed: of wandering; kept: share of the turn rate of a wandering body that a tick leaves; strayed: the standard
    deviation of what it adds. left, bottom, right, top: no body gets beyond; margin: m before that where a body turns
    back, negative where it does not. parts: of the bumper.
    """

    tick: float
    speed: float
    turn_rate: float
    acceleration: float
    turn_acceleration: float
    radius: float
    track: float
    slip_left: float
    slip_right: float
    slip_noise: float
    roam_speed: float
    kept: float
    strayed: float
    left: float
    bottom: float
    right: float
    top: float
    margin: float
    parts: float

    @property
    def slips(self) -> bool:
        """Whether the wheels lead elsewhere than the encoders believe."""
        return bool(self.slip_left or self.slip_right or self.slip_noise)


def laws_of(scenario: Scenario) -> Laws:
    """What holds for the robots of a scenario."""
    robots, tick = scenario.robots, scenario.tick
    limits, wheels, wander = robots.limits, robots.wheels, robots.wander
    kept = max(0.0, 1.0 - tick / wander.steadiness)  # an Ornstein-Uhlenbeck process, one step of Euler's method
    margin = min(limits.speed / limits.turn_rate, 0.1 * scenario.width, 0.1 * scenario.height)
    return Laws(
        tick=tick,
        speed=limits.speed,
        turn_rate=limits.turn_rate,
        acceleration=limits.acceleration,
        turn_acceleration=2.0 * limits.acceleration / wheels.track if wheels else AT_ONCE,
        radius=robots.geometry.radius,
        track=wheels.track if wheels else 0.0,
        slip_left=wheels.slip_left if wheels else 0.0,
        slip_right=wheels.slip_right if wheels else 0.0,
        slip_noise=wheels.slip_noise if wheels else 0.0,
        roam_speed=wander.speed,
        kept=kept,
        strayed=wander.turn_rate * sqrt(1.0 - kept * kept),
        left=0.0,
        bottom=0.0,
        right=scenario.width,
        top=scenario.height,
        margin=margin if scenario.fenced else -1.0,
        parts=float(robots.bumpers),
    )


def bounded(value: Floats, low: Floats | float, high: Floats | float) -> Floats:
    """`value`, or the bound that it is beyond."""
    return either(value < low, low, either(value > high, high, value))


def approach(laws: Laws, across: Floats, up: Floats, heading: Floats) -> tuple[Floats, Floats]:
    """Speed and turn rate of a body with this `heading` that wants to get to a point `across` and `up` from it, m, and
    to stay there."""
    away = np.sqrt(across * across + up * up)
    error = wrap(arc_tangent(up, across) - heading)
    size = np.abs(error)
    # A circle through the point: driven faster, the tightest turn would pass it by. One behind takes half a turn.
    bend = either(size < pi / 2, np.abs(sine_cosine(error)[0]), 1.0)
    turning = either(bend > 0.0, laws.turn_rate * away / (2.0 * either(bend > 0.0, bend, 1.0)), inf)
    braking = np.sqrt(2.0 * BRAKING * laws.acceleration * away)
    fastest = either(turning < braking, turning, braking)
    fastest = either(away / laws.tick < fastest, away / laws.tick, fastest)
    # Wheels need time to end a turn, as they do to end a way.
    ending = np.sqrt(2.0 * BRAKING * laws.turn_acceleration * size)
    there = away <= laws.radius
    return either(there, 0.0, fastest), either(there, 0.0, bounded(error / laws.tick, -ending, ending))


def tumbling(laws: Laws, swing: Floats) -> Floats:
    """The turn rate of a body on wheels that is to turn by `swing` rad and no farther: as fast as it may and yet can
    come to rest there with even braking, in ticks (see `motors`). One wheel brakes for two, as the other one of a body
    that drives as fast as it can is at its limit."""
    change, size = laws.acceleration * laws.tick / laws.track, np.abs(swing) / laws.tick
    braking = np.floor((np.sqrt(1.0 + 8.0 * size / change) - 1.0) / 2.0)
    fastest = bounded(size / (braking + 1.0) + change * braking / 2.0, 0.0, laws.turn_rate)
    return either(swing < 0.0, -fastest, fastest)


def swing_left(laws: Laws, swing: Floats, left: Floats, right: Floats, speed: Floats, turn: Floats) -> Floats:
    """What is left of a `swing` after a tick, in which wheels that turn at `left` and `right` m/s follow the wanted
    speed and turn rate. It is over where another turn is wanted: at the fence."""
    next_left, next_right = wheels_follow(laws, left, right, speed, turn)
    rest = swing - (next_right - next_left) / laws.track * laws.tick
    return either((np.abs(rest) < 1e-9) | (turn != tumbling(laws, swing)), 0.0, rest)


def turned_back(laws: Laws, x: Floats, y: Floats, heading: Floats, speed: Floats, turn: Floats) -> Floats:
    """The turn rate of a body near the fence: as fast as it can until it drives towards the middle of the world."""
    middle = arc_tangent((laws.bottom + laws.top) / 2 - y, (laws.left + laws.right) / 2 - x)
    error = wrap(middle - heading - either(speed < 0.0, pi, 0.0))
    back = either(error < 0.0, -laws.turn_rate, laws.turn_rate)
    return either(np.abs(error) > pi / 4, back, turn)


def outside(laws: Laws, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether a body is within the margin of the fence."""
    beside = (x <= laws.left + laws.margin) | (x >= laws.right - laws.margin)
    return beside | (y <= laws.bottom + laws.margin) | (y >= laws.top - laws.margin)


def wheels_follow(laws: Laws, left: Floats, right: Floats, speed: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """The speeds of wheels, m/s, that follow the wanted speed and turn rate for one tick, as far as they can."""
    half = laws.track / 2.0
    rate = min(laws.turn_rate, laws.speed / half)
    aside = bounded(turn, -rate, rate) * half
    most = laws.speed - np.abs(aside)  # turning comes first: a body that cannot turn cannot avoid anything
    speed = bounded(speed, -most, most)
    change = laws.acceleration * laws.tick
    return left + bounded(speed - aside - left, -change, change), right + bounded(
        speed + aside - right, -change, change
    )


def slipped(laws: Laws, way: Floats, bias: float, deviate: Floats | float) -> Floats:
    """The way of a wheel that seems to go `way` m; its noise gathers with the root of the way."""
    size = np.abs(way)
    root = np.sqrt(either(size > 1e-12, size, 1e-12))
    return way * (1.0 + bounded(bias + laws.slip_noise * deviate / root, -MOST_SLIP, MOST_SLIP))


def arc(laws: Laws, left: Floats, right: Floats, heading: Floats) -> tuple[Floats, Floats, Floats]:
    """How far across, up (m) and round (rad) a body gets whose wheels go `left` and `right` m, from a `heading`."""
    turn = (right - left) / laws.track
    half = turn / 2.0
    still = half == 0.0
    chord = (left + right) / 2.0 * either(still, 1.0, sine_cosine(half)[0] / either(still, 1.0, half))
    sine, cosine = sine_cosine(heading + half)
    return chord * cosine, chord * sine, turn


def touched_part(laws: Laws, across: Floats, up: Floats, heading: Floats) -> Floats:
    """The number of the part of the bumper that something touches, which lies `across` and `up` from the body."""
    place = np.floor((arc_tangent(up, across) - heading) * (laws.parts / (2.0 * pi)) + 0.5)
    return 1.0 + (place - laws.parts * np.floor(place / laws.parts))


FORMULAS = (
    *(bounded, approach, tumbling, turned_back, outside),
    *(wheels_follow, swing_left, slipped, arc, touched_part),
)
