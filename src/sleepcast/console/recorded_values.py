"""What expressions come to in a recording: on the recorded sensor readings, groups and flags, at any time of it.

A moment of a recording is a table of telemetry, so that expressions mean here what they mean everywhere. What robots
have learned (their own variables, rules, operators) is not in a recording. A plot over time that needs it is made by
running the recording again (`past`), where that leads through what was recorded.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Iterator, Sequence
from math import nan

import numpy as np

from sleepcast.columns.telemetry import Key, KnownSymbols, TelemetryTable, validate_reading
from sleepcast.columns.values import AskedColumns, Rows
from sleepcast.console.features.names import names_in
from sleepcast.console.features.plots import (
    AddPlot,
    GetPlot,
    PlotAdded,
    PlotRemoved,
    Plots,
    PlotSpec,
    Plotted,
    RemovePlot,
    ScenarioMeasure,
)
from sleepcast.console.marks import clock_time
from sleepcast.console.outgoing import ShownName
from sleepcast.console.past import Past
from sleepcast.console.replay_client import RerunError
from sleepcast.console.series import Sample, columns_of
from sleepcast.console.timeline import Timeline, values_of
from sleepcast.console.values import Column, Index, Mask, suggested_of
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.fleet.state import Minds, values_at_first
from sleepcast.language import Checked, CheckError, Variable, check
from sleepcast.language.symbols import Declared, FreshNames, Group
from sleepcast.language.vocabulary import FROZEN, ID, MARKED, SLEEPING, TIME_SLOT, Vocabulary

MAX_TIMES = 256
"""Times at which a plot of a recording is drawn."""
MAX_AGAIN = 64
"""The same for one that is made by running again, which takes much longer."""
AT_ONCE = 0.25
"""Seconds for which the samples of one answer are made; the page asks for more."""
HOLDS = (
    "A recording holds what robots sensed, their groups and flags. What they had learned is found by running it again: "
    "of one robot where time stands still, and of all in a plot over time."
)
FLAGS = {FROZEN: 2, SLEEPING: 4, MARKED: 8}
"""The variables that the flags of a frame stand for, each with its bit."""


class RecordedNames(FreshNames):
    """The names of a robot that has heard of the groups that were recorded, and of nothing else. groups: by key."""

    def __init__(self, vocabulary: Vocabulary, groups: dict[str, Group]) -> None:
        super().__init__(vocabulary)
        self._groups = groups

    def declared(self, key: str) -> Declared | None:
        return self._groups.get(key) or super().declared(key)

    def heard(self) -> Iterable[str]:
        return [*super().heard(), *(group.name for group in self._groups.values())]


def groups_at(timeline: Timeline, time: float) -> Iterator[tuple[str, Mask]]:
    """The groups of a recording at a time of it, s, each with its members: who is in more than two shows the newest."""
    marks = timeline.marks_at(time)
    newest, second = (np.frombuffer(codes, np.uint8) for codes in (marks.groups, marks.second or marks.groups))
    for number, name in enumerate(marks.names, 1):
        yield name, (newest == number) | (second == number)


class RecordedTelemetry(TelemetryTable):
    """What was recorded of the robots as their telemetry, at the time of it that is looked at (`now`, s)."""

    def __init__(self, timeline: Timeline, now: Callable[[], float]) -> None:
        self._timeline, self._now = timeline, now
        self._learned, self._at_first = Minds(timeline.vocabulary)[0], values_at_first(timeline.vocabulary)
        self._names = {
            each.slot: key for key, each in timeline.vocabulary.bindings.items() if isinstance(each, Variable)
        }
        self._columns = AskedColumns(len(timeline.scene.names), self._filled, self._members)
        self._time = nan
        """The time of what is in the columns, s."""
        self._known: object = None
        """How much of the recording that rests on: it may still go on."""
        self._readings: dict[str, list[float | None]] | None = None

    def latest(self) -> AskedColumns:
        """The columns of the time that is looked at now."""
        timeline, time = self._timeline, self._now()
        known = time, timeline.values.before(time), timeline.marks.before(time)
        if self._known != known:
            self._known, self._time, self._readings = known, float(time), None
            self._columns = AskedColumns(len(timeline.scene.names), self._filled, self._members)
        return self._columns

    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        """What robots have learned is not in a recording: here they know what their vocabulary gives them."""
        return [(key(self._learned), rows, None)]

    def _filled(self, slot: int) -> Column | float:
        """A variable as it was recorded; of what the language itself keeps on a robot, all but flags is as at first."""
        if slot in FLAGS:
            flags = np.frombuffer(self._timeline.marks_at(self._time).flags, np.uint8)
            return (flags & FLAGS[slot] > 0).astype(np.float64)
        if slot == TIME_SLOT:
            return self._time
        if slot == ID:
            numbers = self._timeline.numbers
            if not numbers:
                return np.arange(1.0, self._columns.count + 1.0)
            return np.array([numbers.get(name, nan) for name in self._timeline.names_at(self._time)], np.float64)
        values = self._recorded().get(self._names.get(slot, ""), [])
        if len(values) == self._columns.count:
            return np.array(values, np.float64)
        return self._at_first[slot] if slot < len(self._at_first) else nan

    def _recorded(self) -> dict[str, list[float | None]]:
        """The readings of this time, by the keys of their variables; they are taken out only if one is asked for."""
        if self._readings is None:
            data = self._timeline.values.at(self._time)
            self._readings = {} if data is None else {key.casefold(): each for key, each in values_of(data).items()}
        return self._readings

    def _members(self) -> dict[str, Mask]:
        return {name.casefold(): members for name, members in groups_at(self._timeline, self._time)}


class RecordedValues:
    """The values of a recording (`Values`). now: the time of it that is looked at, s."""

    def __init__(self, timeline: Timeline, now: Callable[[], float]) -> None:
        self._timeline, self._now = timeline, now
        self._table = RecordedTelemetry(timeline, now)

    @property
    def names(self) -> Sequence[str]:
        return self._timeline.names_at(self._now())

    @property
    def vocabulary(self) -> Vocabulary:
        """The names of the recorded robots."""
        return self._timeline.vocabulary

    @property
    def learned(self) -> RecordedNames:
        """What they are known to have learned at this time: their groups."""
        return self._known()

    @property
    def source(self) -> str:
        time = self._timeline.values.before(self._now())
        read = self._timeline.values.times[time - 1] if time else None
        return "nothing recorded yet" if read is None else f"recorded at {clock_time(read)}"

    def values(self, text: str) -> tuple[Column, int]:
        """As `of`: a recording is a `FactSource`."""
        return self.of(text)

    def time(self) -> float:
        return self._now()

    def of(self, text: str, robots: Index | None = None) -> tuple[Column, int]:
        checked = self.checked(text)
        program = checked.required()
        if checked.unknown:
            raise MisuseError(f"{CheckError(checked.findings, text, checked.more)}\n{HOLDS}")
        validate_reading(text, program)
        return self._table.values(program, np.arange(len(self.names)) if robots is None else robots)[0], 0

    def checked(self, text: str) -> Checked:
        return check(text, self._known())

    def groups(self) -> Iterable[tuple[str, Mask]]:
        return groups_at(self._timeline, self._now())

    def suggested(self) -> list[str]:
        return suggested_of(self._timeline.vocabulary)

    def known(self) -> list[ShownName]:
        """The names that an expression may use, with the ranges of their values."""
        columns, everybody = self._table.latest(), Rows.run(0, len(self.names))
        variables = names_in(self._timeline.vocabulary, lambda variable: columns.column(variable.slot, everybody))
        return variables + [
            ShownName(name, "group", range=f"{int(members.sum())} robots") for name, members in self.groups()
        ]

    def _known(self) -> RecordedNames:
        names = self._timeline.marks_at(self._timeline.seconds).names  # a group that comes later is empty
        return RecordedNames(self._timeline.vocabulary, {name.casefold(): Group(name) for name in names})


class RecordedPlots(Plots):
    """The plots of a recording. Those over time show all of it: samples are made when they are asked for, from far
    apart to close together.

    now: the time that is looked at, s
    past: by which it is run again, None where it cannot be
    """

    def __init__(
        self,
        timeline: Timeline,
        now: Callable[[], float],
        clock: Clock,
        measures: Sequence[ScenarioMeasure] = (),
        past: Past | None = None,
    ) -> None:
        super().__init__(RecordedValues(timeline, now), clock, measures)
        self._timeline, self._past = timeline, past
        self._rerun: dict[int, AddPlot] = {}
        """The plots for which it is run again, by their numbers."""
        self._at = timeline.began
        self._moving = RecordedValues(timeline, lambda: self._at)
        self._samples: dict[int, dict[float, Sample]] = {}
        """Of each plot, by time."""

    def add(self, asked: AddPlot) -> PlotAdded | Awaitable[PlotAdded]:
        """As everywhere; what was not recorded is plotted over time by running again."""
        self._refuse(asked)
        try:
            self._validate(asked)
        except MisuseError as error:
            if self._past is None or asked.kind != "time":
                raise
            return self._added_again(asked, self._past, error)
        return self._added(asked)

    async def _added_again(self, asked: AddPlot, past: Past, unrecorded: MisuseError) -> PlotAdded:
        try:
            sampled = await past.sample(past.tick_of(self._timeline.seconds), asked)
        except RerunError as error:
            raise MisuseError(f"{unrecorded}\n{error}") from None
        if sampled.problem:
            raise MisuseError(sampled.problem)
        self._refuse(asked)  # others may have been added meanwhile
        added = self._added(asked)
        self._rerun[added.number] = asked
        return added

    def sample(self) -> None:
        """Nothing: what was is known already."""

    def _over_time(self, plot: PlotSpec, asked: GetPlot) -> Awaitable[Plotted]:
        return self._sampled(plot, asked)

    async def _sampled(self, plot: PlotSpec, asked: GetPlot) -> Plotted:
        samples = self._samples.setdefault(plot.number, {})
        until, more = self._clock.now() + AT_ONCE, False
        asked_again = self._rerun.get(plot.number)
        count = MAX_TIMES if asked_again is None else MAX_AGAIN
        for time in times_of(self._timeline.began, self._timeline.seconds, count):
            if time in samples:
                continue
            if self._clock.now() > until:
                more = True
                break
            if asked_again is not None and self._past is not None:
                try:
                    sampled = await self._past.sample(self._past.tick_of(time), asked_again)
                except RerunError as error:
                    plot.problem = str(error)
                    break
                plot.problem = ""
                values = [nan if value is None else value for value in sampled.values]
                samples[time] = values or [nan] * len(plot.lines)
                continue
            self._at = time
            samples[time] = self._sample(plot, self._moving)
            await asyncio.sleep(0.0)
        times = sorted(samples)
        columns = columns_of(times, [samples[time] for time in times], len(plot.lines))
        told = f"{len(times)} moments, {'as recorded' if asked_again is None else 'run again'}"
        return Plotted(asked.serial, columns, told=told, problem=plot.problem, more=more)

    def remove(self, asked: RemovePlot) -> PlotRemoved:
        self._samples.pop(asked.number, None)
        self._rerun.pop(asked.number, None)
        return super().remove(asked)


def times_of(began: float, ended: float, count: int) -> list[float]:
    """So many times (a power of two) from the beginning to the end, far apart first: whatever part of them is known
    covers everything."""
    bits = count.bit_length() - 1
    reversed_bits = (int(f"{number:0{bits}b}"[::-1], 2) for number in range(count))
    return [began + (ended - began) * each / (count - 1) for each in reversed_bits]
