"""Clocks: time is an argument, so that tests and simulations can set it."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from random import SystemRandom
from typing import ClassVar, Protocol

MADE = 1_767_225_600.0
"""2026-01-01, in Unix time: no clock that shows less is right, as sleepcast was not made then."""


class Clock(Protocol):
    """A source of time in seconds; only differences mean anything."""

    def now(self) -> float: ...


class WallClock:
    """The computer's monotonic clock, in seconds."""

    def now(self) -> float:
        return time.monotonic()


class WorkClock:
    """Seconds for which the thread that asks has worked: it stands still while others have the processor."""

    def now(self) -> float:
        return time.thread_time()


seconds_passed: Callable[[], float] = (
    partial(time.clock_gettime, time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic
)
"""Seconds that pass, those in which the computer sleeps among them, whatever is done to its clock."""


class UnixClock:
    """Seconds since 1970-01-01 UTC: as this computer had them when the process began, and those that have passed since.
    Setting the computer's clock meanwhile changes nothing in a process."""

    _began: ClassVar[float] = time.time() - seconds_passed()

    def now(self) -> float:
        return UnixClock._began + seconds_passed()

    @staticmethod
    def advance(seconds: float) -> None:
        """All that this process has of these clocks are so far behind: set them right."""
        UnixClock._began += seconds


def epoch_at(now: float) -> int:
    """The number of a life that begins now: later than all before. A computer that always wakes in 1970 would give the
    same again, and what it says would be no news: then chance decides."""
    return int((now if now >= MADE else SystemRandom().uniform(0.0, MADE)) * 1000.0)


class ManualClock:
    """A clock that stands still until it is told to move: simulated time, in seconds."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        return self._now

    def advance(self, seconds: float) -> None:
        """Move time on; a negative step is refused with ValueError."""
        if seconds < 0:
            raise ValueError(f"time cannot go back by {-seconds} s")
        self._now += seconds
