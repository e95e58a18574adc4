"""Tables as CSV and Parquet, read by other people's programs."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

import numpy as np
import polars
import pyarrow.parquet
import pytest

from exporting.recorded import YARD, one_picture, recorded
from sleepcast.exporting import export_recording, table_files
from sleepcast.exporting.table_files import CSV_FILES, PARQUET_FILES, MissingExtraError, ParquetWriter
from sleepcast.simulator.recording.recorder import READINGS, Recorder
from sleepcast.simulator.recording.recording import load_recording

TEXT = polars.String
POLARS = {"string": polars.String, "integer": polars.Int64, "number": polars.Float64, "boolean": polars.Boolean}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    for to in ("csv", "parquet"):
        export_recording(load_recording(YARD), to, folder / to)
    return folder


def test_the_files_are_all_that_there_is(exported: Path) -> None:
    assert {each.name for each in (exported / "csv").iterdir()} == CSV_FILES
    assert {each.name for each in (exported / "parquet").iterdir()} == PARQUET_FILES


def test_both_hold_the_same_values(exported: Path) -> None:
    for file in sorted((exported / "parquet").iterdir()):
        table = polars.read_parquet(file)
        package = json.loads((exported / "csv" / "datapackage.json").read_text(encoding="utf-8"))
        (resource,) = [each for each in package["resources"] if each["name"] == file.stem]
        types = {field["name"]: POLARS[field["type"]] for field in resource["schema"]["fields"]}
        read = polars.read_csv(exported / "csv" / resource["path"], schema=types)
        # Numbers in single precision are as short as they are exact in it; no text of ours is unknown.
        same = [read[name].cast(table[name].dtype).equals(table[name]) for name in read.columns if types[name] != TEXT]
        texts = [read[name].fill_null("").equals(table[name]) for name in read.columns if types[name] == TEXT]
        assert same + texts == [True] * len(table.columns), file.stem


def test_units_are_in_the_metadata_of_columns_and_the_run_in_those_of_the_file(exported: Path) -> None:
    schema = pyarrow.parquet.read_schema(exported / "parquet" / "readings.parquet")
    assert schema.field("speed").metadata == {b"unit": b"m/s", b"description": b"along the heading"}
    assert schema.field("heading").metadata[b"unit"] == b"rad"
    assert b"unit" not in schema.field("robot").metadata
    facts = json.loads(schema.metadata[b"sleepcast"])
    assert (facts["scenario"], facts["seed"], facts["robots"], facts["seconds"]) == ("yard", 3, 3, 10.0)
    package = json.loads((exported / "csv" / "datapackage.json").read_text(encoding="utf-8"))
    assert package["sleepcast"] == facts
    (readings,) = [each for each in package["resources"] if each["name"] == "readings"]
    fields = {field["name"]: field for field in readings["schema"]["fields"]}
    assert fields["speed"] == {"name": "speed", "type": "number", "unit": "m/s", "description": "along the heading"}
    assert package["name"] == "csv"


def test_csv_is_what_other_programs_expect(exported: Path) -> None:
    text = (exported / "csv" / "marks.csv").read_bytes()
    assert b"\r" not in text
    assert text.decode().split("\n")[-2] == "10.0,scout3,,,0,true,false,false,false,false,false"
    with (exported / "csv" / "commands.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert rows[1]["text"] == '(WHEN (IN east) (RULE roll (DRIVE 0.5m/s 10deg/s)) (TK "off we go"))'
    poses = polars.read_csv(exported / "csv" / "poses.csv")
    assert all(len(text) <= 13 for text in poses["x"].cast(polars.String)), "no digits of a precision that is not there"


def test_unknown_is_empty_or_null(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        one_picture(recorder)
        recorder.note(READINGS, 0.0, {"x": [1.5, None, 3.0]})

    recording = recorded(tmp_path, fill)
    for to in ("csv", "parquet"):
        export_recording(recording, to, tmp_path / to)
    assert (tmp_path / "csv" / "readings.csv").read_text(encoding="utf-8") == (
        "time,robot,x\n0.0,left-1,1.5\n0.0,left_1,\n0.0,3ö,3.0\n"
    )
    assert polars.read_parquet(tmp_path / "parquet" / "readings.parquet")["x"].to_list() == [1.5, None, 3.0]


def test_parquet_is_written_in_groups_of_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that memory is bounded by a group."""
    monkeypatch.setattr(table_files, "ROWS", 7)

    def fill(recorder: Recorder) -> None:
        for tick in range(20):
            one_picture(recorder, 0.1 * tick)

    export_recording(recorded(tmp_path, fill), "parquet", tmp_path / "out")
    file = pyarrow.parquet.ParquetFile(tmp_path / "out" / "poses.parquet")
    sizes = [file.metadata.row_group(number).num_rows for number in range(file.num_row_groups)]
    assert (sum(sizes), max(sizes)) == (60, 9)
    np.testing.assert_array_equal(file.read()["time"].to_numpy(), np.repeat(np.round(np.arange(20) * 0.1, 9), 3))


def test_without_pyarrow_a_sentence_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"pyarrow, which is not here; to install it: .*--to csv has the same"):
        ParquetWriter(tmp_path / "out", {})
    assert not (tmp_path / "out").exists()
