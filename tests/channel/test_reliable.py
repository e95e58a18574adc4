"""Commands on a bad radio: everybody in the end, once, in order, and then silence."""

from __future__ import annotations

import pytest

from channel.air import DESK, ROBOTS, START, Air, Party
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import encode, look
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import MAX_TEXT, Role
from sleepcast.channel.reliable import BATCH, LIFE, STOP_AT_FIRST, STOP_EVERY, STOP_FOR, STOP_ON


def rules(party: Party) -> list[str]:
    return [message.text for message in party.got if message.standing]


@pytest.mark.parametrize(("loss", "twice", "delay"), [(0.0, 0.0, 0.001), (0.3, 0.1, 0.05), (0.5, 0.3, 0.2)])
def test_rules_reach_everybody_once_and_in_order(loss: float, twice: float, delay: float) -> None:
    air = Air(12, seed=3, loss=loss, twice=twice, delay=delay)
    sent = []
    for number in range(15):
        sent.append(f"(RULE r{number % 4} {number})")
        air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=sent[-1], standing=True)
        air.run(air.chance.random() * 0.2)
    air.run(15.0)
    assert [rules(robot) for robot in air.robots] == [sent] * 12


def test_a_new_rule_is_quick() -> None:
    air = Air(40, seed=1, loss=0.3)
    air.run(5.0)
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(RULE a 1)", standing=True)
    begin = air.clock.now()
    air.run(5.0)
    took = sorted(robot.when[max(robot.when)] - begin for robot in air.robots)
    assert took[int(0.5 * len(took))] < 0.1
    assert took[-1] < 2.0


def test_a_quiet_fleet_is_quiet() -> None:
    air = Air(20, seed=2, loss=0.1)
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(RULE a 1)", standing=True)
    air.run(200.0)
    air.sent.clear()
    air.run(120.0)
    assert sum(air.sent.values()) <= 12, "some three or four digests for each of two intervals of a minute, of them all"


def test_who_was_away_has_every_rule_within_seconds_of_coming_back() -> None:
    air = Air(10, seed=4, loss=0.3)
    air.run(1.0)
    away = air.robots[3]
    away.on = False
    sent = [f"(RULE r{number} {number})" for number in range(50)]
    for text in sent:
        air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=text, standing=True)
        air.run(0.2)
    air.run(100.0)
    away.on = True
    away.delivery.start(air.clock.now())
    air.run(5.0)
    assert rules(away) == sent


def test_a_party_that_says_how_many_commands_it_takes_is_sent_no_more() -> None:
    other = KeyPair("other", Role.COMMANDER, b"o" * 32)
    air = Air(1, seed=8, trusted=[other.public])
    for desk in (air.desk, air.join("other", other)):
        for number in range(40):
            desk.delivery.post(Kind.COMMAND, air.clock.now(), text=f"(RULE r {number})", standing=True)
    air.run(20.0)
    robot = air.robots[0].delivery
    (first, epoch), (second, _) = sorted(robot.sequencer.standing())
    count = 0

    def sent(has: int, **most: object) -> list[tuple[bytes, int]]:
        nonlocal count
        air.clock.advance(1.0)
        count += 1
        now, body = air.clock.now(), {"have": [[first, epoch, has]], **most}
        (digest,) = encode(Message("rtiny", 1, count, Kind.DIGEST, now, now + LIFE, body=body), "lab", ROBOTS)
        robot.take(digest, now)
        parts = [look(datagram) for datagram in robot.step(now + 0.1)[0]]
        return sorted((part.key, part.sequence) for part in parts if part.kind is Kind.COMMAND)

    assert sent(3, most=6) == [(first, number) for number in range(4, 10)]
    assert sent(38, most=6) == [(first, 39), (first, 40), *((second, number) for number in range(1, 5))]
    assert len(sent(0)) == len(sent(0, most="all")) == 2 * BATCH
    assert sent(0, most=0) == sent(0, most=-7) == []


def test_neighbours_mend_what_the_desk_cannot() -> None:
    air = Air(6, seed=5, loss=0.2)
    air.cut = {frozenset((0, far + 1)) for far in (4, 5)}
    sent = [f"(RULE r{number} {number})" for number in range(8)]
    for text in sent:
        air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=text, standing=True)
        air.run(0.3)
    air.desk.on = False
    air.run(20.0)
    assert [rules(robot) for robot in air.robots] == [sent] * 6


