"""Where robots start: poses in the scenario's file or in a CSV file beside it, or a formation.

    starts = [["1m", "2m", "90deg"], ["3m", "2m", "90deg", "ada"]]      # x, y, heading, name, z
    starts = "starts.csv"                                               # columns x, y, heading, name, z
    starts = { shape = "circle", spacing = "1m", center = ["5m", "5m"] }

Robots take the poses in the order of their numbers. A pose without a heading gets one by chance, as robots without
starts do; one without a name leaves the robot its number. Whether bodies fit there is looked at in `bodies.bodies`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from io import StringIO
from math import ceil, nan, pi, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import MAX_NAME, is_robot_name
from sleepcast.core.errors import decimal_comma, did_you_mean
from sleepcast.core.quantities import shown_value
from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.core.settings import Document, SettingsError, Table, read_text
from sleepcast.core.units import LENGTH, UNITS
from sleepcast.simulator.simd.formulas import rotated, sine_cosine

MAX_STARTS = 100_000
"""Poses of one scenario: they are kept in every recording and snapshot, some 40 bytes each."""
MAX_CSV = 8 * 1_048_576
"""Bytes of a file of poses: as many as MAX_STARTS long lines have."""
SLACK = 1e-9
"""Distance, m, by which rounding may push a formation beyond a world that it just fits into."""
TURN = 2.0 * pi
COLUMNS = ("x", "y", "heading", "name", "z")
"""What a pose consists of, in the order of a list."""
_SAME = {"robot": "name"}
"""What tables of sleepcast call a column, and what it is called here."""
SHAPES = ("line", "circle", "grid")
DEGREES = "°"
"""How tables write what is `deg` here."""
STANDS = "these robots do not fly, so they start on the ground: leave this out"
OUTWARD, INWARD = "outward", "inward"

Floats = NDArray[np.float64]


class StartPose(NamedTuple):
    """A start: x, y in m; heading in rad, None for one by chance; name of the robot, "" for its number; z in m, of what
    flies."""

    x: float
    y: float
    heading: float | None = None
    name: str = ""
    z: float = 0.0


@dataclass(frozen=True, slots=True)
class Formation:
    """Robots around a `center` (x, y in m), `spacing` m from each other. shape: of SHAPES.

    The formation looks along `heading` (rad), and so do its robots, unless those of a circle look `facing` OUTWARD or
    INWARD. In a line they stand side by side, the first on the left; a grid has lines of so many `columns` behind each
    other, 0 for about as many as lines; a circle begins in the direction of `heading` and goes on counter-clockwise.
    """

    shape: str
    spacing: float
    center: tuple[float, float]
    heading: float = 0.0
    facing: str = ""
    columns: int = 0


Starts = tuple[StartPose, ...] | Formation


def rows_of_starts(robots: Table) -> list[Table] | None:
    """The poses of a table of robots, each as a table that is not yet read; None for a formation, and without starts.
    Raises SettingsError."""
    written = robots.values.get("starts")
    if isinstance(written, str):
        return _rows_of_file(robots.file("starts"))
    if not robots.has("starts") or isinstance(written, dict):
        return None
    if not isinstance(written, list) or not written:
        wanted = 'wanted a list of poses such as [["1m", "2m", "90deg"]], a CSV file or a table with a shape'
        raise robots.error("starts", wanted)
    if len(written) > MAX_STARTS:
        raise robots.error("starts", f"{len(written)} poses; at most {MAX_STARTS} fit")
    return [_row(robots, number, pose) for number, pose in enumerate(written, 1)]


def _row(robots: Table, number: int, pose: object) -> Table:
    """A pose of the scenario's file: a list in the order of COLUMNS, or a table with these keys."""
    where, name = (*robots.where, "starts"), f"pose {number}"
    if isinstance(pose, list) and 2 <= len(pose) <= len(COLUMNS):
        pose = dict(zip(COLUMNS, pose, strict=False))
    if not isinstance(pose, dict):
        raise robots.document.error(
            (*where, name), 'wanted x, y, and perhaps heading and name, such as ["1m", "2m", "90deg", "ada"]'
        )
    return Table(robots.document, pose, (*where, name))


