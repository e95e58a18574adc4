"""Several operators in a program's hands: as whom it sends, and that a mission of theirs leads where it leads alone."""

from __future__ import annotations

from pathlib import Path

import pytest

import sleepcast as sc
from sleepcast.api.assembly import assemble
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.api.session_test import missed_in, sent_commands
from sleepcast.experiments.acceptance import read_test, run_test
from sleepcast.loop import Swarm
from sleepcast.simulator import MissionError, find_scenario
from sleepcast.simulator.recording.recording import load_recording
from sleepcast.station import Station

WEST = "(WHEN (<= id 6) (JOIN west))"
DRIVE = "(WHEN (IN west) (DRIVE 1m/s 10deg/s))"


@pytest.fixture
def fleet() -> SimulatedFleet:
    return sc.open("two-desks")


def accounts(swarm: Swarm, station: Station) -> list[tuple[str, str, dict[str, object]]]:
    found = sent_commands(swarm, station)
    return [(desk.operator, each.text, desk.accounting(each.id).to_dict()) for desk, each in found]


def test_a_mission_of_several_is_played_as_it_runs_by_itself(fleet: SimulatedFleet) -> None:
    swarm, chief = assemble(find_scenario("two-desks"), None, mission=True)
    swarm.run(50.0)
    by_itself, by_hand = sc.open("two-desks", mission=True), fleet
    by_itself.run(50, quiet=True)
    sent = by_hand.play(wait=0)
    assert len(sent) == len(by_hand.mission) - 3  # HOLD twice and AWAY once say nothing
    by_hand.run(50 - by_hand.time, quiet=True)
    for each in (by_itself, by_hand):
        assert each.hash == swarm.simulator.state_hash()
        assert not missed_in(each.swarm, each.station)
        assert not each.mission.rest
        assert not [said for line in each.mission for said in line.unmet]
        assert [each.by for each in sent] == [command.message.sender for _, command in sent_commands(swarm, chief)]
    assert accounts(by_hand.swarm, by_hand.station) == accounts(swarm, chief)


def test_it_is_said_who_sends(fleet: SimulatedFleet) -> None:
    assert fleet.operators == {"chief": "commander", "anna": "operator", "bert": "operator"}
    assert next(iter(fleet.operators)) == fleet.send(WEST).by
    fleet.play("@1s as anna lease take west", wait=0).pop()
    fleet.run(1, quiet=True)
    mine, refused = fleet.send(DRIVE, by="anna"), fleet.send(DRIVE, by="bert")
    assert (mine.by, len(mine.matched), refused.by, len(refused.fault)) == ("anna", 6, "bert", 6)
    assert "anna" in next(iter(refused.account.faults.values()))
    assert fleet.why("rover1", mine).verdict
    fleet.run(3, quiet=True)
    assert (fleet["speed"][:6] > 0.5).all()  # whoever sends by hand is there
    assert fleet.ask("speed", by="bert").values["rover1"]
    assert len(fleet.stop(by="bert").matched) == 12
    assert len(fleet.release(by="bert").matched) == 12


def test_the_desk_of_each_previews(fleet: SimulatedFleet) -> None:
    fleet.run(1, quiet=True)
    assert len(fleet.preview("(<= id 6)", by="bert").yes) == 6
    assert fleet.preview(DRIVE, by="anna").no == fleet.preview(DRIVE).no
    assert not any(desk.holding for desk in map(fleet.desk_of, fleet.operators)), "nobody sits down for it"


@pytest.mark.parametrize("by_itself", [False, True])
def test_a_saved_test_repeats_what_all_have_sent(tmp_path: Path, by_itself: bool) -> None:
    fleet = sc.open("two-desks", mission=by_itself)
    if by_itself:
        fleet.run(50, quiet=True)
    else:
        fleet.play(wait=0)
        fleet.send(DRIVE, by="anna")
        fleet.run(5, quiet=True)
    saved = fleet.save_test(tmp_path / "again", exact=True)
    verdict = run_test(read_test(saved))
    assert (verdict.missed, verdict.state) == ((), fleet.hash)
    counts = [each["matched"] for each in verdict.counts if each]
    if by_itself:
        assert "own_mission = true" in (saved / "test.toml").read_text()
    else:
        assert counts == [
            len(desk.accounting(each.id).matched) for desk, each in sent_commands(fleet.swarm, fleet.station)
        ]
        mission = (saved / "mission.sleep").read_text()
        for words in ("s as anna lease take west for 15.0s\n= ", "s as anna HOLD\n", "s as anna AWAY\n", "s HOLD\n"):
            assert words in mission
        assert "s as chief" not in mission, "the first one is not named"
        assert (mission.count("as anna HOLD"), mission.count("as anna AWAY")) == (2, 1)


