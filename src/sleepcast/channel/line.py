"""A line: a party's mailbox on a transport, and the way from the clock on the wall to the time of a mind.

A line never waits unless it is asked to; `wait` mends and hears while its owner has nothing to do. Answers that
somebody has asked for within a time are spread over it by chance, so that a thousand robots do not answer at once.
"""

from __future__ import annotations

import select
from collections import OrderedDict
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from math import isinf
from random import Random

import msgspec

from sleepcast.channel.bodies import WITHIN
from sleepcast.channel.mailbox import Mailbox
from sleepcast.channel.message import Kind, Message
from sleepcast.channel.transport import Transport
from sleepcast.clock import Clock

LONGEST = 60.0
"""Seconds over which answers are spread at most."""
MAX_ASKED = 256
"""Commands of which a party knows how soon they are to be answered."""
MAX_HELD = 1_024
"""Answers that wait for their moment; beyond, the first one goes at once."""


@dataclass(order=True, slots=True)
class Held:
    """An answer that waits for its moment (s of Unix time)."""

    time: float
    tie: int
    message: Message


class Line:
    """See the module. clock: Unix time, s; zero: when the mind's time began. chance: for the moments of answers.

    It is a `Channel`: what is sent gets its number here, and times are those of the mind.
    """

    def __init__(self, transport: Transport, mailbox: Mailbox, clock: Clock, chance: Random, zero: float = 0.0) -> None:
        self.transport, self.mailbox, self.zero = transport, mailbox, zero
        self._clock, self._chance = clock, chance
        self._heard: list[Message] = []
        self._asked: OrderedDict[str, float] = OrderedDict()
        self._held: list[Held] = []
        self._tie = count()
        mailbox.start(clock.now())

    def send(self, message: Message) -> None:
        """Say something; an answer in its moment, all else at once. Raises MessageError for what is too long."""
        within = self._asked.get(str(message.body.get("command")), 0.0) if message.kind is Kind.ANSWER else 0.0
        if within > 0.0:
            when = self._clock.now() + self._chance.uniform(0.0, within)
            heappush(self._held, Held(when, next(self._tie), message))
            if len(self._held) > MAX_HELD:
                self._post(heappop(self._held).message)
        else:
            self._post(message)
        self._step()

    def receive(self) -> list[Message]:
        """What has come in since the last call, and can be dealt with now."""
        self.pump()
        found, self._heard = self._heard, []
        return found

    def pump(self) -> None:
        """Hear, mend, and send what is due."""
        now = self._clock.now()
        for datagram in self.transport.receive():
            self._hear(self.mailbox.take(datagram, now))
        while self._held and self._held[0].time <= now:
            self._post(heappop(self._held).message)
        self._step()

    def due(self) -> float:
        """When `pump` has something to do next even if nothing comes, s of Unix time."""
        due = self.mailbox.due()
        return min(due, self._held[0].time) if self._held else due

    def wait(self, seconds: float) -> None:
        """Pump for so long."""
        until = self._clock.now() + seconds
        while (now := self._clock.now()) < until:
            select.select([self.transport], [], [], max(0.0, min(until, self.due()) - now))
            self.pump()

    def close(self) -> None:
        """Leave. Nothing can be sent or heard afterwards."""
        self.transport.close()

    def _post(self, message: Message) -> None:
        deadline = None if isinf(message.deadline) else message.deadline + self.zero
        self.mailbox.post(
            message.kind,
            self._clock.now(),
            text=message.text,
            deadline=deadline,
            standing=message.standing,
            body=message.body,
        )

    def _step(self) -> None:
        out, freed = self.mailbox.step(self._clock.now())
        for datagram in out:
            self.transport.send(datagram)
        self._hear(freed)

    def _hear(self, messages: list[Message]) -> None:
        for message in messages:
            match message.body.get(WITHIN):
                case float() | int() as within if 0.0 < within <= LONGEST:
                    self._asked[message.id] = float(within)
                    if len(self._asked) > MAX_ASKED:
                        self._asked.popitem(last=False)
            times = {"issued": message.issued - self.zero, "deadline": message.deadline - self.zero}
            self._heard.append(msgspec.structs.replace(message, **times))
