"""Encoders of finite resolution: they count whole steps of each wheel, and odometry knows of counted steps only.

What a wheel has turned since its last step is kept and counts with what follows, so nothing is ever lost: a body that
goes straight is known to a step. A turn is not, since odometry takes each step to come in the tick in which it is
counted.

The machines compute exact odometry, each in its own way; this puts the counted one in its place, in the same way for
all of them, so that they agree to the last bit.
"""

from __future__ import annotations

import numpy as np

from sleepcast.core.records import NamedTuple
from sleepcast.simulator.motion.driving import Laws, arc
from sleepcast.simulator.motion.steps import BodyColumns
from sleepcast.simulator.simd.formulas import wrap
from sleepcast.simulator.world.grid import Floats


class WheelOdometry(NamedTuple):
    """What bodies believe of their poses, m and rad, and how far each wheel turns in this tick, m. Shape (count,)."""

    x: Floats
    y: Floats
    heading: Floats
    left: Floats
    right: Floats


def before_tick(bodies: BodyColumns, laws: Laws) -> WheelOdometry:
    """The odometry of bodies of one type whose wheels have their speeds of this tick, before they move."""
    poses = (bodies.encoder_x.copy(), bodies.encoder_y.copy(), bodies.encoder_heading.copy())
    return WheelOdometry(*poses, bodies.left * laws.tick, bodies.right * laws.tick)


def count(
    bodies: BodyColumns, laws: Laws, before: WheelOdometry, free: Floats, uncounted: Floats, counts: float
) -> None:
    """Let bodies of one type believe what their encoders have counted in this tick.

    free: the share of their way that they made
    uncounted: what each wheel has turned since its last step, m, changed in place, shape (2, count)
    counts: steps in a metre
    """
    left, right = (
        _counted(rest, way, counts) for rest, way in zip(uncounted, (before.left, before.right), strict=True)
    )
    dx, dy, turn = arc(laws, left, right, before.heading)
    bodies.encoder_x[:] = before.x + free * dx
    bodies.encoder_y[:] = before.y + free * dy
    bodies.encoder_heading[:] = wrap(before.heading + turn)


def _counted(rest: Floats, way: Floats, counts: float) -> Floats:
    """What encoders count of these ways of their wheels, m, in whole steps. rest: what they have not counted yet, which
    is changed in place."""
    whole = rest + way
    steps: Floats = np.floor(whole * counts) / counts
    rest[:] = whole - steps
    return steps
