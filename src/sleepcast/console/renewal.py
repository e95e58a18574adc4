"""Another run on the same page: which scenarios there are, what may be changed of each, and the change from one run to
the next.

A run that is to follow is built beside the server, while time stands still in the old one. Then all pages are told to
load themselves again at the same address, so that nothing of the old run is left on them. The new run is another world:
it waits at its start, and no STOP holds in it. So a run whose STOP is not confirmed is not left, and a STOP that is
pressed while the next one is built keeps the old one.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import field
from types import TracebackType
from typing import Protocol, Self

import msgspec
import numpy as np

from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver, in_thread
from sleepcast.console.features.mission import MissionPlayer
from sleepcast.console.features.plots import ScenarioMeasure
from sleepcast.console.features.renewal import (
    Choices,
    Fork,
    GetSetup,
    Offered,
    Renew,
    Renewed,
    Scenarios,
    SetUp,
    ShownScenario,
)
from sleepcast.console.features.session_test import TestMaker
from sleepcast.console.marks import clock_time
from sleepcast.console.outgoing import DeskMessage, Hello
from sleepcast.console.past import Past
from sleepcast.console.view import PaceControl, SwarmView
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.fleet.marks import is_frozen
from sleepcast.station import Station

# ---- what a page is told


class Building(DeskMessage):
    """Another run is being built: what is done now; "" for nothing."""

    step: str


class Note(DeskMessage):
    """What a person should know of this run, "" for nothing. restart: whether to offer to start it again."""

    text: str
    restart: bool = False


# ---- runs


@dataclass(frozen=True, slots=True)
class ShownRun:
    """A swarm that a page can show, with its desk.

    prepare: see `Driver`
    around: entered when the run is shown, and left when another one is, or the program ends
    measures: of its scenario, see `Plots`
    past: see `Backend`
    tests: makes tests of it
    mission: plays its mission, None if it has none
    """

    swarm: SwarmView
    station: Station
    pace: PaceControl
    prepare: Callable[[], None] | None
    around: AbstractContextManager[object]
    measures: Sequence[ScenarioMeasure] = ()
    past: Past | None = None
    tests: TestMaker | None = None
    mission: MissionPlayer | None = None


@dataclass(frozen=True, slots=True)
class RunRequest:
    """The run that somebody wants; see `Renew`."""

    scenario: str
    seed: int | None = None
    robots: int | None = None
    values: dict[str, float] = field(default_factory=dict)


class RunMaker(Protocol):
    """Makes runs. All of it may take long, and is done by a thread beside the server."""

    @property
    def current(self) -> RunRequest:
        """What the run on the page was made of."""

    def scenarios(self) -> list[ShownScenario]:
        """Those that may be run."""

    def choices(self, scenario: str) -> Choices:
        """What may be changed of one. Raises SleepcastError for one that is not offered."""

    def make(self, request: RunRequest, tell: Callable[[str], None]) -> ShownRun:
        """A run as requested. Raises SleepcastError for what cannot be had.

        request: the run that somebody wants
        tell: told what is done, as it begins; what it raises ends the work
        """

    def fork(self, run: ShownRun, state: bytes) -> ShownRun:
        """A run that goes on from a state of this one. Raises SleepcastError."""


class RunAbandonedError(MisuseError):
    """The run that was being built is not wanted any more."""


class RunSwitcher:
    """The run on the page and those after it. A context, within which runs are shown."""

    def __init__(self, first: ShownRun, maker: RunMaker, clock: Clock, *, waits: bool) -> None:
        self.number = 1
        self.step = ""
        """What is being done to build another run."""
        self._maker, self._clock, self._first, self._run = maker, clock, first, first
        self._around = ExitStack()
        self._changed = asyncio.Event()
        self._given_up = ""
        self.desk = self._desk(first, waits)

    def _desk(self, run: ShownRun, waits: bool) -> RenewableBackend:
        driver = Driver(run.swarm, run.pace, self._clock, run.prepare, waits=waits)
        return RenewableBackend(run, driver, self._clock, self)

    def __enter__(self) -> Self:
        self._around.enter_context(self._first.around)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        return bool(self._around.__exit__(kind, error, trace))

    async def live(self) -> None:
        """Let the run on the page live, and the next one when there is one, until cancelled."""
        while True:
            running = asyncio.ensure_future(self.desk.live())
            changed = asyncio.ensure_future(self._changed.wait())
            try:
                await asyncio.wait({running, changed}, return_when=asyncio.FIRST_COMPLETED)
            finally:
                running.cancel()
                changed.cancel()
                await asyncio.wait({running, changed})
            if not running.cancelled():
                running.result()
                return
            self._changed.clear()

    async def scenarios(self, serial: int) -> Offered:
        return Offered(serial, await in_thread(self._maker.scenarios), self._maker.current.scenario)

    async def choices(self, serial: int, scenario: str) -> SetUp:
        return SetUp(serial, await in_thread(lambda: self._maker.choices(scenario)))

    async def renew(self, serial: int, request: RunRequest | None) -> Renewed:
        """Show another run, as requested or (None) as the one on the page was at its start. Raises SleepcastError; then
        the one on the page goes on."""

        async def make() -> ShownRun:
            return await in_thread(lambda: self._maker.make(request or self._maker.current, self._tell))

        return await self._follow(serial, "Reading the scenario", make)

    async def fork(self, serial: int, time: float) -> Renewed:
        """Show a run that goes on from how this one was at a time. Raises SleepcastError; then this one goes on."""
        past = self.desk.past
        if past is None:
            raise MisuseError("Nothing is kept of this run, so it cannot go on from an earlier moment.")

        async def make() -> ShownRun:
            state = await past.state(past.tick_of(time))
            return await in_thread(lambda: self._maker.fork(self._run, state))

        return await self._follow(serial, "Going back", make)

    async def _follow(self, serial: int, step: str, make: Callable[[], Awaitable[ShownRun]]) -> Renewed:
        if self.step:
            raise MisuseError("Another run is being built already.")
        old = self.desk
        paused = old.driver.pace.paused
        old.driver.set_pace(running=False)
        self.step, self._given_up = step, ""
        try:
            run = await make()
            self._tell(self.step)  # given up at the last moment
            around = ExitStack()
            around.enter_context(run.around)
        except BaseException:
            old.driver.set_pace(running=not paused)
            raise
        finally:
            self.step = ""
        self._around.close()
        self._around = around
        self.number += 1
        self._run = run
        self.desk = self._desk(run, waits=True)
        self.desk.alerts.adopt(old.alerts)
        if run.past is not None and run.past.other is not None:
            self.desk.plots.go_on(old.plots, run.past.other.tick * run.past.tick)
        old.over = True
        self._changed.set()
        return Renewed(serial)

    def _tell(self, step: str) -> None:
        """Called by the thread that builds."""
        if self._given_up:
            raise RunAbandonedError(self._given_up)
        self.step = step

    def give_up(self, why: str) -> None:
        """Go on with the run on the page, whatever is being built."""
        self._given_up = why


class RenewableBackend(Backend):
    """The desk of a run that another one may follow. over: whether one has."""

    def __init__(self, run: ShownRun, driver: Driver, clock: Clock, runs: RunSwitcher) -> None:
        super().__init__(
            run.swarm, run.station, driver, clock, measures=run.measures, past=run.past, mission=run.mission
        )
        self.over = False
        self.tests = run.tests
        self._runs, self._number = runs, runs.number

    def hello(self) -> Hello:
        """What a page needs first. Pages of another run load themselves again."""
        return msgspec.structs.replace(super().hello(), run=self._number)

    def stop(self, by: str = "") -> None:
        super().stop(by)
        self._runs.give_up("STOP was pressed: the new run was not started, and STOP holds in this one.")

    async def scenarios(self, asked: Scenarios) -> Offered:
        """Which scenarios there are."""
        return await self._runs.scenarios(asked.serial)

    async def choices(self, asked: GetSetup) -> SetUp:
        """What may be changed of one."""
        return await self._runs.choices(asked.serial, asked.scenario)

    async def renew(self, asked: Renew) -> Renewed:
        """Start another run. Raises SleepcastError; then this one goes on."""
        self._refuse_doubt()
        seed = None if asked.seed is None else int(asked.seed)
        same = not asked.scenario
        request = None if same else RunRequest(asked.scenario, seed, asked.robots, asked.values)
        return await self._runs.renew(asked.serial, request)

    async def fork(self, asked: Fork) -> Renewed:
        """Let the run go on from an earlier moment. Raises SleepcastError; then this one goes on."""
        self._refuse_doubt()
        return await self._runs.fork(asked.serial, asked.time)

    def _refuse_doubt(self) -> None:
        """Raise MisuseError while it is not clear whether STOP is obeyed."""
        stop = self.accounts.stop()
        if stop is not None and not self.accounts.desk_of(stop).accounting(stop.id).complete:
            raise MisuseError(
                "STOP was sent, and not all robots have confirmed it yet. Let time run until they have, "
                "or release STOP; then start the new run."
            )

    def news(self, watched: int) -> Iterator[DeskMessage]:
        """Everything that may have changed."""
        if self.over:
            yield Renewed()
            return
        yield Building(self._runs.step)
        yield self._note()
        yield from super().news(watched)

    def _note(self) -> Note:
        if self.past is not None and self.past.other is not None:
            if self.driver.waiting:
                at = clock_time(self.past.other.tick * self.past.tick)
                seen = "The other future is on the map and in the plots."
                return Note(f"This run goes on from {at}: start it, or send a command. {seen}")
        elif self._number > 1 and self.driver.waiting:
            return Note("This is a new run, another world: nothing that was sent before holds in it, STOP neither.")
        return self._immobile()

    def _immobile(self) -> Note:
        """What to say where no robot can move any more, since bodies cannot."""
        nobody = np.zeros(len(self.swarm.minds), np.bool_)
        exhausted, crashed = (
            nobody if each is None else each for each in (self.swarm.exhausted(), self.swarm.crashed())
        )
        if not (exhausted | crashed).any():
            return Note("")
        frozen = is_frozen(self.swarm.minds)
        if not (exhausted | crashed | frozen).all():
            return Note("")
        supplies = " or ".join(self.swarm.scene.supplies)
        why = [
            f"{count:,} {what}"
            for which, what in (
                (crashed, "have crashed"),
                (exhausted & ~crashed, f"have no {supplies} left"),
                (frozen & ~exhausted & ~crashed, "are frozen"),
            )
            if (count := int(np.count_nonzero(which)))
        ]
        return Note(f"No robot can move any more: {', and '.join(why)}.", restart=True)
