"""Send the same three numbers to several programs, one after the other."""

from __future__ import annotations

import argparse

from places import ROB1, ROB2, numbers, place
from scout import run

from sleepcast.channel.plain_datagrams import send


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    numbers(parser)
    both = [("127.0.0.1", ROB1), ("127.0.0.1", ROB2)]
    parser.add_argument("places", nargs="*", type=place, metavar="[HOST:]PORT", help=f"to whom ({ROB1} {ROB2})")
    given = parser.parse_args()
    send(given.numbers, *(given.places or both))


if __name__ == "__main__":
    run(main)
