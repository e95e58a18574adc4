"""How robots look in pictures: a body of some shape and some colour, perhaps with a spot, and perhaps a ring around it.

The looks are those of the page's map (`console/static/shapes.js`); only the colours differ, which are told apart on
light and on dark pages. Groups take the seven shapes and the seven colours in turn; after each round the colours are
shifted by one, and every other round has a spot, so that no two of 49 look alike and 14 differ without any colour. What
robots show with `COLOUR` takes the same shapes and colours in another order, and with the spot where groups have none.
A robot without either looks like its type, and points along its heading.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.fleet.marks import GroupCodes
from sleepcast.loop import Swarm
from sleepcast.simulator.simulation import OTHER_COLOUR

Corners = Sequence[tuple[float, float]]

SHAPES = ROUNDS = 7
PAIRS = SHAPES * ROUNDS
TYPES = 8
"""Looks of types of robots; those of groups follow, then those of colours."""
NONE = -1
"""No ring."""
MAX_COLOURS = 14
"""Different colours shown at one time; more are names rather than kinds, and nobody tells them apart."""
NEUTRAL, SECOND_NEUTRAL = 0, 8
INKS = ("#7a8b9c", "#fa5d13", "#4a50da", "#277d64", "#7b5580", "#85975f", "#d068e2", "#b62f36", "#5c6977")
SPOT, RING = 0.5, 2.0
"""Size of the spot, and of the ring, as a part of a body's size."""


class Appearance(NamedTuple):
    """How a body is drawn.

    corners: of the body, which is as large as 1.
    ink: its index in `INKS`.
    spot: whether it has one.
    points: whether it turns with the robot.
    """

    corners: Corners
    ink: int
    spot: bool = False
    points: bool = False


def _polygon(count: int, first: float, size: float) -> Corners:
    """The corners of a regular polygon, the first at an angle (rad)."""
    angles = first + np.arange(count) * 2.0 * np.pi / count
    return list(zip((size * np.cos(angles)).tolist(), (size * np.sin(angles)).tolist(), strict=True))


_TYPES: Sequence[Corners] = (
    ((1.35, 0.0), (-0.9, 0.8), (-0.45, 0.0), (-0.9, -0.8)),
    ((1.35, 0.0), (0.35, 0.8), (-1.0, 0.8), (-1.0, -0.8), (0.35, -0.8)),
    ((1.3, 0.3), (-0.2, 0.3), (-0.2, 1.1), (-0.9, 1.1), (-0.9, -1.1), (-0.2, -1.1), (-0.2, -0.3), (1.3, -0.3)),
    ((1.2, 0.0), (-0.6, 1.15), (-1.2, 0.75), (-0.1, 0.0), (-1.2, -0.75), (-0.6, -1.15)),
)
"""Bodies of robots that look along x: arrow, house, T, chevron."""
_BODIES = (
    _polygon(4, 0.0, 1.35),
    _polygon(4, np.pi / 4, 1.3),
    _polygon(16, 0.0, 1.05),
    _polygon(5, -np.pi / 2, 1.3),
    _polygon(3, -np.pi / 2, 1.45),
    _polygon(6, 0.0, 1.25),
    _polygon(3, np.pi / 2, 1.45),
)
"""Bodies of robots in groups, in pixels, which are counted downwards: diamond, square, disc, pentagon, triangle that
points up, hexagon, triangle that points down."""
_SPOT = _polygon(8, 0.0, SPOT)[::-1]
"""The other way round than the bodies, so that it is left out of them."""


