"""Twins: a fleet, and a node for each of its robots. Whatever is done to the one is done to the other, and `compare`
says where anything that can be seen of a robot's mind differs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from language.cases import ACTUATORS, CONSTANTS, FUNCTIONS, SENSORS, Body
from sleepcast.channel.message import Kind, Message
from sleepcast.core.errors import SleepcastError
from sleepcast.fleet import Fleet, RobotView
from sleepcast.language import Vocabulary
from sleepcast.mind.authority import Tells
from sleepcast.mind.instants import EqualClocks
from sleepcast.node.node import Node


def vocabulary() -> Vocabulary:
    return Vocabulary("robot", SENSORS, ACTUATORS, constants=CONSTANTS, functions=FUNCTIONS)


class Twins:
    """`count` robots, numbered from `first` on; readings: their sensors' values, one row a robot. body: makes one;
    lease, tells, on_air: see `Node`."""

    def __init__(
        self,
        count: int,
        *,
        seed: int = 0,
        first: int = 1,
        body: Callable[[], Body] = Body,
        lease: float = math.inf,
        tells: Tells = Tells.ALL,
        on_air: bool = False,
    ) -> None:
        self.here, self.there = [body() for _ in range(count)], [body() for _ in range(count)]
        names = [f"r{i}" for i in range(count)]
        numbers = [first + i for i in range(count)]
        self.fleet = Fleet(
            names,
            vocabulary(),
            numbers=numbers,
            seed=seed,
            bodies=self.here,
            lease=lease,
            tells=tells,
            on_air=on_air,
        )
        own = vocabulary()
        self.nodes = [
            Node(name, own, number=number, seed=seed, body=body, lease=lease, tells=tells, on_air=on_air)
            for name, number, body in zip(names, numbers, self.there, strict=True)
        ]
        for node in self.nodes:
            node.timing.clocks = EqualClocks()
        self.views = list(self.fleet.values())
        self.sent = self.tick = 0
        self.now = 0.0

    def sense(self, readings: Sequence[Sequence[float]]) -> None:
        self.fleet.sense(np.array(readings, np.float64), self.now)
        for node, row in zip(self.nodes, readings, strict=True):
            node.sense(row, self.now)

    def send(self, text: str, robots: Sequence[int] | None = None, kind: Kind = Kind.COMMAND, **more: float) -> None:
        """Let these robots (None: all) hear a message."""
        self.sent += 1
        message = Message("desk", 1, self.sent, kind, self.now, text=text, **more)
        self.hear(message, robots)

    def hear(self, message: Message, robots: Sequence[int] | None = None) -> None:
        self.fleet.receive(message, robots)
        for i in range(len(self.nodes)) if robots is None else robots:
            self.nodes[i].receive(message)

    def think(self, ticks: int = 1, robots: Sequence[int] | None = None) -> None:
        """Go on by so many ticks, and let these robots think in the last of them."""
        self.tick += ticks
        self.now = self.tick / 10
        self.fleet.think(self.tick, self.now, robots)
        for i in range(len(self.nodes)) if robots is None else robots:
            self.nodes[i].think(self.tick, self.now)

    def install(self, robot: int, name: str, text: str, priority: int, *, protected: bool) -> None:
        for mind in (self.views[robot], self.nodes[robot]):
            mind.install(name, text, priority=priority, protected=protected)

    def do(self, text: str, robots: Sequence[int] | None = None, ticks: int = 1) -> None:
        """A command to these robots, and a tick of all."""
        self.send(text, robots)
        self.think(ticks)

    def compare(self) -> None:
        """Raise AssertionError unless every robot is like its twin; what they have said is taken away."""
        for view, node, here, there in zip(self.views, self.nodes, self.here, self.there, strict=True):
            assert seen(view) == seen(node), view.name
            assert here.done == there.done, view.name
            for mind in (view, node):
                mind.outbox.clear()
                mind.pings.clear()
            here.done.clear()
            there.done.clear()

    def compare_reasons(self) -> None:
        """Raise AssertionError unless every robot explains its last command as its twin does."""
        for view, node in zip(self.views, self.nodes, strict=True):
            assert explained(view) == explained(node), view.name


def seen(mind: RobotView | Node) -> dict[str, object]:
    """Everything that can be seen of a mind, such that unknown equals unknown and 0 is not -0."""
    return {
        "variables": {name: value.hex() for name, value in mind.variables()},
        "rules": [
            (r.name, r.text, r.active, r.last_value.hex(), r.last_fault, r.steps, r.firings, r.lease, r.priority)
            for r in mind.rules()
        ],
        "protected": [rule.name for rule in mind.rules() if rule.protected],
        "heard": list(mind.heard()),
        "groups": sorted(mind.groups),
        "outbox": mind.outbox.copy(),
        "pings": mind.pings.copy(),
        "held by": (mind.doubt, mind.driven, mind.catching_up),
        "counts": (mind.dropped, mind.lost, mind.stopped, mind.awake),
        "actuators": {name: value.hex() for name, value in mind.actuators().items()},
    }


def explained(mind: RobotView | Node) -> object:
    try:
        explanation = mind.why()
    except SleepcastError:
        return None
    unknown = math.isnan(explanation.value)
    return unknown or explanation.value, explanation.to_dict()
