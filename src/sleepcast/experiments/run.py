"""Runs: one run from its start to its last sample, and many at once on worker processes that stay alive.

A worker that the system ends (out of memory, a crash in a library) costs its run, which counts as failed; another
worker takes its place. Every run has one thread: cores are used by running many. The same run gives the same samples
and hash in any process, on any number of workers.

Measures in Python are imported and called here: whether they may be is decided before, see `trust`.
"""

from __future__ import annotations

import json
import logging
import os
import re
import signal
from collections import OrderedDict, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import replace
from itertools import chain, islice
from math import isnan
from multiprocessing import connection, get_context
from pathlib import Path
from threading import Thread
from time import perf_counter
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import msgspec

from sleepcast.api.assembly import Common, assemble, warm_up
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.api.session_test import missed_in
from sleepcast.core.errors import MisuseError, SleepcastError, reason_of
from sleepcast.core.extras import installing
from sleepcast.core.hosts import is_loopback
from sleepcast.core.ticks import Every, nearest_ticks
from sleepcast.experiments.measures import Measure, if_known, read_measure, read_stop
from sleepcast.experiments.plan import MAX_COMMANDS, Experiment, PlannedRun
from sleepcast.experiments.results import (
    FORMAT,
    Results,
    RunResult,
    check_rules,
    experiment_in,
    outcomes_in,
    outdated_in,
)
from sleepcast.language import CheckError
from sleepcast.simulator import Changes, Scenario, ScenarioOfSeeds
from sleepcast.simulator.scenario.groups import filled
from sleepcast.simulator.scenario.mission import BOUNDS, COUNTS, MAX_ORDERS, Order, after_end

if TYPE_CHECKING:
    from distributed import Future

CONNECTING = 10.0
"""Seconds in which a cluster answers."""
LONGEST_RUN = 3_600.0
"""Seconds that a run may take by the clock, unless something else is wanted."""
AHEAD = 3
"""Runs that a cluster is given for each of its threads, so that none waits for us."""
SHORT, SMALL = 1.0, 4_096
"""Seconds of a run, and characters of its settings, below which a worker process is given the next one before it has
ended: it would wait as long as we write the outcome, and long ones are for whoever is free first."""
MAX_POINTS = 64
"""Points of which a process knows what their runs have in common: the latest ones."""
MAX_MISSED = len(COUNTS) * len(BOUNDS) * MAX_ORDERS
"""Counts that a mission may want, and that came otherwise: each of every command, once in each way."""
LONGEST_HASH = 128
"""Characters of the hash of a state."""
NOT_OURS = "the worker of the cluster answered something that is no outcome of this run: has it another sleepcast?"
ENDED = "the system ended its worker process: perhaps there was not enough memory"


class ClusterError(MisuseError):
    """A cluster that cannot be reached."""


class ClusterLostError(SleepcastError):
    """A cluster that has gone while runs were with it."""


