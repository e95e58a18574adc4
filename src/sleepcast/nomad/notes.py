"""What the server says to the person at the terminal, at a rate that a person can read."""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.core.clock import Clock

BURST = 20
"""Lines at once,"""
RATE = 2.0
"""and lines a second on the whole. A client that floods the server cannot flood the terminal."""


class Notes:
    """Passes lines on to `say`, and counts those that are too many."""

    def __init__(self, say: Callable[[str], None], clock: Clock) -> None:
        self._say, self._clock = say, clock
        self._credit, self._looked = float(BURST), clock.now()
        self._left_out = 0

    def __call__(self, line: str) -> None:
        """Say this, if there is room for it."""
        now = self._clock.now()
        self._credit = min(BURST, self._credit + RATE * (now - self._looked))
        self._looked = now
        if self._credit < 1.0:
            self._left_out += 1
            return
        self._credit -= 1.0
        if self._left_out:
            self._say(f"... and {self._left_out} more lines that are left out")
            self._left_out = 0
        self._say(line)
