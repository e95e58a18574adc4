"""Bodies that fly: take-offs, places, limits of height, STOP, landings; the same for one and for many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import nan, pi
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from machines import MACHINES
from simulated import outcome, refused, sensed, steps
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.console.frames import places_of
from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm
from sleepcast.robot import Failsafe, FencedError, Setpoint, hovering
from sleepcast.simulator import Simulator, SingleRobot, limited, read_scenario
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.recording.foxglove import read_heights
from sleepcast.simulator.recording.recording import entries, load_recording
from sleepcast.simulator.snapshot import resume, state_of

SKY = """
format = 2
title = "a sky"
seconds = "1min"
tick = "0.1s"

[world]
width = "60m"
height = "60m"

[robots]
like = "copter"
starts = [["10m", "10m", "0deg"], ["20m", "10m", "90deg", "high", "8m"], ["30m", "10m", "180deg"]]
"""
SHORT = '[robots.flight]\nhovers = "{}"\nclimb = "1m/s"\nceiling = "30m"\nheight = "5m"\nsink = "0.5m/s"\n'
LOW, HIGH = 0, 1
"""The first robot stands on the ground, the second one hovers."""


def sky(machine: Machine | None = None, text: str = SKY) -> Simulator:
    return Simulator(read_scenario(text), machine=machine)


def test_robots_start_on_the_ground_or_hover_where_their_start_says() -> None:
    simulator = sky()
    steps(simulator, 1.0)
    low, high = sensed(simulator, LOW), sensed(simulator, HIGH)
    assert (low["z"], low["height"], low["armed"], low["flying"]) == (0.0, 0.0, 0.0, 0.0)
    assert (high["z"], high["height"], high["armed"], high["flying"]) == (8.0, 8.0, 1.0, 1.0)
    assert (high["x"], high["y"]) == (20.0, 10.0)
    assert simulator.heights is not None
    assert simulator.heights.tolist() == [0.0, 8.0, 0.0]


def test_a_flight_from_the_ground_to_a_place_and_back() -> None:
    simulator = sky()
    body = simulator.robots[LOW]
    body.take_off(2.0)
    steps(simulator, 1.0)
    rising = sensed(simulator, LOW)
    assert rising["armed"] == rising["flying"] == 1.0
    assert rising["climb_rate"] == pytest.approx(1.0)
    steps(simulator, 4.0)
    assert sensed(simulator, LOW)["height"] == pytest.approx(2.0, abs=1e-6)
    body.go_to(16.0, 18.0, 5.0)
    steps(simulator, 12.0)
    there = sensed(simulator, LOW)
    assert [there[name] for name in ("x", "y", "z")] == pytest.approx([16.0, 18.0, 5.0], abs=1e-3)
    assert there["heading"] == 0.0, "on the way to a place it keeps its heading"
    body.touch_down()
    steps(simulator, 20.0)
    landed = sensed(simulator, LOW)
    assert (landed["z"], landed["armed"], landed["flying"], landed["climb_rate"]) == (0.0, 0.0, 0.0, 0.0)


def test_four_numbers_drive_it_and_a_place_ends_them() -> None:
    simulator = sky()
    body = simulator.robots[HIGH]
    body.act(Setpoint(speed=3.0, turn_rate=0.0, side=4.0, climb=0.5))
    steps(simulator, 4.0)
    flies = sensed(simulator, HIGH)
    assert flies["speed"] == pytest.approx(3.0), "the limit is that of the vector, 5 m/s"
    assert flies["climb_rate"] == pytest.approx(0.5)
    assert simulator.y[HIGH] > 15.0, "it looks to the north"
    assert simulator.x[HIGH] < 16.0, "its left is in the west"
    body.act(Setpoint(turn_rate=-0.5))
    steps(simulator, 1.0)
    assert sensed(simulator, HIGH)["turn_rate"] == pytest.approx(-0.5)
    assert simulator.bodies.heading[HIGH] == pytest.approx(pi / 2.0 - 0.5)
    z = sensed(simulator, HIGH)["z"]
    body.go_to(20.0, 20.0)
    steps(simulator, 15.0)
    there = sensed(simulator, HIGH)
    assert [there[name] for name in ("x", "y", "speed", "climb_rate")] == pytest.approx([20, 20, 0, 0], abs=1e-6)
    assert there["z"] == pytest.approx(z, abs=0.2), "at the height where it was"


def test_it_comes_to_rest_before_floor_ceiling_and_edges() -> None:
    simulator = sky()
    body, limits = simulator.robots[HIGH], simulator.model.limits
    for climb, end in ((-1.0, limits.floor), (1.0, limits.ceiling)):
        body.act(Setpoint(climb=climb))
        heights = []
        for _ in range(400):
            simulator.step()
            heights.append(float(simulator.bodies.flight.z[HIGH]) if simulator.bodies.flight else nan)
        assert limits.floor <= min(heights) <= max(heights) <= limits.ceiling
        assert heights[-1] == pytest.approx(end, abs=0.01)
    body.act(Setpoint(speed=0.0, side=-5.0, climb=0.0))
    xs = []
    for _ in range(150):
        simulator.step()
        xs.append(float(simulator.x[HIGH]))
    assert max(xs) <= 60.0
    assert xs[-1] == pytest.approx(60.0, abs=0.01)
    assert max(np.abs(np.diff(np.diff(xs)))) <= limits.acceleration * 0.1**2 + 1e-9


def test_stop_hovers_and_nothing_moves_it_until_the_release() -> None:
    simulator = sky()
    body = simulator.robots[HIGH]
    body.act(Setpoint(speed=5.0, climb=1.0))
    steps(simulator, 3.0)
    body.stop()
    steps(simulator, 4.0)
    assert body.rest_state().at_rest
    before = sensed(simulator, HIGH)
    body.take_off(20.0), body.go_to(1.0, 1.0), body.touch_down(), body.act(Setpoint(climb=1.0))
    assert refused(body.arm) == "it is stopped: RELEASE it first"
    steps(simulator, 2.0)
    after = sensed(simulator, HIGH)
    assert {name: after[name] for name in "xyz"} == {name: before[name] for name in "xyz"}
    body.release()
    steps(simulator, 1.0)
    assert sensed(simulator, HIGH)["z"] == before["z"], "nothing old resumes"
    body.climb(0.5)
    steps(simulator, 2.0)
    assert sensed(simulator, HIGH)["z"] > before["z"]


def test_stop_on_the_way_up_and_down_holds_the_height() -> None:
    simulator = sky()
    low, high = simulator.robots[LOW], simulator.robots[HIGH]
    low.take_off(10.0), high.touch_down()
    steps(simulator, 3.0)
    low.stop(), high.stop()
    steps(simulator, 2.0)
    heights = sensed(simulator, LOW)["z"], sensed(simulator, HIGH)["z"]
    steps(simulator, 2.0)
    assert (sensed(simulator, LOW)["z"], sensed(simulator, HIGH)["z"]) == heights
    assert 1.0 < heights[0] < 4.0
    assert 6.0 < heights[1] < 8.0


def test_what_it_does_not_do_it_refuses_in_the_words_of_a_real_one() -> None:
    simulator = sky()
    low, high = simulator.robots[LOW], simulator.robots[HIGH]
    assert refused(lambda: low.go_to(1.0, 1.0)) == hovering.GROUNDED
    assert refused(lambda: low.climb(0.5)) == hovering.GROUNDED
    assert refused(high.disarm) == hovering.FLYING
    assert refused(lambda: low.take_off(31.0)) == "it flies from 0.5 to 30 m high, not at 31 m"
    assert refused(lambda: high.go_to(1.0, 1.0, 0.2)) == "it flies from 0.5 to 30 m high, not at 0.2 m"
    with pytest.raises(FencedError, match=r"\(70, 1\) m lies outside of the fence"):
        high.go_to(70.0, 1.0)
    high.touch_down()
    assert refused(lambda: high.go_to(1.0, 1.0)) == hovering.LANDING
    high.go_to(1.0, 1.0, 6.0)
    steps(simulator, 20.0)
    assert sensed(simulator, HIGH)["z"] == pytest.approx(6.0)


def test_a_battery_is_used_up_by_hovering_and_lands_it_when_empty() -> None:
    simulator = sky(text=SKY + SHORT.format("10s"))
    simulator.robots[HIGH].hold(True)
    steps(simulator, 5.0)
    assert sensed(simulator, HIGH)["battery"] == pytest.approx(0.5)
    assert sensed(simulator, LOW)["battery"] == 1.0, "on the ground it uses nothing"
    steps(simulator, 6.0)
    assert sensed(simulator, HIGH)["climb_rate"] == -0.5
    exhausted = simulator.exhausted()
    assert exhausted is not None
    assert exhausted.tolist() == [False, True, False]
    steps(simulator, 20.0)
    assert sensed(simulator, HIGH)["z"] == 0.0
    assert "its battery is empty" in refused(lambda: simulator.robots[HIGH].take_off(3.0))


def test_a_battery_that_only_the_way_uses_up_lets_nobody_take_off_either() -> None:
    text = (
        SKY.replace('like = "copter"', 'type = "glider"\nbody = { radius = "0.5m" }').replace('"8m"', '"1m"')
        + """
