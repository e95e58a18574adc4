"""Which robots belong to a fleet, as an operator says it: their number, or their names.

A desk learns who is there only from what it hears, so a robot that was never heard is missed by nobody. With an
expectation it is: by its name where names are known, as one of a number where only that is. What holds for longer than
one command lies in a fleet file of the user's settings, one for each channel and fleet.

A file that a person writes has names between blanks, commas or lines; what follows a `#` is a comment.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import msgspec

from sleepcast.channel.message import MAX_NAME
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.files import config_folder, open_file, replace_file
from sleepcast.station.roster import MAX_ROBOTS

FORMAT = 1
MAX_BYTES = 128 * 1024 * 1024
"""Of a file: as many names as a roster takes."""


class ExpectationError(MisuseError):
    """A number, a name or a file that does not say which robots belong to a fleet."""


class FleetFileLostError(SleepcastError):
    """A fleet file that cannot be written."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """names: of the robots that belong to the fleet, as far as they are known; size: how many there are at least, those
    with names among them; 0 where nobody has said."""

    names: tuple[str, ...] = ()
    size: int = 0

    @classmethod
    def of(cls, names: Iterable[str]) -> Expectation:
        """Just these robots. Raises ExpectationError for what is no name, and for more than a roster takes."""
        found = tuple(dict.fromkeys(names))
        for name in found:
            if not 0 < len(name) <= MAX_NAME or not name.isprintable() or " " in name:
                raise ExpectationError(f"{name!r:.80} names no robot: wanted 1 to {MAX_NAME} characters without blanks")
        return cls(found, _sized(len(found)))

    def __bool__(self) -> bool:
        return self.size > 0


NOBODY_SAID = Expectation()


def read_expectation(said: str) -> Expectation:
    """What `--expect` says: a number, or the path of a file of names. Raises ExpectationError."""
    if said.isascii() and said.isdigit():
        return Expectation(size=_sized(int(said[:20])))
    try:
        text = _read(Path(said)).decode("utf-8-sig")
    except OSError as error:
        wanted = "wanted a number of robots, or a file of their names"
        raise ExpectationError(f"cannot read {said}: {error.strerror or error}; {wanted}") from None
    except UnicodeDecodeError as error:
        raise ExpectationError(f"{said} is not UTF-8 text (byte {error.start}): wanted names of robots") from None
    names = [name for line in text.splitlines() for name in line.partition("#")[0].replace(",", " ").split()]
    if not names:
        raise ExpectationError(f"{said} names no robot: wanted names between blanks, commas or lines")
    return Expectation.of(names)


class FleetRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What stands in a fleet file."""

    format: int
    channel: str
    fleet: str
    size: int
    names: list[str]


class FleetFile:
    """The robots that belong to the fleet of a channel, for every desk of this user."""

    def __init__(self, channel: str, fleet: str) -> None:
        self._channel, self._fleet = channel, fleet
        digest = sha256(f"{channel}\n{fleet}".encode(errors="surrogateescape")).hexdigest()  # an address may be long
        self.file = config_folder() / "fleets" / f"{digest[:32]}.json"

    def read(self) -> Expectation:
        """What was kept. Raises ExpectationError for a file that cannot be used."""
        try:
            found = msgspec.json.decode(_read(self.file), type=FleetRecord)
        except FileNotFoundError:
            return NOBODY_SAID
        except OSError as error:
            raise ExpectationError(f"cannot read {self.file}: {error.strerror or error}; {self._mend}") from None
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise ExpectationError(f"{self.file} is no fleet file ({error}): {self._mend}") from None
        if found.format != FORMAT or len(found.names) > max(0, found.size):
            raise ExpectationError(
                f"{self.file} has format {found.format} and {len(found.names)} names of {found.size} robots, which "
                f"this version of sleepcast does not read: {self._mend}"
            )
        return Expectation(Expectation.of(found.names).names if found.names else (), _sized(found.size))

    def write(self, expected: Expectation) -> None:
        """Keep this. Raises FleetFileLostError; the file is then as it was."""
        record = FleetRecord(FORMAT, self._channel, self._fleet, expected.size, list(expected.names))
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self.file, msgspec.json.encode(record))
        except OSError as error:
            raise FleetFileLostError(f"cannot write {self.file}: {error.strerror or error}") from None

    def remove(self) -> None:
        """Expect nobody any more. Raises FleetFileLostError."""
        try:
            self.file.unlink(missing_ok=True)
        except OSError as error:
            raise FleetFileLostError(f"cannot remove {self.file}: {error.strerror or error}") from None

    @property
    def _mend(self) -> str:
        return "say who belongs to the fleet anew with sleepcast roster --expect"


def _sized(count: int) -> int:
    if not 0 < count <= MAX_ROBOTS:
        raise ExpectationError(f"{count} robots cannot be expected: wanted 1 to {MAX_ROBOTS}")
    return count


def _read(file: Path) -> bytes:
    with open_file(file) as opened:
        data = opened.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise ExpectationError(f"{file} is larger than {MAX_BYTES} bytes: no fleet has so many names")
    return data
