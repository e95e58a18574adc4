"""What a ground map hides: places that the ground between rises above the line of sight to.

A line is looked at in places that lie at most half a pixel apart, the same ones from both of its ends: in a plain world
who sees is seen. It begins and ends one radius of the largest body above the ground or whatever stands there, since the
middle of a body is no point on the ground: so robots see each other along a slope, and not across its crest.
"""

from __future__ import annotations

from itertools import pairwise
from math import inf

import numpy as np

from sleepcast.simulator.world.grey_picture import Picture, Stretched
from sleepcast.simulator.world.grid import Floats, Whole
from sleepcast.simulator.world.sight import Ends, Flags, Levels

AT_ONCE = 1_000_000
"""Places that are looked at together."""


class HidingGround:
    """The ground of a world as it hides. picture, terrain: the ground map; size: of the world, m; above: m by which
    lines lie higher than their ends."""

    def __init__(self, picture: Picture, terrain: Stretched, size: tuple[float, float], above: float) -> None:
        self._terrain, self._above, self._top = terrain, above, picture.high
        self._pixel = size[0] / picture.columns, size[1] / picture.rows

    def hide(self, ends: Ends, levels: Levels) -> Flags:
        """Whether the ground hides the end of each line from its beginning. levels: z of both, m."""
        return self.stops(ends, levels) < inf

    def stops(self, ends: Ends, levels: Levels) -> Floats:
        """At which share of each line, 0 to 1, the ground first hides its end; infinite where it does not."""
        found = np.full(len(ends[0]), inf)
        z, to_z = (each + self._above for each in levels)
        low = np.flatnonzero(np.minimum(z, to_z) < self._top)
        x, y, to_x, to_y = (each[low] for each in ends)
        turned = (to_x < x) | ((to_x == x) & (to_y < y))
        begin = np.where(turned, (to_x, to_y, to_z[low]), (x, y, z[low]))
        end = np.where(turned, (x, y, z[low]), (to_x, to_y, to_z[low]))
        steps = np.maximum(np.abs(to_x - x) / self._pixel[0], np.abs(to_y - y) / self._pixel[1])
        counts = np.ceil(2.0 * steps).astype(np.int64)
        for some in _parts(counts):
            which, shares = _shares(counts[some])
            place = begin[:, some][:, which] + shares * (end - begin)[:, some][:, which]
            hit = self._terrain.at(place[0], place[1])[0] > place[2]
            which, shares = which[hit], shares[hit]
            np.minimum.at(found, low[some][which], np.where(turned[some][which], 1.0 - shares, shares))
        return found


def _parts(counts: Whole) -> list[slice]:
    """Stretches of lines that have so many places, each with at most `AT_ONCE` of these, or a single line."""
    part = np.cumsum(counts) // AT_ONCE
    borders = [0, *(np.flatnonzero(np.diff(part)) + 1).tolist(), len(counts)]
    return [slice(first, last) for first, last in pairwise(borders) if first < last]


def _shares(counts: Whole) -> tuple[Whole, Floats]:
    """The places on lines that are parted into so many pieces: the index of the line, and the share of it."""
    inner = np.maximum(counts - 1, 0)
    which = np.repeat(np.arange(len(counts)), inner)
    number = np.arange(len(which)) - np.repeat(np.cumsum(inner) - inner, inner) + 1
    return which, number / counts[which]
