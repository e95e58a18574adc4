"""A message batch: one message from each of many robots, as columns; a single one is made only for its reader. The
robots' names are a `NameIndex`.

A command to a million robots brings a million answers; as columns they take a few bytes each and no time. Numbered
names (`scout1` to `scout1000000`) are made on demand; stored, they would take more memory than the robots' minds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol, overload

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import MAX_NUMBER, RULE, Kind, Message, answer_body, message_id, relay_body
from sleepcast.core.serial import Array, SerialError, within

Index = NDArray[np.intp]
Column = NDArray[np.float64]
Body = dict[str, object]


class Contents(Protocol):
    """The contents of a batch's messages, by index."""

    def text(self, index: int) -> str: ...

    def body(self, index: int) -> Body: ...


class AnswerColumns(msgspec.Struct, frozen=True):
    """Answers to the message `command`, as columns.

    outcomes: those that there are
    outcome: index of each one's in `outcomes`, uint8
    value: NaN for unknown
    faults: the faults that there are
    fault: index in `faults` from 1, 0 for none, int32
    details: further fields of all their bodies
    """

    command: str
    outcomes: tuple[str, ...]
    outcome: NDArray[np.uint8]
    value: Column
    faults: tuple[str, ...]
    fault: NDArray[np.int32]
    details: Body = msgspec.field(default_factory=dict)

    @classmethod
    def alike(
        cls,
        command: str,
        size: int,
        outcome: str,
        value: float = np.nan,
        fault: str = "",
        details: Mapping[str, object] | None = None,
    ) -> AnswerColumns:
        """The same answer `size` times."""
        return cls(
            command,
            (outcome,),
            np.broadcast_to(np.uint8(0), size),
            np.broadcast_to(np.float64(value), size),
            (fault,) if fault else (),
            np.broadcast_to(np.int32(bool(fault)), size),
            dict(details or {}),
        )

    def text(self, index: int) -> str:
        return ""

    def body(self, index: int) -> Body:
        fault = int(self.fault[index])
        reason = self.faults[fault - 1] if fault else ""
        return (
            answer_body(self.command, self.outcomes[self.outcome[index]], float(self.value[index]), reason)
            | self.details
        )


class Reports(msgspec.Struct, frozen=True):
    """Reports under one label: a column for each value, NaN for unknown. rule: that was deactivated, "" for none."""

    label: str
    values: tuple[Column, ...]
    rule: str = ""

    def text(self, index: int) -> str:
        return ""

    def body(self, index: int) -> Body:
        values = [float(column[index]) for column in self.values]
        body: Body = {"label": self.label, "values": [None if value != value else value for value in values]}
        return body | {RULE: self.rule} if self.rule else body


class Relays(msgspec.Struct, frozen=True):
    """One expression that all these robots tell the others, with the hops that it may go. driver: the operator who
    drives them, "" for none; auction: see `message.AUCTION`."""

    said: str
    hops: int
    driver: str = ""
    auction: int | None = None

    def text(self, index: int) -> str:
        return self.said

    def body(self, index: int) -> Body:
        return relay_body(self.hops, self.driver, self.auction)


class PlainBodies(msgspec.Struct, frozen=True):
    """Bodies of any kind without a text: what robots say of their bids."""

    said: tuple[Body, ...]

    def text(self, index: int) -> str:
        return ""

    def body(self, index: int) -> Body:
        return dict(self.said[index])


