"""A fleet as an environment: the libraries' own checks, equal episodes for equal seeds, rewards and ends."""

from __future__ import annotations

import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from pettingzoo.test import parallel_api_test, parallel_seed_test

import sleepcast.gym as gym
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.extras import installing
from sleepcast.gym.episode import Episode
from sleepcast.gym.task import Task, checked

FAR = "(DIST x y vessel_x vessel_y)"
RESCUE: dict[str, Any] = {
    "observations": ["x", "y", "heading", "fuel", FAR],
    "reward": f"(- 0m {FAR})",
    "robots": 6,
    "seconds": 3.0,
    "ticks": 2,
}
LONG = {"seconds": 2_000.0, "ticks": 40}
SETPOINTS = ("drive_speed", "drive_turn")
BRAVO: dict[str, Any] = {"scenario": "bravo", **RESCUE}
CROWD: dict[str, Any] = {
    "scenario": "crowd",
    "observations": ["x", "sonar1", "(IF (< front_range 1m) (COS heading) time)", "bumper"],
    "reward": "(/ speed (+ id 1))",
    "robots": 5,
    "ticks": 3,
}
LEARNED: dict[str, Any] = {**BRAVO, "mission": True, "observations": ["x", "(IF (IN bravo) 1 0)"], "reward": "E1"}


MAKERS = pytest.mark.parametrize("make", [gym.parallel_env, gym.vector_env])
Maker = Callable[..., gym.RobotAgents | gym.RobotVector]


class TestEpisodes:
    @MAKERS
    def test_no_episode_of_one_seed_is_one_of_another(self, make: Maker) -> None:
        env, starts = make("bravo", **{**RESCUE, "robots": 2}), set[str]()
        for seed in range(1, 9):
            env.reset(seed=seed)
            starts.add(env.fleet.hash)
            for number in range(1, 4):
                env.reset()
                assert env.episode_key == (seed, number)
                starts.add(env.fleet.hash)
        assert len(starts) == 8 * 4

    @MAKERS
    def test_an_episode_is_found_again_by_its_seed_and_number(self, make: Maker) -> None:
        env, again = make("bravo", **RESCUE), make("bravo", **RESCUE)
        env.reset(seed=3)
        env.reset()
        env.reset()
        again.reset(seed=3, options={"episode": 2})
        assert env.fleet.hash == again.fleet.hash
        env.reset()
        again.reset()
        assert env.fleet.hash == again.fleet.hash
        again.reset(options={"episode": 2})
        assert again.episode_key == (3, 2)

    def test_first_episodes_are_those_of_0_2_0(self) -> None:
        env = gym.vector_env("bravo", **RESCUE)
        env.reset(seed=np.uint64(4))
        assert env.fleet.swarm.simulator.seed == 4137562808371188093

    @MAKERS
    def test_without_a_seed_two_environments_differ_and_say_how(self, make: Maker) -> None:
        one, other = make("bravo", **RESCUE), make("bravo", **RESCUE)
        one.reset()
        other.reset()
        assert one.fleet.hash != other.fleet.hash
        assert one.episode_key is not None
        other.reset(seed=one.episode_key.seed)
        assert one.fleet.hash == other.fleet.hash

    @pytest.mark.parametrize("leave", [lambda env: pickle.loads(pickle.dumps(env)), lambda env: env.close() or env])
    def test_a_copy_of_an_ended_episode_and_a_closed_one_begin_nothing_by_themselves(
        self, leave: Callable[[Any], Any]
    ) -> None:
        env = gym.vector_env("bravo", **RESCUE)
        env.reset(seed=1)
        while not env.step(np.zeros((6, 2)))[3].any():
            pass
        with pytest.raises(MisuseError, match="call reset"):
            leave(env).step(np.zeros((6, 2)))

    def test_an_environment_that_is_closed_or_copied_has_no_agents(self) -> None:
        env = gym.parallel_env("bravo", **RESCUE)
        env.reset(seed=1)
        assert pickle.loads(pickle.dumps(env)).agents == []
        env.close()
        assert env.agents == []

    @MAKERS
    @pytest.mark.parametrize("until", [None, "share (IN bravo) >= 0.9"])
    def test_a_copy_begins_anew(self, make: Maker, until: str | None) -> None:
        env = make("bravo", **RESCUE | {"until": until})
        env.reset(seed=1)
        copy = pickle.loads(pickle.dumps(env))
        with pytest.raises(MisuseError, match="call reset"):
            _ = copy.fleet
        copy.reset(seed=1)
        assert copy.fleet.hash == env.fleet.hash

    @MAKERS
    @pytest.mark.parametrize(
        ("options", "sentence"),
        [
            ({"epsode": 1}, r"no option \"epsode\" \(did you mean episode\?\)"),
            ({"episode": -1}, "episode -1: wanted a whole number from 0"),
            ({"episode": True}, "episode True: wanted"),
            ({"episode": "2"}, "episode '2': wanted"),
        ],
    )
    def test_options_that_are_none_are_refused(self, make: Maker, options: dict[str, Any], sentence: str) -> None:
        env = make("bravo", **RESCUE)
        env.reset(seed=1)
        before = env.fleet.hash
        with pytest.raises(MisuseError, match=sentence):
            env.reset(options=options)
        assert env.fleet.hash == before


