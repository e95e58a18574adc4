"""Tables as files: CSV, with their columns and units in `datapackage.json` beside them, and Parquet, with units in the
metadata of each column and what describes the run in those of each file.

Rows are written in groups, so that memory is bounded by a group, and not by the recording.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.exporting.tables import TABLE_NAMES, CellType, ExportColumn, ExportTable, Values

ROWS = 65_536
"""Rows of a Parquet file that are written together: some megabytes of each table."""
PACKAGE = "datapackage.json"
CSV_FILES = frozenset({PACKAGE, *(f"{name}.csv" for name in TABLE_NAMES)})
PARQUET_FILES = frozenset(f"{name}.parquet" for name in TABLE_NAMES)


class MissingExtraError(MisuseError):
    """A library that is needed is not installed."""


class CsvWriter:
    """A folder of CSV files, UTF-8, with the names of columns in the first line: the tables of a Data Package
    (https://datapackage.org). facts: what describes the run."""

    def __init__(self, folder: Path, name: str, facts: Mapping[str, object]) -> None:
        folder.mkdir()
        self._folder, self._name, self._facts = folder, name, facts
        self._open = ExitStack()
        self._rows: dict[str, Any] = {}
        self._types: dict[str, list[CellType]] = {}
        self._resources: list[dict[str, object]] = []

    def begin(self, table: ExportTable) -> None:
        file = self._open.enter_context((self._folder / f"{table.name}.csv").open("w", newline="", encoding="utf-8"))
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([column.name for column in table.columns])
        self._rows[table.name], self._types[table.name] = writer, [column.type for column in table.columns]
        self._resources.append(_resource(table))

    def add(self, table: str, columns: Sequence[Values]) -> None:
        cells = map(_cells, columns, self._types[table])
        self._rows[table].writerows(zip(*cells, strict=True))

    def close(self) -> None:
        """Write what is left, and what the columns are. Raises OSError."""
        self._open.close()
        package = {
            "$schema": "https://datapackage.org/profiles/2.0/datapackage.json",
            "name": re.sub(r"[^a-z0-9._-]+", "-", self._name.lower()) or "run",
            "sleepcast": self._facts,
            "resources": self._resources,
        }
        (self._folder / PACKAGE).write_text(json.dumps(package, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")

    def __enter__(self) -> CsvWriter:
        return self

    def __exit__(self, *ended: object) -> None:
        self._open.close()


def _resource(table: ExportTable) -> dict[str, object]:
    """A table as a Data Package describes it; `unit` is an addition of ours, which the standard allows."""
    return {
        "name": table.name,
        "path": f"{table.name}.csv",
        "type": "table",
        "format": "csv",
        "mediatype": "text/csv",
        "encoding": "utf-8",
        "description": table.about,
        "schema": {"fields": [_field(column) for column in table.columns], "missingValues": [""]},
    }


def _field(column: ExportColumn) -> dict[str, str]:
    kind = CellType.NUMBER if column.type is CellType.SINGLE else column.type
    return {"name": column.name, "type": kind.value, **_about(column)}


def _about(column: ExportColumn) -> dict[str, str]:
    told = {"unit": column.unit, "description": column.about}
    return {key: text for key, text in told.items() if text}


def _cells(values: Values, kind: CellType) -> Iterable[object]:
    """Values as CSV has them: empty for unknown, and numbers as short as they are exact."""
    if kind is CellType.TEXT:
        return values
    array = np.asarray(values)
    if kind is CellType.TRUTH:
        return ["true" if value else "false" for value in array.tolist()]
    if kind is CellType.SINGLE:
        return ["" if value == "nan" else value for value in array.astype(np.float32).astype("U32").tolist()]
    return ["" if value != value else value for value in array.tolist()]


class ParquetWriter:
    """A folder of Parquet files. facts: what describes the run. Raises MissingExtraError."""

    def __init__(self, folder: Path, facts: Mapping[str, object]) -> None:
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError as error:
            raise MissingExtraError(
                f"Parquet is written with pyarrow, which is not here; to install it: {installing('parquet')}. "
                "Without it, --to csv has the same tables"
            ) from error
        folder.mkdir()
        self._arrow, self._parquet = pyarrow, pyarrow.parquet
        self._folder, self._facts = folder, {"sleepcast": json.dumps(facts)}
        self._types = {
            CellType.TEXT: pyarrow.string(),
            CellType.WHOLE: pyarrow.int64(),
            CellType.SINGLE: pyarrow.float32(),
            CellType.NUMBER: pyarrow.float64(),
            CellType.TRUTH: pyarrow.bool_(),
        }
        self._open = ExitStack()
        self._files: dict[str, Any] = {}
        self._waiting: dict[str, list[Any]] = {}
        self._rows: dict[str, int] = {}

    def begin(self, table: ExportTable) -> None:
        fields = [
            self._arrow.field(column.name, self._types[column.type], metadata=_about(column))
            for column in table.columns
        ]
        schema = self._arrow.schema(fields, metadata=self._facts | {"description": table.about})
        file = self._parquet.ParquetWriter(self._folder / f"{table.name}.parquet", schema, compression="zstd")
        self._files[table.name] = self._open.enter_context(file)
        self._waiting[table.name], self._rows[table.name] = [], 0

    def add(self, table: str, columns: Sequence[Values]) -> None:
        schema = self._files[table].schema
        arrays = [
            self._arrow.array(values, type=field.type, from_pandas=True)  # which makes NaN null
            for values, field in zip(columns, schema, strict=True)
        ]
        self._waiting[table].append(self._arrow.RecordBatch.from_arrays(arrays, schema=schema))
        self._rows[table] += len(columns[0])
        if self._rows[table] >= ROWS:
            self._write(table)

    def close(self) -> None:
        """Write what is left. Raises OSError."""
        for table in self._files:
            self._write(table)
        self._open.close()

    def _write(self, table: str) -> None:
        batches, self._waiting[table], self._rows[table] = self._waiting[table], [], 0
        if batches:
            self._files[table].write_table(self._arrow.Table.from_batches(batches))

    def __enter__(self) -> ParquetWriter:
        return self

    def __exit__(self, *ended: object) -> None:
        self._open.close()
