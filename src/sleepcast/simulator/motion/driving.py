"""How one body drives, as formulas for arrays and, within compiled kernels, for one body, bit-identical.

A command becomes a wanted speed and turn rate, the limits clamp them, and two wheels turn them into an arc. While
both wheels keep their speed the centre of a body moves on an arc: it turns by (right - left) / track, and the chord
is the centre's path length times sin(h) / h, with h half the turn. This is exact.
"""

from __future__ import annotations

from math import inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple
from sleepcast.simulator.scenario.robot_settings import Wheels
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simd.formulas import arc_tangent, either, sine_cosine, wrap
from sleepcast.simulator.world.grid import Floats

BRAKING = 0.8
"""Share of the acceleration that an approach to a point plans with; the rest is for corrections."""
AT_ONCE = 1e9
"""Turn acceleration of a body without wheels, which turns without inertia, rad/s2."""
MAX_SLIP = 1.0
"""Share of a wheel's path that slip may add or remove in one tick, so that bodies stay within the reach assumed for
contact."""
TINIEST = 1e-300
"""A slip too small to change any number. Any slip makes the simulator track the true pose apart from the odometry;
without it, correcting the encoders would turn the body."""
WANDER, DRIVE, GOTO = 0, 1, 2
"""What moves a body, see `bodies.Mode`."""


class Laws(NamedTuple):
    """Parameters common to the bodies of one type, SI.

    tick: s
    speed, turn_rate, acceleration: the limits
    turn_acceleration: largest change of the turn rate
    radius: m
    track: between the wheels, m, 0 without wheels
    slip_left, slip_right, slip_noise: see `robot_settings.Wheels`
    roam_speed: of wandering
    retained: share of a wandering body's turn rate that remains after a tick
    strayed: standard deviation of what a tick adds
    left, bottom, right, top: edges that no body passes
    margin: distance from them at which a body turns back, m, negative if it does not
    around_x, around_y: see `torus`
    parts: of the bumper
    slides: 1 if bodies slide along what they touch, 0 if they stop there
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
    retained: float
    strayed: float
    left: float
    bottom: float
    right: float
    top: float
    margin: float
    around_x: float
    around_y: float
    parts: float
    slides: float

    @property
    def slips(self) -> bool:
        """Whether the true path differs from the odometry."""
        return bool(self.slip_left or self.slip_right or self.slip_noise)


def laws_of(scenario: Scenario) -> Laws:
    """The parameters for the robots of a scenario."""
    robots, tick = scenario.robots, scenario.tick
    limits, wheels, wander = robots.limits, robots.wheels, robots.wander
    retained = max(0.0, 1.0 - tick / wander.steadiness)  # an Ornstein-Uhlenbeck process, one Euler step
    margin = min(limits.speed / limits.turn_rate, 0.1 * scenario.width, 0.1 * scenario.height)
    return Laws(
        tick=tick,
        speed=limits.speed,
        turn_rate=limits.turn_rate,
        acceleration=limits.acceleration,
        turn_acceleration=2.0 * limits.acceleration / wheels.track if wheels else AT_ONCE,
        radius=robots.geometry.radius,
        track=wheels.track if wheels else 0.0,
        slip_left=_slip_left(wheels) if wheels else 0.0,
        slip_right=wheels.slip_right if wheels else 0.0,
        slip_noise=wheels.slip_noise if wheels else 0.0,
        roam_speed=wander.speed,
        retained=retained,
        strayed=wander.turn_rate * sqrt(1.0 - retained * retained),
        left=-inf if scenario.torus else 0.0,
        bottom=-inf if scenario.torus else 0.0,
        right=inf if scenario.torus else scenario.width,
        top=inf if scenario.torus else scenario.height,
        margin=margin if scenario.fenced else -1.0,
        around_x=scenario.around[0],
        around_y=scenario.around[1],
        parts=float(robots.bumpers),
        slides=float(robots.slides),
    )


def _slip_left(wheels: Wheels) -> float:
    """The slip of the left wheel. Encoders that count steps need the true pose apart from the odometry."""
    exact = not wheels.counts or wheels.slip_left or wheels.slip_right or wheels.slip_noise
    return wheels.slip_left if exact else TINIEST


def bounded(value: Floats, low: Floats | float, high: Floats | float) -> Floats:
    """`value` clamped to `low`..`high`."""
    return either(value < low, low, either(value > high, high, value))


def approach(laws: Laws, dx: Floats, dy: Floats, heading: Floats) -> tuple[Floats, Floats]:
    """Speed and turn rate of a body with this `heading` that drives to a point `dx` and `dy` from it, m, and stops
    there."""
    away = np.sqrt(dx * dx + dy * dy)
    error = wrap(arc_tangent(dy, dx) - heading)
    size = np.abs(error)
    # On a circle through the point: any faster, even the tightest turn would miss it. For a point behind, half a turn.
    bend = either(size < pi / 2, np.abs(sine_cosine(error)[0]), 1.0)
    turning = either(bend > 0.0, laws.turn_rate * away / (2.0 * either(bend > 0.0, bend, 1.0)), inf)
    braking = np.sqrt(2.0 * BRAKING * laws.acceleration * away)
    fastest = either(turning < braking, turning, braking)
    fastest = either(away / laws.tick < fastest, away / laws.tick, fastest)
    # Wheels need time to end a turn, just as they need time to stop.
    ending = np.sqrt(2.0 * BRAKING * laws.turn_acceleration * size)
    arrived = away <= laws.radius
    return either(arrived, 0.0, fastest), either(arrived, 0.0, bounded(error / laws.tick, -ending, ending))


def tumbling(laws: Laws, swing: Floats) -> Floats:
    """The turn rate of a body on wheels that is to turn by exactly `swing` rad: the fastest from which even braking, in
    whole ticks, still stops there. One wheel may have to brake for both, since the other one is at its limit on a body
    at full speed."""
    change, size = laws.acceleration * laws.tick / laws.track, np.abs(swing) / laws.tick
    braking = np.floor((np.sqrt(1.0 + 8.0 * size / change) - 1.0) / 2.0)
    fastest = bounded(size / (braking + 1.0) + change * braking / 2.0, 0.0, laws.turn_rate)
    return either(swing < 0.0, -fastest, fastest)


def swing_left(laws: Laws, swing: Floats, left: Floats, right: Floats, speed: Floats, turn: Floats) -> Floats:
    """The rest of a `swing` after a tick in which wheels at `left` and `right` m/s follow the wanted speed and turn
    rate; 0 if another turn has taken over, at the fence."""
    next_left, next_right = wheels_follow(laws, left, right, speed, turn)
    rest = swing - (next_right - next_left) / laws.track * laws.tick
    return either((np.abs(rest) < 1e-9) | (turn != tumbling(laws, swing)), 0.0, rest)


def spinning(laws: Laws, swing: Floats) -> Floats:
    """As `tumbling`, for a body without wheels."""
    return bounded(swing / laws.tick, -laws.turn_rate, laws.turn_rate)


def spin_left(laws: Laws, swing: Floats) -> Floats:
    """As `swing_left`, for a body without wheels: nothing takes over its turn."""
    rest = swing - spinning(laws, swing) * laws.tick
    return either(np.abs(rest) < 1e-9, 0.0, rest)


def turned_back(laws: Laws, x: Floats, y: Floats, heading: Floats, speed: Floats, turn: Floats) -> Floats:
    """The turn rate of a body near the fence: the fastest possible until it drives towards the middle of the world."""
    middle = arc_tangent((laws.bottom + laws.top) / 2 - y, (laws.left + laws.right) / 2 - x)
    error = wrap(middle - heading - either(speed < 0.0, pi, 0.0))
    back = either(error < 0.0, -laws.turn_rate, laws.turn_rate)
    return either(np.abs(error) > pi / 4, back, turn)


def outside(laws: Laws, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether a body is within the margin of the fence."""
    beside = (x <= laws.left + laws.margin) | (x >= laws.right - laws.margin)
    return beside | (y <= laws.bottom + laws.margin) | (y >= laws.top - laws.margin)


