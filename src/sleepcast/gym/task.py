"""A task: what robots observe, what they can do, what they are paid for, and when an episode ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from math import isfinite
from os import PathLike

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from numpy.typing import NDArray

from sleepcast.api.fleet import SimulatedFleet, open
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.given_numbers import in_seconds
from sleepcast.core.model import Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.ticks import nearest_ticks
from sleepcast.experiments.measures import StopCondition, read_stop
from sleepcast.language import check
from sleepcast.language.learned_names import LearnedNames

MAX_COLUMNS = 256
"""Observations or actions of one robot."""
MAX_STEPS = 10_000_000
"""Of one episode."""


@dataclass(frozen=True)
class Task:
    """See `parallel_env` for the fields."""

    scenario: str | PathLike[str]
    observations: Sequence[str]
    actions: Sequence[str]
    reward: str
    done: str | None = None
    until: str | None = None
    seconds: float | str | None = None
    ticks: int = 1
    robots: int | None = None
    over: Mapping[str, object] = field(default_factory=dict)
    mission: bool = False
    threads: int | None = 1

    def start(self, seed: int) -> SimulatedFleet:
        """A fleet at the start of an episode."""
        return open(
            self.scenario,
            seed=seed,
            robots=self.robots,
            over=self.over,
            mission=self.mission,
            threads=self.threads,
        )


@dataclass(frozen=True)
class CheckedTask:
    """A task that fits its scenario, with the spaces of one robot.

    sees: whether what robots observe, are paid for or are done by may read sonars.
    steps: of an episode, at most.
    """

    task: Task
    names: tuple[str, ...]
    sees: bool
    observed: Box
    acted: Space  # type: ignore[type-arg]  # a Box of setpoints, or a number of expressions
    steps: int
    until: StopCondition | None

    def __reduce__(self) -> tuple[object, ...]:
        """A copy in another process reads anew what cannot travel there: how the goal is measured."""
        return checked, (self.task,)

    def action(self, robot: str, action: object) -> NDArray[np.float64]:
        """What a robot does: an array of the shape of `acted`. Setpoints beyond the body's limits fit: it limits them.
        Raises MisuseError, with the robot's name, for what does not fit."""
        shape = self.acted.shape or ()
        array = _array(action, shape, f"action for {robot}", self._wanted(shape))
        if not self._fits(array):
            raise MisuseError(f"action for {robot}: {action!r:.40}: wanted {self._wanted(shape)}")
        return array

    def all_actions(self, actions: object, worlds: int = 1) -> NDArray[np.float64]:
        """The same for all robots of all worlds at once: an array of a row for each, world by world. Raises
        MisuseError."""
        robots = len(self.names)
        shape = worlds * robots, *(self.acted.shape or ())
        array = _array(actions, shape, "actions", f"one of shape {shape}: {self._wanted(shape[1:])} for each robot")
        if not self._fits(array):
            row = next(row for row, each in enumerate(array) if not self._fits(each))
            where = f" of world {row // robots}" if worlds > 1 else ""
            self.action(f"{self.names[row % robots]}{where}", array[row])
        return array

    def _fits(self, actions: NDArray[np.float64]) -> bool:
        if isinstance(self.acted, Discrete):
            return bool(((actions >= 0) & (actions < self.acted.n) & (actions == np.floor(actions))).all())
        return not np.isnan(actions).any()

    def _wanted(self, shape: tuple[int, ...]) -> str:
        if isinstance(self.acted, Discrete):
            return f"a whole number from 0 to {self.acted.n - 1}"
        return f"{shape[0]} {'number' if shape[0] == 1 else 'numbers'}, of {', '.join(self.task.actions)}"


def checked(task: Task) -> CheckedTask:
    """The task, after every expression has been checked. Raises MisuseError, CheckError and what `open` raises."""
    for what, texts in (("observations", task.observations), ("actions", task.actions)):
        if not 1 <= len(texts) <= MAX_COLUMNS or isinstance(texts, str):
            raise MisuseError(f"{what}: wanted a list of 1 to {MAX_COLUMNS} texts")
    if not 1 <= task.ticks <= MAX_STEPS:
        raise MisuseError(f"ticks {task.ticks}: wanted a whole number from 1 to {MAX_STEPS}")
    with task.start(0) as fleet:  # with a seed, as every episode
        scenario = fleet.swarm.simulator.scenario
        seconds = scenario.seconds if task.seconds is None else in_seconds(task.seconds, "seconds")
        if fleet.swarm.simulator.population is not None:
            raise MisuseError(
                f"{scenario.name}: robots come and go (hatch, most or at), and an environment has always as many"
            )
        if not isfinite(seconds) or not scenario.tick <= seconds <= MAX_STEPS * scenario.tick:
            raise MisuseError(f"seconds {seconds}: wanted from {scenario.tick} to {MAX_STEPS * scenario.tick}")
        sees, swarm = False, fleet.swarm
        for text in (*task.observations, task.reward, *([task.done] if task.done else [])):
            _ = fleet[text]
            reads = swarm.fleet.queries[text].reads
            sees |= reads is None or not swarm.sonars.isdisjoint(reads)
        return CheckedTask(
            task,
            tuple(fleet.names),
            sees or task.mission,
            _observed(fleet, task.observations),
            _acted(fleet, task.actions),
            max(1, nearest_ticks(seconds, scenario.tick * task.ticks)),
            read_stop(task.until, own=True) if task.until else None,
        )


def _observed(fleet: SimulatedFleet, texts: Sequence[str]) -> Box:
    """Sensors have their ranges; the value of an expression may be anything."""
    sensors = {each.name.casefold(): each for each in fleet.swarm.simulator.model.sensors}
    return _box([sensors.get(text.casefold(), Quantity("any")) for text in texts])


def _acted(fleet: SimulatedFleet, texts: Sequence[str]) -> Space:  # type: ignore[type-arg]  # see CheckedTask
    """A Box of setpoints for names of actuators, a Discrete for expressions."""
    actuators = {each.name.casefold(): each for each in fleet.swarm.simulator.model.actuators}
    if all(text.casefold() in actuators for text in texts):
        return _box([actuators[text.casefold()] for text in texts])
    for text in texts:
        if not text.lstrip().startswith("("):
            raise MisuseError(
                f'action "{text:.80}": no actuator{did_you_mean(text, actuators)}: wanted names of actuators '
                f"({', '.join(actuators)}), or expressions only"
            )
        check(text, LearnedNames(fleet.swarm.vocabulary)).required()
    return Discrete(len(texts))


def _array(given: object, shape: tuple[int, ...], what: str, wanted: str) -> NDArray[np.float64]:
    """Numbers as an array of this shape. what, wanted: of the sentence for anything else. Raises MisuseError."""
    try:
        array = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise MisuseError(f"{what}: {given!r:.40}: wanted {wanted}") from None
    if array.shape != shape:
        raise MisuseError(f"{what}: an array of shape {array.shape}: wanted {wanted}")
    return array


def _box(quantities: Sequence[Quantity]) -> Box:
    """The ranges of these quantities, rounded so that no value of float64 within them lies outside."""
    low = np.array([each.low for each in quantities])
    high = np.array([each.high for each in quantities])
    return Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)
