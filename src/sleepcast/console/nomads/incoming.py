"""Messages from the page of the Nomads: exact, bounded shapes. What any page may say stands in `messages`."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from sleepcast.console.incoming import Drawn, Message, Pace, Release, Serial, Step, Stop, Watch, read

MOST_CORNERS = 64
"""Of a polygon drawn on the page, by a click for each."""
MOST_NUMBERS = 64
"""Of an order: more than any has."""
MOST_NAME = 200
"""Characters of a file's name."""
MOST_WORLD = 100_000
"""Characters of a world: a thousand polygons and more; with what JSON adds they stay below its `MAX_BYTES`."""
MOST_TEXT = 256
"""Characters of a text that a robot says."""
FARTHEST = 1e5
"""m: no world is so large, and no number of the page so long."""
LARGEST = 2**31 - 1
"""A number of the Nomad's wire has 32 bits, signed."""

Index = Annotated[int, Meta(ge=0, le=10_000_000)]
Metres = Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST)]
Number = Annotated[int, Meta(ge=-LARGEST, le=LARGEST)]
Numbers = Annotated[list[Number], Meta(max_length=MOST_NUMBERS)]
Corner = tuple[Metres, Metres]


class Perform(Message):
    """An order to a robot, as a program would give it; `text` goes with `tk` alone."""

    serial: Serial
    robot: Index
    order: Annotated[str, Meta(max_length=40)]
    numbers: Numbers
    text: Annotated[str, Meta(max_length=MOST_TEXT)] = ""


class Drive(Message):
    """Speeds of a robot's axes, from a hand at the keys: to be said again and again, or the robot rests."""

    robot: Index
    numbers: Annotated[list[Number], Meta(min_length=3, max_length=3)]


class Click(Message):
    """A place in the Robot window."""

    serial: Serial
    robot: Index
    x: Metres
    y: Metres


class Build(Message):
    """A new polygon."""

    serial: Serial
    corners: Annotated[list[Corner], Meta(min_length=3, max_length=MOST_CORNERS)]


class Shift(Message):
    """Move a polygon, by its place among those that were shown under this version, by so many m."""

    serial: Serial
    version: Annotated[int, Meta(ge=0, le=2**53 - 1)]
    solid: Index
    across: Metres
    up: Metres


class Clear(Message):
    """Take a polygon away, by its place among those that were shown under this version."""

    serial: Serial
    version: Annotated[int, Meta(ge=0, le=2**53 - 1)]
    solid: Index


class Load(Message):
    """The world of a file, in place of the one that there is. name: of the file."""

    serial: Serial
    name: Annotated[str, Meta(max_length=MOST_NAME)]
    text: Annotated[str, Meta(max_length=MOST_WORLD)]


class Save(Message):
    """The world as the text of a file."""

    serial: Serial


Incoming = Perform | Drive | Click | Build | Shift | Clear | Load | Save | Stop | Release | Pace | Step | Watch | Drawn

_DECODER: msgspec.json.Decoder[Incoming] = msgspec.json.Decoder(Incoming)


def decode(data: str | bytes) -> Incoming:
    """The message in `data`. Raises MessageError."""
    return read(_DECODER, data)
