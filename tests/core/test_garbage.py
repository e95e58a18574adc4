"""Garbage is sought seldom only meanwhile, and not at all where it never was."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import suppress

import pytest

from sleepcast.core.garbage import SELDOM, sought_seldom


@pytest.fixture(autouse=True)
def thresholds() -> Iterator[None]:
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


def test_python_looks_as_often_as_before_afterwards() -> None:
    gc.set_threshold(700, 10, 10)
    with suppress(ZeroDivisionError), sought_seldom():
        assert gc.get_threshold() == SELDOM
        raise ZeroDivisionError
    assert gc.get_threshold() == (700, 10, 10)


@pytest.mark.parametrize("chosen", [(0, 10, 10), (1_000_000, 30, 30)])
def test_who_looks_more_seldom_or_never_still_does(chosen: tuple[int, int, int]) -> None:
    gc.set_threshold(*chosen)
    with sought_seldom():
        assert gc.get_threshold() == chosen
