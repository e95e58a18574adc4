"""What an open page and its desk say to each other, whatever carries it: a WebSocket, or a notebook's messages.

STOP and RELEASE go to the desk at once; every question goes to `registry`, which knows who answers it. What one page
has for itself is here: what it was told already and the robot that it looks at. `swarm_dialogue` adds the time at which
it looks and its table; packages add what pages of theirs have.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from typing import Generic, Protocol, TypeVar

from sleepcast.console import outgoing, registry
from sleepcast.console.connection import encode
from sleepcast.console.driver import FrameSource
from sleepcast.console.feature import Reply, Then
from sleepcast.console.incoming import PageMessage, Release, Stop
from sleepcast.console.registry import Source
from sleepcast.core.errors import SleepcastError
from sleepcast.station.validation import CountNeededError, DoubtError


class PageDesk(Source, Protocol):
    """What lies behind any page. What it can be asked besides is told by the protocols of the features."""

    def hello(self) -> outgoing.Hello: ...

    def news(self, watched: int) -> Iterable[outgoing.DeskMessage]: ...

    async def live(self) -> None: ...

    def stop(self, by: str = "") -> None: ...

    def release(self, by: str = "") -> None: ...


D = TypeVar("D", bound=PageDesk)


class Dialogue(ABC, Generic[D]):
    """One page's part: its questions, and what it has been told already.

    turned: set when it looks at another time
    max_waiting: answers that may be waited for at one time; of more, some are given up
    """

    max_waiting: int

    def __init__(self, desk: D) -> None:
        self._desk = desk
        self._watched = -1
        self._sent: dict[str, bytes] = {}
        self.turned = asyncio.Event()

    @property
    @abstractmethod
    def source(self) -> FrameSource:
        """Where this page's frames come from."""

    def hello(self) -> str:
        """The first words to a page, which knows nothing yet."""
        hello = self._desk.hello()
        data = encode(hello)
        self._watched, self._sent = -1, {type(hello).__name__: data}
        return data.decode()

    def answer(self, message: PageMessage) -> Reply:
        """Do what a message asks for; gives the answer or the refusal, None where there is nothing to say."""
        serial: int | None = getattr(message, "serial", None)
        try:
            if isinstance(message, Stop):
                self._desk.stop(message.by)
                return None
            if isinstance(message, Release):
                self._desk.release(message.by)
                return None
            return registry.answer(message, self._desk, self, self._then)
        except SleepcastError as error:
            return refusal(error, serial)

    @property
    def _then(self) -> Then | None:
        """Another time than now, at which the page looks."""
        return None

    def watch(self, robot: int) -> None:
        """Look at a robot; -1: at none. The page has forgotten what it was sent of it."""
        self._watched = robot
        self._sent.pop(outgoing.WatchedRobot.__name__, None)

    def leave(self) -> None:
        """The page goes away."""

    def with_frame(self) -> Iterator[str | bytes]:
        """What goes out with a frame."""
        return iter(())

    def _news(self) -> Iterable[outgoing.DeskMessage]:
        return self._desk.news(self._watched)

    def news(self) -> Iterator[str]:
        """What has changed since the page was last told."""
        for message in self._news():
            data = encode(message)
            kind = type(message).__name__
            if self._sent.get(kind) != data:
                self._sent[kind] = data
                yield data.decode()


def refusal(error: SleepcastError, serial: int | None = None) -> outgoing.Refused:
    """What a page is told that asked for what cannot be done, or must be confirmed first."""
    if isinstance(error, CountNeededError):
        why = error.why[:1].upper() + error.why[1:]
        return outgoing.Refused(f"{why}: {error.may} may obey. Type their number to send it.", serial, True)
    if isinstance(error, DoubtError):
        again = "Press Enter once more to send it as it stands."
        return outgoing.Refused(f"{error.shown}\n{again}", serial, doubt=True)
    return outgoing.Refused(str(error), serial)
