"""Waiting in asyncio."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future

import pytest

from sleepcast.core.tasks import settle, wait_at_most


def test_a_cancellation_is_not_lost_to_an_event_of_the_same_turn() -> None:
    """A desk whose terminal was closed while a datagram came went on for ever."""

    async def run() -> None:
        event = asyncio.Event()
        waiting = asyncio.create_task(wait_at_most(event, 60.0))
        await asyncio.sleep(0.0)
        event.set()
        waiting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await waiting

    asyncio.run(run())


def test_it_waits_no_longer_than_that() -> None:
    async def run() -> None:
        await wait_at_most(asyncio.Event(), 0.0)

    asyncio.run(run())


def test_what_a_thread_does_is_settled_for_who_waits() -> None:
    given, failed, given_up = Future[int](), Future[int](), Future[int]()
    given_up.cancel()
    for done, work in ((given, lambda: 7), (failed, lambda: 1 // 0), (given_up, lambda: pytest.fail("nobody waits"))):
        settle(done, work)
    assert given.result() == 7
    assert isinstance(failed.exception(), ZeroDivisionError)
    assert given_up.cancelled()
