"""Garbage is found when a tick is over, and never in between."""

from __future__ import annotations

import gc
import weakref

from sleepcast.loop.real import THOROUGH, PacedCollector


class Knot:
    """It holds itself, so that nobody but the collector lets it go."""

    def __init__(self) -> None:
        self.itself = self


def test_garbage_waits_for_the_end_of_a_tick() -> None:
    with PacedCollector() as collector:
        knot = weakref.ref(Knot())
        [[each] for each in range(100_000)]  # enough for the collector to look by itself, if it did
        assert knot() is not None
        collector.collect()
        assert knot() is None


def test_what_lived_for_a_while_is_found_as_well() -> None:
    with PacedCollector() as collector:
        kept = Knot()
        knot = weakref.ref(kept)
        collector.collect()
        del kept
        for _ in range(THOROUGH):
            collector.collect()
        assert knot() is None


def test_the_collector_is_left_as_it_was() -> None:
    with PacedCollector():
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
