"""A scenario's own measures: what they are, when they are taken, and that they never grow without end."""

from __future__ import annotations

from itertools import pairwise
from math import hypot, isclose, sqrt
from pathlib import Path

import numpy as np
import pytest

from sleepcast.loop import Swarm
from sleepcast.simulator import SettingsError
from sleepcast.simulator.scenario import measures
from sleepcast.simulator.scenario.measures import RESERVED, MeasureSpec, Measuring
from small_worlds import simulator

BOTH = """
[measures.away]
of = "distance"
to = "house"
every = "0.5s"

[measures.size]
of = "gyration"
every = "2s"
"""


def test_series_are_taken_from_the_start_at_their_times(tmp_path: Path) -> None:
    swarm = Swarm(simulator(tmp_path, ('motion = "still"', 'motion = "wander"'), more=BOTH))
    sim = swarm.simulator

    def centre() -> tuple[float, float]:
        return float(sim.x.mean()), float(sim.y.mean())

    away = [hypot(centre()[0] - 500.0, centre()[1] - 400.0)]
    swarm.run(4)
    x, y = centre()
    away.append(hypot(x - 500.0, y - 400.0))
    size = sqrt(sum((sim.x - x) ** 2 + (sim.y - y) ** 2) / 20)
    found = sim.measured()
    assert [time for time, _ in found["away"]] == [0.5 * k for k in range(9)]
    assert [time for time, _ in found["size"]] == [0.0, 2.0, 4.0]
    assert isclose(found["away"][0][1], away[0])
    assert isclose(found["away"][-1][1], away[1])
    assert isclose(found["size"][-1][1], size)
    assert set(swarm.measures()) == {*RESERVED, "away", "size"}


def test_a_scenario_without_them_measures_what_every_run_does(tmp_path: Path) -> None:
    assert set(Swarm(simulator(tmp_path)).measures()) == set(RESERVED)


def test_a_distance_leads_to_something(tmp_path: Path) -> None:
    house = ('[places.house]\nx = "500m"\ny = "400m"\n', "")
    with pytest.raises(SettingsError, match=r"measures.away.to: there is no place and no light"):
        simulator(tmp_path, house, more=BOTH)


def test_samples_fall_on_the_first_tick_at_each_multiple() -> None:
    specs = [MeasureSpec("away", "distance", (3.0, 4.0), 0.25)]
    measuring = Measuring(specs, 0.1, np.zeros(3), np.zeros(3))
    for tick in range(1, 11):
        measuring.observe(tick, tick * 0.1)
    again = Measuring(specs, 0.1, np.zeros(3), np.zeros(3))
    again.restore(measuring.state())
    for each in (measuring, again):
        each.observe(13, 1.3)
        each.observe(14, 1.4)
        assert [time for time, _ in each.series()["away"]] == [0.0, 0.3, 0.5, 0.8, 1.0, 1.3]


def test_a_long_series_gets_coarser_and_stays_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measures, "MAX_SAMPLES", 16)
    x, y = np.zeros(3), np.zeros(3)
    measuring = Measuring([MeasureSpec("away", "distance", (3.0, 4.0), 1.0)], 1.0, x, y)
    for tick in range(1, 1001):
        measuring.observe(tick, float(tick))
    times = [time for time, _ in measuring.series()["away"]]
    steps = {int(b - a) for a, b in pairwise(times)}
    assert len(times) < 16
    assert times[0] == 0.0
    assert steps == {128}
    assert measuring.series()["away"][0][1] == 5.0
