"""Figures of results: drawn, with the program that draws them and the table that it reads beside them."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from sleepcast.core.errors import MisuseError, SleepcastError, did_you_mean
from sleepcast.core.extras import installing
from sleepcast.experiments import drawing
from sleepcast.experiments.angles import angles_of
from sleepcast.experiments.results import experiment_in, export

FORMATS = (".svg", ".pdf", ".png")


def figure(
    results: Path,
    out: Path,
    *,
    x: str,
    y: Sequence[str],
    by: str | None,
    kind: str,
    title: str,
    angles: Sequence[str] = (),
) -> None:
    """Draw the columns `y` of results over `x`; see `drawing.draw`. Raises MisuseError for what cannot be drawn,
    SleepcastError where nothing can be written.

    results: a folder, or its table as CSV.
    angles: columns of angles besides those that the folder knows.
    """
    if out.suffix not in FORMATS:
        raise MisuseError(f"{out}: wanted a file that ends in {', '.join(FORMATS)}")
    if find_spec("matplotlib") is None:
        raise MisuseError(f"a figure needs Matplotlib; to install it: {installing('experiments')}")
    table_file = results if results.suffix == ".csv" else out.with_suffix(".csv")
    if table_file is not results:
        export(results, table_file)
        angles = sorted({*angles, *angles_of(experiment_in(results))})
    try:
        table = drawing.read_table(table_file)
    except (OSError, ValueError) as error:
        raise MisuseError(f"{table_file}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    for name in (x, *y, *([by] if by else []), *angles):
        if name not in table:
            raise MisuseError(f'no column "{name}"{did_you_mean(name, table)}: wanted one of {", ".join(table)}')
    try:
        drawing.draw(table, x=x, y=y, by=by, kind=kind, out=out, title=title, angles=angles)
        out.with_suffix(".py").write_text(_program(table_file, out, x, y, by, kind, title, angles), encoding="utf-8")
    except ValueError as error:
        raise MisuseError(f"{table_file}: {error}") from error
    except OSError as error:
        raise SleepcastError(f"{out}: cannot be written: {error.strerror or error}") from error


def _program(
    table: Path, out: Path, x: str, y: Sequence[str], by: str | None, kind: str, title: str, angles: Sequence[str]
) -> str:
    """A program that draws the figure: `drawing`, and a call of it."""
    own = Path(drawing.__file__).read_text(encoding="utf-8")
    beside = table.parent.resolve() == out.parent.resolve()
    file = f"HERE / {table.name!r}" if beside else f"Path({str(table.resolve())!r})"
    asked = f"x={x!r}, y={list(y)!r}, by={by!r}, kind={kind!r}, title={title!r}"
    asked += f", angles={list(angles)!r}" if angles else ""
    return f"{own}\n\nHERE = Path(__file__).parent\ndraw(read_table({file}), {asked}, out=HERE / {out.name!r})\n"
