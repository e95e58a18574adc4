"""The first difference between two futures of one run, in words."""

from __future__ import annotations

import numpy as np

from sleepcast.core.units import shown_value
from sleepcast.language.vocabulary import TICK, TIME_SLOT, Variable, VariableKind, unit_of
from sleepcast.loop import Swarm


def first_difference(one: Swarm, other: Swarm) -> str | None:
    """Where the first robot that differs does so, at a tick in which both swarms are; None where they are equal.
    Groups come first, then variables, and then where bodies are. What sensors say is left out: it is measured when it
    is asked for, so it differs where only a question does."""
    names = one.simulator.names
    for key in sorted({*one.fleet.groups, *other.fleet.groups}):
        mine, its = (swarm.fleet.groups.get(key, np.zeros(len(names), np.bool_)) for swarm in (one, other))
        apart = np.flatnonzero(mine != its)
        if apart.size:
            robot = int(apart[0])
            inside = ("is", "was not") if mine[robot] else ("is not", "was")
            return f"{names[robot]} {inside[0]} in {key}, and {inside[1]} before{_more(apart.size)}"
    for variable in (each for each in one.vocabulary.bindings.values() if isinstance(each, Variable)):
        if variable.kind is VariableKind.SENSOR or variable.slot in (TICK, TIME_SLOT):
            continue
        here, there = one.fleet.column(variable.slot), other.fleet.column(variable.slot)
        apart = np.flatnonzero((here != there) & ~(np.isnan(here) & np.isnan(there)))
        if apart.size:
            robot, unit = int(apart[0]), unit_of(variable.name, one.vocabulary)
            now, then = (shown_value(float(each[robot]), unit) for each in (here, there))
            return f"{variable.name} of {names[robot]} is {now}, and was {then} before{_more(apart.size)}"
    for name in ("x", "y", "heading"):
        here, there = (getattr(swarm.simulator.bodies, name) for swarm in (one, other))
        apart = np.flatnonzero(here != there)
        if apart.size:
            robot = int(apart[0])
            now, then = f"{here[robot]:g}", f"{there[robot]:g}"
            return f"the true {name} of {names[robot]} is {now}, and was {then} before{_more(apart.size)}"
    return None


def _more(count: int) -> str:
    return f"; {count - 1:,} more differ" if count > 1 else ""
