"""Wolves and sheep: the scenario beside the published rules in plain Python, by the distributions of what runs come to.

In both programs the order of the animals is by chance, but it is not the same one: single runs differ, so distributions
are compared, by the two-sample test of Kolmogorov and Smirnov. That the test would notice something is shown by other
numbers in the same rules, which it must reject.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

import sleepcast as sc
from scenarios.predation import PUBLISHED, SIDE, Animal, Counts, Course, Meadow, counted, course_of
from sleepcast.experiments.measures import read_measure

SHEEP, WOLVES, GRASS = map(read_measure, ("count (= caste FLOCK)", "count (= caste PACK)", "field grass"))
HUNGRY = 12
"""What a wolf gets from a sheep, so that most packs die out within some hundred ticks; as published hardly any does."""
LONG = 600
"""Ticks for which a run is watched."""
SEEDS = range(100, 120)


def herds(seed: int, ticks: int, wolf_gain: int = PUBLISHED.wolf_gain) -> list[Counts]:
    """What the scenario has after each second, which is a tick of the model, until sheep or wolves are gone."""
    found = list[Counts]()
    with sc.open("wolves-and-sheep", seed=seed, over={"constants.WOLF_GAIN": wolf_gain}, mission=True) as fleet:
        while len(found) < ticks and (not found or all(found[-1][:2])):
            fleet.run(1.0, quiet=True)
            found.append(Counts(int(SHEEP(fleet)), int(WOLVES(fleet)), int(GRASS(fleet))))
    return found


def published(seed: int, ticks: int, wolf_gain: int = PUBLISHED.wolf_gain) -> list[Counts]:
    return counted(seed, ticks, PUBLISHED._replace(wolf_gain=wolf_gain))


def agreement(first: Iterable[float], second: Iterable[float]) -> float:
    """How probable it is that two samples of one distribution are at least as different as these."""
    from scipy.stats import ks_2samp  # importing it takes a second, which every process would wait for

    return float(ks_2samp([*first], [*second]).pvalue)


# ---- the rules in plain Python


def test_grass_is_green_again_thirty_one_ticks_after_it_was_eaten() -> None:
    meadow = Meadow(1, PUBLISHED._replace(sheep=0, wolves=0))
    meadow.countdown = [[-1] * SIDE for _ in range(SIDE)]
    meadow.countdown[0][0] = PUBLISHED.regrowth
    assert [meadow.tick().grass for _ in range(31)] == [SIDE * SIDE - 1] * 30 + [SIDE * SIDE]


def test_a_wolf_without_sheep_lives_as_long_as_its_energy() -> None:
    meadow = Meadow(1, PUBLISHED._replace(sheep=0, wolves=0, wolf_chance=0.0))
    meadow.wolves = [Animal(1.0, 1.0, 0.0, 3.0)]
    assert [meadow.tick().wolves for _ in range(5)] == [1, 1, 1, 0, 0]


def test_a_young_has_half_of_its_parents_energy() -> None:
    meadow = Meadow(1, PUBLISHED._replace(sheep=0, wolves=0, wolf_chance=1.0))
    meadow.wolves = [Animal(1.0, 1.0, 0.0, 9.0)]
    meadow.tick()
    assert [wolf.energy for wolf in meadow.wolves] == [4.0, 4.0]


# ---- the scenario beside them


@pytest.fixture(scope="module")
def after_40_ticks() -> NDArray[np.float64]:
    """What twenty runs of the published rules have then, shape (runs, 3)."""
    return np.array([published(seed, 40)[-1] for seed in range(20)], float)


@pytest.mark.parametrize(("wolf_gain", "same"), [(PUBLISHED.wolf_gain, True), (8, False)])
def test_a_run_begins_as_those_of_the_published_rules_do(
    after_40_ticks: NDArray[np.float64], wolf_gain: int, same: bool
) -> None:
    expected, found = after_40_ticks, herds(105, 40, wolf_gain)[-1]
    off = (np.array(found) - expected.mean(axis=0)) / expected.std(axis=0)
    assert bool(np.abs(off).max() < 3.0) is same, (found, expected.mean(axis=0), off)


def courses(run: Callable[[int, int, int], list[Counts]], wolf_gain: int) -> Course:
    """What each run of one program comes to: of each number one for every seed."""
    found = [course_of(run(seed, LONG, wolf_gain)) for seed in SEEDS]
    return Course(*np.array(found).T)


@pytest.mark.nightly
def test_period_amplitude_and_means_have_the_distributions_of_the_published_rules() -> None:
    expected = courses(published, PUBLISHED.wolf_gain)
    for wolf_gain, same in ((PUBLISHED.wolf_gain, True), (16, False)):
        found = courses(herds, wolf_gain)
        chances = Course(*(agreement(*each) for each in zip(found, expected, strict=True)))
        if same:
            assert min(chances) > 0.01, chances
        else:
            assert max(chances.amplitude, chances.sheep, chances.wolves, chances.grass) < 0.001, chances


@pytest.mark.nightly
def test_packs_die_out_after_as_many_ticks_as_by_the_published_rules() -> None:
    assert all(len(run(seed, LONG, PUBLISHED.wolf_gain)) == LONG for run in (herds, published) for seed in SEEDS[:5])
    expected = [len(published(seed, LONG, HUNGRY)) for seed in SEEDS]
    for wolf_gain, same in ((HUNGRY, True), (8, False)):
        chance = agreement([len(herds(seed, LONG, wolf_gain)) for seed in SEEDS], expected)
        assert chance > 0.01 if same else chance < 0.001, chance
