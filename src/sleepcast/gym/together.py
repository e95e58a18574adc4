"""Worlds in step: an episode in each, whose robots act, and are looked at, all at once.

What robots observe and are paid for is evaluated on one table of all worlds where it reads nothing but sensors and only
computes; else world by world. Either way it is what the episode alone gives, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.telemetry import Key, KnownSymbols, TelemetryTable
from sleepcast.columns.values import AskedColumns, Column, Mask, Rows
from sleepcast.gym.episode import Episode, EpisodeKey, Episodes, Flags, Singles
from sleepcast.gym.task import CheckedTask
from sleepcast.language import check
from sleepcast.language.learned_names import LearnedNames
from sleepcast.language.parts import walk
from sleepcast.language.program import Program
from sleepcast.language.vocabulary import ID, TIME_SLOT, Vocabulary

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

    @property
    def keys(self) -> list[EpisodeKey | None]:
        """See `Episodes.key`, of each world."""
        return [each.key for each in self.worlds]

    @property
    def ended(self) -> Flags:
        """See `Episodes.ended`, of each world."""
        return np.array([each.ended for each in self.worlds])

    def begin(self, which: Sequence[int], seed: int | None, options: Mapping[str, Any] | None) -> Singles:
        """Begin the next episode in these worlds, see `Episodes.begin`; gives what their robots observe."""
        drawn = self.worlds[0].key  # the first seed, which the system draws, is that of all worlds
        for world in which:
            unseeded = seed is None and self.worlds[world].key is None and drawn is not None
            self.worlds[world].begin(drawn.seed if unseeded and drawn else seed, options)
            drawn = drawn or self.worlds[world].key
        return self.observe(which)

    def step(self, which: Sequence[int], actions: NDArray[np.float64]) -> WorldSteps:
        """Let the robots of these worlds act, and time pass. actions: shape (worlds, robots, ...)."""
        episodes = [self.worlds[world].running() for world in which]
        everybody = np.arange(len(self.task.names))
        for episode, wanted in zip(episodes, actions, strict=True):
            episode.act(wanted, everybody)
        ended = self._pass(episodes)
        over = np.array([episode.is_over() for episode in episodes])
        for world, each in zip(which, (ended | over).tolist(), strict=True):
            self.worlds[world].ended = each
        return WorldSteps(*self._look(episodes, paid=True), ended, over)

    def _pass(self, episodes: Sequence[Episode]) -> Flags:
        """Let the ticks of a step pass; gives where the goal is reached, on whose tick a world's step ends."""
        ended = np.zeros(len(episodes), np.bool_)
        for _ in range(self.task.task.ticks):
            for number in np.flatnonzero(~ended).tolist():
                episodes[number].fleet.swarm.step()
                ended[number] = self.task.until is not None and episodes[number].has_ended()
        for episode in episodes:
            episode.fleet.swarm.sense()
        return ended

    def observe(self, which: Sequence[int]) -> Singles:
        """What the robots of these worlds observe now, shape (worlds, robots, observations)."""
        return self._look([self.worlds[world].running() for world in which])[0]

    def _look(self, episodes: Sequence[Episode], *, paid: bool = False) -> tuple[Singles, NDArray[np.float64]]:
        """What robots observe, and what they are `paid`, 0 if nobody asks for it."""
        task, shape = self.task.task, (len(episodes), len(self.task.names))
        table = SensorTable(episodes)
        observed = np.empty((*shape, len(task.observations)), np.float32)
        for column, text in enumerate(task.observations):
            observed[..., column] = self._values(text, table).reshape(shape)
        box = self.task.observed
        np.clip(np.nan_to_num(observed, copy=False), box.low, box.high, out=observed)
        reward = np.nan_to_num(self._values(task.reward, table)) if paid else np.zeros(shape)
        return observed, reward.reshape(shape)

    def _values(self, text: str, table: SensorTable) -> Column:
        """What an expression comes to on each robot of the table."""
        if text not in self._programs:
            self._programs[text] = table.program(text)
        program = self._programs[text]
        if program is None:
            return np.concatenate([episode.values(text) for episode in table.episodes])
        return table.values(program, np.arange(table.count))[0]

    def close(self) -> None:
        for each in self.worlds:
            each.close()

    def __getstate__(self) -> dict[str, Any]:
        """A copy, in this process or another, begins anew."""
        return self.__dict__ | {"_programs": {}}


class SensorTable(TelemetryTable):
    """What the robots of these episodes have sensed, in one table."""

    def __init__(self, episodes: Sequence[Episode]) -> None:
        self.episodes = episodes
        swarms = [episode.fleet.swarm for episode in episodes]
        self._vocabulary, self._ageing = swarms[0].vocabulary, swarms[0].fleet.measured.keys()
        self._sensed = np.concatenate([swarm.simulator.sensed for swarm in swarms], axis=1)
        self._swarms, self.count = swarms, self._sensed.shape[1]
        self._columns = AskedColumns(self.count, self._fill, dict)

    def program(self, text: str) -> Program | None:
        """The expression as a program for this table; None if it needs anything that is not in it."""
        checked = check(text, LearnedNames(self._vocabulary))
        if checked.unknown or checked.program is None:
            return None
        parts = walk(checked.program.root)
        known = {ID, TIME_SLOT, *self._rows(self._vocabulary)} - self._ageing
        fits = all(part.op in SENSED and (part.op != "var" or part.slot in known) for part in parts)
        return checked.program if fits else None

    def _rows(self, vocabulary: Vocabulary) -> range:
        return range(vocabulary.first_sensor, vocabulary.first_sensor + len(vocabulary.sensors))

    def latest(self) -> AskedColumns:
        return self._columns

    def _fill(self, slot: int) -> Column:
        if slot == ID:
            return np.concatenate([np.asarray(swarm.fleet.numbers, np.float64) for swarm in self._swarms])
        if slot == TIME_SLOT:
            return np.repeat([swarm.now() for swarm in self._swarms], self.count // len(self._swarms))
        sensed: Column = self._sensed[slot - self._vocabulary.first_sensor]
        return sensed

    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        raise AssertionError("a program for this table uses nothing that robots have learned")
