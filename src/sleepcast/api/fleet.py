"""One object that is a whole run: a fleet in its world, its time, and the operator's desk."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from math import isfinite
from os import PathLike, fspath
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.assembly import assemble, assemble_from, warm_up
from sleepcast.api.history import History
from sleepcast.api.picture import picture
from sleepcast.api.progress import steps
from sleepcast.api.table import DataTable
from sleepcast.core.errors import MisuseError
from sleepcast.language import CheckError, Explanation
from sleepcast.language.parts import acts
from sleepcast.loop import Swarm, load, save, snapshot
from sleepcast.simulator import Changes, Scenario, find_scenario, read_scenario
from sleepcast.station import Account, Command, Preview, Station

WAIT = 2.0
"""Seconds for which a command waits for answers: robots answer at once, and a lossy radio asks them again."""

Given = TypeVar("Given", bound=np.generic)


class CommandResult:
    """A command that was sent, with what has become of it so far; it goes on counting while the fleet runs."""

    def __init__(self, station: Station, command: Command) -> None:
        self._station, self._command = station, command

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
        return self._station.accounting(self.id)

    @property
    def matched(self) -> tuple[str, ...]:
        """The robots that obeyed; of a question, that answered; of STOP, that are stopped."""
        return self.account.matched

    @property
    def not_matched(self) -> tuple[str, ...]:
        """The robots that decided that it was not for them."""
        return self.account.not_matched

    @property
    def fault(self) -> tuple[str, ...]:
        """The robots on which something went wrong."""
        return self.account.fault

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
        `Station.why` raises."""
        return self._station.why(robot, self.id)

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


