"""Search: points suggested one after the other, where a measure becomes as large or as small as it can.

Optuna's tree-structured Parzen estimator (Bergstra et al. 2011) suggests a few points at a time from all that were done
before these, with chance that depends on nothing but how many there were. So a search does the same points on any
number of workers, and goes on after an interruption as if there had been none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple
from warnings import catch_warnings, simplefilter

from sleepcast.experiments.plan import Experiment, ParameterRange, Setting, Value

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution

ATTEMPTS = 20
"""Suggestions after which the first point is done that was not tried before, if they can be counted: a point is done
once, though the search may like it best."""

Point = dict[str, Value]


class Tried(NamedTuple):
    """A point that was done. value: the mean of the measure over its seeds, None if it is unknown."""

    point: Point
    value: float | None


def suggest(experiment: Experiment, tried: Sequence[Tried], count: int) -> list[Point]:
    """So many points to do next."""
    import optuna
    from optuna.trial import TrialState, create_trial

    goal = experiment.goal
    assert goal is not None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    distributions = {key: _distribution(setting) for key, setting in experiment.over.items()}
    with catch_warnings():
        simplefilter("ignore")  # that points are suggested together is new in some versions
        sampler = optuna.samplers.TPESampler(seed=len(tried), constant_liar=True)
        study = optuna.create_study(sampler=sampler, direction="maximize" if goal.largest else "minimize")
        for point, value in tried:
            study.add_trial(
                create_trial(
                    state=TrialState.FAIL if value is None else TrialState.COMPLETE,
                    params=_numbers(experiment, point),
                    distributions=distributions,
                    value=value,
                )
            )
        known = [each.point for each in tried]
        for _ in range(count):
            for _ in range(ATTEMPTS):
                point = _written(experiment, study.ask(distributions).params)
                if point not in known:
                    break
            else:
                point = next((each for each in experiment.grid() if each not in known), point)
            known.append(point)
    return known[len(tried) :]


def _distribution(setting: Setting | ParameterRange) -> BaseDistribution:
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    if not isinstance(setting, ParameterRange):
        return CategoricalDistribution(setting)
    if setting.whole:
        return IntDistribution(int(setting.low), int(setting.high))
    return FloatDistribution(setting.low, setting.high)


def _numbers(experiment: Experiment, point: Point) -> dict[str, Value]:
    """A point as Optuna has it."""
    return {
        key: setting.number(point[key]) if isinstance(setting, ParameterRange) else point[key]
        for key, setting in experiment.over.items()
    }


def _written(experiment: Experiment, params: Mapping[str, Value]) -> Point:
    """A point as it stands in a scenario."""
    return {
        key: setting.written(float(params[key]) if not setting.whole else int(params[key]))
        if isinstance(setting, ParameterRange)
        else params[key]
        for key, setting in experiment.over.items()
    }
