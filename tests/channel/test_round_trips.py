"""Round trips bound how far another clock is away, however unequal the two ways are."""

from __future__ import annotations

from random import Random

import pytest

from channel.air import Air
from sleepcast.channel import Kind, Message
from sleepcast.channel.clock_sync import on_the_way
from sleepcast.channel.message import TIME, WAITED, WHOSE
from sleepcast.channel.round_trips import DRIFT, MAX_ASKED, REPLIES_A_SECOND, SELDOM, SOON, TRIPS, RoundTrips
from sleepcast.channel.transports.transport import ReceivedDatagram
from sleepcast.core.clock import MADE, seconds_passed

AHEAD = 1.7


def trip(trips: RoundTrips, now: float, there: float, back: float, sender: str = "anna") -> bool:
    """Ask at `now`, and hear the answer of a clock that is AHEAD s behind ours."""
    asked = trips.question(now)
    answer = Message(sender, 1, 1, Kind.HEARTBEAT, now + there - AHEAD, body={TIME: asked[TIME]})
    return trips.hear(answer, now + there + back)


def test_the_bound_holds_whatever_the_ways_take_and_the_shortest_trip_counts() -> None:
    trips, chance, now = RoundTrips(Random(1)), Random(2), 100.0
    trips.want("anna", 1e6, now)
    assert trips.of("anna", now) is None
    shortest = 9.0
    for _ in range(40):
        now = max(now + 0.5, trips.due())
        there, back = chance.uniform(0.0, 0.3), chance.uniform(0.0, 0.05)
        assert trip(trips, now, there, back)
        clock = trips.of("anna", now + there + back)
        assert clock is not None
        assert abs(clock.ahead - AHEAD) <= clock.bound + 1e-9
        shortest = min(shortest, there + back)
    assert clock.bound < 0.15
    later = trips.of("anna", now + 1_000.0)
    assert later is not None
    assert later.bound == pytest.approx(clock.bound + 1_000.0 * DRIFT, abs=0.03)


@pytest.mark.parametrize("wrong", ["nonce", "sender", "again", "late"])
def test_an_answer_counts_once_from_whom_was_asked_to_the_open_question_and_in_time(wrong: str) -> None:
    trips = RoundTrips(Random(1))
    trips.want("anna", 1e6, 0.0)
    asked = trips.question(1.0)
    assert asked[WHOSE] == "anna"
    body = {TIME: b"x" * 16 if wrong == "nonce" else asked[TIME]}
    answer = Message("bert" if wrong == "sender" else "anna", 1, 1, Kind.HEARTBEAT, 1.0, body=body)
    if wrong == "again":
        assert trips.hear(answer, 1.1)
    assert not trips.hear(answer, 3.0 if wrong == "late" else 1.2)


def test_questions_become_rare_where_nobody_answers_and_end_with_what_waits() -> None:
    trips = RoundTrips(Random(1))
    trips.want("anna", 600.0, 0.0)
    times = []
    while trips.due() < 1e9:
        times.append(trips.due())
        if not trips.question(trips.due()):
            break
    assert times[-1] <= 600.0 + 1.5 * SELDOM
    assert len(times) < 70


def test_parties_trips_and_replies_are_bounded() -> None:
    trips = RoundTrips(Random(1))
    for number in range(2 * MAX_ASKED):
        trips.want(f"desk{number}", 100.0 + number, 0.0)
    assert len(trips._clocks) == MAX_ASKED
    assert all(each.trips.maxlen == TRIPS for each in trips._clocks.values())
    question = Message("r1", 1, 1, Kind.REPORT, 0.0, body={TIME: b"", WHOSE: "anna"})
    assert sum(trips.replies(question, "anna", 0.0) for _ in range(1_000)) <= REPLIES_A_SECOND
    assert not trips.replies(question, "bert", 10.0)


def test_what_the_other_has_held_the_question_is_no_part_of_the_bound() -> None:
    trips, now = RoundTrips(Random(1)), 100.0
    trips.want("anna", 1e6, now)
    asked = trips.question(now)
    there, held, back = 0.030, 0.4, 0.010
    answer = Message("anna", 1, 1, Kind.HEARTBEAT, now + there + held - AHEAD, body={TIME: asked[TIME], WAITED: held})
    assert trips.hear(answer, now + there + held + back)
    clock = trips.of("anna", now + there + held + back)
    assert clock is not None
    assert clock.bound == pytest.approx(0.020)
    assert abs(clock.ahead - AHEAD) <= clock.bound


@pytest.mark.parametrize("held", [None, -1.0, 0.5, "long"])
def test_a_desk_that_does_not_say_it_or_says_nonsense_is_measured_by_the_whole_trip(held: object) -> None:
    answer = Message("anna", 1, 1, Kind.HEARTBEAT, 0.0, body={} if held is None else {WAITED: held})
    assert on_the_way(answer, 0.4) == 0.4


def test_a_busy_desk_says_how_long_the_question_has_waited_for_it() -> None:
    air = Air(1, seed=1)
    air.clock.advance(MADE)
    robot, desk, now = air.robots[0].delivery, air.desk.delivery, air.clock.now()
    robot.trips.want("desk", now + 60.0, now - SOON)
    for datagram in robot.step(now)[0]:  # the question is among them
        waited = ReceivedDatagram(datagram)
        waited.arrived = seconds_passed() - 0.25
        assert desk.take(waited, now) == []
    (reply,) = desk.posted()
    entered = robot.admission.enter(reply)
    assert entered is not None
    held = entered.message.body[WAITED]
    assert isinstance(held, float)
    assert held >= 0.25


def test_a_desk_with_many_replies_counts_each_from_when_it_leaves() -> None:
    air = Air(2, seed=1)
    air.clock.advance(MADE)
    desk, asked = air.desk.delivery, air.clock.now()
    for robot in air.robots:
        robot.delivery.trips.want("desk", asked + 60.0, asked - SOON)
        for datagram in robot.delivery.step(asked)[0]:
            desk.take(datagram, asked)
    told = []
    for robot, reply in zip(air.robots, desk.posted(), strict=True):
        entered = robot.delivery.admission.enter(reply)
        assert entered is not None
        told.append((entered.message.issued - asked, entered.message.body[WAITED]))
        air.clock.advance(0.25)  # while it leaves
    assert told == [pytest.approx((0.0, 0.0), abs=1e-3), pytest.approx((0.25, 0.25), abs=1e-3)]
