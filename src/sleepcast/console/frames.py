"""Frames: the picture of the moving swarm, as bytes for the page. `static/frame.js` reads them.

Everything is little endian. A frame of n robots has 32 + 14 n bytes, or 32 + 15 n if any of them has pinged:

    offset   type        meaning
    0        u8          1, the version of this layout
    1        u8          state: bit 0 time runs, bit 1 STOP is latched, bit 2 time cannot run yet: what ticks take is
                         being compiled
    2        u8          1 if pings follow, else 0
    3        u8          0
    4        u32         n
    8        u32         number of the frame; the page sends it back once the frame is drawn
    12       u32         tick, modulo 2^32
    16       f64         simulated time, s
    24       f32         wanted speed: simulated seconds in a second
    28       f32         speed that was reached in the last second or so
    32       f32 x 3n    x (m), y (m), heading (rad, counter-clockwise from x) of each robot in turn; heading NaN: it
                         has no known position and stands aside
    32+12n   u8 x n      group: 0 for none, else the place of its newest group in the list of groups, from 1
    32+13n   u8 x n      flags: bit 0 stopped, 1 frozen, 2 sleeping, 3 marked and showing it,
                         4 silent: its telemetry is stale
    32+14n   u8 x n      pings: 0 for who has not pinged since the frame before, else the caste + 1
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

import numpy as np

from sleepcast.console.view import MindsView
from sleepcast.language.vocabulary import FROZEN, MARKED, MARKING, SLEEPING

VERSION = 1
MAX_GROUPS = 255
"""Groups that one byte can tell apart; robots of later ones are shown as in no group."""

_HEADER = struct.Struct("<BBBxIIIdff")
_BITS = ((FROZEN, 2), (SLEEPING, 4))
_MARK = 8
SILENT = 16


def pack(
    number: int,
    tick: int,
    time: float,
    speeds: tuple[float, float],
    state: tuple[bool, ...],
    poses: bytes,
    marks: tuple[bytes, bytes],
    pings: bytes = b"",
) -> bytes:
    """A frame. speeds: wanted, reached. state: its bits in turn. marks: group and flags of each robot. pings:
    empty if there were none."""
    bits = sum(bit << place for place, bit in enumerate(state))
    header = _HEADER.pack(VERSION, bits, bool(pings), len(marks[0]), number, tick & 0xFFFFFFFF, time, *speeds)
    return b"".join((header, poses, *marks, pings))


def flags_of(minds: MindsView) -> bytes:
    """The flags of each robot."""
    found = minds.stopped.astype(np.uint8)
    for slot, bit in _BITS:
        found |= np.where(minds.column(slot) > 0.0, np.uint8(bit), np.uint8(0))
    shown = (minds.column(MARKED) > 0.0) & (minds.column(MARKING) > 0.0)
    found |= np.where(shown, np.uint8(_MARK), np.uint8(0))
    return found.tobytes()


class Groups:
    """The groups of a fleet, numbered from 1 in the order in which they were first seen.

    names: as written in the first message that named each. counts: members of each. shown: robots that the map shows
    in each, because it is the newest that they are in.
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.counts: list[int] = []
        self.shown: list[int] = []
        self._codes: dict[str, int] = {}

    def look(self, minds: MindsView) -> bytes:
        """The code of each robot's newest group (0: none), and the counts brought up to date."""
        codes = np.zeros(len(minds), np.uint8)
        counts = [0] * MAX_GROUPS
        for key, members in minds.groups.items():
            count = int(np.count_nonzero(members))
            if key not in self._codes and count and len(self.names) < MAX_GROUPS:
                declared = minds.declared(key)
                self.names.append(declared.name if declared is not None else key)
                self._codes[key] = len(self.names)
            if key in self._codes:
                counts[self._codes[key] - 1] = count
        for key, code in self._codes.items():
            if counts[code - 1]:
                codes[minds.groups[key]] = code
        self.counts = counts[: len(self.names)]
        self.shown = np.bincount(codes, minlength=len(self.names) + 1)[1:].tolist()
        return codes.tobytes()

    def code(self, groups: Iterable[str]) -> int:
        """The number of the newest of these groups, 0 of none."""
        return max((self._codes.get(key, 0) for key in groups), default=0)
