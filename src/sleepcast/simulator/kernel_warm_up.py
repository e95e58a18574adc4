"""Warm-up: at the very first start, two processes compile the kernels in parallel.

Compiling is as much Python's work as LLVM's, and numba holds one lock meanwhile, so a second thread would not help.
One process compiles the sonar kernels, the other the motion kernels, which takes about as long; each then finds the
other's kernels in the cache. If this fails, only time is lost: kernels are compiled when first called.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from hashlib import sha256
from typing import TYPE_CHECKING

from sleepcast.simulator.engine import choose, cores, has_numba
from sleepcast.simulator.packing import pack, unpack
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simulation import Simulator

if TYPE_CHECKING:
    import subprocess

OTHER = f"from {__name__} import run_other_process; run_other_process()"
"""The program of the second process."""
PATIENCE = 60.0
"""Seconds to wait for the second process: several times what it takes on a slow machine."""


KERNELS = 34
"""Kernels, each for its types of arguments, that all included scenarios need together: some more on some processors."""


def kernel_count() -> int:
    """How many of them have been compiled so far, also by other processes; 0 without numba."""
    if not has_numba():
        return 0
    from sleepcast.simulator.simd.cached import compiled_count

    return compiled_count()


def compile_kernels(scenario: Scenario) -> None:
    """Compile the kernels that the robots of a scenario need, if none has been compiled yet. scenario: one with few
    robots."""
    if not any(spec.ring for spec in scenario.each_type) or not has_numba():
        return
    from sleepcast.simulator.simd.cached import compiled_in

    if compiled_in():
        return
    import subprocess

    empty = replace(scenario, shapes=(), absent=(), events=())
    with _collector_paused():
        if cores() < 2:
            compile_motion_kernels(empty)
            compile_sonar_kernels(empty)
            return
        with suppress(OSError, subprocess.TimeoutExpired), _other_process(empty) as other:
            compile_motion_kernels(empty)
            other.wait(PATIENCE)


def load_kernels(scenario: Scenario, threads: int | None) -> bool:
    """Load the kernels that robots of a scenario were seen to need in another process; gives whether that is known, and
    all of them are compiled. Arguments: those of `keep_kernels`."""
    if not has_numba():
        return False
    from sleepcast.simulator.simd.cached import ENTRIES, load

    names = ENTRIES.load(_note(scenario, threads))
    return names is not None and all(map(load, names.decode().split()))


def keep_kernels(scenario: Scenario, threads: int | None) -> None:
    """Note for other processes which kernels have been needed here.

    scenario: one with few robots, which have lived in it for a moment.
    threads: None is one for each core.
    """
    if not has_numba():
        return
    from sleepcast.simulator.simd.cached import ENTRIES, in_use

    if names := in_use():
        ENTRIES.save(_note(scenario, threads), " ".join(names).encode())


def _note(scenario: Scenario, threads: int | None) -> str:
    """The name under which it is noted."""
    from sleepcast.simulator.simd.cached import identity

    about = pack(replace(scenario, seed=0)) + f"{threads or cores()}".encode()
    return f"{identity()}-needs-{sha256(about).hexdigest()[:16]}"


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
    import subprocess

    command, quiet = [sys.executable, "-P", "-c", OTHER], subprocess.DEVNULL  # -P: import nothing from this folder
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet) as other:
        try:
            assert other.stdin
            other.stdin.write(pack(scenario))
            other.stdin.close()
            yield other
        finally:
            other.kill()


def run_other_process() -> None:
    """The work of the second process: read a scenario from standard input and compile its sonar kernels."""
    scenario = unpack(Scenario, sys.stdin.buffer.read())
    with _collector_paused():
        compile_sonar_kernels(scenario)
    os._exit(0)  # the kernels are cached, and freeing everything that compiling has allocated takes a second


def compile_motion_kernels(scenario: Scenario) -> None:
    """Let robots without sonars move, which compiles the motion kernels, and what makes quiet ticks."""
    from sleepcast.simulator.quiet.blocks import compile_ticks

    blind = [replace(spec, ring=None) for spec in (scenario.robots, *scenario.sorts)]
    Simulator(replace(scenario, robots=blind[0], sorts=tuple(blind[1:])), machine=choose(threads=1)).step()
    compile_ticks()


def compile_sonar_kernels(scenario: Scenario) -> None:
    """Let robots look and fire their sonars, which compiles the sonar kernels. First they are sorted into cells, as the
    motion kernels need them later."""
    simulator = Simulator(scenario, threads=1)
    simulator.readings()
    bodies = simulator.bodies
    if bodies.sonars:
        bodies.sonars.fire(1, scenario.tick, (bodies.x, bodies.y, bodies.heading))