class Runner:
    """Does runs of an experiment, one after the other: what those of a point have in common is made once."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment = experiment
        self._points: OrderedDict[str, _Point] = OrderedDict()

    def do(self, run: PlannedRun) -> RunResult:
        """One run. What goes wrong in it is its outcome."""
        began = perf_counter()
        try:
            samples, state, unsent, missed = self._done(run)
        except (Exception, SystemExit) as error:  # a measure of somebody's own may raise anything
            return RunResult(run, error=reason_of(error), wall=perf_counter() - began, rules=FORMAT)
        return RunResult(run, samples, "", state, perf_counter() - began, unsent, FORMAT, missed)

    def opened(self, run: PlannedRun) -> SimulatedFleet:
        """The fleet at the start of a run. Raises what is wrong in the scenario or in a command."""
        key = json.dumps(run.point)
        point = self._points.pop(key, None) or _Point(self._experiment, run)
        self._points[key] = point  # it is the latest one now
        if len(self._points) > MAX_POINTS:
            self._points.popitem(last=False)
        return point.opened(run.seed)

    def _done(
        self, run: PlannedRun
    ) -> tuple[tuple[tuple[float | None, ...], ...], str, tuple[str, ...], tuple[str, ...]]:
        """The samples of a run, the hash of its state at the end, the commands that were never sent, and what came
        otherwise than its mission wanted."""
        experiment = self._experiment
        measures = [read_measure(text, own=True) for text in experiment.measures.values()]
        soon = [if_known(measure) for measure in measures]
        stop = if_known(read_stop(experiment.until, own=True).holds) if experiment.until else None
        with self.opened(run) as fleet:
            tick, last = fleet.swarm.simulator.scenario.tick, ticks_of(experiment, fleet.swarm.simulator.scenario)
            due = None if experiment.every is None else Every(experiment.every, tick)
            samples = [] if due is None else [_taken(fleet, soon)]
            ticks = 0
            while ticks < last:
                following = ticks + 1 if stop else last if due is None else min(last, due.following(ticks))
                fleet.run((following - ticks) * tick, quiet=True)
                ticks = following
                if stop is not None and stop(fleet) == 1.0:
                    break
                if due is not None and due.due(ticks) and ticks < last:
                    samples.append(_taken(fleet, soon))
            unsent = tuple(order.in_short() for order in fleet.swarm.mission)
            missed = tuple(missed_in(fleet.swarm, fleet.station))
            return (*samples, _taken(fleet, measures)), fleet.hash, unsent, missed


class _Point:
    """The runs of a point, and what they have in common. run: any of them."""

    def __init__(self, experiment: Experiment, run: PlannedRun) -> None:
        self._experiment = experiment
        self._scenarios = ScenarioOfSeeds(experiment.scenario, Changes(over=tuple(run.point.items())))
        self._common: Common | None = None
        self._orders: tuple[Order, ...] = ()
        """Of the last scenario: what its robots have in common with the next one's, and what the desk sends."""

    def opened(self, seed: int) -> SimulatedFleet:
        """See `Runner.opened`."""
        scenario = self._scenarios[seed]
        if self._common is None or not self._common.suits(scenario):
            self._common = Common(scenario)
            self._orders = orders_of(self._experiment, scenario)
        warm_up(scenario, 1, quiet=True)
        scenario = replace(scenario, mission=self._orders)
        return SimulatedFleet(*assemble(scenario, seed, mission=True, threads=1, common=self._common))


def do(experiment: Experiment, run: PlannedRun) -> RunResult:
    """See `Runner.do`."""
    return Runner(experiment).do(run)


def opened(experiment: Experiment, run: PlannedRun) -> SimulatedFleet:
    """See `Runner.opened`."""
    return Runner(experiment).opened(run)


def orders_of(experiment: Experiment, scenario: Scenario) -> tuple[Order, ...]:
    """What the desk sends in a run, in time order."""
    added = [Order(each.at, each.text, f"the experiment's command at {each.at:g} s") for each in experiment.commands]
    if scenario.constants:
        added = [replace(each, text=filled(each.text, scenario.constants, each.place)) for each in added]
    orders = (*(scenario.mission if experiment.mission else ()), *added)
    return tuple(sorted(orders, key=lambda order: order.time))


def too_late(experiment: Experiment) -> tuple[list[Order], float]:
    """The commands that come after the end of runs, so that they are never sent there, and when such a run ends, s; the
    first of these where lengths or times are varied."""
    for scenario in experiment.timings():
        last = ticks_of(experiment, scenario)
        if late := after_end(orders_of(experiment, scenario), last, scenario.tick):
            return late, last * scenario.tick
    return [], 0.0


def ticks_of(experiment: Experiment, scenario: Scenario) -> int:
    """How long a run is, unless it ends early."""
    seconds = scenario.seconds if experiment.seconds is None else experiment.seconds
    return max(1, nearest_ticks(seconds, scenario.tick))


def _taken(fleet: SimulatedFleet, measures: Sequence[Measure]) -> tuple[float | None, ...]:
    """A sample: the time, and each measure, None for unknown."""
    values = [measure(fleet) for measure in measures]
    return round(fleet.time, 9), *(None if isnan(value) else value for value in values)


