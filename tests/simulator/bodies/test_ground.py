"""Copters and rovers over a ground map: what heights mean, who crashes into a slope, and on what they stand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import sleepcast as sc
from machines import MACHINES
from simulated import steps
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Scenario, Simulator, read_scenario
from sleepcast.simulator.bodies.homes import TOO_HIGH
from sleepcast.simulator.bodies.looking_down import DownCameras
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.packing import pack
from sleepcast.simulator.snapshot import resume, scenario_of, state_of

HILLS = """
format = 2
title = "hills"
seconds = "1min"
tick = "0.1s"

[world]
width = "100m"
height = "40m"
ground = { file = "FILE", low = "2m", high = "12m" }

[[robots]]
like = "copter"
starts = [["10m", "20m", "0deg"], { x = "30m", y = "10m", z = "9m" }, { x = "30m", y = "30m", z = "20m" }]

[[robots]]
type = "rover"
motion = "still"
limits = { speed = "1m/s", turn_rate = "90deg/s", acceleration = "1m/s2" }
body = { radius = "0.3m" }
starts = [["40m", "20m", "0deg"]]

[neighbours]
reach = "15m"
"""
GROUNDED, LOW, HIGH, ROVER = 0, 1, 2, 3


def ramp(folder: Path) -> Path:
    """A picture of 16 bits: level in the west and in the east, where it is 10 m higher, a slope of 1 in 3 between."""
    across = np.interp(np.arange(100) + 0.5, (35.0, 65.0), (0.0, 65_535.0))
    Image.fromarray(np.tile(np.round(across).astype(np.uint16), (40, 1))).save(folder / "hills.png")
    return folder / "hills.png"


def written_text(folder: Path) -> str:
    return HILLS.replace("FILE", str(ramp(folder)))


def written(folder: Path, change: tuple[str, str] = ("", "")) -> Scenario:
    return read_scenario(HILLS.replace(*change).replace("FILE", str(ramp(folder))))


def hills(folder: Path, change: tuple[str, str] = ("", ""), machine: Machine | None = None) -> Simulator:
    return Simulator(written(folder, change), machine=machine)


def sensed(sim: Simulator, name: str) -> list[float]:
    row = [sensor.name for sensor in sim.model.sensors].index(name)
    sim.sense()
    return [float(value) for value in sim.sensed[row]]


def go(sim: Simulator, robot: int, *place: float) -> object:
    return sim.robots.go_to(np.array([robot]), *(np.array([each]) for each in place))


def test_z_counts_from_the_origin_and_height_from_the_ground(tmp_path: Path) -> None:
    sim = hills(tmp_path)
    assert sensed(sim, "z") == [2.0, 9.0, 20.0, pytest.approx(2.0 + 5.0 / 3.0, abs=1e-3)]
    assert sensed(sim, "height")[:3] == [0.0, 7.0, 18.0]
    assert sensed(sim, "flying")[:3] == [0.0, 1.0, 1.0]
    go(sim, HIGH, 80.0, 30.0)
    steps(sim, 20.0)
    assert sensed(sim, "z")[HIGH] == 20.0
    assert sensed(sim, "height")[HIGH] == pytest.approx(8.0, abs=1e-3)


def test_a_flight_takes_off_from_the_ground_and_lands_on_it(tmp_path: Path) -> None:
    sim, one = hills(tmp_path), np.array([GROUNDED])
    assert sim.robots.take_off(one, np.array([5.0])) is None
    steps(sim, 10.0)
    assert sensed(sim, "height")[GROUNDED] == pytest.approx(5.0, abs=0.01)
    assert go(sim, GROUNDED, 80.0, 20.0, 18.0) is None
    steps(sim, 30.0)
    assert sim.robots.touch_down(one) is None
    steps(sim, 15.0)
    assert sensed(sim, "z")[GROUNDED] == pytest.approx(12.0, abs=1e-3)
    assert (sensed(sim, "height")[GROUNDED], sensed(sim, "armed")[GROUNDED]) == (0.0, 0.0)
    assert sensed(sim, "crashed")[GROUNDED] == 0.0
    assert sim.robots.take_off(one, np.array([3.0])) is None, "it stands, and takes off again"
    steps(sim, 10.0)
    assert sensed(sim, "z")[GROUNDED] == pytest.approx(15.0, abs=0.01)


@pytest.mark.parametrize("machine", MACHINES)
def test_who_flies_into_a_slope_crashes_and_stays_there(tmp_path: Path, machine: Machine) -> None:
    sim = hills(tmp_path, machine=machine)
    go(sim, LOW, 80.0, 10.0)
    steps(sim, 20.0)
    assert [(each.robot, each.text) for each in sim.news] == [(LOW, "has crashed into the ground")]
    assert sensed(sim, "crashed")[:3] == [0.0, 1.0, 0.0]
    assert sim.x[LOW] == pytest.approx(56.0, abs=0.6), "the slope is 9 m high there"
    assert sensed(sim, "height")[LOW] == 0.0


def test_who_comes_to_a_slope_slowly_stands_on_it(tmp_path: Path) -> None:
    sim = hills(tmp_path, ('"30m", y = "10m", z = "9m"', '"54m", y = "10m", z = "9m"'))
    row = [each.name for each in sim.model.actuators].index("drive_speed")
    assert sim.model.actuators[row].name == "drive_speed"
    sim.bodies.heading[LOW], sim.bodies.mode[LOW], sim.bodies.wanted_speed[LOW] = 0.0, 1, 0.5
    steps(sim, 10.0)
    assert sensed(sim, "crashed")[LOW] == 0.0
    assert (sensed(sim, "height")[LOW], sensed(sim, "armed")[LOW]) == (0.0, 0.0)
    assert sim.x[LOW] == pytest.approx(56.0, abs=0.2)


def test_the_floor_counts_from_the_ground_and_the_ceiling_from_the_origin(tmp_path: Path) -> None:
    sim = hills(tmp_path)
    sim.bodies.flight.wanted_climb[HIGH] = -1.0  # type: ignore[union-attr]
    steps(sim, 30.0)
    assert 2.5 <= sensed(sim, "z")[HIGH] < 2.6
    sim.bodies.flight.wanted_climb[HIGH] = 1.0  # type: ignore[union-attr]
    steps(sim, 60.0)
    assert 29.9 < sensed(sim, "z")[HIGH] <= 30.0
    refused = go(sim, HIGH, 80.0, 30.0, 12.2)
    assert "it flies from 0.5 to 30 m high, not at 0.2" in str(refused)
    assert go(sim, HIGH, 20.0, 30.0, 12.2) is None


def test_rovers_ride_on_the_ground_at_the_speed_of_the_plane(tmp_path: Path) -> None:
    sim = hills(tmp_path)
    go(sim, ROVER, 70.0, 20.0)
    x, z = [], []
    for _ in range(100):
        steps(sim, 0.1)
        x.append(float(sim.x[ROVER]))
        z.append(sensed(sim, "z")[ROVER])
    wanted = 2.0 + np.interp(x, (35.0, 65.0), (0.0, 10.0))
    assert z == pytest.approx(wanted, abs=0.01)
    flat = hills(tmp_path, ('high = "12m"', 'high = "2m"'))
    go(flat, ROVER, 70.0, 20.0)
    steps(flat, 10.0)
    assert (sim.x[ROVER], sim.y[ROVER]) == (flat.x[ROVER], flat.y[ROVER])
    assert sensed(flat, "z")[ROVER] == 2.0


def test_a_camera_sees_what_is_below_it_and_nothing_from_the_ground(tmp_path: Path) -> None:
    lamp = '[lights.lamp]\nx = "80m"\ny = "30m"\nreach = "50m"\n\n[neighbours]'
    camera = 'like = "copter"\ncamera.angle = "90deg"'
    text = written_text(tmp_path).replace("[neighbours]", lamp).replace('like = "copter"', camera)
    sim = Simulator(read_scenario(text.replace('["10m", "20m", "0deg"]', '["72m", "30m", "0deg"]')))
    cameras = sim.senses.of(DownCameras)
    assert cameras.footprints[[GROUNDED, HIGH]] == pytest.approx([0.0, 18.0])
    go(sim, HIGH, 74.0, 30.0)
    steps(sim, 20.0)
    assert cameras.lights(np.array([GROUNDED, HIGH])).tolist() == [0.0, 1.0], "8 m above the lamp it sees 8 m far"
    go(sim, HIGH, 70.0, 30.0)
    steps(sim, 5.0)
    assert cameras.lights(np.array([HIGH])).tolist() == [0.0]


def test_what_is_solid_stands_on_the_ground(tmp_path: Path) -> None:
    house = """
