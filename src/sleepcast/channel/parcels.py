"""Messages and the radio as parcels: what many robots say at once, and what is on its way, kept and made again."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.chorus import Answers, Chorus, Reports, Told, Words
from sleepcast.channel.message import MAX_NUMBER, Kind, Message
from sleepcast.core.serial import Array, SerialError, within

Order = tuple[int, int, int, int, int]
Numbers = NDArray[np.int64]
Seconds = NDArray[np.float64]


class AnswersParcel(msgspec.Struct, tag="answers"):
    """See `Answers`; the columns are in the order of the robots."""

    command: str
    sorts: tuple[str, ...]
    sort: Array
    value: Array
    faults: tuple[str, ...]
    fault: Array


class ReportsParcel(msgspec.Struct, tag="reports"):
    """See `Reports`."""

    label: str
    values: tuple[Array, ...]


class ToldParcel(msgspec.Struct, tag="told"):
    """See `Told`."""

    said: str
    hops: int = 1


class ChorusParcel(msgspec.Struct, tag="chorus"):
    """See `Chorus`."""

    kind: Kind
    epoch: int
    robots: Array
    sequences: Array
    issued: Array
    lasts: float
    words: AnswersParcel | ReportsParcel | ToldParcel


class MessageParcel(msgspec.Struct, tag="message"):
    """One message among choruses."""

    message: Message


class LaunchParcel(msgspec.Struct):
    """Copies on their way. receivers: robots; None where it is the operator. due: of each, or of all alike."""

    order: Order
    what: MessageParcel | ChorusParcel
    receivers: Array | None
    due: Array | float


class RadioParcel(msgspec.Struct):
    """See `Radio`. heard: what robots could have had already, and which. repeats: how often each party has sent which
    message at the time `repeats_at`. free: see `Turns`."""

    counts: dict[str, int]
    waiting: list[LaunchParcel]
    heard: list[tuple[Message, Array]]
    for_operator: list[MessageParcel | ChorusParcel]
    repeats: list[tuple[int, str, int]]
    repeats_at: float
    free: Array | None


def packed(what: Message | Chorus) -> MessageParcel | ChorusParcel:
    """What is said, as a parcel."""
    return MessageParcel(what) if isinstance(what, Message) else packed_chorus(what)


def unpacked(parcel: MessageParcel | ChorusParcel, names: Sequence[str]) -> Message | Chorus:
    """What was said. names: of all robots. Raises ParcelError."""
    return parcel.message if isinstance(parcel, MessageParcel) else unpacked_chorus(parcel, names)


def packed_launch(order: Order, what: Message | Chorus, receivers: Numbers, due: Seconds | float) -> LaunchParcel:
    """Copies on their way, as a parcel. receivers: robots, or the operator (-1) alone."""
    up = receivers[0] < 0
    when = due if isinstance(due, float) else Array.of(due)
    return LaunchParcel(order, packed(what), None if up else Array.of(receivers.astype(np.int32)), when)


def unpacked_launch(
    parcel: LaunchParcel, names: Sequence[str]
) -> tuple[Order, Message | Chorus, Numbers, Seconds | float]:
    """The order, content, receivers and times of copies on their way. Raises ParcelError."""
    what = unpacked(parcel.what, names)
    if parcel.receivers is None:
        receivers = np.broadcast_to(np.int64(-1), len(what) if isinstance(what, Chorus) else 1)
    elif isinstance(what, Chorus):
        raise SerialError("a chorus that goes to robots")
    else:
        receivers = ascending(parcel.receivers, len(names)).astype(np.int64)
    due = parcel.due if isinstance(parcel.due, float) else parcel.due.made(np.float64, receivers.shape, "due times")
    if receivers.size == 0 or np.isnan(due).any():
        raise SerialError("copies for nobody, or that are never due")
    return parcel.order, what, receivers, due


def packed_chorus(what: Chorus) -> ChorusParcel:
    """What many say, as a parcel."""
    robots, sequences = Array.of(what.robots.astype(np.int32)), Array.of(what.sequences)
    words = _packed_words(what.words, what.places)
    return ChorusParcel(what.kind, what.epoch, robots, sequences, Array.of(what.issued), what.lasts, words)


def unpacked_chorus(parcel: ChorusParcel, names: Sequence[str]) -> Chorus:
    """What many said. names: of all robots. Raises ParcelError."""
    robots = ascending(parcel.robots, len(names))
    shape = robots.shape
    sequences = parcel.sequences.made(np.int32, shape, "sequences")
    within(sequences, 0, MAX_NUMBER, "sequences")
    issued = parcel.issued.made(np.float64, shape, "issued")
    if not 0 <= parcel.epoch <= MAX_NUMBER or not parcel.lasts >= 0.0 or np.isnan(issued).any():
        raise SerialError("something said at no time or in no life")
    words = _words(parcel.words, shape)
    places = np.arange(len(robots))
    return Chorus(parcel.kind, names, parcel.epoch, robots, places, sequences, issued, parcel.lasts, words)


def ascending(listed: Array, count: int) -> NDArray[np.intp]:
    """Indices of some of `count` robots, each once. Raises ParcelError."""
    robots = listed.column(np.int32, count, "robots").astype(np.intp)
    if robots.size and (robots[0] < 0 or robots[-1] >= count or (np.diff(robots) <= 0).any()):
        raise SerialError("robots that are not there, or twice")
    return robots


def _packed_words(words: Words, places: NDArray[np.intp]) -> AnswersParcel | ReportsParcel | ToldParcel:
    if isinstance(words, Answers):
        sort, value, fault = (Array.of(column[places]) for column in (words.sort, words.value, words.fault))
        return AnswersParcel(words.command, words.sorts, sort, value, words.faults, fault)
    if isinstance(words, Reports):
        return ReportsParcel(words.label, tuple(Array.of(column[places]) for column in words.values))
    if isinstance(words, Told):
        return ToldParcel(words.said, words.hops)
    raise TypeError(f"{type(words).__name__} cannot be kept")


def _words(parcel: AnswersParcel | ReportsParcel | ToldParcel, shape: tuple[int, ...]) -> Words:
    if isinstance(parcel, ToldParcel):
        return Told(parcel.said, parcel.hops)
    if isinstance(parcel, ReportsParcel):
        return Reports(parcel.label, tuple(column.made(np.float64, shape, "reported") for column in parcel.values))
    sort, fault = parcel.sort.made(np.uint8, shape, "outcomes"), parcel.fault.made(np.int32, shape, "faults")
    within(sort, 0, len(parcel.sorts) - 1, "outcomes")
    within(fault, 0, len(parcel.faults), "faults")
    value = parcel.value.made(np.float64, shape, "answers")
    return Answers(parcel.command, parcel.sorts, sort, value, parcel.faults, fault)
