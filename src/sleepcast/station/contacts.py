"""Who was heard on the air before, and when, in a file for each fleet: so that a robot which says nothing is missed by
the next desk as well.

It is no more than a memory: a file that is lost or cannot be read fills again by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf, isfinite
from pathlib import Path

import msgspec

from sleepcast.channel.message import MAX_NAME
from sleepcast.core.errors import SleepcastError
from sleepcast.core.files import data_folder, replace_file
from sleepcast.station.roster import MAX_ROBOTS

MAX_BYTES = 128 * 1024 * 1024
"""Of a file: as many robots as a roster takes."""


class ContactsLostError(SleepcastError):
    """Who was heard cannot be remembered."""


class Contacts:
    """The robots in a file, by name, with when each was last heard (s of Unix time). Two desks may share a file: what
    is saved is what both have heard."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.heard: dict[str, float] = self._read()

    @classmethod
    def of(cls, fleet: str) -> Contacts:
        """Those of a fleet, in this user's data."""
        return cls(data_folder() / "rosters" / f"{fleet.encode().hex()}.json")

    def save(self, heard: Mapping[str, float]) -> None:
        """Remember who was heard. Raises ContactsLostError; the file is then as it was."""
        known = self._read()
        known.update((name, max(time, known.get(name, -inf))) for name, time in heard.items() if isfinite(time))
        self._write(known)

    def forget(self, names: Iterable[str]) -> None:
        """Miss these no more, until they are heard again. Raises ContactsLostError."""
        known = self._read()
        for name in names:
            known.pop(name, None)
        self._write(known)

    def _read(self) -> dict[str, float]:
        try:
            with self.file.open("rb") as opened:
                found = msgspec.json.decode(opened.read(MAX_BYTES), type=dict[str, float])
        except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return {}
        fit = [(name, time) for name, time in found.items() if 0 < len(name) <= MAX_NAME]
        return dict(fit[:MAX_ROBOTS])

    def _write(self, known: dict[str, float]) -> None:
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self.file, msgspec.json.encode(known))
        except OSError as error:
            raise ContactsLostError(
                f"cannot remember who was heard ({self.file}: {error.strerror or error}): silence will not be told "
                "next time"
            ) from None
        self.heard = known
