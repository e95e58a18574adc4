"""Two operators and a commander in one run: each has an account, and all that the mission wants comes true."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import pytest

from sleepcast.api.assembly import assemble, assemble_from
from sleepcast.api.session_test import counts_of, unmet
from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm, snapshot
from sleepcast.mind.authority import AT_REST
from sleepcast.simulator import MissionError, find_scenario, load, parse_mission
from sleepcast.simulator.scenario.mission import Instruction, instruction, written_mission
from sleepcast.simulator.scenario.scenario import GALLERY
from sleepcast.station import Station

TEXT = (
    'format = 1\ntitle = "t"\nseconds = "5s"\n[world]\nwidth = "50m"\nheight = "50m"\n'
    '[robots]\ntype = "rover"\ncount = 2\n[robots.limits]\nspeed = "2m/s"\nturn_rate = "45deg/s"\n'
    'acceleration = "1m/s2"\n[robots.body]\nradius = "0.4m"\n'
)
OPERATORS = '[operators.anna]\nrole = "operator"\n[operators.bert]\nrole = "operator"\n'


def desks(swarm: Swarm) -> dict[str, Station]:
    return {desk.operator: desk for desk in cast("list[Station]", swarm.desks)}


def accounts(swarm: Swarm) -> list[object]:
    found = desks(swarm)
    return [desk.accounting(each.id).to_dict() for desk in found.values() for each in desk.commands()]


def test_what_the_mission_wants_comes_true_also_of_a_run_that_goes_on_from_a_snapshot() -> None:
    swarm, _ = assemble(find_scenario("two-desks"), None, mission=True)
    swarm.run(20.6)  # anna's desk is silent, and what she drives still moves
    again, _ = assemble_from(snapshot(swarm), None)
    for each in (swarm, again):
        each.run(29.4)
        found = desks(each)
        sent = {command.id: desk for desk in found.values() for command in desk.commands()}
        assert len([order for order, _ in each.given if order.wanted]) == 13
        for order, number in each.given:
            if not number:
                assert order.text.endswith(("HOLD", "AWAY"))  # which say nothing, so nobody counts
                continue
            assert not unmet(order, counts_of(sent[number].accounting(number)))
        for desk in found.values():  # all operators hear what robots report
            assert {report.robot for report in desk.reports if report.body["label"] == AT_REST} == {
                f"rover{number}" for number in range(1, 7)
            }
    assert again.simulator.state_hash() == swarm.simulator.state_hash()
    assert accounts(again) == accounts(swarm)


def test_each_desk_counts_its_own_commands_over_a_radio_that_loses_them(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(f'{TEXT}{OPERATORS}[radio]\nloss = "30%"\nrate = 20\n', encoding="utf-8")
    swarm, _ = assemble(load(tmp_path), None, mission=False)
    found = desks(swarm)
    for name, desk in found.items():
        desk.send(f"(DEFVAR of_{name} 1)", everybody=True)
        desk.ask("x")
    swarm.run(5.0)
    assert [[command.message.sender for command in desk.commands()] for desk in found.values()] == [
        ["anna"] * 2,
        ["bert"] * 2,
    ]
    assert swarm.radio.counts.lost
    again, _ = assemble_from(snapshot(swarm), None)
    assert accounts(again) == accounts(swarm)


@pytest.mark.parametrize(
    ("more", "wrong"),
    [
        ('[minds]\nlease = "1s"\n', r"name \[operators\] first"),
        ('[operators.anna]\nrole = "boss"\n', "role"),
        ('[operators.rover1]\nrole = "operator"\n', "a robot is called like this"),
        (OPERATORS + '[minds]\nlease = "0.01s"\n', "lease"),
        (OPERATORS + '[minds]\ntells = "some"\n', "tells"),
    ],
)
def test_settings_that_mean_nothing_are_refused(tmp_path: Path, more: str, wrong: str) -> None:
    (tmp_path / "scenario.toml").write_text(TEXT + more, encoding="utf-8")
    with pytest.raises(SettingsError, match=wrong):
        load(tmp_path)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("as bert (ST)", Instruction("once", "(ST)", by="bert")),
        ("as bert STOP", Instruction("STOP", by="bert")),
        ("AWAY", Instruction("AWAY")),
        ("as bert RELEASE", Instruction("RELEASE", by="bert")),
        ("as bert RELEASE  ALL ; of all", Instruction("RELEASE ALL", by="bert")),
        ("lease take bravo", Instruction("lease", "take bravo")),
        ("as anna lease take bravo for 2min", Instruction("lease", "take bravo", 120.0, by="anna")),
        ("lease grant bravo to bert for 5s", Instruction("lease", "grant bravo", 5.0, to="bert")),
        ("as anna standing only r1 (ST)", Instruction("standing", "(ST)", only=("r1",), by="anna")),
    ],
)
def test_orders_say_as_whom_they_are_sent(text: str, found: Instruction) -> None:
    (order,) = parse_mission(f"@5s {text}", "m")
    assert instruction(order) == found
    (again,) = parse_mission(f"@5s {found.written()}", "m")
    assert instruction(again) == found
    assert parse_mission(written_mission([order]), "m")[0].text == order.text


def test_a_locked_rule_is_changed_by_nobody() -> None:
    swarm, chief = assemble(find_scenario("two-desks"), None, mission=False)
    sent = chief.send("(RULE home (ST))", everybody=True)
    swarm.run(1.0)
    assert {*chief.accounting(sent.id).faults.values()} == {
        "home is built in: it cannot be changed over the air in (RULE home (ST))"
    }


def test_an_order_of_nobody_is_refused_by_its_line() -> None:
    swarm, _ = assemble(find_scenario("two-desks"), None, mission=False)
    swarm.mission.extend(parse_mission("@0s as anne (ST)", "my.sleep"))
    with pytest.raises(MissionError, match=r"my\.sleep:1: no operator anne.*did you mean anna"):
        swarm.run(1.0)
    alone, _ = assemble(find_scenario("stop"), None, mission=False)
    alone.mission.extend(parse_mission("@0s as anna (ST)", "my.sleep"))
    with pytest.raises(MissionError, match="nobody is named"):
        alone.run(1.0)


def test_the_scenario_is_a_mission_of_three() -> None:
    scenario = load(GALLERY / "two-desks")
    assert {instruction(order).by for order in scenario.mission} == {"chief", "anna", "bert"}
