"""A small fleet of real minds round a desk, with a radio that the test works by hand."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from sleepcast.channel import Message
from sleepcast.core.clock import ManualClock
from sleepcast.core.model import Quantity
from sleepcast.language import HostFunction, Vocabulary
from sleepcast.node.node import Node
from sleepcast.station import Station

FRACTION = {"low": 0.0, "high": 1.0, "shown_as": "%"}


def vocabulary() -> Vocabulary:
    return Vocabulary(
        "scout",
        sensors=(Quantity("x", "m"), Quantity("fuel", **FRACTION), Quantity("ordnance", **FRACTION)),
        actuators=(Quantity("speed", "m/s", low=0.0, high=15.0),),
        functions=(HostFunction("SONAR", lambda body, i: 1.0, (None,), acts=False, arguments="i"),),
    )


@dataclass
class Fleet:
    """`size` scouts called s0, s1, ...: scout i has fuel i / size and ordnance 0.75, and stands at x = 100 i m."""

    size: int = 10
    clock: ManualClock = field(default_factory=ManualClock)
    sent: list[Message] = field(default_factory=list)

    def __post_init__(self) -> None:
        names = vocabulary()
        self.minds = {f"s{i}": Node(f"s{i}", names, number=i) for i in range(self.size)}
        for i, node in enumerate(self.minds.values()):
            node.sense((100.0 * i, i / self.size, 0.75), 0.0)
        self.station = Station(names, self.minds, self.sent.append, self.clock)
        self.tick = 0

    def report(self, robots: Iterable[str] | None = None) -> None:
        """Telemetry of these robots (by default of all) reaches the desk."""
        chosen = self.minds if robots is None else robots
        self.station.observe(self.clock.now(), [self.minds[name] for name in chosen])

    def deliver(self, robots: Iterable[str] | None = None) -> None:
        """What was sent reaches these robots (by default all); they think, and the desk hears what they say."""
        self.tick += 1
        for name in self.minds if robots is None else robots:
            node = self.minds[name]
            for message in self.sent:
                node.receive(message)
            node.think(self.tick, self.clock.now())
            for message in node.outbox:
                self.station.hear(message)
            node.outbox.clear()
