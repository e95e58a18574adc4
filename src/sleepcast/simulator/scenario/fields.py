"""Fields as a scenario file describes them: values that fill the world, and the variables in which robots sense them.

A scalar field is a sum of a base, hills, zones and a picture; robots sense its value where they are, and how it rises
to the east and to the north. A growing field begins as such a sum and then lives on a grid of cells, from which robots
take and to which they add. A vector field is a sum of a uniform flow and of swirls. `bodies.local_fields` simulates
them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, inf

from sleepcast.core.model import Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table, checked_name
from sleepcast.core.units import LENGTH, NONE, TIME, UNITS, Dimension
from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_TIME, MAX_WORLD
from sleepcast.simulator.scenario.signals import refuse_sight
from sleepcast.simulator.world.grey_picture import Picture, bounds_of_picture, read_picture
from sleepcast.simulator.world.world import Area, Circle

MAX_FIELDS = 8
"""Fields of one world: each is two to four variables on every robot, computed in every tick."""
MAX_PARTS = 256
"""Hills, zones or swirls of one field, each: every robot adds them up in every tick."""
MAX_CORNERS = 256
"""Corners of a zone."""
MAX_CELLS = 1_000_000
"""Cells of a growing field: a tick of it takes some hundredths of a second."""
MAX_RATE = 1_000.0
"""Growth, 1/s: anything faster is full within a tick."""
MAX_VALUE = 1e9
"""Size of any value of a field, in SI."""


@dataclass(frozen=True, slots=True)
class Hill:
    """`peak` at (x, y) in m.

    gaussian: `radius` (m) is its standard deviation; else it falls linearly to 0 there
    hidden: whether it adds nothing behind a wall
    """

    x: float
    y: float
    peak: float
    radius: float
    gaussian: bool
    hidden: bool = False


@dataclass(frozen=True, slots=True)
class Zone:
    """`value` everywhere in a shape."""

    shape: Circle | Area
    value: float


@dataclass(frozen=True, slots=True)
class Growth:
    """How a field grows.

    columns, rows: of its cells, which fill the world
    most: greatest amount in a cell
    rate: of logistic growth, 1/s, or by how much each cell grows in a second
    diffusion: m2/s
    delay: after how many s a cell that was emptied has `most` again; then it grows in no other way. 0 of other laws
    sown: share of the cells that have something at the start, chosen by chance; the others wait for a part of `delay`
    in_turn: whether robots that want more than a cell has get it one after the other, and not in equal shares
    """

    columns: int
    rows: int
    most: float
    rate: float
    logistic: bool
    diffusion: float
    delay: float = 0.0
    sown: float = 1.0
    in_turn: bool = False


@dataclass(frozen=True, slots=True)
class ScalarField:
    """A value at every point: the sum of `base` and its parts; if it grows, only at the start. unit: of the value."""

    name: str
    unit: str
    about: str
    base: float
    hills: tuple[Hill, ...]
    zones: tuple[Zone, ...]
    picture: Picture | None
    growth: Growth | None


@dataclass(frozen=True, slots=True)
class Swirl:
    """A vortex around (x, y), counter-clockwise: strongest, `peak`, at `radius` m from there."""

    x: float
    y: float
    peak: float
    radius: float


@dataclass(frozen=True, slots=True)
class VectorField:
    """A vector at every point: the sum of a uniform one, to the east and to the north, and of swirls."""

    name: str
    unit: str
    about: str
    uniform: tuple[float, float]
    swirls: tuple[Swirl, ...]


Field = ScalarField | VectorField


def read_fields(
    root: Table, size: tuple[float, float], tick: float, taken: Sequence[str], version: int
) -> tuple[Field, ...]:
    """The tables `[fields.NAME]`.

    size: of the world, m
    tick: s
    taken: names already in use
    version: of the scenario's format
    """
    fields: list[Field] = []
    known = {name.casefold() for name in taken}
    for name, table in root.tables("fields", most=MAX_FIELDS).items():
        checked_name(root.table("fields"), name)
        with table:
            vector = table.text("kind", "scalar", choices=("scalar", "vector")) == "vector"
            field = read_flow(table, name, _unit(table), size) if vector else _scalar(table, name, size, tick, version)
        for sensor in field_sensors([field]):
            if sensor.name.casefold() in known:
                raise root.table("fields").error(
                    name, f"robots know something called {sensor.name} already; choose another name"
                )
            known.add(sensor.name.casefold())
        fields.append(field)
    return tuple(fields)


def field_sensors(fields: Sequence[Field]) -> tuple[Quantity, ...]:
    """The sensors for fields, field by field."""
    return tuple(sensor for field in fields for sensor in _sensors_of(field))


def _sensors_of(field: Field) -> Iterator[Quantity]:
    name, unit = field.name, field.unit
    if isinstance(field, VectorField):
        for axis, way in (("x", "east"), ("y", "north")):
            yield Quantity(f"{name}_{axis}", unit, doc=f"{name} here, to the {way}", shown_as=unit)
        return
    low, high = (0.0, field.growth.most) if field.growth else (-inf, inf)
    yield Quantity(name, unit, low, high, doc=field.about or f"the field {name} here", shown_as=unit)
    for axis, way in (("dx", "east"), ("dy", "north")):
        yield Quantity(f"{name}_{axis}", unit, doc=f"how much {name} rises over a metre to the {way}", shown_as=unit)
    if field.growth:
        yield Quantity(f"{name}_taken", unit, 0.0, high, doc=f"{name} that this robot got in the last tick")


def dimension_of(field: Field) -> Dimension:
    return UNITS[field.unit].dimension if field.unit else NONE


# ---- one table


def _unit(table: Table) -> str:
    return table.text("unit", "", choices=("", *UNITS))


def _scalar(table: Table, name: str, size: tuple[float, float], tick: float, version: int) -> ScalarField:
    unit = _unit(table)
    dimension = UNITS[unit].dimension if unit else NONE

    def value(of: Table, key: str, default: float | None = None) -> float:
        return of.number(key, dimension, default, low=-MAX_VALUE, high=MAX_VALUE)

    hills = []
    for each in table.array("hills", most=MAX_PARTS):
        with each:
            gaussian = each.text("shape", "gaussian", choices=("gaussian", "linear")) == "gaussian"
            refuse_sight(each, "hidden", version)
            hidden = each.flag("hidden", False)
            hills.append(Hill(*_at(each, size), value(each, "peak"), _radius(each), gaussian, hidden))
    zones = []
    for each in table.array("zones", most=MAX_PARTS):
        with each:
            zones.append(Zone(_shape(each, size), value(each, "value")))
    grey = None
    if table.has("image"):
        with table.table("image") as each:
            grey = read_picture(each, value(each, "low", 0.0), value(each, "high", 1.0))
    growth = None
    if table.has("growth"):
        with table.table("growth") as each:
            growth = _growth(each, size, tick, each.number("most", dimension, low=LEAST, high=MAX_VALUE), dimension)
    about = table.text("about", "", most=200)
    return ScalarField(name, unit, about, value(table, "base", 0.0), tuple(hills), tuple(zones), grey, growth)


def read_flow(table: Table, name: str, unit: str, size: tuple[float, float]) -> VectorField:
    """The vector field of this name in a table. unit: "" for plain numbers; size: of the world, m"""
    dimension = UNITS[unit].dimension if unit else NONE
    uniform = (0.0, 0.0)
    if table.has("uniform"):
        with table.table("uniform") as each:
            x, y = (each.number(axis, dimension, 0.0, low=-MAX_VALUE, high=MAX_VALUE) for axis in "xy")
            uniform = (x, y)
    swirls = []
    for each in table.array("swirls", most=MAX_PARTS):
        with each:
            peak = each.number("peak", dimension, low=-MAX_VALUE, high=MAX_VALUE)
            swirls.append(Swirl(*_at(each, size), peak, _radius(each)))
    return VectorField(name, unit, table.text("about", "", most=200), uniform, tuple(swirls))


def _at(table: Table, size: tuple[float, float]) -> tuple[float, float]:
    return table.number("x", LENGTH, low=0.0, high=size[0]), table.number("y", LENGTH, low=0.0, high=size[1])


def _radius(table: Table) -> float:
    return table.number("radius", LENGTH, low=LEAST, high=MAX_WORLD)


def _shape(zone: Table, size: tuple[float, float]) -> Circle | Area:
    """A polygon with `corners`, a disc with a `center` and a `radius`, or a rectangle with spans `x` and `y`."""
    if zone.has("corners"):
        return Area((zone.points("corners", (0.0, 0.0), size, least=3, most=MAX_CORNERS),))
    if zone.has("center"):
        return Circle(*zone.point("center", (0.0, 0.0), size), _radius(zone))
    (left, right), (bottom, top) = (zone.span(axis, LENGTH, low=0.0, high=size[i]) for i, axis in enumerate("xy"))
    x0, x1, y0, y1 = left.value, right.value, bottom.value, top.value
    return Area((((x0, y0), (x1, y0), (x1, y1), (x0, y1)),))


def _growth(table: Table, size: tuple[float, float], tick: float, most: float, dimension: Dimension) -> Growth:
    cell = table.number("cell", LENGTH, low=LEAST, high=MAX_WORLD)
    columns, rows = (max(1, ceil(side / cell - 1e-9)) for side in size)
    if columns * rows > MAX_CELLS:
        raise table.error("cell", f"{columns} by {rows} cells; at most {MAX_CELLS} fit: make them larger")
    in_turn = table.text("sharing", "equal", choices=("equal", "in turn")) == "in turn"
    law = table.text("law", "logistic", choices=("logistic", "constant", "delayed"))
    if law == "delayed":
        delay = table.number("delay", TIME, low=tick, high=MAX_TIME)
        sown = table.number("sown", NONE, 1.0, low=0.0, high=1.0)
        return Growth(columns, rows, most, 0.0, False, 0.0, delay, sown, in_turn)
    bound = MAX_RATE if law == "logistic" else MAX_RATE * most
    # A rate of growth is a number in a second; there is no unit for it.
    rate = table.number("rate", NONE, low=-bound, high=bound)
    diffusion = table.number("diffusion", NONE, 0.0, low=0.0)
    growth = Growth(columns, rows, most, rate, law == "logistic", diffusion, in_turn=in_turn)
    if sum(spread(growth, size, tick)) > 0.5:
        raise table.error(
            "diffusion", f"{growth.diffusion:g} m2/s is too fast for such cells: make them larger, or the tick shorter"
        )
    return growth


def spread(growth: Growth, size: tuple[float, float], seconds: float) -> tuple[float, float]:
    """The share of the difference between two cells, side by side and one above the other, that diffuses in so many
    seconds. The explicit scheme is stable while their sum is at most a half."""
    across, up = size[0] / growth.columns, size[1] / growth.rows
    return growth.diffusion * seconds / (across * across), growth.diffusion * seconds / (up * up)


def bounds_of_fields(
    fields: Sequence[Field], size: tuple[float, float], tick: float
) -> Iterator[tuple[str, float, float, float]]:
    """All values of fields that memory or run time depend on, for those that read a snapshot: name, value, least and
    most."""
    yield "fields", len(fields), 0, MAX_FIELDS
    for field in fields:
        yield "units of a field that are none", field.unit not in ("", *UNITS), 0, 0
        if isinstance(field, VectorField):
            yield "swirls", len(field.swirls), 0, MAX_PARTS
            for swirl in field.swirls:
                yield "m as a radius", swirl.radius, LEAST, MAX_WORLD
            continue
        yield "hills", len(field.hills), 0, MAX_PARTS
        for hill in field.hills:
            yield "m as a radius", hill.radius, LEAST, MAX_WORLD
        yield "zones", len(field.zones), 0, MAX_PARTS
        for zone in field.zones:
            corners = sum(map(len, zone.shape.outlines)) if isinstance(zone.shape, Area) else 0
            yield "corners of a zone", corners, 0, MAX_CORNERS
        if (shown := field.picture) is not None:
            yield from bounds_of_picture(shown)
        if (growth := field.growth) is not None:
            yield "columns of cells", growth.columns, 1, MAX_CELLS
            yield "cells", growth.columns * growth.rows, 1, MAX_CELLS
            yield "in a cell at most", growth.most, LEAST, MAX_VALUE
            yield "of growth in a second", abs(growth.rate), 0.0, MAX_RATE * max(1.0, growth.most)
            yield "of diffusion", sum(spread(growth, size, tick)), 0.0, 0.5
            yield "s of delay", growth.delay, 0.0, MAX_TIME
            yield "as a share that is sown", growth.sown, 0.0, 1.0
