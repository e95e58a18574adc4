"""Many worlds of one scenario: each is a fleet of its own, and equals the same run opened alone, bit for bit.

They have nothing in common but time. A world in which something goes wrong is left out from then on, with its reason;
the others go on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import product
from math import ceil, prod
from os import PathLike, fspath
from typing import NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.assembly import Common
from sleepcast.api.commands import WAIT
from sleepcast.api.fleet import SimulatedFleet, changed, open
from sleepcast.api.history import History
from sleepcast.api.progress import steps
from sleepcast.api.resting import KeptWorld, WorldStart
from sleepcast.api.results import CommandResult
from sleepcast.api.table import DataTable, Numbers, Texts
from sleepcast.core.errors import MisuseError, SleepcastError, reason_of
from sleepcast.core.garbage import sought_seldom
from sleepcast.core.given_numbers import in_seconds, read_seconds, read_seed, whole_number
from sleepcast.core.threads import ThreadPool, borders
from sleepcast.core.ticks import nearest_ticks
from sleepcast.loop.swarm import MAX_MINDS
from sleepcast.simulator import Changes, ScenarioOfSeeds
from sleepcast.simulator.engine import MAX_THREADS, cores
from sleepcast.simulator.scenario.robot_settings import MAX_TIME

MAX_WORLDS = 100_000
"""Worlds at once: their desks alone take some gigabytes."""
TOGETHER, IN_TURN = 5.0, 60.0
"""Simulated s after which all worlds are as far, while they run; the same where some have to be woken for that."""
AWAKE = 64
"""Worlds that are always awake, the first ones. The others rest while nothing is done with them."""
GROUP = 50
"""Worlds that are woken and run before others have their turn: some tenths of a second."""


class WorldPlan(NamedTuple):
    """What is special about one world: its seed, and what its scenario says instead."""

    seed: int
    over: Mapping[str, object]


class Worlds:
    """Worlds by their numbers, from 0; `open_many` makes them, and each is a `SimulatedFleet`: `worlds[17]`.

    plans: the seed of each world, and what else is special about it.
    failed: why a world could not be opened, or could not go on, by its number.
    time: simulated s since the start. A world that was run by itself waits until the others have come as far.
    """

    def __init__(
        self, plans: Sequence[WorldPlan], opened: Callable[[WorldPlan], KeptWorld], threads: int, *, quiet: bool
    ) -> None:
        self.plans, self.time = tuple(plans), 0.0
        self.failed: dict[int, str] = {}
        self._worlds: dict[int, KeptWorld] = {}
        self._pool = ThreadPool(threads)
        errors, room = list[Exception](), 0
        with closing(steps(len(self.plans), "opening worlds", quiet=quiet)) as numbers:
            for number in numbers:
                try:
                    world = opened(self.plans[number])
                    if room + world.room > MAX_MINDS:
                        raise MisuseError(
                            f"all worlds together have more than {MAX_MINDS:,} robots: open fewer at once"
                        )
                    if len(self._worlds) >= AWAKE:
                        world.rest()
                    self._worlds[number], room = world, room + world.room
                except Exception as error:  # what a payload does at the start may raise anything
                    errors.append(error)
                    self._fail(number, error)
        if not self._worlds:
            raise errors[0]

    # ---- the worlds

    def __len__(self) -> int:
        return len(self.plans)

    def __getitem__(self, number: int) -> SimulatedFleet:
        """A world by its number. Raises MisuseError for one that is not there, or has failed."""
        at = whole_number(number, "world", -len(self), len(self) - 1) % len(self)
        if at in self.failed:
            raise MisuseError(f"world {at} has failed: {self.failed[at]}")
        return self._worlds[at].fleet

    def __iter__(self) -> Iterator[SimulatedFleet]:
        """The worlds that have not failed."""
        return (world.fleet for world in [*self._worlds.values()])

    def items(self) -> list[tuple[int, SimulatedFleet]]:
        """The same with their numbers."""
        return [(number, world.fleet) for number, world in self._worlds.items()]

    def _going(self) -> list[KeptWorld]:
        """The worlds that have not failed. Raises MisuseError where there are none."""
        if not self._worlds:
            raise MisuseError(f"all worlds have failed, the first one: {next(iter(self.failed.values()))}")
        return [*self._worlds.values()]

    def _fail(self, number: int, error: Exception) -> None:
        self.failed[number] = reason_of(error)
        self._worlds.pop(number, None)

    def _everywhere(self, act: Callable[[KeptWorld], None], worlds: Sequence[tuple[int, KeptWorld]]) -> None:
        """Do something in each of these worlds, on all threads; it fails where that raises anything."""

        def work(first: int, last: int) -> None:
            for number, world in worlds[first:last]:
                try:
                    act(world)
                except Exception as error:
                    self._fail(number, error)

        with sought_seldom():
            self._pool.share(work, borders(len(worlds), self._pool.threads))

    # ---- time

    def run(self, seconds: float | str, *, quiet: bool = False) -> Self:
        """Let simulated time pass in all worlds; gives the worlds themselves. See `SimulatedFleet.run`.

        seconds: for how long, s, or a text such as "30s".
        quiet: whether to show no progress bar.
        """
        began = self.time
        lasts = read_seconds(seconds, "cannot run for", MAX_TIME)
        together = TOGETHER if all(world.is_awake for world in self._worlds.values()) else IN_TURN
        groups = 1 if together == TOGETHER else ceil(len(self._worlds) / GROUP)
        count = ceil(lasts / together) * groups
        with closing(steps(count, f"{len(self._worlds):,} worlds", quiet=quiet)) as parts:
            for part, group in (divmod(number, groups) for number in parts):
                if group == 0:
                    worlds = [*self._worlds.items()]
                until = began + min(lasts, (part + 1) * together)
                self._bring(worlds[group::groups], until)
                if group == groups - 1:
                    self.time = until
        return self

    def _reach(self, time: float) -> None:
        """Let time pass everywhere until then, s."""
        self._bring([*self._worlds.items()], time)
        self.time = time

    def _bring(self, worlds: Sequence[tuple[int, KeptWorld]], time: float) -> None:
        """Let time pass in these worlds until then, s."""

        def act(world: KeptWorld) -> None:
            tick = world.length_of_tick
            left = nearest_ticks(time, tick) - world.tick
            if left > 0:
                world.act(lambda fleet: fleet.run(left * tick, quiet=True))

        self._everywhere(act, worlds)

    # ---- commands and questions

    def send(self, text: str, *, wait: float | str = WAIT, everybody: bool = False, sure: bool = False) -> WorldResults:
        """Broadcast an expression in each world, from its own desk, at the same moment. See `Fleet.send`."""
        return self._sent(lambda fleet: fleet.send(text, wait=0.0, everybody=everybody, sure=sure), wait)

    def ask(self, text: str, *, wait: float | str = WAIT) -> WorldResults:
        """Ask the robots of each world for the value of an expression over the radio. See `Fleet.ask`."""
        return self._sent(lambda fleet: fleet.ask(text, wait=0.0), wait)

    def stop(self, *, wait: float | str = WAIT) -> WorldResults:
        """STOP in each world."""
        return self._sent(lambda fleet: fleet.stop(wait=0.0), wait)

    def release(self, *, wait: float | str = WAIT) -> WorldResults:
        """RELEASE in each world."""
        return self._sent(lambda fleet: fleet.release(wait=0.0), wait)

    def _sent(self, send: Callable[[SimulatedFleet], CommandResult], wait: float | str) -> WorldResults:
        """Send something everywhere, and let time pass until all have answered. Raises what `send` raises in each."""
        until, results = self.time + in_seconds(wait, "wait"), dict[int, CommandResult]()
        refused = dict[int, SleepcastError]()
        self._going()
        for number, fleet in self.items():
            try:
                results[number] = send(fleet)
            except SleepcastError as error:
                refused[number] = error
        if not results:
            raise next(iter(refused.values()))
        self._time_passes(until, results)
        return WorldResults(results, {number: str(error) for number, error in refused.items()})

    def _time_passes(self, until: float, results: Mapping[int, CommandResult]) -> None:
        tick = min(fleet.swarm.simulator.scenario.tick for fleet in self)
        while self._worlds and self.time + tick / 2 < until:
            if all(result.account.complete for number, result in results.items() if number in self._worlds):
                return
            self._reach(round(self.time + tick, 9))

    # ---- values

    def __contains__(self, number: object) -> bool:
        """Whether the world of this number goes on."""
        return number in self._worlds

    def values(self, expression: str) -> NDArray[np.float64]:
        """What an expression comes to on each robot now, world by world, SI, shape (robots of all worlds,); of worlds
        that have failed nothing. Raises what `fleet[...]` raises."""
        return np.concatenate([world.look(lambda fleet: fleet[expression]) for world in self._going()])

    def table(self, *expressions: str) -> DataTable:
        """A row for each robot: `world`, `robot`, and a column for each expression (none: all sensors), SI."""
        going = self._going()
        wanted = expressions or going[0].look(_sensors_of)
        found = [world.look(lambda fleet: ([*fleet.names], [fleet[each] for each in wanted])) for world in going]
        keys: dict[str, Texts | Numbers] = {
            "world": np.repeat([*self._worlds], [len(names) for names, _ in found]),
            "robot": [name for names, _ in found for name in names],
        }
        values = {each: np.concatenate([some[at] for _, some in found]) for at, each in enumerate(wanted)}
        return DataTable.keyed(keys, values)

    def history(self, *expressions: str, every: float | str = 1.0) -> WorldHistory:
        """Sample expressions in all worlds from now on. See `SimulatedFleet.history`."""
        self._going()
        return WorldHistory(
            {
                number: world.look(lambda fleet: fleet.history(*expressions, every=every))
                for number, world in self._worlds.items()
            }
        )

    def overview(self) -> DataTable:
        """A row for each world: `world`, `seed`, `error` ("" for none), and a column for each key of `over`."""
        keys = list(dict.fromkeys(key for plan in self.plans for key in plan.over))
        given = {key: _column([plan.over.get(key) for plan in self.plans]) for key in keys}
        errors = [self.failed.get(number, "") for number in range(len(self))]
        seeds = np.array([plan.seed for plan in self.plans])
        return DataTable.keyed({"world": np.arange(len(self)), "seed": seeds, "error": errors}, given)

    # ---- closed, shown

    def close(self) -> None:
        """Stop sampling and recording in all worlds."""
        for world in self._worlds.values():
            world.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()

    def __repr__(self) -> str:
        robots, failed = sum(world.robots for world in self._worlds.values()), len(self.failed)
        name = next((world.look(_name_of) for world in self._worlds.values()), "no world is left")
        return (
            f"{name}: {len(self):,} worlds with {robots:,} robots after {self.time:g} s"
            f"{f'; {failed:,} failed, the first one: {next(iter(self.failed.values()))}' if failed else ''}"
        )


class WorldResults:
    """What has become of a command in each world; it goes on counting while they run.

    refused: why it was not sent in a world, by its number.
    """

    def __init__(self, results: Mapping[int, CommandResult], refused: Mapping[int, str]) -> None:
        self._results, self.refused = dict(results), dict(refused)

    def __len__(self) -> int:
        return len(self._results)

    def __getitem__(self, world: int) -> CommandResult:
        """The result in one world. Raises MisuseError for one in which it was not sent."""
        if world not in self._results:
            raise MisuseError(f"world {world}: nothing was sent there: {self.refused.get(world, 'there is none')}")
        return self._results[world]

    def table(self) -> DataTable:
        """A row for each robot: `world`, and the columns of `CommandResult.table`."""
        return _joined({number: result.table() for number, result in self._results.items()})

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.table().__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        counts = [len(result.matched) for result in self._results.values()]
        text = next(iter(self._results.values())).text
        return f"{text}: in {len(self):,} worlds, matched {min(counts):,} to {max(counts):,} robots"


class WorldHistory:
    """A `History` for each world, by its number; for data frames one table, with a column `world` before the others."""

    def __init__(self, histories: Mapping[int, History]) -> None:
        self._histories = dict(histories)

    def __len__(self) -> int:
        return len(self._histories)

    def __getitem__(self, world: int) -> History:
        """The history of one world. Raises MisuseError for one that is not sampled."""
        if world not in self._histories:
            raise MisuseError(f"world {world} is not sampled: wanted one of {', '.join(map(str, self._histories))}")
        return self._histories[world]

    def table(self) -> DataTable:
        """In long form: a row a world, sample and robot, in this order."""
        return _joined({number: history.table() for number, history in self._histories.items()})

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.table().__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        return f"{len(self):,} worlds, in each: {next(iter(self._histories.values()))}"


def _sensors_of(fleet: SimulatedFleet) -> tuple[str, ...]:
    return tuple(each.name for each in fleet.station.vocabulary.sensors)


def _name_of(fleet: SimulatedFleet) -> str:
    return fleet.swarm.simulator.scenario.name


def _joined(tables: Mapping[int, DataTable]) -> DataTable:
    """Tables with the same columns as one, with the number of each before."""
    worlds = np.repeat([*tables], [len(table) for table in tables.values()])
    names = list(next(iter(tables.values())).columns)
    return DataTable.keyed(
        {"world": worlds}, {name: _stacked([each[name] for each in tables.values()]) for name in names}
    )


def _stacked(columns: Sequence[Texts | Numbers]) -> Texts | Numbers:
    if all(isinstance(column, np.ndarray) for column in columns):
        stacked: Numbers = np.concatenate(columns)
        return stacked
    return [text for column in columns for text in column]


def _column(values: Sequence[object]) -> Texts | Numbers:
    """Numbers, of which NaN is not given, where all are; else their texts."""
    if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
        return np.array([np.nan if value is None else value for value in values], np.float64)
    return ["" if value is None else str(value) for value in values]


def open_many(
    scenario: str | PathLike[str],
    *,
    seeds: int | Iterable[int],
    over: Mapping[str, object] | None = None,
    robots: int | type | str | None = None,
    area_per_robot: float | None = None,
    walls: bool = True,
    mission: bool = False,
    threads: int | None = None,
    quiet: bool = False,
) -> Worlds:
    """Many worlds of a scenario: one for each seed, and with lists in `over` one for each seed at each of their
    combinations. Each equals the run that `open` gives, bit for bit. Raises what `open` raises, if that is so in
    all worlds; else `Worlds.failed` has the reasons.

    seeds: how many, from 1, or these.
    over: keys of the scenario, each with what it says instead, or with a list of what it says in one world after the
        other, as in a sweep: {"radio.loss": [0, 0.1, 0.3]}. A key that takes a list itself has a list of lists.
    threads: on which the worlds are run; None is one for each core.
    quiet: whether to show no progress bar.
    The rest: see `open`.
    """

    def with_payload(plan: WorldPlan) -> KeptWorld:
        fleet = open(
            scenario,
            seed=plan.seed,
            robots=robots,
            area_per_robot=area_per_robot,
            walls=walls,
            over=plan.over,
            mission=mission,
            threads=1,
        )
        return KeptWorld(fleet, None)

    at_once = cores() if threads is None else whole_number(threads, "threads", 1, MAX_THREADS)
    added = isinstance(robots, type | str)
    usual = Changes(None if added else cast("int | None", robots), area_per_robot, walls)
    each = with_payload if added else _Opener(fspath(scenario), usual, mission=mission).opened
    return Worlds(_plans(seeds, over or {}), each, at_once, quiet=quiet)


class _Opener:
    """Opens worlds of one scenario, of which those of a point that follow each other have much in common.

    changes: of all worlds.
    """

    def __init__(self, scenario: str, changes: Changes, *, mission: bool) -> None:
        self._scenario, self._changes, self._mission = scenario, changes, mission
        self._point: tuple[Mapping[str, object], ScenarioOfSeeds] | None = None
        self._common: Common | None = None

    def opened(self, plan: WorldPlan) -> KeptWorld:
        """A world. Raises what `open` raises."""
        if self._point is None or self._point[0] is not plan.over:
            changes = replace(self._changes, over=changed(plan.over))
            self._point, self._common = (plan.over, ScenarioOfSeeds(self._scenario, changes)), None
        scenario = self._point[1][plan.seed]
        if self._common is None or not self._common.suits(scenario):
            self._common = Common(scenario)
        start = WorldStart(scenario, plan.seed, self._mission, self._common)
        return KeptWorld(start.opened(), start)


def _plans(seeds: int | Iterable[int], over: Mapping[str, object]) -> list[WorldPlan]:
    """Point by point, and at each all seeds. Raises MisuseError."""
    given = seeds if isinstance(seeds, Iterable) else range(1, whole_number(seeds, "seeds", 1, MAX_WORLDS) + 1)
    wanted = [read_seed(seed) for seed, _ in zip(given, range(MAX_WORLDS + 1), strict=False)]
    if not isinstance(over, Mapping):
        raise MisuseError(f'over {over!r:.80}: wanted keys with what they say instead, such as {{"radio.loss": 0.3}}')
    values = [each if isinstance(each, list | tuple | np.ndarray) else [each] for each in over.values()]
    count = len(wanted) * prod(map(len, values))
    if not 1 <= count <= MAX_WORLDS:
        raise MisuseError(f"{count:,} worlds: wanted from 1 to {MAX_WORLDS:,}, of {len(wanted):,} seeds")
    points = [dict(zip(over, point, strict=True)) for point in product(*values)]
    return [WorldPlan(seed, point) for point in points for seed in wanted]
