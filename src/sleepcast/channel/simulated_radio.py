"""The radio of a simulated swarm, in one process: range, loss, delay, duplication and reordering, all from the seed.

Parties have numbers: the robots 0 to n - 1, the operator `OPERATOR`; further operators, who sit beside the first one,
-2, -3 and so on. What happens to a copy of a message is a pure
function of the seed, its sender, content, time, and receiver; neither the order of the calls nor other traffic
changes it. A copy is in flight until it is due; then its receiver can take it.

All copies of a message are one `InFlight` with an array of receivers, and so are the answers of many robots to the
operator (a `MessageBatch`): a broadcast to a million robots costs a few arrays, not millions of objects. If the
radio has a rate, a `TransmitQueue` says when each transmitter gets to a message.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from math import inf

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import BID, TO_OPERATOR, Kind, Message
from sleepcast.channel.message_batch import MessageBatch, MessageBatchState, ascending, dump_batch, load_batch
from sleepcast.core.clock import Clock
from sleepcast.core.counter_rng import key, uniform
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.core.serial import Array, SerialError, within

Numbers = NDArray[np.int64]
Seconds = NDArray[np.float64]
Reception = tuple[Message, Numbers]
"""A message, and the robots that receive it, ascending, without repeats."""


@dataclass(slots=True)
class InFlight:
    """Copies in flight: of one message to some robots, or of a batch of messages to the operator.

    order: transmitter, epoch, sequence, repeat and copy; what is due at the same time arrives in this order.
    due: s, for each copy, or one for all. receivers: of a message; a batch goes to the operator.
    """

    order: tuple[int, int, int, int, int]
    what: Message | MessageBatch
    receivers: Numbers
    due: Seconds | float

    @property
    def size(self) -> int:
        return len(self.receivers)

    @property
    def desks(self) -> list[int]:
        """The operators who receive it: of a batch one alone."""
        numbers: list[int] = self.receivers[: 1 if isinstance(self.what, MessageBatch) else None].tolist()
        return numbers

    def take(self, which: NDArray[np.bool_] | slice) -> InFlight:
        """Some of the copies."""
        what = self.what.take(which) if isinstance(self.what, MessageBatch) else self.what
        due = self.due if isinstance(self.due, float) else self.due[which]
        return InFlight(self.order, what, self.receivers[which], due)

    def split(self, now: float) -> tuple[InFlight | None, InFlight | None]:
        """The copies that are due, and the others; None where there are none."""
        if isinstance(self.due, float):
            return (self, None) if self.due <= now else (None, self)
        here = self.due <= now
        if here.all():
            return self, None
        return (self.take(here), self.take(~here)) if here.any() else (None, self)


@dataclass(frozen=True, slots=True)
class CopyChance:
    """Random draws for each copy. keys: gives the key for a purpose, one for all copies or one for each."""

    keys: Callable[[tuple[object, ...]], int | NDArray[np.uint64]]
    receivers: Numbers

    def drawn(self, *what: object) -> NDArray[np.float64]:
        """A number from [0, 1) for each copy, uniformly distributed."""
        return uniform(self.keys(what), self.receivers.astype(np.uint64))


def _without(copies: InFlight, robots: Numbers) -> InFlight | None:
    """The copies that do not go to these robots; None if all do."""
    kept = ~np.isin(copies.receivers, robots)
    return copies if kept.all() else copies.take(kept) if kept.any() else None


def single(heard: Iterable[Message | MessageBatch]) -> Iterable[Message]:
    for each in heard:
        if isinstance(each, MessageBatch):
            yield from each.messages()
        else:
            yield each


def receptions(flights: list[InFlight]) -> list[Reception]:
    """Copies in flight as receptions, in an order in which each robot finds its messages by time, then by sending."""
    if all(isinstance(copies.due, float) for copies in flights):
        flights.sort(key=lambda copies: (copies.due, copies.order))
        return [(copies.what, copies.receivers) for copies in flights if isinstance(copies.what, Message)]
    flights.sort(key=lambda copies: copies.order)
    sizes = [copies.size for copies in flights]
    receivers = np.concatenate([copies.receivers for copies in flights])
    numbers = np.repeat(np.arange(len(flights)), sizes)
    dues = np.concatenate([np.broadcast_to(copies.due, copies.size) for copies in flights])
    sort = np.lexsort((numbers, dues, receivers))
    receivers, numbers = receivers[sort], numbers[sort]
    starts = np.flatnonzero(np.diff(receivers, prepend=-1))
    turns = np.arange(len(receivers)) - np.repeat(starts, np.diff(starts, append=len(receivers)))
    """0 for a robot's first message of these, 1 for its second, ..."""
    groups = turns * len(flights) + numbers
    sort = np.argsort(groups, kind="stable")
    ends = np.flatnonzero(np.diff(groups[sort], append=-1)) + 1
    received: list[Reception] = []
    for robots in np.split(sort, ends[:-1]):
        message = flights[numbers[robots[0]]].what
        if isinstance(message, Message):
            received.append((message, receivers[robots]))
    return received


