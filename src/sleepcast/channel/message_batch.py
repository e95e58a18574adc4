"""A chorus: what many robots say at once, kept side by side, and turned into messages only for those who read them.

A command to a million robots brings a million answers; as columns they take some bytes each and no time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import Kind, Message, message_id
from sleepcast.channel.payload import HOPS

Index = NDArray[np.intp]
Column = NDArray[np.float64]
Body = dict[str, object]


class Contents(Protocol):
    """What the robots of a chorus say, by the places for which it was made."""

    def text(self, place: int) -> str: ...

    def body(self, place: int) -> Body: ...


@dataclass(frozen=True, slots=True)
class Answers:
    """What came of the message `command`. Columns by place: value (NaN for unknown); sort: which of `sorts` the outcome
    is, uint8; fault: 0 for none, else which of `faults` it is, from 1, int32."""

    command: str
    sorts: tuple[str, ...]
    sort: NDArray[np.uint8]
    value: Column
    faults: tuple[str, ...]
    fault: NDArray[np.int32]

    @classmethod
    def alike(cls, command: str, size: int, sort: str, value: float = np.nan, fault: str = "") -> Answers:
        """The same answer at each of `size` places."""
        return cls(
            command,
            (sort,),
            np.broadcast_to(np.uint8(0), size),
            np.broadcast_to(np.float64(value), size),
            (fault,) if fault else (),
            np.broadcast_to(np.int32(bool(fault)), size),
        )

    def text(self, place: int) -> str:
        return ""

    def body(self, place: int) -> Body:
        value, fault = float(self.value[place]), int(self.fault[place])
        return {
            "command": self.command,
            "outcome": self.sorts[self.sort[place]],
            "value": None if value != value else value,
            "fault": self.faults[fault - 1] if fault else None,
        }


@dataclass(frozen=True, slots=True)
class Reports:
    """What was reported under a label: a column for each value, NaN for unknown."""

    label: str
    values: tuple[Column, ...]

    def text(self, place: int) -> str:
        return ""

    def body(self, place: int) -> Body:
        found = [float(column[place]) for column in self.values]
        return {"label": self.label, "values": [None if value != value else value for value in found]}


@dataclass(frozen=True, slots=True)
class Relays:
    """One expression that they all tell the others, so many hops far."""

    said: str
    hops: int

    def text(self, place: int) -> str:
        return self.said

    def body(self, place: int) -> Body:
        return {HOPS: self.hops}


@dataclass(frozen=True, slots=True)
class MessageBatch:
    """One message from each of some robots.

    names: of all robots there are. robots: the speakers' places among them, each once. places: where in `words` each
    one's own are. sequences: of their messages. issued: when each spoke (s of the swarm's clock); lasts: for how many s
    it is good.
    """

    kind: Kind
    names: Sequence[str]
    epoch: int
    robots: Index
    places: Index
    sequences: NDArray[np.int32]
    issued: Column
    lasts: float
    words: Contents

    def __len__(self) -> int:
        return len(self.robots)

    def take(self, which: NDArray[np.bool_] | slice) -> MessageBatch:
        """The same from some of them only."""
        columns = (self.robots[which], self.places[which], self.sequences[which], self.issued[which])
        return MessageBatch(self.kind, self.names, self.epoch, *columns, self.lasts, self.words)

    def message(self, at: int) -> Message:
        """What the robot at this place of the chorus says."""
        issued, place = float(self.issued[at]), int(self.places[at])
        return Message(
            self.names[self.robots[at]],
            self.epoch,
            int(self.sequences[at]),
            self.kind,
            issued,
            issued + self.lasts,
            self.words.text(place),
            False,
            self.words.body(place),
        )

    def messages(self) -> Iterator[Message]:
        """What each of them says."""
        return map(self.message, range(len(self)))

    def ids(self) -> Iterator[tuple[int, str]]:
        """Each robot with the id of its message."""
        for robot, sequence in zip(self.robots.tolist(), self.sequences.tolist(), strict=True):
            yield robot, message_id(self.names[robot], self.epoch, sequence)
