"""The terminal desk's screen: panes, prompt and keys round a `TuiSession`, and the loop that keeps it alive.

    title       who is at the desk, on which channel
    safety      whether STOP holds, always in the second line
    robots      | commands, and what became of them
                | reports
    prompt      addressees, command type, the text
    hint        who would obey, or what is wrong, with carets
    keys

One thread does everything: the channel is heard and keys are obeyed in turns, so STOP waits for nothing but a turn.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Callable
from typing import TYPE_CHECKING

from prompt_toolkit.application import Application, get_app
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.buffer import Buffer
from prompt_toolkit.filters import Condition, has_completions
from prompt_toolkit.formatted_text import OneStyleAndTextTuple, StyleAndTextTuples
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.layout import (
    BufferControl,
    CompletionsMenu,
    ConditionalContainer,
    Dimension,
    Float,
    FloatContainer,
    HSplit,
    Layout,
    UIContent,
    UIControl,
    VSplit,
    Window,
)
from prompt_toolkit.layout.processors import BeforeInput, HighlightMatchingBracketProcessor
from prompt_toolkit.styles import Style
from prompt_toolkit.utils import get_cwidth

from sleepcast.cli.prompt import WORD, history
from sleepcast.cli.streams import still_open
from sleepcast.cli.tui import panes as panes
from sleepcast.cli.tui.commands import CommandType
from sleepcast.cli.tui.completion import SessionNames
from sleepcast.cli.tui.session import TuiSession
from sleepcast.core.tasks import wait_at_most
from sleepcast.core.time_of_day import time_of_day

if TYPE_CHECKING:
    from sleepcast.cli.tui.panes import Line

REDRAW = 0.25
"""Seconds after which the screen is drawn anew where nothing has come: ages grow."""
MAX_PROMPT = 4
"""Lines of a prompt that are seen at once."""
LOW = 16
"""Lines of a terminal below which the reports make room."""
NARROW = 60
"""Columns below which the robots make room."""

STYLE = Style.from_dict(
    {
        # Attributes and the terminal's own colours only: both light and dark terminals keep them readable.
        "title": "reverse",
        "keys": "reverse",
        "head": "bold underline",
        "stop": "bold reverse ansired",
        "stopped": "bold",
        "warned": "bold",
        "wrong": "bold ansired",
        "said": "bold",
        "when": "",
        "bottom-toolbar": "reverse",
    }
)


class Pane(UIControl):
    """Lines that are made for the room there is."""

    def __init__(self, lines: Callable[[int, int], list[Line]]) -> None:
        self._lines = lines

    def create_content(self, width: int, height: int) -> UIContent:
        """The lines for a window of so many columns and lines."""
        lines = self._lines(width, height)

        def line(number: int) -> StyleAndTextTuples:
            return list(lines[number])

        return UIContent(get_line=line, line_count=len(lines), show_cursor=False)


class Screen:
    """See the module. channel: its address, to be shown."""

    def __init__(self, session: TuiSession, channel: str) -> None:
        self.session, self._channel = session, channel
        self._scrolled = 0
        self._prompt = Buffer(
            name="prompt",
            completer=SessionNames(session),
            complete_while_typing=True,
            history=history(),
            auto_suggest=AutoSuggestFromHistory(),
            multiline=Condition(lambda: still_open(self._prompt.text) > 0),
            accept_handler=self._accept,
            on_text_changed=lambda _: session.hush(),
        )
        self._app: Application[None] = Application(
            layout=Layout(self._container(), focused_element=self._prompt),
            key_bindings=self._keys(),
            style=STYLE,
            full_screen=True,
            mouse_support=False,
        )

    async def run(self) -> None:
        """Until the person leaves. Raises KeyboardInterrupt for Ctrl-C, and for a signal that ends the process."""
        loop = asyncio.get_running_loop()
        transport = self.session.station.session.transport.fileno()
        heard = asyncio.Event()
        loop.add_reader(transport, heard.set)
        with contextlib.suppress(NotImplementedError, RuntimeError):
            loop.add_signal_handler(signal.SIGTERM, self._interrupt)

        def begin() -> None:
            self._app.create_background_task(self._live(heard))

        try:
            await self._app.run_async(pre_run=begin)
        finally:
            loop.remove_reader(transport)

    async def _live(self, heard: asyncio.Event) -> None:
        """Hear the channel, and show what has changed, until the desk is left."""
        try:
            while not (self.session.leaving or self._app.is_done):
                self.session.tick()
                self._app.invalidate()
                await wait_at_most(heard, min(REDRAW, max(0.0, self.session.due())))
                heard.clear()
                await asyncio.sleep(0.0)  # a flood of datagrams must not keep a key waiting
        except Exception as error:
            self._end(error)  # a fault of ours: it is printed on the plain screen, where it can be read

    # ---- keys

    def _accept(self, buffer: Buffer) -> bool:
        """Enter; gives whether the text stays."""
        stays = not self.session.enter(buffer.text)
        self._leave()
        return stays

    def _leave(self) -> None:
        if self.session.leaving:
            self._end()

    def _interrupt(self) -> None:
        self._end(KeyboardInterrupt())

    def _end(self, error: BaseException | None = None) -> None:
        """End the application, once: with an error, or in peace."""
        if self._app.is_done:
            return
        if error is None:
            self._app.exit()
        else:
            self._app.exit(exception=error)

    def _keys(self) -> KeyBindings:
        keys, session = KeyBindings(), self.session
        reading = Condition(lambda: bool(session.page))
        empty = Condition(lambda: not self._prompt.text)
        between = Condition(lambda: not WORD.search(self._prompt.document.text_before_cursor))

        @keys.add("f9", eager=True)
        @keys.add("c-x", eager=True)
        def stop(_: KeyPressEvent) -> None:
            session.stop()

        @keys.add("f7", eager=True)
        def release(_: KeyPressEvent) -> None:
            self._prompt.cancel_completion()
            session.release()

        @keys.add("f1")
        def help_(_: KeyPressEvent) -> None:
            self._scrolled = 0
            session.help()

        @keys.add("f3")
        def command_type(_: KeyPressEvent) -> None:
            session.next_type()

        @keys.add("f4")
        def order(_: KeyPressEvent) -> None:
            session.by_age = not session.by_age

        @keys.add("escape", filter=reading)
        @keys.add("enter", filter=reading & empty, eager=True)
        def close(_: KeyPressEvent) -> None:
            session.page = []

        @keys.add("tab", filter=empty & ~has_completions)
        @keys.add("s-tab", filter=~has_completions)
        def to_whom(_: KeyPressEvent) -> None:
            session.next_addressee()

        @keys.add("tab", filter=~empty & ~between & ~has_completions)
        def complete(_: KeyPressEvent) -> None:
            self._prompt.start_completion(insert_common_part=True)

        @keys.add("tab", filter=has_completions)
        def next_one(_: KeyPressEvent) -> None:
            self._prompt.complete_next()

        @keys.add("pageup")
        def up(_: KeyPressEvent) -> None:
            self._scrolled = max(0, self._scrolled - self._page())

        @keys.add("pagedown")
        def down(_: KeyPressEvent) -> None:
            self._scrolled += self._page()

        @keys.add("c-c", filter=~empty, eager=True)
        def drop(_: KeyPressEvent) -> None:
            self._prompt.reset()

        @keys.add("c-c", filter=empty, eager=True)
        def interrupt(_: KeyPressEvent) -> None:
            session.leave()
            if session.leaving:
                self._interrupt()

        @keys.add("c-q", eager=True)
        @keys.add("c-d", filter=empty, eager=True)
        def leave(_: KeyPressEvent) -> None:
            session.leave()
            self._leave()

        return keys

    def _page(self) -> int:
        return max(1, get_app().output.get_size().rows // 2)

    # ---- layout

    def _container(self) -> FloatContainer:
        session = self.session
        low = Condition(lambda: get_app().output.get_size().rows < LOW)
        narrow = Condition(lambda: get_app().output.get_size().columns < NARROW)
        reading = Condition(lambda: bool(session.page))
        troubled = Condition(lambda: bool(session.station.trouble))
        noticed = Condition(lambda: bool(session.station.notices()))
        robots = _headed(lambda: panes.robots_title(session), Pane(self._robots), Dimension(weight=3))
        sent = _headed(lambda: "Commands", Pane(lambda w, h: panes.commands(session, w, h)), Dimension(weight=5))
        reports = _headed(lambda: "Reports", Pane(lambda w, h: panes.reports(session, w, h)), Dimension(weight=5))
        right = HSplit([sent, ConditionalContainer(reports, ~low)], width=Dimension(weight=5))
        beside = VSplit(
            [ConditionalContainer(robots, ~narrow), ConditionalContainer(_rule(), ~narrow), right],
            height=Dimension(min=2),
        )
        page = _headed(lambda: "Esc closes this page, PageDown goes on in it", Pane(self._read), Dimension(weight=1))
        body = HSplit(
            [
                _one_line(lambda w: panes.title(session, w, self._channel)),
                _one_line(lambda w: panes.safety(session, w)),
                ConditionalContainer(beside, ~reading),
                ConditionalContainer(page, reading),
                self._typed(),
                Window(Pane(self._hint), height=Dimension(min=1, preferred=3, max=4), dont_extend_height=True),
                ConditionalContainer(_one_line(lambda w: panes.trouble(session, w)), troubled),
                ConditionalContainer(_one_line(lambda w: panes.notice(session, w)), noticed),
                _one_line(panes.keys),
            ]
        )
        menu = Float(CompletionsMenu(max_height=8, scroll_offset=1), xcursor=True, ycursor=True)
        return FloatContainer(body, [menu])

    def _typed(self) -> Window:
        control = BufferControl(
            self._prompt,
            input_processors=[
                BeforeInput(lambda: list[OneStyleAndTextTuple](self._before())),
                HighlightMatchingBracketProcessor(chars="()"),
            ],
        )
        return Window(control, height=Dimension(min=1, max=MAX_PROMPT), wrap_lines=True, dont_extend_height=True)

    def _before(self) -> list[tuple[str, str]]:
        session = self.session
        if session.pending is not None:
            return [("class:head", "how many? ")]
        type_ = "" if session.type is CommandType.ONCE else f" {session.type.upper()}"
        at = "" if session.at is None else f" AT {time_of_day(session.at)}"
        return [("bold", f"{panes.clipped(session.to.label or 'sleep', NARROW // 3)}{type_}{at}> ")]

    def _robots(self, width: int, height: int) -> list[Line]:
        self._scrolled = max(0, min(self._scrolled, len(self.session.station.roster) - height))
        return panes.robots(self.session, width, height, self._scrolled)

    def _read(self, width: int, height: int) -> list[Line]:
        self._scrolled = max(0, min(self._scrolled, len(self.session.page) - height))
        lines = self.session.page[self._scrolled : self._scrolled + height]
        return [[("", panes.clipped(line, width))] for line in lines]

    def _hint(self, width: int, height: int) -> list[Line]:
        indent = sum(get_cwidth(text) for _, text in self._before())
        return panes.hint(self.session, self._prompt.text, width, height, indent)


def _one_line(line: Callable[[int], Line]) -> Window:
    return Window(Pane(lambda width, height: [line(width)]), height=1)


def _headed(head: Callable[[], str], pane: Pane, weight: Dimension) -> HSplit:
    """A pane under its name."""
    name = _one_line(lambda width: [("class:head", panes.clipped(head(), width))])
    return HSplit([name, Window(pane)], width=weight)


def _rule() -> Window:
    return Window(width=1, char="│")
