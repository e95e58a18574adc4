"""The radio of a simulated swarm, in this process: range, loss, delay, duplication and reordering, all from
the seed.

Parties have numbers: the robots 0 to n - 1, the operator `OPERATOR`. What happens to a copy of a message is
a pure function of the seed, who sends what and when, and who receives it; neither the order of the calls nor
what else is on the air changes it. A copy waits until its time has come, then its receiver can have it.

All copies of a message are one thing with an array of receivers, and so are the answers of many robots to the
operator (a `MessageBatch`): a broadcast to a million robots and what comes back cost a few arrays, not millions of
objects.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.in_flight import CopyChance, InFlight, Numbers, Reception, Seconds, receptions, single
from sleepcast.channel.message import TO_OPERATOR, Kind, Message
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.channel.serialized import RadioState, ascending, dump_in_flight, dump_sent, load_in_flight, load_sent
from sleepcast.channel.transmit_queue import TransmitQueue
from sleepcast.core.clock import Clock
from sleepcast.core.counter_rng import key, uniform
from sleepcast.core.errors import MisuseError
from sleepcast.core.serial import Array, SerialError, within

OPERATOR = -1
"""The operator's number among the parties."""
MAX_WAITING = 16_000_000
"""Copies on their way at one time: sixteen messages to a million robots, in a quarter of a gigabyte. What is sent
beyond is refused, counted."""

URGENT = frozenset({Kind.STOP, Kind.RELEASE})
"""What goes on the air before all that waits."""

