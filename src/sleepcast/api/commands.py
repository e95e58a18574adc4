"""What a fleet offers whether it is simulated or real: commands and their results, previews, values, tables."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, Awaitable, Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import datetime
from math import inf
from threading import Event, Lock
from typing import TYPE_CHECKING, Concatenate, ParamSpec, Self, TypeVar, cast, overload

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.events import EventQueue, FleetEvent
from sleepcast.api.results import CommandResult
from sleepcast.api.table import DataTable, Numbers, Texts
from sleepcast.channel import Kind
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.given_numbers import in_seconds, read_seconds
from sleepcast.language import Checked, Explanation, check
from sleepcast.language.learned_names import LearnedNames
from sleepcast.station import Command, Preview, Station
from sleepcast.station.prepared import Prepared, Terms
from sleepcast.station.validation import Audience, is_predicate_only, robot_names

if TYPE_CHECKING:
    from sleepcast.api.mission import Mission
    from sleepcast.notebook import FleetWidget, NotebookDesk
    from sleepcast.simulator.scenario.mission import Instruction, Order

WAIT = 2.0
"""Seconds for which a command waits for answers: robots answer at once, and a lossy radio asks them again."""

_CANCELLED: ContextVar[Event | None] = ContextVar("cancelled", default=None)
"""Set on a thread whose caller has been cancelled: it takes no further turn."""


def _refuse_cancelled() -> None:
    """Raises MisuseError on a thread whose caller has been cancelled."""
    if (cancelled := _CANCELLED.get()) is not None and cancelled.is_set():
        raise MisuseError("this was cancelled")


Given = TypeVar("Given", bound=np.generic)
Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")


def to_async(
    method: Callable[Concatenate[Fleet, Arguments], Result],
) -> Callable[Concatenate[Fleet, Arguments], Awaitable[Result]]:
    """The same method for a program with asyncio: it waits on a thread of its own."""

    async def awaited(fleet: Fleet, /, *given: Arguments.args, **named: Arguments.kwargs) -> Result:
        from asyncio import CancelledError, to_thread  # loading it takes longer than the rest of this module

        cancelled = Event()
        before = _CANCELLED.set(cancelled)  # the thread has it from here
        try:
            result: Result = await to_thread(getattr(fleet, method.__name__), *given, **named)
        except CancelledError:
            cancelled.set()
            raise
        finally:
            _CANCELLED.reset(before)
        return result

    awaited.__doc__ = to_async.__doc__
    return awaited


class FairLock:
    """Lets one thread at a time use a fleet, in the order in which they came, until it is closed."""

    def __init__(self) -> None:
        self._open, self._next, self._now = True, Lock(), Lock()

    def __enter__(self) -> None:
        """A turn, not within another one. Raises MisuseError once the fleet is closed, and for a call that was
        cancelled."""
        self._take()
        try:
            self._refuse_closed()
            _refuse_cancelled()
        except MisuseError:
            self._now.release()
            raise

    def __exit__(self, *ended: object) -> None:
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


def _warn_of(checked: Checked, known: Collection[int] = ()) -> None:
    """Warn the caller's caller's caller of names that no robot has. known: where some are known all the same."""
    for finding in checked.findings:
        if finding.unknown and finding.start not in known:
            warnings.warn(finding.render(checked.text), stacklevel=4)


class Fleet(ABC):
    """A fleet and its operator's desk. station: the desk, for what is not offered here.

    Several threads may call methods: they take turns.
    """

    def __init__(self, station: Station) -> None:
        self.station = station
        self._turns = FairLock()
        self._scripted = set[str]()
        """The ids of what scripts have sent."""
        self._desk: NotebookDesk | None = None
        """What lies behind the views, if there ever was one."""

    def _turn(self) -> FairLock:
        """See `FairLock`."""
        return self._turns

    def _pass_on(self) -> None:
        """See `FairLock.pass_on`; raises MisuseError for a call that was cancelled, too."""
        self._turns.pass_on()
        _refuse_cancelled()

    # ---- time

    @property
    @abstractmethod
    def time(self) -> float:
        """Seconds since the start; simulated ones of a simulated fleet."""

    @abstractmethod
    def run(self, seconds: float | str, *, quiet: bool = False) -> Self:
        """Let time pass; gives the fleet. Raises MisuseError for a time that is none.

        seconds: for how long, s, or a text such as "30s".
        quiet: whether to show no progress bar.
        """

    @abstractmethod
    def _until(self, sent: Command, seconds: float) -> CommandResult:
        """Let time pass until everybody has answered, for so long at most."""

    # ---- the operator's desk

    @property
    def operators(self) -> Mapping[str, str]:
        """The operators whom the scenario names, the first one first, each with the role: `commander`, `operator` or
        `observer`. Empty where it names none, and on the air, where the own key says who sends."""
        return {}

    def desk_of(self, operator: str) -> Station:
        """The desk of an operator, "" for the first. Raises MisuseError, with the nearest name, for one who has none
        here."""
        if operator not in ("", self.station.operator):
            raise MisuseError(f"no operator {operator} here: you send as {self.station.operator}")
        return self.station

    def _sitting(self, operator: str) -> Station:
        """The same for who sends by hand, and so is there from now on."""
        return self.desk_of(operator)

    def _commands(self) -> list[Command]:
        """What all operators here have sent, oldest first."""
        return self.station.commands()

    def _prepare(self, text: str, terms: Terms, desk: Station) -> Prepared:
        """Prepare a command, once the desk knows what it has to know for that."""
        with self._turn():
            return desk.prepare(text, terms)

    def preview(self, text: str, *, by: str = "") -> Preview:
        """Who would obey an expression now, by what robots last reported to the desk: `yes`, `no`, and `unknown` with
        the reasons. Nothing is done. For a test alone, as `(> fuel 50%)`, it is for which robots it holds. Raises
        ReadError and CheckError for a text that no robot could run, and MisuseError for an operator who has no desk
        here.

        by: the operator whose desk previews it, as for `send`; nobody sits down for that.
        """
        desk = self.desk_of(by)
        checked = desk.check(text)
        return desk.preview(f"(WHEN {text} 1)" if is_predicate_only(checked.required()) else checked)

    @overload
    def send(
        self,
        text: str,
        *,
        wait: float | str = ...,
        standing: bool = ...,
        deadline: float | str | None = ...,
        everybody: bool = ...,
        count: int | None = ...,
        only: Sequence[str] | None = ...,
        but: Sequence[str] | None = ...,
        sure: bool = ...,
        by: str = ...,
        at: float | str | datetime | None = ...,
    ) -> CommandResult: ...
    @overload
    def send(
        self,
        text: Mission,
        *,
        wait: float | str = ...,
        everybody: bool = ...,
        count: int | None = ...,
        sure: bool = ...,
    ) -> list[CommandResult]: ...
    def send(
        self,
        text: str | Mission,
        *,
        wait: float | str = WAIT,
        standing: bool = False,
        deadline: float | str | None = None,
        everybody: bool = False,
        count: int | None = None,
        only: Sequence[str] | None = None,
        but: Sequence[str] | None = None,
        sure: bool = False,
        by: str = "",
        at: float | str | datetime | None = None,
    ) -> CommandResult | list[CommandResult]:
        """Broadcast an expression. Raises what `Station.send` raises. A `Mission`, or a text that begins with a time,
        is a script: see `play`, whose list of results it gives. Its lines say themselves whether they are standing, for
        whom, and by whom.

        text: the expression, or the script.
        wait: s that may pass until all have answered; 0 sends several at the same moment. Times may be texts with
            units, such as "30s", here and in all methods.
        standing: whether it reaches every robot, even later.
        deadline: s for which it is good.
        everybody: whether it is meant for all robots, where it has no test.
        count: how many robots are meant, which a real fleet asks for where many may obey.
        only, but: names of robots, or of one.
        sure: whether it is meant as it stands, though the checker doubts it; otherwise names that no robot has give a
            UserWarning.
        by: the operator who sends it, "" for the first (see `operators`); from then on robots hear that this one is
            present, and go on as they are driven.
        at: the instant at which all obey at once, at most an hour ahead: robots store the command and wait. In a
            simulated run its time, in s or as a text such as "12s"; on the air a time of day ("12:30:05"), a datetime,
            or s of Unix time. None for as soon as they hear it.
        """
        if not isinstance(text, str) or is_script(text):
            if standing or deadline is not None or only is not None or but is not None or by or at is not None:
                raise MisuseError(
                    "a script says line by line what is standing, within which time, for whom and by whom: @5s as anna "
                    "standing (...)"
                )
            return self.play(text, wait=wait, everybody=everybody, count=count, sure=sure)
        wait, within = in_seconds(wait, "wait"), None if deadline is None else in_seconds(deadline, "deadline")
        instant = None if at is None else self._instant(at)
        terms = Terms(standing, within, everybody, Audience.of(only, but), anyway=sure, undecided=True, at=instant)
        desk = self._sitting(by)
        prepared = self._prepare(text, terms, desk)
        self._warn(prepared)
        return self._until(self._commit(desk, prepared, count, sure), wait)

    def _instant(self, at: float | str | datetime) -> float:
        """A moment in the time of the desk, s. Raises MisuseError."""
        if isinstance(at, datetime):
            raise MisuseError("a simulated run has no time of day: wanted its time in s, or a text such as 12s")
        return read_seconds(at, "cannot obey at")

    def _commit(self, desk: Station, prepared: Prepared, count: int | None, sure: bool) -> Command:
        with self._turn():
            return desk.commit(prepared, count=count, confirmed=sure)

    # ---- missions

    @property
    def mission(self) -> Mission:
        """The scenario's mission, and what became of each line; empty where there is none, as on the air."""
        from sleepcast.api.mission import Mission

        return Mission()

    def play(
        self,
        script: Mission | str | None = None,
        *,
        wait: float | str = WAIT,
        everybody: bool = False,
        count: int | None = None,
        sure: bool = False,
    ) -> list[CommandResult]:
        """Send each line of a script at its time, and let time pass meanwhile; gives what became of them. Times count
        from the start of a simulated run, and on the air from now; what is late is sent at once.

        Raises MissionError, with the place of the line: before anything is sent for what cannot be read; for what is
        refused at its time, and for a STOP that somebody else has sent meanwhile, when the lines before it were sent. A
        RELEASE ends STOPs of scripts only: one that would meet another STOP is refused before anything is sent, and so
        is, on the air, a RELEASE ALL.

        script: as in a mission file; None for what was not sent yet of the scenario's own mission.
        wait: s that may pass after the last line until all have answered.
        everybody: whether robots on the air are meant even where a line has no test; of simulated ones that is known.
        count, sure: as for `send`.
        """
        from sleepcast.api.mission import Mission
        from sleepcast.loop.mission import readable

        if not isinstance(script, str | Mission | None):
            raise MisuseError(f"wanted a script, as sc.Mission or as a text, not {type(script).__name__}")
        wait = in_seconds(wait, "wait")
        lines = Mission(script) if isinstance(script, str) else self._to_play() if script is None else script
        for line in lines:
            readable(line.order)
            with placed(line.order.place):
                self.desk_of(line.instruction.by)
        self._refuse_release(lines)
        began, results, learned = self._zero(), list[CommandResult](), LearnedNames(self.station.vocabulary)
        known = self._stops()
        for line in lines:
            self._reach(began + line.time)
            order = line.instruction
            with placed(line.order.place):
                if not self._stops() <= known:
                    raise MisuseError("STOP ended the script, and this and what follows was not sent: release it first")
                if order.kind in ("once", "standing"):
                    desk = self.desk_of(order.by)
                    prepared = self._prepare(order.text, self._terms(order, everybody, sure), desk)
                    self._warn(prepared, learned)
                    sent: CommandResult | None = self._until(self._commit(desk, prepared, count, sure), 0.0)
                else:
                    sent = self._order(order, sure)
            self._played(line.order, None if sent is None else sent._command)
            if sent is None:
                continue
            known.add(sent.id)
            self._scripted.add(sent.id)
            results.append(CommandResult(self, sent._command, line.order))
        if results:
            self._until(results[-1]._command, wait)
        return results

    def _refuse_release(self, lines: Mission) -> None:
        """Raises MissionError for a line that would end a STOP which no script has sent, but a person."""
        from sleepcast.loop.mission import RELEASES, is_stopped_by_others

        first = next((line for line in lines if line.instruction.kind in RELEASES), None)
        messages = (command.message for command in self._commands())
        if first is not None and is_stopped_by_others(messages, self._scripted | self._sent_by_desk()):
            with placed(first.order.place):
                raise MisuseError("STOP holds, which no script has sent, so that none ends it: release it first")

    def _sent_by_desk(self) -> set[str]:
        """The ids of what the desk has sent of a mission by itself."""
        return set()

    def _stops(self) -> set[str]:
        """The ids of the STOPs that were sent."""
        return {command.id for command in self._commands() if command.kind is Kind.STOP}

    def _terms(self, order: Instruction, everybody: bool, sure: bool) -> Terms:
        """How a line of a script is meant that commands."""
        audience, standing = Audience.of(order.only, order.but), order.kind == "standing"
        return Terms(standing, order.within, everybody, audience, anyway=sure, undecided=True)

    def _order(self, order: Instruction, sure: bool) -> CommandResult | None:
        """Send another line now; None for HOLD and AWAY, which robots do not answer."""
        match order.kind:
            case "STOP":
                return self.stop(wait=0.0, by=order.by)
            case "RELEASE ALL":
                return self.release(wait=0.0, by=order.by)
            case "ask":
                return self.ask(order.text, wait=0.0, only=order.only, but=order.but, sure=sure, by=order.by)
        from sleepcast.loop.swarm import act_on

        with self._turn():
            sent = cast("Command | None", act_on(self.desk_of(order.by), order))
        return None if sent is None else self._until(sent, 0.0)

    @abstractmethod
    def _played(self, order: Order, sent: Command | None) -> None:
        """A line was sent as this command; None: it has none."""

    def _to_play(self) -> Mission:
        """What was not sent yet of the own mission. Raises MisuseError where there is nothing to send."""
        if not self.mission:
            raise MisuseError("there is no mission to play: give a script, as fleet.play('@5s (ST)')")
        if not self.mission.rest:
            raise MisuseError("all commands of the mission were sent: open the scenario again to play it once more")
        return self.mission.rest

    def _zero(self) -> float:
        """The time from which those of a script count, s."""
        return self.time

    def _reach(self, time: float) -> None:
        """Let time pass until then (s)."""
        self.run(max(0.0, time - self.time), quiet=True)

    def ask(
        self,
        text: str,
        *,
        wait: float | str = WAIT,
        only: Sequence[str] | None = None,
        but: Sequence[str] | None = None,
        sure: bool = False,
        by: str = "",
    ) -> CommandResult:
        """Ask for the value of an expression over the radio; nothing changes on the robots. The answers are in
        `values`. Raises what `Station.ask` raises.

        wait: s that may pass until all have answered.
        only, but: names of robots, or of one.
        sure: whether it is meant as it stands, though the fleet has no such name.
        by: the operator who asks, as for `send`.
        """
        wait, only, desk = in_seconds(wait, "wait"), robot_names(only), self.desk_of(by)
        with self._turn():
            sent = desk.ask(self._checked_question(text, sure, only), only=only, but=but, anyway=sure)
        return self._until(sent, wait)

    def _checked_question(self, text: str, sure: bool, only: Sequence[str] | None) -> str | Checked:
        """A question, checked if that is possible, and warned of."""
        try:
            checked = self.station.check(text, only=only, anyway=sure)
        except SleepcastError:
            return text  # the desk says it, and writes it down
        if not (sure or self.station.unknown_names(checked, only)[0]):
            _warn_of(checked)
        return checked

    def _warn(self, prepared: Prepared, learned: LearnedNames | None = None) -> None:
        """Warn the caller's caller of names that no robot has, unless it is sure, or they are refused.

        learned: what was sent before in the same script, which robots may not have reported yet; it learns this text.
        """
        if prepared.draft.terms.anyway:
            return
        checked, known = prepared.draft.checked, set[int]()
        if learned is not None:
            own = check(checked.text, learned)
            known = {finding.start for finding in checked.findings} - {finding.start for finding in own.findings}
            learned.learn(prepared.draft.program.form)
        if not prepared.unknown:
            _warn_of(checked, known)

    def stop(self, *, wait: float | str = WAIT, by: str = "") -> CommandResult:
        """Stop every body at once, until `release`. by: the operator who stops them, as for `send`."""
        wait, desk = in_seconds(wait, "wait"), self.desk_of(by)
        with self._turn():
            sent = desk.stop()
        return self._until(sent, wait)

    def release(self, *, wait: float | str = WAIT, by: str = "") -> CommandResult:
        """End STOP on every robot, whoever stopped it; nothing old resumes by itself. by: the operator who releases
        them, as for `send`."""
        wait, desk = in_seconds(wait, "wait"), self.desk_of(by)
        with self._turn():
            sent = desk.release_all()
        return self._until(sent, wait)

    @abstractmethod
    def why(self, robot: str, sent: CommandResult | str | None = None) -> Explanation:
        """How a robot evaluated a command (or the id of one; None: its last one), or what a rule of its, by name, would
        do now. Raises SleepcastError where it cannot say."""

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
        """A row for each robot: `robot`, and a column for each expression (none: all sensors), SI. A variable that is
        called `robot` is the column `robot_value`."""
        wanted = expressions or tuple(sensor.name for sensor in self.station.vocabulary.sensors)
        columns: dict[str, Texts | Numbers] = {each: self[each] for each in wanted}
        return DataTable.keyed({"robot": tuple(self.names)}, columns)

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

    async def events(self, seconds: float | str = inf) -> AsyncGenerator[FleetEvent, None]:
        """What robots do from now on, for so many seconds, or until the loop over it ends. Time passes in it; commands
        may be sent meanwhile (`await fleet.asend(...)`). Raises MisuseError for a time that is none."""
        from asyncio import to_thread

        seconds = in_seconds(seconds, "events of")
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

    arun = to_async(run)
    aplay = to_async(play)
    apreview = to_async(preview)
    asend = to_async(send)
    aask = to_async(ask)
    astop = to_async(stop)
    arelease = to_async(release)
    awhy = to_async(why)


@contextmanager
def placed(place: str) -> Iterator[None]:
    """Raises MissionError, with the place of the line, for what is wrong with one."""
    try:
        yield
    except SleepcastError as error:
        from sleepcast.simulator import MissionError  # with scenarios, which no fleet on the air needs

        raise MissionError(f"{place}: {error}") from error


def is_script(text: str) -> bool:
    """Whether a text is a mission script: it begins with a time, as no expression does."""
    lines = (line.partition(";")[0].strip() for line in text.split("\n"))
    return next((line.startswith("@") for line in lines if line), False)


def read_only(values: NDArray[Given]) -> NDArray[Given]:
    """A view that cannot be written through."""
    view = values.view()
    view.flags.writeable = False
    return view