class TransmitQueue:
    """The transmitters of `parties`: each sends one message after another, `rate` per second, while up to `queue` wait;
    further ones are dropped. Nothing here is random. free: when each has sent all its messages, s, shape (parties,)."""

    def __init__(self, parties: int, rate: float, queue: int) -> None:
        self.free: Seconds = np.full(parties, -np.inf)
        self._each, self._queue = 1.0 / rate, queue

    def take(self, senders: NDArray[np.intp], now: float, *, urgent: bool = False) -> tuple[Seconds, NDArray[np.bool_]]:
        """When each of these senders (each once) transmits a message of `now`, s, and whether there is room in its
        queue. Urgent messages go first."""
        begin = np.maximum(self.free[senders], now)
        # Messages wait until their transmission begins. The thousandth allows for rounding.
        waiting = np.ceil((begin - now) / self._each - 1e-3)
        room = np.full(len(senders), True) if urgent else waiting <= self._queue
        self.free[senders[room]] = begin[room] + self._each
        return (np.full(len(senders), now) if urgent else begin), room


OPERATOR = -1
"""The operator's number among the parties; of several the first one's."""
_NO_BID = -(2**31)
"""Stands for the caller of a message that is no bid."""
MAX_WAITING = 16_000_000
"""Copies in flight at one time: sixteen messages to a million robots, in a quarter of a gigabyte. Further ones are
refused and counted."""

_URGENT = frozenset({Kind.STOP, Kind.RELEASE})
"""Kinds that are sent before all others that wait."""

_Metres = NDArray[np.float64]
_PLAIN = (inf, inf)
_Levels = tuple[_Metres, _Metres] | None
Between = Callable[[_Metres, _Metres, _Metres, _Metres, _Levels], NDArray[np.integer] | NDArray[np.bool_]]
"""How many walls lie between points: x and y of the beginnings of lines and of their ends, and z of both where robots
fly, m; on a torus the shortest way. Where any wall is too many, whether there are any is enough."""


@dataclass(frozen=True, slots=True)
class RadioModel:
    """The quality of the radio. Raises MisuseError for invalid values.

    reach: range between robots, m
    operator: position of the operator, x and y in m; None: within reach of all
    operator_reach: range between the operator and a robot, m
    wall: by what each wall between two parties multiplies the range, 0 to 1: 1 lets all through, 0 nothing
    loss, duplication, reordering: probabilities, 0..1, for each copy
    delay: s that every copy takes
    jitter: largest additional delay, s, uniform
    held_back: delay of a reordered copy, s
    rate: messages per second that one party can send
    queue: how many of its own may wait; see `TransmitQueue`
    """

    reach: float = inf
    operator: tuple[float, float] | None = None
    operator_reach: float = inf
    wall: float = 1.0
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
        if not 0.0 <= self.wall <= 1.0:
            raise MisuseError(f"the radio's wall is a share from 0 to 1, not {self.wall}")
        if 0.0 < self.wall < 1.0 and self.reach == self.operator_reach == inf:
            raise MisuseError(
                f"the radio's wall of {self.wall:g} shortens a limited reach only: give the radio a reach, or write "
                "wall = 0 for walls that block"
            )
        if not self.rate > 0.0 or self.queue < 0:
            raise MisuseError(
                f"the radio's rate must be above 0 and its queue 0 or more, not {self.rate}, {self.queue}"
            )