def run_all(
    results: Results,
    workers: int | str,
    *,
    retry: bool = False,
    limit: float = LONGEST_RUN,
    remark: Callable[[str], object] = str,
) -> Generator[RunResult, None, None]:
    """Do all runs that are missing, and write each one as it finishes; gives them in that order. Raises
    ResultsLostError, ClusterError where there is no cluster, and ClusterLostError where it has gone.

    workers: so many processes here, or the address of a dask cluster.
    retry: also those that failed.
    limit: s after which a run is ended by force, and has failed; a cluster has none.
    remark: takes what somebody should know who waits.
    """
    experiment, left = results.experiment, results.missing(retry=retry)
    if not left:
        return
    check_rules(results.folder, results.outdated)
    at_once = len(left) if experiment.goal is None else experiment.goal.together * len(experiment.seeds)
    with _pool(experiment, workers, at_once, limit) as pool:
        if isinstance(pool, Cluster) and not pool.threads:
            remark(f"the cluster at {workers} has no workers: the sweep goes on once there are some")
        while left:
            for finished in pool.map(left):
                results.keep(finished)
                yield from finished
            left = results.missing()


def verify(folder: Path, workers: int | str, most: int | None = None) -> Generator[tuple[RunResult, bool], None, None]:
    """Do finished runs again, the first `most` of them; gives each, and whether it came out the same."""
    experiment = experiment_in(folder)
    check_rules(folder, outdated_in(folder))
    before = {each.run.number: each for each in list(outcomes_in(folder))[:most]}
    with _pool(experiment, workers, len(before)) as pool:
        for finished in pool.map([each.run for each in before.values()]):
            for again in finished:
                yield again, again.same_as(before[again.run.number])


def _pool(experiment: Experiment, workers: int | str, runs: int, limit: float = LONGEST_RUN) -> Workers | Cluster:
    return Cluster(experiment, workers) if isinstance(workers, str) else Workers(experiment, min(workers, runs), limit)


class Workers:
    """Worker processes; leaving ends them, whatever they do.

    limit: s that a run may take.
    """

    def __init__(self, experiment: Experiment, count: int, limit: float = LONGEST_RUN) -> None:
        self._experiment, self._limit = experiment, limit
        self._workers = [_Worker(experiment) for _ in range(count)]

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *ended: object) -> None:
        for worker in self._workers:
            worker.end()

    def map(self, runs: Iterable[PlannedRun]) -> Iterator[list[RunResult]]:
        """Do these runs; gives those that have finished, in the order in which they do."""
        left: Iterator[PlannedRun] = iter(runs)
        busy: dict[connection.Connection, _Worker] = {}

        def feed(worker: _Worker, wanted: int) -> None:
            """Let it have so many runs, as far as there are any."""
            for run in islice(left, wanted - len(worker.runs)):
                worker.begin(run)
            if worker.runs:
                busy[worker.pipe] = worker

        for worker in self._workers:
            feed(worker, 1)
        while busy:
            finished = []
            patience = max(0.0, self._limit - max(worker.taken for worker in busy.values()))
            ready = connection.wait(list(busy), patience)
            ended = [pipe for pipe in busy if pipe in ready]
            late = [] if ended else [pipe for pipe, worker in busy.items() if worker.taken >= self._limit]
            for pipe in (*ended, *late):
                worker = busy.pop(pipe)
                outcome = worker.give_up(self._limit) if late else worker.outcome()
                finished.append(outcome)
                ahead = outcome.wall < SHORT and len(outcome.run.key) < SMALL and not worker.ended
                if worker.ended:  # what it has not begun yet is for others
                    left = chain(worker.runs, left)
                    self._workers[self._workers.index(worker)] = worker = _Worker(self._experiment)
                feed(worker, 2 if ahead else 1)
            yield finished


