"""The end of a tick in which robots have come and gone: whoever keeps anything of robots by their rows is told."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from sleepcast.channel.message_batch import NameIndex
from sleepcast.channel.simulated_radio import Radio
from sleepcast.columns.values import Index, Rows
from sleepcast.fleet import Fleet
from sleepcast.fleet.population import renumber as renumber_minds
from sleepcast.fleet.population import turn_over as turn_minds_over
from sleepcast.simulator import Simulator

NO_ROOM = "no room for its children"
"""What a parent reports whose children came too late in the tick for the last rows."""


class ChangingDesk(Protocol):
    """A desk as robots that come and go see it."""

    def turn_over(self, names: NameIndex, children: Index, dead: Index, /) -> None: ...


class ChangingSwarm(Protocol):
    """A swarm in which robots come and go; see `swarm.Swarm`."""

    simulator: Simulator
    fleet: Fleet
    radio: Radio

    @property
    def desks(self) -> Sequence[ChangingDesk]: ...


def turn_over(swarm: ChangingSwarm) -> None:
    """Let robots come and go as they have asked in this tick."""
    turnover = swarm.simulator.turn_over()
    if turnover is None:
        return
    names = swarm.simulator.names
    swarm.radio.turn_over(turnover.changed)
    turn_minds_over(swarm.fleet, names, turnover.parents, turnover.children, turnover.numbers, turnover.dead)
    swarm.fleet.outbox.report(Rows.of(turnover.refused), NO_ROOM)
    for desk in swarm.desks:
        desk.turn_over(names, turnover.children, turnover.dead)


def renumber(swarm: ChangingSwarm) -> None:
    """Other robots are there than at the start: a snapshot is gone on from."""
    names, population, nobody = swarm.simulator.names, swarm.simulator.population, Rows.run(0, 0).robots
    if population is not None:
        renumber_minds(swarm.fleet, names, population.numbers)
    for desk in swarm.desks:
        desk.turn_over(names, nobody, nobody)
