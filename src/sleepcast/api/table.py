"""A table of columns that every data frame library takes as it is, by Arrow's C interface.

https://arrow.apache.org/docs/format/CDataInterface/PyCapsuleInterface.html: `pandas.DataFrame.from_arrow`,
`polars.DataFrame`, `pyarrow.table` and DuckDB call `__arrow_c_stream__`, and share the memory of the numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.columns import column_name
from sleepcast.core.errors import MisuseError, did_you_mean

Texts: TypeAlias = Sequence[str]
Numbers: TypeAlias = NDArray[np.float64] | NDArray[np.int64]
SHOWN = 10
"""Rows that are shown of a table."""


class DataTable:
    """Columns of equal length by name: texts, or numbers, of which NaN is unknown (in Arrow: null)."""

    def __init__(self, columns: Mapping[str, Texts | Numbers]) -> None:
        if len({len(column) for column in columns.values()}) > 1:
            raise ValueError("the columns of a table have the same length")
        self.columns = dict(columns)

    @classmethod
    def keyed(cls, keys: Mapping[str, Texts | Numbers], values: Mapping[str, Texts | Numbers]) -> DataTable:
        """Key columns, then values by expression; one that is called like a key is the column `<name>_value`."""
        columns = dict(keys)
        for name, column in values.items():
            columns[column_name(name, columns)] = column
        return cls(columns)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __getitem__(self, name: str) -> Texts | Numbers:
        """A column. Raises MisuseError for one that is not there."""
        if name not in self.columns:
            names = list(self.columns)
            raise MisuseError(f'no column "{name}"{did_you_mean(str(name), names)}: wanted one of {", ".join(names)}')
        return self.columns[name]

    def to_dict(self) -> dict[str, list[str | float | int | None]]:
        """Lists by column; None for unknown."""
        return {name: _plain(column) for name, column in self.columns.items()}

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The table as an Arrow stream of one batch. Numbers are not copied."""
        from nanoarrow import Schema, Type, c_array_from_buffers
        from nanoarrow.c_array_stream import CArrayStream

        fields, children = {}, []
        for name, column in self.columns.items():
            if isinstance(column, np.ndarray):
                kind = Schema(Type.DOUBLE if column.dtype == np.float64 else Type.INT64)
                buffers = [_known(column), np.ascontiguousarray(column)]
            else:
                kind, buffers = Schema(Type.LARGE_STRING), [None, *_packed(column)]
            fields[name] = kind
            children.append(c_array_from_buffers(kind, len(self), buffers))
        whole = c_array_from_buffers(Schema(Type.STRUCT, fields=fields), len(self), [None], children=children)
        return CArrayStream.from_c_arrays([whole], whole.schema).__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        rows = [list(self.columns), *self._rows()]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        return "\n".join([*lines, *self._more()])

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(name)}</th>" for name in self.columns)
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in self._rows())
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        more = "".join(f"<p>{escape(line)}</p>" for line in self._more())
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"

    def _rows(self) -> list[list[str]]:
        """The first rows, in words."""
        cells = [[_shown(each) for each in _plain(column[:SHOWN])] for column in self.columns.values()]
        return [list(row) for row in zip(*cells, strict=True)]

    def _more(self) -> list[str]:
        return [f"... {len(self) - SHOWN:,} more rows"] if len(self) > SHOWN else []


def _plain(column: Texts | Numbers) -> list[str | float | int | None]:
    if not isinstance(column, np.ndarray):
        return list(column)
    return [None if each != each else each for each in column.tolist()]


def _shown(cell: str | float | int | None) -> str:
    return "" if cell is None else cell if isinstance(cell, str) else f"{cell:.6g}"


def _known(column: Numbers) -> bytes | None:
    """Arrow's bitmap of what is known, None for all: a bit a row, the lowest first."""
    unknown = np.isnan(column)
    return np.packbits(~unknown, bitorder="little").tobytes() if unknown.any() else None


def _packed(texts: Texts) -> tuple[NDArray[np.int64], bytes]:
    """Where each text begins and the last one ends, and all of them in UTF-8."""
    encoded = [text.encode() for text in texts]
    ends = np.zeros(len(encoded) + 1, np.int64)
    np.cumsum([len(text) for text in encoded], out=ends[1:])
    return ends, b"".join(encoded)
