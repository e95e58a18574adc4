"""Every scenario of the gallery shows something alive soon after the first press on its page.

The first press is *Play all*, where ready-made commands work only together, else the first of them. Ten seconds of a
person are ten times `speed_up` seconds of the run; what is looked at is what the map shows.
"""

from __future__ import annotations

import numpy as np
import pytest

from sleepcast.api.assembly import assemble
from sleepcast.fleet.marks import flags_of
from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, Scenario, find_scenario, scenario_names

SECONDS = 10.0
"""Of a person who has pressed once."""
FEW = 60
"""Robots, where a scenario has many and no groups that say how many: enough to see that they live."""


def few_of(name: str) -> Scenario:
    scenario = find_scenario(name)
    alone = not scenario.sorts and not scenario.robots.groups and scenario.robots.count > 5 * FEW
    return find_scenario(name, Changes(FEW)) if alone else scenario


def shown(swarm: Swarm) -> tuple[bytes, bytes, bytes, int]:
    """What the page shows: where robots are, to a hundredth of the world, how they are marked; colours; groups."""
    simulator = swarm.simulator
    fine = 100.0 / max(simulator.scenario.width, simulator.scenario.height)
    heights = np.zeros(1) if simulator.heights is None else 5.0 * simulator.heights
    places = np.round([simulator.x * fine, simulator.y * fine, 5.0 * simulator.bodies.heading])
    poses = places.tobytes() + np.round(heights).tobytes()
    return poses, flags_of(swarm.minds, None), bytes(simulator.colours()), sum(swarm.fleet.members().values())


@pytest.mark.parametrize("name", scenario_names())
def test_the_first_press_brings_it_to_life(name: str) -> None:
    scenario = few_of(name)
    swarm, station = assemble(scenario, None, mission=False, threads=1)
    swarm.send_initial_telemetry()
    together = [command for command in scenario.commands if command.together]
    assert len(together) != 1, "one alone is not together with anything"
    for command in scenario.repeats * together or scenario.commands[:1]:
        station.send(command.text.strip(), everybody=True)
    before = shown(swarm)
    for _ in range(round(SECONDS * scenario.speed_up / scenario.tick)):
        swarm.step()
        if any(swarm.simulator.pinged()) or shown(swarm) != before:
            return
    pytest.fail(f"{name}: nothing on the map has changed {SECONDS:g} s after the first press")


@pytest.mark.parametrize("name", scenario_names())
def test_what_needs_others_is_together_with_them(name: str) -> None:
    """Play all sends nothing whose forerunner it leaves out."""
    commands = find_scenario(name).commands
    for command in commands:
        if command.together and command.needs:
            assert commands[command.needs - 1].together, command.title
