"""Standing commands that say which of those before them still count: newcomers get only these, and nobody is stuck."""

from __future__ import annotations

from typing import Any

import pytest

from channel.air import DESK, ROBOTS, Air, Party
from sleepcast.channel import Kind, Message, reliable, sequencer
from sleepcast.channel.keys import KeyChange, KeyPair, fingerprint
from sleepcast.channel.message import KEYS, ONLY, Role
from sleepcast.channel.sequencer import MessageStore, Stream

OTHER = KeyPair("other", Role.COMMANDER, b"o" * 32)


def say(desk: Party, air: Air, text: str, **body: object) -> int:
    sent = desk.delivery.post(Kind.COMMAND, air.clock.now(), text=text, standing=True, body=body)
    air.run(0.02)
    return sent.sequence


def with_base(air: Air, count: int = 60) -> tuple[list[str], int]:
    """A desk that has said a rule again and again, and which of these still count; the texts that do, and the number of
    the command that says so."""
    numbers = [say(air.desk, air, f"(RULE r{number % 2} {number})") for number in range(count)]
    kept = [*numbers[:2], *numbers[-2:]]
    base = say(air.desk, air, "1", **{ONLY: kept})
    say(air.desk, air, "(RULE z 1)")
    return [f"(RULE r{number % 2} {number})" for number in (0, 1, count - 2, count - 1)] + ["1", "(RULE z 1)"], base


def texts(party: Party) -> list[str]:
    return [message.text for message in party.got if message.standing]


@pytest.mark.parametrize(("loss", "delay"), [(0.0, 0.01), (0.3, 0.05)])
def test_a_newcomer_gets_only_what_still_counts_in_order(loss: float, delay: float) -> None:
    air = Air(3, seed=1, loss=loss, delay=delay)
    kept, _ = with_base(air)
    air.run(5.0)
    assert [[text for text in texts(robot) if text in kept] for robot in air.robots] == [kept] * 3
    air.desk.on = False
    new = air.join("r9", ROBOTS)
    air.run(10.0)
    assert texts(new) == kept
    for robot in (*air.robots, new):
        assert robot.delivery.sequencer.standing() == air.robots[0].delivery.sequencer.standing()


def test_of_two_thousand_commands_a_newcomer_gets_three() -> None:
    air = Air(1, seed=2)
    air.desk.delivery._keep = lambda: None
    numbers = []
    for number in range(2_000):
        sent = air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=f"(RULE r {number})", standing=True)
        numbers.append(sent.sequence)
        (robot,) = air.robots
        for datagram in air.desk.delivery.posted():
            robot.delivery.take(datagram, air.clock.now())
        air.clock.advance(0.001)
    air.desk.delivery._later.clear()
    say(air.desk, air, "1", **{ONLY: [numbers[0], numbers[-1]]})
    air.run(1.0)
    before = air.bytes
    new = air.join("r9", ROBOTS)
    air.run(5.0)
    assert texts(new) == ["(RULE r 0)", "(RULE r 1999)", "1"]
    assert air.bytes - before < 5_000


def test_who_does_not_know_of_it_gets_everything_and_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """A party of 0.2.0 waits for each command that the next one names; it ignores what it does not know."""
    air = Air(2, seed=3)
    kept, _ = with_base(air)
    air.run(3.0)
    air.desk.on = False
    old = air.join("r9", ROBOTS)
    rebase, digest = reliable.rebase, old.delivery._digest

    def new_only(stream: Stream, message: Message, store: MessageStore) -> None:
        if stream not in old.delivery.sequencer._streams.values():
            rebase(stream, message, store)

    def of_old(now: float) -> dict[str, object]:
        return {"have": digest(now)["have"]}

    monkeypatch.setattr(reliable, "rebase", new_only)
    monkeypatch.setattr(old.delivery, "_digest", of_old)
    air.run(20.0)
    assert len(texts(old)) == 62
    assert texts(old)[-2:] == kept[-2:]


@pytest.mark.parametrize("only", [None, 7, "all", [0], [2, 1], [1, 1], [1.0], [True], [10**6], [[1]], [-1]])
def test_a_list_that_is_written_wrongly_says_nothing(only: Any) -> None:
    air = Air(1, seed=4)
    for number in range(3):
        say(air.desk, air, f"(RULE r {number})")
    say(air.desk, air, "1", **{ONLY: only})
    air.run(1.0)
    new = air.join("r9", ROBOTS)
    air.run(5.0)
    assert texts(new) == [f"(RULE r {number})" for number in range(3)] + ["1"]


def test_it_says_nothing_of_the_commands_of_others() -> None:
    air = Air(1, seed=5, trusted=[OTHER.public])
    other = air.join("other", OTHER)
    for number in range(3):
        say(air.desk, air, f"(RULE r {number})")
        say(other, air, f"(RULE s {number})")
    say(other, air, "1", **{ONLY: []})
    air.run(2.0)
    new = air.join("r9", ROBOTS)
    air.run(5.0)
    assert sorted(texts(new)) == sorted([f"(RULE r {number})" for number in range(3)] + ["1"])


