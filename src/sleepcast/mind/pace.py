"""The pace of a process with minds on a real channel: how much of a tick the messages of each sender may take, and when
to look for STOP meanwhile.

Evaluations are bounded by steps, so none takes long; but anybody may ask, as often as signatures are verified, and each
question is evaluated by every robot. So what a sender's messages take is measured. Who has used up a share of the tick
waits for the next one, and all others go on. No time is measured in simulations, where only steps count.
"""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.channel.message import Kind, Message, Role
from sleepcast.core.clock import Clock
from sleepcast.mind.limits import ALL_QUESTIONS_SHARE, COMMANDS_SHARE, QUESTIONS_SHARE, TELLS_SHARE

LOOK_EVERY = 0.005
"""Seconds between two looks for STOP, each of which costs some microseconds for every transport."""
_QUESTIONS, _TELLS = ("", Kind.ASK), ("", Kind.COMMAND)
"""Those who share an account: all who ask, and all robots that tell."""
Account = tuple[str, Kind]
"""Who has sent something, by its key, and whether it asks or commands; robots that share a key by their names."""


class Pace:
    """See the module. clock: s; tick: s. look: takes STOPs that have come, and halts the bodies."""

    def __init__(self, clock: Clock, tick: float, look: Callable[[], None]) -> None:
        self.held_back = False
        """Whether a message has had to wait in this tick."""
        self._clock, self._tick, self._look = clock, tick, look
        self._taken: dict[Account, float] = {}
        self._looked = clock.now()

    def begin(self) -> None:
        """Begin another tick. Who has taken more than its share of the last one owes the rest."""
        shares = ((account, taken - _share(account) * self._tick) for account, taken in self._taken.items())
        self._taken = {account: left for account, left in shares if left > 0.0}
        self.held_back = False

    def allows(self, message: Message) -> bool:
        """Whether this message may be evaluated in this tick."""
        allowed = all(self._taken.get(each, 0.0) < _share(each) * self._tick for each in _accounts(message))
        self.held_back |= not allowed
        return allowed

    def evaluate(self, message: Message, evaluation: Callable[[Message], None]) -> None:
        """Evaluate a message at its sender's expense, and look for STOP afterwards."""
        began = self._clock.now()
        evaluation(message)
        took = self._clock.now() - began
        for account in _accounts(message):
            self._taken[account] = self._taken.get(account, 0.0) + took
        self.look()

    def look(self) -> None:
        """Look for STOP, unless that was done a moment ago."""
        now = self._clock.now()
        if not 0.0 <= now - self._looked < LOOK_EVERY:
            self._look()
            self._looked = self._clock.now()


def _accounts(message: Message) -> tuple[Account, ...]:
    """Where the time for a message is counted."""
    if message.kind is Kind.ASK:
        return (message.key or message.sender, Kind.ASK), _QUESTIONS
    told = (message.sender, Kind.REPORT), _TELLS
    return told if message.role == Role.ROBOT else ((message.key or message.sender, Kind.COMMAND),)


def _share(account: Account) -> float:
    sender, kind = account
    if kind is Kind.ASK:
        return QUESTIONS_SHARE if sender else ALL_QUESTIONS_SHARE
    return TELLS_SHARE if kind is Kind.REPORT else COMMANDS_SHARE
