"""A team of threads that do a job together, the one that asks among them: whoever is free takes the next stretch.

Nobody waits for a thread that has not begun: if it wakes up too late, the others have done its part. Who is done first
looks out for the end of the last stretch before going to sleep, because waking up takes longer than most of that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Generic, TypeAlias, TypeVar
from weakref import finalize

import numpy as np

from sleepcast.simulator.kernels_wait import wait

Result = TypeVar("Result")
Calls: TypeAlias = SimpleQueue[Callable[[], None] | None]

LOOKS = 4_000
"""How often is looked whether the last stretch is done, before going to sleep: for about a tenth of a millisecond."""


class Job(Generic[Result]):
    """Work that is done in stretches, each from a number up to another one."""

    def __init__(self, work: Callable[[int, int], Result], stretches: Sequence[tuple[int, int]]) -> None:
        self._work, self._count = work, len(stretches)
        self._left = list(reversed(stretches))
        self._done: list[Result] = []
        self._errors: list[BaseException] = []
        self._ended, self._bell = np.zeros(1, np.int64), SimpleQueue[None]()

    def help(self) -> None:
        """Do the next stretch until none is left."""
        while self._left:
            try:
                stretch = self._left.pop()
            except IndexError:  # another thread was faster
                break
            try:
                self._done.append(self._work(*stretch))
            except BaseException as error:
                self._errors.append(error)
        if self._over():
            self._ended[0] = 1
            self._bell.put(None)

    def finish(self) -> list[Result]:
        """Do what is left, wait for the others, and give what has come of the stretches, in any order. Raises what the
        work has raised."""
        self.help()
        if not self._over():
            wait(self._ended, LOOKS)
        if not self._over():
            self._bell.get()
        if self._errors:
            raise self._errors[0]
        return self._done

    def _over(self) -> bool:
        return len(self._done) + len(self._errors) == self._count


class Team:
    """So many threads, that of whoever asks among them; the others are started when there is something to do."""

    def __init__(self, threads: int) -> None:
        self._others = threads - 1
        self._calls: Calls | None = None

    def share(self, work: Callable[[int, int], Result], stretches: Sequence[tuple[int, int]]) -> list[Result]:
        """Let all threads do this work; gives what has come of each stretch, in any order."""
        if self._calls is None:
            self._calls = self._start()
        job = Job(work, stretches)
        for _ in range(self._others):
            self._calls.put(job.help)
        try:
            return job.finish()
        finally:
            while not self._calls.empty():  # of threads that have not come
                with suppress(Empty):
                    self._calls.get_nowait()

    def _start(self) -> Calls:
        """Start the other threads; they end when nobody needs this team any more."""
        calls: Calls = SimpleQueue()
        for number in range(self._others):
            Thread(target=_serve, args=(calls,), name=f"kernels_{number}", daemon=True).start()
        finalize(self, _dismiss, calls, self._others)
        return calls


def _serve(calls: Calls) -> None:
    """What another thread does: whatever it is called for."""
    while call := calls.get():
        call()
        del call  # it would keep the work's arrays


def _dismiss(calls: Calls, threads: int) -> None:
    """Let so many threads end."""
    for _ in range(threads):
        calls.put(None)
