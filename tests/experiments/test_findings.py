"""What a sweep has found so far: the same numbers as a figure's, whatever has come until now."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from sleepcast.experiments.drawing import band
from sleepcast.experiments.findings import MAX_TIMES, CurveAxes, SweepFindings
from sleepcast.experiments.plan import Experiment, experiment_of
from sleepcast.experiments.results import RunResult, unknown_in


def experiment(**changes: object) -> Experiment:
    options = {
        "over": ["robots.count=5,10,20", "robots.limits.speed=0.5m/s,1m/s"],
        "measures": ["a=mean x", "b=mean y"],
        "seeds": 3,
    }
    return experiment_of("crowd", **{**options, **changes})  # type: ignore[arg-type]


def outcomes(wanted: Experiment) -> Iterator[RunResult]:
    """The measure `a` is the number of the run, `b` is known of every other one."""
    for run in wanted.runs():
        yield RunResult(run, ((2.0, float(run.number), None if run.number % 2 else 1.0),))


def test_marks_are_those_of_a_figure() -> None:
    wanted = experiment()
    findings = SweepFindings(wanted, outcomes(wanted))
    found = findings.curves(CurveAxes("robots.count", "a", "robots.limits.speed"))
    assert [curve.name for curve in found.curves] == ["0.5m/s", "1m/s"]
    assert (found.unit, found.ticks, found.joined) == ("", [], True)
    for curve in found.curves:
        assert [(mark.x, mark.at) for mark in curve.marks] == [("5", 5.0), ("10", 10.0), ("20", 20.0)]
        for mark in curve.marks:
            values = [
                float(run.number)
                for run in wanted.runs()
                if (str(run.point["robots.count"]), run.point["robots.limits.speed"]) == (mark.x, curve.name)
            ]
            assert (mark.mean, mark.low, mark.high) == band(np.array(values))
            assert mark.runs == 3
            assert [each.value for each in findings.runs_at(CurveAxes("robots.count", "a"), mark.x, "")] != values


def test_units_and_names_make_the_axis() -> None:
    wanted = experiment(over=["robots.limits.speed=1m/s,0.5m/s", "world.edge=wall,fence"])
    findings = SweepFindings(wanted, outcomes(wanted))
    speeds = findings.curves(CurveAxes("robots.limits.speed", "a"))
    assert speeds.unit == "m/s"
    assert [mark.at for mark in speeds.curves[0].marks] == [0.5, 1.0]
    edges = findings.curves(CurveAxes("world.edge", "a"))
    assert edges.ticks == ["fence", "wall"]
    assert [(mark.x, mark.at) for mark in edges.curves[0].marks] == [("fence", 0.0), ("wall", 1.0)]


def test_curves_grow_and_a_repeated_run_takes_the_place_of_the_failed_one() -> None:
    wanted = experiment(over=["robots.count=5"])
    findings = SweepFindings(wanted)
    view = CurveAxes("robots.count", "a")
    assert findings.curves(view).curves == []
    first, second, third = outcomes(wanted)
    findings.add(first)
    assert findings.curves(view).curves[0].marks[0].runs == 1
    findings.add(RunResult(second.run, error="it broke"))
    progress = findings.progress()
    assert (progress.done, progress.failed, progress.unknown, progress.errors) == (2, 1, 0, [("it broke", 1)])
    assert progress.rest is not None
    listed = findings.runs_at(view, "5", "")
    assert [(each.number, each.value, each.error) for each in listed] == [(0, 0.0, ""), (1, None, "it broke")]
    for again in (second, third):
        findings.add(again)
    progress = findings.progress()
    assert (progress.done, progress.failed, progress.unknown, progress.errors) == (3, 0, 1, [])
    assert findings.curves(view).curves[0].marks[0].runs == 3
    findings.finish()
    assert (findings.progress().state, findings.progress().rest) == ("finished", None)


def test_a_mean_over_time_that_has_not_begun_is_not_unknown_but_one_that_never_begins_is() -> None:
    """The page counts as the command does, whatever it keeps of a run."""
    wanted = experiment(over=[], measures=["a=time_mean 15s mean x", "b=mean x"], seeds=1, every=0.1, seconds=20.0)
    (run,) = wanted.runs()
    late = tuple((round(0.1 * step, 9), None if step < 150 else 1.0, 1.0) for step in range(201))
    for samples, unknown in (
        (late, 0),
        (late[:100], 1),
        ((*late[:150], (15.0, None, 1.0), *late[151:]), 1),
        ((late[0], (0.1, None, None), *late[2:]), 1),
    ):
        outcome = RunResult(run, samples)
        assert unknown_in(wanted, outcome) == unknown
        assert SweepFindings(wanted, [outcome]).progress().unknown == unknown


def test_time_is_drawn_through_a_bounded_number_of_marks() -> None:
    wanted = experiment(over=["robots.count=5"], every=0.1, seconds=100.0)
    samples = tuple((round(0.1 * step, 9), float(step), 1.0) for step in range(1001))
    findings = SweepFindings(wanted, [RunResult(run, samples) for run in wanted.runs()])
    found = findings.curves(CurveAxes("time", "a"))
    (curve,) = found.curves
    assert found.unit == "s"
    assert 30 <= len(curve.marks) <= MAX_TIMES
    assert all(mark.mean == pytest.approx(10 * mark.at) and mark.runs == 3 for mark in curve.marks)
    assert [run.value for run in findings.runs_at(CurveAxes("time", "a"), curve.marks[2].x, "")] == [
        curve.marks[2].mean
    ] * 3


def test_curves_that_are_cut_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = experiment()
    findings = SweepFindings(wanted, outcomes(wanted))
    view = CurveAxes("robots.count", "a", "robots.limits.speed")
    assert findings.curves(view).hidden == 0
    monkeypatch.setattr("sleepcast.experiments.findings.MAX_MARKS", 2)
    found = findings.curves(view)
    assert ([len(curve.marks) for curve in found.curves], found.hidden) == ([2, 0], 2)


def test_a_view_that_there_is_not_is_refused() -> None:
    findings = SweepFindings(experiment())
    for view in (
        CurveAxes("nix", "a"),
        CurveAxes("robots.count", "nix"),
        CurveAxes("robots.count", "a", "nix"),
        CurveAxes("time", "a"),
    ):
        with pytest.raises(KeyError):
            findings.curves(view)
