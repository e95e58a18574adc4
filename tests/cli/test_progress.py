"""How far something has come, in a log."""

from __future__ import annotations

import pytest

from sleepcast.cli import progress
from sleepcast.cli.progress import LOGGED, Status


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What the time is, s; a test changes it."""
    now = [100.0]
    monkeypatch.setattr(progress, "perf_counter", lambda: now[0])
    return now


def test_a_log_ends_with_what_is_so_at_the_end(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with Status() as status:
        status.show("stopped 0, silent 1")
        clock[0] += 0.5 * LOGGED
        status.show("stopped 1, silent 0")
        assert capsys.readouterr().err == "stopped 0, silent 1\n", "not every line, as it may change often"
    assert capsys.readouterr().err == "stopped 1, silent 0\n"


def test_a_log_says_nothing_twice(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with Status() as status:
        for text in ("stopped 0", "stopped 1", "stopped 1"):
            status.show(text)
            clock[0] += 2.0 * LOGGED
    with Status():
        pass
    assert capsys.readouterr().err == "stopped 0\nstopped 1\n"