@dataclass(slots=True)
class RadioCounts:
    """Copies so far: sent to a receiver, delivered, and the fate of the others. crowded: messages that were dropped
    because their sender's queue was full."""

    sent: int = 0
    delivered: int = 0
    out_of_reach: int = 0
    lost: int = 0
    duplicated: int = 0
    refused: int = 0
    crowded: int = 0


class Radio:
    """The air between the robots at `x`, `y` and their operator, who is on the ground; see the module.

    x, y: metres, float64, shape (robots,); read whenever something is sent, never copied
    z: likewise where robots fly, NaN of those on the ground; None where none does; operator_z: of the operator
    clock: the swarm's, which determines all times
    around: width and height of a torus, m; infinite for a plain world
    desks: how many operators listen
    between: how many walls lie between parties now; without it walls do not count
    party: the number of a party by its name. What a robot bids goes to its caller alone: nobody else takes it in
    numbers: of the robots, below 0 for rows of `x` and `y` without one; read whenever something is sent, never copied.
        None where each robot has its row's. Chance goes by them.
    """

    def __init__(
        self,
        model: RadioModel,
        x: _Metres,
        y: _Metres,
        *,
        seed: int,
        clock: Clock,
        around: tuple[float, float] = _PLAIN,
        desks: int = 1,
        z: _Metres | None = None,
        operator_z: float = 0.0,
        between: Between | None = None,
        party: Callable[[str], int] = lambda name: OPERATOR,
        numbers: NDArray[np.integer] | None = None,
    ) -> None:
        self._numbers = numbers
        self.desks = np.arange(OPERATOR, OPERATOR - desks, -1, dtype=np.int64)
        """The operators' numbers."""
        self.model, self.counts = model, RadioCounts()
        self._x, self._y, self._z, self._seed, self._clock, self._around = x, y, z, seed, clock, around
        self._between = between if model.wall < 1.0 else None
        self._party, self._operator_z = party, operator_z
        self._count = len(x)
        self._waiting: list[InFlight] = []
        self._on_the_way = 0
        """Copies in flight."""
        self._heard: list[Reception] = []
        """Delivered to robots, not received yet."""
        self._for_desks: dict[int, list[Message | MessageBatch]] = {number: [] for number in self.desks.tolist()}
        """Delivered to operators, not received yet."""
        self._repeats: Counter[tuple[int, str]] = Counter()
        self._repeats_at = -inf
        self.transmit_queue = TransmitQueue(len(x) + desks, model.rate, model.queue) if model.rate < inf else None
        """The robots' transmitters, and the operators' last, the first one's at the end; None without a rate."""

    def endpoint(self, number: int) -> Endpoint:
        """The `Channel` of party `number`."""
        return Endpoint(self, number)

    def send(self, transmitter: int, message: Message) -> None:
        """Send a message: a robot's answers and reports to the operator, any other to the robots in reach."""
        now = begin = self._clock.now()
        if self.transmit_queue:
            begins, room = self.transmit_queue.take(np.array([transmitter]), now, urgent=message.kind in _URGENT)
            if not room[0]:
                self.counts.crowded += 1
                return
            begin = float(begins[0])
        meant, reached = self._receivers(transmitter, message)
        self.counts.sent += len(meant)
        self.counts.out_of_reach += len(meant) - len(reached)
        repeat = self._repeat(transmitter, message, now)
        sender = int(self._numbered(np.array([transmitter]))[0])
        chance = (self._seed, sender, message.id, message.kind.value, now, repeat)
        first = (sender, message.epoch, message.sequence, repeat)
        copies = InFlight((*first, 0), message, reached, begin)
        fate = CopyChance(lambda what: key(*chance, *what), self._numbered(reached))
        self._send_copies(copies, fate)

    def send_all(self, batch: MessageBatch) -> None:
        """Send a batch; each message is lost or delayed exactly as if it were sent alone."""
        if batch.kind is Kind.REQUEST:
            self._send_bids(batch)
        elif batch.kind in TO_OPERATOR:
            self._send_up(batch, self.desks)
        else:
            for robot, message in zip(batch.robots.tolist(), batch.messages(), strict=True):
                self.send(robot, message)

    def _send_bids(self, batch: MessageBatch) -> None:
        """Send what goes to one operator as a batch, and all else message by message."""
        callers = np.array([self._caller_of(message) for message in batch.messages()], np.int64)
        for number in self.desks:
            if (own := callers == number).any():
                self._send_up(batch.take(own), np.array([number]))
        others = batch.take(~np.isin(callers, self.desks))
        for robot, message in zip(others.robots.tolist(), others.messages(), strict=True):
            self.send(robot, message)

    def _caller_of(self, message: Message) -> int:
        """The number of the party to which a bid goes; `_NO_BID` for what is none."""
        match message.body.get(BID):
            case [str() as caller, *_]:
                return self._party(caller)
        return _NO_BID

    def _send_up(self, batch: MessageBatch, desks: Numbers) -> None:
        """Send a batch to these operators."""
        now, near = self._clock.now(), self._near_operator()
        begin: Seconds | float = now
        if self.transmit_queue:
            begins, room = self.transmit_queue.take(batch.robots, now)
            self.counts.crowded += int(np.count_nonzero(~room))
            batch, begin = batch.take(room), begins[room]
        self.counts.sent += len(batch) * len(desks)
        if near is not None:
            heard = near[batch.robots]
            self.counts.out_of_reach += int(np.count_nonzero(~heard)) * len(desks)
            batch = batch.take(heard)
            begin = begin if isinstance(begin, float) else begin[heard]
        for number in desks if len(batch) else ():
            self._send_to(batch, begin, number)

    def _send_to(self, batch: MessageBatch, begin: Seconds | float, number: np.int64) -> None:
        """Send a batch to one operator, from `begin` on, s, of each message or of all."""
        operator = np.broadcast_to(number, len(batch))
        order = (int(self._numbered(batch.robots[:1])[0]), batch.epoch, int(batch.sequences[0]), 0, 0)
        about = (batch.kind.value, self._clock.now(), 0)
        fate = CopyChance(
            lambda what: np.array([key(self._seed, *each, *about, *what) for each in self._ids(batch)], np.uint64),
            operator,
        )
        self._send_copies(InFlight(order, batch, operator, begin), fate)

    def _numbered(self, robots: Numbers) -> Numbers:
        """The numbers of the robots in these rows; those of operators are their own."""
        if self._numbers is None or (robots.size and robots[0] < 0):
            return robots
        return self._numbers[robots].astype(np.int64)

    def _ids(self, batch: MessageBatch) -> Iterator[tuple[int, str]]:
        """The number of each robot with the id of its message."""
        if self._numbers is None:
            return batch.ids()
        return ((int(self._numbered(np.array([robot]))[0]), sent) for robot, sent in batch.ids())

    def turn_over(self, changed: Numbers) -> None:
        """Other robots, or none, are in these rows from now on: what was on the way there comes to nobody."""
        self._waiting = [left for each in self._waiting if (left := _without(each, changed)) is not None]
        self._on_the_way = sum(copies.size for copies in self._waiting)
        kept = ((message, robots[~np.isin(robots, changed)]) for message, robots in self._heard)
        self._heard = [(message, robots) for message, robots in kept if robots.size]
        if self.transmit_queue:
            self.transmit_queue.free[changed] = -np.inf

    def bring(self, message: Message, robots: Numbers, due: float) -> None:
        """Let these robots receive a message at `due`, s, as if others near them had handed it on."""
        room = MAX_WAITING - self._on_the_way
        self.counts.sent += len(robots)
        self.counts.refused += max(0, len(robots) - room)
        receivers = robots[:room].astype(np.int64)
        if receivers.size:
            self._on_the_way += len(receivers)
            order = (self._party(message.sender), message.epoch, message.sequence, 0, 0)
            self._waiting.append(InFlight(order, message, receivers, due))

    def receive(self, number: int) -> list[Message]:
        """The messages of party `number` since its last call, in the order of arrival."""
        if number < 0:
            return list(single(self.hear(number)))
        self._deliver()
        messages = [message for message, robots in self._heard if number in robots]
        left = [(message, robots[robots != number]) for message, robots in self._heard]
        self._heard = [(message, robots) for message, robots in left if robots.size]
        return messages

    def receive_all(self) -> list[Reception]:
        """What the robots have received since the last call: each robot finds its messages in order. Two copies of a
        message that arrive together are two receptions."""
        self._deliver()
        heard, self._heard = self._heard, []
        return heard

    def hear(self, number: int = OPERATOR) -> list[Message | MessageBatch]:
        """What this operator has received since the last call; batches stay whole."""
        self._deliver()
        heard, self._for_desks[number] = self._for_desks[number], []
        return heard

    @property
    def next_due(self) -> float:
        """When the next copy is due, s; -inf while something waits to be received, inf without any."""
        if self._heard or any(self._for_desks.values()):
            return -inf
        return min((float(np.min(copies.due)) for copies in self._waiting), default=inf)

    @property
    def reaches_all(self) -> bool:
        """Whether samples of all robots arrive, always."""
        return not self.model.loss and self._operator_is_near

    @property
    def _operator_is_near(self) -> bool:
        """Whether the operator is in reach of all, wherever they are."""
        return self.model.operator is None or (self.model.operator_reach == inf and self._between is None)

    def samples(self) -> Numbers:
        """The robots from which a sample sent to the operator now would arrive."""
        near = self._near_operator()
        robots = self._everybody()
        robots = robots if near is None else robots[near[robots]]
        if self.model.loss:
            drawn = uniform(key(self._seed, "sample", self._clock.now()), self._numbered(robots).astype(np.uint64))
            robots = robots[drawn >= self.model.loss]
        return robots

    def _receivers(self, transmitter: int, message: Message) -> tuple[Numbers, Numbers]:
        """The intended receivers of a message, and those of them in reach."""
        if transmitter < 0:
            near, everybody = self._near_operator(), self._everybody()
            return everybody, everybody if near is None else everybody[near[everybody]]
        meant = self._everybody() if message.kind not in TO_OPERATOR else self.desks
        if (caller := self._caller_of(message)) != _NO_BID:
            meant = np.array([caller], np.int64)
        if meant.size and meant[0] < 0:
            near = self._near_operator()
            return meant, meant if near is None or near[transmitter] else meant[:0]
        others = meant[meant != transmitter]
        if self.model.reach == inf and self._between is None:
            return others, others
        near = self._within(self._place_of(transmitter), self.model.reach)
        return others, others[near[others]]

    def _everybody(self) -> Numbers:
        """All robots."""
        if self._numbers is not None:
            return np.flatnonzero(self._numbers >= 0)
        return np.arange(self._count, dtype=np.int64)

    def _near_operator(self) -> NDArray[np.bool_] | None:
        """Whether each robot is in reach of the operator; None if all are."""
        if self.model.operator is None or self._operator_is_near:
            return None
        return self._within((*self.model.operator, self._operator_z), self.model.operator_reach)

    def _place_of(self, robot: int) -> tuple[float, float, float]:
        z = 0.0 if self._z is None else np.nan_to_num(self._z[robot])
        return float(self._x[robot]), float(self._y[robot]), float(z)

    def _within(self, place: tuple[float, float, float], reach: float) -> NDArray[np.bool_]:
        """Whether each robot is in reach of this place, m."""
        x, y, z = place
        dx, dy = np.abs(self._x - x), np.abs(self._y - y)
        dx, dy = np.minimum(dx, self._around[0] - dx), np.minimum(dy, self._around[1] - dy)
        square = dx * dx + dy * dy
        heights = None if self._z is None else np.nan_to_num(self._z)
        if heights is not None:
            square += (heights - z) ** 2
        near: NDArray[np.bool_] = square <= reach * reach
        if self._between is not None:
            asked = np.flatnonzero(near)
            here = np.full(len(asked), x), np.full(len(asked), y)
            levels = None if heights is None else (np.full(len(asked), z), heights[asked])
            walls = self._between(*here, self._x[asked], self._y[asked], levels).astype(np.int64)
            near[asked] = square[asked] <= self._squares(reach, walls.max(initial=0))[walls]
        return near

    def _squares(self, reach: float, walls: int) -> _Metres:
        """The square of the reach through no wall, one wall and so on, m2; below 0 where nothing comes through."""
        shares = np.multiply.accumulate(np.append(1.0, np.full(walls, self.model.wall)))  # powers are not exact
        squares: _Metres = np.where(shares > 0.0, np.square(np.where(shares > 0.0, shares, 1.0) * reach), -1.0)
        return squares

    def _repeat(self, transmitter: int, message: Message, now: float) -> int:
        """How often this message was sent before at this very time: each repeat is lost or delayed independently."""
        if now != self._repeats_at:
            self._repeats.clear()
            self._repeats_at = now
        times = self._repeats[transmitter, message.id]
        self._repeats[transmitter, message.id] = times + 1
        return times

    def _send_copies(self, copies: InFlight, fate: CopyChance) -> None:
        """Send one copy to each receiver, and a second one to some."""
        twice = None
        if self.model.duplication:
            twice = fate.drawn("twice") < self.model.duplication
            self.counts.duplicated += int(np.count_nonzero(twice))
        self._transmit(copies, fate, copy=0)
        if twice is not None and twice.any():
            self._transmit(copies, fate, copy=1, only=twice)

    def _transmit(
        self, copies: InFlight, fate: CopyChance, *, copy: int, only: NDArray[np.bool_] | None = None
    ) -> None:
        """Send one copy to each receiver (or only to those in `only`), unless it is lost."""
        model, kept = self.model, only
        if model.loss:
            arrives = fate.drawn("lost", copy) >= model.loss
            kept = arrives if only is None else only & arrives
            self.counts.lost += int(np.count_nonzero(~arrives if only is None else only & ~arrives))
        due = copies.due + model.delay
        if model.jitter or model.reordering:
            due = np.full(copies.size, due)
            if model.jitter:
                due += model.jitter * fate.drawn("jitter", copy)
            if model.reordering:
                due[fate.drawn("held back", copy) < model.reordering] += model.held_back
        sent = InFlight((*copies.order[:4], copy), copies.what, copies.receivers, due)
        if kept is not None:
            sent = sent.take(kept)
        room = MAX_WAITING - self._on_the_way
        if sent.size > room:
            self.counts.refused += sent.size - room
            sent = sent.take(slice(0, room))
        if sent.size:
            self._on_the_way += sent.size
            self._waiting.append(sent)

    def _deliver(self) -> None:
        """Deliver all copies that are due, by time, then by sending."""
        if not self._waiting:
            return
        now = self._clock.now()
        parts = [copies.split(now) for copies in self._waiting]
        due = [here for here, _ in parts if here is not None]
        if not due:
            return
        self._waiting = [later for _, later in parts if later is not None]
        arrived = sum(copies.size for copies in due)
        self._on_the_way -= arrived
        self.counts.delivered += arrived
        upward = [copies for copies in due if copies.receivers[0] < 0]
        downward = [copies for copies in due if copies.receivers[0] >= 0]
        upward.sort(key=lambda copies: (float(np.min(copies.due)), copies.order))
        for copies in upward:
            for number in copies.desks:
                self._for_desks[number].append(copies.what)
        self._heard += receptions(downward)

    # ---- saving and restoring

    def state(self) -> RadioState:
        """The radio as serialized state: copies in flight, delivered messages, counts."""
        return RadioState(
            asdict(self.counts),
            [dump_in_flight(each.order, each.what, each.receivers, each.due) for each in self._waiting],
            [(message, Array.of(robots.astype(np.int32))) for message, robots in self._heard],
            [dump_sent(what) for what in self._for_desks[OPERATOR]],
            [(transmitter, message, times) for (transmitter, message), times in self._repeats.items()],
            self._repeats_at,
            Array.of(self.transmit_queue.free) if self.transmit_queue else None,
            [[dump_sent(what) for what in self._for_desks[number]] for number in self.desks[1:].tolist()],
        )

    def restore(self, state: RadioState, names: Sequence[str]) -> None:
        """Restore serialized state. names: of the robots. Raises SerialError."""
        count = self._count
        self._waiting = [InFlight(*load_in_flight(each, names)) for each in state.waiting]
        self._on_the_way = sum(copies.size for copies in self._waiting)
        if self._on_the_way > MAX_WAITING or state.counts.keys() != asdict(self.counts).keys():
            raise SerialError(f"a radio with {self._on_the_way} copies on their way and {len(state.counts)} counts")
        self._heard = [(message, ascending(robots, count)) for message, robots in state.heard]
        if state.for_others and len(state.for_others) != len(self.desks) - 1:
            raise SerialError(f"what {len(state.for_others) + 1} operators have received, of {len(self.desks)}")
        for number, heard in zip(self.desks.tolist(), [state.for_operator, *state.for_others], strict=False):
            self._for_desks[number] = [load_sent(what, names) for what in heard]
        self._repeats = Counter({(transmitter, message): times for transmitter, message, times in state.repeats})
        self._repeats_at = state.repeats_at
        self.counts = RadioCounts(**state.counts)
        if (state.free is None) != (self.transmit_queue is None):
            raise SerialError("a radio without a rate, but with busy transmitters")
        if self.transmit_queue and state.free:
            self.transmit_queue.free = state.free.made(
                np.float64, self.transmit_queue.free.shape, "when transmitters are free"
            )
            within(self.transmit_queue.free, -inf, inf, "when transmitters are free")


