"""What robots far away told, kept from one command to the next: the same texts and numbers, read as if heard again."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

import msgspec

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import MAX_NAME
from sleepcast.channel.payload import TOLD
from sleepcast.core.files import data_folder, replace_file
from sleepcast.core.serial import SerialError, pack, unpack
from sleepcast.station.contacts import ContactsLostError
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


class Seen:
    """What is kept in a file. It is no more than a memory: one that is lost or cannot be read fills again by itself."""

    def __init__(self, file: Path) -> None:
        self.file = file

    @classmethod
    def of(cls, fleet: str) -> Seen:
        """That of a fleet, in this user's data."""
        return cls(data_folder() / "seen" / fleet.encode().hex())

    def restore(self, minds: RemoteMinds, now: float) -> None:
        """Take in what another desk was told. now: s of Unix time."""
        try:
            with self.file.open("rb") as opened:
                parcel = unpack(SeenParcel, opened.read(MAX_SEEN), MAX_SEEN, "what robots told")
        except (OSError, SerialError):
            return
        if parcel.version != VERSION:
            return
        for name, at, told in parcel.tellers[:MAX_TELLERS]:
            if 0 < len(name) <= MAX_NAME and isfinite(at) and now - at <= KEPT:
                minds.take(_said(name, msgspec.to_builtins(told, builtin_types=(bytes,))), min(at, now))
        for text in parcel.texts[: MAX_TYPES + MAX_MINDS]:
            minds.take(_said("desk", text), now)

    def save(self, minds: RemoteMinds, now: float) -> None:
        """Keep what was told of late. Raises ContactsLostError; the file is then as it was."""
        tellers = [(mind.name, mind.told_at, mind.told) for mind in minds.values() if now - mind.told_at <= KEPT]
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self.file, pack(SeenParcel(VERSION, minds.texts(), tellers), MAX_SEEN))
        except (OSError, SerialError) as error:
            raise ContactsLostError(f"cannot remember what robots told ({self.file}: {error})") from None


def _said(name: str, told: object) -> Message:
    return Message(name, 0, 0, Kind.ANSWER, 0.0, body={TOLD: told})
