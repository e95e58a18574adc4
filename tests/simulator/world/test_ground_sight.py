"""What a ground map hides: from neighbours, lights, pings, cameras and the radio, as a plain reference says."""

from __future__ import annotations

from math import inf
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from machines import MACHINES
from sleepcast.console.adapters.sight import sight_now
from sleepcast.loop import Swarm
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.bodies.looking_down import DownCameras
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.world import ground_sight as module
from sleepcast.simulator.world.grey_picture import Picture, Stretched
from sleepcast.simulator.world.ground_sight import HidingGround
from swarms import swarm_of

WORLD = """
format = 2
title = "a ridge"
seconds = "1min"
tick = "0.1s"

[world]
width = "100m"
height = "40m"
ground = { file = "hills.png", high = "10m" }

[[robots]]
like = "copter"
starts = [{ x = "20m", y = "20m", z = "6m" }, { x = "80m", y = "20m", z = "6m" }, { x = "80m", y = "25m", z = "25m" }]

[robots.camera]
angle = "170deg"

[[robots]]
type = "rover"
motion = "still"
limits = { speed = "1m/s", turn_rate = "90deg/s", acceleration = "1m/s2" }
body = { radius = "0.3m" }
starts = [["20m", "24m", "0deg"], ["80m", "24m", "0deg"], ["46m", "24m", "0deg"]]

[neighbours]
reach = "90m"

[lights.lamp]
x = "30m"
y = "20m"
reach = "90m"
"""
WEST, EAST, ABOVE, NEAR, FAR, SLOPE = range(6)


def world(folder: Path, change: tuple[str, str] = ("", ""), machine: Machine | None = None) -> Simulator:
    """A ridge of 10 m across the middle, 20 m wide."""
    across = np.interp(np.arange(100) + 0.5, (40.0, 50.0, 60.0), (0.0, 65_535.0, 0.0))
    Image.fromarray(np.tile(np.round(across).astype(np.uint16), (40, 1))).save(folder / "hills.png")
    assert change[0] in WORLD
    (folder / "scenario.toml").write_text(WORLD.replace(*change), encoding="utf-8")
    return Simulator(load(folder), machine=machine)


def counts(simulator: Simulator) -> list[float]:
    """How many neighbours each robot senses."""
    swarm = Swarm(simulator)
    swarm.step()
    return [swarm.minds[name].evaluate("(COUNT 90m)").value for name in simulator.names]


@pytest.mark.parametrize("machine", MACHINES)
def test_a_ridge_hides_neighbours_from_each_other_and_who_is_higher_sees_over_it(
    tmp_path: Path, machine: Machine
) -> None:
    west, east = 3.0, 2.0  # who is above sees over the ridge, but not who stands close behind it
    assert counts(world(tmp_path, machine=machine)) == [west, east, 4.0, west, east, 2.0]
    flat = world(tmp_path, ('high = "10m"', 'high = "0m"'), machine)
    assert counts(flat) == [5.0] * 6
    through = world(tmp_path, ("[neighbours]", "[sight]\nneighbours = false\n\n[neighbours]"), machine)
    assert counts(through) == [5.0] * 6


def test_it_hides_lights_and_what_cameras_look_at(tmp_path: Path) -> None:
    simulator = world(tmp_path)
    cameras = simulator.senses.of(DownCameras)
    assert cameras.lights(np.array([WEST, EAST, ABOVE])).tolist() == [1.0, 0.0, 1.0]
    through = world(tmp_path, ("[neighbours]", "[sight]\nlights = false\n\n[neighbours]"))
    assert through.senses.of(DownCameras).lights(np.array([WEST, EAST, ABOVE])).tolist() == [1.0, 1.0, 1.0]


def test_beams_end_at_it(tmp_path: Path) -> None:
    laser = '[laser]\nbeams = 4\nrange = "60m"\n\n[neighbours]'
    simulator = world(tmp_path, ("[neighbours]", laser))
    headings = simulator.bodies.heading
    headings[:] = 0.0
    scans = simulator.scans(np.array([WEST, EAST, ABOVE]))
    ahead = int(np.argmin(np.abs(np.array(simulator.scenario.laser.angles))))  # type: ignore[union-attr]
    assert scans[0, ahead] == pytest.approx(26.5, abs=0.5), "where the ridge is half a metre higher than it flies"
    assert np.isinf(np.delete(scans[0], ahead)).sum() >= 2
    headings[:] = np.pi
    simulator.bodies.forget()
    scans = simulator.scans(np.array([WEST, EAST, ABOVE]))
    assert scans[1, ahead] == pytest.approx(26.5, abs=0.5)
    assert scans[2, ahead] == np.inf, "it flies higher"