def test_an_old_one_that_is_replayed_brings_nothing_back() -> None:
    air = Air(1, seed=6)
    first = say(air.desk, air, "(RULE r 1)")
    say(air.desk, air, "1", **{ONLY: [first]})
    second = say(air.desk, air, "(RULE r 2)")
    latest = say(air.desk, air, "1", **{ONLY: [first, second]})
    air.run(2.0)
    stream = air.robots[0].delivery.sequencer.find((DESK.id, 1))
    assert stream is not None
    assert (stream.base, stream.standing) == (latest, [first, second, latest])
    stream.rebase(2, [])
    assert stream.standing == [first, second, latest]


def test_a_restart_knows_what_still_counts() -> None:
    air = Air(1, seed=7)
    kept, base = with_base(air, 10)
    air.run(3.0)
    (robot,) = air.robots
    again = air.party("r0", ROBOTS, epoch=9)
    again.delivery.restore(robot.delivery.news(), air.clock.now())
    ours, theirs = (each.delivery.sequencer.find((DESK.id, 1)) for each in (robot, again))
    assert ours is not None
    assert theirs is not None
    assert (theirs.base, theirs.standing, theirs.over) == (base, ours.standing, ours.over)
    assert len(theirs.over) == 6
    assert [message.text for message in air.desk.delivery.own_rules.values() if message] == kept


def test_what_a_revoked_key_said_of_its_commands_counts_only_if_it_is_vouched_for() -> None:
    """Whoever has a stolen key cannot take the rules of its owner from newcomers once the key is revoked."""
    chief = KeyPair("chief", Role.COMMANDER, b"c" * 32)
    air = Air(1, seed=8, trusted=[chief.public])
    for number in range(3):
        say(air.desk, air, f"(RULE r{number} 1)")
    vouched = list(map(fingerprint, air.desk.delivery.standing_of(DESK.id)))
    say(air.desk, air, "1", **{ONLY: []})
    air.run(2.0)
    (robot,) = air.robots
    assert robot.delivery.sequencer.standing() == {(DESK.id, 1): 4}
    for change in (KeyChange(vouch=frozenset(vouched)), KeyChange(revoke=frozenset({DESK.id}))):
        other = air.others[0] if air.others else air.join("chief", chief)
        other.delivery.post(Kind.COMMAND, air.clock.now(), standing=True, body={KEYS: change.written()})
        air.run(1.0)
    air.desk.on = False
    new = air.join("r9", ROBOTS)
    air.run(10.0)
    assert [text for text in texts(new) if text] == [f"(RULE r{number} 1)" for number in range(3)]


def test_a_robot_that_was_away_takes_what_still_counts_of_the_rest() -> None:
    air = Air(2, seed=9)
    numbers = [say(air.desk, air, f"(RULE r {number})") for number in range(10)]
    air.run(1.0)
    air.robots[1].on = False
    numbers += [say(air.desk, air, f"(RULE r {number})") for number in range(10, 20)]
    say(air.desk, air, "1", **{ONLY: [numbers[0], numbers[12], numbers[19]]})
    air.run(1.0)
    air.robots[1].on = True
    say(air.desk, air, "(RULE z 1)")
    air.run(10.0)
    assert texts(air.robots[1]) == [f"(RULE r {number})" for number in (*range(10), 12, 19)] + ["1", "(RULE z 1)"]


def test_a_dropped_command_that_is_replayed_changes_nothing() -> None:
    air = Air(1, seed=10)
    kept, _ = with_base(air, 10)
    (robot,) = air.robots
    old = [datagram for each in robot.delivery._store.standing(DESK.id).values() for datagram in each]
    new = air.join("r9", ROBOTS)
    air.run(5.0)
    assert texts(new) == kept
    for party in (robot, new):
        assert not [message for datagram in old for message in party.delivery.take(datagram, air.clock.now())]
    air.run(5.0)
    assert texts(new) == kept


def test_a_full_store_lets_go_of_what_does_not_count_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sequencer, "MAX_STANDING", 20)
    air = Air(1, seed=11)
    numbers = [say(air.desk, air, f"(RULE r {number})") for number in range(20)]
    say(air.desk, air, "1", **{ONLY: [numbers[0], numbers[-1]]})
    for number in range(5):
        say(air.desk, air, f"(RULE z {number})")
    air.run(3.0)
    air.desk.on = False
    new = air.join("r9", ROBOTS)
    air.run(10.0)
    assert texts(new) == ["(RULE r 0)", "(RULE r 19)", "1", *(f"(RULE z {number})" for number in range(5))]
    state, again = air.robots[0].delivery.news(), air.party("r0", ROBOTS, epoch=9)
    again.delivery.restore(state, air.clock.now())
    stored = [number for _, number in again.delivery._store.standing(DESK.id)]
    assert {numbers[0], *range(numbers[-1], numbers[-1] + 7)} <= {*stored}
    assert len(stored) == 20
