"""Worlds in step: an episode in each, whose robots act, and are looked at, all at once.

What robots observe and are paid for is evaluated on one table of all worlds where it reads nothing but sensors and only
computes; else world by world. Either way it is what the episode alone gives, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.columns.machine import Plain, is_plain, no_fault, no_local
from sleepcast.columns.telemetry import Key, KnownSymbols, TelemetryTable
from sleepcast.columns.values import CHUNK, AskedColumns, Column, Mask, Rows
from sleepcast.gym.episode import Episode, EpisodeKey, Episodes, Flags, Singles
from sleepcast.gym.task import CheckedTask
from sleepcast.language import check
from sleepcast.language.learned_names import LearnedNames
from sleepcast.language.parts import walk
from sleepcast.language.program import Program
from sleepcast.language.vocabulary import ID, TIME_SLOT
from sleepcast.loop.quiet import LONGEST, QuietTicks
from sleepcast.simulator.quiet.rows import WorldRows

SENSED = frozenset({"const", "var", "local", "pure", "and", "or", "known", "cond", "if", "progn", "let"})
"""Operations that compute with nothing but sensors and numbers."""


class WorldSteps(NamedTuple):
    """What came of one step in some worlds.

    observed: shape (worlds, robots, observations).
    reward: shape (worlds, robots).
    ended, over: see `EpisodeStep`, shape (worlds,).
    """

    observed: Singles
    reward: NDArray[np.float64]
    ended: Flags
    over: Flags


class Together:
    """See the module. worlds: how many. task: the same in all."""

    def __init__(self, task: CheckedTask, worlds: int) -> None:
        self.task = task
        self.worlds = [Episodes(task, world) for world in range(worlds)]
        self._programs: dict[str, Program | None] = {}
        """What robots observe and are paid for, as programs for one table; None where there is none for it."""
        self._ticks: QuietTicks | None = None
        """Makes the ticks of all worlds; None until a first episode has begun in each."""
        self._stretch: Stretch | None = None
        """Worlds that go on without Python, for some steps; see `_go_on`."""
        self.ended: Flags = np.zeros(worlds, np.bool_)
        """In which worlds the latest episode is over."""

    @property
    def keys(self) -> list[EpisodeKey | None]:
        """See `Episodes.key`, of each world."""
        return [each.key for each in self.worlds]

    def fleet(self, world: int) -> SimulatedFleet:
        """The run of a world. Raises MisuseError if none has begun."""
        self._let_go()
        return self.worlds[world].running().fleet

    def begin(self, which: Sequence[int], seed: int | None, options: Mapping[str, Any] | None) -> Singles:
        """Begin the next episode in these worlds, see `Episodes.begin`; gives what their robots observe."""
        self._let_go()
        drawn = self.worlds[0].key  # the first seed, which the system draws, is that of all worlds
        for world in which:
            unseeded = seed is None and self.worlds[world].key is None and drawn is not None
            self.worlds[world].begin(drawn.seed if unseeded and drawn else seed, options)
            drawn, self.ended[world] = drawn or self.worlds[world].key, False
            if self._ticks is not None:
                self._ticks.replace(world, self.worlds[world].running().swarm)
        if self._ticks is None:
            self._ticks = QuietTicks([each.running().swarm for each in self.worlds], self.task.task.threads or 1)
        return self.observe(which)

    def step(self, which: Sequence[int], actions: NDArray[np.float64]) -> WorldSteps:
        """Let the robots of these worlds act, and time pass. actions: shape (worlds, robots, ...)."""
        if len(which) == len(self.worlds) and self._held():
            steps = self._go_on(actions)
        else:
            self._let_go()
            steps = self._step_each(which, actions)
        self.ended[which] = steps.ended | steps.over
        return steps

    def _step_each(self, which: Sequence[int], actions: NDArray[np.float64]) -> WorldSteps:
        episodes = [self.worlds[world].running() for world in which]
        ended, everybody = np.zeros(len(episodes), np.bool_), np.arange(len(self.task.names))
        for episode, wanted in zip(episodes, actions, strict=True):
            episode.act(wanted, everybody)
        self._pass(which, episodes, ended)
        for episode in episodes:
            episode.count()
        over = np.array([episode.left <= 0 for episode in episodes])
        return WorldSteps(*self._look(SensorTable.of(episodes), paid=True), ended, over)

    def _pass(self, which: Sequence[int], episodes: Sequence[Episode], ended: Flags) -> None:
        """Let the ticks of a step pass; notes where the goal is reached, on whose tick a world's step ends."""
        assert self._ticks is not None
        ticks, looks = self.task.task.ticks, self.task.until is not None
        for _ in range(ticks if looks else 1):
            going = np.flatnonzero(~ended).tolist()
            self._ticks.step(1 if looks else ticks, [which[number] for number in going])
            for number in going if looks else ():
                ended[number] = episodes[number].has_ended()
        for episode in episodes:
            episode.sense()

    # ---- without Python

    def _held(self) -> bool:
        """Whether all worlds can make the next step in compiled code alone: bodies only move and sensors measure, no
        goal is looked for, and nobody has taken a fleet, so that nobody can look at it meanwhile."""
        ticks = self.task.task.ticks
        if self._stretch is not None and self._stretch.left >= ticks:
            return True
        self._let_go()
        episodes = [each.running() for each in self.worlds]
        if any(episode.taken for episode in episodes) or not self._fits:
            return False
        assert self._ticks is not None
        if (left := self._ticks.hold(LONGEST)) >= ticks:
            self._stretch = Stretch(episodes, left)
        elif left:
            self._ticks.let_go()
        return self._stretch is not None

    @cached_property
    def _fits(self) -> bool:
        """Whether the task asks for nothing that compiled code does not do, which is so in all episodes alike."""
        if self.task.until is not None or not isinstance(self.task.acted, Box):
            return False
        if not {each.casefold() for each in self.task.task.actions} <= {"drive_speed", "drive_turn"}:
            return False
        table = SensorTable.of([self.worlds[0].running()])
        return all(self._program(text, table) for text in (*self.task.task.observations, self.task.task.reward))

    def _go_on(self, actions: NDArray[np.float64]) -> WorldSteps:
        """One step of all worlds."""
        ticks, stretch, box = self._ticks, self._stretch, self.task.acted
        assert ticks is not None
        assert stretch is not None
        assert isinstance(box, Box)
        wanted = np.clip(actions.reshape(-1, actions.shape[-1]), box.low, box.high).T
        by_name = {name.casefold(): column for name, column in zip(self.task.task.actions, wanted, strict=True)}
        stretch.rows.drive(by_name.get("drive_speed"), by_name.get("drive_turn"))
        ticks.go_on(self.task.task.ticks, sonars=self.task.sees)
        over = stretch.count(self.task.task.ticks)
        return WorldSteps(*self._look(stretch.table(), paid=True), np.zeros_like(over), over)

    def _let_go(self) -> None:
        """Bring all worlds up to date."""
        if self._stretch is not None and self._ticks is not None:
            self._ticks.let_go()
            self._stretch.end()
            self._stretch = None

    # ---- what robots observe

    def observe(self, which: Sequence[int]) -> Singles:
        """What the robots of these worlds observe now, shape (worlds, robots, observations)."""
        self._let_go()
        return self._look(SensorTable.of([self.worlds[world].running() for world in which]))[0]

    def _look(self, table: SensorTable, *, paid: bool = False) -> tuple[Singles, NDArray[np.float64]]:
        """What robots observe, and what they are `paid`, 0 if nobody asks for it."""
        task, box, shape = self.task.task, self.task.observed, (len(table.episodes), len(self.task.names))
        observed = np.empty((len(task.observations), table.count), np.float32)
        for column, text in enumerate(task.observations):
            observed[column] = self._values(text, table)
        if not np.isfinite(observed).all():
            np.nan_to_num(observed, copy=False)
        np.clip(observed, box.low[:, None], box.high[:, None], out=observed)
        reward = np.nan_to_num(self._values(task.reward, table)) if paid else np.zeros(shape)
        return observed.T.reshape(*shape, -1), reward.reshape(shape)

    def _values(self, text: str, table: SensorTable) -> Column:
        """What an expression comes to on each robot of the table."""
        program = self._program(text, table)
        if program is None:
            return np.concatenate([episode.values(text) for episode in table.episodes])
        return table.value(program)

    def _program(self, text: str, table: SensorTable) -> Program | None:
        if text not in self._programs:
            self._programs[text] = table.program(text)
        return self._programs[text]

    def close(self) -> None:
        self._let_go()
        self.ended[:] = False
        for each in self.worlds:
            each.close()

    def __getstate__(self) -> dict[str, Any]:
        """A copy, in this process or another, begins anew."""
        begun: dict[str, Any] = {"_programs": {}, "_ticks": None, "_stretch": None}
        return self.__dict__ | begun | {"ended": np.zeros_like(self.ended)}


