"""The plots of a desk: all pages see the same ones.

A plot over time is a `Series`, which is sampled with the pictures while time runs, even when nobody looks, so that a
page that is opened later shows what has been. A scatter plot and a histogram show the present. What sampling costs is
kept to a small part of the time: after a sample, ten times as long passes until the next.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import field, replace
from math import nan
from typing import Annotated, Literal, Protocol

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from sleepcast.console.feature import answers
from sleepcast.console.incoming import Expression, PageMessage, Place, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.series import OF_TRUE, STATISTICS, Series, lines_of, sample_of
from sleepcast.console.values import Column, Values, in_unit
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.language.evaluate import is_true

MAX_PLOTS = 16
"""Plots of one desk: they are sampled for as long as it runs."""
MAX_POINTS = 2_000
"""Points of a scatter plot; more would be one cloud."""
BINS = 30
REST = 10.0
"""Times as long as the last samples took, until the next are taken."""


class AddPlot(PageMessage, tag="plot"):
    """Draw something as long as the desk runs: see `PlotSpec`."""

    serial: Serial
    kind: Literal["time", "scatter", "histogram"]
    x: Expression
    y: Expression = ""
    where: Expression = ""
    what: Literal["range", "quantiles", "mean", "median", "min", "max", "sum", "std", "count", "share"] = "range"


class RemovePlot(PageMessage, tag="unplot"):
    """Draw the plot with this number no more."""

    serial: Serial
    number: Place


class GetPlot(PageMessage, tag="plotted"):
    """What is to be drawn of a plot now. after: only what is later (s), if the plot has been thinned this often; -1 for
    everything."""

    serial: Serial
    number: Place
    after: Annotated[float, Meta(ge=-1.0, le=1e12)] = -1.0
    thinned: Place = 0


class ShownPlot(msgspec.Struct, frozen=True):
    """A plot.

    lines: names of what is drawn over x
    units: of x and y
    told: what a person should know of it
    problem: why it shows nothing
    """

    number: int
    kind: str
    title: str
    x: str
    y: str
    where: str
    lines: list[str]
    units: tuple[str, str]
    told: str = ""
    problem: str = ""


class AllPlots(DeskMessage, tag="plots"):
    """Every plot that there is."""

    plots: list[ShownPlot]


class PlotAdded(DeskMessage, tag="plot"):
    """A plot was added under this number."""

    serial: int
    number: int


class PlotRemoved(DeskMessage, tag="unplot"):
    """A plot was removed."""

    serial: int


class Plotted(DeskMessage):
    """What is to be drawn.

    columns: of equal length, of x and of every line, null for unknown
    added: whether it follows what was drawn before, or replaces it
    thinned: how often the series was thinned
    told: what a person should know of it
    problem: why it shows nothing
    more: whether there will be more at once
    earlier: columns of the run that this one has left, from the time at which it did; empty if there is none, or where
        `added` is true
    """

    serial: int
    columns: list[list[float | None]]
    added: bool = False
    thinned: int = 0
    told: str = ""
    problem: str = ""
    more: bool = False
    earlier: list[list[float | None]] = msgspec.field(default_factory=list)


@dataclass(frozen=True, slots=True)
class ScenarioMeasure:
    """What a scenario measures. text: as its file says it. read: the value now, NaN for unknown."""

    name: str
    text: str
    read: Callable[[], float]


@dataclass
class PlotSpec:
    """A plot.

    kind: `time`, a statistic (`what`) of the expression `x` over the robots that pass the test `where`; `scatter`, the
        expressions `x` and `y` on each of them; or `histogram` of `x`
    name: of a measure
    read: gives the value of a measure that no expression stands for
    series: its samples
    earlier: what was sampled in the run that this one has left, as `Series.since`
    problem: why it shows nothing
    """

    number: int
    kind: str
    x: str
    y: str = ""
    where: str = ""
    what: str = ""
    name: str = ""
    read: Callable[[], float] | None = None
    series: Series = field(default_factory=lambda: Series(1))
    earlier: list[list[float | None]] = field(default_factory=list)
    problem: str = ""

    @property
    def title(self) -> str:
        """What it shows, in a line."""
        if self.name:
            text = f"{self.what} {self.x}".strip()
            return self.name if text == self.name else f"{self.name}: {text}"
        titles = {
            "time": f"{self.what} of {self.x}",
            "scatter": f"{self.y} over {self.x}",
            "histogram": f"histogram of {self.x}",
        }
        return titles[self.kind] + (f", where {self.where}" if self.where else "")

    @property
    def lines(self) -> list[str]:
        return [self.what or self.name] if self.read else lines_of(self.what) if self.kind == "time" else ["robots"]


class Plots:
    """See the module. measures: of the scenario, plotted from the start."""

    def __init__(self, values: Values, clock: Clock, measures: Sequence[ScenarioMeasure] = ()) -> None:
        self._values, self._clock = values, clock
        self._numbers = 0
        self._rest_until = clock.now()
        self._plots: dict[int, PlotSpec] = {}
        self._measures = {measure.name: measure for measure in measures}
        for measure in measures[:MAX_PLOTS]:
            what, _, x = measure.text.strip().partition(" ")
            if x.strip() and (what in STATISTICS or what in OF_TRUE):
                self._put("time", x.strip(), what=what, name=measure.name)
            else:
                self._put("time", measure.text, name=measure.name, read=measure.read)

    def _put(self, kind: str, x: str, **more: object) -> PlotSpec:
        self._numbers += 1
        plot = PlotSpec(self._numbers, kind, x, **more)  # type: ignore[arg-type]
        plot.series = Series(len(plot.lines))
        self._plots[plot.number] = plot
        return plot

    def go_on(self, before: Plots, time: float) -> None:
        """Show the plots of another desk, whose run this one has left at this time; what came later there is another
        future."""
        self._numbers, self._plots = before._numbers, {}
        for number, old in before._plots.items():
            read = None if old.read is None else self._measures[old.name].read
            earlier = old.series.since(time) if old.kind == "time" else []
            self._plots[number] = replace(old, read=read, series=old.series.until(time), earlier=earlier)

    def add(self, asked: AddPlot) -> PlotAdded | Awaitable[PlotAdded]:
        """Add a plot. Raises MisuseError if there are too many, and what is wrong with its texts."""
        self._refuse(asked)
        self._validate(asked)
        return self._added(asked)

    def _refuse(self, asked: AddPlot) -> None:
        """Raise MisuseError for a plot that there cannot be, whatever its texts say."""
        if len(self._plots) >= MAX_PLOTS:
            raise MisuseError(f"There are {len(self._plots)} plots, and at most {MAX_PLOTS} fit: remove one first.")
        if not asked.x.strip() or (asked.kind == "scatter" and not asked.y.strip()):
            raise MisuseError("A plot needs an expression, such as fuel; a scatter plot needs two.")

    def _validate(self, asked: AddPlot) -> None:
        """Raise MisuseError where something is wrong in a text."""
        texts = {"the expression": asked.x, "the second expression": asked.y, "the test": asked.where}
        for name, text in texts.items():
            if text.strip():
                try:
                    self._values.of(text.strip(), np.arange(0))
                except SleepcastError as error:
                    raise MisuseError(f"{name[0].upper()}{name[1:]} is not right. {error}") from None

    def _added(self, asked: AddPlot) -> PlotAdded:
        what = asked.what if asked.kind == "time" else ""
        y = asked.y.strip() if asked.kind == "scatter" else ""
        plot = self._put(asked.kind, asked.x.strip(), y=y, where=asked.where.strip(), what=what)
        self._rest_until = self._clock.now()
        self.sample()
        return PlotAdded(asked.serial, plot.number)

    def remove(self, asked: RemovePlot) -> PlotRemoved:
        """Remove a plot; one that is gone already stays gone."""
        self._plots.pop(asked.number, None)
        return PlotRemoved(asked.serial)

    def shown(self) -> AllPlots:
        """Every plot."""
        return AllPlots([self._shown(plot) for plot in self._plots.values()])

    def _shown(self, plot: PlotSpec) -> ShownPlot:
        x = self._unit(plot.x, plot)
        units = ("s", x) if plot.kind == "time" else (x, self._unit(plot.y, plot))
        return ShownPlot(plot.number, plot.kind, plot.title, plot.x, plot.y, plot.where, plot.lines, units)

    def _unit(self, text: str, plot: PlotSpec) -> str:
        if not text or plot.read is not None or plot.what in OF_TRUE:
            return ""
        try:
            return self._values.checked(text).unit
        except SleepcastError:
            return ""

    # ---- over time

    def sample(self) -> None:
        """Take the samples that are due; called between two ticks."""
        now = self._clock.now()
        if now < self._rest_until:
            return
        time = self._values.time()
        for plot in self._plots.values():
            if plot.kind == "time" and plot.series.due(time):
                plot.series.take(time, self._sample(plot, self._values))
        took = self._clock.now() - now
        self._rest_until = now + took + REST * took

    def _sample(self, plot: PlotSpec, values: Values) -> list[float]:
        """What a plot over time shows of these values; unknown, and the problem, while something is wrong with it."""
        try:
            plot.problem = ""
            if plot.read is not None:
                return [plot.read()]
            return sample_of(values, plot.what, plot.x, plot.where, self._unit(plot.x, plot))
        except SleepcastError as error:  # robots have not yet learned what it names, say
            plot.problem = str(error)
            return [nan] * len(plot.lines)

    # ---- what is drawn

    def drawn(self, asked: GetPlot) -> Plotted | Awaitable[Plotted]:
        """What is to be drawn of a plot now. Raises MisuseError for one that is not there."""
        plot = self._plots.get(asked.number)
        if plot is None:
            raise MisuseError(f"There is no plot number {asked.number}.")
        if plot.kind == "time":
            return self._over_time(plot, asked)
        try:
            columns, robots = self._scatter(plot) if plot.kind == "scatter" else self._histogram(plot)
        except SleepcastError as error:
            return Plotted(asked.serial, [], problem=str(error))
        told = ", ".join(filter(None, (robots, self._values.source)))
        return Plotted(asked.serial, columns, told=told)

    def _over_time(self, plot: PlotSpec, asked: GetPlot) -> Plotted | Awaitable[Plotted]:
        series = plot.series
        added = asked.after >= 0.0 and asked.thinned == series.thinned
        columns = series.after(asked.after if added else -1.0)
        earlier = [] if added else plot.earlier
        return Plotted(asked.serial, columns, added, series.thinned, series.told(), plot.problem, earlier=earlier)

    def _scatter(self, plot: PlotSpec) -> tuple[list[list[float | None]], str]:
        x, y = self._known(plot, plot.x, plot.y)
        count = len(x)
        step = -(-count // MAX_POINTS) or 1
        told = f"{len(x[::step]):,} of {count:,} robots" if step > 1 else f"{count:,} robots"
        return [_plain(x[::step]), _plain(y[::step])], told

    def _histogram(self, plot: PlotSpec) -> tuple[list[list[float | None]], str]:
        (x,) = self._known(plot, plot.x)
        if not len(x):
            return [[], []], "0 robots"
        counts, edges = np.histogram(x, BINS)
        return [_plain((edges[1:] + edges[:-1]) / 2.0), _plain(counts)], f"{len(x):,} robots"

    def _known(self, plot: PlotSpec, *texts: str) -> list[Column]:
        """The values of expressions on the robots that pass the test and where all are known, in their units."""
        columns = [in_unit(self._values.of(text)[0], self._unit(text, plot)) for text in texts]
        known = np.isfinite(np.array(columns)).all(axis=0)
        if plot.where:
            known &= is_true(self._values.of(plot.where)[0])
        return [column[known] for column in columns]


def _plain(column: NDArray[np.float64] | NDArray[np.intp]) -> list[float | None]:
    return [float(each) for each in column.tolist()]


class PlotSource(Protocol):
    """A desk with plots."""

    @property
    def plots(self) -> Plots: ...


@answers()
def add_plot(source: PlotSource, asked: AddPlot) -> PlotAdded | Awaitable[PlotAdded]:
    """Draw something from now on."""
    return source.plots.add(asked)


@answers()
def remove_plot(source: PlotSource, asked: RemovePlot) -> PlotRemoved:
    """Draw it no more."""
    return source.plots.remove(asked)


@answers()
def draw_plot(source: PlotSource, asked: GetPlot) -> Plotted | Awaitable[Plotted]:
    """What is to be drawn of a plot now."""
    return source.plots.drawn(asked)
