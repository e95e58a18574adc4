"""What trainers do with environments, as docs/counterparts.md says."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("pettingzoo")

from gymnasium import Env
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from pettingzoo import ParallelEnv

import sleepcast.gym

TASK: dict[str, Any] = {"observations": ["x", "y", "fuel"], "reward": "1", "robots": 4, "seconds": 1.0}
LEAVING: dict[str, Any] = {**TASK, "done": "(> time (* 0.2s id))"}
AGENTS = 4
"""Agent k leaves after k of them."""


class Leaving(ParallelEnv[str, Any, Any]):
    """Agent k leaves in step k."""

    render_mode = None

    def __init__(self) -> None:
        self.metadata = {"name": "leaving"}
        self.possible_agents = [f"scout{number}" for number in range(1, AGENTS + 1)]

    def observation_space(self, agent: str) -> Box:
        return Box(0.0, 9.0, (1,), np.float32)

    action_space = observation_space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        self.agents, self.steps = list(self.possible_agents), 0
        return {name: np.zeros(1, np.float32) for name in self.agents}, {name: {} for name in self.agents}

    def step(self, actions: dict[str, Any]) -> Any:
        self.steps += 1
        there = self.agents
        ended = {name: int(name[-1]) <= self.steps for name in there}
        self.agents = [name for name in there if not ended[name]]
        seen = {name: np.full(1, self.steps, np.float32) for name in there}
        return seen, dict.fromkeys(there, 1.0), ended, dict.fromkeys(there, False), {name: {} for name in there}


class Still(Env[Any, Any]):
    observation_space = action_space = Box(0.0, 1.0, (1,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> Any:
        return np.zeros(1, np.float32), 0.0, False, False, {}


@pytest.fixture(autouse=True)
def no_gym(monkeypatch: pytest.MonkeyPatch) -> None:
    """TorchRL looks for the library of this name, the old one, and would find the folder of our tests."""
    monkeypatch.setitem(sys.modules, "gym", None)


@pytest.mark.counterpart("supersuit")
def test_black_death_ends_an_episode_a_step_after_its_last_agent() -> None:
    import supersuit

    env = supersuit.black_death_v3(Leaving())
    env.reset(seed=1)
    steps = 0
    while env.agents:
        steps += 1
        last = env.step({name: np.zeros(1, np.float32) for name in env.agents})[2]
    assert steps == AGENTS + 1
    assert all(last.values())


@pytest.mark.counterpart("torchrl")
@pytest.mark.filterwarnings("ignore")
def test_torchrl_asks_a_vector_environment_for_an_attribute() -> None:
    from torchrl.envs import GymWrapper, set_gym_backend

    with set_gym_backend("gymnasium"):
        copies = SyncVectorEnv([Still] * 2, autoreset_mode=AutoresetMode.DISABLED)
        assert copies.metadata["autoreset_mode"] is AutoresetMode.DISABLED
        GymWrapper(copies)
        del copies.autoreset_mode
        with pytest.raises(AttributeError, match="autoreset_mode"):
            GymWrapper(copies)
        with pytest.raises(RuntimeError, match="must be one of SAME_STEP or DISABLED"):
            GymWrapper(SyncVectorEnv([Still] * 2, autoreset_mode=AutoresetMode.NEXT_STEP))


@pytest.mark.counterpart("torchrl")
@pytest.mark.filterwarnings("ignore")
def test_torchrl_shows_the_episodes_of_our_worlds_in_turn() -> None:
    from torchrl.envs import GymWrapper, set_gym_backend

    with set_gym_backend("gymnasium"):
        env = GymWrapper(sleepcast.gym.vector_env("bravo", worlds=2, autoreset="Disabled", **TASK))
        found = env.rollout(12, break_when_any_done=False)
    assert tuple(found["observation"].shape) == (8, 12, 3)
    assert found["next", "truncated"].any()


@pytest.mark.counterpart("torchrl")
@pytest.mark.filterwarnings("ignore")
def test_torchrl_groups_agents_by_the_parts_of_their_names_and_ends_with_the_first() -> None:
    from torchrl.envs import PettingZooWrapper
    from torchrl.envs.utils import MarlGroupMapType

    for make in (Leaving, lambda: sleepcast.gym.parallel_env("bravo", **LEAVING)):
        env = PettingZooWrapper(make())
        assert env.group_map == {f"scout{number}": [f"scout{number}"] for number in range(1, AGENTS + 1)}
        first = env.rollout(30).batch_size[0]
        told = PettingZooWrapper(make(), group_map=MarlGroupMapType.ALL_IN_ONE_GROUP, done_on_any=False, use_mask=True)
        assert [len(group) for group in told.group_map.values()] == [AGENTS]
        assert told.rollout(30).batch_size[0] > first


@pytest.mark.counterpart("skrl")
@pytest.mark.filterwarnings("ignore")
def test_skrl_begins_with_its_own_seed() -> None:
    from skrl.envs.wrappers.torch import wrap_env
    from skrl.utils import set_seed

    env = sleepcast.gym.vector_env("bravo", **TASK, worlds=2, autoreset="SameStep")
    env.reset(seed=7)
    set_seed(42)
    wrap_env(env, verbose=False).reset()
    assert env.episode_keys[0].seed == 42, "whatever it was reset with"


@pytest.mark.counterpart("skrl")
@pytest.mark.filterwarnings("ignore")
def test_skrl_wraps_agents_by_their_older_attributes() -> None:
    import torch
    from skrl.envs.wrappers.torch import wrap_env

    with pytest.raises(AttributeError, match="observation_spaces"):
        wrap_env(Leaving(), wrapper="pettingzoo", verbose=False).reset()
    env = wrap_env(sleepcast.gym.parallel_env("bravo", **TASK), wrapper="pettingzoo", verbose=False)
    observed, _ = env.reset()
    assert {name: tuple(each.shape) for name, each in observed.items()} == dict.fromkeys(env.possible_agents, (1, 3))
    _, reward, *_ = env.step({name: torch.zeros(1, 2) for name in env.possible_agents})
    assert {float(each) for each in reward.values()} == {1.0}