def _rows_of_file(file: Path) -> list[Table]:
    """The poses of a CSV file, whose first line names its columns. Lines that begin with # are comments."""
    import csv

    text = read_text(file, MAX_CSV, "a file of starts")
    lines = csv.reader(StringIO(text, newline=""), strict=True)
    units: dict[str, str] = {}
    rows: list[Table] = []
    try:
        for values in lines:
            if not any(map(str.strip, values)) or values[0].lstrip().startswith("#"):
                continue
            if not units:
                units = _columns(file, lines.line_num, values)
                continue
            if len(rows) == MAX_STARTS:
                raise SettingsError(f"{file}:{lines.line_num}: more than {MAX_STARTS} poses: use fewer")
            rows.append(_line(file, lines.line_num, values, units))
    except csv.Error as error:
        raise SettingsError(f"{file}:{lines.line_num}: not CSV: {error}") from None
    if not rows:
        raise SettingsError(f"{file}:1: no poses: wanted a line with the columns x, y, and a line for each robot")
    return rows


def _columns(file: Path, line: int, header: Sequence[str]) -> dict[str, str]:
    """The columns that the first line names, each with its unit: `x [m]`, `heading (deg)`. A first one without a name,
    the numbers that pandas writes of rows, is called ""."""
    columns: dict[str, str] = {}
    for number, title in enumerate(header):
        if not title.strip() and not number and len(header) > 1:
            columns[""] = ""
            continue
        name, _, unit = (part.strip(" )]") for part in title.replace("[", "(").partition("("))
        name, unit = _SAME.get(name.casefold(), name.casefold()), unit.replace(DEGREES, "deg")
        if ";" in title:
            raise SettingsError(f'{file}:{line}: "{title:.40}": wanted commas between the columns, not semicolons')
        if name not in COLUMNS or name in columns:
            near = did_you_mean(name, COLUMNS)
            what = "is there twice" if name in columns else f"is no column{near}"
            is_value = title.strip().lstrip("+-.")[:1].isdigit()
            first = ". The first line names the columns, as in x,y,heading" if is_value else ""
            raise SettingsError(
                f'{file}:{line}: "{title:.40}" {what}: wanted x, y, and perhaps heading and name{first}'
            )
        if unit and (name == "name" or unit not in UNITS):
            raise SettingsError(f'{file}:{line}: unknown unit in "{title:.40}"{did_you_mean(unit, UNITS)}')
        columns[name] = unit
    for name in ("x", "y"):
        if name not in columns:
            raise SettingsError(f"{file}:{line}: there is no column {name}: wanted x, y, and perhaps heading and name")
    return columns


def _line(file: Path, line: int, values: Sequence[str], units: dict[str, str]) -> Table:
    """The pose in one line. units: of each column, for the values that have none."""
    if len(values) != len(units):
        comma = ". Decimals have a point, not a comma" if len(values) > len(units) else ""
        raise SettingsError(f"{file}:{line}: {len(values)} values in {len(units)} columns: one for each{comma}")
    row: dict[str, object] = {}
    for (name, unit), value in zip(units.items(), map(str.strip, values), strict=True):
        if value and name == "heading":
            value = value.replace(DEGREES, "deg")
        if name and value:
            row[name] = value + unit if value[-1:].isdigit() or value[-1:] == "." else value
    return Table(Document(file, row, dict.fromkeys(((name,) for name in COLUMNS), line)), row, ())


def read_starts(robots: Table, rows: Sequence[Table] | None, size: tuple[float, float], highest: float = 0.0) -> Starts:
    """The starts of a table of robots, whose poses are `rows`; empty without any. size: of the world, m. highest: z at
    which any may start, m. Raises SettingsError."""
    if not robots.has("starts"):
        return ()
    for key in ("x", "y", "disc", "numbers"):
        if robots.has(key):
            raise robots.error(key, f"the robots have starts, which say where they begin: leave {key} out, or starts")
    if rows is None:
        return _formation(robots, size)
    return tuple(_pose(row, size, highest) for row in rows)


def _pose(row: Table, size: tuple[float, float], highest: float) -> StartPose:
    with row:
        x, y = (_inside(row, key, side) for key, side in zip("xy", size, strict=True))
        heading = _angle(row) if row.has("heading") else None
        name = row.text("name", "")
        if row.has("name") and not is_robot_name(name):
            raise row.error("name", f"{name!r:.80}: wanted 1 to {MAX_NAME} characters without blanks")
        if row.has("z") and not highest:
            raise row.error("z", STANDS)
        return StartPose(x, y, heading, name, row.number("z", LENGTH, 0.0, low=0.0, high=highest))


def _inside(row: Table, key: str, side: float) -> float:
    position = row.number(key, LENGTH)
    if not 0.0 <= position <= side:
        raise row.error(key, f"{position:g} m is outside the world, which goes from 0 to {side:g} m")
    return position


