"""Plain parts: numbers, variables, functions of numbers and tests, which change nothing and leave nothing to chance.

They are computed for all rows at once, also for those robots that would not come to them, because picking out the
others costs more than computing; a mask says who really comes to a part, and only those can meet a fault there.
The columns that come out may be views of a robot's variables: they are read, never written.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from sleepcast.fleet import pure
from sleepcast.fleet.columns import Column, Index, Mask, Rows, is_true
from sleepcast.language.parts import Part, walk

_PLAIN = frozenset({"const", "var", "local", "absent", "pure", "and", "or", "known"})
_COSTLY = frozenset({"^", "EXP", "LOG", "SIN", "COS", "TAN", "ATAN2", "BEARING"})

Local = Callable[[int, Rows], Column]
Faults = Callable[[Part, Rows, Index, Sequence[str]], None]


@lru_cache(maxsize=4_096)
def is_plain(part: Part) -> bool:
    """Whether `part` is plain throughout, and cheap enough to be computed for nothing."""
    return all(
        inside.op in _PLAIN and not inside.watch and not (inside.op == "pure" and inside.function.name in _COSTLY)
        for inside in walk(part)
    )


def _is_test(part: Part) -> bool:
    """Whether a part is a comparison of two, such as never holds if either is unknown."""
    return part.op == "pure" and len(part.parts) == 2 and part.function.name in pure.TESTS


class Plain:
    """Plain parts of some rows. read: a variable by slot; local: a local name; faults: notes some."""

    def __init__(self, rows: Rows, read: Callable[[int, Rows], Column | float], local: Local, faults: Faults) -> None:
        self._rows, self._read, self._local, self._faults = rows, read, local, faults

    def value(self, part: Part, mask: Mask | None) -> pure.Argument:
        """The values of a part. mask: the rows that come to it, None for all; the others' values mean nothing."""
        match part.op:
            case "const":
                return part.number
            case "var":
                return self._read(part.slot, self._rows)
            case "local":
                return self._local(part.slot, self._rows)
            case "absent":
                return np.nan
            case "known":
                return np.where(np.isnan(self.value(part.parts[0], mask)), 0.0, 1.0)
            case "and":
                return self._and(part, mask)
            case "or":
                return self._or(part, mask)
            case _:
                return self._pure(part, mask)

    def column(self, part: Part) -> Column:
        """The values of a part that all rows come to, not a view of anything."""
        if part.op == "pure":
            return self._pure(part, None)
        return np.array(np.broadcast_to(self.value(part, None), self._rows.size))

    def truth(self, part: Part, mask: Mask | None) -> Mask:
        """Where a part is true, of the rows that come to it."""
        if _is_test(part):
            first, second = (self.value(inside, mask) for inside in part.parts)
            return self._mask(pure.TESTS[part.function.name](first, second))
        if part.op == "and":
            found: Mask | None = None
            for inside in part.parts:
                open_rows = mask if found is None else found if mask is None else found & mask
                true = self.truth(inside, open_rows)
                found = true if found is None else found & true
            return self._mask(True) if found is None else found
        return self._mask(is_true(self.value(part, mask)))

    def _mask(self, found: object) -> Mask:
        return np.broadcast_to(np.asarray(found, np.bool_), self._rows.size)

    def _and(self, part: Part, mask: Mask | None) -> pure.Argument:
        if len(part.parts) > 1 and all(map(_is_test, part.parts)):
            return self._all_hold(part, mask)
        found: pure.Argument = 1.0
        for place, inside in enumerate(part.parts):
            if place == 0:
                found = self.value(inside, mask)
                continue
            true = is_true(found)
            found = np.where(true, self.value(inside, true if mask is None else true & mask), found)
        return found

    def _all_hold(self, part: Part, mask: Mask | None) -> Column:
        """AND of comparisons of two, the usual predicate: 1 where all hold, unknown where the first not to hold is."""
        holding = unknown = None
        for inside in part.parts:
            come = mask if holding is None else holding if mask is None else holding & mask
            numbers = [self.value(each, come) for each in inside.parts]
            for number in numbers:
                missing = np.isnan(number)
                if missing.any():
                    missing = missing if holding is None else missing & holding
                    unknown = missing if unknown is None else unknown | missing
            holds = pure.TESTS[inside.function.name](*numbers)
            holding = holds if holding is None else holding & holds
        found: Column = np.asarray(holding, np.float64)
        return found if unknown is None else np.where(unknown, np.nan, found)

    def _or(self, part: Part, mask: Mask | None) -> pure.Argument:
        found: pure.Argument = 0.0
        unknown: Mask | bool = False
        for place, inside in enumerate(part.parts):
            false = ~is_true(found)
            come = mask if place == 0 else false if mask is None else false & mask
            found = np.where(false, self.value(inside, come), found)
            unknown = unknown | np.isnan(found)
        return np.where(is_true(found), found, np.where(unknown, np.nan, 0.0))

    def _pure(self, part: Part, mask: Mask | None) -> Column:
        def report(places: Index, reasons: Sequence[str]) -> None:
            if mask is not None:
                come = np.broadcast_to(mask, self._rows.size)[places]
                places, reasons = places[come], [reason for reason, met in zip(reasons, come, strict=True) if met]
            self._faults(part, self._rows, places, reasons)

        return pure.apply(part, [self.value(inside, mask) for inside in part.parts], self._rows.size, report)
