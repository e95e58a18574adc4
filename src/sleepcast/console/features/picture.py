"""The picture under the world, for a page that asks for it."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Protocol

from sleepcast.console.driver import in_thread
from sleepcast.console.feature import answers
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.view import Picture


class GetPicture(PageMessage, tag="picture"):
    """The picture of the map that the scene tells the place of."""

    serial: Serial


class Pictured(DeskMessage):
    """The picture of the map, a PNG."""

    serial: int
    png: bytes


class PictureSource(Protocol):
    """A map with a picture. at_once: whether answers come at once, whatever they take."""

    at_once: bool

    @property
    def picture(self) -> Picture: ...


@answers(lacking="There is no picture of this map.")
def picture(source: PictureSource, asked: GetPicture) -> Pictured | Awaitable[Pictured]:
    """The picture, read and packed beside the server. Raises SleepcastError if it cannot be read."""
    return Pictured(asked.serial, source.picture()) if source.at_once else _later(source.picture, asked.serial)


async def _later(picture: Picture, serial: int) -> Pictured:
    return Pictured(serial, await in_thread(picture))
