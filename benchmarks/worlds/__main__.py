"""Prints how fast many small swarms are at once, and one small swarm, beside 0.2.0, ARGoS, VMAS and Mesa.

    python -m benchmarks.worlds [--quick] [--cpu] [--json] [--before FOLDER] [--argos FOLDER] [--rivals-python PYTHON]
        [ROW ...]
    python -m benchmarks.worlds --equal [--quick] [--json] [SCENARIO ...]

Each row is one promise: its value, what is wanted of it, and everybody's own numbers. Everything runs in processes of
its own, the sides of a row in turns, on the wall clock, or with --cpu by the time of the processor, which other work on
the machine hardly changes. What is compared with:

0.2.0: in FOLDER, or taken from the history of this repository; with the same Python and libraries.
ARGoS: `argos3` on the PATH; FOLDER has `20.argos` and `100.argos`: its diffusion example with so many robots and as
much room for each, for length="60", without a visualization.
VMAS, Mesa: in this Python, or in one that --rivals-python names, which may be said more than once.

A row whose rival is missing is not measured, and a row of something that this version does not have says so.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

from benchmarks.children import ROOT
from benchmarks.report import Json, described, machine, number, table
from benchmarks.worlds.rows import ROWS, Bench, Finding, Row
from benchmarks.worlds.sides import Argos, Clock, Libraries, MissingError, Version, before

HEADS = ("", "found", "wanted", "dream", "", "sides")
EQUAL_HEADS = ("scenario", "s", "looks", "states", "rows", "")


def verdict(row: Row, finding: Finding, *, quick: bool) -> str:
    """Whether a row is met. A quick one is another job than the promised one: it tells nothing of that."""
    if finding.value is None:
        return "not there" if finding.note.startswith("not there") else "not measured"
    if quick:
        return "quick"
    return "met" if row.met(finding.value) else "MISSED"


def cells(row: Row, finding: Finding, *, quick: bool) -> tuple[str, ...]:
    """A row as text."""
    found = "" if finding.value is None else f"{number(finding.value)} {row.unit}"
    dream = "" if row.dream is None else f"{row.dream:g} {row.unit}"
    said = "; ".join([*(f"{side.name}: {side.text}" for side in finding.sides), *filter(None, [finding.note])])
    wanted = f"{row.wanted:g} {row.unit}"
    return f"{row.name}: {row.words}", found, wanted, dream, verdict(row, finding, quick=quick), said


def chosen(names: Sequence[str]) -> list[Row]:
    """The rows of these names, all of them for none."""
    known = {row.name: row for row in ROWS}
    if unknown := [name for name in names if name not in known]:
        raise SystemExit(f"there is no row {', '.join(unknown)}: wanted some of {', '.join(known)}")
    return [known[name] for name in names] or list(ROWS)


def compare(options: argparse.Namespace) -> int:
    """--equal: 1 if anything differs, or could not be compared."""
    from benchmarks.worlds.equal import compared

    found = list(compared(options.rows, quick=options.quick))
    if options.json:
        print(json.dumps(Json(machine=machine(), scenarios=[asdict(each) for each in found])))
    else:
        print(f"{described(machine())}\n\n{table(EQUAL_HEADS, [each.cells for each in found])}")
    return int(not all(each.equal for each in found))


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.worlds", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument(
        "rows", nargs="*", metavar="ROW", help="these rows only: " + ", ".join(row.name for row in ROWS)
    )
    parser.add_argument("--equal", action="store_true", help="compare runs in a batch with the same runs alone instead")
    parser.add_argument("--quick", action="store_true", help="a few short runs: to see that it works")
    parser.add_argument("--cpu", action="store_true", help="count the time of the processor: where other work goes on")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--before", metavar="FOLDER", type=Path, help="a checkout of 0.2.0")
    parser.add_argument(
        "--argos", metavar="FOLDER", type=Path, help="with experiments of ARGoS, 20.argos and 100.argos"
    )
    parser.add_argument(
        "--rivals-python", metavar="PYTHON", action="append", default=[], help="a Python that has VMAS or Mesa"
    )
    options = parser.parse_args()
    if options.equal:
        return compare(options)
    rows, here, clock = chosen(options.rows), machine(), Clock(options.cpu)
    with ExitStack() as stack:
        try:
            earlier: Version | str = stack.enter_context(before(options.before, clock))
        except MissingError as error:
            earlier = str(error)
        bench = Bench(
            Version("now", ROOT, clock),
            earlier,
            Argos(options.argos, clock),
            Libraries([sys.executable, *options.rivals_python], clock),
            int(str(here["cores"])),
            options.quick,
        )
        bench.now.check()
        found = [(row, row.measured(bench)) for row in rows]
    if options.json:
        told = [
            Json(
                name=row.name,
                words=row.words,
                wanted=row.wanted,
                dream=row.dream,
                unit=row.unit,
                verdict=verdict(row, finding, quick=options.quick),
                **asdict(finding),
            )
            for row, finding in found
        ]
        print(json.dumps(Json(machine=here, quick=options.quick, cpu=options.cpu, rows=told)))
        return 0
    lines = [cells(row, finding, quick=options.quick) for row, finding in found]
    times = "times are those of the processor" if options.cpu else "times are those on the clock"
    print(f"{described(here)}; {times}\n\n{table(HEADS, lines)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
