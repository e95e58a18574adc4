"""Sends a robot millions of forged datagrams, and looks whether anything of it came through.

    python -m benchmarks.channel.fuzz [--datagrams N] [--seed N] [--json]

A robot - mailbox, door, mind - hears an operator, and between what he says an attacker (`attacker`), five seconds of
simulated time for every hundred thousand datagrams. Its twin, with the same chance, hears the operator only. After each
round they must be alike to the last byte of what they have said and learned: then nothing was executed, nothing was
answered, and nothing was remembered that should not be. A third robot hears what an observer may say, said badly, with
good signatures. Every datagram must be in exactly one counter, and memory must not grow.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from random import Random

from benchmarks.channel.attacker import Attacker
from benchmarks.report import Bar, Json, described, machine, table
from sleepcast.api.progress import steps
from sleepcast.channel import Kind
from sleepcast.channel.admission import Admission
from sleepcast.channel.drops import DropReason
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.core.clock import ManualClock
from sleepcast.language import Vocabulary
from sleepcast.node.node import Node

FLEET = "lab"
DATAGRAMS = 10_000_000
ROUND = 100_000
"""Datagrams of the attacker between two looks at how the robots stand."""
SPELL, CALM = 5.0, 1.5
"""Simulated s in which they come, and then none, so that the operator's signatures are looked at again."""
SAID = 3.0
"""Simulated s in which the operator has said all, his digests included: of what he says in a flood some is lost."""
TICK = 0.01
NONSENSE = 20
"""Of the observer's datagrams in each hundredth of a round."""
KEPT = 400
"""Datagrams that the attacker has recorded: the latest of the operator, and of robots."""
GROWTH = 8.0
"""MB that memory may grow by once a tenth of the run is over: what a heap does by itself."""
LONG = "(SETQ hits (+ hits 1)) ; " + "in several parts " * 150


class Robot:
    """A robot's mind behind its door, without a socket."""

    def __init__(self, name: str, trust: Trust, key: KeyPair, clock: ManualClock, seed: int) -> None:
        self.clock = clock
        self.admission = Admission(trust, FLEET, clock, robot=True)
        self.delivery = ReliableDelivery(name, 1, key, self.admission, Random(seed))
        self.node = Node(name, Vocabulary())
        self.said: list[bytes] = []
        self.answers: Counter[str] = Counter()
        self.given = self.ticks = 0
        self.node.evaluate("(DEFVAR hits 0)")
        self.delivery.start(clock.now())

    def hear(self, datagram: bytes) -> None:
        self.given += 1
        for message in self.delivery.take(datagram, self.clock.now()):
            self.node.receive(message)

    def think(self) -> None:
        """One tick."""
        out, freed = self.delivery.step(self.clock.now())
        for message in freed:
            self.node.receive(message)
        self.ticks += 1
        self.node.think(self.ticks, self.clock.now())
        for message in self.node.outbox:
            self.answers[f"{message.kind} {message.body.get('command')}"] += 1
        self.node.outbox.clear()
        self.said = [*self.said, *out][-KEPT:]

    @property
    def hits(self) -> float:
        return self.node.evaluate("hits").value

    @property
    def uncounted(self) -> int:
        """Datagrams that are in no counter, or in two."""
        return self.given - self.admission.counts.total() - self.admission.taken - self.delivery.overheard

    def state(self) -> tuple[object, ...]:
        """All that must not depend on what an attacker sends."""
        streams = [(name, rules) for name, rules in self.delivery.sequencer.standing().items()]
        return self.hits, self.node.stopped, self.answers, self.said, streams, self.admission.passed


@dataclass
class Findings:
    """What came of a run. executed: commands that were carried out and should not have been; differing: rounds after
    which the robot and its twin were not alike. memory: MB after a tenth of the run, and at the end."""

    datagrams: int = 0
    seconds: float = 0.0
    ways: Counter[str] = field(default_factory=Counter)
    dropped: Counter[DropReason] = field(default_factory=Counter)
    overheard: int = 0
    nonsense: int = 0
    executed: int = 0
    differing: int = 0
    uncounted: int = 0
    legitimate: int = 0
    memory: tuple[float, float] = (0.0, 0.0)

    def bars(self) -> list[Bar]:
        grown = self.memory[1] - self.memory[0]
        return [
            Bar("forged commands executed", self.executed, 0, "", at_least=False),
            Bar("rounds after which robot and twin differ", self.differing, 0, "", at_least=False),
            Bar("datagrams not in exactly one counter", abs(self.uncounted), 0, "", at_least=False),
            Bar("memory grown", grown, GROWTH, "MB", at_least=False),
        ]

    def to_dict(self) -> Json:
        counts = {"ways": dict(self.ways), "dropped": {str(reason): n for reason, n in self.dropped.items()}}
        plain = asdict(replace(self, ways=Counter(), dropped=Counter()))
        return {**plain, **counts, "bars": [bar.to_dict() for bar in self.bars()]}


