"""Values with their units as people write them, in files, options and calls: "30s", "5 mi", or a plain number in SI."""

from __future__ import annotations

import re
from math import inf, isfinite

from sleepcast.core.errors import MisuseError, decimal_comma, did_you_mean
from sleepcast.core.records import NamedTuple
from sleepcast.core.units import NONE, TIME, UNITS, Dimension, to_si

_QUANTITY = re.compile(r"\s*([+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?)\s*([A-Za-z%][A-Za-z/0-9]*|)\s*")
EXAMPLES = {TIME: "30s"}
"""Of values that people write most; else five of the first unit."""


SMALLER = {"min": "s", "h": "s", "km": "m", "mi": "m", "nmi": "m"}
"""In which a bound is shown that is a small part of the unit in which somebody wrote."""


class QuantityError(MisuseError):
    """No value, or none of the wanted dimension and size."""


class Measure(NamedTuple):
    """A physical value in SI, and the unit in which it was written ("" for a plain number)."""

    value: float
    unit: str = ""


def as_measure(value: object) -> Measure | None:
    """What stands there, of any dimension and with any unit; None for what is neither a number nor begins with one."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return Measure(float(value) if abs(value) < 2**1023 else inf)
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return None
    number, unit = float(match[1]), match[2]
    unit = unit if unit in UNITS else next((known for known in UNITS if known == unit.casefold()), unit)
    return Measure(to_si(number, unit) if unit in UNITS else number, unit)


def measure_of(value: object, dimension: Dimension | None, low: float = -inf, high: float = inf) -> Measure:
    """What stands there, which must be of this dimension (None: of any) and from `low` to `high`, SI. Raises
    QuantityError."""
    measure, wanted = as_measure(value), f"{dimension or 'a value'}{_example(dimension)}"
    if measure is None:
        raise QuantityError(refusal(wanted, value))
    if measure.unit and measure.unit not in UNITS:
        units = [unit for unit, known in UNITS.items() if dimension in (None, known.dimension)]
        raise QuantityError(f'unknown unit in "{value}"{did_you_mean(measure.unit, units)}; wanted {wanted}')
    if dimension is not None and measure.unit and UNITS[measure.unit].dimension != dimension:
        raise QuantityError(f'wanted {wanted}, not "{value}", {UNITS[measure.unit].dimension}')
    if not isfinite(measure.value) and (low, high) == (-inf, inf):
        raise QuantityError(refusal(wanted, value))
    if not isfinite(measure.value) or not low <= measure.value <= high:
        raise QuantityError(refusal(f"{dimension or 'a value'} {_between(low, high, measure.unit)}", value))
    return measure


def in_si(value: object, dimension: Dimension | None, low: float = -inf, high: float = inf) -> float:
    """The number of `measure_of`, SI. Raises QuantityError."""
    return measure_of(value, dimension, low, high).value


def refusal(wanted: str, value: object) -> str:
    """The sentence about a value where another one was wanted."""
    comma = "" if wanted.endswith(",") else ","
    return f"wanted {wanted}{comma} not {shown_value(value)}{decimal_comma(value)}"


def _example(dimension: Dimension | None) -> str:
    if dimension in EXAMPLES:
        return f' such as "{EXAMPLES[dimension]}"'
    examples = (unit for unit, known in UNITS.items() if known.dimension == dimension and dimension != NONE)
    return "".join(f' such as "5{unit}"' for unit in list(examples)[:1])


def _between(low: float, high: float, unit: str) -> str:
    def end(value: float) -> str:
        if unit not in UNITS:
            return f"{value:.6g}"
        shown = unit if value == 0.0 or abs(value) >= 0.1 * UNITS[unit].factor else SMALLER.get(unit, unit)
        return f"{value / UNITS[shown].factor:.6g}{shown}"

    if high == inf:
        return f"of at least {end(low)}"
    return f"from {end(low)} to {end(high)}"


def shown_value(value: object) -> str:
    """A TOML value as people write it, shortened."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value[:40]}"'
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return f"[{', '.join(map(shown_value, value[:4]))}{', ...' if len(value) > 4 else ''}]"
    return str(value)[:40]
