"""Two robots of one name: their epochs interleave, while those of one robot that restarts, or is replayed, do not."""

from __future__ import annotations

from itertools import count
from random import Random

import pytest

from channel.air import DESK, ROBOTS, START, Air
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import FOR, INTRODUCE, NAMES, OTHERS, Role
from sleepcast.channel.name_conflicts import (
    LASTS,
    MAX_HOLDERS,
    MAX_NAMES,
    UNDECIDED_FOR,
    NameConflicts,
    sentences,
)
from sleepcast.channel.transports.transport import ReceivedDatagram, address_of
from sleepcast.core.clock import ManualClock

NUMBERS = count(1)
OLD, NEW = 5, 9
"""Epochs."""


def desk() -> NameConflicts:
    return NameConflicts(Random(1), 2.0)


def said(epoch: int, issued: float, kind: Kind = Kind.ANSWER, name: str = "r1", **body: object) -> Message:
    return Message(name, epoch, next(NUMBERS), kind, issued, issued + 5.0, body=body, role=Role.ROBOT)


def hear(conflicts: NameConflicts, *messages: tuple[int, float]) -> None:
    """Messages of r1, each heard as it is issued: epochs with times."""
    for epoch, issued in messages:
        conflicts.hear(said(epoch, issued), issued)


def epochs(conflicts: NameConflicts, now: float, name: str = "r1") -> set[int]:
    return {each.epoch for each in conflicts.contested(now).get(name, ())}


@pytest.mark.parametrize(("first", "second"), [(OLD, NEW), (NEW, OLD)])
def test_epochs_that_interleave_are_two_robots(first: int, second: int) -> None:
    conflicts = desk()
    hear(conflicts, (first, 10.0), (second, 10.1))
    assert not conflicts.contested(10.1), "it may have restarted"
    assert conflicts.undecided(10.1) == ["r1"]
    hear(conflicts, (first, 10.2))
    assert epochs(conflicts, 10.2) == {OLD, NEW}
    assert conflicts.undecided(10.2) == []


def test_one_restart_is_no_conflict_whatever_its_epoch() -> None:
    """A robot without a clock takes a random epoch, so that the later one may be the lower one."""
    for before, after in ((OLD, NEW), (NEW, OLD)):
        conflicts = desk()
        hear(conflicts, (before, 10.0), (before, 10.2), (after, 11.0), (after, 12.0), (after, 13.0))
        assert not conflicts.contested(13.0)
        assert conflicts.undecided(11.0) == ["r1"]
        assert conflicts.undecided(11.0 + UNDECIDED_FOR) == []
        hear(conflicts, (after, 50.0))
        assert conflicts.holders("r1", 50.0) == ()


def test_replays_of_an_earlier_epoch_prove_nothing() -> None:
    conflicts = desk()
    hear(conflicts, (OLD, 10.0), (NEW, 20.0))
    for issued in (10.1, 10.2, 19.9):
        conflicts.hear(said(OLD, issued), 20.5)
        hear(conflicts, (NEW, 20.6))
    assert not conflicts.contested(20.6)
    assert not conflicts.undecided(25.0)
    conflicts = desk()  # and a desk that hears the later epoch first
    hear(conflicts, (NEW, 20.0))
    for at in (20.1, 20.3):
        conflicts.hear(said(OLD, at - 10.2), at)
        hear(conflicts, (NEW, at + 0.1))
    assert not conflicts.contested(20.4)
    assert conflicts.undecided(20.0 + UNDECIDED_FOR + 0.2) == []


def test_a_message_issued_before_the_other_was_heard_does_not_hide_the_conflict() -> None:
    """The clocks of two robots differ by as much as is allowed."""
    conflicts = desk()
    hear(conflicts, (NEW, 10.0))
    for at in (10.1, 11.1, 12.1, 13.1):
        conflicts.hear(said(OLD, at - 1.9), at)
        hear(conflicts, (NEW, at + 0.5))
    assert epochs(conflicts, 13.6) == {OLD, NEW}


