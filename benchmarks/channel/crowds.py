"""How many digests a group sends when all of it has a new standing command, by the delay of the network.

Two equal digests are enough for all. Where a digest takes a third of a second, everybody sends before they hear the
first one, unless they have learned to wait. Deliveries are real, the network is simulated (`repairs`).
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import mean

from benchmarks.channel.proofs import Proof
from benchmarks.channel.repairs import LEARNED, QUIET, Group, Network
from benchmarks.report import Bar, number
from sleepcast.channel import Kind

WATCHED, BETWEEN = 20.0, 60.0
"""Seconds after a command in which digests are counted, and those until the next one."""
FEW = 40.0
"""Digests that are wanted at most after a command, from a group that knows its network."""


def digests(robots: int, network: Network, times: int, seed: int = 1) -> list[int]:
    """How many digests a group sends after each of so many commands."""
    group, found = Group(robots, network, seed), []
    group.run(QUIET)
    for _ in range(times):
        group.sent.clear()
        group.command()
        group.run(WATCHED)
        found.append(group.sent[Kind.DIGEST])
        group.run(BETWEEN)
    return found


def crowds(sizes: Sequence[int], networks: Sequence[Network], times: int) -> Proof:
    """Groups of these sizes on each of these networks, so many commands in each."""
    rows: list[Sequence[str]] = []
    bars: list[Bar] = []
    for network in networks:
        for robots in sizes:
            found = digests(robots, network, times)
            later = mean(found[LEARNED:])
            rows.append([str(network), f"{network.loss:.0%}", str(robots), number(found[0]), number(later)])
            if robots == max(sizes):
                name = f"digests after a command, {robots} robots, {network} ms, {network.loss:.0%} loss"
                bars.append(Bar(name, later, FEW, "digests", at_least=False))
    heads = ["delay, ms", "loss", "robots", "digests after the first command", f"after {LEARNED}"]
    note = f"digests of all robots within {WATCHED:g} s after each of {times} standing commands that all receive"
    return Proof("crowds", heads, rows, bars, note)
