"""Somebody with a trusted key who sends as much as it allows, until he is ended or his time is over.

    python -m benchmarks.channel.asker URI SORT SECONDS

SORT, one of `SORTS`: `burst`, 200 questions of 2.5 kB in one second and then none; the others go on. Each message
differs from all others, has a good signature, and is as dear to check and evaluate as its length allows. At the end he
prints, as JSON, how many he has sent and in how many seconds.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from math import inf
from typing import NamedTuple

from sleepcast.api.connection import FLEET
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import LOOK, Inspection, Predecessors, Role
from sleepcast.channel.transports.udp import UdpTransport
from sleepcast.core.clock import epoch_at

GUESTS = {
    role: KeyPair(f"guest-{role}", role, role.value.encode().ljust(32, b"g"))
    for role in (Role.OBSERVER, Role.COMMANDER, Role.ROBOT)
}
"""His keys: whoever tries this has to trust them."""


class Sort(NamedTuple):
    """Messages of one kind: of a key of this role, so many in a second and of about so many bytes. most: how many in
    all. look: what is asked in place of a text. standing: whether commands are standing."""

    told: str
    role: Role
    kind: Kind
    rate: float
    size: int = 0
    most: int = 10**9
    look: bool = False
    standing: bool = False


SORTS = {
    "burst": Sort("200 questions of 2.5 kB in 1 s", Role.OBSERVER, Kind.ASK, 200, 2_500, 200),
    "steady": Sort("125 questions a second of 1 kB", Role.OBSERVER, Kind.ASK, 125, 1_000),
    "short": Sort("200 short questions a second", Role.OBSERVER, Kind.ASK, 200, 1),
    "looks": Sort("200 looks a second", Role.OBSERVER, Kind.ASK, 200, look=True),
    "tells": Sort("125 TELLs a second of 1 kB", Role.ROBOT, Kind.COMMAND, 125, 1_000),
    "rules": Sort("60 standing commands a second of 1 kB", Role.COMMANDER, Kind.COMMAND, 60, 1_000, standing=True),
}
LOOKS = (Inspection.VOCABULARY, Inspection.MIND, Inspection.WHY, Inspection.TELEMETRY)
TERMS = 10
"""Products in each sum of a question."""
GOOD = 5.0
"""Seconds for which a question is good."""


def question(number: int, size: int) -> str:
    """A question of about so many bytes, like no other."""
    sums: list[str] = []
    while not sums or len(f"(+ {' '.join(sums)})") < size:
        terms = " ".join(f"(* id {number}.{len(sums)}{place})" for place in range(TERMS if size > 1 else 1))
        sums.append(f"(+ {terms})")
    return f"(+ {' '.join(sums)})"


def message(sort: Sort, epoch: int, number: int, now: float) -> Message:
    """The message of this number."""
    owner = GUESTS[sort.role].public.owner
    text = "" if sort.look else question(number, sort.size)
    body: dict[str, object] = {LOOK: LOOKS[number % len(LOOKS)]} if sort.look else {}
    if sort.standing:
        text = f"(RULE flood{number % 9} {text})"
    if sort.kind is Kind.COMMAND and sort.role is not Role.ROBOT:
        body |= Predecessors(number - 1, now, now + GOOD, number - 1 if sort.standing else 0).written()
    deadline = inf if sort.standing else now + GOOD
    return Message(owner, epoch, number, sort.kind, now, deadline, text, sort.standing, body)


def main() -> None:
    uri, name, seconds = sys.argv[1:]
    sort, going = SORTS[name], True

    def end(*_: object) -> None:
        nonlocal going
        going = False

    signal.signal(signal.SIGTERM, end)
    mouth, sent, epoch = UdpTransport(uri), 0, epoch_at(time.time())
    mouth.ignore(Kind)
    print("ready", flush=True)
    began = time.monotonic()
    while going and (passed := time.monotonic() - began) < float(seconds):
        if sent >= passed * sort.rate or sent >= sort.most:
            time.sleep(0.001)
            continue
        sent += 1
        for datagram in encode(message(sort, epoch, sent, time.time()), FLEET, GUESTS[sort.role]):
            mouth.send(datagram)
    print(json.dumps({"sent": sent, "seconds": time.monotonic() - began}), flush=True)


if __name__ == "__main__":
    main()
