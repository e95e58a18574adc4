"""Ctrl-C and SIGTERM where Python's own way might lose them, or break what is being written.

Python raises KeyboardInterrupt wherever it stands: in an import, a finalizer or a callback from compiled code, where it
is swallowed, or in the middle of a record for a file. So while a run is set up, when nothing is open yet, Ctrl-C ends
the process on the spot; and while it goes on, Ctrl-C waits until a tick is over. Pressed once more there, it is raised
at once. If the process was started to ignore Ctrl-C (as nohup does), it does.

SIGTERM, by which services and containers are ended, does the same: bodies are stopped, files closed, and the account is
told. Only the exit status is another.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from threading import current_thread, main_thread
from types import FrameType, TracebackType
from typing import NoReturn

INTERRUPTED = 128 + signal.SIGINT
"""The exit status of a program that Ctrl-C ended, as a shell reports it."""
TERMINATED = 128 + signal.SIGTERM
"""The same for SIGTERM."""
NAMES = {signal.SIGINT: "Ctrl-C", signal.SIGTERM: "SIGTERM"}
TOO_EARLY = "ended by {} before anything had started"


class Terminated(SystemExit):
    """SIGTERM has come."""

    def __init__(self) -> None:
        super().__init__(TERMINATED)

    def __str__(self) -> str:
        return NAMES[signal.SIGTERM]


def terminate(number: int, frame: FrameType | None) -> NoReturn:
    """What SIGTERM does unless something more careful is wanted: raise Terminated, so that all is closed."""
    raise Terminated


PYTHONS = {signal.SIGINT: (signal.default_int_handler,), signal.SIGTERM: (terminate, signal.SIG_DFL)}
"""What a signal does, unless the process was started with another setting, which is kept."""


class Interrupts:
    """What Ctrl-C and SIGTERM do while this is entered: they end the process on the spot; after `defer`, they wait for
    `check`.

    notice: what is printed if one ends the process on the spot; `{}` is which.
    """

    def __init__(self, notice: str = TOO_EARLY) -> None:
        self._notice = notice
        self._pressed: int | None = None
        self._ours: list[signal.Signals] = []

    def __enter__(self) -> Interrupts:
        # Only the main thread may say what a signal does, and hears it.
        if current_thread() is main_thread():
            self._ours = [each for each, usual in PYTHONS.items() if signal.getsignal(each) in usual]
        self._set(self._end_here)
        return self

    def defer(self) -> None:
        """From here on something is open that wants to be closed, and `check` is called now and then."""
        self._set(self._note)

    def check(self) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed, Terminated if SIGTERM has come."""
        if self._pressed is not None:
            _raise(self._pressed)

    def release(self) -> None:
        """From here on Ctrl-C does what it does in Python, and SIGTERM raises Terminated."""
        for each in self._ours:
            signal.signal(each, PYTHONS[each][0])
        self._ours = []

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.release()

    def _end_here(self, number: int, frame: FrameType | None) -> None:
        """End without asking Python, which may be anywhere; not even its streams, which may be in the middle of a
        line."""
        if sys.stderr is not None:
            os.write(2, f"{self._notice.format(NAMES[signal.Signals(number)])}\n".encode())
        os._exit(128 + number)

    def _set(self, handler: Callable[[int, FrameType | None], object]) -> None:
        for each in self._ours:
            signal.signal(each, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._pressed is not None:
            _raise(number)
        self._pressed = number


def end_now(status: int) -> NoReturn:
    """End as a signal does, without asking Python: a thread may be compiling, which nothing can interrupt. For when all
    that was open is closed."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            with suppress(OSError, ValueError):
                stream.flush()
    os._exit(status)


def _raise(number: int) -> NoReturn:
    raise Terminated if number == signal.SIGTERM else KeyboardInterrupt
