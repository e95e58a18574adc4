"""However many stand at the door of a page, who is in goes on, and who has the token comes in."""

from __future__ import annotations

import logging
import os
import resource
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from http.client import HTTPConnection
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, expect

from console.running import PATIENCE, Program, open_page
from sleepcast.console.lobby import KNOWN_PATIENCE, MAX_CONNECTIONS, Lobby
from sleepcast.console.server import QUIET
from sleepcast.core.clock import ManualClock
from small_worlds import write

FILES = 400
"""Files that the program may have open: fewer than strangers knock."""


@contextmanager
def few_files() -> Iterator[None]:
    """What is started meanwhile may open few files."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (FILES, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@contextmanager
def strangers(program: Program, count: int, say: bytes = b"") -> Iterator[None]:
    """So many connections that say no more than this, all of which the program has taken."""
    host, _, port = program.host.rpartition(":")
    with ExitStack() as lines:
        for _ in range(count):
            line = lines.enter_context(socket.create_connection((host, int(port)), PATIENCE))
            line.sendall(say)
        yield


def files_of(program: Program) -> int:
    return len(os.listdir(f"/proc/{program.process.pid}/fd"))


def asked(program: Program, path: str, count: int = 1) -> set[int]:
    """The statuses with which a path is answered, over one connection each."""
    found = set()
    for _ in range(count):
        with closing(HTTPConnection(program.host, timeout=PATIENCE)) as connection:
            connection.request("GET", path)
            found.add(connection.getresponse().status)
    return found


def test_half_open_connections_close_the_page_for_nobody(tmp_path: Path) -> None:
    write(tmp_path)
    with few_files():
        program = Program("run", tmp_path, "--page")
    with program, open_page(program) as before:
        before.frame()
        for say in (b"", b"GET / HTTP/1.1\r\nHost: x\r\nX-Slow: "):
            with strangers(program, FILES + 100, say):
                assert asked(program, f"/?token={program.token}", 3) == {200}
                assert asked(program, "/static/main.js") == {200}
                before.frame()
                with open_page(program) as late:
                    late.frame()
                assert files_of(program) < FILES / 2
        program.end()
    said = program.said.splitlines()
    assert sum("many connections" in line for line in said) == 1
    assert not [line for line in said if "Traceback" in line or "socket" in line]


def test_a_write_to_somebody_who_is_gone_is_no_line_at_the_terminal() -> None:
    def told(text: str) -> bool:
        return QUIET.filter(logging.LogRecord("asyncio", logging.WARNING, "", 0, text, (), None))

    assert told("Executing a task took 1 s")
    assert not told("socket.send() raised exception.")


def test_places_are_those_of_the_oldest_of_the_same_sort() -> None:
    class Line:
        gone = False

        def is_closing(self) -> bool:
            return self.gone

        def abort(self) -> None:
            self.gone = True

    clock = ManualClock()
    lobby = Lobby(clock, lambda _: None)
    pages, known, unknown = ([Line() for _ in range(count)] for count in (16, 2 * MAX_CONNECTIONS, 2 * MAX_CONNECTIONS))
    for each in (*pages, *known):
        lobby.strangers.enter(each)
        lobby.know(each)  # type: ignore[arg-type]  # as much of a transport as is needed
        if each in pages:
            lobby.leave(each)  # type: ignore[arg-type]  # as above
    for each in unknown:
        lobby.strangers.enter(each)
    assert sum(each.gone for each in known) == sum(each.gone for each in unknown) == MAX_CONNECTIONS
    clock.advance(KNOWN_PATIENCE + 1.0)
    lobby.strangers.sweep()
    lobby.known.sweep()
    assert all(each.gone for each in (*known, *unknown))
    assert not any(each.gone for each in pages)


@pytest.mark.browser
def test_a_browser_loads_the_whole_page_while_strangers_come_and_go(tmp_path: Path, context: BrowserContext) -> None:
    """All its files, over connections that strangers do not push out."""
    write(tmp_path)
    over = threading.Event()
    with Program("run", tmp_path, "--page") as program:
        host, _, port = program.host.rpartition(":")

        def knock() -> None:
            while not over.is_set():
                lines = [socket.socket() for _ in range(40)]
                for line in lines:
                    line.setblocking(False)
                    line.connect_ex((host, int(port)))
                time.sleep(0.01)
                for line in lines:
                    line.close()

        knocking = threading.Thread(target=knock)
        knocking.start()
        try:
            page = context.new_page()
            page.goto(program.address)
            expect(page.locator("#title")).not_to_be_empty()
        finally:
            over.set()
            knocking.join()


@pytest.mark.browser
def test_the_token_leaves_the_address_and_the_page_can_be_loaded_again(tmp_path: Path, context: BrowserContext) -> None:
    write(tmp_path)
    with Program("run", tmp_path, "--page") as program:
        page = context.new_page()
        page.goto(f"{program.address}#view=5,5,3")
        title = page.locator("#title")
        expect(title).not_to_be_empty()
        page.wait_for_url(lambda url: "token" not in url and "view=" in url)
        page.reload()
        expect(title).not_to_be_empty()
        page.wait_for_url(lambda url: "token" not in url and "view=" in url)
        other = context.new_page()  # a bookmark, or an address that was copied
        other.goto(f"http://{program.host}/")
        expect(other.locator("#title")).not_to_be_empty()
        assert "token" not in other.url
        for path in ("/?token=wrong", "/"):  # that of an earlier start is forgotten
            other.goto(f"http://{program.host}{path}")
            expect(other.get_by_text("the address lacks the right token").first).to_be_visible()
        other.emulate_media(color_scheme="dark")
        expect(other.locator("p")).to_have_css("color", "rgb(255, 255, 255)")
        page.evaluate("localStorage.setItem('sleepcast.token', 'of an earlier start')")
        page.goto(f"http://{program.host}/")
        expect(page.get_by_text("the address lacks the right token").first).to_be_visible()
