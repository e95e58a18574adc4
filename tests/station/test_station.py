"""The desk: what it refuses, what it sends, how it stops a fleet, and what it writes down."""

from __future__ import annotations

import hashlib
import threading
from math import inf, nan

import numpy as np
import pytest

from sleepcast.channel import Kind, Message
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.language import CheckError, ReadError
from sleepcast.station import (
    DEADLINE,
    CommandTypeError,
    JournalEvent,
    NoExplanationError,
    NoSuchCommandError,
    NotConfirmedError,
    Station,
    UnknownRobotError,
)
from sleepcast.station.account import ValueSummary
from sleepcast.station.sent import MAX_COMMANDS, REPEAT_AFTER
from sleepcast.station.station import MAX_REPORTS
from station.fleet import Fleet, vocabulary

HALF = "(WHEN (> fuel 50%) (JOIN bravo))"


# ---- checking


def test_check_speaks_the_names_of_the_fleet(fleet: Fleet) -> None:
    fleet.minds["s4"].evaluate("(DEFVAR patience 5)")
    found = fleet.station.check("(WHEN (> feul patience) (MARK))")
    assert [f.message for f in found.findings] == ['unknown name "feul" at 1:10 (did you mean fuel?)']
    assert found.findings[0].render(found.text).splitlines()[1:] == [
        "  (WHEN (> feul patience) (MARK))",
        "           ^^^^",
    ]


def test_names_that_robots_have_learned_are_suggested(fleet: Fleet) -> None:
    fleet.minds["s4"].evaluate("(DEFVAR patience 5)")
    assert "did you mean patience?" in fleet.station.check("(> patiense 5)").findings[0].message


# ---- values


def test_values_are_those_of_recent_telemetry(fleet: Fleet) -> None:
    fleet.report(["s1", "s3"])
    values, asked = fleet.station.values("(* 2 fuel)")
    assert np.array_equal(values, [nan, 0.2, nan, 0.6, *[nan] * 6], equal_nan=True)
    assert list(asked) == []
    fleet.clock.advance(fleet.station.stale_after + 1.0)
    assert np.isnan(fleet.station.values("(* 2 fuel)")[0]).all()


def test_values_that_only_the_robots_know_must_be_asked_for(fleet: Fleet) -> None:
    fleet.report(["s1", "s2"])
    values, asked = fleet.station.values("(SONAR 1)")
    assert np.isnan(values).all()
    assert list(asked) == ["s1", "s2"]


def test_values_of_what_acts_or_is_unknown_are_refused(fleet: Fleet) -> None:
    with pytest.raises(MisuseError, match="cannot be previewed"):
        fleet.station.values("(MARK)")
    with pytest.raises(CheckError, match="did you mean fuel"):
        fleet.station.values("(> feul 1)")


# ---- sending


def test_a_command_goes_out_with_a_deadline(fleet: Fleet) -> None:
    fleet.clock.advance(7.0)
    command = fleet.station.send(HALF)
    assert fleet.sent == [command.message]
    message = fleet.sent[0]
    assert (message.kind, message.text, message.standing) == (Kind.COMMAND, HALF, False)
    assert (message.issued, message.deadline) == (7.0, 7.0 + DEADLINE)
    assert command.id == "desk-1.1"
    assert fleet.station.send(HALF, deadline=60.0).message.deadline == 67.0


def test_a_standing_command_has_none(fleet: Fleet) -> None:
    message = fleet.station.send(
        "(RULE slow (WHEN (< fuel 20%) (SETQ speed 1)))", standing=True, everybody=True
    ).message
    assert message.standing
    assert message.deadline == inf


def test_a_question_changes_nothing_and_its_values_are_counted(fleet: Fleet) -> None:
    command = fleet.station.ask("(PROGN (JOIN bravo) (+ fuel 0))")
    assert (command.kind, command.message.deadline) == (Kind.ASK, DEADLINE)
    assert fleet.station.accounting(command.id).values is None
    fleet.deliver()
    account = fleet.station.accounting(command.id)
    assert (account.n_matched, account.n_silent) == (len(fleet.minds), 0)
    assert account.values == ValueSummary(10, 0.0, pytest.approx(0.45), 0.9)
    assert not any(mind.groups for mind in fleet.minds.values())


def test_a_question_that_goes_wrong_is_a_fault_and_one_without_an_answer_has_no_value(fleet: Fleet) -> None:
    wrong, unknown = fleet.station.ask("(/ fuel 0)"), fleet.station.ask("(+ fuel nowhere)")
    fleet.deliver()
    assert fleet.station.accounting(wrong.id).n_fault == len(fleet.minds)
    assert fleet.station.accounting(wrong.id).values is None
    assert fleet.station.accounting(unknown.id).n_matched == len(fleet.minds)
    assert fleet.station.accounting(unknown.id).values is None
    with pytest.raises(ReadError):
        fleet.station.ask("(fuel")


