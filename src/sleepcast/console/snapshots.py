"""What is kept of a run so that its past can be shown: whole states, from which it can be run again.

States are many bytes, so they are few: one for every `STATE_EVERY` seconds of work, but never so many that keeping them
takes more than one part in `COST` of it, and no more than `MAX_BYTES` together. When these are full, states are left
out where they stand closest together, measured by their age: what was just now is kept densely, what was long ago
thinly. `Budget` says how many bytes of everything are kept.
"""

from __future__ import annotations

from bisect import bisect_right

from sleepcast.core.records import dataclass

STATE_EVERY = 0.2
"""Seconds of a machine's work between two kept states: so long takes it at most to come from one to the next."""
COST = 10
"""Times as long as it takes to keep a state must pass before the next one."""
MAX_BYTES = 300_000_000
"""Of the past that a page keeps: six thousand pictures and two thousand states of a thousand robots, say."""
YOUNG = 600.0
"""Seconds of the run within which states are equally worth keeping, whatever their age."""


@dataclass(frozen=True, slots=True)
class Budget:
    """Bytes that are kept of a past at most, in all and of each sort. What was seen of another future counts, too."""

    most: int = MAX_BYTES

    @property
    def states(self) -> int:
        """Of states, from which it is run again."""
        return self.most * 6 // 10

    @property
    def pictures(self) -> int:
        """Of what was to be seen, the marks of robots and the obstacles with it."""
        return self.most * 3 // 10

    @property
    def inputs(self) -> int:
        """Of what came from outside: messages, and changes of obstacles."""
        return self.most // 20

    @property
    def accounts(self) -> int:
        """Of what had become of commands."""
        return self.most // 20


class SnapshotStore:
    """States of a run by their ticks, as bytes. tick: seconds in a tick. most: bytes of all."""

    def __init__(self, tick: float, most: int) -> None:
        self._young, self._most = round(YOUNG / tick), most
        self._ticks: list[int] = []
        self._states: list[bytes] = []
        self.size = 0
        """Bytes of all."""

    def __len__(self) -> int:
        return len(self._ticks)

    @property
    def first(self) -> int | None:
        """The tick of the first one, None if there is none."""
        return self._ticks[0] if self._ticks else None

    @property
    def last(self) -> int | None:
        """The tick of the last one, None if there is none."""
        return self._ticks[-1] if self._ticks else None

    def add(self, tick: int, state: bytes) -> None:
        """Keep a state that is younger than all others."""
        self._ticks.append(tick)
        self._states.append(state)
        self.size += len(state)
        while self.size > self._most and len(self._ticks) > 2:  # leave out what is missed least, no first, no last
            ticks, now = self._ticks, self._ticks[-1] + self._young
            gaps = ((ticks[at + 1] - ticks[at - 1]) / (now - ticks[at]) for at in range(1, len(ticks) - 1))
            index = 1 + min(enumerate(gaps), key=lambda each: each[1])[0]
            self.size -= len(self._states[index])
            del self._ticks[index], self._states[index]

    def until(self, tick: int) -> SnapshotStore:
        """Those of before a tick, to be added to by another run."""
        earlier = SnapshotStore(1.0, self._most)
        earlier._young = self._young
        for at, state in zip(self._ticks, self._states, strict=True):
            if at < tick:
                earlier.add(at, state)
        return earlier

    def before(self, tick: int) -> tuple[int, bytes] | None:
        """The last state up to this tick, None if there is none."""
        count = bisect_right(self._ticks, tick)
        return (self._ticks[count - 1], self._states[count - 1]) if count else None

    def forget_before(self, tick: int) -> None:
        """Leave out all that are older than this."""
        count = bisect_right(self._ticks, tick - 1)
        self.size -= sum(map(len, self._states[:count]))
        del self._ticks[:count], self._states[:count]

    def after(self, tick: int) -> int | None:
        """The tick of the first state from this one on, None if there is none."""
        index = bisect_right(self._ticks, tick - 1)
        return self._ticks[index] if index < len(self._ticks) else None


class SnapshotTimer:
    """Says when the next state is due. Work is told as it is done, s."""

    def __init__(self) -> None:
        self._since = 0.0
        self._cost = 0.0

    @property
    def due(self) -> bool:
        """Whether a state is to be kept now."""
        return self._since >= max(STATE_EVERY, COST * self._cost)

    def worked(self, seconds: float) -> None:
        """So long took what was done since."""
        self._since += seconds

    def begun(self) -> None:
        """A state is being kept."""
        self._since = 0.0

    def kept(self, seconds: float) -> None:
        """So long took it to keep it."""
        self._cost = seconds