class SimulatedFleet:
    """A simulated fleet and its operator's desk; `open` and `resume` make one.

    swarm, station: the parts, for what is not offered here.
    """

    def __init__(self, swarm: Swarm, station: Station) -> None:
        self.swarm, self.station = swarm, station
        self._histories: list[tuple[int, History]] = []

    # ---- time

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.swarm.now()

    def run(self, seconds: float, *, quiet: bool = False) -> SimulatedFleet:
        """Let simulated time pass, as fast as possible; gives the fleet itself. quiet: without a progress bar. Raises
        MisuseError for a time that is none."""
        if not (isfinite(seconds) and seconds >= 0.0):
            raise MisuseError(f"cannot run for {seconds} s: wanted a number of simulated seconds, 0 or more")
        count = round(seconds / self.swarm.simulator.scenario.tick)
        with closing(steps(count, self.swarm.simulator.scenario.name, quiet=quiet)) as ticks:
            for _ in ticks:
                self._step()
        return self

    async def arun(self, seconds: float, *, quiet: bool = False) -> SimulatedFleet:
        """The same for a program with asyncio: the run is on a thread of its own."""
        from asyncio import to_thread  # loading it takes longer than the rest of this module

        return await to_thread(self.run, seconds, quiet=quiet)

    def _step(self) -> None:
        self.swarm.step()
        for ticks, history in self._histories:
            if self.swarm.simulator.tick % ticks == 0:
                self._sample(history)

    def _until(self, sent: CommandResult, seconds: float) -> CommandResult:
        """Let time pass until everybody has answered, for so long at most."""
        until = self.time + seconds
        while self.time < until and not sent.account.complete:
            self._step()
        return sent

    # ---- the operator's desk

    def preview(self, text: str) -> Preview:
        """Who would obey an expression now, by what robots last reported to the desk: `yes`, `no`, and `unknown` with
        the reasons. Nothing is sent. A text that does nothing, as `(> fuel 50%)`, is taken for a test. Raises ReadError
        and CheckError for a text that no robot could run."""
        root = self.station.check(text).required()
        return self.station.preview(f"(WHEN {text} 1)" if root.test is None and not acts(root.root) else text)

    def send(
        self,
        text: str,
        *,
        wait: float = WAIT,
        standing: bool = False,
        deadline: float | None = None,
        everybody: bool = False,
        only: Sequence[str] | None = None,
        but: Sequence[str] | None = None,
        sure: bool = False,
    ) -> CommandResult:
        """Broadcast an expression. wait: simulated seconds that may pass until all have answered; 0 sends several at
        the same moment. sure: it is meant as it stands, though the checker doubts it. The rest, and what is raised: see
        `Station.send`."""
        return self._until(
            self._sent(
                self.station.send(
                    text,
                    standing=standing,
                    deadline=deadline,
                    everybody=everybody,
                    only=only,
                    but=but,
                    confirmed=sure,
                )
            ),
            wait,
        )

    def ask(
        self, text: str, *, wait: float = WAIT, only: Sequence[str] | None = None, but: Sequence[str] | None = None
    ) -> CommandResult:
        """Ask for the value of an expression over the radio; nothing changes on the robots. The answers are in
        `values`. Raises what `Station.ask` raises."""
        return self._until(self._sent(self.station.ask(text, only=only, but=but)), wait)

    def stop(self, *, wait: float = WAIT) -> CommandResult:
        """Stop every body at once, until `release`."""
        return self._until(self._sent(self.station.stop()), wait)

    def release(self, *, wait: float = WAIT) -> CommandResult:
        """End STOP on every robot; nothing old resumes by itself."""
        return self._until(self._sent(self.station.release()), wait)

    def why(self, robot: str, sent: CommandResult | None = None) -> Explanation:
        """How a robot evaluated a command (None: its last one)."""
        return self.station.why(robot, None if sent is None else sent.id)

    def _sent(self, command: Command) -> CommandResult:
        return CommandResult(self.station, command)

    # ---- what is so now

    @property
    def names(self) -> Sequence[str]:
        """The robots, in the order of all arrays."""
        return self.swarm.simulator.names

    def __len__(self) -> int:
        return len(self.names)

    @property
    def x(self) -> NDArray[np.float64]:
        """Where the robots are, m to the east, shape (robots,), read-only."""
        return _read_only(self.swarm.simulator.x)

    @property
    def y(self) -> NDArray[np.float64]:
        """The same to the north."""
        return _read_only(self.swarm.simulator.y)

    @property
    def heading(self) -> NDArray[np.float64]:
        """Where they look, rad, counter-clockwise from east."""
        return _read_only(self.swarm.simulator.bodies.heading)

    def __getitem__(self, expression: str) -> NDArray[np.float64]:
        """What an expression comes to on each robot now: a sensor, a variable, or anything that only reads, as
        `fleet["fuel"]` or `fleet["(DIST x y 0 0)"]`. SI, NaN for unknown, shape (robots,). No radio is needed, and
        nothing changes. Raises ReadError, CheckError, and FleetError for what would do something."""
        checked = self.station.check(expression)
        if checked.unknown:
            raise CheckError(checked.findings, expression, checked.more)
        return self._values(expression)

    def _values(self, expression: str) -> NDArray[np.float64]:
        self.swarm.sense()
        return _read_only(self.swarm.fleet.values_of(expression))

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """The members of each group."""
        names = np.array(self.names)
        found = {key: tuple(names[members].tolist()) for key, members in self.swarm.fleet.groups.items()}
        return {key: members for key, members in sorted(found.items()) if members}

    @property
    def stopped(self) -> NDArray[np.bool_]:
        """Which robots STOP holds, shape (robots,)."""
        return _read_only(self.swarm.fleet.stopped)

    @property
    def hash(self) -> str:
        """Equal for equal states: the same scenario, seed and commands give the same one on every machine."""
        return self.swarm.simulator.state_hash()

    def table(self, *expressions: str) -> DataTable:
        """A row for each robot: `robot`, and a column for each expression (none: all sensors), SI."""
        wanted = expressions or tuple(sensor.name for sensor in self.swarm.vocabulary.sensors)
        return DataTable({"robot": tuple(self.names)} | {each: self[each] for each in wanted})

    def history(self, *expressions: str, every: float = 1.0) -> History:
        """Sample expressions on all robots from now on, every so many simulated seconds. Raises what `fleet[...]`
        raises, and MisuseError for a time that is no tick of the scenario."""
        tick = self.swarm.simulator.scenario.tick
        ticks = round(every / tick) if isfinite(every) else 0
        if not expressions or ticks < 1:
            raise MisuseError(
                f"history needs expressions, and `every` of a tick ({tick:g} s) or more: got "
                f"{len(expressions)} expressions every {every:g} s"
            )
        for each in expressions:
            self[each]  # what is wrong with it is said now
        history = History(tuple(self.names), expressions, ticks * tick)
        self._sample(history)
        self._histories.append((ticks, history))
        return history

    def _sample(self, history: History) -> None:
        history.take(self.time, np.array([self._values(each) for each in history.expressions]))

    # ---- kept, forked, closed

    def snapshot(self) -> bytes:
        """The whole run between two ticks; `resume` goes on from it."""
        return snapshot(self.swarm)

    def save(self, file: str | PathLike[str]) -> None:
        """The same into a file. Raises SnapshotLostError where it cannot be written."""
        save(self.snapshot(), Path(file))

    def fork(self, seed: int | None = None) -> SimulatedFleet:
        """A second run with the same past. seed: another one gives it another chance from here on; None keeps it the
        same, so that all differences come from what you do."""
        return resume(self.snapshot(), seed=seed)

    def close(self) -> None:
        """Stop sampling."""
        self._histories.clear()

    def __enter__(self) -> SimulatedFleet:
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()

    # ---- shown

    def __repr__(self) -> str:
        scenario, simulator = self.swarm.simulator.scenario, self.swarm.simulator
        groups = ", ".join(f"{name} {len(members)}" for name, members in self.groups.items())
        return (
            f"{scenario.name}: {len(self):,} robots after {self.time:g} s, seed {simulator.seed}"
            f"{f'; groups: {groups}' if groups else ''}"
        )

    def _repr_html_(self) -> str:
        return picture(self.swarm, repr(self))


