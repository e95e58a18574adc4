"""The fleet at a glance: for what these robots sense first, the least, the middle and the greatest value over all."""

from __future__ import annotations

from math import floor, inf, log10
from typing import Protocol

import msgspec
import numpy as np

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage, ShownReport
from sleepcast.console.values import Index, Values, places_of
from sleepcast.core.angles import quantile
from sleepcast.core.units import value_in_words

POSE = ("x", "y", "heading")
"""The map shows these better than any number,"""
OF_PLACES = ("_x", "_y")
"""and where places are, which robots are told under such names."""
DIGITS = 3
"""Of the largest of the three values that stand in one row: more do not fit there, and nobody compares them."""
MAX_LATEST = 5
"""Reports that are shown."""


class RobotReport(ShownReport, frozen=True):
    """A report with the name of its robot."""

    robot: str


class ShownQuantity(msgspec.Struct, frozen=True):
    """A quantity with its unit. shown: least, median and greatest value, as people read them; none where no robot knows
    it. unknown: robots that do not know it."""

    name: str
    shown: list[str]
    unknown: int = 0


class GetGlance(PageMessage, tag="glance"):
    """What the fleet is like now: quantities over all robots, and what they reported last."""

    serial: Serial


class Glance(DeskMessage):
    """The fleet at a glance."""

    serial: int
    quantities: list[ShownQuantity]
    reports: list[RobotReport]


class GlanceSource(Protocol):
    """Whose values and reports are known."""

    @property
    def values(self) -> Values: ...

    def latest_reports(self, most: int) -> list[tuple[str, ShownReport]]:
        """The latest reports, newest first, each with the name of its robot."""


@answers(then=run_again)
def glance(source: GlanceSource, asked: GetGlance) -> Glance:
    """The quantities that a table shows at first, over all robots."""
    values = source.values
    names = [name for name in values.suggested() if name not in POSE and not name.endswith(OF_PLACES)]
    places = places_of(values.names)
    latest = [RobotReport(report.at, report.text, name) for name, report in source.latest_reports(MAX_LATEST)]
    return Glance(asked.serial, [_over(values, name, places) for name in names], latest)


def _over(values: Values, name: str, places: Index) -> ShownQuantity:
    """Least, median and greatest of a quantity, nothing where it is unknown everywhere."""
    column, quantity = values.of(name, places)[0], values.checked(name)
    known = column[~np.isnan(column)]
    numbers: list[float] = []
    if known.size and quantity.is_angle:
        numbers = [quantile(known, share) for share in (0.0, 0.5, 1.0)]
    elif known.size:
        numbers = [float(known.min()), float(np.median(known)), float(known.max())]
    shown = [value_in_words(number, quantity.unit) for number in side_by_side(numbers)]
    return ShownQuantity(name, shown, column.size - known.size)


def side_by_side(numbers: list[float]) -> list[float]:
    """Numbers as they are read beside each other: to three digits of the largest, but to whole ones at least."""
    largest = max(map(abs, numbers), default=0.0)
    if not 0.0 < largest < inf:
        return numbers
    places = max(0, DIGITS - 1 - floor(log10(largest)))
    return [round(number, places) + 0.0 for number in numbers]  # never -0
