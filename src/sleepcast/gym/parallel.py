"""PettingZoo: an agent for each robot, all of which act at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.gym.episode import EpisodeKey, Episodes, Singles
from sleepcast.gym.task import CheckedTask, Task, checked

Infos = dict[str, dict[str, Any]]


class RobotAgents(ParallelEnv):  # type: ignore[misc]  # PettingZoo has no types
    """See `parallel_env`.

    fleet: the run itself, to look at or to send commands to.
    episode_key: seed and number of the episode that began last; None before the first.
    render_mode: always None; `fleet.picture()` draws the run.
    """

    metadata = {"name": "sleepcast", "render_modes": []}  # noqa: RUF012  # as the base class has it
    render_mode = None

    def __init__(self, task: CheckedTask) -> None:
        self._task, self._episodes = task, Episodes(task)
        self.possible_agents = list(task.names)
        self.agents: list[str] = []
        self._index = {name: index for index, name in enumerate(task.names)}
        self.observation_spaces = dict.fromkeys(task.names, task.observed)  # skrl asks these, not the functions below
        self.action_spaces = dict.fromkeys(task.names, task.acted)

    @property
    def fleet(self) -> Any:
        return self._episodes.running().fleet

    @property
    def episode_key(self) -> EpisodeKey | None:
        return self._episodes.key

    def observation_space(self, agent: str) -> Space:  # type: ignore[type-arg]  # as in the base class
        return self._task.observed

    def action_space(self, agent: str) -> Space:  # type: ignore[type-arg]  # as in the base class
        return self._task.acted

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Singles], Infos]:
        """Begin the first episode of a seed, the next one of the same seed (None), or number n of it
        (options={"episode": n}). Equal seeds and numbers give equal episodes, bit for bit. Raises MisuseError."""
        observed = self._episodes.begin(seed, options).observe()
        self.agents = list(self.possible_agents)
        return dict(zip(self.agents, observed, strict=True)), {name: {} for name in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Singles], dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Let every agent act and time pass; agents that are done leave. When all have left, nothing happens any more.
        The information of an agent that was cut off by the time says so under Gym's old name as well, since SuperSuit
        hands on no other to trainers. Raises MisuseError for an action that is missing or does not fit."""
        self._episodes.running()
        indices = [self._index[name] for name in self.agents]
        chosen = self._chosen(actions)
        if not self.agents:
            return {}, {}, {}, {}, {}
        step = self._episodes.step(chosen)
        names, rows = self.agents, range(len(indices))
        observed, reward, done = step.observed[indices], step.reward[indices], step.done[indices] | step.ended
        cut_off = step.over & ~done
        self.agents = [] if step.over else [name for name, gone in zip(names, done.tolist(), strict=True) if not gone]
        return (
            {names[row]: observed[row] for row in rows},
            {names[row]: float(reward[row]) for row in rows},
            {names[row]: bool(done[row]) for row in rows},
            dict.fromkeys(names, step.over),
            {names[row]: {"TimeLimit.truncated": True} if cut_off[row] else {} for row in rows},
        )

    def close(self) -> None:
        self._episodes.close()
        self.agents = []

    def __getstate__(self) -> dict[str, Any]:
        """A copy begins anew, as its episodes do."""
        return self.__dict__ | {"agents": []}

    def _chosen(self, actions: Mapping[str, Any]) -> NDArray[np.float64]:
        """The actions as rows for all robots; those of robots that have left are not looked at."""
        if not isinstance(actions, Mapping):
            raise MisuseError(f"actions {actions!r:.40}: wanted a dict: one for each of env.agents, by its name")
        for name in actions:
            if name not in self._index:
                raise MisuseError(f"action for {name!s:.40}: no such agent{did_you_mean(str(name), self._index)}")
        chosen = np.zeros((len(self.possible_agents), *(self._task.acted.shape or ())))
        for name in self.agents:
            if name not in actions:
                raise MisuseError(f"no action for {name}: wanted one for each of env.agents")
            chosen[self._index[name]] = self._task.action(name, actions[name])
        return chosen


def parallel_env(
    scenario: str | PathLike[str],
    *,
    observations: Sequence[str],
    actions: Sequence[str] = ("drive_speed", "drive_turn"),
    reward: str,
    done: str | None = None,
    until: str | None = None,
    seconds: float | str | None = None,
    ticks: int = 1,
    robots: int | None = None,
    over: Mapping[str, object] | None = None,
    mission: bool = False,
    threads: int | None = 1,
) -> RobotAgents:
    """A scenario as a `pettingzoo.ParallelEnv`, with an agent for each robot under the robot's name. STOP and the
    limits of the bodies hold as everywhere. Raises MisuseError for what does not fit, and CheckError for an expression.

    observations: sensors by name, or expressions; what is unknown is 0.
    actions: actuators by name, whose setpoints are chosen anew at each step; or expressions, of which one is chosen.
    reward: an expression on each robot after each step.
    done: an expression that is true when a robot leaves.
    until: a condition of the whole fleet, as "share (IN bravo) >= 0.9", that ends the episode.
    seconds: simulated time of an episode; None is the scenario's.
    ticks: of the scenario, in one step.
    robots, over, mission, threads: as in `sleepcast.open`.
    """
    task = Task(
        scenario, observations, actions, reward, done, until, seconds, ticks, robots, over or {}, mission, threads
    )
    return RobotAgents(checked(task))
