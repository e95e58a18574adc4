"""The names that a text may use, for whoever completes one: what each is, how it is written, and its values over the
fleet."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage, ShownName
from sleepcast.console.view import MindsView, SwarmView
from sleepcast.core.units import value_in_words
from sleepcast.language import Constant, HostFunction, Variable
from sleepcast.language.functions import BUILT_IN
from sleepcast.language.reading_units import unit_of_dimension
from sleepcast.language.symbols import Group, Operator, UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, Vocabulary


class GetNames(PageMessage, tag="names"):
    """The names that a text may use, with the ranges of their values now."""

    serial: Serial


class Named(DeskMessage):
    """The names that a text may use now."""

    serial: int
    names: list[ShownName]


class NameSource(Protocol):
    """Robots that know names."""

    def known_names(self) -> list[ShownName]:
        """The names that a text may use, with the ranges of their values now."""


@answers(then=run_again)
def known_names(source: NameSource, asked: GetNames) -> Named:
    """The names that a text may use."""
    return Named(asked.serial, source.known_names())


# ---- from the vocabulary, and from what robots have learned


def names_of(swarm: SwarmView) -> list[ShownName]:
    """Every name that means something to these robots now."""
    minds = swarm.minds
    from_start = names_in(swarm.vocabulary, lambda variable: minds.column(variable.slot))
    return from_start + [shown for name in minds.heard() if (shown := _learned(name, minds)) is not None]


def names_in(vocabulary: Vocabulary, column: Callable[[Variable], NDArray[np.float64]]) -> list[ShownName]:
    """The names that robots know from the start. column: gives the values of a variable on all of them."""
    shown = [ShownName(f.name, "function", f.doc, usage=f.usage) for f in BUILT_IN.values()]
    for binding in vocabulary.bindings.values():
        if isinstance(binding, HostFunction):
            shown.append(ShownName(binding.name, "robot", binding.doc, usage=binding.usage))
        elif isinstance(binding, Constant):
            value = value_in_words(binding.value, unit_of_dimension(binding.dimension, vocabulary))
            shown.append(ShownName(binding.name, "constant", binding.doc, value))
        elif not ACTIVE0 < binding.slot < ACTIVE0 + BUFFERS:  # sixty-three flags would bury the other names
            quantity = binding.quantity
            values = _range(column(binding), quantity.shown_unit)
            shown.append(ShownName(binding.name, binding.kind.value, quantity.doc, values))
    return shown


def _learned(name: str, minds: MindsView) -> ShownName | None:
    """What robots have learned over the air under this name."""
    declared = minds.declared(name.casefold())
    if isinstance(declared, Operator):
        usage = f"({' '.join((declared.name, *declared.parameters))})"
        return ShownName(declared.name, "operator", usage=usage)
    if isinstance(declared, UserVariable):
        return ShownName(declared.name, "user", range=_range(minds.column(declared.slot), ""))
    if isinstance(declared, Group):
        members = minds.groups.get(declared.name.casefold())
        count = 0 if members is None else int(np.count_nonzero(members))
        return ShownName(declared.name, "group", range=f"{count} robots")
    return None if declared is None else ShownName(declared.name, "rule")


def _range(values: NDArray[np.float64], unit: str) -> str:
    known = values[~np.isnan(values)]
    if not known.size:
        return "unknown"
    low, high = float(known.min()), float(known.max())
    return value_in_words(low, unit) if low == high else f"{value_in_words(low, unit)} … {value_in_words(high, unit)}"
