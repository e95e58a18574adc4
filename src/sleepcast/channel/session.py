"""A session: one party's connection to the channel. It joins a transport, reliable delivery, and the time of a mind.

A session never waits unless it is asked to; `wait` repairs and receives while its owner is idle. Answers requested
within a time are spread over it at random, so that a thousand robots do not answer at once. An answer is sent once;
an operator who has missed some requests them by the robots' names, which the session handles itself, without the
mind.

Many robots of one process share one `Receiver`, as one computer has one radio for any number of minds. It checks,
orders and repairs messages of others once for all of them, and passes them to every robot, which decides itself
whether it is addressed. Each robot sends through its own session, with its own name and numbers; what one robot
tells the others reaches its neighbours through the same receiver.
"""

from __future__ import annotations

import select
from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from heapq import heappop, heappush
from itertools import count
from math import inf, isinf, nan
from random import Random
from typing import Protocol

import msgspec

from sleepcast.channel.admission import Admission
from sleepcast.channel.answer_budget import HELD_BACK, LEAST_ANSWER, AnswerBudget, BudgetDecision
from sleepcast.channel.drops import DropCounter, DropReason
from sleepcast.channel.envelope import MAX_CONTENT, content_of, encoded_size, kind_of
from sleepcast.channel.fair_table import FairTable
from sleepcast.channel.message import (
    AGAIN,
    FOR,
    MAX_NAME,
    MISSED,
    NOT,
    OTHERS,
    TO_OPERATOR,
    WITHIN,
    Kind,
    Message,
    answer_body,
    is_addressed,
    message_id,
)
from sleepcast.channel.reliable import LIFE, ReliableDelivery
from sleepcast.channel.sequencer import Skipped
from sleepcast.channel.transports.transport import Transport, listen_for
from sleepcast.core.clock import Clock
from sleepcast.core.records import NamedTuple

MAX_SPREAD = 60.0
"""Seconds over which answers may be spread."""
_MAX_ASKED = 256
"""Messages of which is remembered who sent them, and in which time they are to be answered. Beyond, one of the key that
has the most gives way, as among the answers."""
_UNANSWERED = TO_OPERATOR | {Kind.REQUEST}
MAX_ANSWERED = 64
"""Answers that can be sent again, as many as a robot can explain."""
_MAX_REPORTED = 8
"""Ids of missed commands in one report; if there are more, only their number is sent."""
GATHER_FOR = 0.001
"""Seconds to wait after something was received, so that datagrams which arrive close together are handled together: a
flood does not wake us for each datagram."""
GATHER_ANSWERS = 0.02
"""The same for an operator, who has to hear a thousand robots in a second: a person does not see the difference, and
each waking takes as much time as an answer."""
_CROWD = 256
"""Datagrams that come together only in a flood: an operator then takes what comes at once, before there is no room for
more."""
_REPORT_EVERY = 1.0
"""Seconds between two such reports."""
_MAX_HELD = 1_024
"""Delayed answers; beyond, the earliest is sent at once."""
MAX_FAULT = 1_000
"""Characters of a fault in an answer; the rest is cut off."""


class AnswerTerms(NamedTuple):
    """Who wants an answer: the id of the key, "" if unknown; and over how many s it is to be spread."""

    key: str = ""
    within: float = 0.0


class DelayedAnswer(msgspec.Struct, order=True):
    """An answer to be sent at a time (s of Unix time)."""

    time: float
    tie: int
    message: Message


