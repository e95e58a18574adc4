"""What a large fleet tells: only what a test has asked for, from then on, and never what a robot has not told."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from random import Random
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from fleet.twins import Twins, vocabulary
from language.authors import Author
from language.cases import SENSORS
from sleepcast.columns.telemetry import NOT_YET
from sleepcast.columns.values import Column, Rows, ValueColumns
from sleepcast.core.serial import pack, unpack
from sleepcast.fleet import Fleet, inspection
from sleepcast.fleet.schema import FleetSnapshot
from sleepcast.fleet.snapshot import restore, state_of
from sleepcast.fleet.state import FleetState
from sleepcast.language import read
from sleepcast.language.evaluate import is_true
from sleepcast.station.validation import FleetNames

ROBOTS = 6
EVERYBODY = list(range(ROBOTS))
X = [sensor.name for sensor in SENSORS].index("x")


def made() -> Fleet:
    with patch.object(inspection, "MANY", ROBOTS):
        return Fleet([f"s{i}" for i in range(ROBOTS)], vocabulary(), seed=1)


@pytest.fixture
def fleet(monkeypatch: pytest.MonkeyPatch) -> Fleet:
    """A fleet that counts as a large one, whose x is 0, 1, 2, ..."""
    monkeypatch.setattr(inspection, "MANY", ROBOTS)
    fleet = Fleet([f"s{i}" for i in range(ROBOTS)], vocabulary(), seed=1)
    measure(fleet, np.arange(ROBOTS, dtype=float))
    return fleet


def measure(fleet: Fleet, x: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    readings = np.full((ROBOTS, len(SENSORS)), np.nan)
    readings[:, X] = x
    fleet.sense(readings, 0.0)


def tell(fleet: Fleet, robots: Sequence[int] = EVERYBODY) -> None:
    fleet.telemetry.take(np.array(robots, np.intp))


def judged(fleet: Fleet, text: str, robots: Sequence[int] = EVERYBODY) -> tuple[list[int], list[int], list[str]]:
    """For whom a test holds, of whom that cannot be said, and the reasons."""
    names = FleetNames(fleet.vocabulary, fleet)
    program = fleet.minds.library.program(text, lambda: [read(text)], names)
    values, reason, reasons = fleet.telemetry.values(program, np.array(robots, np.intp))
    index = np.array(robots)
    return index[is_true(values)].tolist(), index[reason > 0].tolist(), reasons


def test_what_nobody_has_asked_for_is_not_kept(fleet: Fleet) -> None:
    tell(fleet)
    assert not fleet.telemetry.state().values.columns
    assert judged(fleet, "(> x 3.5)") == ([4, 5], [], [])
    slot = fleet.vocabulary.first_sensor + X
    assert [*fleet.telemetry.state().values.columns] == [slot]


def test_values_of_robots_that_have_not_told_are_unknown(fleet: Fleet) -> None:
    tell(fleet)
    tell(fleet, [1, 4])
    names = FleetNames(fleet.vocabulary, fleet)
    program = fleet.minds.library.program("(* 2 x)", lambda: [read("(* 2 x)")], names)
    values, reason, reasons = fleet.telemetry.values(program, np.array(EVERYBODY, np.intp))
    assert np.array_equal(values, [np.nan, 2.0, np.nan, np.nan, 8.0, np.nan], equal_nan=True)
    assert reason.tolist() == [1, 0, 1, 1, 0, 1]
    assert reasons == [NOT_YET]


def test_from_then_on_it_stays_what_was_told(fleet: Fleet) -> None:
    tell(fleet)
    judged(fleet, "(> x 3.5)")
    measure(fleet, np.arange(ROBOTS, dtype=float)[::-1])
    assert judged(fleet, "(> x 3.5)")[0] == [4, 5]
    tell(fleet, [0, 5])
    assert judged(fleet, "(> x 3.5)")[0] == [0, 4]


def test_who_did_not_tell_last_is_not_known_until_it_tells(fleet: Fleet) -> None:
    tell(fleet)
    tell(fleet, [1, 4, 5])
    assert judged(fleet, "(> x 3.5)") == ([4, 5], [0, 2, 3], [NOT_YET])
    assert judged(fleet, "(PROB 0.5)")[1] == EVERYBODY
    tell(fleet, [0, 2])
    assert judged(fleet, "(> x 3.5)", [0, 1, 3]) == ([], [3], [NOT_YET])


def test_what_rules_read_is_asked_for_as_well(fleet: Fleet) -> None:
    fleet.evaluate("(SETQ E4 '(> x 3.5))")
    tell(fleet)
    assert judged(fleet, "E4") == ([4, 5], [], [])
    measure(fleet, np.zeros(ROBOTS))
    assert judged(fleet, "E4") == ([4, 5], [], [])


def test_a_snapshot_keeps_who_has_told_what(fleet: Fleet) -> None:
    tell(fleet)
    tell(fleet, [1, 4, 5])
    judged(fleet, "(> x 3.5)")
    again = made()
    restore(again, unpack(FleetSnapshot, pack(state_of(fleet), 1 << 20), 1 << 20, "fleet"), 0.0)
    measure(again, np.zeros(ROBOTS))
    assert judged(again, "(> x 3.5)") == ([4, 5], [0, 2, 3], [NOT_YET])
    assert judged(again, "(> y 0)")[1] == [0, 2, 3]


def test_a_snapshot_of_before_that_was_kept_is_one_of_robots_that_told_everything(fleet: Fleet) -> None:
    tell(fleet)
    judged(fleet, "(AND (> x 3.5) (> y 0))")
    parcel = state_of(fleet)
    parcel.told.asked = parcel.told.last = None
    again = made()
    restore(again, parcel, 0.0)
    assert judged(again, "(> x 3.5)") == ([4, 5], [], [])


# Attention: everything that a tick reads is named before it, through buffers, operators and messages.


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


def test_a_rule_that_another_one_stores_anew_may_read_anything() -> None:
    twins = Twins(3)
    twins.do("(RULE r (WHEN (> speed 1) (ST)))")
    assert names(twins) == {"speed"}
    twins.do("(RULE q (RULE r (WHEN (> y 1) (ST))))")
    assert names(twins) == {sensor.name for sensor in SENSORS}


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


@settings(max_examples=max(50, settings().max_examples // 4))
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


@given(st.integers(0, 2**32))
def test_all_is_copied_in_one_go_as_it_is_one_by_one(start: int) -> None:
    chance, size = Random(start), 5
    there, together, apart = (ValueColumns(size, [nan] * 4) for _ in range(3))
    everybody = Rows.run(0, size)
    there.share(3, np.arange(10.0)[None, ::2])
    for _ in range(6):
        for _ in range(chance.randrange(4)):
            slot = chance.choice((0, 1, 2, 4, 6))
            some = Rows.of(np.array(sorted(chance.sample(range(size), chance.randint(1, size)))))
            there.assign(slot, some, chance.choice((chance.random(), np.array([chance.random() for _ in some.robots]))))
        if chance.random() < 0.3:
            few = Rows.of(np.array([chance.randrange(size)]))
            for each in (together, apart):
                each.copy_from(there, few, there.slots())
        else:
            together.copy_all(there)
            apart.copy_from(there, everybody, there.slots())
        for slot in there.slots():
            found, wanted = (np.broadcast_to(each.read(slot, everybody), size) for each in (together, apart))
            np.testing.assert_array_equal(found, wanted)
