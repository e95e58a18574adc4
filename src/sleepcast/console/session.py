"""A session: one page that is open. It answers the page's messages and tells it the news.

Four tasks: one reads, one sends frames, one sends news (accounts, groups, the watched robot), one says that there is a
station. A frame goes out only when the page has drawn the one before, so a slow page skips frames; what it asks and
commands never waits for them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import msgspec
from starlette.websockets import WebSocket

from sleepcast.console import incoming
from sleepcast.console.backend import Backend
from sleepcast.console.connection import PageConnection, encode
from sleepcast.console.outgoing import Refused, Robot
from sleepcast.console.replay import ReplayBackend
from sleepcast.core.clock import Clock
from sleepcast.core.errors import SleepcastError
from sleepcast.station.validation import CountNeededError, DoubtError

Answer = msgspec.Struct
NEWS_PERIOD = 0.25
"""Seconds between two looks for news: people read no faster."""

MOST_WAITING = 16
"""Answers of one page that robots have to give first."""


class Session:
    """One page; `run` lasts as long as it is open."""

    def __init__(self, socket: WebSocket, desk: Backend | ReplayBackend, clock: Clock) -> None:
        self._line: PageConnection[incoming.Incoming] = PageConnection(
            socket, incoming.decode, (incoming.Stop, incoming.Drawn), clock
        )
        self._desk = desk
        self._watched = -1
        self._drawn = asyncio.Event()
        self._sent: dict[str, bytes] = {}
        self._waiting: set[asyncio.Task[None]] = set()
        """Answers that robots have to give first."""

    async def run(self) -> None:
        """Serve the page until it goes away or breaks the rules."""
        hello = self._desk.hello()
        self._sent[type(hello).__name__] = encode(hello)
        await self._line.say(hello)
        others = [asyncio.create_task(work) for work in (self._send_frames(), self._send_news(), self._line.beat())]
        try:
            await self._line.read(self._answer)
        finally:
            others += self._waiting
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)

    async def _answer(self, message: incoming.Incoming) -> None:
        desk = self._desk
        match message:
            case incoming.Stop():
                await self._do(desk.stop)
            case incoming.Drawn():
                self._drawn.set()
            case incoming.Watch(robot):
                self._watched = robot
                self._sent.pop(Robot.__name__, None)  # the page has forgotten what it was sent of it
            case incoming.Pace(running, factor):
                desk.driver.set_pace(running, factor)
            case incoming.Seek(time):
                await self._do(lambda: desk.seek(time))
            case incoming.Step():
                desk.driver.step()
            case incoming.Release():
                await self._do(desk.release)
            case incoming.Preview(serial, text):
                await self._reply(serial, lambda: desk.preview(serial, text))
            case incoming.Send(serial, text, everybody, sort, count, confirmed):
                await self._reply(serial, lambda: desk.send(serial, text, everybody, sort, count, confirmed))
            case incoming.Names(serial):
                await self._reply(serial, lambda: desk.names(serial))
            case incoming.Why(serial, robot, command):
                await self._reply(serial, lambda: desk.why(serial, robot, command))
            case incoming.Outcomes(serial, command):
                await self._reply(serial, lambda: desk.outcomes(serial, command))
            case incoming.Commands(serial):
                await self._reply(serial, lambda: desk.commands(serial))

    async def _do(self, deed: Callable[[], None]) -> None:
        try:
            deed()
        except SleepcastError as error:
            await self._line.say(Refused(str(error)))

    async def _reply(self, serial: int, answer: Callable[[], Answer | Awaitable[Answer]]) -> None:
        try:
            said = answer()
        except CountNeededError as error:
            why = error.why[:1].upper() + error.why[1:]
            said = Refused(f"{why}: {error.may} may obey. Type their number to send it.", serial, True)
        except DoubtError as error:
            said = Refused(f"{error.shown}\nPress Enter once more to send it as it stands.", serial, doubt=True)
        except SleepcastError as error:
            said = Refused(str(error), serial)
        if isinstance(said, Awaitable):
            if len(self._waiting) >= MOST_WAITING:
                self._waiting.pop().cancel()  # a page that asks this much reads only the last answers
            waiting = asyncio.ensure_future(self._reply_later(serial, said))
            self._waiting.add(waiting)
            waiting.add_done_callback(self._waiting.discard)
        else:
            await self._line.say(said)

    async def _reply_later(self, serial: int, answer: Awaitable[Answer]) -> None:
        """Answer later what waits for a robot, without delaying anything else."""
        try:
            said = await answer
        except SleepcastError as error:
            said = Refused(str(error), serial)
        await self._line.say(said)

    # ---- what goes out

    async def _send_frames(self) -> None:
        number = 0
        while True:
            frame = await self._desk.driver.frame_after(number)
            number = self._desk.driver.number
            self._drawn.clear()
            await self._line.send(frame)
            await self._drawn.wait()

    async def _send_news(self) -> None:
        while True:
            for message in self._desk.news(self._watched):
                data = encode(message)
                kind = type(message).__name__
                if self._sent.get(kind) != data:
                    self._sent[kind] = data
                    await self._line.send(data.decode())
            await asyncio.sleep(NEWS_PERIOD)
