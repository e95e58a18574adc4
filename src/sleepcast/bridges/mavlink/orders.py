"""Orders to a vehicle: commands of MAVLink, which are sent again until they are answered, and then given up.

Those of one queue wait for each other: the next one is sent when the one before it was answered. So a vehicle is armed
in the mode that was asked for before, whichever datagrams are lost. If one fails, those that the same tick of the mind
has asked for after it are not sent.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from sleepcast.core.records import dataclass

SET_MODE, ARM_DISARM, TAKEOFF, CHANGE_SPEED, INTERVAL = 176, 400, 22, 178, 511
REPOSITION, LAND_START, MISSION_ITEM, MISSION_START = 192, 189, 224, 300
NAMES = {
    SET_MODE: "the mode",
    ARM_DISARM: "arming or disarming",
    TAKEOFF: "taking off",
    CHANGE_SPEED: "its speed",
    INTERVAL: "its messages",
    REPOSITION: "where to circle",
    LAND_START: "the landing of its mission",
    MISSION_ITEM: "where to begin its plan",
    MISSION_START: "beginning its plan",
}
WITH_PLACE = frozenset({REPOSITION})
"""Orders that name a place on the Earth."""
RESULTS = ("accepted", "refused for now", "denied", "not supported", "failed", "in progress", "cancelled")
IN_PROGRESS = 5
ORDER_AGAIN, ORDER_SECONDS = 0.3, 1.5
"""Seconds after which an unanswered order is sent again, and after which it is given up."""
MAX_WAITING = 32
"""Orders that wait: more than a tick has reason to ask for. What finds no room has failed."""

AT_ONCE, ASKED, MESSAGES = "", "asked", "messages"
"""Queues: of what waits for nothing, of what the mind has asked for, and of messages that we need."""


@dataclass(slots=True, eq=False)
class PendingCommand:
    """A command of MAVLink that waits for its answer.

    parameters: seven of them; a place in them is in degrees times 10^7.
    tick: of the mind that has asked for it.
    mode: the one in which the vehicle is once it has accepted this, None if that stays.
    sent: how often.
    again: when it is sent next, s.
    end: when it is given up, s.
    """

    command: int
    parameters: tuple[float, ...]
    queue: str
    tick: int
    mode: int | None = None
    sent: int = 0
    again: float = -inf
    end: float = inf

    @property
    def name(self) -> str:
        return NAMES[self.command]


class Orders:
    """See the module. send: sends a command, which knows how often it was sent before."""

    def __init__(self, send: Callable[[PendingCommand], None]) -> None:
        self._send = send
        self._waiting: list[PendingCommand] = []

    def add(self, now: float, order: PendingCommand) -> bool:
        """Order this, unless the last one of its command and queue that waits is the same; gives whether there was
        room."""
        if len(self._waiting) >= MAX_WAITING:
            return False
        before = self.last(order.command, order.queue)
        if before is None or before.parameters != order.parameters:
            self._waiting.append(order)
        self.tend(now)
        return True

    def last(self, command: int, queue: str) -> PendingCommand | None:
        """The last one of this command that waits in a queue."""
        return next((o for o in reversed(self._waiting) if (o.command, o.queue) == (command, queue)), None)

    def waits(self, queue: str) -> bool:
        """Whether an order of a queue has no answer yet."""
        return any(order.queue == queue for order in self._waiting)

    def tend(self, now: float) -> list[PendingCommand]:
        """Send what is due; gives those that nobody has answered, of which each must `end`."""
        failed: list[PendingCommand] = []
        busy: set[str] = set()
        for order in self._waiting:
            if order.queue in busy:
                continue
            if order.queue != AT_ONCE:
                busy.add(order.queue)
            if now >= order.end:
                failed.append(order)
            elif now >= order.again:
                self._send(order)
                order.end = min(order.end, now + ORDER_SECONDS)
                order.sent, order.again = order.sent + 1, now + ORDER_AGAIN
        return failed

    def answered(self, command: int, result: int) -> PendingCommand | None:
        """The order that this is the answer to, which then waits no more; None if it is none, or not the last one."""
        if result == IN_PROGRESS:
            return None
        answered = next((order for order in self._waiting if order.command == command and order.sent), None)
        self.forget(lambda order: order is answered)
        return answered

    def end(self, failed: PendingCommand) -> list[PendingCommand]:
        """An order has failed: gives those that are not sent any more because of it."""
        others = [
            order
            for order in self._waiting
            if order is not failed and order.queue == failed.queue == ASKED and order.tick == failed.tick
        ]
        self._waiting = [order for order in self._waiting if order is not failed and order not in others]
        return others

    def forget(self, which: Callable[[PendingCommand], bool]) -> None:
        """Send these no more."""
        self._waiting = [order for order in self._waiting if not which(order)]
