"""An index of names: the names of many parties by place, and their places by name.

Numbered names (`scout1` to `scout1000000`) are made on demand; stored, they would take more memory than the robots'
minds.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import overload


class NameIndex(Sequence[str]):
    """`count` numbered names (`prefix` and a number from 1), and then those in `listed`. More can be added."""

    def __init__(self, listed: Iterable[str] = (), *, prefix: str = "", count: int = 0) -> None:
        self._prefix, self._count = prefix, count
        self._listed: list[str] = []
        self._places: dict[str, int] = {}
        for name in listed:
            self.add(name)

    def add(self, name: str) -> int:
        """The place of a name; a new name gets the next one."""
        place = self.place(name)
        if place is None:
            place = self._places[name] = len(self)
            self._listed.append(name)
        return place

    def place(self, name: str) -> int | None:
        """The place of a name; None if it is not in the index."""
        digits = name.removeprefix(self._prefix)
        if name.startswith(self._prefix) and digits.isascii() and digits.isdigit() and digits[0] != "0":
            number = int(digits) if len(digits) <= len(str(self._count)) else 0
            if 0 < number <= self._count:
                return number - 1
        return self._places.get(name)

    def copy(self) -> NameIndex:
        """A copy, to which other names may be added."""
        return NameIndex(self._listed, prefix=self._prefix, count=self._count)

    def __len__(self) -> int:
        return self._count + len(self._listed)

    @overload
    def __getitem__(self, place: int) -> str: ...

    @overload
    def __getitem__(self, place: slice) -> tuple[str, ...]: ...

    def __getitem__(self, place: int | slice) -> str | tuple[str, ...]:
        if isinstance(place, slice):
            return tuple(self[i] for i in range(*place.indices(len(self))))
        if place < 0:
            place += len(self)
        if not 0 <= place < len(self):
            raise IndexError(place)
        return f"{self._prefix}{place + 1}" if place < self._count else self._listed[place - self._count]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self.place(name) is not None


_NUMBERS = re.compile(r"(\d+)")


def natural_order(name: str) -> list[tuple[int, str]]:
    """A sort key by which r2 comes before r10."""
    parts = _NUMBERS.split(name)
    return [(int(part[:18]) if at % 2 else 0, part) for at, part in enumerate(parts)]