def test_a_conflict_ends_when_one_was_silent_for_so_long() -> None:
    conflicts = desk()
    hear(conflicts, (OLD, 10.0), (NEW, 10.1), (OLD, 10.2))
    last = 10.0 + LASTS
    hear(conflicts, *((NEW, 10.0 + second) for second in range(1, 30)))
    assert epochs(conflicts, last) == {OLD, NEW}
    hear(conflicts, (NEW, 39.9))
    assert not conflicts.contested(last + 0.3)
    assert conflicts.changed(last + 0.3) == ["r1"]
    hear(conflicts, (OLD, 60.0), (NEW, 60.1), (OLD, 60.2))
    assert epochs(conflicts, 60.2) == {OLD, NEW}, "it is back"


def test_a_robot_tells_of_another_that_only_it_has_heard() -> None:
    conflicts = desk()
    conflicts.hear(said(NEW, 40.0, **{OTHERS: [[OLD, 20.0]]}), 40.0)
    assert epochs(conflicts, 40.0) == {OLD, NEW}
    assert epochs(conflicts, 50.0) == {OLD, NEW}
    assert not epochs(conflicts, 50.1), "by when the robot has heard it"
    for malformed in (
        [[NEW, 1.0]],
        [[OLD]],
        [[-1, 1.0]],
        [[OLD, -1.0]],
        [[OLD, 31.0]],
        [[OLD, float("nan")]],
        7,
        ["x"],
    ):
        conflicts = desk()
        conflicts.hear(said(NEW, 40.0, **{OTHERS: malformed}), 40.0)
        assert not conflicts.contested(40.0), malformed


def test_what_is_kept_is_bounded() -> None:
    conflicts = desk()
    for epoch in range(1, 50):
        hear(conflicts, (epoch, 10.0 + epoch / 100.0))
    assert len(conflicts.holders("r1", 10.6)) == MAX_HOLDERS
    for number in range(MAX_NAMES + 10):
        conflicts.hear(said(1, 11.0, name=f"x{number}"), 11.0)
    assert conflicts.holders("r1", 11.0) == ()


def test_a_robot_knows_at_once_who_speaks_under_its_name() -> None:
    for other in (OLD, NEW):
        conflicts = desk()
        conflicts.hold({"r1": 7})
        conflicts.begin(100.0)
        conflicts.hear(said(other, 99.9, Kind.STOP), 100.5)
        assert not conflicts.contested(100.5), "of the life before, or a replay"
        conflicts.hear(said(7, 101.0, Kind.STOP), 101.0)
        assert not conflicts.contested(101.0), "its own echo"
        conflicts.hear(said(other, 101.0, Kind.STOP), 101.0, "10.0.0.7:4711")
        (sentence,) = conflicts.of_own(101.0)
        assert sentence.startswith(f"another robot has our name r1, one at 10.0.0.7:4711 (epoch {other}): ")
        assert conflicts.others("r1", 103.0) == [[other, 2.0]]
        assert conflicts.of_own(101.0 + LASTS) != []
        assert conflicts.of_own(101.1 + LASTS) == []
        assert conflicts.others("r1", 101.1 + LASTS) == []


def test_a_process_of_many_robots_says_all_their_names_at_once() -> None:
    here, there = desk(), desk()
    here.hold({f"r{number}": 5 for number in range(1, 51)} | {"scout": 6, "r077": 7})
    there.hold({f"r{number}": 9 for number in range(40, 90)} | {"scout": 9})
    here.begin(10.0)
    there.begin(11.0)
    assert here.due() < 11.0
    body = here.introduction(12.0)
    assert body[NAMES] == [["r", 1, 50, 5], ["scout", 6], ["r0", 77, 1, 7]]
    assert here.due() > 1e9, "there is nobody to be told again"
    there.hear(said(1, 12.0, Kind.DIGEST, name="r1+49", **body), 12.0, "10.0.0.7:1")
    assert set(there.contested(12.0)) == {f"r{number}" for number in range(40, 51)} | {"scout"}
    (first,) = there.of_own(12.0)
    assert first.startswith("other robots have 12 of our names: r40, r41, r42 and 9 more, one at 10.0.0.7:1: ")
    assert there.due() < 12.2, "the other hears of it soon"
    there.introduction(12.2)
    assert 15.0 < there.due() < 20.0, "and again while it lasts"
    assert there.introduction(60.0)[NAMES]
    assert there.due() > 1e9