class Fuzzer:
    """The three robots, the operator and the attacker. seed: what chance depends on."""

    def __init__(self, seed: int) -> None:
        chance = self._chance = Random(seed)
        self.clock = ManualClock(1_800_000_000.0)

        def pair(owner: str, role: Role) -> KeyPair:
            return KeyPair(owner, role, chance.randbytes(32))

        desk, robots = pair("desk", Role.COMMANDER), pair("r*", Role.ROBOT)
        observer, revoked = pair("guest", Role.OBSERVER), pair("gone", Role.COMMANDER)
        trust = Trust((desk.public, robots.public, observer.public, revoked.public))
        trust.revoke("gone")
        self.desk = ReliableDelivery("desk", 1, desk, Admission(trust, FLEET, self.clock, robot=False), Random(seed))
        self.robot, self.twin = (Robot("r1", trust, robots, self.clock, seed) for _ in range(2))
        self.insulted = Robot("r2", trust, robots, self.clock, seed)
        self.attacker = Attacker(FLEET, pair("desk", Role.COMMANDER), revoked, observer, desk, chance)
        self.findings = Findings()
        self._rounds = 0

    def round(self, datagrams: int) -> None:
        """What the operator says, and then so many datagrams of the attacker."""
        self._operate()
        ticks = round(SPELL / TICK)
        ways = tuple(self.attacker.ways)
        for tick in range(ticks):
            self._advance()
            for _ in range(datagrams * (tick + 1) // ticks - datagrams * tick // ticks):
                way = self._chance.choice(ways)
                self.findings.ways[way] += 1
                self.robot.hear(self.attacker(way))
            if tick % (ticks // 100) == 0:
                for _ in range(NONSENSE):
                    self.insulted.hear(self.attacker.nonsense())
                    self.findings.nonsense += 1
        for _ in range(round(CALM / TICK)):
            self._advance()
        self._compare()

    def _operate(self) -> None:
        """A commander's evening in short: a command, a long one, a rule, a question, STOP and RELEASE."""
        now = self.clock.now
        self._rounds += 1
        self.desk.post(Kind.COMMAND, now(), text="(SETQ hits (+ hits 1))")
        self.desk.post(Kind.COMMAND, now(), text=LONG)
        self.desk.post(Kind.COMMAND, now(), text=f"(RULE r{self._rounds % 9} {self._rounds})", standing=True)
        self.desk.post(Kind.ASK, now(), text="hits")
        self.desk.post(Kind.STOP, now())
        self.desk.post(Kind.RELEASE, now())
        for _ in range(round(SAID / TICK)):
            self._advance()
        self.attacker.recorded += self.robot.said[-KEPT // 4 :]
        self.attacker.recorded = self.attacker.recorded[-KEPT:]

    def _advance(self) -> None:
        self.clock.advance(TICK)
        self.attacker.now = self.clock.now()
        for datagram in self.desk.step(self.clock.now())[0]:
            self.attacker.recorded.append(datagram)
            for robot in (self.robot, self.twin, self.insulted):
                robot.hear(datagram)
        for robot in (self.robot, self.twin, self.insulted):
            robot.think()

    def _compare(self) -> None:
        found = self.findings
        found.legitimate = self._rounds
        found.differing += self.robot.state() != self.twin.state()
        found.executed = int(sum(abs(robot.hits - 2 * self._rounds) for robot in (self.robot, self.insulted)))
        found.uncounted = self.robot.uncounted + self.insulted.uncounted
        found.dropped, found.overheard = self.robot.admission.counts, self.robot.delivery.overheard


def fuzz(datagrams: int, seed: int, *, quiet: bool) -> Findings:
    """So many datagrams of the attacker, in rounds."""
    fuzzer, began = Fuzzer(seed), time.perf_counter()
    rounds = -(-datagrams // ROUND)
    early = resident()
    for number in steps(rounds, "forged datagrams", quiet=quiet):
        fuzzer.round(min(ROUND, datagrams - number * ROUND))
        if number == rounds // 10:
            early = resident()
    found = fuzzer.findings
    found.datagrams, found.seconds = sum(found.ways.values()), time.perf_counter() - began
    found.memory = early, resident()
    return found


def resident() -> float:
    """MB of memory that this process has; 0 where the system does not tell."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next(float(line.split()[1]) / 1e3 for line in lines if line.startswith("VmRSS"))


def show(found: Findings) -> str:
    rows = [[way, f"{count:,}"] for way, count in found.ways.items()]
    rows.append(["an observer's, well signed and badly said", f"{found.nonsense:,}"])
    dropped = [[f"dropped: {reason}", f"{count:,}"] for reason, count in sorted(found.dropped.items())]
    dropped.append(["known to the byte already", f"{found.overheard:,}"])
    return "\n\n".join(
        (table(["made by the attacker", "datagrams"], rows), table(["at the robot", "datagrams"], dropped))
    )


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.channel.fuzz", description=__doc__.split("\n")[0])
    parser.add_argument("--datagrams", type=int, default=DATAGRAMS, help="how many, 10,000,000 unless said otherwise")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    options = parser.parse_args()
    found = fuzz(options.datagrams, options.seed, quiet=options.json)
    if options.json:
        print(json.dumps({"machine": machine(), **found.to_dict()}))
    else:
        rate = found.datagrams / found.seconds
        print(f"{described(machine())}\n\n{show(found)}\n")
        print(f"{found.datagrams:,} datagrams in {found.seconds:,.0f} s, {rate:,.0f} a second, making them included")
        print("\n".join(bar.text for bar in found.bars()))
    return 0 if all(bar.met for bar in found.bars()) else 1


if __name__ == "__main__":
    sys.exit(main())
