"""The fleet: the minds of many robots of one vocabulary; `fleet[name]` is one of them, seen as a mind of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np

from sleepcast.fleet.columns import Column, Index, Mask
from sleepcast.fleet.core import Core, FleetError
from sleepcast.fleet.view import RobotView
from sleepcast.language.symbols import Declared
from sleepcast.mind.rules import Mind


class Fleet(Core, Mapping[str, RobotView]):
    """The robots of a `Core` by name, and what can be said of all of them together."""

    def __getitem__(self, name: str) -> RobotView:
        place = self.names.place(name)
        if place is None:
            raise KeyError(name)
        return RobotView(self, place)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def at(self, place: int) -> RobotView:
        """The robot with this index."""
        return RobotView(self, place)

    def column(self, slot: int) -> Column:
        """A variable of all robots, NaN for unknown; not to be written."""
        return self.state.column(slot, self.rows())

    @property
    def stopped(self) -> Mask:
        """Which robots are stopped."""
        return self.state.stopped

    @property
    def groups(self) -> Mapping[str, Mask]:
        """Who is in which group, by its key."""
        return self.state.groups

    def members(self) -> dict[str, int]:
        """How many robots are in each group."""
        counts = {key: int(members.sum()) for key, members in self.state.groups.items()}
        return {key: count for key, count in sorted(counts.items()) if count}

    def declared(self, key: str) -> Declared | None:
        """What any of the robots has learned under this key."""
        for mind in self._different():
            found = mind.declared(key)
            if found is not None:
                return found
        return None

    def heard(self) -> list[str]:
        """Every name that any of the robots has learned, as written."""
        return list(dict.fromkeys(name for mind in self._different() for name in mind.heard()))

    def _different(self) -> Iterator[Mind]:
        """The minds that robots have now, each once."""
        return (self.minds[number] for number in np.flatnonzero(np.bincount(self.state.mind)).tolist())

    def actuators(self, name: str) -> tuple[slice | Index, Column]:
        """The robots that have assigned this actuator since the last call, and their values (SI), not to be written."""
        slot = self._actuator_slots.get(name.casefold())
        if slot is None:
            raise FleetError(f"{self.vocabulary.name} has no actuator {name}")
        assigned = self.state.assigned(slot)
        everybody = self.rows()
        rows = everybody if assigned.all() else everybody.take(assigned)
        if rows.size:
            assigned[rows.index] = False
        return rows.index, self.state.column(slot, rows)

    @cached_property
    def _actuator_slots(self) -> dict[str, int]:
        """The slots of the actuators by their names' keys."""
        names = (quantity.name.casefold() for quantity in self.vocabulary.actuators)
        return {name: slot for slot, name in enumerate(names, self.vocabulary.first_actuator)}

    def reads(self) -> frozenset[int]:
        """The slots of the variables that any active rule or waiting message may look at in the next tick."""
        found = self._read_set.slots(self.inbox.messages())
        return frozenset(self.state.slots()) if found is None else found
