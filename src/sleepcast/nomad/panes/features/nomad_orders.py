"""What only Nomads are asked: orders as a program would give them, driving by hand, and places in their windows."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Annotated, Protocol

from msgspec import Meta

from sleepcast.console.feature import answers
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import Done

MOST_NUMBERS = 64
"""Of an order to a Nomad: more than any has."""
MOST_SAID = 256
"""Characters of a text that a Nomad says."""
LARGEST = 2**31 - 1
"""A number of the Nomads' wire has 32 bits, signed."""
FARTHEST = 1e5
"""m: no world of Nomads is so large, and no number of their wire so long."""
NomadNumber = Annotated[int, Meta(ge=-LARGEST, le=LARGEST)]
NomadIndex = Annotated[int, Meta(ge=0, le=10_000_000)]


class Perform(PageMessage):
    """An order to a Nomad, as a program would give it; `text` goes with `tk` alone."""

    serial: Serial
    robot: NomadIndex
    order: Annotated[str, Meta(max_length=40)]
    numbers: Annotated[list[NomadNumber], Meta(max_length=MOST_NUMBERS)]
    text: Annotated[str, Meta(max_length=MOST_SAID)] = ""


class Drive(PageMessage):
    """Speeds of a Nomad's axes, from a hand at the keys: to be said again and again, or the robot rests."""

    robot: NomadIndex
    numbers: Annotated[list[NomadNumber], Meta(min_length=3, max_length=3)]


class Click(PageMessage):
    """A place in a Nomad's own window, m: the answer to a program that asks for one."""

    serial: Serial
    robot: NomadIndex
    x: Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST)]
    y: Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST)]


class DrivingPage(Protocol):
    """A page whose robots are given orders."""

    def perform(self, asked: Perform) -> Awaitable[Done]:
        """Do what a program's request would do. Raises SleepcastError."""

    def drive(self, asked: Drive) -> Awaitable[None]:
        """Turn the axes until the hand leaves the keys. Raises SleepcastError."""


class WindowSource(Protocol):
    """Robots with windows of their own."""

    def click(self, asked: Click) -> Done:
        """Answer a program that waits for somebody to point at a place. Raises MisuseError."""


@answers()
def perform(source: DrivingPage, asked: Perform) -> Awaitable[Done]:
    """An order to a Nomad."""
    return source.perform(asked)


@answers()
def drive(source: DrivingPage, asked: Drive) -> Awaitable[None]:
    """A Nomad driven by hand."""
    return source.drive(asked)


@answers()
def click(source: WindowSource, asked: Click) -> Done:
    """A place in a Nomad's window."""
    return source.click(asked)
