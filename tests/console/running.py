"""The real program with its page, started as a person starts it, and a page's end of its WebSocket."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any
from urllib.parse import urlsplit

from websockets.sync.client import ClientConnection, connect

import forkserver

PATIENCE = 120.0
"""Seconds that a busy machine may take for what a person sees at once."""


class Program:
    """`sleepcast` with `arguments` and any free port; `with` stops it as Ctrl-C does. waits: whether the time of a
    simulated swarm waits for somebody to start it. changes: of the environment."""

    def __init__(self, *arguments: str | Path, waits: bool = False, **changes: str) -> None:
        running = ["--run"] * (arguments[0] in ("demo", "run") and not waits)
        command = [sys.executable, "-m", "sleepcast", *arguments, *running, "--no-browser", "--port", "0"]
        self.process = forkserver.Popen(
            command, env={**os.environ, **changes}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.said = ""
        assert self.process.stdout is not None
        watchdog = threading.Timer(PATIENCE, self.process.kill)
        watchdog.start()
        while not (found := re.search(r"http://\S+", self.said)):
            line = self.process.stdout.readline()
            assert line, f"no address was printed, only: {self.said}"
            self.said += line
        watchdog.cancel()
        self.address = found[0]

    @property
    def host(self) -> str:
        return urlsplit(self.address).netloc

    @property
    def token(self) -> str:
        return urlsplit(self.address).query.removeprefix("token=")

    def end(self) -> int:
        """Press Ctrl-C; gives the exit status. What it printed is in `said`."""
        return self.wait(signal.SIGINT)

    def wait(self, sign: signal.Signals) -> int:
        """Send a signal and read what is said until the end; gives the exit status."""
        assert self.process.stdout is not None
        watchdog = threading.Timer(PATIENCE, self.process.kill)
        watchdog.start()
        self.process.send_signal(sign)
        with self.process.stdout as output:
            self.said += output.read()
        watchdog.cancel()
        return self.process.wait(PATIENCE)

    def __enter__(self) -> Program:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self.process.returncode is None:
            self.end()


@dataclass
class Page:
    """A page's end of the WebSocket, in a test's hands. news: the latest message of each type; frames: all of them,
    with the robots that short ones leave out; sizes: as they came; drawn: how many of these `frame` has drawn."""

    socket: ClientConnection
    serial: int = 0
    news: dict[str, dict[str, Any]] = field(default_factory=dict)
    frames: list[bytes] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    drawn: int = 0
    refused: list[str] = field(default_factory=list)

    def tell(self, kind: str, /, **fields: object) -> None:
        self.socket.send(json.dumps({"type": kind, **fields}))

    def ask(self, kind: str, /, **fields: object) -> dict[str, Any]:
        """The answer to a question, a refusal included."""
        self.serial += 1
        self.tell(kind, serial=self.serial, **fields)
        while True:
            found = self.receive()
            if found is not None and found.get("serial") == self.serial:
                return found

    def ask_until(self, when: Callable[[dict[str, Any]], object], kind: str, /, **fields: object) -> dict[str, Any]:
        """The answer to a question as soon as it is as wanted; asked no more often than a page may."""
        ends = time.monotonic() + PATIENCE
        while not when(found := self.ask(kind, **fields)):
            assert time.monotonic() < ends, found
            time.sleep(0.05)
        return found

    def receive(self, timeout: float = PATIENCE) -> dict[str, Any] | None:
        """The next message, None if it was a frame. Raises TimeoutError."""
        data = self.socket.recv(timeout)
        if isinstance(data, bytes):
            self.sizes.append(len(data))
            self.frames.append(data[:3] + b"\0" + data[4:32] + self.frames[-1][32:] if data[3] else data)
            return None
        message: dict[str, Any] = json.loads(data)
        self.news[message["type"]] = message
        if message["type"] == "refused":
            self.refused.append(message["reason"])
        return message

    def wait_for(self, kind: str, when: Callable[[dict[str, Any]], bool] = lambda found: True) -> dict[str, Any]:
        """The next message of this type that is as wanted. Raises TimeoutError, though others may come all the time."""
        ends = time.monotonic() + PATIENCE
        while True:
            found = self.receive(max(0.0, ends - time.monotonic()))
            if found is not None and found["type"] == kind and when(found):
                return found

    def until(self, kind: str, when: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The latest message of this type, as soon as it is as wanted."""
        known = self.news.get(kind)
        return known if known is not None and when(known) else self.wait_for(kind, when)

    def drain(self) -> None:
        """Read on until the server ends the connection. Raises ConnectionClosed then."""
        while True:
            self.receive()

    def frame(self) -> bytes:
        """The next frame; the page has drawn it, and the one that may have come while it waited for something else:
        the server sends no other before that."""
        before = len(self.frames)
        if before > self.drawn:
            self._draw()
        deadline = time.monotonic() + PATIENCE  # other messages come all the time
        while len(self.frames) == before:
            self.receive(deadline - time.monotonic())
        self._draw()
        return self.frames[-1]

    def _draw(self) -> None:
        self.drawn = len(self.frames)
        self.tell("drawn", number=number(self.frames[-1]))


def number(frame: bytes) -> int:
    return int.from_bytes(frame[8:12], "little")


@contextmanager
def open_page(program: Program, **changes: Any) -> Iterator[Page]:
    """A page that has been greeted. changes: what `connect` is given otherwise."""
    options: dict[str, Any] = {"origin": f"http://{program.host}", "compression": None, "max_size": None} | changes
    options |= {"open_timeout": PATIENCE, "ping_timeout": PATIENCE}  # of a server that has much else to do
    with connect(f"ws://{program.host}/live?token={program.token}", **options) as socket:
        page = Page(socket)
        page.wait_for("hello")
        yield page


def let_run(program: Program, factor: float | None = None) -> Program:
    """The same program, whose time runs (so many times as fast as real time) and where no STOP holds, whatever the test
    before has left behind and however that ended."""
    with open_page(program) as page:
        page.tell("pace", running=True, factor=factor)
        if page.until("safety", lambda news: True)["latched"]:
            page.tell("release")
            page.until("safety", lambda news: not news["latched"])
    return program