class _Worker:
    """One process. runs: the one that it does, and perhaps the next one. ended: whether it is gone."""

    def __init__(self, experiment: Experiment) -> None:
        context = get_context("spawn")  # a fork would copy threads in the middle of something
        self.pipe, theirs = context.Pipe()
        self.ended = False
        self.runs: deque[PlannedRun] = deque()
        self._began = 0.0
        self._process = context.Process(target=_serve, args=(theirs, experiment), daemon=True)
        self._process.start()
        theirs.close()

    def begin(self, run: PlannedRun) -> None:
        """Let it do a run, after the one that it does."""
        if not self.runs:
            self._began = perf_counter()
        self.runs.append(run)
        with suppress(OSError):  # if it is gone, its outcome says so
            self.pipe.send(run)

    @property
    def taken(self) -> float:
        """s that its run has taken until now."""
        return perf_counter() - self._began

    def give_up(self, limit: float) -> RunResult:
        """End the process, whose run takes too long."""
        self.end()
        return RunResult(self.runs.popleft(), error=f"it took longer than {limit:g} s: is a measure hanging?")

    def outcome(self) -> RunResult:
        """Wait for the outcome of its run."""
        try:
            outcome: RunResult = self.pipe.recv()
        except (EOFError, OSError):
            self.end()
            outcome = RunResult(self.runs[0], error=ENDED)
        self.runs.popleft()
        self._began = perf_counter()
        return outcome

    def end(self) -> None:
        """End the process at once."""
        self.ended = True
        self._process.kill()
        self._process.join()
        self.pipe.close()


def checked_cluster(address: str, *, insecure: bool) -> str:
    """The address of a scheduler, if it may be asked. Raises ClusterError. Programs travel between a scheduler, its
    workers and us, both ways: whoever is taken for one of them runs what he likes on all of these machines.

    insecure: whether the network in between is trusted.
    """
    parts = urlsplit(address if "://" in address else f"tcp://{address}")
    try:
        complete = parts.scheme in ("tcp", "tls") and parts.hostname and parts.port
    except ValueError:
        complete = None
    if not complete:
        raise ClusterError(f"{address!r:.200} is no address of a dask scheduler: wanted tcp:// or tls://host:8786")
    if parts.scheme == "tcp" and not is_loopback(parts.hostname or "") and not insecure:
        raise ClusterError(
            f"{address}: whoever answers there, or is in between, can run programs on this computer, and nothing shows "
            "who it is. Use tls://, with the certificates that dask's settings name, or add --insecure on a network of "
            "your own"
        )
    return address


class Cluster:
    """The workers of a dask cluster, on any number of machines; leaving forgets what they still do. They need the same
    sleepcast, and modules with measures of your own. Raises ClusterError."""

    def __init__(self, experiment: Experiment, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise ClusterError(f"a cluster needs dask; to install it: {installing('cluster')}") from error
        self._experiment, self._address = experiment, address
        try:
            self._client = Client(address, timeout=CONNECTING)
        except Exception as error:  # what answers there may say anything
            raise ClusterError(f"no dask scheduler answers at {address}: {error}") from error

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *ended: object) -> None:
        log = logging.getLogger("distributed.client")  # a traceback for whoever leaves while it looks for the scheduler
        before, log.disabled = log.disabled, True
        try:
            self._client.close()
        finally:
            log.disabled = before

    def map(self, runs: Iterable[PlannedRun]) -> Iterator[list[RunResult]]:
        """See `Workers.map`. Workers may come and go meanwhile. Raises ClusterLostError."""
        from distributed import as_completed

        left, asked, finished = iter(runs), dict[Any, PlannedRun](), as_completed()
        try:
            while True:
                for run in islice(left, max(0, self._places() - len(asked))):
                    asked[future := self._submit(run)] = run
                    finished.add(future)
                if (future := next(finished, None)) is None:
                    return
                yield [self._outcome(future, asked.pop(future))]
        except (CancelledError, OSError) as error:
            raise ClusterLostError(
                f"the dask scheduler at {self._address} has gone; what is done is kept: go on when it is back"
            ) from error

    @property
    def threads(self) -> int:
        """Of all workers that it has now."""
        return sum(self._client.nthreads().values())

    def _places(self) -> int:
        """How many runs the cluster is to have now."""
        return AHEAD * max(1, self.threads)

    def _outcome(self, future: Future[bytes], run: PlannedRun) -> RunResult:
        """Raises CancelledError for one that the scheduler has taken with it, which has no exception of its own."""
        if not future.cancelled() and (error := future.exception()) is not None:
            return RunResult(run, error=f"{ENDED} ({type(error).__name__})")
        return outcome_in(future.result(), self._experiment, run)

    def _submit(self, run: PlannedRun) -> Future[bytes]:
        future: Future[bytes] = self._client.submit(do_elsewhere, self._experiment, run, pure=False)
        return future


