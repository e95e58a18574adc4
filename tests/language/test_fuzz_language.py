"""The fuzzer runs: for seconds with the same texts as ever, at night for minutes with new ones, or as it is told."""

from __future__ import annotations

import os
import time

import pytest

from language.fuzz_language import TEXTS, fuzz


@pytest.mark.slow
def test_no_text_crashes_hangs_or_grows(request: pytest.FixtureRequest) -> None:
    nightly = request.config.getoption("--hypothesis-profile") == "nightly"
    seconds = float(os.environ.get("SLEEPCAST_FUZZ_SECONDS", "300" if nightly else "5"))
    report = fuzz(seconds, int(os.environ.get("SLEEPCAST_FUZZ_SEED", time.time_ns() if nightly else 0)))
    print(report)
    assert report.robots >= 3
    assert report.texts == report.robots * TEXTS
    assert 0.1 * report.texts < report.refused < 0.9 * report.texts
    assert report.faulted > 0.02 * report.texts
