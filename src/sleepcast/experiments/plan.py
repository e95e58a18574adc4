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
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from itertools import islice, product
from math import floor, isfinite, prod
from pathlib import Path

import msgspec

from sleepcast.core.errors import MisuseError, decimal_comma, did_you_mean
from sleepcast.core.extras import installing
from sleepcast.core.settings import Table, toml_document
from sleepcast.core.toml_text import toml_key, toml_value
from sleepcast.core.units import TIME
from sleepcast.experiments.measures import name_of, read_measure, read_stop
from sleepcast.simulator import Changes, Scenario, find_scenario, scenario_names
from sleepcast.simulator.scenario.scenario import GALLERY

PLAN, SCENARIO = "experiment.toml", "scenario.toml"
SEARCH = "search"
SAMPLINGS = ("grid", "latin", "sobol", SEARCH)
MAX_SEARCHED = 5_000
"""Points of a search: each suggestion looks at all points before it."""
MAX_TOGETHER = 100
"""Points that a search suggests at a time: they know nothing of each other."""
MAX_ROWS = 1_000_000
MAX_SEED = 2**63 - 1
MAX_VALUES = 1_000
"""Values of one key in a list: each is checked before the first run."""
MAX_VARIED, MAX_MEASURES, MAX_COMMANDS = 16, 64, 100
LONGEST = 1e7
"""Simulated seconds of a run: four months."""

Value = bool | int | float | str
Setting = tuple[Value, ...]
"""What one key says, run by run."""

_NUMBER = re.compile(r"([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z%/0-9]*)")


class PlanError(MisuseError):
    """A plan that cannot be carried out."""


class Span(msgspec.Struct, frozen=True):
    """From low to high, both with the same unit ("" for none). whole: only whole numbers, both ends included."""

    low: float
    high: float
    unit: str = ""
    whole: bool = False

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
    """There are enough runs at a point once the confidence interval of the mean of a measure is at most `within` on
    each side. least: runs in each round, after which that is looked at."""

    measure: str
    within: float
    least: int = 5


class Goal(msgspec.Struct, frozen=True):
    """What a search is for: the measure whose mean shall become as large as it can, or as small. together: points that
    are suggested at a time; the next ones are only suggested when these are done."""

    measure: str
    largest: bool
    together: int = 4


class Run(msgspec.Struct, frozen=True):
    """One run: its number from 0, what each varied key says, and the seed."""

    number: int
    point: dict[str, Value]
    seed: int

    @property
    def key(self) -> str:
        """The same for the same run, whatever its number."""
        return json.dumps([self.point, self.seed], sort_keys=True)