@pytest.fixture
def lossy() -> SimulatedFleet:
    return sc.open("two-desks", robots=40, over={"radio.loss": "40%"}).run(1, quiet=True)


def test_any_of_them_releases_whom_another_has_stopped(fleet: SimulatedFleet) -> None:
    """As on the air, where a desk looks whose STOPs hold the robots before it releases them."""
    fleet.run(1, quiet=True)
    fleet.stop(by="anna")
    assert len(fleet.release(by="chief").matched) == 12
    assert not fleet.stopped.any()


def test_a_script_says_whether_a_release_is_for_the_stops_of_all(fleet: SimulatedFleet) -> None:
    fleet.play("@1s as anna STOP\n@3s as bert RELEASE")
    assert fleet.stopped.all()
    fleet.play("@6s as bert RELEASE ALL")
    assert not fleet.stopped.any()


def test_a_stop_that_was_released_by_another_is_not_repeated(lossy: SimulatedFleet) -> None:
    """It would stop those that have missed it."""
    assert lossy.stop(by="anna", wait=0.3).account.n_silent
    lossy.release(by="bert", wait=0.0)
    lossy.run(6, quiet=True)
    assert not lossy.stopped.any()


def test_a_saved_test_repeats_a_release_of_all(lossy: SimulatedFleet, tmp_path: Path) -> None:
    lossy.stop(by="anna", wait=0.3)
    lossy.release(by="bert", wait=0.7)
    lossy.send("(DRIVE 1m/s 0deg/s)", by="bert", everybody=True, wait=0.2)
    lossy.stop(by="bert", wait=3.0)
    lossy.release(by="bert", wait=3.0)
    lossy.stop(by="anna", wait=0.0)
    lossy.run(2, quiet=True)
    saved = lossy.save_test(tmp_path / "again", exact=True)
    mission = (saved / "mission.sleep").read_text()
    assert mission.count("s as bert RELEASE ALL\n= ") == 2
    verdict = run_test(read_test(saved))
    assert (verdict.missed, verdict.state) == ((), lossy.hash)


def test_a_recording_holds_the_accounts_of_all(fleet: SimulatedFleet, tmp_path: Path) -> None:
    with fleet.record(tmp_path / "run.mcap"):
        fleet.send(WEST)
        fleet.send("(WHEN (> id 6) (MARK))", by="bert")
        fleet.run(1, quiet=True)
    recorded = load_recording(tmp_path / "run.mcap").accounting
    assert {each: account["matched"] for each, account in recorded.items()} == {
        command.id: 6 for command in fleet.swarm.commands()
    }


@pytest.mark.parametrize("do", ["send", "preview", "ask", "stop", "release"])
def test_nobody_sends_as_somebody_unknown(fleet: SimulatedFleet, do: str) -> None:
    given = {"send": ("(ST)",), "preview": ("(ST)",), "ask": ("x",)}.get(do, ())
    with pytest.raises(sc.errors.MisuseError, match=r"no operator ana.*did you mean anna.*chief, anna, bert"):
        getattr(fleet, do)(*given, by="ana")
    assert not fleet.station.commands()


def test_a_script_is_refused_by_the_line_of_somebody_unknown(fleet: SimulatedFleet) -> None:
    with pytest.raises(MissionError, match=r"the script:2: no operator ana.*did you mean anna"):
        fleet.play("@1s (WHEN (> id 99) (ST))\n@2s as ana (WHEN (> id 99) (ST))")
    assert not fleet.station.commands()
    with pytest.raises(sc.errors.MisuseError, match="by whom"):
        fleet.send("@1s (ST)", by="anna")


def test_where_nobody_is_named_nobody_is_asked_for() -> None:
    alone = sc.open("stop")
    assert alone.operators == {}
    with pytest.raises(sc.errors.MisuseError, match="no operator anna: nobody is named in this run"):
        alone.send("(ST)", by="anna")
