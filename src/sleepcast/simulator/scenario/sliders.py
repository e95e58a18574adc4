"""Sliders: numbers of a scenario that people are invited to change, each within its bounds.

    [sliders.noise]
    key = "constants.NOISE"
    low = 0
    high = 6
    step = 0.1

    [sliders.near]
    value = "5mi"
    low = "1mi"
    high = "10mi"

With a `key`, the number is one that the file has elsewhere, and another value makes another run. With a `value`, the
number is one of the ready-made commands and the mission alone, where `{near}` stands for it.
"""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.core.quantities import Measure
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Document, Table, checked_name, key_path
from sleepcast.core.units import UNITS
from sleepcast.robot import BodyConstant

MAX_SLIDERS = 24
"""Sliders of one scenario: as many as fit beside each other and can still be understood."""
STEPS = 100
"""Steps from one end to the other, unless the file says how large one is."""


@dataclass(frozen=True, slots=True)
class Slider:
    """A number that may be changed.

    key: where the file has it
    value, low, high, step: in `unit`, "" for plain numbers
    live: whether it is a number of commands alone, which may change while a run goes on
    """

    name: str
    title: str
    key: str
    unit: str
    value: float
    low: float
    high: float
    step: float
    live: bool = False

    def written(self, value: float) -> object:
        """Another value as the file would have it."""
        if self.unit:
            return f"{value:.12g}{self.unit}"
        counts = self.step.is_integer() and value.is_integer()  # a number of robots must be a whole one
        return int(value) if counts else value


def read_sliders(root: Table, document: Document, constants: Sequence[BodyConstant]) -> tuple[Slider, ...]:
    """The tables `[sliders.NAME]`. Raises SettingsError, also where a number stands outside its slider."""
    taken = {constant.name.casefold() for constant in constants}
    sliders = []
    for name, table in root.tables("sliders", most=MAX_SLIDERS).items():
        checked_name(root.table("sliders"), name)
        with table:
            sliders.append(_read(name, table, document, taken))
    return tuple(sliders)


def _read(name: str, table: Table, document: Document, taken: set[str]) -> Slider:
    low, high = table.measure("low", None), table.measure("high", None)
    unit = low.unit or high.unit
    if _dimension(low.unit) != _dimension(high.unit):
        raise table.error("high", f'wanted the unit of low, "{low.unit}"')
    if not low.value < high.value:
        raise table.error("high", "wanted more than low")
    live = not table.has("key")
    key = f"sliders.{name}.value" if live else table.text("key")
    if live and name.casefold() in taken:
        raise table.error("value", f'{name} is one of [constants] already: write key = "constants.{name}" instead')
    value = table.measure("value", None) if live else _elsewhere(key, table, document)
    if value.unit and _dimension(value.unit) != _dimension(unit):  # a plain number is in SI
        wrong = f'its number has not the unit of low and high, "{unit}"'
        if document.is_changed(key):
            raise document.error(key_path(key), f"{wrong}, of the slider {name}")
        raise table.error("value" if live else "key", wrong)
    if document.is_changed(key):  # a run may go beyond
        low, high = Measure(min(low.value, value.value), unit), Measure(max(high.value, value.value), unit)
    if not low.value <= value.value <= high.value:
        raise table.error("value" if live else "key", "its number is not between low and high")
    factor = UNITS[unit].factor if unit else 1.0
    step = table.measure("step", None, Measure((high.value - low.value) / STEPS, unit), low=1e-12)
    if _dimension(step.unit) != _dimension(unit):
        raise table.error("step", f'wanted the unit of low and high, "{unit}"')
    at, least, most, each = (round(number.value / factor, 12) for number in (value, low, high, step))
    return Slider(name, table.text("title", name, most=60), key, unit, at, least, most, each, live)


def _elsewhere(key: str, table: Table, document: Document) -> Measure:
    """The number that stands under a key of the file. What a run has put there answers for itself, not the slider."""
    if document.is_changed(key):
        return document.measure(key)
    with table.answering("key"):
        return document.measure(key)


def _dimension(unit: str) -> object:
    return UNITS[unit or "rad"].dimension


def blanks_of(sliders: Sequence[Slider]) -> tuple[BodyConstant, ...]:
    """The numbers of commands alone, as `filled` wants them."""
    return tuple(
        BodyConstant(each.name, each.value * (UNITS[each.unit].factor if each.unit else 1.0), each.unit, each.title)
        for each in sliders
        if each.live
    )
