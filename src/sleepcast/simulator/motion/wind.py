"""How vectors flow at any place, and how the air moves at any time: a uniform wind, swirls, and gusts. SI.

Gusts are a pattern that the uniform wind carries over the ground as it is (Taylor's frozen turbulence, 1938). Each node
of a lattice has a vector by chance, and between nodes there is something between. So the air at a place is a formula of
the seed, the place and the time: nothing of it is kept, and whoever asks twice is told the same.
"""

from __future__ import annotations

import numpy as np

from sleepcast.core.counter_rng import key, uniform
from sleepcast.simulator.scenario.fields import VectorField
from sleepcast.simulator.scenario.wind import WindSpec
from sleepcast.simulator.simd.formulas import exponential, shortest
from sleepcast.simulator.world.grid import Floats, Whole
from sleepcast.simulator.world.torus import Around

ROOT_OF_E = 1.6487212707001282
HALF, LOWER_HALF = np.uint64(32), np.uint64(0xFFFF_FFFF)
"""Of the number of a node: its column stands above the lower half, its row in it."""


def flow(field: VectorField, x: Floats, y: Floats, around: Around) -> tuple[Floats, Floats]:
    """A vector field, to the east and to the north."""
    dx, dy = (np.full(x.size, each) for each in field.uniform)
    for swirl in field.swirls:
        # The stream function is Gaussian: the speed grows with the distance d as d exp(-d^2/(2 radius^2)), which is
        # greatest at `radius`.
        from_x, from_y = shortest(x - swirl.x, around[0]), shortest(y - swirl.y, around[1])
        square, radius = from_x * from_x + from_y * from_y, swirl.radius
        rate = swirl.peak * ROOT_OF_E / radius * exponential(square / (-2.0 * radius * radius))
        dx += -rate * from_y
        dy += rate * from_x
    return dx, dy


def wind_at(spec: WindSpec, seed: int, time: float, x: Floats, y: Floats, around: Around) -> tuple[Floats, Floats]:
    """The speed of the air to the east and to the north at these places, m/s. around: of a torus, at whose edge gusts
    begin anew."""
    east, north = flow(spec.flow, x, y, around)
    if spec.gusts:
        to_east, to_north = spec.flow.uniform
        along, aside = (x - to_east * time) / spec.gust_size, (y - to_north * time) / spec.gust_size
        east += spec.gusts * _between_nodes(key(seed, "gust", "east"), along, aside)
        north += spec.gusts * _between_nodes(key(seed, "gust", "north"), along, aside)
    return east, north


def _between_nodes(chance: int, along: Floats, aside: Floats) -> Floats:
    """Numbers from -1 to 1 that change smoothly from node to node, whose distance is 1."""
    column, row = np.floor(along), np.floor(aside)
    share_x, share_y = _smooth(along - column), _smooth(aside - row)
    left, bottom = column.astype(np.int64), row.astype(np.int64)
    low, high = (
        _drawn(chance, left, bottom + up) * (1.0 - share_x) + _drawn(chance, left + 1, bottom + up) * share_x
        for up in (0, 1)
    )
    smooth: Floats = low * (1.0 - share_y) + high * share_y
    return smooth


def _drawn(chance: int, column: Whole, row: Whole) -> Floats:
    nodes = (column.astype(np.uint64) << HALF) ^ (row.astype(np.uint64) & LOWER_HALF)
    drawn: Floats = 2.0 * uniform(chance, nodes) - 1.0
    return drawn


def _smooth(share: Floats) -> Floats:
    """From 0 to 1 without a kink at the ends."""
    return share * share * (3.0 - 2.0 * share)
