"""How libraries of tables read and write CSV, as docs/counterparts.md says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sleepcast.simulator import Simulator, load

UNKNOWN_AT_FIRST = "radio.loss,error,mean_x\n" + "".join(f"0.1,,{0.5 if row >= 120 else ''}\n" for row in range(150))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A table of ours, with a measure that is unknown in its first 120 rows."""
    (path := tmp_path / "t.csv").write_text(UNKNOWN_AT_FIRST, encoding="utf-8")
    return path


YARD = """format = 1
title = "starts"
seconds = "10s"
[world]
width = "20m"
height = "10m"
[robots]
like = "scout"
motion = "still"
"""


def starts(folder: Path, poses: str) -> list[float]:
    """Where two robots begin in x, in a scenario in this folder that has their poses from a file there."""
    (folder / "scenario.toml").write_text(f'{YARD}starts = "{poses}"\n', encoding="utf-8")
    return [float(x) for x in Simulator(load(folder)).x]


@pytest.mark.counterpart("polars")
def test_polars_takes_for_text_what_is_unknown_at_first(file: Path) -> None:
    import polars

    table = polars.read_csv(file)
    assert table.schema["mean_x"] == polars.String
    assert table.filter(polars.col("error") == "").is_empty()
    with pytest.raises(polars.exceptions.SQLInterfaceError):
        table.sql("SELECT radio.loss FROM self")
    assert table.sql('SELECT "radio.loss" FROM self').height == 150


@pytest.mark.counterpart("duckdb")
def test_to_duckdb_an_empty_error_is_unknown_and_a_dot_parts_a_table_from_its_column(file: Path) -> None:
    import duckdb

    assert duckdb.sql(f"SELECT avg(mean_x) FROM '{file}'").fetchall() == [(0.5,)]
    assert duckdb.sql(f"SELECT count(*) FROM '{file}' WHERE error = ''").fetchall() == [(0,)]
    with pytest.raises(duckdb.BinderException, match="radio"):
        duckdb.sql(f"SELECT radio.loss FROM '{file}'")
    assert duckdb.sql(f"""SELECT max("radio.loss") FROM '{file}'""").fetchall() == [(0.1,)]


@pytest.mark.counterpart("pandas")
def test_to_pandas_an_empty_error_is_unknown(file: Path) -> None:
    import pandas

    table = pandas.read_csv(file)
    assert table["mean_x"].mean() == 0.5
    assert table.query("error == ''").empty
    assert table["error"].isna().all()


@pytest.mark.counterpart("pandas", "polars", "duckdb", "numpy")
def test_tables_of_robots_as_each_writes_them_are_places_to_start_from(tmp_path: Path) -> None:
    import duckdb
    import pandas
    import polars

    columns = {"robot": ["r1", "r2"], "x": [1.0, 2.0], "y": [5.0, 6.0], "heading": [0.0, 1.0]}
    pandas.DataFrame(columns).to_csv(tmp_path / "pandas.csv")
    polars.DataFrame(columns).write_csv(tmp_path / "polars.csv")
    duckdb.sql(
        "SELECT * FROM (VALUES ('r1', 1.0, 5.0, 0.0), ('r2', 2.0, 6.0, 1.0)) AS t(robot, x, y, heading)"
    ).write_csv(str(tmp_path / "duckdb.csv"))
    numbers = np.column_stack([columns["x"], columns["y"], columns["heading"]])
    np.savetxt(tmp_path / "numpy.csv", numbers, delimiter=",", header="x,y,heading")
    assert (tmp_path / "pandas.csv").read_text().startswith(",robot,x,y,heading\n0,r1,")
    assert (tmp_path / "polars.csv").read_text().startswith("robot,x,y,heading\nr1,")
    assert (tmp_path / "duckdb.csv").read_text().startswith("robot,x,y,heading\nr1,")
    assert (tmp_path / "numpy.csv").read_text().startswith("# x,y,heading\n")
    np.savetxt(tmp_path / "numpy.csv", numbers, delimiter=",", header="x,y,heading", comments="")
    for name in ("pandas", "polars", "duckdb", "numpy"):
        assert starts(tmp_path, f"{name}.csv") == [1.0, 2.0], name


@pytest.mark.counterpart("pandas", "polars", "duckdb")
def test_the_metadata_of_a_column_are_left_behind(tmp_path: Path) -> None:
    """Units stand there in tables that are exported."""
    import duckdb
    import pandas
    import polars
    import pyarrow
    import pyarrow.parquet

    file = tmp_path / "readings.parquet"
    schema = pyarrow.schema(
        [pyarrow.field("speed", pyarrow.float64(), metadata={"unit": "m/s"})], metadata={"run": "1"}
    )
    pyarrow.parquet.write_table(pyarrow.table({"speed": [1.0]}, schema=schema), file)
    assert pyarrow.parquet.read_schema(file).field("speed").metadata == {b"unit": b"m/s"}
    read = pandas.read_parquet(file)
    assert (read.attrs, read["speed"].attrs) == ({}, {})
    assert not polars.read_parquet(file).to_arrow().schema.field("speed").metadata
    shown = duckdb.sql(f"SELECT key, value FROM parquet_kv_metadata('{file}')").fetchall()
    assert (b"run", b"1") in shown
    assert (b"unit", b"m/s") not in shown
