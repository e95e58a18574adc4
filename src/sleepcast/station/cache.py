"""What a station remembers of a fleet in files: who was heard (peers), and what robots reported (telemetry).

Both are caches: a file that is lost or cannot be read fills again by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf, isfinite
from pathlib import Path

import msgspec

from sleepcast.channel.message import MAX_NAME
from sleepcast.core.errors import SleepcastError
from sleepcast.core.files import data_folder, replace_file
from sleepcast.core.serial import SerialError, pack, unpack
from sleepcast.mind.telemetry import TelemetryRecord
from sleepcast.station.remote import MAX_MINDS, MAX_TELLERS, MAX_TYPES, RemoteMinds
from sleepcast.station.roster import MAX_ROBOTS

MAX_BYTES = 128 * 1024 * 1024
"""Of a file: as many robots as a roster takes."""


class CacheError(SleepcastError):
    """Who was heard cannot be remembered."""


class PeerCache:
    """The robots in a file, by name, with when each was last heard (s of Unix time). Two desks may share a file: what
    is saved is what both have heard."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.heard: dict[str, float] = self._read()

    @classmethod
    def of(cls, fleet: str) -> PeerCache:
        """Those of a fleet, in this user's data."""
        return cls(data_folder() / "rosters" / f"{fleet.encode().hex()}.json")

    def save(self, heard: Mapping[str, float]) -> None:
        """Remember who was heard. Raises CacheError; the file is then as it was."""
        known = self._read()
        known.update((name, max(time, known.get(name, -inf))) for name, time in heard.items() if isfinite(time))
        self._write(known)

    def forget(self, names: Iterable[str]) -> None:
        """Miss these no more, until they are heard again. Raises CacheError."""
        known = self._read()
        for name in names:
            known.pop(name, None)
        self._write(known)

    def _read(self) -> dict[str, float]:
        try:
            with self.file.open("rb") as opened:
                times = msgspec.json.decode(opened.read(MAX_BYTES), type=dict[str, float])
        except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return {}
        fit = [(name, time) for name, time in times.items() if 0 < len(name) <= MAX_NAME]
        return dict(fit[:MAX_ROBOTS])

    def _write(self, known: dict[str, float]) -> None:
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self.file, msgspec.json.encode(known))
        except OSError as error:
            raise CacheError(
                f"cannot save which robots were heard ({self.file}: {error.strerror or error}): the next desk will not "
                "miss silent robots"
            ) from None
        self.heard = known


VERSION = 1
MAX_SEEN = 256 * 1024**2
"""Bytes of a cache file, unpacked: more than the longest minds and telemetry that a desk holds."""
MAX_AGE = 3_600.0
"""Seconds for which telemetry is worth keeping."""


class CachedTelemetry(msgspec.Struct):
    """See the module.

    texts: of types and minds
    tellers: name, time (s of Unix time) and telemetry of each robot
    commanded: when robots were last commanded, which may have changed them (s of Unix time)
    """

    version: int
    texts: list[str]
    tellers: list[tuple[str, float, TelemetryRecord]]
    commanded: float = -inf


class TelemetryCache:
    """A file that holds what was received. It is only a cache: one that is lost or cannot be read fills again."""

    def __init__(self, file: Path) -> None:
        self.file = file

    @classmethod
    def of(cls, fleet: str) -> TelemetryCache:
        """That of a fleet, in this user's data."""
        return cls(data_folder() / "seen" / fleet.encode().hex())

    def restore(self, minds: RemoteMinds, now: float) -> float:
        """Read the telemetry that another desk has stored, and give when that desk last commanded robots, -inf for
        never. now: s of Unix time."""
        try:
            with self.file.open("rb") as opened:
                state = unpack(CachedTelemetry, opened.read(MAX_SEEN), MAX_SEEN, "telemetry")
        except (OSError, SerialError):
            return -inf
        if state.version != VERSION:
            return -inf
        minds.began = now
        for name, at, telemetry in state.tellers[:MAX_TELLERS]:
            if 0 < len(name) <= MAX_NAME and isfinite(at) and now - at <= MAX_AGE:
                minds.restore(name, telemetry, min(at, now))
        for text in state.texts[: MAX_TYPES + MAX_MINDS]:
            minds.restore("", text, now)
        return state.commanded if state.commanded <= now else now

    def save(self, minds: RemoteMinds, now: float, commanded: float) -> None:
        """Keep recent telemetry, and when robots were last commanded. Raises CacheError; the file is then as it
        was."""
        tellers = [
            (mind.name, mind.reported_at, mind.telemetry)
            for mind in minds.values()
            if now - mind.reported_at <= MAX_AGE
        ]
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self.file, pack(CachedTelemetry(VERSION, minds.texts(), tellers, commanded), MAX_SEEN))
        except (OSError, SerialError) as error:
            raise CacheError(f"cannot save telemetry ({self.file}: {error})") from None
