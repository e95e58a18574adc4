"""Nobody with a trusted key pushes out what others need: whoever fills a table loses their own entries of it.

Each test fills one table as fast as a key of that role may, and then looks at what an honest sender had there before.
"""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from channel.air import DESK, ROBOTS, Air, Party
from sleepcast.channel import Kind, Message
from sleepcast.channel.clock_sync import WrongClocks
from sleepcast.channel.drops import DropReason
from sleepcast.channel.envelope import encode, look
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import BATCH, LIFE, MAX_WANTED, REPAIR_RATE
from sleepcast.channel.sequencer import MAX_STREAMS

OBSERVER = KeyPair("obs", Role.OBSERVER, b"o" * 32)
OTHER = KeyPair("other", Role.OPERATOR, b"x" * 32)
CHIEF = KeyPair("chief", Role.COMMANDER, b"c" * 32)
ALL = (OBSERVER.public, OTHER.public, CHIEF.public)


class Insider:
    """Somebody with a key that is trusted, who says what they like to one party, from any name and epoch."""

    def __init__(self, air: Air, key: KeyPair) -> None:
        self._air, self._key, self._number = air, key, 0

    def say(self, to: Party, kind: Kind, body: dict[str, object], **fields: object) -> None:
        now, self._number = self._air.clock.now(), self._number + 1
        told = {"sender": self._key.public.owner, "epoch": 1, "deadline": now + LIFE, **fields}
        message = Message(sequence=self._number, kind=kind, issued=now, body=body, **told)  # type: ignore[arg-type]
        for datagram in encode(message, "lab", self._key):
            to.got += to.delivery.take(datagram, now)


def invented(count: int, key: KeyPair = DESK, number: int = 7) -> list[list[object]]:
    return [[key.id, 2**40 + epoch, number] for epoch in range(count)]


def order(desk: Party, air: Air, text: str, **how: object) -> Message:
    return desk.delivery.post(Kind.COMMAND, air.clock.now(), text=text, **how)  # type: ignore[arg-type]


def texts(robot: Party) -> list[str]:
    return [message.text for message in robot.got]


@pytest.mark.parametrize("liar", [OBSERVER, ROBOTS, OTHER], ids=lambda key: str(key.public.role))
@pytest.mark.parametrize("kind", [Kind.DIGEST, Kind.REQUEST])
def test_what_digests_and_requests_invent_silences_nobody(liar: KeyPair, kind: Kind) -> None:
    """After a command with a long deadline the next one must be known to follow it, or it waits for that one's end."""
    air = Air(3, seed=1, trusted=ALL)
    order(air.desk, air, "(SETQ a 0)", deadline=air.clock.now() + 600.0)
    air.run(1.0)
    insider = Insider(air, liar)
    for start in range(0, 4 * MAX_STREAMS, MAX_STREAMS):
        lies = invented(start + MAX_STREAMS)[start:]
        body = {"have": lies} if kind is Kind.DIGEST else {"want": [[*each[:2], [each[2]]] for each in lies]}
        for party in air.everybody():
            insider.say(party, kind, body, sender="r9" if liar is ROBOTS else liar.public.owner)
    for number in range(1, 4):
        order(air.desk, air, f"(SETQ a {number})")
        air.run(1.0)
    assert [texts(robot) for robot in air.robots] == [[f"(SETQ a {number})" for number in range(4)]] * 3
    assert air.robots[0].delivery.sequencer.names == ((DESK.id, 1),)


def test_lies_in_digests_are_counted_and_told() -> None:
    air = Air(1, seed=1, trusted=ALL)
    (robot,) = air.robots
    for start in (0, MAX_STREAMS):
        Insider(air, OBSERVER).say(robot, Kind.DIGEST, {"have": invented(start + MAX_STREAMS)[start:]}, epoch=start + 1)
    admission = robot.delivery.admission
    assert admission.drops.by_key[OBSERVER.id, DropReason.NO_ROOM] == MAX_STREAMS
    air.clock.advance(0.5)
    (notice,) = admission.drops.notices(admission.trust)
    assert notice.text == (
        f"130 messages a second of key {OBSERVER.id.hex()[:4]} (obs) are more than there is room for: its oldest are "
        "forgotten"
    )


