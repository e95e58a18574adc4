"""What counts as true, for many robots at a time, as the language has it for one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def is_true(values: NDArray[np.float64] | float) -> NDArray[np.bool_]:
    """Which values count as true: all numbers but 0, and not unknown (NaN). Of the shape of `values`."""
    found: NDArray[np.bool_] = np.abs(values) > 0.0
    return found
