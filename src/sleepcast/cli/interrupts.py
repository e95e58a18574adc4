"""Ctrl-C where Python's own way might lose it, or break what is being written.

Python raises KeyboardInterrupt wherever it stands: in an import, a finalizer or a callback from compiled code, where it
is swallowed, or in the middle of a record for a file. So while a run is set up, when nothing is open yet, Ctrl-C ends
the process on the spot; and while it goes on, Ctrl-C waits until a tick is over. Pressed once more there, it is raised
at once. Whoever has told the process to ignore Ctrl-C (nohup and the like do) is obeyed.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from threading import current_thread, main_thread
from types import FrameType, TracebackType
from typing import NoReturn

INTERRUPTED = 130
"""The exit status of a program that Ctrl-C ended (128 + SIGINT), as a shell reports it."""
TOO_EARLY = "ended by Ctrl-C before anything had begun"


class Interrupts:
    """What Ctrl-C does while this is entered: it ends the process on the spot; after `defer`, it waits for `check`.

    said: what a person is told if it ends the process on the spot."""

    def __init__(self, said: str = TOO_EARLY) -> None:
        self._said = said
        self._pressed = False
        self._ours = False

    def __enter__(self) -> Interrupts:
        # Only the main thread may say what a signal does, and hears it.
        self._ours = current_thread() is main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._ours:
            signal.signal(signal.SIGINT, self._end_here)
        return self

    def defer(self) -> None:
        """From here on something is open that wants to be closed, and `check` is called now and then."""
        if self._ours:
            signal.signal(signal.SIGINT, self._note)

    def check(self) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed."""
        if self._pressed:
            raise KeyboardInterrupt

    def release(self) -> None:
        """From here on Ctrl-C does what it does in Python."""
        if self._ours:
            self._ours = False
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.release()

    def _end_here(self, number: int, frame: FrameType | None) -> None:
        """End without asking Python, which may be anywhere; not even its streams, which may be in the middle of a
        line."""
        if sys.stderr is not None:
            os.write(2, f"{self._said}\n".encode())
        os._exit(INTERRUPTED)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._pressed:
            raise KeyboardInterrupt
        self._pressed = True


def end_now() -> NoReturn:
    """End as Ctrl-C does, without asking Python: a thread may be compiling, which nothing can interrupt. For when all
    that was open is closed."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            with suppress(OSError, ValueError):
                stream.flush()
    os._exit(INTERRUPTED)
