"""The results of an experiment: a folder that holds them and what they came from.

    experiment.toml    what was wanted; the same experiment goes on here, another one is refused
    about.json         version, machine, libraries, and the state of the git repository around it, when it began
    runs.sqlite        each finished run, written once and in one piece

The table has a row for each sample, and columns for each varied key, `run`, `seed`, `time` (simulated s), each measure,
`error` and `hash` (the state of the whole run at its end). A failed run is one row without measures.
"""

from __future__ import annotations

import csv
import json
import os
import platform
import sqlite3
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from itertools import chain, islice
from pathlib import Path
from types import TracebackType

import msgspec
import numpy as np

from sleepcast.api.table import DataTable, Numbers, Texts
from sleepcast.core.angles import mean_direction
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.extras import installing
from sleepcast.core.files import lock_file, replace_file
from sleepcast.core.settings import SettingsError
from sleepcast.core.ticks import SLACK
from sleepcast.core.version import VERSION
from sleepcast.experiments.angles import angles_of
from sleepcast.experiments.drawing import band
from sleepcast.experiments.git_state import git_state
from sleepcast.experiments.measures import begin_of
from sleepcast.experiments.plan import MAX_ROWS, PLAN, Experiment, Objective, PlannedRun, Value, read_experiment
from sleepcast.experiments.search import Tried, suggest

ABOUT, RUNS, LOCK = "about.json", "runs.sqlite", ".lock"
SCHEMA = """
CREATE TABLE IF NOT EXISTS runs (
    key TEXT PRIMARY KEY, number INTEGER NOT NULL, run TEXT NOT NULL, error TEXT NOT NULL, hash TEXT NOT NULL,
    wall REAL NOT NULL, samples TEXT NOT NULL, unsent TEXT NOT NULL DEFAULT '[]',
    missed TEXT NOT NULL DEFAULT '[]'
) STRICT
"""
ADDED = ("unsent", "missed")
"""Columns that files of earlier versions do not have, each a list of texts."""
FORMAT = 2
"""Version of the file of runs and of the rules by which they were done, which is its `user_version`; those of a newer
one are refused. In 1, `until` was looked at only when a sample was due, and samples fell on every so many whole
ticks."""
MAX_CELL = 64 * 1024**2
"""Bytes of one row: a million samples of a measure have a third of it."""
MAX_VALUES = 8_000_000
"""Numbers in one row: short ones take forty times their text in memory."""
MAX_ERROR = 4_000
"""Characters of an error that are stored."""


class ResultsError(MisuseError):
    """A folder that does not hold the results that were wanted."""


class ResultsLostError(SleepcastError):
    """Results that could not be written."""


class RunResult(msgspec.Struct, frozen=True):
    """What came of a run.

    samples: for each its time (simulated s), then the measures in their order; None for unknown.
    error: why it failed; "" if it did not.
    hash: of the state at its end.
    wall: s that it took.
    unsent: commands that were never sent, since it ended before, each with its time, in short.
    rules: by which it was done, see FORMAT.
    missed: sentences about counts that its mission wanted, and that came otherwise.
    """

    run: PlannedRun
    samples: tuple[tuple[float | None, ...], ...] = ()
    error: str = ""
    hash: str = ""
    wall: float = 0.0
    unsent: tuple[str, ...] = ()
    rules: int = 1
    missed: tuple[str, ...] = ()

    def same_as(self, other: RunResult) -> bool:
        """Whether both found the same, to the last bit."""
        return (self.samples, self.error, self.hash) == (other.samples, other.error, other.hash)


