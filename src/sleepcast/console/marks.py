"""The marks on the timeline: commands, STOPs, faults, joins, births, deaths and alerts, each at its time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from math import inf
from typing import TypeVar

import msgspec

from sleepcast.console.account_table import CommandRow
from sleepcast.console.failing import ShownFailing

Known = TypeVar("Known")

MAX_MARKS = 300
"""Marks that are kept, the latest: more cannot be told apart on a screen."""
MAX_KNOWN = 10_000
"""Commands, and rules that failed, of which it is known that they have a mark; a page shows the latest of far fewer."""
JOIN_EVERY = 0.02
"""Part of the time since the start within which joins of one group are one mark."""
TURNOVER_EVERY = 0.1
"""The same of births and deaths: there may be some in every tick, and other marks need room."""
LONGEST = 120
"""Characters of a mark's text: its first line, which the list of commands has whole."""


class Mark(msgspec.Struct, frozen=True):
    """What happened.

    at: simulated s
    kind: command, ask, stop, release, fault, join, birth, death, turnover (both) or alert
    seen: from when on there is anything to be seen of it, s
    command: its id, "" for none
    """

    at: float
    kind: str
    text: str
    seen: float
    command: str = ""


class Marks:
    """Notices what is worth a mark, as it is told what is so."""

    def __init__(self) -> None:
        self.all: deque[Mark] = deque(maxlen=MAX_MARKS)
        self.number = 0
        """How many there have been."""
        self._known: dict[str, int] = {}
        """The commands that have a mark, each with the faults that were told."""
        self._failing: dict[str, None] = {}
        """The rules whose failing has a mark."""
        self._groups: dict[str, tuple[float, int]] = {}
        """When each group had its last mark, and its members when it was looked at last."""
        self._names: Sequence[str] | None = None
        """Of who was there when it was looked at last."""
        self._turnover = (-inf, 0, 0)
        """When births and deaths had their last mark, and how many there have been of each since."""

    def add(self, at: float, kind: str, text: str, seen: float | None = None, command: str = "") -> None:
        """Another mark."""
        self.number += 1
        line = text.strip().split("\n")[0]
        line = line if len(line) <= LONGEST else line[: LONGEST - 1] + "…"
        self.all.append(Mark(at, kind, line, at if seen is None else seen, command))

    def sort(self) -> None:
        """Put those that were noticed in another order into that of time."""
        self.all = deque(sorted(self.all, key=lambda mark: mark.at), MAX_MARKS)

    def rows(self, time: float, rows: Iterable[CommandRow]) -> None:
        """What the accounts say at this time."""
        for row in rows:
            if row.id not in self._known:
                self.add(row.at, row.kind, row.text or row.kind.upper(), time, row.id)
                self._known[row.id] = 0
            if row.fault and not self._known[row.id]:
                self.add(time, "fault", f"{_robots(row.fault)}: fault in {row.text}", command=row.id)
                self._known[row.id] = row.fault
        _keep_latest(self._known)

    def failing(self, time: float, rules: Iterable[ShownFailing]) -> None:
        """Which rules fail at this time."""
        for rule in rules:
            key = rule.rule.casefold()
            if key not in self._failing:
                self._failing[key] = None
                self.add(time, "fault", f"rule {rule.rule} fails on {_robots(rule.robots)}: {rule.reason}")
        _keep_latest(self._failing)

    def take(self, other: Marks, until: float) -> None:
        """Go on from what another run had up to a time."""
        self.all.extend(mark for mark in other.all if mark.seen <= until)
        self.number = other.number + 1
        here = {mark.command for mark in self.all}
        self._known = {command: faults for command, faults in other._known.items() if command in here}
        self._failing = dict(other._failing) if any(mark.kind == "fault" for mark in self.all) else {}

    def groups(self, time: float, names: Sequence[str], counts: Sequence[int]) -> None:
        """How many are in each group at this time."""
        for name, count in zip(names, counts, strict=True):
            marked, before = self._groups.get(name, (-1.0, 0))
            if count > before and (marked < 0.0 or time - marked > JOIN_EVERY * time):
                self.add(time, "join", f"{name}: {_robots(count)}")
                marked = time
            self._groups[name] = marked, count

    def names(self, time: float, names: Sequence[str]) -> None:
        """Who is there at this time, by place, "" for nobody."""
        before, self._names = self._names, names
        marked, born, gone = self._turnover
        if before is not None and before is not names:
            old, new = set(filter(None, before)), set(filter(None, names))
            born, gone = born + len(new - old), gone + len(old - new)
        if (born or gone) and time - marked > TURNOVER_EVERY * time:
            kind = "turnover" if born and gone else "birth" if born else "death"
            said = f"{_robots(born)} came" if born else "", f"{_robots(gone)} gone" if gone else ""
            self.add(time, kind, ", ".join(filter(None, said)))
            marked, born, gone = time, 0, 0
        self._turnover = marked, born, gone


def _keep_latest(known: dict[str, Known]) -> None:
    while len(known) > MAX_KNOWN:
        del known[next(iter(known))]


def _robots(count: int) -> str:
    return f"{count:,} robot{'s' * (count != 1)}"


def clock_time(seconds: float) -> str:
    """Seconds as the page writes times: 0:03:20."""
    whole = int(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"
