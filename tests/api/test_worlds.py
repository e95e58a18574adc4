"""Many worlds at once: each equals the same run alone, and one that fails costs no other."""

from __future__ import annotations

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.node.linking import sensor

LOSSES = [0.0, 0.3]


class Meter:
    """A robot with a meter, which breaks after half a second if the robot started far east."""

    def __init__(self, body: sc.SimulatedBody) -> None:
        self.body, self.breaks = body, bool(body.x > 10_000.0)

    @property
    @sensor(unit="s")
    def read(self) -> float:
        if self.breaks and self.body.time > 0.5:
            raise RuntimeError("the meter is broken")
        return float(self.body.time)


def worlds(**given: object) -> sc.Worlds:
    wanted: dict[str, object] = {"seeds": (3, 7), "over": {"radio.loss": LOSSES}, "robots": 6, "quiet": True}
    return sc.open_many("bravo", **(wanted | given))  # type: ignore[arg-type]  # any of them


class TestEqual:
    @pytest.mark.parametrize("threads", [1, 2])
    def test_each_world_equals_the_run_alone(self, threads: int) -> None:
        together = worlds(threads=threads, mission=True).run(4, quiet=True)
        together.send("(WHEN (> fuel 50%) (JOIN bravo))", wait=0)
        together.run("3s", quiet=True)
        for number, plan in enumerate(together.plans):
            alone = sc.open("bravo", robots=6, seed=plan.seed, over=dict(plan.over), mission=True, threads=1)
            alone.run(4, quiet=True).send("(WHEN (> fuel 50%) (JOIN bravo))", wait=0)
            assert alone.run(3, quiet=True).snapshot() == together[number].snapshot()

    def test_worlds_of_a_point_have_what_was_learned_in_common(self) -> None:
        together = worlds(threads=1)
        together.send("(RULE home (WHEN (> fuel 5%) (JOIN full)))", everybody=True, wait=3)
        first, second, other, _ = (each.swarm for each in together)
        assert first.vocabulary.first is second.vocabulary.first is not other.vocabulary.first
        assert first.vocabulary.user_slots is not second.vocabulary.user_slots
        kept, again, apart = (swarm.fleet.memory.mind_of(0) for swarm in (first, second, other))
        assert kept.running
        assert kept is again is not apart

    def test_worlds_of_a_text_equal_the_run_alone(self) -> None:
        limits = "limits = {speed = '1m/s', acceleration = '1m/s2', turn_rate = 1}"
        robots = f"[robots]\ntype = 'rover'\ncount = 3\n{limits}\nbody = {{radius = 0.1}}"
        text = f"format = 1\ntitle = 'A hall'\nseconds = 9\n{robots}\n[world]\nwidth = '9m'\nheight = '9m'\n"
        together = sc.open_many(text, seeds=2, quiet=True).run(2, quiet=True)
        for number in (0, 1):
            assert sc.open(text, seed=number + 1).run(2).snapshot() == together[number].snapshot()

    def test_a_world_that_went_ahead_waits_for_the_others(self) -> None:
        together = worlds()
        together[1].run(2, quiet=True)
        together.run(1, quiet=True)
        assert [each.time for each in together] == [1.0, 2.0, 1.0, 1.0]
        together.run(3, quiet=True)
        assert {each.time for each in together} == {together.time} == {4.0}

    def test_worlds_with_other_ticks_are_as_far(self) -> None:
        together = worlds(over={"tick": ["0.1s", "0.5s"]}, seeds=1).run(7, quiet=True)
        assert [each.time for each in together] == pytest.approx([7.0, 7.0])


