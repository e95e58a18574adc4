"""Particles: points that turn in space by at most their turn rate, touch nothing, and see what lies in their field."""

from __future__ import annotations

from math import asin, cos, degrees, isnan, pi, radians, sin

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from simulated import sensed, steps
from sleepcast.core.settings import SettingsError
from sleepcast.robot import Setpoint
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.bodies.particles import Particles
from sleepcast.simulator.engine import choose, has_numba
from sleepcast.simulator.motion import steering
from sleepcast.simulator.snapshot import resume, state_of

SPACE = """
format = 2
title = "space"
seconds = "1min"
tick = "0.1s"

[world]
width = "100m"
height = "100m"

[robots]
like = "particle"
starts = [["50m", "50m", "0deg", "a", "50m"], ["50m", "50m", "90deg", "b", "50m"], ["20m", "50m", "0deg", "c", "9km"]]

[neighbours]
reach = "20m"
"""
SPEED, TURN_RATE = 3.0, radians(40.0)


def space(text: str = SPACE, seed: int | None = None) -> Simulator:
    return Simulator(read_scenario(text), seed)


def particles(simulator: Simulator) -> Particles:
    assert isinstance(simulator.bodies.flight, Particles)
    return simulator.bodies.flight


def heading(simulator: Simulator, robot: int = 0) -> tuple[float, float]:
    """Heading and pitch of a robot, degrees."""
    values = sensed(simulator, robot)
    return degrees(values["heading"]), degrees(values["pitch"])


def test_it_has_the_names_of_a_point_in_space_and_no_others() -> None:
    model = space().model
    assert [each.name for each in model.actuators] == ["drive_speed"]
    assert {"STEER", "ST", "TK"} <= {each.name for each in model.functions}
    assert not {"GOTO", "DRIVE", "TAKEOFF", "LAND", "WANDER"} & {each.name for each in model.functions}
    assert [each.name for each in model.sensors] == ["x", "y", "heading", "speed", "z", "climb_rate", "pitch"]


def test_it_goes_where_it_heads_and_turns_by_its_turn_rate() -> None:
    simulator = space()
    simulator.robots[0].act(Setpoint(speed=10.0))
    simulator.robots[0].steer(0.0, 0.0, 1000.0)
    simulator.step()
    assert heading(simulator) == pytest.approx((0.0, 4.0))
    assert sensed(simulator, 0)["speed"] == SPEED, "its limit"
    assert sensed(simulator, 0)["climb_rate"] == pytest.approx(SPEED * sin(radians(4.0)))
    steps(simulator, 2.1)
    assert heading(simulator)[1] == pytest.approx(88.0)
    before = sensed(simulator, 0)
    steps(simulator, 1.0)
    after = sensed(simulator, 0)
    assert heading(simulator)[1] == pytest.approx(90.0)
    assert after["z"] - before["z"] == pytest.approx(SPEED, rel=1e-3)
    simulator.robots[0].steer(0.0, 0.0, 0.0)
    steps(simulator, 1.0)
    assert heading(simulator)[1] == pytest.approx(90.0), "straight on"


def test_the_opposite_direction_is_reached_to_the_left() -> None:
    simulator = space()
    simulator.robots[0].steer(-1e-200, 0.0, 0.0)
    steps(simulator, 1.0)
    assert heading(simulator) == pytest.approx((40.0, 0.0))
    steps(simulator, 4.0)
    assert abs(heading(simulator)[0]) == pytest.approx(180.0)


@given(numbers=st.lists(st.floats(-1e300, 1e300), min_size=6, max_size=6), most=st.floats(0.0, pi))
@example(numbers=[1.0, 1.0, 0.0, -1.0, -1.0, 0.0], most=1.0)
@example(numbers=[3.0, 1.0, 2.0, -3.0, -1.0, -2.0 + 1e-8], most=0.5)
@settings(max_examples=200, deadline=None)
def test_any_turn_is_the_shortest_and_no_longer_than_allowed(numbers: list[float], most: float) -> None:
    before, wanted = (steering.unit(np.array(some)[:, None]) for some in (numbers[:3], numbers[3:]))
    if not before.any():
        return
    after = steering.turned(before, wanted, most)
    assert np.linalg.norm(after) == pytest.approx(1.0)
    if not wanted.any():
        assert np.array_equal(after, before)
        return

    def angle(one: np.ndarray, other: np.ndarray) -> float:
        return 2.0 * asin(min(1.0, float(np.linalg.norm(one - other)) / 2.0))

    assert angle(before, after) == pytest.approx(min(angle(before, wanted), most), abs=1e-7)
    assert angle(before, after) + angle(after, wanted) == pytest.approx(angle(before, wanted), abs=1e-6)


