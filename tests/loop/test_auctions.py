"""BEST and QUORUM in simulated swarms: bids and grants go over the simulated radio, with its losses."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import pytest

from sleepcast.api.assembly import assemble, assemble_from
from sleepcast.api.session_test import as_now, orders_of
from sleepcast.channel.message import Kind, LeaseAction
from sleepcast.loop import Swarm, resume, snapshot
from sleepcast.loop.quiet import QuietTicks
from sleepcast.loop.rerun import InputLog, Rerun
from sleepcast.loop.snapshots import copy_of
from sleepcast.mind.auction import AuctionStatus
from sleepcast.simulator import load
from sleepcast.station import Command, Station

WORLD = """
format = 1
title = "an auction"
seconds = "1min"
seed = 5
tick = "0.1s"
[world]
width = "100m"
height = "100m"
[robots]
type = "rover"
count = 12
motion = "still"
[robots.limits]
speed = "2m/s"
turn_rate = "45deg/s"
acceleration = "1m/s2"
[robots.body]
radius = "0.4m"
[operators.chief]
role = "commander"
[operators.anna]
role = "operator"
"""
BEST = "(BEST 3 (ABS (- id 6.2)) (> id 0) (PROGN (JOIN red) (SETQ drive_speed 1)))"
NEAREST = ["rover5", "rover6", "rover7"]


def swarm_in(folder: Path, radio: str = "") -> tuple[Swarm, Station, Station]:
    file = folder / "scenario.toml"
    file.write_text(f"{WORLD}[radio]\ndelay = '50ms'\n{radio}\n", encoding="utf-8")
    swarm, chief = assemble(load(file), None, mission=False)
    return swarm, chief, desks(swarm)[1]


def desks(swarm: Swarm) -> list[Station]:
    return cast("list[Station]", swarm.desks)


def members(swarm: Swarm, group: str = "red") -> list[str]:
    return [name for name, view in swarm.fleet.items() if group in view.groups]


def status_of(desk: Station, sent: Command) -> AuctionStatus:
    status = desk.accounting(sent.id).auction
    assert status is not None
    return status


def test_the_robots_of_the_least_cost_obey_for_as_long_as_the_desk_keeps_them(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    sent = chief.send(BEST)
    swarm.run(2.5)
    assert members(swarm) == NEAREST
    account = chief.accounting(sent.id)
    assert (account.n_matched, account.n_not_matched, account.n_silent) == (3, 9, 0)
    assert "12 bids; chosen rover6 (0.2), rover7 (0.8), rover5 (1.2)" in account.sentence()
    assert swarm.fleet["rover1"].why(sent.id).value == pytest.approx(5.2)
    swarm.run(20)
    assert members(swarm) == NEAREST
    chief.auctions.end()
    swarm.run(4.5)
    assert members(swarm) == []
    assert swarm.fleet.bids.busy == []


@pytest.mark.parametrize("text", ["(BEST 3 id TRUE (JOIN red))", "(QUORUM 2 3 TRUE (JOIN red) :window 3s)"])
def test_there_are_never_more_members_than_places_in_any_tick(tmp_path: Path, text: str) -> None:
    swarm, chief, _ = swarm_in(tmp_path, "loss = 0.5\njitter = '0.4s'\nduplication = 0.2")
    sent = chief.send(text, deadline=60.0)
    counts = []
    for _ in range(300):
        swarm.step()
        counts.append(len(members(swarm)))
    assert max(counts) == 3
    assert counts.count(3) > 100
    assert status_of(chief, sent).started


@pytest.mark.parametrize("who", [0, 1])
def test_a_stop_of_any_desk_ends_bids_and_grants_and_release_brings_none_back(tmp_path: Path, who: int) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    chief.send(BEST)
    swarm.run(1.5)
    bidding = chief.send("(BEST 3 id TRUE (JOIN blue))")
    swarm.run(0.5)
    desks(swarm)[who].stop()
    swarm.run(0.5)
    assert members(swarm) == members(swarm, "blue") == []
    faults = {answer.fault for answer in chief.accounting(bidding.id).answers.values()}
    assert faults == {"STOP has ended its bid"}
    chief.release_all()
    swarm.run(3)
    assert not swarm.fleet.stopped.any()
    assert members(swarm) == members(swarm, "blue") == []


def test_two_desks_are_two_auctions_and_leases_of_groups_hold(tmp_path: Path) -> None:
    swarm, chief, anna = swarm_in(tmp_path)
    swarm.fleet.evaluate("(JOIN west)", [5, 6])
    anna.lease(LeaseAction.TAKE, "west", 60.0)
    swarm.run(0.5)
    hers, his = anna.send(BEST.replace("red", "blue")), chief.send(BEST)
    refused = anna.send("(BEST 1 id TRUE (RULE shine (MARK)))")
    swarm.run(2)
    assert members(swarm, "blue") == NEAREST
    assert members(swarm) == ["rover4", "rover5", "rover8"]
    assert set(chief.accounting(his.id).fault) == {"rover6", "rover7"}
    assert status_of(anna, hers).bids.keys() == set(swarm.fleet.names)
    assert anna.accounting(refused.id).n_fault == 12


def test_ticks_are_quiet_again_when_nobody_bids(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    swarm.run(2)
    before = swarm.quiet.ticks
    sent = chief.send("(BEST 3 id TRUE 1 :lease 1s)")
    swarm.run(2)
    assert status_of(chief, sent).members == ("rover1", "rover2", "rover3")
    chief.auctions.end()
    swarm.run(3)
    between = swarm.quiet.ticks
    swarm.run(5)
    assert (before > 0) == (swarm.quiet.ticks - between > 30)


@pytest.mark.parametrize("seconds", [0.6, 1.1, 5.0])
def test_a_swarm_goes_on_from_a_snapshot_with_its_auctions(tmp_path: Path, seconds: float) -> None:
    swarm, chief, _ = swarm_in(tmp_path, "loss = 0.3\njitter = '0.2s'")
    chief.send(BEST, deadline=30.0)
    swarm.run(seconds)
    again, _ = assemble_from(snapshot(swarm), None)
    seen = []
    for each in (swarm, again):
        history = []
        for _ in range(60):
            each.step()
            history.append((members(each), desks(each)[0].accounting(chief.commands()[0].id).sentence()))
        seen.append((history, each.simulator.state_hash(), each.measures()))
    assert seen[0] == seen[1]
    assert len(seen[0][0][-1][0]) == 3


def test_a_run_again_is_the_same_run(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path, "loss = 0.3")
    log = InputLog(swarm)
    swarm.witnesses.append(log)
    start = copy_of(swarm).packed()
    chief.send(BEST, deadline=30.0)
    for _ in range(50):
        swarm.step()
    again = Rerun(resume(start), log.inputs)
    while again.tick < 50:
        again.step()
    assert members(again.swarm) == members(swarm) != []
    assert again.swarm.simulator.state_hash() == swarm.simulator.state_hash()


def test_swarms_that_run_together_choose_as_each_does_alone(tmp_path: Path) -> None:
    seen = []
    for together in (False, True):
        swarms = [swarm_in(tmp_path, f"loss = {loss}") for loss in (0.0, 0.3)]
        for _, chief, _ in swarms:
            chief.send(BEST, deadline=30.0)
        if together:
            QuietTicks([swarm for swarm, _, _ in swarms]).step(40)
        else:
            for swarm, _, _ in swarms:
                swarm.run(4)
        seen.append([(members(swarm), swarm.measures(), chief.commands()[0].id) for swarm, chief, _ in swarms])
    assert seen[0] == seen[1]
    assert seen[0][0][0] == NEAREST


@pytest.mark.parametrize(("back", "chosen"), [(0.5, []), (3.0, NEAREST)])
def test_a_run_that_goes_on_from_an_earlier_moment_keeps_who_was_chosen_then(
    tmp_path: Path, back: float, chosen: list[str]
) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    sent = chief.send(BEST, deadline=30.0)
    swarm.run(back)
    earlier = copy_of(swarm).packed()
    assert members(swarm) == chosen
    swarm.run(20)
    known = chief.state()
    past, desk = assemble_from(earlier, None)
    desk.restore(known)
    desk.go_back(past.now())
    for _ in range(150):
        past.step()
        assert len(members(past)) <= 3
        assert set(members(past)) >= set(chosen)
    assert members(past) == NEAREST
    assert status_of(desk, sent).members == ("rover6", "rover7", "rover5")
    assert len(status_of(desk, sent).bids) == 12


# ---- robots that call


CALL = "(WHEN (= id 1) (RULE call (TELL `(BEST 3 (ABS (- id (+ ,id 5.2))) (< id 12) (JOIN red)))))"


def test_a_robot_chooses_for_as_long_as_it_tells_so(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    chief.send(CALL)
    swarm.run(2.5)
    assert members(swarm) == NEAREST
    assert [report.body["label"] for report in chief.reports] == [], "telling it in each tick is not too often"
    swarm.run(20)
    assert members(swarm) == NEAREST
    chief.send("(WHEN (= id 1) (FORGET call))")
    swarm.run(10)
    assert members(swarm) == []
    assert swarm.fleet.bids.busy == []


def test_who_is_lost_is_replaced_and_may_be_chosen_again(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path, "reach = '30m'")
    x, y = swarm.simulator.x, swarm.simulator.y
    x[:], y[:] = 50.0, 50.0
    chief.send(CALL)
    swarm.run(2.5)
    assert members(swarm) == NEAREST
    x[6] = 95.0
    swarm.run(8)
    assert members(swarm) == ["rover5", "rover6", "rover8"]
    x[4], x[6] = 95.0, 50.0
    swarm.run(8)
    assert members(swarm) == ["rover6", "rover7", "rover8"]


@pytest.mark.parametrize("loss", [0.0, 0.5])
def test_a_robot_never_has_more_than_it_wants(tmp_path: Path, loss: float) -> None:
    swarm, chief, _ = swarm_in(tmp_path, f"loss = {loss}\njitter = '0.3s'\nduplication = 0.2")
    for _ in range(8):
        chief.send(CALL)
    counts = []
    for tick in range(400):
        if tick % 100 == 99:  # it stops telling, and begins again
            swarm.fleet.evaluate("(FORGET call)" if tick % 200 == 99 else CALL, [0])
        swarm.step()
        counts.append(len(members(swarm)))
    assert max(counts) == 3
    assert counts.count(3) > 80


def test_a_stop_ends_what_a_robot_calls_and_it_calls_anew_after_release(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    chief.send(CALL)
    swarm.run(2.5)
    chief.stop()
    swarm.run(1)
    assert members(swarm) == []
    swarm.run(5)
    assert members(swarm) == []
    chief.release_all()
    swarm.run(6)
    assert members(swarm) == NEAREST


@pytest.mark.parametrize("seconds", [0.7, 1.6, 6.0])
def test_a_swarm_goes_on_from_a_snapshot_with_what_robots_call(tmp_path: Path, seconds: float) -> None:
    swarm, chief, _ = swarm_in(tmp_path, "loss = 0.3\njitter = '0.2s'")
    for _ in range(5):
        chief.send(CALL)
    swarm.run(seconds)
    again, _ = assemble_from(snapshot(swarm), None)
    seen = []
    for each in (swarm, again):
        history = []
        for _ in range(60):
            each.step()
            history.append(members(each))
        seen.append((history, each.measures()))
    assert seen[0] == seen[1]
    assert len(seen[0][0][-1]) == 3


def test_a_quorum_that_is_told_waits_until_there_are_enough(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    chief.send("(WHEN (= id 1) (RULE call (TELL (QUORUM 2 3 marked (JOIN red)))))")
    swarm.fleet.evaluate("(MARK)", [6])
    swarm.run(5)
    assert members(swarm) == []
    swarm.fleet.evaluate("(MARK)", [3])
    swarm.run(3)
    assert members(swarm) == ["rover4", "rover7"]
    swarm.fleet.evaluate("(MARK)", [2, 8, 9])
    swarm.run(4)
    assert members(swarm) == ["rover3", "rover4", "rover7"]


@pytest.mark.parametrize("text", ["(LEAVE red)", "(FREEZE)", "(SLEEP)"])
def test_who_leaves_by_itself_or_rests_makes_way(tmp_path: Path, text: str) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    chief.send(CALL.replace("(< id 12)", "(NOT marked)"))
    swarm.run(2.5)
    assert members(swarm) == NEAREST
    swarm.fleet.evaluate(f"(PROGN (MARK) {text})", [5])
    swarm.run(3.5)
    assert members(swarm) == ["rover5", "rover7", "rover8"]
    swarm.fleet.evaluate("(PROGN (UNMARK) (WAKE) (THAW))", [5])
    swarm.run(2)
    assert members(swarm) == ["rover5", "rover7", "rover8"], "all places are taken"


def test_a_test_of_a_run_holds_the_commands_and_not_what_a_desk_says_of_them(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    log = InputLog(swarm)
    swarm.witnesses.append(log)
    sent = chief.send(BEST, deadline=30.0)
    swarm.run(5)
    assert {message.kind for _, message in log.inputs.posted} == {Kind.COMMAND, Kind.REQUEST}
    orders = orders_of(swarm, chief, log.inputs, as_now)
    assert [each.id for each in orders] == [sent.id]
