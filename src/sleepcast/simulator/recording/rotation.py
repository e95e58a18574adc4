"""Recordings in parts: when one file ends and the next begins, and what they are called.

    run.mcap, run-0002.mcap, run-0003.mcap, ...

Each part can be read by itself; see `recorder`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf
from pathlib import Path

from sleepcast.core.errors import MisuseError
from sleepcast.core.units import UNITS

LEAST_BYTES, MOST_BYTES = 1e5, 1e12
"""A part: smaller ones hold little but what each begins with, and no disk is larger."""
LEAST_SECONDS, MOST_SECONDS = 1.0, 1e9
MOST_PARTS = 9_999
"""What four digits number; the last part goes on to the end."""

_BYTES = {"kb": 1e3, "mb": 1e6, "gb": 1e9}
_TIMES = ("s", "min", "h")
_PIECE = re.compile(r"(\d{1,9}(?:\.\d{1,9})?)([a-z]+)")


@dataclass(frozen=True, slots=True)
class Rotation:
    """When a part is full. size: bytes of its file; age: simulated s; whichever comes first."""

    size: float = inf
    age: float = inf


ONE_FILE = Rotation()
"""Never full."""


def read_rotation(text: str) -> Rotation:
    """`100MB`, `10min` of simulated time, or both: `100MB,10min`. Raises MisuseError."""
    found = {"size": inf, "age": inf}
    for piece in text.lower().split(","):
        match = _PIECE.fullmatch(piece.strip())
        if match is not None and match[2] in _BYTES:
            kind, value, least, most = "size", float(match[1]) * _BYTES[match[2]], LEAST_BYTES, MOST_BYTES
        elif match is not None and match[2] in _TIMES:
            kind, value = "age", float(match[1]) * UNITS[match[2]].factor
            least, most = LEAST_SECONDS, MOST_SECONDS
        else:
            raise MisuseError(f'"{piece[:40]}" says not when to begin another file: write 100MB, 10min, or 100MB,10min')
        if not least <= value <= most:
            unit = "bytes" if kind == "size" else "s"
            raise MisuseError(f"{piece.strip()}: another file begins after {least:g} to {most:g} {unit}, not {value:g}")
        found[kind] = min(found[kind], value)
    return Rotation(**found)


def part_file(first: Path, number: int) -> Path:
    """The file of the part with this number, from 1, where the first one is `first`."""
    return first if number == 1 else first.with_name(f"{first.stem}-{number:04}{first.suffix}")
