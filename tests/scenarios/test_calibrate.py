"""Calibration: what sonars read against a ruler, standing and turning, and what the page of the scenario says of it.

The ruler looks for the nearest point of a wall in the cone of each sonar, from points that lie close together, so it
shares nothing with the simulator but the pose.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from math import pi, radians

import numpy as np
import pytest

from scenarios.stopping import INCH, RADIUS, Floats, ruler
from sleepcast.api.assembly import assemble
from sleepcast.simulator import Simulator, find_scenario

SCENARIO = find_scenario("calibrate")
NOISE = 0.01
BEAM = radians(25)
SONARS = 16
SETTLED, TICKS = 20, 360
"""Ticks before the measurement and of it: a whole turn at 10 deg/s."""
READINGS = 50
"""Different ones of each sonar in that time, at least, with a pause of 24 ms."""
FINE = 0.005
"""m between two points of the ruler."""


def true_ranges(walls: Floats, x: float, y: float, heading: float) -> Floats:
    """What each sonar should read, m, shape (16,)."""
    axes = heading + np.arange(SONARS) * (2 * pi / SONARS)
    faces = (x, y) + RADIUS * np.column_stack((np.cos(axes), np.sin(axes)))
    found = []
    for face, axis in zip(faces, axes, strict=True):
        apart = walls - face
        across = np.abs(apart @ (-np.sin(axis), np.cos(axis)))
        ahead = apart @ (np.cos(axis), np.sin(axis))
        found.append(np.hypot(*apart[across <= np.tan(BEAM / 2) * ahead].T).min())
    return np.array(found)


@cache
def measured(turning: float, pause: float | None) -> tuple[Floats, Floats]:
    """What the sonars should read and by how much they are wrong, while the robot turns at this rate (deg/s), m, each
    of shape (ticks, 16). pause: s; None if all of them fire in every tick."""
    ring = SCENARIO.robots.ring
    assert ring
    scenario = replace(SCENARIO, robots=replace(SCENARIO.robots, ring=replace(ring, pause=pause)))
    simulator, walls = Simulator(scenario), ruler(SCENARIO.shapes, FINE)
    bodies, read = simulator.bodies, []
    true: list[Floats] = []
    simulator.robots[0].drive(0.0, radians(turning))
    for tick in range(SETTLED + TICKS):
        simulator.step()
        if tick >= SETTLED:
            read.append(bodies.sonar_ranges()[0].copy())
            moved = bool(turning) or not true
            true.append(true_ranges(walls, bodies.x[0], bodies.y[0], bodies.heading[0]) if moved else true[-1])
    return np.array(true), np.array(read) - true


def spread(turning: float, pause: float | None) -> float:
    """Standard deviation of the errors of all sonars, inches."""
    return float(measured(turning, pause)[1].std()) / INCH


@pytest.mark.parametrize("pause", [None, 0.024])
def test_standing_sonars_are_right_on_average_and_spread_as_they_were_told_to(pause: float | None) -> None:
    true, wrong = measured(0.0, pause)
    share = wrong.std(axis=0) / true[0]
    assert np.abs(wrong.mean(axis=0) / true[0]).max() < 4 * NOISE / np.sqrt(READINGS)
    assert share.mean() == pytest.approx(NOISE, rel=0.1)
    assert (np.abs(share / NOISE - 1) < 4 / np.sqrt(2 * READINGS)).all()


def test_turning_makes_readings_old_but_not_biased() -> None:
    """A sonar that fired some tenths of a second ago has looked elsewhere."""
    standing, slow, fast = (spread(turning, 0.024) for turning in (0.0, 10.0, 34.0))
    assert 2 * standing < slow < fast / 2
    assert spread(34.0, 0.004) < 0.6 * fast
    assert spread(34.0, None) < 1.2 * standing
    assert abs(measured(34.0, 0.024)[1].mean()) < 0.3 * INCH


def test_the_page_says_what_was_measured() -> None:
    page = (SCENARIO.path.parent / "README.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| (\d+) deg/s \| ([\d.]+) in \| ([\d.]+) in \| ([\d.]+) in \| ([\d.]+) in \|$", page, re.MULTILINE
    )
    assert len(rows) == 3
    for turning, *said in rows:
        found = [spread(float(turning), pause) for pause in (None, 0.004, 0.024, 0.06)]
        assert [float(each) for each in said] == pytest.approx(found, rel=0.1), turning


def test_the_robot_finds_the_nearest_wall_itself_standing_and_turning() -> None:
    swarm, desk = assemble(SCENARIO, None, mission=True)
    swarm.run(SCENARIO.seconds)
    for report in desk.reports:
        values = report.body["values"]
        assert isinstance(values, list)
        count, mean, deviation = values
        assert count > 500
        assert mean == pytest.approx(60 * INCH, abs=0.5 * INCH)
        assert 0.003 < deviation / mean < 0.02
    assert len(desk.reports) == 2