class Results:
    """The folder of an experiment, open for writing by one process. Raises ResultsError, and ResultsLostError where
    nothing can be written.

    outdated: by which older rule its runs were done, in words; "" if they fit those of now.
    """

    def __init__(self, folder: Path, experiment: Experiment) -> None:
        self.folder, self.experiment = folder, experiment
        try:
            _begin(folder, experiment)
            self._lock = lock_file(folder / LOCK)
            self._connection = sqlite3.connect(folder / RUNS, isolation_level=None)
            self._connection.execute("PRAGMA journal_mode = WAL")  # others may read meanwhile
            version = _check_format(folder, self._connection) or FORMAT
            self.outdated = _outdated(experiment) if version < FORMAT else ""
            self._connection.execute(SCHEMA)
            if not self.outdated:
                self._update()
        except BlockingIOError:
            raise ResultsError(
                f"{folder}: another sweep is writing here: wait for its end, or choose another folder"
            ) from None
        except (OSError, sqlite3.Error) as error:
            raise _lost(folder, error) from error

    def __enter__(self) -> Results:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        with suppress(sqlite3.Error):
            self._connection.execute("PRAGMA journal_mode = DELETE")  # so that one file holds all
        self._connection.close()
        if self._lock is not None:
            os.close(self._lock)

    def _update(self) -> None:
        """Make the file one of the format of now."""
        present = _columns(self._connection)
        for added in ADDED:
            if added not in present:
                self._connection.execute(f"ALTER TABLE runs ADD COLUMN {added} TEXT NOT NULL DEFAULT '[]'")
        self._connection.execute(f"PRAGMA user_version = {FORMAT}")

    def count(self) -> int:
        """How many runs have finished."""
        count: int = self._connection.execute("SELECT count(*) FROM runs").fetchone()[0]
        return count

    def left(self, *, retry: bool = False) -> int:
        """How many runs are to be done yet, at most."""
        condition = "WHERE error = ''" if retry else ""
        done: int = self._connection.execute(f"SELECT count(*) FROM runs {condition}").fetchone()[0]
        return len(self.experiment) - done

    def missing(self, *, retry: bool = False) -> list[PlannedRun]:
        """The runs that are to be done next; there may be more after these, if the experiment wants a precision.

        retry: also those that failed.
        """
        if self.experiment.goal is not None:
            return self._suggested(self.experiment.goal, retry=retry)
        try:
            rows = self._connection.execute("SELECT key, error, samples FROM runs")
            done = {key: _samples(text, self.experiment) for key, error, text in rows if not (retry and error)}
        except (sqlite3.Error, ValueError, RecursionError) as error:
            raise ResultsError(f"{self.folder / RUNS}: the results cannot be read: {error}") from error
        precise = self._precise_points(done)
        for runs in self.experiment.rounds():
            left = [run for run in runs if run.key not in done and _point(run) not in precise]
            if left:
                return left
        return []

    def _suggested(self, goal: Objective, *, retry: bool) -> list[PlannedRun]:
        """The next runs of a search: of the first points that are not all done. Points of which a run is done already
        stay as they are."""
        done = list(outcomes_in(self.folder))
        if retry and (failed := [each.run for each in done if each.error]):
            return failed
        seeds = self.experiment.seeds
        points = points_of(self.experiment, done)
        for start in range(0, self.experiment.points, goal.together):
            some = range(start, min(start + goal.together, self.experiment.points))
            left = [number for number in some if len(points.get(number, ())) < len(seeds)]
            if not left:
                continue
            tried = [
                Tried(points[number][0].run.point, value_of(self.experiment, points[number])) for number in range(start)
            ]
            suggested = dict(zip(some, suggest(self.experiment, tried, len(some)), strict=True))
            runs = []
            for number in left:
                known = {each.run.seed: each.run for each in points.get(number, ())}
                point = next(iter(known.values())).point if known else suggested[number]
                missing = [index for index, seed in enumerate(seeds) if seed not in known]
                runs += [PlannedRun(number * len(seeds) + index, point, seeds[index]) for index in missing]
            return runs
        return []

    def _precise_points(self, done: Mapping[str, Sequence[Sequence[float | None]]]) -> set[str]:
        """The points at which there are enough runs. done: samples by the key of the run."""
        wanted = self.experiment.precision
        if wanted is None:
            return set()
        index = 1 + list(self.experiment.measures).index(wanted.measure)
        angle = wanted.measure in angles_of(self.experiment)
        values: dict[str, list[float]] = {}
        for run in self.experiment.runs():
            value = done[run.key][-1][index] if done.get(run.key) else None
            if value is not None:
                values.setdefault(_point(run), []).append(value)
        enough = {point: known for point, known in values.items() if len(known) >= wanted.least}
        return {point for point, known in enough.items() if _spread(known, angle) <= wanted.within}

    def _key(self, run: PlannedRun) -> str:
        """What names a row: the run; in a search, which may come to a point twice, with its number."""
        return run.key if self.experiment.goal is None else f"{run.number} {run.key}"

    def keep(self, outcomes: Iterable[RunResult]) -> None:
        """Write finished runs, all or none of them. Raises ResultsLostError."""
        rows = [
            (
                self._key(each.run),
                each.run.number,
                msgspec.json.encode(each.run).decode(),
                each.error[:MAX_ERROR],
                each.hash,
                each.wall,
                *map(json.dumps, (each.samples, each.unsent, each.missed)),
            )
            for each in outcomes
        ]
        try:
            self._connection.execute("BEGIN")
            self._connection.executemany("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", rows)
            self._connection.execute("COMMIT")
        except sqlite3.Error as error:
            raise _lost(self.folder, error) from error


