"""Robots that come and go: where a scenario says `hatch = true` of a sort of them, robots may hatch more of it during a
run, and any robot may go. Those of a sort with `at` come at that time, and people may add some of a sort with `most`.

Whatever is kept of robots lies in arrays with a row for each. Where robots come and go there are as many rows as there
may be robots at one time, sort by sort; a row is used again once its robot has gone. What tells robots apart is their
number, which none ever has a second time, and after which they are called.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.errors import MisuseError
from sleepcast.core.ticks import nearest_ticks
from sleepcast.robot import BodyConstant
from sleepcast.simulator.scenario.groups import RobotGroup, group_indices
from sleepcast.simulator.scenario.robot_settings import MAX_ROBOTS, USUAL_ROOM, RobotSpec
from sleepcast.simulator.scenario.robot_types import names_of, slices
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.signals import MAX_DELAYED


def comes_and_goes(scenario: Scenario) -> bool:
    """Whether robots come, or go."""
    return any(spec.comes_and_goes for spec in scenario.each_type)


def hatches(scenario: Scenario) -> bool:
    """Whether robots hatch others, and go."""
    return any(spec.hatch for spec in scenario.each_type)


def addable(scenario: Scenario) -> tuple[str, ...]:
    """The types of robots of which people may add some."""
    return tuple(dict.fromkeys(spec.type for spec in scenario.each_type if spec.hatch or spec.most))


def sizes(scenario: Scenario) -> list[int]:
    """How many robots of each sort the scenario has, those that come later among them."""
    return [part.stop - part.start for part in slices(scenario.each_type, scenario.robots.count)]


def counts(scenario: Scenario) -> list[int]:
    """How many robots of each sort there are at the start."""
    return [0 if spec.at else size for spec, size in zip(scenario.each_type, sizes(scenario), strict=True)]


def rooms(scenario: Scenario) -> list[int]:
    """How many robots of each sort there may be at one time."""
    sized = zip(scenario.each_type, sizes(scenario), strict=True)
    return [max(size, spec.most or (USUAL_ROOM if spec.hatch else 1) * size) for spec, size in sized]


def delayed_rows(scenario: Scenario) -> int:
    """How many rows of robots, one for each tick, the delay of what they sense of neighbours takes."""
    model = scenario.neighbours
    return 0 if model is None else sum(rooms(scenario)) * nearest_ticks(model.delay, scenario.tick)


def with_room(scenario: Scenario) -> Scenario:
    """The scenario with as many robots of each sort as there may be at one time. Raises MisuseError for too many."""
    room = rooms(scenario)
    if sum(room) > MAX_ROBOTS:
        raise MisuseError(f"room for {sum(room)} robots is too much: at most {MAX_ROBOTS} fit. Say a lower most = ...")
    if delayed_rows(scenario) > MAX_DELAYED:
        raise MisuseError(
            f"room for {sum(room)} robots that sense neighbours with a delay is too much: say a lower most = ..., or a "
            "shorter delay"
        )
    return with_counts(scenario, room)


def at_first(scenario: Scenario) -> Scenario:
    """The scenario with the robots that are there at the start only."""
    late = any(spec.at for spec in scenario.each_type)
    return with_counts(scenario, counts(scenario)) if late else scenario


def with_counts(scenario: Scenario, wanted: Sequence[int]) -> Scenario:
    """The scenario with so many robots of each sort, perhaps none of some."""
    specs = tuple(_sized(*each) for each in zip(scenario.each_type, wanted, strict=True))
    total = sum(spec.count for spec in specs)
    if not scenario.sorts:
        return replace(scenario, robots=specs[0])
    groups = tuple(group for spec in specs for group in spec.groups or (RobotGroup(spec.type, spec.count, {}),))
    return replace(scenario, robots=replace(scenario.robots, count=total, groups=groups), sorts=specs)


def _sized(spec: RobotSpec, count: int) -> RobotSpec:
    """A sort, and its groups, with so many robots."""
    sizes = np.bincount(group_indices(spec.groups, count), minlength=len(spec.groups)) if spec.groups else ()
    groups = tuple(replace(group, count=int(size)) for group, size in zip(spec.groups, sizes, strict=True))
    return replace(spec, count=count, groups=groups)


def rows_at_first(scenario: Scenario) -> NDArray[np.intp]:
    """The row of each robot at the start, in the order of their numbers."""
    begins = accumulate(rooms(scenario)[:-1], initial=0)
    return np.concatenate(
        [np.arange(begin, begin + count) for begin, count in zip(begins, counts(scenario), strict=True)]
    )


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

    lasting = False

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        first = at_first(scenario)
        self._first = tuple(names_of(first.each_type, first.robots.count)) if first.robots.count else ()
        """The names at the start, which are the only ones that may have been chosen freely."""
        self._taken = frozenset(self._first)
        sized = zip(scenario.each_type, rooms(scenario), strict=True)
        self._kinds = [spec.type for spec, room in sized for _ in range(room)]
        self._listed = [""] * len(self._kinds)
        self._name(rows_at_first(scenario), np.arange(len(self._first)))

    def _name(self, rows: NDArray[np.intp], numbers: NDArray[np.intp]) -> None:
        """Robots with these numbers are in these rows."""
        for row, number in zip(rows.tolist(), numbers.tolist(), strict=True):
            name = self._listed[row] = self._called(row, number)
            self._indices[name] = row

    def _called(self, row: int, number: int) -> str:
        if number < len(self._first):
            return self._first[number]
        name = f"{self._kinds[row]}{number + 1}"
        return f"{name}b" if name in self._taken else name

    def after(self, gone: NDArray[np.intp], come: NDArray[np.intp], numbers: NDArray[np.intp]) -> NamesByRow:
        """The names once the robots of the rows `gone` are gone, and others have come. numbers: of these, from 0."""
        later = copy(self)
        later._listed, later._indices = self._listed.copy(), self._indices.copy()
        for row in gone.tolist():
            del later._indices[later._listed[row]]
            later._listed[row] = ""
        later._name(come, numbers)
        return later

    def numbered(self, numbers: NDArray[np.intp]) -> NamesByRow:
        """The names of robots with these numbers, one for each row; none where a number is below 0."""
        come = np.flatnonzero(numbers >= 0)
        return self.after(np.array(sorted(self._indices.values()), np.intp), come, numbers[come])

    def copy(self) -> NameIndex:
        return self

    def add(self, name: str) -> int:
        """The row of a robot. Raises KeyError for a name that none has: others are not taken in."""
        return self._indices[name]

    def __contains__(self, name: object) -> bool:
        return name in self._indices or (name == "" and len(self._indices) < len(self._listed))
