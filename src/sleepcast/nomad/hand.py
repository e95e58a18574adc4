"""A person at the page, who commands a robot as a program would: a client without a socket."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.nomad.answers import take
from sleepcast.nomad.requests import Kind
from sleepcast.nomad.session import Refusal, Service, Session, Wait
from sleepcast.nomad.units import GREATEST_WORD, LEAST_WORD
from sleepcast.nomad.wire import CONNECTING, Parser, Request

NAMES = {kind.name.lower(): kind for kind in Kind if kind not in CONNECTING}
"""What can be asked, as the functions of the C library are called."""
PAGE = "the page"
"""What a person there is called among those who drive a robot."""


class Hand:
    """One robot's person. wait: the reply that is still to come. reply: the last. turn: one request at a time."""

    def __init__(self, service: Service, robot: int) -> None:
        self.wait: Wait | None = None
        self.reply = b""
        self.session = Session(service, PAGE, Parser(), self.look)
        self.session.robot, self.session.behaviour = robot, service.behaviours[robot]
        self.turn = asyncio.Lock()
        self._done = asyncio.Event()

    def ask(self, name: str, numbers: Sequence[int]) -> None:
        """Do what the request of this name does. `wait` is set if its reply is still to come. Raises MisuseError."""
        kind = NAMES.get(name)
        if kind is None:
            raise MisuseError(f"there is no request {name!r}{did_you_mean(name, NAMES)}")
        if not all(LEAST_WORD <= number <= GREATEST_WORD for number in numbers):
            raise MisuseError(f"{name}: each number must fit into 32 bits")
        try:
            answer = take(self.session, Request(kind, tuple(numbers), len(numbers)))
        except Refusal as refusal:
            raise MisuseError(refusal.text) from None
        if isinstance(answer, Wait):
            self.wait = answer
            self._done.clear()
        else:
            self.reply = answer or b""

    async def done(self) -> None:
        """Wait until what was asked is done."""
        if self.wait is not None:
            await self._done.wait()

    def look(self) -> None:
        """See whether it is done."""
        if self.wait is not None and (reply := self.wait.ready()) is not None:
            self.wait, self.reply = None, reply
            self._done.set()
