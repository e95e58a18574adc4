"""The mailbox: how commands reach everybody over a radio that loses some of everything.

It knows no socket and no clock of its own: datagrams and the time go in, messages and datagrams come out.

    out      a command is sent at once and a few times more, further and further apart
    order    each command names the one before it and the standing one before it, so a gap is seen. What follows a gap
             waits until the gap is filled, or until what is missing would have been too late anyway
    repair   who misses a command asks for it, and whoever still has it sends it again, after a moment of chance in
             which he listens whether somebody else does. The bytes are the sender's own, so nobody has to be believed
    rules    standing commands are kept, by everybody. How far each party has come is told in digests by Trickle
             (RFC 6206): more and more seldom while all agree, at once when somebody does not
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from math import inf
from random import Random
from typing import NamedTuple

from sleepcast.channel.door import Door
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Message

REPEATS = (0.03, 0.09, 0.21)
"""Seconds after which a command is sent again, unasked: at 30 % loss 99 of 100 hear one of four."""
SOONEST, LATEST = 0.1, 60.0
"""Seconds between two digests of a party: at least, while there is news, and at most."""
ENOUGH = 2
"""Digests like our own, heard in one interval, that make ours needless."""
ASK_AFTER = (0.02, 0.06)
"""Seconds, by chance between these, before a party asks for what it misses: the sender repeats by himself, too."""
ASK_AGAIN = 0.15
"""Seconds after which it asks again for what has not come, doubled each time up to `ASK_SELDOM`."""
ASK_SELDOM = 2.0
MEND_WITHIN = 0.04
"""Seconds, by chance within which a party sends what another one misses, unless somebody else does."""
BATCH = 24
"""Commands sent for one digest or request: the rest follows with the next one."""
MAX_WANTED = 64
"""Numbers in one request."""
MAX_RECENT = 512
"""One-shot commands kept for those who miss them."""
MAX_STANDING = 20_000
"""Standing commands kept, of all senders: months of a busy desk, some ten megabytes."""
MAX_WAITING = 1_024
"""Commands that wait for what came before them."""
MAX_STREAMS = 64
"""Senders of commands, each in each of its epochs, whose order is kept."""

Name = tuple[str, str, int]
"""Of a stream: its key's id as hexadecimal digits, its sender's name, its epoch."""


class Skipped(NamedTuple):
    """A command that never came and would have been too late."""

    sender: str
    epoch: int
    sequence: int


@dataclass(slots=True)
class Stream:
    """The commands of one sender in one epoch. done: number of the latest that was dealt with; standing: the numbers of
    its standing ones that were, in order; waiting: what has come too early, by number."""

    done: int = 0
    standing: list[int] = field(default_factory=list)
    waiting: dict[int, Message] = field(default_factory=dict)

    @property
    def rules(self) -> int:
        """The number of the latest standing command that was dealt with, 0 for none."""
        return self.standing[-1] if self.standing else 0


@dataclass(slots=True)
class Want:
    """A number that somebody misses: when it is asked for next (s), and how long then until the time after."""

    due: float
    again: float = ASK_AGAIN


class Mailbox:
    """One party's mailbox. key: signs what it says; door: what comes in goes through it; name: of its own messages;
    epoch: its life, higher than all before; chance: for its moments. skipped: what never came, since it was asked last.

    robot: whether it obeys commands; an operator keeps and repairs them, and has his own.
    """

    def __init__(self, name: str, epoch: int, key: KeyPair, door: Door, chance: Random) -> None:
        self.name, self.epoch = name, epoch
        self.skipped: list[Skipped] = []
        self._key, self._door, self._chance = key, door, chance
        self._streams: OrderedDict[Name, Stream] = OrderedDict()
        self._kept: dict[tuple[Name, int], list[bytes]] = {}
        self._recent: OrderedDict[tuple[Name, int], list[bytes]] = OrderedDict()
        self._heard_at: dict[tuple[Name, int], float] = {}
        self._wanted: dict[tuple[Name, int], Want] = {}
        self._later: list[tuple[float, int, Callable[[float], None]]] = []
        self._tie = count()
        self._out: list[bytes] = []
        self._sequence = 0
        self._last: tuple[int, float] = (0, inf)
        self._interval, self._alike, self._round = SOONEST, 0, 0
        self._pieces: dict[tuple[bytes, int, int], list[bytes]] = {}
