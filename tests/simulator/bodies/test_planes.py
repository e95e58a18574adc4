"""Planes: they turn by their bank, circle at rest, and never leave their fence; the same for one and for many."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, hypot, isnan, pi, radians, sin, tan

import numpy as np
import pytest

import sleepcast as sc
from machines import MACHINES
from simulated import outcome, refused, sensed, steps
from sleepcast.core.settings import SettingsError
from sleepcast.robot import FencedError, Setpoint, hovering
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.bodies.pilot import NO_ROOF, NO_RUN
from sleepcast.simulator.engine import Machine, NumPyMachine, choose, has_numba
from sleepcast.simulator.snapshot import resume, state_of

SKY = """
format = 2
title = "a sky"
seconds = "10min"
tick = "0.25s"

[world]
width = "600m"
height = "400m"

[robots]
like = "plane"
starts = [["150m", "100m", "0deg"], ["300m", "200m", "90deg", "high", "60m"], ["450m", "200m", "0deg", "b", "80m"]]
"""
LOW, HIGH = 0, 1
"""The first plane stands on the ground, the second one circles."""
SPEED, STALL, CIRCLE = 15.0, 10.0, 60.0
RADIUS = SPEED * SPEED / (9.81 * tan(radians(45.0)))


def sky(machine: Machine | None = None, text: str = SKY, seed: int | None = None) -> Simulator:
    return Simulator(read_scenario(text), seed, machine)


def each_step(simulator: Simulator, seconds: float) -> Iterator[int]:
    """The numbers of these ticks, each when it is over."""
    for tick in range(round(seconds / simulator.scenario.tick)):
        simulator.step()
        yield tick


def away_from(simulator: Simulator, robot: int, x: float, y: float) -> float:
    return hypot(float(simulator.x[robot]) - x, float(simulator.y[robot]) - y)


def test_it_has_the_names_of_a_plane_with_ardupilot_and_takes_no_speeds() -> None:
    model = sky().model
    assert model.actuators == ()
    names = {function.name: function for function in model.functions}
    assert {"ARM", "DISARM", "TAKEOFF", "LAND", "GOTO", "CLIMB"} <= names.keys()
    assert "DRIVE" not in names
    assert names["CLIMB"].doc == hovering.OF_PLANES["CLIMB"]
    assert {"x", "y", "z", "height", "heading", "speed", "climb_rate", "armed", "flying", "battery"} <= {
        sensor.name for sensor in model.sensors
    }


def test_in_the_air_it_circles_from_the_start() -> None:
    simulator = sky()
    steps(simulator, 60.0)
    for _ in each_step(simulator, 30.0):
        assert away_from(simulator, HIGH, 300.0, 200.0) == pytest.approx(CIRCLE, abs=0.5)
    assert sensed(simulator, HIGH)["z"] == pytest.approx(60.0)


def test_it_goes_to_a_place_and_circles_around_it_within_its_limits() -> None:
    simulator = sky()
    simulator.robots[HIGH].go_to(420.0, 80.0, 110.0)
    most_turn, most_climb = 0.0, 0.0
    for _ in each_step(simulator, 90.0):
        flies = sensed(simulator, HIGH)
        assert STALL <= flies["speed"] <= SPEED + 1e-9
        most_turn, most_climb = max(most_turn, abs(flies["turn_rate"])), max(most_climb, flies["climb_rate"])
    assert most_turn == pytest.approx(SPEED / RADIUS, rel=1e-6), "v / r, of the narrowest circle"
    assert most_climb == pytest.approx(3.0)
    assert away_from(simulator, HIGH, 420.0, 80.0) == pytest.approx(CIRCLE, abs=0.5)
    assert flies["z"] == pytest.approx(110.0, abs=0.01)
    simulator.robots[HIGH].go_to(300.0, 200.0, 40.0)
    rates = []
    for _ in each_step(simulator, 60.0):
        rates.append(sensed(simulator, HIGH)["climb_rate"])
    assert min(rates) == pytest.approx(-2.0), "it sinks slower than it climbs"
    assert sensed(simulator, HIGH)["z"] == pytest.approx(40.0, abs=0.01)


def test_a_take_off_climbs_straight_on_and_a_landing_circles_down() -> None:
    simulator = sky()
    body = simulator.robots[LOW]
    body.take_off(45.0)
    for _ in each_step(simulator, 10.0):
        rises = sensed(simulator, LOW)
        assert rises["z"] == 0.0 or rises["speed"] >= STALL - 1e-9, "first it is fast enough"
    assert (float(simulator.y[LOW]), rises["heading"], rises["flying"]) == (100.0, 0.0, 1.0)
    assert rises["z"] < 30.0
    steps(simulator, 60.0)
    circles = sensed(simulator, LOW)
    assert circles["z"] == pytest.approx(45.0, abs=0.01)
    assert circles["turn_rate"] == pytest.approx(-SPEED / CIRCLE, rel=0.01)
    body.touch_down()
    lowest = 0.0
    for _ in each_step(simulator, 40.0):
        body.touch_down()  # as a rule says it, in every tick
        lowest = min(lowest, sensed(simulator, LOW)["climb_rate"])
    landed = sensed(simulator, LOW)
    assert lowest == pytest.approx(-2.0)
    assert [landed[name] for name in ("z", "speed", "climb_rate", "armed", "flying", "crashed")] == [0.0] * 6
    simulator.place(LOW, 150.0, 100.0, 0.0)
    body.take_off()
    steps(simulator, 30.0)
    assert sensed(simulator, LOW)["z"] == pytest.approx(50.0, abs=0.01), "the height of its type"


def test_a_place_during_the_take_off_counts_when_it_may_bank() -> None:
    simulator = sky()
    simulator.robots[LOW].take_off(40.0)
    steps(simulator, 1.0)
    simulator.robots[LOW].go_to(100.0, 300.0)
    steps(simulator, 5.0)
    assert float(simulator.y[LOW]) == 100.0
    steps(simulator, 60.0)
    assert away_from(simulator, LOW, 100.0, 300.0) == pytest.approx(CIRCLE, abs=0.5)
    assert sensed(simulator, LOW)["z"] == pytest.approx(40.0, abs=0.01)


def test_stop_is_a_circle_that_counts_as_rest_and_nothing_old_resumes() -> None:
    simulator = sky()
    body = simulator.robots[HIGH]
    body.go_to(100.0, 100.0, 100.0)
    steps(simulator, 5.0)
    place = float(simulator.x[HIGH]), float(simulator.y[HIGH])
    body.stop()
    steps(simulator, 60.0)
    state = body.rest_state()
    assert state.at_rest
    assert away_from(simulator, HIGH, *place) == pytest.approx(CIRCLE, abs=0.5)
    body.go_to(100.0, 100.0, 100.0)
    height = sensed(simulator, HIGH)["z"]
    steps(simulator, 10.0)
    body.release()
    steps(simulator, 30.0)
    assert away_from(simulator, HIGH, *place) == pytest.approx(CIRCLE, abs=0.5)
    assert sensed(simulator, HIGH)["z"] == height
    assert not body.rest_state().at_rest, "it flies, and may be told another place"
    body.stop()
    steps(simulator, 1.0)
    assert away_from(simulator, HIGH, *place) == pytest.approx(CIRCLE, abs=0.5), "it goes on with the circle it flies"


def test_a_hold_is_a_circle_too() -> None:
    simulator = sky()
    body = simulator.robots[HIGH]
    body.go_to(100.0, 100.0)
    steps(simulator, 5.0)
    place = float(simulator.x[HIGH]), float(simulator.y[HIGH])
    body.hold(True)
    steps(simulator, 60.0)
    assert away_from(simulator, HIGH, *place) == pytest.approx(CIRCLE, abs=0.5)
    body.hold(False)
    steps(simulator, 30.0)
    assert away_from(simulator, HIGH, *place) == pytest.approx(CIRCLE, abs=0.5)


MANY = SKY[: SKY.index("starts =")].replace('like = "plane"', 'like = "plane"\ncount = 60\nz = ["30m", "60m"]')


@pytest.mark.parametrize("wind", ["", '[wind]\nuniform = { x = "4m/s", y = "1m/s" }\n'])
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.nightly)])
def test_whatever_it_is_told_it_never_leaves_its_fence(seed: int, wind: str) -> None:
    text = MANY.replace('"plane"', '"plane"\nx = ["50m", "550m"]\ny = ["50m", "350m"]')
    simulator = sky(NumPyMachine(), text.replace("[robots]", f"{wind}[robots]"), seed)
    chance = np.random.default_rng(seed)
    bodies, everybody = simulator.bodies, np.arange(60)
    flight = bodies.flight
    assert flight is not None
    assert flight.wings is not None
    flight.wings.airspeed[::2] = STALL
    flown = 0.0
    for tick in range(400):
        some = everybody[chance.random(60) < 0.02]
        which = tick // 10 % 4
        if which == 0:
            x, y = chance.uniform(CIRCLE, 600.0 - CIRCLE, len(some)), chance.uniform(CIRCLE, 400.0 - CIRCLE, len(some))
            simulator.robots.go_to(some, x, y, np.full(len(some), 50.0))  # who has landed refuses it
        elif which == 1:
            simulator.robots.stop(some)
        elif which == 2:
            simulator.robots.release(some)
        elif tick % 300 == 39:
            simulator.robots.touch_down(some)
        up = flight.z > 0.0
        simulator.step()
        flight.crashed[:] = 0.0  # planes may meet here, which is another test
        assert (bodies.x >= 0.0).all(), tick
        inside = (bodies.x > 0.0) & (bodies.x < 600.0) & (bodies.y > 0.0) & (bodies.y < 400.0)
        assert inside.all(), "no edge has held any of them"
        assert (bodies.speed[up & (flight.armed > 0.0)] >= STALL - 1e-9).all()
        flown += float(bodies.speed.sum()) * simulator.scenario.tick
    assert flown > 5_000.0
    assert ((bodies.target_x >= CIRCLE) & (bodies.target_x <= 600.0 - CIRCLE))[flight.flying > 0.0].all()


@pytest.mark.parametrize(("edge", "far"), [("fence", 600.0), ("wall", 600.0 - 0.7)])
def test_stop_on_the_way_to_the_fence_turns_before_it_and_circles_inside(edge: str, far: float) -> None:
    text = SKY.replace('["300m", "200m", "90deg", "high", "60m"]', '["560m", "200m", "0deg", "high", "60m"]')
    simulator = sky(text=text.replace("[robots]", f'edge = "{edge}"\n\n[robots]'))
    simulator.robots[HIGH].stop()
    simulator.place(LOW, 460.0, 200.0, 0.0)
    simulator.robots[LOW].take_off(50.0)  # straight on, until there is no more room
    xs = []
    for _ in each_step(simulator, 60.0):
        xs.append(simulator.x[[LOW, HIGH]].tolist())
    low, high = (list(each) for each in zip(*xs, strict=True))
    assert 590.0 < max(low[:60]) < far, "it began its turn a turning radius before the fence"
    assert max(high) <= far
    assert max(high[120:]) == pytest.approx(far, abs=0.5), "its circle touches the fence from inside"
    assert simulator.news == [], "no wall has been hit"


def test_what_it_does_not_do_it_refuses_in_the_words_of_a_real_one() -> None:
    simulator = sky()
    low, high = simulator.robots[LOW], simulator.robots[HIGH]
    assert refused(lambda: high.climb(1.0)) == "a plane does not hover: (GOTO x y z) brings it to another height"
    assert refused(lambda: low.climb(1.0)) == "a plane does not hover: (GOTO x y z) brings it to another height"
    assert refused(lambda: low.go_to(300.0, 200.0)) == hovering.GROUNDED
    assert refused(lambda: high.go_to(300.0, 200.0, 20.0)) == "it flies from 30 to 120 m high, not at 20 m"
    assert outcome(high.go_to, 300.0, 30.0) == (FencedError, "its circle of 60 m around (300, 30) m passes the fence")
    assert outcome(high.go_to, 700.0, 30.0) == (FencedError, "(700, 30) m lies outside of the fence")
    simulator.place(LOW, 590.0, 200.0, 0.0)
    assert outcome(low.take_off, 40.0) == (FencedError, NO_RUN)
    simulator.place(LOW, 590.0, 200.0, pi)
    assert outcome(low.take_off, 40.0) == (float, "1.0")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (('height = "400m"', 'height = "100m"'), "a plane that circles at 60 m needs a fence twice as wide"),
        (("starts", 'flight = { circle = "10m" }\nstarts'), "at 15 m/s it turns within 22.94 m: say at least as much"),
        (("starts", 'flight = { bank = "2deg" }\nstarts'), "it turns within 656.8 m"),
        (("starts", 'limits = { turn_rate = "10deg/s" }\nstarts'), "it turns within 85.94 m"),
        (("starts", 'flight = { stall = "20m/s" }\nstarts'), "stall"),
    ],
)
def test_a_plane_that_cannot_fly_so_is_refused(change: tuple[str, str], why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        read_scenario(SKY.replace(*change))


def test_an_empty_battery_glides_down_at_the_sink_rate_also_under_stop() -> None:
    simulator = sky(text=SKY.replace("starts", 'flight = { hovers = "5s" }\nstarts'))
    simulator.robots[2].stop()
    steps(simulator, 15.0)
    for robot in (HIGH, 2):
        glides = sensed(simulator, robot)
        assert (glides["battery"], glides["climb_rate"]) == (0.0, pytest.approx(-2.0))
    steps(simulator, 45.0)
    assert [sensed(simulator, robot)["z"] for robot in (HIGH, 2)] == [0.0, 0.0]
    assert [sensed(simulator, robot)["speed"] for robot in (HIGH, 2)] == [0.0, 0.0]
    assert "battery is empty" in refused(lambda: simulator.robots[HIGH].take_off(40.0))


def test_planes_that_touch_crash_and_fall() -> None:
    text = SKY.replace('["450m", "200m", "0deg", "b", "80m"]', '["300m", "215m", "-90deg", "b", "60m"]')
    simulator = sky(text=text.replace("starts", 'body = { radius = "2m" }\nstarts'))
    steps(simulator, 1.0)
    assert [each.text for each in simulator.news] == ["has crashed into b", "has crashed into high"]
    steps(simulator, 10.0)
    for robot in (1, 2):
        fallen = sensed(simulator, robot)
        assert [fallen[name] for name in ("z", "speed", "armed", "crashed")] == [0.0, 0.0, 0.0, 1.0]


def test_who_is_let_go_of_circles_or_lands_as_its_type_says() -> None:
    for failsafe, lands in (("hover", False), ("land", True)):
        simulator = sky(text=SKY.replace("starts", f'flight = {{ failsafe = "{failsafe}" }}\nstarts'))
        simulator.robots[HIGH].let_go()  # type: ignore[attr-defined]  # it is a Failsafe where robots fly
        steps(simulator, 60.0)
        assert (sensed(simulator, HIGH)["z"] == 0.0) is lands


@pytest.mark.parametrize("machine", MACHINES)
def test_one_and_many_are_told_the_same(machine: Machine) -> None:
    one, many = sky(machine), sky(machine)
    everybody = np.arange(3)
    orders = (
        ("take_off", [40.0, 131.0, 35.0]),
        ("go_to", [100.0, 590.0, 300.0], [100.0, 100.0, 200.0]),
        ("go_to", [100.0, 500.0, 300.0], [100.0, 100.0, 200.0], [35.0, 140.0, 60.0]),
        ("climb", [1.0, 1.0, 1.0]),
        ("halt",),
        ("disarm",),
        ("touch_down",),
        ("stop",),
    )
    for name, *columns in orders:
        results = getattr(many.robots, name)(everybody, *map(np.array, columns))
        given = [results[robot] if results else 1.0 for robot in everybody]
        for robot, numbers in enumerate(zip(*columns, strict=True) if columns else [()] * 3):
            command = getattr(one.robots[robot], name)
            assert outcome(command, *numbers) == (type(given[robot]), str(given[robot]))
        steps(one, 3.0), steps(many, 3.0)
        assert one.state_hash() == many.state_hash(), name


def test_machines_agree_and_a_snapshot_goes_on() -> None:
    hashes = set()
    for machine in (NumPyMachine(), choose("numba", 1)) if has_numba() else (NumPyMachine(),):
        simulator = sky(machine)
        simulator.robots[LOW].take_off(60.0)
        simulator.robots[HIGH].go_to(400.0, 100.0, 100.0)
        steps(simulator, 6.0)
        again = resume(state_of(simulator))
        steps(simulator, 20.0), steps(again, 20.0)
        assert again.state_hash() == simulator.state_hash()
        hashes.add(simulator.state_hash())
    assert len(hashes) == 1


def test_on_a_torus_there_is_no_edge() -> None:
    simulator = sky(text=SKY.replace('height = "400m"', 'height = "400m"\nedge = "torus"'))
    simulator.robots[HIGH].go_to(10.0, 390.0)
    steps(simulator, 60.0)
    dx, dy = (float(each) for each in (simulator.x[HIGH] - 10.0, simulator.y[HIGH] - 390.0))
    assert hypot((dx + 300.0) % 600.0 - 300.0, (dy + 200.0) % 400.0 - 200.0) == pytest.approx(CIRCLE, abs=0.5)


def windy(wind: str, text: str = SKY) -> Simulator:
    return sky(text=text.replace("[robots]", f"[wind]\n{wind}\n[robots]"))


def test_in_a_steady_wind_it_holds_its_circle_as_far_as_its_bank_allows() -> None:
    held, wide = windy('uniform = { x = "5m/s" }'), windy('uniform = { x = "12m/s" }')
    held.robots[HIGH].stop()
    steps(held, 40.0)
    most_turn, far = 0.0, []
    for _ in each_step(held, 30.0):
        most_turn = max(most_turn, abs(sensed(held, HIGH)["turn_rate"]))
        assert away_from(held, HIGH, 300.0, 200.0) == pytest.approx(CIRCLE, abs=0.1)
        assert sensed(held, HIGH)["speed"] == SPEED, "that through the air"
    assert most_turn == pytest.approx(SPEED / CIRCLE * (1.0 + 5.0 / SPEED) ** 2, rel=0.02)
    assert held.robots[HIGH].rest_state().at_rest
    for _ in each_step(wide, 80.0):
        assert abs(sensed(wide, HIGH)["turn_rate"]) <= SPEED / RADIUS + 1e-9
        far.append(away_from(wide, HIGH, 300.0, 200.0))
    assert max(far) > CIRCLE + 5.0, "a wider one is the narrowest that it can fly"
    assert wide.sayings == []


def test_its_way_is_that_through_the_air_and_that_of_the_air() -> None:
    simulator = windy('uniform = { y = "6m/s" }')
    simulator.robots[LOW].take_off(40.0)
    simulator.robots[HIGH].go_to(500.0, 120.0)
    bodies, tick = simulator.bodies, simulator.scenario.tick
    before = bodies.x[HIGH], bodies.y[HIGH], bodies.heading[HIGH]
    for _ in each_step(simulator, 20.0):
        now = bodies.x[HIGH], bodies.y[HIGH], bodies.heading[HIGH]
        air_x, air_y = (now[0] - before[0]) / tick, (now[1] - before[1]) / tick - 6.0
        assert hypot(air_x, air_y) == pytest.approx(SPEED, rel=0.05)
        middle = before[2] + ((now[2] - before[2] + pi) % (2.0 * pi) - pi) / 2.0
        assert (air_x, air_y) == pytest.approx((SPEED * cos(middle), SPEED * sin(middle)), abs=0.8)
        before = now
    assert simulator.y[LOW] > 110.0, "off the ground the wind takes it along"


def test_a_wind_that_is_faster_carries_it_to_the_edge() -> None:
    simulator = windy('uniform = { x = "20m/s" }')
    steps(simulator, 120.0)
    assert "is carried away: the wind is faster than it flies" in {each.text for each in simulator.news}
    assert [float(simulator.x[robot]) for robot in (LOW, HIGH)] == [150.0, 600.0]


def test_gusts_push_it_and_a_snapshot_goes_on_in_them() -> None:
    simulator = windy('uniform = { x = "4m/s" }\ngusts = "2m/s"')
    steps(simulator, 60.0)
    again = resume(state_of(simulator))
    far = [away_from(simulator, HIGH, 300.0, 200.0) for _ in each_step(simulator, 30.0)]
    assert max(far) - min(far) > 0.5
    assert far == pytest.approx([CIRCLE] * len(far), abs=5.0)
    steps(again, 30.0)
    assert again.state_hash() == simulator.state_hash()


def test_planes_push_nobody_down() -> None:
    below = SKY.replace('["450m", "200m", "0deg", "b", "80m"]', '["300m", "200m", "90deg", "b", "57m"]')
    simulator = windy("downwash = true", below)
    steps(simulator, 10.0)
    assert sensed(simulator, 2)["z"] == 57.0


ROOFS = SKY.replace(
    "[robots]",
    """[[world.polygons]]
