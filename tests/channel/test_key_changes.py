"""Whom to trust, told over a bad radio: everybody believes the same in the end, and no longer whom he should not."""

from __future__ import annotations

import random
from collections.abc import Sequence

import pytest

from channel.air import DESK, ROBOTS, Air, Party
from sleepcast.channel import Kind, Message
from sleepcast.channel.drops import DropReason
from sleepcast.channel.envelope import look
from sleepcast.channel.keys import (
    MAX_CHANGES,
    MAX_KEYS,
    MAX_VOUCHED,
    KeyChange,
    KeyPair,
    KeyRefusal,
    PublicKey,
    Trust,
    fingerprint,
)
from sleepcast.channel.message import KEYS, Role

CHIEF = KeyPair("chief", Role.COMMANDER, b"c" * 32)
ANNA = KeyPair("anna", Role.OPERATOR, b"a" * 32)
WATCH = KeyPair("watch", Role.OBSERVER, b"w" * 32)
NEW = KeyPair("desk", Role.COMMANDER, b"n" * 32)
KNOWN = (CHIEF.public, ANNA.public, WATCH.public)


def change(
    party: Party, air: Air, trust: Sequence[PublicKey] = (), vouch: Sequence[bytes] = (), **others: bytes
) -> None:
    said = KeyChange(tuple(trust), frozenset(vouch), frozenset(others.values()))
    party.delivery.post(Kind.COMMAND, air.clock.now(), standing=True, body={KEYS: said.written()})


def say(party: Party, air: Air, text: str, standing: bool = False) -> None:
    party.delivery.post(Kind.COMMAND, air.clock.now(), text=text, standing=standing)


def texts(party: Party) -> list[str]:
    return [message.text for message in party.got if message.text]


def roles(party: Party) -> dict[str, list[bool]]:
    found: dict[str, list[bool]] = {}
    for key in party.delivery.admission.trust.keys:
        found.setdefault(key.owner, []).append(key.revoked)
    return found


def test_a_new_operator_is_obeyed_and_a_revoked_one_is_not_everywhere_and_by_late_comers() -> None:
    air = Air(8, seed=1, loss=0.3, twice=0.1)
    anna = air.join("anna", ANNA)
    say(anna, air, "(before)")
    air.run(9.0)
    assert not any(texts(robot) for robot in air.robots)
    change(air.desk, air, trust=[ANNA.public])
    air.run(3.0)
    say(anna, air, "(between)")
    air.run(6.0)
    assert [texts(robot) for robot in air.robots] == [["(between)"]] * 8
    change(air.desk, air, thief=ANNA.id)
    air.run(3.0)
    say(anna, air, "(after)")
    anna.delivery.post(Kind.STOP, air.clock.now())
    late = air.join("r99", ROBOTS)
    air.run(5.0)
    assert [texts(robot) for robot in (*air.robots, late)] == [["(between)"]] * 8 + [[]]
    assert all(roles(robot)["anna"] == [True] for robot in (*air.robots, late))
    assert all(robot.delivery.admission.counts[DropReason.REVOKED] for robot in air.robots)
    assert not any(message.kind is Kind.STOP for robot in air.robots for message in robot.got)


def test_a_key_is_rotated_and_late_comers_have_the_rules_of_the_old_one() -> None:
    air = Air(6, seed=2, loss=0.3)
    say(air.desk, air, "(RULE a 1)", standing=True)
    say(air.desk, air, "(RULE b 2)", standing=True)
    change(air.desk, air, trust=[NEW.public])
    air.run(3.0)
    desk = air.join("desk", NEW)
    desk.delivery.admission.trust.add(NEW.public)
    change(desk, air, vouch=[*map(fingerprint, air.desk.delivery.standing_of(DESK.id))])
    change(desk, air, old=DESK.id)
    air.run(4.0)
    say(air.desk, air, "(RULE stolen 1)", standing=True)
    say(desk, air, "(RULE c 3)", standing=True)
    air.run(4.0)
    air.desk.on = False  # who has not heard of the end of a key would still hear the thief himself
    late = air.join("r99", ROBOTS)
    air.run(8.0)
    assert [texts(robot) for robot in air.robots] == [["(RULE a 1)", "(RULE b 2)", "(RULE c 3)"]] * 6
    assert sorted(texts(late)) == ["(RULE a 1)", "(RULE b 2)", "(RULE c 3)"]
    assert roles(late) == {"desk": [True, False], "r*": [False]}


