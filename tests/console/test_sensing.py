"""What a robot's body senses, as the page is told: in a swarm and in a recording of it."""

from __future__ import annotations

from math import hypot, inf, pi
from pathlib import Path

import pytest

import sleepcast as sc
from console.asking import put
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.console.adapters.swarm import kind_of, sensing_of
from sleepcast.console.features.sense import Sense
from sleepcast.console.replay import ReplayBackend, ReplayDriver
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import load
from sleepcast.simulator.recording.recording import load_recording
from small_worlds import SCOUTS, scouts, write

SLIPPING = ('track = "0.3452m"', 'track = "0.3452m"\nslip_left = 0.1')


def test_sonars_encoders_and_bumper_of_a_scout(tmp_path: Path) -> None:
    simulator = scouts(tmp_path, SLIPPING)
    simulator.place(0, 10.0, 6.0, 0.0)
    seen = sensing_of(simulator, 0)
    assert seen.sonars[0] == pytest.approx(12.0 - 10.0 - 0.17, abs=0.02)  # the wall ahead, from the rim
    assert len(seen.sonars) == 16
    assert seen.believed == pytest.approx(seen.pose)
    assert seen.touched == ()
    simulator.robots[0].drive(1.0, 0.0)
    for _ in range(30):
        simulator.step()
    before = simulator.state_hash()
    seen = sensing_of(simulator, 0)
    assert simulator.state_hash() == before
    assert seen.believed is not None
    assert hypot(seen.believed[0] - seen.pose[0], seen.believed[1] - seen.pose[1]) > 0.02  # the left wheel slips
    assert seen.touched[0] == pytest.approx(-seen.pose[2], abs=0.1)  # the wall lies in the direction of x
    assert -pi <= seen.touched[0] <= pi


def test_bodies_without_sonars_and_wheels_have_none() -> None:
    with sc.open("couzin", robots=5, seed=1) as fleet:
        seen = sensing_of(fleet.swarm.simulator, 4)
        assert (seen.believed, seen.sonars, seen.touched) == (None, (), ())
        scenario = fleet.swarm.simulator.scenario
        assert scenario.neighbours is not None
        assert seen.reaches == (("neighbours", scenario.neighbours.reach),) or scenario.neighbours.reach == inf


def test_each_sort_has_its_own_body(tmp_path: Path) -> None:
    scenario = load(write(tmp_path, text=SCOUTS))
    kind = kind_of(scenario, scenario.robots)
    assert (kind.radius, kind.encoders, kind.sonars) == (0.17, True, 16)
    assert kind.sensing((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), [float("nan"), 2.5]).sonars == (None, 2.5)


def test_a_recording_holds_what_bodies_sensed(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    folder = tmp_path / "scouts"
    folder.mkdir()
    scenario = str(write(folder, SLIPPING, text=SCOUTS))
    with sc.open(scenario, seed=2) as fleet, fleet.record(file, pictures=0.5, readings=1.0):
        fleet.send("(DRIVE 0.5m/s 20deg/s)", everybody=True)
        fleet.run(3)
        wanted = sensing_of(fleet.swarm.simulator, 0)
    timeline = load_timeline(load_recording(file))
    desk = ReplayBackend(timeline, ReplayDriver(timeline, ManualClock()))
    desk.seek(timeline.seconds)
    found = put(desk, Sense, 1, 0).body
    assert found.sonars == pytest.approx(wanted.sonars)
    assert found.believed == pytest.approx(wanted.believed)
    assert found.pose == pytest.approx(wanted.pose, abs=1e-5)
    with pytest.raises(MisuseError, match="does not hold"):
        put(desk, Sense, 1, 7)
