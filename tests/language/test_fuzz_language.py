"""The fuzzer runs: for some seconds here, for longer where the environment says CI, or for as long as it is told."""

from __future__ import annotations

import os

import pytest

from language.fuzz_language import TEXTS, fuzz

SECONDS = float(os.environ.get("SLEEPCAST_FUZZ_SECONDS", "20" if os.environ.get("CI") else "5"))
SEED = int(os.environ.get("SLEEPCAST_FUZZ_SEED", "0"))


@pytest.mark.slow
def test_no_text_crashes_hangs_or_grows() -> None:
    report = fuzz(SECONDS, SEED)
    print(report)
    assert report.robots >= 3
    assert report.texts == report.robots * TEXTS
    assert 0.1 * report.texts < report.refused < 0.9 * report.texts
    assert report.faulted > 0.02 * report.texts
