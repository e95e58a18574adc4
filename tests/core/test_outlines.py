"""How deep ways lie inside of areas."""

from __future__ import annotations

from math import hypot, inf

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sleepcast.core.model import NamedArea
from sleepcast.core.outlines import corners_of, depth, depths

SQUARE = NamedArea("square", (0.0, 0.0, 10.0, 0.0, 10.0, 10.0, 0.0, 10.0))
NOTCHED = NamedArea("notched", (0.0, 0.0, 10.0, 0.0, 10.0, 10.0, 6.0, 10.0, 6.0, 3.0, 4.0, 3.0, 4.0, 10.0, 0.0, 10.0))
DISC = NamedArea("disc", (5.0, 5.0, 5.0))
NUMBERS = st.floats(-20.0, 20.0)


@pytest.mark.parametrize(
    ("area", "start", "end", "expected"),
    [
        (SQUARE, (2.0, 2.0), (5.0, 7.0), (2.0, inf)),
        (SQUARE, (-4.0, 5.0), (-3.0, 5.0), (-inf, -3.0)),
        (SQUARE, (-1.0, 5.0), (5.0, 5.0), (-inf, inf)),
        (SQUARE, (-5.0, 5.0), (15.0, 5.0), (-inf, inf)),
        (NOTCHED, (2.0, 8.0), (8.0, 8.0), (-inf, inf)),
        (NOTCHED, (2.0, 2.0), (8.0, 2.0), (1.0, inf)),
        (DISC, (5.0, 5.0), (5.0, 8.0), (2.0, 5.0)),
        (DISC, (-5.0, 11.0), (15.0, 11.0), (5.0 - hypot(10.0, 6.0), -1.0)),
    ],
)
def test_ways(
    area: NamedArea, start: tuple[float, float], end: tuple[float, float], expected: tuple[float, float]
) -> None:
    assert depths(area, start, end) == pytest.approx(expected)
    assert depths(area, end, start) == pytest.approx(expected), "the other way round"


@given(
    st.sampled_from([SQUARE, NOTCHED, DISC]),
    st.tuples(NUMBERS, NUMBERS),
    st.tuples(NUMBERS, NUMBERS),
    st.floats(0.0, 1.0),
)
def test_a_way_is_nowhere_deeper_or_less_deep_than_it_says(
    area: NamedArea, start: tuple[float, float], end: tuple[float, float], share: float
) -> None:
    point = start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
    least, greatest = depths(area, start, end)
    assume(abs(depth(area, point)) > 1e-9)
    assert least - 1e-9 <= depth(area, point) <= greatest + 1e-9


def test_a_disc_is_drawn_with_many_corners() -> None:
    assert all(hypot(x - 5.0, y - 5.0) == pytest.approx(5.0) for x, y in corners_of(DISC))
    assert corners_of(SQUARE) == ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
