"""What a soak has found: what each node did by its own store and its operators' accounts, and what it took, as bars."""

from __future__ import annotations

import os
import sqlite3
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from benchmarks.soak.nodes import KINDS, Computer

EVALUATED = frozenset({"matched", "not matched"})
PAGE = os.sysconf("SC_PAGE_SIZE")
UNSURE = 150.0
"""Seconds before and after a lease in which a robot may refuse its group's other operator: the times of its messages,
and those for which robots were down, which do not count for a lease."""


@dataclass(frozen=True)
class Sent:
    """A command of an operator: its times are s of simulated Unix time."""

    operator: str
    id: str
    text: str
    issued: float
    deadline: float
    counts: bool
    """Whether it is a one-shot command that raises its sender's counter on all."""


@dataclass
class Known:
    """What has been seen in a run. sent: commands; stopped: STOPs. outcomes: of the evaluations in the stores, by robot
    and command, each with its time. answered: the robots that have obeyed a command, by its sender's account. values:
    what robots said at the end, by the text of the question; wanted: what some of them must be."""

    sent: list[Sent] = field(default_factory=list)
    stopped: list[Sent] = field(default_factory=list)
    outcomes: dict[tuple[str, str], list[tuple[str, float]]] = field(default_factory=dict)
    answered: dict[str, frozenset[str]] = field(default_factory=dict)
    values: dict[str, dict[str, float | None]] = field(default_factory=dict)
    wanted: dict[str, float] = field(default_factory=dict)
    leases: list[Sent] = field(default_factory=list)
    """Leases of the group: the deadline is that of the lease."""
    members: frozenset[str] = frozenset()
    """The robots that were told to join the group."""

    def read(self, stores: Sequence[Path]) -> None:
        """Read all stores."""
        for store in stores:
            for robot, command, outcome, time in _evaluations(store):
                self.outcomes.setdefault((robot, command), []).append((outcome, time))


def _evaluations(file: Path) -> list[tuple[str, str, str, float]]:
    with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as store:
        return store.execute("SELECT robot, command, outcome, time FROM journal").fetchall()


# ---- nothing lost, nothing twice


@dataclass
class Delivery:
    """Pairs of robot and one-shot command, of one kind of computers."""

    pairs: int = 0
    done: int = 0
    twice: int = 0
    late: int = 0


def delivery(known: Known, computers: Sequence[Computer]) -> dict[str, Delivery]:
    """By kind: the pairs whose robot could be reached until the deadline, and how many of them were evaluated; and of
    all pairs, how many twice, or too late."""
    found = {kind: Delivery() for kind in KINDS}
    for computer in computers:
        of_kind = found[computer.kind]
        for robot in computer.robots:
            for sent in known.sent:
                if sent.counts:
                    _pair(known, computer, robot, sent, of_kind)
    return found


def _pair(known: Known, computer: Computer, robot: str, sent: Sent, found: Delivery) -> None:
    reached = computer.reached(sent.issued, sent.deadline)
    if not computer.stores:
        if reached and sent.id in known.answered:
            found.pairs += 1
            found.done += robot in known.answered[sent.id]
        return
    times = [time for outcome, time in known.outcomes.get((robot, sent.id), ()) if outcome in EVALUATED]
    refused = any(
        lease.issued - UNSURE <= sent.issued <= lease.deadline + UNSURE
        for lease in known.leases
        if lease.operator != sent.operator
    )
    if reached and not (refused and robot in known.members):
        found.pairs += 1
        found.done += bool(times)
    found.twice += len(times) > 1
    found.late += any(time > sent.deadline for time in times)


def counters(known: Known, computers: Sequence[Computer]) -> tuple[int, int]:
    """Robots whose counter of an operator's commands is less, and more, than the commands that they have obeyed."""
    less = more = 0
    for operator in sorted({sent.operator for sent in known.sent}):
        values = known.values[f"{operator}_n"]
        for computer in computers:
            for robot in computer.robots:
                value = values.get(robot)
                obeyed, most = _obeyed(known, computer, robot, operator)
                less += value is None or value < obeyed
                more += value is not None and value > most
    return less, more


