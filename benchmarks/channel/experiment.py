"""What all proofs need: hosts with robots on them, an operator's desk, and what each of them has noted.

Robots are processes `sleepcast swarm`, one on each host, with keys and data folders of their own; the desk is a process
on a host of its own. All is gone at the end of a `with` block.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self

from benchmarks.channel.desk import Ordered
from benchmarks.channel.lab import URI, Lab
from benchmarks.report import Json
from sleepcast.channel.keyring import development_keys

DESK = "desk"
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
"""Compiled kernels are kept there; they need not be made anew for each run."""


class ExperimentError(Exception):
    """Something that should take part did not begin, or did not end as it should."""


@dataclass(frozen=True)
class Noted:
    """What the robots of all hosts have noted: see `watched`."""

    answers: Sequence[tuple[str, str, str, float]]
    rests: Sequence[tuple[str, float, bool]]

    def of(self, command: str) -> dict[str, float]:
        """When each robot had dealt with a message (s of Unix time)."""
        return {robot: time for robot, which, _, time in self.answers if which == command}

    def stopped(self, since: float, within: float) -> list[float]:
        """Seconds after `since` (s of Unix time) until each robot that moved then was at rest by a STOP, inf for one
        that was not within so many."""
        resting: dict[str, float | None] = {}
        found: dict[str, float] = {}
        for robot, when, at_rest in sorted(self.rests, key=lambda each: each[1]):
            if when < since:
                resting[robot] = when if at_rest else None
            elif at_rest and when < since + within and resting.get(robot) is None:
                found.setdefault(robot, when - since)
        moved = {robot for robot, when in resting.items() if when is None}
        return [found.get(robot, inf) for robot in moved | found.keys()]

    def order(self, robot: str, commands: Sequence[str]) -> list[tuple[str, float]]:
        """Which of these commands a robot dealt with, and when, in its order."""
        wanted = set(commands)
        return [(which, time) for who, which, _, time in self.answers if who == robot and which in wanted]


class Experiment:
    """A fleet of `hosts` with `robots` on each, and a desk, on the air; a `with` block lasts as long as they do."""

    def __init__(self, hosts: int, robots: int, *options: str) -> None:
        self.hosts = [f"host{number}" for number in range(1, hosts + 1)]
        self.robots = robots
        self._options = options
        self._folder = TemporaryDirectory(prefix="sleepcast-lab-")
        self.folder = Path(self._folder.name)
        self.lab = Lab([DESK, *self.hosts])
        self._swarms: dict[str, subprocess.Popen[str]] = {}
        self._lives = 0
        self._files: list[Path] = []

    def __enter__(self) -> Self:
        try:
            development_keys(self.folder / "config" / "sleepcast" / "keys")
            self.begin(*self.hosts)
            command = (sys.executable, "-m", "benchmarks.channel.desk", URI)
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
            self.desk = Ordered(self.lab.start(DESK, *command, environment=self.environment, **pipes))
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        self.lab.close()
        self._folder.cleanup()

    @property
    def environment(self) -> dict[str, str]:
        """Of all processes: folders of their own, and this sleepcast."""
        places = {"XDG_CONFIG_HOME": self.folder / "config", "XDG_DATA_HOME": self.folder / "data"}
        ours = {"XDG_CACHE_HOME": CACHE, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        return {**os.environ, **{name: str(value) for name, value in (places | ours).items()}}

    # ---- robots

    def begin(self, *hosts: str) -> None:
        """Start the robots of these hosts, and wait until they are up. Raises ExperimentError."""
        for host in hosts:
            first = 1 + self.hosts.index(host) * self.robots
            self._lives += 1
            self._files.append(self.folder / f"{host}-{self._lives}.json")
            options = (
                "--channel",
                URI,
                "--first",
                str(first),
                *(each.format(host=host, folder=self.folder) for each in self._options),
            )
            words = ("swarm", str(self.robots), *options)
            command = (sys.executable, "-m", "benchmarks.channel.watched", self._files[-1], *words)
            self._swarms[host] = self.lab.start(
                host, *command, environment=self.environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
        for host in hosts:
            stdout = self._swarms[host].stdout
            assert stdout is not None
            if "up" not in stdout.readline():
                raise ExperimentError(f"the robots of {host} did not begin")

    def kill(self, host: str) -> None:
        """End the robots of a host as a crash does."""
        self.lab.stop(self._swarms[host], signal.SIGKILL)

    def cpu(self) -> float:
        """Seconds of the processor that all robots' processes have used."""
        used = 0
        for process in self._swarms.values():
            fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
            used += int(fields[11]) + int(fields[12])
        return used / os.sysconf("SC_CLK_TCK")

    def noted(self) -> Noted:
        """End all robots, and give what they have noted. Raises ExperimentError."""
        for process in self._swarms.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for host, process in self._swarms.items():
            if process.wait(60.0) not in (0, 130, -signal.SIGKILL):
                raise ExperimentError(f"the robots of {host} ended with {process.returncode}")
        told = [json.loads(file.read_text()) for file in self._files if file.exists()]
        return Noted(
            [tuple(each) for one in told for each in one["answers"]],
            [tuple(each) for one in told for each in one["rests"]],
        )

    # ---- the desk

    def order(self, do: str, **arguments: object) -> Json:
        """Have the desk do something, and give what became of it."""
        return self.desk.order(do, **arguments)