class TestActions:
    @pytest.mark.parametrize(
        ("action", "sentence"),
        [
            (1.0, r"action for scout2: an array of shape \(\): wanted 2 numbers, of drive_speed, drive_turn"),
            (np.zeros(3), r"action for scout2: an array of shape \(3,\): wanted 2"),
            (np.zeros((1, 2)), "shape"),
            ("fast", "action for scout2: 'fast': wanted 2 numbers"),
            (None, r"action for scout2: an array of shape \(\): wanted 2"),
            ([1.0, np.nan], "action for scout2: .*nan.*: wanted 2"),
        ],
    )
    def test_setpoints_that_do_not_fit_are_refused_by_name(self, action: object, sentence: str) -> None:
        env = gym.parallel_env("bravo", **RESCUE)
        env.reset(seed=1)
        actions: dict[str, Any] = {name: np.zeros(2) for name in env.agents}
        with pytest.raises(MisuseError, match=sentence):
            env.step({**actions, "scout2": action})
        assert env.fleet.time == 0.0
        env.step(actions)

    @pytest.mark.parametrize("action", [3, -1, 0.5, np.nan, np.zeros(2)])
    def test_expressions_are_chosen_by_whole_numbers(self, action: object) -> None:
        env = gym.parallel_env("bravo", **RESCUE, actions=["(ST)", "(WANDER)", "(TUMBLE)"])
        env.reset(seed=1)
        with pytest.raises(MisuseError, match=r"action for scout2: .*wanted a whole number from 0 to 2"):
            env.step({**dict.fromkeys(env.agents, 0), "scout2": action})
        env.step(dict.fromkeys(env.agents, np.int64(2)))

    def test_names_that_are_no_robots_are_refused(self) -> None:
        env = gym.parallel_env("bravo", **RESCUE)
        env.reset(seed=1)
        with pytest.raises(MisuseError, match=r"action for scuot2: no such agent \(did you mean scout2\?\)"):
            env.step({**{name: np.zeros(2) for name in env.agents}, "scuot2": np.zeros(2)})

    @pytest.mark.parametrize(
        ("actions", "sentence"),
        [
            (
                np.zeros(2),
                r"actions: an array of shape \(2,\): wanted one of shape \(6, 2\): 2 numbers, of drive_speed",
            ),
            (np.zeros((5, 2)), r"shape \(5, 2\)"),
            (0.0, r"shape \(\)"),
            ([[0.0, 0.0], [0.0]], "actions: .*wanted one of shape"),
            ([[0.0, 0.0]] * 4 + [[0.0, np.nan]] + [[0.0, 0.0]], "action for scout5: .*nan"),
        ],
    )
    def test_a_vector_of_them_likewise(self, actions: Any, sentence: str) -> None:
        env = gym.vector_env("bravo", **RESCUE)
        env.reset(seed=1)
        with pytest.raises(MisuseError, match=sentence):
            env.step(actions)
        assert env.fleet.time == 0.0

    def test_a_vector_of_numbers_of_expressions_likewise(self) -> None:
        env = gym.vector_env("bravo", **RESCUE, actions=["(ST)", "(WANDER)"])
        env.reset(seed=1)
        with pytest.raises(MisuseError, match=r"action for scout6: .*wanted a whole number from 0 to 1"):
            env.step(np.array([0, 1, 0, 1, 0, 2]))


