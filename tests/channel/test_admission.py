"""What comes in, and why everything else does not."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from math import inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import (
    ANSWERS_TO_OTHERS,
    MAX_REASSEMBLIES,
    OLDEST,
    SKEW,
    STOPS_A_SECOND,
    STOPS_AT_ONCE,
    VERIFIED_A_SECOND,
    VERIFIED_BY_OPERATOR,
    VERIFIED_IN_ALL,
    WINDOW,
    Admission,
    Admitted,
)
from sleepcast.channel.drops import DropReason
from sleepcast.channel.envelope import HEAD, PAYLOAD_AT, SIGNATURE_HEAD, encode, look, signed_bytes
from sleepcast.channel.keys import ID_BYTES, KeyPair, KeyRefusal, Trust
from sleepcast.channel.message import MAX_TEXT, Role
from sleepcast.core.clock import ManualClock

DESK = KeyPair("desk", Role.OPERATOR, b"d" * 32)
CHIEF = KeyPair("chief", Role.COMMANDER, b"c" * 32)
WATCH = KeyPair("watch", Role.OBSERVER, b"w" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
STRANGER = KeyPair("desk", Role.COMMANDER, b"s" * 32)
NOW = 1_000.0
SEQUENCE_AT = 13
"""Where a message's number lies in what is signed: after its epoch, with its own head."""


def trust() -> Trust:
    return Trust(key.public for key in (DESK, CHIEF, WATCH, ROBOTS))


def admission(robot: bool = True, rate: float = 1e9, clock: ManualClock | None = None) -> Admission:
    return Admission(trust(), "lab", clock or ManualClock(NOW), robot=robot, rate=rate)


def message(sequence: int = 1, sender: str = "desk", kind: Kind = Kind.COMMAND, **others: object) -> Message:
    fields: dict[str, object] = {"epoch": 1, "issued": NOW, "deadline": NOW + 5.0, "text": "(ST)", "role": "operator"}
    return Message(**{**fields, **others}, sender=sender, sequence=sequence, kind=kind)  # type: ignore[arg-type]


def only(datagrams: list[bytes]) -> bytes:
    (datagram,) = datagrams
    return datagram


def test_a_message_comes_in_once() -> None:
    here, sent = admission(), message(key=DESK.id.hex())
    datagram = only(encode(sent, "lab", DESK))
    assert [here.enter(datagram) for _ in range(3)] == [Admitted(sent, (datagram,)), None, None]
    assert (here.passed, here.counts) == (1, {DropReason.REPEATED: 2})


def test_a_message_comes_in_once_whoever_of_a_keys_owners_says_it() -> None:
    for sender in ("r1", "r*"):
        here = admission(robot=False)
        datagram = only(encode(message(sender=sender, kind=Kind.REPORT), "lab", ROBOTS))
        assert [here.enter(datagram) is not None for _ in range(3)] == [True, False, False]
        assert here.counts == {DropReason.REPEATED: 2}


@pytest.mark.parametrize(
    ("reason", "sent", "key", "fleet"),
    [
        (DropReason.UNKNOWN_KEY, message(), STRANGER, "lab"),
        (DropReason.OTHER_FLEET, message(), DESK, "sea"),
        (DropReason.NOT_ALLOWED, message(sender="watch"), WATCH, "lab"),
        (DropReason.NOT_ALLOWED, message(sender="watch", kind=Kind.RELEASE), WATCH, "lab"),
        (DropReason.NOT_ALLOWED, message(sender="r1", kind=Kind.RELEASE), ROBOTS, "lab"),
        (DropReason.NOT_ALLOWED, message(sender="chief"), DESK, "lab"),
        (DropReason.NOT_ALLOWED, message(sender="desk"), ROBOTS, "lab"),
        (DropReason.NOT_ALLOWED, message(kind=Kind.ANSWER), DESK, "lab"),
        (DropReason.NOT_FOR_US, message(sender="r1", kind=Kind.ANSWER), ROBOTS, "lab"),
        (DropReason.LATE, message(issued=NOW - 9.0, deadline=NOW - SKEW - 0.1), DESK, "lab"),
        (DropReason.EARLY, message(issued=NOW + SKEW + 0.1, deadline=inf), DESK, "lab"),
    ],
)
def test_what_is_dropped_and_why(reason: DropReason, sent: Message, key: KeyPair, fleet: str) -> None:
    here = admission()
    assert here.enter(only(encode(sent, fleet, key))) is None
    assert here.counts == {reason: 1}


