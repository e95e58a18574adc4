"""What lies below places in the air."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.roofs import GROUND, Roofs
from sleepcast.simulator.world.torus import PLAIN
from sleepcast.simulator.world.world import Area, Circle, Polygon, Wall, World, is_solid_throughout

HOUSE = Polygon(((2.0, 2.0), (8.0, 2.0), (8.0, 6.0), (2.0, 6.0)), tall=3.0)
RING = Area(
    (((10.0, 0.0), (20.0, 0.0), (20.0, 10.0), (10.0, 10.0)), ((12.0, 2.0), (18.0, 2.0), (18.0, 8.0), (12.0, 8.0)))
)
TOWER = Circle(5.0, 4.0, 1.0, tall=9.0)
THINGS = (HOUSE, replace(RING, tall=5.0), TOWER, Wall(((0.0, 8.0), (9.0, 8.0)), tall=2.0), Circle(15.0, 5.0, 2.0))


def below(*place: float, around: tuple[float, float] = PLAIN) -> float:
    x, y, z = (np.array([each]) for each in place)
    return float(Roofs(World(THINGS), around).below(x, y, z)[0])


@pytest.mark.parametrize(
    ("place", "height"),
    [
        ((3.0, 3.0, 4.0), 3.0),
        ((3.0, 3.0, 3.0), 3.0),
        ((3.0, 3.0, 2.9), GROUND),
        ((5.0, 4.0, 20.0), 9.0),
        ((5.0, 4.0, 8.0), 3.0),
        ((11.0, 5.0, 6.0), 5.0),
        ((13.0, 3.0, 6.0), GROUND),
        ((15.0, 5.0, 6.0), GROUND),
        ((4.0, 8.0, 6.0), GROUND),
        ((9.0, 9.0, 6.0), GROUND),
    ],
)
def test_the_highest_roof_that_is_not_above_counts(place: tuple[float, float, float], height: float) -> None:
    assert below(*place) == height


def test_on_a_torus_a_thing_at_the_edge_is_met_from_both_sides() -> None:
    world = World((Circle(0.5, 5.0, 1.0, tall=3.0),))
    x, y, z = np.array([0.2, 9.8, 1.4]), np.full(3, 5.0), np.full(3, 4.0)
    assert Roofs(world, (10.0, 10.0)).below(x, y, z).tolist() == [3.0, 3.0, 3.0]
    assert Roofs(world).below(x, y, z).tolist() == [3.0, GROUND, 3.0]


def test_many_places_are_as_each_alone() -> None:
    drawn = np.random.default_rng(4)
    x, y, z = drawn.uniform(-1.0, 21.0, 3_000), drawn.uniform(-1.0, 11.0, 3_000), drawn.uniform(0.0, 12.0, 3_000)
    wanted = np.full(3_000, GROUND)
    for thing in THINGS:
        if is_solid_throughout(thing) and thing.tall is not None:
            wanted = np.where(inside(thing, x, y) & (thing.tall <= z), np.maximum(wanted, thing.tall), wanted)
    assert Roofs(World(THINGS)).below(x, y, z).tolist() == wanted.tolist()
    assert {*wanted.tolist()} == {GROUND, 3.0, 5.0, 9.0}


def test_roofs_follow_the_world() -> None:
    world = World()
    roofs, place = Roofs(world), (np.array([5.0]), np.array([4.0]), np.array([20.0]))
    assert not roofs
    number = world.add(TOWER)
    assert roofs.below(*place) == [9.0]
    world.move(number, 3.0, 0.0)
    assert roofs.below(*place) == [GROUND]
    world.remove(number)
    assert not roofs


@pytest.mark.parametrize("tall", [0.0, -1.0, float("inf"), float("nan")])
def test_nothing_has_such_a_height(tall: float) -> None:
    with pytest.raises(MisuseError, match="wanted a number above 0"):
        World((replace(TOWER, tall=tall),))
