"""The plots of a desk: sampled while time runs, whether anybody looks or not, and drawn when they are asked for."""

from __future__ import annotations

from itertools import count
from math import nan

import numpy as np
import pytest

from console.test_backend import Stand, stand
from sleepcast.console.features.plots import (
    MAX_PLOTS,
    MAX_POINTS,
    REST,
    AddPlot,
    GetPlot,
    Plots,
    Plotted,
    RemovePlot,
    ScenarioMeasure,
)
from sleepcast.core.errors import MisuseError, SleepcastError

__all__ = ["stand"]

serials = count(1)


def added(stand: Stand, kind: str = "time", x: str = "battery", **how: str) -> int:
    return stand.desk.plots.add(AddPlot(next(serials), kind, x, **how)).number  # type: ignore[arg-type]


def drawn(plots: Plots, number: int, **since: float) -> Plotted:
    found = plots.drawn(GetPlot(next(serials), number, **since))  # type: ignore[arg-type]
    assert isinstance(found, Plotted)
    return found


def run(stand: Stand, seconds: float) -> None:
    for _ in range(round(seconds)):
        stand.run(1.0)
        stand.clock.advance(0.1)


def test_a_plot_over_time_is_sampled_with_every_picture(stand: Stand) -> None:
    number = added(stand)
    run(stand, 5.0)
    times, mean, low, high = drawn(stand.desk.plots, number).columns
    assert times == pytest.approx([2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    levels = [100 * stand.level(name) for name in stand.swarm.minds]
    assert (mean[-1], low[-1], high[-1]) == pytest.approx((np.mean(levels), min(levels), max(levels)), rel=1e-3)
    (shown,) = stand.desk.plots.shown().plots
    assert (shown.title, shown.units, shown.lines) == ("range of battery", ("s", "%"), ["mean", "min", "max"])


def test_only_what_is_new_is_sent(stand: Stand) -> None:
    number = added(stand)
    run(stand, 3.0)
    before = drawn(stand.desk.plots, number)
    assert not before.added
    run(stand, 2.0)
    after = drawn(stand.desk.plots, number, after=before.columns[0][-1], thinned=before.thinned)
    assert after.added
    assert len(after.columns[0]) == 2
    assert not drawn(stand.desk.plots, number, after=5.0, thinned=99).added


def test_scatter_and_histogram_show_the_present(stand: Stand) -> None:
    scatter = added(stand, "scatter", "x", y="y", where="(> battery 60%)")
    histogram = added(stand, "histogram", "battery")
    x, y = drawn(stand.desk.plots, scatter).columns
    full = [robot for robot, name in enumerate(stand.swarm.minds) if stand.level(name) > 0.6]
    places = stand.swarm.simulator.x[full] / 1000, stand.swarm.simulator.y[full] / 1000  # as people read them: km
    assert (x, y) == (pytest.approx(places[0]), pytest.approx(places[1]))
    middles, counts = drawn(stand.desk.plots, histogram).columns
    assert sum(each or 0.0 for each in counts) == 20
    assert len(middles) == len(counts) == 30
    assert [plot.title for plot in stand.desk.plots.shown().plots] == [
        "y over x, where (> battery 60%)",
        "histogram of battery",
    ]
    assert MAX_POINTS > 20


def test_what_is_wrong_is_refused_with_its_place(stand: Stand) -> None:
    with pytest.raises(MisuseError, match=r"The test is not right.*did you mean battery\?") as refused:
        added(stand, where="(> batery 1)")
    assert "^^^^^^" in str(refused.value)
    with pytest.raises(MisuseError, match="scatter plot needs two"):
        added(stand, "scatter", "x")
    with pytest.raises(MisuseError, match="no plot number 7"):
        drawn(stand.desk.plots, 7)
    for _ in range(MAX_PLOTS):
        added(stand)
    with pytest.raises(MisuseError, match="remove one first"):
        added(stand)


def test_a_plot_is_removed(stand: Stand) -> None:
    number = added(stand)
    stand.desk.plots.remove(RemovePlot(next(serials), number))
    assert stand.desk.plots.shown().plots == []
    stand.desk.plots.remove(RemovePlot(next(serials), number))


def test_measures_of_the_scenario_are_there_from_the_start(stand: Stand) -> None:
    def broken() -> float:
        raise SleepcastError("nobody knows")

    measures = [
        ScenarioMeasure("full", "share (> battery 60%)", lambda: nan),
        ScenarioMeasure("spread", "gyration", lambda: 7.0),
        ScenarioMeasure("odd", "odd", broken),
    ]
    plots = Plots(stand.desk.values, stand.clock, measures)
    plots.sample()
    full, spread, odd = (drawn(plots, number) for number in (1, 2, 3))
    expected = np.mean([stand.level(name) > 0.6 for name in stand.swarm.minds])
    assert full.columns[1] == pytest.approx([expected])
    assert spread.columns[1] == [7.0]
    assert (odd.columns[1], odd.problem) == ([None], "nobody knows")
    assert [plot.title for plot in plots.shown().plots] == ["full: share (> battery 60%)", "spread: gyration", "odd"]


def test_plots_go_on_in_another_future_beside_what_was_seen_of_the_earlier_one(stand: Stand) -> None:
    def plots_of(read: float) -> Plots:
        return Plots(stand.desk.values, stand.clock, [ScenarioMeasure("spread", "gyration", lambda: read)])

    before = plots_of(7.0)
    number = before.add(AddPlot(next(serials), "time", "battery", what="mean")).number
    cloud = before.add(AddPlot(next(serials), "scatter", "x", "y")).number
    for _ in range(4):
        run(stand, 1.0)
        before.sample()
    after = plots_of(8.0)
    after.go_on(before, 4.0)
    assert [plot.number for plot in after.shown().plots] == [1, number, cloud]
    first = drawn(after, 1)
    assert (first.columns, first.earlier) == ([[2.0, 3.0, 4.0], [7.0] * 3], [[4.0, 5.0, 6.0], [7.0] * 3])
    run(stand, 1.0)
    after.sample()
    more = drawn(after, 1, after=4.0, thinned=first.thinned)
    assert (more.added, more.columns[1], more.earlier) == (True, [8.0], [])
    assert drawn(before, 1).columns[0] == [2.0, 3.0, 4.0, 5.0, 6.0], "the earlier future has kept its own"
    assert drawn(after, cloud).earlier == []
    assert drawn(after, number).earlier[0] == [4.0, 5.0, 6.0]
    assert after.add(AddPlot(next(serials), "time", "x", what="mean")).number > cloud


def test_sampling_takes_a_small_part_of_the_time(stand: Stand) -> None:
    taken = []

    def slow() -> float:
        taken.append(stand.swarm.now())
        stand.clock.advance(0.5)
        return 1.0

    plots = Plots(stand.desk.values, stand.clock, [ScenarioMeasure("slow", "slow", slow)])
    for _ in range(100):
        stand.swarm.run(1.0)
        plots.sample()
        stand.clock.advance(0.1)
    assert len(taken) == pytest.approx(10.0 / (REST * 0.5), abs=1)