class ChannelSession:
    """A `Channel` in the time of a mind; messages get their numbers when they are sent.

    clock: Unix time, s
    chance: for the times of answers
    zero: start of the mind's time, s of Unix time
    listens: whether it receives for itself; otherwise a `Receiver` does, and its owner passes messages on
    answers: what questions may cost, shared by all robots of a process; None: this session is alone
    ends: called on close
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
        answers: AnswerBudget | None = None,
    ) -> None:
        self.transport, self.delivery, self.zero = transport, delivery, zero
        self._clock, self._chance, self._answers = clock, chance, answers or AnswerBudget()
        self._answers.robots += delivery.admission.robot
        self.conflicts = delivery.admission.conflicts
        """Whose names others have as well; of the receiver, where it is shared."""
        self.ends: list[Callable[[], None]] = []
        self._heard: list[Message] = []
        self._missed: list[Skipped] = []
        self._report_at = -inf
        self._asked = FairTable[str, AnswerTerms, str](_MAX_ASKED)
        self._answered = FairTable[str, Message, str](MAX_ANSWERED)
        self._delayed: list[DelayedAnswer] = []
        self._tie = count()
        self._crowded = False
        if listens:
            delivery.start(clock.now())

    def send(self, message: Message) -> None:
        """Send a message: an answer at its random time, any other at once. Raises MessageError if it is too long."""
        if message.kind is Kind.ANSWER:
            command = str(message.body.get("command"))
            asked = self._asked.get(command) or AnswerTerms()
            fitting = self._fitting(message, command, asked.key)
            if fitting is None:
                return
            self._answered.put(asked.key, command, fitting)
            self._delay(fitting, asked.within)
        else:
            self._post(message)
        self.flush()

    def receive(self) -> list[Message]:
        """The messages received since the last call that can be handled now."""
        self.pump()
        return self.heard()

    def pump(self) -> bool:
        """Receive, repair, and send what is due; whether anything came."""
        came = self.transport.receive()
        self._crowded = len(came) > _CROWD
        self._read(came)
        self.tend()
        return bool(came)

    def stops(self) -> list[Message]:
        """The STOPs received since the last call of this or `receive`. All else waits, unread."""
        self._read(self.transport.receive_stops())
        stops = [message for message in self._heard if message.kind is Kind.STOP]
        self._heard = [message for message in self._heard if message.kind is not Kind.STOP]
        return stops

    def _read(self, datagrams: Iterable[bytes]) -> None:
        messages: list[Message] = []
        for datagram in datagrams:
            messages += self.delivery.take(datagram, self._clock.now())
        self._hear(messages + self.delivery.turned_away(), self._clock.now())

    def hear(self, messages: Iterable[Message]) -> None:
        """Take in received messages, with the times of our mind."""
        for message in messages:
            if message.kind is Kind.ASK and self._answers.has_refused(message):
                if is_addressed(message.body, self.delivery.name):  # we answer in place of the mind
                    now = self._clock.now() - self.zero
                    self.send(self._answer(message.id, "fault", HELD_BACK, now, now + LIFE))
                continue
            if message.kind is Kind.ASK and AGAIN in message.body:
                self._say_again(message)
                continue
            if message.kind not in _UNANSWERED:
                self._asked.put(message.key, message.id, AnswerTerms(message.key, _within(message)))
            self._heard.append(message)

    def miss(self, skipped: Iterable[Skipped]) -> None:
        """Note commands that never arrived, and are now too late."""
        self._missed += skipped

    def tend(self) -> None:
        """Repair, and send what is due."""
        now = self._clock.now()
        while self._delayed and self._delayed[0].time <= now:
            self._post(heappop(self._delayed).message)
        if self.delivery.admission.robot:
            self._tell_missed(now)
        out, freed = self.delivery.step(now)
        for datagram in out:
            self.transport.send(datagram)
        self._hear(freed, now)

    def heard(self) -> list[Message]:
        """The messages taken in since the last call."""
        messages, self._heard = self._heard, []
        return messages

    def due(self) -> float:
        """When to call `receive` next even if nothing comes, s of Unix time."""
        return -inf if self._heard else self.pump_due()

    def wait(self, seconds: float) -> None:
        """Pump for some seconds; a robot that receives STOP stops waiting."""
        wait_together([self], self.transport, seconds, self._clock)

    def listen(self, seconds: float, gather: float = GATHER_ANSWERS) -> None:
        """Wait until something has come to an operator, and `gather` s longer for what comes with it, or until
        something is to be sent: the next copy of a STOP is not to be late. At most so many seconds; nothing is received
        yet."""
        now = self._clock.now()
        until = min(now + seconds, self.pump_due())
        if until <= now:
            return
        came, _, _ = select.select([self.transport], [], [], until - now)
        if came:
            longer = GATHER_FOR if self._crowded else gather
            select.select([], [], [], max(0.0, min(longer, until - self._clock.now())))

    def close(self) -> None:
        """Leave the channel. Nothing can be sent or received afterwards."""
        self.transport.close()
        self._answers.robots -= self.delivery.admission.robot
        for end in self.ends:
            end()

    @property
    def has_stop(self) -> bool:
        """Whether a robot has received a STOP, which does not wait for the next tick."""
        return self.delivery.admission.robot and any(message.kind is Kind.STOP for message in self._heard)

    @property
    def is_catching_up(self) -> bool:
        """Whether a robot misses standing commands of others: see `CatchingUp`."""
        return self.delivery.is_catching_up(self._clock.now())

    def pump_due(self) -> float:
        """When to call `pump` next even if nothing comes, s of Unix time."""
        due = self.delivery.due()
        return min(due, self._delayed[0].time) if self._delayed else due

    def _delay(self, answer: Message, within: float) -> None:
        """Send an answer at a random moment within this many seconds; at once if 0."""
        if within == 0.0:
            self._post(answer)
            return
        when = self._clock.now() + self._chance.uniform(0.0, within)
        heappush(self._delayed, DelayedAnswer(when, next(self._tie), answer))
        if len(self._delayed) > _MAX_HELD:
            self._post(heappop(self._delayed).message)

    def _say_again(self, asked: Message) -> None:
        """An operator has missed answers: send ours again if we are named as missing, or not named as received."""
        named, heard = asked.body.get(FOR), asked.body.get(NOT)
        answer, name = self._answered.get(str(asked.body[AGAIN])), self.delivery.name
        missed = name in named if isinstance(named, list) else isinstance(heard, list) and name not in heard
        if answer is None or not missed:
            return
        if any(held.message is answer for held in self._delayed):
            return  # it is about to be sent anyway
        if self._answers.answer(asked.key, self._size(answer), self._clock.now()):
            self._delay(answer, _within(asked))
        else:
            _count_held_back(self.delivery.admission, asked.key)

    def _answer(self, command: str, outcome: str, fault: str, issued: float, deadline: float) -> Message:
        body = answer_body(command, outcome, nan, fault)
        return Message(self.delivery.name, self.delivery.epoch, 0, Kind.ANSWER, issued, deadline, body=body)

    def _fitting(self, answer: Message, command: str, asker: str) -> Message | None:
        """An answer as it may be sent: with a fault in its place if it is too long, or more than its asker (the id of
        a key) may have; None if not even that."""
        fault, now = answer.body.get("fault"), self._clock.now()
        if isinstance(fault, str) and len(fault) > MAX_FAULT:
            answer = msgspec.structs.replace(answer, body={**answer.body, "fault": f"{fault[:MAX_FAULT]} ..."})
        if answer.body.get("outcome") != "answer":
            if fault:
                self._answers.spend(asker, self._size(answer) - LEAST_ANSWER, now)
            return answer
        length = len(content_of(answer.text, answer.body))
        if length > MAX_CONTENT:
            fault = f"the answer has {length:,} bytes, and a message has room for {MAX_CONTENT:,}"
            return self._answer(command, "fault", fault, answer.issued, answer.deadline)
        if self._answers.answer(asker, self._size(answer) - LEAST_ANSWER, now):
            return answer
        _count_held_back(self.delivery.admission, asker)
        if self._answers.may_tell(asker, self.delivery.name, now):
            return self._answer(command, "fault", HELD_BACK, answer.issued, answer.deadline)
        return None

    def _size(self, message: Message) -> int:
        return encoded_size(message, self.delivery.admission.fleet)

    def _post(self, message: Message) -> None:
        deadline, now = None if isinf(message.deadline) else message.deadline + self.zero, self._clock.now()
        body = message.body
        if message.kind is Kind.ANSWER and (others := self.conflicts.others(self.delivery.name, now)):
            telling = {**body, OTHERS: others}  # of other robots with our name, where there is room for that
            body = telling if len(content_of(message.text, telling)) <= MAX_CONTENT else body
        self.delivery.post(
            message.kind, now, text=message.text, deadline=deadline, standing=message.standing, body=body
        )

    def flush(self) -> None:
        """Send what was queued; anything else is due only after we have listened."""
        for datagram in self.delivery.posted():
            self.transport.send(datagram)

    def _tell_missed(self, now: float) -> None:
        """Report the commands that never arrived and are now too late, at most once in `_REPORT_EVERY`."""
        self.miss(self.delivery.skipped())
        if not self._missed or now < self._report_at:
            return
        ids = []
        for skipped in self._missed[:_MAX_REPORTED]:
            key = self.delivery.admission.trust.find(skipped.key)
            ids.append(message_id(key.owner if key else skipped.key.hex(), skipped.epoch, skipped.sequence))
        body: dict[str, object] = {"label": "missed", "values": [float(len(self._missed))], MISSED: ids}
        self.delivery.post(Kind.REPORT, now, body=body)
        self._missed, self._report_at = [], now + _REPORT_EVERY

    def _hear(self, messages: list[Message], now: float) -> None:
        admission = self.delivery.admission
        if admission.robot:
            messages = sift(messages, self._answers, (self.delivery.name,), admission, now)
        self.hear([to_mind_time(message, self.zero, admission, now) for message in messages])


class Waitable(Protocol):
    """What is readable when something was received."""

    def fileno(self) -> int: ...


def wait_together(sessions: Sequence[ChannelSession], received: Waitable, seconds: float, clock: Clock) -> None:
    """Pump all these sessions, which receive by one transport, for some seconds, or until a robot among them has
    received STOP. received: that transport, or the multiplexer that shares it. clock: Unix time, s."""
    until = clock.now() + seconds
    while (now := clock.now()) < until and not any(session.has_stop for session in sessions):
        due = min((session.pump_due() for session in sessions), default=inf)
        select.select([received], [], [], max(0.0, min(until, due) - now))
        came = [session.pump() for session in sessions]
        if any(came) and not any(session.has_stop for session in sessions):
            select.select([], [], [], max(0.0, min(GATHER_FOR, until - clock.now())))


def sift(
    messages: Iterable[Message], answers: AnswerBudget, names: Collection[str], admission: Admission, now: float
) -> list[Message]:
    """The messages to robots of these names without the questions that are held back at `now` (s of Unix time); those
    that robots are to refuse are among them, see `AnswerBudget.has_refused`."""
    let_in = []
    for message in messages:
        if message.kind is Kind.ASK:
            verdict = answers.ask(message, names, now)
            if verdict is not BudgetDecision.LET_IN:
                _count_held_back(admission, message.key)
            if verdict is BudgetDecision.DROPPED:
                continue
        let_in.append(message)
    return let_in


def _count_held_back(admission: Admission, asker: str) -> None:
    admission.drops.add(DropReason.HELD_BACK, bytes.fromhex(asker))


def to_mind_time(message: Message, zero: float, admission: Admission, now: float) -> Message:
    """A message received at `now`, in the time of a mind that began at `zero`, s of Unix time. Its deadline is by the
    sender's clock, so the measured clock offset is added."""
    offset = admission.offsets.of(message.sender, now)
    if not (zero or offset):  # an operator's time is that of the channel, and a copy would cost as much as reading it
        msgspec.structs.force_setattr(message, "heard", now)
        return message
    deadline = message.deadline + offset - zero
    return msgspec.structs.replace(message, issued=message.issued - zero, deadline=deadline, heard=now - zero)


