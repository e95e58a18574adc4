"""How many bytes somebody makes a robot send for each of his own: with what he has recorded, and with a key of his own.

Questions are in `questioned`. Here one robot keeps many standing commands, long ones among them. An attacker has it
hear requests and digests, in simulated time, as fast as a radio carries them: such as he has recorded of another robot,
played again and again; and new ones, well signed with an observer's key, which is the least of those that may ask for
repairs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from random import Random

from benchmarks.channel.proofs import Proof
from benchmarks.channel.questioned import QUESTIONS, questioned, timed
from benchmarks.report import Bar, number
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import BATCH, REPAIR_RATE, ReliableDelivery
from sleepcast.core.clock import ManualClock

FLEET = "lab"
COMMANDS = 120
"""Standing commands that the robot keeps."""
LONG = "(SETQQ e1 1) ; " + "in many parts " * 1_100
RATE = 150
"""Datagrams of the attacker in a second: fewer than the robot looks at of one key."""
AT_ONCE = REPAIR_RATE + 75_000.0
"""Bytes that may go at once: those of a second, and what is left of the longest command."""
SIZES = (1, 60)
"""Robots of one process that are asked."""
LONGEST = 20.0
"""Seconds for which they are asked at most."""
TICK = 0.01
START = 1_800_000_000.0
DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
GUEST = KeyPair("guest", Role.OBSERVER, b"g" * 32)


@dataclass
class Spent:
    """Bytes that the attacker sent, and that the robot sent, in so many seconds."""

    given: int = 0
    said: int = 0
    seconds: float = 0.0

    @property
    def ratio(self) -> float:
        return self.said / self.given


def attacked(sort: str, seconds: float) -> Spent:
    """What became of an attack of this sort: "replayed" or "new", with a kind of message behind it."""
    clock, found = ManualClock(START), Spent()
    trust = Trust(key.public for key in (DESK, ROBOTS, GUEST))
    desk = ReliableDelivery("desk", 1, DESK, Admission(trust, FLEET, clock, robot=False), Random(1))
    robot = ReliableDelivery("r1", 1, ROBOTS, Admission(trust, FLEET, clock, robot=True), Random(2))
    for place in range(COMMANDS):
        text = LONG if place % 4 == 0 else f"(RULE r{place % 9} {place})"
        desk.post(Kind.COMMAND, clock.now(), text=text, standing=True)
        for datagram in desk.posted():
            robot.take(datagram, clock.now())
        clock.advance(0.1)  # as many as a robot looks at
    robot.step(clock.now())
    coming, due = datagrams(sort, clock), 0.0
    for _ in range(round(seconds / TICK)):
        clock.advance(TICK)
        due += RATE * TICK
        while due >= 1.0:
            due -= 1.0
            datagram = next(coming)
            found.given += len(datagram)
            robot.take(datagram, clock.now())
        found.said += sum(map(len, robot.step(clock.now())[0]))
    found.seconds = seconds
    return found


def datagrams(sort: str, clock: ManualClock) -> Iterator[bytes]:
    """What the attacker has the robot hear, one after the other."""
    when, kind = sort.split()
    key, sender = (ROBOTS, "r2") if when == "replayed" else (GUEST, "guest")
    chance, recorded = Random(3), b""
    for sequence in count(1):
        now = clock.now()
        wanted = chance.sample(range(1, COMMANDS + 1), BATCH)
        body: dict[str, object] = {"want": [[DESK.id, 1, wanted]]} if kind == "request" else {"have": []}
        message = Message(sender, 1, sequence, Kind(kind), now, now + 5.0, body=body)
        if when == "new" or not recorded:
            recorded = encode(message, FLEET, key)[0]
        yield recorded


def amplification(seconds: float) -> Proof:
    """Each attack for so many s: requests and digests, and each kind of question to one robot and to a swarm."""
    rows: list[Sequence[str]] = []
    bars: list[Bar] = []
    for sort in ("replayed request", "replayed digest", "new request", "new digest"):
        found = attacked(sort, seconds)
        bound = AT_ONCE + (0.0 if sort.startswith("replayed") else REPAIR_RATE * seconds)
        rows.append([sort, "1", *map(number, _figures(found.given, found.said, bound)), "", ""])
        if sort.startswith("replayed"):
            bars.append(Bar(f"{sort}s: bytes out for each byte in", found.ratio, 1.0, "", at_least=False))
        else:
            rate = (found.said - AT_ONCE) / found.seconds
            bars.append(Bar(f"{sort}s: bytes out a second", rate / 1e3, REPAIR_RATE / 1e3, "kB", at_least=False))
    asked = {(kind, robots): questioned(kind, robots, min(seconds, LONGEST)) for robots in SIZES for kind in QUESTIONS}
    for (kind, robots), each in (*asked.items(), (("time, to a desk", 1), timed(min(seconds, LONGEST)))):
        alone = number(each.first_said / each.first_given)
        figures = map(number, _figures(each.given, each.said, each.bound))
        rows.append([kind, str(robots), *figures, alone, f"{each.held_back:,}"])
        bars.append(Bar(f"{kind}, {robots} robots: kB out", each.said / 1e3, each.bound / 1e3, "kB", at_least=False))
    heads = [
        "kind",
        "robots",
        "kB in",
        "kB out",
        "factor",
        "bound, kB",
        "bound, factor",
        "the first alone",
        "held back",
    ]
    note = (
        f"{RATE} datagrams a second, requests and digests for {seconds:g} s, others for {min(seconds, LONGEST):g} s; "
        "new ones are signed with an observer's key, leases with an operator's; held back: counted, and told"
    )
    return Proof("amplification", heads, rows, bars, note)


def _figures(given: float, said: float, bound: float) -> tuple[float, ...]:
    return given / 1e3, said / 1e3, said / given, bound / 1e3, bound / given
