"""The fleet: the minds of many robots of one vocabulary; `fleet[name]` is one of them, seen as a mind of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from sleepcast.fleet.columns import Column, Index
from sleepcast.fleet.core import Core, FleetError
from sleepcast.fleet.view import RobotView


class Fleet(Core, Mapping[str, RobotView]):
    """The robots of a `Core` by name, and what can be said of all of them together."""

    def __getitem__(self, name: str) -> RobotView:
        return RobotView(self, self.places[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def members(self) -> dict[str, int]:
        """How many robots are in each group."""
        counts = {key: int(members.sum()) for key, members in self.state.groups.items()}
        return {key: count for key, count in sorted(counts.items()) if count}

    def actuators(self, name: str) -> tuple[Index, Column]:
        """The robots that have assigned this actuator since the last call, and their values (SI)."""
        variables = {quantity.name.casefold(): i for i, quantity in enumerate(self.vocabulary.actuators)}
        if name.casefold() not in variables:
            raise FleetError(f"{self.vocabulary.name} has no actuator {name}")
        slot = self.vocabulary.first_actuator + variables[name.casefold()]
        assigned = self.state.assigned(slot)
        rows = self.rows().take(assigned)
        assigned[...] = False
        return rows.robots, self.state.column(slot, rows)

    def reads(self) -> frozenset[int]:
        """The slots of the variables that any active rule or waiting message may look at in the next tick."""
        found = self._attention.slots(self._inbox.messages())
        return frozenset(self.state.slots()) if found is None else found
