"""Somebody with an observer's key who asks as fast as it allows, until he is ended or his time is over.

    python -m benchmarks.channel.asker URI SORT SECONDS

SORT: `burst`, 200 questions of 2.5 kB in one second and then none; `steady`, 125 of 1 kB in each second. Each question
differs from all others, has a good signature, and is as dear to check and evaluate as its length allows. At the end he
prints, as JSON, how many he has asked and in how many seconds.
"""

from __future__ import annotations

import json
import signal
import sys
import time

from sleepcast.api.connection import FLEET
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Role
from sleepcast.channel.transports.udp import UdpTransport
from sleepcast.core.clock import epoch_at

GUEST = KeyPair("guest", Role.OBSERVER, b"g" * 32)
"""His key: whoever tries this has to trust it."""
BURST, BURST_BYTES = 200, 2_500
"""Questions in the one second, and bytes of each."""
STEADY, STEADY_BYTES = 125, 1_000
"""Questions in each second, and bytes of each."""
TERMS = 10
"""Products in each sum of a question."""
GOOD = 5.0
"""Seconds for which a question is good."""


def question(number: int, size: int) -> str:
    """A question of about so many bytes, like no other."""
    sums: list[str] = []
    while len(f"(+ {' '.join(sums)})") < size:
        terms = " ".join(f"(* id {number}.{len(sums)}{place})" for place in range(TERMS))
        sums.append(f"(+ {terms})")
    return f"(+ {' '.join(sums)})"


def main() -> None:
    uri, sort, seconds = sys.argv[1:]
    count, size = (BURST, BURST_BYTES) if sort == "burst" else (STEADY, STEADY_BYTES)
    going = True

    def end(*_: object) -> None:
        nonlocal going
        going = False

    signal.signal(signal.SIGTERM, end)
    mouth, sent, epoch = UdpTransport(uri), 0, epoch_at(time.time())
    mouth.ignore(Kind)
    print("ready", flush=True)
    began = time.monotonic()
    while going and (passed := time.monotonic() - began) < float(seconds):
        if sent >= passed * count or (sort == "burst" and sent >= count):
            time.sleep(0.001)
            continue
        now, sent = time.time(), sent + 1
        asked = Message("guest", epoch, sent, Kind.ASK, now, now + GOOD, question(sent, size))
        for datagram in encode(asked, FLEET, GUEST):
            mouth.send(datagram)
    print(json.dumps({"sent": sent, "seconds": time.monotonic() - began}), flush=True)


if __name__ == "__main__":
    main()