@pytest.mark.parametrize("seconds", [0.0, -1.0, 3601.0, inf])
def test_an_impossible_deadline_is_refused(fleet: Fleet, seconds: float) -> None:
    with pytest.raises(CommandTypeError, match="deadline"):
        fleet.station.send(HALF, deadline=seconds)
    assert fleet.sent == []


def test_a_deadline_that_is_no_number_is_refused(fleet: Fleet) -> None:
    with pytest.raises(CommandTypeError):
        fleet.station.send(HALF, deadline=float("nan"))


def test_a_standing_command_takes_no_deadline_and_no_snapshot(fleet: Fleet) -> None:
    with pytest.raises(CommandTypeError, match="no deadline"):
        fleet.station.send("(RULE r 5)", standing=True, everybody=True, deadline=5.0)
    with pytest.raises(CommandTypeError, match="one-shot"):
        fleet.station.send(HALF, standing=True)


def test_errors_are_not_sent(fleet: Fleet) -> None:
    with pytest.raises(ReadError):
        fleet.station.send("(WHEN (> fuel")
    with pytest.raises(CheckError, match="sensor"):
        fleet.station.send("(WHEN (> fuel 50%) (SETQ fuel 1))")
    assert fleet.sent == []


def test_everybody_must_be_spelled_out(fleet: Fleet) -> None:
    with pytest.raises(NotConfirmedError, match=r"has no test.*10 on the roster"):
        fleet.station.send("(JOIN bravo)")
    with pytest.raises(NotConfirmedError, match="always true"):
        fleet.station.send("(WHEN (>= fuel 0%) (JOIN bravo))")
    assert fleet.sent == []
    fleet.station.send("(JOIN bravo)", everybody=True)
    assert len(fleet.sent) == 1


def test_the_prediction_is_kept_with_the_command(fleet: Fleet) -> None:
    fleet.report()
    assert fleet.station.send(HALF).predicted == {"s6", "s7", "s8", "s9"}


def test_old_commands_make_room(fleet: Fleet) -> None:
    first = fleet.station.send(HALF)
    for _ in range(MAX_COMMANDS):
        fleet.station.send(HALF)
    assert len(fleet.station.commands()) == MAX_COMMANDS
    with pytest.raises(NoSuchCommandError):
        fleet.station.accounting(first.id)


# ---- stop


def test_stop_is_accounted_for_truthfully_and_repeated_until_it_is(fleet: Fleet) -> None:
    fleet.report()
    stop = fleet.station.stop()
    assert fleet.sent[0].kind is Kind.STOP
    fleet.deliver([name for name in fleet.minds if name not in ("s3", "s5")])
    found = fleet.station.accounting(stop.id)
    assert (found.n_matched, found.silent) == (8, ("s3", "s5"))

    fleet.station.attend()
    assert len(fleet.sent) == 1, "not again at once"
    fleet.clock.advance(REPEAT_AFTER)
    fleet.station.attend()
    assert [message.id for message in fleet.sent] == [stop.id, stop.id]
    fleet.deliver()
    assert fleet.station.accounting(stop.id).complete
    assert all(node.stopped for node in fleet.minds.values())
    fleet.clock.advance(REPEAT_AFTER)
    fleet.station.attend()
    assert len(fleet.sent) == 2, "everybody is accounted for"


def test_telemetry_accounts_for_a_stop_whose_answer_was_lost(fleet: Fleet) -> None:
    stop = fleet.station.stop()
    for node in fleet.minds.values():
        node.receive(fleet.sent[0])
        node.outbox.clear()
    fleet.report(["s1", "s2"])
    assert fleet.station.accounting(stop.id).matched == ("s1", "s2")


def test_release_ends_the_repeating_of_stop_and_is_accounted_for(fleet: Fleet) -> None:
    fleet.station.stop()
    fleet.deliver(["s1"])
    fleet.report()
    release = fleet.station.release()
    assert fleet.station.accounting(release.id).n_matched == 0
    fleet.deliver()
    assert fleet.station.accounting(release.id).complete
    assert not any(node.stopped for node in fleet.minds.values())
    fleet.clock.advance(10.0)
    fleet.station.attend()
    assert [message.kind for message in fleet.sent] == [Kind.STOP, Kind.RELEASE]


def test_a_command_after_a_stop_does_not_end_its_repeating(fleet: Fleet) -> None:
    stop = fleet.station.stop()
    fleet.station.send(HALF)
    fleet.clock.advance(REPEAT_AFTER)
    fleet.station.attend()
    assert fleet.sent[-1].id == stop.id


# ---- why


def test_why_asks_the_robot_itself(fleet: Fleet) -> None:
    command = fleet.station.send(HALF)
    fleet.deliver()
    assert fleet.station.why("s7", command.id).matched
    found = fleet.station.why("s4", command.id)
    assert not found.matched
    assert found.reason == "fuel = 40 %, needed > 50 %"
    assert fleet.station.why("s4").command == command.id


