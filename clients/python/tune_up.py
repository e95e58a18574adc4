"""A Scout goes about and touches nothing.

The program of 1998 that this one follows was printed with a mistake: it looked for things nearer than 10 in an array of
ranges that it never filled, found one every time, and turned on the spot for ever. Here the sonars decide.
"""

from __future__ import annotations

import time
from itertools import count

from scout import begin, options, run, wander

from sleepcast.nomad.client import Nomad


def main() -> None:
    given = options(__doc__ or "").parse_args()
    touched = 0
    with begin(given) as nomad:
        come_home(nomad)
        for _ in range(given.loops) if given.loops else count():
            if wander(nomad).bumper:
                touched += 1
                back_off(nomad)
            time.sleep(given.pause / 1000.0)
        x, y = nomad.state.words[34:36]
        print(f"robot {given.robot} is at {x}, {y}; it touched something {touched} times", flush=True)


def come_home(nomad: Nomad) -> None:
    """Be at home by its encoders, and where it was by the world."""
    x, y = nomad.state.words[34:36]
    nomad.zr()
    nomad.ws(True, True, True, 20)
    nomad.place_robot(x, y, 0, 0)


def back_off(nomad: Nomad) -> None:
    nomad.st()
    nomad.tk("Ouch.")
    for way, turn in ((-60, 0), (0, 900)):
        nomad.scout_pr(way, turn)
        nomad.ws(True, True, False, 5)


if __name__ == "__main__":
    run(main)
