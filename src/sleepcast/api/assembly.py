"""How a simulated swarm and the operator's desk are put together, and made ready to run at full speed."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

from sleepcast.api.progress import counting
from sleepcast.language import Vocabulary
from sleepcast.loop import Swarm, step_swarm, vocabulary_of
from sleepcast.robot import RobotModel
from sleepcast.simulator import (
    KERNELS,
    Payload,
    Scenario,
    Simulator,
    choose,
    compile_kernels,
    keep_kernels,
    kernel_count,
    load_kernels,
)
from sleepcast.station import Journal, SendPolicy, Station
from sleepcast.station.station import DESK

FEW, WARM_TICKS = 12, 3
"""Robots and ticks of a warm-up: some of each group, and all that happens only when something has moved."""


class Common:
    """What swarms have in common whose scenarios are the same but for their seeds and walls: what was checked and
    compiled for the robots of the one is not compiled again for the next. There is no other difference.

    scenario: of any of them.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._alike = _anywhere(scenario)
        self._first: Vocabulary | None = None
        self.model: RobotModel | None = None
        """Of the robots, once there are some."""

    def suits(self, scenario: Scenario) -> bool:
        """Whether this is for the swarms of a scenario."""
        return _anywhere(scenario) == self._alike

    def vocabulary_of(self, model: RobotModel) -> Vocabulary:
        """The vocabulary of the next swarm, whose robots are of this model."""
        if self._first is None:
            self.model, self._first = model, vocabulary_of(model)
        return self._first.anew()


def _anywhere(scenario: Scenario) -> Scenario:
    """A scenario without what depends on its seed."""
    return replace(scenario, seed=0, shapes=(), origin="")


def assemble(
    scenario: Scenario,
    seed: int | None,
    *,
    mission: bool,
    threads: int | None = None,
    journal: Journal | None = None,
    payload: Payload | None = None,
    common: Common | None = None,
) -> tuple[Swarm, Station]:
    """A swarm in its scenario and the operator's desk.

    seed: None for the scenario's.
    mission: whether the desk sends the scenario's own orders.
    threads: None is one for each core.
    journal: None is one in memory.
    payload: what a program adds to the bodies.
    common: what it has in common with others; None for nothing, as with a payload, whose functions are of its objects.
    """
    common = None if payload else common
    model = None if common is None else common.model
    simulator = Simulator(scenario, seed, threads=threads, payload=payload, model=model)
    names = None if common is None else common.vocabulary_of(simulator.model)
    swarm = Swarm(simulator, scenario.mission if mission else (), names)
    station = station_of(swarm, journal)
    swarm.desk = station
    return swarm, station


def assemble_from(
    snapshot: bytes,
    seed: int | None,
    threads: int | None = None,
    journal: Journal | None = None,
    name: str = "the snapshot",
) -> tuple[Swarm, Station]:
    """A swarm that goes on from a snapshot, and its desk. Raises SnapshotError.

    seed: another one makes a fork.
    threads: None is one for each core.
    journal: None is one in memory.
    name: of the snapshot, for errors.
    """
    from sleepcast.loop import resume

    swarm = resume(snapshot, seed=seed, threads=threads, desk=partial(station_of, journal=journal), name=name)
    return swarm, cast(Station, swarm.desk)


def vocabulary_in(scenario: Scenario) -> Vocabulary:
    """The names that the scenario's robots know."""
    return vocabulary_of(Simulator(scenario, machine=choose("numpy")).model)


def station_of(swarm: Swarm, journal: Journal | None = None) -> Station:
    """The operator's desk for a swarm; where the scenario names several operators, the others sit down, too."""
    first, *others = [_station(swarm, name, None if i else journal) for i, name in enumerate(swarm.operators or [DESK])]
    for desk in (first, *others):
        desk.beside = [each for each in (first, *others) if each is not desk]
    swarm.others = list(others)
    return first


def others_of(swarm: Swarm) -> list[Station]:
    """The desks of the further operators, in the scenario's order."""
    return cast("list[Station]", swarm.others)


def _station(swarm: Swarm, operator: str, journal: Journal | None) -> Station:
    return Station(
        swarm.vocabulary,
        swarm.minds,
        swarm.post,
        swarm,
        operator=operator,
        journal=journal,
        policy=SendPolicy(doubts=True),
        heartbeat=swarm.simulator.scenario.minds.lease / 3.0,
    )


_warm = set[tuple[Path, int | None]]()
"""Scenarios, and threads, for which everything is compiled in this process."""


def warm_up(scenario: Scenario, threads: int | None, *, quiet: bool = False) -> None:
    """Load and compile all that a tick of `scenario` needs, once in a process, since what settings change of it is
    compiled when it is first needed. What that is, is seen by letting a few robots live in it for a moment, unless
    another process has done so.

    threads: None is one for each core.
    quiet: whether to print no line that counts the compiled kernels.
    """
    if (scenario.path, threads) in _warm:
        return
    _warm.add((scenario.path, threads))
    few = few_of(scenario)
    if load_kernels(few, threads):
        return
    with counting("compiling the simulator, once on this computer: kernel", kernel_count, KERNELS, quiet=quiet):
        compile_kernels(few)
        swarm, _ = assemble(few, None, mission=False, threads=threads)
        for _ in range(WARM_TICKS):
            step_swarm(swarm)
            swarm.simulator.readings()
        swarm.step()  # which may be quiet
    keep_kernels(few, threads)


def few_of(scenario: Scenario) -> Scenario:
    """The scenario with a few robots."""
    return replace(scenario, robots=replace(scenario.robots, count=min(scenario.robots.count, FEW)))
