"""An instant for all in simulated swarms, whose clocks are equal: heard late or not, all obey in one tick."""

from __future__ import annotations

from pathlib import Path

import pytest

import sleepcast as sc
from loop.test_auctions import desks, members, swarm_in
from sleepcast.api.assembly import assemble_from
from sleepcast.core.errors import MisuseError
from sleepcast.loop import resume, snapshot
from sleepcast.loop.quiet import QuietTicks
from sleepcast.loop.rerun import InputLog, Rerun
from sleepcast.loop.snapshots import copy_of
from sleepcast.station.sent import SILENT

RADIO = "loss = 0.3\njitter = '0.5s'"
START = "(AFTER-ISSUE 3s (WHEN (> id 6) (PROGN (JOIN red) (SETQ drive_speed 1))))"
LATER = ["rover7", "rover8", "rover9", "rover10", "rover11", "rover12"]


def test_all_robots_obey_in_one_tick_however_late_they_have_heard_it(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path, RADIO)
    sent = chief.send(START)
    counts = set()
    for _ in range(60):
        swarm.step()
        counts.add(len(members(swarm)))
        if len(members(swarm)):
            assert swarm.simulator.time >= 2.95
    account = chief.accounting(sent.id)
    assert counts == {0, len(members(swarm))}
    assert {*account.matched} <= {*members(swarm)}
    assert account.bound == pytest.approx(0.05)


@pytest.mark.parametrize("seconds", [0.6, 2.9, 3.1])
def test_a_swarm_goes_on_from_a_snapshot_with_what_waits(tmp_path: Path, seconds: float) -> None:
    swarm, chief, _ = swarm_in(tmp_path, RADIO)
    chief.send(START)
    swarm.run(seconds)
    again, _ = assemble_from(snapshot(swarm), None)
    seen = []
    for each in (swarm, again):
        history = []
        for _ in range(30):
            each.step()
            history.append((members(each), desks(each)[0].accounting(chief.commands()[0].id).sentence()))
        seen.append((history, each.simulator.state_hash()))
    assert seen[0] == seen[1]
    assert seen[0][0][-1][0]


def test_a_run_again_is_the_same_run_also_on_quiet_ticks_and_beside_others(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    log = InputLog(swarm)
    swarm.witnesses.append(log)
    start = copy_of(swarm).packed()
    chief.send(START)
    for _ in range(50):
        swarm.step()
    again = Rerun(resume(start), log.inputs)
    while again.tick < 50:
        again.step()
    both = [swarm_in(tmp_path) for _ in range(2)]
    for _, desk, _ in both:
        desk.send(START)
    both[0][0].run(5)
    QuietTicks([both[1][0]]).step(50)
    swarms = [swarm, again.swarm, *(each for each, _, _ in both)]
    assert [members(each) for each in swarms] == [LATER] * 4
    assert len({each.simulator.state_hash() for each in swarms}) == 1


def test_the_account_goes_back_to_who_waited_then(tmp_path: Path) -> None:
    swarm, chief, _ = swarm_in(tmp_path)
    sent = chief.send(START)
    swarm.run(5)
    assert chief.accounting(sent.id).n_matched == 6
    assert (sent.answers.codes_at(1.0) != SILENT).all()
    chief.go_back(1.0)
    assert (chief.accounting(sent.id).n_waiting, chief.accounting(sent.id).n_silent) == (12, 0)


def test_python_sends_a_command_for_an_instant_of_the_run() -> None:
    fleet = sc.open("bravo", robots=3, seed=1)
    fleet.run(1)
    sent = fleet.send("(MARK)", everybody=True, at="4s")
    assert (len(sent.waiting), sent.instant) == (3, pytest.approx(4.0))
    fleet.run(5)
    assert len(sent.matched) == 3
    with pytest.raises(MisuseError, match=r"wanted one within the next 1 h"):
        fleet.send("(MARK)", everybody=True, at=2.0)


def test_an_explanation_tells_how_many_commands_a_robot_has_discarded() -> None:
    with sc.open("bravo", robots=3, seed=1) as fleet:
        for wait in (20, 30):
            fleet.send(f"(AFTER-ISSUE {wait}s (WHEN (> id 1) (MARK)))", wait=0)
        fleet.run(1)
        sent = fleet.send("(WHEN (> id 1) (+ (ABS -1) (CANCEL)))")
        why = fleet.why(sent.matched[0], sent.id)
        assert (sent.values[sent.matched[0]], why.value) == (3.0, 3.0)
        assert fleet.why(sent.matched[0], sent.id).root.children[1].children[1].value == 2.0
