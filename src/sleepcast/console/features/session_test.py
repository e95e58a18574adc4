"""A session as a test: what the page is told to choose from, and who makes the files.

While the dialog is open time stands still: the test ends at this tick, and the numbers are of it. The files go to the
page as one zip file, which the browser saves: nothing is written where the program runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, Protocol

import msgspec
from msgspec import Meta

from sleepcast.console.feature import answers, only_now
from sleepcast.console.incoming import Expression, Id, PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.view import PaceControl, SwarmView
from sleepcast.core.errors import MisuseError

MAX_HELD = 1_000
"""Commands of one test: as many as a mission may have."""
MAX_GOALS = 16
"""Goals of one test, as in an exercise."""
Bound = Literal["exactly", "at least", "at most"]
TestName = Annotated[str, Meta(pattern=r"\A[A-Za-z0-9][A-Za-z0-9_-]{0,59}\Z")]

NO_TEST = "A test is saved from the page of a simulated swarm: sleepcast demo, or sleepcast run --page."
OF_RECORDING = (
    "A recording is not saved as a test: it has the accounts of commands only as they were at its pictures. Send the "
    "same commands in sleepcast demo, and save the test there."
)


class DraftTest(PageMessage):
    """Let time stand still, and tell what a test of the session up to now would hold."""

    serial: Serial


class CountTrue(PageMessage):
    """For how many robots an expression is true now, by what they themselves know."""

    serial: Serial
    text: Expression


class HeldCount(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What shall become of a command when a test ends. how: what the count is to the number."""

    count: Literal["matched", "held", "not matched", "unknown", "fault", "silent"]
    how: Bound
    number: Annotated[int, Meta(ge=0, le=10_000_000)]


class HeldGoal(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """For how many robots an expression shall be true when a test ends."""

    text: Expression
    how: Bound
    number: Annotated[int, Meta(ge=0, le=10_000_000)]


HeldCounts = Annotated[list[HeldCount], Meta(max_length=6)]


class SaveTest(PageMessage):
    """Make the files of a test.

    tick: at which it was drafted
    held: by the ids of commands
    exact: the whole state shall be the same at the end
    """

    serial: Serial
    tick: Annotated[int, Meta(ge=0, le=2**53 - 1)]
    name: TestName
    held: Annotated[dict[Id, HeldCounts], Meta(max_length=MAX_HELD)] = msgspec.field(default_factory=dict)
    goals: Annotated[list[HeldGoal], Meta(max_length=MAX_GOALS)] = msgspec.field(default_factory=list)
    exact: bool = False


class DraftCommand(msgspec.Struct, frozen=True):
    """A command that was sent, and how many robots did what. at: s. text: of its order in the mission."""

    id: str
    at: float
    text: str
    counts: dict[str, int]


class Drafted(DeskMessage):
    """What a test of the session would hold. ended: the time (s) of the tick at which it ends. ran: whether time ran
    before."""

    serial: int
    tick: int
    ended: float
    ran: bool
    name: str
    commands: list[DraftCommand]


class Counted(DeskMessage):
    """For how many robots an expression is true now."""

    serial: int
    number: int


class Packed(DeskMessage):
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


class PausedDriver(Protocol):
    """What lets time run."""

    @property
    def pace(self) -> PaceControl: ...

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None: ...


class TestSource(Protocol):
    """A run of which tests can be made."""

    @property
    def tests(self) -> TestMaker: ...
    @property
    def swarm(self) -> SwarmView: ...
    @property
    def driver(self) -> PausedDriver: ...


@answers(then=only_now, lacking=NO_TEST, recording=OF_RECORDING)
def draft_test(source: TestSource, asked: DraftTest) -> Drafted:
    """Let time stand still, and tell what a test would hold."""
    ran = not source.driver.pace.paused
    name, commands = source.tests.draft()
    source.driver.set_pace(running=False)
    return Drafted(asked.serial, source.swarm.tick, source.swarm.now(), ran, name, commands)


@answers(then=only_now, lacking=NO_TEST, recording=OF_RECORDING)
def count_true(source: TestSource, asked: CountTrue) -> Counted:
    """For how many robots an expression is true now."""
    return Counted(asked.serial, source.tests.count(asked.text))


@answers(then=only_now, lacking=NO_TEST, recording=OF_RECORDING)
def save_test(source: TestSource, asked: SaveTest) -> Packed:
    """The files of a test. Raises MisuseError where time has gone on meanwhile."""
    if asked.tick != source.swarm.tick:
        raise MisuseError("Time has gone on since this dialog was opened: close it, and open it again.")
    files = source.tests.files(asked.name, asked.held, asked.goals, asked.exact)
    return Packed(asked.serial, f"{asked.name}.zip", files)
