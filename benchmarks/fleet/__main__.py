"""Prints what a fleet's machine costs, beside NumPy written by hand, numexpr and polars, and whether each bar is met.

    python -m benchmarks.fleet [--quick] [--json]

Everything is measured in this one run and in turns, so the ratios hold for this machine as it is now.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import count
from statistics import median
from time import perf_counter

import numpy as np

from benchmarks.fleet import rules
from sleepcast.fleet import Fleet
from sleepcast.fleet.native.kernels import Kernels, available
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.node.node import Node

LATENCY_BAR = 0.030
"""Seconds from the text of a new rule until 100,000 running robots have all evaluated it."""
PREDICATE_BAR = 1.5e-9
"""Seconds a robot for the Bravo predicate."""
CROWD_BARS = {100: 1e-6, 1_000: 200e-9, 100_000: 25e-9}
"""Seconds a robot for a tick of the ten rules of the scenario `crowd`, by robots."""
WARM = 8
"""Ticks before a tick of native code is timed: rules are walked until their code is there."""
NATIVE_TICK = "a tick of ten rules, native"


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


class Running:
    """A fleet that runs ten rules. native: whether they have become native code."""

    def __init__(self, sensed: rules.Columns, *, native: bool) -> None:
        self.fleet, self._numbers, self._ticks = rules.fleet(sensed, native=native), count(1), count(1)
        for number, text in enumerate(rules.RULES):
            self.hear(f"(RULE k{number} {text})")
        for _ in range(WARM if native else 1):
            self.tick()
            if self.fleet.kernels is not None:
                self.fleet.kernels.settle()

    def hear(self, text: str) -> None:
        self.fleet.receive(rules.command(next(self._numbers), text))

    def tick(self) -> None:
        number = next(self._ticks)
        self.fleet.think(number, number / 10)
        self.fleet.take_messages()

    def new_rule(self) -> None:
        """A new rule on robots that run ten, from its text until all have evaluated it."""
        number = next(self._numbers)
        self.hear(f"(RULE new (WHEN (< near1 0.{number}) (SETQ lamp {number})))")
        self.tick()


def ten_rules(robots: int, turns: int) -> tuple[list[Row], list[Row]]:
    """Ticks of ten rules; and a new rule on robots that run ten."""
    sensed, source = rules.columns(robots), np.random.default_rng(2)
    base = "ten rules by hand in NumPy"
    walked = Running(sensed, native=False)
    ticks: dict[str, Callable[[], object]] = {
        "a tick of ten rules, walked": walked.tick,
        base: lambda: rules.rules_by_hand(sensed, source),
    }
    news: dict[str, Callable[[], object]] = {"text to all evaluated, ten others walked": walked.new_rule}
    absent: tuple[str, ...] = (NATIVE_TICK,)
    if available():
        native, absent = Running(sensed, native=True), ()
        ticks[NATIVE_TICK] = native.tick
        news["text to all evaluated, ten others native"] = Running(sensed, native=True).new_rule
    ticking, late = in_turns(ticks, turns), in_turns(news, turns)
    latency = [Row(name, robots, seconds, seconds / ticking[base]) for name, seconds in late.items()]
    return rows(robots, ticking, base, absent), latency


def crowd(turns: int, sizes: Sequence[int]) -> list[Row]:
    """Ticks of fleets with the rules of the scenario `crowd`, walked and native; the ratio is to walking."""
    found = []
    for robots in sizes:
        contenders: dict[str, Callable[[], object]] = {"walked": Crowd(robots, native=False).tick}
        if available():
            contenders["native"] = Crowd(robots, native=True).tick
        times = in_turns(contenders, turns)
        found += [
            Row(f"{robots:,} robots, {name}", robots, taken, taken / times["walked"]) for name, taken in times.items()
        ]
    return found


class Crowd:
    """A fleet that runs the rules of `crowd`."""

    def __init__(self, robots: int, *, native: bool) -> None:
        self._ticks = count(1)
        self.fleet = rules.crowd(robots, native=native)
        for _ in range(WARM):
            self.tick()
            if self.fleet.kernels is not None:
                self.fleet.kernels.settle()

    def tick(self) -> None:
        number = next(self._ticks)
        self.fleet.think(number, number / 10)
        self.fleet.take_messages()


def native_predicate(robots: int, turns: int, base: float) -> Row:
    """The Bravo predicate as native code alone: values and truths of all robots, nothing kept."""
    name = "sleepcast, native code alone"
    if not available():
        return Row(name, robots, None, None)
    fleet = rules.fleet(rules.columns(robots))
    (outcome,) = fleet.evaluate(rules.BRAVO)
    program, rows = outcome.entry.program, fleet.rows()
    kernels = Kernels(hot=0)
    taken = in_turns({name: lambda: kernels.run(fleet.memory, program, rows)}, turns)[name]
    return Row(name, robots, taken, taken / base)


def hostile(robots: int, turns: int) -> tuple[list[Row], list[Row]]:
    """What texts within all bounds that are made to be dear take of a tick of many robots, and of one."""
    base, sum_of = "sums of numbers", "(+ 1 x)"
    many = {
        base: "(DOTIMES (i 999) (+ i id))",
        "everybody tells another text each time": "(DOTIMES (i 999) (TELL `(+ ,i ,id 1)))",
        "everybody has the same fault each time": "(DOTIMES (i 999) (/ 1 0))",
        "everybody has a fault of his own each time": "(DOTIMES (i 999) (SQRT (- id)))",
        "everybody reports each time": '(DOTIMES (i 999) (REPORT "a" i))',
        "everybody stores another number each time": "(DOTIMES (i 200) (SETQ E1 (+ i id)))",
    }
    one = {
        "a sum of 2,000 numbers": nested("1", 2_000),
        "1,400 errors": nested("(SQRT 1 2)", 1_400),
        "2,000 unknown names": nested("n{}", 2_000),
        "1,500 doubtful comparisons": nested("(> 5m 5s)", 1_500),
        "1,000 things to tell": nested("(TELL `(+ ,1))", 1_000),
        "one rule of 12,000 characters": f"(RULE r {nested(sum_of, 1_400)})",
        "60 rules of 200 characters": "(PROGN "
        + " ".join(f"(RULE r{i} {nested(sum_of, 25)})" for i in range(60))
        + ")",
    }
    tables = []
    for count_of, texts in ((robots, many), (1, one)):
        times = in_turns({name: lambda n=count_of, text=text: one_tick(n, text) for name, text in texts.items()}, turns)
        tables.append(rows(count_of, times, next(iter(times))))
    return tables[0], tables[1]


def one_tick(robots: int, text: str) -> None:
    """A tick in which robots that know nothing are given one text."""
    if robots == 1:
        node = Node("r0", Vocabulary("rover", ()))
        node.receive(rules.command(1, text))
        node.think(1, 0.0)
        return
    fleet = Fleet([f"r{i}" for i in range(robots)], Vocabulary("rover", ()))
    fleet.receive(rules.command(1, text))
    fleet.think(1, 0.0)
    fleet.take_messages()


def nested(text: str, times: int) -> str:
    """Many of `text` (`{}` is their number), in lists as large as a list may be."""
    items = [text.format(i) for i in range(times)]
    while len(items) > 1:
        items = [f"(+ {' '.join(items[i : i + 90])})" for i in range(0, len(items), 90)]
    return items[0]


def main() -> None:
    parser = argparse.ArgumentParser(description="What a fleet's machine costs, beside what people use instead.")
    parser.add_argument("--quick", action="store_true", help="fewer robots and turns: to see that it works")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    given = parser.parse_args()
    million, many, turns = (20_000, 5_000, 3) if given.quick else (1_000_000, 100_000, 15)
    predicates = predicate(million, turns)
    ticks, latency = ten_rules(many, turns)
    by_hand = predicates[1].seconds or 1.0
    predicates.insert(1, native_predicate(million, turns, by_hand))
    best = min(row.seconds for row in predicates[:2] if row.seconds is not None)
    late = min(row.seconds for row in latency if row.seconds is not None)
    bars = [
        Bar("Bravo predicate, seconds a robot", best / million, PREDICATE_BAR, best / million <= PREDICATE_BAR),
        Bar("new rule, text to all evaluated, seconds", late, LATENCY_BAR, late <= LATENCY_BAR),
    ]
    crowds = crowd(turns, (100, 1_000, 5_000) if given.quick else (100, 1_000, 10_000, 100_000))
    for row in crowds:
        if row.name.endswith("native") and row.robots in CROWD_BARS and row.seconds is not None:
            wanted, taken = CROWD_BARS[row.robots], row.seconds / row.robots
            bars.append(Bar(f"rules of crowd, {row.robots:,} robots, seconds a robot", taken, wanted, taken <= wanted))
    of_many, of_one = hostile(100 if given.quick else 1_000, min(turns, 5))
    if given.json:
        tables: dict[str, list[Row] | list[Bar]]
        tables = {"predicate": predicates, "ticks": ticks, "latency": latency, "crowd": crowds, "bars": bars}
        tables |= {"hostile": of_many, "hostile, one robot": of_one}
        json.dump({name: [asdict(row) for row in table] for name, table in tables.items()}, sys.stdout, indent=2)
        return
    for title, table in (("the Bravo predicate", predicates), ("ten rules", ticks), ("a new rule", latency)):
        print(f"\n{title}, {table[0].robots:,} robots; the last column is the ratio to NumPy by hand")
        print("\n".join(row.text for row in table))
    print("\nthe rules of the scenario crowd; the last column is the ratio to walking")
    print("\n".join(row.text for row in crowds))
    for table in (of_many, of_one):
        who = f"{table[0].robots:,} robots" if table[0].robots > 1 else "one robot"
        print(f"\na tick of {who} with a text made to be dear; the last column is the ratio to the first")
        print("\n".join(row.text for row in table))
    print()
    for bar in bars:
        print(f"{bar.name}: {bar.value:.3g}, wanted at most {bar.wanted:.3g}: {'met' if bar.met else 'not met'}")


if __name__ == "__main__":
    main()
