"""The obstacles of a world from a file, and as the text of one."""

from __future__ import annotations

from typing import Annotated, Protocol

from msgspec import Meta

from sleepcast.console.feature import answers
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage, Done

MAX_WORLD = 100_000
"""Characters of a world: a thousand polygons and more; with what JSON adds they stay below `MAX_BYTES`."""
MAX_NAME = 200
"""Characters of a file's name."""


class Load(PageMessage):
    """The obstacles of a file, in place of those that there are. name: of the file."""

    serial: Serial
    name: Annotated[str, Meta(max_length=MAX_NAME)]
    text: Annotated[str, Meta(max_length=MAX_WORLD)]


class Save(PageMessage):
    """All obstacles as the text of a file."""

    serial: Serial


class WorldText(DeskMessage, tag="world"):
    """All obstacles as the text of a file."""

    serial: int
    text: str


class WorldSource(Protocol):
    """A world that has a form as text."""

    def load(self, name: str, text: str) -> None:
        """Have the obstacles of this text in place of all that there are. name: of the file that has it. Raises
        SleepcastError."""

    def written(self) -> str:
        """All obstacles as a text that can be loaded."""


@answers()
def load_world(source: WorldSource, asked: Load) -> Done:
    """Have the obstacles of a file."""
    source.load(asked.name, asked.text)
    return Done(asked.serial)


@answers()
def save_world(source: WorldSource, asked: Save) -> WorldText:
    """All obstacles as text."""
    return WorldText(asked.serial, source.written())
