"""Series: an expression over the fleet as time passes, sampled by the desk whether anybody looks or not.

A series is bounded: when it is full, every second sample is dropped, and from then on samples are taken half as often.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isnan, nan

import numpy as np

from sleepcast.console.values import Column, Values, in_unit
from sleepcast.core.angles import around_mean, deviation, mean_direction, quantile
from sleepcast.language.evaluate import is_true

MAX_SAMPLES = 1_000
"""Of one series: as many as a plot has pixels."""
LEAST_EVERY = 0.1
"""Simulated seconds between two samples at first: the tick of most scenarios."""
QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9)

Sample = list[float]
Statistic = Callable[[Column], Sample]

_PLAIN: dict[str, tuple[tuple[str, ...], Statistic]] = {
    "range": (("mean", "min", "max"), lambda known: [known.mean(), known.min(), known.max()]),
    "quantiles": (
        ("median", "10 %", "25 %", "75 %", "90 %"),
        lambda known: [(each := np.quantile(known, QUANTILES))[2], *each[[0, 1, 3, 4]]],
    ),
    "mean": (("mean",), lambda known: [known.mean()]),
    "median": (("median",), lambda known: [float(np.median(known))]),
    "min": (("min",), lambda known: [known.min()]),
    "max": (("max",), lambda known: [known.max()]),
    "sum": (("sum",), lambda known: [known.sum()]),
    "std": (("standard deviation",), lambda known: [known.std()]),
}
_OF_ANGLES: dict[str, Statistic] = {
    "range": lambda known: [mean_direction(known), (near := around_mean(known)).min(), near.max()],
    "quantiles": lambda known: _PLAIN["quantiles"][1](around_mean(known)),
    "mean": lambda known: [mean_direction(known)],
    "median": lambda known: [quantile(known, 0.5)],
    "min": lambda known: [quantile(known, 0.0)],
    "max": lambda known: [quantile(known, 1.0)],
    "sum": lambda known: [known.sum()],
    "std": lambda known: [deviation(known)],
}
STATISTICS = {what: (names, plain, _OF_ANGLES[what]) for what, (names, plain) in _PLAIN.items()}
"""What is made of the values that are known: names of the lines, and their values, of plain numbers and of angles. The
first is the main one; the others lie around it, from the lowest to the highest."""
OF_TRUE = ("count", "share")
"""What is made of for how many robots it is true; unknown is not."""


class Series:
    """Samples of some lines over time. lines: how many."""

    def __init__(self, lines: int) -> None:
        self.every = LEAST_EVERY
        self.thinned = 0
        """How often it was thinned or cut."""
        self._lines = lines
        self._times: list[float] = []
        self._samples: list[Sample] = []

    def due(self, time: float) -> bool:
        """Whether a sample is wanted at this time. Where time has gone back, what came later is forgotten."""
        if self._times and time < self._times[-1]:
            kept = int(np.searchsorted(self._times, time))
            del self._times[kept:], self._samples[kept:]
            self.thinned += 1
        return not self._times or time >= self._times[-1] + self.every

    def take(self, time: float, sample: Sample) -> None:
        """Add a sample."""
        if len(self._times) == MAX_SAMPLES:
            self._times, self._samples = self._times[::2], self._samples[::2]
            self.every = max(2.0 * self.every, self._times[-1] / (MAX_SAMPLES // 2))
            self.thinned += 1
        self._times.append(time)
        self._samples.append(sample)

    def until(self, time: float) -> Series:
        """What there is up to a time, to go on from there."""
        earlier = Series(self._lines)
        earlier.every, earlier.thinned = self.every, self.thinned + 1
        end = int(np.searchsorted(self._times, time, "right"))
        earlier._times, earlier._samples = self._times[:end], self._samples[:end]
        return earlier

    def since(self, time: float) -> list[list[float | None]]:
        """As `after`, but from the last sample up to this time on."""
        start = int(np.searchsorted(self._times, time, "right"))
        return columns_of(self._times, self._samples, self._lines, max(0, start - 1))

    def told(self) -> str:
        """How close together the samples are, in words."""
        count = len(self._times)
        if count < 2:
            return f"{count} samples"
        return f"{count} samples, one every {(self._times[-1] - self._times[0]) / (count - 1):.2g} s"

    def after(self, time: float) -> list[list[float | None]]:
        """The times later than this one, then the values of every line; None for unknown."""
        return columns_of(self._times, self._samples, self._lines, int(np.searchsorted(self._times, time, "right")))


def columns_of(
    times: Sequence[float], samples: Sequence[Sample], lines: int, start: int = 0
) -> list[list[float | None]]:
    """Times and samples as columns."""
    return [list(times[start:]), *(plain([sample[line] for sample in samples[start:]]) for line in range(lines))]


def plain(values: Sequence[float]) -> list[float | None]:
    """Numbers for the page, which has none for unknown."""
    return [None if isnan(value) else value for value in values]


def lines_of(what: str) -> list[str]:
    """The names of the lines of a statistic."""
    return list(STATISTICS[what][0]) if what in STATISTICS else [what]


def sample_of(values: Values, what: str, x: str, where: str, unit: str) -> Sample:
    """A statistic of an expression over the robots that pass a test, in this unit. Raises SleepcastError."""
    column, _ = values.of(x)
    if where:
        column = column[is_true(values.of(where)[0])]
    if what in OF_TRUE:
        true = is_true(column)
        return [float(true.sum()) if what == "count" else float(true.mean()) if true.size else nan]
    names, of_numbers, of_angles = STATISTICS[what]
    statistic = of_angles if values.checked(x).is_angle else of_numbers
    known = column[np.isfinite(column)]
    if not known.size:
        return [nan] * len(names)
    return [float(each) for each in in_unit(np.array(statistic(known), np.float64), unit)]