def test_names_in_a_digest_are_those_of_the_keys_owner() -> None:
    clock, ours = ManualClock(START), KeyPair("r1", Role.ROBOT, b"q" * 32)
    admission = Admission(Trust((DESK.public, ours.public)), "lab", clock, robot=False)
    for epoch, names in ((1, [["r1", 8], ["r2", 8]]), (2, [["r1", 9], ["r2", 9]]), (3, [["r1", 8], ["r2", 8]])):
        clock.advance(0.1)
        message = Message("r1", 1, epoch, Kind.DIGEST, clock.now(), clock.now() + 5.0, body={NAMES: names})
        for datagram in encode(message, "lab", ours):
            admission.enter(datagram)
    assert epochs(admission.conflicts, clock.now()) == {8, 9}
    assert not epochs(admission.conflicts, clock.now(), "r2")
    for malformed in (7, ["x"], [[1, 2]], [["r", -1, 3, 4]], [["r", 1, 10**12, 4]], [["x" * 80, 4]], [["r", 1, -5, 2]]):
        desk().hear(said(1, 5.0, Kind.DIGEST, **{NAMES: malformed}), 5.0)


def test_robots_of_one_name_hear_each_other_and_a_restart_is_none() -> None:
    air = Air(2, seed=3, loss=0.2)
    air.run(1.0)
    assert all(not party.delivery.admission.conflicts.of_own(air.clock.now()) for party in air.robots)
    other = air.join("r1", ROBOTS)
    air.run(8.0)
    now = air.clock.now()
    assert len(other.delivery.admission.conflicts.of_own(now)) == 1
    assert len(air.robots[1].delivery.admission.conflicts.of_own(now)) == 1
    assert air.robots[0].delivery.admission.conflicts.of_own(now) == []
    other.on = False
    air.run(LASTS + 1.0)
    assert all(not party.delivery.admission.conflicts.of_own(air.clock.now()) for party in air.robots)
    air.robots[1].on = False
    again = air.join("r1", ROBOTS)  # another life of them
    air.run(LASTS)
    assert again.delivery.admission.conflicts.of_own(air.clock.now()) == []


def test_a_desk_lets_robots_that_were_out_of_reach_hear_each_other() -> None:
    air = Air(1, seed=4)
    other = air.join("r0", ROBOTS)
    pair = frozenset((1, 2))
    air.cut.add(pair)
    air.run(120.0)
    assert not other.delivery.admission.conflicts.contested(air.clock.now())
    air.cut.clear()
    air.desk.delivery.post(Kind.ASK, air.clock.now(), body={FOR: ["r0"], INTRODUCE: True})
    air.run(1.0)
    for party in (air.robots[0], other):
        assert len(party.delivery.admission.conflicts.of_own(air.clock.now())) == 1


def test_the_sentence_says_who_and_where() -> None:
    conflicts = desk()
    for epoch, at, address in ((NEW, 1.0, "10.0.0.7:1"), (OLD, 1.1, ""), (NEW, 1.2, "10.0.0.7:1")):
        conflicts.hear(said(epoch, at), at, address)
    assert sentences(conflicts.contested(1.2)) == [
        "2 robots have the name r1, one with epoch 5, one at 10.0.0.7:1 (epoch 9)"
    ]
    for name in ("r2", "r3", "r4", "r5"):
        for epoch, at, address in ((NEW, 1.0, "10.0.0.7:1"), (OLD, 1.1, "10.0.0.8:1"), (NEW, 1.2, "10.0.0.7:1")):
            conflicts.hear(said(epoch, at, name=name), at, address)
    assert sentences(conflicts.contested(1.2))[1] == (
        "2 robots have each of 4 names: r2, r3, r4 and 1 more, one at 10.0.0.7:1, one at 10.0.0.8:1"
    )


def test_a_datagram_knows_where_it_came_from() -> None:
    datagram = ReceivedDatagram(b"abc")
    assert (datagram, address_of(datagram), address_of(b"abc")) == (b"abc", "", "")
    datagram.address = ("fe80::1%lo", 47123)
    assert address_of(datagram) == "[fe80::1%lo]:47123"