def test_a_newcomer_still_learns_from_digests() -> None:
    """It has no stream of what it never heard, and yet asks for it."""
    air = Air(3, seed=2, trusted=ALL)
    sent = [f"(RULE a {number})" for number in range(30)]
    for text in sent:
        order(air.desk, air, text, standing=True)
        air.run(0.05)
    air.run(10.0)
    air.desk.on = False
    insider = Insider(air, OBSERVER)
    new = air.join("r7", ROBOTS)
    for _ in range(20):
        insider.say(new, Kind.DIGEST, {"have": invented(MAX_STREAMS)})
        air.run(0.5)
    assert texts(new) == sent


def test_a_desk_repeats_what_robots_tell_and_no_lie_takes_the_room_of_its_own_rules() -> None:
    air = Air(2, seed=3, trusted=ALL)
    chief = air.join("chief", CHIEF)
    order(chief, air, "(RULE b 1)", standing=True)
    order(air.desk, air, "(RULE a 1)", standing=True)
    air.run(5.0)
    high = [[b"\xff" * 8, 1, 3], *invented(MAX_STREAMS - 1, CHIEF)]
    Insider(air, OBSERVER).say(air.desk, Kind.DIGEST, {"have": invented(MAX_STREAMS, CHIEF)})
    Insider(air, ROBOTS).say(air.desk, Kind.DIGEST, {"have": high}, sender="r9")
    told = {(key, epoch): rules for key, epoch, rules in air.desk.delivery._digest(air.clock.now())["have"]}  # type: ignore[attr-defined]
    assert told[DESK.id, 1] == 1
    assert len(told) <= MAX_STREAMS
    lies = {name for name in told if name[1] > 100}
    assert lies <= {(CHIEF.id, epoch) for _, epoch, _ in high[1:]}, "an observer's tale is not repeated"


def test_an_operator_who_begins_many_epochs_loses_their_own_streams() -> None:
    air = Air(1, seed=4, trusted=ALL)
    (robot,) = air.robots
    order(air.desk, air, "(SETQ a 0)", deadline=air.clock.now() + 600.0)
    air.run(1.0)
    for epoch in range(1, 3 * MAX_STREAMS):
        Insider(air, OTHER).say(robot, Kind.COMMAND, {}, epoch=epoch, text="(SETQ b 1)")
    order(air.desk, air, "(SETQ a 1)")
    air.run(1.0)
    assert texts(robot)[-1] == "(SETQ a 1)"
    assert len(robot.delivery.sequencer.names) == MAX_STREAMS
    assert robot.delivery.admission.drops.by_key[OTHER.id, DropReason.NO_ROOM] >= 2 * MAX_STREAMS


def test_an_operator_who_begins_many_epochs_makes_nobody_forget_a_commanders_rules() -> None:
    air = Air(1, seed=4, trusted=ALL)
    (robot,) = air.robots
    for epoch in range(1, MAX_STREAMS):
        Insider(air, CHIEF).say(robot, Kind.COMMAND, {}, epoch=epoch, text="(RULE a 1)", standing=True)
    for epoch in range(1, MAX_STREAMS):
        Insider(air, OTHER).say(robot, Kind.COMMAND, {}, epoch=epoch, text="(SETQ b 1)")
    assert len(robot.delivery.sequencer.standing()) == MAX_STREAMS - 1


@pytest.mark.parametrize("standing", [False, True])
def test_commands_of_one_key_take_no_room_from_those_that_others_may_still_miss(standing: bool) -> None:
    air = Air(1, seed=5, trusted=ALL)
    (robot,) = air.robots
    sent = order(air.desk, air, "(RULE a 1)", standing=standing)
    air.run(1.0)
    store = robot.delivery._store
    name = CHIEF.id, 1
    for number in range(1, 30_000 if standing else 1_000):
        store.keep(name, number, standing, (b"",), air.clock.now())
    assert store.take((DESK.id, 1), sent.sequence, air.clock.now())


def test_whoever_invents_names_and_epochs_lets_nothing_be_heard_twice() -> None:
    """What a robot has heard of others stays known, so that a replay of it is dropped."""
    air = Air(1, seed=6, trusted=ALL)
    robot, now = air.robots[0], air.clock.now()
    tell = Message("r8", 1, 1, Kind.COMMAND, now, now + LIFE, "(SETQ a 1)")
    (datagram,) = encode(tell, "lab", ROBOTS)
    assert robot.delivery.take(datagram, now)
    note = robot.delivery.admission.note
    for epoch in range(20_000):
        note(OBSERVER.id, "obs", epoch, 1)
    for number in range(20_000):
        note(b"many", f"s{number}", 1, 1)
    assert not robot.delivery.take(datagram, now)
    assert robot.delivery.admission.counts[DropReason.REPEATED] == 1


