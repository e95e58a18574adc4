"""An instant for all: commands with AFTER-ISSUE, which wait in a robot until so long after their issue.

The instant is counted from the time of issue in the message, by the clock of whoever sent it, so a message that was
repeated or late means the same instant. A robot translates it by what it knows of that clock (`ClockBound`): by how
much its own is ahead, and within which bound. What it does at the instant, it does in the tick that is nearest.

A robot that does not know the sender's clock does nothing, and says so as soon as the instant is over for certain: as
long after it has heard the command as that was to wait.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto
from math import inf
from typing import TYPE_CHECKING, Protocol

import msgspec

from sleepcast.channel.clock_sync import ClockBound
from sleepcast.channel.message import Message
from sleepcast.language.parts import Timed

if TYPE_CHECKING:  # simulated robots measure no clocks
    from sleepcast.channel.round_trips import RoundTrips

MAX_WAITING = 8
"""Commands that wait in a robot at most."""
TOO_MANY_WAIT = f"{MAX_WAITING} commands wait in this robot already: no more"
HELD_UNTIL = "it is held still, so nothing waits in it"
"""Why a robot that is stopped, or catches up, takes no such command."""
STOP_DISCARDED = "STOP has discarded it before its instant"
CANCEL_DISCARDED = "CANCEL has discarded it before its instant"
TOO_LATE = "heard after its instant, so not done"
NO_CLOCK = "not done: this robot has no bound of its clock, since it could not measure that of the sender"
RESTARTED = "its instant came while the robot was restarted: not done, or only in part"


class SenderClocks(Protocol):
    """What a robot knows of the clocks of those who command it. Times are s of its mind."""

    def want(self, sender: str, until: float, now: float) -> None:
        """Find out about this sender's clock, and keep to it until then."""

    def of(self, sender: str, now: float) -> ClockBound | None:
        """What is known now; None if nothing is."""


class EqualClocks:
    """The clocks of one simulated run: all show the same time."""

    def want(self, sender: str, until: float, now: float) -> None:
        pass

    def of(self, sender: str, now: float) -> ClockBound | None:
        return ClockBound(0.0, 0.0)


class UnknownClocks(EqualClocks):
    """Nothing is known of the clocks of others, and nothing can be found out."""

    def of(self, sender: str, now: float) -> ClockBound | None:
        return None


class MeasuredClocks:
    """The clocks of others on the air. trips: by which they are measured; zero: gives when the mind's time began, s of
    Unix time."""

    def __init__(self, trips: RoundTrips, zero: Callable[[], float]) -> None:
        self._trips, self._zero = trips, zero

    def want(self, sender: str, until: float, now: float) -> None:
        self._trips.want(sender, until + self._zero(), now + self._zero())

    def of(self, sender: str, now: float) -> ClockBound | None:
        return self._trips.of(sender, now + self._zero())


class Timeliness(Enum):
    """How a command stands to its instant."""

    AHEAD = auto()
    NOW = auto()
    """This tick is the nearest one."""
    OVER = auto()
    UNKNOWN = auto()
    """It is over for certain, and when it was nobody here can say."""


class WaitingCommand(msgspec.Struct, frozen=True):
    """A command that waits. message: that brought it, in the time of the mind; wait, text: see `Timed`; restarted:
    whether the robot was restarted since."""

    message: Message
    wait: float
    text: str
    restarted: bool = False

    @classmethod
    def of(cls, message: Message, timed: Timed) -> WaitingCommand:
        return cls(message, timed.wait, timed.command)

    @property
    def instant(self) -> float:
        """By the sender's clock, s."""
        return self.message.issued + self.wait

    @property
    def over(self) -> float:
        """When the instant is over for certain, by our own clock, s: nothing is heard before it was issued."""
        heard = self.message.heard
        return (self.message.issued if heard is None else heard) + self.wait

    def moment(self, now: float, tick: float, clock: ClockBound | None, *, waited: bool) -> Timeliness:
        """How it stands in the tick at `now`, of `tick` s. waited: whether it was there in the tick before, so that
        this one may be late itself."""
        if clock is None:
            return Timeliness.UNKNOWN if now > self.over else Timeliness.AHEAD
        left = self.instant + clock.ahead - now
        if left > tick / 2.0:
            return Timeliness.AHEAD
        return Timeliness.NOW if left >= -(2.0 * tick if waited else tick / 2.0) else Timeliness.OVER

    def bound(self, now: float, tick: float, clock: ClockBound) -> float:
        """By how many s the tick at `now` may miss the instant at most."""
        return clock.bound + max(tick / 2.0, abs(self.instant + clock.ahead - now))

    def precedes(self, stopped: float, clock: ClockBound) -> bool:
        """Whether it may have been issued before a STOP that was heard at that time of our clock, s."""
        return self.message.issued + clock.ahead - clock.bound < stopped

    def at_its_instant(self) -> Message:
        """What is obeyed then, as if it had been sent at the instant: so it has its place among what others change."""
        return msgspec.structs.replace(self.message, text=self.text, issued=self.instant, deadline=inf)

    def shifted(self, by: float) -> WaitingCommand:
        """The same in the time of a mind that began `by` s earlier."""
        message = self.message
        heard = None if message.heard is None else message.heard + by
        times = {"issued": message.issued + by, "deadline": message.deadline + by, "heard": heard}
        return msgspec.structs.replace(self, message=msgspec.structs.replace(message, **times))


def in_turn(commands: list[WaitingCommand]) -> list[WaitingCommand]:
    """In the order in which they are done: by their instants, and where these are equal as they came."""
    return sorted(commands, key=lambda each: each.instant)


def discarded(commands: list[WaitingCommand], by: Callable[[WaitingCommand], bool]) -> list[WaitingCommand]:
    """Take those out of the list that this is true of, and return them."""
    gone = [each for each in commands if by(each)]
    commands[:] = [each for each in commands if each not in gone]
    return gone