class MessageBatch(msgspec.Struct, frozen=True):
    """One message from each of some robots.

    names: of all robots
    robots: the senders' indices among them, each once
    places: the index of each message's contents in `words`
    sequences: numbers of the messages
    issued: when each was sent (s of the swarm's clock)
    lasts: s until its deadline

    Columns have the shape (messages,).
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
        """Some of the messages."""
        columns = (self.robots[which], self.places[which], self.sequences[which], self.issued[which])
        return MessageBatch(self.kind, self.names, self.epoch, *columns, self.lasts, self.words)

    def message(self, at: int) -> Message:
        """The message with this index."""
        issued, index = float(self.issued[at]), int(self.places[at])
        return Message(
            self.names[self.robots[at]],
            self.epoch,
            int(self.sequences[at]),
            self.kind,
            issued,
            issued + self.lasts,
            self.words.text(index),
            False,
            self.words.body(index),
        )

    def messages(self) -> Iterator[Message]:
        """All messages."""
        return map(self.message, range(len(self)))

    def ids(self) -> Iterator[tuple[int, str]]:
        """Each robot with the id of its message."""
        for robot, sequence in zip(self.robots.tolist(), self.sequences.tolist(), strict=True):
            yield robot, message_id(self.names[robot], self.epoch, sequence)


def in_settled_order(batches: Sequence[MessageBatch]) -> list[MessageBatch]:
    """What robots have reported and told by their rules in one tick, each robot's own in its order. Which of them are
    evaluated together, and who comes first, depends on how far native code has been made, and so on no seed: here
    first come first messages, and what is alike is one batch."""
    if len(batches) < 2:
        return [*batches]
    alike = defaultdict[tuple[object, ...], list[MessageBatch]](list)
    for batch, places in zip(batches, _places_among_own(batches), strict=True):
        subject = batch.kind.value, *_subject(batch.words)
        for place in range(places.min(), places.max() + 1):
            if (here := places == place).any():
                alike[place, *subject].append(batch if here.all() else batch.take(here))
    return [_together(alike[key]) for key in sorted(alike)]


def _places_among_own(batches: Sequence[MessageBatch]) -> list[Index]:
    """Of each message how many of the same robot come before it."""
    robots, sequences = (np.concatenate([getattr(each, name) for each in batches]) for name in ("robots", "sequences"))
    order = np.lexsort((sequences, robots))
    own, ascending = robots[order], np.arange(len(robots))
    places = np.empty_like(ascending)
    places[order] = ascending - np.maximum.accumulate(np.where(np.diff(own, prepend=-1) > 0, ascending, 0))
    return np.split(places, np.cumsum([len(each) for each in batches])[:-1])


def _subject(words: Contents) -> tuple[object, ...]:
    """What is the same in messages that can be one batch."""
    if isinstance(words, Reports):
        return words.rule, words.label, len(words.values)
    if isinstance(words, Relays):
        return words.said, words.hops, words.driver, -1 if words.auction is None else words.auction
    raise TypeError(f"no rule says {type(words).__name__}")


def _together(batches: Sequence[MessageBatch]) -> MessageBatch:
    """The messages of several batches about the same, in the order of the robots."""
    first, *others = batches
    if not others:
        return first
    robots, sequences, issued = (
        np.concatenate([getattr(each, name) for each in batches]) for name in ("robots", "sequences", "issued")
    )
    order = np.argsort(robots, kind="stable")
    words = first.words
    if isinstance(words, Reports):
        said = [[column[each.places] for column in each.words.values] for each in batches]  # type: ignore[attr-defined]
        values = tuple(np.concatenate(column)[order] for column in zip(*said, strict=True))
        words = Reports(words.label, values, words.rule)
    return msgspec.structs.replace(
        first,
        robots=robots[order],
        places=np.arange(len(order)),
        sequences=sequences[order],
        issued=issued[order],
        words=words,
    )


# ---- serialized state


class AnswersState(msgspec.Struct, tag="answers"):
    """See `AnswerColumns`; the columns are in the order of the robots."""

    command: str
    sorts: tuple[str, ...]
    sort: Array
    value: Array
    faults: tuple[str, ...]
    fault: Array
    details: Body = {}


class ReportsState(msgspec.Struct, tag="reports"):
    """See `Reports`."""

    label: str
    values: tuple[Array, ...]
    rule: str = ""


class RelaysState(msgspec.Struct, tag="told"):
    """See `Relays`."""

    said: str
    hops: int = 1
    driver: str = ""
    auction: int | None = None


class PlainBodiesState(msgspec.Struct, tag="bodies"):
    """See `PlainBodies`; in the order of the robots."""

    said: tuple[Body, ...]


ContentsState = AnswersState | ReportsState | RelaysState | PlainBodiesState


class MessageBatchState(msgspec.Struct, tag="chorus"):
    """See `MessageBatch`. senders: their names, where others may be at their indices later."""

    kind: Kind
    epoch: int
    robots: Array
    sequences: Array
    issued: Array
    lasts: float
    words: ContentsState
    senders: list[str] | None = None


def dump_batch(what: MessageBatch) -> MessageBatchState:
    """A batch as serialized state."""
    robots, sequences = Array.of(what.robots.astype(np.int32)), Array.of(what.sequences)
    words = _dump_contents(what.words, what.places)
    named = names_of_places(what.names, what.robots)
    senders = None if named is None else list(named.values())
    return MessageBatchState(
        what.kind, what.epoch, robots, sequences, Array.of(what.issued), what.lasts, words, senders
    )


def load_batch(state: MessageBatchState, names: Sequence[str]) -> MessageBatch:
    """A batch from its serialized state. names: of all robots. Raises SerialError."""
    robots = ascending(state.robots, len(names))
    shape = robots.shape
    sequences = state.sequences.made(np.int32, shape, "sequences")
    within(sequences, 0, MAX_NUMBER, "sequences")
    issued = state.issued.made(np.float64, shape, "issued")
    if not 0 <= state.epoch <= MAX_NUMBER or not state.lasts >= 0.0 or np.isnan(issued).any():
        raise SerialError("a message batch with an epoch or a time out of range")
    words = _load_contents(state.words, shape)
    places = np.arange(len(robots))
    if state.senders is not None:
        if len(state.senders) != len(robots):
            raise SerialError(f"{len(state.senders)} names of {len(robots)} robots")
        names = NamesThen(len(names), dict(zip(robots.tolist(), state.senders, strict=True)))
    return MessageBatch(state.kind, names, state.epoch, robots, places, sequences, issued, state.lasts, words)


def ascending(listed: Array, count: int) -> NDArray[np.intp]:
    """Indices of some of `count` robots, ascending, each once. Raises SerialError."""
    robots = listed.column(np.int32, count, "robots").astype(np.intp)
    if robots.size and (robots[0] < 0 or robots[-1] >= count or (np.diff(robots) <= 0).any()):
        raise SerialError("robots that are not there, or twice")
    return robots


def _dump_contents(words: Contents, places: NDArray[np.intp]) -> ContentsState:
    if isinstance(words, AnswerColumns):
        outcome, value, fault = (Array.of(column[places]) for column in (words.outcome, words.value, words.fault))
        return AnswersState(words.command, words.outcomes, outcome, value, words.faults, fault, words.details)
    if isinstance(words, Reports):
        return ReportsState(words.label, tuple(Array.of(column[places]) for column in words.values), words.rule)
    if isinstance(words, Relays):
        return RelaysState(words.said, words.hops, words.driver, words.auction)
    if isinstance(words, PlainBodies):
        return PlainBodiesState(tuple(words.said[place] for place in places.tolist()))
    raise TypeError(f"{type(words).__name__} cannot be kept")


def _load_contents(state: ContentsState, shape: tuple[int, ...]) -> Contents:
    if isinstance(state, RelaysState):
        return Relays(state.said, state.hops, state.driver, state.auction)
    if isinstance(state, PlainBodiesState):
        if len(state.said) != shape[0]:
            raise SerialError(f"{len(state.said)} bodies of {shape[0]} messages")
        return PlainBodies(state.said)
    if isinstance(state, ReportsState):
        values = tuple(column.made(np.float64, shape, "reported") for column in state.values)
        return Reports(state.label, values, state.rule)
    outcome, fault = state.sort.made(np.uint8, shape, "outcomes"), state.fault.made(np.int32, shape, "faults")
    within(outcome, 0, len(state.sorts) - 1, "outcomes")
    within(fault, 0, len(state.faults), "faults")
    value = state.value.made(np.float64, shape, "answers")
    return AnswerColumns(state.command, state.sorts, outcome, value, state.faults, fault, state.details)


# ---- the names of many parties by index, and their indices by name


class NameIndex(Sequence[str]):
    """`count` numbered names (`prefix` and a number from 1), and then those in `listed`. More can be added.

    lasting: whether each index has the same name for ever
    """

    lasting = True

    def __init__(self, listed: Iterable[str] = (), *, prefix: str = "", count: int = 0) -> None:
        self._prefix, self._count = prefix, count
        self._listed: list[str] = []
        self._indices: dict[str, int] = {}
        for name in listed:
            self.add(name)

    def add(self, name: str) -> int:
        """The index of a name; a new name gets the next one."""
        index = self.index_of(name)
        if index is None:
            index = self._indices[name] = len(self)
            self._listed.append(name)
        return index

    def index_of(self, name: str) -> int | None:
        """The index of a name; None if it is not here."""
        if not self._count:
            return self._indices.get(name)
        digits = name.removeprefix(self._prefix)
        if name.startswith(self._prefix) and digits.isascii() and digits.isdigit() and digits[0] != "0":
            number = int(digits) if len(digits) <= len(str(self._count)) else 0
            if 0 < number <= self._count:
                return number - 1
        return self._indices.get(name)

    def copy(self) -> NameIndex:
        """A copy, to which other names may be added."""
        return NameIndex(self._listed, prefix=self._prefix, count=self._count)

    def __len__(self) -> int:
        return self._count + len(self._listed)

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[str, ...]: ...

    def __getitem__(self, index: int | slice) -> str | tuple[str, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        if index < 0:
            index += len(self)
        if not 0 <= index < len(self):
            raise IndexError(index)
        return f"{self._prefix}{index + 1}" if index < self._count else self._listed[index - self._count]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self.index_of(name) is not None


class NamesThen(NameIndex):
    """The names of some of so many robots at some time, by index; "" for all others."""

    lasting = False

    def __init__(self, count: int, names: Mapping[int, str]) -> None:
        super().__init__()
        self._listed = [names.get(index, "") for index in range(count)]
        self._indices = {name: index for index, name in names.items()}

    def copy(self) -> NameIndex:
        return self


def lasting_part(names: NameIndex, batch: MessageBatch) -> MessageBatch:
    """Those messages of a batch whose senders are called the same in `names`, at their indices."""
    if names.lasting or batch.names is names:
        return batch
    return batch.take(np.array([batch.names[robot] == names[robot] for robot in batch.robots.tolist()], np.bool_))


def names_of_places(names: Sequence[str], places: Index) -> dict[int, str] | None:
    """The names at these indices, where others may be there later; else None."""
    if not isinstance(names, NameIndex) or names.lasting:
        return None
    return {place: names[place] for place in places.tolist()}