class Endpoint:
    """One party's `Channel` on the radio."""

    def __init__(self, radio: Radio, number: int) -> None:
        self._radio, self._number = radio, number

    def send(self, message: Message) -> None:
        self._radio.send(self._number, message)

    def receive(self) -> list[Message]:
        return self._radio.receive(self._number)


# ---- serialized state

SendOrder = tuple[int, int, int, int, int]


class MessageState(msgspec.Struct, tag="message"):
    """One message, where there may also be a batch."""

    message: Message


class InFlightState(msgspec.Struct):
    """See `InFlight`.

    receivers: robots; None for operators
    due: of each copy, or one for all
    desks: the operators' numbers, None for the first one alone
    """

    order: SendOrder
    what: MessageState | MessageBatchState
    receivers: Array | None
    due: Array | float
    desks: list[int] | None = None


class RadioState(msgspec.Struct):
    """See `Radio`.

    heard: messages delivered to robots, and which robots
    repeats: how often each party has sent which message at the time `repeats_at`
    free: see `TransmitQueue`
    for_others: as for_operator, of each further one
    """

    counts: dict[str, int]
    waiting: list[InFlightState]
    heard: list[tuple[Message, Array]]
    for_operator: list[MessageState | MessageBatchState]
    repeats: list[tuple[int, str, int]]
    repeats_at: float
    free: Array | None
    for_others: list[list[MessageState | MessageBatchState]] = []


