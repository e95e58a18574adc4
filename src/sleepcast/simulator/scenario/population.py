"""Robots that come and go: where a scenario says `hatch = true` of a sort of them, more of it may come during a run,
and any robot may go.

Whatever is kept of robots lies in arrays with a row for each. Where robots come and go there are as many rows as there
may be robots at one time, sort by sort; a row is used again once its robot has gone. What tells robots apart is their
number, which none ever has a second time, and after which they are called.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.errors import MisuseError
from sleepcast.robot import BodyConstant
from sleepcast.simulator.scenario.groups import RobotGroup, group_indices
from sleepcast.simulator.scenario.robot_settings import MAX_ROBOTS, USUAL_ROOM, RobotSpec
from sleepcast.simulator.scenario.robot_types import names_of, slices
from sleepcast.simulator.scenario.scenario import Scenario


def comes_and_goes(scenario: Scenario) -> bool:
    """Whether robots come and go."""
    return any(spec.hatch for spec in scenario.each_type)


def with_room(scenario: Scenario) -> Scenario:
    """The scenario with as many robots of each sort as there may be at one time. Raises MisuseError for too many."""
    counts = [part.stop - part.start for part in slices(scenario.each_type, scenario.robots.count)]
    specs = tuple(_roomy(*each) for each in zip(scenario.each_type, counts, strict=True))
    total = sum(spec.count for spec in specs)
    if total > MAX_ROBOTS:
        raise MisuseError(f"room for {total} robots is too much: at most {MAX_ROBOTS} fit. Say a lower most = ...")
    if not scenario.sorts:
        return replace(scenario, robots=specs[0])
    groups = tuple(group for spec in specs for group in spec.groups or (RobotGroup(spec.type, spec.count, {}),))
    return replace(scenario, robots=replace(scenario.robots, count=total, groups=groups), sorts=specs)


def _roomy(spec: RobotSpec, count: int) -> RobotSpec:
    """A sort, and its groups, with as many robots as there may be at one time. count: at the start."""
    room = _room(spec, count)
    sizes = np.bincount(group_indices(spec.groups, room), minlength=len(spec.groups)) if spec.groups else ()
    groups = tuple(replace(group, count=int(size)) for group, size in zip(spec.groups, sizes, strict=True))
    return replace(spec, count=room, groups=groups)


def _room(spec: RobotSpec, count: int) -> int:
    """How many robots of a sort there may be at one time. count: at the start."""
    return max(count, spec.most or USUAL_ROOM * count) if spec.hatch else count


def rows_at_first(scenario: Scenario) -> NDArray[np.intp]:
    """The row of each robot at the start, in the order of their numbers."""
    counts = [part.stop - part.start for part in slices(scenario.each_type, scenario.robots.count)]
    rooms = [_room(spec, count) for spec, count in zip(scenario.each_type, counts, strict=True)]
    begins = accumulate(rooms[:-1], initial=0)
    return np.concatenate([np.arange(begin, begin + count) for begin, count in zip(begins, counts, strict=True)])


def sorts_by_name(specs: Sequence[RobotSpec]) -> dict[str, int]:
    """The sorts of which more may come, by the names that HATCH knows: their types, each with its place in the file. Of
    several of one type it is the first."""
    return {spec.type: place for place, spec in reversed([*enumerate(specs)]) if spec.hatch}


def sort_constants(scenario: Scenario) -> tuple[BodyConstant, ...]:
    """The names of those sorts, as robots know them."""
    named = sorts_by_name(scenario.each_type)
    return tuple(BodyConstant(name, float(place), "", "a sort of robots, for HATCH") for name, place in named.items())


class NamesByRow(NameIndex):
    """The names of robots by their rows, "" for rows without a robot. They never change: `after` gives others."""

    def __init__(self, names: Sequence[str], kinds: Sequence[str], rows: Iterable[int]) -> None:
        super().__init__()
        self._listed, self._kinds = list(names), kinds
        self._indices = {self._listed[row]: row for row in rows}
        self._first = frozenset(self._indices)
        """The names at the start, which are the only ones that may have been chosen freely."""

    def after(self, gone: NDArray[np.intp], come: NDArray[np.intp], numbers: NDArray[np.intp]) -> NamesByRow:
        """The names once the robots of the rows `gone` are gone, and others have come. numbers: of these, from 0."""
        later = NamesByRow((), self._kinds, ())
        later._listed, later._indices, later._first = self._listed.copy(), self._indices.copy(), self._first
        for row in gone.tolist():
            del later._indices[later._listed[row]]
            later._listed[row] = ""
        for row, number in zip(come.tolist(), numbers.tolist(), strict=True):
            name = f"{self._kinds[row]}{number + 1}"
            name = later._listed[row] = f"{name}b" if name in self._first else name
            later._indices[name] = row
        return later

    def copy(self) -> NameIndex:
        return self

    def __contains__(self, name: object) -> bool:
        return name in self._indices or (name == "" and len(self._indices) < len(self._listed))

    def add(self, name: str) -> int:
        """The row of a robot. Raises KeyError for a name that none has: others are not taken in."""
        return self._indices[name]


def named_by_row(scenario: Scenario) -> NamesByRow:
    """The names at the start of a scenario in which robots come and go."""
    first, rows = names_of(scenario.each_type, scenario.robots.count), rows_at_first(scenario).tolist()
    roomy = with_room(scenario)
    names = [""] * roomy.robots.count
    for name, row in zip(first, rows, strict=True):
        names[row] = name
    kinds = [spec.type for spec in roomy.each_type for _ in range(spec.count)]
    return NamesByRow(names, kinds, rows)