def outcome_in(answer: object, experiment: Experiment, run: PlannedRun) -> RunResult:
    """What a worker has answered, which may be anything: a failed run if it is no outcome of this one."""
    try:
        outcome = msgspec.json.decode(answer if isinstance(answer, bytes) else b"", type=RunResult)
    except (msgspec.DecodeError, RecursionError):
        return RunResult(run, error=NOT_OURS)
    wide = all(len(sample) == 1 + len(experiment.measures) for sample in outcome.samples)
    fits = (
        outcome.run == run
        and wide
        and len(outcome.hash) <= LONGEST_HASH
        and bool(outcome.samples) != bool(outcome.error)
    )
    fits = fits and outcome.rules == FORMAT and len(outcome.unsent) <= MAX_ORDERS + MAX_COMMANDS
    fits = fits and len(outcome.missed) <= MAX_MISSED
    return outcome if fits else RunResult(run, error=NOT_OURS)


def do_elsewhere(experiment: Experiment, run: PlannedRun) -> bytes:
    """The outcome of a run as plain data."""
    return msgspec.json.encode(do(experiment, run))


def _serve(pipe: connection.Connection, experiment: Experiment) -> None:
    """What a worker process does until its owner is gone. Ctrl-C is its owner's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    runner = Runner(experiment)
    with suppress(EOFError, OSError):
        while True:
            pipe.send(runner.do(pipe.recv()))


def cores() -> int:
    """How many workers are useful here."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def try_out(experiment: Experiment, limit: float = LONGEST_RUN) -> None:
    """As `_try_out`, within so many seconds. Raises MisuseError."""
    errors: list[BaseException] = []

    def attempt() -> None:
        try:
            _try_out(experiment)
        except BaseException as error:  # it belongs to who waits
            errors.append(error)

    trial = Thread(target=attempt, name="trial", daemon=True)
    trial.start()
    trial.join(limit)
    if trial.is_alive():
        raise MisuseError(f"the trial of the measures took longer than {limit:g} s: is one hanging?")
    if errors:
        raise errors[0]


def _try_out(experiment: Experiment) -> None:
    """Check the experiment, open the first run, and take each measure once, so that a mistake is met before a thousand
    runs fail. What robots learn only on the way may still be unknown. Raises MisuseError, also for whatever a measure
    raises."""
    run = experiment.checked().first()
    with opened(experiment, run) as fleet:
        for name, text in experiment.measures.items():
            measure = read_measure(text, own=True)
            try:
                measure(fleet)
            except CheckError as error:
                if not _learned_later(error, [order.text for order in fleet.swarm.mission]):
                    raise MisuseError(f'measure "{name}": {error}') from error
            except SleepcastError as error:
                raise MisuseError(f'measure "{name}": {error}') from error
            except (Exception, SystemExit) as error:  # a function of somebody's own may raise anything
                raise MisuseError(f'measure "{name}" ({text}) fails: {type(error).__name__}: {error}') from error
        if experiment.until:
            if_known(read_stop(experiment.until, own=True).holds)(fleet)


def _learned_later(error: CheckError, commands: Sequence[str]) -> bool:
    """Whether all that is wrong is names that commands will declare."""
    wrong = [finding for finding in error.findings if finding.unknown or finding.severity == "error"]
    unknown = {finding.unknown.casefold() for finding in wrong}
    words = set(re.split(r"[\s()]+", " ".join(commands).casefold()))
    return bool(unknown) and unknown <= words
