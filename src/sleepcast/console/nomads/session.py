"""A session of the Nomads' page: one open page, its requests, and what it is sent.

Four tasks, as for any page: one reads, one sends pictures, one sends news, one says that there is a server. A picture
goes out only when the page has drawn the one before. Who drives by hand must say so again and again: a page that falls
silent, or goes away, leaves its robot at rest.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine

from starlette.websockets import WebSocket

from sleepcast.console.connection import PageConnection, encode
from sleepcast.console.incoming import Drawn, Pace, Release, Step, Stop, Watch
from sleepcast.console.nomads import incoming
from sleepcast.console.nomads.backend import Done, NomadsBackend, World
from sleepcast.console.nomads.updates import Pictures
from sleepcast.console.outgoing import Refused
from sleepcast.core.clock import Clock
from sleepcast.core.errors import SleepcastError

PICTURE_PERIOD = 0.05
"""Seconds between two pictures at least: robots that are no faster than a person walks need no more."""
NEWS_PERIOD = 0.25
"""Seconds between two looks for what changes seldom."""
HAND_OFF = 0.6
"""Seconds after which a robot that is driven by hand rests, unless it is driven on: a page says so three times as
often."""

MOST_UNDER_WAY = 64
"""Orders of one page that may be under way at a time; some take as long as a robot's motion."""


class NomadSession:
    """One page; `run` lasts as long as it is open."""

    def __init__(self, socket: WebSocket, desk: NomadsBackend, clock: Clock) -> None:
        self._line: PageConnection[incoming.Incoming] = PageConnection(socket, incoming.decode, (Stop, Drawn), clock)
        self._desk = desk
        self._pictures = Pictures(desk.nomads)
        self._drawn = asyncio.Event()
        self._sent: dict[str, bytes] = {}
        self._before = b""
        """The picture that went out last."""
        self._under_way: set[asyncio.Task[None]] = set()
        self._driven: int | None = None
        self._hand_off: asyncio.TimerHandle | None = None

    async def run(self) -> None:
        """Serve the page until it goes away or breaks the rules."""
        await self._line.say(self._desk.hello())
        others = [asyncio.create_task(work) for work in (self._send_pictures(), self._send_news(), self._line.beat())]
        try:
            await self._line.read(self._answer)
        finally:
            for task in (*others, *self._under_way):
                task.cancel()
            self._let_go()
            await asyncio.gather(*others, *self._under_way, return_exceptions=True)

    # ---- what comes in

    async def _answer(self, message: incoming.Incoming) -> None:
        desk = self._desk
        match message:
            case Stop():
                desk.hold(True)
            case Release():
                desk.hold(False)
            case Drawn():
                self._drawn.set()
            case Watch(robot):
                self._pictures.choose(robot)
                self._before = b""  # the page has forgotten what it was sent of it
            case Pace(running, factor):
                desk.set_pace(running, factor)
            case Step():
                desk.step()
            case incoming.Drive(robot, numbers):
                if await self._has_room(None):
                    self._drive(robot, numbers)
            case incoming.Perform(serial, robot, order, numbers, text):
                if await self._has_room(serial):
                    self._begin(desk.perform(robot, order, numbers, text), serial)
            case incoming.Click(serial, robot, x, y):
                await self._try(lambda: desk.click(robot, x, y), serial)
            case incoming.Build(serial, corners):
                await self._try(lambda: desk.build(corners), serial)
            case incoming.Shift(serial, version, solid, across, up):
                await self._try(lambda: desk.shift(version, solid, across, up), serial)
            case incoming.Load(serial, name, text):
                await self._try(lambda: desk.load(name, text), serial)
            case incoming.Save(serial):
                await self._line.say(World(serial, desk.nomads.written()))
            case incoming.Clear(serial, version, solid):
                await self._try(lambda: desk.clear(version, solid), serial)

    async def _try(self, act: Callable[[], None], serial: int) -> None:
        try:
            act()
        except SleepcastError as error:
            await self._line.say(Refused(str(error), serial))
        else:
            await self._line.say(Done(serial))

    async def _has_room(self, serial: int | None) -> bool:
        """Whether one more order may be begun; otherwise the page gets a refusal."""
        if len(self._under_way) < MOST_UNDER_WAY:
            return True
        await self._line.say(Refused("too many orders wait to be done; this one was not begun", serial))
        return False

    def _begin(self, order: Coroutine[None, None, str], serial: int | None) -> None:
        """Do it beside everything else: some orders take as long as the robot's motion."""
        task = asyncio.create_task(self._see_through(order, serial))
        self._under_way.add(task)
        task.add_done_callback(self._under_way.discard)

    async def _see_through(self, order: Coroutine[None, None, str], serial: int | None) -> None:
        try:
            note = await order
        except SleepcastError as error:
            await self._line.say(Refused(str(error), serial))
        else:
            if serial is not None:
                await self._line.say(Done(serial, note))

    # ---- driving by hand

    def _drive(self, robot: int, numbers: list[int]) -> None:
        if self._driven not in (None, robot):
            self._let_go()
        if self._hand_off is not None:
            self._hand_off.cancel()
            self._hand_off = None
        self._driven = None
        self._begin(self._desk.drive(robot, numbers), None)
        if any(numbers):
            self._driven = robot
            self._hand_off = asyncio.get_running_loop().call_later(HAND_OFF, self._let_go)

    def _let_go(self) -> None:
        """The hand is off the keys: what it drove rests."""
        if self._driven is not None:
            self._drive(self._driven, [0, 0, 0])

    # ---- what goes out

    async def _send_pictures(self) -> None:
        while True:
            picture = encode(self._pictures.take(*self._desk.paces()))
            if picture != self._before:
                self._before = picture
                self._drawn.clear()
                await self._line.send(picture.decode())
                await self._drawn.wait()
            await asyncio.sleep(PICTURE_PERIOD)

    async def _send_news(self) -> None:
        while True:
            for message in (self._desk.safety(), self._desk.solids()):
                data = encode(message)
                kind = type(message).__name__
                if self._sent.get(kind) != data:
                    self._sent[kind] = data
                    await self._line.send(data.decode())
            await asyncio.sleep(NEWS_PERIOD)
