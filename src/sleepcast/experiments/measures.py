"""Measures: one number of a whole fleet, from an expression on every robot or from a function in Python.

    mean fuel                              of the robots whose fuel is known
    share (IN bravo)                       of all robots, for which it is true
    quantile 0.9 (DIST x y 0 0)
    largest_cluster 2m                     of the group as a whole; see `group_measures`
    stock ore coal                         what is left of these stocks, added up, in SI
    field grass                            what all cells of this growing field have, added up, in SI
    time_mean mean fuel                    the mean of a measure over all samples of the run so far
    time_mean 20s largest_cluster 2m       over those from this time on
    analysis.spread                        the function `spread` of the module `analysis`, which takes the fleet

A package adds measures by name with entry points in the group `sleepcast.measures`.

A function in Python may do anything, so only who has decided to run what a text names (see `trust`) may ask for it:
unless `own` is said, measures in Python are refused, and no module is imported.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import import_module
from math import isfinite, isnan, nan
from operator import eq, ge, gt, le, lt
from typing import SupportsFloat, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.angles import deviation, mean_direction, quantile, widest_gap
from sleepcast.core.errors import MisuseError, decimal_comma, did_you_mean
from sleepcast.core.extensions import extensions, load_extension
from sleepcast.core.records import dataclass
from sleepcast.core.units import TIME, UNITS, to_si
from sleepcast.experiments.group_measures import NAMES, read_group_measure
from sleepcast.language import CheckError
from sleepcast.language.evaluate import is_true
from sleepcast.language.functions import BUILT_IN

Values: TypeAlias = NDArray[np.float64]
Measure: TypeAlias = Callable[[SimulatedFleet], float]

OF_KNOWN: dict[str, Callable[[Values], float]] = {
    "min": lambda values: float(values.min()),
    "mean": lambda values: float(values.mean()),
    "median": lambda values: float(np.median(values)),
    "max": lambda values: float(values.max()),
    "sum": lambda values: float(values.sum()),
    "std": lambda values: float(values.std()),
    "gap": lambda values: float(np.diff(np.sort(values)).max(initial=0.0)),
    "order": lambda values: float(np.hypot(np.cos(values).mean(), np.sin(values).mean())),
}
"""What is made of the values of the robots that know one; NaN if none does. gap: the widest between two values next to
each other: of the times at which robots did something, the longest wait. order: of angles, rad: the length of their
mean direction (the order parameter of Kuramoto, 1975), 1 if all are equal, near 0 if they are spread evenly."""
OF_ANGLES: dict[str, Callable[[Values], float]] = OF_KNOWN | {
    "min": lambda angles: quantile(angles, 0.0),
    "mean": mean_direction,
    "median": lambda angles: quantile(angles, 0.5),
    "max": lambda angles: quantile(angles, 1.0),
    "std": deviation,
    "gap": widest_gap,
}
"""The same of angles, rad; see `core.angles`. sum: of the numbers."""
ANGULAR = ("min", "mean", "median", "max", "quantile")
"""What is an angle again if it is made of angles."""
OF_TRUE: dict[str, Callable[[NDArray[np.bool_]], float]] = {
    "count": lambda true: float(np.count_nonzero(true)),
    "share": lambda true: np.count_nonzero(true) / true.size if true.size else nan,
}
"""What is made of for whom it is true; unknown is not."""
AGGREGATES = (*OF_KNOWN, *OF_TRUE, "quantile", "stock", "field")
OTHER_WORDS = {
    **dict.fromkeys(("avg", "average"), "mean"),
    **dict.fromkeys(("number", "num"), "count"),
    **dict.fromkeys(("fraction", "part", "percent", "percentage", "ratio"), "share"),
    "total": "sum",
    "minimum": "min",
    "least": "min",
    "maximum": "max",
    "most": "max",
}
"""Words that people write for those above."""
GROUP = "sleepcast.measures"

TIME_MEAN = "time_mean"
_AVERAGED = re.compile(rf"{TIME_MEAN}\s+(?:(\d+(?:\.\d*)?|\.\d+)\s*([a-z]+)\s+)?(\S.*)", re.DOTALL)
_FUNCTION = re.compile(r"([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)[.:]([A-Za-z_]\w*)")
_CALLED = re.compile(rf"({'|'.join(AGGREGATES)})\((.*)\)", re.DOTALL)
_QUANTILE = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s+(.+)", re.DOTALL)
_STOP = re.compile(r"(.+?)\s*(>=|<=|==|>|<)\s*([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*", re.DOTALL)
_COMPARED = {">=": ge, "<=": le, "==": eq, ">": gt, "<": lt}


class MeasureError(MisuseError):
    """A measure that cannot be taken."""


def read_measure(text: str, *, own: bool = False) -> Measure:
    """The measure that a text describes. Raises MeasureError.

    own: functions in Python, too, whose modules are imported.
    """
    first, _, rest = text.strip().partition(" ")
    expression = rest.strip()
    if first == TIME_MEAN:
        return _time_mean(text, own=own)
    if first in NAMES:
        return read_group_measure(text)
    if expression and first in OF_KNOWN:
        return lambda fleet: _of_known(fleet, expression, OF_KNOWN[first], OF_ANGLES[first])
    if expression and first in OF_TRUE:
        return lambda fleet: OF_TRUE[first](is_true(fleet[expression]))
    if expression and first == "quantile":
        return _quantile(text, expression)
    if expression and first in _LEVELS:
        return lambda fleet: _sum_of(first, expression.split(), _LEVELS[first](fleet))
    if meant := _meant(text.strip()):
        raise MeasureError(f'measure "{text:.80}": write {meant:.80}')
    if expression:
        raise MeasureError(
            f'measure "{text:.80}": there is no "{first:.40}"{did_you_mean(first, (*AGGREGATES, *NAMES, TIME_MEAN))}: '
            f"wanted one of {', '.join(AGGREGATES)} and an expression, such as mean fuel"
        )
    if not own and own_function(first) is not None:
        raise MeasureError(
            f'measure "{text:.80}" is a function in Python, and what comes from others is not run: wanted one of '
            f"{', '.join((*AGGREGATES, *NAMES))}, as in mean fuel"
        )
    return _function(first, own=own)


def _time_mean(text: str, *, own: bool) -> Measure:
    """The mean of a measure over the samples so far, as a measure that keeps them: it is of one run. What was unknown
    is left out."""
    parts = _AVERAGED.fullmatch(text.strip())
    if parts is None or parts[3].startswith(TIME_MEAN) or (parts[2] and not _is_time(parts[2])):
        raise MeasureError(
            f'measure "{text:.80}": wanted {TIME_MEAN}, perhaps a time from which on, and a measure, as in '
            f"{TIME_MEAN} 20s mean fuel"
        )
    measure, angle, samples = read_measure(parts[3], own=own), angle_of(parts[3]), list[float]()
    begin = begin_of(text)

    def measured(fleet: SimulatedFleet) -> float:
        value = measure(fleet)
        if not isnan(value) and fleet.time >= begin - 1e-9:
            samples.append(value)
        mean = mean_direction if angle and fleet.checked(angle).is_angle else np.mean
        return float(mean(np.array(samples))) if samples else nan

    return measured


def begin_of(text: str) -> float:
    """From when on a measure has values, s of the run: 0, but for the mean over the samples from a time on."""
    parts = _AVERAGED.fullmatch(text.strip())
    return to_si(float(parts[1]), parts[2]) if parts and parts[2] else 0.0


def _is_time(unit: str) -> bool:
    return unit in UNITS and UNITS[unit].dimension == TIME


def _meant(text: str) -> str:
    """The measure that was probably meant by what is none: other words for these, or a test without one."""
    first, _, rest = text.partition(" ")
    if called := _CALLED.fullmatch(text):
        given = called[2].strip()
        return f"{called[1]} ({given})" if " " in given and not given.startswith("(") else f"{called[1]} {given}"
    if first.casefold() in OTHER_WORDS and (rest.startswith("(") or len(rest.split()) == 1):
        return f"{OTHER_WORDS[first.casefold()]} {rest.strip()}"
    if text.startswith("("):
        return f"count {text}, share {text} or mean {text}"
    known = BUILT_IN.get(first.casefold())
    return f"count ({text}) or share ({text})" if known and rest else ""


def own_function(text: str) -> tuple[str, str] | None:
    """Module and name of the function in Python that a measure names, also one of which it takes the mean; None for
    every other measure."""
    averaged = _AVERAGED.fullmatch(text.strip())
    match = _FUNCTION.fullmatch(averaged[3] if averaged else text.strip())
    return None if match is None else (match[1], match[2])


def if_known(measure: Measure) -> Measure:
    """The same, and NaN as long as robots have not yet learned what it names."""

    def measured(fleet: SimulatedFleet) -> float:
        try:
            return measure(fleet)
        except CheckError:
            return nan

    return measured


def name_of(text: str) -> str:
    """A name for a measure that got none: the function's own, or the text with `_` for everything between words."""
    function = own_function(text)
    return function[1] if function else re.sub(r"\W+", "_", text).strip("_")[:32]


