"""Draw a figure from a table of results. This file stands alone: it needs Python, NumPy and Matplotlib.

A line goes through the means, within a band that holds the true mean with 95 % confidence (bootstrap over the runs); a
box shows the quartiles of the runs; a heat map shows the means over two varied keys. Of runs with several samples, all
are drawn over the time, and only the last ones over anything else.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

KINDS = ("line", "box", "heat")
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#000000", "#999933")
"""Okabe and Ito's, which colour-blind people can tell apart (https://jfly.uni-koeln.de/color/), but for their yellow,
which is too light for a line on white."""
MARKERS = "osD^vP*X"
STYLES = ("-", "--", ":")
"""Of lines: more than there are colours differ in these."""
LONG = 36
"""Letters that fit beside the axis: names of many measures stand in the legend only."""
NAMED, BESIDE = 16, 3
"""Names below each other in a legend, and such columns of them; what is left out is counted in its last line."""
LETTERS = 60
"""Letters of names below an axis that fit beside each other; more are written at a slant."""
RESAMPLED, CONFIDENCE = 2_000, 0.95

Floats = NDArray[np.float64]
Table = dict[str, list[str]]

_NUMBER = re.compile(r"([-+]?(?:[0-9.]+(?:[eE][-+]?[0-9]+)?|nan))\s*([A-Za-z%/0-9]*)")


def read_table(file: Path) -> Table:
    """The columns of a CSV file, as texts."""
    with file.open(newline="", encoding="utf-8") as opened:
        head, *rows = list(csv.reader(opened))
    if twice := [name for index, name in enumerate(head) if name in head[:index]]:
        raise ValueError(f"two columns are called {twice[0]}: give one of them another name")
    return {name: [row[index] for row in rows] for index, name in enumerate(head)}


def numbers(column: list[str]) -> tuple[Floats, str] | None:
    """A column as numbers, NaN where it is empty, with their unit ("" for none); None if they are no numbers of one
    unit."""
    matches = [_NUMBER.fullmatch(each) if each else None for each in column]
    if any(each and match is None for each, match in zip(column, matches, strict=True)):
        return None
    units = {match[2] for match in matches if match}
    if len(units) > 1:
        return None
    return np.array([float(match[1]) if match else np.nan for match in matches]), "".join(units)


def at_end(table: Table) -> Table:
    """The last sample of each run."""
    last = {run: row for row, run in enumerate(table["run"])}
    return {name: [column[row] for row in last.values()] for name, column in table.items()}


def band(values: Floats, angle: bool = False) -> tuple[float, float, float]:
    """The mean of some runs, and the ends of its confidence interval by the percentile bootstrap (Efron, 1979).

    angle: whether they are angles, rad: then NaN where they have no mean direction.
    """
    ends = ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2)
    drawn = np.random.default_rng(0).choice(values, (RESAMPLED, len(values)))
    if angle:
        mean = direction(values)
        low, high = np.nanquantile(around(mean, direction(drawn)), ends) if mean == mean else (mean, mean)
        return float(mean), float(low), float(high)
    low, high = np.quantile(drawn.mean(1), ends)
    return float(values.mean()), float(low), float(high)


def direction(angles: Floats) -> Floats:
    """The mean directions of angles, rad, along the last axis; NaN where unit vectors cancel."""
    x, y = np.cos(angles).mean(-1), np.sin(angles).mean(-1)
    return np.where(np.hypot(x, y) > 1e-9, np.arctan2(y, x), np.nan)


def around(middle: Floats, angles: Floats) -> Floats:
    """The same angles, rad, each within half a turn of `middle`."""
    off = angles - middle
    return middle + off - 2.0 * np.pi * np.round(off / (2.0 * np.pi))


def draw(
    table: Table,
    *,
    x: str,
    y: Sequence[str],
    by: str | None,
    kind: str,
    out: Path,
    title: str = "",
    dpi: int = 150,
    angles: Sequence[str] = (),
) -> None:
    """Draw the columns `y` over `x` into an SVG, PDF or PNG file: a line or box for each of them, or of a single one
    for each value of `by`. Raises KeyError for no such column, ValueError for what cannot be drawn.

    by: in a heat map, the other axis.
    kind: one of KINDS.
    dpi: dots an inch of a PNG file.
    angles: the columns of angles, rad.
    """
    if x != "time" and "run" in table:
        table = at_end(table)
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcdefaults()  # a matplotlibrc lies in the folder of whoever wrote it: it may start TeX, or ask for any size
    mpl.rcParams["svg.hashsalt"] = "sleepcast"  # the same figure is the same file
    mpl.rcParams["svg.fonttype"] = "none"
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.add_subplot()
    axis = numbers(table[x])
    ticks = _sorted(table[x]) if axis is None or kind == "box" else []
    places = np.array([float(ticks.index(each)) for each in table[x]]) if ticks or axis is None else axis[0]
    measured = {name: _measured(table, name) for name in y}
    unit = "s" if x == "time" else "" if axis is None or ticks else axis[1]
    names = ", ".join(y)  # the legend names them as well
    axes.set(xlabel=_label(x, unit), ylabel=_label(names if len(names) <= LONG else "", measured[y[0]][1]), title=title)
    if kind == "heat":
        if by is None or len(y) > 1:
            raise ValueError("a heat map has two axes and one measure: say with --by what is on the other axis")
        _heat(figure, axes, table, (x, by, y[0]), y[0] in angles)
    else:
        lines = [(name, values) for name, (values, _) in measured.items()]
        if by is not None:
            if len(y) > 1:
                raise ValueError("either several measures or --by: each gets a line of its own")
            of = np.array(table[by])
            lines = [(group, np.where(of == group, measured[y[0]][0], np.nan)) for group in _sorted(table[by])]
        for number, (name, heights) in enumerate(lines):
            angle = (y[0] if by is not None else name) in angles
            known = ~np.isnan(heights)
            style = STYLES[number // len(COLOURS) % len(STYLES)]
            look = (COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)], style)
            if kind == "box":
                _boxes(axes, places[known], heights[known], (number, len(lines)), look[0], name, angle)
            else:
                _line(axes, places[known], heights[known], look, name, angle)
        if ticks:
            _name_ticks(axes, ticks)
        if by is not None or len(y) > 1:
            _name_lines(figure, axes, by)
        axes.grid(color="#dddddd", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(out, dpi=dpi, metadata={"Date": None} if out.suffix == ".svg" else None)


def _name_lines(figure, axes, by: str | None) -> None:  # type: ignore[no-untyped-def]  # Matplotlib has no types
    """Name every line or box beside the axes, in a figure as wide as that takes; of too many, say how many are left."""
    handles, names = axes.get_legend_handles_labels()
    if len(names) > NAMED * BESIDE:
        shown = NAMED * BESIDE - 1
        (nothing,) = axes.plot([], [], alpha=0.0)
        handles, names = [*handles[:shown], nothing], [*names[:shown], f"and {len(names) - shown} more"]
    columns = -(-len(names) // NAMED)
    legend = figure.legend(handles, names, title=by, frameon=False, loc="outside right upper", ncols=columns)
    if columns > 1:
        figure.draw_without_rendering()
        wide = legend.get_window_extent().width / figure.dpi
        figure.set_figwidth(figure.get_figwidth() + wide * (columns - 1) / columns)


def _measured(table: Table, name: str) -> tuple[Floats, str]:
    parsed = numbers(table[name])
    if parsed is None:
        raise ValueError(f"the column {name} has no numbers of one unit")
    return parsed


def _label(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name


def _sorted(column: list[str]) -> list[str]:
    """The different values, numbers by size."""
    parsed = numbers(column)
    different = dict.fromkeys(column)
    return sorted(different) if parsed is None else sorted(different, key=lambda each: numbers([each])[0][0])  # type: ignore[index]


def _line(axes, places: Floats, heights: Floats, look: tuple[str, str, str], group: str, angle: bool) -> None:  # type: ignore[no-untyped-def]  # Matplotlib has no types
    at = np.unique(places)
    bands = np.array([band(heights[places == each], angle) for each in at]).reshape(-1, 3)
    colour, marker, style = look
    few = {"marker": marker, "markersize": 4} if len(at) <= 40 else {}
    axes.plot(at, bands[:, 0], color=colour, label=group, linewidth=1.6, linestyle=style, **few)
    axes.fill_between(at, bands[:, 1], bands[:, 2], color=colour, alpha=0.2, linewidth=0)


def _boxes(axes, places: Floats, heights: Floats, which: tuple[int, int], colour: str, group: str, angle: bool) -> None:  # type: ignore[no-untyped-def]  # as above
    at = np.unique(places)
    step = float(np.diff(at).min()) if len(at) > 1 else 1.0
    width = 0.7 * step / which[1]
    middles = at + (which[0] - (which[1] - 1) / 2) * width
    shown = {"facecolor": colour, "alpha": 0.5, "edgecolor": colour}
    boxes = [heights[places == each] for each in at]
    axes.boxplot(
        [around(direction(box), box) for box in boxes] if angle else boxes,
        positions=middles,
        widths=0.8 * width,
        patch_artist=True,
        manage_ticks=False,
        boxprops=shown,
        medianprops={"color": "#000000"},
        flierprops={"markersize": 3},
    )
    axes.plot([], [], color=colour, linewidth=6, alpha=0.5, label=group)


def _name_ticks(axes, names: list[str]) -> None:  # type: ignore[no-untyped-def]  # as above
    """Write names below the axis, so that they do not run into each other."""
    slant = sum(len(name) + 2 for name in names) > LETTERS
    axes.set_xticks(range(len(names)), names, **({"rotation": 30, "ha": "right"} if slant else {}))


def _heat(figure, axes, table: Table, names: tuple[str, str, str], angle: bool) -> None:  # type: ignore[no-untyped-def]  # as above
    columns, rows = _sorted(table[names[0]]), _sorted(table[names[1]])
    values, unit = _measured(table, names[2])
    cells: dict[tuple[int, int], list[float]] = {}
    for column, row, value in zip(table[names[0]], table[names[1]], values, strict=True):
        if not np.isnan(value):
            cells.setdefault((rows.index(row), columns.index(column)), []).append(float(value))
    means = np.full((len(rows), len(columns)), np.nan)
    for cell, in_cell in cells.items():
        means[cell] = direction(np.array(in_cell)) if angle else sum(in_cell) / len(in_cell)
    drawn = axes.imshow(means, cmap="cividis", origin="lower", aspect="auto")
    _name_ticks(axes, columns)
    axes.set_yticks(range(len(rows)), rows)
    axes.set_ylabel(names[1])
    figure.colorbar(drawn, ax=axes, label=_label(names[2], unit))
