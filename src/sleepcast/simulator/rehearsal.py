"""The first start of all: kernels are compiled by two processes at once.

Compiling is Python's work as much as LLVM's, and numba does it under one lock, so a second thread would not help. A
second process lets a few robots look around, and this one lets them move; each finds what the other has compiled where
kernels are kept. Whatever goes wrong there, nothing is lost but time: what nobody has compiled is compiled when it is
needed.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

from sleepcast.simulator.engine import choose, cores
from sleepcast.simulator.packing import pack, unpack
from sleepcast.simulator.scenario import Scenario
from sleepcast.simulator.simulation import Simulator

OTHER = f"from {__name__} import attend; attend()"
"""What the other process runs."""
PATIENCE = 60.0
"""Seconds that are waited for the other process: some times what it takes on a slow machine."""


def rehearse(scenario: Scenario) -> None:
    """Compile what the robots of a scenario need, if no kernel has ever been compiled and there are two cores for it.
    scenario: one with few robots."""
    machine = choose()
    if machine.name == "numpy" or cores() < 2 or not any(sort.ring for sort in scenario.each_sort):
        return
    from sleepcast.simulator.compiled import anything_kept

    if anything_kept():
        return
    empty = replace(scenario, shapes=(), absent=(), events=())
    blind = [replace(sort, ring=None) for sort in (empty.robots, *empty.sorts)]
    with suppress(OSError, subprocess.TimeoutExpired), _looking_around(empty) as other:
        Simulator(replace(empty, robots=blind[0], sorts=tuple(blind[1:])), machine=machine).step()
        other.wait(PATIENCE)


@contextmanager
def _looking_around(scenario: Scenario) -> Iterator[subprocess.Popen[bytes]]:
    """The other process, as long as it is wanted."""
    command, quiet = [sys.executable, "-P", "-c", OTHER], subprocess.DEVNULL  # -P: nothing of the folder we are in
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet) as other:
        try:
            assert other.stdin
            other.stdin.write(pack(scenario))
            other.stdin.close()
            yield other
        finally:
            other.kill()


def attend() -> None:
    """What the other process does: let the robots of the scenario that comes in by the door look around."""
    scenario = unpack(Scenario, sys.stdin.buffer.read())
    simulator = Simulator(scenario)
    simulator.readings()
    bodies = simulator.bodies
    if bodies.echoes:
        bodies.echoes.fire(1, scenario.tick, (bodies.x, bodies.y, bodies.heading))