@dataclass(frozen=True)
class StopCondition:
    """A run ends early when it holds: `share (IN bravo) >= 0.9`."""

    text: str
    measure: Measure
    compared: Callable[[float, float], bool]
    bound: float

    def holds(self, fleet: SimulatedFleet) -> bool:
        """Whether it does now; not while the measure is unknown."""
        return self.compared(self.measure(fleet), self.bound)


def read_stop(text: str, *, own: bool = False) -> StopCondition:
    """The condition that a text describes. own: as for `read_measure`. Raises MeasureError."""
    parts = _parts_of_stop(text)
    return StopCondition(text, read_measure(parts[1], own=own), _COMPARED[parts[2]], float(parts[3]))


def measure_of_stop(text: str) -> str:
    """The measure in a condition. Raises MeasureError."""
    return _parts_of_stop(text)[1]


def _parts_of_stop(text: str) -> re.Match[str]:
    parts = _STOP.fullmatch(text)
    if parts is None:
        comma = decimal_comma(re.split(r"[<>=]", text)[-1])
        raise MeasureError(f'"{text:.80}": wanted a measure and a bound, such as share (IN bravo) >= 0.9{comma}')
    return parts


def _of_known(
    fleet: SimulatedFleet,
    expression: str,
    of_numbers: Callable[[Values], float],
    of_angles: Callable[[Values], float],
) -> float:
    values = fleet[expression]
    known = values[~np.isnan(values)]
    aggregate = of_angles if fleet.checked(expression).is_angle else of_numbers
    return aggregate(known) if known.size else nan


