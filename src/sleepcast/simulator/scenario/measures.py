"""Measures: time series of a run that the scenario asks for.

    [measures.distance_to_light]
    of = "distance"
    to = "light"
    every = "10s"

A series is a list of [seconds, metres] from the start on. Its length is bounded: when it is full, every second
sample is dropped, and the sampling period doubles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import dataclass
from sleepcast.core.serial import SerialError
from sleepcast.core.settings import Table, checked_name
from sleepcast.core.ticks import Every, nearest_ticks
from sleepcast.core.units import TIME

MAX_MEASURES = 16
MAX_SAMPLES = 10_000
"""Samples of one series: finer than any plot of it."""
RESERVED = ("awake", "groups", "stopped", "said", "radio")
"""Values recorded for every run; measures need other names."""
KINDS = ("distance", "gyration")

Point = tuple[float, float]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MeasureSpec:
    """One series. of: one of `KINDS`: the distance of the robots' centroid from the point `to` (m), or their radius of
    gyration, the root mean square of their distances from that centroid (m). every: sampling period, s."""

    name: str
    of: str
    to: Point | None
    every: float


def read_measures(root: Table, points: Mapping[str, Point], longest: float) -> tuple[MeasureSpec, ...]:
    """The tables `[measures.NAME]`. points: named points for distances; longest: largest sampling period, s."""
    specs = []
    for name, table in root.tables("measures", most=MAX_MEASURES).items():
        around = root.table("measures")
        if checked_name(around, name) in RESERVED:
            raise around.error(name, f"{name} is measured of every run already; choose another name")
        with table:
            kind = table.text("of", choices=KINDS)
            if kind == "distance" and not points:
                raise table.error("to", "there is no place and no light to which a distance could lead")
            to = points[table.text("to", choices=tuple(points))] if kind == "distance" else None
            every = table.number("every", TIME, 1.0, low=0.001, high=longest)
            specs.append(MeasureSpec(name, kind, to, every))
    return tuple(specs)


class Measuring:
    """The series of one run. tick: simulated seconds per tick; x, y: positions of the robots, m, shape (robots,);
    there: which of them are there, None if all are."""

    def __init__(
        self,
        specs: Sequence[MeasureSpec],
        tick: float,
        x: Floats,
        y: Floats,
        there: NDArray[np.bool_] | None = None,
    ) -> None:
        self._specs, self._x, self._y, self._there = specs, x, y, there
        self._tick = tick
        self._due = [self._every(spec, 1) for spec in specs]
        self._thinned = [1] * len(specs)
        """How many times as long as its period the time between two samples of each has become."""
        self._series: list[list[list[float]]] = [[] for _ in specs]
        self.observe(0, 0.0)

    def observe(self, tick: int, time: float) -> None:
        """Take the samples that are due at the tick of this number; time: simulated time of the run, s."""
        for index, spec in enumerate(self._specs):
            if self._due[index].due(tick):
                series = self._series[index]
                if self._there is None or self._there.any():  # nobody is nowhere
                    series.append([round(time, 6), self._measure(spec)])
                if len(series) >= MAX_SAMPLES:
                    del series[1::2]
                    self._thin(index, 2 * self._thinned[index])

    def following(self, tick: int) -> int | None:
        """The next tick after this one at which a sample is due, None without any series."""
        return min((due.following(tick) for due in self._due), default=None)

    def series(self) -> dict[str, list[list[float]]]:
        """The samples so far, for each measure a list of [seconds, metres]."""
        return {spec.name: list(series) for spec, series in zip(self._specs, self._series, strict=True)}

    def state(self) -> list[tuple[int, list[list[float]]]]:
        """For each series the sampling period in ticks, the nearest number of them, and the samples."""
        periods = [self._ticks(spec) * thinned for spec, thinned in zip(self._specs, self._thinned, strict=True)]
        return [(ticks, list(series)) for ticks, series in zip(periods, self._series, strict=True)]

    def restore(self, state: list[tuple[int, list[list[float]]]]) -> None:
        """Restore a `state`. Raises SerialError."""
        if len(state) != len(self._specs):
            raise SerialError(f"{len(state)} measures, wanted {len(self._specs)}")
        for spec, (ticks, series) in zip(self._specs, state, strict=True):
            whole = ticks > 0 and ticks % self._ticks(spec) == 0
            if not whole or len(series) >= MAX_SAMPLES or not all(len(sample) == 2 for sample in series):
                raise SerialError(f"a measure with {len(series)} samples, {ticks} ticks apart")
        for index, (ticks, _) in enumerate(state):
            self._thin(index, ticks // self._ticks(self._specs[index]))
        self._series = [list(series) for _, series in state]

    def _thin(self, index: int, thinned: int) -> None:
        self._thinned[index], self._due[index] = thinned, self._every(self._specs[index], thinned)

    def _every(self, spec: MeasureSpec, thinned: int) -> Every:
        return Every(max(spec.every, self._tick) * thinned, self._tick)

    def _ticks(self, spec: MeasureSpec) -> int:
        return max(1, nearest_ticks(spec.every, self._tick))

    def _measure(self, spec: MeasureSpec) -> float:
        every_x, every_y = (self._x, self._y) if self._there is None else (self._x[self._there], self._y[self._there])
        x, y = float(every_x.mean()), float(every_y.mean())
        if spec.to is not None:
            return float(np.hypot(spec.to[0] - x, spec.to[1] - y))
        return float(np.sqrt(((every_x - x) ** 2 + (every_y - y) ** 2).mean()))
