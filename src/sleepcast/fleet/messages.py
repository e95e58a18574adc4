"""Messages of a fleet: the inbox, where they wait for the next tick, and the outbox, with everything that robots send.

Messages that many robots send at once are stored as columns, and become message objects only when they are read,
robot by robot. A message that all robots have received takes no memory per robot; one that only some have received
takes a bit each.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from math import inf

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import Kind, Message
from sleepcast.channel.message_batch import (
    AnswerColumns,
    Contents,
    MessageBatch,
    Relays,
    Reports,
    ascending,
    dump_batch,
    in_settled_order,
    load_batch,
)
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.serial import Array, SerialError
from sleepcast.fleet.schema import InboxState, OutboxState
from sleepcast.fleet.state import FleetState
from sleepcast.language.vocabulary import TIME_SLOT
from sleepcast.mind.limits import (
    MAX_OUTBOX,
    MAX_QUESTIONS,
    MAX_QUEUE,
    MAX_SEEN,
    REPORTS_A_SECOND,
    TELL_BURST,
    TELL_SECONDS,
    TELLS_A_SECOND,
)


class Outbox:
    """The outboxes of a fleet. names: of the robots."""

    def __init__(self, state: FleetState, names: Sequence[str]) -> None:
        self._state, self.names = state, names
        self.epoch = 0
        self._batches: list[MessageBatch] = []
        self._outboxes: dict[int, list[Message]] = {}
        self._pings: list[tuple[Index, Column]] = []
        self._pinged: NDArray[np.int16] | None = None
        """Pings of each robot that have not been taken yet; allocated when a robot first pings."""
        self._ping_lists: dict[int, list[float]] = {}

    def say(self, kind: Kind, rows: Rows, words: Contents, *, places: Index | None = None, lasts: float = inf) -> None:
        """Send a message from each of these robots. places: where in `words` each robot's contents are, if not in
        order."""
        if rows.size == 0:
            return
        state = self._state
        if (state.in_outbox[rows.index] >= MAX_OUTBOX).any():
            self._count_again(rows)
        room = state.in_outbox[rows.index] < MAX_OUTBOX
        if not room.all():
            state.lost[rows.take(~room).index] += 1
            rows, places = rows.take(room), np.flatnonzero(room) if places is None else places[room]
        state.in_outbox[rows.index] += 1
        state.sequence[rows.index] += 1
        robots, sequences, now = rows.robots, state.sequence[rows.index].copy(), state.read(TIME_SLOT, rows)
        issued = np.broadcast_to(now, rows.size) if isinstance(now, float) else now.copy()
        if places is None:
            places = robots if robots[0] == 0 and robots[-1] == rows.size - 1 else np.arange(rows.size)
        self._batches.append(
            MessageBatch(kind, self.names, self.epoch, robots, places, sequences, issued, lasts, words)
        )

    def _count_again(self, rows: Rows) -> None:
        """Count outboxes that seem full again, since they may have been emptied."""
        self._deliver_all()
        for robot in rows.robots[self._state.in_outbox[rows.index] >= MAX_OUTBOX].tolist():
            self._state.in_outbox[robot] = len(self._outboxes.get(robot, ()))

    def report(self, rows: Rows, label: str, values: Sequence[Column] = (), rule: str = "") -> None:
        """REPORT on each of these robots, as far as its clock's second allows more. rule: that they have deactivated,
        "" for none."""
        state, words = self._state, Reports(label, tuple(values), rule)
        seconds = state.column(TIME_SLOT, rows).astype(np.int32)
        before = np.where(state.reported_in[rows.index] == seconds, state.reported[rows.index], 0)
        state.reported_in[rows.index] = seconds
        state.reported[rows.index] = before + 1
        within_rate = before < REPORTS_A_SECOND
        if within_rate.all():
            self.say(Kind.REPORT, rows, words)
        else:
            state.lost[rows.take(~within_rate).index] += 1
            self.say(Kind.REPORT, rows.take(within_rate), words, places=np.flatnonzero(within_rate))

    def remark(self, rows: Rows, sentence: str, now: float) -> None:
        """Report at `now` (s) on each of these robots what no expression has asked for, whether it thinks or not."""
        self._state.assign(TIME_SLOT, rows, now)
        self.report(rows, sentence)

    def may_tell(self, rows: Rows, hops: int) -> tuple[Mask, Rows]:
        """Which of the robots may TELL something now, over this many hops, which is counted; and which of the others
        have not been refused before."""
        state, now = self._state, self._state.column(TIME_SLOT, rows)
        begin = np.maximum(state.telling_until[rows.index], now)
        may: Mask = begin - now <= (TELL_BURST - 1) / TELLS_A_SECOND
        if hops < 1:
            may[:] = False
        before = state.rate_limited[rows.index]
        silenced = rows.take(~may & ~before)
        state.lost[rows.take(~may).index] += 1
        state.rate_limited[rows.index] = np.where(may, before & (begin > now), True)
        some = rows.take(may)
        state.telling_until[some.index] = begin[may] + 1.0 / TELLS_A_SECOND
        return may, silenced

    def tell(self, rows: Rows, text: str, hops: int, driver: str = "", auction: int | None = None) -> None:
        """TELL on each of these robots, which must be allowed to. driver: the operator who drives them, if one does;
        auction: the number of what they call by it."""
        self.say(Kind.COMMAND, rows, Relays(text, hops, driver, auction), lasts=TELL_SECONDS)

    def answer(self, rows: Rows, answers: AnswerColumns) -> None:
        """Send the answers to a message from each of these robots."""
        self.say(Kind.ANSWER, rows, answers)

    def answer_alike(
        self,
        message: Message,
        rows: Rows,
        outcome: str,
        fault: str = "",
        details: Mapping[str, object] | None = None,
    ) -> None:
        """Give the same answer on each of these robots."""
        self.answer(rows, AnswerColumns.alike(message.id, rows.size, outcome, fault=fault, details=details))

    def ping(self, rows: Rows, castes: Column) -> None:
        """PING on each of these robots."""
        if self._pinged is None:
            self._pinged = np.zeros(self._state.count, np.int16)
        if (self._pinged[rows.index] >= MAX_OUTBOX).any():  # lists may have been emptied since
            self._pinged[rows.index] = [len(self.pings(robot)) for robot in rows.robots.tolist()]
            room = self._pinged[rows.index] < MAX_OUTBOX
            self._state.lost[rows.take(~room).index] += 1
            rows, castes = rows.take(room), castes[room]
        self._pinged[rows.index] += 1
        self._pings.append((rows.robots, castes))

    def ping_noted(self) -> None:
        """PING where native code has noted one. Whose comes first makes no difference to who hears it."""
        castes = self._state.castes()
        robots = np.flatnonzero(~np.isnan(castes))
        if robots.size:
            self.ping(Rows.of(robots), castes[robots])
            castes[robots] = np.nan

    def pings(self, robot: int) -> list[float]:
        """The castes of a robot's pings; the sender clears the list."""
        for robots, castes in self._pings:
            for pinging, caste in zip(robots.tolist(), castes.tolist(), strict=True):
                self._ping_lists.setdefault(pinging, []).append(caste)
        self._pings.clear()
        return self._ping_lists.setdefault(robot, [])

    @property
    def empty(self) -> bool:
        """Whether there is nothing to take."""
        return not self._batches and not self._pings

    def take_pings(self) -> list[tuple[Index, Column]]:
        """Take the pings that are not in a robot's list yet: robots and castes."""
        taken, self._pings = self._pings, []
        for robots, _ in taken:
            if self._pinged is not None:
                self._pinged[robots] -= 1
        return taken

    def of(self, robot: int) -> list[Message]:
        """The messages that a robot is about to send; the sender clears the list."""
        self._deliver_all()
        return self._outboxes.setdefault(robot, [])

    def turn_over(self, names: Sequence[str], changed: Index) -> None:
        """Robots are called like this from now on; those that have come or gone have nothing to say."""
        self.names = names
        self._state.in_outbox[changed] = self._state.sequence[changed] = 0
        for robot in changed.tolist() if self._outboxes or self._ping_lists else ():
            self._outboxes.pop(robot, None)
            self._ping_lists.pop(robot, None)

    def take(self) -> list[MessageBatch]:
        """Take the messages that are not in a robot's outbox yet."""
        taken, self._batches = self._batches, []
        for batch in taken:
            self._state.in_outbox[batch.robots] -= 1
        return taken

    @property
    def size(self) -> int:
        """How many batches there are to take."""
        return len(self._batches)

    def settle(self, begin: int) -> None:
        """Bring what the rules of one tick have said, all batches from this one on, into the order that it has
        whatever of the rules is native code."""
        self._batches[begin:] = in_settled_order(self._batches[begin:])

    def state(self) -> OutboxState:
        """Everything that is still to be sent."""
        return OutboxState(
            self.epoch,
            [dump_batch(batch) for batch in self._batches],
            {robot: list(messages) for robot, messages in self._outboxes.items() if messages},
            [(Array.of(robots.astype(np.int32)), Array.of(castes)) for robots, castes in self._pings],
            {robot: list(castes) for robot, castes in self._ping_lists.items() if castes},
        )

    def restore(self, state: OutboxState) -> None:
        """Restore what was still to be sent. Raises SerialError."""
        count = self._state.count
        if not all(0 <= robot < count for robot in (*state.outboxes, *state.ping_lists)):
            raise SerialError("a robot that is not there has something to say")
        self.epoch = state.epoch
        self._batches = [load_batch(batch, self.names) for batch in state.sayings]
        self._outboxes = {robot: list(messages) for robot, messages in state.outboxes.items()}
        self._ping_lists = {robot: list(castes) for robot, castes in state.ping_lists.items()}
        self._pings, self._pinged = [], np.zeros(count, np.int16)
        for listed, told in state.pings:
            robots = ascending(listed, count)
            self._pings.append((robots, told.made(np.float64, robots.shape, "castes")))
            self._pinged[robots] += 1
        for robot, castes in self._ping_lists.items():
            self._pinged[robot] += len(castes)

    def _deliver_all(self) -> None:
        for batch in self._batches:
            for robot, message in zip(batch.robots.tolist(), batch.messages(), strict=True):
                self._outboxes.setdefault(robot, []).append(message)
        self._batches.clear()


