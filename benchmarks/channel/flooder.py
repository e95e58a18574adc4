"""Somebody who sends forgeries, as many a second as he can or was told, until he is ended or his time is over.

    python -m benchmarks.channel.flooder URI KEY KIND RATE SECONDS

He has the operator's key id (KEY, in hexadecimal digits), which everybody knows, and not his key. Each datagram of KIND
(stop, command, ...; `parts`: of commands in 96 parts) is as a real one but for the signature, so it is as dear to check
as it gets; they are made beforehand and differ from each other. At the end he prints, as JSON, how many he has sent and
in how many seconds.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from random import Random

from sleepcast.api.connection import FLEET
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import HEAD, encode
from sleepcast.channel.keys import ID_BYTES, KeyPair
from sleepcast.channel.message import MAX_TEXT, Role
from sleepcast.channel.transports.udp import UdpTransport

MADE = 4_096
"""Datagrams that differ."""
AT_ONCE = 16
"""Datagrams between two looks at the clock."""
GOOD = 600.0
"""Seconds for which they seem to be in time."""
PARTS = "parts"
TEXTS = {PARTS: "\N{SNOWMAN}" * MAX_TEXT, "command": "(SETQ drive_speed 1)"}
"""What those say that say something."""


def forged(owner: str, key: bytes, kind: str, count: int) -> list[bytes]:
    """So many datagrams that only look as if they were of the key with this id."""
    chance, own, now = Random(1), KeyPair(owner, Role.COMMANDER, b"f" * 32), time.time()
    found: list[bytes] = []
    while len(found) < count:
        text = TEXTS.get(kind, "")
        message = Message(
            owner,
            chance.randrange(1, 2**40),
            chance.randrange(1, 2**40),
            Kind.COMMAND if kind == PARTS else Kind(kind),
            now,
            now + GOOD,
            text,
            body={"within": 0.1},
        )
        found += encode(message, FLEET, own)
    at = len(HEAD)
    return [each[:at] + key + each[at + ID_BYTES :] for each in found[:count]]


def main() -> None:
    uri, key, kind, rate, seconds = sys.argv[1:]
    going = True

    def end(*_: object) -> None:
        nonlocal going
        going = False

    signal.signal(signal.SIGTERM, end)
    made, mouth, sent = forged("desk", bytes.fromhex(key), kind, MADE), UdpTransport(uri), 0
    mouth.ignore(Kind)
    print("ready", flush=True)
    began = time.monotonic()
    while going and (passed := time.monotonic() - began) < float(seconds):
        if sent >= passed * float(rate):
            time.sleep(0.0002)
            continue
        for _ in range(AT_ONCE):
            mouth.send(made[sent % MADE])
            sent += 1
    print(json.dumps({"sent": sent - mouth.lost, "seconds": time.monotonic() - began}), flush=True)


if __name__ == "__main__":
    main()
