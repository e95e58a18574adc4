"""Forged datagrams, some thousands of each sort; `python -m benchmarks.channel.fuzz` sends as many as one likes."""

from __future__ import annotations

import pytest
from benchmarks.channel.fuzz import Fuzzer

from sleepcast.channel.drops import DropReason
from sleepcast.channel.keys import PublicKey

REASONS = {
    *(DropReason.MALFORMED, DropReason.UNKNOWN_KEY, DropReason.REVOKED, DropReason.NOT_ALLOWED, DropReason.LATE),
    *(DropReason.REPEATED, DropReason.TOO_MANY, DropReason.FORGED),
}


def test_nothing_that_is_forged_moves_a_robot_or_makes_it_speak() -> None:
    fuzzer = Fuzzer(seed=1)
    for _ in range(2):
        fuzzer.round(16_000)
    found = fuzzer.findings
    assert (found.executed, found.differing, found.uncounted) == (0, 0, 0)
    assert found.legitimate == 2
    assert min(found.ways.values()) > 1_000
    assert set(found.dropped) >= REASONS
    assert found.overheard > 0


def test_the_fuzzer_sees_a_robot_that_believes_everybody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PublicKey, "signed", lambda *_: True)
    fuzzer = Fuzzer(seed=1)
    fuzzer.round(2_000)
    assert fuzzer.findings.executed > 0
    assert fuzzer.findings.differing == 1
