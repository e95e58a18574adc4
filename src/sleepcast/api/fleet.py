"""One object that is a whole run: a fleet in its world, its time, and the operator's desk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from functools import cached_property
from math import isfinite
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.assembly import Common, assemble, assemble_from, others_of, warm_up
from sleepcast.api.commands import Fleet, read_only
from sleepcast.api.history import History
from sleepcast.api.mission import Mission
from sleepcast.api.payload import payload_of
from sleepcast.api.picture import picture
from sleepcast.api.progress import steps
from sleepcast.api.results import CommandResult
from sleepcast.core.errors import MisuseError
from sleepcast.core.given_numbers import in_seconds, read_seconds
from sleepcast.core.ticks import Every, tick_at
from sleepcast.fleet.queries import MAX_QUERIES
from sleepcast.language import Checked, CheckError, Explanation
from sleepcast.language.evaluate import is_true
from sleepcast.loop import Swarm, load, save, snapshot
from sleepcast.loop.mission import MissionLog
from sleepcast.loop.population import add_robot
from sleepcast.loop.rerun import InputLog, Inputs
from sleepcast.simulator import Changes, Payload, Scenario, World, find_scenario, read_scenario
from sleepcast.simulator.scenario.mission import Instruction, Order
from sleepcast.simulator.scenario.robot_settings import MAX_TIME
from sleepcast.station import Command, Station
from sleepcast.station.prepared import Terms

if TYPE_CHECKING:
    from sleepcast.api.recording import RunRecording
    from sleepcast.notebook import NotebookDesk


class SimulatedFleet(Fleet):
    """A simulated fleet and its operator's desk; `open` and `resume` make one.

    swarm, station: the parts, for what is not offered here.
    """

    def __init__(self, swarm: Swarm, station: Station) -> None:
        super().__init__(station)
        self.swarm = swarm
        self._histories: list[tuple[Every, History]] = []
        """What is sampled, and when."""
        self._checked: dict[str, tuple[int, Checked, CheckError | None]] = {}
        """`FleetState.turns`, what the checker said of expressions then, and what is raised for them."""
        self._inputs: InputLog | None = None
        """All that came from outside since the start; None for a fleet whose start nobody saw."""
        self._recording: RunRecording | None = None

    def _watch_inputs(self, earlier: Inputs | None = None) -> None:
        """Keep what comes from outside from now on. earlier: what came before; None before the first tick."""
        self._inputs = InputLog(self.swarm)
        if earlier is not None:
            self._inputs.begin_with(earlier)
        self.swarm.witnesses.append(self._inputs)

    @property
    def _only_inputs(self) -> Inputs | None:
        """What came from outside since the start, if its scenario, its seed and its state between two ticks are all
        else that there is of the fleet; None if somebody watches it, or its desk has heard what no state keeps."""
        swarm, desks = self.swarm, [self.station, *others_of(self.swarm)]
        watched = swarm.witnesses != [self._inputs] or swarm.senders or swarm.refused or self._recording
        if watched or not swarm.whole or any(desk.listeners or desk.failures.names for desk in desks):
            return None
        return None if self._inputs is None else self._inputs.inputs

    def _dissolve(self) -> None:
        """Let go of all at once, for those whose fleet nobody else has: its parts know each other, so that otherwise
        it would wait in memory for the garbage collector."""
        swarm, fleet, bodies = self.swarm, self.swarm.fleet, self.swarm.simulator.bodies
        minds = fleet, fleet.memory, fleet.bids, fleet.timing
        for part in (self, swarm, *swarm.desks, *minds, bodies, *bodies.parts, vars(swarm).get("quiet")):
            if part is not None:
                vars(part).clear()

    # ---- time

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.swarm.now()

    def run(self, seconds: float | str, *, quiet: bool = False) -> SimulatedFleet:
        """Let simulated time pass, as fast as possible; gives the fleet itself. It passes in ticks of the scenario, so
        it ends on the tick that is nearest; what is left over is carried to the next `run`. Raises MisuseError for a
        time that is none.

        seconds: for how long, s, or a text such as "30s".
        quiet: whether to show no progress bar.
        """
        count = self.swarm.carried.ticks(read_seconds(seconds, "cannot run for", MAX_TIME))
        with closing(steps(count, self.swarm.simulator.scenario.name, quiet=quiet)) as ticks:
            reached = 0
            for number in ticks:
                if number == reached:
                    reached += self._advance(count - number)
        self._changed()
        return self

    def _step(self, most: int) -> int:
        """Let ticks pass, at least one and at most so many; gives how many."""
        tick = self.swarm.simulator.tick
        made = self.swarm.advance(min([most, *(every.following(tick) - tick for every, _ in self._histories)]))
        for every, history in self._histories:
            if every.due(self.swarm.simulator.tick):
                self._sample(history)
        return made

    def _tick(self) -> None:
        self._step(1)

    def _advance(self, most: int) -> int:
        """The same, in turn with other threads; whoever shows the fleet learns of it."""
        with self._turn():
            made = self._step(most)
        self._changed(soon=True)
        return made

    def _pass(self) -> None:
        self._advance(1)

    def _until(self, sent: Command, seconds: float) -> CommandResult:
        until, result = self.time + seconds, CommandResult(self, sent)
        while self.time < until and not result.account.complete:
            self._pass()
        self._changed()
        return result

    def why(self, robot: str, sent: CommandResult | str | None = None) -> Explanation:
        if isinstance(sent, CommandResult):
            return self.desk_of(sent.by).why(robot, sent.id)
        meant = (each for each in reversed(self._commands()) if sent in (None, each.id))
        by = next((each.message.sender for each in meant), self.station.operator)
        return self.desk_of(by).why(robot, sent)

    # ---- operators

    @property
    def operators(self) -> dict[str, str]:
        return {name: role.value for name, role in self.swarm.operators.items()}

    def desk_of(self, operator: str) -> Station:
        return self.station if operator == self.station.operator else cast(Station, self.swarm.desk_of(operator))

    def _sitting(self, operator: str) -> Station:
        """See `Fleet`: a program is an open desk, so that what it drives goes on."""
        desk = self.desk_of(operator)
        desk.hold(True)
        return desk

    def _commands(self) -> list[Command]:
        return cast("list[Command]", self.swarm.commands())

    # ---- the mission

    @cached_property
    def _mission(self) -> MissionLog:
        """What was sent of the mission, for whoever asks."""
        swarm, scenario = self.swarm, self.swarm.simulator.scenario
        return MissionLog(scenario.mission, swarm.commands, scenario.tick, swarm.given, self.station.operator)

    @property
    def mission(self) -> Mission:
        commands = {command.id: command for command in self._commands()}
        orders, sent = self._mission.orders, self._mission.sent()
        return Mission.of(
            orders,
            {
                number: CommandResult(self, commands[message.id], orders[number])
                for number, message in sent.items()
                if message.id in commands
            },
            self._mission.wordless(),
        )

    def _to_play(self) -> Mission:
        rest = super()._to_play()
        self.swarm.mission.clear()  # what the desk was to send by itself is among them
        self.swarm.halted = False
        return rest

    def _sent_by_desk(self) -> set[str]:
        return {sent for _, sent in self.swarm.given}

    def _played(self, order: Order, sent: Command | None) -> None:
        if sent is None:
            self.swarm.given.append((order, ""))
        elif order in self._mission.orders:
            self._mission.note(self._mission.orders.index(order), sent.message)

    def _zero(self) -> float:
        return 0.0

    def _reach(self, time: float) -> None:
        """Let ticks pass until the one that ends at `time` is next: what is sent then is on the air in it."""
        simulator = self.swarm.simulator
        while simulator.tick + 1 < tick_at(time, simulator.scenario.tick):
            self._pass()

    def _terms(self, order: Instruction, everybody: bool, sure: bool) -> Terms:
        if order.within is not None:  # sent before the tick in which it is on the air
            order = order._replace(within=order.within + self.swarm.simulator.scenario.tick)
        return super()._terms(order, True, sure)

    # ---- what is so now

    @property
    def _there(self) -> NDArray[np.bool_] | slice:
        """The rows with a robot, of the swarm's columns."""
        present = self.swarm.fleet.state.present
        return slice(None) if present is None else present

    @property
    def names(self) -> Sequence[str]:
        names = self.swarm.simulator.names
        return names if self.swarm.simulator.population is None else tuple(filter(None, names))

    @property
    def world(self) -> World:
        """The obstacles. They may be added, moved and removed between two ticks; sonars and bumpers feel it at once."""
        return self.swarm.simulator.world

    def add_robot(
        self, kind: str = "", x: float | None = None, y: float | None = None, heading: float | None = None
    ) -> str:
        """Add a robot, and give its name. It is as one of its table in the scenario is at the start, is stopped if a
        STOP of anybody lasts, and is told the standing commands in the next tick. Raises MisuseError where there is no
        room: for another one (`most` in the scenario), or in its place.

        kind: its type, "" where robots of one type only can be added.
        x, y: where it stands, m; None for a place by chance, as the scenario says.
        heading: rad, None for one by chance.
        """
        with self._turn():
            name = add_robot(self.swarm, kind, x, y, heading)
        self._changed()
        return name

    @property
    def x(self) -> NDArray[np.float64]:
        return read_only(self.swarm.simulator.x[self._there].copy())

    @property
    def y(self) -> NDArray[np.float64]:
        return read_only(self.swarm.simulator.y[self._there].copy())

    @property
    def heading(self) -> NDArray[np.float64]:
        return read_only(self.swarm.simulator.bodies.heading[self._there].copy())

    @property
    def z(self) -> NDArray[np.float64]:
        """m above the origin; 0 of robots that do not fly."""
        flight = self.swarm.simulator.bodies.flight
        return read_only(np.zeros_like(self.x) if flight is None else np.nan_to_num(flight.z[self._there]))

    @property
    def velocity(self) -> NDArray[np.float64]:
        """True velocity over the ground, to the east and to the north, m/s, shape (2, robots)."""
        return read_only(self.swarm.simulator.bodies.velocity()[:, self._there])

    @property
    def pitch(self) -> NDArray[np.float64] | None:
        """How far the direction of each particle points up, rad; None of other robots."""
        flight = self.swarm.simulator.bodies.flight
        return None if flight is None or flight.pitch is None else read_only(flight.pitch[self._there].copy())

    def __getitem__(self, expression: str) -> NDArray[np.float64]:
        """See `Fleet`: no radio is needed, and nothing changes."""
        self.checked(expression)
        with self._turn():
            return self._values(expression)

    def checked(self, expression: str) -> Checked:
        """What is known of an expression before it is evaluated; nothing new is, as long as no robot's mind changes.
        Raises ReadError, and CheckError for names that no robot has."""
        turns = self.swarm.fleet.state.turns
        before, checked, error = self._checked.get(expression, (-1, None, None))
        if checked is None or before != turns:
            if len(self._checked) >= MAX_QUERIES:
                self._checked.clear()
            checked = self.station.check(expression)
            error = CheckError(checked.findings, expression, checked.more) if checked.unknown else None
            self._checked[expression] = turns, checked, error
        if error is not None:
            raise error.with_traceback(None)
        return checked

    def _values(self, expression: str) -> NDArray[np.float64]:
        return read_only(self.swarm.values_of(expression)[self._there])

    def _members(self) -> dict[str, tuple[str, ...]]:
        names = np.array(self.swarm.simulator.names)
        groups = {key: tuple(names[members].tolist()) for key, members in self.swarm.fleet.groups.items()}
        return {key: members for key, members in sorted(groups.items()) if members}

    @property
    def stopped(self) -> NDArray[np.bool_]:
        return read_only(self.swarm.fleet.stopped[self._there].copy())

    @property
    def hash(self) -> str:
        """Equal for equal states: the same scenario, seed and commands give the same one on every machine."""
        return self.swarm.simulator.state_hash()

    def history(self, *expressions: str, every: float | str = 1.0) -> History:
        """Sample expressions on all robots from now on: at once, and on the first tick at or after each multiple of
        `every`. Raises what `fleet[...]` raises, and MisuseError for a time that is less than a tick of the scenario.

        expressions: what is sampled, a column each.
        every: simulated s between two samples.
        """
        tick, every = self.swarm.simulator.scenario.tick, in_seconds(every, "every")
        if not expressions or not isfinite(every) or round(every / tick) < 1:
            raise MisuseError(
                f"history needs expressions, and `every` of a tick ({tick:g} s) or more: got "
                f"{len(expressions)} expressions every {every:g} s"
            )
        for each in expressions:
            self[each]  # what is wrong with it is said now
        history = History(self.names, expressions, every)
        with self._turn():
            self._sample(history)
            self._histories.append((Every(every, tick), history))
        return history

    def _sample(self, history: History) -> None:
        history.take(self.time, np.array([self._values(each) for each in history.expressions]), self.names)

    # ---- kept, forked, closed

    def snapshot(self) -> bytes:
        """The whole run between two ticks; `resume` goes on from it. Raises MisuseError for robots of a class of one's
        own, whose state nobody knows."""
        self._check_whole()
        return snapshot(self.swarm)

    def save(self, file: str | PathLike[str]) -> None:
        """The same into a file. Raises SnapshotLostError where it cannot be written."""
        save(self.snapshot(), Path(file))

    def _check_whole(self) -> None:
        if self.swarm.simulator.payload is not None:
            raise MisuseError(
                "robots of a class of your own cannot be saved, forked or recorded, because only the class knows their "
                "state: open the fleet again with the same seed"
            )

    def fork(self, seed: int | None = None) -> SimulatedFleet:
        """A second run with the same past.

        seed: another one gives it other random numbers from here on; None keeps them, so that all differences come from
            what you do.
        """
        return resume(self.snapshot(), seed=seed)

    def record(
        self,
        file: str | PathLike[str],
        *,
        pictures: float | str | None = None,
        readings: float | str | None = None,
        rotate: str | None = None,
    ) -> RunRecording:
        """Record the run into an MCAP file from now on, until `close` of the recording or of the fleet. What goes wrong
        later is logged by the logger `sleepcast`. Raises MisuseError for a file that exists already and for robots of a
        class of one's own, RecordingError where none can be made.

        pictures, readings: simulated s between two of them; None: as the scenario's speed suggests.
        rotate: when another file begins, as "100MB,10min".
        """
        from sleepcast.api.recording import RecordingPlan, RunRecording
        from sleepcast.simulator.recording.recorder import ONE_FILE, read_rotation

        self._check_whole()
        pictures, readings = (None if each is None else in_seconds(each, "every") for each in (pictures, readings))
        plan = RecordingPlan(Path(file), pictures, readings, ONE_FILE if rotate is None else read_rotation(rotate))
        with self._turn():
            self._recording = RunRecording(self.swarm, self.station, plan)
        return self._recording

    def save_test(
        self, folder: str | PathLike[str], *, counts: Sequence[str] = (), goals: Sequence[str] = (), exact: bool = False
    ) -> Path:
        """Save what was sent and what became of it as a test in a new folder, which `sleepcast run` repeats; gives the
        folder. What was done past the desks, as `swarm.evaluate`, is not in it. Raises MisuseError for a folder that
        exists, and for a run that cannot be repeated.

        counts: expressions that shall be true of as many robots at the end as they are now.
        goals: what else shall hold then, as "share (IN bravo) >= 0.9".
        exact: whether the final state must match exactly, bit for bit.
        """
        from sleepcast.api.session_test import session_files, write_files

        if self._inputs is None:
            raise MisuseError("a test begins with its scenario: this fleet goes on from a snapshot, or is a fork")
        target = Path(folder)
        counts, goals = ((each,) if isinstance(each, str) else each for each in (counts, goals))
        as_now = [f"count {each} == {int(np.count_nonzero(is_true(self[each])))}" for each in counts]
        home = target.resolve()
        with self._turn():
            inputs, wanted = self._inputs.inputs, [*as_now, *goals]
            files = session_files(self.swarm, self.station, inputs, home.name, goals=wanted, exact=exact, home=home)
        write_files(target, files)
        return target

    def close(self) -> None:
        """Stop sampling and recording."""
        self._histories.clear()
        if self._recording is not None:
            self._recording.close()

    # ---- shown

    def __repr__(self) -> str:
        scenario, simulator = self.swarm.simulator.scenario, self.swarm.simulator
        groups = ", ".join(f"{name} {len(members)}" for name, members in self.groups.items())
        mission = self.mission.sentence(by_itself=bool(self.swarm.mission), halted=self.swarm.halted)
        return (
            f"{scenario.name}: {len(self):,} robots after {self.time:g} s, seed {simulator.seed}"
            f"{f'; groups: {groups}' if groups else ''}{f'; {mission}' if mission else ''}"
        )

    def _repr_html_(self) -> str:
        return picture(self.swarm, repr(self))

    def _make_desk(self) -> NotebookDesk:
        from sleepcast.notebook import simulated_desk

        return simulated_desk(self.swarm, self.station, self._tick, self._turn, self._mission)