def test_without_a_deadline_news_grow_old() -> None:
    here = admission(clock=ManualClock(NOW + OLDEST + SKEW + 1.0))
    assert here.enter(only(encode(message(deadline=inf), "lab", DESK))) is None
    assert here.counts == {DropReason.LATE: 1}


@pytest.mark.parametrize("key", [DESK, CHIEF, WATCH, ROBOTS], ids=lambda key: str(key.public.role))
def test_anybody_with_a_role_may_stop(key: KeyPair) -> None:
    sender = "r5" if key is ROBOTS else key.public.owner
    assert admission().enter(only(encode(message(sender=sender, kind=Kind.STOP), "lab", key)))


STANDS = "stands"
LETS_IN = {
    Role.OBSERVER: {Kind.ASK, Kind.STOP, Kind.DIGEST, Kind.REQUEST},
    Role.OPERATOR: {*Kind} - {Kind.ANSWER, Kind.REPORT},
    Role.COMMANDER: {*Kind, STANDS} - {Kind.ANSWER, Kind.REPORT},
    Role.ROBOT: {Kind.COMMAND, Kind.STOP, Kind.DIGEST, Kind.REQUEST},
}
"""What each role may say to a robot."""


@pytest.mark.parametrize("key", [WATCH, DESK, CHIEF, ROBOTS], ids=lambda key: str(key.public.role))
@pytest.mark.parametrize("kind", [*Kind, STANDS])
def test_a_role_goes_as_far_as_it_goes_and_no_further(key: KeyPair, kind: Kind | str) -> None:
    sender = "r5" if key is ROBOTS else key.public.owner
    sent = message(sender=sender, kind=Kind.COMMAND if kind == STANDS else Kind(kind), standing=kind == STANDS)
    datagram = only(encode(sent, "lab", key))
    assert bool(admission().enter(datagram)) is (kind in LETS_IN[key.public.role])
    heard = admission(robot=False).enter(datagram)
    to_operator = {Kind.ANSWER, Kind.REPORT, Kind.STOP, Kind.DIGEST, Kind.REQUEST}
    assert bool(heard) is (kind in (to_operator if key is ROBOTS else LETS_IN[key.public.role]))


def test_an_operator_has_no_ear_for_what_robots_tell_each_other() -> None:
    here = admission(robot=False)
    assert here.enter(only(encode(message(sender="r1"), "lab", ROBOTS))) is None
    assert here.counts == {DropReason.NOT_FOR_US: 1}
    assert here.enter(only(encode(message(sender="r1", kind=Kind.ANSWER, sequence=2), "lab", ROBOTS)))


def test_a_revoked_key_counts_no_more_and_stays_revoked() -> None:
    here = admission()
    here.trust.revoke("desk")
    here.trust.add(DESK.public)
    assert here.enter(only(encode(message(), "lab", DESK))) is None
    assert here.enter(only(encode(message(kind=Kind.STOP), "lab", DESK))) is None
    assert here.counts == {DropReason.REVOKED: 2}


@given(st.data())
def test_a_changed_byte_never_comes_in(data: st.DataObject) -> None:
    datagram = only(encode(message(), "lab", DESK))
    at = data.draw(st.integers(0, len(datagram) - 1))
    here = admission()
    assert (
        here.enter(datagram[:at] + bytes([datagram[at] ^ data.draw(st.integers(1, 255))]) + datagram[at + 1 :]) is None
    )
    assert sum(here.counts.values()) == 1
    assert here.enter(datagram), "a forgery must not use up the number of what it forged"


