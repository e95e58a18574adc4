"""What a picture of a fleet marks robots with, one byte each: each robot's two newest groups, and its flags."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sleepcast.language.symbols import Declared
from sleepcast.language.vocabulary import FROZEN, MARKED, MARKING, SLEEPING

MAX_GROUPS = 255
"""Groups that one byte can distinguish; robots of later ones are shown as in no group."""

_BITS = ((FROZEN, 2), (SLEEPING, 4))
_MARK = 8
_EXHAUSTED, _CRASHED = 32, 64
"""The bit between is that of silent robots, which only a desk knows."""


class FleetMarks(Protocol):
    """The minds of a fleet, as arrays in the order of its robots."""

    def __len__(self) -> int: ...

    @property
    def stopped(self) -> NDArray[np.bool_]: ...

    @property
    def groups(self) -> Mapping[str, NDArray[np.bool_]]:
        """The members of each group, by its key; the newest group last."""

    def column(self, slot: int) -> NDArray[np.float64]:
        """A variable of all robots in SI, NaN for unknown."""

    def declared(self, key: str) -> Declared | None:
        """What any robot has learned under this key."""


def flags_of(
    minds: FleetMarks, exhausted: NDArray[np.bool_] | None = None, crashed: NDArray[np.bool_] | None = None
) -> bytes:
    """The flags of each robot. exhausted, crashed: which bodies have used up what they drive with, and have crashed;
    None where nobody knows."""
    flags = minds.stopped.astype(np.uint8)
    for slot, bit in _BITS:
        flags |= np.where(minds.column(slot) > 0.0, np.uint8(bit), np.uint8(0))
    shown = (minds.column(MARKED) > 0.0) & (minds.column(MARKING) > 0.0)
    flags |= np.where(shown, np.uint8(_MARK), np.uint8(0))
    for which, bit in ((exhausted, _EXHAUSTED), (crashed, _CRASHED)):
        if which is not None:
            flags |= np.where(which, np.uint8(bit), np.uint8(0))
    return flags.tobytes()


def is_frozen(minds: FleetMarks) -> NDArray[np.bool_]:
    """Which robots are frozen."""
    return minds.column(FROZEN) > 0.0


class GroupCodes:
    """The groups of a fleet, numbered from 1 in the order in which they were first seen.

    names: as written in the first message that named each
    counts: members of each
    shown: members whose newest group it is, as the map shows them
    second: the number of each robot's second newest group (0: none); empty if no robot is in two
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.counts: list[int] = []
        self.shown: list[int] = []
        self.second = b""
        self._codes: dict[str, int] = {}

    def expect(self, names: Iterable[str]) -> None:
        """Number groups of these names first, in this order, whether there are any members or not."""
        for name in names:
            self.names.append(name)
            self._codes[name.casefold()] = len(self.names)

    def look(self, minds: FleetMarks) -> bytes:
        """The number of each robot's newest group (0: none); updates the rest."""
        codes, second = np.zeros((2, len(minds)), np.uint8)
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
                members = minds.groups[key]
                second[members] = codes[members]
                codes[members] = code
        self.counts = counts[: len(self.names)]
        self.shown = np.bincount(codes, minlength=len(self.names) + 1)[1:].tolist()
        self.second = second.tobytes() if second.any() else b""
        return codes.tobytes()

    def members(self, minds: FleetMarks, code: int) -> NDArray[np.bool_]:
        """Who is in the group with this number now: nobody if there is none."""
        key = next((key for key, known in self._codes.items() if known == code), "")
        members = minds.groups.get(key)
        return np.zeros(len(minds), np.bool_) if members is None else members
