"""Several operators in a program's hands: as whom it sends, and that a mission of theirs leads where it leads alone."""

from __future__ import annotations

import pytest

import sleepcast as sc
from sleepcast.api.assembly import assemble
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.api.session_test import missed_in, sent_commands
from sleepcast.loop import Swarm
from sleepcast.simulator import MissionError, find_scenario
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


@pytest.mark.parametrize("do", ["send", "ask", "stop", "release"])
def test_nobody_sends_as_somebody_unknown(fleet: SimulatedFleet, do: str) -> None:
    given = {"send": ("(ST)",), "ask": ("x",)}.get(do, ())
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