def test_two_at_one_place_pass_through_each_other_and_nobody_falls() -> None:
    simulator = space()
    steps(simulator, 3.0)
    assert [sensed(simulator, robot)["z"] for robot in range(3)] == [50.0, 50.0, 9000.0]
    assert not simulator.news


def test_the_edges_of_its_space_hold_it_like_a_wall() -> None:
    simulator = space()
    for robot, way in ((0, (1.0, 0.0, 0.0)), (1, (0.0, 1.0, -9.0)), (2, (0.0, 0.0, 1.0))):
        simulator.robots[robot].act(Setpoint(speed=SPEED))
        simulator.robots[robot].steer(*way)
    steps(simulator, 400.0)
    assert sensed(simulator, 0)["x"] == 100.0
    assert (sensed(simulator, 1)["z"], sensed(simulator, 2)["z"]) == (0.0, 10_000.0)
    assert sensed(simulator, 1)["y"] > 60.0, "it slides along"


def test_stop_holds_it_and_its_direction_and_release_brings_nothing_back() -> None:
    simulator = space()
    robot = simulator.robots[0]
    robot.act(Setpoint(speed=SPEED))
    robot.steer(1.0, 0.0, 0.5)
    steps(simulator, 1.0)
    robot.stop()
    steps(simulator, 0.1)
    place = sensed(simulator, 0)
    robot.steer(0.0, 1.0, 0.0)
    robot.act(Setpoint(speed=SPEED))
    steps(simulator, 1.0)
    assert sensed(simulator, 0) == place
    assert robot.rest_state().speed == 0.0
    robot.release()
    steps(simulator, 1.0)
    assert sensed(simulator, 0) == place


def test_one_and_many_are_told_the_same() -> None:
    alone, together = space(), space()
    numbers = np.array([1.0, -2.0, 0.0]), np.array([0.0, 1.0, 3.0]), np.array([1.0, 0.0, -1.0])
    for robot in range(3):
        alone.robots[robot].steer(*(float(each[robot]) for each in numbers))
    together.robots.steer(np.arange(3), *numbers)
    for simulator in (alone, together):
        steps(simulator, 2.0)
    assert alone.bodies.state_hash() == together.bodies.state_hash()


def test_a_snapshot_goes_on_as_before() -> None:
    simulator = space()
    simulator.robots[0].act(Setpoint(speed=SPEED))
    simulator.robots[0].steer(0.3, -1.0, 2.0)
    steps(simulator, 0.5)
    again = resume(state_of(simulator))
    for each in (simulator, again):
        steps(each, 2.0)
    assert simulator.bodies.state_hash() == again.bodies.state_hash()
    assert sensed(again, 0)["z"] > 51.0


def test_starts_by_chance_head_anywhere_in_space() -> None:
    area = 'disc = { x = "50m", y = "50m", radius = "5m" }\nz = ["40m", "60m"]\ncount = 400'
    text = SPACE.replace(SPACE[SPACE.index("starts") : SPACE.index("\n[neighbours]")], f"{area}\n")
    simulator = space(text, seed=5)
    ahead = np.array(steering.pointing(simulator.bodies.heading, particles(simulator).pitch))
    assert np.abs(ahead.mean(axis=1)).max() < 0.1
    assert (ahead**2).mean(axis=1) == pytest.approx([1 / 3] * 3, abs=0.05)
    z = particles(simulator).z
    assert 40.0 <= z.min() < 42.0
    assert 58.0 < z.max() <= 60.0


FIELD = 'reach = "20m"\nfield = "120deg"\nall_round = "2m"\n'


def test_its_field_of_view_is_a_cone_around_its_direction() -> None:
    """The second one is 1 m to its left, which it senses on all sides; the third one is ahead, 45 degrees up."""
    simulator = space(SPACE.replace('reach = "20m"\n', FIELD))
    bodies, flight, near = simulator.bodies, particles(simulator), simulator.senses._near
    assert near
    bodies.x[:], bodies.y[:], flight.z[:] = (50.0, 50.0, 60.0), (50.0, 51.0, 50.0), (50.0, 50.0, 60.0)
    count = next(each.many for each in simulator.model.functions if each.name == "COUNT")
    assert count
    for pitch, seen in ((0.0, 2.0), (-14.0, 2.0), (-16.0, 1.0), (90.0, 2.0), (-90.0, 1.0)):
        flight.pitch[0] = radians(pitch)
        bodies.moved()
        near.step()
        assert count(simulator.robots, np.array([0]), np.array([20.0])) == seen, pitch
    bodies.heading[2], flight.pitch[2] = pi, radians(-45.0)
    bodies.moved()
    near.step()
    assert count(simulator.robots, np.array([2]), np.array([20.0])) == 2.0