def open(
    scenario: str | PathLike[str] | Scenario,
    *,
    seed: int | None = None,
    robots: int | type | str | None = None,
    area_per_robot: float | None = None,
    walls: bool = True,
    over: Mapping[str, object] | None = None,
    mission: bool = False,
    threads: int | None = None,
) -> SimulatedFleet:
    """A simulated fleet at the start of its scenario. Raises MisuseError for no such scenario, SettingsError for what
    is wrong in it.

    scenario: a name of the gallery, the path of a folder or file, TOML text, or a `Scenario`.
    seed: what all chance depends on; None for the scenario's.
    robots: their number, or a class with @sensor, @actuator, @function and @command that adds to each of them, or the
        name of one that an installed package adds.
    area_per_robot: m2; a change of the scenario, as `walls` is.
    walls: whether there is anything solid.
    over: any of its keys, each with what it says instead, as {"radio.loss": 0.3}.
    mission: whether the desk sends the scenario's own commands by itself, at their times, until a `stop`; else
        `SimulatedFleet.play` does.
    threads: None is one for each core; any number gives the same bits.
    """
    count, payload = (None, payload_of(robots)) if isinstance(robots, type | str) else (robots, None)
    changes = Changes(count, area_per_robot, walls, seed, changed(over))
    chosen = _chosen(scenario, changes)
    return opened(chosen, changes.seed, mission=mission, threads=threads, payload=payload)


