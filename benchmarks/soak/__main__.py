"""Puts a fleet of mixed robots on the air for a simulated day, with everything that goes wrong there, and counts.

    python -m benchmarks.soak [--nodes N] [--seconds S] [--speed X] [--seed N] [--plan] [--keep] [--json]

Nodes of five kinds, on computers in networks of their own, are commanded by two operators with keys of their own, while
each computer loses a tenth of what reaches it. By a seeded schedule nodes are killed and begin again, parts of the
network are cut off, clocks jump, and an operator's program is killed. All clocks, sleeps and timeouts of all processes
run X times faster than this machine's (`clock`), except during STOPs, which are timed by this machine's own clock. The
bars: nothing lost, nothing twice, no growth. Linux only; wants network namespaces and a C compiler.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from math import ceil, inf
from pathlib import Path

from benchmarks.channel.lab import LabError
from benchmarks.report import Bar, Json, described, machine, table
from benchmarks.soak import evidence
from benchmarks.soak.clock import ClockError
from benchmarks.soak.evidence import Growth
from benchmarks.soak.nodes import MICROPYTHON, OPERATORS, TICK, Fleet, NodeError, missing, mixed
from benchmarks.soak.run import LIFE, LOSS, STOP_WITHIN, Soak

NODES, SPEED, SECONDS = 100, 24.0, 28_800.0
"""Eight simulated hours in 20 minutes, which takes two cores that nobody else uses."""
LEAST_NODES, MOST_NODES = 8, 400
WARM = 0.15
"""Share of the run after whose beginning memory is still filled."""
MEMORY, DESK = 2.5e6, 10e6
"""Bytes of memory that a process may gain in a simulated hour, so that a day costs no more than it takes anyway; and an
operator's program, which keeps the accounts of a thousand commands."""
STORED, JOURNAL, LOG = 600.0, 2_000.0, 5e6
"""Bytes: in a store, of each command and each of its robots; in an operator's journal, of each command and each robot;
ahead of a store, where SQLite has four million at most."""


def bars(soak: Soak) -> tuple[list[Bar], list[list[str]], list[list[str]]]:
    """What was promised, and the tables behind it: deliveries by kind, growth by kind."""
    known, computers = soak.known, soak.fleet.computers
    delivered = evidence.delivery(known, computers)
    pairs = sum(each.pairs for each in delivered.values())
    done = sum(each.done for each in delivered.values())
    less, more = evidence.counters(known, computers)
    lost = evidence.rules_missing(known, computers)
    times = sorted(evidence.stop_times(known, computers, STOP_WITHIN))
    found = [
        Bar("one-shot commands evaluated in time, of all pairs in reach", 100.0 * done / max(1, pairs), 99.9, "%"),
        Bar("of them evaluated twice", sum(each.twice for each in delivered.values()), 0, "", False),
        Bar("of them evaluated after their deadline", sum(each.late for each in delivered.values()), 0, "", False),
        Bar("counters that are less than the commands obeyed", less, 0, "", False),
        Bar("counters that are more than the commands obeyed", more, 0, "", False),
        Bar("last rules missing on a robot at the end", len(lost), 0, "", False),
        Bar("commands obeyed against another operator's lease", evidence.against_leases(known), 0, "", False),
        Bar("STOP until 99 % of the robots in reach had it", _share(times, 0.99), 0.5, "s", False, "no STOP was sent"),
        Bar(f"robots in reach without a STOP after {STOP_WITHIN:g} s", sum(each > STOP_WITHIN for each in times), 0,
            "", False),
        Bar("nodes that ended by themselves", len(soak.ended), 0, "", False),
    ]  # fmt: skip
    rows = [
        [kind, f"{sum(len(c.robots) for c in computers if c.kind == kind)}",
         f"{sum(c.kind == kind for c in computers)}", f"{each.pairs:,}", f"{each.pairs - each.done:,}",
         f"{each.twice}", f"{each.late}"]
        for kind, each in delivered.items() if each.pairs
    ]  # fmt: skip
    grown, growth_rows = _growth(soak)
    return found + grown, rows, growth_rows


def _growth(soak: Soak) -> tuple[list[Bar], list[list[str]]]:
    computers, hours = soak.fleet.computers, soak.seconds / 3_600.0
    kind_of = {each.name: each.kind for each in computers}
    kind_of |= dict.fromkeys(OPERATORS, "operator") | {"nserver": "nserver"}
    growths = evidence.growths(soak.seen, kind_of, WARM * soak.seconds, 0.3 * soak.seconds)
    rows = [
        [kind, f"{each.lives}", f"{each.memory / 1e6:.2f}", f"{each.worst / 1e6:.2f}", f"{each.files:+d}",
         f"{each.largest:.0f}", f"{each.stored / 1e3:,.0f}"]
        for kind, each in growths.items()
    ]  # fmt: skip
    sent = len(soak.known.sent) / hours
    stores = [each for kind, each in growths.items() if kind not in ("operator", "nserver", MICROPYTHON)]
    per_node = max(_per_node(kind, each, soak) for kind, each in growths.items()) if stores else inf
    journal = growths["operator"].stored / sent if "operator" in growths else inf
    robots = sum(len(each.robots) for each in computers)
    desk, others = (
        max((each.worst for kind, each in growths.items() if (kind == "operator") is wanted), default=inf)
        for wanted in (True, False)
    )
    if soak.fleet.firsts().keys() - growths.keys():
        others = inf  # of a kind it is not known
    return [
        Bar("memory that a robot's process gains in a simulated hour, worst", others / 1e6, MEMORY / 1e6, "MB", False),
        Bar("memory that an operator's program gains in it", desk / 1e6, DESK / 1e6, "MB", False),
        Bar("open files more at the end", max((each.files for each in growths.values()), default=inf), 0, "", False),
        Bar("bytes in a store for each command sent, and robot", per_node / sent, STORED, "B", False),
        Bar("bytes in an operator's journal for each command sent, and robot", journal / robots, JOURNAL, "B", False),
        Bar("bytes written ahead of a store, most", soak.largest_log / 1e6, LOG / 1e6, "MB", False),
    ], rows