def _angle(table: Table) -> float:
    try:
        angle = table.measure("heading")
    except SettingsError:
        around = f", {OUTWARD} or {INWARD}" if table.values.get("shape") == "circle" else ""
        wrong, comma = shown_value(table.values["heading"]), decimal_comma(table.values["heading"])
        raise table.error("heading", f'wanted an angle such as "90deg"{around}, not {wrong}{comma}') from None
    if abs(angle.value) > TURN:
        plain = "" if angle.unit else f'. {angle.value:g} alone are radians, "{angle.value:g}deg" degrees'
        raise table.error("heading", f"wanted an angle from -360deg to 360deg{plain}")
    return angle.value


def _formation(robots: Table, size: tuple[float, float]) -> Formation:
    with robots.table("starts") as table:
        shape = table.text("shape", choices=SHAPES)
        facing = table.values.get("heading") if shape == "circle" else None
        turned = facing in (OUTWARD, INWARD)
        table.has("heading")
        return Formation(
            shape=shape,
            spacing=table.number("spacing", LENGTH, low=0.0, high=max(size)),
            center=table.point("center", (0.0, 0.0), size) if table.has("center") else (size[0] / 2.0, size[1] / 2.0),
            heading=_angle(table) if table.has("heading") and not turned else 0.0,
            facing=str(facing) if turned else "",
            columns=table.whole("columns", 0, low=1, high=MAX_STARTS)
            if shape == "grid" and table.has("columns")
            else 0,
        )


def refuse_misfits(robots: Table, starts: Starts, count: int, size: tuple[float, float]) -> None:
    """Raise SettingsError if so many robots of this table cannot start there. size: of the world, m."""
    if not starts:
        return
    if not isinstance(starts, Formation):
        if count > len(starts):
            raise robots.error(
                "starts", f"{len(starts)} starts for {count} robots: write more starts, or use fewer robots"
            )
        return
    x, y, _ = start_columns(starts, count)
    beyond = np.flatnonzero(np.maximum(np.maximum(-x, x - size[0]), np.maximum(-y, y - size[1])) > SLACK)
    if beyond.size:
        first = int(beyond[0])
        raise robots.error(
            "starts",
            f"a {starts.shape} of {count} robots {starts.spacing:g} m apart does not fit into a world of {size[0]:g} "
            f"by {size[1]:g} m: robot {first + 1} would start at {x[first]:g}, {y[first]:g} m",
        )


def refuse_equal_names(names: Iterable[str], rows: Iterable[Table]) -> None:
    """Raise SettingsError if two robots have the same one of these names. rows: the poses that name robots."""
    twice = {name for name, count in Counter(names).items() if count > 1}
    for row in reversed(list(rows)):
        name = row.values.get("name")
        if name in twice:
            raise row.error("name", f"another robot is called {name}, too: each needs a name of its own")


def start_columns(starts: Starts, count: int) -> tuple[Floats, Floats, Floats]:
    """x, y (m) and heading (rad, NaN where it is left to chance) of so many robots, shape (count,)."""
    if isinstance(starts, Formation):
        return _columns_of(starts, count)
    rows = [(pose.x, pose.y, nan if pose.heading is None else pose.heading) for pose in starts[:count]]
    x, y, heading = np.array(rows, np.float64).reshape(-1, 3).T
    return x, y, heading


def start_heights(starts: tuple[StartPose, ...], count: int) -> Floats:
    """z of so many robots, m, shape (count,)."""
    return np.array([pose.z for pose in starts[:count]], np.float64)


def _columns_of(formation: Formation, count: int) -> tuple[Floats, Floats, Floats]:
    number: Floats = np.arange(count, dtype=np.float64)
    heading = np.full(count, formation.heading)
    if formation.shape == "circle":
        angle = heading + number * (TURN / max(count, 1))
        half, _ = sine_cosine(np.array(pi / max(count, 1)))
        radius = formation.spacing / (2.0 * float(half)) if count > 1 else 0.0
        sine, cosine = sine_cosine(angle)
        ahead, left = radius * cosine, radius * sine
        if formation.facing:
            heading = angle + (pi if formation.facing == INWARD else 0.0)
        return formation.center[0] + ahead, formation.center[1] + left, heading
    columns = count if formation.shape == "line" else formation.columns or ceil(sqrt(count))
    lines = ceil(count / max(columns, 1))
    ahead = ((lines - 1) / 2.0 - number // columns) * formation.spacing
    left = ((columns - 1) / 2.0 - number % columns) * formation.spacing
    x, y = rotated(ahead, left, *sine_cosine(heading))
    return formation.center[0] + x, formation.center[1] + y, heading
