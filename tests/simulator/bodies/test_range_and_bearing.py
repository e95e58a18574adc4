"""Neighbours: what robots sense of each other, with which errors, and that it is the same in every way of asking."""

from __future__ import annotations

import ctypes
from math import cos, isclose, isnan, pi, sin
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sleepcast as sc
from sleepcast.core.model import NativeCall
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Simulator, load, read_scenario
from sleepcast.simulator.bodies import range_and_bearing
from sleepcast.simulator.bodies.range_and_bearing import RangeAndBearing
from sleepcast.simulator.engine import choose
from sleepcast.simulator.snapshot import resume, state_of
from small_worlds import SCOUTS, simulator, write

NEIGHBOURS = '\n[neighbours]\nreach = "100m"\n'
SHARES = NEIGHBOURS + '[neighbours.shares]\nopinion = ""\nload = "kg"\n'
ASKED = (
    "COUNT",
    "MEAN_X",
    "MEAN_Y",
    "MEAN_HEADING",
    "NEAREST_X",
    "NEAREST_DIST",
    "FARTHEST_DIST",
    "OUTLIER_X",
    "OUTLIER_Y",
    "GAP",
    "GAP_BEARING",
)


def ask(sim: Simulator, name: str, *arguments: float, robot: int = 0) -> float:
    """What one robot gets from one of its functions."""
    function = next(each for each in sim.model.functions if each.name == name)
    found = function.call(sim.robots[robot], *arguments)
    return 1.0 if found is None else found


def ask_all(sim: Simulator, name: str, *arguments: float) -> np.ndarray:
    """What all robots get from it at once."""
    function = next(each for each in sim.model.functions if each.name == name)
    assert function.many
    robots = np.arange(sim.bodies.count)
    return function.many(sim.robots, robots, *(np.full(robots.size, each) for each in arguments))


def four(folder: Path, more: str = NEIGHBOURS) -> Simulator:
    """Robot 0 in the middle; 1 is 3 m to its east, 2 is 4 m to its north, 3 is 50 m to its south; the others are far
    away."""
    sim = simulator(folder, more=more)
    bodies = sim.bodies
    bodies.x[:], bodies.y[:], bodies.heading[:] = 900.0, 900.0, 0.0
    bodies.x[:4], bodies.y[:4] = (500.0, 503.0, 500.0, 500.0), (500.0, 500.0, 504.0, 450.0)
    bodies.heading[:4] = 0.0, pi / 2, pi / 2, -pi / 2
    return sim


