"""Missions and fences from and to a vehicle, item by item, as MAVLink's mission protocol has it.

Nothing here waits: a transfer is told the time and what has come, and sends what is due. Who sends items is asked for
each; who wants items asks for each. What is not answered is said again, for a while, and then the transfer has failed.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import isfinite
from typing import Any

from sleepcast.bridges.address import BodyError
from sleepcast.bridges.mavlink.link import MavlinkConnection
from sleepcast.core.mission_files import WAYPOINT, Item
from sleepcast.core.records import NamedTuple

MISSION, FENCE = 0, 1
"""What items are of: MAV_MISSION_TYPE."""
AGAIN, SECONDS = 0.5, 6.0
"""Seconds after which what was not answered is said again, and after which a transfer without an answer has failed: a
vehicle asks anew once a second."""
LAST_WORD = 3
"""Times of `AGAIN` without a word, longer than a vehicle needs to ask for an item anew."""
PAUSE = 0.02
"""Seconds between two looks at what has come."""
MAX_ITEMS = 700
"""What ArduPilot has room for, on most boards."""
ACCEPTED, INVALID_SEQUENCE = 0, 13
RESULTS = (
    *("accepted", "failed", "its frame is not supported", "not supported", "there is no room", "invalid"),
    *(f"parameter {number} is invalid" for number in range(1, 5)),
    *("its place is invalid", "its place is invalid", "its height is invalid", "out of order", "denied", "cancelled"),
)
"""In the order of MAV_MISSION_RESULT."""


class Party(NamedTuple):
    """Who exchanges items with whom: numbers of the vehicle, and of ours."""

    system: int
    ours: int
    component: int


class Transfer(ABC):
    """See the module. failed: why it has, "" while it has not; done: whether it has succeeded."""

    def __init__(self, link: MavlinkConnection, party: Party, kind: int, now: float) -> None:
        self._link, self._party, self._kind = link, party, kind
        self.done, self.failed = False, ""
        self._again, self._end = now, now + SECONDS

    @property
    def over(self) -> bool:
        return self.done or bool(self.failed)

    def tend(self, now: float) -> None:
        """Say again what was not answered, if it is time to."""
        if self.over:
            return
        if now >= self._end:
            self.failed = f"it has not answered for {SECONDS:g} s"
        elif now >= self._again:
            self._again = now + AGAIN
            self.repeat()

    def hear(self, message: Any, now: float) -> None:
        """Take what the vehicle says, if it is about this."""
        kind = message.get_type()
        ours = getattr(message, "target_system", 0) in (0, self._party.ours)
        if self.over or not ours or getattr(message, "mission_type", -1) != self._kind:
            return
        if kind == "MISSION_ACK":
            self.acknowledged(message.type)
        elif self.answered(kind, message):
            self._again, self._end = now + AGAIN, now + SECONDS

    @abstractmethod
    def repeat(self) -> None:
        """Say again what has no answer."""

    def acknowledged(self, result: int) -> None:
        """The vehicle has ended it."""
        if result not in (ACCEPTED, INVALID_SEQUENCE):  # a repeated item is out of order, and harmless
            self.failed = RESULTS[result] if result < len(RESULTS) else f"result {result}"

    @abstractmethod
    def answered(self, kind: str, message: Any) -> bool:
        """Take another message; whether it brings the transfer on."""

    @property
    def _to(self) -> tuple[int, int]:
        return self._party.system, 1


class Upload(Transfer):
    """Writes items, of a mission behind one in the place of home, which ArduPilot fills in by itself. Numbers that are
    NaN are written as 0: for many commands ArduPilot refuses a mission with one."""

    def __init__(self, link: MavlinkConnection, party: Party, kind: int, items: Sequence[Item], now: float) -> None:
        super().__init__(link, party, kind, now)
        self._items = [Item(WAYPOINT, None), *items] if kind == MISSION else list(items)
        self._asked = -1
        """The last item that it has asked for."""
        self._unanswered = 0
        """Times that it was to say something again since then."""

    @property
    def count(self) -> int:
        return len(self._items)

    def repeat(self) -> None:
        """From its first question on it is the vehicle that asks again; but if it asks for no more, its last word may
        be lost, and all is said again."""
        self._unanswered += 1
        if self._asked == self.count - 1 and self._unanswered > LAST_WORD:
            self._asked = -1
        if self._asked < 0:
            self._link.send(self._link.mav.mission_count_encode(*self._to, self.count, self._kind))

    def acknowledged(self, result: int) -> None:
        super().acknowledged(result)
        self.done = result == ACCEPTED and self._asked == self.count - 1

    def answered(self, kind: str, message: Any) -> bool:
        if kind not in ("MISSION_REQUEST", "MISSION_REQUEST_INT") or not 0 <= message.seq < self.count:
            return False
        anew = bool(message.seq > self._asked)
        self._asked, self._unanswered = max(self._asked, message.seq), 0
        item = self._items[message.seq]
        place = [round(each * 1e7) for each in item.at or (0.0, 0.0)]
        *parameters, height = (each if isfinite(each) else 0.0 for each in (*item.parameters, item.altitude))
        head = *self._to, message.seq, item.frame, item.command, 0, 1
        self._link.send(self._link.mav.mission_item_int_encode(*head, *parameters, *place, height, self._kind))
        return anew


class Download(Transfer):
    """Reads items; `items` are those that have come."""

    def __init__(self, link: MavlinkConnection, party: Party, kind: int, now: float) -> None:
        super().__init__(link, party, kind, now)
        self.items: list[Item] = []
        self._count = -1

    def repeat(self) -> None:
        mav = self._link.mav
        if self._count < 0:
            self._link.send(mav.mission_request_list_encode(*self._to, self._kind))
        else:
            self._link.send(mav.mission_request_int_encode(*self._to, len(self.items), self._kind))

    def answered(self, kind: str, message: Any) -> bool:
        if kind == "MISSION_COUNT" and self._count < 0:
            self._count = message.count
            if self._count > MAX_ITEMS:
                self.failed = f"it has {self._count} items, and {MAX_ITEMS} are read"
        elif kind == "MISSION_ITEM_INT" and message.seq == len(self.items) < self._count:
            at = (message.x / 1e7, message.y / 1e7) if message.x or message.y else None
            parameters = message.param1, message.param2, message.param3, message.param4
            self.items.append(Item(message.command, at, message.z, message.frame, parameters))
        else:
            return False
        self._go_on()
        return True

    def _go_on(self) -> None:
        if not self.over and len(self.items) == self._count:
            self.done = True
            self._link.send(self._link.mav.mission_ack_encode(*self._to, ACCEPTED, self._kind))
        elif not self.over:
            self.repeat()


def finish(transfer: Transfer, link: MavlinkConnection, party: Party, failed: str) -> None:
    """Wait until a transfer is over, where nothing else is to be done. failed: how the sentence begins that says why it
    has failed. Raises BodyError."""
    while not transfer.over:
        transfer.tend(time.monotonic())
        for message in link.receive():
            if message.get_srcSystem() == party.system:
                transfer.hear(message, time.monotonic())
        if not transfer.over:
            time.sleep(PAUSE)
    if transfer.failed:
        raise BodyError(f"{failed}: {transfer.failed}")