def dump_sent(what: Message | MessageBatch) -> MessageState | MessageBatchState:
    """A message or a batch as serialized state."""
    return MessageState(what) if isinstance(what, Message) else dump_batch(what)


def load_sent(state: MessageState | MessageBatchState, names: Sequence[str]) -> Message | MessageBatch:
    """A message or a batch from its serialized state. names: of all robots. Raises SerialError."""
    return state.message if isinstance(state, MessageState) else load_batch(state, names)


def dump_in_flight(
    order: SendOrder, what: Message | MessageBatch, receivers: Numbers, due: Seconds | float
) -> InFlightState:
    """Copies in flight as serialized state. receivers: robots, or operators."""
    up = receivers[0] < 0
    desks = InFlight(order, what, receivers, due).desks if up else []
    when = due if isinstance(due, float) else Array.of(due)
    others = desks if desks not in ([], [OPERATOR]) else None
    return InFlightState(order, dump_sent(what), None if up else Array.of(receivers.astype(np.int32)), when, others)


def load_in_flight(
    state: InFlightState, names: Sequence[str]
) -> tuple[SendOrder, Message | MessageBatch, Numbers, Seconds | float]:
    """The order, content, receivers and due times of copies in flight. Raises SerialError."""
    what = load_sent(state.what, names)
    if state.receivers is None:
        desks = np.array([OPERATOR] if state.desks is None else state.desks, np.int64)
        if desks.size == 0 or (desks >= 0).any():
            raise SerialError("copies in flight to operators that are none")
        receivers = np.broadcast_to(desks[0], len(what)) if isinstance(what, MessageBatch) else desks
    elif isinstance(what, MessageBatch):
        raise SerialError("a message batch that goes to robots")
    else:
        receivers = ascending(state.receivers, len(names)).astype(np.int64)
    due = state.due if isinstance(state.due, float) else state.due.made(np.float64, receivers.shape, "due times")
    if receivers.size == 0 or np.isnan(due).any():
        raise SerialError("copies in flight without receivers, or that are never due")
    return state.order, what, receivers, due
