"""Prints what the language costs on one robot, beside what people use instead, and whether each bar is met.

    python -m benchmarks.language [--quick] [--json]

Everything is measured in this one run, so the ratios hold for this machine as it is now.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from benchmarks.language import commands
from benchmarks.language.contenders import (
    CODE,
    LAMBDA,
    PREDICATE,
    RIVALS,
    Contender,
    hand_written,
    holds,
    sleepcast,
    states,
)
from benchmarks.language.timing import Ratio, Timing, in_turns, nothing
from sleepcast.core.version import VERSION


@dataclass(frozen=True)
class Effort:
    """How long to measure: turns, seconds of a batch, robots that hear commands, starts of a process."""

    turns: int
    seconds: float
    robots: int
    starts: int


LOOP = "the loop around the calls"
FULL, QUICK = Effort(31, 0.02, 20, 15), Effort(5, 0.002, 1, 3)


@dataclass(frozen=True)
class Row:
    """One measured thing. ratio: to the row that the table compares with; low, high: its quartiles."""

    name: str
    seconds: float | None
    ratio: float | None = None
    low: float | None = None
    high: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Bar:
    """What was promised. value: what came out, in `unit`."""

    name: str
    value: float
    wanted: str
    met: bool
    unit: str


@dataclass(frozen=True)
class Report:
    """All of one run."""

    machine: dict[str, str]
    predicate: list[Row]
    text: list[Row]
    start: list[Row]
    bars: list[Bar]


def measure(effort: Effort) -> Report:
    """Run every benchmark."""
    bars: list[Bar] = []
    predicate = _predicate(effort, bars)
    text = _text(effort, bars)
    start = _start(effort, bars)
    return Report(_machine(), predicate, text, start, bars)


def _predicate(effort: Effort, bars: list[Bar]) -> list[Row]:
    robots = states()
    contenders = [*hand_written(robots), *sleepcast(robots)]
    absent: list[Row] = []
    found: dict[str, str] = {}
    for library, make in RIVALS.items():
        try:
            contender = make(robots)
        except ImportError:
            absent.append(Row(library, None, note="not installed"))
        else:
            contenders.append(contender)
            found[library] = contender.name
    for contender in contenders:
        _agrees(contender, robots)
    times = in_turns(
        {LOOP: nothing(robots)} | {each.name: each.batch for each in contenders}, effort.turns, effort.seconds
    )
    bare = {name: timing.less(times[LOOP]) for name, timing in times.items() if name != LOOP}
    bars.append(_at_most("compiled code / hand-written lambda", bare[CODE].over(bare[LAMBDA]), 1.3))
    if "evalidate" in found:
        bars.append(_at_least("evalidate / compiled code", bare[found["evalidate"]].over(bare[CODE]), 3.0))
    return [*(_row(name, timing, bare[LAMBDA]) for name, timing in bare.items()), *absent]


def _agrees(contender: Contender, robots: Sequence[dict[str, float]]) -> None:
    """A fast wrong answer is no contender."""
    for number, state in enumerate(robots[:4]):
        if contender.ask(number) != holds(state):
            raise RuntimeError(f"{contender.name} gives the wrong answer for {state}")


def _text(effort: Effort, bars: list[Bar]) -> list[Row]:
    first = commands.first_results(effort.robots)
    times = commands.stages(effort.turns, effort.seconds)
    bars.append(_below("text to first result of the Bravo command", first.median, 150e-6, "us"))
    kept = times[commands.KEPT].over(times[commands.WALKED])
    bars.append(_at_most("evaluation kept for explaining / plain, walked", kept, 3.0))
    kept = times[commands.RUN_KEPT].over(times[commands.RUN])
    bars.append(_at_most("evaluation kept for explaining / plain, compiled", kept, 3.0))
    tail = f"90 % below {_time(first.quantile(0.9)).strip()}, 99 % below {_time(first.quantile(0.99)).strip()}"
    walked = times[commands.WALKED]
    return [
        Row("text to first result: heard, read, checked, run, answered", first.median, note=tail),
        *(
            _row(name, timing, walked) if name in commands.EVALUATIONS else Row(name, timing.median)
            for name, timing in times.items()
        ),
    ]


def _start(effort: Effort, bars: list[Bar]) -> list[Row]:
    times = commands.start_times(effort.starts)
    # Processes are timed on the wall clock, which whatever else the machine does can only make longer: the best counts.
    bars.append(_below("start of sleepcast eval, best", min(times[commands.START].turns), 0.150, "ms"))
    bars.append(_below("import of sleepcast.language, best", min(times[commands.IMPORT].turns), 0.050, "ms"))
    return [Row(name, each.median, note=f"best {_time(min(each.turns)).strip()}") for name, each in times.items()]


def _row(name: str, timing: Timing, compared: Timing) -> Row:
    ratio = timing.over(compared)
    return Row(name, timing.median, ratio.median, *ratio.quartiles)


def _at_most(name: str, ratio: Ratio, limit: float) -> Bar:
    return Bar(name, ratio.median, f"<= {limit:g} x", ratio.median <= limit, "x")


def _at_least(name: str, ratio: Ratio, limit: float) -> Bar:
    return Bar(name, ratio.median, f">= {limit:g} x", ratio.median >= limit, "x")


def _below(name: str, seconds: float, limit: float, unit: str) -> Bar:
    scale = {"us": 1e6, "ms": 1e3}[unit]
    return Bar(name, seconds * scale, f"< {limit * scale:g} {unit}", seconds < limit, unit)


def _machine() -> dict[str, str]:
    return {
        "sleepcast": VERSION,
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "system": f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors",
        "load": " ".join(f"{each:.2f}" for each in os.getloadavg()),
    }


# ---- printing


def _time(seconds: float) -> str:
    for unit, scale in (("ns", 1e9), ("us", 1e6), ("ms", 1e3)):
        if seconds * scale < 10_000:
            return f"{seconds * scale:8.1f} {unit}"
    return f"{seconds:8.1f} s "


def _line(row: Row) -> str:
    time = " " * 11 if row.seconds is None else _time(row.seconds)
    ratio = "" if row.ratio is None else f"{row.ratio:9.2f} x  ({row.low:.2f} to {row.high:.2f})"
    return f"  {row.name:58}{time}{ratio}{'   ' + row.note if row.note else ''}"


def show(report: Report) -> str:
    """The report for people."""
    lines = [", ".join(f"{name} {value}" for name, value in report.machine.items()), ""]
    lines += [f"{PREDICATE}, a call; ratio to the {LAMBDA} (quartiles of the turns)"]
    lines += map(_line, report.predicate)
    lines += ["", f"{commands.COMMAND}; ratio to the walked evaluation", *map(_line, report.text)]
    lines += ["", "starting", *map(_line, report.start), ""]
    for bar in report.bars:
        verdict = "met" if bar.met else "MISSED"
        lines.append(f"  {bar.name:58}{bar.value:8.2f} {bar.unit:3} wanted {bar.wanted:10} {verdict}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; 0 whether or not the bars are met: a busy machine is no bug."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.language", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a few seconds only, to see that it works")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    chosen = parser.parse_args(arguments)
    report = measure(QUICK if chosen.quick else FULL)
    print(json.dumps(asdict(report), indent=2) if chosen.json else show(report))
    return 0


if __name__ == "__main__":
    sys.exit(main())
