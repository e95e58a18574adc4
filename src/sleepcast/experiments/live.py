"""The measures of a scenario's experiment, taken of a swarm that runs on a page.

A scenario may be anybody's, and opening it is no decision to run programs: functions in Python are only taken from
folders that are the user's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from math import nan
from pathlib import Path

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.columns import column_name
from sleepcast.core.errors import SleepcastError
from sleepcast.experiments.measures import MeasureError, read_measure
from sleepcast.experiments.plan import PLAN, experiment_of_scenario, read_experiment
from sleepcast.experiments.trust import is_own, look_in, programs_of

MAX_ROBOTS = 20_000
"""Robots of which a measure of the group as a whole is taken while a page is served: of more it takes too long between
two ticks."""

Taken = tuple[str, str, Callable[[], float]]
"""A measure: its name, its text, and what gives its value now, NaN for unknown."""


def live_measures(fleet: SimulatedFleet, folder: Path | None = None) -> list[Taken]:
    """The measures of the scenario's experiment, and the time series that its own file asks for. What is wrong with a
    measure is said when it is taken: a page opens all the same.

    folder: of a scenario that is not of the gallery.
    """
    scenario = fleet.swarm.simulator.scenario
    texts = _texts(scenario.name, folder)
    own = folder is not None and is_own(folder, _files(texts.values(), folder))
    if own and folder is not None:
        look_in([folder.resolve()])
    measures: list[Taken] = [(name, text, partial(_taken, text, fleet, own)) for name, text in texts.items()]
    for spec in scenario.measures:  # a plot is found by its name
        name = column_name(spec.name, [known for known, *_ in measures])
        measures.append((name, spec.name, partial(_latest, fleet, spec.name)))
    return measures


def _files(texts: Iterable[str], folder: Path) -> list[Path]:
    """The files in Python of this folder that measures would run."""
    try:
        return [file for each in programs_of(texts, [folder.resolve()]) for file in each.files]
    except MeasureError:  # said when the measure is taken
        return []


def _texts(scenario: str, folder: Path | None) -> dict[str, str]:
    """What the experiment of a scenario measures, by name; nothing if there is none, or none that can be read."""
    try:
        file = None if folder is None else folder / PLAN
        if file is not None and file.is_file():
            return read_experiment(file).measures
        experiment = experiment_of_scenario(scenario)
    except SleepcastError:  # `sleepcast sweep` says what is wrong with it
        return {}
    return {} if experiment is None else experiment.measures


def recorded_measures(scenario: str) -> list[Taken]:
    """The measures of the experiment of a scenario, for a recording: what no expression stands for is not in it."""
    return [(name, text, _not_recorded) for name, text in _texts(scenario, None).items()]


def _not_recorded() -> float:
    raise SleepcastError("This is measured of a running swarm, and is not in a recording.")


def _taken(text: str, fleet: SimulatedFleet, own: bool) -> float:
    """Raises SleepcastError for what cannot be measured, and for a fleet that is too large."""
    if len(fleet) > MAX_ROBOTS:
        raise SleepcastError(f"This is measured of at most {MAX_ROBOTS:,} robots while a page is open.")
    measure = read_measure(text, own=own)
    try:
        return measure(fleet)
    except SleepcastError:
        raise
    except Exception as error:  # a function in Python may do anything, and the page goes on
        raise SleepcastError(f"{type(error).__name__}: {error}") from error


def _latest(fleet: SimulatedFleet, name: str) -> float:
    series = fleet.swarm.simulator.measured()[name]
    return series[-1][1] if series else nan
