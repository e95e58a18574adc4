"""Prints what the whole loop of the scenario `crowd` costs - sense, ten rules, move, collide - and the bars beside it.

    python -m benchmarks.loop [--quick] [--large] [--json] [--robots N,N,...] [--no-page] [--picture FILE.svg]

Every row runs in a process of its own: with walls and open, at one robot per 4 and per 16 square metres, on one thread
and on all, with 100 to 100,000 robots, and a million with --large; and once more with sonars that fire one after
another, two in a step, as a real Scout's do. Set-up and compiling are told apart. First comes how
fast this machine is, and last a thousand robots in real time, with their page open and recorded.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.chart import Line, draw
from benchmarks.children import ChildError, child
from benchmarks.loop import floor, page
from benchmarks.loop.one import TICKS
from benchmarks.report import Bar, Json, described, installed, machine, number, table

WARM, SECONDS, LIMIT = 3.0, 5.0, 900.0
QUICK_WARM, QUICK_SECONDS = 0.2, 0.2
PAGE_SECONDS, QUICK_PAGE_SECONDS = 20.0, 2.0
COUNTS, LARGE, QUICK = (100, 1_000, 10_000, 100_000), 1_000_000, (100, 300)
AREAS = (4.0, 16.0)
"""Square metres for each robot."""
FEW = 1_000
"""Robots without numba."""
FASTER = {100: 210.0, 1_000: 100.0, 10_000: 30.0, 100_000: 4.0, LARGE: 0.45}
"""Times real time at least, by number of robots, with walls, at one for 4 square metres, on all threads."""
OPEN, WIDE, WITHOUT = 0.6, 1.0, 3.0
"""Times real time at least: a million in the open, at one for 4 and for 16 square metres, or where two sonars fire in a
step; 1,000 without numba."""
FLAT, KILOBYTE, HALF = 1.5, 1_000.0, 0.5
"""At most: cost of a robot's step, a million over 10,000; bytes a robot; cores with the page open and recording."""
FLAT_FROM = 10_000
MANY = 100_000
"""Robots from which memory is told of the robots and not of the program."""


@dataclass(frozen=True)
class Case:
    """What is run. area: square metres for each robot. in_order: sonars fire one after another, two in a tick."""

    robots: int
    area: float
    walls: bool
    threads: int
    numba: bool = True
    in_order: bool = False

    @property
    def name(self) -> str:
        field = f"{'walls' if self.walls else 'open'}, one per {self.area:g} m2"
        field += ", two sonars a step" if self.in_order else ""
        return field if self.numba else f"{field}, without numba"


@dataclass(frozen=True)
class Row:
    """A case and what came out: seconds for one of simulated time, or why nothing did."""

    case: Case
    found: Json
    note: str = ""

    def value(self, key: str) -> float:
        return float(str(self.found[key]))

    @property
    def step(self) -> float | None:
        """Nanoseconds for a robot and a step, on the wall clock."""
        return None if self.note else self.value("second") / TICKS / self.case.robots * 1e9

    @property
    def realtime(self) -> float | None:
        return None if self.note else 1.0 / self.value("second")


def cases(counts: Sequence[int], areas: Sequence[float], threads: Sequence[int]) -> list[Case]:
    """All rows of the table."""
    numba = installed("numba") is not None
    found = [
        Case(robots, area, walls, each)
        for robots in counts
        for area in areas
        for walls in (True, False)
        for each in threads
        if numba
    ]
    in_order = [Case(robots, 4.0, True, each, in_order=True) for robots in counts for each in threads if numba]
    return [*found, *in_order, Case(min(FEW, max(counts)), 4.0, True, 1, numba=False)]


def measure(case: Case, warm: float, seconds: float) -> Row:
    print(f"{case.robots:,} robots, {case.name}, {case.threads} threads ...", file=sys.stderr, flush=True)
    wanted = json.dumps({**asdict(case), "warm": warm, "seconds": seconds})
    try:
        found = child("benchmarks.loop.one", wanted, limit=LIMIT)
    except ChildError as error:
        return Row(case, {}, str(error))
    if found["awake"] != case.robots:
        return Row(case, {}, f"only {found['awake']} robots think")
    return Row(case, found)


def show(rows: Sequence[Row], floors: floor.Floor | None) -> str:
    """The table. Its last columns: bytes a robot; s to compile or load kernels, to set up, and for the first tick."""
    heads = ["field", "robots", "threads", "ns a step", "x cones", "x real time", "wanted", "CPU ns"]
    heads += ["bytes", "compile", "set-up", "first tick"]
    lines = []
    for row in rows:
        case, wanted = row.case, _wanted(row.case)
        cells = [case.name, f"{case.robots:,}", str(case.threads)]
        if row.note or row.step is None or row.realtime is None:
            lines.append([*cells, row.note[:40], *[""] * 8])
            continue
        cells += [number(row.step), number(row.step / floors.cones) if floors else "", number(row.realtime)]
        cells += [_told(row.realtime, wanted), number(row.value("cpu") / TICKS / case.robots * 1e9)]
        cells += [number(row.value("bytes")) if case.robots >= MANY else ""]
        lines.append([*cells, *(f"{row.value(key):.2f} s" for key in ("compile", "setup", "first_tick"))])
    return table(heads, lines)


