"""Prints how many times faster than life each simulator does the same job, and how many times faster sleepcast is.

    python -m benchmarks.rivals [--quick] [--json] [--picture FILE.svg]

The job is in `job.py`: wander with avoidance, ten control steps a second, one robot for every four square metres, range
sensing as each offers it. Each contender runs in a process of its own, with each number of robots, in turns; set-up is
not counted. Who is not installed is named and left out.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from benchmarks.chart import Line, draw
from benchmarks.children import ChildError, child
from benchmarks.report import Bar, described, installed, machine, middle, number, table
from benchmarks.rivals.job import TICK
from benchmarks.rivals.one import CONTENDERS, OURS


@dataclass(frozen=True)
class Effort:
    """Numbers of robots; how often each is measured; s to warm up, to measure, and to wait for a result."""

    counts: tuple[int, ...]
    turns: int
    warm: float
    seconds: float
    limit: float


FULL = Effort((100, 1_000, 10_000, 100_000), 3, 3.0, 5.0, 420.0)
QUICK = Effort((100,), 1, 0.2, 0.2, 60.0)
SLOW = 2.0
"""Seconds of a tick beyond which it is measured once: it differs by far more than the noise."""


@dataclass
class Row:
    """A contender with so many robots. ticks: s a tick, of each turn; note: why there are none."""

    name: str
    robots: int
    ticks: list[float] = field(default_factory=list)
    setup: float | None = None
    note: str = ""

    @property
    def realtime(self) -> float | None:
        return TICK / middle(self.ticks) if self.ticks else None


def measure(effort: Effort, names: Sequence[str]) -> tuple[list[Row], dict[str, str]]:
    """All contenders in turns; and how each was set up."""
    rows = [Row(name, robots) for robots in effort.counts for name in names]
    settings: dict[str, str] = {}
    for row in rows:
        contender = CONTENDERS[row.name]
        if row.robots > contender.most:
            row.note = f"not tried: {contender.why}"
    for _ in range(effort.turns):
        for row in rows:
            if not row.note and not (row.ticks and row.ticks[0] > SLOW):
                _one(row, effort, settings)
    return rows, settings


def _one(row: Row, effort: Effort, settings: dict[str, str]) -> None:
    arguments = (row.name, str(row.robots), str(effort.warm), str(effort.seconds))
    print(f"{row.name}, {row.robots:,} robots ...", file=sys.stderr, flush=True)
    try:
        found = child("benchmarks.rivals.one", *arguments, limit=effort.limit)
    except ChildError as error:
        row.note = str(error)
        return
    row.ticks.append(float(str(found["tick"])))
    row.setup = float(str(found["setup"]))
    settings[row.name] = str(found["setting"])


def bars(rows: Sequence[Row]) -> list[Bar]:
    """sleepcast is faster than every rival, at every size."""
    ours = {row.robots: row.realtime for row in rows if row.name == OURS}
    told = []
    for robots, mine in ours.items():
        others = {row.name: row.realtime for row in rows if row.robots == robots and row.realtime and _rival(row.name)}
        if mine is None or not others:
            continue
        fastest = max(others, key=lambda name: others[name] or 0.0)
        name = f"{robots:,} robots: sleepcast / {fastest}"
        told.append(Bar(name, mine / (others[fastest] or 1.0), 1.0, "x"))
    return told


def _rival(name: str) -> bool:
    return CONTENDERS[name].library != "sleepcast"


def show(rows: Sequence[Row], counts: Sequence[int]) -> str:
    """Times real time, and below it how many times faster sleepcast is."""
    found = {(row.name, row.robots): row for row in rows}
    names = list(dict.fromkeys(row.name for row in rows))
    heads = ["x real time", *(f"{count:,}" for count in counts)]

    def cell(name: str, robots: int) -> str:
        value = found[name, robots].realtime
        return "-" if value is None else number(value)

    def ratio(name: str, robots: int) -> str:
        mine, theirs = found[OURS, robots].realtime, found[name, robots].realtime
        return "-" if mine is None or theirs is None else number(mine / theirs)

    fast = table(heads, [[name, *(cell(name, count) for count in counts)] for name in names])
    heads[0] = f"{OURS} / ..."
    return f"{fast}\n\n" + table(heads, [[name, *(ratio(name, count) for count in counts)] for name in names[1:]])


def lines(rows: Sequence[Row]) -> list[Line]:
    names = dict.fromkeys(row.name for row in rows)
    counts = [row.robots for row in rows]
    real = Line("real time", [(min(counts), 1.0), (max(counts), 1.0)], wanted=True)
    found = [
        Line(name, [(row.robots, row.realtime) for row in rows if row.name == name and row.realtime is not None])
        for name in names
    ]
    return [*found, real]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rivals", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="100 robots, one turn: to see that it works")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    parser.add_argument("--picture", type=Path, metavar="FILE.svg", help="draw the table into this file")
    options = parser.parse_args()
    effort = QUICK if options.quick else FULL
    absent = [name for name, each in CONTENDERS.items() if _rival(name) and not installed(each.library)]
    rows, settings = measure(effort, [name for name in CONTENDERS if name not in absent])
    told = bars(rows)
    if options.picture:
        draw(
            options.picture,
            f"Wander with avoidance on {machine()['cores']} cores",
            "robots",
            "times real time",
            lines(rows),
        )
    if options.json:
        report = [{**asdict(row), "realtime": row.realtime} for row in rows]
        found = {"machine": machine(), "rows": report, "settings": settings, "absent": absent}
        print(json.dumps({**found, "bars": [bar.to_dict() for bar in told]}))
        return
    print(f"{described(machine())}\n\n{show(rows, effort.counts)}\n")
    print("\n".join(f"{name}: {setting}" for name, setting in settings.items()))
    print("".join(f"{name}: not installed\n" for name in absent), end="")
    print("".join(f"{row.name}, {row.robots:,}: {row.note}\n" for row in rows if row.note))
    print("\n".join(bar.text for bar in told))


if __name__ == "__main__":
    main()
