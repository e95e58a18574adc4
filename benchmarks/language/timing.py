"""Timing on a machine that does other things too.

What is compared is run in turns, a short batch of each, many times over, so that a slow second hits everybody alike;
the order is turned round from turn to turn. A batch is timed in CPU time of this process, which does not count what
other programs take; the garbage collector rests during a batch and runs between turns. A contender's time is the
median over the turns, a ratio the median of the ratios within each turn, with the quartiles beside it.
"""

from __future__ import annotations

import gc
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import TypeVar

Input = TypeVar("Input")
Batch = Callable[[int], int]
"""Runs something so many times over and says how many calls that were."""


@dataclass(frozen=True)
class Timing:
    """Seconds a call in each turn."""

    turns: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.turns)

    def quantile(self, share: float) -> float:
        """The time that this share of the turns stay below."""
        ordered = sorted(self.turns)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]

    def over(self, other: Timing) -> Ratio:
        """This time divided by another of the same turns."""
        return Ratio(tuple(mine / theirs for mine, theirs in zip(self.turns, other.turns, strict=True)))

    def less(self, other: Timing) -> Timing:
        """This time without another of the same turns, such as that of the loop around the calls."""
        return Timing(tuple(mine - theirs for mine, theirs in zip(self.turns, other.turns, strict=True)))


@dataclass(frozen=True)
class Ratio:
    """One time divided by another, in each turn."""

    turns: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.turns)

    @property
    def quartiles(self) -> tuple[float, float]:
        if len(self.turns) < 2:
            return self.median, self.median
        low, _, high = statistics.quantiles(self.turns, n=4, method="inclusive")
        return low, high


def calls(function: Callable[[Input], object], inputs: Sequence[Input]) -> Batch:
    """Calls of `function` with each of the inputs in turn."""

    def batch(rounds: int) -> int:
        for _ in repeat(None, rounds):
            for each in inputs:
                function(each)
        return rounds * len(inputs)

    return batch


def nothing(inputs: Sequence[object]) -> Batch:
    """The loop of `calls` without a call."""

    def batch(rounds: int) -> int:
        for _ in repeat(None, rounds):
            for _each in inputs:
                pass
        return rounds * len(inputs)

    return batch


def in_turns(batches: Mapping[str, Batch], turns: int, seconds: float) -> dict[str, Timing]:
    """Time all batches in turns; each batch is made about `seconds` long. Gives seconds a call by name."""
    rounds = {name: _rounds(batch, seconds) for name, batch in batches.items()}
    found: dict[str, list[float]] = {name: [] for name in batches}
    names = list(batches)
    for turn in range(turns):
        start = turn * 3 % len(names)
        for name in names[start:] + names[:start]:
            found[name].append(_timed(batches[name], rounds[name]))
    return {name: Timing(tuple(times)) for name, times in found.items()}


def _rounds(batch: Batch, seconds: float) -> int:
    """How many rounds take about so long; at least one. Trying it out also warms everything up."""
    rounds = 1
    while True:
        begin = time.process_time()
        batch(rounds)
        taken = time.process_time() - begin
        if taken >= seconds / 4:
            return max(1, round(rounds * seconds / taken))
        rounds *= 4


def _timed(batch: Batch, rounds: int) -> float:
    gc.collect()
    gc.disable()
    try:
        begin = time.process_time()
        count = batch(rounds)
        return (time.process_time() - begin) / count
    finally:
        gc.enable()


def one_by_one(events: Sequence[Callable[[], object]]) -> Timing:
    """Each event timed by itself on the wall clock, garbage collection and all: what somebody waits for."""
    times = []
    for event in events:
        begin = time.perf_counter()
        event()
        times.append(time.perf_counter() - begin)
    return Timing(tuple(times))


def command_times(command: Sequence[str], turns: int, environment: Mapping[str, str]) -> Timing:
    """Wall-clock seconds of a whole command; the first, untimed, one warms the file cache."""
    times = []
    for turn in range(turns + 1):
        begin = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True, env=environment)
        if turn:
            times.append(time.perf_counter() - begin)
    return Timing(tuple(times))
