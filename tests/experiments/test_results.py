"""Folders of results that somebody sends: what is wrong in them is a sentence, and what computes is not read."""

from __future__ import annotations

import json
import sqlite3
import tracemalloc
from pathlib import Path

import polars
import pytest

from sleepcast.experiments.plan import experiment_of
from sleepcast.experiments.results import (
    MAX_VALUES,
    Results,
    ResultsError,
    RunResult,
    export,
    outcomes_in,
    summary_of,
    table_of,
)

PLAN = experiment_of("crowd", measures=["mean x"], over=["radio.loss=0,0.1"], seeds=1)
RUN = json.dumps({"number": 0, "point": {"radio.loss": 0}, "seed": 1})
ROW = f"SELECT 'a' AS key, 0 AS number, '{RUN}' AS run, '' AS hash, 1.0 AS wall, '[[0.0, 1.0]]' AS samples, "
NEW = "INSERT INTO runs (key, number, run, hash, wall, samples) VALUES ('a', 0, ?, '', 1.0, '[[0.0, 1.0]]')"
FOREVER = "WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n) "


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Results without a run yet."""
    with Results(tmp_path / "found", PLAN):
        return tmp_path / "found"


def changed(folder: Path, *statements: tuple[str, tuple[object, ...]]) -> None:
    connection = sqlite3.connect(folder / "runs.sqlite")
    for text, values in statements:
        connection.execute(text, values)
    connection.commit()
    connection.close()


def insert(run: str, samples: str) -> tuple[str, tuple[object, ...]]:
    return "INSERT INTO runs VALUES ('a', 0, ?, '', '', 1.0, ?, '[]', '[]')", (run, samples)


@pytest.mark.parametrize(
    ("run", "samples"),
    [
        (RUN, "[" * 200_000),
        (RUN, '{"a":' * 200_000),
        (RUN, "[[0.0]]"),
        (RUN, "[[0.0, 1.0, 2.0]]"),
        (RUN, '[["a", "b"]]'),
        (RUN, "[5]"),
        (RUN, "5"),
        (RUN, ""),
        ("[" * 200_000, "[[0.0, 1.0]]"),
        (RUN.replace("radio.loss", "radio.delay"), "[[0.0, 1.0]]"),
        (RUN.replace("0}", "[0]}"), "[[0.0, 1.0]]"),
    ],
)
def test_a_row_that_is_none_is_a_sentence(folder: Path, run: str, samples: str) -> None:
    changed(folder, insert(run, samples))
    for read in (summary_of, table_of):
        with pytest.raises(ResultsError, match="the results cannot be read"):
            read(folder)


@pytest.mark.parametrize("texts", ["", "5", "[5]", "[" * 200_000])
@pytest.mark.parametrize("columns", ["?, '[]'", "'[]', ?"])
def test_what_was_never_sent_or_came_otherwise_is_a_list_of_texts(folder: Path, texts: str, columns: str) -> None:
    changed(folder, (f"INSERT INTO runs VALUES ('a', 0, ?, '', '', 1.0, '[[0.0, 1.0]]', {columns})", (RUN, texts)))
    with pytest.raises(ResultsError, match="the results cannot be read"):
        summary_of(folder)


@pytest.mark.parametrize("samples", ["", "5", "[5]", "[[0.0]]", "[" * 200_000, "[0]," * (MAX_VALUES + 1)])
def test_nor_is_it_gone_on_with(folder: Path, samples: str) -> None:
    changed(folder, insert(RUN, samples))
    tracemalloc.start()
    try:
        with Results(folder, PLAN) as found, pytest.raises(ResultsError, match="the results cannot be read"):
            found.missing()
        assert tracemalloc.get_traced_memory()[1] < 200 * 1024**2
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "view",
    [
        f"{ROW} hex(zeroblob(450000000)) AS error",
        f"{FOREVER}{ROW} '' AS error FROM n",
    ],
    ids=["long", "without end"],
)
def test_what_computes_its_rows_is_not_read(folder: Path, view: str) -> None:
    changed(folder, ("DROP TABLE runs", ()), (f"CREATE VIEW runs AS {view}", ()))
    with pytest.raises(ResultsError, match="which no results have"):
        list(outcomes_in(folder))
    with pytest.raises(ResultsError, match="which no results have"):
        Results(folder, PLAN)


def test_nor_is_what_acts_on_writing(folder: Path) -> None:
    changed(folder, ("CREATE TRIGGER more AFTER INSERT ON runs BEGIN DELETE FROM runs; END", ()))
    with pytest.raises(ResultsError, match="'more', which no results have"):
        Results(folder, PLAN)


def test_nor_a_column_that_becomes_large(folder: Path) -> None:
    changed(
        folder,
        ("DROP TABLE runs", ()),
        (
            "CREATE TABLE runs (key TEXT, number INTEGER, run TEXT, error AS (hex(zeroblob(100000000))), hash TEXT, "
            "wall REAL, samples TEXT)",
            (),
        ),
        (NEW, (RUN,)),
    )
    with pytest.raises(ResultsError, match="too big"):
        list(outcomes_in(folder))


def test_what_was_written_is_read(folder: Path) -> None:
    changed(folder, insert(RUN, "[[0.0, 1.0], [1.0, null], [2.0, Infinity]]"))
    (found,) = outcomes_in(folder)
    assert found.samples == ((0.0, 1.0), (1.0, None), (2.0, float("inf")))


def test_numbers_beyond_those_of_a_machine_are_a_column(tmp_path: Path) -> None:
    plan = experiment_of("gauci", measures=["mean x"], over=[f"constants.FAR={2**63},1"])
    with Results(tmp_path / "found", plan) as results:
        results.keep([RunResult(run, ((0.0, 1.0),), hash="a") for run in plan.runs()])
    assert list(table_of(tmp_path / "found")["constants.FAR"]) == [2.0**63, 1.0]


def test_what_polars_makes_of_a_table_and_what_it_has_to_be_told(folder: Path, tmp_path: Path) -> None:
    """As the page on experiments says of measures that are unknown at first, of errors, and of names with a dot."""
    samples = [[time, None if time < 120 else 0.5] for time in range(150)]
    changed(folder, insert(RUN, json.dumps(samples)))
    export(folder, tmp_path / "t.csv")
    export(folder, tmp_path / "t.parquet")
    assert polars.read_csv(tmp_path / "t.csv").schema["mean_x"] == polars.String
    read = polars.read_csv(tmp_path / "t.csv", infer_schema_length=None)
    kept = polars.read_parquet(tmp_path / "t.parquet")
    for frame in (read, kept):
        assert frame["mean_x"].mean() == 0.5
        assert frame["mean_x"].null_count() == 120
        assert frame.filter(polars.col("error") != "").is_empty()
        assert frame.sql('SELECT "radio.loss" FROM self').height == 150
        with pytest.raises(polars.exceptions.SQLInterfaceError):
            frame.sql("SELECT radio.loss FROM self")
    assert read["error"].null_count() == 150
    assert (kept["error"] == "").all()
