"""One of many worlds, which may rest: it then takes a tenth of the memory, and wakes when something is to be done.

Whoever runs a thousand worlds looks at few of them as a whole. A fleet with its desk is made of some hundreds of
objects; a world at rest is what has changed since its start, as bytes. Awake again it goes on to the last bit as if it
had never rested. Worlds rest only as long as nobody has got hold of their fleet, and nothing has come from outside.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar

from sleepcast.api.assembly import Common, assemble
from sleepcast.api.fleet import SimulatedFleet, opened
from sleepcast.api.history import History
from sleepcast.core.ticks import Every
from sleepcast.loop import Swarm
from sleepcast.loop.resting import RestingSwarm
from sleepcast.simulator import Scenario
from sleepcast.station import Station

Value = TypeVar("Value")


class WorldStart(NamedTuple):
    """How a world begins: always the same way."""

    scenario: Scenario
    seed: int
    mission: bool
    common: Common

    def opened(self) -> SimulatedFleet:
        """Raises what `open` raises."""
        return opened(self.scenario, self.seed, mission=self.mission, threads=1, common=self.common)

    def assembled(self) -> tuple[Swarm, Station]:
        return assemble(self.scenario, self.seed, mission=self.mission, threads=1, common=self.common)


class KeptWorld:
    """See the module. fleet: just opened. start: how it was; None for one that never rests.

    room: how many robots there may be at one time. length_of_tick: s.
    """

    __slots__ = ("_fleet", "_histories", "_resting", "_robots", "_start", "length_of_tick", "room")

    def __init__(self, fleet: SimulatedFleet, start: WorldStart | None) -> None:
        self._fleet: SimulatedFleet | None = fleet
        self._start, self._robots, self.room = start, len(fleet), len(fleet.swarm.simulator.names)
        self.length_of_tick = fleet.swarm.simulator.scenario.tick
        self._resting: RestingSwarm | None = None
        """What it has come to; None at its start."""
        self._histories: list[tuple[Every, History]] = []

    @property
    def is_awake(self) -> bool:
        return self._fleet is not None

    @property
    def robots(self) -> int:
        """How many robots there are."""
        return self._robots if self._fleet is None else len(self._fleet)

    @property
    def fleet(self) -> SimulatedFleet:
        """The world itself: it does not rest any more."""
        if self._fleet is None:
            self._fleet = self._woken()
        return self._fleet

    @property
    def tick(self) -> int:
        """Ticks since the start."""
        if self._fleet is not None:
            return self._fleet.swarm.simulator.tick
        return 0 if self._resting is None else self._resting.tick

    def rest(self) -> None:
        """Rest from now on, at the start."""
        if self._fleet is not None and self._start is not None:
            fleet, self._fleet = self._fleet, None
            fleet._dissolve()

    def look(self, look: Callable[[SimulatedFleet], Value]) -> Value:
        """Look at the world without any change to it, but for histories; what is given must not be of the fleet."""
        if self._fleet is not None:
            return look(self._fleet)
        fleet = self._woken()
        try:
            return look(fleet)
        finally:
            self._histories = fleet._histories
            fleet._dissolve()

    def act(self, act: Callable[[SimulatedFleet], object]) -> None:
        """Let something happen in the world. One that is broken off stays awake."""
        if self._fleet is not None:
            act(self._fleet)
            return
        self._fleet = fleet = self._woken()
        act(fleet)
        inputs = fleet._only_inputs
        if inputs is not None:
            self._robots = len(fleet)
            self._resting, self._histories, self._fleet = RestingSwarm(fleet.swarm, inputs), fleet._histories, None
            fleet._dissolve()

    def close(self) -> None:
        """Stop sampling and recording."""
        if self._fleet is not None:
            self._fleet.close()
        self._histories = []

    def _woken(self) -> SimulatedFleet:
        assert self._start is not None
        if self._resting is None:
            fleet = self._start.opened()
        else:
            start = self._start
            swarm, station = start.assembled()
            inputs = self._resting.wake(swarm, lambda: start.assembled()[0])
            fleet = SimulatedFleet(swarm, station)
            fleet._watch_inputs(inputs)
        fleet._histories = self._histories
        return fleet
