"""A swarm whose minds are nodes: the loop of one tick robot by robot, to compare the fleet's with."""

from __future__ import annotations

from math import nan

from sleepcast.channel.message import Message
from sleepcast.channel.simulated_radio import OPERATOR, Radio
from sleepcast.loop import vocabulary_of
from sleepcast.node.node import Node
from sleepcast.robot import Setpoint
from sleepcast.simulator import Simulator
from sleepcast.station import Station


class NodeSwarm:
    """Bodies, a node for each, the radio and a desk; it is their clock."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        self.vocabulary = vocabulary_of(simulator.model)
        self.nodes = [
            Node(name, self.vocabulary, number=i + 1, seed=simulator.seed, body=simulator.robots[i])
            for i, name in enumerate(simulator.names)
        ]
        self.minds = {node.name: node for node in self.nodes}
        self.radio = Radio(simulator.scenario.radio, simulator.x, simulator.y, seed=simulator.seed, clock=self)
        self.posted: list[Message] = []
        self.desk = Station(self.vocabulary, self.minds, self.posted.append, self)
        self.telemetry_ticks = max(1, round(simulator.scenario.telemetry / simulator.scenario.tick))

    def now(self) -> float:
        return self.simulator.time

    def step(self) -> None:
        """One tick, in the loop's order."""
        for i, node in enumerate(self.nodes):
            wanted = node.actuators()
            if wanted:
                names = [actuator.name for actuator in self.simulator.model.actuators]
                self.simulator.robots[i].act(Setpoint(*[wanted.get(name, nan) for name in names]))
        self.simulator.step()
        for message in self.posted:
            self.radio.send(OPERATOR, message)
            self.desk.on_air(message)
        self.posted.clear()
        for message, robots in self.radio.receive_all():
            for i in robots.tolist():
                self.nodes[i].receive(message)
        for i, node in enumerate(self.nodes):
            if node.awake:
                self._sense(i)
                node.think(self.simulator.tick, self.now())
        for i, node in enumerate(self.nodes):
            for message in node.outbox:
                self.radio.send(i, message)
            for caste in node.pings:
                self.simulator.ping(i, caste)
            node.outbox.clear()
            node.pings.clear()
        for message in self.radio.receive(OPERATOR):
            self.desk.hear(message)
        if self.simulator.tick % self.telemetry_ticks == 0:
            sampled = self.radio.samples().tolist()
            for i in sampled:
                self._sense(i)
            self.desk.observe(self.now(), [self.nodes[i] for i in sampled])
        self.desk.attend()

    def _sense(self, robot: int) -> None:
        self.nodes[robot].sense(self.simulator.readings([robot])[0], self.now())