def points_of(experiment: Experiment, done: Iterable[RunResult]) -> dict[int, list[RunResult]]:
    """The finished runs of each point of a search, by the number of the point."""
    points: dict[int, list[RunResult]] = {}
    for each in done:
        points.setdefault(each.run.number // len(experiment.seeds), []).append(each)
    return points


def value_of(experiment: Experiment, runs: Iterable[RunResult]) -> float | None:
    """The mean at the end of some runs of the measure that is searched for; None if it is known of none."""
    assert experiment.goal is not None
    index = 1 + list(experiment.measures).index(experiment.goal.measure)
    known = [value for each in runs if each.samples and (value := each.samples[-1][index]) is not None]
    if known and experiment.goal.measure in angles_of(experiment):
        mean = mean_direction(np.array(known))
        return None if mean != mean else mean
    return sum(known) / len(known) if known else None


class Best(msgspec.Struct, frozen=True):
    """The best point of a search.

    value: the mean of the measure there.
    runs: over how many.
    """

    measure: str
    value: float
    point: dict[str, Value]
    runs: int

    def sentence(self) -> str:
        """For a person."""
        settings = ", ".join(f"{key} = {value}" for key, value in self.point.items())
        return f"best {self.measure}: {self.value:.4g} at {settings}"


def best_of(folder: Path) -> Best | None:
    """What a search has found; None if it has found nothing, or the experiment is no search. Raises ResultsError."""
    experiment = experiment_in(folder)
    if experiment.goal is None:
        return None
    points = []
    for runs in points_of(experiment, outcomes_in(folder)).values():
        value = value_of(experiment, runs)
        if value is not None:
            points.append(Best(experiment.goal.measure, value, runs[0].run.point, len(runs)))
    best = max if experiment.goal.largest else min
    return best(points, key=lambda each: each.value) if points else None


class Summary(msgspec.Struct, frozen=True):
    """How far an experiment has come.

    runs: how many are wanted, at most.
    done: how many have finished.
    failed: how many of these failed.
    unknown: values that no robot could give, see `unknown_in`.
    unsent: in how many runs each command was never sent, since they ended before.
    missed: in how many each count that the mission wanted came otherwise.
    """

    runs: int
    done: int
    failed: int
    unknown: int
    unsent: dict[str, int] = {}
    missed: dict[str, int] = {}

    def sentence(self) -> str:
        """For a person."""
        sentence = f"{self.done:,} of {self.runs:,} runs done"
        sentence += f", {self.failed:,} of them failed" if self.failed else ""
        values = "value" if self.unknown == 1 else "values"
        return sentence + (f"; {self.unknown:,} {values} unknown" if self.unknown else "")


def experiment_in(folder: Path) -> Experiment:
    """What was wanted in a folder of results. Raises ResultsError."""
    if not (folder / PLAN).is_file() or not (folder / RUNS).is_file():
        raise ResultsError(f"{folder}: no results of an experiment: wanted a folder with {PLAN} and {RUNS}")
    try:
        return read_experiment(folder / PLAN)
    except SettingsError as error:
        raise ResultsError(f"the experiment of these results cannot be read: {error}") from error


def outcomes_in(folder: Path) -> Iterator[RunResult]:
    """Every finished run, by number. Raises ResultsError."""
    experiment = experiment_in(folder)
    with _reading(folder) as connection:
        rules = _check_format(folder, connection)
        present = _columns(connection)
        added = ", ".join(each if each in present else "'[]'" for each in ADDED)
        rows = connection.execute(f"SELECT run, error, hash, wall, samples, {added} FROM runs ORDER BY number")
        for row in islice(rows, MAX_ROWS):
            yield _outcome(row, experiment, rules)


@contextmanager
def _reading(folder: Path) -> Iterator[sqlite3.Connection]:
    """The file of runs, to be read. Raises ResultsError, also for what is wrong in it."""
    try:
        connection = sqlite3.connect(f"{(folder / RUNS).resolve().as_uri()}?mode=ro", uri=True, timeout=1.0)
        with closing(connection):
            yield connection
    except (sqlite3.Error, ValueError, RecursionError) as error:
        raise ResultsError(f"{folder / RUNS}: the results cannot be read: {error}") from error


def _columns(connection: sqlite3.Connection) -> set[str]:
    """The columns of a file of runs."""
    return {row[1] for row in connection.execute("PRAGMA table_info(runs)")}


def _outcome(row: tuple[str, str, str, float, str, str, str], experiment: Experiment, rules: int) -> RunResult:
    """What a row says. Raises ValueError for what no run of this experiment has."""
    run, error, state, wall, samples, *added = row
    decoded = msgspec.json.decode(run, type=PlannedRun)
    taken = _samples(samples, experiment)
    if decoded.point.keys() != experiment.over.keys():
        raise ValueError(f"run {decoded.number} has other measures or settings than its {PLAN}")
    unsent, missed = (msgspec.json.decode(each, type=tuple[str, ...]) for each in added)
    return RunResult(decoded, taken, error, state, wall, unsent, rules, missed)


def _samples(text: str, experiment: Experiment) -> tuple[tuple[float | None, ...], ...]:
    """What was measured. Raises ValueError and RecursionError for what was not."""
    if text.count(",") >= MAX_VALUES:
        raise ValueError(f"a run has more than {MAX_VALUES} numbers")
    taken = msgspec.convert(json.loads(text), tuple[tuple[float | None, ...], ...])
    if not all(len(each) == 1 + len(experiment.measures) for each in taken):
        raise ValueError(f"a run has other measures than its {PLAN}")
    return taken


def check_rules(folder: Path, outdated: str) -> None:
    """Raise ResultsError where runs of now would not fit those in the folder.

    outdated: see `Results`.
    """
    if outdated:
        raise ResultsError(
            f"{folder}: its runs were done by sleepcast 0.2.0 or earlier, {outdated}: runs of this version would not "
            f"fit them. Begin anew in another folder (sleepcast sweep {folder / PLAN} --out ANOTHER), or finish it "
            "with the version that began it"
        )


def outdated_in(folder: Path) -> str:
    """By which older rule its runs were done, see `Results`. Raises ResultsError."""
    experiment = experiment_in(folder)
    with _reading(folder) as connection:
        return _outdated(experiment) if _check_format(folder, connection) < FORMAT else ""


def _outdated(experiment: Experiment) -> str:
    """What an older version did otherwise in such an experiment; "" for nothing."""
    if experiment.until:
        return "which looked at `until` only when a sample was due"
    uneven = experiment.every is not None and any(
        abs((ratio := experiment.every / scenario.tick) - round(ratio)) > SLACK for scenario in experiment.timings()
    )
    return "which took samples only every so many whole ticks" if uneven else ""


def _check_format(folder: Path, connection: sqlite3.Connection) -> int:
    """The version of a file of runs, 0 for a new one. Raise ResultsError for results that this program does not know,
    or that compute instead of being there: a view of a few bytes may have rows without end, and a trigger may do
    anything to what is written."""
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_CELL)
    connection.execute("PRAGMA trusted_schema = OFF")
    others = connection.execute("SELECT name FROM sqlite_schema WHERE type IN ('view', 'trigger')").fetchall()
    if others:
        raise ResultsError(f"{folder}: its {RUNS} has {others[0][0]!r:.80}, which no results have: not read")
    version: int = connection.execute("PRAGMA user_version").fetchone()[0]
    if version > FORMAT:
        raise ResultsError(
            f"{folder}: these results have format {version}, and this sleepcast knows formats up to {FORMAT}: "
            "use a newer sleepcast"
        )
    return version