class Stretch:
    """Worlds that are held for some ticks, see `QuietTicks.hold`. left: ticks that may still follow."""

    def __init__(self, episodes: Sequence[Episode], left: int) -> None:
        self._episodes, self.left, self._ticks, self._steps = episodes, left, 0, 0
        self._until = np.array([episode.left for episode in episodes])
        """Steps of this stretch after which the time of an episode is over."""
        swarms = [episode.swarm for episode in episodes]
        self._began = np.repeat([swarm.simulator.tick for swarm in swarms], len(swarms[0].fleet))
        self._tick = np.repeat([swarm.simulator.scenario.tick for swarm in swarms], len(swarms[0].fleet))
        self.rows = WorldRows([swarm.simulator for swarm in swarms])

    def count(self, ticks: int) -> Flags:
        """A step of so many ticks was made; gives whose time is over."""
        self.left, self._ticks, self._steps = self.left - ticks, self._ticks + ticks, self._steps + 1
        return self._until <= self._steps

    def end(self) -> None:
        """Let the episodes know how many steps they have made."""
        for episode in self._episodes:
            episode.count(self._steps)

    def table(self) -> SensorTable:
        """What robots sense now."""
        return SensorTable(self._episodes, self.rows.sensed(), lambda: (self._began + self._ticks) * self._tick)


