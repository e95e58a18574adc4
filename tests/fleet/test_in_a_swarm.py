"""A fleet in the place of a swarm's nodes: with the desk, the radio and the bodies, the same run to the last bit."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from fleet.twins import seen
from sleepcast.fleet import Fleet
from sleepcast.loop import Swarm
from sleepcast.node.node import Node
from sleepcast.station import Station
from small_worlds import simulator

TICKS = 160
ORDERS = {
    5: "(RULE shy (COND ((< sonar0 60m) (DRIVE 0 0.4)) ((PROB 10%) (DRIVE 2 0.3)) (1 (DRIVE 3 0))))",
    20: "(WHEN (> battery 50%) (JOIN bravo))",
    30: "(WHEN (IN bravo) (RULE gossip (WHEN (PROB 1%) (TELL (MARK)))))",
    60: '(WHEN marked (REPORT "marked" x y))',
    90: "(WHEN (> x 500m) (FREEZE))",
    120: "(+ x nobody)",
}
RADIO = (('[radio]\ndelay = "0s"', '[radio]\ndelay = "0.2s"\nloss = "20%"'), ("count = 20", "count = 40"))


def run(folder: Path, *, as_fleet: bool) -> tuple[Swarm, Station]:
    """A swarm after its run, with a fleet or with nodes."""
    bodies = simulator(folder, *RADIO)
    swarm = Swarm(bodies)
    if as_fleet:
        fleet = Fleet(bodies.names, swarm.vocabulary, seed=bodies.seed, bodies=bodies.robots)
        swarm.nodes, swarm.minds = cast(list[Node], list(fleet.values())), cast(dict[str, Node], fleet)
    station = swarm.desk = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    for tick in range(TICKS):
        if tick in ORDERS:
            station.send(ORDERS[tick], everybody=True)
        swarm.step()
    return swarm, station


def test_a_swarm_with_a_fleet_is_the_swarm_with_nodes(tmp_path: Path) -> None:
    (wanted, desk), (found, other) = run(tmp_path, as_fleet=False), run(tmp_path, as_fleet=True)
    assert found.simulator.state_hash() == wanted.simulator.state_hash()
    assert found.measures() == wanted.measures()
    assert wanted.measures()["groups"]
    for here, there in zip(found.nodes, wanted.nodes, strict=True):
        assert seen(here) == seen(there)
    for command in desk.commands():
        assert other.accounting(command.id) == desk.accounting(command.id)
    name = wanted.nodes[0].name
    assert other.preview("(WHEN (> battery 50%) (MARK))") == desk.preview("(WHEN (> battery 50%) (MARK))")
    assert other.why(name).to_dict() == desk.why(name).to_dict()
    assert found.evaluate(name, "(* 2 x)").value == wanted.evaluate(name, "(* 2 x)").value
