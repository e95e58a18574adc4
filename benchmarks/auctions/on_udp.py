"""Rounds of BEST and QUORUM on real UDP among robots that are processes: some are killed with `kill -9` and go on from
their stores, desks are killed while they choose, two choose at once, somebody says STOP in the middle, and up to half
of all datagrams are lost.

Who obeys has a rule by which its body works, once a tick, and notes it by one clock; a body is taken to work in a round
from its first such note to its last. Leases and windows are as short as they may be, and a round begins while the last
members of the one before it are still leaving.
"""

from __future__ import annotations

import socket
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.auctions.parties import Air, Desk, Party, be_robots

TOGETHER, ALONE = ("r1", "r2", "r3", "r4"), ("r5", "r6", "r7", "r8")
"""Robots that share a process, and those that have one each, which is killed now and then."""
ROBOTS = (*TOGETHER, *ALONE)
LEAST, MOST = 2, 3
WINDOW, DEADLINE, LEASE, LOOK = 0.3, 1.2, 1.0, 1.4
"""Seconds for bids, until nobody is granted any more, and of a lease; and after which the account is read."""
KILLED, GONE, TWO, STOPPED = 0.3, 0.2, 0.2, 0.1
"""Shares of the rounds in which a robot is killed, a desk is killed, two desks choose, and somebody says STOP."""
PATIENCE = 60.0
"""Seconds within which all robots are there, or released."""
SLOW = 1.0
"""Seconds by which a body may be late on a busy machine."""
COLUMNS = {
    "choices": "choices",
    "killed": "robot killed",
    "gone": "desk killed",
    "stopped": "STOP",
    "undisturbed": "BEST, undisturbed",
    "true": "the true three",
    "started": "QUORUM started",
    "short": "short",
    "many": "too many",
    "hasty": "started without",
    "untold": "short untold",
    "late": "after the lease",
    "deaf": "after STOP",
}
"""What is counted, in the order of the table."""
NEVER = ("many", "hasty", "untold", "late", "deaf")


@dataclass
class Choice:
    """One command of one desk. Times are s of the monotonic clock.

    number: what its members work on
    middle: robots whose numbers are nearest are wanted, or those with greater ones
    account: what its desk says of it at the end, None if the desk was killed
    ended: since when nobody renews leases
    stopped: when all had heard a STOP, as far as the one who said it knows
    worked: when each body first and last worked on it
    """

    number: int
    is_best: bool
    middle: float
    killed: bool = False
    gone: bool = False
    account: Any = None
    ended: float = inf
    stopped: float = inf
    worked: dict[str, list[float]] = field(default_factory=dict)

    @property
    def text(self) -> str:
        does = f"(RULE work{self.number} (WORK {self.number})) :window {WINDOW}s :lease {LEASE:.0f}s"
        if self.is_best:
            return f"(BEST {MOST} (ABS (- id {self.middle:.3f})) TRUE {does})"
        return f"(QUORUM {LEAST} {MOST} (> id {self.middle:.3f}) {does})"

    @property
    def wanted(self) -> set[str]:
        """The robots whose bids are the least, or who accept."""
        if self.is_best:
            return set(sorted(ROBOTS, key=lambda name: abs(int(name[1:]) - self.middle))[:MOST])
        return {name for name in ROBOTS if int(name[1:]) > self.middle}

    @property
    def at_once(self) -> int:
        """How many bodies worked at the same time, at most."""
        begun = (first for first, _ in self.worked.values())
        return max((sum(first <= now <= last for first, last in self.worked.values()) for now in begun), default=0)

    def outcome(self) -> dict[str, bool]:
        """By the keys of COLUMNS."""
        auction, workers = (self.account or {}).get("auction", {}), set(self.worked)
        started, short = bool(auction.get("started")), bool(auction.get("short"))
        undisturbed = self.is_best and not (self.killed or self.gone or self.stopped < inf)
        last = max((last for _, last in self.worked.values()), default=-inf)
        return {
            "choices": True,
            "killed": self.killed,
            "gone": self.gone,
            "stopped": self.stopped < inf,
            "undisturbed": undisturbed,
            "true": undisturbed and workers == self.wanted,
            "started": not self.is_best and started,
            "short": not self.is_best and short,
            "many": self.at_once > MOST,
            "hasty": not self.is_best and bool(workers) and len(self.wanted) < LEAST,
            "untold": not self.is_best and started and len(workers) < LEAST and not short,
            "late": last > self.ended + LEASE + SLOW,
            "deaf": last > self.stopped + SLOW,
        }


