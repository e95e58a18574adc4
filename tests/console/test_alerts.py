"""Alerts: which firings there are, of which robots, and what a person is told of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from sleepcast.console.features import alerts
from sleepcast.console.features.alerts import LOOK_EVERY, MAX_ALERTS, MAX_FIRINGS, TOGETHER, AlertBoard
from sleepcast.console.values import Column, Index, Mask
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.language import Checked
from station.fleet import Fleet

LOW = "(< fuel 30%)"


@dataclass
class Told:
    """What robots told the desk (its `Values`)."""

    fleet: Fleet
    clock: ManualClock

    @property
    def names(self) -> Sequence[str]:
        return self.fleet.station.names

    def time(self) -> float:
        return self.clock.now()

    def of(self, text: str, robots: Index | None = None) -> tuple[Column, int]:
        values, asked = self.fleet.station.values(text, robots)
        return values, len(asked)

    def checked(self, text: str) -> Checked:
        return self.fleet.station.check(text)

    def groups(self) -> Iterable[tuple[str, Mask]]:
        return ()

    def suggested(self) -> list[str]:
        return []


def board(fleet: Fleet, clock: ManualClock) -> AlertBoard:
    return AlertBoard(Told(fleet, clock), clock)


class Watch:
    """Ten scouts, scout i with fuel i / 10, their desk and its alerts."""

    def __init__(self) -> None:
        self.fleet = Fleet()
        self.clock = ManualClock()
        self.board = board(self.fleet, self.clock)
        self.fleet.report()

    def fuel(self, **levels: float) -> None:
        """These scouts have so much fuel now, and all tell."""
        for name, level in levels.items():
            self.fleet.minds[name].sense((0.0, level, 0.75), self.fleet.clock.now())
        self.fleet.report()

    def look(self, after: float = TOGETHER) -> None:
        self.clock.advance(after)
        self.board.look()

    def firings(self) -> list[tuple[int, int, str]]:
        return [(each.alert, each.count, each.robots) for each in self.board.shown().firings]


@pytest.fixture
def watch() -> Watch:
    return Watch()


def test_what_is_true_from_the_start_is_counted_and_fires_not(watch: Watch) -> None:
    watch.board.add(LOW)
    watch.look()
    (shown,) = watch.board.shown().alerts
    assert (shown.text, shown.above, shown.count, shown.fired, shown.trouble) == (LOW, 0, 3, 0, "")
    assert watch.firings() == []


def test_it_fires_for_whom_it_becomes_true(watch: Watch) -> None:
    watch.board.add(LOW)
    watch.fuel(s7=0.2)
    watch.look()
    assert watch.firings() == [(1, 4, "s7")]
    watch.look()
    assert len(watch.firings()) == 1
    watch.fuel(s7=0.9)
    watch.look()
    watch.fuel(s7=0.1, s8=0.1, s9=0.1, s6=0.1)
    watch.look()
    assert watch.firings()[1:] == [(1, 7, "s6, s7, s8 and 1 more")]
    assert [place for place, mark in enumerate(watch.board.robots(2)) if mark] == [6, 7, 8, 9]


def test_robots_that_follow_soon_are_told_together(watch: Watch) -> None:
    watch.board.add(LOW)
    watch.fuel(s5=0.1)
    watch.look()
    for name in ("s6", "s7"):
        watch.fuel(**{name: 0.1})
        watch.look(LOOK_EVERY)
    assert watch.firings() == [(1, 4, "s5")]
    watch.look()
    assert watch.firings()[1:] == [(1, 6, "s6, s7")]


def test_more_than_so_many_fires_once_until_they_are_fewer(watch: Watch) -> None:
    watch.board.add(LOW, 4)
    watch.fuel(s5=0.1)
    watch.look()
    assert watch.firings() == []
    watch.fuel(s6=0.1)
    watch.look()
    watch.fuel(s7=0.1)
    watch.look()
    assert watch.firings() == [(1, 5, "s0, s1, s2 and 2 more")]
    watch.fuel(s5=0.9, s6=0.9)
    watch.look()
    watch.fuel(s5=0.1, s6=0.1)
    watch.look()
    assert [count for _, count, _ in watch.firings()] == [5, 6]


def test_more_than_so_many_from_the_start_fires_not(watch: Watch) -> None:
    watch.board.add(LOW, 2)
    watch.look()
    assert watch.firings() == []


def test_a_robot_whose_telemetry_is_old_keeps_what_it_said(watch: Watch) -> None:
    watch.board.add(LOW)
    watch.fleet.clock.advance(watch.fleet.station.stale_after + 1.0)
    watch.look()
    assert watch.board.shown().alerts[0].count == 3
    watch.fleet.report()
    watch.look()
    assert watch.firings() == []


def test_robots_that_are_never_heard_have_no_count() -> None:
    fleet, clock = Fleet(), ManualClock()
    watched = board(fleet, clock)
    watched.add(LOW)
    assert watched.shown().alerts[0].count == -1
    fleet.report()
    clock.advance(1.0)
    watched.look()
    assert watched.shown().alerts[0].count == 3
    assert watched.shown().firings == []


def test_one_that_is_muted_is_counted_without_a_word(watch: Watch) -> None:
    watch.board.add(LOW)
    watch.board.mute(1, True)
    watch.fuel(s7=0.2)
    watch.look()
    assert (watch.firings(), watch.board.shown().alerts[0].count) == ([], 4)
    watch.board.mute(1, False)
    watch.fuel(s8=0.2)
    watch.look()
    assert watch.firings() == [(1, 5, "s8")]


def test_one_that_is_removed_is_gone_and_its_firings_stay(watch: Watch) -> None:
    watch.board.add(LOW)
    watch.fuel(s7=0.2)
    watch.look()
    watch.board.remove(1)
    assert watch.board.shown().alerts == []
    assert len(watch.firings()) == 1
    for wrong in (watch.board.remove, lambda number: watch.board.mute(number, True)):
        with pytest.raises(MisuseError, match="no alert number 1"):
            wrong(1)


@pytest.mark.parametrize("text", ["(MARK)", "(< fule 3)", "(<", "(WHEN (< fuel 1) (JOIN bravo))"])
def test_what_is_no_test_is_refused(watch: Watch, text: str) -> None:
    with pytest.raises(SleepcastError):
        watch.board.add(text)
    assert watch.board.shown().alerts == []


def test_there_are_so_many_and_no_more(watch: Watch) -> None:
    for _ in range(MAX_ALERTS):
        watch.board.add(LOW)
    with pytest.raises(MisuseError, match="remove one"):
        watch.board.add(LOW)


def test_only_the_latest_firings_are_kept(watch: Watch) -> None:
    watch.board.add(LOW)
    for _ in range(MAX_FIRINGS + 1):
        watch.fuel(s7=0.9)
        watch.look()
        watch.fuel(s7=0.1)
        watch.look()
    assert watch.board.shown().alerts[0].fired == MAX_FIRINGS + 1
    assert watch.board.robots(2)
    with pytest.raises(MisuseError, match="not known any more"):
        watch.board.robots(1)


def test_no_look_takes_long(watch: Watch, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each takes longer than all may together, so one is looked at with each picture, and none is forgotten."""
    for _ in range(3):
        watch.board.add(LOW)
    looked: list[str] = []
    values = watch.board.values.of

    def slow(text: str) -> object:
        watch.clock.advance(2.0 * alerts.LONGEST_LOOK)
        looked.append(text)
        return values(text)

    monkeypatch.setattr(watch.board.values, "of", slow)
    watch.clock.advance(1.0)
    for number in (1, 2, 3):
        watch.board.look()
        assert len(looked) == number
    watch.board.look()
    assert len(looked) == 3, "none is due"


