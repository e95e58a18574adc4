"""STOP, and commands, while somebody floods the air with forgeries under the operator's key id.

Real processes on the loopback: robots (`sleepcast swarm`, or a `sleepcast node` each), an operator's desk, and an
attacker (`flooder`), whom each of them hears as he hears the operator. Each trial sends commands to robots that are
free, then STOP, then RELEASE, and takes from the robots' own notes when each had heard STOP.

A robot has a computer of its own; here all share two cores. So the nodes are few.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.channel.desk import Ordered
from benchmarks.channel.proofs import YARD, Proof, seconds
from benchmarks.report import Bar, number
from sleepcast.api.progress import steps
from sleepcast.channel.keyring import DEVELOPMENT_TRUST, add_trust, development_keys
from sleepcast.channel.keys import PublicKey, Trust

RATE = 80_000
"""Datagrams a second of the attacker."""
KINDS = ("stop", "command", "parts")
"""What he forges."""
SOON, AT_LAST = 1.0, 3.0
"""Seconds in which 99 % of the robots, and all, have heard STOP."""
COMMANDS = 3
"""Commands in each trial."""
PATIENCE = 30.0
SETTLED = 1.0
"""Seconds until a flood, or its end, is everywhere."""


@dataclass
class Tried:
    """What came of some trials. rate: datagrams a second that the attacker has sent; stops: seconds until each robot
    had heard STOP, inf for never; through: of commands and robots, how many were answered; pairs: of how many; silent:
    robots that the desk missed after STOP."""

    rate: float = 0.0
    stops: list[float] = field(default_factory=list)
    through: int = 0
    pairs: int = 0
    silent: int = 0


def flood(robots: int, nodes: int, trials: int, rate: int = RATE) -> Proof:
    """So many robots in a swarm, and so many nodes, so many times."""
    rows: list[Sequence[str]] = []
    bars: list[Bar] = []
    fleets = {f"swarm of {robots}": ["swarm", str(robots)]} if robots else {}
    fleets |= {f"{nodes} nodes": ["node"] * nodes} if nodes else {}
    for name, words in fleets.items():
        count, silent = robots if words[0] == "swarm" else nodes, 0
        for kind in ("", *KINDS):
            found = tried(words, count, kind, rate, trials)
            shares = [seconds(found.stops, share) for share in (0.5, 0.99, 1.0)]
            share = 100.0 * found.through / found.pairs
            forged = f"{found.rate:,.0f} {'in parts' if kind == 'parts' else kind}" if kind else "none"
            rows.append([name, forged, *map(number, shares), str(found.silent), number(share)])
            silent += found.silent
            if kind == "stop":
                bars += [
                    Bar(f"{name}: 99 % have heard STOP", shares[1], SOON, "s", at_least=False),
                    Bar(f"{name}: all have heard STOP", shares[2], AT_LAST, "s", at_least=False),
                    Bar(f"{name}: commands that were answered", share, 95.0, "%"),
                ]
        bars.append(Bar(f"{name}: missed at the desk after STOP, in any flood", silent, 0, "", at_least=False))
    heads = ["robots", "forged a second", "STOP: 50 %, s", "99 %, s", "100 %, s", "silent", "commands answered, %"]
    return Proof("flood", heads, rows, bars, f"{trials} trials each; wanted of the attacker: {rate:,} a second")


def tried(
    words: Sequence[str],
    count: int,
    kind: str,
    rate: int,
    trials: int,
    commands: int = COMMANDS,
    slack: float = 0.0,
) -> Tried:
    """So many trials with these processes of robots, during a flood of this kind. commands: in each trial; slack: s
    more for answers."""
    found, began = Tried(), []
    with TemporaryDirectory(prefix="sleepcast-flood-") as place:
        folder = Path(place)
        with Air(folder, words) as air:
            for _ in range(20):
                if air.desk.order("ask", text="1", patience=2.0)["answers"] == count:
                    break
            with air.flooded(kind, rate) as sent:
                for _ in steps(trials, f"flood of {kind or 'nothing'}", quiet=False):
                    for _ in range(commands):
                        told = air.desk.order("send", text="(SETQQ e1 1)", patience=2.0 + slack)
                        found.through += int(str(told["answers"]))
                        found.pairs += count
                    told = air.desk.order("stop", patience=AT_LAST + slack)
                    found.silent += int(str(told["n_silent"]))
                    began.append((float(str(told["began"])), float(str(told["ended"]))))
                    air.desk.order("release", patience=AT_LAST)
            found.rate = sent[0] if sent else 0.0
        notes = [json.loads(file.read_text()) for file in folder.glob("*.json")]
    stopped: dict[str, list[float]] = {}
    for robot, _, outcome, when in (answer for each in notes for answer in each["answers"]):
        if outcome == "stopped":
            stopped.setdefault(robot, []).append(when)
    names = [f"r{place + 1}" for place in range(count)]
    for begin, end in began:
        for name in names:
            heard = [when - begin for when in stopped.get(name, ()) if begin <= when <= end + SETTLED]
            found.stops.append(min(heard, default=inf))
    return found


class Air:
    """The robots and a desk on the loopback; a `with` block lasts as long as they do. guests: keys that the robots
    trust besides."""

    def __init__(self, folder: Path, words: Sequence[str], guests: Sequence[PublicKey] = ()) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self._uri = f"udp://239.255.83.90:{free.getsockname()[1]}?interface=lo"
        self._folder, self._words, self._guests, self._stack = folder, words, guests, ExitStack()
        places = {"XDG_CONFIG_HOME": folder / "config", "XDG_DATA_HOME": folder / "data"}
        path = os.pathsep.join(each for each in sys.path if each)
        self._environment = {**os.environ, "PYTHONPATH": path, **{name: str(at) for name, at in places.items()}}

    def __enter__(self) -> Air:
        keys = self._folder / "config" / "sleepcast" / "keys"
        operator, _ = development_keys(keys)
        self._key = operator.id.hex()
        if self._guests:
            add_trust(Trust(self._guests), keys / DEVELOPMENT_TRUST)
        with ExitStack() as stack:
            running = []
            if self._words[0] == "swarm":
                running.append(self._begin(stack, "watched", str(self._folder / "1.json"), *self._words, *YARD))
            else:
                for place in range(1, len(self._words) + 1):
                    body = ("--body", f"sim:{YARD[1]}", "--name", f"r{place}")
                    running.append(self._begin(stack, "watched", str(self._folder / f"{place}.json"), "node", *body))
            for each in running:
                _line(each)
            self.desk = Ordered(self._begin(stack, "desk", self._uri, channel=False))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _begin(self, stack: ExitStack, module: str, *words: str, channel: bool = True) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", f"benchmarks.channel.{module}", *words]
        command += ["--channel", self._uri] if channel else []
        process = subprocess.Popen(
            command,
            env=self._environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        stack.callback(_ended, process)
        return process

    @contextmanager
    def flooded(self, kind: str, rate: int) -> Iterator[list[float]]:
        """A flood of this kind during the block, none for ""; gives how many a second it was, once it is over."""
        if not kind:
            yield []
            return
        with self.attacked("flooder", self._key, kind, str(rate)) as found:
            time.sleep(SETTLED)
            yield found

    @contextmanager
    def attacked(self, module: str, *words: str) -> Iterator[list[float]]:
        """An attacker during the block: a module of this folder; gives how much a second he has sent, once it is
        over."""
        found: list[float] = []
        with ExitStack() as stack:
            process = self._begin(stack, module, self._uri, *words, "600", channel=False)
            _line(process)
            yield found
            process.send_signal(signal.SIGTERM)
            told = json.loads(_line(process))
            found.append(told["sent"] / told["seconds"])


def _line(process: subprocess.Popen[str]) -> str:
    """The next that a process says. Raises RuntimeError if it has ended."""
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise RuntimeError(f"{process.args} has ended")
    return line


def _ended(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
