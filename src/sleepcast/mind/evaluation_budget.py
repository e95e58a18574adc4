"""What evaluations may cost a process with minds on a real channel: how much time the messages of each sender may take,
and when to look for STOP meanwhile.

Evaluations are bounded by steps, so none takes long; but anybody may ask, as often as signatures are verified, and each
question is evaluated by every robot. So what a sender's messages take is measured. Each sender has an account, which
fills by a share of the time that passes; whoever has used it up waits for a later tick, and all others go on. A full
account is enough for a question to a thousand robots at once. No time is measured in simulations, where only steps
count.
"""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.channel.message import Kind, Message, Role
from sleepcast.core.clock import Clock
from sleepcast.mind.limits import ALL_QUESTIONS_SHARE, COMMANDS_SHARE, QUESTIONS_SHARE, SECONDS_AT_ONCE, TELLS_SHARE

LOOK_EVERY = 0.005
"""Seconds between two looks for STOP, each of which costs some microseconds for every transport."""
_QUESTIONS, _TELLS = ("", Kind.ASK), ("", Kind.COMMAND)
"""Those who share an account: all who ask, and all robots that tell."""
Account = tuple[str, Kind]
"""Who has sent something, by its key, and whether it asks or commands; robots that share a key by their names."""


class EvaluationBudget:
    """See the module.

    clock: s.
    work: s of work of the thread that evaluates, so that nobody pays for what else runs on the machine.
    look: takes STOPs that have come, and halts the bodies.
    """

    def __init__(self, clock: Clock, work: Clock, look: Callable[[], None]) -> None:
        self.held_back = False
        """Whether a message has had to wait in this tick."""
        self._clock, self._work, self._look = clock, work, look
        self._taken: dict[Account, float] = {}
        """What each has taken that time has not given back yet, s."""
        self._began = self._looked = clock.now()

    def begin(self) -> None:
        """Begin another tick."""
        now = self._clock.now()
        passed = max(0.0, now - self._began)
        left = ((account, taken - _share(account) * passed) for account, taken in self._taken.items())
        self._taken = {account: taken for account, taken in left if taken > 0.0}
        self._began, self.held_back = now, False

    def allows(self, message: Message) -> bool:
        """Whether this message may be evaluated in this tick; no sender alone can take the time of all."""
        room = {each: SECONDS_AT_ONCE if each[0] else 2.0 * SECONDS_AT_ONCE for each in _accounts(message)}
        allowed = all(self._taken.get(each, 0.0) < seconds for each, seconds in room.items())
        self.held_back |= not allowed
        return allowed

    def evaluate(self, message: Message, evaluation: Callable[[Message], None]) -> None:
        """Evaluate a message at its sender's expense, and look for STOP afterwards."""
        began = self._work.now()
        evaluation(message)
        took = self._work.now() - began
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
    tell = (message.sender, Kind.REPORT), _TELLS
    return tell if message.role == Role.ROBOT else ((message.key or message.sender, Kind.COMMAND),)


def _share(account: Account) -> float:
    sender, kind = account
    if kind is Kind.ASK:
        return QUESTIONS_SHARE if sender else ALL_QUESTIONS_SHARE
    return TELLS_SHARE if kind is Kind.REPORT else COMMANDS_SHARE
