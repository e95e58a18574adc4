"""`sleepcast prepare`: compile what simulated robots need, before it is needed. The last step of go.py's set-up."""

from __future__ import annotations

import json
from contextlib import contextmanager, nullcontext
from time import perf_counter
from typing import TYPE_CHECKING

import click

from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.progress import told_unless_soon
from sleepcast.cli.streams import complain, put
from sleepcast.core.errors import SleepcastError
from sleepcast.core.extras import installing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

TICKS = 10
"""Of each scenario's mission: rules that are run so often have become native code."""


class PrepareError(SleepcastError):
    """There is nothing to compile with, or nowhere to keep it."""


@click.command("prepare")
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as one JSON object.")
@click.option("--quiet", is_flag=True, help="Show no progress on standard error.")
def prepare(as_json: bool, quiet: bool) -> int:
    """Compile what the robots of all included scenarios need, and keep it in your cache folder.

    This takes a processor a minute or two, once for each version of sleepcast and numba and for each type of processor.
    Without it, the first scenario that needs something compiles it while you wait.

    \b
    Examples:
      sleepcast prepare
      sleepcast prepare --json
    """
    from sleepcast.simulator import scenario_names
    from sleepcast.simulator.engine import has_numba

    began, names = perf_counter(), scenario_names()
    with Interrupts("ended by {}; what has been compiled is kept"), _progress(len(names), quiet) as tell:
        if not has_numba():
            raise PrepareError(f"there is nothing to compile: {_without_numba()}")
        for name in names:
            tell(name)
            _compile_for(name)
    from sleepcast.simulator.simd.cached import CACHE, compiled_in

    folder, seconds = compiled_in(), perf_counter() - began
    if folder is None:
        places = " nor in ".join(map(str, CACHE.folders))
        raise PrepareError(f"compiled code can be kept neither in {places}, so every start will compile anew")
    outcome = {"scenarios": names, "folder": str(folder), "wall_seconds": round(seconds, 3)}
    sentence = f"{len(names)} scenarios are ready to start, after {seconds:.1f} s ({folder})"
    put(json.dumps(outcome) if as_json else sentence)
    return 0


def advise() -> None:
    """Say how to get the fast program, where there is none."""
    from sleepcast.simulator.engine import has_numba

    if not has_numba():
        complain(_without_numba())


def _without_numba() -> str:
    return f"numba is not installed, so simulations run several times slower; to install it: {installing('fast')}"


def _compile_for(name: str) -> None:
    """Compile what a scenario needs: its bodies, many of them, and the rules of its mission."""
    from sleepcast.api.assembly import assemble, few_of, warm_up
    from sleepcast.simulator import choose, find_scenario

    scenario = find_scenario(name)
    warm_up(scenario, None, quiet=True)
    swarm, _ = assemble(few_of(scenario), None, mission=True)
    for _ in range(TICKS):
        swarm.step()
    if kernels := swarm.fleet.kernels:
        kernels.settle()
    if pool := choose().pool:
        pool.practise()


@contextmanager
def _progress(count: int, quiet: bool) -> Iterator[Callable[[str], object]]:
    """Shows what is being compiled: give it each scenario's name as its turn comes."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from sleepcast.api.progress import counting_column
    from sleepcast.simulator import KERNELS, kernel_count

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        sentence = f"compiling some {KERNELS} kernels for this computer, a minute or two of a processor's time ..."
        with nullcontext() if quiet else told_unless_soon(sentence):
            yield lambda name: None
        return
    kernels = counting_column("kernel", kernel_count, KERNELS)
    columns = SpinnerColumn(), TextColumn("compiling for {task.description}"), BarColumn(), kernels, TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=count, completed=-1)
        yield lambda name: bar.update(task, description=name, advance=1)