def _within(asked: Message) -> float:
    """Seconds over which answers to a message are to be spread; 0 if missing or malformed."""
    match asked.body.get(WITHIN):
        case float() | int() as within if 0.0 < within <= MAX_SPREAD:
            return float(within)
    return 0.0


def receiver_name(names: Sequence[str]) -> str:
    """The name under which these robots receive: the first one's, cut if necessary, and how many more there are."""
    more = f"+{len(names) - 1}"
    return names[0][: MAX_NAME - len(more)] + more


class Receiver:
    """Receives for many robots of one process.

    port: brings datagrams
    delivery: sends digests and requests for all
    clock: Unix time, s
    zero: when the minds' time began
    names: of the robots
    answers: see `ChannelSession`
    """

    def __init__(
        self,
        port: Port,
        delivery: ReliableDelivery,
        clock: Clock,
        zero: float = 0.0,
        *,
        names: Collection[str] = (),
        answers: AnswerBudget | None = None,
    ) -> None:
        self.delivery, self.zero = delivery, zero
        self._port, self._clock, self._names, self._answers = port, clock, frozenset(names), answers or AnswerBudget()
        delivery.start(clock.now())

    @property
    def waits(self) -> bool:
        """Whether datagrams wait to be taken."""
        return bool(self._port.waiting)

    def stops(self) -> list[Message]:
        """The STOPs among them, in the time of the minds. All else waits, unread."""
        return self._read(self._port.receive_stops())

    def due(self) -> float:
        """When to call `tend` next even if nothing comes, s of Unix time."""
        return self.delivery.due()

    def take(self) -> list[Message]:
        """The received messages that can be handled now, in the time of the minds."""
        return self._read(self._port.drain())

    def tend(self) -> list[Message]:
        """Repair, and send what is due; returns the messages that need not wait any longer."""
        now = self._clock.now()
        out, freed = self.delivery.step(now)
        for datagram in out:
            self._port.send(datagram)
        return self._in_time(freed, now)

    def skipped(self) -> list[Skipped]:
        """The commands that never arrived, since the last call."""
        return self.delivery.skipped()

    @property
    def is_catching_up(self) -> bool:
        """See `ChannelSession.is_catching_up`."""
        return self.delivery.is_catching_up(self._clock.now())

    def close(self) -> None:
        """Leave the multiplexer."""
        self._port.close()

    def _read(self, datagrams: Iterable[bytes]) -> list[Message]:
        messages: list[Message] = []
        for datagram in datagrams:
            now = self._clock.now()
            messages += self._in_time(self.delivery.take(datagram, now), now)
        return messages + self._in_time(self.delivery.turned_away(), self._clock.now())

    def _in_time(self, messages: Iterable[Message], now: float) -> list[Message]:
        admission = self.delivery.admission
        let_in = sift(messages, self._answers, self._names, admission, now)
        return [to_mind_time(message, self.zero, admission, now) for message in let_in]


