"""Fixtures of the desk's tests."""

from __future__ import annotations

import pytest

from station.fleet import Fleet


@pytest.fixture
def fleet() -> Fleet:
    """Ten scouts, none of which the desk has heard from."""
    return Fleet()