def test_for_the_radio_it_is_one_wall(tmp_path: Path) -> None:
    for wall, heard in (("0", False), ("1", True)):
        simulator = world(tmp_path, ("[neighbours]", f"[radio]\nwall = {wall}\nreach = '90m'\n\n[neighbours]"))
        swarm = swarm_of(simulator.scenario)
        sight = swarm.simulator.bodies.sight
        ends = np.array([20.0]), np.array([20.0]), np.array([80.0]), np.array([20.0])
        assert sight.count_between(*ends, (np.array([3.0]), np.array([3.0]))).tolist() == [1]
        assert sight.count_between(*ends, (np.array([3.0]), np.array([25.0]))).tolist() == [0]
        swarm.evaluate(swarm.simulator.names[WEST], "(TELL `(JOIN heard))")
        swarm.run(0.5)
        assert ("heard" in swarm.minds[swarm.simulator.names[EAST]].groups) == heard
        assert "heard" in swarm.minds[swarm.simulator.names[ABOVE]].groups


def rolling(seed: int) -> tuple[Picture, Stretched]:
    """HidingGround of some pixels' width, 20 m high."""
    drawn = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 60), np.linspace(0.0, 1.0, 40))
    waves = sum(np.sin(a * x + b * y + c) for a, b, c in drawn.uniform((4.0, 4.0, 0.0), (20.0, 20.0, 6.0), (6, 3)))
    grey = np.rint(255.0 * (waves - waves.min()) / np.ptp(waves)).astype(np.uint8)
    picture = Picture(60, 40, grey.tobytes().hex(), 0.0, 20.0)
    return picture, Stretched(picture, (100.0, 48.0))


@pytest.mark.parametrize("seed", range(3))
def test_lines_stop_where_the_ground_first_rises_above_them_whichever_way(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture, terrain = rolling(seed)
    hills, drawn = HidingGround(picture, terrain, (100.0, 48.0), 0.5), np.random.default_rng(100 + seed)
    (x, to_x), (y, to_y) = drawn.uniform(0.0, 100.0, (2, 400)), drawn.uniform(0.0, 48.0, (2, 400))
    z, to_z = (terrain.at(*at)[0] + drawn.uniform(0.0, 9.0, 400) for at in ((x, y), (to_x, to_y)))
    shares = hills.stops((x, y, to_x, to_y), (z, to_z))
    fine = np.linspace(0.0, 1.0, 4001)[1:-1]
    for line in range(400):
        along = [a[line] + fine * (b[line] - a[line]) for a, b in ((x, to_x), (y, to_y), (z, to_z))]
        over = terrain.at(along[0], along[1])[0] - along[2] - 0.5
        if abs(over.max()) > 0.3:  # it may look past the very top of a hill
            assert (shares[line] < inf) == (over.max() > 0.0)
        if shares[line] < inf:
            pixels = max(abs(to_x[line] - x[line]) / (100.0 / 60.0), abs(to_y[line] - y[line]) / (48.0 / 40.0))
            first = fine[np.argmax(over > 0.0)]
            assert first - 1e-3 <= shares[line]
            assert over[min(3998, round(4000 * shares[line]))] > -0.1
            assert shares[line] - first < 0.5 / pixels + 1e-3 or over[fine < shares[line] - 0.5 / pixels].max() < 0.3
    assert 50 < (shares < inf).sum() < 350
    back = hills.hide((to_x, to_y, x, y), (to_z, z))
    assert back.tolist() == (shares < inf).tolist()
    monkeypatch.setattr(module, "AT_ONCE", 50)
    assert hills.stops((x, y, to_x, to_y), (z, to_z)).tolist() == shares.tolist()


def test_nobody_and_lines_without_length_are_not_hidden() -> None:
    picture, terrain = rolling(1)
    hills, none, one = HidingGround(picture, terrain, (100.0, 48.0), 0.5), np.empty(0), np.array([30.0])
    assert hills.hide((none,) * 4, (none, none)).tolist() == []
    assert hills.hide((one,) * 4, (one * 0.0, one * 0.0)).tolist() == [False]


def test_the_page_shows_where_the_ridge_hides(tmp_path: Path) -> None:
    simulator = world(tmp_path)
    view = sight_now(simulator, WEST)
    stops = {line.robot: line.stop for line in view.lines if line.sense == "neighbours" and line.stop is not None}
    assert stops.keys() == {EAST, FAR}
    assert stops[EAST] == pytest.approx((46.5, 20.0), abs=0.5), "where it is half a metre higher than the line"
