"""A session: one party's connection to the channel. It joins a transport, reliable delivery, and the time of a mind.

A session never waits unless it is asked to; `wait` repairs and receives while its owner has nothing to do. Answers that
were asked for within a time are spread over it at random, so that a thousand robots do not answer at once. An answer is
sent once; who has missed some asks for them by the robots' names, which is the session's own business: the mind hears
nothing of it.

Many robots of one process share one `Receiver`, as one computer has one radio however many minds live on it. It checks,
orders and repairs what comes from others once for all of them, and hands it to every robot, which decides by itself
whether it is addressed. Each robot sends by a session of its own, under its own name and numbers; what one robot tells
the others reaches its neighbours through the same receiver.
"""

from __future__ import annotations

import select
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from math import inf, isinf
from random import Random

import msgspec

from sleepcast.channel.admission import Admission
from sleepcast.channel.keys import KeyChange, KeyRefusal
from sleepcast.channel.message import MAX_NAME, Kind, Message, message_id
from sleepcast.channel.payload import AGAIN, FOR, KEYS, MISSED, NOT, WITHIN
from sleepcast.channel.reliable import LIFE, ReliableDelivery
from sleepcast.channel.sequencer import Skipped
from sleepcast.channel.transports.multiplexer import Port
from sleepcast.channel.transports.transport import Transport
from sleepcast.core.clock import Clock

MAX_SPREAD = 60.0
"""Seconds over which answers are spread at most."""
MAX_ASKED = 256
"""Commands of which a party knows how soon they are to be answered."""
MAX_ANSWERED = 64
"""Commands of which a party can say its answer again, as many as it can explain."""
MAX_REPORTED = 8
"""Commands that were missed whose ids are told in one report; of more, how many."""
GATHER_FOR = 0.001
"""Seconds for which the next look at the air waits after something came: what comes close together is dealt with
together, and a flood costs no look for each datagram."""
REPORT_EVERY = 1.0
"""Seconds between two such reports."""
MAX_HELD = 1_024
"""Answers that wait for their moment; beyond, the first one goes at once."""


@dataclass(order=True, slots=True)
class DelayedAnswer:
    """An answer that waits for its moment (s of Unix time)."""

    time: float
    tie: int
    message: Message