class SensorTable(TelemetryTable):
    """What the robots of some episodes have sensed, in one table.

    sensed: shape (sensors, rows).
    times: gives the time of each row, s.
    """

    def __init__(self, episodes: Sequence[Episode], sensed: NDArray[np.float64], times: Callable[[], Column]) -> None:
        self.episodes, self.count = episodes, sensed.shape[1]
        self._sensed, self._times = sensed, times
        swarm = episodes[0].swarm
        self._vocabulary, self._ageing = swarm.vocabulary, swarm.fleet.measured.keys()
        self._columns = AskedColumns(self.count, self._fill, dict)
        self._values: dict[Program, Column] = {}

    @classmethod
    def of(cls, episodes: Sequence[Episode]) -> SensorTable:
        """The table of these episodes as they are now."""
        swarms = [episode.swarm for episode in episodes]
        sensed = np.concatenate([swarm.simulator.sensed for swarm in swarms], axis=1)
        return cls(episodes, sensed, lambda: np.repeat([swarm.now() for swarm in swarms], len(swarms[0].fleet)))

    def program(self, text: str) -> Program | None:
        """The expression as a program for this table; None if it needs anything that is not in it."""
        checked = check(text, LearnedNames(self._vocabulary))
        if checked.unknown or checked.program is None:
            return None
        first = self._vocabulary.first_sensor
        known = {ID, TIME_SLOT, *range(first, first + len(self._vocabulary.sensors))} - self._ageing
        parts = walk(checked.program.root)
        fits = all(part.op in SENSED and (part.op != "var" or part.slot in known) for part in parts)
        return checked.program if fits else None

    def value(self, program: Program) -> Column:
        """What one of these programs comes to on each row."""
        if program not in self._values:
            self._values[program] = self._value(program)
        return self._values[program]

    def _value(self, program: Program) -> Column:
        everybody = Rows.run(0, self.count)
        if program.root.op == "var":
            return self._columns.column(program.root.slot, everybody)
        if self.count <= CHUNK and is_plain(program.root):
            with np.errstate(all="ignore"):
                return Plain(everybody, self._columns.read, no_local, no_fault).column(program.root)
        return self.values(program, np.arange(self.count))[0]

    def latest(self) -> AskedColumns:
        return self._columns

    def _fill(self, slot: int) -> Column:
        if slot == ID:
            return np.concatenate([np.asarray(each.swarm.fleet.numbers, np.float64) for each in self.episodes])
        if slot == TIME_SLOT:
            return self._times()
        sensed: Column = self._sensed[slot - self._vocabulary.first_sensor]
        return sensed

    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        raise AssertionError("a program for this table uses nothing that robots have learned")