corners = [["100m", "20m"], ["340m", "20m"], ["340m", "199m"], ["100m", "199m"]]
tall = "20m"

[robots]""",
)


def test_it_takes_off_from_a_roof_and_lands_on_it() -> None:
    simulator = sky(text=ROOFS)
    body = simulator.robots[LOW]
    assert (sensed(simulator, LOW)["z"], sensed(simulator, LOW)["height"]) == (20.0, 0.0)
    simulator.place(LOW, 330.0, 100.0, 0.0)
    assert refused(lambda: body.take_off(40.0)) == NO_ROOF
    simulator.place(LOW, 330.0, 100.0, pi)
    body.take_off(40.0)
    steps(simulator, 6.0)
    rises = sensed(simulator, LOW)
    assert (abs(rises["heading"]), float(simulator.y[LOW])) == (pytest.approx(pi), pytest.approx(100.0))
    assert rises["height"] == rises["z"] - 20.0 > 0.0
    steps(simulator, 15.0)
    assert sensed(simulator, LOW)["z"] == pytest.approx(60.0, abs=0.01), "40 m above the roof"
    body.go_to(220.0, 110.0, 52.0)
    steps(simulator, 20.0)
    body.touch_down()
    steps(simulator, 25.0)
    landed = sensed(simulator, LOW)
    assert [landed[name] for name in ("z", "height", "speed", "flying", "crashed")] == [20.0, 0.0, 0.0, 0.0, 0.0]


def test_who_rolls_off_a_roof_falls() -> None:
    simulator = sky(text=ROOFS)
    flight = simulator.bodies.flight
    assert flight is not None
    assert flight.wings is not None
    simulator.place(LOW, 335.0, 100.0, 0.0)
    flight.wings.airspeed[LOW] = STALL  # as after its landing
    steps(simulator, 5.0)
    fallen = sensed(simulator, LOW)
    assert 340.0 < simulator.x[LOW] < 343.0
    assert [fallen[name] for name in ("z", "speed", "climb_rate", "armed")] == [0.0] * 4


MIXED = (
    SKY.replace("[robots]", "[[robots]]")
    + """
