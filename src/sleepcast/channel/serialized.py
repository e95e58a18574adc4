"""Messages and the radio as parcels: what many robots say at once, and what is on its way, kept and made again."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import MAX_NUMBER, Kind, Message
from sleepcast.channel.message_batch import Answers, Contents, MessageBatch, Relays, Reports
from sleepcast.core.serial import Array, SerialError, within

SendOrder = tuple[int, int, int, int, int]
Numbers = NDArray[np.int64]
Seconds = NDArray[np.float64]


class AnswersState(msgspec.Struct, tag="answers"):
    """See `Answers`; the columns are in the order of the robots."""

    command: str
    sorts: tuple[str, ...]
    sort: Array
    value: Array
    faults: tuple[str, ...]
    fault: Array


class ReportsState(msgspec.Struct, tag="reports"):
    """See `Reports`."""

    label: str
    values: tuple[Array, ...]


class RelaysState(msgspec.Struct, tag="told"):
    """See `Relays`."""

    said: str
    hops: int = 1


class MessageBatchState(msgspec.Struct, tag="chorus"):
    """See `MessageBatch`."""

    kind: Kind
    epoch: int
    robots: Array
    sequences: Array
    issued: Array
    lasts: float
    words: AnswersState | ReportsState | RelaysState


class MessageState(msgspec.Struct, tag="message"):
    """One message among choruses."""

    message: Message


class InFlightState(msgspec.Struct):
    """Copies on their way. receivers: robots; None where it is the operator. due: of each, or of all alike."""

    order: SendOrder
    what: MessageState | MessageBatchState
    receivers: Array | None
    due: Array | float


class RadioState(msgspec.Struct):
    """See `Radio`. heard: what robots could have had already, and which. repeats: how often each party has sent which
    message at the time `repeats_at`. free: see `Turns`."""

    counts: dict[str, int]
    waiting: list[InFlightState]
    heard: list[tuple[Message, Array]]
    for_operator: list[MessageState | MessageBatchState]
    repeats: list[tuple[int, str, int]]
    repeats_at: float
    free: Array | None


def dump_sent(what: Message | MessageBatch) -> MessageState | MessageBatchState:
    """What is said, as a parcel."""
    return MessageState(what) if isinstance(what, Message) else dump_batch(what)


def load_sent(parcel: MessageState | MessageBatchState, names: Sequence[str]) -> Message | MessageBatch:
    """What was said. names: of all robots. Raises ParcelError."""
    return parcel.message if isinstance(parcel, MessageState) else load_batch(parcel, names)


def dump_in_flight(
    order: SendOrder, what: Message | MessageBatch, receivers: Numbers, due: Seconds | float
) -> InFlightState:
    """Copies on their way, as a parcel. receivers: robots, or the operator (-1) alone."""
    up = receivers[0] < 0
    when = due if isinstance(due, float) else Array.of(due)
    return InFlightState(order, dump_sent(what), None if up else Array.of(receivers.astype(np.int32)), when)


def load_in_flight(
    parcel: InFlightState, names: Sequence[str]
) -> tuple[SendOrder, Message | MessageBatch, Numbers, Seconds | float]:
    """The order, content, receivers and times of copies on their way. Raises ParcelError."""
    what = load_sent(parcel.what, names)
    if parcel.receivers is None:
        receivers = np.broadcast_to(np.int64(-1), len(what) if isinstance(what, MessageBatch) else 1)
    elif isinstance(what, MessageBatch):
        raise SerialError("a chorus that goes to robots")
    else:
        receivers = ascending(parcel.receivers, len(names)).astype(np.int64)
    due = parcel.due if isinstance(parcel.due, float) else parcel.due.made(np.float64, receivers.shape, "due times")
    if receivers.size == 0 or np.isnan(due).any():
        raise SerialError("copies for nobody, or that are never due")
    return parcel.order, what, receivers, due


def dump_batch(what: MessageBatch) -> MessageBatchState:
    """What many say, as a parcel."""
    robots, sequences = Array.of(what.robots.astype(np.int32)), Array.of(what.sequences)
    words = _dump_contents(what.words, what.places)
    return MessageBatchState(what.kind, what.epoch, robots, sequences, Array.of(what.issued), what.lasts, words)


def load_batch(parcel: MessageBatchState, names: Sequence[str]) -> MessageBatch:
    """What many said. names: of all robots. Raises ParcelError."""
    robots = ascending(parcel.robots, len(names))
    shape = robots.shape
    sequences = parcel.sequences.made(np.int32, shape, "sequences")
    within(sequences, 0, MAX_NUMBER, "sequences")
    issued = parcel.issued.made(np.float64, shape, "issued")
    if not 0 <= parcel.epoch <= MAX_NUMBER or not parcel.lasts >= 0.0 or np.isnan(issued).any():
        raise SerialError("something said at no time or in no life")
    words = _load_contents(parcel.words, shape)
    places = np.arange(len(robots))
    return MessageBatch(parcel.kind, names, parcel.epoch, robots, places, sequences, issued, parcel.lasts, words)


def ascending(listed: Array, count: int) -> NDArray[np.intp]:
    """Indices of some of `count` robots, each once. Raises ParcelError."""
    robots = listed.column(np.int32, count, "robots").astype(np.intp)
    if robots.size and (robots[0] < 0 or robots[-1] >= count or (np.diff(robots) <= 0).any()):
        raise SerialError("robots that are not there, or twice")
    return robots


def _dump_contents(words: Contents, places: NDArray[np.intp]) -> AnswersState | ReportsState | RelaysState:
    if isinstance(words, Answers):
        sort, value, fault = (Array.of(column[places]) for column in (words.sort, words.value, words.fault))
        return AnswersState(words.command, words.sorts, sort, value, words.faults, fault)
    if isinstance(words, Reports):
        return ReportsState(words.label, tuple(Array.of(column[places]) for column in words.values))
    if isinstance(words, Relays):
        return RelaysState(words.said, words.hops)
    raise TypeError(f"{type(words).__name__} cannot be kept")


def _load_contents(parcel: AnswersState | ReportsState | RelaysState, shape: tuple[int, ...]) -> Contents:
    if isinstance(parcel, RelaysState):
        return Relays(parcel.said, parcel.hops)
    if isinstance(parcel, ReportsState):
        return Reports(parcel.label, tuple(column.made(np.float64, shape, "reported") for column in parcel.values))
    sort, fault = parcel.sort.made(np.uint8, shape, "outcomes"), parcel.fault.made(np.int32, shape, "faults")
    within(sort, 0, len(parcel.sorts) - 1, "outcomes")
    within(fault, 0, len(parcel.faults), "faults")
    value = parcel.value.made(np.float64, shape, "answers")
    return Answers(parcel.command, parcel.sorts, sort, value, parcel.faults, fault)