def test_commands_of_one_sender_come_in_order_and_once_and_none_after_its_deadline() -> None:
    air = Air(8, seed=6, loss=0.3, twice=0.2, delay=0.08)
    posted: dict[int, Message] = {}
    for number in range(300):
        standing = number % 10 == 0
        message = air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=f"(SETQ a {number})", standing=standing)
        posted[message.sequence] = message
        air.run(0.02)
    air.run(LIFE + 2.0)
    for robot in air.robots:
        numbers = [message.sequence for message in robot.got]
        assert numbers == sorted(set(numbers))
        skipped = {skip.sequence for skip in robot.delivery.skipped()}
        assert set(posted) - set(numbers) <= skipped
        assert len(numbers) >= 0.999 * len(posted)
        late = [number for number in numbers if robot.when[number] > posted[number].deadline + 2.0]
        assert not late


def test_what_follows_a_command_that_never_comes_waits_only_until_its_deadline() -> None:
    air = Air(2, seed=7)
    air.cut = {frozenset((0, 1)), frozenset((0, 2))}
    lost = air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(SETQ a 1)", deadline=air.clock.now() + 1.0)
    air.run(0.5)
    air.cut = {frozenset((1, 2))}
    air.desk.on = True
    air.desk.delivery._store._recent.clear()  # nobody has it any more
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(SETQ a 2)")
    air.run(0.4)
    assert not air.robots[0].got
    air.run(2.0)
    assert [message.text for message in air.robots[0].got] == ["(SETQ a 2)"]
    assert [skip.sequence for skip in air.robots[0].delivery.skipped()] == [lost.sequence]


LONG = "".join(f"(SETQ v{number} {number * 7919})" for number in range(1_200))[:MAX_TEXT]


@pytest.mark.parametrize("standing", [True, False])
def test_a_text_of_16_kib_gets_through_a_bad_radio_before_its_deadline(standing: bool) -> None:
    air = Air(20, seed=11, loss=0.3, twice=0.1, delay=0.05)
    assert len(LONG.encode()) == MAX_TEXT == 16_384
    sent = air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=LONG, standing=standing)
    air.run(LIFE)
    assert [[message.text for message in robot.got] for robot in air.robots] == [[LONG]] * 20
    assert all(robot.when[sent.sequence] < START + LIFE for robot in air.robots)


def test_of_a_long_message_only_what_is_missing_is_sent_again() -> None:
    air = Air(1, seed=12, delay=0.001)
    air.cut = {frozenset((0, 1))}
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=LONG)
    air.run(1.0)  # all that the desk says by itself is lost
    sent = air.desk.delivery._store._recent.values()
    (parts,) = (kept.datagrams for kept in sent)
    for number, datagram in enumerate(parts):
        if number not in (2, 9):
            assert air.robots[0].delivery.take(datagram, air.clock.now()) == []
    air.cut = set()
    before = air.bytes
    air.run(1.0)
    assert [message.text for message in air.robots[0].got] == [LONG]
    assert air.sent[Kind.REQUEST] == 1
    assert air.bytes - before < 3 * 1_200, "two parts and a request"


@pytest.mark.parametrize(("kind", "loss"), [(Kind.STOP, 0.99), (Kind.RELEASE, 0.8), (Kind.ASK, 0.8)])
def test_nobody_is_asked_for_parts_of_what_nobody_keeps(kind: Kind, loss: float) -> None:
    air = Air(20, seed=13, loss=loss)
    air.desk.delivery.post(kind, air.clock.now(), text="1", body={"for": [f"r{number}" for number in range(400)]})
    air.run(LIFE)
    assert max(len(robot.got) for robot in air.robots) == 1
    assert min(len(robot.got) for robot in air.robots) == 0, "some have missed a part"
    assert air.sent[Kind.REQUEST] == 0


def test_stop_waits_for_nothing() -> None:
    air = Air(1, seed=8)
    air.cut = {frozenset((0, 1))}
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(RULE a 1)", standing=True)
    air.run(1.0)
    air.cut = set()
    air.desk.delivery.post(Kind.STOP, air.clock.now())
    air.run(0.02)
    assert [message.kind for message in air.robots[0].got] == [Kind.STOP]