def test_signatures_of_one_key_are_looked_at_at_a_rate_and_stop_has_its_own() -> None:
    clock = ManualClock(NOW)
    here = admission(rate=VERIFIED_A_SECOND, clock=clock)
    good = only(encode(message(), "lab", DESK))
    forged = good[:-1] + bytes([good[-1] ^ 1])
    for _ in range(1_000):
        here.enter(forged)
    assert here.counts[DropReason.FORGED] == VERIFIED_A_SECOND
    assert here.counts[DropReason.TOO_MANY] == 1_000 - VERIFIED_A_SECOND
    assert here.enter(good) is None
    assert here.enter(only(encode(message(2, kind=Kind.STOP), "lab", DESK)))
    assert here.enter(only(encode(message(3, sender="chief"), "lab", CHIEF))), "another key has a budget of its own"
    clock.advance(1.0)
    assert here.enter(good)


def forged(sequence: int, kind: Kind = Kind.STOP) -> bytes:
    """As the desk's own, but for the signature."""
    found = only(encode(message(sequence, kind=kind), "lab", STRANGER))
    return found[: len(HEAD)] + DESK.id + found[len(HEAD) + ID_BYTES :]


@pytest.mark.parametrize("seed", range(3))
def test_a_real_stop_comes_in_within_a_second_while_80_000_are_forged(seed: int) -> None:
    """Each hundredth of a second brings 800 forgeries, and in some place among them one copy of the real one."""
    clock, chance = ManualClock(NOW), random.Random(seed)
    here = Admission(trust(), "lab", clock, robot=True, chance=random.Random(seed))
    forgeries = [forged(number) for number in range(2, 1_002)]
    stop = only(encode(message(kind=Kind.STOP), "lab", DESK))
    for datagram in (each for _ in range(40) for each in forgeries):  # half a second: whatever was saved is spent
        clock.advance(1.0 / 80_000)
        here.enter(datagram)
    begun, entered = clock.now(), None
    while entered is None and clock.now() < begun + 1.0:
        place = chance.randrange(800)
        for number in range(800):
            clock.advance(1.0 / 80_000)
            entered = entered or (here.enter(stop) if number == place else None)
            here.enter(forgeries[number])
    assert entered is not None
    assert here.counts[DropReason.FORGED] <= STOPS_A_SECOND * (clock.now() - NOW + STOPS_AT_ONCE) + 1, (
        "and no more work"
    )


def test_forgeries_in_a_row_do_not_keep_a_stop_out() -> None:
    here = Admission(trust(), "lab", ManualClock(NOW), robot=True)
    for number in range(2, 402):
        assert here.enter(forged(number)) is None
    assert here.enter(only(encode(message(kind=Kind.STOP), "lab", DESK))) is not None


def test_a_commands_copies_come_in_by_their_share_of_a_flood() -> None:
    """Also where forgeries always come first: no place in the queue is better than another."""
    clock, came = ManualClock(NOW), 0
    here = Admission(trust(), "lab", clock, robot=True, chance=random.Random(1))
    forgeries = [forged(number, Kind.COMMAND) for number in range(10_000, 10_009)]
    for number in range(1, 4_001):  # nine forgeries and one of ours, four hundred times a second
        for datagram in (*forgeries, only(encode(message(number), "lab", DESK))):
            came += here.enter(datagram) is not None
        clock.advance(1.0 / 400.0)
    assert came == pytest.approx(10.0 * VERIFIED_A_SECOND / 10.0, rel=0.3)


