"""Prints how fast copters fly, with ten rules, neighbours within 5 m and contact, beside crazyflow and ARGoS.

    python -m benchmarks.flight [--quick] [--cpu] [--json] [--copters N,N,...] [--argos FOLDER] [--rivals-python PYTHON]

What they do is in `copters.py`. Each number of them runs in a process of its own, on one thread and on all, in turns
with the rivals; set-up and compiling do not count. What is compared is how many copters' seconds of flight come out in
a second on the clock; with --cpu the time of the processor counts, by the number of its cores, which other work on the
machine hardly changes.

crazyflow: in this Python, or in one that --rivals-python names.
ARGoS: `argos3` on the PATH; FOLDER has `100.argos` and `1000.argos`: so many eye-bots on pointmass3d that fly by a
controller of the same kind, at ten steps a second, for length="60", without a visualization.

What the three simulate is not the same, and is told beside the numbers. A rival that is missing is not measured.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

from benchmarks.loop import floor
from benchmarks.report import Bar, Json, described, installed, machine, middle, number, table
from benchmarks.worlds.sides import Argos, Clock, MissingError, asked, python_with

COUNTS, LARGE, QUICK = (100, 1_000), 100_000, (27,)
TURNS = 3
WARM, SECONDS, QUICK_SECONDS = 1.0, 3.0, 0.1
MINUTE = 60.0
OURS, CRAZYFLOW, ARGOS = "sleepcast", "crazyflow", "ARGoS"
WANTED = {CRAZYFLOW: 10.0, ARGOS: 20.0}
"""How many times as many copters' seconds at least."""
REAL_TIME = 1.0
"""Times real time at least, of LARGE ones."""
DOES = {
    OURS: "10 Hz; limits of speed, climb and acceleration, no attitude; contact along ways, neighbours, ten rules, "
    "telemetry, battery",
    CRAZYFLOW: "500 Hz; attitude and thrust of a fitted second-order model; no contact, neighbours or rules",
    ARGOS: "10 Hz; point masses with a controller each; what its sensors and actuators do",
}


@dataclass
class Row:
    """Somebody with so many copters. seconds: what a simulated second took, s, in each turn; note: why none did."""

    name: str
    copters: int
    seconds: list[float] = field(default_factory=list)
    note: str = ""
    setting: str = ""

    @property
    def realtime(self) -> float | None:
        return 1.0 / middle(self.seconds) if self.seconds else None

    @property
    def flown(self) -> float | None:
        """Copters' seconds of flight in a second."""
        return None if self.realtime is None else self.realtime * self.copters


@dataclass(frozen=True)
class Effort:
    """s to measure; how often; which of the clocks."""

    seconds: float
    turns: int
    clock: Clock


def ours(row: Row, effort: Effort, cores: int) -> float:
    """The fastest number of threads counts."""
    found = []
    for threads in sorted({1, cores}):
        wanted = {
            "copters": row.copters,
            "threads": threads,
            "numba": installed("numba") is not None,
            "warm": effort.seconds / SECONDS * WARM,
            "seconds": effort.seconds,
        }
        said = asked("benchmarks.flight.one", json.dumps(wanted), *effort.clock.options)
        if said["awake"] != row.copters:
            raise MissingError(f"only {said['awake']} copters think")
        found.append((float(str(said["second"])), threads, said))
    second, threads, said = min(found, key=lambda each: each[0])
    row.setting = f"{threads} threads; {said['crashed']} of {row.copters:,} have crashed"
    return second


def crazyflow(row: Row, effort: Effort, pythons: Sequence[str]) -> float:
    """See `with_crazyflow`."""
    python = python_with("crazyflow", pythons)
    texts = (str(row.copters), str(effort.seconds), *effort.clock.options)
    said = asked("benchmarks.flight.with_crazyflow", *texts, python=python)
    row.setting = str(said["setting"])
    return float(str(said["second"]))