class ChannelSession:
    """See the module. clock: Unix time, s; zero: when the mind's time began. chance: for the moments of answers.

    It is a `Channel`: what is sent gets its number here, and times are those of the mind. listens: whether it hears for
    itself; else an `Ear` does, and whoever has it brings what it hears. ends: called when the line is left.
    """

    def __init__(
        self,
        transport: Transport,
        delivery: ReliableDelivery,
        clock: Clock,
        chance: Random,
        zero: float = 0.0,
        *,
        listens: bool = True,
    ) -> None:
        self.transport, self.delivery, self.zero = transport, delivery, zero
        self._clock, self._chance = clock, chance
        self.ends: list[Callable[[], None]] = []
        self._heard: list[Message] = []
        self._missed: list[Skipped] = []
        self._report_at = -inf
        self._asked: OrderedDict[str, float] = OrderedDict()
        self._answered: OrderedDict[str, Message] = OrderedDict()
        self._delayed: list[DelayedAnswer] = []
        self._tie = count()
        if listens:
            delivery.start(clock.now())

    def send(self, message: Message) -> None:
        """Say something; an answer in its moment, all else at once. Raises MessageError for what is too long."""
        if message.kind is Kind.ANSWER:
            command = str(message.body.get("command"))
            self._answered[command] = message
            if len(self._answered) > MAX_ANSWERED:
                self._answered.popitem(last=False)
            self._delay(message, self._asked.get(command, 0.0))
        else:
            self._post(message)
        self.flush()

    def receive(self) -> list[Message]:
        """What has come in since the last call, and can be dealt with now."""
        self.pump()
        return self.heard()

    def pump(self) -> bool:
        """Hear, mend, and send what is due; whether anything came."""
        came = self.transport.receive()
        for datagram in came:
            now = self._clock.now()
            self._hear(self.delivery.take(datagram, now), now)
        self.tend()
        return bool(came)

    def hear(self, messages: Iterable[Message]) -> None:
        """Take in what others say, with the times of our mind."""
        for message in messages:
            if message.kind is Kind.ASK and AGAIN in message.body:
                self._say_again(message)
                continue
            within = _within(message)
            if within > 0.0:
                self._asked[message.id] = within
                if len(self._asked) > MAX_ASKED:
                    self._asked.popitem(last=False)
            if message.kind is Kind.COMMAND and KEYS in message.body and not message.ahead:
                self._answer_for_keys(message)
            else:
                self._heard.append(message)

    def miss(self, skipped: Iterable[Skipped]) -> None:
        """These commands never came, and would come too late."""
        self._missed += skipped

    def tend(self) -> None:
        """Mend, and send what is due."""
        now = self._clock.now()
        while self._delayed and self._delayed[0].time <= now:
            self._post(heappop(self._delayed).message)
        self._step(now)

    def heard(self) -> list[Message]:
        """What has been heard since the last call, and can be dealt with now."""
        found, self._heard = self._heard, []
        return found

    def due(self) -> float:
        """When `receive` has something to do next even if nothing comes, s of Unix time."""
        return -inf if self._heard else self._pump_due()

    def wait(self, seconds: float) -> None:
        """Pump for so long; a robot that hears STOP waits no longer."""
        until = self._clock.now() + seconds
        while (now := self._clock.now()) < until and not self._has_stop():
            select.select([self.transport], [], [], max(0.0, min(until, self._pump_due()) - now))
            if self.pump() and not self._has_stop():
                select.select([], [], [], max(0.0, min(GATHER_FOR, until - self._clock.now())))

    def close(self) -> None:
        """Leave. Nothing can be sent or heard afterwards."""
        self.transport.close()
        for end in self.ends:
            end()

    def _has_stop(self) -> bool:
        """Whether something has been heard that waits for no tick."""
        return self.delivery.admission.robot and any(message.kind is Kind.STOP for message in self._heard)

    def _pump_due(self) -> float:
        due = self.delivery.due()
        return min(due, self._delayed[0].time) if self._delayed else due

    def _delay(self, answer: Message, within: float) -> None:
        """Say an answer in its moment, at once if it has none."""
        if within == 0.0:
            self._post(answer)
            return
        when = self._clock.now() + self._chance.uniform(0.0, within)
        heappush(self._delayed, DelayedAnswer(when, next(self._tie), answer))
        if len(self._delayed) > MAX_HELD:
            self._post(heappop(self._delayed).message)

    def _say_again(self, asked: Message) -> None:
        """Somebody has missed answers; ours is among them if we are named, or others are whose answers have come."""
        named, heard = asked.body.get(FOR), asked.body.get(NOT)
        answer, name = self._answered.get(str(asked.body[AGAIN])), self.delivery.name
        missed = name in named if isinstance(named, list) else isinstance(heard, list) and name not in heard
        if answer is None or not missed:
            return
        if all(held.message is not answer for held in self._delayed):  # else it is about to be said anyway
            self._delay(answer, _within(asked))

    def _answer_for_keys(self, message: Message) -> None:
        """Whom to trust is the channel's affair, so a robot's answer is the channel's, too."""
        if not self.delivery.admission.robot:
            return
        body: dict[str, object] = {"command": message.id, "outcome": "matched", "value": None, "fault": None}
        try:
            KeyChange.of(message)
        except KeyRefusal as error:
            body |= {"outcome": "fault", "fault": str(error)}
        now = self._clock.now() - self.zero
        self.send(Message(self.delivery.name, self.delivery.epoch, 0, Kind.ANSWER, now, now + LIFE, body=body))

    def _post(self, message: Message) -> None:
        deadline = None if isinf(message.deadline) else message.deadline + self.zero
        self.delivery.post(
            message.kind,
            self._clock.now(),
            text=message.text,
            deadline=deadline,
            standing=message.standing,
            body=message.body,
        )

    def flush(self) -> None:
        """Send what has been said; nothing else is due before we have listened."""
        for datagram in self.delivery.posted():
            self.transport.send(datagram)

    def _step(self, now: float) -> None:
        if self.delivery.admission.robot:
            self._tell_missed(now)
        out, freed = self.delivery.step(now)
        for datagram in out:
            self.transport.send(datagram)
        self._hear(freed, now)

    def _tell_missed(self, now: float) -> None:
        """Report the commands that never came and would come too late, those of a second at once."""
        self.miss(self.delivery.skipped())
        if not self._missed or now < self._report_at:
            return
        ids = []
        for skipped in self._missed[:MAX_REPORTED]:
            key = self.delivery.admission.trust.find(skipped.key)
            ids.append(message_id(key.owner if key else skipped.key.hex(), skipped.epoch, skipped.sequence))
        body: dict[str, object] = {"label": "missed", "values": [float(len(self._missed))], MISSED: ids}
        self.delivery.post(Kind.REPORT, now, body=body)
        self._missed, self._report_at = [], now + REPORT_EVERY

    def _hear(self, messages: list[Message], now: float) -> None:
        self.hear(to_mind_time(message, self.zero, self.delivery.admission, now) for message in messages)


