"""Robots with minds and stores on a bad radio, in simulated time, which die at any moment and are born again."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing, suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from random import Random

from channel.air import DESK, ROBOTS, Air, Party
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.keys import Trust
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.core.model import HostFunction
from sleepcast.core.units import NONE
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.node.node import Node
from sleepcast.node.store import Store

TICK = 0.05
"""Seconds from one thought to the next."""


@dataclass
class World:
    """What a robot has done to it, which no death undoes."""

    done: list[float] = field(default_factory=list)

    def note(self, number: float) -> None:
        self.done.append(number)


NOTES = Vocabulary("noter", functions=(HostFunction("NOTE", World.note, (NONE,), arguments="n"),))


class KilledError(Exception):
    """The process has ended here."""


class Mortal(Node):
    """A mind that dies in the middle of things: `dies` says after how many evaluations more, `early` whether before
    what is asked then is done."""

    dies, early = -1, False

    def _obey(self, message: Message, now: float) -> None:
        if self.dies == 0 and self.early:
            raise KilledError
        super()._obey(message, now)
        if self.dies == 0:
            raise KilledError
        self.dies -= 1


class Living:
    """One robot: its process ends and begins, its world and its file stay."""

    def __init__(self, air: Air, party: Party, file: Path) -> None:
        self.air, self.party, self.file, self.world = air, party, file, World()
        self.name = party.delivery.name
        self.said: list[str] = []
        self.answers: list[Message] = []
        self.wakes = 0.0
        self.begin()

    def begin(self) -> None:
        """A life begins."""
        now = self.air.clock.now()
        self.store = Store(self.file, self.air.clock, self.said.append)
        trust = Trust((DESK.public, ROBOTS.public))
        admission = Admission(trust, "lab", self.air.clock, robot=True, rate=1e9)
        chance = Random(self.air.chance.random())
        self.party.delivery = ReliableDelivery(self.name, self.store.new_epoch(self.name), ROBOTS, admission, chance)
        self.party.delivery.start(now)
        self.node = Mortal(self.name, NOTES, body=self.world, on_air=True)
        self.node.zero, self.ticks = now, 0
        self.store.adopt(self.node, self.party.delivery)
        self.party.got.clear()
        self.party.on, self.wakes = True, now

    def die(self) -> None:
        """The process is gone, as after kill -9: nothing is written any more."""
        self.party.on, self.wakes = False, inf
        connection, lock = self.store._connection, self.store._lock
        assert connection is not None
        assert lock is not None
        connection.close()
        os.close(lock)

    def tick(self) -> None:
        """As `loop.real` does it, without a body."""
        now = self.air.clock.now()
        for message in self.party.got:
            times = {"issued": message.issued - self.node.zero, "deadline": message.deadline - self.node.zero}
            self.node.receive(Message(**{**{f: getattr(message, f) for f in message.__struct_fields__}, **times}))
        self.party.got.clear()
        if self.store.before():
            self.store.write()
        self.ticks += 1
        self.node.think(self.ticks, now - self.node.zero)
        if self.store.after():
            self.store.write()
        self.answers += [message for message in self.node.outbox if message.kind is Kind.ANSWER]
        self.node.outbox.clear()

    def journal(self) -> list[tuple[str, str, float, str]]:
        """Command, kind, time and outcome of everything, from the file."""
        with closing(sqlite3.connect(self.file)) as connection:
            rows = connection.execute("SELECT command, kind, time, outcome FROM journal WHERE robot = ?", (self.name,))
            return rows.fetchall()


class Afloat:
    """A desk and robots; see the module."""

    def __init__(self, robots: int, folder: Path, seed: int, **radio: float) -> None:
        self.air = Air(robots, seed, **radio)
        self.chance = Random(seed)
        self.robots = [Living(self.air, party, folder / f"{party.delivery.name}.store") for party in self.air.robots]

    def post(
        self, text: str, *, standing: bool = False, deadline: float | None = None, desk: Party | None = None
    ) -> Message:
        """The desk commands, or another one."""
        now = self.air.clock.now()
        return (desk or self.air.desk).delivery.post(Kind.COMMAND, now, text=text, standing=standing, deadline=deadline)

    def run(self, seconds: float, deaths: float = 0.0) -> None:
        """Let time pass. deaths: of each robot in a second, on average, each for up to a second."""
        until = self.air.clock.now() + seconds
        while self.air.clock.now() < until:
            self.air.run(TICK)
            for robot in self.robots:
                if robot.party.on:
                    self._tick(robot, deaths)
                elif robot.wakes <= self.air.clock.now():
                    robot.begin()

    def _tick(self, robot: Living, deaths: float) -> None:
        dies = self.chance.random() < deaths * TICK
        if dies:
            robot.node.dies, robot.node.early = self.chance.choice((0, 0, 1, 2)), self.chance.random() < 0.5
        with suppress(KilledError):
            robot.tick()
        if dies:
            robot.die()
            robot.wakes = self.air.clock.now() + self.chance.random()