class Inbox:
    """The queues of `count` robots. Indices are ascending, without repeats. after: whether a message comes after one
    that waits already, None if all wait in the order in which they came. room: messages that may wait."""

    def __init__(
        self, count: int, after: Callable[[Message, Message], bool] | None = None, room: int | None = None
    ) -> None:
        self._count, self._after, self._room = count, after, room
        self._seen: OrderedDict[str, NDArray[np.uint8] | None] = OrderedDict()
        self._queue: list[tuple[Message, Index]] = []
        self.waiting: NDArray[np.int16] = np.zeros(count, np.int16)
        """Messages waiting for each robot."""

    def first_heard(self, message: Message, robots: Index) -> Index:
        """Those of the robots that have not received this message before; marks it as received."""
        everybody = len(robots) == self._count
        if message.id not in self._seen:
            self._seen[message.id] = None if everybody else self._bits(robots)
            if len(self._seen) > MAX_SEEN:
                self._seen.popitem(last=False)
            return robots
        bits = self._seen[message.id]
        if bits is None:
            return robots[:0]
        new: Index = robots[(bits[robots >> 3] >> (robots & 7).astype(np.uint8)) & 1 == 0]
        bits |= self._bits(new)
        return new

    def _bits(self, robots: Index) -> NDArray[np.uint8]:
        bits = np.zeros((self._count + 7) // 8, np.uint8)
        np.bitwise_or.at(bits, robots >> 3, np.left_shift(1, robots & 7).astype(np.uint8))
        return bits

    def put(self, message: Message, robots: Index) -> Index:
        """Queue a message on these robots; returns those whose queue was full."""
        room = self.has_room(robots)
        queued = robots[room]
        if queued.size:
            self.waiting[queued] += 1
            self._enqueue(message, queued)
        return robots[~room]

    def _enqueue(self, message: Message, robots: Index) -> None:
        """Insert a message into each robot's queue: as late as what waits for the robot allows."""
        if self._after is None or not self._queue:
            self._queue.append((message, robots))
            return
        index = np.full(self._count, len(self._queue))
        moving = np.zeros(self._count, np.bool_)
        moving[robots] = True
        for at in range(len(self._queue) - 1, -1, -1):
            waiting, waiting_for = self._queue[at]
            undecided = waiting_for[moving[waiting_for]]
            if self._after(message, waiting):
                moving[undecided] = False
            else:
                index[undecided] = at
        for at in np.unique(index[robots])[::-1].tolist():
            self._queue.insert(at, (message, robots[index[robots] == at]))

    def refusing_question(self, message: Message, robots: Index) -> Index:
        """Those of the robots for which so many questions of its sender wait already that this one is refused."""
        full = robots[:0]
        if message.kind is Kind.ASK and self._after is not None:
            full = robots[self.has_room(robots) & (self.waiting[robots] >= MAX_QUESTIONS)]
        if full.size == 0:
            return full
        questions = np.zeros(self._count, np.int16)
        for before, those in self._queue:
            questions[those] += before.kind is Kind.ASK and before.sender == message.sender
        return full[questions[full] >= MAX_QUESTIONS]

    def turn_over(self, parents: Index, children: Index, dead: Index) -> None:
        """Nothing waits for children or for the dead; children have heard what their parents have."""
        changed = np.zeros(self._count, np.bool_)
        changed[children] = changed[dead] = True
        left = ((message, robots[~changed[robots]]) for message, robots in self._queue)
        self._queue = [(message, robots) for message, robots in left if robots.size]
        self.waiting[changed] = 0
        for bits in self._seen.values():
            if bits is not None:
                heard = (bits[parents >> 3] >> (parents & 7).astype(np.uint8)) & 1 == 1
                bits &= ~self._bits(np.concatenate((children, dead)))
                bits |= self._bits(children[heard])

    def has_room(self, robots: Index) -> Mask:
        """For which of the robots one more message may wait."""
        room: Mask = self.waiting[robots] < (MAX_QUEUE if self._room is None else self._room)
        return room

    @property
    def empty(self) -> bool:
        """Whether no message is waiting."""
        return not self._queue

    def take(self, rows: Rows) -> list[tuple[Message, Rows]]:
        """The messages waiting on some robots, in order, each with those robots; no more than one tick evaluates."""
        if not self._queue:
            return []
        turns = np.zeros(self._count, np.int16)
        turns[rows.index] = MAX_QUEUE
        taken, left = [], []
        for message, robots in self._queue:
            now = turns[robots] > 0
            turns[robots] -= now
            taken.append((message, Rows.of(robots[now])))
            if not now.all():
                left.append((message, robots[~now]))
        self._queue = left
        self.waiting[rows.index] = np.maximum(self.waiting[rows.index] - MAX_QUEUE, 0)
        return taken

    def messages(self) -> list[tuple[Message, Index]]:
        """The waiting messages in order of arrival, each with its robots."""
        return list(self._queue)

    def state(self) -> InboxState:
        """All waiting messages, and which robots have received which messages."""
        return InboxState(
            [(key, None if bits is None else Array.of(bits)) for key, bits in self._seen.items()],
            [(message, Array.of(robots.astype(np.int32))) for message, robots in self._queue],
        )

    def restore(self, state: InboxState) -> None:
        """Restore a saved inbox. Raises SerialError."""
        if len(state.seen) > MAX_SEEN:
            raise SerialError(f"{len(state.seen)} messages that have been heard, at most {MAX_SEEN} are remembered")
        bytes_of_bits = (self._count + 7) // 8
        self._seen = OrderedDict(
            (key, None if bits is None else bits.made(np.uint8, (bytes_of_bits,), "who has heard a message"))
            for key, bits in state.seen
        )
        self._queue = []
        self.waiting[:] = 0
        for message, listed in state.queue:
            robots = ascending(listed, self._count)
            if not self.has_room(robots).all():
                raise SerialError(
                    f"{int(self.waiting[robots].max()) + 1} messages that wait for one robot are too many"
                )
            self.waiting[robots] += 1
            self._queue.append((message, robots))
