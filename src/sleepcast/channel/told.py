"""What digests tell of streams: heard from others, and never verified.

Only a command that was received makes a stream. Anybody whose key may send a digest can name streams that do not exist,
so what digests say is kept apart: each key that tells has a room of its own, in which it replaces only what it told
itself, and what it does not repeat is forgotten.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import NamedTuple

from sleepcast.channel.fair_table import FairTable
from sleepcast.channel.sequencer import MAX_STREAMS, StreamId

MAX_TOLD = 4_096
"""Streams that are remembered as others tell of them: `MAX_STREAMS` of each of 64 keys, half a megabyte."""
TOLD_FOR = 600.0
"""Seconds for which it is remembered that somebody told of a command: digests come every minute at least."""


class Told(NamedTuple):
    """The number of a stream's latest standing command, and when it was last told, s."""

    number: int
    time: float


class ToldStreams:
    """The latest standing command of each stream, as others tell. lost: called with the key of a teller that has told
    of more streams than are remembered of one key."""

    def __init__(self, lost: Callable[..., object] = lambda *_: None) -> None:
        self._told = FairTable[tuple[str, StreamId], Told, str](MAX_TOLD, each=MAX_STREAMS, lost=lost)

    def hear(self, teller: str, told: Mapping[StreamId, int], now: float, falling: Callable[[StreamId], bool]) -> None:
        """A digest that was signed with this key, at `now`, s. falling: of which streams a smaller number counts."""
        for name, number in told.items():
            before = self._told.get((teller, name))
            if before is None or number >= before.number or falling(name) or now - before.time > TOLD_FOR:
                self._told.put(teller, (teller, name), Told(number, now))

    def latest(self, now: float) -> dict[StreamId, int]:
        """The highest number that is told of each stream."""
        for which in [which for which, told in self._told.items() if now - told.time > TOLD_FOR]:
            self._told.pop(which)
        found: dict[StreamId, int] = {}
        for (_, name), told in self._told.items():
            found[name] = max(told.number, found.get(name, 0))
        return found


# ---- whether a robot catches up: it was off or out of reach, and takes standing commands that are old. Each was right
# in its time, and one that is still to come may have replaced it. So the robot rests until it has all of them


OLD = 60.0
"""Seconds after its issue from which a standing command is old. Whoever was out of reach for less need not rest, and
interrupt what it does: commands of one minute hardly contradict each other."""
QUIET = 2.0
"""Seconds after the latest old command for which there may be more of which nobody has told yet: the digests of others
come sooner, unless several are lost."""
PATIENCE = 30.0
"""Seconds after the latest old command for which a robot waits for others that it has been told of. Whoever told of
them may be gone, or may have lied."""


class CatchingUp:
    """One receiver's judgement. told: what others tell. Times are s of Unix time."""

    def __init__(self, told: ToldStreams) -> None:
        self._told, self._latest = told, -inf

    def take(self, issued: float, now: float) -> None:
        """A standing command, issued at that time, is taken at `now`."""
        if now - issued > OLD:
            self._latest = now

    def lasts(self, have: Mapping[StreamId, int], now: float) -> bool:
        """Whether it lasts at `now`. have: the latest standing command of each stream that was taken here."""
        since = now - self._latest
        if since >= PATIENCE:
            return False
        return since < QUIET or any(number > have.get(name, 0) for name, number in self._told.latest(now).items())