# ---- one transport for many parties of one process, each with a port that is a transport for it


MAX_QUEUE = 8_192
"""Datagrams waiting at one port; beyond, the oldest are dropped. Ports share the bytes: ten megabytes for all."""


class Multiplexer:
    """See the module. drops: counts datagrams that are dropped here, with those that its parties drop. answers: what
    questions to robots among its parties may cost."""

    def __init__(self, transport: Transport, drops: DropCounter) -> None:
        self.drops, self.answers = drops, AnswerBudget()
        self._transport = transport
        self._ports: list[Port] = []
        self._listening: list[Port] = []
        self._wanted: frozenset[Kind] = frozenset()

    def fileno(self) -> int:
        """A file descriptor that is readable when something was received from the network."""
        return self._transport.fileno()

    def port(self, wanted: Iterable[Kind]) -> Port:
        """The transport of one more party, which wants only these kinds."""
        port = Port(self, frozenset(wanted))
        self._ports.append(port)
        if port.wanted:  # most ports only send
            self._listening.append(port)
            self._listen()
        return port

    def gather(self) -> bool:
        """Distribute the datagrams received since the last call to the ports; whether there were any."""
        came = self._transport.receive()
        for datagram in came:
            self._distribute(datagram, None)
        return bool(came)

    def gather_stops(self) -> None:
        """Distribute the STOPs that have been received, and nothing else."""
        for datagram in self._transport.receive_stops():
            self._distribute(datagram, None)

    def send(self, datagram: bytes, sender: Port) -> None:
        """Send a datagram of this port's party."""
        self._transport.send(datagram)
        self._distribute(datagram, sender)

    def leave(self, port: Port) -> None:
        """Remove a port; the last one closes the transport."""
        if port in self._ports:
            self._ports.remove(port)
            if not self._ports:
                self._transport.close()
            elif port in self._listening:
                self._listening.remove(port)
                self._listen()

    def _listen(self) -> None:
        """Let the transport drop the kinds that no port wants."""
        wanted = frozenset[Kind]().union(*(port.wanted for port in self._listening))
        if wanted != self._wanted:
            self._wanted = wanted
            listen_for(self._transport, wanted)

    def _distribute(self, datagram: bytes, sender: Port | None) -> None:
        kind = kind_of(datagram)
        if kind not in self._wanted:
            if sender is None:
                self.drops.add(DropReason.MALFORMED if kind is None else DropReason.NOT_FOR_US)
            return
        for port in self._listening:
            if port is not sender and kind in port.wanted:
                port.waiting.append(datagram)


