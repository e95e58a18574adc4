"""What a large fleet tells: only what a test has asked for, from then on, and never what a robot has not told."""

from __future__ import annotations

from collections.abc import Sequence
from unittest.mock import patch

import numpy as np
import pytest

from fleet.twins import vocabulary
from language.cases import SENSORS
from sleepcast.core.serial import pack, unpack
from sleepcast.fleet import Fleet, telemetry
from sleepcast.fleet.schema import FleetSnapshot
from sleepcast.fleet.snapshot import restore, state_of
from sleepcast.fleet.telemetry import NOT_YET
from sleepcast.language import read
from sleepcast.station.preview import FleetNames

ROBOTS = 6
EVERYBODY = list(range(ROBOTS))
X = [sensor.name for sensor in SENSORS].index("x")


def made() -> Fleet:
    with patch.object(telemetry, "MANY", ROBOTS):
        return Fleet([f"s{i}" for i in range(ROBOTS)], vocabulary(), seed=1)


@pytest.fixture
def fleet(monkeypatch: pytest.MonkeyPatch) -> Fleet:
    """A fleet that counts as a large one, whose x is 0, 1, 2, ..."""
    monkeypatch.setattr(telemetry, "MANY", ROBOTS)
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
    yes, reason, reasons = fleet.telemetry.judge(program, np.array(robots, np.intp))
    index = np.array(robots)
    return index[yes].tolist(), index[reason > 0].tolist(), reasons


def test_what_nobody_has_asked_for_is_not_kept(fleet: Fleet) -> None:
    tell(fleet)
    assert not fleet.telemetry.state().values.columns
    assert judged(fleet, "(> x 3.5)") == ([4, 5], [], [])
    slot = fleet.vocabulary.first_sensor + X
    assert [*fleet.telemetry.state().values.columns] == [slot]


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
