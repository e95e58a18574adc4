"""Differential drive: two wheels that keep their limits, what the encoders make of them, and where they really lead.

While both wheels keep their speed the middle of a body moves on an arc: it turns by (right - left) / track, and the
straight line to where it gets is the way of the middle times sin(h) / h, at half the turn h. That is exact.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from sleepcast.channel.chance import key, uniform
from sleepcast.simulator.bodies import TURN, Bodies, Floats
from sleepcast.simulator.robot_settings import Wheels

MOST_SLIP = 1.0
"""Share of a wheel's way that slip may add or take in one tick, so that no body gets farther than it could reach."""


class Step(NamedTuple):
    """One body's step in a frame of its own choice: across and up, m, and turn, rad."""

    across: Floats
    up: Floats
    turn: Floats


def roll(bodies: Bodies, wheels: Wheels, speed: Floats, turn: Floats, tick: float) -> tuple[Step, Step]:
    """Let the wheels follow the wanted speed (m/s) and turn rate (rad/s) for one tick, as far as they can.

    Gives what the encoders see, in their own frame, and what the bodies do, in the world's.
    """
    limits = bodies.limits
    rate = min(limits.turn_rate, limits.speed / (wheels.track / 2.0))
    aside = np.clip(turn, -rate, rate) * (wheels.track / 2.0)
    left_over = limits.speed - np.abs(aside)  # turning comes first: a body that cannot turn cannot avoid anything
    speed = np.clip(speed, -left_over, left_over)
    most = limits.acceleration * tick
    for now, wanted in ((bodies.left, speed - aside), (bodies.right, speed + aside)):
        now += np.clip(wanted - now, -most, most)
    bodies.speed[:] = (bodies.left + bodies.right) / 2.0
    left, right = bodies.left * tick, bodies.right * tick
    seen = arc(left, right, wheels.track, bodies.encoder_heading)
    if not bodies.slips:
        return seen, seen
    noise_left, noise_right = _normals(bodies) if wheels.slip_noise else (0.0, 0.0)
    left = left * (1.0 + _slip(wheels.slip_left, wheels.slip_noise, noise_left, left))
    right = right * (1.0 + _slip(wheels.slip_right, wheels.slip_noise, noise_right, right))
    return seen, arc(left, right, wheels.track, bodies.heading)


def arc(left: Floats, right: Floats, track: float, heading: Floats) -> Step:
    """The step of a body whose wheels go `left` and `right` m, from a `heading` in rad."""
    turn = (right - left) / track
    chord = (left + right) / 2.0 * np.sinc(turn / TURN)  # sinc(z) is sin(pi z) / (pi z), and pi z is half the turn
    middle = heading + turn / 2.0
    return Step(chord * np.cos(middle), chord * np.sin(middle), turn)


def _slip(bias: float, noise: float, normal: Floats | float, way: Floats) -> Floats:
    """The share by which a wheel's way is longer than it seems; its noise gathers with the root of the way."""
    root = np.sqrt(np.maximum(np.abs(way), 1e-12))
    slip: Floats = np.clip(bias + noise * normal / root, -MOST_SLIP, MOST_SLIP)
    return slip


def _normals(bodies: Bodies) -> tuple[Floats, Floats]:
    """Two standard normal numbers for each body at this tick (Box and Muller's method)."""
    size, angle = (uniform(key(bodies.seed, "slip", half, bodies.tick), bodies.numbers) for half in "ab")
    size = sqrt(2.0) * np.sqrt(-np.log(1.0 - size))
    return size * np.cos(2.0 * pi * angle), size * np.sin(2.0 * pi * angle)
