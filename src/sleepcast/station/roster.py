"""The roster: which robots there are, when each was last heard, and what it said of itself then."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import inf

from sleepcast.errors import MisuseError, did_you_mean
from sleepcast.station.minds import Telemetry

MAX_ROBOTS = 1_000_000
"""Robots on one roster; names beyond it are not taken in, so that a forger cannot fill the memory with names."""


class UnknownRobotError(MisuseError):
    """A name that no robot on the roster has."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        names = list(known)
        super().__init__(f'there is no robot "{name}" among the {len(names)} on the roster{did_you_mean(name, names)}')


@dataclass(slots=True)
class Row:
    """The latest news of one robot. told: when it last sent telemetry, heard: when it last sent anything (s of the
    desk's clock, -inf: never). values, groups, stopped: as of `told`."""

    robot: str
    heard: float = -inf
    told: float = -inf
    values: list[float] | None = None
    groups: frozenset[str] = frozenset()
    stopped: bool = False


class Roster:
    """Robots by name, in the order in which they were enrolled."""

    def __init__(self, names: Iterable[str] = ()) -> None:
        self._rows: dict[str, Row] = {}
        for name in names:
            self.enrol(name)

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows.values())

    def __getitem__(self, name: str) -> Row:
        """The row of a robot. Raises UnknownRobotError."""
        row = self._rows.get(name)
        if row is None:
            raise UnknownRobotError(name, self._rows)
        return row

    def names(self) -> tuple[str, ...]:
        """Every robot's name."""
        return tuple(self._rows)

    def enrol(self, name: str) -> Row | None:
        """The row of a robot, a new one if need be; None if the roster is full."""
        row = self._rows.get(name)
        if row is None and len(self._rows) < MAX_ROBOTS:
            row = self._rows[name] = Row(name)
        return row

    def hear(self, name: str, now: float) -> None:
        """Note that a robot has said something at `now`."""
        row = self.enrol(name)
        if row is not None:
            row.heard = now

    def observe(self, now: float, told: Iterable[Telemetry]) -> None:
        """Take in what robots tell of themselves at `now`; their numbers are copied."""
        for news in told:
            row = self.enrol(news.name)
            if row is not None:
                row.heard = row.told = now
                row.values, row.groups, row.stopped = list(news.values), news.groups, news.stopped
