"""The names that a text may use, for completion: what each is, how it is written, and its values over the fleet."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from sleepcast.console.explaining import shown_value
from sleepcast.console.swarm import RobotMind, Swarm
from sleepcast.language import Constant, HostFunction, Variable
from sleepcast.language.functions import FUNCTIONS
from sleepcast.language.names import Group, Operator, UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS


class ShownName(msgspec.Struct, frozen=True):
    """A name. usage: how a function is called, "" for everything else. range: least to greatest over the fleet."""

    name: str
    kind: str
    doc: str = ""
    range: str = ""
    usage: str = ""


def names_of(swarm: Swarm) -> list[ShownName]:
    """Every name that means something to these robots now."""
    minds = list(swarm.minds.values())
    found = [ShownName(f.name, "function", f.doc, usage=f.usage) for f in FUNCTIONS.values()]
    for binding in swarm.vocabulary.bindings.values():
        if isinstance(binding, HostFunction):
            found.append(ShownName(binding.name, "robot", binding.doc, usage=binding.usage))
        elif isinstance(binding, Constant):
            found.append(ShownName(binding.name, "constant", binding.doc, shown_value(binding.value, "")))
        elif not ACTIVE0 < binding.slot < ACTIVE0 + BUFFERS:  # sixty-three flags would bury the other names
            found.append(_variable(binding, minds))
    return found + _learned(minds)


def _variable(variable: Variable, minds: Iterable[RobotMind]) -> ShownName:
    quantity = variable.quantity
    values = _range((mind.values[variable.slot] for mind in minds), quantity.shown_as or quantity.unit)
    return ShownName(variable.name, variable.kind.value, quantity.doc, values)


def _learned(minds: list[RobotMind]) -> list[ShownName]:
    """What robots have learned over the air; each name is described by the first robot that knows it."""
    first: dict[str, RobotMind] = {}
    for mind in minds:
        for name in mind.heard():
            first.setdefault(name, mind)
    found = []
    for name, mind in first.items():
        declared = mind.declared(name.casefold())
        if isinstance(declared, Operator):
            usage = f"({' '.join((declared.name, *declared.parameters))})"
            found.append(ShownName(declared.name, "operator", usage=usage))
        elif isinstance(declared, UserVariable):
            slot = declared.slot
            values = (mind.values[slot] for mind in minds if slot < len(mind.values))
            found.append(ShownName(declared.name, "user", range=_range(values, "")))
        elif isinstance(declared, Group):
            count = sum(declared.name.casefold() in mind.groups for mind in minds)
            found.append(ShownName(declared.name, "group", range=f"{count} robots"))
        elif declared is not None:
            found.append(ShownName(declared.name, "rule"))
    return found


def _range(values: Iterable[float], unit: str) -> str:
    known = [value for value in values if value == value]
    if not known:
        return "unknown"
    low, high = min(known), max(known)
    return shown_value(low, unit) if low == high else f"{shown_value(low, unit)} … {shown_value(high, unit)}"
