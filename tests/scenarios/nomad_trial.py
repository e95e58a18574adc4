"""Runs of `stop` behind `sleepcast nserver`: programs drive the robots, and one more client watches.

The server is a process of its own and goes in lockstep, so a run is as fast as its programs. The watcher is a client
as well: it puts the robots where the seed wants them, asks at every tick where all of them are, has the order sent when
the way is clear, and measures with the ruler of `stopping`.
"""

from __future__ import annotations

import json
import random
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from math import hypot, pi
from pathlib import Path

import forkserver
from scenarios.stopping import CLEAR, SCENARIO, Outcome, Pose, Stop, distance, ruler
from sleepcast.nomad.client.nomad import Nomad
from sleepcast.nomad.client.nomad import Pose as Place
from sleepcast.nomad.wire.units import metres, radians

LONGEST, LONGEST_TRIAL = 60.0, 300.0
"""Seconds on the wall that a busy machine is given for any one step, and for a whole trial."""
STARTING = 0.1
"""Seconds on the wall that programs are left alone in while they start."""
SETTLED, PATIENCE = 10.0, 1200.0
"""Simulated seconds of wandering before the order, and after it in which everybody should have stopped."""
TICK = 0.02
LOOK = 25
"""Ticks between two looks at who moves: who has not moved in one stands."""
STILL = 0.004
"""m or rad by which the wire's words may differ for one and the same pose."""
ORIGIN = SCENARIO.width / 2, SCENARIO.height / 2
"""Where a Nomad's 0, 0 lies in the scenario's frame."""
ROBOTS = 2

PATIENT = f"""
import sys
from sleepcast.cli import main
from sleepcast.nomad.server import nserver

nserver.PATIENCE = {LONGEST}
sys.exit(main(sys.argv[1:]))
"""
"""`sleepcast` on a busy machine, where a program may be slow to ask."""

Program = Sequence[str | Path]


def free_ports() -> list[int]:
    """Ports at which nobody hears datagrams, one for each robot."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(ROBOTS)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


@contextmanager
def started(program: Program) -> Iterator[subprocess.Popen[str]]:
    """A process that ends with the block."""
    with forkserver.Popen(program, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(LONGEST)
            finally:
                process.kill()


@contextmanager
def server(*options: str) -> Iterator[int]:
    """`sleepcast nserver` with the scenario's world, patient with whoever does not ask; gives its port."""
    command = [sys.executable, "-c", PATIENT, "nserver", SCENARIO.path, "--robots", str(ROBOTS)]
    with started([*command, "--headless", "--lockstep", "--port", "0", "--json", *options]) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line, f"nserver ended with {process.wait(LONGEST)}"
        yield int(json.loads(line)["port"])


def place(port: int, seed: int) -> None:
    """Put the robots where this seed wants them: in the scenario's strip, not too near to each other."""
    chance, (low, high), (bottom, top) = random.Random(seed), SCENARIO.robots.x, SCENARIO.robots.y
    heights = chance.sample([bottom, (bottom + top) / 2, top], ROBOTS)
    for robot, y in enumerate(heights, 1):
        x, heading = chance.uniform(low, high), chance.uniform(-pi, pi)
        with Nomad.connect(port=port, robot=robot) as nomad:  # one after the other, since each waits for all others
            nomad.place(Place(x - ORIGIN[0], y - ORIGIN[1], heading, heading))


class Watcher:
    """One client that sees all robots."""

    def __init__(self, nomad: Nomad) -> None:
        self._nomad, self._points = nomad, ruler(SCENARIO.shapes)
        self._deadline = time.monotonic() + LONGEST_TRIAL
        self.time = 0.0
        """Simulated s since it began to watch."""

    def look(self) -> list[Pose]:
        """Where all robots are after the next tick."""
        assert time.monotonic() < self._deadline, "a program hangs"
        self.time += TICK
        return [
            (metres(x) + ORIGIN[0], metres(y) + ORIGIN[1], radians(steering))
            for x, y, steering in self._nomad.get_rpx()
        ]

    def after(self, ticks: int) -> list[Pose]:
        """Where they are after so many ticks."""
        for _ in range(ticks - 1):
            self.look()
        return self.look()

    def distance(self, poses: list[Pose], robot: int) -> float:
        """How far a robot is from the nearest thing, m."""
        return distance(self._points, poses, robot)

    def clear(self, poses: list[Pose]) -> bool:
        """Whether nobody has anything near by."""
        return all(self.distance(poses, each) >= CLEAR for each in range(ROBOTS))


def standing(before: Pose, now: Pose) -> bool:
    turned = abs((now[2] - before[2] + pi) % (2 * pi) - pi)
    return hypot(now[0] - before[0], now[1] - before[1]) < STILL and turned < STILL


def trial(port: int, seed: int, programs: Sequence[Program], broadcast: Program) -> Outcome:
    """Let these programs, one for each robot, run at the server, and order them to stop when the way is clear."""
    with ExitStack() as stack:
        place(port, seed)
        nomad = Nomad.connect(port=port)
        watcher = Watcher(nomad)
        running = [stack.enter_context(started(program)) for program in programs]
        stack.callback(nomad.close)  # before them: they may ask once more, and would wait for it
        stood = 0
        before, poses = watcher.look(), watcher.after(LOOK)
        while any(map(standing, before, poses)):  # not all programs drive yet
            assert all(process.poll() is None for process in running), "a program ended before it drove"
            time.sleep(STARTING)
            before, poses = poses, watcher.after(LOOK)
        begun = watcher.time
        while watcher.time < begun + SETTLED or not watcher.clear(poses):
            before, poses = poses, watcher.after(LOOK)
            stood += sum(map(standing, before, poses))
        subprocess.run(broadcast, check=True, timeout=LONGEST)
        sent, stops = watcher.time, dict[int, Stop]()
        while len(stops) < ROBOTS and watcher.time < sent + PATIENCE:
            before, poses = poses, watcher.after(LOOK)
            for robot in set(range(ROBOTS)) - set(stops):
                if standing(before[robot], poses[robot]):
                    stops[robot] = Stop(watcher.time - sent, watcher.distance(poses, robot))
        moved = sum(hypot(a[0] - b[0], a[1] - b[1]) for a, b in zip(poses, watcher.after(500), strict=True))
        return Outcome(tuple(stop for _, stop in sorted(stops.items())), stood, moved)