class Run:
    """Robots on the air, and what desks have them choose. loss: share of datagrams that each party loses."""

    def __init__(self, folder: Path, seed: int, stack: ExitStack) -> None:
        self.chance, self.choices, self._stack = Random(seed), list[Choice](), stack
        self.air = Air.at(f"udp://239.255.83.76:{_free_port()}?interface=lo", folder / "log")
        self.air.log.touch()
        self._notes = stack.enter_context(self.air.log.open())
        self._party(TOGETHER)
        self._alone = [self._party((name,)) for name in ALONE]
        self._desks, self._latest = list[Desk](), list[Choice]()
        self._chief: Desk | None = None
        """Who has said STOP in this round."""
        desk = Desk(self.air, "chief", ROBOTS)
        desk.ask("send", "(WHEN (> id 0))", PATIENCE)
        _wait_for_all(desk)
        desk.kill()

    def round(self, loss: float) -> list[Choice]:
        """One round; gives what was chosen in it, which goes on a while longer."""
        self.air.loss.value, chance = loss, self.chance
        self._desks = [
            Desk(self.air, name, ROBOTS) for name in (("anna", "bert") if chance.random() < TWO else ("anna",))
        ]
        self._latest = [self._send(desk) for desk in self._desks]
        due = [(chance.uniform(0.0, LOOK), act) for act in self._mischief()]
        begin = time.monotonic()
        for moment, act in sorted([*due, (LOOK, self._restart)], key=lambda each: each[0]):
            time.sleep(max(0.0, begin + moment - time.monotonic()))
            act()
        if self._chief is not None:
            self._end_stop(self._chief)
        for desk, choice in zip(self._desks, self._latest, strict=True):
            choice.account = desk.ask()
            desk.kill()
            choice.ended = min(choice.ended, time.monotonic())
        return self._latest

    def settle(self) -> None:
        """Wait until nobody works any more, and take in what bodies have noted."""
        time.sleep(LEASE + 2.0 * SLOW)
        for line in self._notes:
            at, name, number = line.split()
            worked = self.choices[int(number)].worked.setdefault(name, [float(at), float(at)])
            worked[1] = float(at)

    def _send(self, desk: Desk) -> Choice:
        choice = Choice(len(self.choices), self.chance.random() < 0.5, self.chance.uniform(0.0, 9.0))
        self.choices.append(choice)
        desk.ask("send", choice.text, DEADLINE)
        return choice

    def _mischief(self) -> list[Callable[[], None]]:
        """What goes wrong in this round."""
        likely = ((KILLED, self._kill_robot), (KILLED, self._restart), (GONE, self._kill_desk), (STOPPED, self._stop))
        return [act for share, act in likely if self.chance.random() < share]

    def _kill_robot(self) -> None:
        self.chance.choice(self._alone).kill()
        for choice in self._latest:
            choice.killed = True

    def _restart(self) -> None:
        """Who was killed begins its next life."""
        for robot in self._alone:
            if not robot.is_alive:
                robot.start()

    def _kill_desk(self) -> None:
        place = self.chance.randrange(len(self._desks))
        self._desks[place].kill()
        self._latest[place].gone, self._latest[place].ended = True, time.monotonic()

    def _stop(self) -> None:
        self._chief = Desk(self.air, "chief", ROBOTS)
        self._chief.ask("stop")

    def _end_stop(self, chief: Desk) -> None:
        """When all robots have stopped, the next round may begin."""
        _wait_for_all(chief)
        for choice in self._latest:
            choice.stopped = time.monotonic()
        chief.ask("release")
        _wait_for_all(chief)
        chief.kill()
        self._chief = None

    def _party(self, names: Sequence[str]) -> Party:
        party = Party(be_robots, self.air, names)
        self._stack.callback(party.kill)
        return party


def _wait_for_all(desk: Desk) -> None:
    """Until no robot is silent any more to what this desk has sent last. Raises TimeoutError."""
    until = time.monotonic() + PATIENCE
    while (told := desk.ask())["silent"]:
        if time.monotonic() > until:
            raise TimeoutError(f"robots are silent: {told}")
        time.sleep(0.05)


def rows(losses: Sequence[float], rounds: int, seed: int = 1) -> bool:
    """Print a row for each share of lost datagrams; whether nothing was there that must never be."""
    print(f"{rounds:,} rounds: BEST {MOST} or QUORUM {LEAST} {MOST} of {len(ROBOTS)} robots")
    found = counted(losses, rounds, seed)
    print("   ".join(["lost", *COLUMNS.values()]))
    for loss, counts in found.items():
        cells = (f"{counts[key]:{len(head)},}" for key, head in COLUMNS.items())
        print("   ".join([f"{loss:4.0%}", *cells]))
    return not any(counts[key] for counts in found.values() for key in NEVER)


def counted(losses: Sequence[float], rounds: int, seed: int) -> dict[float, Counter[str]]:
    """How many choices came out in which way, by the share that was lost in their rounds."""
    with TemporaryDirectory() as folder, ExitStack() as stack:
        run = Run(Path(folder), seed, stack)
        made = [
            (losses[number % len(losses)], choice)
            for number in range(rounds)
            for choice in run.round(losses[number % len(losses)])
        ]
        run.settle()
    found = {loss: Counter[str]() for loss in losses}
    for loss, choice in made:
        found[loss].update(key for key, is_so in choice.outcome().items() if is_so)
    return found


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])
