"""Whether a robot is catching up: it was off or out of reach, and takes standing commands that are old.

Each of them was right in its time, and one that is still to come may have replaced it. So the rules of a robot that
catches up do nothing, and its body rests, until the robot has all standing commands that it has been told of.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from sleepcast.channel.sequencer import MAX_STREAMS, StreamId

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
    """One receiver's judgement. Times are s of Unix time."""

    def __init__(self) -> None:
        self._latest = -inf
        """When the latest old command was taken."""
        self._told: dict[StreamId, int] = {}
        """The number of the latest standing command of each stream, as others have told in their digests."""

    def hear(self, told: Mapping[StreamId, int]) -> None:
        """Somebody's digest: the number of the latest standing command of each stream."""
        for name, number in told.items():
            self._told[name] = max(number, self._told.pop(name, 0))
        while len(self._told) > MAX_STREAMS:
            del self._told[next(iter(self._told))]

    def take(self, issued: float, now: float) -> None:
        """A standing command, issued at that time, is taken at `now`."""
        if now - issued > OLD:
            self._latest = now

    def lasts(self, have: Mapping[StreamId, int], now: float) -> bool:
        """Whether it lasts at `now`. have: the latest standing command of each stream that was taken here."""
        since = now - self._latest
        if since >= PATIENCE:
            return False
        return since < QUIET or any(number > have.get(name, 0) for name, number in self._told.items())