def _per_node(kind: str, growth: Growth, soak: Soak) -> float:
    """Bytes that a store gains in a simulated hour for each of its robots; 0 for what is no store of robots."""
    robots = [len(each.robots) for each in soak.fleet.computers if each.kind == kind and each.stores]
    return growth.stored / robots[0] if robots else 0.0


def _share(times: Sequence[float], share: float) -> float | None:
    return times[ceil(share * len(times)) - 1] if times else None


HEADS = ["kind", "nodes", "computers", "pairs in reach", "not evaluated", "twice", "late"]
GROWTH_HEADS = ["kind", "lives", "MB/h, median", "MB/h, worst", "files", "MB, largest", "kB/h stored, worst"]


def report(soak: Soak) -> tuple[Json, str]:
    """What came out, as JSON and as text."""
    found, rows, growth = bars(soak)
    did = dict(sorted(soak.done.items()))
    load = os.getloadavg()[0]
    clocks = (
        f"clocks of all processes: {soak.speed:g} times this machine's, except during STOPs; minds tick every {TICK:g} "
        "simulated s"
    )
    told: Json = {
        "machine": machine(),
        "simulated_seconds": soak.seconds,
        "wall_seconds": soak.real,
        "speed": soak.speed,
        "loss": LOSS,
        "events": did,
        "settled_after": soak.settled if soak.settled < inf else None,
        "late_by": soak.slow,
        "cores": soak.busy / soak.real,
        "load": load,
        "kinds": [dict(zip(HEADS, row, strict=True)) for row in rows],
        "growth": [dict(zip(GROWTH_HEADS, row, strict=True)) for row in growth],
        "bars": [bar.to_dict() for bar in found],
        "missing": evidence.rules_missing(soak.known, soak.fleet.computers)[:20],
        "ended": soak.ended[:20],
    }
    results = [[bar.name, f"{bar.value:,.4g} {bar.unit}".strip() if bar.value is not None else "-",
                f"at {'least' if bar.at_least else 'most'} {bar.wanted:g} {bar.unit}".strip(),
                {True: "met", False: "MISSED", None: "?"}[bar.met]] for bar in found]  # fmt: skip
    text = "\n\n".join(
        [
            f"{soak.seconds / 3_600.0:.2f} simulated hours in {soak.real / 60.0:.1f} minutes; {LOSS:.0%} loss; "
            f"{clocks}; one-shot commands are good for {LIFE:g} simulated s; "
            f"{soak.busy / soak.real:.2f} cores used, load {load:.1f}",
            ", ".join(f"{number} {what}" for what, number in did.items()),
            table(HEADS, rows),
            table(GROWTH_HEADS, growth),
            table(["what", "found", "bar", ""], results),
            f"every rule was everywhere {soak.settled:.0f} simulated s after the end" if soak.settled < inf else "",
            *map(str, told["missing"]),  # type: ignore[call-overload]
            *map(str, told["ended"]),  # type: ignore[call-overload]
        ]
    )
    return told, text


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=__doc__.split("\n")[0])
    parser.add_argument("--nodes", type=int, default=NODES, metavar="N", help=f"nodes in all (default: {NODES})")
    parser.add_argument("--seconds", type=float, default=SECONDS, metavar="S", help="simulated seconds")
    parser.add_argument("--speed", type=float, default=SPEED, metavar="X", help="of all clocks")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the schedule")
    parser.add_argument("--plan", action="store_true", help="print the schedule, and do nothing")
    parser.add_argument("--keep", action="store_true", help="keep all files, and say where")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    options = parser.parse_args(arguments)
    if not LEAST_NODES <= options.nodes <= MOST_NODES:
        parser.error(f"--nodes {options.nodes}: wanted {LEAST_NODES} to {MOST_NODES}")
    if not 60.0 <= options.seconds <= 30 * 86_400.0 or not 1.0 <= options.speed <= 100.0:
        parser.error("wanted 60 to 2,592,000 --seconds, and a --speed of 1 to 100")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    folder = Path(tempfile.mkdtemp(prefix="sleepcast-soak-"))
    try:
        return _run(options, folder)
    except (LabError, ClockError, NodeError) as error:
        print(f"no soak here: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("ended; nothing is left running", file=sys.stderr)
        return 130
    finally:
        if options.keep:
            print(f"all files are in {folder}", file=sys.stderr)
        else:
            shutil.rmtree(folder, ignore_errors=True)


def _run(options: argparse.Namespace, folder: Path) -> int:
    began = time.monotonic()

    def say(line: str) -> None:
        print(f"{time.monotonic() - began:6.0f} s  {line}", file=sys.stderr, flush=True)

    without = missing()
    for kind, why in without.items():
        say(f"no {kind} nodes: {why}")
    fleet = Fleet(folder, mixed(options.nodes, without))
    try:
        kinds = Counter(each.kind for each in fleet.computers)
        say(", ".join(f"{number} x {kind}" for kind, number in kinds.items()))
        soak = Soak(fleet, options.seed, options.seconds, options.speed, say)
        if options.plan:
            print("\n".join(event.text for event in soak.plan))
            return 0
        soak.run()
    finally:
        fleet.close()
    told, text = report(soak)
    print(json.dumps(told) if options.json else f"{described(machine())}\n\n{text}")
    return 0 if all(bar.met is not False for bar in bars(soak)[0]) else 1


if __name__ == "__main__":
    sys.exit(main())
