"""Robots that come during a run without a parent: at the time that the scenario says, or because somebody adds them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sleepcast as sc
from cli.calling import called_warm
from machines import ALL
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm, resume
from sleepcast.loop.rerun import InputLog, Rerun
from sleepcast.simulator import Circle, Simulator, read_scenario
from sleepcast.simulator.engine import Machine, choose

HEAD = """
format = 2
title = "yard"
seconds = "1min"

[world]
width = "20m"
height = "20m"
edge = "wall"
{world}

[neighbours]
reach = "30m"
shares = {{ fuel = "" }}

[pings]
reach = "30m"

[radio]
delay = "0.25s"
{more}
"""
SORT = """
[[robots]]
type = "{type}"
count = {count}
{coming}

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "10m/s2"

[robots.body]
radius = "0.1m"
{body}

[robots.stores.energy]
start = ["40%", "80%"]
full = "100%"
"""
STILL = 'motion = "still"'


def sort(type: str, count: int, coming: str = "", body: str = "") -> str:
    return SORT.format(type=type, count=count, coming=coming, body=body)


def text(*sorts: str, world: str = "", more: str = "") -> str:
    return HEAD.format(world=world, more=more) + "".join(sorts)


SHEEP = sort("sheep", 4, "most = 8")
WOLVES = sort("wolf", 3, 'at = "1s"')


def fleet(*sorts: str, seed: int = 1, **changes: Any) -> SimulatedFleet:
    return sc.open(text(*(sorts or (SHEEP, WOLVES)), **changes), seed=seed)


def test_robots_come_at_their_time_with_the_numbers_that_follow() -> None:
    with fleet() as run:
        run.run(0.9)
        assert run.names == ("sheep1", "sheep2", "sheep3", "sheep4")
        run.run(0.1)
        assert run.names[4:] == ("wolf5", "wolf6", "wolf7")
        assert run["id"].tolist() == [1, 2, 3, 4, 5, 6, 7]
        assert run.time == pytest.approx(1.0)
        run.run(5)
        assert len(run) == 7


def test_a_robot_that_comes_is_as_it_would_have_been_at_the_start() -> None:
    """Place, heading, speed and stores go by its number alone."""
    bumpers = "bumpers = 1"
    with fleet(sort("sheep", 4, body=bumpers), sort("wolf", 3, body=bumpers)) as first:
        wanted = {what: first[what][4:].tolist() for what in ("id", "x", "y", "heading", "speed", "energy", "bumper")}
        for late in ('at = "2s"', 'at = "2s"\nmost = 9'):
            with fleet(sort("sheep", 4, STILL, body=bumpers), sort("wolf", 3, late, body=bumpers)) as run:
                run.send("(DEFVAR age 3)", everybody=True, wait=0)
                run.send("(JOIN old)", everybody=True, wait=0)
                run.run(2)
                assert {what: run[what][4:].tolist() for what in wanted} == wanted
                assert np.isnan(run["age"][4:]).all()
                assert run.groups["old"] == ("sheep1", "sheep2", "sheep3", "sheep4")


def test_starts_and_formations_say_where_they_come() -> None:
    listed = sort("sheep", 2, 'at = "1s"\nstarts = [["3m", "4m", "90deg"], ["5m", "6m", "0deg"]]')
    circle = sort("wolf", 3, 'at = "0.5s"\nstarts = { shape = "line", spacing = "1m", center = ["10m", "10m"] }')
    with fleet(sort("dog", 1), listed, circle) as run:
        run.run(1)
        places = dict(zip(run.names, zip(run.x.tolist(), run.y.tolist(), strict=True), strict=True))
        assert run.names == ("dog1", "sheep5", "sheep6", "wolf2", "wolf3", "wolf4")  # by row; numbers by their time
        assert places["sheep5"] == (3.0, 4.0)
        assert places["sheep6"] == (5.0, 6.0)
        minds = run.swarm.minds
        assert [minds[name].evaluate("(ROUND (* 10 heading))").value for name in ("sheep5", "sheep6")] == [16.0, 0.0]


@pytest.mark.parametrize("machine", ALL)
def test_runs_are_the_same_on_all_machines_and_threads(machine: Any) -> None:
    def hashed(on: Machine) -> tuple[str, bytes]:
        run = Swarm(Simulator(read_scenario(text(SHEEP, WOLVES, more="loss = 0.1")), 5, on))
        run.run(3)
        return run.simulator.state_hash(), run.values_of("(+ id energy x)").tobytes()

    assert hashed(machine) == hashed(machine)
    if machine.name == "numba":
        assert hashed(choose("numba", 3)) == hashed(machine)


def test_who_comes_is_told_standing_commands_and_expected_by_none_from_before() -> None:
    with fleet() as run:
        run.send("(JOIN once)", everybody=True, wait=0)
        lasting = run.send('(RULE go (REPORT "hello" id))', everybody=True, standing=True, wait=0)
        run.send("(JOIN pack)", everybody=True, standing=True, wait=0)
        only = run.send("(JOIN two)", standing=True, only=["sheep1", "sheep2"], wait=0)
        run.run(3)
        assert run.groups["once"] == run.names[:4]
        assert run.groups["pack"] == run.names
        assert run.groups["two"] == ("sheep1", "sheep2")
        assert [rule.text for rule in run.swarm.minds["wolf6"].rules()] == ['(REPORT "hello" id)']
        for sent, count in ((lasting, 4), (only, 2)):
            assert sent.account.complete
            assert len(sent.account.matched) == count
            assert not sent.account.silent
        assert set(run.swarm.minds) == {*run.names}
        later = run.send("(JOIN three)", everybody=True)
        assert len(later.account.matched) == 7


def test_no_standing_command_is_lost_where_there_are_many() -> None:
    with fleet(SHEEP) as run:
        run.send("(DEFVAR tally 0)", everybody=True, standing=True)
        for number in range(70):
            run.run(0.1)
            run.send(f"(SETQ tally (+ (* 2 tally) {number % 3}))", everybody=True, standing=True, wait=0)
        run.run(0.5)
        run.add_robot()
        run.run(0.5)
        tallies = run["tally"].tolist()
        assert tallies == [tallies[0]] * 5  # each of them, in their order


def test_a_stop_of_the_fleet_holds_who_comes_until_release() -> None:
    with fleet() as run:
        run.run(0.2)
        run.stop(wait=0)
        run.run(0.1)
        assert run.add_robot() == "sheep5"  # while the STOP is still on its way
        assert run.stopped.tolist() == [False] * 4 + [True]
        run.run(2)
        assert run.stopped.all()
        assert len(run) == 8
        still = run.x.tolist()
        run.run(1)
        assert run.x.tolist() == still
        assert run.swarm.minds["wolf6"].evaluate("(FD 1)").faults
        release = run.release()
        assert not run.stopped.any()
        assert len(release.account.matched) == 8
        run.add_robot()
        assert not run.stopped.any()


def test_locked_rules_are_there_from_the_beginning() -> None:
    operators = '[operators.ann]\nrole = "commander"\n[minds.locked]\nsafe = "(WHEN (> time 0) (MARK))"\n'
    with fleet(more=operators) as run:
        run.run(2)
        assert [len(run.swarm.minds[name].rules()) for name in run.names] == [1] * 7


# ---- places


def test_a_given_place_that_is_taken_is_waited_for() -> None:
    """By a body where bodies touch each other, and by a wall anywhere."""
    solid = "bumpers = 1"
    first = sort("dog", 1, f'starts = [["5m", "5m"]]\n{STILL}', solid)
    late = sort("sheep", 2, 'at = "1s"\nstarts = [["5.1m", "5m"], ["9m", "9m"]]', solid)
    with fleet(first, late) as run:
        run.run(3)
        assert run.names == ("dog1",)  # both wait, since they come together
        run.send("(GOTO 15 15)", everybody=True, wait=0)
        wall = run.world.add(Circle(9.0, 9.0, 0.5))
        run.run(3)
        assert run.names == ("dog1",)
        run.world.remove(wall)
        run.run(0.1)
        assert run.names == ("dog1", "sheep2", "sheep3")
        assert (run.x[1:].tolist(), run.y[1:].tolist()) == ([5.1, 9.0], [5.0, 9.0])


def test_places_by_chance_are_free_ones() -> None:
    solid, crowd = "bumpers = 1", 'at = "1s"\nx = ["1m", "4m"]\ny = ["1m", "4m"]'
    with fleet(
        sort("dog", 40, f'{STILL}\nx = ["1m", "4m"]\ny = ["1m", "4m"]', solid), sort("sheep", 40, crowd, solid)
    ) as run:
        run.world.add(Circle(2.5, 2.5, 0.7))
        run.run(1)
        assert len(run) == 80
        gap = np.hypot(run.x[:, None] - run.x, run.y[:, None] - run.y)[40:]
        assert np.sort(gap)[:, 1].min() >= 0.2
        assert np.hypot(run.x[40:] - 2.5, run.y[40:] - 2.5).min() >= 0.8


def test_nobody_comes_while_there_is_no_room_by_chance() -> None:
    narrow = 'at = "1s"\nx = ["2m", "2.05m"]\ny = ["2m", "2.05m"]'
    with fleet(sort("dog", 1, f'starts = [["2m", "2m"]]\n{STILL}', "bumpers = 1"), sort("sheep", 1, narrow)) as run:
        run.run(1.2)
        assert run.names == ("dog1",)
        run.send("(GOTO 9 9)", everybody=True, wait=0)
        run.run(3)
        assert run.names == ("dog1", "sheep2")


def test_a_world_may_be_empty_at_the_start() -> None:
    with fleet(sort("sheep", 3, 'at = "1s"')) as run:
        run.run(0.5)
        assert (len(run), run.names, run.x.tolist()) == (0, (), [])
        run.run(1)
        assert run.names == ("sheep1", "sheep2", "sheep3")
        assert run.send("(JOIN pack)", everybody=True).account.complete


# ---- added by hand


def test_robots_are_added_where_there_is_room() -> None:
    with fleet(
        sort("sheep", 4, "most = 8", "bumpers = 1"), sort("wolf", 3, 'at = "1s"\nmost = 4', "bumpers = 1")
    ) as run:
        assert run.add_robot("sheep", 3.0, 4.0, 1.0) == "sheep5"
        assert (run.x[4], run.y[4], run.heading[4]) == (3.0, 4.0, 1.0)
        assert np.isnan(run.swarm.minds["sheep5"].evaluate("fuel").value or np.nan)
        assert run.add_robot("wolf") == "wolf6"
        wrong = {
            ("wolf",): "no room for another wolf: see most",  # three are to come
            (): 'no robot "" can be added: wanted sheep or wolf',
            ("shep",): 'no robot "shep" can be added (did you mean sheep',
            ("sheep", 3.1, 4.0): "a sheep has no room at 3.1, 4 m: something solid or another robot is there",
            ("sheep", 0.05, 4.0): "a sheep has no room at 0.05, 4 m",
            ("sheep", 21.0, 4.0): "x = 21 m lies outside the world, which goes from 0 to 20 m",
            ("sheep", float("nan"), 4.0): "x = nan m lies outside the world",
            ("sheep", 3.0): "give both",
            ("sheep", 9.0, 9.0, float("inf")): "a heading of inf rad",
        }
        for given, why in wrong.items():
            with pytest.raises(MisuseError, match=re.escape(why)):
                run.add_robot(*given)
        run.run(2)
        assert len(run) == 9
        for _ in range(3):
            run.add_robot("sheep")
        with pytest.raises(MisuseError, match="no room for another sheep"):
            run.add_robot("sheep")


def test_as_many_robots_as_stores_are_no_stores() -> None:
    water = '[robots.stores.water]\nstart = ["1", "2"]\nlasts = "10s"\n'
    with fleet(sort("sheep", 1, "most = 2") + water) as run:
        run.add_robot()
        run.run(1)
        assert (np.diff(run["water"]) != 0.0).all()
        assert (run["energy"] >= 0.4).all()


def test_robots_are_added_only_where_the_scenario_has_room() -> None:
    with fleet(sort("sheep", 4)) as run, pytest.raises(MisuseError, match="no robots can be added: say most"):
        run.add_robot()
    with fleet(sort("sheep", 4, 'at = "1s"')) as run, pytest.raises(MisuseError, match="no robots can be added"):
        run.add_robot()
    starts = 'most = 4\nstarts = [["1m", "1m"], ["2m", "2m"]]'
    with fleet(sort("sheep", 2, starts)) as run:
        with pytest.raises(MisuseError, match="say where this one is to stand"):
            run.add_robot()
        assert run.add_robot("", 3.0, 3.0) == "sheep3"


def test_where_robots_only_come_nobody_hatches_or_dies() -> None:
    with fleet() as run:
        run.run(1)
        for form in ("(DIE)", "(HATCH 0 1)"):
            assert run.swarm.minds["sheep1"].evaluate(form).faults


# ---- time


def lived(run: SimulatedFleet) -> None:
    """What the runs below have in common, after half a second."""
    run.send("(RULE roam (WHEN (PROB 0.1) (DRIVE 0.5 (GAUSS 0 1))))", everybody=True, standing=True, wait=0)
    run.run(0.1)
    pillar = run.world.add(Circle(15.0, 15.0, 1.0))
    run.add_robot("sheep", 12.0, 12.0)
    run.world.move(pillar, -3.0, -3.0)  # onto the robot that has just come
    run.add_robot("sheep")
    run.run(2)


def test_a_run_that_is_put_away_goes_on_to_the_last_bit() -> None:
    for before in (0.4, 3.0):
        with fleet(seed=3) as run, fleet(seed=3) as other:
            for each in (run, other):
                each.run(before)
                each.stop(wait=0)
                each.run(0.1)
                each.release(wait=0)
                each.add_robot()
            with sc.resume(run.snapshot()) as gone_on, run.fork() as fork:
                for each in (gone_on, fork, other):
                    lived(each)
                assert gone_on.names == fork.names == other.names
                assert gone_on.hash == fork.hash == other.hash
                assert gone_on["(+ id energy)"].tobytes() == other["(+ id energy)"].tobytes()


@pytest.mark.parametrize("before", [0.0, 0.3])
def test_recorded_runs_are_verified(tmp_path: Path, before: float) -> None:
    file = tmp_path / "run.mcap"
    with fleet() as run:
        run.run(before)
        run.add_robot("sheep", 1.0, 1.0)
        with run.record(file):
            lived(run)
            run.add_robot("sheep")
    verified = called_warm("replay", str(file), "--verify")
    assert (verified.status, "the same to the last bit" in verified.out) == (0, True), verified.out


def test_a_run_again_from_any_moment_adds_each_robot_once() -> None:
    with fleet() as run:
        log = InputLog(run.swarm)
        run.swarm.witnesses.append(log)
        run.run(0.5)
        states = [run.snapshot()]
        run.add_robot("sheep", 12.0, 12.0)
        states.append(run.snapshot())  # the same tick, with the robot
        run.add_robot("sheep")
        run.run(1)
        states.append(run.snapshot())
        run.add_robot()
        run.run(1)
        for state in states:
            again = Rerun(resume(state), log.inputs)
            while again.tick < run.swarm.simulator.tick:
                again.step()
            assert again.swarm.simulator.state_hash() == run.hash


def test_where_another_future_has_no_room_a_robot_is_not_added_again() -> None:
    with fleet(sort("sheep", 4, "hatch = true\nmost = 5")) as run:
        log, state = InputLog(run.swarm), run.snapshot()
        run.swarm.witnesses.append(log)
        run.run(0.2)
        run.add_robot()
        run.run(0.1)
        other = resume(state)
        other.minds["sheep1"].evaluate("(HATCH sheep 1)")
        again = Rerun(other, log.inputs)
        while again.tick < 5:
            again.step()
        assert [*other.minds] == ["sheep1", "sheep2", "sheep3", "sheep4", "sheep5"]


def test_worlds_at_once_come_to_the_same_as_each_alone() -> None:
    alone = []
    for seed in (1, 2):
        with fleet(seed=seed) as run:
            run.run(2)
            alone.append((run.hash, tuple(run.names)))
    with sc.open_many(text(SHEEP, WOLVES), seeds=[1, 2]) as worlds:
        worlds.run(2, quiet=True)
        assert [(world.hash, tuple(world.names)) for world in worlds] == alone


def test_histories_and_tables_have_those_that_are_there() -> None:
    with fleet() as run:
        history = run.history("id", every=1)
        run.run(2)
        assert history["id"].shape == (3, 7)
        assert np.isnan(history["id"][0, 4:]).all()
        assert history["id"][1, 4:].tolist() == [5.0, 6.0, 7.0]
        assert run.table("id")["robot"] == run.names


# ---- what scenarios may say


@pytest.mark.parametrize(
    ("coming", "wrong"),
    [
        ('at = "0s"', "at"),
        ("at = true", "at"),
        ('at = "1s"\nmost = 2', "the table has 3 robots: say at least as many"),
        ('at = "1s"\nstarts = [["1m", "1m", "0deg", "ada"], ["2m", "2m"], ["3m", "3m"]]', "leave their names out"),
        ('at = "1s"\nmost = 2000000', "most"),
    ],
)
def test_scenarios_say_what_is_wrong(coming: str, wrong: str) -> None:
    with pytest.raises(SettingsError, match=wrong):
        read_scenario(text(sort("sheep", 3, coming)))


def test_starts_on_each_other_are_refused_before_the_run() -> None:
    late = sort("sheep", 2, 'at = "1s"\nstarts = [["1m", "1m"], ["1.1m", "1m"]]', "bumpers = 1")
    with pytest.raises(MisuseError, match="their bodies overlap"):
        fleet(sort("dog", 1), late)


def test_a_run_with_added_robots_is_not_saved_as_a_test(tmp_path: Path) -> None:
    with fleet() as run:
        run.run(0.2)
        run.add_robot()
        run.run(0.2)
        with pytest.raises(MisuseError, match=re.escape("A robot was added by hand at 0.3 s, which a test cannot")):
            run.save_test(tmp_path / "saved")
