"""What a fleet offers whether it is simulated or real: commands and their results, previews, values, tables."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from math import inf
from threading import Event, Lock
from typing import TYPE_CHECKING, Concatenate, ParamSpec, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.events import EventQueue, FleetEvent
from sleepcast.api.table import DataTable, Numbers, Texts
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.model import RestState
from sleepcast.language import Explanation
from sleepcast.station import Account, Command, Preview, Station
from sleepcast.station.validation import is_mere_test

if TYPE_CHECKING:
    from sleepcast.notebook import FleetWidget, NotebookDesk

WAIT = 2.0
"""Seconds for which a command waits for answers: robots answer at once, and a lossy radio asks them again."""

_GONE: ContextVar[Event | None] = ContextVar("gone", default=None)
"""Set on a thread whose caller has been cancelled: it takes no further turn."""


def _refuse_cancelled() -> None:
    """Raises MisuseError on a thread whose caller has been cancelled."""
    if (gone := _GONE.get()) is not None and gone.is_set():
        raise MisuseError("this was cancelled")


Given = TypeVar("Given", bound=np.generic)
Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")


class CommandResult:
    """A command that was sent, with what has become of it so far; it goes on counting while the fleet runs."""

    def __init__(self, fleet: Fleet, command: Command) -> None:
        self._fleet, self._command = fleet, command

    @property
    def id(self) -> str:
        """Of the message."""
        return self._command.id

    @property
    def text(self) -> str:
        """The expression; `STOP` or `RELEASE` for these two."""
        return self._command.text

    @property
    def account(self) -> Account:
        """Everything that is known of it now."""
        return self._fleet.station.accounting(self.id)

    @property
    def matched(self) -> tuple[str, ...]:
        """The robots that obeyed; of a question, that answered; of STOP, that have accepted it: see `at_rest`."""
        return self.account.matched

    @property
    def at_rest(self) -> tuple[str, ...]:
        """Of STOP: the robots that have accepted it and say that they are at rest."""
        rest = self.account.rest
        return () if rest is None else rest.at_rest

    @property
    def stopping(self) -> dict[str, RestState]:
        """Of STOP: those that have accepted it and are not at rest yet, each with its `speed` (m/s) and the `distance`
        that it may still go (m); NaN for unknown."""
        rest = self.account.rest
        return {} if rest is None else rest.stopping

    @property
    def not_matched(self) -> tuple[str, ...]:
        """The robots that decided that it was not for them."""
        return self.account.not_matched

    @property
    def held(self) -> tuple[str, ...]:
        """Those among the matched that were to move, and did not because STOP holds them."""
        return self.account.held

    @property
    def unknown(self) -> tuple[str, ...]:
        """The robots on which the test was neither true nor false, since it reads something that they do not know."""
        return self.account.unknown

    @property
    def fault(self) -> tuple[str, ...]:
        """The robots on which something went wrong."""
        return self.account.fault

    @property
    def not_stored(self) -> tuple[str, ...]:
        """The robots that have done it, but could not store it: a restart may forget it."""
        return self.account.not_stored

    @property
    def silent(self) -> tuple[str, ...]:
        """The robots that were never heard to answer."""
        return self.account.silent

    @property
    def values(self) -> dict[str, float | None]:
        """What each robot answered that the expression came to, SI; None for unknown."""
        return {name: answer.value for name, answer in self.account.answers.items()}

    def why(self, robot: str) -> Explanation:
        """How this robot evaluated it: the tree of values, and the first test that did not hold. Raises what
        `Fleet.why` raises."""
        return self._fleet.why(robot, self)

    def table(self) -> DataTable:
        """A row for each robot: `robot`, `outcome`, `value` (SI), `fault`."""
        found = self.account
        names = [*found.answers, *found.silent]
        answers = [found.answers.get(name) for name in names]
        values = [np.nan if each is None or each.value is None else each.value for each in answers]
        return DataTable(
            {
                "robot": names,
                "outcome": ["silent" if each is None else str(each.outcome) for each in answers],
                "value": np.array(values),
                "fault": ["" if each is None else each.fault or "" for each in answers],
            }
        )

    def __repr__(self) -> str:
        return f"{self.text}: {self.account.sentence()}"


def beside(
    method: Callable[Concatenate[Fleet, Arguments], Result],
) -> Callable[Concatenate[Fleet, Arguments], Awaitable[Result]]:
    """The same method for a program with asyncio: it waits on a thread of its own."""

    async def awaited(fleet: Fleet, /, *given: Arguments.args, **named: Arguments.kwargs) -> Result:
        from asyncio import CancelledError, to_thread  # loading it takes longer than the rest of this module

        gone = Event()
        before = _GONE.set(gone)  # the thread has it from here
        try:
            found: Result = await to_thread(getattr(fleet, method.__name__), *given, **named)
        except CancelledError:
            gone.set()
            raise
        finally:
            _GONE.reset(before)
        return found

    awaited.__doc__ = beside.__doc__
    return awaited


class Turns:
    """Lets one thread at a time use a fleet, in the order in which they came, until it is closed."""

    def __init__(self) -> None:
        self._open, self._next, self._now = True, Lock(), Lock()

    @contextmanager
    def turn(self) -> Iterator[None]:
        """A turn, not within another one. Raises MisuseError once the fleet is closed."""
        self._take()
        try:
            self._refuse_closed()
            yield
        finally:
            self._now.release()

    def pass_on(self) -> None:
        """Within a turn: let those that wait have theirs first. Raises MisuseError if one of them closed the fleet."""
        self._now.release()
        self._take()
        self._refuse_closed()

    @contextmanager
    def last(self) -> Iterator[None]:
        """The turn of the thread that closes the fleet."""
        self._take()
        try:
            self._open = False
            yield
        finally:
            self._now.release()

    def _take(self) -> None:
        with self._next:
            self._now.acquire()

    def _refuse_closed(self) -> None:
        if not self._open:
            raise MisuseError("this fleet is closed: connect again")


class Fleet(ABC):
    """A fleet and its operator's desk. station: the desk, for what is not offered here.

    Several threads may call methods: they take turns.
    """

    def __init__(self, station: Station) -> None:
        self.station = station
        self._turns = Turns()
        self._desk: NotebookDesk | None = None
        """What lies behind the views, if there ever was one."""

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """See `Turns.turn`; raises MisuseError for a call that was cancelled, too."""
        with self._turns.turn():
            _refuse_cancelled()
            yield

    def _pass_on(self) -> None:
        """See `Turns.pass_on`; raises MisuseError for a call that was cancelled, too."""
        self._turns.pass_on()
        _refuse_cancelled()

    # ---- time

    @property
    @abstractmethod
    def time(self) -> float:
        """Seconds since the start; simulated ones of a simulated fleet."""

    @abstractmethod
    def run(self, seconds: float, *, quiet: bool = False) -> Self:
        """Let time pass; gives the fleet itself. quiet: without a progress bar. Raises MisuseError for a time that is
        none."""

    @abstractmethod
    def _until(self, sent: Command, seconds: float) -> CommandResult:
        """Let time pass until everybody has answered, for so long at most."""

    # ---- the operator's desk

    @abstractmethod
    def _prepare(self, text: str, sure: bool, only: Sequence[str] | None) -> None:
        """Learn what the desk has to know before it sends a text to these robots (None: all). sure: whether it is meant
        as it stands."""

    def preview(self, text: str) -> Preview:
        """Who would obey an expression now, by what robots last reported to the desk: `yes`, `no`, and `unknown` with
        the reasons. Nothing is done. For a test alone, as `(> fuel 50%)`, it is for which robots it holds. Raises
        ReadError and CheckError for a text that no robot could run."""
        program = self.station.check(text).required()
        return self.station.preview(f"(WHEN {text} 1)" if is_mere_test(program) else text)

    def send(
        self,
        text: str,
        *,
        wait: float = WAIT,
        standing: bool = False,
        deadline: float | None = None,
        everybody: bool = False,
        count: int | None = None,
        only: Sequence[str] | None = None,
        but: Sequence[str] | None = None,
        sure: bool = False,
    ) -> CommandResult:
        """Broadcast an expression. wait: seconds that may pass until all have answered; 0 sends several at the same
        moment. count: how many robots are meant, which a real fleet asks for where many may obey. sure: it is meant as
        it stands, though the checker doubts it; otherwise names that no robot has give a UserWarning. The rest, and
        what is raised: see `Station.send`."""
        self._prepare(text, sure, only)
        self._warn(text, sure, only)
        with self._turn():
            sent = self.station.send(
                text,
                standing=standing,
                deadline=deadline,
                everybody=everybody,
                count=count,
                only=only,
                but=but,
                confirmed=sure,
                undecided=True,
            )
        return self._until(sent, wait)

    def ask(
        self,
        text: str,
        *,
        wait: float = WAIT,
        only: Sequence[str] | None = None,
        but: Sequence[str] | None = None,
        sure: bool = False,
    ) -> CommandResult:
        """Ask for the value of an expression over the radio; nothing changes on the robots. The answers are in
        `values`. sure: it is meant as it stands, though the fleet has no such name. Raises what `Station.ask`
        raises."""
        self._warn(text, sure, only)
        with self._turn():
            sent = self.station.ask(text, only=only, but=but, anyway=sure)
        return self._until(sent, wait)

    def _warn(self, text: str, sure: bool, only: Sequence[str] | None) -> None:
        """Warn the caller's caller of names that no robot has, unless it is sure."""
        if sure:
            return
        try:
            checked = self.station.check(text, only=only)
        except SleepcastError:
            return  # the desk says it, and writes it down
        for finding in checked.findings:
            if finding.unknown:
                warnings.warn(finding.render(text), stacklevel=3)

    def stop(self, *, wait: float = WAIT) -> CommandResult:
        """Stop every body at once, until `release`."""
        with self._turn():
            sent = self.station.stop()
        return self._until(sent, wait)

    def release(self, *, wait: float = WAIT) -> CommandResult:
        """End STOP on every robot; nothing old resumes by itself."""
        with self._turn():
            sent = self.station.release()
        return self._until(sent, wait)

    @abstractmethod
    def why(self, robot: str, sent: CommandResult | None = None) -> Explanation:
        """How a robot evaluated a command (None: its last one). Raises SleepcastError where it cannot say."""

    # ---- what is so now

    @property
    @abstractmethod
    def names(self) -> Sequence[str]:
        """The robots, in the order of all arrays."""

    def __len__(self) -> int:
        return len(self.names)

    @abstractmethod
    def __getitem__(self, expression: str) -> NDArray[np.float64]:
        """What an expression comes to on each robot now: a sensor, a variable, or anything that only reads, as
        `fleet["fuel"]` or `fleet["(DIST x y 0 0)"]`. SI, NaN for unknown, shape (robots,), read-only. Raises ReadError,
        CheckError, and SleepcastError for what would do something."""

    @property
    def x(self) -> NDArray[np.float64]:
        """Where the robots are, m to the east, shape (robots,), read-only."""
        return self["x"]

    @property
    def y(self) -> NDArray[np.float64]:
        """The same to the north."""
        return self["y"]

    @property
    def heading(self) -> NDArray[np.float64]:
        """Where they look, rad, counter-clockwise from east."""
        return self["heading"]

    @property
    def groups(self) -> Mapping[str, tuple[str, ...]]:
        """The members of each group."""
        return self._members()

    @property
    @abstractmethod
    def stopped(self) -> NDArray[np.bool_]:
        """Which robots STOP holds, shape (robots,)."""

    def table(self, *expressions: str) -> DataTable:
        """A row for each robot: `robot`, and a column for each expression (none: all sensors), SI."""
        wanted = expressions or tuple(sensor.name for sensor in self.station.vocabulary.sensors)
        columns: dict[str, Texts | Numbers] = {each: self[each] for each in wanted}
        return DataTable({"robot": tuple(self.names)} | columns)

    # ---- shown

    def view(self) -> FleetWidget:
        """Map and prompt of the operator's page, for a notebook (Jupyter, marimo, VS Code). It is the same fleet: what
        is sent there is done here, and what happens here is seen there. Simulated time stands still until its button is
        pressed; then it goes on while the view is on the screen and no cell is running. Raises MisuseError where
        anywidget is not installed, and for more than 50,000 robots."""
        from sleepcast.notebook import FleetWidget

        if self._desk is None:
            self._desk = self._make_desk()
        return FleetWidget(self._desk, self._repr_html_, self.__repr__)

    @abstractmethod
    def _make_desk(self) -> NotebookDesk:
        """What shall lie behind the views."""

    @abstractmethod
    def _repr_html_(self) -> str:
        """The fleet as it is now, for notebooks."""

    def _changed(self, *, soon: bool = False) -> None:
        """Show it in the views. soon: there is more to come."""
        if self._desk is not None:
            self._desk.changed(soon=soon)

    # ---- what happens

    async def events(self, seconds: float = inf) -> AsyncGenerator[FleetEvent, None]:
        """What robots do from now on, for so many seconds, or until the loop over it ends. Time passes in it; commands
        may be sent meanwhile (`await fleet.asend(...)`). Raises MisuseError for a time that is none."""
        from asyncio import to_thread

        if not seconds >= 0.0:
            raise MisuseError(f"events of {seconds} s: wanted a number of seconds, 0 or more")
        queue, until = EventQueue(lambda: self.time, self._members), self.time + seconds
        self.station.listeners.append(queue.hear)
        try:
            while True:
                for event in queue.take():
                    yield event
                if self.time >= until:
                    return
                await to_thread(self._pass)
        finally:
            self.station.listeners.remove(queue.hear)
            self._changed()

    @abstractmethod
    def _pass(self) -> None:
        """Let a moment pass."""

    @abstractmethod
    def _members(self) -> Mapping[str, tuple[str, ...]]:
        """The members of each group, as far as the desk knows."""

    # ---- closed

    @abstractmethod
    def close(self) -> None:
        """Give back what it holds."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()

    # ---- for programs with asyncio: each waits on a thread of its own

    arun = beside(run)
    apreview = beside(preview)
    asend = beside(send)
    aask = beside(ask)
    astop = beside(stop)
    arelease = beside(release)
    awhy = beside(why)


def read_only(values: NDArray[Given]) -> NDArray[Given]:
    """A view that cannot be written through."""
    view = values.view()
    view.flags.writeable = False
    return view
