"""Scouts beside copters: what their sonars hear, what they touch, and where both may start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import sleepcast as sc
from machines import ALL, MACHINES
from simulated import sensed, steps
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.bodies.starting import StartError
from sleepcast.simulator.engine import Machine, choose
from sleepcast.simulator.snapshot import resume, state_of

YARD = """
format = 2
title = "a yard"
seconds = "1min"
tick = "0.1s"

[world]
width = "20m"
height = "20m"

[[world.walls]]
points = [["14m", "0m"], ["14m", "20m"]]
tall = "1m"

[[robots]]
like = "scout"
starts = [["10m", "10m", "0deg"]]
motion = "still"

[[robots]]
like = "copter"
starts = [["12m", "10m"]]
"""
SCOUT, COPTER = 0, 1
RIM, BOTH, WALL = 10.17, 0.67, 14.0
"""Where the Scout's rim is in front, what both radii are together, and where the wall stands, m."""
IN_ORDER = ('like = "scout"', 'like = "scout"\nsonar.pause = "10ms"')
SECTORS = (
    'like = "scout"',
    'type = "scout"\nlimits = { speed = "1m/s", turn_rate = "90deg/s", acceleration = "2m/s2" }',
)
SECTORS = (SECTORS[0], f'{SECTORS[1]}\nbody = {{ radius = "0.17m", sonars = 16, sonar_range = "5m" }}')


def yard(*changes: tuple[str, str], machine: Machine | None = None) -> Simulator:
    text = YARD
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return Simulator(read_scenario(text), machine=machine)


def height(z: float, place: str = "12m") -> tuple[str, str]:
    """Let the copter begin so high."""
    return '[["12m", "10m"]]', f'[{{ x = "{place}", y = "10m", z = "{z}m" }}]'


def test_a_sonar_hears_a_copter_that_stands_and_not_one_that_hovers_above() -> None:
    with sc.open(YARD) as fleet:
        fleet.run(0.2)
        (before, _) = fleet.table()["front_range"].tolist()
        fleet.send("(WHEN (NOT flying) (TAKEOFF 5m))")
        fleet.run(8.0)
        table = fleet.table()
    assert before == pytest.approx(12.0 - 0.5 - RIM, abs=1e-5)
    assert table["z"].tolist()[COPTER] == pytest.approx(5.0)
    assert table["front_range"].tolist()[SCOUT] == pytest.approx(WALL - RIM, abs=1e-5)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("z", [0.66, 0.68])
@pytest.mark.parametrize("changes", [(IN_ORDER,), ()])
def test_heights_overlap_while_the_lower_end_is_below_the_upper_one(
    machine: Machine, z: float, changes: tuple[tuple[str, str], ...]
) -> None:
    simulator = yard(*changes, height(z), machine=machine)
    steps(simulator, 1.0)
    seen = 12.0 - 0.5 - RIM if z < BOTH else WALL - RIM
    assert sensed(simulator, SCOUT)["sonar0"] == pytest.approx(seen, abs=1e-5)
    simulator.robots[SCOUT].drive(1.0, 0.0)
    steps(simulator, 5.0)
    stop = 12.0 - BOTH if z < BOTH else WALL - 0.17
    assert simulator.x[SCOUT] == pytest.approx(stop, abs=1e-5)
    assert sensed(simulator, SCOUT)["bumper"] == 1.0
    assert not sensed(simulator, COPTER)["crashed"]
    assert np.isnan([sensed(simulator, COPTER)[name] for name in ("bumper", "sonar0", "front_range")]).all()


def test_sectors_see_only_what_is_as_low() -> None:
    for z, seen in ((0.0, 12.0 - BOTH - 10.0), (2.0, 5.0)):
        assert yard(SECTORS, height(z)).robots[SCOUT].sonar(0.0) == pytest.approx(seen)


def test_a_copter_beside_wheels_knows_where_it_is() -> None:
    simulator = yard(height(5.0))
    simulator.robots[COPTER].go_to(4.0, 3.0, 6.0)
    steps(simulator, 8.0)
    known = sensed(simulator, COPTER)
    assert (known["x"], known["y"], known["z"]) == pytest.approx((4.0, 3.0, 6.0), abs=1e-3)
    assert (known["x"], known["y"]) == (simulator.x[COPTER], simulator.y[COPTER])


