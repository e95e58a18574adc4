"""Where bodies stand as they come into a world: none in another one, and none in something solid.

On the ground bodies are in each other's way where they have contact, what flies among them while it is as low. What
flies crashes into whatever it touches once its motors turn, so it stands in nothing from the start, on the ground too.
Bodies whose places are by chance are moved until all are free; a place that is given, and is not free, is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import NamedTuple
from sleepcast.simulator.bodies.flight import Flight
from sleepcast.simulator.bodies.proximity import CELL, Bumpers, Neighbours, reach
from sleepcast.simulator.motion.steps import SKIN
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simd.formulas import shortest
from sleepcast.simulator.world.grid import Floats, Grid, Whole, distance, grid_over, pairs, sort, spread

Flags = NDArray[np.bool_]
Anew = Callable[[int], tuple[Floats, Floats]]
"""New places by chance for all bodies, by attempt, m."""
MAX_ATTEMPTS = 1_000
"""Attempts to move bodies that overlap at the start: a world that is not full needs a few dozen."""
ALL_PAIRS = 16_384
"""Pairs up to which all are compared at once: for few bodies cells take longer."""


class StartError(MisuseError):
    """A body cannot be where the scenario puts it."""


class Standing(Protocol):
    """Bodies, as far as it concerns where they stand; see `bodies.Bodies`."""

    scenario: Scenario
    radii: Floats
    x: Floats
    y: Floats
    near: Neighbours
    low: Neighbours
    contact: Bumpers | None
    flight: Flight | None


class Placed(NamedTuple):
    """Where bodies are: x, y, z and radii, m; which ones fly, and which are as low as those on the ground. Shape
    (count,)."""

    x: Floats
    y: Floats
    z: Floats
    radii: Floats
    flies: Flags
    low: Flags

    def of(self, which: Whole | Flags) -> Placed:
        """Some of them."""
        columns: list[NDArray[Any]] = [column[which] for column in self]
        return Placed(*columns)

    def joined(self, more: Placed) -> Placed:
        """These and more."""
        columns: list[NDArray[Any]] = [np.concatenate(each) for each in zip(self, more, strict=True)]
        return Placed(*columns)


def placed(bodies: Standing) -> Placed:
    """These bodies, where they are now."""
    flight, none = bodies.flight, np.zeros(len(bodies.x), bool)
    if flight is None:
        return Placed(bodies.x, bodies.y, np.zeros(len(none)), bodies.radii, none, ~none)
    ground = flight.ground_at(bodies.x, bodies.y)
    z = np.where(flight.flies, flight.z, ground)
    return Placed(bodies.x, bodies.y, z, bodies.radii, flight.flies, flight.low(bodies.x, bodies.y))


def is_crowded(bodies: Standing) -> bool:
    """Whether it matters in this world that bodies touch something."""
    return bodies.contact is not None or _crashes(bodies)


def _crashes(bodies: Standing) -> bool:
    return bodies.flight is not None and bodies.flight.collides


def touch(bodies: Standing, ones: Placed, others: Placed) -> Flags:
    """Which of `ones` touch that of `others` beside it, where that matters."""
    around = bodies.scenario.around
    dx, dy, dz = shortest(others.x - ones.x, around[0]), shortest(others.y - ones.y, around[1]), others.z - ones.z
    flat, close = dx * dx + dy * dy, others.radii + ones.radii + SKIN
    touches: Flags = np.zeros(len(flat), bool)
    if _crashes(bodies):
        touches |= (flat + dz * dz <= close * close) & (ones.flies | others.flies)
    if bodies.contact is not None:
        touches |= (flat <= close * close) & ones.low & others.low & ~(ones.flies & others.flies)
    return touches


def touch_solids(bodies: Standing, ones: Placed, lines: Floats, tops: Floats) -> Flags:
    """Which of `ones` touch the solid beside it, where that matters. tops: how high these are, m"""
    inside = distance(ones.x, ones.y, *lines[:, :4].T) < ones.radii + lines[:, 4] + SKIN
    flying = (ones.z < tops) & _crashes(bodies)
    touches: Flags = inside & np.where(ones.flies, flying, bodies.contact is not None)
    return touches


def part(bodies: Standing, anew: Anew, given: Flags) -> None:
    """Move bodies until none overlaps another one or a solid, where that matters. given: bodies that must stay where
    they are. Of two others that overlap, the one with the higher index moves. Raises MisuseError if they do not fit,
    StartError for one that must stay."""
    if not is_crowded(bodies):
        return
    x, y, wide = bodies.x, bodies.y, bodies.low.grid  # the sonars' cells would give too many pairs in a full room
    fine = grid_over(wide.columns * wide.size, wide.rows * wide.size, CELL * bodies.radii.max(), len(x))
    for attempt in range(MAX_ATTEMPTS):
        if bodies.flight:
            bodies.flight.stand()
        all_ = placed(bodies)
        i, j = _overlapping(bodies, fine, all_)
        inside = _in_solids(bodies, all_)
        wrong = _distinct(len(x), i[np.where(given[i] == given[j], i > j, given[j])], inside)
        if not len(wrong):
            bodies.low.forget()
            return
        _refuse_given(given, (i, j), inside, all_)
        other_x, other_y = anew(attempt)
        x[wrong], y[wrong] = other_x[wrong], other_y[wrong]
    raise MisuseError(
        f"{len(x)} robots with a radius of {bodies.radii.max():g} m do not fit where they start: "
        "give them more room, or ask for fewer"
    )


def _overlapping(bodies: Standing, fine: Grid, all_: Placed) -> tuple[Whole, Whole]:
    """Bodies that overlap, each pair in both orders."""
    every = np.arange(len(all_.x))
    bodies.low.forget()
    images = bodies.low.images(all_.x, all_.y)
    x, y, close = images.x, images.y, 2.0 * bodies.radii.max() + SKIN
    if len(every) * len(x) <= ALL_PAIRS:
        i, j = np.nonzero((x[every, None] - x) ** 2 + (y[every, None] - y) ** 2 <= close * close)
        i, j = i[i != j], j[i != j]
    else:
        i, j = pairs(fine, sort(fine, x, y), x, y, close, every)
    j = images.whose(j)
    touches = touch(bodies, all_.of(i), all_.of(j))
    return i[touches], j[touches]


def _in_solids(bodies: Standing, all_: Placed) -> Whole:
    """Bodies that something solid is too near to."""
    near, count, scenario = bodies.low, len(all_.x), bodies.scenario
    images = near.images(all_.x, all_.y)
    all_ = all_._replace(x=images.x[:count], y=images.y[:count])
    listed = near.solids(max(reach(spec, scenario.tick) for spec in scenario.each_type))
    cell = near.grid.cells_of(all_.x, all_.y)
    k, index = spread(np.arange(count), listed.start[cell], listed.start[cell + 1])
    item = listed.items[index]
    return _distinct(count, k[touch_solids(bodies, all_.of(k), near.lines[item], near.tops[item])])


def _refuse_given(given: Flags, overlapping: tuple[Whole, Whole], inside: Whole, all_: Placed) -> None:
    """Raise StartError if a body that must stay where it is overlaps another such one, or something solid."""
    (i, j), stuck = overlapping, inside[given[inside]]
    if stuck.size:
        first = stuck[0]
        raise StartError(
            f"robot {first + 1} cannot start at {_place(all_, first)}: its body, with a radius of "
            f"{all_.radii[first]:g} m, would be in a wall there"
        )
    both = np.flatnonzero(given[i] & given[j] & (i < j))
    if both.size:
        one, other = i[both[0]], j[both[0]]
        apart = np.linalg.norm([each[one] - each[other] for each in all_[:3]])
        least = all_.radii[one] + all_.radii[other]
        raise StartError(
            f"robots {one + 1} and {other + 1} cannot start {apart:g} m apart, at {_place(all_, one)} and "
            f"{_place(all_, other)}: their bodies overlap. Put them more than {least:g} m apart"
        )


def _place(all_: Placed, robot: int) -> str:
    """Where a body is, of what flies with its height."""
    numbers = all_[:3] if all_.flies[robot] else all_[:2]
    return ", ".join(f"{each[robot]:g}" for each in numbers) + " m"


def _distinct(count: int, *indices: Whole) -> Whole:
    """The different ones of indices below `count`, ascending. (`np.unique` loads NumPy's masked arrays first.)"""
    found = np.zeros(count, np.bool_)
    for each in indices:
        found[each] = True
    return np.flatnonzero(found)
