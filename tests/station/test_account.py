"""What became of a command: matched, did not match, unknown, fault, silent; and silence is never taken for consent."""

from __future__ import annotations

from math import inf, nan

import msgspec
import numpy as np
import pytest

from sleepcast.channel import Kind, Message
from sleepcast.channel.message_batch import NameIndex
from sleepcast.cli.account import account_lines, as_dict
from sleepcast.station import Outcome
from sleepcast.station.account import account
from sleepcast.station.sent import LATE, Command, answer_from
from station.fleet import Fleet

HALF = "(WHEN (> fuel 50%) (JOIN bravo))"


def test_before_anybody_has_answered_everybody_is_silent(fleet: Fleet) -> None:
    command = fleet.station.send(HALF)
    found = fleet.station.accounting(command.id)
    assert found.n_silent == 10
    assert not found.complete
    assert found.sentence().startswith("matched 0, did not match 0, fault 0, silent 10 of 10 robots: s0 (never heard)")


def test_four_ways_for_every_robot(fleet: Fleet) -> None:
    fleet.report()
    command = fleet.station.send("(WHEN (> fuel 50%) (SETQ speed (/ 1 (- x 800))))")
    fleet.clock.advance(2.0)
    fleet.deliver([name for name in fleet.minds if name != "s2"])
    fleet.clock.advance(6.0)
    found = fleet.station.accounting(command.id)
    assert found.matched == ("s6", "s7", "s9")
    assert found.not_matched == ("s0", "s1", "s3", "s4", "s5")
    assert found.fault == ("s8",)
    assert found.silent == ("s2",)
    assert found.last_heard == {"s2": 0.0}
    assert "division by zero" in found.faults["s8"]
    assert found.sentence() == "matched 3, did not match 5, fault 1, silent 1 of 10 robots: s2 (last heard 8 s ago)"
    assert found.to_dict() == {
        "text": command.text,
        "matched": 3,
        "held": 0,
        "not_matched": 5,
        "unknown": 0,
        "fault": 1,
        "silent": 1,
    }


def test_a_clock_that_was_set_back_gives_no_negative_age(fleet: Fleet) -> None:
    fleet.report()
    command = fleet.station.send(HALF)
    said = msgspec.structs.replace(fleet.station.accounting(command.id), now=fleet.clock.now() - 3_461.0).sentence()
    assert "s0 (last heard at an unknown time, since a clock was wrong)" in said
    assert "-" not in said


@pytest.mark.parametrize("text", ["(WHEN (> fule 50%) (MARK))", "(IF (> fule 50%) (MARK) (UNMARK))"])
def test_a_test_that_is_unknown_is_counted_as_such(fleet: Fleet, text: str) -> None:
    command = fleet.station.send(text)
    fleet.deliver()
    found = fleet.station.accounting(command.id)
    assert (found.n_matched, found.n_not_matched, found.n_unknown, found.n_fault) == (0, 0, 10, 0)
    assert found.unknown == tuple(fleet.minds)
    assert found.complete
    assert command.answers["s1"].outcome is Outcome.UNKNOWN
    assert found.sentence() == "matched 0, did not match 0, unknown 10, fault 0, silent 0"


def test_a_command_to_move_under_stop_is_held(fleet: Fleet) -> None:
    fleet.station.stop()
    fleet.deliver()
    moving, joining = fleet.station.send("(WHEN (> fuel 50%) (SETQ speed 1))"), fleet.station.send(HALF)
    fleet.deliver()
    found = fleet.station.accounting(moving.id)
    assert (found.n_matched, found.n_held, found.n_not_matched) == (4, 4, 6)
    assert found.matched == found.held == ("s6", "s7", "s8", "s9")
    assert found.sentence().startswith("matched 4 (held by STOP: 4), did not match 6, fault 0")
    assert fleet.station.accounting(joining.id).n_held == 0, "what moves nothing is done"
    assert "bravo" in fleet.minds["s9"].groups
    fleet.station.release()
    again = fleet.station.send("(WHEN (> fuel 50%) (SETQ speed 1))")
    fleet.deliver()
    assert fleet.station.accounting(again.id).n_held == 0


def test_a_robot_that_cannot_say_so_is_counted_by_what_it_says(fleet: Fleet) -> None:
    command = fleet.station.send(HALF)
    bodies: list[dict[str, object]] = [
        {"outcome": "not matched", "value": None},
        {"outcome": "not matched", "unknown": False},
        {"outcome": "not matched", "unknown": "yes"},
        {"outcome": "matched", "unknown": True},
        {"outcome": "not matched", "unknown": True},
        {"outcome": "matched", "held": True},
    ]
    for i, body in enumerate(bodies):
        fleet.station.hear(Message(f"s{i}", 0, 1, Kind.ANSWER, 0.0, body={"command": command.id, **body}))
    found = fleet.station.accounting(command.id)
    assert found.not_matched == ("s0", "s1", "s2")
    assert (found.matched, found.held, found.unknown) == (("s3", "s5"), ("s5",), ("s4",))