CROWD = (
    YARD.replace("[[world.walls]]", "[[world.circles]]\ncenter = [5, 5]\nradius = 1\n\n[[world.walls]]")
    .replace('starts = [["10m", "10m", "0deg"]]\nmotion = "still"', "count = 30\nbody.contact = 'slide'")
    .replace('starts = [["12m", "10m"]]', 'count = 15\nz = ["0m", "1.5m"]')
)


@pytest.mark.parametrize("edge", ["wall", "torus"])
def test_all_machines_and_a_run_that_goes_on_move_a_crowd_alike(edge: str) -> None:
    scenario = read_scenario(CROWD.replace("[world]", f'[world]\nedge = "{edge}"'))
    machines = [*ALL, *([choose("numba", 2)] if len(ALL) > 1 else [])]
    simulators = [Simulator(scenario, machine=machine) for machine in machines]
    for simulator in simulators:
        for copter in range(30, 45):
            simulator.robots[copter].drive(0.5, 0.3)
        steps(simulator, 3.0)
    simulators.append(resume(state_of(simulators[0])))
    for simulator in simulators:
        steps(simulator, 2.0)
    assert len({simulator.state_hash() for simulator in simulators}) == 1
    assert (simulators[0].bodies.bumper[:30] > 0.0).any()
    ranges = [simulator.bodies.sonar_ranges(range(30)) for simulator in simulators]
    assert all(each == pytest.approx(ranges[0], abs=1e-4) for each in ranges)


def test_nobody_starts_in_another_one_and_above_there_is_room() -> None:
    with pytest.raises(StartError, match="robots 1 and 2 cannot start 0 m apart"):
        yard(height(0.0, "10m"))
    simulator = yard(height(2.0, "10m"))
    simulator.step()
    assert not sensed(simulator, COPTER)["crashed"]
    with pytest.raises(StartError, match=r"robots 2 and 3 cannot start 0\.1 m apart"):
        yard(('[["12m", "10m"]]', '[["12m", "10m"], ["12.1m", "10m"]]'))
    crowd = Simulator(read_scenario(CROWD)).bodies
    low = np.flatnonzero(crowd.flight.low(crowd.x, crowd.y)) if crowd.flight else np.arange(0)
    apart = np.hypot(crowd.x[:30, None] - crowd.x[low], crowd.y[:30, None] - crowd.y[low])
    own = np.flatnonzero(low < 30)
    apart[low[own], own] = np.inf
    assert (apart > crowd.radii[:30, None] + crowd.radii[low]).all()


@pytest.mark.parametrize(("z", "comes"), [(0.0, False), (3.0, True)])
def test_a_scout_comes_where_no_copter_is_as_low(z: float, comes: bool) -> None:
    simulator = yard(height(z), ('motion = "still"', 'motion = "still"\nmost = 2'))
    if not comes:
        with pytest.raises(MisuseError, match="has no room at 12, 10 m"):
            simulator.add_robot("scout", 12.0, 10.0, 0.0)
        return
    simulator.add_robot("scout", 12.0, 10.0, 0.0)
    steps(simulator, 0.5)
    assert int(simulator.there.sum()) == 3


@pytest.mark.parametrize("machine", MACHINES)
def test_on_a_ground_map_heights_count_from_the_ground(tmp_path: Path, machine: Machine) -> None:
    """From 4 m in the west to 12 m in the east; the copter stands 1.2 m higher than the Scout."""
    heights = np.interp(np.arange(100) + 0.5, (0.0, 100.0), (0.0, 65_535.0))
    Image.fromarray(np.tile(np.round(heights).astype(np.uint16), (100, 1))).save(tmp_path / "hills.png")
    hills = ("[world]", f'[world]\nground = {{ file = "{tmp_path / "hills.png"}", low = "4m", high = "12m" }}')
    stands, hovers = (yard(hills, height(z, "13m"), machine=machine) for z in (0.0, 11.0))
    assert sensed(stands, COPTER)["z"] - sensed(stands, SCOUT)["z"] == pytest.approx(1.2, abs=1e-3)
    assert sensed(stands, SCOUT)["sonar0"] == pytest.approx(13.0 - 0.5 - RIM, abs=1e-5)
    assert sensed(hovers, SCOUT)["sonar0"] == pytest.approx(WALL - RIM, abs=1e-5)