class Port:
    """One party's transport on a multiplexer. wanted: kinds that it receives. waiting: datagrams not received yet."""

    def __init__(self, multiplexer: Multiplexer, wanted: frozenset[Kind]) -> None:
        self.wanted = wanted
        self.waiting: deque[bytes] = deque(maxlen=MAX_QUEUE)
        self._multiplexer = multiplexer

    def fileno(self) -> int:
        """Readable when something was received from the network; datagrams of other ports are here already."""
        return self._multiplexer.fileno()

    def send(self, datagram: bytes) -> None:
        """Broadcast."""
        self._multiplexer.send(datagram, self)

    def receive(self) -> list[bytes]:
        """See `Transport.receive`."""
        self._multiplexer.gather()
        return self.drain()

    def receive_stops(self) -> list[bytes]:
        """See `Transport.receive_stops`."""
        self._multiplexer.gather_stops()
        stops = [datagram for datagram in self.waiting if kind_of(datagram) is Kind.STOP]
        if stops:
            others = [datagram for datagram in self.waiting if kind_of(datagram) is not Kind.STOP]
            self.waiting.clear()
            self.waiting.extend(others)
        return stops

    def drain(self) -> list[bytes]:
        """The datagrams that wait here, without reading from the network."""
        datagrams = list(self.waiting)
        self.waiting.clear()
        return datagrams

    def close(self) -> None:
        """See `Transport.close`."""
        self._multiplexer.leave(self)
