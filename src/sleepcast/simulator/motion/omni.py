"""How bodies on the ground move that drive in every direction, as on mecanum wheels: formulas for arrays.

Their two speeds, ahead and to the left, are the body's own and turn with it. The limits of speed and acceleration are
those of the vector of both, as for what flies. On the way to a point a body keeps its heading.
"""

from __future__ import annotations

import numpy as np

from sleepcast.core.records import NamedTuple
from sleepcast.simulator.motion.driving import DRIVE, GOTO, Laws, bounded
from sleepcast.simulator.motion.flying import homed, shortened, steered
from sleepcast.simulator.motion.steps import BodyColumns, Displacement, Draws, Settled, overridden, wanted, within_edges
from sleepcast.simulator.motion.steps import commit as commit_ways
from sleepcast.simulator.simd.formulas import arc_tangent, rotated, shortest, sine_cosine
from sleepcast.simulator.world.grid import Floats


class SideColumns(NamedTuple):
    """What such bodies have besides `BodyColumns`, changed in place: speeds to the left, m/s, the wanted and the
    present one."""

    wanted: Floats
    speed: Floats


def propose(bodies: BodyColumns, side: SideColumns, laws: Laws, draws: Draws, proposal: Displacement) -> None:
    """See `steps.propose`."""
    ahead, turn = wanted(bodies, laws, draws)
    left = np.where(bodies.mode == DRIVE, side.wanted, 0.0)
    goes = bodies.mode == GOTO
    if goes.any():
        to_ahead, to_left = _towards_target(bodies, laws)
        ahead, left = np.where(goes, to_ahead, ahead), np.where(goes, to_left, left)
        turn = np.where(goes, 0.0, turn)
    ahead, left = shortened(laws, ahead, left)
    course = bodies.heading + arc_tangent(left, ahead)
    turn, moves = overridden(bodies, laws, course, np.sqrt(ahead * ahead + left * left), turn)
    ahead, left = np.where(moves, ahead, 0.0), np.where(moves, left, 0.0)
    bodies.speed[:], side.speed[:] = steered(laws, (bodies.speed, side.speed), (ahead, left))
    proposal.turn[:] = bounded(np.where(moves, turn, 0.0), -laws.turn_rate, laws.turn_rate) * laws.tick
    way = bodies.speed * laws.tick, side.speed * laws.tick
    proposal.dx[:], proposal.dy[:] = rotated(*way, *sine_cosine(bodies.heading + proposal.turn))
    within_edges(bodies, laws, proposal)


def _towards_target(bodies: BodyColumns, laws: Laws) -> tuple[Floats, Floats]:
    """The speeds ahead and to the left of bodies that come to rest at their targets."""
    dx = shortest(bodies.target_x - bodies.encoder_x, laws.around_x)
    dy = shortest(bodies.target_y - bodies.encoder_y, laws.around_y)
    return rotated(*homed(laws, dx, dy), *sine_cosine(-bodies.heading))


def commit(bodies: BodyColumns, side: SideColumns, laws: Laws, proposal: Displacement, settled: Settled) -> None:
    """See `steps.commit`: the way that stores pay for is that in whatever direction."""
    pace = np.sqrt(bodies.speed * bodies.speed + side.speed * side.speed)
    commit_ways(bodies._replace(speed=pace), laws, proposal, settled)
    if not laws.slides:
        for speed in (bodies.speed, side.speed):
            speed[settled.free < 1.0] = 0.0