def test_another_run_is_watched_for_the_same(watch: Watch) -> None:
    told: list[str] = []
    watch.board.listeners.append(lambda firing: told.append(firing.robots))
    watch.board.add(LOW, 0)
    watch.board.add("(< (SONAR 1) 2m)", 3)
    watch.board.mute(2, True)
    other = Watch()
    other.board.adopt(watch.board)
    assert [(each.text, each.above, each.muted) for each in other.board.shown().alerts] == [
        (LOW, 0, False),
        ("(< (SONAR 1) 2m)", 3, True),
    ]
    other.look()
    other.fuel(s9=0.1)
    other.look()
    assert told == ["s9"]
    assert np.frombuffer(other.board.robots(1), np.uint8).tolist() == [0] * 9 + [1]


def test_what_cannot_be_looked_at_says_why(watch: Watch) -> None:
    watch.fleet.minds["s4"].evaluate("(DEFVAR patience 5)")
    watch.board.add("(> patience 3)")
    other = board(Fleet(), ManualClock())
    other.adopt(watch.board)
    other.look()
    assert 'unknown name "patience"' in other.shown().alerts[0].trouble


def test_a_terminal_is_told_too(watch: Watch) -> None:
    said: list[str] = []
    watch.board.watch([LOW], said.append)
    watch.clock.advance(3_700.0)
    watch.fuel(s7=0.2)
    watch.look(TOGETHER)
    assert said == ["alert at 1:01:41: (< fuel 30%): s7"]
