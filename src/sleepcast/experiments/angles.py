"""Which measures of an experiment are angles, so that means over its runs are circular ones.

The units of what a scenario's robots know say it.
"""

from __future__ import annotations

from sleepcast.api.assembly import vocabulary_in
from sleepcast.core.errors import SleepcastError
from sleepcast.experiments.measures import angle_of
from sleepcast.experiments.plan import Experiment
from sleepcast.language import Vocabulary, check
from sleepcast.language.learned_names import LearnedNames
from sleepcast.simulator import Changes, find_scenario

_KNOWN: dict[tuple[object, ...], frozenset[str]] = {}
"""What was found out, by scenario and measures."""


def angles_of(experiment: Experiment) -> frozenset[str]:
    """The names of the measures that are angles; of those that name what robots learn in a run, none."""
    asked = {name: expression for name, text in experiment.measures.items() if (expression := angle_of(text))}
    key = (experiment.scenario, *asked.items())
    if key not in _KNOWN:
        vocabulary = _vocabulary(experiment) if asked else None
        is_angle = {} if vocabulary is None else {name: _is_angle(text, vocabulary) for name, text in asked.items()}
        _KNOWN[key] = frozenset(name for name, true in is_angle.items() if true)
    return _KNOWN[key]


def _vocabulary(experiment: Experiment) -> Vocabulary | None:
    """What robots of its scenario know; None if there is no such scenario any more."""
    for robots in (1, None):  # some worlds are too small for one robot
        try:
            changes = Changes(robots=robots, over=tuple(experiment.first().point.items()))
            return vocabulary_in(find_scenario(experiment.scenario, changes))
        except SleepcastError:
            continue
    return None


def _is_angle(expression: str, vocabulary: Vocabulary) -> bool:
    try:
        return check(expression, LearnedNames(vocabulary)).is_angle
    except SleepcastError:
        return False
