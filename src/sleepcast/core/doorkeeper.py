"""How many connections a server keeps open of those who have not shown who they are, and for how long.

Whoever reaches a port can open connections and say nothing. So there is room for only so many strangers, far fewer than
a process may have files, and one more pushes out the one that has waited for longest: somebody who speaks at once is
always heard, and who does not, soon loses his place. Those who are known are no business of the keeper any more. When
the server ends, nobody is left at the door: see `stop_listening`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol

from sleepcast.core.clock import Clock

PAUSE = 60.0
"""Seconds between two sentences about connections that were closed."""
SPARE = 64
"""Files that a process has open besides connections: libraries, a journal, a recording."""
TURNS = 4
"""Turns of a loop in which all places may be taken: what has been sent is read in the turn after its connection was
taken, and until then it must not be pushed out."""
QUEUE = 1_024
"""Connections that wait in the system until they are taken: without room there, others try again after a second."""
FULL = "socket.accept() out of system resource"
"""What asyncio says when there is no file left for one more connection."""
LEAST = 16
"""Strangers at least, whatever the limit of files is."""
ARRIVAL = 4
"""Turns of a loop from the one in which the system hands a connection over to the first that its protocol does."""


class Abortable(Protocol):
    """What is kept open: a transport of asyncio."""

    def is_closing(self) -> bool:
        """Whether it is closed, or about to be."""

    def abort(self) -> None:
        """Close it at once."""


def room(most: int, share: int = 4) -> int:
    """For how many connections of one kind there is room: `most`, or less where the limit of files is low. share: one
    part in so many of what the process may have open."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return most
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return most if files == resource.RLIM_INFINITY else min(most, max(LEAST, (files - SPARE) // share))


class Doorkeeper:
    """See the module.

    most: connections at one time.
    patience: seconds for which one may keep its place without a sign of life.
    say: tells the person at the terminal, seldom.
    """

    def __init__(self, most: int, patience: float, clock: Clock, say: Callable[[str], None]) -> None:
        self._most, self._patience, self._clock, self._say = most, patience, clock, say
        self._since: dict[Abortable, float] = {}
        self._told = -PAUSE - 1.0
        self.turned_away = 0
        """Connections that lost their place to others."""

    def __len__(self) -> int:
        return len(self._since)

    def __contains__(self, connection: Abortable) -> bool:
        return connection in self._since

    def enter(self, connection: Abortable) -> None:
        """A new connection; the oldest one makes room for it."""
        if len(self._since) >= self._most:
            self._forget_closed()
        while len(self._since) >= self._most:
            oldest = next(iter(self._since))
            self._end(oldest)
            self.turned_away += 1
            self._tell()
        self._since[connection] = self._clock.now()

    def touch(self, connection: Abortable) -> None:
        """It has done something: its patience begins anew, and others have waited for longer."""
        if self._since.pop(connection, None) is not None:
            self._since[connection] = self._clock.now()

    def leave(self, connection: Abortable) -> None:
        """It is known now, or gone."""
        self._since.pop(connection, None)

    def sweep(self) -> None:
        """Close what has been silent for too long; called time and again."""
        self._forget_closed()
        latest = self._clock.now() - self._patience
        for connection in [each for each, since in self._since.items() if since < latest]:
            self._end(connection)

    def _forget_closed(self) -> None:
        for connection in [each for each in self._since if each.is_closing()]:
            del self._since[connection]

    def _end(self, connection: Abortable) -> None:
        del self._since[connection]
        connection.abort()

    def _tell(self) -> None:
        now = self._clock.now()
        if now - self._told > PAUSE:
            self._told = now
            self._say(
                "somebody opens many connections and does not say who he is: the oldest of these are closed, and all "
                "who are in already go on"
            )


def sentences_of(say: Callable[[str], None]) -> Callable[[asyncio.AbstractEventLoop, dict[str, Any]], None]:
    """A handler of a loop's errors that says once in words what would be thousands of tracebacks."""
    told = False

    def handle(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        nonlocal told
        if context.get("message") != FULL:
            loop.default_exception_handler(context)
        elif not told:
            told = True
            say("this process has no file left for one more connection: close programs, or raise the limit (ulimit -n)")

    return handle


async def stop_listening(servers: Sequence[asyncio.Server]) -> None:
    """Take no more connections, and close these servers once those that were just taken have their protocols, so that
    whoever then closes all connections closes these as well. If a server is closed earlier, asyncio forgets them open
    as they are, and their clients wait in vain."""
    loop = asyncio.get_running_loop()
    try:
        for listener in (each for server in servers for each in server.sockets):
            with suppress(NotImplementedError):  # the loop of Windows takes a connection in a single turn
                loop.remove_reader(listener)
        for _ in range(ARRIVAL):
            await asyncio.sleep(0)
    finally:
        for server in servers:
            server.close()
