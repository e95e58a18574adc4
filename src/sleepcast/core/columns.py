"""Names of columns: what a table is keyed by keeps its name, whatever robots call their variables."""

from __future__ import annotations

from collections.abc import Container


def column_name(name: str, taken: Container[str]) -> str:
    """`name`, or where a column is called so already, the name with `_value` behind it."""
    while name in taken:
        name += "_value"
    return name
