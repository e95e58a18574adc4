"""The rows of the table: what each measures, beside whom, and what is wanted of it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from statistics import mean

from benchmarks.report import Json, middle, number
from benchmarks.worlds.sides import Argos, Libraries, MissingError, Version

MINUTE = 60.0
"""Simulated seconds of a run, unless something else is said."""
TURNS = 3
"""How often small rows are measured, each side in turn."""
FEWER = 20
"""Runs of a rival, from which the time of all is scaled."""
SAME = 0.95
"""What is not slower has at least so much of the speed: repeated runs of one program differ by as much."""
FLOCK, FLOCK_SECONDS = 100, 500
"""Robots of a flock, and its steps, which take a simulated second each."""
NOW, BEFORE = "now", "before"


@dataclass(frozen=True)
class Side:
    """What came out for somebody who takes part. values: of each turn, or of each run of a rival, in `unit`."""

    name: str
    values: Sequence[float]
    unit: str

    @property
    def text(self) -> str:
        low, high = number(min(self.values)), number(max(self.values))
        spread = "" if low == high else f" ({low} to {high})"
        return f"{number(middle(self.values))} {self.unit}{spread}"


@dataclass(frozen=True)
class Finding:
    """A row's value, None if it is not measured, which `note` explains; and the sides that were."""

    value: float | None
    sides: Sequence[Side] = ()
    note: str = ""


@dataclass
class Bench:
    """Who takes part, and how much is done. before: a text where it is missing, which says why."""

    now: Version
    before: Version | str
    argos: Argos
    libraries: Libraries
    cores: int
    quick: bool
    _taken: dict[object, float] = field(default_factory=dict)

    def version(self, which: str) -> Version:
        """Raises MissingError where the release before is missing."""
        found = self.now if which == NOW else self.before
        if isinstance(found, str):
            raise MissingError(found)
        return found

    def runs(self, full: int, quick: int) -> int:
        return quick if self.quick else full

    @property
    def turns(self) -> int:
        return self.runs(TURNS, 1)

    def once(self, key: object, work: Callable[[], float]) -> float:
        """What takes long is measured once, also for two rows."""
        if key not in self._taken:
            self._taken[key] = work()
        return self._taken[key]


def in_turns(turns: int, *sides: Callable[[], float]) -> list[list[float]]:
    """What each side takes in so many turns, after one that compiles and reads files, which does not count."""
    for side in sides:
        side()
    found: list[list[float]] = [[] for _ in sides]
    for _ in range(turns):
        for values, side in zip(found, sides, strict=True):
            values.append(side())
    return found


def ratio(over: Sequence[float], under: Sequence[float]) -> float:
    """The median of the ratios of each turn."""
    return middle([a / b for a, b in zip(over, under, strict=True)])


# ---- sweeps


def _sweep(bench: Bench, which: str, robots: int, runs: int) -> float:
    version = bench.version(which)
    over = [f"robots.count={robots}"]

    def work() -> float:
        version.process("run", "crowd", "--robots", f"{robots}", "--seconds", "10", "--threads", "1", "--quiet")
        return version.sweep("crowd", runs, MINUTE, "mean battery", over, bench.cores)

    return bench.once(("sweep", which, robots), work)


def sweep(robots: int, runs: int, quick: int, bench: Bench) -> Finding:
    """A sweep beside that of the release before."""
    runs = bench.runs(runs, quick)
    before, now = (_sweep(bench, which, robots, runs) for which in (BEFORE, NOW))
    return Finding(before / now, [Side("0.2.0", [before], "s"), Side(NOW, [now], "s")])


def sweep_beside_argos(robots: int, runs: int, quick: int, bench: Bench) -> Finding:
    """The same sweep beside ARGoS, a process a run, as many at a time as there are cores."""
    runs, few = bench.runs(runs, quick), bench.runs(FEWER, bench.cores)
    bench.argos.process(robots)
    whole, each = bench.argos.many(robots, few, bench.cores)
    now, scaled = _sweep(bench, NOW, robots, runs), whole / few * runs
    alone = Side("ARGoS, a run", each, "s")
    return Finding(scaled / now, [Side(NOW, [now], "s"), Side("ARGoS, scaled", [scaled], "s"), alone])


# ---- one run


