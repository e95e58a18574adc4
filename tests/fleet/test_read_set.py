"""Attention: everything that a tick reads is named before it, through buffers, operators and messages."""

from __future__ import annotations

from random import Random
from unittest.mock import patch

from hypothesis import given, note, settings
from hypothesis import strategies as st

from fleet.twins import Twins
from language.authors import Author
from language.cases import SENSORS
from sleepcast.fleet.columns import Column, FleetState, Rows


def names(twins: Twins) -> set[str]:
    first = twins.fleet.vocabulary.first_sensor
    return {SENSORS[slot - first].name for slot in twins.fleet.reads() if first <= slot < first + len(SENSORS)}


def test_rules_are_followed_through_buffers_and_operators() -> None:
    twins = Twins(3)
    assert names(twins) == set()
    twins.do("(PROGN (SETQQ E4 (SETQ lamp sonar1)) (DEFUN far (a) (> a sonar2)))")
    assert names(twins) == set()
    twins.do("(RULE r (WHEN (far x) E4))")
    assert names(twins) == {"x", "sonar1", "sonar2"}
    twins.do("(DEACTIVATE r)")
    assert names(twins) == set()


def test_messages_that_wait_are_looked_into() -> None:
    twins = Twins(3)
    twins.send("(SETQ lamp (+ speed y))", [1])
    assert names(twins) == {"speed", "y"}
    twins.think()
    assert names(twins) == set()
    twins.send("(RULE r (SETQ lamp sonar3))", [2])
    assert names(twins) == {sensor.name for sensor in SENSORS}
    twins.think()
    assert names(twins) == {"sonar3"}


@settings(max_examples=200)
@given(start=st.integers(0, 2**63))
def test_nothing_else_is_read(start: int) -> None:
    chance = Random(start)
    author, twins = Author(chance, deepest=3), Twins(3, seed=start % 1_000)
    twins.fleet.kernels = twins.fleet.memory.kernels = None
    twins.sense([[chance.choice((0.0, 0.5, 3.0)) for _ in SENSORS] for _ in range(3)])
    asked: set[int] = set()
    first = twins.fleet.vocabulary.first_sensor
    sensors = range(first, first + len(SENSORS))
    reading = FleetState.read

    def watching(self: FleetState, slot: int, rows: Rows) -> Column | float:
        asked.add(slot)
        return reading(self, slot, rows)

    for step in range(4):
        text = f"(RULE r{step} {author.text()})" if chance.random() < 0.5 else author.text()
        note(text)
        twins.send(text)
        for _ in range(2):
            named = twins.fleet.reads()
            asked.clear()
            with patch.object(FleetState, "read", watching):
                twins.think()
            assert asked.intersection(sensors) <= named