def summary_of(folder: Path) -> Summary:
    """How far it has come. Raises ResultsError."""
    experiment, done = experiment_in(folder), list(outcomes_in(folder))
    unknown = sum(unknown_in(experiment, each) for each in done)
    unsent = Counter(command for each in done for command in dict.fromkeys(each.unsent))
    # of a sentence that also says how it came in one run, only what was wanted
    wanted = ({sentence.rpartition(", but it was ")[0]: None for sentence in each.missed} for each in done)
    missed = Counter(chain.from_iterable(wanted))
    failed = sum(bool(each.error) for each in done)
    return Summary(len(experiment), len(done), failed, unknown, dict(unsent), dict(missed))


def unknown_in(experiment: Experiment, outcome: RunResult) -> int:
    """How many values no robot could give in a run. A mean over the samples from a time on has none before: that counts
    only if the run ends without one."""
    if not outcome.samples:
        return 0
    samples = np.array(outcome.samples, np.float64)
    due = samples[:, :1] >= np.array([begin_of(text) for text in experiment.measures.values()]) - 1e-9
    due[-1] = True
    return int(np.count_nonzero(due & np.isnan(samples[:, 1:])))


def table_of(folder: Path) -> DataTable:
    """All results, see the module. Raises ResultsError."""
    experiment = experiment_in(folder)
    rows: list[tuple[RunResult, tuple[float | None, ...]]] = []
    nothing = (None,) * (1 + len(experiment.measures))
    for outcome in outcomes_in(folder):
        rows += [(outcome, sample) for sample in outcome.samples or (nothing,)]
    columns: dict[str, Texts | Numbers] = {
        key: _column([outcome.run.point[key] for outcome, _ in rows]) for key in experiment.over
    }
    columns["run"] = np.array([outcome.run.number for outcome, _ in rows], np.int64)
    columns["seed"] = np.array([outcome.run.seed for outcome, _ in rows], np.int64)
    for index, name in enumerate(("time", *experiment.measures)):
        columns[name] = np.array([np.nan if sample[index] is None else sample[index] for _, sample in rows], np.float64)
    columns["error"] = [outcome.error for outcome, _ in rows]
    columns["hash"] = [outcome.hash for outcome, _ in rows]
    return DataTable(columns)


