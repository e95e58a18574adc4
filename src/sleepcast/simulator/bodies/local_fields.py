"""What robots sense of fields: the value where each one really is, and how it rises.

The values of a robot are read at its true place, but the directions are those of its own frame of reference: if its
odometry has turned, so have the slopes and vectors that it senses. Formulas use only operations that give the same bits
on every processor. Lengths in m, values in SI.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import key
from sleepcast.core.model import HostFunction
from sleepcast.simulator.bodies.bodies import Bodies, Floats, Whole
from sleepcast.simulator.bodies.body import BodySenses, acting
from sleepcast.simulator.bodies.growing_field import ADD, TAKE, GrowingField
from sleepcast.simulator.motion.wind import flow
from sleepcast.simulator.scenario.fields import (
    Field,
    Hill,
    ScalarField,
    VectorField,
    dimension_of,
    field_sensors,
)
from sleepcast.simulator.simd.formulas import exponential, rotated, shortest, sine_cosine
from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.grey_picture import Stretched
from sleepcast.simulator.world.torus import Around

Sensed = tuple[Floats, Floats, Floats]
"""Value, slope to the east and slope to the north (per m), one for each point."""
Hides = Callable[[Whole, Floats, Floats], NDArray[np.bool_]]
"""Whether walls lie between points: x and y of each and of what it looks at, m. See `BetweenWalls.any_between`."""


class LocalFields:
    """The fields of the scenario of all `bodies`."""

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        names = [sensor.name for sensor in bodies.sensors]
        self._each: list[tuple[Field, Floats, GrowingField | None]] = []
        """Each field, the rows of its sensors in the table of sensor values, and its cells if it grows."""
        for field in bodies.scenario.fields:
            sensors = field_sensors([field])
            first = names.index(sensors[0].name)
            rows = bodies.known[first : first + len(sensors)]
            cells = _cells_of(bodies, field) if isinstance(field, ScalarField) else None
            self._each.append((field, rows, cells))
            rows[:] = 0.0
        self._look()

    def step(self) -> None:
        """One tick, after all bodies have moved."""
        for _, rows, cells in self._each:
            if cells is not None:
                rows[3] = cells.step(self._bodies.tick)
        self._look()

    def clear(self, robots: Whole) -> None:
        """These robots ask for nothing."""
        for _, _, cells in self._each:
            if cells is not None:
                cells.clear(robots)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes and that the next ticks depend on."""
        return {
            f"{name} of field {field.name}": each
            for field, _, cells in self._each
            if cells is not None
            for name, each in cells.arrays().items()
        }

    def amount(self, name: str) -> Floats | None:
        """The amounts in the cells of a growing field, shape (rows, columns), bottom row first; None of others."""
        matching = (cells for field, _, cells in self._each if field.name == name)
        cells = next(matching, None)
        return None if cells is None else cells.amount

    def ask(self, number: int, what: int, robots: Whole, amounts: Floats) -> None:
        """These robots TAKE from the cell under them, or ADD to it, in the field with this number, which grows."""
        cells = self._each[number][2]
        assert cells is not None
        cells.ask(what, robots, amounts, self._bodies.x[robots], self._bodies.y[robots])

    def _look(self) -> None:
        bodies, scenario = self._bodies, self._bodies.scenario
        size = (scenario.width, scenario.height)
        for field, rows, cells in self._each:
            if isinstance(field, VectorField):
                rows[0], rows[1] = self._turned(*flow(field, bodies.x, bodies.y, scenario.around))
                continue
            if cells is not None:
                value, dx, dy = cells.read(bodies.x, bodies.y)
            else:
                value, dx, dy = values(field, bodies.x, bodies.y, size, scenario.around, bodies.sight.behind_walls)
            rows[0] = value
            rows[1], rows[2] = self._turned(dx, dy)

    def _turned(self, dx: Floats, dy: Floats) -> tuple[Floats, Floats]:
        """Vectors in the world's frame, as robots see them whose odometry has turned."""
        bodies = self._bodies
        if not bodies.scenario.robots.wheels:
            return dx, dy
        return rotated(dx, dy, *sine_cosine(bodies.encoder_heading - bodies.heading))


