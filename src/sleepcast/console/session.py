"""A session: one page that is open, whatever robots it shows. It answers the page's messages and tells it the news.

Four tasks: one reads, one sends frames, one sends news (accounts, groups, the watched robot), one says that there is a
station. A frame goes out only when the page has drawn the one before, so a slow page skips frames; what it asks and
commands never waits for them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Any

from starlette.websockets import WebSocket

from sleepcast.console import registry
from sleepcast.console.connection import PageConnection
from sleepcast.console.dialogue import Dialogue, refusal
from sleepcast.console.driver import FrameSource
from sleepcast.console.feature import Answer
from sleepcast.console.frames import still
from sleepcast.console.incoming import Drawn, PageMessage, Stop
from sleepcast.core.clock import Clock
from sleepcast.core.errors import SleepcastError

NEWS_PERIOD = 0.25
"""Seconds between two looks for news: people read no faster."""


class PageSession:
    """One page; `run` lasts as long as it is open."""

    def __init__(self, socket: WebSocket, dialogue: Dialogue[Any], clock: Clock) -> None:
        self._line: PageConnection[PageMessage] = PageConnection(socket, registry.decode, (Stop, Drawn), clock)
        self._dialogue = dialogue
        self._drawn = asyncio.Event()
        self._waiting: set[asyncio.Task[None]] = set()
        """Answers that robots have to give first."""

    async def run(self) -> None:
        """Serve the page until it goes away or breaks the rules."""
        await self._line.send(self._dialogue.hello())
        others = [asyncio.create_task(work) for work in (self._send_frames(), self._send_news(), self._line.beat())]
        try:
            await self._line.read(self._answer)
        finally:
            self._dialogue.leave()
            others += self._waiting
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)

    async def _answer(self, message: PageMessage) -> None:
        if isinstance(message, Drawn):
            self._drawn.set()
            return
        answer = self._dialogue.answer(message)
        if isinstance(answer, Awaitable):
            if len(self._waiting) >= self._dialogue.max_waiting:
                self._waiting.pop().cancel()  # a page that asks this much reads only the last answers
            waiting = asyncio.ensure_future(self._reply_later(getattr(message, "serial", None), answer))
            self._waiting.add(waiting)
            waiting.add_done_callback(self._waiting.discard)
        elif answer is not None:
            await self._line.say(answer)

    async def _reply_later(self, serial: int | None, answer: Awaitable[Answer]) -> None:
        """Answer later what waits for a robot, without delaying anything else."""
        try:
            message = await answer
        except SleepcastError as error:
            message = refusal(error, serial)
        if message is not None:
            await self._line.say(message)

    # ---- what goes out

    async def _send_frames(self) -> None:
        source, number = self._dialogue.source, 0
        while True:
            frame = await self._next_frame(source, number)
            if source is not self._dialogue.source:
                source, number = self._dialogue.source, 0
                continue
            known, number = source.changed <= number, source.number
            self._drawn.clear()
            await self._line.send(still(frame) if known else frame)
            for data in self._dialogue.with_frame():
                await self._line.send(data)
            await self._drawn.wait()

    async def _next_frame(self, source: FrameSource, number: int) -> bytes:
        """The next frame of a source; any, if the page looks elsewhere meanwhile."""
        turned = self._dialogue.turned
        waits = [asyncio.ensure_future(source.frame_after(number)), asyncio.ensure_future(turned.wait())]
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for wait in waits:
                wait.cancel()
        turned.clear()
        return source.frame

    async def _send_news(self) -> None:
        while True:
            for data in self._dialogue.news():
                await self._line.send(data)
            await asyncio.sleep(NEWS_PERIOD)