def test_wrong_clocks_of_invented_robots_leave_those_of_others_known() -> None:
    clocks = WrongClocks(100)
    clocks.note("r1", 50.0, "key of r1")
    for number in range(1_000):
        clocks.note(f"s{number}", 9.0, "key of s*")
        clocks.note_took(f"s{number}", "desk", 9.0, "key of s*")
    assert clocks.ahead("r1") == 50.0
    assert len(clocks.wrong) <= 100


def repaired(party: Party, air: Air, seconds: float = 0.1) -> list[int]:
    """The numbers of the commands that it sends again within these seconds."""
    found: list[int] = []
    for _ in range(round(seconds / 0.005)):
        air.clock.advance(0.005)
        parts = map(look, party.delivery.step(air.clock.now())[0])
        found += [part.sequence for part in parts if part.kind is Kind.COMMAND]
    return found


def with_rules(air: Air, count: int) -> Party:
    """A robot that has so many standing commands of a kilobyte, long ago."""
    for number in range(count):
        order(air.desk, air, f"(RULE a {number}) {'; ' + 'x' * 900}", standing=True)
    air.run(20.0)
    return air.robots[0]


def test_whoever_asks_without_end_leaves_half_of_the_repairs_to_others() -> None:
    air = Air(1, seed=8, trusted=ALL)
    robot = with_rules(air, 300)
    insider = Insider(air, OBSERVER)

    def asks(numbers: Iterable[int], key: Insider, **fields: object) -> None:
        key.say(robot, Kind.REQUEST, {"want": [[DESK.id, 1, [*numbers]]]}, **fields)

    for number in range(1, 241, BATCH):  # more than may be resent in a second
        asks(range(number, number + BATCH), insider)
    greedy = repaired(robot, air)
    assert 0.4 * REPAIR_RATE < 1_000 * len(greedy) < 0.7 * REPAIR_RATE
    for number in range(1, 241, BATCH):
        asks(range(number, number + BATCH), insider)
    asks(range(250, 270), Insider(air, ROBOTS), sender="r9")
    assert {*repaired(robot, air)} >= {*range(250, 270)}


def test_a_request_is_answered_with_at_most_as_many_commands_as_it_may_name() -> None:
    air = Air(1, seed=9, trusted=ALL)
    robot = with_rules(air, 100)
    want = [[DESK.id, 1, [*range(start, start + BATCH)]] for start in range(1, 97, BATCH)]
    Insider(air, OBSERVER).say(robot, Kind.REQUEST, {"want": want})
    assert 0 < len(repaired(robot, air)) <= MAX_WANTED


def test_whoever_asks_for_what_nobody_has_keeps_no_robot_from_asking() -> None:
    """A robot that has missed a command asks for it, though somebody near it says all the time that they ask."""
    air = Air(1, seed=10, trusted=ALL)
    (robot,) = air.robots
    air.cut = {frozenset((0, 1))}
    missed = order(air.desk, air, "(SETQ a 1)", deadline=air.clock.now() + 60.0)
    air.run(1.0)
    air.cut = set()
    order(air.desk, air, "(SETQ a 2)", deadline=air.clock.now() + 60.0)
    insider = Insider(air, OBSERVER)
    for _ in range(60):
        if not robot.got:
            insider.say(robot, Kind.REQUEST, {"want": [[DESK.id, 1, [missed.sequence]]]})
        air.run(0.05)
    assert texts(robot) == ["(SETQ a 1)", "(SETQ a 2)"]


def test_only_what_is_resent_at_once_puts_off_the_requests_of_others() -> None:
    air = Air(1, seed=11, trusted=ALL)
    robot = air.robots[0]
    air.cut = {frozenset((0, 1))}
    first = order(air.desk, air, "(SETQ a 1)", deadline=air.clock.now() + 60.0)
    air.run(1.0)
    air.cut = set()
    order(air.desk, air, "(SETQ a 2)", deadline=air.clock.now() + 60.0)
    for _ in range(4):
        air.step()
        air.clock.advance(0.005)
    air.desk.on = False
    sequencer = robot.delivery.sequencer
    stream = sequencer.find((DESK.id, 1))
    assert stream is not None
    due = stream.wanted[first.sequence].due
    others = [*range(10_000, 10_000 + BATCH)]
    Insider(air, OBSERVER).say(robot, Kind.REQUEST, {"want": [[DESK.id, 1, [*others, first.sequence]]]})
    assert stream.wanted[first.sequence].due == due