limits = { speed = "5m/s", turn_rate = "1rad/s", acceleration = "2m/s2" }
flight = { climb = "1m/s", ceiling = "30m", height = "5m" }
stores.battery = { start = ["100%", "100%"], reach = "10m" }
"""
    )
    simulator = sky(text=text)
    simulator.robots[HIGH].go_to(20.0, 40.0)
    steps(simulator, 6.0)
    assert sensed(simulator, HIGH)["z"] == 0.0
    assert "its battery is empty" in refused(lambda: simulator.robots[HIGH].take_off(3.0))
    assert refused(lambda: simulator.robots[HIGH].go_to(20.0, 20.0)) == hovering.GROUNDED


@pytest.mark.parametrize("wanted", [1e200, -1e300])
def test_who_is_driven_at_any_speed_flies_as_fast_as_it_may(wanted: float) -> None:
    simulator = sky()
    simulator.robots[HIGH].act(Setpoint(side=wanted))
    steps(simulator, 3.0)
    flight = simulator.bodies.flight
    assert flight is not None
    assert abs(flight.velocity_x[HIGH]) == pytest.approx(5.0)


def test_a_robot_that_is_gone_leaves_nothing_in_the_air() -> None:
    with sc.open(SKY.replace('like = "copter"', 'like = "copter"\nhatch = true')) as fleet:
        fleet.send("(WHEN (NOT flying) (TAKEOFF 8m))")
        fleet.run(12.0)
        fleet.send("(WHEN (= id 2) (DIE))")
        fleet.send("(WHEN (= id 1) (GOTO 25m 10m))")
        fleet.run(6.0)
        assert fleet.table()["z"].tolist() == pytest.approx([8.0, 8.0])
        assert not fleet.swarm.simulator.news


@pytest.mark.parametrize("machine", MACHINES)
def test_copters_that_touch_crash_and_fall_and_stay(machine: Machine) -> None:
    text = SKY.replace("[robots]", 'edge = "torus"\n\n[robots]').replace(
        '"180deg"]]', '"180deg", "", "8m"], ["59m", "20m", "0deg", "", "9m"], ["1m", "20m", "0deg", "", "9m"]]'
    )
    simulator = sky(machine, text.replace(', ""', ', "c{}"').format(3, 4, 5))
    for robot, x, y in ((1, 25.0, 10.0), (2, 25.0, 10.0), (3, 0.5, 20.0)):
        simulator.robots[robot].go_to(x, y)
    steps(simulator, 3.0)
    flight = simulator.bodies.flight
    assert flight is not None
    assert flight.crashed.tolist() == [0.0, 1.0, 1.0, 1.0, 1.0], "two in the air, and two across the edge"
    assert flight.armed.tolist() == [0.0] * 5
    assert [(saying.robot, saying.text) for saying in simulator.news] == [
        *((3, "has crashed into c5"), (4, "has crashed into c4")),
        *((1, "has crashed into c3"), (2, "has crashed into high")),
    ]
    steps(simulator, 3.0)
    assert flight.z.tolist() == [0.0] * 5
    assert refused(lambda: simulator.robots[1].take_off(3.0)) == hovering.LOCKED_MOTORS
    assert len(simulator.news) == 4


def test_who_falls_falls_as_fast_as_things_do_and_takes_others_down() -> None:
    text = SKY.replace('"180deg"]]', '"180deg"], ["50m", "50m", "0deg", "b", "8m"], ["20m", "10m", "0deg", "c", "3m"]]')
    simulator = sky(text=text)
    simulator.bodies.place(3, 20.0, 10.5, 0.0)
    heights = []
    for _ in range(20):
        simulator.step()
        heights.append(sensed(simulator, HIGH)["z"])
    moments = 0.1 * np.arange(12)
    assert heights[:12] == pytest.approx(8.0 - 9.81 / 2.0 * moments**2)
    assert heights[-1] == 0.0
    assert [saying.text for saying in simulator.news][-1].startswith("has crashed into")
    assert {saying.robot for saying in simulator.news} == {1, 3, 4}


def test_copters_on_the_ground_touch_nobody_and_a_near_miss_is_none() -> None:
    text = SKY.replace('"180deg"]]', '"180deg"], ["50m", "50m", "0deg", "b"], ["21.1m", "10m", "0deg", "c", "8m"]]')
    simulator = sky(text=text)
    simulator.bodies.place(3, 30.4, 10.0, 0.0)  # nobody starts like that
    steps(simulator, 1.0)
    assert not simulator.news
    simulator.robots[3].take_off(5.0)
    steps(simulator, 0.2)
    assert [saying.robot for saying in simulator.news] == [2, 3], "it took off beside one that stood too near"


def test_fast_ones_do_not_pass_through_each_other() -> None:
    text = SKY.replace(
        'like = "copter"', 'like = "copter"\nlimits = { speed = "50m/s", acceleration = "200m/s2" }'
    ).replace('"180deg"]]', '"180deg"], ["40m", "10m", "0deg", "b", "8m"]]')
    simulator = sky(text=text)
    simulator.robots[HIGH].go_to(58.0, 10.0), simulator.robots[3].go_to(2.0, 10.0)
    steps(simulator, 2.0)
    assert {saying.robot for saying in simulator.news} == {HIGH, 3}


def test_stop_on_the_way_to_ceiling_and_floor_stays_between_them() -> None:
    for climb in (1.0, -1.0):
        for tick in range(0, 60, 12):
            simulator = sky(text=SKY.replace('"8m"', '"27m"' if climb > 0.0 else '"3m"'))
            body, limits, flight = simulator.robots[HIGH], simulator.model.limits, simulator.bodies.flight
            assert flight is not None
            body.climb(climb)
            for now in range(70):
                if now == tick:
                    body.stop()
                simulator.step()
                assert limits.floor <= flight.z[HIGH] <= limits.ceiling
            assert flight.climb_rate[HIGH] == 0.0


def test_an_emergency_stop_lets_crazyflies_fall_also_under_stop() -> None:
    simulator = sky(text=SKY.replace('"copter"', '"crazyflie"').replace('"8m"', '"2m"'))
    assert {"MOTORS-OFF", "ALL-MOTORS-OFF"} <= {each.name for each in simulator.model.functions}
    assert "MOTORS-OFF" not in {each.name for each in sky().model.functions}
    body = simulator.robots[HIGH]
    body.stop()
    body.cut_motors()
    steps(simulator, 1.0)
    fallen = sensed(simulator, HIGH)
    assert (fallen["z"], fallen["armed"], fallen["crashed"]) == (0.0, 0.0, 0.0)
    assert refused(lambda: simulator.robots[HIGH].cut_motors() or body.take_off(1.0)) == hovering.LOCKED_MOTORS
    simulator.robots[LOW].cut_all_motors()
    assert refused(lambda: simulator.robots[2].take_off(1.0)) == hovering.LOCKED_MOTORS


MIXED = (
    SKY.replace("[robots]", "[[robots]]")
    + """
