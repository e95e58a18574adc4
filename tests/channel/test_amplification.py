"""Requests and digests, played again and new: what a robot sends for them is bounded."""

from __future__ import annotations

import pytest
from benchmarks.channel.amplification import AT_ONCE, attacked

from sleepcast.channel.reliable import REPAIR_RATE

SECONDS = 3.0


@pytest.mark.parametrize("kind", ["request", "digest"])
def test_what_is_played_again_is_answered_once(kind: str) -> None:
    short, long = (attacked(f"replayed {kind}", seconds) for seconds in (SECONDS, 2.0 * SECONDS))
    assert 0 < short.said <= AT_ONCE
    assert long.said - short.said < 1_000, "but for a digest of its own"


@pytest.mark.parametrize("kind", ["request", "digest"])
def test_whoever_asks_without_end_gets_no_more_than_so_many_bytes_a_second(kind: str) -> None:
    found = attacked(f"new {kind}", SECONDS)
    assert 0 < found.said <= AT_ONCE + SECONDS * REPAIR_RATE