def test_a_neighbour_tells_its_pitch() -> None:
    simulator = space()
    particles(simulator).pitch[1] = 0.25
    near = simulator.senses._near
    assert near
    near.step()
    assert near.shown("pitch", np.array([0, 1]), np.array([1.0, 0.0])).tolist() == [0.25, 0.0]
    assert isnan(near.shown("pitch", np.array([0]), np.array([2.0]))[0])


@pytest.mark.skipif(not has_numba(), reason="needs numba, the extra `fast`")
@pytest.mark.parametrize("delay", ["", 'delay = "0.1s"\n'])
@pytest.mark.parametrize("edge", ["", 'edge = "torus"'])
@given(chance=st.integers(0, 2**32 - 1), field=st.sampled_from([30, 180, 270, 359]))
@settings(max_examples=5, deadline=None)
def test_random_schools_sense_the_same_with_and_without_kernels(edge: str, delay: str, chance: int, field: int) -> None:
    text = SPACE.replace(SPACE[SPACE.index("starts") : SPACE.index("\n[neighbours]")], "count = 60\n")
    text = text.replace('height = "100m"\n', f'height = "100m"\n{edge}\n')
    scenario = read_scenario(text + f'field = "{field}deg"\nall_round = "1m"\nloss = 0.1\nnoise = 0.05\n{delay}')
    drawn, results = np.random.default_rng(chance), []
    places, ways = np.rint(drawn.uniform(0.0, 25.0, (3, 60)) * 2.0) / 2.0, drawn.uniform(-1.5, 1.5, (2, 60))
    for machine, threads in (("numpy", 1), ("numba", 1), ("numba", 2)):
        simulator = Simulator(scenario, machine=choose(machine, threads))
        bodies, flight, near = simulator.bodies, particles(simulator), simulator.senses._near
        assert near
        bodies.x[:], bodies.y[:], flight.z[:], bodies.heading[:], flight.pitch[:] = *places, *ways
        bodies.moved()
        near.step()
        if delay:
            flight.z[:], flight.pitch[:] = places[0], ways[0]
            bodies.moved()
            near.step()
        functions = {each.name: each.many for each in simulator.model.functions}
        for name in ("COUNT", "MEAN_X", "MEAN_Z", "MEAN_HEADING", "NEAREST_DIST", "OUTLIER_X"):
            many = functions[name]
            assert many
            results.append(many(simulator.robots, np.arange(60), np.full(60, 12.0)))
        results += [each.astype(float) for each in near.neighbours(np.arange(60), 60, np.full(60, 12.0))]
        asked, named = np.repeat(np.arange(60), 60), np.tile(np.arange(60.0), 60)
        results += [near.shown(shown, asked, named) for shown in ("x", "z", "pitch", "heading", "distance")]
    by_numpy, *others = np.concatenate(results).reshape(3, -1)
    assert all(np.array_equal(each, by_numpy, equal_nan=True) for each in others)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('like = "particle"', 'like = "particle"\nbody.bumpers = 1', "touches nothing"),
        ('like = "particle"', 'like = "particle"\ncamera = { angle = "60deg" }', "has none of this"),
        ('like = "particle"', 'like = "particle"\nflight.climb = "1m/s"', "moves by itself"),
        ("[neighbours]", '[wind]\nuniform = { x = "1m/s" }\n[neighbours]', "only robots that fly"),
        ('reach = "20m"', 'reach = "20m"\n[neighbours.shares]\npitch = ""', "robots sense this"),
    ],
)
def test_what_a_particle_cannot_have_is_refused(old: str, new: str, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        read_scenario(SPACE.replace(old, new, 1))


def test_particles_have_their_world_for_themselves() -> None:
    text = SPACE.replace("[robots]", "[[robots]]").replace(
        "[neighbours]", '[[robots]]\nlike = "copter"\ncount = 2\n\n[neighbours]'
    )
    with pytest.raises(SettingsError, match="their world for themselves"):
        read_scenario(text)


def test_the_formulas_agree_with_each_other() -> None:
    direction = np.array(steering.pointing(np.array([0.5, -3.0, 0.0]), np.array([0.3, -1.2, pi / 2])))
    assert direction[:, 0] == pytest.approx([cos(0.5) * cos(0.3), sin(0.5) * cos(0.3), sin(0.3)])
    back = steering.headed(direction)
    assert np.array(back)[:, :2] == pytest.approx(np.array([[0.5, -3.0], [0.3, -1.2]]))
