"""Send what is typed, three numbers a line, and print what comes, until the input ends."""

from __future__ import annotations

import argparse
import os
import sys
from select import select

from places import READER, ROB1, line
from scout import run, whole

from sleepcast.channel.plain_datagrams import Datagrams, send
from sleepcast.core.errors import SleepcastError

LONGEST_LINE = 256
"""Bytes."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("host", nargs="?", default="127.0.0.1", help="to whom (%(default)s)")
    parser.add_argument("port", nargs="?", type=whole(1, 65_535), default=ROB1, help="... at which port (%(default)s)")
    parser.add_argument("own", nargs="?", type=whole(1, 65_535), default=READER, help="where to listen (%(default)s)")
    given = parser.parse_args()
    typed, rest = sys.stdin.fileno(), b""
    with Datagrams("127.0.0.1", given.own) as ears:
        to = f"{given.host}, port {given.port}"
        print(
            f"Three numbers a line go to {to}; what comes to port {ears.port} is printed.", file=sys.stderr, flush=True
        )
        while True:
            ready, _, _ = select([typed, ears], [], [])
            for numbers in ears.receive():
                print(line(numbers), flush=True)
            if typed not in ready:
                continue
            data = os.read(typed, LONGEST_LINE)
            *lines, rest = (rest + data).split(b"\n")
            for words in lines if data else [rest]:
                send_line(words.split(), (given.host, given.port))
            if not data:
                return
            if len(rest) > LONGEST_LINE:
                print("That line is too long.", file=sys.stderr)
                rest = b""


def send_line(words: list[bytes], place: tuple[str, int]) -> None:
    """Send a line's numbers; empty lines are none."""
    if not words:
        return
    try:
        send([float(word) for word in words], place)
        print("sent", file=sys.stderr, flush=True)
    except ValueError:
        print("Three numbers make a datagram.", file=sys.stderr, flush=True)
    except SleepcastError as error:
        print(error, file=sys.stderr, flush=True)


if __name__ == "__main__":
    run(main)
