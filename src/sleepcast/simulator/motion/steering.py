"""How particles turn in space: formulas for arrays of shape (3, bodies), one column for each body. SI, angles in rad.

A direction is a unit vector, or, as bodies have it, a heading (counter-clockwise from the x axis) and a pitch, which is
how far it points up.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.motion.driving import bounded
from sleepcast.simulator.simd.formulas import arc_tangent, either, sine_cosine
from sleepcast.simulator.world.grid import Floats

OPPOSITE = 1e-8
"""rad: who wants a direction so near to the opposite one turns to its left, since the side to which it lies is lost in
rounding."""


def pointing(heading: Floats, pitch: Floats) -> tuple[Floats, Floats, Floats]:
    """The unit vectors, x, y and z, of these headings and pitches."""
    (sine, cosine), (rise, level) = sine_cosine(heading), sine_cosine(pitch)
    return cosine * level, sine * level, rise


def headed(direction: Floats) -> tuple[Floats, Floats]:
    """Heading and pitch of these vectors of any length; both 0 of the zero vector."""
    x, y, z = direction
    return arc_tangent(y, x), arc_tangent(z, np.sqrt(x * x + y * y))


def unit(vectors: Floats) -> Floats:
    """These vectors with length 1, also where they are too long or too short to be squared; the zero vector stays."""
    largest = np.max(np.abs(vectors), axis=0)
    scaled = vectors / either(largest > 0.0, largest, 1.0)
    length = np.sqrt(_product(scaled, scaled))
    return scaled / either(length > 0.0, length, 1.0)


def turned(direction: Floats, wanted: Floats, most: Floats | float) -> Floats:
    """Unit vectors that have turned towards the wanted ones, at most by the angle `most`. Who wants the opposite turns
    level, to its left; who wants the zero vector goes straight on."""
    along = _product(direction, wanted)
    aside = wanted - along * direction
    length = np.sqrt(_product(aside, aside))
    angle, straight = arc_tangent(length, along), (wanted == 0.0).all(axis=0)
    opposite = (length < OPPOSITE) & (along < 0.0)
    aside = either(opposite, _left(direction), aside / either(length > 0.0, length, 1.0))
    sine, cosine = sine_cosine(bounded(angle, 0.0, most))
    part = unit(cosine * direction + sine * aside)
    return either(straight, direction, either(angle <= most, wanted, part))


def _left(direction: Floats) -> Floats:
    """Level unit vectors to the left of these; of what points straight up or down, along x."""
    x, y, _ = direction
    upright = either((x == 0.0) & (y == 0.0), 1.0, 0.0)
    return unit(np.stack((upright - y, x, np.zeros_like(x))))


def _product(one: Floats, other: Floats) -> Floats:
    """The scalar products of vectors."""
    product: Floats = one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
    return product
