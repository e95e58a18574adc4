"""A flood of forgeries, or of questions, on the loopback, among real processes; `python -m benchmarks.channel flood
questions` is the large one."""

from __future__ import annotations

import sys
from math import inf

import pytest
from benchmarks.channel.flood import tried
from benchmarks.channel.questions import tried as asked

RATE = 20_000
"""Forgeries a second: what a busy machine can send beside the robots."""
SLACK = 60.0
"""s for answers, which robots may be slow to give on a busy machine; how fast they are is for the large one to say."""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such filters")
@pytest.mark.parametrize("words", [["swarm", "5"], ["node"]])
def test_stop_and_commands_come_through_a_flood_of_forged_stops(words: list[str]) -> None:
    found = tried(words, 5 if words[0] == "swarm" else 1, "stop", RATE, 1, slack=SLACK)
    assert max(found.stops) < inf
    assert found.silent == 0
    assert found.through == found.pairs


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such filters")
def test_stop_and_its_account_come_through_a_flood_of_anything_else() -> None:
    found = tried(["swarm", "5"], 5, "command", RATE, 1, commands=0, slack=SLACK)
    assert max(found.stops) < inf
    assert found.silent == 0


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such filters")
def test_stop_and_commands_come_through_questions_without_end() -> None:
    found = asked(["swarm", "5"], "steady", 1, patience=SLACK)
    assert max(found.stops) < inf
    assert found.silent == 0
