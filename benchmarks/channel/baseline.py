"""What a newcomer takes after many standing commands, and after a baseline: a few that still count, not all of them.

A robot has evaluated all commands, and their sender is gone. Another one joins. Deliveries are real, the network is
simulated (`repairs`).
"""

from __future__ import annotations

from math import inf

from benchmarks.channel.proofs import Proof
from benchmarks.channel.repairs import QUIET, Group, Network
from benchmarks.report import Bar, number
from sleepcast.channel.message import ONLY
from sleepcast.station.baselines import BASELINE_TEXT, propose

NAMES = 20
"""Rules of which most commands replace one."""
NETWORK = Network(0.02)
PATIENCE = 3_600.0
"""Seconds for which a newcomer may lack something."""
FEW, SMALL, SOON = 50.0, 50.0, 5.0
"""Commands, kilobytes and seconds that are wanted at most for a newcomer after a baseline."""


def joined(group: Group, last: int) -> tuple[int, float, float]:
    """A robot joins: how many commands it takes, the bytes on the air meanwhile, and the seconds until it has the last
    one (inf: never)."""
    group.run(QUIET)
    before, began = group.bytes, group.clock.now()
    newcomer = group.join()
    group.run(PATIENCE, lambda: last in newcomer.rules)
    took = group.clock.now() - began if last in newcomer.rules else inf
    found = len(newcomer.rules), (group.bytes - before) / 1e3, took
    group.leave(newcomer)
    return found


def baseline(commands: int) -> Proof:
    """So many standing commands, then a newcomer, a baseline, and another newcomer."""
    group = Group(1, NETWORK, seed=1)
    messages = {}
    for count in range(commands):
        message = group.post(f"(RULE near{count % NAMES} (VM {count} 0))")
        messages[message.sequence] = message
        group.clock.advance(0.001)
    all_of_them = joined(group, message.sequence)
    kept = propose(messages).kept
    few = joined(group, group.post(BASELINE_TEXT, {ONLY: kept}).sequence)
    rows = [
        [what, number(taken), number(kilobytes), number(took)]
        for what, (taken, kilobytes, took) in (("none", all_of_them), ("a baseline", few))
    ]
    wanted = (("commands", FEW), ("kB", SMALL), ("s", SOON))
    bars = [
        Bar(f"a newcomer after a baseline, {unit}", value, most, unit, at_least=False)
        for value, (unit, most) in zip(few, wanted, strict=True)
    ]
    heads = ["baseline", "commands that a newcomer takes", "kB on the air", "s until it has the last one"]
    return Proof("baseline", heads, rows, bars, f"after {commands:,} standing commands for {NAMES} rules")
