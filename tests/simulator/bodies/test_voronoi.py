"""Voronoi cells: their centroids are those of a brute-force count of points, near enough, and the same in every way."""

from __future__ import annotations

from math import inf
from pathlib import Path

import numpy as np
import pytest

from sleepcast.simulator import Simulator
from sleepcast.simulator.bodies import voronoi
from small_worlds import simulator

NEIGHBOURS = '\n[neighbours]\nreach = "1km"\n'


def everybody(sim: Simulator, radius: float, robots: np.ndarray | None = None) -> np.ndarray:
    """Centroids of the cells of all robots, or of some, shape (2, robots)."""
    functions = {each.name: each.many for each in sim.model.functions}
    robots = np.arange(sim.bodies.count) if robots is None else robots
    return np.array(
        [functions[name](sim.robots, robots, np.full(robots.size, radius)) for name in ("CELL_X", "CELL_Y")]
    )


def counted(sim: Simulator, robot: int, radius: float, points: int = 600) -> tuple[float, float]:
    """The centroid of a cell, by the points of a fine grid that belong to it."""
    bodies = sim.bodies
    x, y = bodies.x - bodies.x[robot], bodies.y - bodies.y[robot]
    steps = (np.arange(points) + 0.5) / points * radius - radius / 2.0
    across, up = (each.ravel() for each in np.meshgrid(steps, steps))
    mine = across**2 + up**2 <= (radius / 2.0) ** 2
    for other in np.flatnonzero(np.hypot(x, y) <= radius):
        mine &= (across - x[other]) ** 2 + (up - y[other]) ** 2 >= across**2 + up**2
    if not sim.scenario.torus:
        mine &= (across + bodies.x[robot] >= 0) & (across + bodies.x[robot] <= sim.scenario.width)
        mine &= (up + bodies.y[robot] >= 0) & (up + bodies.y[robot] <= sim.scenario.height)
    return bodies.x[robot] + across[mine].mean(), bodies.y[robot] + up[mine].mean()


@pytest.mark.parametrize("radius", [60.0, 250.0, 900.0])
def test_a_centroid_is_that_of_all_points_of_the_cell(tmp_path: Path, radius: float) -> None:
    sim = simulator(tmp_path, more=NEIGHBOURS, seed=5)
    found = everybody(sim, radius)
    wanted = np.array([counted(sim, robot, radius) for robot in range(sim.bodies.count)]).T
    assert np.hypot(*(found - wanted)).max() < 0.003 * radius
    assert np.hypot(*(found - wanted)).mean() < 0.001 * radius


def test_one_robot_gets_the_same_as_all_of_them_and_in_small_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim = simulator(tmp_path, more=NEIGHBOURS)
    found = everybody(sim, 300.0)
    alone = np.hstack([everybody(sim, 300.0, np.array([robot])) for robot in range(sim.bodies.count)])
    assert (found == alone).all()
    monkeypatch.setattr(voronoi, "MAX_LENGTHS", 7 * voronoi.DIRECTIONS)
    sim.senses.step()
    assert (found == everybody(sim, 300.0)).all()


def test_a_robot_alone_has_a_disc_around_it_and_at_the_edge_what_the_world_leaves(tmp_path: Path) -> None:
    sim = simulator(tmp_path, more=NEIGHBOURS)
    sim.bodies.x[:], sim.bodies.y[:] = 900.0, 900.0
    sim.bodies.x[:2], sim.bodies.y[:2] = (500.0, 0.0), (500.0, 200.0)
    x, y = everybody(sim, 100.0)[:, :2]
    assert (x[0], y[0]) == pytest.approx((500.0, 500.0), abs=1e-9)
    assert x[1] == pytest.approx(4.0 * 50.0 / (3.0 * np.pi), rel=1e-3)  # of half a disc
    assert y[1] == pytest.approx(200.0, abs=1e-9)


def test_on_a_torus_a_cell_has_no_edge(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ('height = "1km"', 'height = "1km"\nedge = "torus"'), ('sonar_range = "100m"', ""),
                    ("sonars = 16", ""), more='\n[neighbours]\nreach = "400m"\n')  # fmt: skip
    sim.bodies.x[:], sim.bodies.y[:] = 500.0, 500.0
    sim.bodies.x[:2], sim.bodies.y[:2] = (10.0, 980.0), (200.0, 200.0)
    x, y = everybody(sim, 400.0)[:, :2]
    assert x[0] > 10.0 + 50.0, "its neighbour is 30 m to the west, across the edge"
    assert x[0] - 10.0 == pytest.approx(980.0 - x[1], abs=1e-6)
    assert (y[0], y[1]) == pytest.approx((200.0, 200.0), abs=1e-6)


def test_robots_in_one_place_and_robots_outside_have_a_centroid(tmp_path: Path) -> None:
    x, y = np.array([5.0, 5.0, -3.0]), np.array([5.0, 5.0, -3.0])
    none = np.array([], np.int64)
    robot, zero = np.array([0, 1]), np.zeros(2)
    found = voronoi.centroids(robot, zero, zero, np.full(3, 2.0), x, y, (10.0, 10.0))
    np.testing.assert_allclose(np.array(found)[:, :2], (x[:2], y[:2]), atol=1e-9)
    assert np.hypot(found[0][2], found[1][2]) < np.hypot(3.0, 3.0), "it is drawn towards the world"
    found = voronoi.centroids(none, zero[:0], zero[:0], np.zeros(3), x, y, (inf, inf))
    np.testing.assert_array_equal(found, (x, y))
