"""The plan of an experiment: what is varied, what is measured, and the runs that follow from it.

    scenario = "crowd"
    seconds = "60s"
    seeds = 20                                  # 1 to 20, or a list of your own
    every = "10s"                               # between two samples; without it there is one, at the end
    until = "share (< (DIST x y 0 0) 5m) >= 0.9"

    [over]
    radio.loss = [0, 0.1, 0.3]                  # each with each
    robots.limits.speed = ["0.5m/s", "1m/s"]

    [measures]
    charge = "mean battery"

    [[commands]]
    at = "5s"
    text = "(WHEN (> battery 50%) (JOIN a))"

With `[precision]`, `seeds` is the most: at each point there are no more runs than it takes until the mean of a measure
is known well enough. With `sampling` as "latin" (a Latin hypercube) or "sobol", and a number of `points`, `over` has
ranges instead: `radio.loss = { low = 0, high = 0.5 }`, whole numbers from `{ low = 10, high = 50, whole = true }`, and
a list is a choice. With "search", points are suggested on the way, so that a measure becomes as large or small as it
can: `maximise = "charge"`; see `search`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from importlib.util import find_spec
from itertools import islice, product
from math import floor, inf, isfinite, prod
from pathlib import Path
from typing import TypeVar

import msgspec

from sleepcast.core.errors import MisuseError, decimal_comma, did_you_mean
from sleepcast.core.extras import installing
from sleepcast.core.given_numbers import MAX_SEED, read_seed, whole_number
from sleepcast.core.quantities import as_measure
from sleepcast.core.settings import Table, key_path, shown_key, toml_document
from sleepcast.core.toml_text import toml_key, toml_value
from sleepcast.core.units import TIME, UNITS, Dimension
from sleepcast.experiments.measures import name_of, read_measure, read_stop
from sleepcast.simulator import Changes, Scenario, find_scenario, scenario_names
from sleepcast.simulator.scenario.scenario import GALLERY, is_scenario_file

PLAN, SCENARIO = "experiment.toml", "scenario.toml"
SEARCH = "search"
SAMPLINGS = ("grid", "latin", "sobol", SEARCH)
MAX_SEARCHED = 5_000
"""Points of a search: each suggestion looks at all points before it."""
MAX_TOGETHER = 100
"""Points that a search suggests at a time: they know nothing of each other."""
MAX_ROWS = 1_000_000
MAX_VALUES = 1_000
"""Values of one key in a list: each is checked before the first run."""
MAX_LISTED = 5
"""Values that a sentence about repeated ones lists."""
MAX_VARIED, MAX_MEASURES, MAX_COMMANDS = 16, 64, 100
LONGEST = 1e7
"""Simulated seconds of a run: four months."""

TIMING = ("seconds", "tick", "mission")
"""Keys of a scenario that decide about times; `[constants]`, too."""

Value = bool | int | float | str
Setting = tuple[Value, ...]
"""What one key says, run by run."""

_NUMBER = re.compile(r"([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z%/0-9]*)")


class PlanError(MisuseError):
    """A plan that cannot be carried out."""


class ParameterRange(msgspec.Struct, frozen=True):
    """From low to high, both with the same unit ("" for none); with whole, only whole numbers, both ends included."""

    low: float
    high: float
    unit: str = ""
    whole: bool = False

    @property
    def count(self) -> float:
        """How many different values there are; inf for a range of numbers."""
        return int(self.high) - int(self.low) + 1 if self.whole else inf

    def at(self, share: float) -> Value:
        """The value so far along, as it stands in a scenario."""
        if self.whole:
            return self.written(min(floor(self.low + share * (self.high - self.low + 1)), int(self.high)))
        return self.written(self.low + share * (self.high - self.low))

    def written(self, value: float) -> Value:
        """A value as it stands in a scenario."""
        return f"{value!r}{self.unit}" if self.unit else value

    def number(self, written: Value) -> float:
        """The number of a value that stands in a scenario."""
        value = float(str(written).removesuffix(self.unit))
        return int(value) if self.whole else value


class TimedCommand(msgspec.Struct, frozen=True):
    """An expression that the desk sends at a simulated time, s."""

    at: float
    text: str


class Precision(msgspec.Struct, frozen=True):
    """There are enough runs at a point once the mean of a measure is known well enough.

    within: half of its confidence interval, at most.
    least: runs in each round, after which that is looked at.
    """

    measure: str
    within: float
    least: int = 5


class Objective(msgspec.Struct, frozen=True):
    """What a search is for: the measure whose mean shall become as large as it can, or as small.

    together: points that are suggested at a time; the next ones are only suggested when these are done.
    """

    measure: str
    largest: bool
    together: int = 4


class PlannedRun(msgspec.Struct, frozen=True):
    """One run: its number from 0, what each varied key says, and the seed."""

    number: int
    point: dict[str, Value]
    seed: int

    @property
    def key(self) -> str:
        """The same for the same run, whatever its number."""
        return json.dumps([self.point, self.seed], sort_keys=True)


class Experiment(msgspec.Struct, frozen=True):
    """See the module. Seeds, and the values of a key, are different ones: of equal ones the first is taken.

    over: by key, its values, or the range from which they are drawn.
    seconds: of a run; None for the scenario's own.
    every: s between samples; None for one sample at the end.
    mission: whether the desk sends the scenario's own commands as well.
    repeated: what was given more than once, in sentences for people.
    """

    scenario: str
    seeds: tuple[int, ...]
    measures: dict[str, str]
    over: dict[str, Setting | ParameterRange] = {}
    seconds: float | None = None
    every: float | None = None
    until: str = ""
    mission: bool = True
    commands: tuple[TimedCommand, ...] = ()
    sampling: str = "grid"
    points: int = 0
    precision: Precision | None = None
    goal: Objective | None = None
    repeated: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Keep one of equal seeds, values and points: a run that is wanted twice is one run, and would be missed."""
        seeds, again = _different(map(read_seed, self.seeds), int)
        sentences, over = [*self.repeated, *_said_again("seeds", again)], dict(self.over)
        for key, setting in self.over.items():
            if not isinstance(setting, ParameterRange):
                over[key], others = _different(setting, partial(_meaning, plain=_sort_of_plain(setting)))
                sentences += _said_again(f"over {key:.80}", others)
        points, most = self.points, prod(map(_count, over.values()))
        if self.goal is not None and most < points:
            sentences.append(f"points: only {most:,} different ones fit into these ranges, not {points:,}")
            points = int(most)
        for name, value in (("seeds", seeds), ("over", over), ("points", points), ("repeated", tuple(sentences))):
            msgspec.structs.force_setattr(self, name, value)

    def __len__(self) -> int:
        """How many runs there are; with a precision, at most."""
        return len(self.seeds) * self._count_points()

    def _count_points(self) -> int:
        if not self.points:
            return prod(len(_values(each)) for each in self.over.values())
        if self.goal is not None:
            return self.points
        return _count_drawn(self.sampling, tuple(self.over.values()), self.points)

    def repeats(self) -> tuple[str, ...]:
        """What was given or drawn more than once, and is done once: sentences for people."""
        count = self._count_points()
        if count == self.points or not self.points:
            return self.repeated
        return (
            *self.repeated,
            f"points: only {count:,} of {self.points:,} that were drawn are different; each is done once",
        )

    def runs(self) -> Iterator[PlannedRun]:
        """All of them, seed by seed, so that the first ones say something of every point; none of a search, whose
        points are known on the way only. What was drawn again has a number, but no run."""
        points = list(self._points())
        width = self.points or len(points)
        for row, seed in enumerate(self.seeds):
            for number, point in points:
                yield PlannedRun(row * width + number, point, seed)

    def grid(self) -> Iterator[dict[str, Value]]:
        """Every point of a search, one after the other, if no key has a range of numbers; else nothing."""
        size = prod(map(_count, self.over.values()))
        for number in range(int(size) if isfinite(size) else 0):
            point = {}
            for key, setting in self.over.items():
                number, index = divmod(number, int(_count(setting)))
                point[key] = (
                    setting.written(int(setting.low) + index) if isinstance(setting, ParameterRange) else setting[index]
                )
            yield point

    def rounds(self) -> Iterator[list[PlannedRun]]:
        """The same in the rounds after which is looked whether there are enough."""
        runs = list(self.runs())
        size = len(runs) if self.precision is None else self.precision.least * (len(runs) // len(self.seeds))
        yield from (runs[start : start + size] for start in range(0, len(runs), size))

    def varied(
        self,
        *,
        over: Sequence[str] = (),
        seeds: int = 0,
        seconds: float | None = None,
        every: float | None = None,
        until: str = "",
        mission: bool = True,
    ) -> Experiment:
        """The same, but for what is said here as in `experiment_of`. Raises PlanError."""
        if self.points and over:
            raise PlanError(f"over: the points of this experiment are drawn ({self.sampling}); change its file instead")
        replaced = ("over ",) * bool(over) + ("seeds:",) * bool(seeds)
        return msgspec.structs.replace(
            self,
            over=_varied(over) if over else self.over,
            seeds=_numbers(seeds) if seeds else self.seeds,
            seconds=seconds or self.seconds,
            every=every or self.every,
            until=until or self.until,
            mission=mission and self.mission,
            repeated=tuple(each for each in self.repeated if not each.startswith(replaced)),
        )

    def _points(self) -> Iterator[tuple[int, dict[str, Value]]]:
        """Each point once, with its place among all that were given or drawn."""
        settings = tuple(self.over.values())
        points: Iterable[tuple[int, Setting]] = enumerate(product(*map(_values, settings)))
        if self.points:
            points = _drawn_once(self.sampling, settings, self.points)
        for number, values in () if self.goal is not None else points:
            yield number, dict(zip(self.over, values, strict=True))

    def first(self) -> PlannedRun:
        """A run to try things out with."""
        middle = {key: _at(setting, 0.5) for key, setting in self.over.items()}
        return PlannedRun(0, next((point for _, point in self._points()), middle), self.seeds[0])

    def scenario_at(self, point: Mapping[str, Value], seed: int | None = None) -> Scenario:
        """The scenario with these settings. Raises what `find_scenario` raises."""
        return find_scenario(self.scenario, Changes(seed=seed, over=tuple(point.items())))

    def timings(self) -> Iterator[Scenario]:
        """The scenario of the first run, and with each value of what decides how long a run is, or when something is
        sent in it."""
        first = self.first().point
        yield self.scenario_at(first)
        for key, setting in self.over.items():
            if key in TIMING or key.startswith("constants."):
                yield from (self.scenario_at(first | {key: value}) for value in _values(setting))

    def checked(self) -> Experiment:
        """The same, if it can be carried out: every measure can be read, and every value of every key fits the
        scenario. What measures in Python name is imported: see `trust`. Raises MisuseError."""
        if not self.seeds or len(self) == 0:
            raise PlanError("an experiment without a run: wanted a seed, and a value for each key")
        if len(self) > MAX_ROWS:
            raise PlanError(f"{len(self):,} runs: at most {MAX_ROWS:,} fit into one experiment")
        if len(self.over) > MAX_VARIED:
            raise PlanError(f"{len(self.over)} keys are varied: at most {MAX_VARIED} fit")
        for key, setting in self.over.items():
            if len(_values(setting)) > MAX_VALUES:
                raise PlanError(
                    f"over {key:.80}: {len(_values(setting)):,} values: at most {MAX_VALUES:,} fit; to draw more of "
                    'them from a range, write sampling = "sobol" into an experiment file'
                )
        if not self.measures:
            raise PlanError("nothing is measured: wanted a measure, such as mean fuel")
        for name, text in self.measures.items():
            if name in (*self.over, *RESERVED):
                raise PlanError(f'measure "{name}": the table has a column of this name already; choose another name')
            read_measure(text, own=True)
        if self.until:
            read_stop(self.until, own=True)
        if self.precision is not None and self.precision.measure not in self.measures:
            known = f"{did_you_mean(self.precision.measure, self.measures)}: wanted one of {', '.join(self.measures)}"
            raise PlanError(f'precision: nothing is measured as "{self.precision.measure:.80}"{known}')
        if self.goal is not None:
            self._check_search(self.goal)
        self._check_points()
        return self

    def _check_points(self) -> None:
        """Raises MisuseError for a value that does not fit the scenario, and for a key on which no run depends."""
        for key, decided in self._decided().items():
            if key in self.over:
                raise PlanError(f"over {key}: {decided}")
        first = self.first().point
        last = {key: _values(setting)[-1] for key, setting in self.over.items()}
        self.scenario_at(first)
        for key, setting in self.over.items():
            if not self._matters(key, setting, first) and not self._matters(key, setting, last):
                raise PlanError(f"over {key:.80}: no run depends on it, so that all would be the same: leave it out")

    def _matters(self, key: str, setting: Setting | ParameterRange, point: Mapping[str, Value]) -> bool:
        """Whether runs at this point may differ by what is varied; also where there is one value only. Raises
        MisuseError for a value that does not fit."""
        values = _values(setting)
        usual = _run_of(self.scenario_at({**point, key: values[0]}))
        different = [_run_of(self.scenario_at({**point, key: value})) != usual for value in values[1:]]
        return any(different) or not different

    def _decided(self) -> dict[str, str]:
        """The keys of a scenario that an experiment decides itself, each with what to do instead."""
        decided = {
            "seed": "each run has a seed of its own: --seeds 20 are 1 to 20; in a plan, seeds = [42, 43] are these",
            "speed_up": "a run of a sweep goes as fast as it can: leave it out",
        }
        if self.seconds is not None:
            decided["seconds"] = "the experiment says how long a run is: leave out one of them"
        if not self.mission:
            decided["mission"] = "the experiment leaves the mission out: leave out one of them"
        return decided

    def _check_search(self, goal: Objective) -> None:
        key = "maximise" if goal.largest else "minimise"
        if goal.measure not in self.measures:
            known = f"{did_you_mean(goal.measure, self.measures)}: wanted one of {', '.join(self.measures)}"
            raise PlanError(f'{key}: nothing is measured as "{goal.measure:.80}"{known}')
        if self.precision is not None:
            raise PlanError("precision: a search does every point with all seeds: leave one of them out")
        if find_spec("optuna") is None:
            raise PlanError(f"a search needs Optuna; to install it: {installing('search')}")

    def to_toml(self) -> str:
        """The file that says the same; equal for equal experiments."""
        lines = [f"scenario = {_toml(self.scenario)}"]
        if self.seconds is not None:
            lines.append(f'seconds = "{self.seconds!r}s"')
        counted = self.seeds == tuple(range(1, len(self.seeds) + 1))
        lines.append(f"seeds = {len(self.seeds) if counted else _toml(self.seeds)}")
        lines += [f'every = "{self.every!r}s"'] if self.every is not None else []
        lines += [f"until = {_toml(self.until)}"] if self.until else []
        lines += [] if self.mission else ["mission = false"]
        lines += [f'sampling = "{self.sampling}"', f"points = {self.points}"] if self.points else []
        if (goal := self.goal) is not None:
            lines += [f"{'maximise' if goal.largest else 'minimise'} = {_toml(goal.measure)}"]
            lines += [f"together = {goal.together}"]
        varied = [f"{toml_key(key)} = {_toml(each)}" for key, each in self.over.items()]
        lines += ["", "[over]", *varied] if varied else []
        lines += ["", "[measures]", *(f"{toml_key(name)} = {_toml(text)}" for name, text in self.measures.items())]
        if (wanted := self.precision) is not None:
            lines += ["", "[precision]", f"measure = {_toml(wanted.measure)}"]
            lines += [f"within = {wanted.within!r}", f"least = {wanted.least}"]
        for command in self.commands:
            lines += ["", "[[commands]]", f'at = "{command.at!r}s"', f"text = {_toml(command.text)}"]
        return "\n".join(lines) + "\n"


RESERVED = ("run", "seed", "time", "error", "hash")
"""Columns that every table of results has."""


def read_experiment(path: Path, text: str | None = None) -> Experiment:
    """The experiment in the TOML file at `path`. Raises SettingsError.

    text: what is in the file; None to read it.
    """
    with toml_document(path, text).root() as root:
        sampling = root.text("sampling", "grid", choices=SAMPLINGS)
        most = MAX_SEARCHED if sampling == SEARCH else MAX_ROWS
        points = 0 if sampling == "grid" else root.whole("points", low=1, high=most)
        over = _over_of(root, sampled=sampling != "grid")
        if sampling != "grid" and not over:
            raise root.error("over", f"wanted a range to draw from, since sampling is {sampling}")
        measures = root.table("measures")
        if len(measures.values) > MAX_MEASURES:
            raise root.error("measures", f"{len(measures.values)} of them; at most {MAX_MEASURES} fit")
        with measures:
            taken = {name: measures.text(name, most=4_000) for name in measures.names()}
        return Experiment(
            scenario=_absolute(root.text("scenario", most=4_000), root.document.path.parent),
            seeds=(
                root.wholes("seeds", (), low=0, high=MAX_SEED, most=MAX_ROWS)
                if isinstance(root.values.get("seeds"), list)
                else _numbers(root.whole("seeds", 1, low=1, high=MAX_ROWS))
            ),
            measures=taken,
            over=over,
            seconds=root.number("seconds", TIME, low=0.0, high=LONGEST) if root.has("seconds") else None,
            every=root.number("every", TIME, low=0.001, high=LONGEST) if root.has("every") else None,
            until=root.text("until", ""),
            mission=root.flag("mission", True),
            commands=tuple(map(_command, root.array("commands", most=MAX_COMMANDS))),
            sampling=sampling,
            points=points,
            precision=_precision(root.table("precision")) if root.has("precision") else None,
            goal=_goal(root) if sampling == SEARCH else None,
        )


def experiment_of_scenario(scenario: str) -> Experiment | None:
    """The experiment in the folder of a scenario; None where there is none. Raises PlanError."""
    file = experiment_file(scenario)
    return None if file is None else read_experiment(file)


def experiment_file(scenario: str) -> Path | None:
    """The plan in the folder of a scenario: a name of the gallery, or the path of a folder or its scenario.toml; None
    where there is none."""
    path = Path(scenario)
    own = path.parent if path.name == SCENARIO else path
    folder = GALLERY / scenario if scenario in scenario_names() else own if (own / SCENARIO).is_file() else None
    return folder / PLAN if folder is not None and (folder / PLAN).is_file() else None


def is_written(path: Path) -> bool:
    """Whether this is a plan by itself: results of an experiment, or a TOML file that is no scenario."""
    return is_results(path) or (path.suffix == ".toml" and not is_scenario_file(path))


def is_results(folder: Path) -> bool:
    """Whether these are the results of an experiment, and no scenario with a plan beside it."""
    return (folder / PLAN).is_file() and not (folder / SCENARIO).is_file()


def experiment_of(
    scenario: str,
    *,
    over: Sequence[str] = (),
    measures: Sequence[str] = (),
    seeds: int = 1,
    seconds: float | None = None,
    every: float | None = None,
    until: str = "",
    mission: bool = True,
) -> Experiment:
    """The experiment that a command line describes. Raises PlanError.

    over: each `KEY=VALUE,VALUE`.
    measures: each `NAME=MEASURE`, or a measure alone.
    seeds: how many, from 1; the rest: see `Experiment`.
    """
    name = _absolute(scenario, Path.cwd())
    return Experiment(name, _numbers(seeds), _named(measures), _varied(over), seconds, every, until, mission)


def _named(measures: Sequence[str]) -> dict[str, str]:
    """Measures by name. Raises PlanError for two of one name, of which one column would be lost."""
    named: dict[str, str] = {}
    for each in measures:
        match = re.fullmatch(r"\s*([A-Za-z_]\w*)\s*=(?!=)(.+)", each, re.DOTALL)
        name, text = (match[1], match[2].strip()) if match else (name_of(each), each.strip())
        if name in named:
            raise PlanError(
                f'measures "{named[name]:.80}" and "{text:.80}" would both be called {name:.80}: give them different '
                f"names, as in other={text:.80}"
            )
        named[name] = text
    return named


def _run_of(scenario: Scenario) -> Scenario:
    """What a run of a sweep takes of a scenario: equal ones make equal runs."""
    return replace(scenario, title="", about="", speed_up=1.0, length_unit="", commands=(), sliders=(), origin="")


def _varied(options: Sequence[str]) -> dict[str, Setting | ParameterRange]:
    """What options say is varied, each as `KEY=VALUE,VALUE`."""
    varied: dict[str, Setting | ParameterRange] = {}
    for each in options:
        key, equals, values = each.partition("=")
        if not equals or not key.strip() or not values.strip():
            raise PlanError(f'over "{each:.80}": wanted a key and its values, such as radio.loss=0,0.1,0.3')
        name = shown_key(key_path(key.strip()))
        if name in varied:
            raise PlanError(f"over {name:.80}: it is given twice: give all its values at once, as in {name:.80}=1,2")
        varied[name] = tuple(_value(value.strip()) for value in values.split(","))
    return varied


def _numbers(seeds: int) -> tuple[int, ...]:
    """The first so many seeds."""
    return tuple(range(1, whole_number(seeds, "seeds", 1, MAX_ROWS) + 1))


def _at(setting: Setting | ParameterRange, share: float) -> Value:
    """The value so far along a range, or in a list."""
    if isinstance(setting, ParameterRange):
        return setting.at(share)
    return setting[min(int(share * len(setting)), len(setting) - 1)]


Thing = TypeVar("Thing")


def _different(given: Iterable[Thing], meaning: Callable[[Thing], Hashable]) -> tuple[tuple[Thing, ...], list[Thing]]:
    """The first of those that mean the same, and all the others. A text stands for a number that means the same: its
    unit is still to be checked."""
    kept, again = dict[Hashable, Thing](), list[Thing]()
    for each in given:
        sense = meaning(each)
        if sense in kept:
            again.append(each)
        if sense not in kept or (isinstance(each, str) and not isinstance(kept[sense], str)):
            kept[sense] = each
    return tuple(kept.values()), again


def _sort_of_plain(setting: Setting) -> Dimension | None:
    """What a number without a unit is beside these: it is in SI, of the dimension that all units have."""
    units = {each.unit for each in map(as_measure, setting) if each is not None}
    dimensions = {UNITS[unit].dimension for unit in units if unit in UNITS}
    return dimensions.pop() if len(dimensions) == 1 else None


def _meaning(value: Value, plain: Dimension | None) -> Hashable:
    """Equal for values that a scenario takes for the same one: 1 and 1.0, "1m" and "100cm", and 1 beside "1m". plain:
    see `_sort_of_plain`."""
    if isinstance(value, bool):
        return "flag", value
    measure = as_measure(value)
    if measure is None or (measure.unit and measure.unit not in UNITS):
        return "text", value
    exact = value if isinstance(value, int) else measure.value  # as a float, large ones would be equal
    return UNITS[measure.unit].dimension if measure.unit else plain, exact


def _said_again(what: str, again: Sequence[Value]) -> list[str]:
    """The sentence about what was given more than once, if anything was."""
    shown = ", ".join(map(str, dict.fromkeys(again[:MAX_LISTED]))) + (", ..." if len(again) > MAX_LISTED else "")
    return [f"{what}: {shown:.200} was given more than once, and is done once"] if again else []


def _count(setting: Setting | ParameterRange) -> float:
    """How many values a key may have."""
    return setting.count if isinstance(setting, ParameterRange) else len(setting)


def _values(setting: Setting | ParameterRange) -> Setting:
    return (setting.at(0.0), setting.at(1.0)) if isinstance(setting, ParameterRange) else setting


def _drawn_once(
    sampling: str, settings: Sequence[Setting | ParameterRange], count: int
) -> Iterator[tuple[int, Setting]]:
    """The different ones of so many points that are drawn, with their places."""
    taken = set[str]()
    for number, shares in enumerate(_drawn(sampling, len(settings), count)):
        values = tuple(_at(setting, share) for setting, share in zip(settings, shares, strict=True))
        if (text := json.dumps(values)) not in taken:
            taken.add(text)
            yield number, values


@lru_cache(maxsize=8)  # a page asks for it several times a second
def _count_drawn(sampling: str, settings: tuple[Setting | ParameterRange, ...], count: int) -> int:
    return sum(1 for _ in _drawn_once(sampling, settings, count))


def _drawn(sampling: str, dimensions: int, count: int) -> Iterator[tuple[float, ...]]:
    """That many points of the unit cube, the same in every process."""
    try:
        from scipy.stats import qmc
    except ImportError as error:
        raise PlanError(f"{sampling} sampling needs scipy; to install it: {installing('experiments')}") from error
    if sampling == "latin":
        drawn = qmc.LatinHypercube(dimensions, seed=0).random(count)
    else:
        sobol = qmc.Sobol(dimensions, scramble=False)
        drawn = sobol.random_base2((count - 1).bit_length())  # its balance holds for powers of two only
    yield from islice((tuple(point) for point in drawn.tolist()), count)


def _absolute(name: str, folder: Path) -> str:
    """The name of a scenario of the gallery, or the whole path of one of somebody's own."""
    path = folder / Path(name).expanduser()
    return str(path.resolve()) if path.exists() else name


def _over_of(root: Table, *, sampled: bool) -> dict[str, Setting | ParameterRange]:
    """What is varied, by key. Raises SettingsError for a key that is given twice: as `"radio.loss"` and in `radio`."""
    varied: dict[str, Setting | ParameterRange] = {}
    for key, setting in _over(root, root.table("over"), sampled=sampled):
        name = shown_key(key_path(key))
        if name in varied:
            raise root.table("over").error(key, "it is given twice: give all its values at once")
        varied[name] = setting
    return varied


def _over(
    root: Table, table: Table, *, sampled: bool, above: str = ""
) -> Iterator[tuple[str, Setting | ParameterRange]]:
    """By key, its values; `radio.loss` may stand as one key or in a table `radio`."""
    with table:
        for name in table.names():
            key, value = f"{above}{name}", table.values[name]
            table.has(name)
            if isinstance(value, dict) and not (sampled and {"low", "high"} <= value.keys()):
                yield from _over(root, table.table(name), sampled=sampled, above=f"{key}.")
            elif sampled and not isinstance(value, list):
                yield key, _span(table, name)
            elif isinstance(value, list) and value and all(isinstance(each, Value) for each in value):
                yield key, tuple(value)
            else:
                raise table.error(name, "wanted a list of values, such as [0, 0.1, 0.3]")


def _span(table: Table, name: str) -> ParameterRange:
    value = table.values[name]
    ends = [_NUMBER.fullmatch(str(value[end])) for end in ("low", "high")] if isinstance(value, dict) else [None]
    if any(each is None for each in ends):
        wrong = [value.get(end) for end in ("low", "high")] if isinstance(value, dict) else []
        comma = next(filter(None, map(decimal_comma, wrong)), "")
        wanted = 'wanted a range, such as { low = 0, high = 0.5 } or { low = "1m/s", high = "2m/s" }'
        raise table.error(name, wanted + comma)
    (low, unit), (high, other) = ((each[1], each[2]) for each in ends if each is not None)
    if unit != other or not (isfinite(float(low)) and isfinite(float(high)) and float(low) < float(high)):
        raise table.error(name, "wanted a range from the lower to the higher end, both with the same unit")
    with table.table(name) as span:
        span.has("low"), span.has("high")
        whole = span.flag("whole", False)
        if whole and not (float(low).is_integer() and float(high).is_integer()):
            raise span.error("whole", "wanted whole numbers as ends, such as { low = 10, high = 50, whole = true }")
    return ParameterRange(float(low), float(high), unit, whole)


def _goal(root: Table) -> Objective:
    if root.has("maximise") == root.has("minimise"):
        raise root.error("sampling", 'a search has one goal: wanted maximise = "..." or minimise = "...", a measure')
    largest = root.has("maximise")
    return Objective(
        root.text("maximise" if largest else "minimise"), largest, root.whole("together", 4, low=1, high=MAX_TOGETHER)
    )


def _precision(table: Table) -> Precision:
    with table:
        least = table.whole("least", 5, low=2, high=1_000)
        return Precision(table.text("measure"), table.number("within", low=0.0), least)


def _command(table: Table) -> TimedCommand:
    with table:
        return TimedCommand(table.number("at", TIME, low=0.0, high=LONGEST), table.text("text", most=16_000))


def _value(text: str) -> Value:
    """A value as it would stand in TOML: a number, true or false, else a text."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _toml(value: Value | Setting | ParameterRange) -> str:
    if isinstance(value, ParameterRange):
        low, high = (f'"{each!r}{value.unit}"' if value.unit else repr(each) for each in (value.low, value.high))
        return f"{{ low = {low}, high = {high}{', whole = true' if value.whole else ''} }}"
    return toml_value(value)
