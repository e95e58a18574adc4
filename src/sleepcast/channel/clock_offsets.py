"""Skew: how much other clocks differ from ours, as heartbeats show it.

A heartbeat that was sent at t by its sender's clock and is heard at T by ours took T - t: the difference of the clocks
and the time on the way. The least of some is the difference and the shortest way, which is short on a radio.
"""

from __future__ import annotations

from collections import OrderedDict, deque

ENOUGH, LATEST = 3, 16
"""Heartbeats from which a difference is believed, and how many of the latest tell it: those of some five seconds."""
FRESH = 600.0
"""Seconds for which a difference is believed that no heartbeat confirms: clocks part by milliseconds meanwhile."""
LEAST = 0.05
"""Seconds of a difference that matters: less may be the way, and clocks that are kept differ by less."""
MAX_OFFSETS = 64
"""Senders whose clocks are known; the one that was silent longest makes room."""


class ClockOffsets:
    """The clocks of those that send heartbeats, by their names. bound: s that a clock may be wrong: who delays
    heartbeats on their way cannot move anybody's deadlines farther."""

    def __init__(self, bound: float) -> None:
        self._bound = bound
        self._took: OrderedDict[str, deque[tuple[float, float]]] = OrderedDict()

    def note(self, sender: str, issued: float, now: float) -> None:
        """A heartbeat of that time was heard at `now`, each s by its own clock."""
        took = self._took.setdefault(sender, deque(maxlen=LATEST))
        took.append((now, now - issued))
        self._took.move_to_end(sender)
        if len(self._took) > MAX_OFFSETS:
            self._took.popitem(last=False)

    def of(self, sender: str, now: float) -> float:
        """Seconds by which our clock is ahead of this sender's; 0 while that is not known, or no more than the way
        explains."""
        took = self._took.get(sender)
        if took is None or len(took) < ENOUGH or now - took[-1][0] > FRESH:
            return 0.0
        found = max(-self._bound, min(self._bound, *(each for _, each in took)))
        return found if abs(found) >= LEAST else 0.0

    def all(self, now: float) -> dict[str, float]:
        """Those that are known."""
        found = {sender: self.of(sender, now) for sender in self._took}
        return {sender: skew for sender, skew in found.items() if skew}