def _of_type(number: int) -> Appearance:
    ink = SECOND_NEUTRAL if (number + number // len(_TYPES)) % 2 else NEUTRAL
    return Appearance(_TYPES[number % len(_TYPES)], ink, points=True)


def _of_pair(number: int, shift: int, spot: bool) -> Appearance:
    shape = number % SHAPES
    return Appearance(_BODIES[shape], 1 + (shape + shift) % SHAPES, spot)


LOOKS = (
    *(_of_type(number) for number in range(TYPES)),
    *(_of_pair(number, number // SHAPES, number // SHAPES % 2 == 1) for number in range(PAIRS)),
    *(_of_pair(number, ROUNDS - 1 - number // SHAPES, number // SHAPES % 2 == 0) for number in range(PAIRS)),
)


def of_group(code: int) -> int:
    """The look of the group with this number, from 1."""
    return TYPES + (code - 1) % PAIRS


def of_colour(number: int) -> int:
    """The look of a colour, from 1."""
    return TYPES + PAIRS + (number - 1) % PAIRS


_GROUPS = np.array([0, *map(of_group, range(1, 256))])
_COLOURS = np.array([0, *map(of_colour, range(1, 256))])


def bodies_of(types: NDArray[np.intp], codes: NDArray[np.uint8], colours: NDArray[np.uint8]) -> NDArray[np.intp]:
    """The look of each body: of its newest group, else of its colour, else of its type."""
    looks: NDArray[np.intp] = np.where(codes, _GROUPS[codes], np.where(colours, _COLOURS[colours], types))
    return looks


class SwarmLooks(NamedTuple):
    """How each robot of a swarm looks: its body and its ring, as indices in `LOOKS`, and NONE for no ring.

    entries: the looks with their meaning and the number of robots, for a legend.
    """

    bodies: NDArray[np.intp]
    rings: NDArray[np.intp]
    entries: list[tuple[int, str, int]]


def looks_of(swarm: Swarm) -> SwarmLooks:
    """How the robots look now. The body is that of the newest group, else of the colour, else of the type; the ring is
    that of the second newest group, else of the colour of a robot in a group."""
    simulator, groups = swarm.simulator, GroupCodes()
    count, types = len(simulator.names), simulator.scenario.each_type
    codes = np.frombuffer(groups.look(swarm.fleet), np.uint8)
    second = np.frombuffer(groups.second or bytes(count), np.uint8)
    colours = np.frombuffer(simulator.colours() or bytes(count), np.uint8)
    if np.count_nonzero(np.bincount(colours, minlength=1)[1:]) > MAX_COLOURS:
        colours = np.zeros(count, np.uint8)
    bodies = np.zeros(count, np.intp)
    entries = []
    for number, (settings, part) in enumerate(zip(types, simulator.bodies.of_each_type, strict=True)):
        bodies[part] = number
        if len(types) > 1:
            there = simulator.there[part]
            entries.append((number, settings.type, int(np.count_nonzero(there))))
    bodies = bodies_of(bodies, codes, colours)
    rings = np.where(second, _GROUPS[second], np.where(codes.astype(bool) & (colours > 0), _COLOURS[colours], NONE))
    entries += [
        (of_group(code), name, n) for code, (name, n) in enumerate(zip(groups.names, groups.counts, strict=True), 1)
    ]
    shown = np.bincount(colours, minlength=1)
    entries += [(of_colour(n), named(n), int(shown[n])) for n in range(1, len(shown)) if shown[n]]
    return SwarmLooks(bodies, rings, entries)


def named(colour: int) -> str:
    return "another colour" if colour == OTHER_COLOUR else f"colour {colour}"


def body(look: int, x: float, y: float, size: float, heading: float) -> str:
    """The outline of a robot at x, y as an SVG path. heading: rad, clockwise, as pixels are counted downwards."""
    look_of = LOOKS[look]
    cos, sin = (size * np.cos(heading), size * np.sin(heading)) if look_of.points else (size, 0.0)
    parts = (look_of.corners, _SPOT) if look_of.spot else (look_of.corners,)
    return "".join(_path(part, x, y, cos, sin) for part in parts)


def ring(look: int, x: float, y: float, size: float) -> str:
    """The ring around a robot at x, y as an SVG path: the outline of the look's body, wider than any body."""
    return _path(LOOKS[look].corners, x, y, RING * size, 0.0)


def _path(corners: Corners, x: float, y: float, cos: float, sin: float) -> str:
    return f"M{'L'.join(f'{x + a * cos - b * sin:.1f} {y + a * sin + b * cos:.1f}' for a, b in corners)}Z"
