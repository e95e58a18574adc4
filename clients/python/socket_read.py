"""Print the numbers of every datagram that comes."""

from __future__ import annotations

import argparse
import sys
from select import select

from places import READER, line
from scout import run, whole

from sleepcast.channel.plain_datagrams import Datagrams


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("port", nargs="?", type=whole(1, 65_535), default=READER, help="where to listen (%(default)s)")
    parser.add_argument("count", nargs="?", type=whole(0, 10**9), default=0, help="end after so many; 0: never")
    parser.add_argument("--listen", default="127.0.0.1", help="the address to listen at (%(default)s)")
    given = parser.parse_args()
    heard = 0
    with Datagrams(given.listen, given.port) as ears:
        print(f"Listening at port {ears.port}.", file=sys.stderr, flush=True)
        while not given.count or heard < given.count:
            select([ears], [], [])
            for numbers in ears.receive():
                print(line(numbers), flush=True)
                heard += 1


if __name__ == "__main__":
    run(main)