def test_who_could_not_store_what_it_did_has_done_it_but_is_named(fleet: Fleet) -> None:
    sent = fleet.station.stop()
    faults = {"s3": "not stored", "s4": "the brake is broken", "s5": "the brake is broken; not stored"}
    for name in fleet.minds:
        body = {"command": sent.id, "outcome": "stopped", "fault": faults.get(name)}
        fleet.station.hear(Message(name, 0, 1, Kind.ANSWER, 0.0, body=body))
    found = fleet.station.accounting(sent.id)
    assert (found.n_matched, found.n_fault, found.complete) == (10, 0, True)
    assert found.not_stored == ("s3", "s5")
    assert found.flawed == {"s4": faults["s4"], "s5": faults["s5"]}
    assert found.sentence() == "matched 10, did not match 0, not stored 2, fault 0, silent 0"
    lines = [line.strip() for line in account_lines(sent, found)]
    assert lines[1:] == [
        "not stored, so a restart may forget it 2: s3, s5",
        "fault on s4, which stopped all the same: the brake is broken",
        "fault on s5, which stopped all the same: the brake is broken; not stored",
        "silent 0",
    ]
    told = as_dict(sent, found)
    assert (told["not_stored"], told["n_not_stored"]) == (["s3", "s5"], 2)


def test_a_robot_that_enrols_later_is_not_silent_but_counts_if_it_answers(fleet: Fleet) -> None:
    command = fleet.station.send(HALF)
    fleet.deliver()
    for late in ("late1", "late2"):
        fleet.station.hear(Message(late, 0, 1, Kind.HEARTBEAT, 0.0))
    body: dict[str, object] = {"command": command.id, "outcome": "matched", "value": 1.0, "fault": None}
    fleet.station.hear(Message("late2", 0, 2, Kind.ANSWER, 0.0, body=body))
    found = fleet.station.accounting(command.id)
    assert found.complete
    assert found.matched == ("s6", "s7", "s8", "s9", "late2")
    assert set(fleet.station.roster) >= {"late1", "late2"}


def test_only_the_first_answer_counts(fleet: Fleet) -> None:
    command = fleet.station.send(HALF)
    for outcome in ("not matched", "matched"):
        body: dict[str, object] = {"command": command.id, "outcome": outcome}
        fleet.station.hear(Message("s1", 0, 1, Kind.ANSWER, 0.0, body=body))
    assert fleet.station.accounting(command.id).not_matched == ("s1",)


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"command": "desk-1.1"},
        {"command": "desk-1.1", "outcome": "perhaps"},
        {"command": "desk-1.1", "outcome": 1},
        {"command": ["desk-1.1"], "outcome": "matched"},
        {"command": "desk-9.9", "outcome": "matched"},
    ],
)
def test_an_answer_that_makes_no_sense_only_shows_that_the_robot_is_there(
    fleet: Fleet, body: dict[str, object]
) -> None:
    command = fleet.station.send(HALF)
    assert command.id == "desk-1.1"
    fleet.clock.advance(1.0)
    fleet.station.hear(Message("s1", 0, 1, Kind.ANSWER, 0.0, body=body))
    assert fleet.station.accounting(command.id).n_silent == 10
    assert fleet.station.roster["s1"] == 1.0


@pytest.mark.parametrize("value", [None, nan, inf, "5", 10**400, True], ids=lambda value: str(value)[:5])
def test_any_value_in_an_answer_is_taken_as_a_number_or_as_unknown(value: object) -> None:
    answer = answer_from({"outcome": "matched", "value": value}, 0.0)
    assert answer is not None
    assert answer.value == (1.0 if value is True else None)


def test_a_command_heard_too_late_is_a_fault_with_its_reason(fleet: Fleet) -> None:
    command = fleet.station.send(HALF, deadline=1.0)
    fleet.clock.advance(2.0)
    fleet.deliver(["s9"])
    found = fleet.station.accounting(command.id)
    assert found.fault == ("s9",)
    assert found.faults == {"s9": LATE}
    assert "bravo" not in fleet.minds["s9"].groups


def test_many_silent_robots_are_counted_not_listed() -> None:
    message = Message("desk", 1, 1, Kind.COMMAND, 0.0, text="(MARK)")
    found = account(Command(message, NameIndex(f"s{i}" for i in range(100))), 3.0, np.full(100, -inf))
    assert found.sentence().endswith("s4 (never heard), and 95 more")


def test_answers_are_kept_with_value_and_time(fleet: Fleet) -> None:
    command = fleet.station.send("(WHEN (> fuel 80%) (* 100 fuel))")
    fleet.clock.advance(1.5)
    fleet.deliver()
    answer = command.answers["s9"]
    assert (answer.outcome, answer.heard, answer.value) == (Outcome.MATCHED, 1.5, 90.0)
