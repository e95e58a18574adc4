"""Robots that come and go, at the end of a tick or because somebody adds one: whoever keeps anything of robots by their
rows is told, and who comes without a parent is told what it must know."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Protocol

import msgspec

from sleepcast.channel.message import Kind, Message
from sleepcast.channel.message_batch import NameIndex
from sleepcast.channel.simulated_radio import Radio
from sleepcast.columns.values import Index, Rows
from sleepcast.fleet import Fleet
from sleepcast.fleet.population import renumber as renumber_minds
from sleepcast.fleet.population import turn_over as turn_minds_over
from sleepcast.mind.authority import Latch, restored
from sleepcast.mind.limits import MAX_QUEUE
from sleepcast.simulator import Simulator
from sleepcast.simulator.bodies.arrivals import Arrival
from sleepcast.simulator.bodies.population import Turnover

NO_ROOM = "no room for its children"
"""What a parent reports whose children came too late in the tick for the last rows."""
MAX_STANDING = 4_096
"""Standing commands that newcomers are told, the latest ones: as many as one can name on the air."""

AT_ONCE = MAX_QUEUE // 2
"""Of these in one tick: as many as can wait for their evaluation, with room for what is sent just then."""


class BriefingState(msgspec.Struct):
    """See `Briefing`. latch: as it is written."""

    standing: list[Message] = []
    latch: dict[str, object] = {}


class Briefing:
    """What whoever comes later is to know of what operators have sent.

    standing: their standing commands, the oldest first
    latch: that of a robot that has heard all their STOPs and RELEASEs
    """

    def __init__(self) -> None:
        self.standing: deque[Message] = deque(maxlen=MAX_STANDING)
        self.latch = Latch()

    def hear(self, message: Message) -> None:
        """An operator's message goes on the air."""
        if message.kind is Kind.STOP:
            self.latch = self.latch.stop(message) or self.latch
        elif message.kind is Kind.RELEASE:
            self.latch = self.latch.release(message) or self.latch
        elif message.standing:
            self.standing.append(message)

    def state(self) -> BriefingState:
        """All of it."""
        return BriefingState(list(self.standing), self.latch.written())

    def restore(self, state: BriefingState) -> None:
        """Know what was known."""
        self.standing, self.latch = deque(state.standing, MAX_STANDING), restored(state.latch)


class ChangingDesk(Protocol):
    """A desk as robots that come and go see it."""

    def turn_over(self, names: NameIndex, children: Index, dead: Index, /) -> None: ...


class ArrivalWitness(Protocol):
    """A witness as robots that are added see it; see `swarm.Witness`."""

    def came(self, arrival: Arrival, /) -> None: ...


class ChangingSwarm(Protocol):
    """A swarm in which robots come and go; see `swarm.Swarm`."""

    simulator: Simulator
    fleet: Fleet
    radio: Radio
    briefing: Briefing

    @property
    def desks(self) -> Sequence[ChangingDesk]: ...

    @property
    def witnesses(self) -> Sequence[ArrivalWitness]: ...


def turn_over(swarm: ChangingSwarm) -> None:
    """Let robots come and go as they have asked in this tick, and those come whose time it is."""
    turnover = swarm.simulator.turn_over()
    if turnover is not None:
        _tell(swarm, turnover)


def add_robot(
    swarm: ChangingSwarm, kind: str = "", x: float | None = None, y: float | None = None, heading: float | None = None
) -> str:
    """Add a robot between two ticks, and give its name; see `Simulator.add_robot`, also for what it raises."""
    arrival = swarm.simulator.add_robot(kind, x, y, heading)
    turnover = swarm.simulator.turnover
    assert turnover is not None
    _tell(swarm, turnover)
    for witness in swarm.witnesses:
        witness.came(arrival)
    return swarm.simulator.names[int(turnover.children[0])]


def add_again(swarm: ChangingSwarm, arrival: Arrival) -> None:
    """Add a robot that was added between these ticks when the run went on before; see `Simulator.add_again`."""
    turnover = swarm.simulator.add_again(arrival)
    if turnover is not None:
        _tell(swarm, turnover)


def _tell(swarm: ChangingSwarm, turnover: Turnover) -> None:
    """Let everybody know who has come and gone, and newcomers what they are to know."""
    names = swarm.simulator.names
    swarm.radio.turn_over(turnover.changed)
    turn_minds_over(swarm.fleet, names, turnover.parents, turnover.children, turnover.numbers, turnover.dead)
    swarm.fleet.outbox.report(Rows.of(turnover.refused), NO_ROOM)
    for desk in swarm.desks:
        desk.turn_over(names, turnover.children, turnover.dead)
    if (new := turnover.newcomers).size:
        for rule in swarm.simulator.scenario.minds.locked:
            swarm.fleet.install(rule.name, rule.text, robots=Rows.of(new))
        swarm.fleet.begin(swarm.briefing.latch, swarm.simulator.time, Rows.of(new))
        for index, message in enumerate(swarm.briefing.standing):
            ticks = index // AT_ONCE + 0.5
            swarm.radio.bring(message, new, swarm.simulator.time + ticks * swarm.simulator.scenario.tick)


def renumber(swarm: ChangingSwarm) -> None:
    """Other robots are there than at the start: a snapshot is gone on from."""
    names, population, nobody = swarm.simulator.names, swarm.simulator.population, Rows.run(0, 0).robots
    if population is not None:
        renumber_minds(swarm.fleet, names, population.numbers)
    for desk in swarm.desks:
        desk.turn_over(names, nobody, nobody)
