"""Robots that come and go: HATCH and DIE at the end of a tick, and what minds, bodies, radio and desk make of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sleepcast as sc
from cli.calling import called_warm
from machines import ALL
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.errors import SleepcastError
from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.bodies.population import MAX_CALLS
from sleepcast.simulator.engine import Machine, choose

HEAD = """
format = 2
title = "field"
seconds = "1min"

[world]
width = "20m"
height = "20m"
edge = "torus"

[neighbours]
reach = "3m"
shares = { fuel = "" }

[pings]
reach = "3m"

[radio]
delay = "0.25s"
{radio}

"""
SORT = """
[[robots]]
type = "{type}"
count = {count}
{hatch}

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "10m/s2"

[robots.body]
radius = "0.1m"

[robots.stores.energy]
start = ["40%", "80%"]
full = "100%"
"""
BREED = "(RULE breed (WHEN (PROB 0.03) (HATCH (IF (< id 7) sheep wolf) 1 0.5)))"
PASS = "(RULE pass (WHEN (PROB 0.03) (DIE)))"


def text(sheep: str = "hatch = true", wolves: str = "hatch = true", radio: str = "", more: str = "") -> str:
    sorts = SORT.format(type="sheep", count=6, hatch=sheep) + SORT.format(type="wolf", count=4, hatch=wolves)
    return HEAD.replace("{radio}", radio) + more + sorts


def swarm(seed: int = 1, machine: Machine | None = None, **changes: Any) -> Swarm:
    return Swarm(Simulator(read_scenario(text(**changes)), seed, machine))


def everybody(run: Swarm, *texts: str) -> None:
    for each in texts:
        run.fleet.evaluate(each, run.fleet.state.everybody())


def fleet(seed: int = 1, **changes: Any) -> SimulatedFleet:
    return sc.open(text(**changes), seed=seed)


def test_children_are_copies_of_their_parents_and_have_the_numbers_that_follow() -> None:
    run = swarm()
    everybody(run, "(DEFVAR age id)", "(RULE old (SETQ age (+ age 1)))", "(WHEN (< id 3) (JOIN elders))")
    run.run(0.3)
    parents = [run.minds["sheep2"], run.minds["sheep1"]]
    for parent in parents:  # whoever asks first, children come in the order of their parents
        assert parent.evaluate("(HATCH sheep 2 0.5)").value == 2.0
    energies = [parent.evaluate("energy").value for parent in parents]
    run.step()
    children = [run.minds[f"sheep{number}"] for number in (11, 12, 13, 14)]
    assert [child.number for child in children] == [11, 12, 13, 14]
    for child, parent in zip(children, [parents[1], parents[1], parents[0], parents[0]], strict=True):
        assert child.groups == parent.groups == {"elders"}
        assert [rule.text for rule in child.rules()] == [rule.text for rule in parent.rules()]
        for same in ("age", "x", "y", "heading"):
            assert child.evaluate(same).value == parent.evaluate(same).value
    halves = [energies[1] / 4, energies[1] / 4, energies[0] / 4, energies[0] / 4]
    assert [child.evaluate("energy").value for child in children] == halves
    assert [parent.evaluate("energy").value for parent in parents] == pytest.approx([energy / 2 for energy in energies])
    run.run(0.2)  # each goes on by itself
    assert len({mind.evaluate("(GAUSS 0 1)").value for mind in (*children, *parents)}) == 6
    assert len({mind.evaluate("x").value for mind in (*children, *parents)}) == 6


def test_without_a_share_children_have_as_much_as_their_parents() -> None:
    run = swarm()
    parent = run.minds["wolf1"]
    energy = parent.evaluate("energy").value
    parent.evaluate("(HATCH sheep 1)")
    run.step()
    assert [run.minds[name].evaluate("energy").value for name in ("wolf1", "sheep11")] == [energy, energy]


def test_a_robot_gives_its_young_no_more_than_it_has() -> None:
    run = swarm()
    energy = run.minds["sheep1"].evaluate("energy").value
    assert isinstance(energy, float)
    run.minds["sheep1"].evaluate("(PROGN (HATCH sheep 1 0.5) (HATCH sheep 7 1))")
    run.step()
    shared = [run.minds[name].evaluate("energy").value for name in ("sheep1", "sheep11", "sheep12")]
    assert shared == [0.0, energy / 2, pytest.approx(energy / 14)]


def test_what_was_given_away_is_not_copied_as_well() -> None:
    run = swarm()
    energy = run.minds["sheep1"].evaluate("energy").value
    assert isinstance(energy, float)
    run.minds["sheep1"].evaluate("(PROGN (HATCH sheep 1 0.75) (HATCH sheep 2) (HATCH sheep 1 0.5))")
    run.step()
    names = ("sheep1", "sheep11", "sheep12", "sheep13", "sheep14")
    found = [run.minds[name].evaluate("energy").value for name in names]
    assert found == [energy / 8, energy * 0.75, energy / 4, energy / 4, energy / 8]


def test_names_and_numbers_are_never_used_again_and_rows_are() -> None:
    run = swarm(sheep="hatch = true\nmost = 7")
    seen = {name: run.minds[name].number for name in run.fleet}
    for tick in range(40):
        run.minds[f"sheep{1 if tick == 0 else 10 + tick}"].evaluate("(PROGN (HATCH sheep 1) (DIE))")
        run.step()
        (name,) = [name for name in run.fleet if name not in seen]
        seen[name] = run.minds[name].number
    assert [*seen.values()] == [*range(1, 51)]
    assert len(run.fleet.names) == 7 + 16
    assert set(run.fleet) <= {*seen}


def test_runs_are_the_same_on_every_machine_and_number_of_threads() -> None:
    results = []
    for machine in (choose(machine.name, threads) for machine in ALL for threads in (1, 2)):
        run = swarm(machine=machine, radio="loss = 0.2")
        follow = "(RULE follow (WHEN (KNOWN (NEAREST_ID 3)) (GOTO (NEAREST_X 3) (NEAREST_Y 3))))"
        everybody(
            run, BREED, PASS, "(RULE paint (COLOUR id))", follow, "(RULE call (WHEN (PROB 0.05) (TELL (PING 1))))"
        )
        run.run(10)
        results.append((run.simulator.state_hash(), tuple(run.fleet), run.values_of("(+ id energy)").tobytes()))
    assert len(set(results)) == 1
    assert max(int(name.lstrip("shepwolf")) for name in results[0][1]) > 50


def test_more_than_there_is_room_for_is_a_fault() -> None:
    run = swarm(sheep="hatch = true\nmost = 8", wolves="")
    asked = {
        "(HATCH sheep 3)": "there is room for 2 more sheep, not for 3: see most in [robots]",
        "(HATCH wolf 1)": "HATCH",
        "(HATCH sheep 1.5)": "a whole number of children, 0 or more, not 1.5",
        "(HATCH sheep -1)": "a whole number of children, 0 or more, not -1",
        "(HATCH 1 1)": "wanted sheep, not 1",
        "(HATCH sheep 1 2)": "a share of each store from 0 to 1, not 2",
    }
    for form, why in asked.items():
        result = run.minds["wolf1"].evaluate(form)
        assert why in result.faults[0].reason
        assert result.value != result.value
    assert run.minds["wolf1"].evaluate("(HATCH sheep 0)").value == 0.0
    many = f"(DOTIMES (i {MAX_CALLS + 1}) (HATCH sheep 0))"
    assert not run.minds["wolf1"].evaluate(many).faults
    run.step()
    assert len([*run.fleet]) == 10


def test_parents_for_whose_children_others_have_taken_the_room_say_so() -> None:
    with fleet(sheep="hatch = true\nmost = 8") as run:
        run.run(1)
        run.send("(WHEN (< id 4) (HATCH sheep 1))")
        run.run(1)
        assert [report.robot for report in run.station.reports] == ["sheep3"]
        assert run.station.reports[0].body["label"] == "no room for its children"
        assert {"sheep11", "sheep12"} < {*run.names}
        assert len(run.names) == 12


def test_stopped_robots_neither_hatch_nor_die() -> None:
    with fleet() as run:
        run.run(1)
        run.stop()
        for form in ("(HATCH sheep 1)", "(DIE)"):
            sent = run.send(form, everybody=True)
            assert len(sent.account.fault) == 10
            assert "stopped" in next(iter(sent.account.faults.values()))
        assert len(run.names) == 10


@pytest.mark.parametrize(("minds", "left"), [("", 10), ("[minds]\ntells_hatch = true\n", 5)])
def test_robots_are_told_to_come_and_go_only_where_the_scenario_says_so(minds: str, left: int) -> None:
    with fleet(more=minds) as run:
        run.run(1)
        run.send("(DEFUN vanish () (DIE))", everybody=True)
        run.send("(WHEN (= id 1) (PROGN (TELL (WHEN (< id 4) (DIE))) (TELL (WHEN (> id 7) (vanish)))))")
        run.send("(WHEN (= id 2) (TELL (RULE go (DIE))))") if not minds else None
        run.run(2)
        assert len(run.names) == left


def test_only_those_are_expected_that_were_there_and_who_dies_is_not_waited_for() -> None:
    with fleet() as run:
        run.run(1)
        first = run.send("(WHEN (< id 3) (HATCH sheep 1))", wait=0)
        run.run(0.5)
        gone = run.send("(WHEN (> id 10) (DIE))", wait=0)  # they do, and then they have something to answer
        run.run(1)
        assert first.account.complete
        assert len(first.account.matched) == 2
        assert gone.account.matched == ("sheep11", "sheep12")
        run.swarm.minds["sheep1"].evaluate("(DIE)")
        late = run.send("(JOIN late)", everybody=True, wait=0)
        run.run(2)
        assert late.account.complete
        assert "sheep1" not in late.account.matched
        assert len(late.account.matched) == 9


def test_children_have_nothing_of_what_a_grant_has_made_of_their_parents() -> None:
    with fleet() as run:
        best = "(BEST 2 id (> id 0) (PROGN (JOIN red) (JOIN old) (RULE go (MARK))))"
        everybody(run.swarm, "(WHEN (= id 1) (JOIN old))")
        run.send(best, wait=0)
        run.run(2.5)
        minds = run.swarm.minds
        assert {name for name in run.swarm.fleet if "red" in minds[name].groups} == {"sheep1", "sheep2"}
        minds["sheep1"].evaluate("(HATCH sheep 2)")
        minds["sheep2"].evaluate("(PROGN (HATCH wolf 1) (DIE))")
        run.run(0.2)
        assert [minds[name].groups for name in ("sheep11", "sheep12", "wolf13")] == [{"old"}, {"old"}, set()]
        assert not any(minds[name].rules() for name in ("sheep11", "sheep12", "wolf13"))
        assert minds["sheep1"].groups == {"red", "old"}
        assert minds["sheep1"].rules()


def test_who_dies_before_an_instant_is_not_waited_for_and_children_do_nothing_at_it() -> None:
    with fleet() as run:
        later = run.send("(AFTER-ISSUE 2s (WHEN (> id 0) (JOIN red)))", wait=0)
        run.run(1)
        assert len(later.account.waiting) == 10
        run.swarm.minds["sheep1"].evaluate("(HATCH sheep 1)")
        run.swarm.minds["sheep2"].evaluate("(DIE)")
        run.run(2)
        assert later.account.complete
        assert len(later.account.matched) == 9
        assert not later.account.waiting
        assert "red" not in run.swarm.minds["sheep11"].groups


def test_what_was_on_the_way_to_a_robot_does_not_come_to_the_next_one_in_its_row() -> None:
    run = swarm(sheep="hatch = true\nmost = 7")
    run.minds["sheep1"].evaluate("(TELL (JOIN told))")
    run.step()
    run.minds["sheep2"].evaluate("(DIE)")
    run.step()  # the copies are still on the way
    run.minds["wolf1"].evaluate("(HATCH sheep 2)")
    run.step()
    assert run.minds["sheep11"].index == 1
    run.run(1)
    assert {name for name in run.fleet if "told" in run.minds[name].groups} == {*run.fleet} - {
        *("sheep1", "sheep11", "sheep12")
    }


def test_neighbours_are_those_that_are_there_by_their_numbers() -> None:
    run = swarm()
    population, bodies = run.simulator.population, run.simulator.bodies
    assert population is not None
    for index, name in enumerate(run.fleet):
        bodies.place(run.minds[name].index, 10.0 + 0.1 * index, 10.0, 0.0)
    run.minds["sheep2"].evaluate("(DIE)")
    run.minds["wolf4"].evaluate("(HATCH sheep 1)")
    run.step()
    run.sense()
    one = run.minds["sheep1"]
    assert one.evaluate("(COUNT 3)").value == 9.0
    assert one.evaluate("(NEAREST_ID 3)").value == 3.0
    assert one.evaluate("(COUNT-OVER (n 3) (= n 2))").value == 0.0
    assert one.evaluate("(SUM-OVER (n 3) n)").value == 3.0 + 4 + 5 + 6 + 7 + 8 + 9 + 10 + 11
    assert one.evaluate("(OF 11 x)").value == pytest.approx(one.evaluate("(OF 10 x)").value)
    assert np.isnan(one.evaluate("(OF 2 x)").value)
    assert np.isnan(one.evaluate("(OF 12 x)").value)


def test_a_robot_does_not_explain_what_another_one_did_in_its_row() -> None:
    with fleet(sheep="hatch = true\nmost = 7") as run:
        run.run(1)
        sent = run.send("(WHEN (= id 1) (DIE))", everybody=True)
        run.send("(WHEN (= id 2) (HATCH sheep 2))")
        run.run(1)
        assert run.swarm.minds["sheep11"].index == 0
        with pytest.raises(SleepcastError, match="sheep11 was not there yet when this command was sent"):
            run.why("sheep11", sent)
        assert "id" in str(run.why("sheep2", sent))


def test_tables_and_histories_have_those_that_are_there() -> None:
    with fleet() as run:
        history = run.history("id", every=1)
        run.run(1)
        run.send("(WHEN (= id 1) (DIE))", wait=0)
        run.send("(WHEN (= id 2) (HATCH wolf 1))", wait=0)
        run.run(1)
        assert run["id"].tolist() == [2, 3, 4, 5, 6, 7, 8, 9, 10, 11]
        assert run.names[-1] == "wolf11"
        assert len(run.x) == len(run.stopped) == 10
        assert run.table("id")["robot"] == run.names
        assert history["id"].shape == (3, 11)
        assert history.names[-1] == "wolf11"
        assert np.isnan(history["id"][2, 0])
        assert np.isnan(history["id"][1, 10])
        assert history["id"][2, 10] == 11
        assert len(history.table()) == 30


def test_previews_ask_before_robots_are_gone_for_good() -> None:
    with fleet() as run:
        run.run(1)
        run.send("(WHEN (= id 1) (DIE))")
        preview = run.preview("(WHEN (< id 4) (DIE))")
        assert preview.yes == ("sheep2", "sheep3")
        assert len(preview.no) == 7
        assert not preview.unknown


@pytest.mark.parametrize(
    ("sheep", "wrong"),
    [
        ("most = 3", "the table has 6 robots"),
        ("hatch = true\nmost = 3", "the table has 6 robots"),
        ("hatch = 1", "true or false"),
        ("hatch = true\nmost = 2000000", "most"),
    ],
)
def test_scenarios_say_what_is_wrong_with_their_bounds(sheep: str, wrong: str) -> None:
    with pytest.raises(SettingsError, match=wrong):
        read_scenario(text(sheep=sheep))


def test_children_have_the_values_of_the_group_of_their_sort() -> None:
    group = "\n[robots.groups.{name}]\ncount = {count}\nvalues = {{ caste = {caste} }}\n"
    sorts = [
        SORT.format(type=type, count=count, hatch="hatch = true").replace(f"count = {count}\n", "")
        + group.format(name=f"{type}s", count=count, caste=caste)
        for type, count, caste in (("sheep", 6, 1), ("wolf", 4, 2))
    ]
    run = Swarm(Simulator(read_scenario(HEAD.replace("{radio}", "") + "".join(sorts))))
    assert [run.evaluate(name, "caste").value for name in run.fleet] == [1.0] * 6 + [2.0] * 4
    run.minds["wolf1"].evaluate("(PROGN (HATCH sheep 1) (HATCH wolf 1))")
    run.step()
    assert [run.evaluate(name, "caste").value for name in ("sheep11", "wolf12")] == [1.0, 2.0]


def test_a_run_that_is_put_away_goes_on_to_the_last_bit() -> None:
    with fleet(radio="loss = 0.1", seed=3) as run, fleet(radio="loss = 0.1", seed=3) as other:
        for each in (run, other):
            each.run(1)
            each.send("(RULE breed (WHEN (PROB 0.05) (HATCH (IF (< id 7) sheep wolf) 1 0.5)))", everybody=True)
            each.send('(RULE pass (WHEN (PROB 0.05) (PROGN (REPORT "bye" id) (DIE))))', everybody=True)
            each.run(6)
        asked = [each.send("(WHEN (> energy 10%) (JOIN rich))", wait=0) for each in (run, other)]
        for each in (run, other):
            each.run(0.3)
        with sc.resume(run.snapshot()) as gone_on:
            assert gone_on.names == run.names
            for each in (gone_on, other):
                each.run(5)
            assert gone_on.hash == other.hash
            assert gone_on.names == other.names
            assert gone_on["(+ id energy)"].tobytes() == other["(+ id energy)"].tobytes()
            kept, wanted = gone_on.station.accounting(asked[0].id), asked[1].account
            assert (kept.matched, kept.silent) == (wanted.matched, wanted.silent)
            reports = [[report.robot for report in each.station.reports] for each in (gone_on, other)]
            assert reports[0] == reports[1]


def test_a_run_does_not_grow_by_births_and_deaths() -> None:
    with fleet(sheep="hatch = true\nmost = 12") as run:
        run.run(1)
        run.send("(RULE live (PROGN (HATCH sheep 1) (DIE)))", only=[f"sheep{number}" for number in range(1, 7)])
        sizes = []
        for _ in range(2):
            run.run(8)
            sizes.append(len(run.snapshot()))
        assert max(int(name.lstrip("shepwolf")) for name in run.names) > 900
        assert sizes[1] < 1.02 * sizes[0]
        assert (len(run.names), len(run.swarm.fleet.minds)) == (10, 2)


def test_when_all_robots_are_gone_nobody_is_asked_and_nobody_known() -> None:
    with fleet() as run:
        history = run.run(1).history("(FLOOR x)", every=0.5)
        run.send("(WHEN (> id 0) (DIE))")
        run.run(1)
        assert (len(run), run["(+ id x)"].tolist(), history.table()["robot"][-1]) == (0, [], "wolf4")
        with pytest.raises(SleepcastError, match='there is no robot "wolf4" among the 0 on the roster'):
            run.send("(JOIN a)", only="wolf4")
        assert not run.stop().account.silent
        assert not run.send("(WHEN (> id 0) (JOIN a))").account.matched


def test_worlds_at_once_come_to_the_same_as_each_alone() -> None:
    def lived(run: Any) -> None:
        run.run(1, quiet=True)
        for each in (BREED, PASS):
            run.send(each, everybody=True, wait=0)
        run.run(5, quiet=True)

    alone = []
    for seed in (1, 2):
        with fleet(seed=seed) as run:
            lived(run)
            alone.append((run.hash, tuple(run.names)))
    with sc.open_many(text(), seeds=[1, 2]) as worlds:
        lived(worlds)
        names = [name for _, each in alone for name in each]
        assert [*worlds.table("id")["robot"]] == names
        assert f"2 worlds with {len(names)} robots" in repr(worlds)
        assert [(world.hash, tuple(world.names)) for world in worlds] == alone


def test_recorded_runs_are_verified(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with fleet() as run, run.record(file):
        run.run(1)
        for each in (BREED, PASS):
            run.send(each, everybody=True)
        run.run(5)
    verified = called_warm("replay", str(file), "--verify")
    assert (verified.status, "the same to the last bit" in verified.out) == (0, True)
