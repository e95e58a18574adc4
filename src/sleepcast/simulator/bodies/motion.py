"""Motion: one tick of all bodies at once.

Each body proposes a step (see `driving` and `steps`); with bumpers it ends where bodies would touch (see `contact`);
then all go as far as they are free to.
"""

from __future__ import annotations

from sleepcast.core.counter_rng import GOLDEN, key
from sleepcast.simulator.bodies.bodies import Bodies
from sleepcast.simulator.bodies.contact import Settled, clear
from sleepcast.simulator.bodies.steps import Draws

_BITS = 0xFFFF_FFFF_FFFF_FFFF


def step(bodies: Bodies) -> None:
    """Move all bodies through the tick `bodies.tick`, and count it. Who is near whom is still known from the last look
    around, unless somebody was put elsewhere."""
    draws = Draws(
        bodies.tick * GOLDEN & _BITS,
        key(bodies.seed, "slip", "left", bodies.tick),
        key(bodies.seed, "slip", "right", bodies.tick),
    )
    machine, sorts = bodies.machine, list(zip(bodies.parts, bodies.of_each_sort, strict=True))
    proposal, free = machine.room(bodies.count)
    for part, which in sorts:
        machine.propose(part.columns, part.laws, draws, proposal.of(which))
    settled = Settled(free, bodies.hit_x, bodies.hit_y)
    if bodies.contact:
        bodies.contact.settle(bodies.x, bodies.y, proposal.across, proposal.up, settled)
    else:
        clear(settled)
    for part, which in sorts:
        machine.commit(part.columns, part.laws, proposal.of(which), Settled(*(each[which] for each in settled)))
        if not part.laws.track and part is not bodies:  # others may have wheels, so what these believe lies apart
            part.encoder_x[:], part.encoder_y[:], part.encoder_heading[:] = part.x, part.y, part.heading
    bodies.tick += 1
    bodies.forget()
    if bodies.echoes:
        bodies.echoes.fire(bodies.tick, bodies.time, (bodies.x, bodies.y, bodies.heading))