def test_forgeries_under_many_keys_are_looked_at_at_a_rate_in_all() -> None:
    clock, keys = ManualClock(NOW), [KeyPair(f"r{n}", Role.ROBOT, n.to_bytes(32, "big")) for n in range(1, 101)]
    here = Admission(Trust(key.public for key in keys), "lab", clock, robot=True, chance=random.Random(1))
    said = [only(encode(message(sender=key.public.owner), "lab", STRANGER)) for key in keys]
    told = [each[: len(HEAD)] + key.id + each[len(HEAD) + ID_BYTES :] for each, key in zip(said, keys, strict=True)]
    for _ in range(100):
        clock.advance(0.01)
        for datagram in told:
            here.enter(datagram)
    assert VERIFIED_IN_ALL <= here.counts[DropReason.FORGED] <= 2.0 * VERIFIED_IN_ALL + 1.0, (
        "a second's worth, and a second"
    )


def test_answers_to_others_keep_out_no_answer_to_us() -> None:
    clock = ManualClock(NOW)
    door = admission(robot=False, rate=VERIFIED_BY_OPERATOR, clock=clock)
    door.own = b"desk-1."
    told = [
        only(encode(message(number, "r1", Kind.ANSWER, body={"command": f"{asker}.{number}"}), "lab", ROBOTS))
        for number, asker in enumerate(("guest-1",) * 2_500 + ("desk-1",) * 500, 1)
    ]
    came = [door.enter(datagram) for datagram in told]
    assert all(came[2_500:])
    assert 1_500 < sum(each is not None for each in came[:2_500]) <= ANSWERS_TO_OTHERS


def test_a_desk_hears_others_at_the_pace_of_robots() -> None:
    door = admission(robot=False, rate=VERIFIED_BY_OPERATOR, clock=ManualClock(NOW))
    asked = [only(encode(message(number, kind=Kind.ASK), "lab", DESK)) for number in range(1, 401)]
    assert sum(door.enter(datagram) is not None for datagram in asked) <= VERIFIED_A_SECOND


def parts_of(text: str, sequence: int = 1) -> list[bytes]:
    found = encode(message(sequence, text=text), "lab", DESK)
    assert len(found) > 2
    return found


@settings(max_examples=30)
@given(st.randoms(use_true_random=False))
def test_the_parts_of_a_long_message_come_in_any_order_and_more_than_once(chance: random.Random) -> None:
    here, text = admission(), "x" * 10_000
    coming = parts_of(text) * 2
    chance.shuffle(coming)
    found = [heard for heard in map(here.enter, coming) if heard is not None]
    assert [(heard.message.text, set(heard.datagrams)) for heard in found] == [(text, set(coming))]


def test_long_messages_that_are_never_completed_take_bounded_room() -> None:
    here = admission()
    for sequence in range(10 * MAX_REASSEMBLIES):
        here.enter(parts_of("x" * 5_000, sequence)[0])
    assert len(here._open) <= MAX_REASSEMBLIES
    datagrams = parts_of("y" * 5_000, 10 * MAX_REASSEMBLIES)
    assert [heard.message.text for heard in map(here.enter, datagrams) if heard] == ["y" * 5_000]


@pytest.mark.parametrize("known", [True, False])
def test_a_flood_of_messages_in_96_parts_pushes_out_no_long_message_of_others(known: bool) -> None:
    """An observer's, well signed, of which no one is ever complete; and forged ones of the desk's own key."""
    here, text = admission(rate=1e9), "y" * 5_000
    first, *others = parts_of(text)
    assert here.enter(first) is None
    asked = encode(message(1, sender="watch", kind=Kind.ASK, text="\N{SNOWMAN}" * MAX_TEXT), "lab", WATCH)
    for sequence in range(20 * MAX_REASSEMBLIES):
        if known:
            flood = replaced(asked[sequence % len(asked)], sequence, WATCH)
        else:
            flood = replaced(asked[sequence % len(asked)], sequence, STRANGER, DESK.id)
        assert here.enter(flood) is None
    assert here.counts[DropReason.FORGED] == (0 if known else 20 * MAX_REASSEMBLIES)
    assert len(here._open) == (MAX_REASSEMBLIES if known else 1)
    assert [heard.message.text for heard in map(here.enter, others) if heard] == [text]


