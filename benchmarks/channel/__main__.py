"""Tries what the channel promises, on real processes in networks of their own, and prints whether each bar is met.

    python -m benchmarks.channel [PROOF ...] [--quick] [--json]

Proofs: rewrite, catch_up, once, census, stop, forgery, drops, amplification, repairs, crowds, baseline, flood,
questions, latency, durable, sending; without any, all of them. Hosts are network namespaces joined by a bridge, each
with losses of its own (`lab`); everything is measured in this one run. Nobody need be root.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict

from benchmarks.channel import proofs
from benchmarks.channel.amplification import amplification
from benchmarks.channel.baseline import baseline
from benchmarks.channel.crowds import crowds
from benchmarks.channel.drops import drops
from benchmarks.channel.durable import durable
from benchmarks.channel.flood import flood
from benchmarks.channel.fuzz import DATAGRAMS, fuzz
from benchmarks.channel.lab import why_not
from benchmarks.channel.latency import latency
from benchmarks.channel.proofs import Proof, Size
from benchmarks.channel.questions import questions
from benchmarks.channel.repairs import NETWORKS, Network, repairs
from benchmarks.channel.sending import sending
from benchmarks.report import Json, described, machine, table

LOSSES = (0.0, 0.1, 0.3, 0.5)


def forgery(datagrams: int) -> Proof:
    """What the fuzzer finds, in a row."""
    found = fuzz(datagrams, seed=0, quiet=False)
    dropped = ", ".join(f"{count:,} {reason}" for reason, count in sorted(found.dropped.items()))
    rows = [
        [
            f"{found.datagrams:,}",
            f"{found.executed}",
            f"{found.differing}",
            f"{found.uncounted}",
            f"{found.memory[0]:.1f} to {found.memory[1]:.1f}",
            f"{found.datagrams / found.seconds:,.0f}",
        ]
    ]
    heads = ["datagrams", "executed", "rounds that differ", "not counted once", "memory, MB", "a second"]
    return Proof("forgery", heads, rows, found.bars(), f"dropped: {dropped}")


FULL: dict[str, Callable[[], Proof]] = {
    "rewrite": lambda: proofs.rewrite(Size(20, 50, 5), LOSSES),
    "catch_up": lambda: proofs.catch_up(Size(20, 5, 3)),
    "once": lambda: proofs.once(Size(20, 1, 1), 10_000),
    "census": lambda: proofs.census(Size(20, 50, 10)),
    "stop": lambda: proofs.stop(Size(20, 50, 100)),
    "forgery": lambda: forgery(DATAGRAMS),
    "drops": lambda: drops(20_000),
    "amplification": lambda: amplification(60.0),
    "repairs": lambda: repairs((2, 5, 20, 100), NETWORKS, 10),
    "crowds": lambda: crowds((20, 200), NETWORKS, 10),
    "baseline": lambda: baseline(20_000),
    "flood": lambda: flood(10, 2, 20),
    "questions": lambda: questions([["swarm", "10"], ["swarm", "60"], ["node"]], 5),
    "latency": lambda: latency(100, 2, 150),
    "durable": lambda: durable(200, 40, 40),
    "sending": lambda: sending(1_000, 5),
}
QUICK: dict[str, Callable[[], Proof]] = {
    "rewrite": lambda: proofs.rewrite(Size(4, 5, 1), (0.0, 0.3)),
    "catch_up": lambda: proofs.catch_up(Size(4, 3, 1)),
    "once": lambda: proofs.once(Size(4, 1, 1), 300),
    "census": lambda: proofs.census(Size(4, 10, 2)),
    "stop": lambda: proofs.stop(Size(4, 5, 2)),
    "forgery": lambda: forgery(100_000),
    "drops": lambda: drops(500),
    "amplification": lambda: amplification(5.0),
    "repairs": lambda: repairs((2, 20), (Network(0.001), Network(0.3, 0.1)), 5),
    "baseline": lambda: baseline(200),
    "crowds": lambda: crowds((20,), (Network(0.001), Network(0.3)), 5),
    "flood": lambda: flood(10, 2, 2),
    "questions": lambda: questions([["swarm", "60"]], 1, ["burst", "steady"]),
    "latency": lambda: latency(20, 2, 30),
    "durable": lambda: durable(8, 4, 4),
    "sending": lambda: sending(50, 1),
}
IN_NETWORKS = frozenset({"rewrite", "catch_up", "once", "census", "stop"})


def show(proof: Proof) -> str:
    bars = "\n".join(bar.text for bar in proof.bars)
    return f"## {proof.name}\n\n{table(proof.heads, proof.rows)}\n\n{proof.note}\n\n{bars}\n"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.channel", description=__doc__.split("\n")[0])
    parser.add_argument("proofs", nargs="*", metavar="PROOF", help=f"of {', '.join(FULL)}")
    parser.add_argument("--quick", action="store_true", help="a small fleet, tried once or twice")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.proofs if name not in FULL]
    if unknown:
        parser.error(f"no proof {unknown[0]!r}: wanted some of {', '.join(FULL)}")
    reason = why_not() if not options.proofs or IN_NETWORKS & set(options.proofs) else ""
    if not options.json:
        print(f"{described(machine())}\n", flush=True)
    found = []
    for name in options.proofs or FULL:
        if name in IN_NETWORKS and reason:
            print(f"{name} is left out: {reason}", file=sys.stderr)
            continue
        found.append((QUICK if options.quick else FULL)[name]())
        if not options.json:
            print(show(found[-1]), flush=True)
    if options.json:
        told: Json = {"machine": machine(), "left_out": reason, "proofs": [_as_json(proof) for proof in found]}
        print(json.dumps(told))
    return 0 if all(bar.met is not False for proof in found for bar in proof.bars) else 1


def _as_json(proof: Proof) -> Json:
    return {**asdict(proof), "bars": [bar.to_dict() for bar in proof.bars]}


if __name__ == "__main__":
    sys.exit(main())
