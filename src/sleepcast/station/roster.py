"""The roster: which robots there are, when each was last heard, and when it last told anything of itself.

A robot has a place, in the order of enrolment; what is known of many robots lies side by side, by place.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf
from typing import overload

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.name_index import NameIndex
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.serial import Array
from sleepcast.station.parcels import RosterParcel

MAX_ROBOTS = 1_000_000
"""Robots on one roster; names beyond it are not taken in, so that a forger cannot fill the memory with names."""

Index = NDArray[np.intp]
Seconds = NDArray[np.float64]


class UnknownRobotError(MisuseError):
    """A name that no robot on the roster has."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        names = list(known)
        super().__init__(f'there is no robot "{name}" among the {len(names)} on the roster{did_you_mean(name, names)}')


def of_robots(count: int, expected: bool) -> str:
    """Among whom silence was counted. expected: whether these are all that there are, as somebody has said."""
    return f"of {count:,} robots" + ("" if expected else " heard so far")


class Roster:
    """Robots by name, in the order in which they were enrolled.

    heard: when each last sent anything, told: when it last told of itself; s of the desk's clock, -inf for never, by
    place, with room for robots that are still to come. size: how many robots there are at least, heard or not; 0 where
    nobody has said.
    """

    def __init__(self, names: Iterable[str] = (), size: int = 0) -> None:
        self.size = size
        self.names = names.copy() if isinstance(names, NameIndex) else NameIndex()
        self.heard: Seconds = np.full(len(self.names), -inf)
        self.told: Seconds = np.full(len(self.names), -inf)
        if not isinstance(names, NameIndex):
            for name in names:
                self.enrol(name)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def nameless(self) -> int:
        """How many robots there are, as somebody has said, that are not on the roster."""
        return max(0, self.size - len(self.names))

    def place(self, name: str) -> int:
        """The place of a robot. Raises UnknownRobotError."""
        found = self.names.place(name)
        if found is None:
            raise UnknownRobotError(name, self.names)
        return found

    def enrol(self, name: str) -> int | None:
        """The place of a robot, a new one if need be; None if the roster is full."""
        place = self.names.place(name)
        if place is None and len(self.names) < MAX_ROBOTS:
            place = self.names.add(name)
            if place >= len(self.heard):
                self.heard, self.told = _longer(self.heard), _longer(self.told)
        return place

    def hear(self, name: str, now: float) -> int | None:
        """Note that a robot has said something at `now`; gives its place."""
        place = self.enrol(name)
        if place is not None:
            self.heard[place] = now
        return place

    def state(self, minds: int) -> RosterParcel:
        """All of it. minds: so many of the robots, from the first on, are known by their minds."""
        listed = len(self.names)
        return RosterParcel(list(self.names[minds:]), Array.of(self.heard[:listed]), Array.of(self.told[:listed]))

    def restore(self, parcel: RosterParcel) -> None:
        """Know what that roster knew. Raises ParcelError."""
        for name in parcel.others:
            self.enrol(name)
        shape = (len(self.names),)
        self.heard = parcel.heard.made(np.float64, shape, "when robots were heard")
        self.told = parcel.told.made(np.float64, shape, "when robots told of themselves")

    def observe(self, robots: Index | slice, now: float) -> None:
        """Note that these robots have told of themselves at `now`, which may be some time ago."""
        self.heard[robots] = np.maximum(self.heard[robots], now)
        self.told[robots] = now


class Some(Sequence[str]):
    """Robots by their places, named only when somebody looks."""

    def __init__(self, names: NameIndex, places: Index) -> None:
        self._names, self.places = names, places

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, at: int) -> str: ...

    @overload
    def __getitem__(self, at: slice) -> tuple[str, ...]: ...

    def __getitem__(self, at: int | slice) -> str | tuple[str, ...]:
        if isinstance(at, slice):
            return tuple(self._names[place] for place in self.places[at].tolist())
        return self._names[int(self.places[at])]


def _longer(column: Seconds) -> Seconds:
    return np.concatenate((column, np.full(max(16, len(column)), -inf)))
