"""What robots can tell of a neighbour, by the names that texts have for it: one table for every kind of robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import nan
from typing import Any

from sleepcast.core.model import HostFunction, NeighbourSensor
from sleepcast.core.units import LENGTH, NONE, UNITS

NEAREST_ID = "NEAREST_ID"
"""The function that robots have which tell their neighbours apart."""
SHOWN = {
    "x": ("m", "Its x."),
    "y": ("m", "Its y."),
    "heading": ("deg", "The direction in which it heads."),
    "distance": ("m", "How far away it is, from centre to centre."),
    "bearing": ("deg", "The direction in which it is, as a heading; unknown at the robot's own place."),
    "colour": ("", "The colour that it shows."),
}
"""What is seen of every neighbour: its unit, and a description."""


EVERY = 1 << 20
"""More neighbours than any robot has: to ask how many there are."""


class NearIds(tuple[float, ...]):
    """Ids of neighbours, ascending. total: of how many neighbours these are the nearest."""

    total: int

    @classmethod
    def of(cls, ids: Iterable[float], total: int) -> NearIds:
        near = cls(ids)
        near.total = total
        return near


def listed(neighbours: NeighbourSensor, body: object, most: int, arguments: Sequence[float]) -> NearIds:
    """The ids of the neighbours of one robot. Raises whatever the robot's own software raises."""
    near = sorted({float(neighbour) for neighbour in neighbours.call(body, most, *arguments)})[:most]
    total = len({*map(float, neighbours.call(body, EVERY, *arguments))}) if len(near) == most else 0
    return NearIds.of(near, max(total, len(near)))


def crowded(most: int) -> str:
    """What a robot reports, with their number, when it has more neighbours than a form goes through."""
    return f"goes through the nearest {most} neighbours only, of"


def field_named(
    name: str, unit: str, doc: str, call: Callable[..., float], many: Callable[..., Any] | None
) -> tuple[str, HostFunction]:
    """One of `NeighbourSensor.fields`: what neighbours show under this name, in this unit ("": a plain number)."""
    dimension = UNITS[unit].dimension if unit else NONE
    function = HostFunction(
        f"OF {name}",
        call,
        (NONE,),
        arguments="n",
        result=dimension,
        acts=False,
        doc=doc,
        many=many,
        unit=unit,
        repeats=True,
    )
    return name, function


def nearest_id(
    call: Callable[..., float],
    list_one: Callable[..., Any],
    field_of: Callable[..., float],
    *,
    many: Callable[..., Any] | None = None,
    list_many: Callable[..., Any] | None = None,
    field_of_many: Callable[..., Any] | None = None,
    more: Mapping[str, str] | None = None,
) -> HostFunction:
    """The function NEAREST_ID of robots that tell their neighbours apart.

    call, many: its own value, see `HostFunction`
    list_one, list_many: see `NeighbourSensor`
    field_of, field_of_many: `field_of(name, body, id)` gives what a robot senses of a neighbour under a name
    more: names of what neighbours show besides `SHOWN`, each with its unit
    """
    shown = SHOWN | {name: (unit, f"The {name} that it shows.") for name, unit in (more or {}).items()}
    fields = tuple(
        field_named(
            name, unit, doc, partial(field_of, name), None if field_of_many is None else partial(field_of_many, name)
        )
        for name, (unit, doc) in shown.items()
    )
    return HostFunction(
        NEAREST_ID,
        call,
        (LENGTH, NONE),
        least=1,
        arguments="r [colour]",
        result=NONE,
        acts=False,
        doc="id of the nearest neighbour within r, of equally near ones the smallest. With a colour: of that colour "
        "only.",
        many=many,
        neighbours=NeighbourSensor(list_one, list_many, fields),
    )


def _nothing(*_: object) -> float:
    return nan


ALONE = nearest_id(_nothing, lambda *_: (), _nothing)
"""The same of a robot that never has any neighbours."""