def _wanted(case: Case) -> float | None:
    """Times real time that this case must reach."""
    if not case.numba:
        return WITHOUT if case.robots == FEW else None
    if case.in_order:
        return WIDE if case.robots == LARGE else None
    if case.area == 4.0 and case.walls:
        return FASTER.get(case.robots)
    if case.robots == LARGE and not case.walls:
        return OPEN if case.area == 4.0 else WIDE
    return None


def _told(realtime: float, wanted: float | None) -> str:
    return "" if wanted is None else f"{wanted:g} {'met' if realtime >= wanted else 'MISSED'}"


def bars(rows: Sequence[Row]) -> list[Bar]:
    """Every promise that these rows can tell of; on all threads."""
    most = max(row.case.threads for row in rows)
    found = []
    for row in rows:
        wanted = _wanted(row.case)
        if wanted is None or (row.case.numba and row.case.threads < most):
            continue
        found.append(Bar(f"{row.case.robots:,} Scouts, {row.case.name}", row.realtime, wanted, "x real time"))
    steps = {row.case.robots: row.step for row in rows if row.case == Case(row.case.robots, 4.0, True, most)}
    base, large = steps.get(FLAT_FROM), steps.get(LARGE) or steps.get(MANY)
    if base and large:
        last = max(count for count, step in steps.items() if step is not None)
        found.append(Bar(f"a robot's step, {last:,} over {FLAT_FROM:,}", large / base, FLAT, "x", at_least=False))
    sizes = [row.value("bytes") for row in rows if not row.note and row.case.robots >= MANY]
    if sizes:
        found.append(Bar(f"memory of {MANY:,} and more", max(sizes), KILOBYTE, "bytes a robot", at_least=False))
    return found


def page_bars(share: page.Share | str, robots: int) -> list[Bar]:
    name = f"{robots:,} with the page open, recording"
    if isinstance(share, str):
        return [Bar(name, None, HALF, "cores", at_least=False, note=share)]
    return [
        Bar(name, share.cores, HALF, "cores", at_least=False),
        Bar(f"{name}: speed", share.speed, 0.98, "x real time"),
    ]


def lines(rows: Sequence[Row]) -> list[Line]:
    """For the picture: the fields on all threads, and real time."""
    most = max(row.case.threads for row in rows)
    names = dict.fromkeys(row.case.name for row in rows if row.case.numba)
    found = [
        Line(
            name,
            [
                (row.case.robots, row.realtime)
                for row in rows
                if row.case.name == name and row.case.threads == most and row.realtime is not None
            ],
        )
        for name in names
    ]
    counts = [row.case.robots for row in rows]
    return [*found, Line("real time", [(min(counts), 1.0), (max(counts), 1.0)], wanted=True)]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.loop", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few robots, short: to see that it works")
    parser.add_argument("--large", action="store_true", help="a million robots too (about 1 GB of memory)")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    parser.add_argument("--robots", metavar="N,N,...", help="these numbers of robots only")
    parser.add_argument("--no-page", action="store_true", help="leave out the page")
    parser.add_argument("--picture", type=Path, metavar="FILE.svg", help="draw the table into this file")
    options = parser.parse_args()
    counts: tuple[int, ...] = QUICK if options.quick else (*COUNTS, LARGE) if options.large else COUNTS
    if options.robots:
        counts = tuple(int(part.replace("_", "")) for part in options.robots.split(","))
    here = machine()
    threads = sorted({1, min(2, int(str(here["cores"])))})
    warm, seconds = (QUICK_WARM, QUICK_SECONDS) if options.quick else (WARM, SECONDS)
    areas = AREAS[:1] if options.quick else AREAS
    floors = floor.measure()
    rows = [measure(case, warm, seconds) for case in cases(counts, areas, threads)]
    told = bars(rows)
    if not options.no_page:
        robots = min(counts) if options.quick else page.ROBOTS
        share = page.measure(robots, QUICK_PAGE_SECONDS if options.quick else PAGE_SECONDS)
        told += page_bars(share, robots)
    if options.picture:
        draw(options.picture, f"crowd: ten rules each, {threads[-1]} threads", "robots", "times real time", lines(rows))
    if options.json:
        report = [{**asdict(row), "ns": row.step, "realtime": row.realtime} for row in rows]
        found = {"machine": here, "floor": asdict(floors) if floors else None, "rows": report}
        print(json.dumps({**found, "bars": [bar.to_dict() for bar in told]}))
        return
    print(f"{described(here)}\n{floors.text if floors else 'numba is not installed'}\n\n{show(rows, floors)}\n")
    print("\n".join(bar.text for bar in told))
    print("\nA new rule on 100,000 running robots, and Bravo over 1,000,000: python -m benchmarks.fleet")


if __name__ == "__main__":
    main()
