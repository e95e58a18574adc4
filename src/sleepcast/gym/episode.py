"""Episodes: each is one run of a task from its start, step by step, with arrays for all robots.

The same seed with the same number of an episode is the same run, bit for bit, whatever came before.
"""

from __future__ import annotations

from collections.abc import Mapping
from secrets import randbits
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.counter_rng import key
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.given_numbers import MAX_SEED, read_seed, whole_number
from sleepcast.gym.task import CheckedTask
from sleepcast.language import check
from sleepcast.language.evaluate import is_true
from sleepcast.language.learned_names import LearnedNames
from sleepcast.loop import Swarm

Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]


class EpisodeStep(NamedTuple):
    """What came of one step.

    observed: shape (robots, observations).
    reward, done: shape (robots,), 0 and True for robots that were done before.
    ended: whether the episode has reached its goal.
    over: whether its time is over.
    """

    observed: Singles
    reward: NDArray[np.float64]
    done: Flags
    ended: bool
    over: bool


class Episode:
    """One run of a task. seed, number, world: the same ones give the same run.

    Its desk begins to listen to the robots when somebody takes the `fleet`, unless it sends a mission, or there are
    several: until then nobody sees what it would have heard.
    """

    def __init__(self, checked: CheckedTask, seed: int, number: int, world: int = 0) -> None:
        self._checked, self._task = checked, checked.task
        purpose = ("episode", seed, number) if number else ("episode", seed)  # the first one is as it was in 0.2.0
        self._fleet = checked.task.start(key(*purpose, *(("world", world) if world else ())) >> 1)
        self._swarm = self._fleet.swarm
        self.taken = bool(self._task.mission or self._swarm.others)
        """Whether somebody has taken the fleet, and may look at it at any time."""
        if not self.taken:
            self._swarm.desk = None
        self._rows = {each.name.casefold(): row for row, each in enumerate(self._swarm.simulator.model.sensors)}
        names = LearnedNames(self._swarm.vocabulary)
        expressions = () if isinstance(checked.acted, Box) else self._task.actions
        self._programs = [check(text, names).required() for text in expressions]
        self._done: Flags = np.zeros(len(checked.names), np.bool_)
        self._resting: Flags = self._done.copy()
        self._steps = 0
        self.sense()

    @property
    def fleet(self) -> SimulatedFleet:
        if not self.taken:
            self.taken, self._swarm.desk = True, self._fleet.station
            self._swarm.send_initial_telemetry()
        return self._fleet

    @property
    def swarm(self) -> Swarm:
        """The same, for whoever only lets time pass and looks at bodies."""
        return self._swarm

    def close(self) -> None:
        self._fleet.close()

    def step(self, actions: NDArray[np.generic]) -> EpisodeStep:
        """Let all robots act that are not done, and time pass: the ticks of a step, or fewer if the episode ends on one
        of them.

        actions: shape (robots, actuators), or for expressions their numbers, shape (robots,).
        """
        before = self._done.copy()
        self.act(actions, np.flatnonzero(~before))
        for _ in range(self._task.ticks):
            self._halt_done()
            self._swarm.step()
            if ended := self.has_ended():
                break
        self.sense()
        reward = np.where(before, 0.0, self.reward())
        self._halt_done()
        self.count()
        return EpisodeStep(self.observe(), reward, self._done.copy(), ended, self.left <= 0)

    def sense(self) -> None:
        """Bring what sensors show up to date, sonars only if they are looked at."""
        self._swarm.sense(sonars=self._checked.sees)

    @property
    def left(self) -> int:
        """Steps until its time is over."""
        return self._checked.steps - self._steps

    def count(self, steps: int = 1) -> None:
        """So many steps were made."""
        self._steps += steps

    def reward(self) -> NDArray[np.float64]:
        """What each robot is paid now."""
        return np.nan_to_num(self.values(self._task.reward))

    def has_ended(self) -> bool:
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
        observed = np.empty((len(self._done), len(self._task.observations)), np.float32)
        for column, text in enumerate(self._task.observations):
            row = self._rows.get(text.casefold())
            observed[:, column] = self.values(text) if row is None else sensed[row]
        return np.clip(np.nan_to_num(observed, copy=False), box.low, box.high, out=observed)

    def values(self, text: str) -> NDArray[np.float64]:
        """What an expression comes to on each robot now."""
        return self._swarm.fleet.values_of(text, self._swarm.now())

    def act(self, actions: NDArray[np.generic], robots: NDArray[np.intp]) -> None:
        """Let these robots do what is wanted of all of them; see `step`."""
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


class EpisodeKey(NamedTuple):
    """Which episode.

    seed: what `reset` was given.
    episode: how many episodes of that seed came before in its world, from 0.
    """

    seed: int
    episode: int


class Episodes:
    """One episode of a task after the other.

    world: of how many that run at once; each has episodes of its own.
    key: that of the one that began last; None before the first.
    ended: whether the one that runs has reached its goal or its time.
    """

    def __init__(self, task: CheckedTask, world: int = 0) -> None:
        self.task, self.world = task, world
        self.key: EpisodeKey | None = None
        self.ended = False
        self._current: Episode | None = None

    def begin(self, seed: int | None, options: Mapping[str, Any] | None) -> Episode:
        """Begin the first episode of a seed, or the one that options["episode"] names; without both, the next one of
        the same seed. The first seed is drawn by the system if none is given, as Gymnasium has it: copies of an
        environment would otherwise repeat each other. Raises MisuseError."""
        self.key = _following(self.key, seed, _episode_in(options))
        self.close()
        self._current = Episode(self.task, *self.key, self.world)
        return self._current

    def running(self) -> Episode:
        """Raises MisuseError if none has begun."""
        if self._current is None:
            raise MisuseError("no episode has begun: call reset() first")
        return self._current

    def step(self, actions: NDArray[np.generic]) -> EpisodeStep:
        """See `Episode.step`. Raises MisuseError if none has begun."""
        step = self.running().step(actions)
        self.ended = step.ended or step.over
        return step

    def close(self) -> None:
        self.ended = False
        if self._current is not None:
            self._current.close()
            self._current = None

    def __getstate__(self) -> dict[str, Any]:
        """A copy, in this process or another, begins anew."""
        return {"task": self.task, "world": self.world, "key": None, "ended": False, "_current": None}


def _following(key: EpisodeKey | None, seed: int | None, episode: int | None) -> EpisodeKey:
    if seed is not None:
        return EpisodeKey(read_seed(seed), episode or 0)
    if key is None:
        return EpisodeKey(randbits(32), episode or 0)
    return EpisodeKey(key.seed, key.episode + 1 if episode is None else episode)


def _episode_in(options: Mapping[str, Any] | None) -> int | None:
    """The one of our options; others may be for what wraps the environment, unless they are ours misspelt."""
    for name in options or ():
        if name != "episode" and (meant := did_you_mean(str(name), ["episode"])):
            raise MisuseError(f'reset: no option "{name!s:.40}"{meant}')
    episode = (options or {}).get("episode")
    return None if episode is None else whole_number(episode, "reset: episode", 0, MAX_SEED)
