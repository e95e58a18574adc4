"""The keys of chance that compiled code finds are those of Python."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sleepcast.core.counter_rng import key
from sleepcast.core.given_numbers import MAX_SEED

pytest.importorskip("numba")

from sleepcast.simulator.quiet.blocks import chance_texts
from sleepcast.simulator.quiet.kernels_chance import keys_of
from sleepcast.simulator.quiet.layout import PURPOSES

TICKS = st.one_of(st.integers(0, 1_000), st.integers(0, 2**62), st.sampled_from([9, 10, 99, 100, 999_999_999, 10**9]))


@settings(max_examples=100, deadline=None)
@given(st.integers(0, MAX_SEED), TICKS)
def test_they_are_hashes_of_the_same_texts(seed: int, tick: int) -> None:
    found = np.zeros(2 * PURPOSES, np.int64)
    keys_of(chance_texts(seed), tick, found)
    wanted = [key(seed, *what, tick) for what in (("slip", "left"), ("slip", "right"), ("echo",), ("dropout",))]
    assert found[:PURPOSES].view(np.uint64).tolist() == wanted
