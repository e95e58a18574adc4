"""The loop thinks with a fleet: with the desk, the radio and the bodies, the same run as with a node for each robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from fleet.node_swarm import NodeSwarm
from fleet.twins import seen
from sleepcast.loop import Swarm
from sleepcast.station import Station
from small_worlds import simulator

TICKS = 160
ORDERS = {
    5: "(RULE shy (COND ((< sonar0 60m) (DRIVE 0 0.4)) ((PROB 10%) (DRIVE 2 0.3)) (1 (DRIVE 3 0))))",
    20: "(WHEN (> battery 50%) (JOIN bravo))",
    30: "(WHEN (IN bravo) (RULE gossip (WHEN (PROB 1%) (TELL (MARK)))))",
    40: "(RULE steer (WHEN (PROB 5%) (SETQ drive_turn (RANDOM -1 1))))",
    60: '(WHEN marked (REPORT "marked" x y))',
    70: "(WHEN (< x 300m) (GOTO 500m 500m))",
    75: "(WHEN (> y 500m) (TUMBLE))",
    80: '(REPORT "near" (SONAR 3) (NEAREST -90deg 90deg))',
    85: "(WHEN (< y 200m) (WANDER))",
    90: "(WHEN (> x 500m) (FREEZE))",
    100: "(ST)",
    110: "STOP",
    115: "RELEASE",
    120: "(+ x nobody)",
    130: "(DEFUN far (limit) (> x limit))",
}
QUESTIONS = (
    "(WHEN (> battery 50%) (MARK))",
    "(WHEN (AND (> battery 50%) (PROB 0.5)) (MARK))",
    "(WHEN (far 400m) (MARK))",
    "(WHEN (OR (IN bravo) (SONAR 0)) (MARK))",
    "(WHEN E5 (MARK))",
    "(WHEN (SETQ drive_turn 1) (MARK))",
)
DELAY = ('[radio]\ndelay = "0s"', '[radio]\ndelay = "0.2s"\nloss = "20%"')
STORM = (
    '[radio]\ndelay = "0s"',
    '[radio]\ndelay = "0.1s"\njitter = "0.4s"\nloss = "20%"\nduplication = "20%"\nreordering = "20%"',
)


OVERTAKEN = {2: "STOP", 30: "RELEASE", 32: "STOP"}


def give(desk: Station, order: str) -> None:
    if order == "STOP":
        desk.stop()
    elif order == "RELEASE":
        desk.release()
    else:
        desk.send(order, everybody=True)


def test_a_stop_holds_that_overtakes_the_release_before_it(tmp_path: Path) -> None:
    wanted = NodeSwarm(simulator(tmp_path, STORM))
    found = Swarm(simulator(tmp_path, STORM))
    there = wanted.desk
    here = found.desk = Station(found.vocabulary, found.minds, found.post, found)
    for tick in range(60):
        if tick in OVERTAKEN:
            give(here, OVERTAKEN[tick])
            give(there, OVERTAKEN[tick])
        found.step()
        wanted.step()
    assert all(node.stopped for node in wanted.nodes)
    assert found.fleet.stopped.all()
    assert found.radio.counts == wanted.radio.counts


def reported(desk: Station) -> list[tuple[float, str, object]]:
    """What was reported; in which order the desk took in what came in one tick is all the same."""
    return sorted((r.heard, r.robot, str(r.body)) for r in desk.reports)


@pytest.mark.parametrize("radio", [DELAY, STORM], ids=["delay", "storm"])
def test_a_swarm_with_a_fleet_is_the_swarm_with_nodes(tmp_path: Path, radio: tuple[str, str]) -> None:
    wanted = NodeSwarm(simulator(tmp_path, radio, ("count = 20", "count = 40")))
    found = Swarm(simulator(tmp_path, radio, ("count = 20", "count = 40")))
    there = wanted.desk
    here = found.desk = Station(found.vocabulary, found.minds, found.post, found)
    for tick in range(TICKS):
        if tick in ORDERS:
            give(here, ORDERS[tick])
            give(there, ORDERS[tick])
        found.step()
        wanted.step()
    assert found.simulator.state_hash() == wanted.simulator.state_hash()
    assert found.radio.counts == wanted.radio.counts
    assert found.fleet.members()["bravo"]
    for view, node in zip(found.minds.values(), wanted.nodes, strict=True):
        assert seen(view) == seen(node)
    for command in there.commands():
        account, other = here.accounting(command.id), there.accounting(command.id)
        assert account.to_dict() == other.to_dict()
        for names in ("matched", "not_matched", "fault", "silent", "faults", "last_heard"):
            assert getattr(account, names) == getattr(other, names)
        assert dict(here.commands()[0].answers) == dict(there.commands()[0].answers)
    for text in QUESTIONS:
        preview, other_preview = here.preview(text), there.preview(text)
        for names in ("yes", "no", "unknown", "reasons", "oldest", "everybody"):
            assert getattr(preview, names) == getattr(other_preview, names), text
    assert reported(here) == reported(there)
    name = wanted.nodes[0].name
    assert here.why(name).to_dict() == there.why(name).to_dict()
    assert found.evaluate(name, "(* 2 x)").value == wanted.nodes[0].evaluate("(* 2 x)").value
