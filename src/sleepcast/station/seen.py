"""What robots far away told, kept from one command to the next: the same texts and numbers, read as if heard again."""

from __future__ import annotations

from math import isfinite

import msgspec

from sleepcast.channel import Kind, Message
from sleepcast.channel.bodies import TOLD
from sleepcast.parcel import ParcelError, pack, unpack
from sleepcast.station.remote import MAX_MINDS, MAX_TELLERS, MAX_TYPES, RemoteMinds
from sleepcast.station.telling import TelemetryTold

VERSION = 1
MAX_SEEN = 256 * 1024**2
"""Bytes of what is kept, unpacked: the longest minds and tellings that one desk holds are less."""
KEPT = 3_600.0
"""Seconds for which what a robot told is worth being kept."""


class SeenParcel(msgspec.Struct):
    """texts: of types and minds. tellers: name, when it told (s of Unix time), what."""

    version: int
    texts: list[str]
    tellers: list[tuple[str, float, TelemetryTold]]


def state(minds: RemoteMinds, now: float) -> bytes:
    """Everything that was told of late, as bytes. Raises ParcelError for more than fits."""
    tellers = [(mind.name, mind.told_at, mind.told) for mind in minds.values() if now - mind.told_at <= KEPT]
    return pack(SeenParcel(VERSION, minds.texts(), tellers), MAX_SEEN)


def restore(minds: RemoteMinds, data: bytes, now: float) -> None:
    """Take in what another desk was told. What cannot be read is left out; raises ParcelError where nothing can."""
    parcel = unpack(SeenParcel, data, MAX_SEEN, "what robots told")
    if parcel.version != VERSION:
        raise ParcelError(f"what robots told, of version {parcel.version}, wanted {VERSION}")
    for name, at, told in parcel.tellers[:MAX_TELLERS]:
        if isfinite(at) and now - at <= KEPT:
            minds.take(_said(name, msgspec.to_builtins(told, builtin_types=(bytes,))), min(at, now))
    for text in parcel.texts[: MAX_TYPES + MAX_MINDS]:
        minds.take(_said("", text), now)


def _said(name: str, told: object) -> Message:
    return Message(name or "desk", 0, 0, Kind.ANSWER, 0.0, body={TOLD: told})
