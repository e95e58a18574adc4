"""PettingZoo: an agent for each robot, all of which act at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from sleepcast.core.errors import MisuseError
from sleepcast.gym.episode import Episode, Singles
from sleepcast.gym.task import Checked, Task, checked

Infos = dict[str, dict[str, Any]]


class RobotAgents(ParallelEnv):  # type: ignore[misc]  # PettingZoo has no types
    """See `parallel_env`. fleet: the run itself, to look at or to send commands to."""

    metadata = {"name": "sleepcast", "render_modes": []}  # noqa: RUF012  # as the base class has it

    def __init__(self, task: Checked) -> None:
        self._task = task
        self.possible_agents = list(task.names)
        self.agents: list[str] = []
        self._place = {name: place for place, name in enumerate(task.names)}
        self._episode: Episode | None = None
        self._number = -1

    @property
    def fleet(self) -> Any:
        return self._running().fleet

    def observation_space(self, agent: str) -> Space:  # type: ignore[type-arg]  # as in the base class
        return self._task.observed

    def action_space(self, agent: str) -> Space:  # type: ignore[type-arg]  # as in the base class
        return self._task.acted

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Singles], Infos]:
        """Begin an episode. seed: None is the next one. Equal seeds give equal episodes, bit for bit."""
        self.close()
        self._number = self._number + 1 if seed is None else seed
        self._episode = Episode(self._task, self._number)
        self.agents = list(self.possible_agents)
        return dict(zip(self.agents, self._episode.observe(), strict=True)), {name: {} for name in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Singles], dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Let every agent act and time pass; agents that are done leave."""
        episode, places = self._running(), [self._place[name] for name in self.agents]
        if missing := [name for name in self.agents if name not in actions]:
            raise MisuseError(f"no action for {missing[0]}: wanted one for each of env.agents")
        whole: NDArray[Any] = np.zeros((len(self.possible_agents), *(self._task.acted.shape or ())))
        whole[places] = [actions[name] for name in self.agents]
        made = episode.step(whole)
        names, rows = self.agents, range(len(places))
        observed, reward, done = made.observed[places], made.reward[places], made.done[places] | made.ended
        self.agents = [] if made.over else [name for name, gone in zip(names, done.tolist(), strict=True) if not gone]
        return (
            {names[row]: observed[row] for row in rows},
            {names[row]: float(reward[row]) for row in rows},
            {names[row]: bool(done[row]) for row in rows},
            dict.fromkeys(names, made.over),
            {name: {} for name in names},
        )

    def close(self) -> None:
        if self._episode is not None:
            self._episode.close()
            self._episode = None

    def _running(self) -> Episode:
        if self._episode is None:
            raise MisuseError("no episode has begun: call reset() first")
        return self._episode


def parallel_env(
    scenario: str | PathLike[str],
    *,
    observations: Sequence[str],
    actions: Sequence[str] = ("drive_speed", "drive_turn"),
    reward: str,
    done: str | None = None,
    until: str | None = None,
    seconds: float | None = None,
    ticks: int = 1,
    robots: int | None = None,
    over: Mapping[str, object] | None = None,
    mission: bool = False,
    threads: int | None = 1,
) -> RobotAgents:
    """A scenario as a `pettingzoo.ParallelEnv`, with an agent for each robot under the robot's name.

    observations: sensors by name, or expressions; what is unknown is 0. actions: actuators by name, whose setpoints
    are chosen anew at each step; or expressions, of which one is chosen. reward: an expression on each robot after
    each step. done: an expression that is true when a robot leaves. until: a condition of the whole fleet, as
    "share (IN bravo) >= 0.9", that ends the episode. seconds: simulated time of an episode, None is the scenario's.
    ticks: of the scenario, in one step. robots, over, mission, threads: as in `sleepcast.open`. STOP and the limits of
    the bodies hold as everywhere. Raises MisuseError for what does not fit, and CheckError for an expression.
    """
    task = Task(
        scenario, observations, actions, reward, done, until, seconds, ticks, robots, over or {}, mission, threads
    )
    return RobotAgents(checked(task))