def process(robots: int, bench: Bench) -> list[Side]:
    """Whole processes of this version, the release before and ARGoS, in turns; who is missing is left out."""
    words = ("run", "crowd", "--robots", f"{robots}", "--seconds", f"{MINUTE:g}", "--quiet", "--json")
    sides: dict[str, Callable[[], float]] = {NOW: partial(bench.now.process, *words)}
    if isinstance(bench.before, Version):
        sides["0.2.0"] = partial(bench.before.process, *words)
    try:
        bench.argos.experiment(robots)
        sides["ARGoS"] = partial(bench.argos.process, robots)
    except MissingError:
        pass
    return [Side(name, values, "s") for name, values in zip(sides, in_turns(bench.turns, *sides.values()), strict=True)]


def process_alone(robots: int, bench: Bench) -> Finding:
    """Seconds of a whole process."""
    sides = process(robots, bench)
    return Finding(middle(sides[0].values), sides)


def process_beside_argos(robots: int, bench: Bench) -> Finding:
    """A whole process beside one of ARGoS."""
    bench.argos.experiment(robots)
    sides = process(robots, bench)
    return Finding(ratio(sides[-1].values, sides[0].values), sides)


def loop_beside_argos(robots: int, bench: Bench) -> Finding:
    """Times real time of the ticks in a whole process, which loads compiled code on the way; of ARGoS, what ten minutes
    take longer than one, over the nine."""
    bench.argos.experiment(robots)

    def ours(which: str) -> float:
        return bench.version(which).loop("crowd", "--robots", f"{robots}", "--seconds", f"{MINUTE:g}")

    def theirs() -> float:
        return 9 * MINUTE / (bench.argos.process(robots, 10) - bench.argos.process(robots))

    sides: dict[str, Callable[[], float]] = {NOW: lambda: ours(NOW), "ARGoS": theirs}
    if isinstance(bench.before, Version):
        sides["0.2.0"] = lambda: ours(BEFORE)
    taken = dict(zip(sides, in_turns(bench.turns, *sides.values()), strict=True))
    return Finding(
        ratio(taken[NOW], taken["ARGoS"]), [Side(name, values, "x real time") for name, values in taken.items()]
    )


# ---- beside libraries


def vector_beside_vmas(bench: Bench) -> Finding:
    """Robots' steps a second of 100 worlds of ten."""
    steps = bench.runs(100, 5)
    bench.libraries.python("vmas")

    def theirs() -> float:
        return float(str(bench.libraries.asked("vmas", "100", "10", f"{steps}")["rate"]))

    def ours() -> float:
        return float(str(bench.now.one("vector", 100, 10, steps)["rate"]))

    try:
        ours()
    except MissingError as error:
        return Finding(None, [Side("VMAS", [theirs() for _ in range(bench.turns)], "steps/s")], str(error))
    now, vmas = in_turns(bench.turns, ours, theirs)
    return Finding(ratio(now, vmas), [Side(NOW, now, "steps/s"), Side("VMAS", vmas, "steps/s")])


def flock_beside_mesa(bench: Bench) -> Finding:
    """Runs a second of the gallery's flocking as a sweep, beside Mesa's boids in as many processes as there are
    cores."""
    runs, few, seconds = bench.runs(1_000, 20), bench.runs(FEWER, bench.cores), bench.runs(FLOCK_SECONDS, 50)
    over = [f"robots.count={FLOCK}"]

    def ours(which: str) -> float:
        return runs / bench.version(which).sweep("vicsek", runs, seconds, "polarization", over, bench.cores)

    sides = [Side(NOW, [ours(NOW)], "runs/s")]
    if isinstance(bench.before, Version):
        sides.insert(0, Side("0.2.0", [ours(BEFORE)], "runs/s"))
    try:
        taken = mesa(bench, seconds, few)
    except MissingError as error:
        return Finding(None, sides, str(error))
    rate = bench.cores / mean(taken)
    a_run = Side("Mesa, a run", taken, "s")
    return Finding(sides[-1].values[0] / rate, [*sides, Side("Mesa, scaled", [rate], "runs/s"), a_run])


