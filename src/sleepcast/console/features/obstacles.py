"""Obstacles that a person puts up, moves, takes away, and undoes all of it."""

from __future__ import annotations

from typing import Annotated, Protocol

import msgspec
from msgspec import Meta

from sleepcast.console.feature import NO_ROBOTS, answers, only_now
from sleepcast.console.incoming import Metres, Number, PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.view import ObstacleEditor

MAX_CORNERS = 64
"""Of one obstacle that a person draws; `static/obstacles.js` knows it, too."""
FIXED = "The obstacles of this world cannot be changed from here."


class Build(PageMessage):
    """Put up an obstacle with these corners, m."""

    serial: Serial
    corners: Annotated[list[tuple[Metres, Metres]], Meta(min_length=3, max_length=MAX_CORNERS)]


class Shift(PageMessage):
    """Move the obstacle with this index among those of this version of the world by dx, dy, m."""

    serial: Serial
    version: Annotated[int, Meta(ge=0, le=2**53 - 1)]
    index: Annotated[int, Meta(ge=0, le=1_000_000)] = msgspec.field(name="place")
    dx: Metres = msgspec.field(name="across")
    dy: Metres = msgspec.field(name="up")


class Clear(PageMessage):
    """Take an obstacle away; see `Shift`."""

    serial: Serial
    version: Annotated[int, Meta(ge=0, le=2**53 - 1)]
    index: Annotated[int, Meta(ge=0, le=1_000_000)] = msgspec.field(name="place")


class Undo(PageMessage):
    """Undo a change of the obstacles by its number, or (again) do once more what was undone."""

    serial: Serial
    change: Number
    again: bool = False


class Built(DeskMessage):
    """The obstacles were changed as asked for. change: the number of this change, by which it can be undone; obstacle:
    that of the obstacle."""

    serial: int
    change: int
    obstacle: int


class Undone(DeskMessage):
    """A change of the obstacles was undone, or done again."""

    serial: int


class ObstacleSource(Protocol):
    """A world whose obstacles people may change."""

    @property
    def editor(self) -> ObstacleEditor: ...


@answers(then=only_now, lacking=FIXED, recording=NO_ROBOTS)
def build(source: ObstacleSource, asked: Build) -> Built:
    """Put up an obstacle."""
    return Built(asked.serial, *source.editor.build(asked.corners))


@answers(then=only_now, lacking=FIXED, recording=NO_ROBOTS)
def shift(source: ObstacleSource, asked: Shift) -> Built:
    """Move an obstacle."""
    return Built(asked.serial, *source.editor.shift(asked.version, asked.index, asked.dx, asked.dy))


@answers(then=only_now, lacking=FIXED, recording=NO_ROBOTS)
def clear(source: ObstacleSource, asked: Clear) -> Built:
    """Take an obstacle away."""
    return Built(asked.serial, *source.editor.clear(asked.version, asked.index))


@answers(then=only_now, lacking=FIXED, recording=NO_ROBOTS)
def undo(source: ObstacleSource, asked: Undo) -> Undone:
    """Undo a change, or (again) do once more what was undone."""
    source.editor.undo(asked.change, asked.again)
    return Undone(asked.serial)
