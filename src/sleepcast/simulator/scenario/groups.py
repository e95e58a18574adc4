"""Groups of robots with their own values, and named constants for rules.

    [constants]
    EYES = 4
    FAR = "6m"

    [robots.groups.eyes]
    count = 20
    values = { myCaste = "EYES" }

Every robot knows each constant by name. A value is a sensor variable of every robot and has one number per group; it
is unknown on robots whose group does not define it. Robots are numbered through the groups in the file's order.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from math import nan

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import did_you_mean
from sleepcast.core.model import Quantity
from sleepcast.core.quantities import Measure
from sleepcast.core.records import dataclass
from sleepcast.core.settings import SettingsError, Table, checked_name
from sleepcast.core.units import UNITS
from sleepcast.robot import BodyConstant

MAX_CONSTANTS = 64
"""Constants: as many as people who write rules can still tell apart."""
MAX_GROUPS = 16
"""Groups of robots in one world: more belong into a data table, not into a scenario."""
MAX_VALUES = 16
"""Values of a group: each is one variable on every robot."""
_PLACEHOLDER = re.compile(r"\{([A-Za-z_]\w*)\}")


@dataclass(frozen=True, slots=True)
class RobotGroup:
    """A group of robots.

    count: their number, or their proportion if the run changes the number of robots
    values: the group's own values by name, in SI with the unit that was written
    sees_light: whether its robots have a light sensor
    """

    name: str
    count: int
    values: dict[str, Measure]
    sees_light: bool = True


def read_constants(root: Table) -> tuple[BodyConstant, ...]:
    """The table `[constants]`: a number, plain or with a unit, for each name."""
    with root.table("constants") as table:
        if len(table.values) > MAX_CONSTANTS:
            raise root.error("constants", f"{len(table.values)} of them; at most {MAX_CONSTANTS} fit")
        measures = {checked_name(table, name): table.measure(name, None) for name in table.values}
    return tuple(
        BodyConstant(name, measure.value, measure.unit, "of this scenario") for name, measure in measures.items()
    )


def filled(text: str, constants: Sequence[BodyConstant], place: str) -> str:
    """A text with each `{NAME}` replaced by the constant of that name, as a number with its unit. place: of the text,
    for errors. Raises SettingsError for a name that there is not."""
    known = {constant.name.casefold(): constant for constant in constants}

    def value(match: re.Match[str]) -> str:
        constant = known.get(match[1].casefold())
        if constant is None:
            near = did_you_mean(match[1], [each.name for each in constants])
            raise SettingsError(f"{place}: there is no constant {match[1]:.40}{near}: write it into [constants]")
        factor = UNITS[constant.unit].factor if constant.unit else 1.0
        return f"{constant.value / factor:.15g}{constant.unit}"

    return _PLACEHOLDER.sub(value, text)


def read_groups(robots: Table, constants: Sequence[BodyConstant], most: int) -> tuple[RobotGroup, ...]:
    """The tables `[robots.groups.NAME]`, none if all robots are alike; at most `most` robots in each."""
    groups = []
    for name, table in robots.tables("groups", most=MAX_GROUPS).items():
        checked_name(robots.table("groups"), name)
        with table:
            count = table.whole("count", low=1, high=most)
            groups.append(RobotGroup(name, count, _values(table, constants), table.flag("sees_light", True)))
    return tuple(groups)


def _values(group: Table, constants: Sequence[BodyConstant]) -> dict[str, Measure]:
    known = {constant.name.casefold(): constant for constant in constants}
    with group.table("values") as table:
        if len(table.values) > MAX_VALUES:
            raise group.error("values", f"{len(table.values)} of them; at most {MAX_VALUES} fit")
        values = {}
        for name, written in table.values.items():
            checked_name(table, name)
            if isinstance(written, str) and written[:1].isalpha():
                constant = known.get(table.text(name).casefold())
                if constant is None:
                    near = did_you_mean(written, (each.name for each in constants))
                    raise table.error(name, f'there is no constant "{written[:40]}"{near} under [constants]')
                values[name] = Measure(constant.value, constant.unit)
            else:
                values[name] = table.measure(name, None)
        return values


def _refuse_unlike_units(groups: Iterable[tuple[Table, RobotGroup]]) -> None:
    """Refuse a name with different spellings or dimensions in two groups. groups: each with its table of robots."""
    first: dict[str, tuple[str, Measure]] = {}
    for robots, group in groups:
        for name, value in group.values.items():
            spelling, other = first.setdefault(name.casefold(), (name, value))
            place = robots.table("groups").table(group.name).table("values")
            if name != spelling:
                raise place.error(name, f"another group spells it {spelling}; use one spelling")
            if _dimension(value.unit) != _dimension(other.unit):
                raise place.error(
                    name, f'another group gives it in "{other.unit or "plain numbers"}"; use one dimension'
                )


def _dimension(unit: str) -> object:
    return UNITS[unit].dimension if unit else UNITS["rad"].dimension


def value_quantities(groups: Sequence[RobotGroup]) -> tuple[Quantity, ...]:
    """The sensors for the groups' values, each with the range that the values span."""
    names = dict.fromkeys(name for group in groups for name in group.values)
    quantities = []
    for name in names:
        values = [group.values[name] for group in groups if name in group.values]
        low, high = min(value.value for value in values), max(value.value for value in values)
        unit = next((value.unit for value in values if value.unit), "")
        quantities.append(Quantity(name, unit, low, high, doc="a value of the robot's group", shown_as=unit))
    return tuple(quantities)


def group_indices(groups: Sequence[RobotGroup], count: int) -> NDArray[np.intp]:
    """The index of each robot's group, shape (count,); group sizes are those of the file, or in proportion to them."""
    ends = np.cumsum([group.count for group in groups])
    bounds = np.rint(ends * (count / ends[-1])).astype(np.intp)
    return np.searchsorted(bounds, np.arange(count), side="right")


def values_of(groups: Sequence[RobotGroup], count: int, name: str) -> NDArray[np.float64]:
    """Each robot's value called `name`, in SI, NaN where its group has none; shape (count,)."""
    each = [group.values[name].value if name in group.values else nan for group in groups]
    return np.array(each, np.float64)[group_indices(groups, count)]


def seeing(groups: Sequence[RobotGroup], count: int) -> NDArray[np.bool_]:
    """Whether each robot has a light sensor, shape (count,)."""
    if not groups:
        return np.ones(count, bool)
    return np.array([group.sees_light for group in groups], bool)[group_indices(groups, count)]


def refuse_clashes(
    root: Table,
    robots: Sequence[Table],
    taken: Iterable[str],
    constants: Sequence[BodyConstant],
    groups: Sequence[Sequence[RobotGroup]],
) -> None:
    """Raise SettingsError where a constant or value has the name of something else that robots know (`taken`). groups:
    those in each of the tables `robots`."""
    known = {name.casefold() for name in taken}
    for constant in constants:
        if constant.name.casefold() in known:
            table = root.table("constants")
            raise table.error(constant.name, "robots know something of this name already; choose another")
        known.add(constant.name.casefold())
    for number, table in enumerate(robots):
        for group in groups[number]:
            for name in group.values:
                if name.casefold() in known:
                    place = table.table("groups").table(group.name).table("values")
                    raise place.error(name, "robots know something of this name already; choose another")
    _refuse_unlike_units([(table, group) for table, some in zip(robots, groups, strict=True) for group in some])
