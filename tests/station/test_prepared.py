"""A command is read and checked once, and who would obey it is foreseen once, unless something has changed since."""

from __future__ import annotations

import pytest

from counting import ONCE, counted
from safety.scene import Scene
from sleepcast.station import CountNeededError, DoubtError, MemoryJournal, SendPolicy
from sleepcast.station.journal.journal import JournalEvent
from sleepcast.station.network import ABOVE, NetworkStation
from sleepcast.station.prepared import GOOD_FOR, Prepared, Terms
from sleepcast.station.remote import RemoteMinds, TelemetryClient
from sleepcast.station.staging import Stages
from sleepcast.station.validation import UnknownNameError

HALF = "(WHEN (> id 5) (DRIVE 1))"
MANY = ABOVE + 2


class Desk:
    """A desk that has just heard what all its robots tell: r0, r1, ..., by their ids."""

    def __init__(self, robots: int = MANY) -> None:
        self.scene, self.minds = Scene(robots), RemoteMinds()
        self.station: NetworkStation = self.scene.desk(minds=self.minds)
        self.telemetry = TelemetryClient(self.station, self.minds)
        self.station.listeners.append(self.telemetry.hear)
        self.look()
        self.look()

    def look(self) -> None:
        self.telemetry.look()
        self.scene.run(0.5)

    def sent(self) -> int:
        return len([each for each in self.station.commands() if each.text])


def test_a_command_is_checked_foreseen_and_validated_once() -> None:
    desk = Desk()
    with counted() as found:
        sent = desk.station.commit(desk.station.prepare(HALF))
    assert found == ONCE
    assert sent.predicted == {f"r{number}" for number in range(6, MANY)}
    desk.look()
    with counted() as found:
        desk.station.send("(WHEN (> id 9) (DRIVE 1))", confirmed=True)
    assert found == ONCE


def told(desk: Desk) -> None:
    desk.look()


def aged(desk: Desk) -> None:
    desk.scene.clock.advance(1.1 * GOOD_FOR)


def policy(desk: Desk) -> None:
    desk.station.policy = SendPolicy(above=2, doubts=True)


def commanded(desk: Desk) -> None:
    desk.station.send("(WHEN (= id 1) (DRIVE 1))")


@pytest.mark.parametrize("change", [told, aged, policy, commanded])
def test_who_would_obey_is_foreseen_again_when_something_has_changed_but_never_checked(change: object) -> None:
    desk = Desk()
    prepared = desk.station.prepare(HALF)
    change(desk)  # type: ignore[operator]
    with counted() as found:
        desk.station.accept(prepared, count=desk.station.prepare(HALF).may)
    assert found == {"checked": 1, "foreseen": 2, "validated": 1}, "the check and one preview are of the second"


def test_another_number_is_asked_for_anew() -> None:
    """What a person has answered is about the number that he was shown."""
    desk = Desk(20)
    text = "(WHEN (< x 14) (DRIVE 1))"
    prepared = desk.station.prepare(text)
    assert prepared.may == 14
    for number, robot in enumerate(desk.scene.fleet.values()):
        robot.node.sense((float(number + 2), 0.5), 0.0)
    desk.look()
    before = desk.sent()
    with pytest.raises(CountNeededError) as asked:
        desk.station.commit(prepared, count=14)
    assert (asked.value.may, desk.sent()) == (12, before)
    with counted() as found:
        sent = desk.station.commit(prepared, count=12)
    assert found == {"foreseen": 1, "validated": 1}
    assert len(sent.predicted) == 12


def test_a_name_that_means_something_else_by_now_is_checked_anew() -> None:
    """The desk would foresee by what the text meant before, and robots would do what it means now."""
    desk = Desk()
    prepared = desk.station.prepare("(WHEN (> charge 5) (DRIVE 1))", Terms(anyway=True))
    assert len(prepared.forecast.undecided) == MANY
    for number, robot in enumerate(desk.scene.fleet.values()):
        robot.node.evaluate(f"(DEFVAR charge {number})")
    desk.look()
    with counted() as found, pytest.raises(CountNeededError) as asked:
        desk.station.commit(prepared, count=0, confirmed=True)
    assert found == ONCE
    assert asked.value.may == MANY - 6


def test_each_stage_counts_anew_who_may_obey() -> None:
    desk = Desk(20)
    text = "(WHEN (< x 14) (DRIVE 1))"
    with counted() as found:
        stages = Stages(desk.station, desk.station.prepare(text), count=14)
        first = stages.send()
    assert found == {"checked": 1, "foreseen": 1, "validated": 2}
    for number, robot in enumerate(desk.scene.fleet.values()):
        robot.node.sense((float(number + 2), 0.5), 0.0)
    desk.look()
    with counted() as found:
        rest = [stages.send() for _ in range(2)]
    assert found["checked"] == 0
    assert found["validated"] == 2
    assert stages.over
    assert [len(each.predicted) for each in (first, *rest)] == [1, 2, 9]


# ---- what is asked


def test_what_is_doubted_is_asked_about_in_one_order() -> None:
    """Names that no robot has, then what the text says, then the number."""
    desk = Desk()
    prepared = desk.station.prepare("(WHEN (> id 0) (> feul 6) (DRIVE 1))")
    with pytest.raises(UnknownNameError, match="none of the 12 robots that have sent telemetry has feul, so nothing"):
        desk.station.commit(prepared)
    prepared = prepared.despite_names()
    with pytest.raises(DoubtError, match="did you mean"):
        desk.station.commit(prepared)
    with pytest.raises(CountNeededError, match="11 may obey"):
        desk.station.commit(prepared, confirmed=True)
    assert desk.sent() == 0
    desk.station.commit(prepared, confirmed=True, count=11)


def test_every_refusal_is_written_down_once() -> None:
    desk = Desk()
    prepared: Prepared = desk.station.prepare("(WHEN (> id 0) (DRIVE 1))")
    with pytest.raises(CountNeededError):
        desk.station.commit(prepared)
    journal = desk.station.journal
    assert isinstance(journal, MemoryJournal)
    refused = [entry.text for entry in journal.entries() if entry.event is JournalEvent.REFUSED]
    assert refused == ["(WHEN (> id 0) (DRIVE 1))"]
