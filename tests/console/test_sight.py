"""What a robot sees, as the map shows it: in a swarm, in its past and in a recording of it."""

from __future__ import annotations

import asyncio
from math import hypot
from pathlib import Path

import msgspec
import numpy as np
import pytest

import sleepcast as sc
from console.asking import put
from sleepcast.console.adapters.live_past import LivePast
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.console.adapters.sight import sight_now
from sleepcast.console.adapters.swarm import SwarmAdapter, scene_of
from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver
from sleepcast.console.features.sight import MAX_SIGHT_LINES, Seen, Sight, SightLine, SightView
from sleepcast.console.features.time import ShowMoment
from sleepcast.console.replay import ReplayBackend, ReplayDriver
from sleepcast.console.swarm_dialogue import SwarmDialogue
from sleepcast.core.clock import ManualClock, WallClock
from sleepcast.core.errors import MisuseError
from sleepcast.loop import Pace, Swarm
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.recording.recording import load_recording
from small_worlds import SMALL, write
from swarms import desk_of, station_of

TEXT = SMALL.replace("format = 1", "format = 2").replace('"1km"', '"20m"').replace('"500m"', '"5m"')
TEXT = TEXT.replace('y = "400m"', 'y = "4m"').replace('radius = "0.5m"', 'radius = "0.25m"')
TEXT = TEXT.replace("count = 20", 'count = 3\nstarts = [["8m", "10m"], ["12m", "10m"], ["8m", "14m"]]')
WALL = '\n[[world.walls]]\nname = "wall"\npoints = [["10m", "4m"], ["10m", "11.5m"]]\n'
NEAR = '\n[neighbours]\nreach = "6m"\n'
LAMPS = """
[lights.behind]
x = "12m"
y = "8m"

[lights.far]
x = "8m"
y = "1m"
reach = "8m"

[lights.seen]
x = "4m"
y = "10m"
"""
LASER = '\n[laser]\nbeams = 72\nrange = "6m"\n'
PINGS = '\n[pings]\nreach = "6m"\n'


def simulator(folder: Path, more: str, *changes: tuple[str, str]) -> Simulator:
    return Simulator(load(write(folder, *changes, more=more, text=TEXT)))


def to(view: SightView, sense: str) -> dict[int, tuple[float, float] | None]:
    """Where each robot is hidden from this sense, None for those that are noticed."""
    return {line.robot: line.stop for line in view.lines if line.sense == sense}


def test_walls_hide_neighbours_and_lights_where_they_stand(tmp_path: Path) -> None:
    sim = simulator(tmp_path, WALL + NEAR + LAMPS)
    before = sim.state_hash()
    view = sight_now(sim, 0)
    assert sim.state_hash() == before
    assert to(view, "neighbours") == {1: (pytest.approx(10.0), 10.0), 2: None}
    assert [line for line in view.lines if line.sense == "lights"] == [
        SightLine("lights", -1, 4.0, 10.0, None),
        SightLine("lights", -1, 12.0, 8.0, (pytest.approx(10.0), pytest.approx(9.0))),
    ]
    assert to(sight_now(sim, 2), "neighbours") == {0: None, 1: None}, "past the end of the wall"
    assert scene_of(sim.scenario, ("a", "b", "c")).senses == ("neighbours", "lights")


def test_the_area_ends_at_walls_and_at_the_reach(tmp_path: Path) -> None:
    view = sight_now(simulator(tmp_path, WALL + NEAR), 0)
    corners = np.array(view.area)
    assert corners[:, 0].max() > 12.7, "beyond the upper end of the wall"
    beside = corners[(corners[:, 1] > 4.1) & (corners[:, 1] < 11.4)]
    assert beside[:, 0].max() == pytest.approx(10.0)
    away = [hypot(x - view.x, y - view.y) for x, y in view.area]
    assert max(away) == pytest.approx(6.0, abs=1e-3)
    assert any(corner == pytest.approx((10.0, 11.5), abs=1e-3) for corner in view.area), "the end itself"
    assert sight_now(simulator(tmp_path, NEAR), 0).area == (), "nothing hides anything"
    whole = np.array(sight_now(simulator(tmp_path, WALL + NEAR.replace("6m", "40m")), 0).area)
    assert (whole.min(), whole.max()) == (0.0, 20.0)
    assert [20.0, 0.0] not in whole.tolist(), "in the shadow of the wall"
    assert [20.0, 20.0] in whole.tolist()


def test_of_format_1_nothing_hides(tmp_path: Path) -> None:
    view = sight_now(simulator(tmp_path, WALL + NEAR, ("format = 2", "format = 1")), 0)
    assert (to(view, "neighbours"), view.area) == ({1: None, 2: None}, ())


def test_bodies_hide_pings_and_lights_where_the_scenario_says_so(tmp_path: Path) -> None:
    starts = ('["12m", "10m"], ["8m", "14m"]', '["9m", "10m"], ["12m", "10m"]')
    hide = "\n[sight]\nbodies_hide = true\n"
    view = sight_now(simulator(tmp_path, PINGS + NEAR + hide, starts), 0)
    assert to(view, "pings") == {1: None, 2: (pytest.approx(8.75), 10.0)}
    assert to(view, "neighbours") == {1: None, 2: None}
    assert to(sight_now(simulator(tmp_path, PINGS, starts), 0), "pings") == {1: None, 2: None}


