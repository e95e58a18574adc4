"""Statistics of angles. 179 and -179 degrees are two degrees apart, and their mean is 180, not 0.

The mean is the direction of the sum of unit vectors; the circular standard deviation is sqrt(-2 ln R) for a mean vector
of length R (Mardia and Jupp, 2000). Where the vectors cancel, there is no mean direction, and nothing that is measured
from it: all is NaN then. Least, greatest and median values are those of the deviations from the mean direction, within
half a turn on either side.
"""

from __future__ import annotations

from math import atan2, log, nan, sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TURN = 2.0 * np.pi
CANCELLED = 1e-9
"""Length of the mean of unit vectors below which rounding alone may have given its direction."""


def mean_direction(angles: Floats) -> float:
    """The circular mean of some angles, rad in -pi..pi; NaN where there is none."""
    return _mean_vector(angles)[0]


def deviation(angles: Floats) -> float:
    """The circular standard deviation of some angles, rad; NaN where they have no mean direction."""
    direction, length = _mean_vector(angles)
    return nan if direction != direction else sqrt(max(0.0, -2.0 * log(min(length, 1.0))))


def around_mean(angles: Floats) -> Floats:
    """The same angles, each within half a turn of their mean direction, rad, so perhaps beyond -pi..pi."""
    direction = mean_direction(angles)
    return direction + wrapped(angles - direction)


def widest_gap(angles: Floats) -> float:
    """The widest angle between two directions next to each other, rad; a whole turn for a single one."""
    turned = np.sort(angles % TURN)
    return float(np.diff(turned, append=turned[0] + TURN).max())


def wrapped(angles: Floats) -> Floats:
    """The same angles within -pi..pi."""
    turned: Floats = angles - TURN * np.round(angles / TURN)
    return turned


def quantile(angles: Floats, share: float) -> float:
    """The angle up to which this share of them lies, seen from their mean direction, rad in -pi..pi; 0 for the least,
    0.5 for the median, 1 for the greatest. NaN where they have no mean direction."""
    return float(wrapped(np.array(np.quantile(around_mean(angles), share))))


def _mean_vector(angles: Floats) -> tuple[float, float]:
    """Direction and length of the mean of unit vectors; NaN for the direction if they cancel."""
    if not angles.size:
        return nan, nan
    x, y = float(np.cos(angles).mean()), float(np.sin(angles).mean())
    length = sqrt(x * x + y * y)
    return (atan2(y, x) if length > CANCELLED else nan), length
