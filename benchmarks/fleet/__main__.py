"""Prints what a fleet's machine costs, beside NumPy written by hand, numexpr and polars, and whether each bar is met.

    python -m benchmarks.fleet [--quick] [--json]

Everything is measured in this one run and in turns, so the ratios hold for this machine as it is now.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import count
from statistics import median
from time import perf_counter

import numpy as np

from benchmarks.fleet import rules

LATENCY_BAR = 0.030
"""Seconds from the text of a new rule until 100,000 running robots have all evaluated it."""
PREDICATE_BAR = 1.5e-9
"""Seconds a robot for the Bravo predicate."""


@dataclass(frozen=True)
class Row:
    """One measured thing. seconds: median of all turns, None if it is not installed. ratio: to NumPy by hand."""

    name: str
    robots: int
    seconds: float | None
    ratio: float | None

    @property
    def text(self) -> str:
        if self.seconds is None:
            return f"{self.name:<52} not installed"
        ratio = "" if self.ratio is None else f"{self.ratio:8.2f}"
        return (
            f"{self.name:<52} {self.seconds * 1e3:9.3f} ms {self.seconds / self.robots * 1e9:8.2f} ns a robot {ratio}"
        )


@dataclass(frozen=True)
class Bar:
    """What was promised."""

    name: str
    value: float
    wanted: float
    met: bool


def in_turns(contenders: dict[str, Callable[[], object]], turns: int) -> dict[str, float]:
    """Median seconds of each contender, called in turns so that a slow second hits all of them."""
    taken: dict[str, list[float]] = {name: [] for name in contenders}
    for turn in range(turns + 1):
        for name, work in contenders.items():
            start = perf_counter()
            work()
            if turn:  # the first turn warms up
                taken[name].append(perf_counter() - start)
    return {name: median(times) for name, times in taken.items()}


def rows(robots: int, times: dict[str, float], base: str, absent: tuple[str, ...] = ()) -> list[Row]:
    found = [Row(name, robots, seconds, seconds / times[base]) for name, seconds in times.items()]
    return found + [Row(name, robots, None, None) for name in absent]


def predicate(robots: int, turns: int) -> list[Row]:
    """The Bravo predicate on all robots, by everybody who can."""
    sensed = rules.columns(robots)
    fleet = rules.fleet(sensed)
    base = "NumPy by hand, in pieces"
    contenders: dict[str, Callable[[], object]] = {
        "sleepcast, values, matches, faults and why": lambda: fleet.evaluate(rules.BRAVO),
        base: lambda: rules.in_pieces(rules.predicate_by_hand, sensed),
        "NumPy by hand": lambda: rules.predicate_by_hand(sensed),
    }
    absent = []
    for name, make in (("numexpr", with_numexpr), ("polars", with_polars)):
        try:
            contenders[name] = make(sensed)
        except ImportError:
            absent.append(name)
    (outcome,) = fleet.evaluate(rules.BRAVO)
    for name, work in contenders.items():
        if not name.startswith("sleepcast") and not np.array_equal(np.asarray(work()), outcome.matched):
            raise SystemExit(f"{name} does not find the robots that sleepcast finds")
    return rows(robots, in_turns(contenders, turns), base, tuple(absent))


def with_numexpr(sensed: rules.Columns) -> Callable[[], object]:
    numexpr = importlib.import_module("numexpr")
    text = "(sqrt((x-3)**2+(y-4)**2)<5)&(fuel>0.5)&(ordnance>0.7)"
    return lambda: numexpr.evaluate(text, local_dict=sensed)


def with_polars(sensed: rules.Columns) -> Callable[[], object]:
    polars = importlib.import_module("polars")
    frame, column = polars.DataFrame(sensed), polars.col
    far = ((column("x") - 3) ** 2 + (column("y") - 4) ** 2).sqrt()
    found = (far < 5) & (column("fuel") > 0.5) & (column("ordnance") > 0.7)
    return lambda: frame.select(found.alias("bravo"))["bravo"].to_numpy()


def ten_rules(robots: int, turns: int) -> tuple[list[Row], list[Row]]:
    """Ticks of ten rules; and a new rule on robots that run ten, from its text until all have evaluated it."""
    sensed = rules.columns(robots)
    fleet, numbers, source = rules.fleet(sensed), count(1), np.random.default_rng(2)
    for number, text in enumerate(rules.RULES):
        fleet.receive(rules.command(next(numbers), f"(RULE k{number} {text})"))
    ticks = count(1)

    def tick() -> None:
        number = next(ticks)
        fleet.think(number, number / 10)
        fleet.said()

    def new_rule() -> None:
        number = next(numbers)
        fleet.receive(rules.command(number, f"(RULE new (WHEN (< near1 0.{number}) (SETQ lamp {number})))"))
        tick()

    base = "ten rules by hand in NumPy"
    ticking = in_turns({"a tick of ten rules": tick, base: lambda: rules.rules_by_hand(sensed, source)}, turns)
    late = in_turns({"a new rule: text to all evaluated, ten others included": new_rule}, turns)
    latency = [Row(name, robots, seconds, seconds / ticking[base]) for name, seconds in late.items()]
    return rows(robots, ticking, base), latency


def main() -> None:
    parser = argparse.ArgumentParser(description="What a fleet's machine costs, beside what people use instead.")
    parser.add_argument("--quick", action="store_true", help="fewer robots and turns: to see that it works")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    given = parser.parse_args()
    million, many, turns = (20_000, 5_000, 3) if given.quick else (1_000_000, 100_000, 15)
    predicates = predicate(million, turns)
    ticks, latency = ten_rules(many, turns)
    best, late = predicates[0].seconds or 0.0, latency[0].seconds or 0.0
    bars = [
        Bar("Bravo predicate, seconds a robot", best / million, PREDICATE_BAR, best / million <= PREDICATE_BAR),
        Bar("new rule, text to all evaluated, seconds", late, LATENCY_BAR, late <= LATENCY_BAR),
    ]
    if given.json:
        tables: dict[str, list[Row] | list[Bar]]
        tables = {"predicate": predicates, "ticks": ticks, "latency": latency, "bars": bars}
        json.dump({name: [asdict(row) for row in table] for name, table in tables.items()}, sys.stdout, indent=2)
        return
    for title, table in (("the Bravo predicate", predicates), ("ten rules", ticks), ("a new rule", latency)):
        print(f"\n{title}, {table[0].robots:,} robots; the last column is the ratio to NumPy by hand")
        print("\n".join(row.text for row in table))
    print()
    for bar in bars:
        print(f"{bar.name}: {bar.value:.3g}, wanted at most {bar.wanted:.3g}: {'met' if bar.met else 'not met'}")


if __name__ == "__main__":
    main()
