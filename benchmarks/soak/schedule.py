"""What happens in a soak and when, by a seed: what operators send, and what goes wrong.

kill        a computer's nodes end as by a crash, and begin again some time later on what they have kept
partition   some computers hear each other only
clock       a computer's time of day jumps by hours, and back
wrong       the same, and its nodes are killed and begin again meanwhile, so that a whole life has the wrong time
restart     an operator's program is killed, and begins again
one-shot, rule, rollback, lease, stop
            what operators send
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from random import Random

ORDER_EVERY, LEAST_ORDERS = 100.0, 20
"""Simulated seconds between two orders of one operator, in the mean; and how many there are about, at least."""
EVERY = {
    "kill": 240.0,
    "partition": 1_800.0,
    "clock": 1_800.0,
    "wrong": 2_400.0,
    "stop": 3_600.0,
    "lease": 3_600.0,
    "rollback": 4_800.0,
}
"""Simulated seconds between two of them, in the mean; in a short run each comes once."""
BEGIN, END = 0.04, 0.97
"""Shares of the run between which things go wrong."""
RULES = 4
"""Names of rules of each operator."""
DOWN = (5.0, 60.0)
"""Simulated seconds for which a killed node is down, besides the time it needs to start."""
CUT = (60.0, 360.0)
"""Simulated seconds of a partition."""
WRONG = (120.0, 600.0)
"""Simulated seconds for which a clock is wrong."""
HOURS = 6.0
"""Hours by which it is wrong, at most."""


@dataclass(frozen=True, order=True)
class Event:
    """time: simulated s after the beginning. who: computers, or an operator. lasts: simulated s. amount: of a clock's
    jump, s; of a rule, its number."""

    time: float
    what: str
    who: tuple[str, ...] = ()
    lasts: float = 0.0
    amount: float = 0.0

    @property
    def text(self) -> str:
        who = ", ".join(self.who[:4]) + (f" and {len(self.who) - 4} more" if len(self.who) > 4 else "")
        lasts = f" for {self.lasts:.0f} s" if self.lasts else ""
        amount = f", {self.amount:+,.0f} s" if self.what in ("clock", "wrong") else ""
        return f"{self.time:9.1f} s  {self.what}  {who}{lasts}{amount}"


def schedule(
    seed: int,
    seconds: float,
    computers: Sequence[str],
    clocked: Sequence[str],
    operators: Sequence[str],
    spared: Collection[str] = (),
) -> list[Event]:
    """What happens in a run of so many simulated s, in its order. clocked: the computers whose clocks may jump; spared:
    those whose nodes are never killed."""
    chance = Random(seed)
    killed = [each for each in computers if each not in spared]
    chosen = {"kill": killed, "clock": clocked, "wrong": [each for each in clocked if each not in spared]}
    first, last = BEGIN * seconds, END * seconds
    found: list[Event] = []
    for what in EVERY:
        count = max(1, round((last - first) / EVERY[what]))
        for number in range(count):
            time = first + (last - first) * (number + chance.uniform(0.1, 0.9)) / count
            found.append(_event(what, time, chance, seconds, chosen.get(what, computers), operators))
    every = min(ORDER_EVERY, (last - first) / LEAST_ORDERS)
    for operator in operators:
        time, number = first / 2.0, 0
        while time < last:
            what = "one-shot" if chance.random() < 0.7 else "rule"
            found.append(Event(time, what, (operator,), amount=float(number)))
            number += 1
            time += chance.uniform(0.4, 1.6) * every
    found.append(Event(seconds * chance.uniform(0.4, 0.6), "restart", (operators[0],), lasts=chance.uniform(*DOWN)))
    return sorted(found)


def _event(
    what: str,
    time: float,
    chance: Random,
    seconds: float,
    computers: Sequence[str],
    operators: Sequence[str],
) -> Event:
    short = min(1.0, seconds / 3_600.0)
    if what == "kill":
        return Event(time, what, (chance.choice(computers),), chance.uniform(*DOWN))
    if what == "partition":
        count = max(1, round(len(computers) * chance.uniform(0.1, 0.3)))
        return Event(time, what, tuple(chance.sample(computers, count)), short * chance.uniform(*CUT))
    if what in ("clock", "wrong"):
        jump = chance.choice((-1.0, 1.0)) * chance.uniform(0.1, HOURS) * 3_600.0
        return Event(time, what, (chance.choice(computers),), short * chance.uniform(*WRONG), jump)
    return Event(time, what, (chance.choice(operators),))