def argos(row: Row, folder: Path | None, clock: Clock) -> float:
    """What a minute more takes, so that starting does not count."""
    side = Argos(folder, clock, "eye-bots on pointmass3d")
    return (side.process(row.copters, 2) - side.process(row.copters, 1)) / MINUTE


def measure(counts: Sequence[int], effort: Effort, folder: Path | None, pythons: Sequence[str]) -> list[Row]:
    """All rows, in turns; rivals do not take part with many copters."""
    cores = int(str(machine()["cores"]))
    rows: list[tuple[Row, Callable[[Row], float]]] = []
    for count in counts:
        rows.append((Row(OURS, count), partial(ours, effort=effort, cores=cores)))
        if count < LARGE:
            rows.append((Row(CRAZYFLOW, count), partial(crazyflow, effort=effort, pythons=pythons)))
            rows.append((Row(ARGOS, count), partial(argos, folder=folder, clock=effort.clock)))
    for _ in range(effort.turns):
        for row, work in rows:
            if not row.note:
                print(f"{row.name}, {row.copters:,} copters ...", file=sys.stderr, flush=True)
                try:
                    row.seconds.append(work(row) / (cores if effort.clock.cpu else 1))
                except MissingError as error:
                    row.note = str(error)
    return [row for row, _ in rows]


def bars(rows: Sequence[Row]) -> list[Bar]:
    """Every promise that these rows can tell of."""
    mine = {row.copters: row for row in rows if row.name == OURS}
    found = []
    for row in rows:
        flown, name = mine[row.copters].flown, f"{row.copters:,} copters: sleepcast / {row.name}"
        if row.name in WANTED:
            value = flown / row.flown if flown and row.flown else None
            found.append(Bar(name, value, WANTED[row.name], "x", note=f"not measured, {row.note}"))
        elif row.copters >= LARGE:
            found.append(Bar(f"{row.copters:,} copters", row.realtime, REAL_TIME, "x real time", note=row.note))
    return found


def show(rows: Sequence[Row]) -> str:
    heads = ("", "copters", "x real time", "copters' s in a s", "how", "what")
    lines = []
    for row in rows:
        values = ["-" if value is None else number(value) for value in (row.realtime, row.flown)]
        lines.append(
            (row.name, f"{row.copters:,}", *values, row.setting or f"not measured: {row.note}", DOES[row.name])
        )
    return table(heads, lines)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.flight", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few copters, one turn: to see that it works")
    parser.add_argument("--cpu", action="store_true", help="count the time of the processor: where other work goes on")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--copters", metavar="N,N,...", help="these numbers of copters only")
    parser.add_argument(
        "--argos", metavar="FOLDER", type=Path, help="with experiments of ARGoS, 100.argos and 1000.argos"
    )
    parser.add_argument(
        "--rivals-python", metavar="PYTHON", action="append", default=[], help="a Python that has crazyflow"
    )
    options = parser.parse_args()
    counts: tuple[int, ...] = QUICK if options.quick else (*COUNTS, LARGE)
    if options.copters:
        counts = tuple(int(part.replace("_", "")) for part in options.copters.split(","))
    seconds, turns = (QUICK_SECONDS, 1) if options.quick else (SECONDS, TURNS)
    here, floors = machine(), floor.measure()
    effort = Effort(seconds, turns, Clock(options.cpu))
    rows = measure(counts, effort, options.argos, [sys.executable, *options.rivals_python])
    told = bars(rows)
    if options.json:
        report = [{**asdict(row), "realtime": row.realtime, "flown": row.flown} for row in rows]
        print(json.dumps(Json(machine=here, cpu=options.cpu, rows=report, bars=[bar.to_dict() for bar in told])))
        return
    times = (
        "times are those of the processor, by the number of cores" if options.cpu else "times are those on the clock"
    )
    print(f"{described(here)}; {times}\n{floors.text if floors else 'numba is not installed'}\n\n{show(rows)}\n")
    print("\n".join(bar.text for bar in told))


if __name__ == "__main__":
    main()