def test_what_a_thief_has_said_before_the_revocation_came_reaches_nobody_else() -> None:
    air = Air(4, seed=3, trusted=KNOWN)
    chief = air.join("chief", CHIEF)
    say(chief, air, "(RULE good 1)", standing=True)
    air.run(2.0)
    known = [*map(fingerprint, chief.delivery.standing_of(CHIEF.id))]
    air.cut = {frozenset((5, number)) for number in (0, 3, 4)} | {
        frozenset((far, near)) for far in (1, 2) for near in (0, 3, 4)
    }
    say(chief, air, "(RULE bad 1)", standing=True)  # two robots hear it
    air.run(2.0)
    change(air.desk, air, vouch=known)
    change(air.desk, air, thief=CHIEF.id)
    air.run(2.0)
    air.cut = set()
    chief.on = False
    air.run(4.0)
    late = air.join("r99", ROBOTS)
    air.run(8.0)
    assert [texts(robot) for robot in air.robots[:2]] == [["(RULE good 1)", "(RULE bad 1)"]] * 2
    assert [texts(robot) for robot in (*air.robots[2:], late)] == [["(RULE good 1)"]] * 3
    air.run(120.0)
    air.sent.clear()
    air.run(120.0)
    assert sum(air.sent.values()) <= 14, "nobody goes on telling what nobody takes"


def test_what_of_a_revoked_key_was_still_waited_for_is_not_obeyed_any_more() -> None:
    air = Air(1, seed=4, trusted=KNOWN)
    anna = air.join("anna", ANNA)
    air.cut = {frozenset((1, 2)), frozenset((0, 2))}
    say(anna, air, "(lost)")
    air.run(0.5)
    anna.delivery._store._recent.clear()
    air.cut = set()
    say(anna, air, "(waits for it)")
    air.run(0.3)
    assert texts(air.robots[0]) == []
    change(air.desk, air, thief=ANNA.id)
    air.run(6.0)
    assert texts(air.robots[0]) == []


def test_replays_of_a_revoked_key_move_nobody_and_nobody_helps_to_replay_them() -> None:
    """Whoever has recorded everything that a key has ever said replays it after the revocation, to old and new robots,
    asks for it, and tells of it; a robot that was started again knows no better."""
    air = Air(2, seed=8, trusted=KNOWN)
    chief, anna, watch = (air.join(name, key) for name, key in (("chief", CHIEF), ("anna", ANNA), ("watch", WATCH)))
    recorded: list[bytes] = []
    send = air._send

    def record(who: int, datagram: bytes, now: float) -> None:
        recorded.append(datagram)
        send(who, datagram, now)

    air._send = record  # type: ignore[method-assign]
    say(chief, air, "(RULE a 1)", standing=True)
    say(anna, air, "(SETQ a 1)")
    chief.delivery.post(Kind.STOP, air.clock.now())
    anna.delivery.post(Kind.RELEASE, air.clock.now())
    anna.delivery.post(Kind.HEARTBEAT, air.clock.now())
    air.run(3.0)
    stored = air.robots[0].delivery.news()
    change(air.desk, air, one=CHIEF.id, two=ANNA.id)
    air.run(3.0)
    chief.on = anna.on = air.desk.on = False
    late = air.join("r99", ROBOTS)
    again = air.join("r0", ROBOTS)
    for party in (late, again):
        for key in (CHIEF.id, ANNA.id):
            party.delivery.admission.trust.take(KeyChange(revoke=frozenset({key})))
    again.delivery.restore(stored, air.clock.now())
    parties = [*air.robots, late, again]
    for party in parties:
        party.got.clear()
    theirs = [datagram for datagram in recorded if look(datagram).key in (CHIEF.id, ANNA.id)]
    assert {look(datagram).kind for datagram in theirs} >= {Kind.COMMAND, Kind.STOP, Kind.RELEASE, Kind.HEARTBEAT}
    wanted: list[object] = [[key, epoch, [1, 2, 3]] for key in (CHIEF.id, ANNA.id) for epoch in range(1, 6)]
    watch.delivery._send(Kind.REQUEST, {"want": wanted}, air.clock.now())
    watch.delivery._send(Kind.DIGEST, {"have": [[CHIEF.id, epoch, 0] for epoch in range(1, 6)]}, air.clock.now())
    told = len(recorded)
    air.run(3.0)
    again_sent = {look(datagram).key for datagram in recorded[told:]}
    assert not again_sent & {CHIEF.id, ANNA.id}, "nobody sends again what a revoked key has said"
    for party in parties:
        passed = party.delivery.admission.passed
        for datagram in theirs:
            assert party.delivery.take(datagram, air.clock.now()) == []
        assert party.delivery.admission.passed == passed
        assert not {CHIEF.id, ANNA.id} & {key for key, _ in party.delivery.sequencer.standing()}
        assert not {message.sender for message in party.got} & {"chief", "anna"}


