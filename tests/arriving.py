"""Connections that arrive in the very turn of the loop in which a server ends."""

from __future__ import annotations

import asyncio
import gc
import socket
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from sleepcast.core.doorkeeper import ARRIVAL

AGES = range(ARRIVAL + 2)
"""Turns that passed since a connection arrived: of these, in some it has not got its protocol yet."""


@contextmanager
def arriving(port: int) -> Iterator[socket.socket]:
    """A connection to this port of 127.0.0.1 which the loop that runs has not noticed yet."""
    with socket.socket() as client:
        client.setblocking(False)
        with suppress(BlockingIOError):
            client.connect(("127.0.0.1", port))
        yield client


async def turns(count: int) -> None:
    """Let so many turns of the loop pass."""
    for _ in range(count):
        await asyncio.sleep(0)


@contextmanager
def nothing_left_open() -> Iterator[None]:
    """What is opened meanwhile is closed at the end, and not left to the collector of garbage."""
    gc.collect()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ResourceWarning)
        yield
        gc.collect()
    assert not [str(each.message) for each in told if each.category is ResourceWarning]