class TestTables:
    def test_a_table_has_a_row_for_each_robot_of_each_world(self) -> None:
        together = worlds().run(1, quiet=True)
        table = together.table("x", "fuel")
        assert list(table.columns) == ["world", "robot", "x", "fuel"]
        assert np.asarray(table["world"]).tolist() == [0] * 6 + [1] * 6 + [2] * 6 + [3] * 6
        assert (np.asarray(table["x"])[6:12] == together[1]["x"]).all()
        assert (together.values("x") == table["x"]).all()

    def test_a_history_has_the_world_before_the_time(self) -> None:
        together = worlds()
        history = together.history("x", every=1)
        together.run(2, quiet=True)
        table = history.table()
        assert list(table.columns) == ["world", "time", "robot", "x"]
        assert len(table) == 4 * 3 * 6
        assert history[2].times.tolist() == [0.0, 1.0, 2.0]
        with pytest.raises(sc.errors.MisuseError, match="world 4 is not sampled: wanted one of 0, 1, 2, 3"):
            history[4]

    def test_the_overview_says_what_is_special_about_each_world(self) -> None:
        assert worlds().overview().to_dict() == {
            "world": [0, 1, 2, 3],
            "seed": [3, 7, 3, 7],
            "error": [""] * 4,
            "radio.loss": [0.0, 0.0, 0.3, 0.3],
        }

    def test_what_became_of_a_command_is_one_table(self) -> None:
        together = worlds(seeds=4, over={})
        asked = together.ask("id", wait=5)
        assert asked[1].values == {f"scout{number}": number for number in range(1, 7)}
        assert together.time < 5.0, "all have answered before"
        table = asked.table()
        assert list(table.columns) == ["world", "robot", "outcome", "value", "fault"]
        assert len(table) == 4 * 6
        assert together.stop()[3].silent == ()
        assert all(each.stopped.all() for each in together)


class TestFailures:
    def test_a_world_that_cannot_be_built_fails_alone(self) -> None:
        together = worlds(over={"radio.loss": [0.1, 7]}).run(1, quiet=True)
        assert sorted(together.failed) == [2, 3]
        assert "over radio.loss: wanted a plain number from 0 to 1, not 7" in together.failed[2]
        assert len(together.table("x")) == 2 * 6
        with pytest.raises(sc.errors.MisuseError, match=r"world 2 has failed: .*radio\.loss"):
            together[2]
        assert "2 failed, the first one" in repr(together)

    def test_what_is_wrong_in_all_of_them_is_raised(self) -> None:
        with pytest.raises(sc.errors.MisuseError, match=r"radio\.loss: wanted a plain number"):
            worlds(over={"radio.loss": 7})

    @pytest.mark.parametrize("threads", [1, 2])
    def test_one_in_which_something_goes_wrong_is_left_out(self, threads: int) -> None:
        together = worlds(robots=Meter, over={"robots.count": 1}, threads=threads).run(1, quiet=True)
        assert together.failed.keys() == {0}, "seed 3 lets its first scout start far east"
        assert "the meter is broken" in together.failed[0]
        assert [each.time for each in together] == [1.0]
        assert 0 not in together

    def test_where_all_have_failed_there_is_nothing_to_read(self) -> None:
        together = worlds(robots=Meter, over={"robots.count": 1}, seeds=(3,)).run(1, quiet=True)
        with pytest.raises(sc.errors.MisuseError, match=r"all worlds have failed, the first one: .*broken"):
            together.values("x")

    def test_a_command_that_one_world_refuses_is_sent_in_the_others(self) -> None:
        together = worlds(seeds=2, over={})
        together[1].send("(RULE mine (WHEN (> fuel 200%) (ST)))", everybody=True, wait=1)
        sent = together.send("(DEFVAR mine 1)", everybody=True, wait=0)
        assert "mine at 1:9 is already a rule" in sent.refused[1]
        assert len(sent) == 1

    def test_one_that_all_refuse_is_raised(self) -> None:
        with pytest.raises(sc.errors.SleepcastError, match="no test"):
            worlds().send("(ST)")

    @pytest.mark.parametrize(
        ("given", "wanted"),
        [
            ({"seeds": 0}, "seeds 0: wanted a whole number from 1"),
            ({"seeds": ()}, "0 worlds: wanted from 1"),
            ({"seeds": (1.5,)}, r"seed 1\.5: wanted a whole number"),
            ({"over": {"radio.loss": []}}, "0 worlds"),
            ({"over": [1]}, "over .*wanted keys"),
            ({"seeds": range(10**9)}, "worlds: wanted from 1 to 100,000"),
            ({"threads": 0}, "threads 0"),
        ],
    )
    def test_what_makes_no_worlds(self, given: dict[str, object], wanted: str) -> None:
        with pytest.raises(sc.errors.MisuseError, match=wanted):
            worlds(**given)

    def test_too_many_robots(self) -> None:
        with pytest.raises(sc.errors.MisuseError, match="robots"):
            worlds(robots=10**9)
