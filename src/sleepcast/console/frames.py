"""Frames: the picture of the moving swarm, as bytes for the page. `static/frame.js` reads them.

Everything is little endian. A frame of n robots has 32 + 14 n bytes, or 32 + 15 n if any of them has pinged:

    offset   type        meaning
    0        u8          1, the version of this layout
    1        u8          state: bit 0 time runs, bit 1 STOP is latched
    2        u8          1 if pings follow, else 0
    3        u8          0
    4        u32         n
    8        u32         number of the frame; the page sends it back once the frame is drawn
    12       u32         tick, modulo 2^32
    16       f64         simulated time, s
    24       f32         wanted speed: simulated seconds in a second
    28       f32         speed that was reached in the last second or so
    32       f32 x 3n    x (m), y (m), heading (rad, counter-clockwise from x) of each robot in turn
    32+12n   u8 x n      group: 0 for none, else the place of its newest group in the list of groups, from 1
    32+13n   u8 x n      flags: bit 0 stopped, 1 frozen, 2 sleeping, 3 marked and showing it
    32+14n   u8 x n      pings: 0 for who has not pinged since the frame before, else the caste + 1
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

from sleepcast.language.vocabulary import FROZEN, MARKED, MARKING, SLEEPING
from sleepcast.station import Mind, Telemetry

VERSION = 1
MAX_GROUPS = 255
"""Groups that one byte can tell apart; robots of later ones are shown as in no group."""

_HEADER = struct.Struct("<BBBxIIIdff")
_BITS = ((FROZEN, 2), (SLEEPING, 4))
_MARK = 8


def pack(
    number: int,
    tick: int,
    time: float,
    speeds: tuple[float, float],
    state: tuple[bool, bool],
    poses: bytes,
    marks: tuple[bytes, bytes],
    pings: bytes = b"",
) -> bytes:
    """A frame. speeds: wanted, reached. state: time runs, STOP is latched. marks: group and flags of each robot. pings:
    empty if there were none."""
    running, stopped = state
    header = _HEADER.pack(
        VERSION, running | stopped << 1, bool(pings), len(marks[0]), number, tick & 0xFFFFFFFF, time, *speeds
    )
    return b"".join((header, poses, *marks, pings))


def flags_of(minds: Iterable[Telemetry]) -> bytes:
    """The flags of each robot."""
    found = bytearray()
    for mind in minds:
        values = mind.values
        flags = 1 if mind.stopped else 0
        for slot, bit in _BITS:
            if values[slot] > 0.0:
                flags |= bit
        if values[MARKED] > 0.0 and values[MARKING] > 0.0:
            flags |= _MARK
        found.append(flags)
    return bytes(found)


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
        self._code_of: dict[frozenset[str], int] = {frozenset(): 0}

    def look(self, minds: Iterable[Mind]) -> bytes:
        """The code of each robot's newest group (0: none), and the counts brought up to date."""
        sets: dict[frozenset[str], int] = {}
        codes = bytearray()
        for mind in minds:
            codes.append(self.code(mind))
            sets[mind.groups] = sets.get(mind.groups, 0) + 1
        self.counts = [0] * len(self.names)
        self.shown = [0] * len(self.names)
        for groups, count in sets.items():
            for key in groups:
                if key in self._codes:
                    self.counts[self._codes[key] - 1] += count
            if (code := self._code_of[groups]) > 0:
                self.shown[code - 1] += count
        return bytes(codes)

    def code(self, mind: Mind) -> int:
        """The number of a robot's newest group, 0 if it is in none."""
        found = self._code_of.get(mind.groups)
        return self._number(mind.groups, mind) if found is None else found

    def _number(self, groups: frozenset[str], mind: Mind) -> int:
        for key in sorted(groups):
            if key not in self._codes and len(self.names) < MAX_GROUPS:
                declared = mind.declared(key)
                self.names.append(declared.name if declared is not None else key)
                self._codes[key] = len(self.names)
        code = max((self._codes.get(key, 0) for key in groups), default=0)
        if len(self._code_of) > 4 * MAX_GROUPS:  # sets come and go; the groups themselves stay numbered
            self._code_of = {frozenset(): 0}
        self._code_of[groups] = code
        return code
