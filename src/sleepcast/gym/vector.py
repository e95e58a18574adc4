"""Gymnasium: every robot as one environment of a vector, in one world or many, for a policy that all of them follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sleepcast.api.worlds import MAX_WORLDS
from sleepcast.core.errors import MisuseError
from sleepcast.core.given_numbers import read_seed, whole_number
from sleepcast.gym.episode import EpisodeKey, Flags, Singles
from sleepcast.gym.task import CheckedTask, Task, checked
from sleepcast.gym.together import Together
from sleepcast.loop.swarm import MAX_MINDS

AUTORESETS = tuple(mode.value for mode in AutoresetMode)


class RobotVector(VectorEnv[Singles, NDArray[np.generic], NDArray[np.generic]]):
    """See `vector_env`.

    fleet: the run of the first world, to look at or to send commands to.
    fleets: the runs of all worlds.
    episode_key: seed and number of the episode that began last in the first world; None before that.
    episode_keys: the same of each world.
    autoreset_mode: when the next episode begins, as in `metadata`; TorchRL asks for it by this name.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012  # as the base class has it

    def __init__(self, task: CheckedTask, worlds: int = 1, autoreset: AutoresetMode = AutoresetMode.NEXT_STEP) -> None:
        self._task, self._together = task, Together(task, worlds)
        self.metadata = self.metadata | {"autoreset_mode": autoreset}
        self.autoreset_mode, self._robots = autoreset, len(task.names)
        self.num_envs = worlds * self._robots
        self.single_observation_space, self.single_action_space = task.observed, task.acted
        self.observation_space = batch_space(task.observed, self.num_envs)
        self.action_space = batch_space(task.acted, self.num_envs)

    @property
    def fleet(self) -> Any:
        return self._together.fleet(0)

    @property
    def fleets(self) -> list[Any]:
        return [self._together.fleet(world) for world in self._everywhere]

    @property
    def episode_key(self) -> EpisodeKey | None:
        return self.episode_keys[0]

    @property
    def episode_keys(self) -> list[EpisodeKey | None]:
        return self._together.keys

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Singles, dict[str, Any]]:
        """Begin in each world the first episode of a seed, the next one of the same seed (None), or number n of it
        (options={"episode": n}). Equal seeds, numbers and worlds give equal episodes, bit for bit.

        With Gymnasium's options={"reset_mask": ...} only in some worlds. Raises MisuseError, also for a mask that
        leaves out some robots of a world: it begins anew as a whole.
        """
        which = self._masked((options or {}).get("reset_mask"))
        super().reset(seed=None if seed is None else read_seed(seed))
        begun = self._together.begin(which, seed, options)
        self.closed = False
        if len(which) == len(self._together.worlds):
            return self._flat(begun), {}
        return self._flat(self._together.observe(self._everywhere)), {}

    def step(self, actions: NDArray[np.generic]) -> tuple[Singles, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Let all robots act and time pass. An episode ends for all robots of its world together; the next one begins
        there as the mode of autoreset says. Raises MisuseError for actions that do not fit, and for a world that waits
        for `reset`.

        actions: shape (worlds x robots, actuators), or for expressions their numbers, shape (worlds x robots,).
        """
        together, worlds = self._together, len(self._together.worlds)
        wanted = self._task.all_actions(actions, worlds).reshape(worlds, self._robots, *(self._task.acted.shape or ()))
        waiting = together.ended.copy()
        if not waiting.any() and self.autoreset_mode is not AutoresetMode.SAME_STEP:
            step = together.step(self._everywhere, wanted)
            return self._flat(step.observed), step.reward.ravel(), self._each(step.ended), self._each(step.over), {}
        if waiting.any() and self.autoreset_mode is AutoresetMode.DISABLED:
            raise MisuseError(f"{np.count_nonzero(waiting)} episodes are over: call reset, with a reset_mask for some")
        observed = np.empty((worlds, self._robots, *(self._task.observed.shape)), np.float32)
        reward = np.zeros((worlds, self._robots))
        ended, over = np.zeros((2, worlds), np.bool_)
        going, info = np.flatnonzero(~waiting).tolist(), dict[str, Any]()
        if going:
            observed[going], reward[going], ended[going], over[going] = together.step(going, wanted[going])
        if waiting.any():
            begun = np.flatnonzero(waiting).tolist()
            observed[begun] = together.begin(begun, None, None)
        done = ended | over
        if done.any() and self.autoreset_mode is AutoresetMode.SAME_STEP:
            info = self._final(observed, done)
            begun = np.flatnonzero(done).tolist()
            observed[begun] = together.begin(begun, None, None)
        return self._flat(observed), reward.ravel(), self._each(ended), self._each(over), info

    def close_extras(self, **kwargs: Any) -> None:
        self._together.close()

    @property
    def _everywhere(self) -> list[int]:
        return [*range(len(self._together.worlds))]

    def _flat(self, observed: Singles) -> Singles:
        """A row for each robot, world by world."""
        return observed.reshape(self.num_envs, *self._task.observed.shape)

    def _each(self, flags: Flags) -> Flags:
        """What is so of a world, for each of its robots."""
        return np.repeat(flags, self._robots)

    def _final(self, observed: Singles, done: Flags) -> dict[str, Any]:
        """What robots observed at the end of episodes that have ended, as Gymnasium has it."""
        rows, last = self._each(done), np.full(self.num_envs, None, object)
        for row in np.flatnonzero(rows).tolist():
            last[row] = self._flat(observed)[row].copy()
        return {"final_obs": last, "_final_obs": rows, "final_info": {}, "_final_info": rows.copy()}

    def _masked(self, mask: object) -> list[int]:
        """The worlds that a mask of Gymnasium's means. Raises MisuseError for one that does not mean whole worlds."""
        if mask is None:
            return self._everywhere
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise MisuseError(f"reset_mask {mask!r:.40}: wanted an array of {self.num_envs} bools, one for each robot")
        of_each = mask.reshape(-1, self._robots)
        some = of_each.any(axis=1)
        if not of_each[some].all() or not some.any():
            raise MisuseError(
                f"reset_mask: {np.count_nonzero(~mask):,} of {mask.size:,} robots are left out, and all robots of a "
                "world begin anew together: take in whole worlds, or leave the mask out"
            )
        return np.flatnonzero(some).tolist()


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
    worlds: int = 1,
    autoreset: AutoresetMode | str = AutoresetMode.NEXT_STEP,
) -> RobotVector:
    """A scenario as a `gymnasium.vector.VectorEnv`: every robot of every world is one of its environments.

    See `parallel_env` for the other arguments. Nobody leaves an episode early: it ends for all robots of its world
    together, by `until` or after `seconds`.

    worlds: how many there are, which have nothing in common: robot r of world w is row w * robots + r, and episode k
        there is the one of (seed, w, k); that of the first world is the same however many there are.
    autoreset: when the next episode begins in a world where one has ended: in the next step, whatever the actions
        ("NextStep"); in the same one, with what was observed last in `info["final_obs"]` ("SameStep"); or by `reset`
        alone, with a "reset_mask" for some worlds ("Disabled").
    """
    if not isinstance(autoreset, AutoresetMode):
        if autoreset not in AUTORESETS:
            raise MisuseError(f"autoreset {autoreset!r:.40}: wanted one of {', '.join(AUTORESETS)}")
        autoreset = AutoresetMode(autoreset)
    task = Task(
        scenario, observations, actions, reward, None, until, seconds, ticks, robots, over or {}, mission, threads
    )
    count, fit = whole_number(worlds, "worlds", 1, MAX_WORLDS), checked(task)
    if count * len(fit.names) > MAX_MINDS:
        raise MisuseError(f"{count:,} worlds of {len(fit.names):,} robots: at most {MAX_MINDS:,} robots fit")
    return RobotVector(fit, count, autoreset)
