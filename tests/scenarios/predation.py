"""Wolves, sheep and grass in plain Python, by the published rules of NetLogo's model, beside the scenario
`wolves-and-sheep`.

The rules are those of U. Wilensky, "NetLogo Wolf Sheep Predation model" (1997), in its version with grass. This follows
their description and shares nothing with the simulator: animals are objects, and each tick goes through them one by
one, in a new random order. What a run comes to is a few numbers (`Course`), of which the distributions over many seeds
can be compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, floor, radians, sin
from random import Random
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

SIDE = 51
"""Patches along a side of the world, which has no edge."""
SETTLED = 100
"""Ticks after which a run has forgotten how it began."""


class Counts(NamedTuple):
    """How many of each there are after a tick; grass: green patches."""

    sheep: int
    wolves: int
    grass: int


class Rules(NamedTuple):
    """The numbers of the model, as published. gains: energy from food; chances: of a young, in each tick; regrowth:
    ticks."""

    sheep: int = 100
    wolves: int = 50
    sheep_gain: int = 4
    wolf_gain: int = 20
    sheep_chance: float = 0.04
    wolf_chance: float = 0.05
    regrowth: int = 30


PUBLISHED = Rules()


@dataclass(slots=True)
class Animal:
    """x, y: patches, from the lower left corner of the world; heading: degrees."""

    x: float
    y: float
    heading: float
    energy: float
    alive: bool = True

    @property
    def patch(self) -> tuple[int, int]:
        """The column and the row of the patch under it."""
        return floor(self.x) % SIDE, floor(self.y) % SIDE

    def step(self) -> None:
        """One patch ahead."""
        self.x = (self.x + cos(radians(self.heading))) % SIDE
        self.y = (self.y + sin(radians(self.heading))) % SIDE


class Meadow:
    """One world."""

    def __init__(self, seed: int, rules: Rules = PUBLISHED) -> None:
        self._random, self._rules = Random(seed), rules
        self.countdown = [[self._sown() for _ in range(SIDE)] for _ in range(SIDE)]
        """Of each patch the ticks until it is green again; -1 of a green one."""
        self.sheep = [self._placed(rules.sheep_gain) for _ in range(rules.sheep)]
        self.wolves = [self._placed(rules.wolf_gain) for _ in range(rules.wolves)]

    def tick(self) -> Counts:
        """All sheep, then all wolves, then the grass."""
        rules = self._rules
        self._live(self.sheep, self._graze, rules.sheep_gain, rules.sheep_chance)
        prey: dict[tuple[int, int], list[Animal]] = {}
        for each in self.sheep:
            prey.setdefault(each.patch, []).append(each)
        self._live(self.wolves, lambda wolf: self._hunt(prey.get(wolf.patch)), rules.wolf_gain, rules.wolf_chance)
        self.sheep = [each for each in self.sheep if each.alive]
        return Counts(len(self.sheep), len(self.wolves), self._grow())

    def _sown(self) -> int:
        return -1 if self._random.random() < 0.5 else self._random.randrange(self._rules.regrowth)

    def _placed(self, gain: int) -> Animal:
        drawn = self._random.uniform
        return Animal(drawn(0.0, SIDE), drawn(0.0, SIDE), drawn(0.0, 360.0), self._random.randrange(2 * gain))

    def _live(self, herd: list[Animal], eats: Callable[[Animal], bool], gain: int, chance: float) -> None:
        """A tick of each animal of a kind that was there as it began."""
        random = self._random
        for each in random.sample(herd, len(herd)):
            each.heading += random.randrange(50) - random.randrange(50)
            each.step()
            each.energy += gain * eats(each) - 1.0
            each.alive = each.energy >= 0.0
            if each.alive and random.random() < chance:
                herd.append(self._born(each))
        herd[:] = [each for each in herd if each.alive]

    def _born(self, parent: Animal) -> Animal:
        parent.energy /= 2.0
        young = Animal(parent.x, parent.y, parent.heading + self._random.uniform(0.0, 360.0), parent.energy)
        young.step()
        return young

    def _graze(self, sheep: Animal) -> bool:
        column, row = sheep.patch
        green = self.countdown[row][column] < 0
        if green:
            self.countdown[row][column] = self._rules.regrowth
        return green

    def _hunt(self, prey: list[Animal] | None) -> bool:
        if not prey:
            return False
        prey.pop(self._random.randrange(len(prey))).alive = False
        return True

    def _grow(self) -> int:
        """A tick of all patches; gives how many are green. One is green again in the tick in which it finds its
        countdown at 0."""
        for row in self.countdown:
            row[:] = [left - 1 if left >= 0 else -1 for left in row]
        return sum(left < 0 for row in self.countdown for left in row)


def counted(seed: int, ticks: int, rules: Rules = PUBLISHED) -> list[Counts]:
    """The counts after each tick, until wolves or sheep are gone."""
    meadow, found = Meadow(seed, rules), list[Counts]()
    while len(found) < ticks and (not found or all(found[-1][:2])):
        found.append(meadow.tick())
    return found


class Course(NamedTuple):
    """What a run came to, after it had settled.

    period: ticks, the inverse of the mean frequency of the sheep's number, weighted by its power
    amplitude: standard deviation of the sheep's number, as a share of its mean
    sheep, wolves, grass: means
    """

    period: float
    amplitude: float
    sheep: float
    wolves: float
    grass: float


def course_of(counts: ArrayLike) -> Course:
    """The course of a run. counts: of sheep, wolves and grass after each tick, shape (ticks, 3)."""
    settled = np.asarray(counts, float)[SETTLED:]
    sheep = settled[:, 0]
    power = np.abs(np.fft.rfft((sheep - sheep.mean()) * np.hanning(sheep.size))) ** 2
    frequency = np.fft.rfftfreq(sheep.size)
    slow = (frequency > 1.0 / 400.0) & (frequency < 1.0 / 20.0)
    period = power[slow].sum() / (power[slow] * frequency[slow]).sum()
    return Course(float(period), float(sheep.std() / sheep.mean()), *settled.mean(axis=0).tolist())
