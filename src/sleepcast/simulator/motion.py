"""Motion: one tick of all bodies at once.

Each body proposes a step (see `driving` and `steps`); with bumpers it ends where bodies would touch (see `contact`);
then all go as far as they are free to.
"""

from __future__ import annotations

import numpy as np

from sleepcast.channel.chance import GOLDEN, key
from sleepcast.simulator.bodies import Bodies
from sleepcast.simulator.contact import Settled
from sleepcast.simulator.steps import Draws

_BITS = 0xFFFF_FFFF_FFFF_FFFF


def step(bodies: Bodies) -> None:
    """Move all bodies through the tick `bodies.tick`, and count it."""
    bodies.forget()
    draws = Draws(
        bodies.tick * GOLDEN & _BITS,
        key(bodies.seed, "slip", "left", bodies.tick),
        key(bodies.seed, "slip", "right", bodies.tick),
    )
    machine, parts = bodies.machine, bodies.parts
    for part in parts:
        machine.propose(part.columns, part.laws, draws, part.proposal)
    settled = Settled(np.ones(bodies.count), bodies.hit_x, bodies.hit_y)
    if bodies.contact:
        settled = bodies.contact.settle(bodies.x, bodies.y, bodies.proposal.across, bodies.proposal.up)
        bodies.hit_x[:], bodies.hit_y[:] = settled.across, settled.up
    for part, which in zip(parts, bodies.of_each_sort, strict=True):
        machine.commit(part.columns, part.laws, part.proposal, Settled(*(each[which] for each in settled)))
        if not part.laws.track and part is not bodies:  # others may have wheels, so what these believe lies apart
            part.encoder_x[:], part.encoder_y[:], part.encoder_heading[:] = part.x, part.y, part.heading
    bodies.tick += 1
    bodies.near.forget()
    if bodies.echoes:
        bodies.echoes.fire(bodies.tick, bodies.time, (bodies.x, bodies.y, bodies.heading))
