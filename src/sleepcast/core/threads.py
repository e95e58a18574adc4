"""A pool of threads that share one job. The calling thread works too, and each free thread takes the next stretch.

No thread waits for one that has not begun: if it wakes up too late, the others have done its part. A thread that is
done polls for the end of the last stretch before it sleeps, because waking up usually takes longer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import accumulate, chain, pairwise, repeat
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Generic, TypeAlias, TypeVar
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

Result = TypeVar("Result")
Calls: TypeAlias = SimpleQueue[Callable[[], None] | None]
Look: TypeAlias = Callable[[NDArray[np.int64], int, int], object]
"""Looks at the first number until it is not 0, so many times at most, and then some times more; lets other threads
run."""

LOOKS = 4_000
"""How often is looked before going to sleep: for about a tenth of a millisecond."""
ENDED = 120
"""How often is looked after the end: the thread that said so holds the interpreter for some microseconds more, and one
that asks for it meanwhile is put to sleep."""
SIZES = 3, 3, 1, 1
"""How large the stretches for each thread are: who is done early takes over some of the rest, and the last ones are
small, so that all are done at about the same time."""
FEW = 2, 1
"""The same of a job that is done soon, since each stretch takes some microseconds to begin."""


def borders(count: int, threads: int, sizes: Sequence[int] = SIZES, grain: int = 1) -> list[int]:
    """Where the stretches of so many things begin, at multiples of `grain`, and their end; none that has anything in it
    is shorter than that, unless all are. sizes: of those for each thread, in proportion."""
    parts = list(accumulate(chain.from_iterable(repeat(size, threads) for size in sizes), initial=0))
    return [*(count // grain * part // parts[-1] * grain for part in parts[:-1]), count]


class Job(Generic[Result]):
    """Work that is done in stretches, each from a number up to another one."""

    def __init__(
        self, work: Callable[[int, int], Result], stretches: Sequence[tuple[int, int]], look: Look | None
    ) -> None:
        self._work, self._count, self._look = work, len(stretches), look
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
        if self._look is not None and not self._over():
            self._look(self._ended, LOOKS, ENDED)
        if not self._over():
            self._wait()
        if self._errors:
            raise self._errors[0]
        return self._done

    def _wait(self) -> None:
        """Wait for the others, also if Ctrl-C is pressed meanwhile: they write where others would go on."""
        try:
            self._bell.get()
        except BaseException:
            if not self._over():
                self._bell.get()
            raise

    def _over(self) -> bool:
        return len(self._done) + len(self._errors) == self._count


class ThreadPool:
    """So many threads, the calling one included; the others are started when there is something to do.

    look: how one looks out for the end of a job; without it one goes to sleep at once.
    """

    def __init__(self, threads: int, look: Look | None = None) -> None:
        self.threads = threads
        self._look = look
        self._calls: Calls | None = None

    def share(self, work: Callable[[int, int], Result], borders: Sequence[int]) -> list[Result]:
        """Let all threads do this work between these borders; gives what has come of each stretch, in any order. This
        one alone does it if there is only one."""
        stretches = [pair for pair in pairwise(borders) if pair[0] < pair[1]]
        if self.threads == 1 or len(stretches) < 2:
            return [work(*stretch) for stretch in stretches]
        if self._calls is None:
            self._calls = self._start()
        job = Job(work, stretches, self._look)
        for _ in range(self.threads - 1):
            self._calls.put(job.help)
        try:
            return job.finish()
        finally:
            while not self._calls.empty():  # of threads that have not come
                with suppress(Empty):
                    self._calls.get_nowait()

    def practise(self) -> None:
        """Look once, so that how one looks is compiled before it matters."""
        if self._look is not None and self.threads > 1:
            self._look(np.ones(1, np.int64), 1, 1)

    def _start(self) -> Calls:
        """Start the other threads; they end with this pool."""
        calls: Calls = SimpleQueue()
        for number in range(self.threads - 1):
            Thread(target=_serve, args=(calls,), name=f"kernels_{number}", daemon=True).start()
        finalize(self, _dismiss, calls, self.threads - 1)
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