def mesa(bench: Bench, steps: int, runs: int) -> list[float]:
    """Seconds that each run of Mesa's boids takes, with a process for each core."""
    from concurrent.futures import ThreadPoolExecutor

    bench.libraries.python("mesa")
    each = str(-(-runs // bench.cores))
    with ThreadPoolExecutor(bench.cores) as pool:
        found = list(
            pool.map(lambda _: bench.libraries.asked("mesa", f"{FLOCK}", f"{steps}", each), range(bench.cores))
        )
    return [float(seconds) for answer in found for seconds in _numbers(answer, "runs")]


# ---- batches


def memory(bench: Bench) -> Finding:
    """kB a robot."""
    worlds = bench.runs(1_000, 100)
    found = float(str(bench.now.one("memory", worlds, 20, bench.runs(60, 5))["kilobytes"]))
    return Finding(found, [Side(NOW, [found], "kB")])


def batch_beside_alone(scenario: str, seconds: int, bench: Bench) -> Finding:
    """How many times as fast a run is in a batch as alone, by the time of the processor."""
    alone = _numbers(bench.now.one("alone", scenario, bench.runs(FEWER, 2), bench.runs(seconds, 10)), "runs")
    beside = Side("alone, a run", alone, "s")
    try:
        found = bench.now.one("batch", scenario, bench.runs(1_000, 20), bench.runs(seconds, 10))
    except MissingError as error:
        return Finding(None, [beside], str(error))
    batch = _numbers(found, "runs")
    return Finding(middle(alone) / batch[0], [Side("in a batch, a run", batch, "s"), beside])


def _numbers(found: Json, key: str) -> list[float]:
    values = found[key]
    assert isinstance(values, list)
    return values


# ---- many robots


def loop_beside_before(robots: int, bench: Bench) -> Finding:
    """A row of `benchmarks.loop`: walls, one robot per 4 m2, two threads; the speed beside that of the release
    before."""
    wait = {"warm": 0.2, "seconds": 0.2} if bench.quick else {"warm": 3, "seconds": 5}
    case: Json = {"robots": robots, "area": 4, "walls": True, "threads": min(2, bench.cores), "numba": True, **wait}

    def side(which: str) -> float:
        version = bench.version(which)
        found = version.child("benchmarks.loop.one", _text(case))
        return 1 / float(str(found["cpu" if version.clock.cpu else "second"]))

    if robots >= 1_000_000:
        before, now = [side(BEFORE)], [side(NOW)]
    else:
        before, now = in_turns(bench.turns, lambda: side(BEFORE), lambda: side(NOW))
    return Finding(ratio(now, before), [Side("0.2.0", before, "x real time"), Side(NOW, now, "x real time")])


def _text(case: Json) -> str:
    import json

    return json.dumps(case)


# ---- all of them


@dataclass(frozen=True)
class Row:
    """name: by which it is chosen. words: what is measured. wanted, dream: bounds of the value, in `unit`."""

    name: str
    words: str
    measure: Callable[[Bench], Finding]
    wanted: float
    dream: float | None = None
    unit: str = "x"
    at_least: bool = True

    def met(self, value: float) -> bool:
        return value >= self.wanted if self.at_least else value <= self.wanted

    def measured(self, bench: Bench) -> Finding:
        """What it measures; who or what is missing is its note."""
        print(f"{self.name} ...", file=sys.stderr, flush=True)
        try:
            return self.measure(bench)
        except MissingError as error:
            return Finding(None, note=str(error))


ROWS = (
    Row("sweep-20", "sweep, 1,000 runs of 20 robots, beside 0.2.0", partial(sweep, 20, 1_000, 40), 10, 25),
    Row("sweep-20-argos", "the same beside ARGoS, a process a run", partial(sweep_beside_argos, 20, 1_000, 40), 6, 15),
    Row("sweep-100", "sweep, 200 runs of 100 robots, beside 0.2.0", partial(sweep, 100, 200, 10), 5),
    Row(
        *("process-20", "whole process, one run of 20 robots, warm", partial(process_alone, 20), 0.45, 0.3),
        *("s", False),
    ),
    Row("loop-20-argos", "loop of 20 robots, beside ARGoS", partial(loop_beside_argos, 20), 2),
    Row("process-100-argos", "whole process, 100 robots, beside ARGoS", partial(process_beside_argos, 100), 3),
    Row("vector", "`vector_env`, 100 worlds of 10, beside VMAS", vector_beside_vmas, 8),
    Row("flock", "runs of `vicsek`, 100 robots, beside Mesa's boids", flock_beside_mesa, 100),
    Row("memory", "memory of 1,000 worlds of 20, a robot", memory, 1.5, None, "kB", False),
    Row("flood", "a run of `flood` in 1,000 worlds, beside alone", partial(batch_beside_alone, "flood", 60), SAME),
    Row(
        "recruit", "a run of `recruit` in 1,000 worlds, beside alone", partial(batch_beside_alone, "recruit", 60), SAME
    ),
    *(
        Row(
            f"loop-{robots}",
            f"loop of {robots:,} robots, beside 0.2.0",
            partial(loop_beside_before, robots),
            SAME,
        )
        for robots in (1_000, 10_000, 100_000, 1_000_000)
    ),
)
