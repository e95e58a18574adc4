"""The measures of a scenario's experiment, taken of a swarm that runs on a page."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import nan

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.errors import SleepcastError
from sleepcast.experiments.measures import read_measure
from sleepcast.experiments.plan import experiment_of_scenario

MOST_ROBOTS = 20_000
"""Robots of which a measure of the group as a whole is taken while a page is served: of more it takes too long between
two ticks."""

Taken = tuple[str, str, Callable[[], float]]
"""A measure: its name, its text, and what gives its value now, NaN for unknown."""


def live_measures(fleet: SimulatedFleet) -> list[Taken]:
    """The measures of the scenario's experiment, and the time series that its own file asks for. Raises MisuseError for
    an experiment in which something is wrong."""
    scenario = fleet.swarm.simulator.scenario
    experiment = experiment_of_scenario(scenario.name)
    found: list[Taken] = []
    for name, text in experiment.measures.items() if experiment is not None else ():
        found.append((name, text, partial(_taken, read_measure(text), fleet)))
    found += [(spec.name, spec.name, partial(_latest, fleet, spec.name)) for spec in scenario.measures]
    return found


def recorded_measures(scenario: str) -> list[Taken]:
    """The measures of the experiment of a scenario, for a recording: what no expression stands for is not in it."""
    experiment = experiment_of_scenario(scenario)
    return [] if experiment is None else [(name, text, _not_recorded) for name, text in experiment.measures.items()]


def _not_recorded() -> float:
    raise SleepcastError("This is measured of a running swarm, and is not in a recording.")


def _taken(measure: Callable[[SimulatedFleet], float], fleet: SimulatedFleet) -> float:
    """Raises SleepcastError for a fleet that is too large."""
    if len(fleet) > MOST_ROBOTS:
        raise SleepcastError(f"This is measured of at most {MOST_ROBOTS:,} robots while a page is open.")
    return measure(fleet)


def _latest(fleet: SimulatedFleet, name: str) -> float:
    series = fleet.swarm.simulator.measured()[name]
    return series[-1][1] if series else nan