def replaced(datagram: bytes, sequence: int, key: KeyPair, named: bytes = b"") -> bytes:
    """The part of another message, signed with this key. named: the id that it says instead."""
    payload = bytearray(look(datagram).payload)
    payload[SEQUENCE_AT : SEQUENCE_AT + 8] = (sequence + 1_000).to_bytes(8, "big")
    head = datagram[: len(HEAD)] + (named or key.id) + datagram[PAYLOAD_AT - 3 : PAYLOAD_AT]
    return head + payload + SIGNATURE_HEAD + key.sign(signed_bytes(bytes(payload)))


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 3 * WINDOW)), min_size=1, max_size=60))
def test_a_number_counts_once_and_never_after_the_window(numbers: list[tuple[int, int]]) -> None:
    here = Admission(trust(), "lab", ManualClock(NOW), robot=True, rate=1e9)
    heard: set[tuple[int, int]] = set()
    newest: dict[int, int] = {}
    for epoch, sequence in numbers:
        known = (epoch, sequence) in heard or sequence <= newest.get(epoch, -1) - WINDOW
        came_in = here.enter(only(encode(message(sequence, epoch=epoch), "lab", DESK))) is not None
        assert came_in is not known
        heard.add((epoch, sequence))
        newest[epoch] = max(newest.get(epoch, -1), sequence)


def test_what_stands_counts_however_old_it_is() -> None:
    here = admission(clock=ManualClock(NOW + 10.0 * OLDEST))
    assert here.enter(only(encode(message(sender="chief", deadline=inf, standing=True), "lab", CHIEF)))


@pytest.mark.parametrize("key", [DESK, WATCH, ROBOTS])
def test_only_a_commander_says_what_stands(key: KeyPair) -> None:
    """Authority by key: rules are a commander's, however good the signature of somebody else."""
    here = admission()
    said = message(sender=key.public.owner.replace("*", "1"), deadline=inf, standing=True)
    assert here.enter(only(encode(said, "lab", key))) is None
    assert here.counts == {DropReason.NOT_ALLOWED: 1}


def test_trust_is_bounded_and_names_what_it_does_not_know() -> None:
    known = trust()
    with pytest.raises(KeyRefusal, match="did you mean chief"):
        known.revoke("chef")
    with pytest.raises(KeyRefusal, match="32 bytes"):
        replace(DESK.public, public=b"short")
    with pytest.raises(KeyRefusal, match="1 to 64"):
        replace(DESK.public, owner="")
    with pytest.raises(KeyRefusal, match="only robots may share a key"):
        replace(DESK.public, owner="d*")
    with pytest.raises(KeyRefusal, match="32 bytes"):
        KeyPair("desk", Role.OPERATOR, b"short")
    one, other = KeyPair.new("a", Role.ROBOT), KeyPair.new("a", Role.ROBOT)
    assert one.id != other.id


FLOODS: list[Callable[[], bytes]] = [
    lambda: b"",
    lambda: b"\xd2" * 300,
    lambda: only(encode(message(), "lab", STRANGER)),
]


@pytest.mark.parametrize("flood", FLOODS)
def test_a_flood_leaves_nothing_behind(flood: Callable[[], bytes]) -> None:
    here, datagram = admission(), flood()
    for _ in range(10_000):
        here.enter(datagram)
    assert (here.passed, sum(here.counts.values())) == (0, 10_000)
    assert (len(here._heard), len(here._open), len(here._budgets)) == (0, 0, 0)


def test_a_number_far_behind_the_latest_costs_nothing() -> None:
    here = admission()
    here.note(ROBOTS.id, "r1", 1, 2**62)
    here.note(ROBOTS.id, "r1", 1, 5)
    sent = message(sender="r1", kind=Kind.DIGEST, sequence=5)
    assert here.enter(only(encode(sent, "lab", ROBOTS))) is None
    assert here.counts == {DropReason.REPEATED: 1}
