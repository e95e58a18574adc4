"""The inbox: messages that wait for the next tick, and which robots have heard which message before.

A message that all have heard costs no memory a robot; of one that only some have heard, one bit.
"""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import Message
from sleepcast.channel.serialized import ascending
from sleepcast.core.serial import Array, SerialError
from sleepcast.fleet.columns import Index, Rows
from sleepcast.fleet.limits import MAX_QUEUE, MAX_SEEN
from sleepcast.fleet.parcels import InboxParcel


class Inbox:
    """The queues of `count` robots. Indices are ascending and name each robot once."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._seen: OrderedDict[str, NDArray[np.uint8] | None] = OrderedDict()
        self._queue: list[tuple[Message, Index]] = []
        self.waiting: NDArray[np.int16] = np.zeros(count, np.int16)
        """Messages waiting for each robot."""

    def first_heard(self, message: Message, robots: Index) -> Index:
        """Those of the robots that have not heard this message before; now they have."""
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
        """Let a message wait on these robots; gives those that had no room for it."""
        room = self.waiting[robots] < MAX_QUEUE
        there = robots[room]
        if there.size:
            self.waiting[there] += 1
            self._queue.append((message, there))
        return robots[~room]

    @property
    def empty(self) -> bool:
        """Whether nothing waits on anybody."""
        return not self._queue

    def take(self, rows: Rows) -> list[tuple[Message, Rows]]:
        """The messages that wait on some robots, in the order in which they came, each with those robots."""
        if not self._queue:
            return []
        thinking = np.zeros(self._count, np.bool_)
        thinking[rows.index] = True
        taken, left = [], []
        for message, robots in self._queue:
            now = thinking[robots]
            taken.append((message, Rows.of(robots[now])))
            if not now.all():
                left.append((message, robots[~now]))
        self._queue = left
        self.waiting[rows.index] = 0
        return taken

    def messages(self) -> list[tuple[Message, Index]]:
        """What waits, in the order in which it came, each message with its robots."""
        return list(self._queue)

    def state(self) -> InboxParcel:
        """Everything that waits, and who has heard what."""
        return InboxParcel(
            [(key, None if bits is None else Array.of(bits)) for key, bits in self._seen.items()],
            [(message, Array.of(robots.astype(np.int32))) for message, robots in self._queue],
        )

    def restore(self, parcel: InboxParcel) -> None:
        """Be as that inbox was. Raises ParcelError."""
        if len(parcel.seen) > MAX_SEEN:
            raise SerialError(f"{len(parcel.seen)} messages that have been heard, at most {MAX_SEEN} are remembered")
        bytes_of_bits = (self._count + 7) // 8
        self._seen = OrderedDict(
            (key, None if bits is None else bits.made(np.uint8, (bytes_of_bits,), "who has heard a message"))
            for key, bits in parcel.seen
        )
        self._queue = []
        self.waiting[:] = 0
        for message, listed in parcel.queue:
            if self.put(message, ascending(listed, self._count)).size:
                raise SerialError(f"more than {MAX_QUEUE} messages that wait for one robot")
