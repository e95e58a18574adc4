"""What a page of Nomads and its desk say to each other beside what all pages say: orders, driving by hand, windows.

Who drives by hand must say so again and again: a page that falls silent, or goes away, leaves its robot at rest.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Coroutine, Iterator
from contextlib import suppress
from typing import Any, TypeVar

from sleepcast.console.connection import encode
from sleepcast.console.dialogue import Dialogue
from sleepcast.console.driver import FrameSource
from sleepcast.console.outgoing import Done
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.nomad.panes.backend import NomadsBackend
from sleepcast.nomad.panes.features.nomad_orders import Drive, Perform
from sleepcast.nomad.panes.windows import PageWindows

HAND_OFF = 0.6
"""Seconds after which a robot that is driven by hand rests, unless it is driven on: a page says so three times as
often."""
MOST_UNDER_WAY = 64
"""Orders of one page that may be under way at a time; some take as long as a robot's motion."""

T = TypeVar("T")


class NomadDialogue(Dialogue[NomadsBackend]):
    """See the module."""

    max_waiting = 2 * MOST_UNDER_WAY

    def __init__(self, desk: NomadsBackend) -> None:
        super().__init__(desk)
        self._windows = PageWindows(desk.nomads)
        self._before = b""
        """What the page was told last of the windows."""
        self._under_way = 0
        self._driven: int | None = None
        self._hand_off: asyncio.TimerHandle | None = None
        self._rests: set[asyncio.Task[None]] = set()
        """Of robots that nobody drives any more."""
        desk.driver.enter()

    @property
    def source(self) -> FrameSource:
        return self._desk.driver

    def watch(self, robot: int) -> None:
        self._windows.choose(robot)
        self._before = b""  # the page has forgotten what it was sent of it
        super().watch(robot)

    def perform(self, asked: Perform) -> Awaitable[Done]:
        """An order that goes on beside everything else."""
        return self._begin(self._desk.obey(asked))

    def with_frame(self) -> Iterator[str | bytes]:
        """What the windows show beside a frame, unless the page knows it."""
        data = encode(self._windows.take())
        if data != self._before:
            self._before = data
            yield data.decode()

    def leave(self) -> None:
        self._desk.driver.leave()
        self._let_go()

    def _begin(self, order: Coroutine[Any, Any, T]) -> Awaitable[T]:
        """An order that goes on beside everything else: some take as long as the robot's motion."""
        if self._under_way >= MOST_UNDER_WAY:
            order.close()
            raise MisuseError("too many orders wait to be done; this one was not begun")
        self._under_way += 1
        return self._see_through(order)

    async def _see_through(self, order: Coroutine[Any, Any, T]) -> T:
        try:
            return await order
        finally:
            self._under_way -= 1

    # ---- driving by hand

    def drive(self, asked: Drive) -> Awaitable[None]:
        """Turn the axes of a robot until the hand leaves the keys."""
        robot, numbers = asked.robot, asked.numbers
        if self._driven not in (None, robot):
            self._let_go()
        self._forget()
        driving = self._begin(self._desk.turn(robot, numbers))
        if any(numbers):
            self._driven = robot
            self._hand_off = asyncio.get_running_loop().call_later(HAND_OFF, self._let_go)
        return driving

    def _forget(self) -> None:
        if self._hand_off is not None:
            self._hand_off.cancel()
        self._hand_off = self._driven = None

    def _let_go(self) -> None:
        """The hand is off the keys: what it drove rests."""
        robot = self._driven
        self._forget()
        if robot is not None:
            rest = asyncio.ensure_future(self._rest(robot))
            self._rests.add(rest)
            rest.add_done_callback(self._rests.discard)

    async def _rest(self, robot: int) -> None:
        with suppress(SleepcastError):  # a real robot may be gone; the page is told of that otherwise
            await self._desk.turn(robot, [0, 0, 0])
