"""Code of other packages behind the page: that of each package runs in an event loop and a thread of its own.

The page's own loop takes STOP, so it waits for nobody. What a package does not answer at once is answered later, and
what it does not answer within `ANSWER_WITHIN` is refused in a sentence with its name. From then on what it adds is left
out, until it comes back: it is not called meanwhile.

What is answered at once is looked up between two ticks, as by the page's own functions. Whatever takes longer goes on
beside them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from concurrent.futures import Future, wait
from functools import cache, partial
from threading import Thread
from typing import TypeAlias, TypeVar

from sleepcast.console.feature import Answer, Reply
from sleepcast.core.errors import MisuseError
from sleepcast.core.tasks import settle

AT_ONCE = 0.02
"""Seconds for which the page's loop waits for a package at most: unnoticed by people, long for what reads columns."""
ANSWER_WITHIN = 10.0
"""Seconds for an answer: long enough to ask robots, or another computer."""

T = TypeVar("T")
Started: TypeAlias = Answer | Future[tuple[Answer, BaseException | None]]
"""An answer, or what it comes to later: itself, or what is raised."""


def _nothing() -> None:
    """What is done as soon as a package does nothing else."""


class PackageThread:
    """See the module. package: its name, for sentences."""

    def __init__(self, package: str) -> None:
        self._package = package
        self._loop = asyncio.new_event_loop()
        self._late = False
        """Whether an answer came too late, or not at all."""
        Thread(target=self._loop.run_forever, name=f"package {package}", daemon=True).start()
        self._sign = self.begin(_nothing)
        """Done as soon as the package has come back from what it did last."""

    def begin(self, work: Callable[[], T]) -> Future[T]:
        """Have this done, after all that it does already."""
        done: Future[T] = Future()
        self._loop.call_soon_threadsafe(settle, done, work)
        return done

    def give_up(self) -> None:
        """Wait no longer for what it does: it is left out until it has come back."""
        self._late, self._sign = True, self.begin(_nothing)

    def answer(self, work: Callable[[], Reply]) -> Reply:
        """What a function of the package answers: at once, else what can be awaited. Raises whatever that raises, and
        MisuseError if it hangs."""
        busy = not self._sign.done()
        self._late = self._late and busy
        if self._late:
            raise MisuseError(f"The package {self._package} hangs: what it adds is left out until it answers again.")
        called = self.begin(partial(self._start, work))
        if not _in_event_loop():  # nobody's STOP comes by here, as where the past is run again
            return asyncio.run(self._later(called))
        if not busy:
            wait([called], AT_ONCE)
        if called.done() and not isinstance(reply := called.result(), Future):
            return reply
        if not called.done() and not busy:
            self._sign = self.begin(_nothing)
        return self._later(called)

    def _start(self, work: Callable[[], Reply]) -> Started:
        """Call a function, within the package's loop; what has to be awaited begins there."""
        reply = work()
        return asyncio.run_coroutine_threadsafe(_awaited(reply), self._loop) if isinstance(reply, Awaitable) else reply

    async def _later(self, called: Future[Started]) -> Answer:
        """The answer of a function that was called, within `ANSWER_WITHIN`. Raises what `answer` raises."""
        try:
            async with asyncio.timeout(ANSWER_WITHIN) as patience:
                started = await asyncio.wrap_future(called)
                if not isinstance(started, Future):
                    return started
                answer, error = await asyncio.wrap_future(started)
        except TimeoutError:
            if not patience.expired():
                raise
            self.give_up()
            raise MisuseError(f"The package {self._package} has not answered within {ANSWER_WITHIN:g} s.") from None
        finally:
            called.add_done_callback(_end)
        if error is not None:
            raise error
        return answer


async def _awaited(reply: Awaitable[Answer]) -> tuple[Answer, BaseException | None]:
    """What it comes to: what it raises, too, since SystemExit would end the package's loop."""
    try:
        return await reply, None
    except asyncio.CancelledError:
        raise
    except BaseException as error:
        return None, error


def _end(called: Future[Started]) -> None:
    """Nobody waits any more for what this has begun."""
    if not called.cancelled() and called.exception() is None and isinstance(started := called.result(), Future):
        started.cancel()


def _in_event_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


@cache
def thread_of(package: str) -> PackageThread:
    """The thread of a package, which begins when it is asked for first."""
    return PackageThread(package)
