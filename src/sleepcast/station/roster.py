"""The roster: which robots there are, when each was last heard, and which are expected.

A robot has a place, in the order of enrolment; what is known of many robots lies side by side, by place.

A station learns who is there only from what it hears. A robot that it never heard counts as silent where `--expect`,
or the fleet file in the user's settings (one for each channel and fleet), says how many robots, or which, belong to it.
A file that a person writes has names between blanks, commas or lines; what follows a `#` is a comment.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from hashlib import sha256
from math import inf
from pathlib import Path
from typing import TypeVar, overload

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import MAX_NAME, is_robot_name
from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.errors import MisuseError, SleepcastError, did_you_mean
from sleepcast.core.files import config_folder, open_file, replace_file
from sleepcast.core.serial import Array
from sleepcast.station.serialized import RosterState

MAX_ROBOTS = 1_000_000
"""Robots on one roster; names beyond it are not taken in, so that a forger cannot fill the memory with names."""
MAX_OF_KEY = MAX_ROBOTS // 2
"""Of them, those that are first heard under one key: robots may share one, and who has it can invent names."""

Index = NDArray[np.intp]
Seconds = NDArray[np.float64]
Number = TypeVar("Number", bound=np.generic)


def longer(column: NDArray[Number], length: int) -> NDArray[Number]:
    """The column with zeros at its end, as long as said."""
    return column if len(column) == length else np.append(column, np.zeros(length - len(column), column.dtype))


class UnknownRobotError(MisuseError):
    """A name that no robot on the roster has."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        names = list(filter(None, known))
        super().__init__(f'there is no robot "{name}" among the {len(names)} on the roster{did_you_mean(name, names)}')


def of_robots(count: int, expected: bool) -> str:
    """The robots among which silence was counted. expected: whether that is the number that was given."""
    return f"of {count:,} robots" + ("" if expected else " heard so far")


