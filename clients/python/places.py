"""What the programs for datagrams have in common: numbers and places as people write them."""

from __future__ import annotations

import argparse

from scout import whole

ROB1, ROB2, READER = 5001, 5002, 4000
"""Ports at which the programs listen."""


def place(word: str) -> tuple[str, int]:
    """The host and the port of HOST:PORT or PORT."""
    host, _, port = word.rpartition(":")
    return host or "127.0.0.1", whole(1, 65_535)(port)


def numbers(parser: argparse.ArgumentParser) -> None:
    """Three numbers as arguments; those below 0 are no options."""
    parser.add_argument("numbers", type=float, nargs=3, metavar="NUMBER", help="what to say")


def line(given: tuple[float, float, float]) -> str:
    """Three numbers as they are printed."""
    return " ".join(f"{number:12.2f}" for number in given)
