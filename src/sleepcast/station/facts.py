"""What a test may ask of each robot, as the desk knows it at one moment: where `selection` looks for one.

A measured quantity is an expression with its value on every robot; a property is a test that holds or not. Numbers are
written in the unit in which people read the quantity, with as few digits as still separate.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from math import ceil, floor, inf, isfinite, log10
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.core.units import LENGTH, UNITS, to_si
from sleepcast.language import Constant, Variable
from sleepcast.language.evaluate import is_true
from sleepcast.language.reader import format_literal
from sleepcast.language.symbols import Group, Names, Operator, UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, MARKING, TICK, TIME_SLOT, Vocabulary

MAX_QUANTITIES = 64
"""Variables that are looked at: as many as robots have, but not every one that somebody has taught them."""
MAX_PROPERTIES = 128
"""Groups and areas that are looked at."""
FINEST = 17
"""Digits with which every number can be told from every other one."""

Values = NDArray[np.float64]
Mask = NDArray[np.bool_]


class FactSource(Protocol):
    """Whatever knows of robots: a station, or a recording at one time."""

    @property
    def names(self) -> Sequence[str]: ...
    @property
    def vocabulary(self) -> Vocabulary: ...
    @property
    def learned(self) -> Names:
        """What robots have learned."""

    def values(self, text: str, /) -> tuple[Values, object]:
        """What an expression comes to on each robot, SI, NaN for unknown. Raises SleepcastError."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A quantity.

    text: its expression
    unit: of its numbers as they are written, "" for plain ones
    flag: whether it is 0 or 1, so that its name is a test
    rank: the lower, the sooner people think of it
    """

    text: str
    values: Values
    unit: str = ""
    flag: bool = False
    rank: int = 0


@dataclass(frozen=True, eq=False)
class Property:
    """A test, and where it holds; nowhere where that is not known."""

    text: str
    holds: Mask
    rank: int = 0


@dataclass(frozen=True, eq=False)
class Facts:
    """All of them.

    known: robots whose telemetry is recent
    place: x and y with their unit, if robots know them
    points: named places that robots know, each the expressions of its x and y with their values
    """

    known: Mask
    quantities: tuple[Measured, ...]
    properties: tuple[Property, ...] = ()
    ids: Values | None = None
    place: tuple[Measured, Measured] | None = None
    points: tuple[tuple[str, str, Values, Values], ...] = ()

    def __len__(self) -> int:
        return len(self.known)


_SKIPPED = frozenset({MARKING, TIME_SLOT, TICK, *range(ACTIVE0 + 1, ACTIVE0 + BUFFERS)})
"""Variables that are the same on all robots, or say which buffers run."""


def facts_of(source: FactSource) -> Facts:
    """What the desk knows now; what cannot be evaluated is left out."""
    quantities = tuple(_quantities(source))
    by_name = {each.text.casefold(): each for each in quantities}
    x, y = by_name.get("x"), by_name.get("y")
    known = x is not None and y is not None and _is_length(x.unit) and _is_length(y.unit)
    place = (x, y) if x is not None and y is not None and known else None
    ids = by_name.get("id")
    return Facts(
        source.values("0")[0] == 0.0,
        quantities,
        tuple(_properties(source)),
        None if ids is None else ids.values,
        place,
        tuple(_points(source, by_name)) if place is not None else (),
    )


def _is_length(unit: str) -> bool:
    return unit in UNITS and UNITS[unit].dimension == LENGTH


def _quantities(source: FactSource) -> Iterator[Measured]:
    variables: list[tuple[str, str, bool, int]] = []
    for binding in source.vocabulary.bindings.values():
        if isinstance(binding, Variable) and binding.slot not in _SKIPPED:
            quantity = binding.quantity
            flag = binding.kind.value == "support" and (quantity.low, quantity.high) == (0.0, 1.0)
            near = 0 if binding.name.casefold() in ("x", "y", "id") or flag else 1
            variables.append((binding.name, quantity.shown_unit, flag, near))
    variables += [(each.name, "", False, 1) for each in _learned(source) if isinstance(each, UserVariable)]
    for name, unit, flag, rank in variables[:MAX_QUANTITIES]:
        values = _values(source, name)
        if values is not None:
            yield Measured(name, values, unit, flag, rank)


def _properties(source: FactSource) -> Iterator[Property]:
    tests: list[str] = []
    for each in _learned(source):
        if isinstance(each, Group):
            tests.append(f"(IN {each.name})")
        elif isinstance(each, Operator) and not each.parameters:
            tests.append(f"(INSIDE {each.name})")
    for test in tests[:MAX_PROPERTIES]:
        values = _values(source, test)
        if values is not None:
            yield Property(test, is_true(values))
            yield Property(f"(NOT {test})", values == 0.0)


def _learned(source: FactSource) -> Iterator[UserVariable | Group | Operator | object]:
    names = source.learned
    known = (*names.heard(), *(area.name for area in source.vocabulary.areas))
    for name in dict.fromkeys(known):
        yield names.declared(name.casefold())


def _points(source: FactSource, by_name: dict[str, Measured]) -> Iterator[tuple[str, str, Values, Values]]:
    """Pairs of names NAME_x and NAME_y."""
    bindings = source.vocabulary.bindings
    for key in bindings:
        if not key.endswith("_x") or f"{key[:-2]}_y" not in bindings:
            continue
        pair = bindings[key], bindings[f"{key[:-2]}_y"]
        columns = [by_name[each.name.casefold()].values for each in pair if each.name.casefold() in by_name]
        if all(isinstance(each, Constant) for each in pair):
            columns = [np.full(len(source.names), each.value) for each in pair if isinstance(each, Constant)]
        if len(columns) == 2:
            yield pair[0].name, pair[1].name, columns[0], columns[1]


def _values(source: FactSource, text: str) -> Values | None:
    try:
        return source.values(text)[0]
    except SleepcastError:
        return None


# ---- numbers


def literal(value: float, unit: str) -> float:
    """What the number `value` of a unit is in SI, as every robot reads it."""
    return to_si(value, unit) if unit else value


def shortest(low: float, high: float, unit: str, *, below: bool) -> str:
    """The shortest literal of a unit whose value (SI) lies between two others. below: it may equal `low` and not
    `high`; else the other way round. One of them may be infinite."""
    factor = UNITS[unit].factor if unit else 1.0
    least, most = low / factor, high / factor
    inner = most if not isfinite(least) else least if not isfinite(most) else 0.5 * (least + most)
    width = abs(inner) or 1.0
    least = least if isfinite(least) else most - 4.0 * width
    most = most if isfinite(most) else least + 4.0 * width
    top = ceil(log10(max(abs(least), abs(most), 1e-300))) + 1
    for exponent in range(top, top - FINEST - 2, -1):
        texts = [text for step in range(4) for text in _multiples(least, most, exponent - step)]
        fitting = [text for text in texts if _fits(literal(float(text), unit), low, high, below=below)]
        if fitting:
            return min(fitting, key=lambda text: (len(text), len(text.strip("-0.")), abs(float(text) - inner))) + unit
    return format_literal(low if below else high)


def _multiples(least: float, most: float, exponent: int) -> Iterator[str]:
    """Multiples of a power of ten between two numbers, as they are written: those in the middle of too many."""
    step = 10.0**exponent
    first, last = floor(least / step), ceil(most / step)
    if last - first > 40:
        middle = (first + last) // 2
        first, last = middle - 5, middle + 5
    for multiple in range(first, last + 1):
        if exponent >= 0:
            yield str(multiple * 10**exponent)
        else:
            digits = str(abs(multiple)).rjust(1 - exponent, "0")
            yield f"{'-' if multiple < 0 else ''}{digits[:exponent]}.{digits[exponent:]}"


def _fits(value: float, low: float, high: float, *, below: bool) -> bool:
    return low <= value < high if below else low < value <= high


def joined(tests: Iterable[str], word: str) -> str:
    """Several tests as one."""
    given = list(tests)
    return given[0] if len(given) == 1 else f"({word} {' '.join(given)})"


def listed(ids: Sequence[int], together: int) -> str:
    """The test that names robots by their numbers, runs of three and more as one. together: operands of one OR."""
    tests: list[str] = []
    ordered = sorted(ids)
    begin = 0
    for at in range(1, len(ordered) + 1):
        if at < len(ordered) and ordered[at] == ordered[at - 1] + 1:
            continue
        run = ordered[begin:at]
        if len(run) > 2:
            tests.append(f"(<= {run[0]} id {run[-1]})")
        else:
            tests += [f"(= id {number})" for number in run]
        begin = at
    while len(tests) > together:
        tests = [joined(tests[at : at + together], "OR") for at in range(0, len(tests), together)]
    return joined(tests, "OR")


_ROUND = re.compile(r"\.?0+$")


def rounded(value: float, step: float) -> str:
    """A number as a multiple of a power of ten, without zeros at its end."""
    digits = max(0, -floor(log10(step))) if step < inf else 0
    text = f"{round(value / step) * step:.{digits}f}"
    return (_ROUND.sub("", text) if "." in text else text) or "0"
