"""What an open page and its desk say to each other, whatever carries it: a WebSocket, or a notebook's messages.

One set of messages serves all pages, and what any robots have is answered here. `swarm_dialogue` adds what robots with
minds of their own are told and asked, `nomads/dialogue` what Nomads are.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Iterable, Iterator, Sequence
from typing import Generic, Protocol, TypeAlias, TypeVar

import msgspec

from sleepcast.console import incoming, outgoing
from sleepcast.console.connection import encode
from sleepcast.console.driver import FrameSource
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.station.validation import CountNeededError, DoubtError

Answer: TypeAlias = msgspec.Struct | msgspec.Raw | None


class PacedSource(Protocol):
    """Frames of something whose time can be governed; see `Driver`."""

    @property
    def frame(self) -> bytes: ...

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None: ...

    def step(self) -> None: ...


class PageDesk(Protocol):
    """What any page can ask. All raise SleepcastError for what cannot be done, with a sentence for who asked."""

    @property
    def driver(self) -> PacedSource: ...

    def hello(self) -> outgoing.Hello: ...

    def news(self, watched: int) -> Iterable[outgoing.Said]: ...

    async def live(self) -> None: ...

    def stop(self) -> None: ...

    def release(self) -> None: ...

    def build(self, serial: int, corners: Sequence[tuple[float, float]]) -> outgoing.Built: ...

    def shift(self, serial: int, version: int, place: int, across: float, up: float) -> outgoing.Built: ...

    def clear(self, serial: int, version: int, place: int) -> outgoing.Built: ...

    def undo(self, serial: int, change: int, again: bool) -> outgoing.Undone: ...

    def sense(self, serial: int, robot: int) -> outgoing.Sensed: ...


D = TypeVar("D", bound=PageDesk)


class Dialogue(ABC, Generic[D]):
    """One page's part: its questions, and what it has been told already. turned: set when it looks at another time.
    most_waiting: answers that may be waited for at one time; of more, some are given up."""

    most_waiting: int

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

    def answer(self, message: incoming.Incoming) -> Answer | Awaitable[Answer]:
        """Do what a message asks for; gives the answer or the refusal, None where there is nothing to say."""
        serial: int | None = getattr(message, "serial", None)
        try:
            return self._answer(message)
        except SleepcastError as error:
            return refusal(error, serial)

    def _answer(self, message: incoming.Incoming) -> Answer | Awaitable[Answer]:
        desk = self._desk
        match message:
            case incoming.Stop():
                desk.stop()
            case incoming.Release():
                desk.release()
            case incoming.SetPace(running, factor):
                desk.driver.set_pace(running, factor)
            case incoming.SingleStep():
                desk.driver.step()
            case incoming.Watch(robot):
                self._watched = robot
                self._sent.pop(outgoing.WatchedRobot.__name__, None)  # the page has forgotten what it was sent of it
            case incoming.Build(serial, corners):
                return desk.build(serial, corners)
            case incoming.Shift(serial, version, place, across, up):
                return desk.shift(serial, version, place, across, up)
            case incoming.Clear(serial, version, place):
                return desk.clear(serial, version, place)
            case incoming.Undo(serial, change, again):
                return desk.undo(serial, change, again)
            case incoming.Sense(serial, robot):
                return desk.sense(serial, robot)
            case _:
                raise MisuseError("This is not supported for these robots.")
        return None

    def leave(self) -> None:
        """The page goes away."""

    def beside(self) -> Iterator[str | bytes]:
        """What goes out with a frame."""
        return iter(())

    def _news(self) -> Iterable[outgoing.Said]:
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
