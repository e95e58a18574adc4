"""The fields of a simulated world, as the map shows them."""

from __future__ import annotations

from math import floor, log10, pi

import numpy as np

from sleepcast.console.view import FieldPicture, ShownField
from sleepcast.core.units import value_in_words
from sleepcast.simulator import Scenario, Simulator
from sleepcast.simulator.bodies.field_map import FieldMap, coarse, still_map
from sleepcast.simulator.scenario.fields import Field, ScalarField
from sleepcast.simulator.world.world import World

MAX_CELLS = 128
"""Cells along the longer side of a map: 16 kilobytes at most, or twice as many where it has directions."""
MAX_DIGITS = 17
"""A number of the machine has no more."""
NOTHING = 1e-9
"""Of the most that a cell may have: a field that dies away comes ever nearer to 0, and is shown as empty below this."""


def shown_fields(scenario: Scenario) -> tuple[ShownField, ...]:
    """The fields of a scenario."""
    return tuple(ShownField(field.name, field.about, _grows(field)) for field in scenario.fields)


def still_picture(scenario: Scenario, name: str, world: World | None = None) -> FieldPicture:
    """A field that does not grow, or how one that does began. world: see `still_map`."""
    field = next(each for each in scenario.fields if each.name == name)
    return _picture(still_map(field, scenario, MAX_CELLS, world), field)


class FieldPictures:
    """The fields of a simulated world as they are now; those that do not grow are drawn once for all walls that do
    not move."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._still: dict[str, FieldPicture] = {}
        self._world_version = simulator.world.version

    def of(self, name: str) -> FieldPicture:
        """One of them, by its name."""
        amount, scenario = self._simulator.senses.amount(name), self._simulator.scenario
        if amount is not None:
            return _picture(coarse(amount, MAX_CELLS), next(each for each in scenario.fields if each.name == name))
        world = self._simulator.world
        if self._world_version != world.version:
            self._world_version = world.version
            self._still.clear()
        if name not in self._still:
            self._still[name] = still_picture(scenario, name, world)
        return self._still[name]


def _grows(field: Field) -> bool:
    return isinstance(field, ScalarField) and field.growth is not None


def _picture(field_map: FieldMap, field: Field) -> FieldPicture:
    low, high = float(field_map.values.min()), float(field_map.values.max())
    growth = field.growth if isinstance(field, ScalarField) else None
    if growth is not None or field_map.angles is not None:
        low = 0.0
    if growth is not None:  # so that colours keep their meaning for a while
        high = round_above(high if high > NOTHING * growth.most else 0.0)
    part = (field_map.values - low) / (high - low) if high > low else np.zeros_like(field_map.values)
    rows, columns = field_map.values.shape
    angles = (
        b"" if field_map.angles is None else np.round(field_map.angles * (128.0 / pi)).astype(np.int64).astype(np.uint8)
    )
    low_text, middle, high_text = (_shown(each, low, high, field.unit) for each in (low, (low + high) / 2.0, high))
    cells = np.round(255.0 * part).astype(np.uint8).tobytes()
    return FieldPicture(columns, rows, cells, (low_text, middle, high_text), bytes(angles))


def _shown(value: float, low: float, high: float, unit: str) -> str:
    """A value on a scale: no more digits than tell its ends apart, but as many."""
    digits, span = 4 if unit else 6, high - low
    if span > 0.0:
        size = floor(log10(span))
        value = round(value, 2 - size) + 0.0  # no -0
        digits = min(MAX_DIGITS, max(digits, 3 + floor(log10(max(abs(low), abs(high)))) - size))
    return value_in_words(value, unit, digits)


def round_above(value: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that is not below a value; 1 for nothing."""
    if value <= 0.0:
        return 1.0
    power = 10.0 ** floor(log10(value))
    return float(next(times * power for times in (1.0, 2.0, 5.0, 10.0) if times * power >= value * (1.0 - 1e-9)))