class TestSensing:
    def test_what_is_within_the_radius_is_counted_but_not_the_robot_itself(self, tmp_path: Path) -> None:
        sim = four(tmp_path)
        assert [ask(sim, "COUNT", radius) for radius in (0.0, 2.9, 3.0, 4.0, 60.0)] == [0, 0, 1, 2, 3]

    def test_nothing_is_sensed_beyond_the_reach(self, tmp_path: Path) -> None:
        sim = four(tmp_path, more='\n[neighbours]\nreach = "3.5m"\n')
        assert ask(sim, "COUNT", 1e9) == 1
        assert ask(sim, "FARTHEST_DIST", 1e9) == 3.0

    def test_places_distances_and_headings(self, tmp_path: Path) -> None:
        sim = four(tmp_path)
        assert ask(sim, "MEAN_X", 10.0) == pytest.approx(501.5)
        assert ask(sim, "MEAN_Y", 10.0) == pytest.approx(502.0)
        assert (ask(sim, "NEAREST_X", 10.0), ask(sim, "NEAREST_Y", 10.0)) == (503.0, 500.0)
        assert (ask(sim, "NEAREST_DIST", 60.0), ask(sim, "FARTHEST_DIST", 60.0)) == (3.0, 50.0)
        assert ask(sim, "MEAN_HEADING", 10.0) == pytest.approx(pi / 2)

    def test_the_widest_gap_lies_between_neighbours(self, tmp_path: Path) -> None:
        sim = four(tmp_path)  # one is east, one north: 270 degrees are free, their middle is south-west
        assert ask(sim, "GAP", 10.0) == pytest.approx(1.5 * pi)
        assert ask(sim, "GAP_BEARING", 10.0) == pytest.approx(-0.75 * pi)
        assert ask(sim, "GAP", 3.0) == pytest.approx(2 * pi)
        assert abs(ask(sim, "GAP_BEARING", 60.0)) == pytest.approx(pi)  # one more is south: the west is free

    def test_the_outlier_is_farthest_from_the_mean_of_all_neighbours(self, tmp_path: Path) -> None:
        sim = four(tmp_path)
        assert (ask(sim, "OUTLIER_X", 60.0), ask(sim, "OUTLIER_Y", 60.0)) == (500.0, 450.0)
        assert (ask(sim, "OUTLIER_X", 60.0, robot=3), ask(sim, "OUTLIER_Y", 60.0, robot=3)) == (500.0, 504.0)
        assert ask(sim, "OUTLIER_X", 3.5) == 503.0, "the only one"

    def test_distances_by_rank(self, tmp_path: Path) -> None:
        sim = four(tmp_path)
        assert [ask(sim, "RANK_DIST", rank, 60.0) for rank in (1, 1.9, 2, 3, 4, 1e9)] == [3, 3, 4, 50, 50, 50]
        assert ask(sim, "RANK_DIST", 3, 10.0) == 4.0
        assert all(isnan(ask(sim, "RANK_DIST", rank, 60.0)) for rank in (0, -1))
        assert isnan(ask(sim, "RANK_DIST", 1, 2.0))
        assert ask(sim, "MEAN_Y", ask(sim, "RANK_DIST", 2, 60.0)) == pytest.approx(502.0), "of the two nearest"
        assert [ask_all(sim, "RANK_DIST", 2, 60.0)[robot] for robot in (0, 1)] == [4.0, 5.0]

    def test_ranks_differ_from_robot_to_robot_and_hold_in_blocks(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        found = []
        for most in (range_and_bearing.MAX_PAIRS, 1):
            monkeypatch.setattr(range_and_bearing, "MAX_PAIRS", most)
            sim = four(tmp_path)
            (function,) = (each for each in sim.model.functions if each.name == "RANK_DIST")
            assert function.many
            found.append(function.many(sim.robots, np.array([1, 0, 2]), np.array([1.0, 2.0, 3.0]), np.full(3, 60.0)))
        assert found[0] == pytest.approx([3.0, 4.0, 54.0])
        assert np.array_equal(*found)

    def test_without_neighbours_only_the_count_is_known(self, tmp_path: Path) -> None:
        sim = four(tmp_path)
        assert ask(sim, "COUNT", 1.0) == 0.0
        assert all(isnan(ask(sim, name, 1.0)) for name in ASKED[1:])

    def test_a_negative_radius_finds_nobody(self, tmp_path: Path) -> None:
        assert ask(four(tmp_path), "COUNT", -5.0) == 0.0


class TestField:
    """What lies behind a robot, in the cone that its field of view leaves out, it does not sense."""

    def test_neighbours_behind_are_not_sensed_but_all_around_up_to_a_distance(self, tmp_path: Path) -> None:
        for field, all_round, seen in (
            ("270deg", "0m", {1, 2, 3}),  # the third one is to its right: 135 degrees to each side
            ("170deg", "0m", {1}),
            ("170deg", "4m", {1, 2}),
            ("0deg", "0m", {1}),  # exactly ahead
            ("360deg", "0m", {1, 2, 3}),
        ):
            more = f'\n[neighbours]\nreach = "60m"\nfield = "{field}"\nall_round = "{all_round}"\n'
            sim = four(tmp_path, more=more)
            assert ask(sim, "COUNT", 60.0) == len(seen), field
            assert sim.senses._near
            numbers = np.arange(1.0, 4.0)
            told = sim.senses._near.shown("distance", np.zeros(3, np.intp), numbers)
            assert {*numbers[~np.isnan(told)].astype(int).tolist()} == seen, field

    def test_it_looks_where_it_heads(self, tmp_path: Path) -> None:
        sim = four(tmp_path, more='\n[neighbours]\nreach = "60m"\nfield = "100deg"\n')
        for heading, x, y in ((0.0, 503.0, 500.0), (pi / 2, 500.0, 504.0), (-pi / 2, 500.0, 450.0)):
            sim.bodies.heading[0] = heading
            sim.senses.step()
            assert (ask(sim, "MEAN_X", 60.0), ask(sim, "MEAN_Y", 60.0)) == (x, y)
        sim.bodies.heading[0] = pi
        sim.senses.step()
        assert ask(sim, "COUNT", 60.0) == 0
        assert isnan(ask(sim, "NEAREST_ID", 60.0))

    def test_a_whole_turn_leaves_every_bit_as_it_is(self, tmp_path: Path) -> None:
        found = []
        for field in ("", 'field = "360deg"\n'):
            sim = simulator(tmp_path, more=f'\n[neighbours]\nreach = "300m"\nloss = 0.1\n{field}')
            sim.step()
            found.append([ask_all(sim, name, 300.0).tobytes() for name in ASKED])
        assert found[0] == found[1]


class TestErrors:
    def crowd(self, folder: Path, more: str) -> Simulator:
        """Twenty robots within 20 m."""
        sim = simulator(folder, more=more)
        sim.bodies.x[:], sim.bodies.y[:] = 500.0 + np.arange(20.0), 500.0
        return sim

    def test_a_share_of_neighbours_is_missed_and_others_in_the_next_tick(self, tmp_path: Path) -> None:
        sim = self.crowd(tmp_path, NEIGHBOURS + "loss = 0.25\n")
        seen = []
        for _ in range(40):
            seen.append(ask_all(sim, "COUNT", 50.0))
            sim.senses.step()
            sim.bodies.tick += 1
        share = np.mean(seen) / 19.0
        assert 0.72 < share < 0.78
        assert len({tuple(each) for each in seen}) > 30

    def test_places_are_noisy_in_proportion_to_their_distance(self, tmp_path: Path) -> None:
        sim = four(tmp_path, more=NEIGHBOURS + "noise = 0.1\n")
        errors = []
        for _ in range(400):
            errors.append([ask(sim, "NEAREST_X", 3.5) - 503.0, ask(sim, "NEAREST_Y", 3.5) - 500.0])
            sim.senses.step()
            sim.bodies.tick += 1
        assert np.allclose(np.std(errors, axis=0), 0.3, rtol=0.15)
        assert np.allclose(np.mean(errors, axis=0), 0.0, atol=0.05)

    def test_a_robot_sees_the_world_in_its_own_frame(self, tmp_path: Path) -> None:
        sim = Simulator(load(write(tmp_path, ("count = 1", "count = 4"), text=SCOUTS, more=NEIGHBOURS)))
        bodies = sim.bodies
        bodies.x[:], bodies.y[:], bodies.heading[:] = 1.0, 1.0, 0.0
        bodies.x[:2], bodies.y[:2], bodies.heading[:2] = (5.0, 8.0), 9.0, (0.0, 1.0)
        bodies.encoder_x[0], bodies.encoder_y[0], bodies.encoder_heading[0] = 10.0, 20.0, 0.25  # it has slipped
        assert isclose(ask(sim, "MEAN_X", 3.5), 10.0 + 3.0 * cos(0.25))
        assert isclose(ask(sim, "MEAN_Y", 3.5), 20.0 + 3.0 * sin(0.25))
        assert isclose(ask(sim, "MEAN_HEADING", 3.5), 1.25)


class TestSharing:
    def test_a_colour_is_seen_from_the_next_tick_on(self, tmp_path: Path) -> None:
        sim = four(tmp_path)
        ask(sim, "COLOUR", 2.0, robot=1)
        assert ask(sim, "COUNT", 10.0, 2.0) == 0.0
        sim.senses.step()
        assert ask(sim, "COUNT", 10.0, 2.0) == 1.0
        assert ask(sim, "COUNT", 10.0, 0.0) == 1.0
        assert ask(sim, "MEAN_X", 10.0, 2.0) == 503.0

    def test_numbers_are_reduced_over_those_who_share_one(self, tmp_path: Path) -> None:
        sim = four(tmp_path, more=SHARES)
        assert isnan(ask(sim, "MEAN_OPINION", 60.0))
        assert ask(sim, "SUM_OPINION", 60.0) == 0.0
        for robot, opinion in ((0, 100.0), (1, 1.0), (3, 4.0)):
            ask(sim, "SHARE_OPINION", opinion, robot=robot)
        sim.senses.step()
        found = {name: ask(sim, f"{name}_OPINION", 60.0) for name in ("MEAN", "SUM", "LEAST", "MOST", "NEAREST")}
        assert found == {"MEAN": 2.5, "SUM": 5.0, "LEAST": 1.0, "MOST": 4.0, "NEAREST": 1.0}

    def test_shared_numbers_are_state(self, tmp_path: Path) -> None:
        sim = four(tmp_path, more=SHARES)
        before = sim.state_hash()
        ask(sim, "SHARE_LOAD", 5.0, robot=1)
        assert sim.state_hash() != before
        again = resume(state_of(sim))
        assert again.state_hash() == sim.state_hash()
        for each in (sim, again):
            each.step()
        assert ask(again, "SUM_LOAD", 60.0) == ask(sim, "SUM_LOAD", 60.0) == 5.0


class TestOneResult:
    """However it is asked, the result has the same bits."""

    def running(self, folder: Path, machine: str = "numpy") -> Simulator:
        path = write(
            folder, ("count = 20", "count = 300"), more=SHARES.replace('"100m"', '"60m"\nloss = 0.1\nnoise = 0.05')
        )
        sim = Simulator(load(path), machine=choose(machine, 2))
        for _ in range(5):
            sim.step()
        return sim

    @pytest.mark.parametrize("name", ASKED)
    def test_one_robot_and_all_at_once(self, tmp_path: Path, name: str) -> None:
        sim = self.running(tmp_path)
        together = ask_all(sim, name, 40.0)
        sim.senses._near._recent.clear()  # type: ignore[union-attr]  # so that each is found anew
        alone = [ask(sim, name, 40.0, robot=robot) for robot in range(sim.bodies.count)]
        assert np.array_equal(together, alone, equal_nan=True)

    def test_in_blocks(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        sim = self.running(tmp_path)
        whole = [ask_all(sim, name, 40.0) for name in ASKED]
        monkeypatch.setattr(range_and_bearing, "MAX_PAIRS", 50)
        sim.senses._near._recent.clear()  # type: ignore[union-attr]
        assert all(
            np.array_equal(*each, equal_nan=True)
            for each in zip(whole, [ask_all(sim, name, 40.0) for name in ASKED], strict=True)
        )

    def test_with_compiled_kernels(self, tmp_path: Path) -> None:
        pytest.importorskip("numba")
        by_numpy, by_numba = self.running(tmp_path), self.running(tmp_path, "numba")
        for name in ASKED:
            assert np.array_equal(ask_all(by_numpy, name, 40.0), ask_all(by_numba, name, 40.0), equal_nan=True)


TORUS = 'width = "250m"\nheight = "240m"\nedge = "torus"'
WORLDS = {
    "plain": (),
    "torus": (('width = "1km"\nheight = "1km"', TORUS), ('x = "500m"\ny = "400m"', 'x = "50m"\ny = "40m"')),
    "noisy": (("[radio]", '[noise]\nx = "1m"\nheading = "5deg"\n\n[radio]'),),
}
NARROW = 'field = "150deg"\nall_round = "3m"\n'
ERRORS = {
    "exact": "",
    "wrong": "loss = 0.2\nnoise = 0.1\n",
    "late": 'delay = "0.1s"\nnoise = 0.1\n',
    "narrow": NARROW,
    "all": f'loss = 0.2\ndelay = "0.1s"\n{NARROW}',
}
SHARED = '[neighbours.shares]\nopinion = ""\nway = "deg"\n'
REDUCED = tuple(f"{how}_{what}" for what in ("OPINION", "WAY") for how in ("MEAN", "SUM", "LEAST", "MOST", "NEAREST"))
SHOWN = ("x", "y", "heading", "distance", "bearing", "colour", "opinion", "way")


def one_by_one(
    near: RangeAndBearing, robots: np.ndarray, radii: np.ndarray, fields: tuple[str, ...]
) -> list[np.ndarray]:
    """Who is near these robots, at most 20 and at most 3 of each; and what each of them senses of all others, of
    itself, and of robots that are not there."""
    found = []
    for most in (20, 3):
        first, others = near.neighbours(robots, most, radii)
        found += [first.astype(float), others.astype(float)]
    asked = np.repeat(robots, 64)
    named = np.tile([*np.arange(-1.0, 61.0), 0.5, np.nan], robots.size)
    return [*found, *(near.shown(field, asked, named) for field in fields)]


@pytest.mark.parametrize("errors", ERRORS)
@pytest.mark.parametrize("world", WORLDS)
@given(chance=st.integers(0, 2**32 - 1), radius=st.sampled_from([0.0, 1.0, 2.5, 7.0, 50.0]))
@settings(max_examples=6, deadline=None)
def test_random_worlds_are_the_same_with_and_without_pairs(
    world: str, errors: str, chance: int, radius: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Whether they are alone, at one place, of several colours, or share nothing."""
    pytest.importorskip("numba")
    more = f'\n[neighbours]\nreach = "40m"\n{ERRORS[errors]}{SHARED}'
    scenario = load(write(tmp_path_factory.mktemp("world"), ("count = 20", "count = 60"), *WORLDS[world], more=more))
    drawn, results = np.random.default_rng(chance), []
    places, headings = np.rint(drawn.uniform(-12.0, 12.0, (2, 60)) * 4.0) / 4.0, drawn.uniform(-pi, pi, 60)
    colours, opinions = drawn.integers(0, 3, 60).astype(float), drawn.choice([-0.0, 0.0, 1.5, np.nan], 60)
    ways, radii, some = drawn.uniform(-9.0, 9.0, 60), drawn.choice([radius, 3.0], 60), drawn.permutation(60)[:40]
    few = np.sort(some[:9])
    moves = np.rint(drawn.uniform(-3.0, 3.0, (2, 60)))
    for machine, threads in (("numpy", 1), ("numba", 1), ("numba", 2)):
        sim = Simulator(scenario, machine=choose(machine, threads))
        sim.step()
        near = sim.senses._near
        assert near
        sim.bodies.x[:], sim.bodies.y[:], sim.bodies.heading[:] = (*places, headings)
        sim.bodies.moved()  # on a torus some of them are beyond an edge
        for row, values in enumerate((colours, opinions, ways)):
            near.share(row, np.arange(60), values)
        near.step()
        sim.bodies.x[:], sim.bodies.y[:], sim.bodies.heading[:] = (*(places + moves), headings[::-1])
        sim.bodies.moved()
        near.step()
        functions = {each.name: each.many for each in sim.model.functions}
        for name in (*ASKED[:9], *REDUCED):
            many = functions[name]
            assert many
            results.append(many(sim.robots, some, radii[some]))
            results.append(many(sim.robots, some, np.full(40, radius), colours[some[::-1]]))
        results += one_by_one(near, few, radii[few], SHOWN)
    found = np.concatenate(results).reshape(3, -1)
    found[np.isnan(found)] = np.nan  # whatever sign it has
    by_numpy, *others = found
    assert all(each.tobytes() == by_numpy.tobytes() for each in others)


SKY = """
format = 2
title = "a sky"
seconds = "1min"
tick = "0.1s"

[world]
width = "{width}m"
height = "30m"
{edge}

[[robots]]
like = "copter"
count = 40

[[robots]]
type = "rover"
count = 20

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "1m/s2"

[robots.body]
radius = "0.2m"

[neighbours]
reach = "12m"
{errors}
{shared}
{walls}
"""
SKIES = {
    "plain": ("100", "", ""),
    "torus": ("40", 'edge = "torus"', ""),
    "walls": ("40", "", '[[world.walls]]\npoints = [["20m", "0m"], ["20m", "15m"]]'),
    "low walls": ("40", "", '[[world.walls]]\npoints = [["15m", "0m"], ["15m", "30m"]]\ntall = "12m"'),
}


@pytest.mark.parametrize("errors", ERRORS)
@pytest.mark.parametrize("sky", SKIES)
@given(chance=st.integers(0, 2**32 - 1), radius=st.sampled_from([0.0, 2.5, 7.0, 50.0]))
@settings(max_examples=4, deadline=None)
def test_random_skies_are_the_same_with_and_without_pairs(sky: str, errors: str, chance: int, radius: float) -> None:
    """Copters and rovers, in one layer of cells or in several ones; and native code gets the same where it may ask."""
    pytest.importorskip("numba")
    width, edge, walls = SKIES[sky]
    scenario = read_scenario(SKY.format(width=width, edge=edge, errors=ERRORS[errors], shared=SHARED, walls=walls))
    drawn, results = np.random.default_rng(chance), []
    places, headings = np.rint(drawn.uniform(0.0, 29.0, (3, 60)) * 2.0) / 2.0, drawn.uniform(-pi, pi, 60)
    colours, opinions = drawn.integers(0, 3, 60).astype(float), drawn.choice([-0.0, 0.0, 1.5, np.nan], 60)
    radii, some = drawn.choice([radius, 3.0], 60), drawn.permutation(60)[:50]
    few = np.sort(some[:9])
    moves = np.rint(drawn.uniform(0.0, 1.0, (3, 60)))
    for machine, threads in (("numpy", 1), ("numba", 1), ("numba", 2)):
        sim = Simulator(scenario, machine=choose(machine, threads))
        near, flight = sim.senses._near, sim.bodies.flight
        assert near
        assert flight
        sim.bodies.x[:], sim.bodies.y[:], sim.bodies.heading[:] = (*places[:2], headings)
        flight.z[:40] = places[2, :40]
        sim.bodies.moved()
        for row, values in enumerate((colours, opinions, headings)):
            near.share(row, np.arange(60), values)
        near.step()
        sim.bodies.x[:], sim.bodies.y[:], sim.bodies.heading[:] = (*(places + moves)[:2], headings[::-1])
        flight.z[:40] += moves[2, :40]
        sim.bodies.moved()
        near.step()
        functions = {each.name: each for each in sim.model.functions}
        for name in (*ASKED, "MEAN_Z", "NEAREST_Z", *REDUCED):
            many = functions[name].many
            assert many
            results.append(many(sim.robots, some, radii[some]))
            results.append(many(sim.robots, some, np.full(50, radius), colours[some[::-1]]))
            native = functions[name].native
            if machine == "numba" and native is not None:
                call = native.bound(sim.robots, (radius,))
                assert call
                assert call.usable
                assert call.usable() == (sky != "low walls")
                if not call.usable():
                    continue
                ctypes.CFUNCTYPE(None, ctypes.c_void_p)(call.prepare)(call.senses)
                expected = many(sim.robots, np.arange(20), np.full(20, radius))
                assert np.array_equal(told(call, radius), expected, equal_nan=True)
        results += one_by_one(near, few, radii[few], (*SHOWN, "z"))
        assert (near._named is None) == (machine == "numba" and sky != "low walls"), (
            "kernels are asked where they may be"
        )
    found = np.concatenate(results).reshape(3, -1)
    found[np.isnan(found)] = np.nan  # whatever sign it has
    by_numpy, *others = found
    assert all(each.tobytes() == by_numpy.tobytes() for each in others)


def told(call: NativeCall, radius: float) -> list[float]:
    """What native code tells of twenty robots, eight at a time and of the last ones four."""
    found = list[float]()
    for first, mask in ((0, 0xFF), (8, 0xFF), (12, 0xF0)):
        radii, results = np.full(8, radius), np.full(8, 7.0)
        words = [ctypes.c_int64] * 3 + [ctypes.c_void_p] * 2
        ask = ctypes.CFUNCTYPE(None, ctypes.c_void_p, *words)(call.call)
        ask(call.context, first, mask, 8, radii.ctypes.data, results.ctypes.data)
        found += [each for lane, each in enumerate(results.tolist()) if mask >> lane & 1]
    return found


@pytest.mark.parametrize("errors", ERRORS)
def test_native_code_is_given_the_same_and_can_begin_a_tick(errors: str, tmp_path: Path) -> None:
    """As long as chance has no part in it: its keys are Python's."""
    pytest.importorskip("numba")
    scenario = load(write(tmp_path, more=f'\n[neighbours]\nreach = "400m"\n{ERRORS[errors]}{SHARED}'))
    sims = [Simulator(scenario, machine=choose("numba", 1)) for _ in range(2)]
    names = ("COUNT", "MEAN_X", "MEAN_HEADING", "MEAN_WAY", "SUM_OPINION")
    functions = {each.name: each for each in sims[0].model.functions if each.name in names}
    calls = {}
    for name, function in functions.items():
        assert function.native
        assert function.native.takes((300.0,))
        assert not function.native.takes((None,))
        calls[name] = function.native.bound(sims[0].robots, (300.0,))
    found = []
    for tick in range(3):
        for sim in sims:
            sim.step()
            near = sim.senses._near
            assert near
            sim.bodies.x[:] += 10.0 * np.arange(20.0)
            near.share(1, np.arange(20), np.arange(20.0) * tick)
            near.share(2, np.arange(20), np.arange(20.0))
        first, second = sims
        beginnings = first.senses.beginnings
        assert bool(beginnings) == (errors in ("exact", "narrow"))
        for begin, argument in beginnings or ():
            ctypes.CFUNCTYPE(None, ctypes.c_void_p)(begin)(argument)
        if beginnings:
            near.step()  # of the second one, whose senses Python begins again
        else:
            for sim in sims:
                assert sim.senses._near
                sim.senses._near.step()
        for name, call in calls.items():
            assert call
            ctypes.CFUNCTYPE(None, ctypes.c_void_p)(call.prepare)(call.senses)
            found.append(told(call, 300.0))
            assert np.array_equal(found[-1], ask_all(second, name, 300.0), equal_nan=True)
        assert first.bodies.tick == tick + 1
    assert len({tuple(each) for each in found}) > 6


class TestInExpressions:
    def test_a_rule_and_its_explanation(self, tmp_path: Path) -> None:
        path = write(tmp_path, more=SHARES)
        with sc.open(str(path), seed=3) as fleet:
            sent = fleet.send("(WHEN (> (COUNT 80m) 1) (JOIN crowd) (SHARE_OPINION (COUNT 80m)))", everybody=True)
            fleet.run(1)
            assert 0 < len(sent.matched) < 20
            one = sent.matched[0]
            assert "COUNT" in str(sent.why(one))

    def test_values_and_history_of_a_fleet(self, tmp_path: Path) -> None:
        with sc.open(str(write(tmp_path, more=SHARES)), seed=3) as fleet:
            counted = fleet["(COUNT 80m)"]
            assert counted.max() > 0
            assert counted[0] == np.sum(np.hypot(fleet.x - fleet.x[0], fleet.y - fleet.y[0]) <= 80.0) - 1
            with pytest.raises(sc.errors.SleepcastError, match="cannot be previewed"):
                fleet["(SHARE_OPINION 3)"]

    def test_without_the_sense_the_functions_fail(self, tmp_path: Path) -> None:
        with sc.open(str(write(tmp_path))) as fleet:
            with pytest.warns(UserWarning, match='unknown function "COUNT"'):
                sent = fleet.send("(WHEN (> (COUNT 5m) 1) (ST))", everybody=True)
            fleet.run(1)
            assert len(sent.fault) == 20


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ('reach = "-1m"', "reach"),
        ('reach = "5m"\nloss = 2', "loss"),
        ('reach = "5m"\nfield = "361deg"', "field"),
        ('reach = "5m"\nall_round = "1m"', "say the field"),
        ('reach = "5m"\n[neighbours.shares]\nx = ""', "choose another"),
        ('reach = "5m"\n[neighbours.shares]\nx1 = "parsec"', "parsec"),
        ('reach = "5m"\n[neighbours.shares]\n' + "".join(f'x{i} = ""\n' for i in range(9)), "at most 8"),
        ("", "reach"),
    ],
)
def test_a_table_that_cannot_be(tmp_path: Path, more: str, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        load(write(tmp_path, more=f"\n[neighbours]\n{more}\n"))
