"""Times and ticks: on which tick a moment falls, and how many ticks a length of time is.

    a moment    (a command, an event, a sample) falls on the first tick that ends at it or later
    a length    (a run) is the number of ticks that comes nearest to it; what is left over is carried to the next one

Ticks are counted, never added up as seconds, so that a long run is where its number of ticks says.
"""

from __future__ import annotations

from math import ceil, floor

SLACK = 1e-6
"""Of a tick, by which rounding may move a moment."""


def tick_at(time: float, tick: float) -> int:
    """The tick on which a moment falls. time: s since the start; tick: s in each."""
    return ceil(time / tick - SLACK)


def nearest_ticks(seconds: float, tick: float) -> int:
    """How many ticks of `tick` s come nearest to a length of time, s."""
    return round(seconds / tick)


class Carried:
    """Lengths of time one after the other, in ticks of `tick` s. rest: of a tick, what was wanted so far and not given;
    less than 0 if more was given."""

    def __init__(self, tick: float, rest: float = 0.0) -> None:
        self._tick, self.rest = tick, rest

    def ticks(self, seconds: float) -> int:
        """How many ticks the next length is, s, with what the ones before have left over."""
        wanted = self.rest + seconds / self._tick
        given = round(wanted)
        self.rest = wanted - given
        return given


class Every:
    """The multiples of a time, `every` s, in ticks of `tick` s. If several fall on one tick, that is due once."""

    def __init__(self, every: float, tick: float) -> None:
        self._share = tick / every

    def due(self, number: int) -> bool:
        """Whether a multiple falls on the tick of this number; 0 is the start, which is one."""
        return self._passed(number) > self._passed(number - 1)

    def following(self, number: int) -> int:
        """The next tick after this one on which a multiple falls."""
        later = max(number, tick_at((self._passed(number) + 1) / self._share, 1.0) - 2) + 1
        while not self.due(later):
            later += 1
        return later

    def _passed(self, number: int) -> int:
        """How many multiples above 0 have come by the end of this tick."""
        return floor((number + SLACK) * self._share)
