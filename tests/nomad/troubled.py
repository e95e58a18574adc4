"""A server that goes wrong on the way to its client: it dies, freezes, floods, or says what it was not asked for."""

from __future__ import annotations

import select
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread

TROUBLES = ("dies", "freezes", "floods", "garbage")
LOOK = 0.02
"""Seconds between two looks at whether it goes wrong."""


class Troubled:
    """Stands between clients and a server. trouble: one of `TROUBLES`, "" while all is well."""

    def __init__(self, port: int) -> None:
        self.trouble = ""
        self._server, self._ended = port, Event()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._listening.settimeout(LOOK)
        self.port: int = self._listening.getsockname()[1]
        self._threads = [Thread(target=self._take, daemon=True)]
        self._threads[0].start()

    def end(self) -> None:
        self._ended.set()
        for thread in self._threads:
            thread.join()
        self._listening.close()

    def _take(self) -> None:
        while not self._ended.is_set():
            with suppress(TimeoutError):
                near, _ = self._listening.accept()
                self._threads.append(Thread(target=self._relay, args=(near,), daemon=True))
                self._threads[-1].start()

    def _relay(self, near: socket.socket) -> None:
        with near, socket.create_connection(("127.0.0.1", self._server)) as far, suppress(OSError):
            near.settimeout(1.0)
            said = b"\0"
            while not self._ended.is_set() and self.trouble != "dies":
                if self.trouble == "freezes":
                    self._ended.wait(LOOK)
                    continue
                if self.trouble == "floods":
                    near.sendall(said * 100)
                for each in select.select([near, far], [], [], LOOK)[0]:
                    data = each.recv(65_536)
                    if not data:
                        return
                    if each is far:
                        said = data
                        data = bytes(255 - byte for byte in data) if self.trouble == "garbage" else data
                    (far if each is near else near).sendall(data)


@contextmanager
def troubled(port: int) -> Iterator[Troubled]:
    """One in front of the server at this port."""
    found = Troubled(port)
    try:
        yield found
    finally:
        found.end()
