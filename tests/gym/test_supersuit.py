"""SuperSuit's ways of turning a fleet's agents into what trainers take."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import sleepcast.gym as gym

supersuit = pytest.importorskip("supersuit", reason="what it needs has no wheel for this Python")

pytestmark = pytest.mark.counterpart("supersuit")

TASK: dict[str, Any] = {"observations": ["x", "y", "fuel"], "reward": "1", "robots": 4, "seconds": 1.0}


def test_black_death_goes_on_for_those_that_left_until_the_last_has() -> None:
    env = supersuit.black_death_v3(gym.parallel_env("bravo", done="(> time (* 0.2s id))", **TASK))
    env.reset(seed=1)
    paid, last = [], dict[str, bool]()
    while env.agents:
        observed, reward, last, _, _ = env.step({name: np.zeros(2) for name in env.agents})
        paid.append(sum(reward.values()))
        assert set(observed) == set(env.possible_agents)
        assert all(not observed[name].any() for name in observed if reward[name] == 0.0)
    assert paid == sorted(paid, reverse=True)
    assert (paid[0], paid[-1]) == (4.0, 0.0)
    assert all(last.values())


@pytest.mark.parametrize("done", [None, "(> time (* 0.2s id))"])
def test_one_policy_for_the_agents_of_several_copies(done: str | None) -> None:
    agents = gym.parallel_env("bravo", done=done, **TASK)
    vector = supersuit.pettingzoo_env_to_vec_env_v1(supersuit.black_death_v3(agents) if done else agents)
    assert vector.render_mode is None
    env = supersuit.concat_vec_envs_v1(vector, 2, num_cpus=1)
    observed, _ = env.reset(seed=5)
    starts = {observed[copy * 4 : copy * 4 + 4].tobytes() for copy in range(2)}
    ends = 0
    for _ in range(25):
        observed, reward, ended, cut, _ = env.step(np.zeros((8, 2), np.float32))
        assert (observed.shape, reward.shape) == ((8, 3), (8,))
        if (ended | cut).all():  # the next episode of each copy has begun
            ends += 1
            starts |= {observed[copy * 4 : copy * 4 + 4].tobytes() for copy in range(2)}
    assert ends >= 2
    assert len(starts) == 2 * (ends + 1), "no episode of a copy is one of another copy, or an earlier one"
    env.close()


def test_copies_without_a_seed_do_not_repeat_each_other() -> None:
    env = supersuit.concat_vec_envs_v1(supersuit.pettingzoo_env_to_vec_env_v1(gym.parallel_env("bravo", **TASK)), 2)
    observed, _ = env.reset()
    assert not np.array_equal(observed[:4], observed[4:])
    env.close()


def test_a_trainer_hears_that_an_episode_was_cut_off_by_the_time() -> None:
    """Stable-Baselines3 adds the worth of what would have followed only where it is told so."""
    vector = supersuit.pettingzoo_env_to_vec_env_v1(gym.parallel_env("bravo", **TASK))
    env = supersuit.concat_vec_envs_v1(vector, 2, num_cpus=1)
    env.reset(seed=5)
    last: list[dict[str, object]] = [{}]
    while not any(last):
        _, _, _, _, last = env.step(np.zeros((8, 2), np.float32))
    assert [each["TimeLimit.truncated"] for each in last] == [True] * 8
    assert all("terminal_observation" in each for each in last)
    env.close()
