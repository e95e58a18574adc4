"""Where bodies stand at the start: what is refused, what is moved, and who may stand in others."""

from __future__ import annotations

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.bodies.starting import StartError

FIELD = """
format = 2
title = "a field"
seconds = "1min"

[world]
width = "20m"
height = "20m"
edge = "wall"

[[world.walls]]
points = [["15m", "5m"], ["15m", "9m"]]
tall = "3m"

[robots]
like = "{kind}"
{robots}
"""
ONE_METRE = r"their bodies overlap\. Put them more than 1 m apart"
IN_WALL = "its body, with a radius of 0.5 m, would be in a wall there"


def field(robots: str, kind: str = "copter") -> Simulator:
    return Simulator(read_scenario(FIELD.format(kind=kind, robots=robots)))


@pytest.mark.parametrize(
    ("robots", "said"),
    [
        ("starts = [[5, 5], [5, 5]]", "1 and 2 cannot start 0 m apart, at 5, 5, 0 m and 5, 5, 0 m: " + ONE_METRE),
        (
            "starts = [[9, 9], { x = 5, y = 5, z = 4 }, { x = 5, y = 5, z = 4.5 }]",
            "2 and 3 cannot start 0.5 m apart, at 5, 5, 4 m and 5, 5, 4.5 m: " + ONE_METRE,
        ),
        ('count = 2\nstarts = { shape = "line", spacing = "50cm", center = [5, 5] }', "cannot start 0.5 m apart, at"),
        ("starts = [[14.8, 7]]", "robot 1 cannot start at 14.8, 7, 0 m: " + IN_WALL),
        ("starts = [{ x = 0.3, y = 7, z = 4 }]", "robot 1 cannot start at 0.3, 7, 4 m: " + IN_WALL),
    ],
)
def test_a_given_place_where_a_copter_would_crash_is_refused(robots: str, said: str) -> None:
    with pytest.raises(StartError, match=said):
        field(robots)


def test_above_another_one_and_above_a_wall_is_room() -> None:
    simulator = field("starts = [[5, 5], { x = 5, y = 5, z = 1.1 }, { x = 14.8, y = 7, z = 3.1 }]")
    simulator.step()
    assert not simulator.news


@pytest.mark.parametrize("z", ["0m", "5m"])
def test_places_by_chance_are_found_where_nobody_crashes(z: str) -> None:
    bodies = field(f'count = 40\nx = ["13m", "20m"]\nz = ["{z}", "{z}"]').bodies
    apart = np.hypot(bodies.x[:, None] - bodies.x, bodies.y[:, None] - bodies.y) + 9.0 * np.eye(40)
    assert apart.min() > 1.0
    assert bodies.x.max() < 19.5
    beside = (bodies.y > 5.0) & (bodies.y < 9.0) & (np.abs(bodies.x - 15.0) < 0.5)
    assert beside.any() == (z == "5m"), "the wall is 3 m high"
    with pytest.raises(MisuseError, match="do not fit where they start"):
        field(f'count = 40\nx = ["9m", "12m"]\ny = ["9m", "12m"]\nz = ["{z}", "{z}"]')


def test_what_touches_nothing_may_start_in_others() -> None:
    field("body.bumpers = 0\nstarts = [[5, 5], [5, 5], [14.9, 7]]", kind="scout").step()
    particles = FIELD.replace('edge = "wall"', "").format(kind="particle", robots="starts = [[5, 5], [5, 5]]")
    Simulator(read_scenario(particles.replace('tall = "3m"', ""))).step()


@pytest.mark.parametrize("z", [0.0, 4.0])
def test_nobody_comes_where_a_copter_stands_or_flies(z: float) -> None:
    simulator = field(f"most = 3\nstarts = [{{ x = 5, y = 5, z = {z} }}]")
    if z:
        simulator.add_robot("copter", 5.4, 5.0, 0.0)
        return
    with pytest.raises(MisuseError, match=r"has no room at 5\.4, 5 m"):
        simulator.add_robot("copter", 5.4, 5.0, 0.0)


MIXED = """
like = "copter"
type = "copter"
hatch = true
starts = [{ x = 5, y = 5, z = 4 }]

[[robots]]
like = "scout"
type = "scout"
hatch = true
motion = "still"
starts = [[9, 9]]
"""


@pytest.mark.parametrize(
    ("parent", "text", "children"),
    [
        (1, "(HATCH copter 1)", 0),
        (1, "(HATCH scout 1)", 1),
        (2, "(HATCH copter 1)", 1),
        (2, "(HATCH copter 2)", 0),
        (2, "(HATCH copter 1) (HATCH copter 1)", 1),
    ],
)
def test_nobody_that_flies_is_hatched_into_another_one(parent: int, text: str, children: int) -> None:
    with sc.open(FIELD.format(kind="", robots="").replace('[robots]\nlike = ""\n', "[[robots]]" + MIXED)) as fleet:
        account = fleet.send(f"(WHEN (= id {parent}) {text})", everybody=True)
        fleet.run(1.0)
        assert len(fleet["x"]) == 2 + children
        flies = np.isfinite(fleet["crashed"])
        assert not fleet["crashed"][flies].any()
        assert flies.tolist() == [True, "copter" in text, False] if children else [True, False]
        told = ["a child begins where its parent is" in fault for fault in account.table()["fault"]]
        assert any(told) == (text.count("HATCH") > children)


@pytest.mark.parametrize("leaves", [True, False])
def test_a_copter_leaves_its_carrier_once_that_has_driven_away(leaves: bool) -> None:
    with sc.open(FIELD.format(kind="", robots="").replace('[robots]\nlike = ""\n', "[[robots]]" + MIXED)) as fleet:
        fleet.send("(WHEN (= id 2) (HATCH copter 1))", everybody=True)
        if leaves:
            fleet.send("(WHEN (= id 2) (SETQ drive_speed 0.5m/s))", everybody=True)
        fleet.run(4.0, quiet=True)
        fleet.send("(WHEN (= id 3) (TAKEOFF 2m))", everybody=True)
        fleet.run(4.0, quiet=True)
        assert fleet["crashed"][1] == (not leaves)
        assert (fleet["height"][1] > 1.0) == leaves
