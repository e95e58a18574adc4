"""Motion: one tick of all bodies at once.

What each body wants (to wander, to drive, to reach a point) becomes a wanted speed and turn rate; tumbling,
holding, an empty tank and the fence overrule it; the limits cut it, and it becomes a step, by wheels (see
`wheels`) or without, where a body has no inertia in turning. With bumpers a step ends where bodies would touch.
"""

from __future__ import annotations

from math import inf, pi, sqrt

import numpy as np

from sleepcast.channel.chance import GOLDEN, mix
from sleepcast.simulator.bodies import TURN, Bodies, Flags, Floats, Mode
from sleepcast.simulator.wheels import Step, roll

BRAKING = 0.8
"""Share of the acceleration that an approach to a point counts on, so that there is some left to correct
with."""
AT_ONCE = 1e9
"""rad/s2 of a craft without wheels, which has no inertia in turning."""
_UNIT_SPREAD = sqrt(12.0)
"""Makes an even draw of width 1 one of standard deviation 1."""


def step(bodies: Bodies) -> None:
    """Move all bodies through the tick `bodies.tick`, and count it."""
    tick = bodies.scenario.tick
    bodies.forget()
    speed, turn = _wanted(bodies, tick)
    moves = ~(bodies.held | _empty(bodies))
    _tumble(bodies, moves, turn, tick)
    _turn_back(bodies, speed, turn)
    speed *= moves
    turn *= moves
    wheels = bodies.scenario.robots.wheels
    seen, real = roll(bodies, wheels, speed, turn, tick) if wheels else _glide(bodies, speed, turn, tick)
    _move(bodies, seen, real, tick)
    bodies.tick += 1
    bodies.near.forget()
    if bodies.echoes:
        bodies.echoes.fire(bodies.tick, bodies.time, (bodies.x, bodies.y, bodies.heading))


def wrap(angle: Floats) -> Floats:
    """Each angle (rad) within -pi..pi."""
    return angle - TURN * np.floor((angle + pi) / TURN)


