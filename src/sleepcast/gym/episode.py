"""An episode: one run of a task from its start, step by step, with arrays for all robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from sleepcast.core.counter_rng import key
from sleepcast.gym.task import CheckedTask
from sleepcast.language import check
from sleepcast.language.evaluate import is_true
from sleepcast.language.learned_names import LearnedNames

Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]


class EpisodeStep(NamedTuple):
    """What came of one step. observed: shape (robots, observations); reward, done: shape (robots,), 0 and True for
    robots that were done before. ended: whether the episode has reached its goal; over: or its time."""

    observed: Singles
    reward: NDArray[np.float64]
    done: Flags
    ended: bool
    over: bool


class Episode:
    """One run of a task. seed, number: the same pair gives the same run."""

    def __init__(self, checked: CheckedTask, seed: int, number: int) -> None:
        self._checked, self._task = checked, checked.task
        purpose = ("episode", seed, number) if number else ("episode", seed)  # the first one is as it was in 0.2.0
        self.fleet = checked.task.start(key(*purpose) >> 1)
        self._swarm = self.fleet.swarm
        self._rows = {each.name.casefold(): row for row, each in enumerate(self._swarm.simulator.model.sensors)}
        self._programs = [] if isinstance(checked.acted, Box) else [self._program(text) for text in self._task.actions]
        self._done: Flags = np.zeros(len(checked.names), np.bool_)
        self._resting: Flags = self._done.copy()
        self._steps = 0
        self._swarm.sense()

    def close(self) -> None:
        self.fleet.close()

    def step(self, actions: NDArray[np.generic]) -> EpisodeStep:
        """Let all robots act that are not done, and time pass: the ticks of a step, or fewer if the episode ends on one
        of them. actions: shape (robots, actuators), or for expressions their numbers, shape (robots,)."""
        before = self._done.copy()
        self._act(actions, np.flatnonzero(~before))
        for _ in range(self._task.ticks):
            self._halt_done()
            self._swarm.step()
            if ended := self._has_ended():
                break
        self._steps += 1
        self._swarm.sense()
        reward = np.where(before, 0.0, np.nan_to_num(self._values(self._task.reward)))
        self._halt_done()
        return EpisodeStep(self.observe(), reward, self._done.copy(), ended, self._steps >= self._checked.steps)

    def _has_ended(self) -> bool:
        """Whether the episode has reached its goal on this tick; notes who is done by now."""
        if self._task.done:
            self._done |= is_true(self._swarm.values_of(self._task.done))
        until = self._checked.until
        return bool(self._done.all()) or (until is not None and until.holds(self.fleet))

    def _halt_done(self) -> None:
        """Let those rest that are done and still move."""
        self._swarm.simulator.robots.halt(np.flatnonzero(self._done & ~self._resting))
        self._resting |= self._done

    def observe(self) -> Singles:
        """What robots observe now; unknown values are 0."""
        box, sensed = self._checked.observed, self._swarm.simulator.sensed
        found = np.empty((len(self._done), len(self._task.observations)), np.float32)
        for column, text in enumerate(self._task.observations):
            row = self._rows.get(text.casefold())
            found[:, column] = self._values(text) if row is None else sensed[row]
        return np.clip(np.nan_to_num(found, copy=False), box.low, box.high, out=found)

    def _values(self, text: str) -> NDArray[np.float64]:
        return self._swarm.fleet.values_of(text, self._swarm.now())

    def _program(self, text: str):  # type: ignore[no-untyped-def]  # what `CheckedTask.required` gives
        return check(text, LearnedNames(self._swarm.vocabulary)).required()

    def _act(self, actions: NDArray[np.generic], robots: NDArray[np.intp]) -> None:
        box = self._checked.acted
        if isinstance(box, Box):
            wanted = np.clip(np.asarray(actions, np.float64), box.low, box.high)
            for column, actuator in enumerate(self._task.actions):
                self._swarm.simulator.act(actuator.casefold(), robots, wanted[robots, column])
            return
        chosen = np.asarray(actions)[robots]
        for number, program in enumerate(self._programs):
            some = robots[chosen == number]
            if some.size:
                self._swarm.fleet.run(program, self._swarm.fleet.rows(some))
