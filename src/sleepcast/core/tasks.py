"""Works that go on side by side, in one thread or in others, and waiting that can always be ended."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, TypeVar

T = TypeVar("T")


async def together(*works: Coroutine[Any, Any, None]) -> None:
    """Do all of this until one of it ends or fails, or until cancelled; then all of it has ended."""
    tasks = [asyncio.ensure_future(work) for work in works]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        ended = await asyncio.gather(*tasks, return_exceptions=True)
    for error in ended:
        if isinstance(error, BaseException) and not isinstance(error, asyncio.CancelledError):
            raise error


async def wait_at_most(event: asyncio.Event, seconds: float) -> None:
    """Wait for the event, and no longer than this (s). `asyncio.wait_for` of Python 3.11 would lose a cancellation that
    comes in the same turn as the event, and whoever waits in a loop would never end."""
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            await event.wait()


def settle(done: Future[T], work: Callable[[], T]) -> None:
    """Do this, and let whoever waits for `done` have what comes of it, or what it raises; nothing if nobody waits any
    more."""
    if not done.set_running_or_notify_cancel():
        return
    try:
        result = work()
    except BaseException as error:
        done.set_exception(error)
    else:
        done.set_result(result)
