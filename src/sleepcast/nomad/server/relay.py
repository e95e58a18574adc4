"""A relay to a real robot: it passes a client's requests to another server, and the replies back.

The other server takes this one for one more program. What it is asked waits its turn, one request at a time, as the
wire wants it; only to stop the robot does not wait. A real robot that loses its client is stopped.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from functools import partial

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.nomad.wire.encoding import HEADER, Layout, decode, encode_request
from sleepcast.nomad.wire.requests import RequestType

CONNECT_SECONDS = 10.0
"""For the other server to answer at first."""
ANSWER_SECONDS = 600.0
"""For any other answer: twice the longest that a request of the wire may take."""
MAX_WAITING = 64
"""Requests that wait to be sent; a client has one under way, so more are a mistake."""
REAL_TIMEOUT = 10
"""Whole seconds without a request after which a real robot stops, unless its client wants another number: so it stops
even if this computer dies. 0, never, is not to be had."""
FAREWELL_SECONDS = 2.0
"""For the other server to take the last words."""

Ask = Callable[[int, Sequence[int]], Awaitable[tuple[int, Sequence[int]]]]
"""Sends a request, and gives type and words of its reply."""


@dataclass(frozen=True, slots=True)
class RealAddress:
    """Where a real robot is: `nomad://host:port#number`."""

    host: str
    port: int
    number: int

    def __str__(self) -> str:
        return f"nomad://{self.host}:{self.port}#{self.number}"


@dataclass(slots=True)
class Pending:
    """A request on its way, and its reply once that has come: type and words."""

    kind: int
    words: Sequence[int]
    reply: tuple[int, Sequence[int]] | None = None


class Relay:
    """See the module.

    mask: words of `ct` that the client has sent.
    timeout: the last of its `conf_tm`.
    nudge: called whenever an answer has come.
    broken: why nothing can be asked any more, "" while all is well.
    """

    def __init__(
        self,
        robot: RealAddress,
        mask: Sequence[int],
        timeout: int,
        nudge: Callable[[], None],
        say: Callable[[str], None],
    ) -> None:
        self.robot, self.broken = robot, ""
        self._nudge, self._say = nudge, say
        self._closed = self._busy = False
        self._asked: asyncio.Queue[Pending | None] = asyncio.Queue(MAX_WAITING)
        self.ask(RequestType.CT, mask)
        self.ask(RequestType.CONF_TM, (timeout,))
        self._task = asyncio.get_running_loop().create_task(self._connected(self._converse))
        self._tasks = {self._task}

    def ask(self, kind: int, words: Sequence[int]) -> Pending:
        """Send a request when its turn comes."""
        if kind == RequestType.CONF_TM and words[0] <= 0:
            words = (REAL_TIMEOUT,)
        pending = Pending(kind, words)
        if not self.broken:
            try:
                self._asked.put_nowait(pending)
            except asyncio.QueueFull:
                self._break("it does not answer")
        return pending

    def stop(self) -> None:
        """Stop the robot now, whatever it is asked: the reply to that may be long in coming, as to `ws`."""
        self._tasks.add(asyncio.get_running_loop().create_task(self._connected(self._stop)))

    def close(self) -> None:
        """Stop the robot and let it go, unless that was done before."""
        if self._closed:
            return
        self._closed = True
        if self._busy or not self._asked.empty():
            self._task.cancel()
            self.stop()
        else:
            self._asked.put_nowait(None)

    async def gone(self) -> None:
        """Wait, not for long, until the robot is let go."""
        await asyncio.wait(self._tasks, timeout=2 * FAREWELL_SECONDS)

    async def _converse(self, ask: Ask) -> None:
        """Ask what the client asks, one after the other."""
        while (pending := await self._asked.get()) is not None:
            self._busy = True
            async with asyncio.timeout(ANSWER_SECONDS):
                pending.reply = await ask(pending.kind, pending.words)
            self._busy = False
            self._nudge()
        await self._stop(ask)

    async def _stop(self, ask: Ask) -> None:
        async with asyncio.timeout(FAREWELL_SECONDS):
            await ask(RequestType.ST, ())

    async def _connected(self, talk: Callable[[Ask], Awaitable[None]]) -> None:
        """Talk to the robot on a connection of its own; what goes wrong with that breaks the relay."""
        writer: asyncio.StreamWriter | None = None
        me = (self.robot.number, os.getpid())
        try:
            async with asyncio.timeout(CONNECT_SECONDS):
                reader, writer = await asyncio.open_connection(self.robot.host, self.robot.port)
                ask = partial(_ask, reader, writer)
                _, accepted = await ask(RequestType.CONNECT_ROBOT, me)
            if not (accepted and accepted[0]):
                self._break(f"it has no robot {self.robot.number}")
                return
            await talk(ask)
            writer.write(encode_request(Layout.FOUR, RequestType.DISCONNECT_ROBOT, me))
        except TimeoutError:
            self._break("it does not answer in time")
        except (OSError, asyncio.IncompleteReadError) as error:
            self._break(f"the connection is lost ({getattr(error, 'strerror', None) or 'it has ended'})")
        finally:
            if writer is not None:
                writer.close()
                with suppress(OSError):
                    await writer.wait_closed()

    def _break(self, why: str) -> None:
        self.broken = why
        self._say(f"the real robot at {self.robot} does not obey: {why}")
        self._nudge()


async def _ask(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, kind: int, words: Sequence[int]
) -> tuple[int, Sequence[int]]:
    writer.write(encode_request(Layout.FOUR, kind, words))
    answered, size = HEADER.unpack(await reader.readexactly(HEADER.size))
    return answered, decode(await reader.readexactly(4 * size))


def real_robot(text: str) -> RealAddress:
    """`nomad://HOST:PORT#NUMBER` as where a robot is. Raises MisuseError."""
    from urllib.parse import urlsplit

    try:
        parts = urlsplit(text)
        host, port, number = parts.hostname, parts.port, int(parts.fragment or "1")
    except ValueError:
        host, port, number = None, None, 0
    if host is None or port is None or parts.scheme != "nomad" or number < 1:
        raise MisuseError(f"wanted a robot such as nomad://scout.local:7019#1, not {text!r}")
    return RealAddress(host, port, number)