_Metres = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RadioModel:
    """How good the radio is.

    reach: m from one robot to another. operator: where the operator sits (x, y in m; None: within reach of
    everybody), operator_reach: m between the operator and a robot. loss, duplication, reordering: chances,
    0..1, for each copy. delay: s that every copy takes; jitter: up to so many s more, drawn evenly.
    held_back: s by which a reordered copy comes later. rate: messages in a second that one party can send, and
    queue: how many of its own wait for that; see `turns`. Raises MisuseError for what cannot be.
    """

    reach: float = inf
    operator: tuple[float, float] | None = None
    operator_reach: float = inf
    loss: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    held_back: float = 1.0
    rate: float = inf
    queue: int = 16

    def __post_init__(self) -> None:
        for name in ("loss", "duplication", "reordering"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise MisuseError(f"the radio's {name} is a chance from 0 to 1, not {getattr(self, name)}")
        for name in ("reach", "operator_reach", "delay", "jitter", "held_back"):
            if not getattr(self, name) >= 0.0:
                raise MisuseError(f"the radio's {name} must be 0 or more, not {getattr(self, name)}")
        if not self.rate > 0.0 or self.queue < 0:
            raise MisuseError(
                f"the radio's rate must be above 0 and its queue 0 or more, not {self.rate}, {self.queue}"
            )


@dataclass(slots=True)
class RadioCounts:
    """Copies so far: meant for a receiver, put into an inbox, and what became of the others. crowded: messages that
    never went on the air, because too many of their sender waited."""

    sent: int = 0
    delivered: int = 0
    out_of_reach: int = 0
    lost: int = 0
    duplicated: int = 0
    refused: int = 0
    crowded: int = 0


class Radio:
    """The air between the robots at `x`, `y` and their operator; see the module.

    x, y: metres, float64, shape (robots,); they are looked at whenever something is sent, never copied.
    clock: the swarm's; it alone says when anything happens.
    """

    def __init__(self, model: RadioModel, x: _Metres, y: _Metres, *, seed: int, clock: Clock) -> None:
        self.model = model
        self.counts = RadioCounts()
        self._x, self._y, self._seed, self._clock = x, y, seed, clock
        self._count = len(x)
        self._waiting: list[InFlight] = []
        self._on_the_way = 0
        """Copies in all that waits."""
        self._heard: list[Reception] = []
        """What robots could have had already."""
        self._for_operator: list[Message | MessageBatch] = []
        self._repeats: Counter[tuple[int, str]] = Counter()
        self._repeats_at = -inf
        self.turns = TransmitQueue(len(x) + 1, model.rate, model.queue) if model.rate < inf else None
        """When each party's transmitter is free, the operator's last; None where all can send as much as they like."""

    def endpoint(self, number: int) -> Endpoint:
        """The channel as party `number` has it."""
        return Endpoint(self, number)

    def send(self, transmitter: int, message: Message) -> None:
        """Put `message` on the air: a robot's answers and reports to the operator, all else to the robots in
        reach."""
        now = begin = self._clock.now()
        if self.turns:
            begins, room = self.turns.take(np.array([transmitter]), now, urgent=message.kind in URGENT)
            if not room[0]:
                self.counts.crowded += 1
                return
            begin = float(begins[0])
        meant, found = self._receivers(transmitter, message)
        self.counts.sent += len(meant)
        self.counts.out_of_reach += len(meant) - len(found)
        repeat = self._repeat(transmitter, message, now)
        chance = (self._seed, transmitter, message.id, message.kind.value, now, repeat)
        first = (transmitter, message.epoch, message.sequence, repeat)
        launch = InFlight((*first, 0), message, found, begin)
        self._launch(launch, CopyChance(lambda what: key(*chance, *what), found))

    def send_all(self, chorus: MessageBatch) -> None:
        """The same for what many robots say at once; to the loss and delay of each it makes no difference."""
        if chorus.kind not in TO_OPERATOR:
            for robot, message in zip(chorus.robots.tolist(), chorus.messages(), strict=True):
                self.send(robot, message)
            return
        now, near = self._clock.now(), self._near_operator()
        begin: Seconds | float = now
        if self.turns:
            begins, room = self.turns.take(chorus.robots, now)
            self.counts.crowded += int(np.count_nonzero(~room))
            chorus, begin = chorus.take(room), begins[room]
        self.counts.sent += len(chorus)
        if near is not None:
            heard = near[chorus.robots]
            self.counts.out_of_reach += int(np.count_nonzero(~heard))
            chorus = chorus.take(heard)
            begin = begin if isinstance(begin, float) else begin[heard]
        if len(chorus):
            operator = np.broadcast_to(np.int64(OPERATOR), len(chorus))
            order = (int(chorus.robots[0]), chorus.epoch, int(chorus.sequences[0]), 0, 0)
            about = (chorus.kind.value, now, 0)
            fate = CopyChance(
                lambda what: np.array([key(self._seed, *each, *about, *what) for each in chorus.ids()], np.uint64),
                operator,
            )
            self._launch(InFlight(order, chorus, operator, begin), fate)

    def receive(self, number: int) -> list[Message]:
        """What party `number` has heard since it last asked, in the order of arrival."""
        if number == OPERATOR:
            return list(single(self.hear()))
        self._deliver()
        found = [message for message, robots in self._heard if number in robots]
        left = [(message, robots[robots != number]) for message, robots in self._heard]
        self._heard = [(message, robots) for message, robots in left if robots.size]
        return found

    def receive_all(self) -> list[Reception]:
        """What the robots have heard since they were last asked: each robot finds its messages in their order. Of two
        copies of a message that arrive together a robot gets both, in two batches."""
        self._deliver()
        heard, self._heard = self._heard, []
        return heard

    def hear(self) -> list[Message | MessageBatch]:
        """What the operator has heard since it last asked, what many robots said at once in one piece."""
        self._deliver()
        heard, self._for_operator = self._for_operator, []
        return heard

    def samples(self) -> Numbers:
        """The robots from which a sample sent to the operator just now gets through."""
        near = self._near_operator()
        robots = self._everybody() if near is None else np.flatnonzero(near)
        if self.model.loss:
            robots = robots[self._drawn(robots, (self._seed, "sample", self._clock.now())) >= self.model.loss]
        return robots

    def _receivers(self, transmitter: int, message: Message) -> tuple[Numbers, Numbers]:
        """Who should hear this, and those of them who are in reach."""
        if transmitter == OPERATOR:
            near, everybody = self._near_operator(), self._everybody()
            return everybody, everybody if near is None else everybody[near]
        if message.kind in TO_OPERATOR:
            near = self._near_operator()
            operator = np.array([OPERATOR], np.int64)
            return operator, operator if near is None or near[transmitter] else operator[:0]
        others = np.delete(self._everybody(), transmitter)
        if self.model.reach == inf:
            return others, others
        near = self._within(float(self._x[transmitter]), float(self._y[transmitter]), self.model.reach)
        return others, others[near[others]]

    def _everybody(self) -> Numbers:
        """All robots."""
        return np.arange(self._count, dtype=np.int64)

    def _near_operator(self) -> NDArray[np.bool_] | None:
        """Whether each robot and the operator are in each other's reach; None if all are."""
        if self.model.operator is None or self.model.operator_reach == inf:
            return None
        return self._within(*self.model.operator, self.model.operator_reach)

    def _within(self, x: float, y: float, reach: float) -> NDArray[np.bool_]:
        across, up = self._x - x, self._y - y
        near: NDArray[np.bool_] = across * across + up * up <= reach * reach
        return near

    def _repeat(self, transmitter: int, message: Message, now: float) -> int:
        """How often this very message was sent before at this very time: a repeat has a fate of its own."""
        if now != self._repeats_at:
            self._repeats.clear()
            self._repeats_at = now
        said = self._repeats[transmitter, message.id]
        self._repeats[transmitter, message.id] = said + 1
        return said

    def _launch(self, launch: InFlight, fate: CopyChance) -> None:
        """Send copies on their way, a second one of some."""
        twice = None
        if self.model.duplication:
            twice = fate.drawn("twice") < self.model.duplication
            self.counts.duplicated += int(np.count_nonzero(twice))
        self._depart(launch, fate, copy=0)
        if twice is not None and twice.any():
            self._depart(launch, fate, copy=1, only=twice)

    def _depart(self, launch: InFlight, fate: CopyChance, *, copy: int, only: NDArray[np.bool_] | None = None) -> None:
        """Send one copy to each receiver (or to `only` some of them), unless it is lost."""
        model, kept = self.model, only
        if model.loss:
            arrives = fate.drawn("lost", copy) >= model.loss
            kept = arrives if only is None else only & arrives
            self.counts.lost += int(np.count_nonzero(~arrives if only is None else only & ~arrives))
        due = launch.due + model.delay
        if model.jitter or model.reordering:
            due = np.full(launch.size, due)
            if model.jitter:
                due += model.jitter * fate.drawn("jitter", copy)
            if model.reordering:
                due[fate.drawn("held back", copy) < model.reordering] += model.held_back
        sent = InFlight((*launch.order[:4], copy), launch.what, launch.receivers, due)
        if kept is not None:
            sent = sent.take(kept)
        room = MAX_WAITING - self._on_the_way
        if sent.size > room:
            self.counts.refused += sent.size - room
            sent = sent.take(slice(0, room))
        if sent.size:
            self._on_the_way += sent.size
            self._waiting.append(sent)

    def _drawn(self, receivers: Numbers, what: tuple[object, ...]) -> NDArray[np.float64]:
        return uniform(key(*what), receivers.astype(np.uint64))

    def _deliver(self) -> None:
        """Give every copy whose time has come to its receiver, in order of time, then of sending."""
        if not self._waiting:
            return
        now = self._clock.now()
        parts = [launch.split(now) for launch in self._waiting]
        due = [here for here, _ in parts if here is not None]
        if not due:
            return
        self._waiting = [later for _, later in parts if later is not None]
        arrived = sum(launch.size for launch in due)
        self._on_the_way -= arrived
        self.counts.delivered += arrived
        upward = [launch for launch in due if launch.receivers[0] == OPERATOR]
        downward = [launch for launch in due if launch.receivers[0] != OPERATOR]
        upward.sort(key=lambda launch: (float(np.min(launch.due)), launch.order))
        self._for_operator += [launch.what for launch in upward]
        self._heard += receptions(downward)

    # ---- kept and made again

    def state(self) -> RadioState:
        """Everything that is on its way, and what has been counted."""
        return RadioState(
            asdict(self.counts),
            [dump_in_flight(each.order, each.what, each.receivers, each.due) for each in self._waiting],
            [(message, Array.of(robots.astype(np.int32))) for message, robots in self._heard],
            [dump_sent(what) for what in self._for_operator],
            [(transmitter, message, times) for (transmitter, message), times in self._repeats.items()],
            self._repeats_at,
            Array.of(self.turns.free) if self.turns else None,
        )

    def restore(self, parcel: RadioState, names: Sequence[str]) -> None:
        """Be as that radio was. names: of the robots. Raises ParcelError."""
        count = self._count
        self._waiting = [InFlight(*load_in_flight(each, names)) for each in parcel.waiting]
        self._on_the_way = sum(launch.size for launch in self._waiting)
        if self._on_the_way > MAX_WAITING or parcel.counts.keys() != asdict(self.counts).keys():
            raise SerialError(f"a radio with {self._on_the_way} copies on their way and {len(parcel.counts)} counts")
        self._heard = [(message, ascending(robots, count)) for message, robots in parcel.heard]
        self._for_operator = [load_sent(what, names) for what in parcel.for_operator]
        self._repeats = Counter({(transmitter, message): times for transmitter, message, times in parcel.repeats})
        self._repeats_at = parcel.repeats_at
        self.counts = RadioCounts(**parcel.counts)
        if (parcel.free is None) != (self.turns is None):
            raise SerialError("transmitters that are busy where none can be")
        if self.turns and parcel.free:
            self.turns.free = parcel.free.made(np.float64, self.turns.free.shape, "when transmitters are free")
            within(self.turns.free, -inf, inf, "when transmitters are free")


class Endpoint:
    """One party's `Channel` on the radio."""

    def __init__(self, radio: Radio, number: int) -> None:
        self._radio, self._number = radio, number

    def send(self, message: Message) -> None:
        self._radio.send(self._number, message)

    def receive(self) -> list[Message]:
        return self._radio.receive(self._number)
