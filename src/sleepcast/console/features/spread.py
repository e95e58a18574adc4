"""The number that is being dragged, and what it is compared with: how the values lie over the robots.

A number in a test is a threshold for some quantity, as 50% is for fuel in `(> fuel 50%)`. The page shows how that
quantity is spread over all robots, and over those for whom this comparison decides: they would obey if it held, and
would not if it did not.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple, Protocol

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import PageMessage, Serial, Text
from sleepcast.console.outgoing import DeskMessage
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.units import UNITS
from sleepcast.language.reader import Form, List, Number, brief, read, walk
from sleepcast.station import Station

BINS = 48
"""Columns of a histogram: as many as can be told apart in a small picture."""
COMPARISONS = frozenset({"<", "<=", ">", ">=", "=", "/=", "eq"})


class GetSpread(PageMessage, tag="spread"):
    """How what a number is compared with is spread over the robots; at: where the number begins in the text."""

    serial: Serial
    text: Text
    at: Annotated[int, Meta(ge=0, le=16_384)]


class Spread(DeskMessage):
    """How a quantity is spread, in the unit of the number it is compared with.

    low, high: the ends of the columns
    every, deciding: robots in each
    whole: whether it has whole values only
    unknown: robots that do not know it
    """

    serial: int
    quantity: str
    unit: str
    low: float
    high: float
    every: list[int]
    deciding: list[int]
    whole: bool = False
    unknown: int = 0


class Compared(NamedTuple):
    """A number, the comparison in which it stands, and what it is compared with."""

    number: Number
    comparison: List
    quantity: Form


def compared(text: str, at: int) -> Compared:
    """The comparison of the number that begins at an offset. Raises ReadError, and MisuseError if there is none."""
    for form in walk(read(text)):
        if not isinstance(form, List) or form.head not in COMPARISONS:
            continue
        for index, item in enumerate(form.items[1:], 1):
            if isinstance(item, Number) and item.start == at:
                beside = [form.items[near] for near in (index - 1, index + 1) if 1 <= near < len(form.items)]
                quantity = next((each for each in beside if not isinstance(each, Number)), None)
                if quantity is not None:
                    return Compared(item, form, quantity)
    raise MisuseError("this number is compared with nothing that robots know")


class SpreadSource(Protocol):
    """Who can evaluate and preview texts."""

    @property
    def station(self) -> Station: ...


@answers(then=run_again)
def spread(source: SpreadSource, asked: GetSpread) -> Spread:
    """The histogram for the number at an offset of a text. Raises ReadError, CheckError, and MisuseError for a number
    that is compared with nothing, or with what only the robots themselves can say."""
    station, text = source.station, asked.text
    number, comparison, quantity = compared(text, asked.at)
    values, _ = station.values(text[quantity.start : quantity.end])
    factor = UNITS[number.unit].factor if number.unit else 1.0
    known = ~np.isnan(values)
    if not known.any():
        raise MisuseError(f"no robot has told {brief(quantity, text)}")
    measured = values[known] / factor
    low, high, whole, columns = _ends(measured)
    decides = _deciding(station, text, comparison)[known]
    every, deciding = (np.histogram(each, columns, (low, high))[0] for each in (measured, measured[decides]))
    unknown, name = len(values) - len(measured), brief(quantity, text)
    return Spread(asked.serial, name, number.unit, low, high, every.tolist(), deciding.tolist(), whole, unknown)


def _ends(values: NDArray[np.float64]) -> tuple[float, float, bool, int]:
    """The ends of the columns, whether all values are whole numbers, and how many columns there are."""
    low, high = float(values.min()), float(values.max())
    whole = bool((values == np.round(values)).all())
    if whole and high - low < BINS:
        return low - 0.5, high + 0.5, True, int(high - low) + 1
    if low == high:
        room = 0.05 * abs(low) or 1.0
        return low - room, high + room, whole, BINS
    return low, high, whole, BINS


def _deciding(station: Station, text: str, comparison: List) -> NDArray[np.bool_]:
    """For whom the outcome depends on this comparison; everybody if that cannot be told."""
    before, after = text[: comparison.start], text[comparison.end :]
    try:
        if_true, if_false = (station.preview(f"{before}{word}{after}") for word in ("TRUE", "FALSE"))
    except SleepcastError:  # the rest of the text is not right yet
        return np.ones(len(station.names), np.bool_)
    differs: NDArray[np.bool_] = if_true.codes != if_false.codes
    return differs