def _obeyed(known: Known, computer: Computer, robot: str, operator: str) -> tuple[int, int]:
    """How many of an operator's commands a robot has obeyed: at least and at most. One without a store counts from
    where its present life began."""
    ours = [sent for sent in known.sent if sent.counts and sent.operator == operator]
    if computer.stores:
        count = sum(outcome == "matched" for sent in ours for outcome, _ in known.outcomes.get((robot, sent.id), ()))
        return count, count
    began = computer.away[-1][1] if computer.away else 0.0
    least = sum(robot in known.answered.get(sent.id, ()) for sent in ours if sent.issued > began)
    return least, sum(sent.deadline > computer.born for sent in ours)


def rules_missing(known: Known, computers: Sequence[Computer]) -> list[str]:
    """The robots, each with a rule, that do not have its last text, or did not say."""
    return [
        f"{robot}: {text} is {known.values[text].get(robot)}, not {wanted:g}"
        for text, wanted in known.wanted.items()
        for computer in computers
        for robot in computer.robots
        if known.values[text].get(robot) != wanted
    ]


def against_leases(known: Known) -> int:
    """Commands that a robot has obeyed although it had granted the lease of its group to another operator before."""
    return sum(
        granted < sent.issued and time < lease.deadline
        for lease in known.leases
        for robot in known.members
        for outcome, granted in known.outcomes.get((robot, lease.id), ())
        if outcome == "matched"
        for sent in known.sent
        if sent.counts and sent.operator != lease.operator
        for decided, time in known.outcomes.get((robot, sent.id), ())
        if decided in EVALUATED
    )


def stop_times(known: Known, computers: Sequence[Computer], within: float) -> list[float]:
    """Seconds from each STOP until each robot with a store that could be reached had it, inf for never."""
    found = []
    for stop in known.stopped:
        for computer in computers:
            if computer.stores and computer.reached(stop.issued, stop.issued + within):
                for robot in computer.robots:
                    times = [time for _, time in known.outcomes.get((robot, stop.id), ())]
                    found.append(min(times, default=float("inf")) - stop.issued)
    return found


# ---- no growth


@dataclass(frozen=True)
class Taken:
    """What one process, or one file, took at a moment (s of simulated time). life: which of its lives it was."""

    who: str
    life: int
    time: float
    memory: int
    files: int
    stored: int


def taken(who: str, life: int, time: float, pid: int, stored: Sequence[Path]) -> Taken | None:
    """What a process takes now, None if it is gone. stored: its files."""
    try:
        memory = int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE
        files = len(os.listdir(f"/proc/{pid}/fd"))
    except (OSError, IndexError):
        return None
    return Taken(who, life, time, memory, files, sum(file.stat().st_size for file in stored if file.exists()))


@dataclass(frozen=True)
class Growth:
    """Of the processes of one kind: bytes of memory in a simulated hour, in the middle and at most; open files more
    than in the beginning, at most; bytes stored in a simulated hour, at most; MB of memory of the largest."""

    lives: int
    memory: float
    worst: float
    files: int
    stored: float
    largest: float


def growths(seen: Sequence[Taken], kind_of: Mapping[str, str], warm: float, least: float) -> dict[str, Growth]:
    """By kind, of lives that have lasted `least` simulated s after their first `warm` s."""
    lives: dict[tuple[str, int], list[Taken]] = defaultdict(list)
    for each in seen:
        lives[each.who, each.life].append(each)
    rates: dict[str, list[tuple[float, int, float, int]]] = defaultdict(list)
    for (who, _), all_of_it in lives.items():
        later = [each for each in all_of_it if each.time >= all_of_it[0].time + warm]
        if len(later) >= 4 and later[-1].time - later[0].time >= least:
            half = len(later) // 4
            ends = later[: max(1, half)], later[-max(1, half) :]
            hours = (median(x.time for x in ends[1]) - median(x.time for x in ends[0])) / 3_600.0
            memory, stored = (
                (median(getattr(x, what) for x in ends[1]) - median(getattr(x, what) for x in ends[0])) / hours
                for what in ("memory", "stored")
            )
            files = int(median(x.files for x in ends[1]) - median(x.files for x in ends[0]))
            rates[kind_of[who]].append((memory, files, stored, max(x.memory for x in later)))
    return {
        kind: Growth(
            len(each),
            median(rate[0] for rate in each),
            max(rate[0] for rate in each),
            max(rate[1] for rate in each),
            max(rate[2] for rate in each),
            max(rate[3] for rate in each) / 1e6,
        )
        for kind, each in rates.items()
    }
