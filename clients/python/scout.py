"""What the programs for Scouts have in common: their options, how they begin, and how a Scout wanders."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from contextlib import suppress

from sleepcast.core.errors import SleepcastError
from sleepcast.nomad.client import Nomad, State

NEAR, CLOSE = 15, 8
"""Inches: go slowly and turn away; do not go on at all."""
CRUISE, CREEP = 75, 15
"""1/10 in/s."""
TURN_AWAY, TURN_IN_PLACE = 320, 340
"""1/10 deg/s."""
FRONT = (12, 13, 14, 15, 0, 1, 2, 3, 4)
"""Sonars that look forwards or to a side, from the right to the left."""


def options(said: str) -> argparse.ArgumentParser:
    """The options of every program for a Scout, those of the C programs; `said` tells what this one does."""
    parser = argparse.ArgumentParser(description=said, add_help=False)
    parser.add_argument("--help", action="help", help="show this and exit")
    parser.add_argument("-h", "--host", default="127.0.0.1", help="where the server is (%(default)s)")
    parser.add_argument("-p", "--port", type=whole(1, 65_535), default=7019, help="... and its port (%(default)s)")
    parser.add_argument("-r", "--robot", type=whole(1, 100_000), default=1, help="the robot's number (%(default)s)")
    parser.add_argument("-f", "--rate", type=whole(0, 255), default=1, help="4 ms between sonars (%(default)s)")
    parser.add_argument("-w", "--pause", type=whole(0, 1000), default=20, help="ms between two looks (%(default)s)")
    parser.add_argument("-n", "--loops", type=whole(0, 10**9), default=0, help="end after so many looks; 0: never")
    return parser


def whole(least: int, most: int) -> Callable[[str], int]:
    """Reads a whole number between two others."""

    def read(word: str) -> int:
        number = int(word)
        if not least <= number <= most:
            raise argparse.ArgumentTypeError(f"{number} is no whole number from {least} to {most}")
        return number

    read.__name__ = "whole number"  # argparse says so for a word that is none
    return read


def begin(given: argparse.Namespace) -> Nomad:
    """Take over the robot; its server is to stop it a second after this program has gone."""
    nomad = Nomad.connect(given.host, given.port, robot=given.robot)
    nomad.conf_tm(1)
    nomad.conf_sn(given.rate)
    return nomad


def nearest_front(state: State) -> int:
    """Inches to the nearest thing before a Scout."""
    return min(state.sonar_inches[number] for number in FRONT)


def wander(nomad: Nomad) -> State:
    """Straight on where it is clear, else to the left: who chooses the freer side each time trembles in a corner."""
    inches = nearest_front(nomad.state)
    if inches < CLOSE:
        return nomad.scout_vm(0, TURN_IN_PLACE)
    return nomad.scout_vm(CREEP, TURN_AWAY) if inches < NEAR else nomad.scout_vm(CRUISE, 0)


def run(program: Callable[[], None]) -> None:
    """Run a program until it ends, Ctrl-C included; what goes wrong is a sentence."""
    with suppress(KeyboardInterrupt):
        try:
            program()
        except SleepcastError as error:
            print(error, file=sys.stderr)
            sys.exit(error.exit_status)