# ---- values at points


def values(field: ScalarField, x: Floats, y: Floats, size: tuple[float, float], around: Around, hides: Hides) -> Sensed:
    """A field that does not grow, or the start of one that does. size: of the world; around: of a torus."""
    value, dx, dy = np.full(x.size, field.base), np.zeros(x.size), np.zeros(x.size)
    for hill in field.hills:
        parts = _hill(hill, x, y, around)
        if hill.hidden:
            here = np.flatnonzero(parts[0])
            behind = here[hides(here, np.full(here.size, hill.x), np.full(here.size, hill.y))]
            for part in parts:
                part[behind] = 0.0
        for total, part in zip((value, dx, dy), parts, strict=True):
            total += part
    for zone in field.zones:
        value[inside(zone.shape, x, y)] += zone.value
    if field.picture is not None:
        for total, part in zip((value, dx, dy), Stretched(field.picture, size).at(x, y), strict=True):
            total += part
    return value, dx, dy


def _hill(hill: Hill, x: Floats, y: Floats, around: Around) -> Sensed:
    dx, dy = shortest(hill.x - x, around[0]), shortest(hill.y - y, around[1])
    square, radius = dx * dx + dy * dy, hill.radius
    if hill.gaussian:
        value = hill.peak * exponential(square / (-2.0 * radius * radius))
        slope = value / (radius * radius)
    else:
        away = np.sqrt(square)
        value = hill.peak * np.maximum(1.0 - away / radius, 0.0)
        slope = np.where((away > 0.0) & (away < radius), hill.peak / radius, 0.0) / np.where(away > 0.0, away, 1.0)
    return value, slope * dx, slope * dy


# ---- fields that grow


def _cells_of(bodies: Bodies, field: ScalarField) -> GrowingField | None:
    """The cells of a field that grows, with the values in their middles."""
    if field.growth is None:
        return None
    scenario, growth = bodies.scenario, field.growth
    size = (scenario.width, scenario.height)
    x, y = cell_middles(growth.columns, growth.rows, size)
    hides = bodies.sight.from_points(x, y)
    start = values(field, x, y, size, scenario.around, hides)[0].reshape(growth.rows, growth.columns)
    chance = key(bodies.seed, "field", field.name)
    return GrowingField(growth, size, scenario.torus, scenario.tick, bodies.numbers, start, chance)


def cell_middles(columns: int, rows: int, size: tuple[float, float]) -> tuple[Floats, Floats]:
    """x and y of the middles of cells that fill a world of this size, row by row from the bottom, m."""
    column_x = (np.arange(columns) + 0.5) * (size[0] / columns)
    row_y = (np.arange(rows) + 0.5) * (size[1] / rows)
    x, y = np.meshgrid(column_x, row_y)
    return x.ravel(), y.ravel()


def field_functions(fields: Sequence[Field]) -> Iterator[HostFunction]:
    """What expressions may call of these fields: robots TAKE from the cell under them, or ADD to it, if it grows."""
    for number, field in enumerate(fields):
        if isinstance(field, ScalarField) and field.growth is not None:
            yield from (_asking(number, field, what) for what in (TAKE, ADD))


def _asking(number: int, field: Field, what: int) -> HostFunction:
    def ask(senses: BodySenses, robots: Whole, amounts: Floats) -> None:
        senses.of(LocalFields).ask(number, what, robots, amounts)

    doc = (
        f"Takes up to this amount of {field.name} from the cell under the robot.",
        f"Adds this amount of {field.name} to the cell under the robot.",
    )[what]
    return acting(f"{('TAKE', 'ADD')[what]}_{field.name.upper()}", dimension_of(field), "amount", doc, ask)
