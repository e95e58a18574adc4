"""The pace of a process: whose messages wait for the next tick, and when STOP is looked for."""

from __future__ import annotations

import pytest

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import Role
from sleepcast.core.clock import ManualClock
from sleepcast.mind.limits import ALL_QUESTIONS_SHARE, QUESTIONS_SHARE, TELLS_SHARE
from sleepcast.mind.pace import LOOK_EVERY, Pace

TICK = 0.1


class Paced:
    """A pace, and evaluations that take time."""

    def __init__(self) -> None:
        self.clock, self.looks, self.number = ManualClock(), 0, 0
        self.pace = Pace(self.clock, TICK, self._look)

    def _look(self) -> None:
        self.looks += 1

    def message(self, sender: str, kind: Kind, role: Role) -> Message:
        self.number += 1
        return Message(sender, 1, self.number, kind, 0.0, text="1", role=role.value)

    def evaluated(self, sender: str, kind: Kind, role: Role, each: float, most: int = 100) -> float:
        """Seconds that messages of this sender get of what is left of the tick, if each takes so long."""
        took = 0.0
        for _ in range(most):
            message = self.message(sender, kind, role)
            if not self.pace.allows(message):
                break
            self.pace.evaluate(message, lambda _: self.clock.advance(each))
            took += each
        return took


def test_who_asks_gets_a_share_of_each_tick_and_all_who_ask_another() -> None:
    paced = Paced()
    for _ in range(3):
        paced.pace.begin()
        shares = [paced.evaluated(guest, Kind.ASK, Role.OBSERVER, 0.001) for guest in ("a", "b", "c")]
        assert shares == pytest.approx([QUESTIONS_SHARE * TICK] * 2 + [0.0], abs=0.0011)
        assert sum(shares) <= ALL_QUESTIONS_SHARE * TICK + 0.0011
        assert paced.pace.held_back


def test_commands_go_on_whoever_asks_and_whatever_robots_tell() -> None:
    paced = Paced()
    paced.evaluated("desk", Kind.ASK, Role.OPERATOR, 0.001)
    told = [paced.evaluated(f"r{number}", Kind.COMMAND, Role.ROBOT, 0.001) for number in range(6)]
    assert told == pytest.approx([TELLS_SHARE * TICK] * 4 + [0.0] * 2, abs=0.0011)
    assert paced.evaluated("desk", Kind.COMMAND, Role.OPERATOR, 0.001, 50) == pytest.approx(0.05)


def test_one_long_evaluation_is_paid_for_over_the_next_ticks() -> None:
    paced = Paced()
    long = 3.5 * QUESTIONS_SHARE * TICK
    assert paced.evaluated("a", Kind.ASK, Role.OBSERVER, long) == long
    waited = 0
    while not paced.evaluated("a", Kind.ASK, Role.OBSERVER, 0.001, 1):
        paced.pace.begin()
        waited += 1
    assert waited == 3


def test_stop_is_looked_for_after_each_evaluation_unless_that_was_a_moment_ago() -> None:
    paced = Paced()
    paced.evaluated("a", Kind.COMMAND, Role.OPERATOR, 1.1 * LOOK_EVERY, 4)
    assert paced.looks == 4
    paced.evaluated("a", Kind.COMMAND, Role.OPERATOR, LOOK_EVERY / 10.0, 30)
    assert 6 <= paced.looks <= 7