def test_a_mask_that_leaves_robots_out_is_refused() -> None:
    """It was ignored, and all robots began anew."""
    env = gym.vector_env("bravo", **RESCUE)
    first, _ = env.reset(seed=1)
    env.step(np.zeros((6, 2)))
    some, all_of_them = np.arange(6) < 2, np.ones(6, np.bool_)
    for mask, said in ((some, "4 of 6 robots are left out"), (all_of_them[:3], "wanted an array of 6 bools")):
        with pytest.raises(MisuseError, match=said):
            env.reset(seed=1, options={"reset_mask": mask})
    assert env.fleet.time > 0.0, "nothing was reset"
    options = {"reset_mask": all_of_them}
    assert np.array_equal(env.reset(seed=1, options=options)[0], first)
    assert "reset_mask" in options, "unlike in other vector environments, they may be given again"


class TestParallel:
    @pytest.mark.parametrize("actions", [["drive_speed", "drive_turn"], ["(DRIVE 5kn 0deg/s)", "(TUMBLE)", "(ST)"]])
    def test_pettingzoo_accepts_it(self, actions: list[str]) -> None:
        env = gym.parallel_env("bravo", actions=actions, done="(< fuel 20%)", **RESCUE)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            parallel_api_test(env, num_cycles=40)
        env.close()

    def test_pettingzoo_finds_equal_episodes_for_equal_seeds(self) -> None:
        parallel_seed_test(lambda: gym.parallel_env("bravo", **RESCUE), num_cycles=20)

    def test_agents_have_the_robots_names_and_ranges(self) -> None:
        env = gym.parallel_env("bravo", **RESCUE)
        assert env.possible_agents == [f"scout{number}" for number in range(1, 7)]
        observed, acted = env.observation_space("scout1"), env.action_space("scout1")
        assert isinstance(observed, Box)
        assert isinstance(acted, Box)
        assert (observed.low[3], observed.high[3], observed.high[4]) == (0.0, 1.0, np.inf)
        assert acted.high[0] == pytest.approx(30 * 1852 / 3600)

    def test_their_spaces_are_attributes_too(self) -> None:
        env = gym.parallel_env(**BRAVO)
        assert list(env.observation_spaces) == list(env.action_spaces) == env.possible_agents
        for name in env.possible_agents:
            assert env.observation_spaces[name] is env.observation_space(name)
            assert env.action_spaces[name] is env.action_space(name)

    def test_robots_that_are_done_leave_and_stand(self) -> None:
        env = gym.parallel_env("bravo", done="(> fuel 50%)", **{**RESCUE, "robots": 20, **LONG})
        env.reset(seed=1)
        fast = {name: np.array([10.0, 0.0]) for name in env.agents}
        _, _, done, _, _ = env.step(fast)
        left = [name for name, gone in done.items() if gone]
        assert left == [name for name, fuel in zip(env.possible_agents, env.fleet["fuel"], strict=True) if fuel > 0.5]
        assert set(env.agents) == set(env.possible_agents) - set(left)
        for _ in range(20):
            env.step({name: fast[name] for name in env.agents})
        assert max(abs(env.fleet["speed"][env.possible_agents.index(name)]) for name in left) == 0.0
        env.close()

    def test_who_leaves_in_the_last_step_is_not_cut_off(self) -> None:
        env = gym.parallel_env("bravo", **RESCUE, done="(AND (= id 2) (> time 2.9s))")
        env.reset(seed=1)
        told: dict[str, dict[str, Any]] = {}
        while env.agents:
            _, _, _, _, told = env.step({name: np.zeros(2) for name in env.agents})
        assert [name for name in env.possible_agents if not told[name].get("TimeLimit.truncated")] == ["scout2"]

    def test_an_episode_ends_for_all_when_its_goal_is_reached(self) -> None:
        env = gym.parallel_env("bravo", until="share (> time 0.5s) >= 1", **RESCUE)
        env.reset(seed=1)
        done: dict[str, bool] = {}
        while env.agents:
            _, _, done, cut, told = env.step({name: np.zeros(2) for name in env.agents})
        assert all(done.values())
        assert not any(cut.values())
        assert not any(told.values()), "nobody was cut off"

    @pytest.mark.parametrize(
        "end",
        [{"until": "count (< 0.65s time 0.75s) >= 1"}, {"done": "(< (+ 0.55 (/ id 100)) time (+ 0.7 (/ id 100)))"}],
    )
    def test_it_ends_on_the_tick_at_which_it_is_reached(self, end: dict[str, Any]) -> None:
        env = gym.parallel_env("bravo", **{**RESCUE, "ticks": 5}, **end)
        env.reset(seed=1)
        still = {name: np.zeros(2) for name in env.agents}
        assert [any(env.step(still)[2].values()) for _ in range(2)] == [False, True]
        assert env.agents == []
        assert env.fleet.time == pytest.approx(0.7)

    def test_who_is_done_is_what_the_language_says(self) -> None:
        env = gym.parallel_env("bravo", **RESCUE, done="(- 2 id)")  # all but scout2, of which it is 0
        env.reset(seed=1)
        env.step({name: np.zeros(2) for name in env.agents})
        assert env.agents == ["scout2"]

    def test_who_is_done_within_a_step_rests_from_then_on(self) -> None:
        states = []
        for ticks in (10, 1):
            env = gym.parallel_env("bravo", **{**RESCUE, "ticks": ticks}, done="(AND (= id 1) (< 0.45s time 0.55s))")
            env.reset(seed=1)
            for _ in range(10 // ticks):
                env.step({name: np.array([5.0, 0.0]) for name in env.agents})
            states.append((env.fleet.hash, env.agents))
        assert states[0] == states[1]
        assert "scout1" not in states[0][1]

    @pytest.mark.parametrize("end", [{"until": "share (> time 0.5s) >= 1"}, {"done": "(> time 0.5s)"}, {}])
    def test_when_all_have_left_nothing_happens_any_more(self, end: dict[str, Any]) -> None:
        env = gym.parallel_env("bravo", **RESCUE, **end)
        env.reset(seed=1)
        while env.agents:
            env.step({name: np.zeros(2) for name in env.agents})
        ended = env.fleet.hash
        assert env.step({}) == ({}, {}, {}, {}, {})
        assert env.step({"scout1": np.zeros(2)}) == ({}, {}, {}, {}, {})
        assert env.fleet.hash == ended


class TestVector:
    def test_shapes_rewards_and_ends(self) -> None:
        env = gym.vector_env("bravo", **RESCUE)
        assert env.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
        observed, _ = env.reset(seed=4)
        assert observed.shape == (6, 5)
        assert env.observation_space.contains(observed)
        for step in range(15):
            observed, reward, ended, cut, _ = env.step(env.action_space.sample())
            assert env.observation_space.contains(observed)
            assert np.allclose(reward, -observed[:, 4], rtol=1e-6)
            assert not ended.any()
            assert cut.all() == (step == 14)
        again, reward, _, cut, _ = env.step(env.action_space.sample())
        assert not cut.any()
        assert not reward.any()
        assert env.fleet.time == 0.0
        assert not np.array_equal(again, observed)
        env.close()

    def test_equal_seeds_and_actions_make_equal_episodes(self) -> None:
        def episode(seed: int) -> list[bytes]:
            env = gym.vector_env("crowd", observations=["x", "y", "sonar1"], reward="speed", robots=30, seconds=2.0)
            env.action_space.seed(5)
            found = [env.reset(seed=seed)[0].tobytes()]
            for _ in range(10):
                observed, reward, *_ = env.step(env.action_space.sample())
                found += [observed.tobytes(), reward.tobytes()]
            return [*found, env.fleet.hash.encode()]

        assert episode(3) == episode(3)
        assert episode(3) != episode(4)

    def test_wrappers_of_gymnasium_work(self) -> None:
        env = RecordEpisodeStatistics(gym.vector_env("bravo", actions=["(ST)", "(WANDER)"], **RESCUE))
        assert isinstance(env.single_action_space, Discrete)
        env.reset(seed=1)
        for _ in range(20):
            *_, info = env.step(env.action_space.sample())
            if "episode" in info:
                assert (info["episode"]["l"] == 15).all()
                return
        raise AssertionError("no episode has ended")

    def test_stop_holds_robots_whatever_the_policy_wants(self) -> None:
        env = gym.vector_env("bravo", **{**RESCUE, **LONG})
        env.reset(seed=1)
        env.fleet.stop()
        for _ in range(20):
            env.step(np.full((6, 2), [10.0, 0.0]))
        assert env.fleet.stopped.all()
        assert not env.fleet["speed"].any()

    def test_setpoints_beyond_the_limits_are_limited(self) -> None:
        env = gym.vector_env("bravo", **{**RESCUE, **LONG})
        env.reset(seed=1)
        for _ in range(25):
            env.step(np.full((6, 2), [1e6, 0.0]))
        assert env.fleet["speed"].max() <= 30 * 1852 / 3600 + 1e-9


APART = """
format = 1
title = "Robots that drive apart"
seconds = "15s"
tick = "0.5s"
[world]
width = "100m"
height = "100m"
[robots]
type = "vehicle"
count = 2
motion = "still"
x = ["40m", "60m"]
y = ["40m", "60m"]
[robots.limits]
speed = "1m/s"
turn_rate = "45deg/s"
acceleration = "1m/s2"
[robots.body]
radius = "0.2m"
"""
"""Robots that drive straight on are far from the middle in the end, at different times in different worlds, and in some
not before the time is over."""


class TestWorlds:
    @pytest.mark.parametrize("task", [BRAVO, CROWD, LEARNED])
    def test_each_equals_the_run_alone(self, task: dict[str, Any]) -> None:
        """What is evaluated on one table of all worlds, and what is not."""
        env = gym.vector_env(worlds=3, **task)
        robots = env.num_envs // 3
        env.action_space.seed(5)
        observed, _ = env.reset(seed=4)
        alone = [Episode(checked(Task(actions=SETPOINTS, **task)), 4, 0, world) for world in range(3)]
        assert np.array_equal(observed, np.concatenate([each.observe() for each in alone]))
        assert len({each.swarm.simulator.state_hash() for each in alone}) == 3
        for _ in range(6):
            actions = env.action_space.sample()
            observed, reward, *_ = env.step(actions)
            steps = [each.step(some) for each, some in zip(alone, np.split(actions, 3), strict=True)]
            assert np.array_equal(observed, np.concatenate([each.observed for each in steps]))
            assert np.array_equal(reward, np.concatenate([each.reward for each in steps]))
        assert [each.snapshot() for each in env.fleets] == [each.fleet.snapshot() for each in alone]
        assert observed.shape == (3 * robots, len(task["observations"]))

    def test_the_first_world_is_the_same_however_many_there_are(self) -> None:
        one, many = (gym.vector_env("bravo", worlds=worlds, **RESCUE) for worlds in (1, 3))
        assert np.array_equal(one.reset(seed=4)[0], many.reset(seed=4)[0][:6])

    def test_who_takes_a_fleet_between_steps_changes_nothing(self) -> None:
        """What was made without Python is then brought up to date, and its desk hears of all robots."""
        left_alone, looked_at = (gym.vector_env(worlds=2, **CROWD) for _ in range(2))
        left_alone.action_space.seed(5)
        for env in (left_alone, looked_at):
            env.reset(seed=4)
        for step in range(8):
            actions = left_alone.action_space.sample()
            expected, now = left_alone.step(actions), looked_at.step(actions)
            assert all(np.array_equal(one, other) for one, other in zip(expected[:4], now[:4], strict=True))
            if step == 3:
                fleet = looked_at.fleets[1]
                assert fleet.time == pytest.approx(4 * 3 * 0.1)
                assert len(fleet.preview("(> x -1m)").yes) == 5
            if step > 3:
                assert (fleet.x == looked_at.fleets[1].x).all()
        assert [each.hash for each in left_alone.fleets] == [each.hash for each in looked_at.fleets]

    def test_commands_reach_robots_between_steps(self) -> None:
        env = gym.vector_env(worlds=2, **CROWD)
        env.reset(seed=4)
        for _ in range(3):
            env.step(np.full((10, 2), [0.5, 0.0]))
        env.fleets[0].stop()
        for _ in range(10):
            env.step(np.full((10, 2), [0.5, 0.0]))
        speeds = [fleet["speed"] for fleet in env.fleets]
        assert not speeds[0].any()
        assert speeds[1].any()

    def test_without_a_seed_all_worlds_have_the_one_that_is_drawn(self) -> None:
        env = gym.vector_env("bravo", worlds=3, **RESCUE)
        env.reset()
        assert len({key and key.seed for key in env.episode_keys}) == 1
        assert len({fleet.hash for fleet in env.fleets}) == 3

    @pytest.mark.parametrize("mode", AutoresetMode)
    def test_episodes_end_world_by_world(self, mode: AutoresetMode) -> None:
        away = "(DIST x y 50m 50m)"
        env = gym.vector_env(
            APART,
            observations=["x", away],
            reward=away,
            until=f"share (> {away} 14m) >= 1",
            worlds=4,
            autoreset=mode.value,
        )
        assert env.metadata["autoreset_mode"] is env.autoreset_mode is mode, "TorchRL asks the environment itself"
        env.reset(seed=4)
        reasons = set[tuple[bool, ...]]()
        waits = np.zeros(4, np.bool_)
        for _ in range(70):
            before = [key and key.episode for key in env.episode_keys]
            _, reward, ended, over, info = env.step(np.full((8, 2), [10.0, 0.0]))
            done = (ended | over).reshape(4, 2)
            assert (done.any(axis=1) == done.all(axis=1)).all(), "a world's rows end together"
            fresh = np.array([fleet.time == 0.0 for fleet in env.fleets])
            assert (fresh == (done[:, 0] if mode is AutoresetMode.SAME_STEP else waits)).all()
            again = [key and key.episode for key in env.episode_keys]
            assert [now != then for now, then in zip(again, before, strict=True)] == fresh.tolist()
            if mode is AutoresetMode.SAME_STEP and done.any():
                assert (info["_final_obs"] == done.ravel()).all()
                last = info["final_obs"][done.ravel()]
                assert np.allclose(reward[done.ravel()], [each[1] for each in last], rtol=1e-6)
            reasons |= {tuple(each) for each in np.stack((ended, over))[:, ::2].T.tolist()}
            waits = done[:, 0]
            if mode is AutoresetMode.DISABLED and waits.any():
                with pytest.raises(MisuseError, match="episodes are over: call reset"):
                    env.step(np.zeros((8, 2)))
                env.reset(options={"reset_mask": np.repeat(waits, 2)})
                waits = np.zeros(4, np.bool_)
        assert {(True, False), (False, True), (False, False)} <= reasons

    def test_a_mask_begins_whole_worlds_anew(self) -> None:
        env = gym.vector_env("bravo", worlds=3, **RESCUE)
        env.reset(seed=4)
        before, *_ = env.step(np.full((18, 2), [10.0, 0.0]))
        after, _ = env.reset(options={"reset_mask": np.arange(18) // 6 == 1})
        same = (before == after).all(axis=1).reshape(3, 6).all(axis=1)
        assert same.tolist() == [True, False, True]
        assert [key and key.episode for key in env.episode_keys] == [0, 1, 0]
        with pytest.raises(MisuseError, match=r"12 of 18 robots are left out, .* whole worlds"):
            env.reset(options={"reset_mask": np.arange(18) % 3 == 0})

    def test_wrappers_of_gymnasium_work(self) -> None:
        env = RecordEpisodeStatistics(gym.vector_env("bravo", worlds=2, autoreset="SameStep", **RESCUE))
        env.reset(seed=1)
        for _ in range(20):
            *_, info = env.step(env.action_space.sample())
            if "episode" in info:
                assert (info["episode"]["l"] == 15).all()
                return
        raise AssertionError("no episode has ended")

    def test_gymnasium_counts_each_worlds_episodes_where_worlds_are_reset_one_by_one(self) -> None:
        env = RecordEpisodeStatistics(
            gym.vector_env(
                "crowd",
                robots=2,
                worlds=3,
                seconds=3.0,
                observations=["x"],
                reward="1",
                until="count (> x 2.2m) >= 1",
                autoreset="Disabled",
            )
        )
        env.reset(seed=3)
        steps = np.zeros(6, int)
        lengths = set[int]()
        for _ in range(40):
            _, _, ended, over, info = env.step(np.full((6, 2), [0.5, 0.0]))
            steps += 1
            done = ended | over
            if done.any():
                assert (info["episode"]["l"][done] == steps[done]).all()
                lengths |= set(steps[done].tolist())
                steps[done] = 0
                env.reset(options={"reset_mask": done})
        assert len(lengths) > 1, "worlds have ended at different times"

    def test_what_is_wrong_is_said_with_its_world(self) -> None:
        env = gym.vector_env("bravo", worlds=2, **RESCUE)
        env.reset(seed=1)
        actions = np.zeros((12, 2))
        actions[8, 1] = np.nan
        with pytest.raises(MisuseError, match="action for scout3 of world 1"):
            env.step(actions)

    @pytest.mark.parametrize(
        ("given", "said"),
        [
            ({"worlds": 0}, "worlds 0: wanted a whole number from 1"),
            ({"worlds": 100_000, "robots": 11}, "100,000 worlds of 11 robots: at most 1,000,000"),
            ({"autoreset": "never"}, "autoreset 'never': wanted one of NextStep, SameStep, Disabled"),
        ],
    )
    def test_what_makes_none(self, given: dict[str, Any], said: str) -> None:
        with pytest.raises(MisuseError, match=said):
            gym.vector_env("bravo", **{**RESCUE, **given})


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"observations": []}, "observations: wanted a list"),
        ({"observations": "x"}, "observations: wanted a list"),
        ({"observations": ["fule"]}, "fule"),
        ({"actions": ["drive_sped"]}, "did you mean drive_speed"),
        ({"actions": ["(DRIVE 5"]}, "parenthesis|closed|missing"),
        ({"reward": "(ST)"}, "cannot be previewed"),
        ({"until": "share"}, "wanted a measure and a bound"),
        ({"seconds": -1.0}, "seconds -1.0: wanted from"),
        ({"ticks": 0}, "ticks 0: wanted"),
        ({"over": {"robots.cuont": 3}}, "cuont"),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(SleepcastError, match=sentence):
        gym.parallel_env("bravo", **{**RESCUE, **changes})


def test_a_step_before_reset_is_refused() -> None:
    with pytest.raises(MisuseError, match="call reset"):
        gym.vector_env("bravo", **RESCUE).step(np.zeros((6, 2)))


def test_actions_in_a_list_are_refused() -> None:
    env = gym.parallel_env("bravo", **RESCUE)
    env.reset(seed=1)
    with pytest.raises(MisuseError, match=r"^actions .*: wanted a dict"):
        env.step([np.zeros(2)] * 6)  # type: ignore[arg-type]  # what is tried


def test_a_missing_action_is_refused() -> None:
    env = gym.parallel_env("bravo", **RESCUE)
    env.reset(seed=1)
    with pytest.raises(MisuseError, match="no action for scout2"):
        env.step({"scout1": np.zeros(2)})


def test_without_the_libraries_a_sentence_says_what_to_install() -> None:
    program = (
        "import sys; sys.modules['gymnasium'] = None\ntry:\n import sleepcast.gym\nexcept Exception as e: print(e)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert installing("gym") in done.stdout
