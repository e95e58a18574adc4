"""Findings: what a sweep has found so far, as curves that grow while it goes on.

The sweep adds each outcome as it comes; others may ask at the same time, from any thread. A curve goes over the values
of one varied key, or over time, and each of its marks is the mean of the runs there with its confidence interval, as in
a figure. Over time, at most `MAX_TIMES` moments of each run are stored.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from threading import Lock
from time import monotonic
from typing import NamedTuple

import msgspec
import numpy as np

from sleepcast.experiments.angles import angles_of
from sleepcast.experiments.drawing import Floats, band, numbers
from sleepcast.experiments.plan import Experiment, ParameterRange, PlannedRun, Value
from sleepcast.experiments.results import RunResult, unknown_in

MAX_TIMES = 60
"""Moments of one run that are stored: a curve over time is drawn through so many marks at most."""
MAX_KEPT = 100_000
"""Runs that are stored for curves; more are only counted, so that memory stays bounded."""
MAX_LISTED = 200
"""Runs of one mark that are listed."""
MAX_MARKS = 5_000
"""Marks of all curves together."""
TIME = "time"


class CurveAxes(NamedTuple):
    """What is looked at.

    x: a varied key, or "time".
    y: a measure.
    by: a varied key, for each value of which there is a curve; "" for a single one.
    """

    x: str
    y: str
    by: str = ""


class CurvePoint(msgspec.Struct, frozen=True):
    """Some runs at one place of a curve.

    x: the value there.
    at: where it is on the axis.
    mean, low, high: of the measure, with the ends of its 95 % confidence interval.
    runs: how many.
    """

    x: str
    at: float
    mean: float
    low: float
    high: float
    runs: int


class Curve(msgspec.Struct, frozen=True):
    """A curve.

    name: the value of `by`; "" for a single curve.
    """

    name: str
    marks: list[CurvePoint]


class Curves(msgspec.Struct, frozen=True):
    """What is drawn.

    unit: of the axis.
    ticks: the names of its places 0, 1, 2, ...; empty if it is one of numbers.
    joined: whether a line goes through the marks; not where points were drawn from ranges.
    hidden: curves of which marks are left out, since there are too many.
    """

    curves: list[Curve]
    unit: str = ""
    ticks: list[str] = []
    joined: bool = True
    hidden: int = 0


class ListedRun(msgspec.Struct, frozen=True):
    """One finished run. value: of the measure that is looked at, None if it is unknown."""

    number: int
    seed: int
    settings: dict[str, Value]
    value: float | None
    error: str


class Progress(msgspec.Struct, frozen=True):
    """How far a sweep has come.

    total: runs, at most.
    rest: s until its end; None while nobody can tell.
    errors: the most frequent ones, with their counts.
    kept: runs that the curves are drawn from.
    state: "running", "finished" or "stopped".
    """

    total: int
    done: int
    failed: int
    unknown: int
    rest: float | None
    errors: list[tuple[str, int]]
    kept: int
    state: str


class _FinishedRun(NamedTuple):
    """What a run measured.

    last: its measures at the end; NaN for unknown.
    times: of its samples, s.
    series: what was measured then.
    unknown: values that no robot could give.
    """

    run: PlannedRun
    last: Floats
    times: Floats
    series: Floats
    unknown: int
    error: str


class SweepFindings:
    """See the module. before: outcomes of earlier sweeps into the same folder."""

    def __init__(self, experiment: Experiment, before: Iterable[RunResult] = ()) -> None:
        self.experiment = experiment
        self._lock = Lock()
        self._finished: list[_FinishedRun] = []
        self._numbers: dict[int, int] = {}
        """Where a run is in that list, by its number."""
        self._done = self._failed = self._unknown = 0
        self._errors: Counter[str] = Counter()
        self._state = "running"
        self._bands: dict[tuple[CurveAxes, str, str], tuple[Floats, CurvePoint]] = {}
        self._stride = self._thinned()
        self._angles = angles_of(experiment)
        for outcome in before:
            self.add(outcome)
        self._began, self._at_start = monotonic(), self._done

    def add(self, outcome: RunResult) -> None:
        """One more run has finished, or one that had failed was done again."""
        nothing = (None,) * (1 + len(self.experiment.measures))
        samples = np.array(outcome.samples or (nothing,), np.float64)
        thinned = samples[:: self._stride]
        unknown = unknown_in(self.experiment, outcome)
        finished = _FinishedRun(outcome.run, samples[-1, 1:], thinned[:, 0], thinned[:, 1:], unknown, outcome.error)
        with self._lock:
            index = self._numbers.get(outcome.run.number)
            if index is not None:
                self._count(self._finished[index], -1)
                self._finished[index] = finished
            elif len(self._finished) < MAX_KEPT:
                self._numbers[outcome.run.number] = len(self._finished)
                self._finished.append(finished)
            self._count(finished, 1)

    def finish(self, state: str = "finished") -> None:
        """Nothing more will come."""
        self._state = state

    def progress(self) -> Progress:
        """How far it has come."""
        with self._lock:
            total, done = len(self.experiment), self._done
            new = done - self._at_start
            rest = (monotonic() - self._began) / new * (total - done) if new and self._state == "running" else None
            errors = [each for each in self._errors.most_common(3) if each[1] > 0]
            return Progress(
                total, done, self._failed, self._unknown, rest, errors, len(self._finished), self._state
            )  # fmt: skip

    def views(self) -> dict[str, tuple[str, ...]]:
        """What can be chosen: for "x", "y" and "by"."""
        keys = tuple(self.experiment.over)
        over_time = (TIME,) if self.experiment.every is not None else ()
        split = tuple(key for key in keys if not isinstance(self.experiment.over[key], ParameterRange))
        return {"x": (*keys, *over_time) or ("seed",), "y": tuple(self.experiment.measures), "by": ("", *split)}

    def curves(self, view: CurveAxes) -> Curves:
        """What is known now. Raises KeyError for a view that there is not."""
        self._check(view)
        with self._lock:
            finished = list(self._finished)
        column = list(self.experiment.measures).index(view.y)
        groups: dict[str, dict[str, list[float]]] = {}
        for each in finished:
            line = groups.setdefault(_value_of(each.run, view.by), {})
            if view.x == TIME:
                for at, value in zip(each.times.tolist(), each.series[:, column].tolist(), strict=True):
                    line.setdefault(f"{at:.9g}", []).append(value)
            else:
                line.setdefault(_value_of(each.run, view.x), []).append(float(each.last[column]))
        names = list(dict.fromkeys(x for line in groups.values() for x in line))
        axis = numbers(names)
        ticks = sorted(names) if axis is None else []
        places = {x: float(ticks.index(x)) for x in names} if axis is None else dict(zip(names, axis[0], strict=True))
        unit = "s" if view.x == TIME else "" if axis is None else axis[1]
        curves, left, hidden = [], MAX_MARKS, 0
        for name in in_order(groups):
            marks = [
                self._mark(view, name, x, float(places[x]), values)
                for x, values in sorted(groups[name].items(), key=lambda item: places[item[0]])
            ]
            known = [mark for mark in marks if mark is not None]
            hidden += len(known) > left
            known = known[:left]
            left -= len(known)
            curves.append(Curve(name, known))
        return Curves(curves, unit, ticks, not isinstance(self.experiment.over.get(view.x), ParameterRange), hidden)

    def runs_at(self, view: CurveAxes, x: str, name: str) -> list[ListedRun]:
        """The runs behind a mark; over time, those of its curve. Raises KeyError as `curves`."""
        self._check(view)
        column = list(self.experiment.measures).index(view.y)
        with self._lock:
            finished = list(self._finished)
        behind = [
            each
            for each in finished
            if _value_of(each.run, view.by) == name and (view.x == TIME or _value_of(each.run, view.x) == x)
        ]
        listed = []
        for each in sorted(behind, key=lambda each: each.run.number)[:MAX_LISTED]:
            value = _at(each, x, column) if view.x == TIME else float(each.last[column])
            known = None if np.isnan(value) else value
            listed.append(ListedRun(each.run.number, each.run.seed, each.run.point, known, each.error))
        return listed

    def run(self, number: int) -> PlannedRun | None:
        """The finished run of this number."""
        with self._lock:
            known = self._numbers.get(number)
            return None if known is None else self._finished[known].run

    def _check(self, view: CurveAxes) -> None:
        views = self.views()
        for name, wanted in (("x", view.x), ("y", view.y), ("by", view.by)):
            if wanted not in views[name]:
                raise KeyError(wanted)

    def _mark(self, view: CurveAxes, name: str, x: str, at: float, values: list[float]) -> CurvePoint | None:
        """The mean of the known values, computed again only if there are other ones; None if there is none."""
        all_values = np.array(values)
        known = all_values[~np.isnan(all_values)]
        if not known.size:
            return None
        before = self._bands.get((view, name, x))
        if before is not None and np.array_equal(before[0], known):
            return before[1]
        mean, low, high = band(known, view.y in self._angles)
        if np.isnan(mean):
            return None
        mark = CurvePoint(x, at, mean, low, high, int(known.size))
        self._bands[view, name, x] = known, mark
        return mark

    def _count(self, finished: _FinishedRun, sign: int) -> None:
        self._done += sign
        self._failed += sign * bool(finished.error)
        self._unknown += sign * finished.unknown
        if finished.error:
            self._errors[finished.error] += sign

    def _thinned(self) -> int:
        """Of so many samples one is kept."""
        every = self.experiment.every
        if every is None:
            return 1
        seconds = self.experiment.seconds or self.experiment.scenario_at(self.experiment.first().point).seconds
        return max(1, -(-round(seconds / every) // (MAX_TIMES - 1)))


def in_order(names: Iterable[str]) -> list[str]:
    """Numbers of one unit by size, other texts by the alphabet."""
    different = list(dict.fromkeys(names))
    parsed = numbers(different)
    if parsed is None:
        return sorted(different)
    return [name for _, name in sorted(zip(parsed[0].tolist(), different, strict=True))]


def _value_of(run: PlannedRun, key: str) -> str:
    """The value of a key in a run, as text."""
    if not key:
        return ""
    return str(run.seed if key == "seed" else run.point[key])


def _at(finished: _FinishedRun, x: str, column: int) -> float:
    """What was measured at a time that a mark names, NaN if the run had ended."""
    values = [value for at, value in zip(finished.times, finished.series[:, column], strict=True) if f"{at:.9g}" == x]
    return float(values[0]) if values else float("nan")
