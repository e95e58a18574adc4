"""An ear: what many robots of one process hear with, as one computer has one radio however many minds live on it.

Each robot has a line of its own, on which it says what it has to say, by its name and under its numbers. What comes
from others is taken in once for all of them: looked at, put into its order, mended, kept for those who missed it. Then
every robot is given it, decides by itself whether it is meant, and answers for itself. What a robot tells the others
goes through the same ear to its neighbours.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sleepcast.channel.message import MAX_NAME, Message
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.sequencer import Skipped
from sleepcast.channel.session import to_mind_time
from sleepcast.channel.transports.multiplexer import Port
from sleepcast.core.clock import Clock


def receiver_name(names: Sequence[str]) -> str:
    """Under which name robots of these names hear: of the first one, if need be cut short, and how many more."""
    more = f"+{len(names) - 1}"
    return names[0][: MAX_NAME - len(more)] + more


class Receiver:
    """See the module. branch: what brings datagrams; mailbox: whose digests and requests speak for all; clock: Unix
    time, s; zero: when the minds' time began."""

    def __init__(self, branch: Port, mailbox: ReliableDelivery, clock: Clock, zero: float = 0.0) -> None:
        self.mailbox, self.zero = mailbox, zero
        self._branch, self._clock = branch, clock
        mailbox.start(clock.now())

    @property
    def waits(self) -> bool:
        """Whether something has come that nobody has looked at."""
        return bool(self._branch.waiting)

    def due(self) -> float:
        """When `tend` has something to do next even if nothing comes, s of Unix time."""
        return self.mailbox.due()

    def take(self) -> list[Message]:
        """What has come and can be dealt with now, with the times of the minds."""
        found: list[Message] = []
        for datagram in self._branch.drain():
            now = self._clock.now()
            found += self._in_time(self.mailbox.take(datagram, now), now)
        return found

    def tend(self) -> list[Message]:
        """Mend, and send what is due; gives what waits no longer."""
        now = self._clock.now()
        out, freed = self.mailbox.step(now)
        for datagram in out:
            self._branch.send(datagram)
        return self._in_time(freed, now)

    def skipped(self) -> list[Skipped]:
        """The commands that never came, since this was asked last."""
        return self.mailbox.skipped()

    def close(self) -> None:
        """Leave the trunk."""
        self._branch.close()

    def _in_time(self, messages: Iterable[Message], now: float) -> list[Message]:
        return [to_mind_time(message, self.zero, self.mailbox.door, now) for message in messages]
