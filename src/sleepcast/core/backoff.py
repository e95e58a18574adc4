"""Pauses between tries that have failed: each is twice as long as the one before, up to a longest."""

from __future__ import annotations


class Backoff:
    """first, longest: the pauses at first and at most, s.
    pause: the next one, s.
    """

    __slots__ = ("first", "longest", "pause")

    def __init__(self, first: float, longest: float) -> None:
        self.first, self.longest = first, longest
        self.pause = first

    def take(self) -> float:
        """The pause before the next try, s; the one after it is longer."""
        pause, self.pause = self.pause, min(2.0 * self.pause, self.longest)
        return pause

    def reset(self) -> None:
        """A try has succeeded: begin with the first pause again."""
        self.pause = self.first
