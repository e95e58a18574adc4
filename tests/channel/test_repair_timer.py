"""How long a party waits before it resends what another one misses: by the copies of what was requested."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random
from statistics import mean

import pytest
from benchmarks.channel.repairs import LEARNED, Found, Network, gaps, newcomers

from channel.air import DESK, ROBOTS, START, Air, Party
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import encode, look
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import BATCH, LIFE
from sleepcast.channel.repair_timer import REPAIR_PAUSE, REPAIR_WITHIN, REPAIR_WITHIN_SLOW, CommandId, RepairTimer

STREAM = (DESK.id, 1)
SOON = 0.1 * REPAIR_WITHIN
WANTED: list[CommandId] = [(STREAM, number) for number in range(1, 6)]


def answered(timer: RepairTimer, now: float, gaps: Iterable[float]) -> None:
    """Others answer a request of `now` for five commands: so many s after one another."""
    timer.begin(WANTED, now, now + timer.wait())
    for gap in (0.0, *gaps):
        now += gap
        for command in WANTED:
            timer.heard(command, now)


def slow() -> RepairTimer:
    """A timer that has heard twenty answers at once."""
    timer = RepairTimer(Random(1))
    answered(timer, START, [0.0] * 19)
    return timer


def test_one_copy_or_two_keep_the_window_short() -> None:
    timer = RepairTimer(Random(1))
    for turn in range(20):
        answered(timer, START + 10.0 * turn, [0.0] * (turn % 2))
    assert timer.window == REPAIR_WITHIN
    assert timer.pause == REPAIR_PAUSE
    assert max(timer.wait() for _ in range(1_000)) <= REPAIR_WITHIN


def test_more_copies_at_once_make_the_window_longer_by_their_number() -> None:
    windows = []
    for copies in (3, 20, 100):
        timer = RepairTimer(Random(1))
        answered(timer, START, [0.0] * copies)
        windows.append(timer.window)
    assert REPAIR_WITHIN < windows[0] < windows[1] < windows[2] < REPAIR_WITHIN_SLOW


def test_our_own_copy_is_one_of_them() -> None:
    windows = []
    for ours in (False, True):
        timer = RepairTimer(Random(1))
        timer.begin(WANTED, START, START)
        for command in WANTED if ours else ():
            timer.sent(command)
        for command in WANTED * 4:
            timer.heard(command, START + 0.3)
        windows.append(timer.window)
    assert REPAIR_WITHIN < windows[0] < windows[1]


def test_copies_by_parties_that_have_lost_the_first_one_do_not() -> None:
    timer = RepairTimer(Random(1))
    for turn in range(20):
        answered(timer, START + 10.0 * turn, [1.2 * SOON] * 7)
    assert timer.window == REPAIR_WITHIN


def test_copies_of_what_nobody_has_requested_of_late_do_not_count() -> None:
    timer = RepairTimer(Random(1))
    for command in WANTED * 50:
        timer.heard(command, START)
    answered(timer, START, [])
    for command in WANTED * 50:
        timer.heard(command, START + 60.0)
    answered(timer, START + 120.0, [])
    assert timer.window == REPAIR_WITHIN


def test_no_flood_of_copies_makes_waits_longer_than_the_slowest_network_needs() -> None:
    timer = RepairTimer(Random(1))
    for turn in range(20):
        answered(timer, START + 10.0 * turn, [0.0] * 500)
    assert timer.window == REPAIR_WITHIN_SLOW
    assert timer.pause <= REPAIR_WITHIN_SLOW
    assert max(timer.wait() for _ in range(1_000)) <= REPAIR_WITHIN_SLOW


def test_commands_that_are_requested_again_are_pending_again() -> None:
    timer = RepairTimer(Random(1))
    timer.begin(WANTED * 2, START, START + 0.1)
    timer.begin(WANTED[:1], START + 1.0, START + 1.1)
    assert [timer.is_pending(command, START + 0.05) for command in WANTED] == [True] * 5
    assert [timer.is_pending(command, START + 0.5) for command in WANTED[1:]] == [False] * 4
    assert [timer.is_pending(command, START + 1.05) for command in WANTED] == [True, *[False] * 4]
    timer.begin(WANTED, START + 20.0, START + 20.1)
    assert [timer.is_pending(command, START + 20.05) for command in WANTED] == [True] * 5


def test_few_copies_make_the_window_short_again() -> None:
    timer = slow()
    before, windows = timer.window, []
    for turn in range(1, 40):
        answered(timer, START + 10.0 * turn, [])
        windows.append(timer.window)
    assert windows == sorted(windows, reverse=True)
    assert windows[0] == before, "the request before this one is still counted for"
    assert 0.5 * before < windows[2] < before
    assert windows[-1] == REPAIR_WITHIN
    assert timer.pause == REPAIR_PAUSE


def test_few_parties_need_not_all_wait_for_the_end() -> None:
    few, many = RepairTimer(Random(1)), RepairTimer(Random(1))
    answered(few, START, [0.0] * 4)
    answered(many, START, [0.0] * 400)
    middle = [sorted(timer.wait() / timer.window for _ in range(999))[500] for timer in (few, many)]
    assert middle[0] < 0.8 < middle[1] < 0.95


# ---- with real deliveries


def test_on_a_slow_network_few_of_twenty_resend_what_a_newcomer_misses() -> None:
    found = newcomers(20, Network(0.3), 6)
    assert found.copies[0] > 10.0, "nobody knows yet"
    assert mean(found.copies[LEARNED:]) < 7.0
    assert max(found.took) < 6.0


def test_on_a_slow_network_few_of_twenty_resend_one_missed_command() -> None:
    found = gaps(20, Network(0.3, beacons=True), 10)
    assert mean(found.copies[LEARNED:]) < 9.0
    assert max(found.took) < 3.0


@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_a_fast_network_stays_fast_and_quiet(loss: float) -> None:
    found = newcomers(20, Network(0.001, loss), 6)
    assert mean(found.copies) < (1.5 if loss == 0.0 else 4.0)
    assert sorted(found.took)[2] < 1.5


def test_the_same_seed_gives_the_same_traffic_on_a_slow_network() -> None:
    def run() -> Found:
        return newcomers(5, Network(0.1, 0.1), 3)

    assert run() == run()


THIEF = KeyPair("thief", Role.OBSERVER, b"t" * 32)


def stored(commands: int) -> tuple[Air, Party, list[bytes]]:
    """A robot that has standing commands for long, and their datagrams."""
    air = Air(1, seed=5, trusted=[THIEF.public])
    for number in range(commands):
        air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=f"(RULE a {number})", standing=True)
    air.run(10.0)
    air.desk.on = False
    return air, air.robots[0], list(air.desk.delivery.standing_of(DESK.id))


def digest(air: Air, number: int, key: KeyPair = ROBOTS, name: str = "r9", has: int = 0) -> bytes:
    """Message `number` of a robot that has the standing commands up to number `has`."""
    now = air.clock.now()
    body: dict[str, object] = {"have": [[DESK.id, 1, has]]}
    return encode(Message(name, 1, number, Kind.DIGEST, now, now + LIFE, body=body), "lab", key)[0]


def crowded(commands: int = 3) -> tuple[Air, Party, list[bytes]]:
    """The same, after fifty copies of all of them at once, again and again."""
    air, robot, datagrams = stored(commands)
    for number in range(1, 10):
        robot.delivery.take(digest(air, number, THIEF, "thief"), air.clock.now())
        for datagram in datagrams * 50:
            robot.delivery.take(datagram, air.clock.now())
        air.run(4.0)
    assert robot.delivery._repairs.window == REPAIR_WITHIN_SLOW
    air.run(10.0)
    air.sent.clear()
    return air, robot, datagrams


def test_who_replays_what_he_has_recorded_changes_nothing() -> None:
    air, robot, commands = stored(3)
    recorded = digest(air, 1)
    robot.delivery.take(recorded, air.clock.now())
    air.run(10.0)
    for _ in range(50):
        for datagram in (recorded, *commands * 20):
            robot.delivery.take(datagram, air.clock.now())
        air.run(0.2)
    assert robot.delivery._repairs.window == REPAIR_WITHIN


def test_who_may_ask_for_repairs_can_delay_them_by_the_bound_and_only_for_a_while() -> None:
    air, robot, commands = crowded()
    robot.delivery.take(digest(air, 1), air.clock.now())
    air.run(REPAIR_WITHIN_SLOW + 0.1)
    assert air.sent[Kind.COMMAND] == len(commands)
    for number in range(2, 42):
        robot.delivery.take(digest(air, number), air.clock.now())
        air.run(5.0)
    assert robot.delivery._repairs.window == REPAIR_WITHIN


@pytest.mark.parametrize("after", [0.02, 0.19, 0.43, 0.5])
def test_copies_that_a_sender_repeats_unasked_do_not_count(after: float) -> None:
    air, robot, _ = stored(1)
    air.desk.on = True
    for number in range(1, 20):
        has = air.desk.delivery._own().rules
        air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=f"(RULE b {number})", standing=True)
        air.run(after)
        robot.delivery.take(digest(air, number, has=has), air.clock.now())
        air.run(4.0)
        assert robot.delivery._repairs.window == REPAIR_WITHIN


def test_what_is_about_to_be_resent_is_not_resent_twice() -> None:
    air, robot, commands = crowded()
    for number in range(10, 60):  # a digest in each 0.04 s, while the wait is two seconds
        robot.delivery.take(digest(air, number, THIEF, "thief"), air.clock.now())
        air.run(0.04)
    air.run(3.0)
    assert air.sent[Kind.COMMAND] == len(commands)


def test_a_digest_that_has_crossed_the_answer_to_the_last_one_is_not_answered_again() -> None:
    air, robot, commands = crowded()
    for datagram in commands:
        robot.delivery.take(datagram, air.clock.now())
    air.run(2.0 * REPAIR_PAUSE)
    robot.delivery.take(digest(air, 1), air.clock.now())
    air.run(5.0)
    assert air.sent[Kind.COMMAND] == 0


def test_long_commands_are_counted_as_one_copy_each() -> None:
    air = Air(1, seed=5)
    robot = air.robots[0]
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(RULE a 1) ;" + "x" * 12_000, standing=True)
    air.run(10.0)
    air.desk.on = False
    parts = [each for each in air.desk.delivery.standing_of(DESK.id) if look(each).parts > 1]
    assert len(parts) > BATCH // 3
    for number in range(1, 10):
        robot.delivery.take(digest(air, number), air.clock.now())
        for datagram in parts * 2:
            robot.delivery.take(datagram, air.clock.now())
        air.run(10.0)
    assert robot.delivery._repairs.window == REPAIR_WITHIN
