"""A run again: from any kept state, with what came from outside, everything is as it was, explanations included."""

from __future__ import annotations

import pytest

from sleepcast.core.errors import SleepcastError
from sleepcast.loop import Swarm, resume
from sleepcast.loop.rerun import InputLog, Rerun
from sleepcast.loop.snapshots import copy_of
from sleepcast.simulator import Changes, Circle, Simulator, find_scenario
from swarms import desk_of, drive, mind, station_of, swarm_of

FEW = 12
STATES, LOOKS, LAST = (0, 14, 29), (15, 30, 41), 41
WALL_AT = 21


def picture(swarm: Swarm) -> list[object]:
    """The bodies and minds of a swarm."""
    return [swarm.simulator.state_hash(), [mind(view) for view in swarm.fleet.values()], swarm.fleet.members()]


def reasons(swarm: Swarm, commands: list[str]) -> dict[tuple[str, str], str]:
    """Why each robot did with each command what it did, as far as the fleet knows."""
    found = {}
    for name, view in swarm.fleet.items():
        for command in commands:
            try:
                found[name, command] = repr(view.why(command))
            except SleepcastError:
                continue
    return found


@pytest.mark.parametrize("name", ["bravo", "crowd", "maze"])
def test_a_run_from_any_state_is_the_same_run(name: str) -> None:
    scenario = find_scenario(name, Changes(robots=FEW))
    swarm = Swarm(Simulator(scenario, 4))
    swarm.desk = station_of(swarm)
    log = InputLog(swarm)
    swarm.witnesses.append(log)
    states, seen = {}, {}
    for tick in range(LAST + 1):
        if tick in STATES:
            states[tick] = copy_of(swarm).packed()
        if tick in LOOKS:
            seen[tick] = picture(swarm)
        if tick == WALL_AT:
            swarm.simulator.world.add(Circle(scenario.width / 2, scenario.height / 2, 1.0))
        drive(swarm, 1)
    commands = [command.id for command in desk_of(swarm).commands() if command.kind == "command"]
    wanted = reasons(swarm, commands)
    assert len(wanted) > FEW * 5
    assert log.inputs.changes
    assert len(log.inputs.posted) > 10
    for base, state in states.items():
        again = Rerun(resume(state), log.inputs)
        again.swarm.desk = station_of(again.swarm)
        assert again.tick == base
        while again.tick < LAST:
            again.step()
            if again.tick in LOOKS:
                assert picture(again.swarm) == seen[again.tick], f"from {base}, at {again.tick}"
        found = reasons(again.swarm, commands)
        assert found.items() <= wanted.items()
        if base == 0:
            assert found == wanted


def test_a_run_without_an_input_is_another_run() -> None:
    swarm = swarm_of(find_scenario("crowd", Changes(robots=FEW)), seed=4)
    log = InputLog(swarm)
    swarm.witnesses.append(log)
    start = copy_of(swarm).packed()
    drive(swarm, LAST)
    del log.inputs.posted[0]
    again = Rerun(resume(start), log.inputs)
    while again.tick < LAST:
        again.step()
    assert again.swarm.simulator.state_hash() != swarm.simulator.state_hash()


def test_inputs_are_found_by_their_ticks() -> None:
    swarm = swarm_of(find_scenario("crowd", Changes(robots=FEW)), seed=4)
    log = InputLog(swarm)
    swarm.witnesses.append(log)
    drive(swarm, LAST)
    whole = log.inputs
    assert whole.between(0, LAST).posted == whole.posted
    middle = whole.between(8, 16)
    assert middle.posted
    assert all(8 < tick <= 16 for tick, _ in middle.posted)
    assert whole.between(0, 8).posted + middle.posted + whole.between(16, LAST).posted == whole.posted