[[robots]]
type = "rover"
motion = "still"
starts = [["20m", "20m", "0deg"], ["40m", "40m", "0deg"]]
limits = { speed = "1m/s", turn_rate = "90deg/s", acceleration = "1m/s2" }
body = { radius = "0.3m" }
"""
)


def test_beside_copters_rovers_stay_on_the_ground() -> None:
    simulator = sky(text=MIXED)
    everybody = np.arange(5)
    results = simulator.robots.take_off(everybody, np.full(5, 3.0))
    assert results is not None
    assert [str(result) for result in results] == ["1.0"] * 3 + ["this robot does not fly"] * 2
    assert simulator.robots.go_to(everybody[3:], np.array([25.0, 45.0]), np.array([20.0, 40.0])) is None
    steps(simulator, 8.0)
    rover = sensed(simulator, 3)
    assert rover["x"] == pytest.approx(25.0, abs=0.3)
    assert all(np.isnan(rover[name]) for name in ("z", "height", "climb_rate", "armed", "flying", "crashed"))
    simulator.robots[HIGH].go_to(25.0, 20.0, 3.0)
    steps(simulator, 12.0)
    assert not simulator.news, "above it, it touches nothing"
    simulator.robots[HIGH].touch_down()
    steps(simulator, 8.0)
    assert [(each.robot, each.text) for each in simulator.news] == [(HIGH, "has crashed into rover1")]
    assert simulator.heights is not None
    assert simulator.heights[HIGH] == 0.0


def each_acts(simulator: Simulator, actuator: str) -> None:
    for body in simulator.robots:
        body.act(Setpoint(side=0.5) if actuator == "drive_side" else Setpoint(climb=0.5))


@pytest.mark.parametrize(
    "act",
    [
        each_acts,
        lambda simulator, actuator: simulator.act(actuator, np.arange(5), np.full(5, 0.5)),
        lambda simulator, actuator: simulator.act(actuator, slice(0, 5), np.full(5, 0.5)),
    ],
)
def test_what_only_copters_have_does_not_hold_up_a_rover(act: Callable[[Simulator, str], None]) -> None:
    simulator = sky(text=MIXED)
    simulator.robots[3].go_to(25.0, 20.0)
    act(simulator, "drive_climb"), act(simulator, "drive_side")
    steps(simulator, 8.0)
    assert sensed(simulator, 3)["x"] == pytest.approx(25.0, abs=0.3)
    assert sensed(simulator, HIGH)["z"] > 8.0


def test_who_is_let_go_of_hovers_or_lands_as_its_type_says() -> None:
    landing = '"copter"\nflight = { failsafe = "land" }'
    for kind, lands in (('"copter"', False), (landing, True), ('"crazyflie"', False)):
        simulator = sky(text=SKY.replace('"copter"', kind).replace('"8m"', '"1m"'))
        body = simulator.robots[HIGH]
        body.act(Setpoint(speed=0.5))
        steps(simulator, 1.0)
        assert isinstance(body, Failsafe)
        body.let_go()
        steps(simulator, 8.0)
        after = sensed(simulator, HIGH)
        assert (after["z"] == 0.0, after["speed"], body.stopped) == (lands, 0.0, False)


@pytest.mark.parametrize("machine", MACHINES)
def test_one_and_many_are_told_the_same(machine: Machine) -> None:
    one, many = sky(machine), sky(machine)
    everybody = np.arange(3)
    orders = (
        ("take_off", [3.0, 31.0, 4.0]),
        ("go_to", [5.0, 50.0, 70.0], [5.0, 5.0, 5.0]),
        ("go_to", [5.0, 50.0, 40.0], [5.0, 5.0, 5.0], [2.0, 40.0, 9.0]),
        ("climb", [0.2, -0.2, 0.2]),
        ("disarm",),
        ("arm",),
        ("touch_down",),
    )
    for name, *columns in orders:
        results = getattr(many.robots, name)(everybody, *map(np.array, columns))
        given = [results[robot] if results else 1.0 for robot in everybody]
        for robot, numbers in enumerate(zip(*columns, strict=True) if columns else [()] * 3):
            command = getattr(one.robots[robot], name)
            assert outcome(command, *numbers) == (type(given[robot]), str(given[robot]))
        steps(one, 2.0), steps(many, 2.0)
        assert one.state_hash() == many.state_hash(), name


def test_a_snapshot_in_the_air_goes_on_as_the_run_did() -> None:
    simulator = sky()
    simulator.robots[LOW].take_off(6.0)
    simulator.robots[HIGH].go_to(40.0, 40.0, 12.0)
    steps(simulator, 2.0)
    again = resume(state_of(simulator))
    steps(simulator, 5.0), steps(again, 5.0)
    assert again.state_hash() == simulator.state_hash()
    assert sensed(again, LOW)["z"] == pytest.approx(6.0, abs=0.3)


def test_a_body_of_its_own_node_flies_and_keeps_narrower_limits() -> None:
    narrow = replace(sky().model.limits, ceiling=4.0, climb=0.5, fence=None)
    scenario = limited(read_scenario(SKY), narrow)
    with SingleRobot(Simulator(scenario), None) as body:
        assert refused(lambda: body.take_off(5.0)) == "it flies from 0.5 to 4 m high, not at 5 m"
        body.take_off(3.5)
        for _ in range(100):
            body.sense()
        read = dict(zip((sensor.name for sensor in body.model.sensors), body.sense().values, strict=True))
        assert read["z"] == pytest.approx(3.5)
        body.go_to(12.0, 10.0, 2.0)
        for _ in range(100):
            body.sense()
    assert (body.rest_state().at_rest, body.stopped) == (True, True)
    assert body.complaints() == []
    with pytest.raises(MisuseError, match="their fence is the edge of their world"):
        limited(read_scenario(SKY), replace(narrow, fence=(1.0, 1.0, 9.0, 9.0)))


def test_a_fleet_flies_by_expressions_with_accounts() -> None:
    with sc.open(SKY) as fleet:
        assert len(fleet.send("(GOTO 5m 5m)", everybody=True).fault) == 2
        sent = fleet.send("(WHEN (AND (> battery 50%) (NOT flying)) (TAKEOFF 3m))")
        assert len(sent.matched) == 2
        fleet.run(5.0)
        assert fleet.table()["z"].tolist() == pytest.approx([3.0, 8.0, 3.0])
        fleet.send("(WHEN flying (RULE up (SETQ drive_climb 0.2m/s)))")
        fleet.run(5.0)
        assert min(fleet.table()["climb_rate"]) == pytest.approx(0.2)


def test_a_recording_and_a_page_have_the_heights(tmp_path: Path) -> None:
    with sc.open(SKY) as fleet, fleet.record(tmp_path / "sky.mcap"):
        fleet.send("(WHEN (NOT flying) (TAKEOFF 3m))")
        fleet.run(6.0)
        heights = fleet.table()["z"].tolist()
    recording = load_recording(tmp_path / "sky.mcap")
    *_, last = (each.data for each in entries(tmp_path / "sky.mcap", recording) if each.topic == "/poses")
    assert read_heights(last, 3).tolist() == pytest.approx(heights)
    _, poses = load_timeline(recording).poses.values[-1]
    assert places_of(poses, 3)[2].tolist() == pytest.approx(heights)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (('like = "copter"', 'like = "scout"\nz = "1m"'), "do not fly"),
        (('"8m"]', '"80m"]'), "z"),
        (('like = "copter"', 'like = "copter"\nmotion = "wander"'), "motion"),
        (('like = "copter"', 'like = "copter"\nz = ["5m", "6m"]'), "give poses a z"),
        (
            ('like = "copter"', 'like = "copter"\nbody = { radius = "1m", bumpers = 2 }'),
            "robots.body.bumpers: robots that fly have no bumpers",
        ),
        (('like = "copter"', 'like = "copter"\nbody = { radius = "1m", sonars = 2, sonar_range = "1m" }'), "no sonars"),
    ],
)
def test_what_cannot_fly_so_is_refused(change: tuple[str, str], why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        read_scenario(SKY.replace(*change))


BALL = SKY.replace("[robots]", '[neighbours]\nreach = "20m"\n\n[robots]').replace(
    '"180deg"]]', '"180deg"], ["20m", "13m", "0deg", "b", "12m"], ["23m", "10m", "0deg", "c", "8m"]]'
)
"""Around the second robot, at 8 m: one 5 m away, 4 m of it upwards; one 3 m away beside it; two on the ground."""


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(("(COUNT 4.9m)", 1.0), ("(COUNT 5m)", 2.0), ("(COUNT 12m)", 2.0), ("(COUNT 13m)", 4.0)),
        *(("(NEAREST_DIST 20m)", 3.0), ("(FARTHEST_DIST 5m)", 5.0), ("(RANK_DIST 2 20m)", 5.0)),
        *(("(MEAN_Z 5m)", 10.0), ("(MEAN_Z 20m)", 5.0), ("(NEAREST_Z 20m)", 8.0), ("(MEAN_X 5m)", 21.5)),
        *(("(OF 4 distance)", 5.0), ("(OF 4 z)", 12.0), ("(OF 1 z)", 0.0)),
        *(("(MAX-OVER (n 5m) (OF n z))", 12.0), ("(COUNT-OVER (n 4m) (> (OF n z) 1m))", 1.0)),
    ],
)
def test_neighbours_are_those_in_a_ball(machine: Machine, text: str, value: float) -> None:
    swarm = Swarm(Simulator(read_scenario(BALL), machine=machine))
    swarm.step()
    assert swarm.evaluate("high", text).value == pytest.approx(value)


@pytest.mark.parametrize("machine", MACHINES)
def test_fields_of_a_neighbour_are_of_one_moment(machine: Machine) -> None:
    text = BALL.replace('reach = "20m"', 'reach = "20m"\nnoise = 0.1')
    swarm = Swarm(Simulator(read_scenario(text), machine=machine))
    above = "(- (OF 4 distance) (DIST x y z (OF 4 x) (OF 4 y) (OF 4 z)))"
    heights = set()
    for _ in range(3):
        swarm.step()
        assert swarm.evaluate("high", above).value == pytest.approx(0.0, abs=1e-9)
        heights.add(swarm.evaluate("high", "(OF 4 z)").value)
    assert len(heights) == 3, "each tick draws anew how wrong they are"


def test_a_neighbour_far_above_a_small_world_is_one() -> None:
    text = SKY.replace("[robots]", '[neighbours]\nreach = "500m"\n\n[robots]').replace('"8m"', '"200m"')
    swarm = Swarm(Simulator(read_scenario(text + '[robots.flight]\nceiling = "300m"\n')))
    swarm.step()
    assert [swarm.evaluate("high", f"(COUNT {radius}m)").value for radius in (199, 201, 500)] == [0.0, 2.0, 2.0]


def test_what_befalls_a_body_of_its_own_node_is_a_complaint() -> None:
    with SingleRobot(Simulator(read_scenario(SKY + SHORT.format("2s"))), None) as body:
        body.take_off(5.0)
        for _ in range(30):
            body.sense()
        assert body.complaints() == [hovering.exhausted(in_air=True)]
        assert body.complaints() == []
