"""The table of robots, as one page sees it: a column for each expression, sorted and filtered here, sent in pieces.

The page asks for the rows in sight. Only the column by which it is sorted and the test are evaluated on every robot,
the others on the robots in sight: with 100,000 robots that takes some 15 ms, less than the time between two frames. The
order is kept until the page asks for another one, so that scrolling costs nothing.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from io import StringIO
from typing import Annotated, Protocol

import msgspec
import numpy as np
from msgspec import Meta

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import Expression, Index, PageMessage, Place, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.values import Column, Values, in_unit, places_of
from sleepcast.console.values import Index as Robots
from sleepcast.core.columns import column_name
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.core.units import value_in_words
from sleepcast.language.evaluate import is_true

BY_NUMBER, BY_GROUP = -1, -2
"""What a table is sorted by, if by none of its columns."""
CSV_ROWS = 2_000
"""Rows of one piece of CSV: they are written in some 10 ms, so that a STOP waits no longer."""
MAX_COLUMNS = 12
"""Of the table: more of them fit on no screen."""
MAX_ROWS = 200
"""Rows that are asked for at once: those in sight, and some above and below."""
MAX_PICKED = 10_000
"""Robots that are picked from the table by hand."""
ASK = "Only the robots themselves could tell this: ask them in the prompt."


class GetRows(PageMessage, tag="rows"):
    """Rows of the table of robots, `count` from index `first` on.

    columns: expressions, none for those that the desk suggests
    sort: the column by which it is sorted, -1 for the robots' own order, -2 for their groups
    where: a test that the robots pass, "" for all of them
    again: sort anew; else the order stays that of the last rows, if nothing else is asked for
    """

    serial: Serial
    columns: Annotated[list[Expression], Meta(max_length=MAX_COLUMNS)]
    sort: Annotated[int, Meta(ge=-2, lt=MAX_COLUMNS)] = -1
    descending: bool = False
    where: Expression = ""
    first: Place = 0
    count: Annotated[int, Meta(ge=0, le=MAX_ROWS)] = 0
    again: bool = False


class GetRange(PageMessage, tag="range"):
    """Which robots are in these rows of the table, in the order of the last rows."""

    serial: Serial
    first: Place
    count: Place


class GetCsv(PageMessage, tag="csv"):
    """The table as CSV, piece by piece; all are of the moment of the first one. robots: only these (by index), none for
    all rows; they are given with the first piece."""

    serial: Serial
    piece: Place = 0
    robots: Annotated[list[Index], Meta(max_length=MAX_PICKED)] = msgspec.field(default_factory=list)


class ShownColumn(msgspec.Struct, frozen=True):
    """A column of the table of robots. problem: why there is nothing in it, or not for every robot."""

    text: str
    unit: str = ""
    problem: str = ""


class ShownRow(msgspec.Struct, frozen=True, array_like=True):
    """A robot in the table, by its index, with its groups and its values as people read them."""

    robot: int
    groups: str
    cells: list[str]


class TableRows(DeskMessage, tag="rows"):
    """Rows of the table from index `first` on.

    total: rows that pass the test
    problem: what is wrong with the test
    source: where the values come from, in words; "" for telemetry
    """

    serial: int
    columns: list[ShownColumn]
    total: int
    first: int
    rows: list[ShownRow]
    problem: str = ""
    source: str = ""


class RowRobots(DeskMessage, tag="range"):
    """The robots in rows of the table by their indices, four bytes each, little endian."""

    serial: int
    robots: bytes


class Csv(DeskMessage):
    """A piece of the table as CSV. done: whether it was the last."""

    serial: int
    text: str
    done: bool


@dataclass(frozen=True)
class RowOrder:
    """Robots in the order of the table. key: what was asked for."""

    key: tuple[object, ...]
    robots: Robots
    problem: str


@dataclass(frozen=True)
class CsvTable:
    """A table of one moment: names of the columns, robots in turn, their groups, and columns of numbers."""

    heads: list[str]
    robots: Robots
    groups: dict[int, str]
    columns: list[Column]


class RobotTable:
    """See the module. values: of the robots."""

    def __init__(self, values: Values) -> None:
        self._values = values
        self._columns: list[str] = []
        self._order = RowOrder((), np.arange(0), "")
        self._names: Sequence[str] = ()
        """Of the robots when they were put into this order."""
        self._csv: CsvTable | None = None

    def rows(self, asked: GetRows) -> TableRows:
        """The rows that the page asks for."""
        texts = asked.columns or self._values.suggested()
        order = self._ordered(asked, texts)
        self._columns = texts
        robots = order.robots[asked.first : asked.first + asked.count]
        where = np.argsort(robots)
        columns = [self._column(text, robots[where]) for text in texts]
        index = np.empty(len(robots), np.intp)  # of each robot of the table in the cells, which are in their own order
        index[where] = np.arange(len(robots))
        groups = self._groups_of(robots)
        rows = [
            ShownRow(robot, groups.get(robot, ""), [cells[at] for _, cells in columns])
            for robot, at in zip(robots.tolist(), index.tolist(), strict=True)
        ]
        shown = [column for column, _ in columns]
        total = len(order.robots)
        return TableRows(asked.serial, shown, total, asked.first, rows, order.problem, self._values.source)

    def range(self, asked: GetRange) -> RowRobots:
        """The robots in these rows, as they were sorted last."""
        robots = self._order.robots[asked.first : asked.first + asked.count]
        return RowRobots(asked.serial, robots.astype("<i4").tobytes())

    def csv(self, asked: GetCsv) -> Csv:
        """A piece of the table as CSV. Raises MisuseError for a piece of a table that was not begun."""
        if asked.piece == 0:
            self._csv = self._whole(asked.robots)
        if self._csv is None:
            raise MisuseError("This table is not there any more: copy it again from its beginning.")
        table, start = self._csv, asked.piece * CSV_ROWS
        stop = start + CSV_ROWS
        text = _written(self._values, table, start, stop)
        done = stop >= len(table.robots)
        if done:
            self._csv = None
        return Csv(asked.serial, text, done)

    # ---- which robots, in which order

    def _ordered(self, asked: GetRows, texts: list[str]) -> RowOrder:
        by = texts[asked.sort] if 0 <= asked.sort < len(texts) else min(asked.sort, BY_NUMBER)
        key, names = (by, asked.descending, asked.where.strip()), self._values.names
        if asked.again or key != self._order.key or names is not self._names:
            self._names = names
            self._order = self._sorted(key, by, asked.descending, asked.where.strip())
        return self._order

    def _sorted(self, key: tuple[object, ...], by: str | int, descending: bool, where: str) -> RowOrder:
        try:
            robots = np.flatnonzero(is_true(self._values.of(where)[0])) if where else places_of(self._values.names)
        except SleepcastError as error:
            return RowOrder(key, np.arange(0), str(error))
        if by == BY_NUMBER:
            return RowOrder(key, robots[::-1] if descending else robots, "")
        if by == BY_GROUP:
            newest = np.full(len(self._values.names), np.nan)
            for number, (_, members) in enumerate(self._values.groups()):
                newest[members] = number
            keys = newest[robots]
        else:
            try:
                keys, _ = self._values.of(str(by), robots)
            except SleepcastError:  # its head says what is wrong
                return RowOrder(key, robots, "")
        order = np.argsort(-keys if descending else keys, kind="stable")  # unknown is last either way
        return RowOrder(key, robots[order], "")

    # ---- what is in them

    def _column(self, text: str, robots: Robots) -> tuple[ShownColumn, list[str]]:
        """A column, and its cells on these robots (ascending)."""
        values, column = self._read(text, robots)
        if column.problem and column.problem != ASK:
            return column, [""] * len(robots)
        return column, [value_in_words(value, column.unit) for value in values.tolist()]

    def _read(self, text: str, robots: Robots) -> tuple[Column, ShownColumn]:
        """A column on these robots (ascending) in SI, unknown where something is wrong with it."""
        try:
            unit = self._values.checked(text).unit
            values, asked = self._values.of(text, robots)
        except SleepcastError as error:
            return np.full(len(robots), np.nan), ShownColumn(text, "", str(error))
        return values, ShownColumn(text, unit, ASK if asked else "")

    def _groups_of(self, robots: Robots) -> dict[int, str]:
        """The names of each robot's groups, the newest last; robots in none are left out."""
        names_by_robot: dict[int, list[str]] = {}
        for name, members in self._values.groups():
            for robot in robots[members[robots]].tolist():
                names_by_robot.setdefault(robot, []).append(name)
        return {robot: ", ".join(names) for robot, names in names_by_robot.items()}

    def _whole(self, picked: list[int]) -> CsvTable:
        """The table of this moment. picked: only these robots; none stands for all that are in it."""
        robots = self._order.robots
        if picked:
            robots = robots[np.isin(robots, np.array(picked))]
        where = np.argsort(robots)
        heads, columns = ["robot", "groups"], []
        for text in self._columns:
            values, shown = self._read(text, robots[where])
            column = np.empty(len(robots))
            column[where] = in_unit(values, shown.unit)
            heads.append(column_name(f"{text} ({shown.unit})" if shown.unit else text, heads))
            columns.append(column)
        return CsvTable(heads, robots, self._groups_of(robots), columns)


def _written(values: Values, table: CsvTable, start: int, stop: int) -> str:
    """Rows of a table as CSV, with the head before the first one; unknown is empty."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    if start == 0:
        writer.writerow(table.heads)
    robots = table.robots[start:stop].tolist()
    cells = [["" if x != x else f"{x:.10g}" for x in column[start:stop].tolist()] for column in table.columns]
    names = values.names
    writer.writerows(
        [names[robot], table.groups.get(robot, ""), *row] for robot, *row in zip(robots, *cells, strict=True)
    )
    return text.getvalue()


class TablePage(Protocol):
    """A page with a table of its own."""

    @property
    def table(self) -> RobotTable: ...


@answers(then=run_again)
def rows(source: TablePage, asked: GetRows) -> TableRows:
    """Rows of the table."""
    return source.table.rows(asked)


@answers(then=run_again)
def row_range(source: TablePage, asked: GetRange) -> RowRobots:
    """Which robots are in some rows."""
    return source.table.range(asked)


@answers(then=run_again)
def csv_piece(source: TablePage, asked: GetCsv) -> Csv:
    """A piece of the table as CSV."""
    return source.table.csv(asked)
