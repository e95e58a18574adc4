"""Many rounds of BEST and QUORUM on the made `radio`, counted: in each a BEST 4 and a QUORUM 5 8 at once among twelve
robots, one in eight of which dies on the way."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from math import inf
from random import Random

from benchmarks.auctions.radio import Rounds, SimulatedRobot, best, quorum
from sleepcast.mind.auction import rank

ROBOTS, DYING, SECONDS = 12, 1 / 8, 8.0
"""Robots; which share of them dies; and how long a round lasts, half a second after the deadline."""
PLACES, LEAST, MOST = 4, 5, 8
CHUNK = 100
"""Rounds that a process makes at a time."""
COLUMNS = {
    "true": "the true four",
    "others": "four of others",
    "fewer": "fewer",
    "many": "too many",
    "accepted": "enough accepted",
    "started": "started",
    "hasty": "started without",
    "short": "short",
    "lost": "short, none killed",
    "crowd": "too many",
}
"""What is counted, in the order of the table: four numbers of the BEST, and then those of the QUORUM. `short`: it was
started, and fewer than the least obeyed; `hasty`: it was started although fewer than the least accept."""

NEVER = ("many", "hasty", "crowd")


def rows(
    losses: Sequence[float], rounds: int, count: Callable[[float, Sequence[int]], Counter[str]] | None = None
) -> bool:
    """Print a row for each share of lost messages; whether nothing was there that must never be. count: counts rounds,
    by default those of this module."""
    kept = True
    print(f"{rounds:,} rounds each: BEST {PLACES} and QUORUM {LEAST} {MOST} of {ROBOTS}, one in eight dies on the way")
    print("   ".join(["lost", *COLUMNS.values()]))
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    with ProcessPoolExecutor(usable) as pool:
        for loss in losses:
            chunks = [range(begin, min(begin + CHUNK, rounds)) for begin in range(0, rounds, CHUNK)]
            found = sum(pool.map(partial(count or counted, loss), chunks), Counter[str]())
            shares = (f"{found[key] / rounds:{len(head)}.2%}" for key, head in COLUMNS.items())
            print("   ".join([f"{loss:4.0%}", *shares]), flush=True)
            kept = kept and not any(found[key] for key in NEVER)
    return kept


def counted(loss: float, seeds: Sequence[int]) -> Counter[str]:
    """How many of the rounds with these seeds ended in which way."""
    found = Counter[str]()
    for seed in seeds:
        found.update(key for key, is_so in outcome(loss, seed).items() if is_so)
    return found


def outcome(loss: float, seed: int) -> dict[str, bool]:
    """How one round ended, by the keys of COLUMNS."""
    chance = Random(f"{loss} {seed}")
    each = Rounds(chance, [best(PLACES), quorum(LEAST, MOST)], ROBOTS, loss)
    accepting = chance.randint(LEAST - 1, ROBOTS)
    for number, robot in enumerate(each.robots):
        robot.dies = chance.uniform(0.0, SECONDS + 1.0) if chance.random() < DYING else inf
        robot.accepts = number < accepting
    each.run(SECONDS)
    return {**_of_best(each), **_of_quorum(each, accepting)}


def _of_best(each: Rounds) -> dict[str, bool]:
    """Who is dead by the end may count or not, as nobody can say when the choice was made."""
    obeyed = set(each.callers[0].status().members)
    alive = [robot for robot in each.robots if robot.dies > each.time]
    true = obeyed in (_least(each.robots), _least(alive))
    enough = len(obeyed) >= PLACES
    return {"true": true, "others": enough and not true, "fewer": not enough, "many": each.most_members[0] > PLACES}


def _of_quorum(each: Rounds, accepting: int) -> dict[str, bool]:
    status = each.callers[1].status()
    killed = any(robot.dies <= each.time for robot in each.robots if robot.name in status.chosen)
    return {
        "accepted": accepting >= LEAST,
        "started": status.started,
        "hasty": (status.started or bool(status.members)) and accepting < LEAST,
        "short": status.short,
        "lost": status.short and not killed,
        "crowd": each.most_members[1] > MOST,
    }


def _least(robots: Sequence[SimulatedRobot]) -> set[str]:
    """Those that bid least."""
    return {robot.name for robot in sorted(robots, key=lambda each: rank(each.cost, each.name))[:PLACES]}
