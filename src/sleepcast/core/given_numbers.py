"""Numbers that programs give: seeds, counts, seconds. Every type of number means its value, and nothing else does, but
for times, which may also be texts with their units.

A seed is hashed by its text, so NumPy's 7, written `np.uint64(7)`, would be another seed than 7 if it were stored.
"""

from __future__ import annotations

from math import inf
from operator import index

from sleepcast.core.errors import MisuseError
from sleepcast.core.quantities import QuantityError, measure_of
from sleepcast.core.units import TIME

MAX_SEED = 2**63 - 1
"""The largest seed: on the command line, in files and in Python."""


def whole_number(value: object, what: str, low: int, high: int) -> int:
    """`value`, of any integer type, as a plain int from `low` to `high`. what: it is, for the error. Raises MisuseError
    for anything else: a text, a float and a truth value are no whole numbers."""
    try:
        number = None if isinstance(value, bool) else index(value)  # type: ignore[arg-type]  # that is the question
    except TypeError:
        number = None
    if number is None or not low <= number <= high:
        raise MisuseError(f"{what} {_shown(value)}: wanted a whole number from {low} to {high}")
    return number


def read_seed(value: object) -> int:
    """A seed as a plain int: equal ones give equal runs, whatever their types. Raises MisuseError."""
    return whole_number(value, "seed", 0, MAX_SEED)


def read_seconds(value: object, what: str, high: float = inf) -> float:
    """A time as a float, s, from 0 to `high`: of any number type, or a text with its unit, such as "30s". what: it is,
    for the error. Raises MisuseError."""
    given = in_seconds(value, what) if isinstance(value, str) else value
    try:
        seconds = -1.0 if isinstance(given, bytes | bool) else float(given)  # type: ignore[arg-type]  # as above
    except (TypeError, ValueError, OverflowError):
        seconds = -1.0
    if not 0.0 <= seconds <= high or seconds == inf:
        most = "0 or more" if high == inf else f"from 0 to {high:g}"
        raise MisuseError(f'{what} {_shown(value)}: wanted a number of seconds, {most}, or a text such as "30s"')
    return seconds


def in_seconds(value: float | str, what: str) -> float:
    """A time as a text with its unit, such as "30s", in s; a number as it is. what: it is, for the error. Raises
    MisuseError for a text that says no time."""
    if not isinstance(value, str):
        return value
    try:
        measure = measure_of(value, TIME, 0.0)
    except QuantityError as error:
        raise MisuseError(f"{what} {_shown(value)}: {error}") from error
    if not measure.unit:
        raise MisuseError(
            f'{what} {_shown(value)}: wanted a number of seconds, 0 or more, or a text with its unit, such as "30s"'
        )
    return measure.value


def _shown(value: object) -> str:
    return (repr(value) if isinstance(value, str | bytes) else str(value))[:40]
