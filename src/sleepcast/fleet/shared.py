"""Shared: values that are stored once for all robots of a fleet that have equal ones, such as whose orders count."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.rows import Mask, Rows, distinct
from sleepcast.core.arrays import filled
from sleepcast.core.serial import SerialError, within

Value = TypeVar("Value")
SPARE = 16
"""Values that no robot has any more, and that may accumulate."""


def _itself(value: object) -> Hashable:
    return value


class Shared(Generic[Value]):
    """The values of `count` robots, `first` at first. key: is equal for equal values.

    Values never change; `change` gives robots others. While all robots have the same value there is no array.
    """

    def __init__(self, count: int, first: Value, key: Callable[[Value], Hashable] = _itself) -> None:
        self._count, self._key = count, key
        self._used = 1
        """Values in use when last counted."""
        self._all_have(first)

    def _all_have(self, value: Value) -> None:
        self.values = [value]
        """Those that robots have, and perhaps some that none has any more."""
        self._numbers = {self._key(value): 0}
        self._column: NDArray[np.int32] | None = None
        """Index of each robot's value; None: all have the only one."""

    def of(self, robot: int) -> Value:
        """The value of one robot."""
        return self.values[0 if self._column is None else int(self._column[robot])]

    def divide(self, rows: Rows) -> list[tuple[Value, Rows, Mask | None]]:
        """Group the rows by their values; each group with its places (None: all)."""
        if rows.size == 0:
            return []
        if self._column is None:
            return [(self.values[0], rows, None)]
        numbers = self._column[rows.index]
        present = distinct(numbers)[0].tolist()
        if len(present) == 1:
            return [(self.values[present[0]], rows, None)]
        masks = [numbers == number for number in present]
        return [(self.values[number], rows.take(mask), mask) for number, mask in zip(present, masks, strict=True)]

    def where(self, rows: Rows, holds: Callable[[Value], bool]) -> Rows:
        """Those of the rows for whose values `holds` is true."""
        if self._column is None:
            return rows if holds(self.values[0]) else rows.none()
        truths = np.array([holds(value) for value in self.values])
        return rows.take(truths[self._column[rows.index]])

    def change(self, rows: Rows, how: Callable[[Value], Value]) -> None:
        """Replace the values of these robots."""
        for value, some, _ in self.divide(rows):
            changed = how(value)
            if changed is not value:
                self.set(some, changed)

    def set(self, rows: Rows, value: Value) -> None:
        """Give these robots this value."""
        if rows.size == 0:
            return
        if rows.size == self._count:
            self._all_have(value)
            return
        number = self._numbers.setdefault(self._key(value), len(self.values))
        if number == len(self.values):
            self.values.append(value)
        if self._column is None:
            if number == 0:
                return
            self._column = filled(0, np.int32, self._count)
        self._column[rows.index] = number
        if len(self.values) > 2 * self._used + SPARE:  # forget those that no robot has any more
            numbers, self._column[:] = np.unique(self._column, return_inverse=True)
            self.values = [self.values[number] for number in numbers.tolist()]
            self._numbers = {self._key(value): number for number, value in enumerate(self.values)}
            self._used = len(self.values)

    @property
    def column(self) -> NDArray[np.int32]:
        """The index of each robot's value in `values`."""
        return np.zeros(self._count, np.int32) if self._column is None else self._column

    def restore(self, values: Sequence[Value], column: NDArray[np.int32]) -> None:
        """Restore values, and the index of each robot's. Raises SerialError for an index of none."""
        if not values:
            raise SerialError("robots without a value that each of them has")
        within(column, 0, len(values) - 1, "the values of robots")
        self._all_have(values[0])
        if len(values) == 1:
            return
        self.values, self._column = list(values), column
        self._numbers = {self._key(value): number for number, value in reversed(list(enumerate(values)))}