[[world.circles]]
center = ["80m", "30m"]
radius = "5m"
tall = "3m"

[[robots]]"""
    sim = hills(tmp_path, ('\n[[robots]]\nlike = "copter"', f'{house}\nlike = "copter"'))
    go(sim, HIGH, 80.0, 30.0)
    steps(sim, 20.0)
    assert sensed(sim, "height")[HIGH] == pytest.approx(5.0, abs=1e-3)
    sim.robots.touch_down(np.array([HIGH]))
    steps(sim, 15.0)
    assert sensed(sim, "z")[HIGH] == pytest.approx(15.0, abs=1e-3)
    assert sensed(sim, "crashed")[HIGH] == 0.0


def test_a_snapshot_holds_the_ground_and_goes_on_as_the_run_did(tmp_path: Path) -> None:
    sim = hills(tmp_path)
    go(sim, LOW, 80.0, 10.0)
    steps(sim, 5.0)
    again = resume(state_of(sim))
    for each in (sim, again):
        steps(each, 10.0)
    assert again.bodies.state_hash() == sim.bodies.state_hash()
    assert scenario_of(pack(sim.scenario)).ground == sim.scenario.ground


def ridge(folder: Path, flight: str = 'failsafe = "rtl"', z: tuple[float, float] = (20.0, 6.0)) -> Simulator:
    """A ridge of 12 m in the south, west of which copters are at home; one is low in the east now, where it came by way
    of the north, and one at home. z: at which it went there, and is."""
    across = np.interp(np.arange(100) + 0.5, (35.0, 50.0, 65.0), (0.0, 65_535.0, 0.0))
    grey = np.tile(np.round(across).astype(np.uint16), (40, 1))
    grey[:20] = 0
    Image.fromarray(grey).save(folder / "hills.png")
    text = HILLS.replace("FILE", str(folder / "hills.png")).replace('"9m"', '"6m"').replace('"20m" }]', '"6m" }]')
    sim = Simulator(read_scenario(text.replace('like = "copter"', f'like = "copter"\nflight = {{ {flight} }}')))
    for x, y, height in ((36.0, 35.0, z[0]), (80.0, 35.0, z[0]), (80.0, 10.0, z[1])):
        go(sim, LOW, x, y, height)
        steps(sim, 30.0)
    return sim


def test_who_returns_home_rises_over_a_hill_before_it_sets_out(tmp_path: Path) -> None:
    sim, both = ridge(tmp_path), np.array([LOW, HIGH])
    sim.robots.let_go(both)
    z = []
    while sim.x[LOW] > 79.0:
        steps(sim, 0.1)
        z.append(sensed(sim, "z")[LOW])
    highest = 2.0 + 10.0 * 14.5 / 15.0
    assert z[-1] == pytest.approx(highest + 0.5 + 2 * 0.5, abs=0.1), "over the ridge by its floor and its size"
    steps(sim, 70.0)
    assert (sim.x[LOW], sim.y[LOW]) == (pytest.approx(30.0, abs=0.1), pytest.approx(10.0, abs=0.1))
    assert (sensed(sim, "height")[LOW], sensed(sim, "crashed")[LOW]) == (0.0, 0.0)
    assert sensed(sim, "height")[HIGH] == 0.0, "at home it lands"


def test_who_is_driven_while_it_rises_does_not_return(tmp_path: Path) -> None:
    sim = ridge(tmp_path)
    sim.robots.let_go(np.array([LOW]))
    steps(sim, 2.0)
    sim.act("drive_speed", np.array([LOW]), np.array([0.0]))
    steps(sim, 20.0)
    assert sim.x[LOW] > 79.0


def test_who_cannot_rise_over_the_ground_on_its_way_home_says_so_and_lands(tmp_path: Path) -> None:
    sim = ridge(tmp_path, 'failsafe = "rtl", ceiling = "8m"', (6.0, 6.0))
    sim.robots.let_go(np.array([LOW]))
    assert [each.text for each in sim.news] == ["nobody drives it any more: it returns home and lands", TOO_HIGH]
    steps(sim, 20.0)
    assert (sensed(sim, "height")[LOW], sensed(sim, "crashed")[LOW]) == (0.0, 0.0)
    assert sim.x[LOW] == pytest.approx(80.0, abs=0.1)


def test_worlds_with_a_ground_map_are_the_same_together_and_alone(tmp_path: Path) -> None:
    text = written_text(tmp_path)
    together = sc.open_many(text, seeds=[3, 4], quiet=True)
    orders = (
        "(WHEN (AND (= id 1) (NOT flying)) (TAKEOFF 5m))",
        "(RULE stroll (WHEN (PROB 10%) (SETQ drive_speed 0.5m/s) (SETQ drive_turn (RANDOM -1 1))))",
        "(RULE shy (WHEN (> (COUNT 15m) 0) (SETQ drive_turn (* 0.1 (COUNT 15m)))))",
        "(WHEN (= id 2) (GOTO 80m 10m))",
    )
    for order in orders:
        together.send(order, everybody=True, wait=0)
        together.run(10.0, quiet=True)
    for number, seed in enumerate((3, 4)):
        alone = sc.open(text, seed=seed, threads=1)
        for order in orders:
            alone.send(order, everybody=True, wait=0)
            alone.run(10.0, quiet=True)
        assert alone.snapshot() == together[number].snapshot()
    assert together[0].snapshot() != together[1].snapshot()


def test_on_a_torus_nobody_meets_a_cliff_at_the_edge(tmp_path: Path) -> None:
    sim = hills(tmp_path, ('height = "40m"', 'height = "40m"\nedge = "torus"'))
    go(sim, HIGH, 95.0, 30.0)
    heights = []
    for _ in range(250):
        steps(sim, 0.1)
        heights.append(sensed(sim, "height")[HIGH])
    assert sim.x[HIGH] == pytest.approx(95.0)
    assert heights[-1] == pytest.approx(8.0, abs=1e-3)
    assert sensed(sim, "crashed")[HIGH] == 0.0


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (('{ file = "FILE", low = "2m", high = "12m" }', '"FILE"'), "high"),
        (("FILE", "none.png"), "there is no file"),
        (('high = "12m"', 'high = "12s"'), "length"),
        (('low = "2m"', 'low = "-2m"'), "low"),
        (('low = "2m"', 'low = "13m"'), "world.ground.high: wanted at least low, 13 m"),
    ],
)
def test_what_is_no_ground_is_refused(tmp_path: Path, change: tuple[str, str], why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        written(tmp_path, change)


@pytest.mark.parametrize(("pixel", "fits"), [((9, 9, 9), True), ((9, 9, 8), False), ((9, 9, 9, 200), False)])
def test_a_ground_has_greys_and_neither_colours_nor_holes(tmp_path: Path, pixel: tuple[int, ...], fits: bool) -> None:
    Image.fromarray(np.full((4, 4, len(pixel)), pixel, np.uint8)).save(tmp_path / "plain.png")
    text = HILLS.replace("FILE", str(tmp_path / "plain.png"))
    if fits:
        assert read_scenario(text).ground_at(5.0, 5.0) == pytest.approx(2.0 + 10.0 * 9.0 / 255.0)
        return
    with pytest.raises(SettingsError, match="a picture in colours, or partly transparent: wanted greys alone"):
        read_scenario(text)


def test_a_ground_without_anybody_in_the_air_is_refused(tmp_path: Path) -> None:
    text = HILLS.replace("FILE", str(ramp(tmp_path)))
    start, end = text.index('[[robots]]\nlike = "copter"'), text.index('[[robots]]\ntype = "rover"')
    with pytest.raises(SettingsError, match="only copters and planes know how high the ground is"):
        read_scenario(text[:start] + text[end:])
