"""What a datagram costs a robot that drops it, by the reason: processor time of one call from bytes to nothing.

Every datagram is another one, so that nothing that was read before helps, as an attacker would have it; those that are
replayed have all come before. Robots look at so many signatures of a key in a second and not at more: what a signature
costs (`forged`) is met at that rate at most, and the flood is dropped at the price of `too many`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from random import Random
from statistics import median

from benchmarks.channel.proofs import Proof
from benchmarks.report import Bar, number
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.drops import DropReason
from sleepcast.channel.envelope import FIXED, MAX_DATAGRAM, PAYLOAD_AT, encode
from sleepcast.channel.keys import KeyChange, KeyPair, Trust
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.core.clock import ManualClock

NOW = 1_000.0
FLEET = "field"
ANNA, WATCH, THIEF, ROBOTS, STRANGER = (
    KeyPair(owner, role, owner[:1].encode() * 32)
    for owner, role in (
        ("anna", Role.OPERATOR),
        ("watch", Role.OBSERVER),
        ("thief", Role.OPERATOR),
        ("r*", Role.ROBOT),
        ("stranger", Role.COMMANDER),
    )
)
BAR = 20.0
"""Microseconds that nonsense and strangers may cost, at the median."""
CHEAP = (DropReason.MALFORMED, DropReason.UNKNOWN_KEY)
SEQUENCE_AT = PAYLOAD_AT + 13


def robot(rate: float) -> ReliableDelivery:
    """A robot that looks at so many signatures a second. Its clock stands still."""
    trust = Trust(key.public for key in (ANNA, WATCH, THIEF, ROBOTS))
    trust.take(KeyChange(revoke=frozenset((THIEF.id,))))
    admission = Admission(trust, FLEET, ManualClock(NOW), robot=True, rate=rate)
    return ReliableDelivery("r1", 1, ROBOTS, admission, Random(0))


def said(key: KeyPair, kind: Kind, *, at: float = 0.0, fleet: str = FLEET, number: int = 1) -> bytes:
    """A message of this key, issued `at` s from now."""
    sender = key.public.owner.replace("*", "2")
    text = "(WHEN (> front_range 1m) (VM 0.2m/s 0.2m/s))" if kind is Kind.COMMAND else ""
    (datagram,) = encode(Message(sender, 1, number, kind, NOW + at, NOW + at + 5.0, text), fleet, key)
    return datagram


def numbered(datagram: bytes, count: int) -> list[bytes]:
    """The same with other numbers, which its signature is not of."""
    head, tail = datagram[:SEQUENCE_AT], datagram[SEQUENCE_AT + 8 :]
    return [head + each.to_bytes(8, "big") + tail for each in range(2, count + 2)]


def nonsense(count: int, chance: Random) -> list[bytes]:
    """Datagrams that are none: noise of every length, and messages that lost a byte or had one changed."""
    whole = said(ANNA, Kind.COMMAND)
    found = []
    for turn in range(count):
        at = chance.randrange(PAYLOAD_AT, PAYLOAD_AT + FIXED.size)
        sorts = (
            chance.randbytes(chance.randrange(MAX_DATAGRAM)),
            whole[: chance.randrange(len(whole))],
            whole[:at] + b"\xff" + whole[at:],
        )
        found.append(sorts[turn % len(sorts)])
    return found


def made(count: int, chance: Random) -> dict[DropReason, list[bytes]]:
    """Datagrams that are dropped, by the reason."""
    return {
        DropReason.MALFORMED: nonsense(count, chance),
        DropReason.UNKNOWN_KEY: numbered(said(STRANGER, Kind.COMMAND), count),
        DropReason.REVOKED: numbered(said(THIEF, Kind.COMMAND), count),
        DropReason.NOT_ALLOWED: numbered(said(WATCH, Kind.COMMAND), count),
        DropReason.NOT_FOR_US: numbered(said(ROBOTS, Kind.ANSWER), count),
        DropReason.LATE: [said(ANNA, Kind.COMMAND, at=-60.0, number=each) for each in range(1, count + 1)],
        DropReason.EARLY: [said(ANNA, Kind.COMMAND, at=60.0, number=each) for each in range(1, count + 1)],
        DropReason.REPEATED: [said(ANNA, Kind.ASK, number=each) for each in range(1, count + 1)],
        DropReason.TOO_MANY: numbered(said(ANNA, Kind.COMMAND), count),
        DropReason.FORGED: numbered(said(ANNA, Kind.COMMAND), count),
        DropReason.OTHER_FLEET: [said(ANNA, Kind.COMMAND, fleet="sea", number=each) for each in range(1, count + 1)],
    }


def costs(delivery: ReliableDelivery, datagrams: Iterable[bytes]) -> list[float]:
    """Microseconds of processor time that each took."""
    found, clock = [], time.thread_time_ns
    for datagram in datagrams:
        begin = clock()
        delivery.take(datagram, NOW)
        found.append((clock() - begin) / 1_000.0)
    return found


def drops(count: int) -> Proof:
    """`count` datagrams for each reason."""
    rows: list[Sequence[str]] = []
    bars = []
    before: dict[DropReason, Callable[[ReliableDelivery, list[bytes]], object]] = {
        DropReason.REPEATED: lambda delivery, all_of_them: [delivery.take(datagram, NOW) for datagram in all_of_them],
        DropReason.TOO_MANY: lambda delivery, _: [
            delivery.take(each, NOW) for each in numbered(said(ANNA, Kind.ASK), 2)
        ],
    }
    for reason, datagrams in made(count, Random(1)).items():
        delivery = robot(1.0 if reason is DropReason.TOO_MANY else 1e12)
        before.get(reason, lambda delivery, _: None)(delivery, datagrams)
        delivery.admission.counts.clear()
        took = sorted(costs(delivery, datagrams))
        if delivery.admission.counts != {reason: count}:
            raise RuntimeError(f"meant to be dropped as {reason}: {dict(delivery.admission.counts)}")
        middle = median(took)
        rows.append([str(reason), number(middle), number(took[int(0.99 * count)]), number(1e6 * count / sum(took))])
        if reason in CHEAP:
            bars.append(Bar(f"a datagram dropped as {reason}, median", middle, BAR, "us", at_least=False))
    heads = ["dropped as", "median, us", "99th percentile, us", "a second, one core"]
    return Proof("drops", heads, rows, bars, f"{count:,} datagrams for each reason, each another one.")
