"""The WebSocket of one page: it limits the rate of messages, and sends.

Whatever page is served, it is read in the same way: what is no message is refused with a sentence, what comes too fast
is not read, and a peer that keeps on breaking the rules is not served any more. Urgent messages pass in any case:
STOP, and that a picture was drawn, without which no other picture would ever go out.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Generic, TypeVar

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from sleepcast.channel.admission import TokenBucket
from sleepcast.console import incoming
from sleepcast.console.outgoing import Alive, Refused
from sleepcast.core.clock import Clock

MESSAGES_PER_SECOND = 120.0
"""Of one page, over a longer time: thirty frames drawn, and the fastest typing many times over."""
MESSAGES_AT_ONCE = 240.0
"""A page may save up this many, for a burst after a pause."""
MAX_DROPPED = 2_000
"""Messages beyond the rate after which a page is not served any more."""
MAX_MALFORMED = 200
"""Messages that are none, after which a page is not served any more."""
TOO_MUCH = 1008
"""The WebSocket close code for a peer that breaks the rules."""
BEAT = 2.0
"""Seconds between two words to a page that there is nothing new: it takes a longer silence for a loss of the line."""

M = TypeVar("M", bound=incoming.PageMessage)

encode = msgspec.json.Encoder().encode


class PageConnection(Generic[M]):
    """One page's socket.

    decode: gives a message or raises PageMessageError
    urgent: messages that nothing may hold up
    """

    def __init__(
        self, socket: WebSocket, decode: Callable[[str | bytes], M], urgent: tuple[type[M], ...], clock: Clock
    ) -> None:
        self._socket, self._decode, self._urgent, self._clock = socket, decode, urgent, clock
        self._allowance = TokenBucket(MESSAGES_PER_SECOND, MESSAGES_AT_ONCE, clock.now())
        self._dropped = self._malformed = 0
        self._gone = False

    async def read(self, take: Callable[[M], Awaitable[None]]) -> None:
        """Hand every message to `take` until the page goes away or breaks the rules."""
        while True:
            event = await self._socket.receive()
            if event["type"] == "websocket.disconnect":
                self._gone = True
                return
            await self._take(event.get("text") or event.get("bytes") or b"", take)
            if self._dropped > MAX_DROPPED or self._malformed > MAX_MALFORMED:
                self._gone = True
                with suppress(WebSocketDisconnect):
                    await self._socket.close(TOO_MUCH, "too many messages that are not this page's")
                return

    async def _take(self, data: str | bytes, take: Callable[[M], Awaitable[None]]) -> None:
        try:
            message = self._decode(data)
        except incoming.PageMessageError as error:
            self._malformed += 1
            await self.say(Refused(str(error), incoming.serial_in(data)))
            return
        if isinstance(message, self._urgent):
            await take(message)
            return
        if self._allowance.left(self._clock.now()) >= 1.0:
            self._allowance.spend(1.0)
            await take(message)
            return
        self._dropped += 1
        serial = getattr(message, "serial", None)
        if serial is not None or self._dropped == 1:
            await self.say(Refused("too many messages at once; this one was not read", serial))

    async def beat(self) -> None:
        """Let the page know for ever that it is heard."""
        while True:
            await asyncio.sleep(BEAT)
            await self.say(Alive())

    async def say(self, message: msgspec.Struct | msgspec.Raw) -> None:
        """Tell the page, if it is still there."""
        await self.send(encode(message).decode())

    async def send(self, data: str | bytes) -> None:
        """Send the page text, or bytes for a picture, if it is still there."""
        if self._gone:
            return
        try:
            await (self._socket.send_text(data) if isinstance(data, str) else self._socket.send_bytes(data))
        except WebSocketDisconnect:
            self._gone = True