[[robots]]
like = "copter"
starts = [{ x = "200m", y = "300m", z = "8m" }]

[[robots]]
type = "rover"
motion = "still"
starts = [["100m", "350m", "0deg"]]
limits = { speed = "1m/s", turn_rate = "90deg/s", acceleration = "1m/s2" }
body = { radius = "0.3m" }
"""
)


def test_speeds_for_all_drive_all_but_planes() -> None:
    one, many = sky(text=MIXED), sky(text=MIXED)
    everybody = np.arange(5)
    for simulator in (one, many):
        simulator.robots[HIGH].go_to(300.0, 100.0)
    for actuator, value in (("drive_speed", 0.5), ("drive_turn", 0.1), ("drive_side", 0.2), ("drive_climb", 0.3)):
        many.act(actuator, everybody, np.full(5, value))
        name = {"drive_speed": "speed", "drive_turn": "turn_rate"}.get(actuator, actuator.removeprefix("drive_"))
        for body in one.robots:
            body.act(Setpoint(**{name: value}))
        steps(one, 1.0), steps(many, 1.0)
        assert one.state_hash() == many.state_hash()
    steps(one, 30.0)
    assert sensed(one, 3)["climb_rate"] == pytest.approx(0.0, abs=0.31)
    assert sensed(one, 3)["z"] > 8.5
    assert sensed(one, 4)["speed"] == pytest.approx(0.5)
    assert away_from(one, HIGH, 300.0, 100.0) == pytest.approx(CIRCLE, abs=1.0)
    assert isnan(sensed(one, 4)["z"])
    assert refused(lambda: one.robots[4].take_off(3.0)) == "this robot does not fly"


def test_a_fleet_flies_by_expressions_with_accounts() -> None:
    with sc.open(SKY) as fleet:
        sent = fleet.send("(WHEN (AND (> battery 50%) (NOT flying)) (TAKEOFF 40m))")
        assert len(sent.matched) == 1
        fleet.run(30.0)
        sent = fleet.send("(WHEN flying (GOTO 300m 20m))")
        assert len(sent.fault) == 3
        assert len(fleet.send("(CLIMB 1m/s)", everybody=True).fault) == 3
        assert len(fleet.send("(WHEN flying (GOTO 300m 200m (+ 40m (* 10m id))))").matched) == 3
        fleet.run(60.0)
        assert fleet.table()["z"].tolist() == pytest.approx([50.0, 60.0, 70.0], abs=0.1)
        fleet.stop()
        fleet.run(1.0)
        assert fleet.table()["speed"].tolist() == pytest.approx([SPEED] * 3)
