"""Robots far away, of which a desk knows what they answer to looks, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import count

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import LOOK, OF, Inspection
from sleepcast.core.clock import ManualClock
from sleepcast.node.node import Node
from sleepcast.station import Station
from sleepcast.station.remote import RemoteMinds


@dataclass
class Far:
    """Minds by name, and what a desk knows of them."""

    nodes: Mapping[str, Node]
    clock: ManualClock = field(default_factory=lambda: ManualClock(1_000.0))
    minds: RemoteMinds = field(default_factory=RemoteMinds)
    asked: list[tuple[str, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._numbers = count(1)

    def answers(self, robot: str, look: str, of: str | None = None) -> Message:
        """What a robot says to a look."""
        node, number = self.nodes[robot], next(self._numbers)
        self.asked.append((robot, look))
        body: dict[str, object] = {LOOK: look} | ({} if of is None else {OF: of})
        node.receive(Message("desk", 1, number, Kind.ASK, 0.0, body=body))
        node.think(number, self.clock.now())
        found = [message for message in node.outbox if message.kind is Kind.ANSWER]
        node.outbox.clear()
        return found[-1]

    def look(self, robots: Iterable[str] | None = None) -> None:
        """These robots (by default all) tell of themselves, and whatever is missing then is asked for."""
        now = self.clock.now()
        for robot in self.nodes if robots is None else robots:
            self.minds.take(self.answers(robot, Inspection.TELEMETRY), now)
        while wanted := self.minds.wanted(now):
            for look, names in wanted:
                for robot in names:
                    self.minds.take(self.answers(robot, look), now)

    def station(self) -> Station:
        """A desk that knows what has been told."""
        station = Station(self.minds.vocabulary, self.minds, [].append, self.clock)
        for mind in self.minds.values():
            station.observe(mind.reported_at, [mind])
        return station
