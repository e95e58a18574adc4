"""Tables of a recorded run, a row an observation: which there are, with the unit of every column, and their rows.

All values are SI; what is unknown is empty (CSV) or null (Parquet). Names of columns are those of all other tables of
sleepcast: `time`, `robot`, and sensors by their names.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum
from math import inf
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.columns import column_name
from sleepcast.core.units import si_unit
from sleepcast.exporting.run import (
    CommandEvent,
    Event,
    FailingEvent,
    LogLineEvent,
    MarksEvent,
    OutcomeEvent,
    PosesEvent,
    ReadingsEvent,
    RecordedRun,
    RobotsEvent,
    RulesEvent,
    SolidsEvent,
)
from sleepcast.simulator.world.world import rows_of

Values: TypeAlias = Sequence[str] | Sequence[int] | Sequence[float] | Sequence[bool] | NDArray[np.generic]
FLAGS = {"stopped": 1, "frozen": 2, "sleeping": 4, "marked": 8, "out_of_energy": 32, "crashed": 64}
"""Columns of `marks`, and the bit of each."""


class CellType(StrEnum):
    """What a column holds, as table schemas call it."""

    TEXT = "string"
    WHOLE = "integer"
    SINGLE = "single"
    """A number in single precision."""
    NUMBER = "number"
    TRUTH = "boolean"


class ExportColumn(NamedTuple):
    """A column. unit: in SI, "1" for a plain number, "" for what has none."""

    name: str
    type: CellType
    unit: str = ""
    about: str = ""


class ExportTable(NamedTuple):
    """A table. columns: in order."""

    name: str
    about: str
    columns: tuple[ExportColumn, ...]


class TableWriter(Protocol):
    """Writes tables: the one for CSV and the one for Parquet."""

    def begin(self, table: ExportTable) -> None:
        """A table with this name follows, perhaps without rows."""

    def add(self, table: str, columns: Sequence[Values]) -> None:
        """Add rows, given by their columns. Raises OSError if they cannot be written."""


def _text(name: str, about: str = "") -> ExportColumn:
    return ExportColumn(name, CellType.TEXT, "", about)


def _count(name: str, about: str = "") -> ExportColumn:
    return ExportColumn(name, CellType.WHOLE, "1", about)


TIME = ExportColumn("time", CellType.NUMBER, "s", "simulated, since the start of the run")
ROBOT = _text("robot", "its name")
TABLES = (
    ExportTable(
        "robots",
        "the robots of the run",
        (
            ROBOT,
            _count("number", "of the robot in the scenario, from 1"),
            _text("type"),
            ExportColumn("radius", CellType.NUMBER, "m", "of its body"),
        ),
    ),
    ExportTable(
        "poses",
        "where each robot was, in the frame of the world",
        (
            TIME,
            ROBOT,
            ExportColumn("x", CellType.SINGLE, "m", "to the east"),
            ExportColumn("y", CellType.SINGLE, "m", "to the north"),
            ExportColumn("heading", CellType.SINGLE, "rad", "counter-clockwise from east"),
        ),
    ),
    ExportTable(
        "marks",
        "groups and flags of each robot, from this time on",
        (
            TIME,
            ROBOT,
            _text("group", "the newest, empty for none"),
            _text("second_group", "the second newest"),
            ExportColumn("colour", CellType.WHOLE, "1", "that it shows, 0 for none"),
            *(ExportColumn(flag, CellType.TRUTH) for flag in FLAGS),
        ),
    ),
    ExportTable(
        "turnover",
        "robots that came and went during the run; other tables have a row of each while it was there",
        (
            TIME,
            ROBOT,
            ExportColumn("came", CellType.TRUTH, "", "or else it went"),
            _text("parent", "who has hatched it, empty for none"),
        ),
    ),
    ExportTable(
        "commands",
        "the operator's messages",
        (
            TIME,
            _count("tick", "in which it was sent"),
            _text("command", "its id"),
            _text("sender"),
            _text("kind"),
            _text("text", "the expression"),
            ExportColumn("standing", CellType.TRUTH, "", "whether robots that join later obey it, too"),
            ExportColumn("deadline", CellType.NUMBER, "s", "until which it may be heard; unknown for ever"),
        ),
    ),
    ExportTable(
        "outcomes",
        "what had become of a command at this time",
        (
            TIME,
            _text("command", "its id"),
            _text("text"),
            *map(_count, ("matched", "not_matched", "unknown", "fault", "silent")),
            _count("held", "robots among the matched that STOP held"),
            _count("predicted", "robots expected to obey when it was sent"),
            _text("values", "answers to a question"),
        ),
    ),
    ExportTable("log", "what was said", (TIME, _text("level"), _text("name", "who said it"), _text("text"))),
    ExportTable(
        "rules",
        "the expressions stored on a robot, all of them whenever they had changed",
        (
            TIME,
            ROBOT,
            _text("rule"),
            _text("text"),
            ExportColumn("active", CellType.TRUTH),
            ExportColumn("priority", CellType.WHOLE, "1"),
        ),
    ),
    ExportTable(
        "failing",
        "the rules that failed, all of them whenever they had changed",
        (
            TIME,
            _text("rule"),
            _count("robots", "on which it failed"),
            _count("inactive", "robots among them that had deactivated it"),
            _text("reason", "the fault of one of them"),
        ),
    ),
    ExportTable(
        "walls",
        "solid things: each line from (x0, y0) to (x1, y1), at the start and whenever one was added or moved; "
        "unknown numbers for one that was removed",
        (
            TIME,
            _count("wall", "the number of the thing"),
            *(ExportColumn(name, CellType.NUMBER, "m") for name in ("x0", "y0", "x1", "y1")),
            ExportColumn("radius", CellType.NUMBER, "m", "0 for a line, above it for a disc"),
        ),
    ),
)
HEIGHT = ExportColumn("z", CellType.SINGLE, "m", "above the ground")
"""Of poses, where robots fly."""
READINGS = "readings"
TABLE_NAMES = (*(table.name for table in TABLES), READINGS)


class TableSink:
    """Makes rows of events. run: of which; rows: written so far, by table."""

    def __init__(self, run: RecordedRun, writer: TableWriter) -> None:
        self._run, self._writer = run, writer
        self._sensors: tuple[str, ...] | None = None
        self.rows: dict[str, int] = {}
        self._flies = run.scenario.robots.flight is not None
        for table in TABLES:
            high = self._flies and table.name == "poses"
            self._begin(table._replace(columns=(*table.columns, HEIGHT)) if high else table)
        rows, numbers = zip(*run.wanted.values(), strict=True)
        specs = [run.spec(row) for row in rows]
        types, radii = [spec.type for spec in specs], [spec.geometry.radius for spec in specs]
        self._add("robots", [list(run.wanted), np.array(numbers), types, radii])

    def take(self, event: Event) -> None:
        """Write what an event says. Raises ValueError for what fits no table, OSError if it cannot be written."""
        match event:
            case PosesEvent():
                chosen = self._run.chosen
                z = [event.z[chosen].astype(np.float32)] if self._flies else []
                self._add("poses", [*self._keys(event.time), *event.poses[chosen].T, *z])
            case ReadingsEvent():
                self._readings(event)
            case MarksEvent():
                self._marks(event)
            case RobotsEvent(time, change) if not change.everybody:
                for came in change.came:
                    self._came(time, came.robot, True, came.parent)
                for gone in change.gone:
                    self._came(time, gone.robot, False, "")
            case CommandEvent():
                self._command(event)
            case OutcomeEvent(time, told):
                counts = (told.matched, told.not_matched, told.unknown, told.fault, told.silent, told.held)
                self._row("outcomes", time, told.command, told.text, *counts, told.predicted, told.values)
            case LogLineEvent(time, level, name, text):
                self._row("log", time, level.name.lower(), name, text)
            case RulesEvent(time, rules):
                self._rules(time, rules.robot, [(r.name, r.text, r.active, r.priority) for r in rules.rules])
            case FailingEvent(time, failing):
                for rule in failing:
                    self._row("failing", time, rule.rule, rule.count, rule.inactive, rule.reason)
            case SolidsEvent():
                self._walls(event)

    def close(self) -> None:
        """All events were taken: a run that ended before its first readings has no such table yet."""
        if self._sensors is None:
            self._begin_readings(())

    def _begin(self, table: ExportTable) -> None:
        self.rows[table.name] = 0
        self._writer.begin(table)

    def _add(self, table: str, columns: Sequence[Values]) -> None:
        self.rows[table] += len(columns[0])
        self._writer.add(table, columns)

    def _row(self, table: str, *cells: str | float) -> None:
        self._add(table, [np.array([cell]) if isinstance(cell, float) else [cell] for cell in cells])

    def _keys(self, time: float) -> tuple[Values, Values]:
        names = self._run.chosen_names
        return np.full(len(names), time), names

    def _came(self, time: float, robot: str, came: bool, parent: str) -> None:
        if self._run.wants(robot):
            self._row("turnover", time, robot, came, parent)

    def _readings(self, event: ReadingsEvent) -> None:
        if self._sensors is None:
            self._begin_readings(event.values)
        if tuple(event.values) != self._sensors:
            raise ValueError("readings of other sensors than before")
        self._add(READINGS, [*self._keys(event.time), *(each[self._run.chosen] for each in event.values.values())])

    def _begin_readings(self, sensors: Iterable[str]) -> None:
        self._sensors = tuple(sensors)
        columns = [TIME, ROBOT]
        for name in self._sensors:
            sensor = self._run.sensors.get(name)
            taken = [column.name for column in columns]
            unit = "" if sensor is None else si_unit(sensor.unit)
            about = "added by a program, which alone knows its unit" if sensor is None else sensor.doc
            columns.append(ExportColumn(column_name(name, taken), CellType.NUMBER, unit, about))
        self._begin(ExportTable(READINGS, "what the sensors of each robot read", tuple(columns)))

    def _marks(self, event: MarksEvent) -> None:
        groups = [
            [event.name_of(number) for number in numbers[self._run.chosen].tolist()]
            for numbers in (event.group, event.second)
        ]
        flags = event.flags[self._run.chosen]
        truths = [(flags & bit).astype(bool) for bit in FLAGS.values()]
        colours = event.colour[self._run.chosen].astype(np.int64)
        self._add("marks", [*self._keys(event.time), *groups, colours, *truths])

    def _command(self, event: CommandEvent) -> None:
        said = event.message
        deadline = np.nan if said.deadline == inf else said.deadline
        about = (said.id, said.sender, said.kind.value, said.text, said.standing, deadline)
        self._row("commands", event.time, event.tick, *about)

    def _rules(self, time: float, robot: str, rules: Iterable[tuple[str, str, bool, int]]) -> None:
        if self._run.wants(robot):
            for rule in rules:
                self._row("rules", time, robot, *rule)

    def _walls(self, event: SolidsEvent) -> None:
        for number in event.gone:
            self._row("walls", event.time, number, *[np.nan] * 5)
        for number, shape in event.put.items():
            columns = np.array(rows_of(shape), np.float64).reshape(-1, 5).T
            count = len(columns[0])
            self._add("walls", [np.full(count, event.time), np.full(count, number), *columns])