def open(
    scenario: str | PathLike[str] | Scenario,
    *,
    seed: int | None = None,
    robots: int | None = None,
    area_per_robot: float | None = None,
    walls: bool = True,
    mission: bool = False,
    threads: int | None = None,
) -> SimulatedFleet:
    """A simulated fleet at the start of its scenario.

    scenario: a name of the gallery, the path of a folder or file, TOML text, or a `Scenario`. seed: what all chance
    depends on, None for the scenario's. robots, area_per_robot (m2), walls: changes of the scenario. mission: whether
    the desk sends the scenario's own commands. threads: None is one for each core; any number gives the same bits.
    Raises MisuseError for no such scenario, SettingsError for what is wrong in it.
    """
    changes = Changes(robots, area_per_robot, walls, seed)
    if isinstance(scenario, Scenario):
        if changes != Changes(seed=seed):
            raise MisuseError("a Scenario object is taken as it is: give its name, path or text to change it")
        found = scenario
    elif isinstance(scenario, str) and "\n" in scenario:
        found = read_scenario(scenario, changes)
    else:
        found = find_scenario(fspath(scenario), changes)
    warm_up(found, threads)
    return SimulatedFleet(*assemble(found, seed, mission=mission, threads=threads))


def resume(
    snapshot: bytes | str | PathLike[str], *, seed: int | None = None, threads: int | None = None
) -> SimulatedFleet:
    """A fleet that goes on from a snapshot, or from the file of one, to the last bit; with another seed, as a fork.
    Raises SnapshotError."""
    if isinstance(snapshot, bytes):
        return SimulatedFleet(*assemble_from(snapshot, seed, threads))
    name = fspath(snapshot)
    return SimulatedFleet(*assemble_from(load(Path(name)), seed, threads, name=name))


def _read_only(values: NDArray[Given]) -> NDArray[Given]:
    """A view that cannot be written through."""
    view = values.view()
    view.flags.writeable = False
    return view
