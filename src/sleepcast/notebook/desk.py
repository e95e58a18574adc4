"""What lies behind the views of one fleet: they ask and command, and are shown what happens in cells, too.

Nothing here runs by itself. While time is to run, each view asks for a picture when it has drawn the one before, and
the ticks that are due are made then; so cells and views take turns on the kernel, and whatever they do is done to the
same fleet. What changes in a cell is shown when the cell has changed it (`changed`), a long run some times a second.
Messages may come on any thread: each takes a turn of the fleet.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

import msgspec

from sleepcast.console import incoming, registry
from sleepcast.console.backend import Backend
from sleepcast.console.connection import encode
from sleepcast.console.driver import FRAME_PERIOD
from sleepcast.console.features.mission import Play, SendLine, SkipLine
from sleepcast.console.features.send import Send
from sleepcast.console.features.time import SetPace, SingleStep
from sleepcast.console.features.watched import Watch
from sleepcast.console.outgoing import Refused
from sleepcast.console.session import NEWS_PERIOD
from sleepcast.console.swarm_dialogue import SwarmDialogue
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError

SLICE = 0.03
"""Seconds of ticks between two pictures: a cell that is run meanwhile waits no longer."""
BYTES_PER_SECOND = 400_000
"""Of pictures: Jupyter's servers drop what comes faster than a million."""
MAX_ROBOTS = 50_000
"""Robots of a fleet that can be viewed: their names and one picture are 700 kB each."""


class WidgetPort(Protocol):
    """What carries messages to the browser: the widget."""

    def tell(self, content: dict[str, object], picture: bytes | None = None) -> None:
        """Send this."""


class NotebookDesk:
    """See the module. Raises MisuseError for a fleet that is too large for a notebook.

    turn: a turn with the fleet, in which nobody else changes it.
    period: s between two pictures, at least.
    """

    def __init__(
        self,
        desk: Backend,
        clock: Clock,
        turn: Callable[[], AbstractContextManager[None]],
        period: float = FRAME_PERIOD,
    ) -> None:
        robots = len(desk.hello().scene.names)
        if robots > MAX_ROBOTS:
            raise MisuseError(
                f"{robots:,} robots are too many for a view in a notebook: at most {MAX_ROBOTS:,}; "
                "`sleepcast demo` shows more on its page"
            )
        desk.at_once = True
        self.desk, self.driver, self.clock, self.turn = desk, desk.driver, clock, turn
        self.views: list[DeskView] = []
        """Those that are open."""
        self._period, self._due = period, clock.now()

    def view(self, line: WidgetPort) -> DeskView:
        """Another view, which opens when its page has begun."""
        return DeskView(self, line)

    def changed(self, *, soon: bool = False) -> None:
        """Show all views what has changed, outside a turn. soon: there is more to come, so it may be left out."""
        now = self.clock.now()
        if not self.views or (soon and now < self._due):
            return
        with self.turn():
            self.show()
        self._due = now + self.pause()

    def show(self) -> None:
        """Show all views how things are, within a turn."""
        views = tuple(self.views)
        for view in views:
            view.tell_news()
        self.driver.draw()
        for view in views:
            view.show_picture(answer=False)

    def pause(self) -> float:
        """Seconds between two pictures."""
        return max(self._period, len(self.driver.frame) / BYTES_PER_SECOND)


class DeskView:
    """One widget, wherever and however often it is shown."""

    def __init__(self, desk: NotebookDesk, line: WidgetPort) -> None:
        self._desk, self._line = desk, line
        self._dialogue = SwarmDialogue(desk.desk)
        self._pages = 0
        self._shown = self._told = -1.0
        """When a picture was shown, and news were told."""

    def take(self, content: object) -> None:
        """A message of the widget's end in the browser, which may be anything."""
        try:
            match content:
                case {"open": True}:
                    with self._desk.turn():
                        self._open()
                case {"close": True}:
                    self._close()
                case {"say": str(text)}:
                    self._hear(text)
        except SleepcastError as error:  # the fleet is closed, say
            self._say(Refused(str(error)))

    def _open(self) -> None:
        self._pages += 1
        if self not in self._desk.views:
            self._desk.views.append(self)
        self._line.tell({"say": self._dialogue.hello()})
        self.tell_news()
        self._desk.driver.draw()
        self.show_picture(answer=False)

    def _close(self) -> None:
        self._pages -= 1
        if self._pages < 1 and self in self._desk.views:
            self._desk.views.remove(self)

    def _hear(self, text: str) -> None:
        if len(text) > incoming.MAX_BYTES:
            self._say(Refused(f"a message of {len(text):,} characters is too long: at most {incoming.MAX_BYTES:,}"))
            return
        try:
            message = registry.decode(text)
        except incoming.PageMessageError as error:
            self._say(Refused(str(error), incoming.serial_in(text)))
            return
        with self._desk.turn():
            if isinstance(message, incoming.Drawn):
                self._go_on()
                return
            answer = self._dialogue.answer(message)
            if isinstance(answer, msgspec.Struct):
                self._say(answer)
            if isinstance(message, CHANGING):
                self._desk.show()

    def _go_on(self) -> None:
        """Make the ticks that are due, and show where that leads. A second page of this widget that asks for what the
        first one has just been shown has been shown it, too."""
        desk, now = self._desk, self._desk.clock.now()
        if desk.driver.pace.paused or now - self._shown < 0.5 * desk.pause():
            return
        try:
            desk.driver.advance(SLICE)
        except SleepcastError as error:
            desk.driver.set_pace(running=False)
            self._say(Refused(f"Time stands still: {error}"))
        if now - self._told >= NEWS_PERIOD:
            self.tell_news()
        desk.driver.draw()
        self.show_picture(answer=True)

    # ---- what goes to the browser

    def tell_news(self) -> None:
        """Whatever the page does not know yet."""
        self._told = self._desk.clock.now()
        for news in self._dialogue.news():
            self._line.tell({"say": news})

    def show_picture(self, *, answer: bool) -> None:
        """The driver's latest picture. answer: whether it was asked for."""
        self._shown = self._desk.clock.now()
        wait = 1000.0 * self._desk.pause()
        self._line.tell({"wait": wait, "answer": answer}, self._desk.driver.frame)

    def _say(self, message: msgspec.Struct) -> None:
        self._line.tell({"say": encode(message).decode()})


CHANGING = (incoming.Stop, incoming.Release, SetPace, SingleStep, Send, Watch, Play, SendLine, SkipLine)
"""Messages after which there may be something new to see."""
