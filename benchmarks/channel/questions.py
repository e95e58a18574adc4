"""STOP, and an operator's commands, while somebody with a trusted key asks, looks, tells or commands as much as he can.

Real processes on the loopback, on the two cores of one machine: robots (a `sleepcast swarm`, or a `sleepcast node`),
an operator's desk, and one who floods them (`asker`). Each trial sends STOP, RELEASE and a command, and takes from the
robots' own notes when each body was told to halt. The same is done without any attack.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.channel.asker import GUESTS, SORTS
from benchmarks.channel.flood import AT_LAST, SETTLED, Air
from benchmarks.channel.proofs import Proof, seconds
from benchmarks.report import Bar, number
from sleepcast.api.progress import steps

HALTED = 0.3
"""Seconds in which all bodies have been told to halt."""
BURST, BEGUN = 1.0, 4.0
"""Seconds after which a burst, or another attack, is at its worst."""
LIFE = 5.0
"""Seconds for which a command is good."""
TRIALS_END = 6.0
"""Seconds after which what is left of a burst is over."""


@dataclass
class Asked:
    """What came of some trials. stops: seconds until each body was told to halt, inf for never; confirmed: until the
    desk knew it of all; answered: until all had answered a command; silent: robots that the desk missed, after each."""

    stops: list[float] = field(default_factory=list)
    confirmed: list[float] = field(default_factory=list)
    answered: list[float] = field(default_factory=list)
    silent: int = 0


def questions(fleets: Sequence[Sequence[str]], trials: int, sorts: Sequence[str] = tuple(SORTS)) -> Proof:
    """Each of these fleets (the words of a command), so many times under each attack, and without one."""
    rows: list[Sequence[str]] = []
    bars: list[Bar] = []
    for words in fleets:
        name = " ".join(words)
        for sort in ("", *sorts):
            told = SORTS[sort].told if sort else "none"
            found = tried(words, sort, trials)
            shares = [seconds(found.stops, share) for share in (0.5, 1.0)]
            times = [*shares, max(found.confirmed), max(found.answered)]
            rows.append([name, told, *map(number, times), str(found.silent)])
            if sort:
                bars.append(Bar(f"{name}, {told}: all bodies halted", shares[1], HALTED, "s", at_least=False))
                bars.append(Bar(f"{name}, {told}: a command answered by all", times[3], LIFE, "s", at_least=False))
    heads = ["robots", "attack", "halted: 50 %, s", "100 %, s", "confirmed, s", "command answered, s", "silent"]
    return Proof("questions", heads, rows, bars, f"{trials} trials each; times of the worst trial")


def tried(words: Sequence[str], sort: str, trials: int, patience: float = AT_LAST + LIFE) -> Asked:
    """So many trials with this fleet, under an attack of this sort. patience: s for answers."""
    found, began = Asked(), []
    count = int(words[1]) if words[0] == "swarm" else len(words)
    with TemporaryDirectory(prefix="sleepcast-questions-") as place:
        folder = Path(place)
        with Air(folder, words, [guest.public for guest in GUESTS.values()]) as air:
            for _ in range(20):
                if air.desk.order("ask", text="1", patience=2.0)["answers"] == count:
                    break
            for _ in steps(trials, f"{' '.join(words)}, {sort or 'no attack'}", quiet=False):
                with air.attacked("asker", sort) if sort else nullcontext():
                    time.sleep(BURST if sort == "burst" else BEGUN if sort else SETTLED)
                    told = air.desk.order("stop", patience=patience)
                    found.silent += int(str(told["n_silent"]))
                    found.confirmed.append(float(str(told["took"])))
                    began.append((float(str(told["began"])), float(str(told["ended"]))))
                    air.desk.order("release", patience=patience)
                    told = air.desk.order("send", text="(SETQQ e1 1)", patience=patience)
                    found.silent += int(str(told["n_silent"]))
                    found.answered.append(float(str(told["took"])) if not told["n_silent"] else inf)
                if len(began) < trials:
                    time.sleep(TRIALS_END if sort else 0.0)
        notes = [json.loads(file.read_text()) for file in folder.glob("*.json")]
    halts: dict[str, list[float]] = {}
    for robot, when in (halt for each in notes for halt in each["halts"]):
        halts.setdefault(robot, []).append(when)
    for begin, end in began:
        for place_ in range(count):
            heard = [when - begin for when in halts.get(f"r{place_ + 1}", ()) if begin <= when <= end + SETTLED]
            found.stops.append(min(heard, default=inf))
    return found
