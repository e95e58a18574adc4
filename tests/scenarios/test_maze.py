"""The maze: everybody keeps a hand on the wall, gets somewhere that way, and stays where it sees a lamp."""

from __future__ import annotations

import numpy as np
import pytest

from sleepcast.api.assembly import assemble
from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, Simulator, find_scenario

SECONDS = 60.0


@pytest.fixture(scope="module")
def swarm() -> Swarm:
    """Some robots after a minute."""
    found, _ = assemble(find_scenario("maze", Changes(robots=80)), None, mission=True)
    found.run(SECONDS)
    return found


def known(swarm: Swarm, name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([dict(node.variables())[name] for node in swarm.minds.values()])


def test_everybody_knows_the_quarter_it_started_in(swarm: Swarm) -> None:
    groups = swarm.measures()["groups"]
    assert isinstance(groups, dict)
    quarters = ["northeast", "northwest", "southeast", "southwest"]
    assert sum(groups[quarter] for quarter in quarters) == 80
    start = Simulator(swarm.simulator.scenario)
    for x, y, mind in zip(start.x, start.y, swarm.minds.values(), strict=True):
        if min(abs(x - 600.0), abs(y - 600.0)) > 1.0:
            assert ("south" if y < 600.0 else "north") + ("west" if x < 600.0 else "east") in mind.groups


def test_most_feel_a_wall_and_go_along_it(swarm: Swarm) -> None:
    assert np.mean(known(swarm, "room") < 3.0) > 0.5
    start = Simulator(swarm.simulator.scenario)
    gone = np.hypot(swarm.simulator.x - start.x, swarm.simulator.y - start.y)
    assert float(np.median(gone)) > 8.0


def test_who_sees_a_lamp_is_home_and_stays(swarm: Swarm) -> None:
    sim = swarm.simulator
    light = sim.scenario.lights[0]
    sim.bodies.place(7, light.x + 2.0, light.y + 2.0, 0.0)
    swarm.run(2.0)
    assert "home" in swarm.minds[sim.names[7]].groups
    before = sim.x[7], sim.y[7]
    swarm.run(2.0)
    assert (sim.x[7], sim.y[7]) == before