def test_a_stop_is_said_a_hundred_times_in_its_first_second_and_ends_with_a_release() -> None:
    air = Air(1, seed=8)
    air.desk.delivery.post(Kind.STOP, air.clock.now())
    air.run(3.0)
    assert air.sent[Kind.STOP] == round(STOP_FOR / STOP_EVERY) + 1
    air.desk.delivery.post(Kind.STOP, air.clock.now())
    air.run(0.1)
    before = air.sent[Kind.STOP]
    air.desk.delivery.post(Kind.RELEASE, air.clock.now())
    air.run(1.0)
    assert air.sent[Kind.STOP] == before


def test_a_later_stop_takes_the_place_of_the_one_before() -> None:
    air = Air(1, seed=8)
    for _ in range(4):
        air.desk.delivery.post(Kind.STOP, air.clock.now())
        air.run(0.25)
    assert air.sent[Kind.STOP] == pytest.approx(1.0 / STOP_EVERY + 4, abs=4)


def test_a_stop_that_is_looked_for_long_after_is_said_less_often() -> None:
    air = Air(1, seed=8)
    air.desk.delivery.post(Kind.STOP, air.clock.now(), body={"first": "desk-1.1", "age": 2.0 * STOP_AT_FIRST})
    air.run(1.0)
    assert air.sent[Kind.STOP] == round(STOP_ON / STOP_EVERY) + 1


def test_the_same_chance_makes_the_same_traffic() -> None:
    def traffic() -> tuple[int, list[list[float]]]:
        air = Air(6, seed=9, loss=0.3)
        for number in range(10):
            air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=f"(RULE a {number})", standing=True)
            air.run(0.1)
        air.run(3.0)
        return air.bytes, [sorted(robot.when.values()) for robot in air.robots]

    assert traffic() == traffic()


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"have": 5},
        {"have": [[1, 2, 3]]},
        {"have": [[b"x", 1, 2]] * 1_000},
        {"have": [[DESK.id, 1, 2**62]]},
        {"want": [[DESK.id, 0, ["a", None, -1]]]},
        {"want": [[DESK.id, 1, list(range(300))]]},
        {"want": [[DESK.id, 1, [1, 1, True, 1.0, 1]]]},
    ],
)
def test_nonsense_from_a_robot_that_is_trusted_does_no_harm(body: dict[str, object]) -> None:
    air = Air(2, seed=10)
    liar = air.robots[1].delivery
    for kind in (Kind.DIGEST, Kind.REQUEST):
        liar.post(kind, START, body=body)
    air.run(1.0)
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(ST)")
    air.run(1.0)
    assert [message.text for message in air.robots[0].got] == ["(ST)"]


def test_an_operator_who_comes_by_is_told_nobodys_rules() -> None:
    air = Air(robots=6, seed=8)
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(RULE a 1)", standing=True)
    air.run(3.0)
    air.sent.clear()
    second = air.another_desk()
    air.run(3.0)
    assert air.sent[Kind.COMMAND] == 0
    assert second.got == []
    second.delivery.post(Kind.COMMAND, air.clock.now(), text="(RULE b 1)", standing=True)
    air.run(3.0)
    assert [[message.text for message in robot.got] for robot in air.robots] == [["(RULE a 1)", "(RULE b 1)"]] * 6
    assert air.sent[Kind.COMMAND] == 5, "the new rule, five times, and nothing else"


def test_an_echo_of_what_we_have_said_is_no_news() -> None:
    air = Air(1, seed=11)
    robot = air.robots[0]
    robot.delivery.post(Kind.COMMAND, START, text="(ST)")
    robot.delivery.start(START)
    echo: list[bytes] = []
    for tick in range(200):
        echo += robot.delivery.step(START + 0.01 * tick)[0]
    kinds = {look(datagram).kind for datagram in echo}
    assert kinds == {Kind.COMMAND, Kind.DIGEST}
    assert [robot.delivery.take(datagram, START + 2.0) for datagram in echo] == [[]] * len(echo)
    assert robot.delivery.admission.passed == 0


def test_of_many_few_speak_and_few_mend() -> None:
    air = Air(200, seed=12)
    air.run(3.0)
    air.sent.clear()
    air.robots[1].on = False
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(RULE a 1)", standing=True)
    air.run(1.0)
    assert air.sent[Kind.DIGEST] < 12
    air.desk.on, air.robots[1].on = False, True
    air.sent.clear()
    air.robots[1].delivery.start(air.clock.now())
    air.run(5.0)
    assert rules(air.robots[1]) == ["(RULE a 1)"]
    assert air.sent[Kind.COMMAND] < 6
    assert air.sent[Kind.DIGEST] < 40
