"""The process that runs a swarm again, beside the one that lives: what it is asked, and what it answers.

The process (`adapters/replay_worker.py`) begins with the first question, which takes it a second. It knows nothing but
what a question brings: a state, and what came from outside since. A question that nobody waits for is given up.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import field
from multiprocessing import connection, get_context
from threading import Lock, Thread
from typing import Literal

from sleepcast.console.frames import places_of
from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.loop.rerun import Inputs

ReplayAction = Literal["begin", "look", "answer", "why", "state", "advance", "compare", "sample"]


@dataclass(frozen=True, slots=True)
class RunMoment:
    """A moment of a run.

    run: which one
    base, state: the tick from which it is run again, and the state then
    tick: of the moment
    inputs: all that came after the state up to the moment
    checks: digests of the poses that were seen on the way, by tick
    """

    run: int
    base: int
    state: bytes
    tick: int
    inputs: Inputs
    checks: dict[int, bytes] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked for a moment.

    action: what is to be done there
    robot: the one that is looked at or asked, -1 for none
    message: the page's, for "answer" and "sample"; the command, for "why"
    groups: names that are known already, in their order
    patience: seconds of work after which it is given up, or that "advance" takes
    source: of the scenario, packed, and the seed, for "begin"
    other: the same moment of an alternate run, for "compare"
    """

    action: ReplayAction
    moment: RunMoment
    robot: int = -1
    message: bytes = b""
    groups: tuple[str, ...] = ()
    patience: float = 60.0
    source: tuple[bytes, int] = (b"", 0)
    other: RunMoment | None = None


@dataclass(frozen=True, slots=True)
class ReplayAnswer:
    """What was found at a moment.

    tick: the moment's
    poses: as in a frame
    marks: groups, flags, the names of the groups, second groups and colours, as in `timeline.RobotMarks`
    names: of the robots by row, where they come and go
    counts, shown: of the groups
    message: what the page is to be told, as JSON
    state: one that is to be kept
    differs: the first tick whose poses are not those that were seen, None if there is none
    error: why there is no answer
    ended: whether it was given up, for the time that it took
    """

    tick: int = 0
    poses: bytes = b""
    marks: tuple[bytes, bytes, tuple[str, ...], bytes, bytes] = (b"", b"", (), b"", b"")
    counts: tuple[int, ...] = ()
    shown: tuple[int, ...] = ()
    message: bytes = b""
    state: bytes = b""
    differs: int | None = None
    names: tuple[str, ...] = ()
    error: str = ""
    ended: bool = False


def digest(poses: bytes, count: int) -> bytes:
    """What tells poses of so many robots from others: where everybody is. A recording has headings as quaternions,
    which are rounded."""
    return hashlib.blake2b(places_of(poses, count).tobytes(), digest_size=16).digest()


class RerunError(SleepcastError):
    """The past cannot be shown, and why."""


class ReplayClient:
    """See the module. work: what the process does with its end of the pipe until that is closed."""

    def __init__(self, work: Callable[[connection.Connection], None]) -> None:
        self._work = work
        self._turn = asyncio.Lock()
        self._sending = Lock()
        self._pipe: connection.Connection | None = None
        self._end: Callable[[], None] = lambda: None
        self._number, self._ended = 0, False

    async def ask(self, question: Question) -> ReplayAnswer:
        """What it finds; others that ask meanwhile wait. Raises RerunError. To cancel this gives it up."""
        async with self._turn:
            self._number += 1
            waiting: Future[ReplayAnswer] = Future()
            Thread(target=self._exchange, args=(self._number, question, waiting), name="past", daemon=True).start()
            done = asyncio.wrap_future(waiting)
            try:
                answer = await asyncio.shield(done)
            except asyncio.CancelledError:
                with suppress(OSError):
                    self._send(self._number)
                await asyncio.wait([done])
                raise
        if answer.error:
            raise RerunError(answer.error)
        return answer

    def _exchange(self, number: int, question: Question, waiting: Future[ReplayAnswer]) -> None:
        try:
            pipe = self._begun()
            self._send((number, question))
            waiting.set_result(pipe.recv())
        except (EOFError, OSError) as error:
            self._pipe = None
            why = "sleepcast is ending" if self._ended else f"the process that runs it again has ended ({error})"
            waiting.set_result(ReplayAnswer(error=f"The past cannot be shown: {why}."))

    def _send(self, what: object) -> None:
        with self._sending:
            if self._pipe is not None:
                self._pipe.send(what)

    def _begun(self) -> connection.Connection:
        """The pipe to the process, which is begun if there is none."""
        if self._pipe is None:
            if self._ended:
                raise EOFError
            context = get_context("spawn")  # a fork would copy threads in the middle of something
            self._pipe, theirs = context.Pipe()
            process = context.Process(target=self._work, args=(theirs,), daemon=True)
            process.start()
            self._end = process.kill
            theirs.close()
        return self._pipe

    def close(self) -> None:
        """End the process."""
        self._ended = True
        self._end()
