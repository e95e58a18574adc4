"""The first difference between a run and an alternate one, in words."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from sleepcast.columns.values import Column, Mask
from sleepcast.core.units import value_in_words
from sleepcast.language.symbols import UserVariable
from sleepcast.language.vocabulary import TICK, TIME_SLOT, Variable, VariableKind, unit_of
from sleepcast.loop import Swarm

Compared = tuple[str, str, Column, Column, Mask]
"""A quantity with its unit, its values in both futures, and which robots count."""


def first_difference(one: Swarm, other: Swarm) -> str | None:
    """Where the first robot that differs does so, at a tick in which both swarms are; None where they are equal.

    Groups come first, then variables that robots have learned, then those that all have, then what sensors say, and
    then where bodies are. Sensors are measured when they are needed, so a question alone changes them: only robots that
    were evaluated in this tick in both futures count there, and only what both needed.
    """
    names = one.simulator.names
    for key in sorted({*one.fleet.groups, *other.fleet.groups}):
        mine, its = (swarm.fleet.groups.get(key, np.zeros(len(names), np.bool_)) for swarm in (one, other))
        apart = np.flatnonzero(mine != its)
        if apart.size:
            robot = int(apart[0])
            inside = ("is", "was not") if mine[robot] else ("is not", "was")
            return f"{names[robot]} {inside[0]} in {key}, and {inside[1]} before{_more(apart.size)}"
    everybody = np.ones(len(names), np.bool_)
    for quantities in (_learned, _own, _sensed):
        for name, unit, here, there, counts in quantities(one, other, everybody):
            apart = np.flatnonzero((here != there) & ~(np.isnan(here) & np.isnan(there)) & counts)
            if apart.size:
                robot = int(apart[0])
                now, then = (value_in_words(float(each[robot]), unit) for each in (here, there))
                return f"{name} of {names[robot]} is {now}, and was {then} before{_more(apart.size)}"
    for name in ("x", "y", "heading"):
        here, there = (getattr(swarm.simulator.bodies, name) for swarm in (one, other))
        apart = np.flatnonzero(here != there)
        if apart.size:
            robot = int(apart[0])
            unit = unit_of(name, one.vocabulary)
            now, then = (value_in_words(float(each[robot]), unit) for each in (here, there))
            return f"the true {name} of {names[robot]} is {now}, and was {then} before{_more(apart.size)}"
    return None


def _learned(one: Swarm, other: Swarm, everybody: Mask) -> Iterator[Compared]:
    """Variables that robots of either future have learned; unknown on those that have not."""
    mine, its = _user_variables(one), _user_variables(other)
    nothing = np.full(len(everybody), np.nan)
    for key in sorted({*mine, *its}):
        here, there = (
            swarm.fleet.column(known[key].slot) if key in known else nothing
            for swarm, known in ((one, mine), (other, its))
        )
        yield (mine.get(key) or its[key]).name, "", here, there, everybody


def _user_variables(swarm: Swarm) -> dict[str, UserVariable]:
    learned = ((name.casefold(), swarm.fleet.declared(name.casefold())) for name in swarm.fleet.heard())
    return {key: declared for key, declared in learned if isinstance(declared, UserVariable)}


def _own(one: Swarm, other: Swarm, everybody: Mask) -> Iterator[Compared]:
    """Variables that all robots have from the start, but for sensors and the time."""
    for variable in _bound(
        one, lambda each: each.kind is not VariableKind.SENSOR and each.slot not in (TICK, TIME_SLOT)
    ):
        here, there = one.fleet.column(variable.slot), other.fleet.column(variable.slot)
        yield variable.name, unit_of(variable.name, one.vocabulary), here, there, everybody


def _sensed(one: Swarm, other: Swarm, everybody: Mask) -> Iterator[Compared]:
    """What sensors say."""
    counts = np.zeros_like(everybody)
    counts[np.intersect1d(one.thought.robots, other.thought.robots)] = True
    if not counts.any():
        return
    needed = one.fleet.reads() & other.fleet.reads()
    for variable in _bound(one, lambda each: each.kind is VariableKind.SENSOR):
        if variable.slot in one.sonars and variable.slot not in needed:
            continue
        here, there = one.fleet.column(variable.slot), other.fleet.column(variable.slot)
        yield variable.name, unit_of(variable.name, one.vocabulary), here, there, counts


def _bound(swarm: Swarm, wanted: Callable[[Variable], bool]) -> Iterator[Variable]:
    return (each for each in swarm.vocabulary.bindings.values() if isinstance(each, Variable) and wanted(each))


def _more(count: int) -> str:
    return f"; {count - 1:,} more differ" if count > 1 else ""
