"""A session: one page that is open. It answers the page's messages and tells it the news.

Three tasks: one reads, one sends frames, one sends news (accounts, groups, the watched robot). A frame goes out only
when the page has drawn the one before, so a slow page skips frames; what it asks and commands never waits for them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from sleepcast.clock import Clock
from sleepcast.console import messages
from sleepcast.console.answers import Refused
from sleepcast.console.desk import Desk
from sleepcast.console.replay import ReplayDesk
from sleepcast.errors import SleepcastError

NEWS_PERIOD = 0.25
"""Seconds between two looks for news: people read no faster."""
MESSAGES_PER_SECOND = 120.0
"""Of one page, over a longer time: thirty frames drawn, and the fastest typing many times over."""
MESSAGES_AT_ONCE = 240.0
"""A page may save up this many, for a burst after a pause."""
MOST_DROPPED = 2_000
"""Messages beyond the rate after which a page is not served any more."""
MOST_MALFORMED = 200
"""Messages that are none, after which a page is not served any more."""
TOO_MUCH = 1008
"""The WebSocket close code for a peer that breaks the rules."""

_encode = msgspec.json.Encoder().encode


class Session:
    """One page; `run` lasts as long as it is open."""

    def __init__(self, socket: WebSocket, desk: Desk | ReplayDesk, clock: Clock) -> None:
        self._socket, self._desk, self._clock = socket, desk, clock
        self._watched = -1
        self._drawn = asyncio.Event()
        self._sent: dict[str, bytes] = {}
        self._allowance, self._counted_at = MESSAGES_AT_ONCE, clock.now()
        self._dropped = self._malformed = 0

    async def run(self) -> None:
        """Serve the page until it goes away or breaks the rules."""
        await self._say(self._desk.hello())
        others = [asyncio.create_task(self._send_frames()), asyncio.create_task(self._send_news())]
        try:
            await self._read()
        except WebSocketDisconnect:
            pass
        finally:
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)

    # ---- what comes in

    async def _read(self) -> None:
        while True:
            event = await self._socket.receive()
            if event["type"] == "websocket.disconnect":
                return
            data = event.get("text") or event.get("bytes") or b""
            await self._take(data)
            if self._dropped > MOST_DROPPED or self._malformed > MOST_MALFORMED:
                await self._socket.close(TOO_MUCH, "too many messages that are not this page's")
                return

    async def _take(self, data: str | bytes) -> None:
        try:
            message = messages.decode(data)
        except messages.MessageError as error:
            self._malformed += 1
            await self._say(Refused(str(error), messages.serial_in(data)))
            return
        if isinstance(message, messages.Stop):  # before anything that could hold it up
            self._desk.stop()
        elif not self._may_pass():
            self._dropped += 1
            serial = getattr(message, "serial", None)
            if serial is not None or self._dropped == 1:
                await self._say(Refused("too many messages at once; this one was not read", serial))
        else:
            await self._answer(message)

    def _may_pass(self) -> bool:
        """Whether one more message keeps within the page's rate."""
        now = self._clock.now()
        saved = self._allowance + (now - self._counted_at) * MESSAGES_PER_SECOND
        self._allowance, self._counted_at = min(saved, MESSAGES_AT_ONCE), now
        if self._allowance < 1.0:
            return False
        self._allowance -= 1.0
        return True

    async def _answer(self, message: messages.Incoming) -> None:
        desk = self._desk
        match message:
            case messages.Drawn():
                self._drawn.set()
            case messages.Watch(robot):
                self._watched = robot
                self._sent.pop("robot", None)
            case messages.Pace(running, factor):
                desk.driver.set_pace(running, factor)
            case messages.Seek(time):
                await self._seek(time)
            case messages.Step():
                desk.driver.step()
            case messages.Release():
                desk.release()
            case messages.Preview(serial, text):
                await self._reply(serial, lambda: desk.preview(serial, text))
            case messages.Send(serial, text, everybody, sort):
                await self._reply(serial, lambda: desk.send(serial, text, everybody, sort))
            case messages.Names(serial):
                await self._reply(serial, lambda: desk.names(serial))
            case messages.Why(serial, robot, command):
                await self._reply(serial, lambda: desk.why(serial, robot, command))
            case messages.Outcomes(serial, command):
                await self._reply(serial, lambda: desk.outcomes(serial, command))
            case messages.Commands(serial):
                await self._reply(serial, lambda: desk.commands(serial))

    async def _seek(self, time: float) -> None:
        try:
            self._desk.seek(time)
        except SleepcastError as error:
            await self._say(Refused(str(error)))

    async def _reply(self, serial: int, answer: Callable[[], msgspec.Struct]) -> None:
        try:
            said = answer()
        except SleepcastError as error:
            said = Refused(str(error), serial)
        await self._say(said)

    # ---- what goes out

    async def _say(self, message: msgspec.Struct) -> None:
        await self._socket.send_text(_encode(message).decode())

    async def _send_frames(self) -> None:
        number = 0
        while True:
            frame = await self._desk.driver.frame_after(number)
            number = self._desk.driver.number
            self._drawn.clear()
            await self._socket.send_bytes(frame)
            await self._drawn.wait()

    async def _send_news(self) -> None:
        while True:
            for message in self._desk.news(self._watched):
                data = _encode(message)
                kind = type(message).__name__
                if self._sent.get(kind) != data:
                    self._sent[kind] = data
                    await self._socket.send_text(data.decode())
            await asyncio.sleep(NEWS_PERIOD)
