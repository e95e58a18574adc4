"""Measures of a group as a whole, on groups whose values are known."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.core.errors import MisuseError
from sleepcast.experiments.group_measures import ALONE, WITHIN, SwarmSample, read_group_measure
from sleepcast.experiments.measures import angle_of, own_function, read_measure


def group(places: list[tuple[float, float]], headings: list[float] | None = None, size: float = 100.0) -> SwarmSample:
    x, y = np.array(places, float).T
    return SwarmSample(x, y, np.array(headings or [0.0] * len(places)), (size, size))


def in_space(places: list[tuple[float, float, float]], ways: list[tuple[float, float, float]]) -> SwarmSample:
    (x, y, z), (east, north, up) = np.array(places, float).T, np.array(ways, float).T
    pitch = np.arctan2(up, np.hypot(east, north))
    return SwarmSample(x, y, np.arctan2(north, east), (100.0, 100.0), z, pitch=pitch)


def flying(places: list[tuple[float, float, float]], velocities: list[tuple[float, float]]) -> SwarmSample:
    x, y, z = np.array(places, float).T
    return SwarmSample(x, y, np.zeros_like(x), (100.0, 100.0), z, np.array(velocities, float).T)


SQUARE = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
ABOVE = [(10.0, 10.0, 5.0), (10.0, 10.0, 9.0), (13.0, 10.0, 5.0), (60.0, 60.0, 5.0)]
WHEEL = [(5.0, 1.0, 0.0), (5.0, 0.0, 1.0), (5.0, -1.0, 0.0), (5.0, 0.0, -1.0)]
"""As SQUARE, upright: across y and z."""
TWO_GROUPS = [(10.0, 10.0), (11.0, 10.0), (12.0, 10.0), (50.0, 50.0), (51.0, 50.0)]


@pytest.mark.parametrize(
    ("name", "near", "some", "value"),
    [
        ("polarization", 0.0, group(SQUARE), 1.0),
        ("polarization", 0.0, group(SQUARE, [0, pi / 2, pi, -pi / 2]), 0.0),
        ("rotation", 0.0, group(SQUARE, [pi / 2, pi, -pi / 2, 0]), 1.0),
        ("rotation", 0.0, group(SQUARE, [-pi / 2, 0, pi / 2, pi]), 1.0),
        ("rotation", 0.0, group(SQUARE, [0, pi / 2, pi, -pi / 2]), 0.0),
        ("gyration", 0.0, group(SQUARE), 1.0),
        ("closest", 0.0, group(SQUARE), 2.0**0.5),
        ("closest", 0.0, group(SQUARE)._replace(z=np.array([3.0, 0.0, 3.0, 5.0])), 2.0),
        ("closest", 0.0, group([(1.0, 1.0), (1.0, 1.0)]), 0.0),
        ("polarization", 0.0, in_space(WHEEL, [(0, 0, 1)] * 4), 1.0),
        ("polarization", 0.0, in_space(WHEEL, [(0, 1, 0), (0, 0, 2), (0, -1, 0), (0, 0, -2)]), 0.0),
        ("rotation", 0.0, in_space(WHEEL, [(0, 0, 1), (0, -1, 0), (0, 0, -1), (0, 1, 0)]), 1.0),
        ("rotation", 0.0, in_space(WHEEL, [(0, 0, 1)] * 4), 0.0),
        ("gyration", 0.0, in_space(WHEEL, [(0, 0, 1)] * 4), 1.0),
        ("clusters", 1.5, in_space([(0, 0, 0), (0, 0, 1), (0, 0, 3)], [(1, 0, 0)] * 3), 2.0),
        ("largest_cluster", 1.5, group(TWO_GROUPS), 0.6),
        ("largest_cluster", 0.5, group(TWO_GROUPS), 0.2),
        ("clusters", 1.5, group(TWO_GROUPS), 2.0),
        ("clusters", 0.5, group(TWO_GROUPS), 5.0),
        ("clusters", 1.5, group([(1.0, 1.0)]), 1.0),
        ("covered", 10.0, group([(50.0, 50.0)]), pi / 100.0),
        ("ground_speed", 0.0, flying(ABOVE, [(3, 4), (0, 0), (-1, 0), (0, 2)]), 2.0),
        ("velocity_correlation", 5.0, flying(ABOVE[:3], [(3, 4), (6, 8), (0.3, 0.4)]), 1.0),
        ("velocity_correlation", 5.0, flying(ABOVE, [(1, 0), (2, 0), (0, 3), (5, 0)]), (0.5 + 0.5 + 0.0 + 0.0) / 4),
        ("velocity_correlation", 5.0, flying(ABOVE[:2], [(1, 0), (-2, 0)]), -1.0),
        ("velocity_correlation", 5.0, flying(ABOVE[:3], [(1, 0), (0, 0), (1, 0)]), (0.5 + 0.0 + 0.5) / 3),
        ("velocity_correlation", 0.1, flying(ABOVE[1:3], [(1, 0), (1, 0)]), 0.0),
        ("close_pairs", 3.5, flying(ABOVE, [(0, 0)] * 4), 1 / 6),
        ("close_pairs", 5.1, flying(ABOVE, [(0, 0)] * 4), 3 / 6),
        ("close_pairs", 5.0, flying(ABOVE[:1], [(0, 0)]), 0.0),
        ("voronoi_cost", 0.0, group([(50.0, 50.0)]), 100.0**2 / 6.0),  # the mean of x2 + y2 over a square
    ],
)
def test_values(name: str, near: float, some: SwarmSample, value: float) -> None:
    assert (ALONE | WITHIN)[name](some, near) == pytest.approx(value, rel=0.02, abs=1e-9)


def test_of_a_fleet_and_of_some_of_its_robots() -> None:
    with sc.open("bravo", seed=3) as fleet:
        assert 0.0 < read_measure("polarization")(fleet) < 0.2
        everybody = read_measure("gyration")(fleet)
        near = read_measure("gyration (< (DIST x y vessel_x vessel_y) 5mi)")(fleet)
        assert near < 5 * 1609.4 < everybody
        assert read_measure("largest_cluster 40mi")(fleet) == 1.0
        assert np.isnan(read_measure("largest_cluster 1m (> fuel 200%)")(fleet))


def test_who_is_closest_in_space_among_all_or_some() -> None:
    places = [[x, "10m", "0deg"] for x in ("10m", "13m", "19m")]
    with sc.open("rehearsal", robots=3, over={"robots.starts": places}) as fleet:
        assert read_measure("closest")(fleet) == 3.0
        fleet.send("(WHEN (= id 1) (TAKEOFF 4m))")
        fleet.run("10s", quiet=True)
        assert read_measure("closest")(fleet) == pytest.approx(5.0)
        assert read_measure("closest (> id 1)")(fleet) == 6.0
        assert np.isnan(read_measure("closest (> id 2)")(fleet)), "nobody is near a lone robot"


@pytest.mark.parametrize(
    "text",
    ["largest_cluster", "covered 5", "covered 5s", "gyration 5m", "clusters 2m fuel", "clusters -2m", "rotation x"],
)
def test_texts_that_are_no_measure(text: str) -> None:
    with pytest.raises(MisuseError, match=r"wanted|unit of length"):
        read_group_measure(text)


def test_the_velocity_of_what_flies_drives_and_drives_sideways() -> None:
    with sc.open("crowd", robots=3) as fleet:
        fleet.send("(SETQ drive_speed 0.2m/s)", everybody=True)
        fleet.run(2.0)
        assert fleet.velocity == pytest.approx(
            fleet["speed"] * np.stack((np.cos(fleet.heading), np.sin(fleet.heading)))
        )
        assert fleet.z.tolist() == [0.0] * 3
    with sc.open("rehearsal", robots=2) as fleet:
        fleet.send("(TAKEOFF 2m)", everybody=True)
        fleet.run(8.0)
        fleet.send("(PROGN (SETQ drive_speed 1m/s) (SETQ drive_side 0.5m/s))", everybody=True)
        before = np.stack((fleet.x, fleet.y))
        fleet.run(1.0)
        assert fleet.z == pytest.approx(2.0, abs=0.1)
        assert read_measure("ground_speed")(fleet) == pytest.approx(np.hypot(1.0, 0.5), abs=0.01)
        assert (np.sign(fleet.velocity) == np.sign(np.stack((fleet.x, fleet.y)) - before)).all()


def test_a_mean_over_time_is_of_all_samples_so_far_from_a_time_on() -> None:
    with sc.open("crowd", robots=2) as fleet:
        every, late, unknown = (
            read_measure(text)
            for text in ("time_mean mean time", "time_mean 2s mean time", "time_mean mean (IF (> time 2.5s) 7 UNKNOWN)")
        )
        found = []
        for _ in range(4):
            found.append((every(fleet), late(fleet), unknown(fleet)))
            fleet.run(1.0)
        assert np.array(found) == pytest.approx(
            np.array([(0.0, np.nan, np.nan), (0.5, np.nan, np.nan), (1.0, 2.0, np.nan), (1.5, 2.5, 7.0)]), nan_ok=True
        )
        again = read_measure("time_mean mean time")
        assert again(fleet) == fleet.time, "each run has its own"


def test_a_mean_of_angles_over_time_is_a_direction() -> None:
    with sc.open("crowd", robots=1) as fleet:
        turning = read_measure("time_mean mean (WRAP (+ 170deg (* time 10deg)))")
        turning(fleet)
        fleet.run(2.0)
        assert abs(turning(fleet)) == pytest.approx(np.pi)
        assert angle_of("time_mean 2s quantile 0.5 heading") == "heading"


@pytest.mark.parametrize("text", ["time_mean", "time_mean 5m mean fuel", "time_mean time_mean mean fuel"])
def test_texts_that_are_no_mean_over_time(text: str) -> None:
    with pytest.raises(MisuseError, match="perhaps a time from which on, and a measure, as in time_mean 20s mean fuel"):
        read_measure(text)


def test_a_function_in_python_is_one_behind_a_mean_too() -> None:
    assert own_function("time_mean 20s analysis.spread") == own_function("analysis.spread") == ("analysis", "spread")
    with pytest.raises(MisuseError, match="what comes from others is not run"):
        read_measure("time_mean analysis.spread")


def test_a_misspelt_name() -> None:
    with pytest.raises(MisuseError, match="did you mean polarization"):
        read_measure("polarisation")


def test_the_order_of_angles_is_the_length_of_their_mean() -> None:
    with sc.open("crowd", robots=4) as fleet:
        assert read_measure("order (* 90deg (MOD id 4))")(fleet) == pytest.approx(0.0, abs=1e-12)
        assert read_measure("order (* 180deg (MOD id 2))")(fleet) == pytest.approx(0.0, abs=1e-12)
        assert read_measure("order 60deg")(fleet) == pytest.approx(1.0)
        assert read_measure("order heading")(fleet) == pytest.approx(read_measure("polarization")(fleet))


def test_the_gap_is_the_widest_between_neighbouring_values_that_are_known() -> None:
    with sc.open("crowd", robots=5) as fleet:
        assert read_measure("gap (* id id)")(fleet) == 25 - 16
        assert read_measure("gap (IF (< id 4) (* id id) UNKNOWN)")(fleet) == 9 - 4
        assert read_measure("gap 3")(fleet) == 0.0


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("IN bravo", r"write count \(IN bravo\) or share \(IN bravo\)"),
        ("(IN bravo)", r"write count \(IN bravo\), share"),
        ("avg fuel", "write mean fuel"),
        ("percentage (IN bravo)", r"write share \(IN bravo\)"),
        ("mean(fuel)", "write mean fuel"),
        ("count(IN bravo)", r"write count \(IN bravo\)"),
        ("number of robots", 'there is no "number"'),
    ],
)
def test_a_measure_in_other_words_is_answered_with_ours(text: str, meant: str) -> None:
    with pytest.raises(MisuseError, match=meant):
        read_measure(text)