class Roster:
    """Robots by name, in the order in which they were enrolled.

    heard: when each last sent anything, reported: when its last telemetry arrived; s of the desk's clock, -inf for
    never, by place, with room for robots that are still to come. size: how many robots there are at least, heard or
    not; 0 where that is unknown.
    """

    def __init__(self, names: Iterable[str] = (), size: int = 0) -> None:
        self.size = size
        self._of: Counter[str] = Counter()
        """How many names were first heard under each key."""
        self.names = names.copy() if isinstance(names, NameIndex) else NameIndex()
        self.heard: Seconds = np.full(len(self.names), -inf)
        self.reported: Seconds = np.full(len(self.names), -inf)
        self._everybody = _named(names) if isinstance(names, NameIndex) and "" in names else None
        self.size = self.size if self._everybody is None else len(self._everybody)
        if not isinstance(names, NameIndex):
            for name in names:
                self.enrol(name)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def nameless(self) -> int:
        """How many of the expected robots are not on the roster."""
        return max(0, self.size - len(self.names))

    @property
    def everybody(self) -> Index | None:
        """The places of all robots, ascending; None where there is one at each place."""
        return self._everybody

    def asked(self, only: Index | None) -> Index | None:
        """The places of those that are asked where only these are, or None for all: whoever comes later is not."""
        return self._everybody if only is None else only

    @property
    def count(self) -> int:
        """How many robots there are at these places."""
        return len(self.names) if self._everybody is None else len(self._everybody)

    def turn_over(self, names: NameIndex, changed: Index) -> None:
        """Other robots, or none, are at these places, and nobody has heard them yet. names: by place, "" for none."""
        self.names = names
        self.heard[changed] = self.reported[changed] = -inf
        before = np.arange(len(names)) if self._everybody is None else self._everybody
        there = [place for place in changed.tolist() if names[place]]
        self._everybody = np.union1d(np.setdiff1d(before, changed), np.array(there, np.intp))
        self.size = len(self._everybody)

    def by_name(self) -> dict[str, float | None]:
        """When each robot was last heard, s, None for never."""
        heard = zip(self.names, self.heard.tolist(), strict=False)
        return {name: at if at > -inf else None for name, at in heard if name}

    def place(self, name: str) -> int:
        """The place of a robot. Raises UnknownRobotError."""
        place = self.names.index_of(name)
        if place is None:
            raise UnknownRobotError(name, self.names)
        return place

    def enrol(self, name: str) -> int | None:
        """The place of a robot, a new one if need be; None if the roster is full, and where robots come and go, since
        there is nobody else then."""
        place = self.names.index_of(name)
        if place is None and self.names.lasting and len(self.names) < MAX_ROBOTS:
            place = self.names.add(name)
            if place >= len(self.heard):
                self.heard, self.reported = _longer(self.heard), _longer(self.reported)
        return place

    def hear(self, name: str, now: float, key: str = "") -> int | None:
        """Store that a robot was heard at `now` under this key ("" if nobody signs), and return its place; None without
        room for one more."""
        place = self.names.index_of(name)
        if place is None and (not key or self._of[key] < MAX_OF_KEY):
            place = self.enrol(name)
            self._of[key] += 1
        if place is not None:
            self.heard[place] = now
        return place

    def hear_many(self, names: Sequence[str], robots: Index, now: float) -> None:
        """Store that these robots were heard, which are still at the places of `names` that they had."""
        if not self.names.lasting and names is not self.names:
            robots = np.array([place for place in robots.tolist() if names[place] == self.names[place]], np.intp)
        self.heard[robots] = now

    def state(self, minds: int) -> RosterState:
        """All of it. minds: how many of the robots, from the first on, are known by their minds."""
        listed = len(self.names)
        return RosterState(list(self.names[minds:]), Array.of(self.heard[:listed]), Array.of(self.reported[:listed]))

    def restore(self, state: RosterState) -> None:
        """Know what that roster knew. Raises SerialError."""
        for name in state.others:
            self.enrol(name)
        shape = (len(self.names),)
        self.heard = state.heard.made(np.float64, shape, "when robots were heard")
        self.reported = state.told.made(np.float64, shape, "times of telemetry")

    def meant(self, only: Index | None, named: bool) -> int:
        """How many robots a message is for, including robots that were never heard; 0 where that is unknown. only: the
        places of those on the roster, None for all; named: whether it is for these alone."""
        if only is None:
            return self.size
        return len(only) if named else self.size and len(only) + self.nameless

    def go_back(self, time: float) -> None:
        """Nobody was heard after `time`, s."""
        np.minimum(self.heard, time, out=self.heard)
        np.minimum(self.reported, time, out=self.reported)

    def observe(self, robots: Index | slice, now: float) -> None:
        """Store that the telemetry of these robots is of `now`, which may be some time ago."""
        self.heard[robots] = np.maximum(self.heard[robots], now)
        self.reported[robots] = now

    def forget(self, robots: Iterable[str]) -> list[int]:
        """These robots have told nothing that still counts. Gives their places."""
        places = [place for name in robots if (place := self.names.index_of(name)) is not None]
        self.reported[places] = -inf
        return places


class RobotNames(Sequence[str]):
    """Robots by their places, named only on request."""

    def __init__(self, names: NameIndex, places: Index) -> None:
        self.names, self.places = names, places

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, at: int) -> str: ...

    @overload
    def __getitem__(self, at: slice) -> tuple[str, ...]: ...

    def __getitem__(self, at: int | slice) -> str | tuple[str, ...]:
        if isinstance(at, slice):
            return tuple(self.names[place] for place in self.places[at].tolist())
        return self.names[int(self.places[at])]


def _named(names: NameIndex) -> Index:
    """The places at which there is a robot."""
    return np.flatnonzero(np.fromiter((bool(name) for name in names), np.bool_, len(names)))


def _longer(column: Seconds) -> Seconds:
    return np.concatenate((column, np.full(max(16, len(column)), -inf)))


