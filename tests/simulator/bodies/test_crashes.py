"""Copters among solid things that have a height: what they fly over, what they touch, and on what they land."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from machines import MACHINES
from simulated import steps
from sleepcast.api.assembly import assemble
from sleepcast.api.recording import RecordingPlan, recorded
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Simulator, Wall, read_scenario
from sleepcast.simulator.bodies.crashes import near_solids
from sleepcast.simulator.bodies.flight import fence_of
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.recording.recording import load_recording
from sleepcast.simulator.snapshot import resume, state_of

TOWN = """
format = 2
title = "a town"
seconds = "1min"
tick = "0.1s"

[world]
width = "60m"
height = "60m"

[[world.polygons]]
corners = [["20m", "5m"], ["30m", "5m"], ["30m", "15m"], ["20m", "15m"]]
tall = "4m"
name = "the house"

[[world.walls]]
points = [["20m", "20m"], ["20m", "40m"]]
tall = "3m"

[[world.circles]]
center = ["45m", "10m"]
radius = "2m"

[robots]
like = "copter"
starts = [{ x = "10m", y = "30m", z = "5m" }, { x = "10m", y = "35m", z = "2m" }, ["25m", "10m"]]

[neighbours]
reach = "30m"
"""
HIGH, LOW, ON_ROOF = 0, 1, 2


def town(change: tuple[str, str] = ("", ""), machine: Machine | None = None) -> Simulator:
    return Simulator(read_scenario(TOWN.replace(*change)), machine=machine)


def sensed(simulator: Simulator, name: str) -> list[float]:
    row = [sensor.name for sensor in simulator.model.sensors].index(name)
    simulator.sense()
    return [float(value) for value in simulator.sensed[row]]


def flown(simulator: Simulator, robot: int, x: float, y: float, seconds: float) -> None:
    """Go there at this height."""
    assert simulator.robots.go_to(np.array([robot]), np.array([x]), np.array([y])) is None
    steps(simulator, seconds)


@pytest.mark.parametrize("machine", MACHINES)
def test_copters_fly_over_what_is_lower_and_crash_into_what_is_not(machine: Machine) -> None:
    sim = town(machine=machine)
    sim.robots.go_to(np.array([HIGH, LOW]), np.array([28.0, 28.0]), np.array([30.0, 35.0]))
    steps(sim, 8.0)
    assert sensed(sim, "crashed") == [0.0, 1.0, 0.0]
    assert [(each.robot, each.text) for each in sim.news] == [(LOW, "has crashed into a wall")]
    assert sim.x[HIGH] == pytest.approx(28.0)
    assert 19.0 < sim.x[LOW] < 20.0, "it touches the wall with its rim, and falls where it is"
    assert sensed(sim, "z") == [pytest.approx(5.0), 0.0, 4.0]


def test_things_without_a_height_are_as_high_as_the_sky() -> None:
    sim = town(('"10m", y = "30m", z = "5m"', '"45m", y = "20m", z = "29m"'))
    flown(sim, HIGH, 45.0, 3.0, 8.0)
    assert sensed(sim, "crashed")[HIGH] == 1.0
    assert sim.y[HIGH] == pytest.approx(12.5, abs=0.5)


def test_who_lands_on_a_roof_stands_there_and_measures_from_there() -> None:
    sim = town()
    assert (sensed(sim, "z")[ON_ROOF], sensed(sim, "height")[ON_ROOF], sensed(sim, "flying")[ON_ROOF]) == (
        4.0,
        0.0,
        0.0,
    )
    flown(sim, HIGH, 25.0, 12.5, 8.0)
    assert sensed(sim, "height")[HIGH] == pytest.approx(1.0)
    sim.robots.touch_down(np.array([HIGH]))
    steps(sim, 4.0)
    assert (sensed(sim, "z")[HIGH], sensed(sim, "height")[HIGH]) == (4.0, 0.0)
    assert (sensed(sim, "armed")[HIGH], sensed(sim, "crashed")[HIGH]) == (0.0, 0.0)
    assert sim.robots.disarm(np.array([HIGH])) is None, "a roof is ground for who stands there"
    sim.robots.take_off(np.array([ON_ROOF]), np.array([2.0]))
    steps(sim, 4.0)
    assert sensed(sim, "z")[ON_ROOF] == pytest.approx(6.0)
    (refused,) = sim.robots.take_off(np.array([HIGH]), np.array([29.0])) or [None]
    assert str(refused) == "it flies from 0.5 to 30 m high, not at 33 m"


def test_who_sinks_beside_the_rim_crashes_and_the_floor_counts_from_the_roof() -> None:
    sim = town(('"10m", y = "30m", z = "5m"', '"19.8m", y = "10m", z = "5m"'))
    sim.act("drive_climb", np.array([HIGH, ON_ROOF]), np.array([-1.0, -1.0]))
    steps(sim, 3.0)
    assert sensed(sim, "crashed")[HIGH] == 1.0
    sim = town(('"10m", y = "30m", z = "5m"', '"25m", y = "7m", z = "8m"'))
    sim.act("drive_climb", np.array([HIGH]), np.array([-1.0]))
    steps(sim, 9.0)
    assert sensed(sim, "height")[HIGH] == pytest.approx(0.5)
    assert sensed(sim, "z")[HIGH] == pytest.approx(4.5)


def test_an_empty_battery_over_a_roof_lands_on_it_and_who_falls_lies_there() -> None:
    sim = town(('"10m", y = "30m", z = "5m"', '"25m", y = "7m", z = "9m"'))
    sim.bodies.stores[0, HIGH] = 0.0
    steps(sim, 15.0)
    assert (sensed(sim, "z")[HIGH], sensed(sim, "height")[HIGH]) == (4.0, 0.0)
    assert sensed(sim, "crashed")[HIGH] == 0.0


def test_who_stands_on_a_roof_that_goes_falls() -> None:
    sim = town()
    (house,) = (number for number, shape in sim.world.shapes.items() if shape.name == "the house")
    sim.world.remove(house)
    steps(sim, 2.0)
    assert sensed(sim, "z")[ON_ROOF] == 0.0


def test_a_snapshot_over_a_roof_goes_on_as_the_run_did() -> None:
    sim = town()
    sim.robots.take_off(np.array([ON_ROOF]), np.array([2.0]))
    steps(sim, 1.0)
    again = resume(state_of(sim))
    for each in (sim, again):
        each.robots.touch_down(np.array([ON_ROOF]))
        steps(each, 4.0)
    assert again.state_hash() == sim.state_hash()
    assert again.world.shapes == sim.world.shapes
    assert sensed(again, "z")[ON_ROOF] == 4.0


def test_the_wall_around_a_world_is_the_fence_of_what_flies() -> None:
    sim = town(('height = "60m"', 'height = "60m"\nedge = "wall"'))
    (refused,) = sim.robots.go_to(np.array([HIGH]), np.array([0.3]), np.array([30.0])) or [None]
    assert str(refused) == "(0.3, 30) m lies outside of the fence"
    sim.act("drive_side", np.array([HIGH]), np.array([5.0]))
    sim.bodies.heading[HIGH] = np.pi / 2.0
    steps(sim, 12.0)
    assert sensed(sim, "crashed")[HIGH] == 0.0
    assert sim.x[HIGH] == pytest.approx(fence_of(sim.scenario, sim.scenario.robots)[0], abs=0.01)


@pytest.mark.parametrize(("robot", "seen"), [(HIGH, 2.0), (LOW, 1.0)])
def test_neighbours_are_seen_over_walls_that_are_low_enough(robot: int, seen: float) -> None:
    """The line to the one behind the wall of 3 m passes it at 4.45 or 2.95 m."""
    sim = town(('["25m", "10m"]', '{ x = "30m", y = "30m", z = "3.9m" }'))
    count = next(each for each in sim.model.functions if each.name == "COUNT")
    assert count.many is not None
    assert count.many(sim.robots, np.array([robot]), np.array([25.0]))[0] == seen


@pytest.mark.parametrize(("z", "seen"), [("1m", False), ("5m", True)])
def test_beams_pass_over_what_is_lower(z: str, seen: bool) -> None:
    starts = TOWN[TOWN.index("starts") : TOWN.index("[neighbours]")]
    laser = '[laser]\nbeams = 4\nrange = "30m"\n\n'
    sim = town((starts, f'starts = [{{ x = "10m", y = "30m", z = "{z}", heading = "0deg" }}]\n\n{laser}'))
    ahead = sim.scans()[0][2]
    assert ahead == (np.inf if seen else pytest.approx(10.0))


def test_on_which_part_of_a_way_something_solid_is_near() -> None:
    """Compared with many points of each way."""
    drawn = np.random.default_rng(2)
    count, shares = 400, np.linspace(0.0, 1.0, 2_001)
    x, y, way_x, way_y = drawn.uniform(-2.0, 2.0, (4, count))
    way_x[:20] = way_y[:20] = 0.0
    solids = np.concatenate([drawn.uniform(-2.0, 2.0, (4, count)), np.zeros((1, count))]).T
    solids[::3, 2:4] = solids[::3, :2]
    near = drawn.uniform(0.1, 1.0, count)
    begin, end = near_solids(x, y, way_x, way_y, solids, near)
    x0, y0, x1, y1, _ = solids.T[:, :, None]
    px, py = x[:, None] + shares * way_x[:, None], y[:, None] + shares * way_y[:, None]
    size = (x1 - x0) ** 2 + (y1 - y0) ** 2
    part = np.clip(((px - x0) * (x1 - x0) + (py - y0) * (y1 - y0)) / np.where(size > 0.0, size, 1.0), 0.0, 1.0)
    within = np.hypot(px - x0 - part * (x1 - x0), py - y0 - part * (y1 - y0)) < near[:, None]
    met = within.any(axis=1)
    assert 80 < met.sum() < 320
    assert ((begin < end) | ~met).all()
    assert np.allclose(begin[met], shares[within.argmax(axis=1)][met], atol=1e-3)
    assert np.allclose(end[met], shares[2_000 - within[:, ::-1].argmax(axis=1)][met], atol=1e-3)
    assert (end - begin)[~met].max() < 2e-3


def test_a_recording_and_its_page_know_how_high_things_are(tmp_path: Path) -> None:
    swarm, station = assemble(read_scenario(TOWN), None, mission=False)
    file = tmp_path / "run.mcap"
    with recorded(swarm, station, RecordingPlan(file, 0.1, 0.1), print):
        swarm.run(0.5)
        swarm.simulator.world.add(Wall(((1.0, 1.0), (2.0, 1.0)), tall=7.0))
        swarm.run(0.5)
    timeline = load_timeline(load_recording(file))
    assert timeline.scene.tall == (4.0, None, 3.0)
    later = timeline.obstacles.at(0.9)
    assert later is not None
    assert later.tall == (4.0, None, 3.0, 7.0)


@pytest.mark.parametrize("tall", ["0m", "20km", "-3m"])
def test_a_height_has_bounds(tall: str) -> None:
    with pytest.raises(SettingsError, match="tall"):
        town(('tall = "3m"', f'tall = "{tall}"'))
