"""The picture under the world, for a page that asks for it."""

from __future__ import annotations

from collections.abc import Awaitable

from sleepcast.console import outgoing
from sleepcast.console.driver import aside
from sleepcast.console.view import Picture
from sleepcast.core.errors import MisuseError


def pictured(
    picture: Picture | None, serial: int, *, at_once: bool = False
) -> outgoing.Pictured | Awaitable[outgoing.Pictured]:
    """The picture, read and packed beside the server. at_once: whatever it takes. Raises SleepcastError if there is
    none, or it cannot be read."""
    if picture is None:
        raise MisuseError("There is no picture of this map.")
    return outgoing.Pictured(serial, picture()) if at_once else _later(picture, serial)


async def _later(picture: Picture, serial: int) -> outgoing.Pictured:
    return outgoing.Pictured(serial, await aside(picture))
