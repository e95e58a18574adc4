"""A session as a test: what the page is told to choose from, and who makes the files.

While the dialog is open time stands still: the test ends at this tick, and the numbers are of it. The files go to the
page as one zip file, which the browser saves: nothing is written where the program runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import msgspec

from sleepcast.console.incoming import HeldCount, HeldGoal
from sleepcast.console.outgoing import Said

NO_TEST = "A test is saved from the page of a simulated swarm: sleepcast demo, or sleepcast run --page."
OF_RECORDING = (
    "A recording is not saved as a test: it has the accounts of commands only as they were at its pictures. Send the "
    "same commands in sleepcast demo, and save the test there."
)


class DraftCommand(msgspec.Struct, frozen=True):
    """A command that was sent, and how many robots did what. at: s. text: of its order in the mission."""

    id: str
    at: float
    text: str
    counts: dict[str, int]


class Drafted(Said):
    """What a test of the session would hold. ended: the time (s) of the tick at which it ends. ran: whether time ran
    before."""

    serial: int
    tick: int
    ended: float
    ran: bool
    name: str
    commands: list[DraftCommand]


class Counted(Said):
    """For how many robots an expression is true now."""

    serial: int
    number: int


class Packed(Said):
    """A test as a zip file. name: of the file."""

    serial: int
    name: str
    data: bytes


class TestMaker(Protocol):
    """Makes tests of one run."""

    def draft(self) -> tuple[str, list[DraftCommand]]:
        """A name for the test, and the commands that it would repeat. Raises SleepcastError for a run that cannot be
        repeated."""

    def count(self, text: str) -> int:
        """For how many robots an expression is true now. Raises SleepcastError."""

    def files(
        self, name: str, held: Mapping[str, Sequence[HeldCount]], goals: Sequence[HeldGoal], exact: bool
    ) -> bytes:
        """The test as a zip file. Raises SleepcastError."""