def test_on_a_torus_the_shortest_way_counts(tmp_path: Path) -> None:
    torus = ('height = "20m"', 'height = "20m"\nedge = "torus"')
    starts = ('["8m", "10m"], ["12m", "10m"]', '["1m", "10m"], ["18m", "10m"]')
    wall = WALL.replace('"10m"', '"19m"')
    view = sight_now(simulator(tmp_path, wall + NEAR, torus, starts), 0)
    assert view.lines[0] == SightLine("neighbours", 1, -2.0, 10.0, (pytest.approx(-1.0), 10.0))
    assert min(x for x, _ in view.area) == pytest.approx(1.0 - 0.8 * 6.0, abs=0.01), "past its upper end"


def test_beams_of_a_scanner_end_at_what_they_meet(tmp_path: Path) -> None:
    sim = simulator(tmp_path, WALL + LASER, ('["8m", "10m"]', '["8m", "10m", "0deg"]'))
    before = sim.state_hash()
    points = np.array(sight_now(sim, 0).scan)
    assert sim.state_hash() == before
    assert [10.0, 10.0] in points.tolist(), "the wall ahead"
    walls = points[points[:, 1] < 11.6]
    assert len(walls) > 5
    assert walls[:, 0] == pytest.approx(10.0, abs=1e-3)
    beside = points[points[:, 1] > 11.6]
    assert np.hypot(beside[:, 0] - 8.0, beside[:, 1] - 14.0) == pytest.approx(0.25, abs=1e-3), "the robot above"
    assert scene_of(sim.scenario, ()).senses == ("scanner",)


def test_only_robots_with_a_light_sensor_see_lights(tmp_path: Path) -> None:
    groups = (
        "[robots.stores.battery]",
        "[robots.groups.blind]\ncount = 1\nsees_light = false\n\n[robots.groups.keen]\ncount = 2\n\n"
        "[robots.stores.battery]",
    )
    sim = simulator(tmp_path, LAMPS, groups)
    assert not sight_now(sim, 0).lines
    assert len(sight_now(sim, 1).lines) == 2


def test_no_more_lines_than_can_be_told_apart(tmp_path: Path) -> None:
    many = ('count = 3\nstarts = [["8m", "10m"], ["12m", "10m"], ["8m", "14m"]]', "count = 400")
    view = sight_now(simulator(tmp_path, NEAR.replace("6m", "30m"), many), 7)
    away = [hypot(line.x - view.x, line.y - view.y) for line in view.lines]
    assert (len(away), away) == (MAX_SIGHT_LINES, sorted(away))


def test_a_recording_shows_what_was_seen_then_also_past_walls_that_move(tmp_path: Path) -> None:
    file, folder = tmp_path / "run.mcap", tmp_path / "world"
    folder.mkdir()
    event = '\n[[events]]\nat = "2s"\nremove = "wall"\n'
    scenario = str(write(folder, more=WALL + NEAR + LAMPS + event, text=TEXT))
    views = []
    with sc.open(scenario, seed=2) as fleet, fleet.record(file, pictures=0.1):
        fleet.send("(DRIVE 1m/s 0deg/s)", everybody=True)
        for _ in range(2):
            fleet.run(1.5)
            views.append((fleet.time, sight_now(fleet.swarm.simulator, 0)))
    timeline = load_timeline(load_recording(file))
    desk = ReplayBackend(timeline, ReplayDriver(timeline, ManualClock()))
    for time, wanted in (*views, views[0]):
        desk.seek(time)
        found = put(desk, Sight, 1, 0).sight
        assert [(line.sense, line.robot, line.stop is None) for line in found.lines] == [
            (line.sense, line.robot, line.stop is None) for line in wanted.lines
        ]
        assert (found.x, found.y) == pytest.approx((wanted.x, wanted.y), abs=1e-5)
        assert len(found.area) == len(wanted.area)
    assert views[0][1].area
    assert not views[1][1].area
    with pytest.raises(MisuseError, match="numbered from 0 to 2"):
        put(desk, Sight, 1, 3)


def test_a_moment_of_the_past_is_run_again(tmp_path: Path) -> None:
    swarm = Swarm(simulator(tmp_path, WALL + NEAR, ("seed = 3", "seed = 4")))
    swarm.desk = station_of(swarm)
    station, view, clock = desk_of(swarm), SwarmAdapter(swarm), WallClock()
    past = LivePast(view, swarm, station, clock)
    dialogue = SwarmDialogue(Backend(view, station, Driver(view, Pace(clock, swarm, 1.0), clock), clock, past=past))
    then = sight_now(swarm.simulator, 0)
    for _ in range(4):
        swarm.step()
    swarm.simulator.place(0, 8.0, 2.0, 0.0)
    now = dialogue.answer(Sight(1, 0))
    assert isinstance(now, Seen)
    assert now.sight.y == 2.0

    async def look() -> None:
        dialogue.answer(ShowMoment(past.tick))
        said = await dialogue.answer(Sight(2, 0))  # type: ignore[misc]
        assert msgspec.json.decode(bytes(said), type=Seen).sight == then
        dialogue.leave()

    asyncio.run(look())
    past.close()


def test_a_world_whose_robots_see_nobody_has_nothing_to_tell(tmp_path: Path) -> None:
    sim = simulator(tmp_path, WALL)
    assert scene_of(sim.scenario, ("a", "b", "c")).senses == ()
    assert sight_now(sim, 0) == SightView(8.0, 10.0, (), ())