def export(folder: Path, file: Path) -> None:
    """Write the table into a Parquet or CSV file. Raises ResultsError, and ResultsLostError where it cannot be
    written."""
    if file.suffix not in (".parquet", ".csv"):
        raise ResultsError(f"{file}: wanted a file that ends in .parquet or .csv")
    table, half = table_of(folder), file.with_name(f".{file.name}.half")
    try:
        _write(table, half, file.suffix)
        os.replace(half, file)
    except OSError as error:
        half.unlink(missing_ok=True)
        raise _lost(file, error) from error


def _write(table: DataTable, file: Path, suffix: str) -> None:
    if suffix == ".csv":
        with file.open("w", newline="", encoding="utf-8") as opened:
            writer = csv.writer(opened, lineterminator="\n")
            writer.writerow(table.columns)
            columns = table.to_dict().values()
            writer.writerows([["" if each is None else each for each in row] for row in zip(*columns, strict=True)])
        return
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ResultsError(
            f"a Parquet file needs pyarrow: write a .csv file, or install it: {installing('experiments')}"
        ) from error
    pyarrow.parquet.write_table(pyarrow.table(table), file)


def _point(run: PlannedRun) -> str:
    return json.dumps(run.point, sort_keys=True)


def _spread(values: Sequence[float], angle: bool) -> float:
    """Half of the confidence interval of their mean. angle: whether they are angles."""
    _, low, high = band(np.array(values), angle)
    return (high - low) / 2


def _column(values: list[Value]) -> Texts | Numbers:
    whole = np.iinfo(np.int64)
    if all(isinstance(each, int) and whole.min <= each <= whole.max for each in values):
        return np.array([int(each) for each in values], np.int64)
    if any(isinstance(each, str) for each in values):
        return [str(each) for each in values]
    return np.array(values, np.float64)


def _begin(folder: Path, experiment: Experiment) -> None:
    """Make the folder, unless it is of this experiment already."""
    wanted = experiment.to_toml()
    if (folder / PLAN).exists():
        if (folder / PLAN).read_text(encoding="utf-8") != wanted:
            if experiment_in(folder).repeated:
                raise ResultsError(
                    f"{folder}: its {PLAN} names equal points or seeds twice, which an earlier version numbered twice: "
                    "choose another folder"
                )
            raise ResultsError(
                f"{folder}: holds the results of another experiment (its {PLAN} differs): choose another folder, or go "
                f"on with that one: sleepcast sweep {folder}"
            )
        return
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ResultsError(f"{folder}: exists already, and holds no results: choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / ABOUT).write_text(json.dumps(_about(), indent=2) + "\n", encoding="utf-8")
    replace_file(folder / PLAN, wanted.encode())


def _about() -> dict[str, object]:
    return {
        "sleepcast": VERSION,
        "rules": FORMAT,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": platform.platform(),
        "cores": os.cpu_count(),
        "began": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "git": git_state(Path.cwd()),
    }


def _lost(place: Path, error: OSError | sqlite3.Error) -> ResultsLostError:
    if isinstance(error, sqlite3.DatabaseError) and not isinstance(error, sqlite3.OperationalError):
        return ResultsLostError(f"{place}: its {RUNS} is damaged: {error}")
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return ResultsLostError(f"{place}: cannot be written: {reason}; what was written before is intact")
