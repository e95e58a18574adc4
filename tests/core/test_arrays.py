"""Arrays laid out for the caches."""

from __future__ import annotations

import numpy as np
import pytest

from sleepcast.core.arrays import LINE, PAGE, block, filled


def place(array: np.ndarray) -> int:
    return int(array.ctypes.data) % PAGE


@pytest.mark.parametrize("sort", [np.float64, np.uint16, np.bool_])
def test_an_array_is_full_of_its_value_and_has_its_shape(sort):
    for shape in ((), (0,), (5,), (5_000,), (3, 4_001)):
        found = filled(1.0, sort, *shape)
        assert found.shape == shape
        assert found.dtype == sort
        assert found.flags.c_contiguous
        assert (found == 1).all()


def test_large_arrays_begin_with_lines_at_different_places_of_a_page():
    arrays = [filled(np.nan, np.float64, 10_000) for _ in range(PAGE // LINE)]
    places = {place(array) for array in arrays}
    assert len(places) == len(arrays)
    assert not any(start % LINE for start in places)


def test_arrays_do_not_share_memory():
    one, other = filled(0, np.int32, 2_000), filled(1, np.int32, 2_000)
    one[:] = 7
    assert (other == 1).all()
    assert not np.shares_memory(one, other)


@pytest.mark.parametrize("size", [0, 1, 100, PAGE - 1, PAGE, 3 * PAGE])
def test_a_block_begins_with_a_line_and_few_bytes_take_no_pages(size):
    found = block(size, 7 * LINE)
    assert len(found) == size
    assert size == 0 or place(found) % LINE == 0
    assert found.base.nbytes <= size + 2 * (LINE if size < PAGE else PAGE)
