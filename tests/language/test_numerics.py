"""The angle of a point against the C library's, which may be wrong in its last bit as well."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sleepcast.language.numerics import angle

FINITE = st.floats(allow_nan=False, allow_infinity=False)
NEAR = st.floats(-10.0, 10.0)
EDGES = (0.0, -0.0, 1.0, -1.0, 5e-324, -5e-324, 1e-310, 1.7e308, -1.7e308, 2.0**1000, 3.0, 0.41421356237309503)

SOME = ["-0x1.07c6c6947a6a8p+0", "-0x1.dac670561bb50p-1", "-0x1.921fb54442d18p-1", "-0x1.2d0ead6066394p-1"]


def close(y: float, x: float) -> bool:
    found, wanted = angle(y, x), math.atan2(y, x)
    return abs(found - wanted) <= 1.5 * math.ulp(wanted) and math.copysign(1.0, found) == math.copysign(1.0, y)


@settings(max_examples=max(500, settings().max_examples))
@given(y=FINITE | NEAR, x=FINITE | NEAR)
def test_it_is_right_to_the_last_place_but_one(y: float, x: float) -> None:
    assert close(y, x)


def test_the_edges_are_those_of_c() -> None:
    for y in EDGES:
        for x in EDGES:
            assert close(y, x), (y, x)
    for y, x in (
        (0.0, 1.0),
        (-0.0, 1.0),
        (0.0, -1.0),
        (-0.0, -0.0),
        (1.0, 0.0),
        (-1.0, -0.0),
        (1.0, 1.0),
        (-2.0, -2.0),
    ):
        assert angle(y, x).hex() == math.atan2(y, x).hex(), (y, x)


@pytest.mark.parametrize("radius", [1e-300, 1.0, 1e300])
def test_it_grows_all_the_way_round(radius: float) -> None:
    steps = [math.pi * (i / 5_000 - 1.0) for i in range(1, 10_000)]
    found = [angle(radius * math.sin(a), radius * math.cos(a)) for a in steps]
    assert all(first < second for first, second in pairwise(found))


def test_its_bits_are_the_same_everywhere() -> None:
    """Made of sums, products and quotients of 64-bit floats, which no processor may do otherwise."""
    assert [angle(0.1 * i - 0.5, 0.3).hex() for i in range(4)] == SOME
