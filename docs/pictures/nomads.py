"""The picture of the Nomads' page: two Scouts that wander through a room for some minutes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

from sleepcast.nomad.client import Nomad, NomadError

ROOM = """\
4 -1400 -1100 1400 -1100 1400 -1060 -1400 -1060
4 -1400 1060 1400 1060 1400 1100 -1400 1100
4 -1400 -1060 -1360 -1060 -1360 1060 -1400 1060
4 1360 -1060 1400 -1060 1400 1060 1360 1060
4 300 200 650 240 600 560 330 600
3 -800 -500 -420 -620 -400 -330
4 -900 300 -500 300 -500 420 -900 420
"""
NEAR = 20
"""Inches at which a Scout turns away."""
FAST, BEND, TURN = 150, 6, 80
"""Tenths of an inch a second: of both wheels, of what the left one lacks, and of both for turning."""
AWAY = 100
"""Tenths of an inch that it goes back from what it has touched."""
ROBOTS, SPEED = 2, 8


def arguments(folder: Path) -> list[str | Path]:
    """What starts a server of two noisy Scouts in a room."""
    room = folder / "laboratory.txt"
    room.write_text(ROOM)
    options = ["--setup", "noisy", "--robots", str(ROBOTS), "--speed", str(SPEED), "--page-port", "0"]
    return ["nserver", room, *options]


@contextmanager
def wandering(said: str) -> Iterator[None]:
    """Each robot of the server that has said where it is wanders, driven by a program of its own."""
    found = re.search(r"port (\d+)", said)
    if found is None:
        raise SystemExit("the server has not said its port")
    enough = Event()
    programs = [Thread(target=_wander, args=(int(found[1]), robot + 1, enough)) for robot in range(ROBOTS)]
    for program in programs:
        program.start()
    try:
        yield
    finally:
        enough.set()
        for program in programs:
            program.join()


def _wander(port: int, robot: int, enough: Event) -> None:
    with suppress(NomadError), Nomad.connect(port=port, robot=robot) as nomad:
        nomad.conf_sn(1)
        state = nomad.gs()
        while not enough.wait(0.02):
            if state.bumper:
                nomad.tk("Ouch.")
                nomad.pr(-AWAY, -AWAY + robot * AWAY // 4)
                state = nomad.ws(True, True, seconds=5)
            ahead = min(state.sonar_inches[sonar] for sonar in (0, 1, 15))
            state = nomad.vm(-TURN, TURN) if ahead < NEAR else nomad.vm(FAST, FAST - robot * BEND)