def wheels_follow(laws: Laws, left: Floats, right: Floats, speed: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """New wheel speeds, m/s, after following the wanted speed and turn rate for one tick, within the limits."""
    half = laws.track / 2.0
    rate = min(laws.turn_rate, laws.speed / half)
    aside = bounded(turn, -rate, rate) * half
    most = laws.speed - np.abs(aside)  # turning has priority: a body that cannot turn cannot avoid anything
    speed = bounded(speed, -most, most)
    change = laws.acceleration * laws.tick
    return left + bounded(speed - aside - left, -change, change), right + bounded(
        speed + aside - right, -change, change
    )


def slipped(laws: Laws, way: Floats, bias: float, deviate: Floats | float) -> Floats:
    """The true path of a wheel that appears to roll `way` m; its noise grows with the square root of the path."""
    size = np.abs(way)
    root = np.sqrt(either(size > 1e-12, size, 1e-12))
    return way * (1.0 + bounded(bias + laws.slip_noise * deviate / root, -MAX_SLIP, MAX_SLIP))


def arc(laws: Laws, left: Floats, right: Floats, heading: Floats) -> tuple[Floats, Floats, Floats]:
    """Displacement in x and y (m) and turn (rad) of a body whose wheels roll `left` and `right` m, starting from
    `heading`."""
    turn = (right - left) / laws.track
    half = turn / 2.0
    still = half == 0.0
    chord = (left + right) / 2.0 * either(still, 1.0, sine_cosine(half)[0] / either(still, 1.0, half))
    sine, cosine = sine_cosine(heading + half)
    return chord * cosine, chord * sine, turn


def glided(
    laws: Laws, before: Floats, speed: Floats, turn: Floats, heading: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """The speed (m/s) of a body without wheels after one tick, from the one `before` it, and its displacement in x and
    y (m) and turn (rad)."""
    most = laws.acceleration * laws.tick
    after = before + bounded(bounded(speed, -laws.speed, laws.speed) - before, -most, most)
    turned = bounded(turn, -laws.turn_rate, laws.turn_rate) * laws.tick
    way = after * laws.tick
    sine, cosine = sine_cosine(heading + turned)
    return after, way * cosine, way * sine, turned


def touched_part(laws: Laws, dx: Floats, dy: Floats, heading: Floats) -> Floats:
    """The number of the bumper segment touched by a thing that lies `dx` and `dy` from the body."""
    part = np.floor((arc_tangent(dy, dx) - heading) * (laws.parts / (2.0 * pi)) + 0.5)
    return 1.0 + (part - laws.parts * np.floor(part / laws.parts))


FORMULAS = (
    *(bounded, approach, tumbling, turned_back, outside),
    *(wheels_follow, swing_left, slipped, arc, spinning, spin_left, glided, touched_part),
)
