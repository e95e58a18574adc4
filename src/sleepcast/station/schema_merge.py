"""Uniting: one vocabulary for a fleet of robots of several types, so that a text is checked once, for all of them.

A name is in it if any type has it; its range is the widest. What is a number that each type has for itself (a constant
that not all of them have alike) is a variable here, since it differs from robot to robot. A name that is a function on
one type and a number on another cannot be both, unless that function has a number of its own: the type that comes later
is left out, and its robots cannot be foreseen.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import msgspec

from sleepcast.core.model import Constant, HostFunction, Quantity
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, SUPPORT, Variable, Vocabulary

Key = TypeVar("Key", bound=Hashable)

NUMBERED = (*range(ACTIVE0 + 1), *range(ACTIVE0 + BUFFERS, len(SUPPORT)))
"""Slots of the support variables that a robot tells as numbers."""


class SlotMap(msgspec.Struct, frozen=True, eq=False, dict=True):
    """Where what robots of one type tell belongs.

    slots: of the numbers, in their order
    fixed: numbers that all robots of the type have, by their slots
    """

    slots: tuple[int, ...]
    fixed: dict[int, float]

    @cached_property
    def places(self) -> dict[int, int]:
        """Where in that order the number of a slot stands."""
        return {slot: place for place, slot in enumerate(self.slots)}


def merge_schemas(types: Mapping[Key, Vocabulary]) -> tuple[Vocabulary, dict[Key, SlotMap], dict[Key, str]]:
    """The vocabulary of a fleet of these types, where the numbers of each belong, and why others are left out."""
    refused = _refused(types)
    kept = {key: of_type for key, of_type in types.items() if key not in refused}
    both = _both(types)
    alike = {key: constant for key, constant in _alike(kept.values()).items() if key not in both}
    apart = [c for each in kept.values() for c in each.constants if c.name.casefold() not in {*alike, *both}]
    numbers = [Quantity(constant.name, doc=constant.doc) for constant in apart]
    actuators = _widest(quantity for of_type in kept.values() for quantity in of_type.actuators)
    sensors = _widest([*(quantity for of_type in kept.values() for quantity in of_type.sensors), *numbers])
    vocabulary = Vocabulary(
        " and ".join(dict.fromkeys(of_type.name for of_type in kept.values())) or "robot",
        tuple(quantity for key, quantity in sensors.items() if key not in actuators),
        tuple(actuators.values()),
        constants=tuple(alike.values()),
        functions=tuple(_functions(function for each in kept.values() for function in each.functions)),
        outlines=tuple(dict.fromkeys(outline for each in kept.values() for outline in each.outlines)),
    )
    return (
        vocabulary,
        {key: _fitted(of_type, vocabulary) for key, of_type in kept.items()},
        refused,
    )


def _refused(types: Mapping[Key, Vocabulary]) -> dict[Key, str]:
    """The types that have a number under the name that an earlier type has for a function, or the other way round."""
    kinds: dict[str, tuple[bool, str]] = {}
    refused: dict[Key, str] = {}
    both = _both(types)
    for key, vocabulary in types.items():
        own = {name: isinstance(binding, HostFunction) for name, binding in vocabulary.bindings.items()}
        for name, is_function in own.items():
            if name in kinds and kinds[name][0] is not is_function and name not in both:
                what = ("number", "function")
                refused[key] = f"{name} is a {what[is_function]} here and a {what[not is_function]} of {kinds[name][1]}"
        if key not in refused:
            kinds |= {name: (is_function, vocabulary.name) for name, is_function in own.items() if name not in kinds}
    return refused


def _both(types: Mapping[Key, Vocabulary]) -> set[str]:
    """The names that are a function with a number of its own on any type."""
    functions = (function for of_type in types.values() for function in of_type.functions)
    return {function.name.casefold() for function in functions if function.value is not None}


def _alike(types: Iterable[Vocabulary]) -> dict[str, Constant]:
    """The constants that all types have with one value."""
    each = [{constant.name.casefold(): constant for constant in vocabulary.constants} for vocabulary in types]
    first = each[0] if each else {}
    return {
        key: constant
        for key, constant in first.items()
        if all(key in other and repr(other[key].value) == repr(constant.value) for other in each)
    }


def _widest(quantities: Iterable[Quantity]) -> dict[str, Quantity]:
    """Quantities by key, each once, with the widest range that any type has for it."""
    widest: dict[str, Quantity] = {}
    for quantity in quantities:
        key = quantity.name.casefold()
        one = widest.setdefault(key, quantity)
        widest[key] = replace(one, low=min(one.low, quantity.low), high=max(one.high, quantity.high))
    return widest


def _functions(functions: Iterable[HostFunction]) -> Iterable[HostFunction]:
    """Functions, each once; of different shapes under one name, whatever any type takes."""
    united: dict[str, HostFunction] = {}
    for function in functions:
        key = function.name.casefold()
        one = united.setdefault(key, function)
        if one.dimensions != function.dimensions or _least(one) != _least(function):
            most = max(len(one.dimensions), len(function.dimensions))
            least = min(_least(one), _least(function))
            united[key] = replace(one, dimensions=(None,) * most, least=least)
        acts, for_good = one.acts or function.acts, one.irreversible or function.irreversible
        number = function.value if one.value is None else one.value
        united[key] = replace(united[key], acts=acts, irreversible=for_good, value=number)
    return united.values()


def _least(function: HostFunction) -> int:
    return len(function.dimensions) if function.least is None else function.least


def _fitted(own: Vocabulary, vocabulary: Vocabulary) -> SlotMap:
    slots = {key: binding.slot for key, binding in vocabulary.bindings.items() if isinstance(binding, Variable)}
    named = [slots[quantity.name.casefold()] for quantity in (*own.sensors, *own.actuators)]
    fixed = {slots[key]: c.value for c in own.constants if (key := c.name.casefold()) in slots}
    return SlotMap((*NUMBERED, *named), fixed)
