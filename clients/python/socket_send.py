"""Send three numbers to one program."""

from __future__ import annotations

import argparse

from places import ROB1, numbers
from scout import run, whole

from sleepcast.channel.plain_datagrams import send


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    numbers(parser)
    parser.add_argument("host", nargs="?", default="127.0.0.1", help="to whom (%(default)s)")
    parser.add_argument("port", nargs="?", type=whole(1, 65_535), default=ROB1, help="... at which port (%(default)s)")
    given = parser.parse_args()
    send(given.numbers, (given.host, given.port))


if __name__ == "__main__":
    run(main)