@pytest.mark.parametrize("key", [ANNA, WATCH, ROBOTS, CHIEF], ids=lambda key: str(key.public.role))
@pytest.mark.parametrize("standing", [True, False])
def test_only_a_commander_says_whom_to_trust(key: KeyPair, standing: bool) -> None:
    air = Air(2, seed=5, trusted=KNOWN)
    party = air.join("r9" if key is ROBOTS else key.public.owner, key)
    said = KeyChange((NEW.public,), frozenset(), frozenset((DESK.id,)))
    party.delivery.post(Kind.COMMAND, air.clock.now(), standing=standing, body={KEYS: said.written()})
    air.run(2.0)
    changed = key is CHIEF and standing
    assert [robot.delivery.admission.trust.find(NEW.id) is not None for robot in air.robots] == [changed] * 2
    assert [roles(robot)["desk"][0] for robot in air.robots] == [changed] * 2


@pytest.mark.parametrize(
    "written",
    [
        None,
        {},
        {"trust": [], "vouch": [], "revoke": "all"},
        {"trust": [["x", "king", "00" * 32]], "vouch": [], "revoke": []},
        {"trust": [["x", "operator", "00"]], "vouch": [], "revoke": []},
        {"trust": [["", "operator", "00" * 32]], "vouch": [], "revoke": []},
        {"trust": [["r*", "operator", "00" * 32]], "vouch": [], "revoke": []},
        {"trust": [], "vouch": ["zz" * 12], "revoke": []},
        {"trust": [], "vouch": [], "revoke": [b"x" * 8]},
        {"trust": [], "vouch": ["00" * 12] * (MAX_CHANGES + 1), "revoke": []},
    ],
)
def test_a_change_that_is_written_wrongly_changes_nothing(written: object) -> None:
    message = Message("desk", 1, 1, Kind.COMMAND, 1.0, standing=True, body={KEYS: written}, role="commander")
    with pytest.raises(KeyRefusal):
        KeyChange.of(message)
    air = Air(1, seed=6)
    before = air.robots[0].delivery.admission.trust.keys
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), standing=True, body={KEYS: written})
    say(air.desk, air, "(RULE next 1)", standing=True)
    air.run(2.0)
    assert air.robots[0].delivery.admission.trust.keys == before
    assert texts(air.robots[0]) == ["(RULE next 1)"], "what follows does not wait for it"


def test_the_order_in_which_changes_are_heard_makes_no_difference() -> None:
    keys = [KeyPair(f"k{number}", Role.OPERATOR, bytes([number]) * 32).public for number in range(1, 6)]
    changes = [KeyChange(trust=(key,)) for key in keys]
    changes += [KeyChange(revoke=frozenset((key.id,))) for key in keys[:3]]
    changes += [KeyChange(vouch=frozenset((bytes([number]) * 12,))) for number in range(4)]
    found = set()
    for seed in range(30):
        trust = Trust()
        for each in random.Random(seed).sample(changes * 2, 2 * len(changes)):
            trust.take(each)
        found.add((frozenset(trust.keys), trust.gone, frozenset(trust.vouched)))
    assert len(found) == 1


def test_trust_has_bounds_and_tells_of_every_change_once() -> None:
    told: list[Trust] = []
    trust = Trust(keep=told.append)
    many = [PublicKey(f"k{number}", Role.OBSERVER, number.to_bytes(32, "big")) for number in range(MAX_KEYS + 3)]
    trust.take(KeyChange(trust=tuple(many)))
    trust.take(KeyChange(trust=tuple(many)))
    trust.take(KeyChange(vouch=frozenset(number.to_bytes(12, "big") for number in range(MAX_VOUCHED + 3))))
    trust.take(KeyChange(revoke=frozenset(number.to_bytes(8, "big") for number in range(MAX_KEYS + 3))))
    assert (len(trust), len(trust.vouched), len(trust.gone)) == (MAX_KEYS, MAX_VOUCHED, MAX_KEYS)
    trust.take(KeyChange(revoke=frozenset((many[0].id,))))
    assert trust.keys[0].revoked, "the end of a key that is known always fits"
    assert len(told) == 4


def test_a_key_that_is_known_keeps_its_owner_and_role() -> None:
    trust = Trust([WATCH.public])
    trust.take(KeyChange(trust=(PublicKey("watch", Role.COMMANDER, WATCH.public.public),)))
    assert trust.keys == (WATCH.public,)