def _wanted(bodies: Bodies, tick: float) -> tuple[Floats, Floats]:
    """What each body wants: speed and turn rate, shape (count,), before anything overrules or limits it."""
    wanders = bodies.mode == Mode.WANDER
    _roam(bodies, tick)
    speed = np.where(wanders, bodies.scenario.robots.wander.speed, bodies.wanted_speed)
    turn = np.where(wanders, bodies.roaming, bodies.wanted_turn)
    going = np.flatnonzero(bodies.mode == Mode.GOTO)
    if going.size:
        across = bodies.target_x[going] - bodies.encoder_x[going]
        up = bodies.target_y[going] - bodies.encoder_y[going]
        away = np.sqrt(across * across + up * up)
        error = wrap(np.arctan2(up, across) - bodies.encoder_heading[going])
        # A circle through the point: driven faster, the tightest turn would pass it by. One behind takes half a turn.
        bend = np.where(np.abs(error) < pi / 2, np.abs(np.sin(error)), 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            turning = bodies.limits.turn_rate * away / (2.0 * bend)
        braking = np.sqrt(2.0 * BRAKING * bodies.limits.acceleration * away)
        fastest = np.minimum.reduce([turning, braking, away / tick])
        there = away <= bodies.geometry.radius
        speed[going] = np.where(there, 0.0, fastest)
        # Wheels need time to end a turn, as they do to end a way.
        ending = np.sqrt(2.0 * BRAKING * _turn_acceleration(bodies) * np.abs(error))
        turn[going] = np.where(there, 0.0, np.clip(error / tick, -ending, ending))
    return speed, turn


def _turn_acceleration(bodies: Bodies) -> float:
    """How fast the turn rate of a body can change, rad/s2."""
    wheels = bodies.scenario.robots.wheels
    return 2.0 * bodies.limits.acceleration / wheels.track if wheels else AT_ONCE


def _roam(bodies: Bodies, tick: float) -> None:
    """Let the turn rates of wandering bodies drift: an Ornstein-Uhlenbeck process, one step of Euler's
    method."""
    wander = bodies.scenario.robots.wander
    bits = mix(bodies.chance + np.uint64(bodies.tick * GOLDEN & 0xFFFF_FFFF_FFFF_FFFF))
    drawn = (bits >> np.uint64(11)) * 2.0**-53 - 0.5
    kept = max(0.0, 1.0 - tick / wander.steadiness)
    bodies.roaming *= kept
    bodies.roaming += drawn * (_UNIT_SPREAD * wander.turn_rate * sqrt(1.0 - kept * kept))


def _tumble(bodies: Bodies, moves: Flags, turn: Floats, tick: float) -> None:
    """Bodies that tumble, and can move, turn as fast as they can until their swing is done."""
    swinging = np.flatnonzero(bodies.swing)
    swinging = swinging[moves[swinging]]
    if swinging.size:
        limit = bodies.limits.turn_rate
        now = np.clip(bodies.swing[swinging] / tick, -limit, limit)
        turn[swinging] = now
        left = bodies.swing[swinging] - now * tick
        bodies.swing[swinging] = np.where(np.abs(left) < 1e-9, 0.0, left)


def _empty(bodies: Bodies) -> Flags:
    """Whether each body has run out of something that driving uses."""
    empty = np.zeros(bodies.count, bool)
    for row, store in zip(bodies.stores, bodies.scenario.robots.stores, strict=True):
        if store.reach < inf:
            empty |= row <= 0.0
    return empty


def _turn_back(bodies: Bodies, speed: Floats, turn: Floats) -> None:
    """Bodies that drive near the fence turn, as fast as they can, until they drive towards the middle of the
    world."""
    if not bodies.scenario.fenced:
        return
    margin = min(
        bodies.limits.speed / bodies.limits.turn_rate, 0.1 * bodies.scenario.width, 0.1 * bodies.scenario.height
    )
    left, bottom, right, top = bodies.fence
    inside = (bodies.x > left + margin) & (bodies.x < right - margin)
    inside &= (bodies.y > bottom + margin) & (bodies.y < top - margin)
    near = np.flatnonzero(~inside)
    near = near[(bodies.mode[near] != Mode.GOTO) & (speed[near] != 0.0)]
    middle = np.arctan2((bottom + top) / 2 - bodies.y[near], (left + right) / 2 - bodies.x[near])
    error = wrap(middle - bodies.heading[near] - np.where(speed[near] < 0.0, pi, 0.0))
    astray = np.abs(error) > pi / 4
    turn[near[astray]] = np.copysign(bodies.limits.turn_rate, error[astray])


def _glide(bodies: Bodies, speed: Floats, turn: Floats, tick: float) -> tuple[Step, Step]:
    """The steps of crafts without wheels: as they believe, and as they are, which is the same."""
    limits = bodies.limits
    most = limits.acceleration * tick
    bodies.speed += np.clip(np.clip(speed, -limits.speed, limits.speed) - bodies.speed, -most, most)
    turned = np.clip(turn, -limits.turn_rate, limits.turn_rate) * tick
    way, heading = bodies.speed * tick, bodies.heading + turned
    step = Step(way * np.cos(heading), way * np.sin(heading), turned)
    return step, step


def _move(bodies: Bodies, seen: Step, real: Step, tick: float) -> None:
    """Move each body by its `real` step, as far as its fence and its bumper let it, and let it believe what its
    encoders have `seen` of that; take what it uses from its stores."""
    left, bottom, right, top = bodies.fence
    across = np.clip(bodies.x + real.across, left, right) - bodies.x
    up = np.clip(bodies.y + real.up, bottom, top) - bodies.y
    free: Floats | float = 1.0
    if bodies.contact:
        settled = bodies.contact.settle(bodies.x, bodies.y, across, up)
        free = settled.free
        bodies.hit_x[:], bodies.hit_y[:] = settled.across, settled.up
        bodies.bumper[:] = bodies.contact.part_of(settled, bodies.heading)
    used = np.abs(bodies.speed) * tick * free
    bodies.x += free * across
    bodies.y += free * up
    bodies.heading[:] = wrap(bodies.heading + real.turn)
    if bodies.scenario.robots.wheels:
        bodies.encoder_x += free * seen.across
        bodies.encoder_y += free * seen.up
        bodies.encoder_heading[:] = wrap(bodies.encoder_heading + seen.turn)
    if bodies.contact:
        for speed in (bodies.speed, bodies.left, bodies.right):
            speed[settled.free < 1.0] = 0.0
    for row, store in zip(bodies.stores, bodies.scenario.robots.stores, strict=True):
        if store.reach < inf:
            row -= used * (store.full / store.reach)
            np.maximum(row, 0.0, out=row)