def opened(
    scenario: Scenario,
    seed: int | None,
    *,
    mission: bool,
    threads: int | None,
    payload: Payload | None = None,
    common: Common | None = None,
) -> SimulatedFleet:
    """The fleet that `open` gives in this scenario, see `assemble`."""
    warm_up(scenario, threads)
    parts = assemble(scenario, seed, mission=mission, threads=threads, payload=payload, common=common)
    fleet = SimulatedFleet(*parts)
    fleet._watch_inputs()
    return fleet


def _chosen(scenario: str | PathLike[str] | Scenario, changes: Changes) -> Scenario:
    if isinstance(scenario, Scenario):
        if changes != Changes(seed=changes.seed):
            raise MisuseError("a Scenario object is taken as it is: give its name, path or text to change it")
        return scenario
    if isinstance(scenario, str) and "\n" in scenario:
        return read_scenario(scenario, changes)
    return find_scenario(fspath(scenario), changes)


def changed(over: Mapping[str, object] | None) -> tuple[tuple[str, object], ...]:
    """The keys that a caller changes; NumPy's single values are plain ones. Raises MisuseError for what names none."""
    if not isinstance(over or {}, Mapping):
        raise MisuseError(f'over {over!r:.80}: wanted keys with what they say instead, such as {{"radio.loss": 0.3}}')
    for key in over or ():
        if not isinstance(key, str):
            raise MisuseError(f"over {key!r:.80}: wanted a key such as radio.loss or commands[0].title")
    single = (np.generic, np.ndarray)
    return tuple(
        (key, each.item() if isinstance(each, single) and not each.ndim else each) for key, each in (over or {}).items()
    )


def resume(
    snapshot: bytes | str | PathLike[str], *, seed: int | None = None, threads: int | None = None
) -> SimulatedFleet:
    """A fleet that goes on from a snapshot, or from the file of one, to the last bit; with another seed, as a fork.
    Raises SnapshotError."""
    if isinstance(snapshot, bytes):
        return SimulatedFleet(*assemble_from(snapshot, seed, threads))
    name = fspath(snapshot)
    return SimulatedFleet(*assemble_from(load(Path(name)), seed, threads, name=name))