def to_mind_time(message: Message, zero: float, admission: Admission, now: float) -> Message:
    """A message that was heard `now`, with its times as those of a mind, which began at `zero`, s of Unix time. A
    deadline is of its sender's clock: what the door has seen of how that differs from ours is reckoned with."""
    deadline = message.deadline + admission.offsets.of(message.sender, now) - zero
    return msgspec.structs.replace(message, issued=message.issued - zero, deadline=deadline, heard=now - zero)


def _within(asked: Message) -> float:
    """Seconds over which answers to a message are to be spread; 0 where it says nothing that can be meant."""
    match asked.body.get(WITHIN):
        case float() | int() as within if 0.0 < within <= MAX_SPREAD:
            return float(within)
    return 0.0


def receiver_name(names: Sequence[str]) -> str:
    """Under which name robots of these names hear: of the first one, if need be cut short, and how many more."""
    more = f"+{len(names) - 1}"
    return names[0][: MAX_NAME - len(more)] + more


class Receiver:
    """See the module. port: what brings datagrams; delivery: whose digests and requests speak for all; clock: Unix
    time, s; zero: when the minds' time began."""

    def __init__(self, port: Port, delivery: ReliableDelivery, clock: Clock, zero: float = 0.0) -> None:
        self.delivery, self.zero = delivery, zero
        self._port, self._clock = port, clock
        delivery.start(clock.now())

    @property
    def waits(self) -> bool:
        """Whether something has come that nobody has looked at."""
        return bool(self._port.waiting)

    def due(self) -> float:
        """When `tend` has something to do next even if nothing comes, s of Unix time."""
        return self.delivery.due()

    def take(self) -> list[Message]:
        """What has come and can be dealt with now, with the times of the minds."""
        found: list[Message] = []
        for datagram in self._port.drain():
            now = self._clock.now()
            found += self._in_time(self.delivery.take(datagram, now), now)
        return found

    def tend(self) -> list[Message]:
        """Mend, and send what is due; gives what waits no longer."""
        now = self._clock.now()
        out, freed = self.delivery.step(now)
        for datagram in out:
            self._port.send(datagram)
        return self._in_time(freed, now)

    def skipped(self) -> list[Skipped]:
        """The commands that never came, since this was asked last."""
        return self.delivery.skipped()

    def close(self) -> None:
        """Leave the trunk."""
        self._port.close()

    def _in_time(self, messages: Iterable[Message], now: float) -> list[Message]:
        return [to_mind_time(message, self.zero, self.delivery.admission, now) for message in messages]