class Experiment(msgspec.Struct, frozen=True):
    """See the module. seconds: of a run, None for the scenario's own. every: s between samples, None for one sample at
    the end. mission: whether the desk sends the scenario's own commands as well. over: by key, its values, or the span
    from which they are drawn."""

    scenario: str
    seeds: tuple[int, ...]
    measures: dict[str, str]
    over: dict[str, Setting | Span] = {}
    seconds: float | None = None
    every: float | None = None
    until: str = ""
    mission: bool = True
    commands: tuple[TimedCommand, ...] = ()
    sampling: str = "grid"
    points: int = 0
    precision: Precision | None = None
    goal: Goal | None = None

    def __len__(self) -> int:
        """How many runs there are; with a precision, at most."""
        return len(self.seeds) * (self.points or prod(len(_values(each)) for each in self.over.values()))

    def runs(self) -> Iterator[Run]:
        """All of them, seed by seed, so that the first ones say something of every point; none of a search, whose
        points are known on the way only."""
        points = list(self._points())
        for number, (seed, point) in enumerate(product(self.seeds, points)):
            yield Run(number, point, seed)

    def rounds(self) -> Iterator[list[Run]]:
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
        return msgspec.structs.replace(
            self,
            over=_varied(over) if over else self.over,
            seeds=_numbers(seeds) if seeds else self.seeds,
            seconds=seconds or self.seconds,
            every=every or self.every,
            until=until or self.until,
            mission=mission and self.mission,
        )

    def _points(self) -> Iterator[dict[str, Value]]:
        keys = list(self.over)
        if self.goal is not None:
            return
        if not self.points:
            for values in product(*(_values(each) for each in self.over.values())):
                yield dict(zip(keys, values, strict=True))
            return
        for shares in _drawn(self.sampling, len(keys), self.points):
            yield {key: _at(self.over[key], share) for key, share in zip(keys, shares, strict=True)}

    def first(self) -> Run:
        """A run to try things out with."""
        middle = {key: _at(setting, 0.5) for key, setting in self.over.items()}
        return Run(0, next(self._points(), middle), self.seeds[0])

    def scenario_at(self, point: Mapping[str, Value], seed: int | None = None) -> Scenario:
        """The scenario with these settings. Raises what `find_scenario` raises."""
        return find_scenario(self.scenario, Changes(seed=seed, over=tuple(point.items())))

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
        first = self.first().point
        for key, setting in self.over.items():
            for value in _values(setting):
                self.scenario_at(first | {key: value})
        self.scenario_at(first)
        return self

    def _check_search(self, goal: Goal) -> None:
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
    """The experiment in the TOML file at `path`; text: what would stand in it. Raises SettingsError."""
    with toml_document(path, text).root() as root:
        sampling = root.text("sampling", "grid", choices=SAMPLINGS)
        most = MAX_SEARCHED if sampling == SEARCH else MAX_ROWS
        points = 0 if sampling == "grid" else root.whole("points", low=1, high=most)
        over = dict(_over(root, root.table("over"), sampled=sampling != "grid"))
        if sampling != "grid" and not over:
            raise root.error("over", f"wanted a range to draw from, since sampling is {sampling}")
        measures = root.table("measures")
        if len(measures.values) > MAX_MEASURES:
            raise root.error("measures", f"{len(measures.values)} of them; at most {MAX_MEASURES} fit")
        with measures:
            taken = {name: measures.text(name, most=4_000) for name in measures.names()}
        return Experiment(
            scenario=_scenario(root),
            seeds=_seeds(root),
            measures=taken,
            over=over,
            seconds=root.number("seconds", TIME, low=0.0, high=LONGEST) if root.has("seconds") else None,
            every=root.number("every", TIME, low=0.001, high=LONGEST) if root.has("every") else None,
            until=root.text("until", ""),
            mission=root.flag("mission", True),
            commands=tuple(_commands(root)),
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
    """The experiment that a line of commands describes. over: each `KEY=VALUE,VALUE`; measures: each `NAME=MEASURE`, or
    a measure alone. Raises PlanError."""
    named = {}
    for each in measures:
        found = re.fullmatch(r"\s*([A-Za-z_]\w*)\s*=(?!=)(.+)", each, re.DOTALL)
        name, text = (found[1], found[2].strip()) if found else (name_of(each), each.strip())
        named[name] = text
    name = _absolute(scenario, Path.cwd())
    return Experiment(name, _numbers(seeds), named, _varied(over), seconds, every, until, mission)


def _varied(said: Sequence[str]) -> dict[str, Setting | Span]:
    """What options say is varied, each as `KEY=VALUE,VALUE`."""
    varied: dict[str, Setting | Span] = {}
    for each in said:
        key, equals, values = each.partition("=")
        if not equals or not key.strip() or not values.strip():
            raise PlanError(f'over "{each:.80}": wanted a key and its values, such as radio.loss=0,0.1,0.3')
        varied[key.strip()] = tuple(_value(value.strip()) for value in values.split(","))
    return varied


def _numbers(seeds: int) -> tuple[int, ...]:
    """The first so many seeds."""
    if not 1 <= seeds <= MAX_ROWS:
        raise PlanError(f"seeds {seeds}: wanted a whole number from 1 to {MAX_ROWS}")
    return tuple(range(1, seeds + 1))


def _at(setting: Setting | Span, share: float) -> Value:
    """The value so far along a range, or in a list."""
    if isinstance(setting, Span):
        return setting.at(share)
    return setting[min(int(share * len(setting)), len(setting) - 1)]


def _values(setting: Setting | Span) -> Setting:
    return (setting.at(0.0), setting.at(1.0)) if isinstance(setting, Span) else setting


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


def _scenario(root: Table) -> str:
    name = root.text("scenario", most=4_000)
    return _absolute(name, root.document.path.parent)


def _absolute(name: str, folder: Path) -> str:
    """The name of a scenario of the gallery, or the whole path of one of somebody's own."""
    path = folder / Path(name).expanduser()
    return str(path.resolve()) if path.exists() else name


def _seeds(root: Table) -> tuple[int, ...]:
    if isinstance(root.values.get("seeds", 1), list):
        return root.wholes("seeds", (), low=0, high=MAX_SEED, most=MAX_ROWS)
    return tuple(range(1, 1 + root.whole("seeds", 1, low=1, high=MAX_ROWS)))


def _over(root: Table, table: Table, *, sampled: bool, above: str = "") -> Iterator[tuple[str, Setting | Span]]:
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


def _span(table: Table, name: str) -> Span:
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
    return Span(float(low), float(high), unit, whole)


def _goal(root: Table) -> Goal:
    if root.has("maximise") == root.has("minimise"):
        raise root.error("sampling", 'a search has one goal: wanted maximise = "..." or minimise = "...", a measure')
    largest = root.has("maximise")
    measure = root.text("maximise" if largest else "minimise")
    return Goal(measure, largest, root.whole("together", 4, low=1, high=MAX_TOGETHER))


def _precision(root: Table) -> Precision:
    with root as table:
        return Precision(
            table.text("measure"), table.number("within", low=0.0), table.whole("least", 5, low=2, high=1_000)
        )


def _commands(root: Table) -> Iterator[TimedCommand]:
    for table in root.array("commands", most=MAX_COMMANDS):
        with table:
            yield TimedCommand(table.number("at", TIME, low=0.0, high=LONGEST), table.text("text", most=16_000))


def _value(text: str) -> Value:
    """A value as it would stand in TOML: a number, true or false, else a text."""
    if text in ("true", "false"):
        return text == "true"
    for sort in (int, float):
        try:
            return sort(text)
        except ValueError:
            continue
    return text


def _toml(value: Value | Setting | Span) -> str:
    if isinstance(value, Span):
        ends = (f'"{each!r}{value.unit}"' if value.unit else repr(each) for each in (value.low, value.high))
        low, high = ends
        return f"{{ low = {low}, high = {high}{', whole = true' if value.whole else ''} }}"
    return toml_value(value)
