"""Gymnasium: every robot of a fleet as one environment of a vector, for a policy that all of them follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.core.given_numbers import read_seed
from sleepcast.gym.episode import EpisodeKey, Episodes, Flags, Singles
from sleepcast.gym.task import CheckedTask, Task, checked


class RobotVector(VectorEnv[Singles, NDArray[np.generic], NDArray[np.generic]]):
    """See `vector_env`.

    fleet: the run itself, to look at or to send commands to.
    episode_key: seed and number of the episode that began last; None before the first.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012  # as the base class has it

    def __init__(self, task: CheckedTask) -> None:
        self._task, self._episodes = task, Episodes(task)
        self.num_envs = len(task.names)
        self.single_observation_space, self.single_action_space = task.observed, task.acted
        self.observation_space = batch_space(task.observed, self.num_envs)
        self.action_space = batch_space(task.acted, self.num_envs)

    @property
    def fleet(self) -> Any:
        return self._episodes.running().fleet

    @property
    def episode_key(self) -> EpisodeKey | None:
        return self._episodes.key

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Singles, dict[str, Any]]:
        """Begin the first episode of a seed, the next one of the same seed (None), or number n of it
        (options={"episode": n}). Equal seeds and numbers give equal episodes, bit for bit. Raises MisuseError, also for
        a "reset_mask" that leaves out robots: all of them live in one world, which begins anew as a whole."""
        self._check_mask((options or {}).get("reset_mask"))
        super().reset(seed=None if seed is None else read_seed(seed))
        observed = self._episodes.begin(seed, options).observe()
        self.closed = False
        return observed, {}

    def step(self, actions: NDArray[np.generic]) -> tuple[Singles, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Let all robots act and time pass. An episode ends for all of them together; the step after it begins the next
        one, whatever the actions. Raises MisuseError for actions that do not fit.

        actions: shape (robots, actuators), or for expressions their numbers, shape (robots,).
        """
        if self._episodes.ended:
            observed, info = self.reset()
            return observed, np.zeros(self.num_envs), self._all(False), self._all(False), info
        step = self._episodes.step(self._task.all_actions(actions))
        return step.observed, step.reward, self._all(step.ended), self._all(step.over), {}

    def close_extras(self, **kwargs: Any) -> None:
        self._episodes.close()

    def _check_mask(self, mask: object) -> None:
        """Raises MisuseError for a mask of Gymnasium's that is not for all robots."""
        if mask is None:
            return
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise MisuseError(f"reset_mask {mask!r:.40}: wanted an array of {self.num_envs} bools, one for each robot")
        if not mask.all():
            raise MisuseError(
                f"reset_mask: {np.count_nonzero(~mask):,} of {self.num_envs:,} robots are left out, and all of them "
                "live in one world, which begins anew as a whole: leave the mask out, or use an environment for each"
            )

    def _all(self, flag: bool) -> Flags:
        return np.full(self.num_envs, flag)


def vector_env(
    scenario: str | PathLike[str],
    *,
    observations: Sequence[str],
    actions: Sequence[str] = ("drive_speed", "drive_turn"),
    reward: str,
    until: str | None = None,
    seconds: float | str | None = None,
    ticks: int = 1,
    robots: int | None = None,
    over: Mapping[str, object] | None = None,
    mission: bool = False,
    threads: int | None = 1,
) -> RobotVector:
    """A scenario as a `gymnasium.vector.VectorEnv`: every robot is one of its environments, and all live in one world.

    See `parallel_env` for the arguments. Nobody leaves an episode early: it ends for all robots together, by `until`
    or after `seconds`.
    """
    task = Task(
        scenario, observations, actions, reward, None, until, seconds, ticks, robots, over or {}, mission, threads
    )
    return RobotVector(checked(task))
