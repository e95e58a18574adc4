"""Figures stay readable whatever stands in the table."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

import pytest

from sleepcast.experiments.drawing import COLOURS, Table, draw, read_table

pytest.importorskip("matplotlib")

NAMES = [f"a strategy with the number {number}" for number in range(10)]


def table(names: list[str], counts: list[str]) -> Table:
    rows = list(product(names, counts, range(3)))
    return {
        "strategy": [name for name, _, _ in rows],
        "robots.count": [count for _, count, _ in rows],
        "run": [str(number) for number in range(len(rows))],
        "share": [str(seed + names.index(name)) for name, _, seed in rows],
    }


def drawn(tmp_path: Path, found: Table, **how: object) -> str:
    out = tmp_path / "figure.svg"
    draw(found, out=out, **{"y": ["share"], "by": None, "kind": "line", **how})  # type: ignore[arg-type]
    return out.read_text()


def slanted(figure: str, name: str) -> bool:
    """Whether a name is written at a slant."""
    (text,) = re.findall(rf"<text [^>]*>{re.escape(name)}</text>", figure)
    return "rotate(-30" in text


def ink(figure: str) -> set[tuple[str, ...]]:
    """The looks of the lines between marks: colour and dashes."""
    lines = re.findall(r'<path d="[^"]*" clip-path="[^"]*" style="([^"]*stroke-width: 1.6[^"]*)"', figure)
    return {tuple(re.findall(r"stroke(?:-dasharray)?: ([^;]+)", style)) for style in lines}


@pytest.mark.parametrize("kind", ["line", "box", "heat"])
def test_long_names_do_not_run_into_each_other(tmp_path: Path, kind: str) -> None:
    by = "robots.count" if kind == "heat" else None
    figure = drawn(tmp_path, table(NAMES, ["10", "20"]), x="strategy", kind=kind, by=by)
    assert all(slanted(figure, name) for name in NAMES)
    figure = drawn(tmp_path, table(["patrol", "rest"], ["10", "20"]), x="strategy", kind=kind, by=by)
    assert not slanted(figure, "patrol")


def test_more_lines_than_colours_all_look_different(tmp_path: Path) -> None:
    figure = drawn(tmp_path, table(NAMES, ["10", "20"]), x="robots.count", by="strategy")
    assert len(NAMES) > len(COLOURS)
    assert len(ink(figure)) == len(NAMES)


@pytest.mark.parametrize("count", [16, 40, 60])
def test_a_legend_is_complete_or_counts_what_it_leaves_out(tmp_path: Path, count: int) -> None:
    names = [f"strategy {number:02d}" for number in range(count)]
    figure = drawn(tmp_path, table(names, ["10"]), x="robots.count", by="strategy", kind="box")
    (width, height) = map(float, re.findall(r'viewBox="0 0 ([0-9.]+) ([0-9.]+)"', figure)[0])
    places = re.findall(r'<text [^>]* x="([0-9.]+)" y="([0-9.]+)"[^>]*>([^<]+)</text>', figure)
    legend = {name: (float(x), float(y)) for x, y, name in places if name.startswith(("strategy ", "and "))}
    assert all(0 < x < width - 55 and 0 < y < height for x, y in legend.values())
    assert set(legend) == set(names) if count <= 48 else set(legend) == {*names[:47], "and 13 more"}


def test_two_columns_of_one_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("run,a,a\n0,1,2\n")
    with pytest.raises(ValueError, match="two columns are called a"):
        read_table(tmp_path / "table.csv")


def test_boxes_stand_side_by_side_over_uneven_numbers(tmp_path: Path) -> None:
    figure = drawn(tmp_path, table(["a", "b"], ["20", "1000", "50"]), x="robots.count", by="strategy", kind="box")
    order = re.findall(r"<text [^>]*>(20|50|1000)</text>", figure)
    assert order == ["20", "50", "1000"]


def test_settings_of_the_folder_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Matplotlib looks for a matplotlibrc where the program was started, which may be anybody's folder."""
    import matplotlib as mpl

    found = table(NAMES[:2], ["1", "2"])
    before = drawn(tmp_path, found, x="robots.count", by="strategy")
    for key, value in {"lines.linewidth": 99.0, "text.usetex": True, "axes.facecolor": "red", "font.size": 3.0}.items():
        monkeypatch.setitem(mpl.rcParams, key, value)
    assert drawn(tmp_path, found, x="robots.count", by="strategy") == before
