"""Single runs of an experiment on pages of their own: each a process with the operator's page of a simulated swarm.

The run begins anew with its own settings, commands and seed, so it is the one that was measured, until somebody sends a
command of his own. A process ends with its owner.
"""

from __future__ import annotations

import os
import re
import signal
from multiprocessing import connection, get_context
from threading import Lock, Thread

from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.server import Address, serve
from sleepcast.core.clock import WallClock
from sleepcast.core.errors import SleepcastError
from sleepcast.experiments.plan import Experiment, PlannedRun
from sleepcast.experiments.run import opened
from sleepcast.loop import Pace

MAX_OPEN = 4
"""Runs that are open at one time; one more ends the page that was opened first."""
HOST = "127.0.0.1"
_ADDRESS = re.compile(r"http://\S+")


class OpenedRuns:
    """The pages of single runs of an experiment; leaving ends them all."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment = experiment
        self._lock = Lock()
        self._open: dict[int, _OpenedRun] = {}

    def address_of(self, run: PlannedRun) -> str:
        """The address of the page of a run, which is started unless it is open. Raises SleepcastError."""
        with self._lock:
            known = self._open.get(run.number)
            if known is not None and known.alive():
                return known.address
            self._open = {number: each for number, each in self._open.items() if each.alive()}
            while len(self._open) >= MAX_OPEN:
                self._open.pop(next(iter(self._open))).end()
            started = self._open[run.number] = _OpenedRun(self._experiment, run)
            return started.address

    def end(self) -> None:
        """End all of them."""
        with self._lock:
            for each in self._open.values():
                each.end()
            self._open.clear()


class _OpenedRun:
    """One process. address: of its page. Raises SleepcastError if it cannot be started."""

    def __init__(self, experiment: Experiment, run: PlannedRun) -> None:
        context = get_context("spawn")  # as for workers
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_show, args=(theirs, experiment, run), daemon=True)
        self._process.start()
        theirs.close()
        try:
            message = str(self._pipe.recv())
        except EOFError:
            message = "its process ended"
        address = _ADDRESS.search(message)
        if address is None:
            self.end()
            raise SleepcastError(f"run {run.number} cannot be opened: {message}")
        self.address = address[0]

    def alive(self) -> bool:
        return self._process.is_alive()

    def end(self) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _show(pipe: connection.Connection, experiment: Experiment, run: PlannedRun) -> None:
    """What the process of a run does until its owner is gone. Ctrl-C is its owner's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_owner, args=(pipe,), daemon=True).start()
    try:
        fleet, clock = opened(experiment, run), WallClock()
        swarm = fleet.swarm
        pace = Pace(clock, swarm, swarm.simulator.scenario.speed_up)
        address = Address(HOST, 0, insecure=False, browser=False)
        serve(SwarmAdapter(swarm), fleet.station, pace, clock, address=address, say=pipe.send)
    except SleepcastError as error:
        pipe.send(str(error))


def _end_with_owner(pipe: connection.Connection) -> None:
    try:
        pipe.recv()
    except (EOFError, OSError):
        os._exit(0)