def _quantile(text: str, rest: str) -> Measure:
    parts = _QUANTILE.fullmatch(rest)
    share = float(parts[1]) if parts else nan
    if parts is None or not 0.0 <= share <= 1.0:
        comma = decimal_comma(rest.split(maxsplit=1)[0])
        raise MeasureError(f'measure "{text:.80}": wanted a share and an expression, such as quantile 0.9 fuel{comma}')
    expression = parts[2]
    return lambda fleet: _of_known(
        fleet,
        expression,
        lambda values: float(np.quantile(values, share)),
        lambda angles: quantile(angles, share),
    )


def angle_of(text: str) -> str:
    """The expression whose values a measure turns into an angle if they are angles; "" for any other measure."""
    if averaged := _AVERAGED.fullmatch(text.strip()):
        return angle_of(averaged[3])
    first, _, rest = text.strip().partition(" ")
    if first == "quantile" and (parts := _QUANTILE.fullmatch(rest.strip())):
        return parts[2]
    return rest.strip() if first in ANGULAR else ""


def _amounts(fleet: SimulatedFleet) -> dict[str, float]:
    """What all cells of each growing field have, in SI."""
    simulator = fleet.swarm.simulator
    grown = {field.name: simulator.senses.amount(field.name) for field in simulator.scenario.fields}
    return {name: float(amount.sum()) for name, amount in grown.items() if amount is not None}


_LEVELS: dict[str, Callable[[SimulatedFleet], dict[str, float]]] = {
    "stock": lambda fleet: fleet.swarm.simulator.stocks(),
    "field": _amounts,
}
"""What the world holds of each thing of a kind, by its name."""


def _sum_of(what: str, names: list[str], left: dict[str, float]) -> float:
    """What is left of these things of a kind, added up."""
    for name in names:
        if name not in left:
            known = (
                f"{did_you_mean(name, left)}: wanted one of {', '.join(left)}" if left else ": this scenario has none"
            )
            kind = "growing field" if what == "field" else what
            raise MeasureError(f'no {kind} "{name:.80}"{known}')
    return sum(left[name] for name in names)


def _number(name: str, value: object) -> float:
    """What a function of somebody's own has given; NaN if it is not finite. Raises MeasureError if it is no number."""
    if isinstance(value, str | bytes) or not isinstance(value, SupportsFloat):
        raise MeasureError(f'measure "{name:.80}" gave {value!r:.40}, a {type(value).__name__}: wanted a number')
    try:
        number = float(value)
    except TypeError as error:  # an array of many
        raise MeasureError(f'measure "{name:.80}" gave a {type(value).__name__}: wanted one number') from error
    return number if isfinite(number) else nan


def _function(name: str, *, own: bool) -> Measure:
    added = extensions(GROUP) if own else {}
    try:
        if name in added:
            function = load_extension(added[name], "measure")
        elif named := own_function(name):
            function = getattr(import_module(named[0]), named[1])
        else:
            raise MeasureError(
                f'no measure "{name:.80}"{did_you_mean(name, (*added, *NAMES))}: wanted {", ".join(AGGREGATES)} and an '
                "expression, such as mean fuel, or a function in Python, such as analysis.spread"
            )
    except MisuseError:
        raise
    except Exception as error:  # a module that is imported may do anything
        raise MeasureError(f'measure "{name:.80}" cannot be loaded: {type(error).__name__}: {error}') from error
    if not callable(function):
        raise MeasureError(f'measure "{name:.80}" is no function')

    def measured(fleet: SimulatedFleet) -> float:
        return _number(name, function(fleet))

    return measured