FORMAT = 1
MAX_BYTES = 128 * 1024 * 1024
"""Of a file: as many names as a roster takes."""


class ExpectationError(MisuseError):
    """A number, a name or a file that does not say which robots belong to a fleet."""


class FleetFileLostError(SleepcastError):
    """A fleet file that cannot be written."""


class Expectation(msgspec.Struct, frozen=True):
    """names: of the robots that belong to the fleet, as far as they are known; size: how many there are at least, those
    with names among them; 0 where nobody has said."""

    names: tuple[str, ...] = ()
    size: int = 0

    @classmethod
    def of(cls, names: Iterable[str]) -> Expectation:
        """Just these robots. Raises ExpectationError for what is no name, and for more than a roster takes."""
        given = tuple(dict.fromkeys(names))
        for name in given:
            if not is_robot_name(name):
                raise ExpectationError(f"{name!r:.80} names no robot: wanted 1 to {MAX_NAME} characters without blanks")
        return cls(given, _sized(len(given)))

    def __bool__(self) -> bool:
        return self.size > 0


NOBODY_SAID = Expectation()


def read_expectation(said: str) -> Expectation:
    """The value of `--expect`: a number, or the path of a file of names. Raises ExpectationError."""
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
        """The stored expectation. Raises ExpectationError for a file that cannot be used."""
        try:
            record = msgspec.json.decode(_read(self.file), type=FleetRecord)
        except FileNotFoundError:
            return NOBODY_SAID
        except OSError as error:
            raise ExpectationError(f"cannot read {self.file}: {error.strerror or error}; {self._mend}") from None
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise ExpectationError(f"{self.file} is not a fleet file ({error}): {self._mend}") from None
        if record.format != FORMAT or len(record.names) > max(0, record.size):
            raise ExpectationError(
                f"{self.file} has format {record.format} and {len(record.names)} names of {record.size} robots, which "
                f"this version of sleepcast does not read: {self._mend}"
            )
        return Expectation(Expectation.of(record.names).names if record.names else (), _sized(record.size))

    def write(self, expected: Expectation) -> None:
        """Keep this. Raises FleetFileLostError; the file is then as it was."""
        record = FleetRecord(FORMAT, self._channel, self._fleet, expected.size, list(expected.names))
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self.file, msgspec.json.encode(record))
        except OSError as error:
            raise FleetFileLostError(f"cannot write {self.file}: {error.strerror or error}") from None

    def remove(self) -> None:
        """Forget which robots are expected. Raises FleetFileLostError."""
        try:
            self.file.unlink(missing_ok=True)
        except OSError as error:
            raise FleetFileLostError(f"cannot remove {self.file}: {error.strerror or error}") from None

    @property
    def _mend(self) -> str:
        return "set the fleet's robots again with sleepcast roster --expect"


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


# ---- when robots were last commanded


class CommandedTimes:
    """When robots were last commanded, by this desk or another: of all robots of a roster, and of single ones that were
    commanded since; s of the desk's clock. What they reported before does not say who will obey."""

    def __init__(self) -> None:
        self._all = -inf
        self._some: dict[int, float] = {}
        self.latest = -inf
        """When any robot was commanded last."""
        self.count = 0
        """How often robots were."""

    def note(self, at: float, places: Index | None = None) -> None:
        """Robots were commanded at a time. places: of these robots, None for all."""
        self.latest = max(self.latest, at)
        self.count += 1
        if places is None:
            self._all = max(self._all, at)
            self._some = {place: time for place, time in self._some.items() if time > self._all}
            return
        for place in places.tolist():
            self._some[place] = max(at, self._some.get(place, self._all))

    def of(self, count: int) -> Seconds:
        """Of the first robots on the roster, so many of them: when each was commanded last, -inf for never."""
        times = np.full(count, self._all)
        for place, time in self._some.items():
            if place < count:
                times[place] = time
        return times