def test_why_says_what_is_wrong_with_the_question(fleet: Fleet) -> None:
    command = fleet.station.send(HALF)
    with pytest.raises(UnknownRobotError, match=r'no robot "S4x" among the 10 on the roster \(did you mean s4\?\)'):
        fleet.station.why("S4x", command.id)
    with pytest.raises(NoSuchCommandError, match=r"desk-1\.2"):
        fleet.station.why("s4", "desk-1.2")
    with pytest.raises(NoExplanationError, match="s4 remembers no command"):
        fleet.station.why("s4", command.id)
    fleet.station.hear(Message("stranger", 0, 1, Kind.HEARTBEAT, 0.0))
    with pytest.raises(NoExplanationError, match="cannot be asked"):
        fleet.station.why("stranger", command.id)


# ---- roster, reports, journal


def test_the_roster_says_when_each_robot_was_last_heard(fleet: Fleet) -> None:
    assert set(fleet.station.roster.values()) == {None}
    fleet.clock.advance(3.0)
    fleet.report(["s1"])
    fleet.clock.advance(1.0)
    fleet.station.hear(Message("s2", 0, 1, Kind.HEARTBEAT, 4.0))
    assert {name: heard for name, heard in fleet.station.roster.items() if heard} == {"s1": 3.0, "s2": 4.0}


def test_reports_are_kept_the_latest_last(fleet: Fleet) -> None:
    fleet.station.send('(WHEN (> fuel 80%) (REPORT "fuel" fuel))')
    fleet.deliver()
    (report,) = fleet.station.reports
    assert (report.robot, report.body) == ("s9", {"label": "fuel", "values": [0.9]})
    for i in range(MAX_REPORTS + 5):
        fleet.station.hear(Message("s1", 0, i, Kind.REPORT, 0.0, body={"label": str(i)}))
    assert len(fleet.station.reports) == MAX_REPORTS


def test_the_journal_has_all_that_was_sent_heard_and_decided(fleet: Fleet) -> None:
    fleet.report()
    with pytest.raises(NotConfirmedError):
        fleet.station.send("(MARK)")
    command = fleet.station.send(HALF)
    fleet.deliver(["s4", "s9"])
    fleet.station.stop()
    fleet.clock.advance(1.0)
    fleet.station.attend()
    entries = list(fleet.station.journal.entries())
    assert [entry.number for entry in entries] == list(range(1, 7))
    events = [(entry.event, entry.who) for entry in entries]
    assert events == [
        (JournalEvent.REFUSED, "desk"),
        (JournalEvent.SENT, "desk"),
        (JournalEvent.HEARD, "s4"),
        (JournalEvent.HEARD, "s9"),
        (JournalEvent.SENT, "desk"),
        (JournalEvent.REPEATED, "desk"),
    ]
    assert "has no test" in str(entries[0].details["reason"])
    sent = entries[1]
    assert (sent.subject, sent.text) == (command.id, HALF)
    assert sent.details["digest"] == hashlib.sha256(HALF.encode()).hexdigest()
    assert list(sent.details["predicted"]) == ["s6", "s7", "s8", "s9"]
    assert entries[2].subject == command.id
    assert entries[2].details["outcome"] == "not matched"
    assert entries[5].details == {"silent": 10}


# ---- threads


def test_many_threads_at_one_desk(fleet: Fleet) -> None:
    """Commands keep their order, and nothing that is heard while others look is lost or breaks them."""
    errors: list[BaseException] = []

    def work(job: int) -> None:
        try:
            for i in range(50):
                if job == 0:
                    fleet.station.send(HALF)
                elif job == 1:
                    fleet.station.hear(Message(f"new{i}", 0, i, Kind.HEARTBEAT, 0.0))
                elif job == 2:
                    fleet.report()
                else:
                    fleet.station.preview(HALF)
                    for command in fleet.station.commands():
                        fleet.station.accounting(command.id)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=work, args=(job,)) for job in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert [message.sequence for message in fleet.sent] == list(range(1, 51))
    assert len(fleet.station.roster) == 60


def test_errors_at_the_desk_are_the_users_own() -> None:
    for error in (NotConfirmedError, CommandTypeError, NoSuchCommandError, UnknownRobotError):
        assert issubclass(error, MisuseError)
    assert not issubclass(NoExplanationError, MisuseError)


def test_a_desk_without_robots_sends_all_the_same() -> None:
    sent: list[Message] = []
    station = Station(vocabulary(), {}, sent.append, ManualClock(), operator="bridge", epoch=3)
    command = station.send(HALF)
    assert command.id == "bridge-3.1"
    found = station.accounting(command.id).sentence()
    assert found == "matched 0, did not match 0, fault 0, silent 0 of 0 robots heard so far"
