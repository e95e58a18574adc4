"""Warm-up: at the very first start, two processes compile the kernels at once.

Compiling is Python's work as much as LLVM's, and numba does it under one lock, so a second thread would not help. A
second process lets a few robots look around, and this one lets them move, which takes about as long; each finds what
the other has compiled in the cache. If this fails, only time is lost: kernels are then compiled when first called.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

from sleepcast.simulator.engine import choose, cores
from sleepcast.simulator.packing import pack, unpack
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simulation import Simulator

OTHER = f"from {__name__} import run_other_process; run_other_process()"
"""What the other process runs."""
PATIENCE = 60.0
"""Seconds that are waited for the other process: some times what it takes on a slow machine."""


def compile_kernels(scenario: Scenario) -> None:
    """Compile what the robots of a scenario need, if no kernel has ever been compiled.
    scenario: one with few robots."""
    if choose().name == "numpy" or not any(sort.ring for sort in scenario.each_sort):
        return
    from sleepcast.simulator.simd.compiled import kept_in

    if kept_in():
        return
    empty = replace(scenario, shapes=(), absent=(), events=())
    with _collector_paused():
        if cores() < 2:
            compile_motion_kernels(empty)
            compile_sonar_kernels(empty)
            return
        with suppress(OSError, subprocess.TimeoutExpired), _other_process(empty) as other:
            compile_motion_kernels(empty)
            other.wait(PATIENCE)


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Pause the garbage collector: compiling makes a million long-lived objects, and scanning them takes a tenth of the
    time."""
    by_itself = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if by_itself:
            gc.enable()


@contextmanager
def _other_process(scenario: Scenario) -> Iterator[subprocess.Popen[bytes]]:
    """The second process; it is killed at the end of the block."""
    command, quiet = [sys.executable, "-P", "-c", OTHER], subprocess.DEVNULL  # -P: nothing of the folder we are in
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet) as other:
        try:
            assert other.stdin
            other.stdin.write(pack(scenario))
            other.stdin.close()
            yield other
        finally:
            other.kill()


def run_other_process() -> None:
    """What the other process does: let the robots of the scenario that comes in by the door look around."""
    scenario = unpack(Scenario, sys.stdin.buffer.read())
    with _collector_paused():
        compile_sonar_kernels(scenario)
    os._exit(0)  # kernels are kept, and to give back all that compiling has made takes a second


def compile_motion_kernels(scenario: Scenario) -> None:
    """Let robots move that cannot look around."""
    blind = [replace(sort, ring=None) for sort in (scenario.robots, *scenario.sorts)]
    Simulator(replace(scenario, robots=blind[0], sorts=tuple(blind[1:])), machine=choose(threads=1)).step()


def compile_sonar_kernels(scenario: Scenario) -> None:
    """Let robots look around, and fire their sonars. They are brought into order first, which the others need later."""
    simulator = Simulator(scenario, threads=1)
    simulator.readings()
    bodies = simulator.bodies
    if bodies.sonars:
        bodies.sonars.fire(1, scenario.tick, (bodies.x, bodies.y, bodies.heading))
