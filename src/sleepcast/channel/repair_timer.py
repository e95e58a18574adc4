"""The repair timer: how long a party waits before it resends what another one misses.

All parties that have a missing command wait for a random time, so that the first one resends it and the others hear
that and stay silent. They hear it only if the longest wait exceeds the time a datagram takes, which nobody knows: a
millisecond on a cable, a third of a second on a wireless network that sends multicast with its beacons. So each party
counts the copies of what was requested, as SRM does (Floyd, Jacobson, Liu, McCanne and Zhang, A reliable multicast
framework for light-weight sessions and application level framing, IEEE/ACM Transactions on Networking 5, 1997). Many
copies soon after the first mean that it came too late for their senders: the waits become longer. Otherwise they become
shorter again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import log, log2
from random import Random

import msgspec

from sleepcast.channel.sequencer import STEEPNESS, StreamId, mostly_late

REPAIR_WITHIN, REPAIR_WITHIN_SLOW = 0.06, 2.0
"""Seconds within which a party resends what another one misses: at first, and at most. A one-shot command is
valid for five, so its repair still comes in time."""
REPAIR_PAUSE = 0.2
"""Seconds for which a command just heard is not resent, at least."""
_COUNTED_FOR = 3.0
"""Seconds after a request for which copies are counted: the longest wait, and twice a slow network's delay."""
_SHRINK = 0.9
"""Factor of the window after a request that few have answered."""
_FEW = 3.0
"""Copies of a command without which the window never grows."""

CommandId = tuple[StreamId, int]


class Round(msgspec.Struct):
    """The commands of one request or digest, and their copies.

    begun: when it came, s
    due: when we resend each command, s
    window: the longest wait then, s
    soon: the time in which the number of parties whose waits end grows e-fold, s
    copies: how many we have heard or sent
    last: when each command was last heard, s
    extra: copies heard besides each one's first
    spread: sum of the times between them, s
    grown: whether they have made the window longer
    """

    begun: float
    due: dict[CommandId, float]
    window: float
    soon: float
    copies: int = 0
    last: dict[CommandId, float] = msgspec.field(default_factory=dict)
    extra: int = 0
    spread: float = 0.0
    grown: bool = False

    def hear(self, command: CommandId, now: float) -> None:
        """Another party has sent this command."""
        self.copies += 1
        if command in self.last:
            self.extra += 1
            self.spread += now - self.last[command]
        self.last[command] = now

    @property
    def each(self) -> float:
        """Copies of each command, ours included."""
        return self.copies / len(self.due)

    @property
    def is_crowded(self) -> bool:
        """Whether copies come faster than loss explains. Parties that have lost a copy resend it too, however long the
        window is, but hardly more than one in each `soon`."""
        return self.extra > len(self.due) + self.spread / self.soon


class RepairTimer:
    """One party's timer. chance: for the waits. window: the longest wait, s."""

    def __init__(self, chance: Random) -> None:
        self.window = REPAIR_WITHIN
        self._chance, self._crowd = chance, _FEW
        self._rounds: deque[Round] = deque()
        self._of: dict[CommandId, Round] = {}

    @property
    def pause(self) -> float:
        """Seconds for which a command just heard is not resent: its requester may not have received it yet."""
        return max(REPAIR_PAUSE, 2.0 * self.window / self._steepness)

    def wait(self) -> float:
        """A random time to wait, s."""
        return self.window * mostly_late(self._chance, self._steepness)

    def is_pending(self, command: CommandId, now: float) -> bool:
        """Whether we are about to resend this command."""
        repairs = self._of.get(command)
        return repairs is not None and now < repairs.due[command]

    def begin(self, commands: Sequence[CommandId], now: float, due: float) -> None:
        """These commands were requested at `now`, and we resend them at `due`, s."""
        while self._rounds and now - self._rounds[0].begun > _COUNTED_FOR:
            ended = self._rounds.popleft()
            for command in ended.due:
                del self._of[command]
            if not ended.grown:
                self.window = max(_SHRINK * self.window, REPAIR_WITHIN)
                if self.window == REPAIR_WITHIN:
                    self._crowd = _FEW
        begun = Round(now, {}, self.window, self.window / self._steepness)
        for command in commands:
            self._of.setdefault(command, begun).due[command] = due
        if begun.due:
            self._rounds.append(begun)

    def sent(self, command: CommandId) -> None:
        """We have resent this command."""
        repairs = self._of.get(command)
        if repairs is not None:
            repairs.copies += 1

    def heard(self, command: CommandId, now: float) -> None:
        """Another party has sent this command, as an exact copy of what we have stored."""
        repairs = self._of.get(command)
        if repairs is None or now > repairs.begun + _COUNTED_FOR:
            return
        repairs.hear(command, now)
        if repairs.is_crowded:
            repairs.grown = True
            self._crowd = max(self._crowd, repairs.each)
            self.window = min(max(self.window, repairs.window * log2(max(2.0, repairs.each))), REPAIR_WITHIN_SLOW)

    @property
    def _steepness(self) -> float:
        """How rarely short waits are drawn: as rarely as the number of parties needs that have answered at once, if it
        is known (as in RFC 5401). While the window is the shortest, they may be ten thousand."""
        return STEEPNESS if self.window == REPAIR_WITHIN else min(1.0 + log(self._crowd), STEEPNESS)
