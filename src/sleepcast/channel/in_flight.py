"""Launches: copies of what is said on their way, what became of them by chance, and in which order they arrive.

All copies of a message are one launch with an array of receivers, and so is what many robots say to the operator.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import Message
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.core.counter_rng import uniform

Numbers = NDArray[np.int64]
Seconds = NDArray[np.float64]
Reception = tuple[Message, Numbers]
"""A message, and the robots that have it, ascending, each once."""


@dataclass(slots=True)
class InFlight:
    """Copies on their way: of one message to some robots, or of what many robots say to the operator.

    order: transmitter, epoch, sequence, repeat and copy; what is due at the same time arrives in this order.
    due: s, for each copy, or for all alike. receivers: of a message; a chorus goes to the operator.
    """

    order: tuple[int, int, int, int, int]
    what: Message | MessageBatch
    receivers: Numbers
    due: Seconds | float

    @property
    def size(self) -> int:
        return len(self.receivers)

    def take(self, which: NDArray[np.bool_] | slice) -> InFlight:
        """Some of the copies."""
        what = self.what.take(which) if isinstance(self.what, MessageBatch) else self.what
        due = self.due if isinstance(self.due, float) else self.due[which]
        return InFlight(self.order, what, self.receivers[which], due)

    def split(self, now: float) -> tuple[InFlight | None, InFlight | None]:
        """What is due by now, and what is not."""
        if isinstance(self.due, float):
            return (self, None) if self.due <= now else (None, self)
        here = self.due <= now
        if here.all():
            return self, None
        return (self.take(here), self.take(~here)) if here.any() else (None, self)


@dataclass(frozen=True, slots=True)
class CopyChance:
    """Where the chance of each copy comes from. keys: what a draw is for to its key, one for all copies or one each."""

    keys: Callable[[tuple[object, ...]], int | NDArray[np.uint64]]
    receivers: Numbers

    def drawn(self, *what: object) -> NDArray[np.float64]:
        """For each copy a number evenly from [0, 1)."""
        return uniform(self.keys(what), self.receivers.astype(np.uint64))


def single(heard: Iterable[Message | MessageBatch]) -> Iterable[Message]:
    for each in heard:
        if isinstance(each, MessageBatch):
            yield from each.messages()
        else:
            yield each


def receptions(launches: list[InFlight]) -> list[Reception]:
    """Launches as batches in an order in which each robot finds its messages in theirs: of time, then of sending."""
    if all(isinstance(launch.due, float) for launch in launches):
        launches.sort(key=lambda launch: (launch.due, launch.order))
        return [(launch.what, launch.receivers) for launch in launches if isinstance(launch.what, Message)]
    launches.sort(key=lambda launch: launch.order)
    sizes = [launch.size for launch in launches]
    receivers = np.concatenate([launch.receivers for launch in launches])
    numbers = np.repeat(np.arange(len(launches)), sizes)
    dues = np.concatenate([np.broadcast_to(launch.due, launch.size) for launch in launches])
    sort = np.lexsort((numbers, dues, receivers))
    receivers, numbers = receivers[sort], numbers[sort]
    starts = np.flatnonzero(np.diff(receivers, prepend=-1))
    turns = np.arange(len(receivers)) - np.repeat(starts, np.diff(starts, append=len(receivers)))
    """Whether it is a robot's first message of these, its second, ..."""
    groups = turns * len(launches) + numbers
    sort = np.argsort(groups, kind="stable")
    ends = np.flatnonzero(np.diff(groups[sort], append=-1)) + 1
    found: list[Reception] = []
    for robots in np.split(sort, ends[:-1]):
        message = launches[numbers[robots[0]]].what
        if isinstance(message, Message):
            found.append((message, receivers[robots]))
    return found
