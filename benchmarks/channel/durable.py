"""What robots have confirmed, after kill -9 at a random moment: what they know again, and when it was on the disk.

Real processes on the loopback: `sleepcast swarm`, a `sleepcast node` with a body in the simulator, and one that is the
bridge to a Nomad server. Each life confirms a STOP, a RELEASE or a command, is killed up to 2.5 s later, and the next
one is asked what it knows. The desk of a life ends before its robots do, so that none of its copies reach the next one.

The row of an answer is looked for in the store when the answer has arrived: it must be there.
"""

from __future__ import annotations

import json
import os
import select
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from unittest import mock

from benchmarks.channel.proofs import Proof, seconds
from benchmarks.report import Bar, number
from sleepcast.api.connection import FLEET, AirOptions, session_for
from sleepcast.api.progress import steps
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import LOOK, TELEMETRY, Inspection
from sleepcast.channel.session import ChannelSession

AFTER = 2.5
"""Seconds after the confirmation within which the process is killed."""
PATIENCE = 30.0
LOOK_EVERY = 0.0005
"""Seconds between two looks at the air and at the store."""
CONFIRMED = ("stopped", "released", "matched")
KINDS = (Kind.STOP, Kind.COMMAND, Kind.RELEASE, Kind.COMMAND)
"""What the lives are told, in turn."""


@dataclass
class Found:
    """What came of some kills. forgotten: robots of all lives that did not know what they had confirmed; doubted: those
    that stood still because they might not; confirmed: s until the last robot had answered, for each kind; lag: s from
    each answer on the air to its row in the store."""

    kills: int = 0
    forgotten: int = 0
    doubted: int = 0
    confirmed: dict[Kind, list[float]] = field(default_factory=dict)
    lag: list[float] = field(default_factory=list)


def durable(swarms: int, nodes: int, bridges: int, robots: int = 10) -> Proof:
    """So many kills of a swarm of this many robots, of a node, and of a bridge."""
    rows, bars = [], []
    kinds = {f"swarm of {robots}": (swarms, "swarm"), "node": (nodes, "node"), "bridge": (bridges, "bridge")}
    for name, (kills, sort) in kinds.items():
        if not kills:
            continue
        found = killed(sort, robots if sort == "swarm" else 1, kills, name)
        stop, release = (found.confirmed.get(kind, [0.0]) for kind in (Kind.STOP, Kind.RELEASE))
        times = [f"{1e3 * seconds(each, 0.5):.1f} / {1e3 * max(each):.1f}" for each in (stop, release)]
        lags = [f"{1e3 * seconds(found.lag, 0.5):.1f}", f"{1e3 * max(found.lag):.1f}"]
        rows.append([name, str(found.kills), str(found.forgotten), str(found.doubted), *times, *lags])
        bars += [
            Bar(f"{name}: confirmed and forgotten", found.forgotten + found.doubted, 0, "", at_least=False),
            Bar(f"{name}: from the answer to the row, worst", 1e3 * max(found.lag), 0.0, "ms", at_least=False),
        ]
    heads = [
        *("robots", "kills", "forgotten", "in doubt", "STOP confirmed, 50 % / worst, ms"),
        *("RELEASE confirmed, 50 % / worst, ms", "answer to row, 50 %, ms", "worst, ms"),
    ]
    note = (
        f"killed 0 to {number(AFTER)} s after the last robot had confirmed; rows that were there before count below 0"
    )
    return Proof("durable", heads, rows, bars, note)


def killed(sort: str, robots: int, kills: int, name: str) -> Found:
    """What came of so many kills of robots of this sort."""
    found, chance, expected, known = Found(), Random(1), False, 0
    with (
        TemporaryDirectory(prefix="sleepcast-lab-") as place,
        mock.patch.dict(os.environ, _at(Path(place))),
        _lives(sort, robots, Path(place)) as lives,
    ):
        for turn in steps(kills + 1, f"durable: {name}", quiet=False):
            with lives.life() as (process, desk):
                if turn:
                    _note(found, desk.states(), (expected, float(known)))
                if turn == kills:
                    break
                kind = KINDS[turn % len(KINDS)]
                expected = expected if kind is Kind.COMMAND else kind is Kind.STOP
                known = turn if kind is Kind.COMMAND else known
                text = f"(PROGN (DEFVAR told 0) (SETQ told {turn}))" if kind is Kind.COMMAND else ""
                desk.tell(kind, text, chance.uniform(0.0, AFTER), found)
                process.kill()
                process.wait()
                found.kills += 1
    return found


def _note(found: Found, states: dict[str, tuple[bool, float, str]], expected: tuple[bool, float]) -> None:
    for stopped, told, doubt in states.values():
        found.doubted += bool(doubt)
        found.forgotten += not doubt and (stopped, told) != expected


def _at(folder: Path) -> dict[str, str]:
    return {"XDG_CONFIG_HOME": str(folder / "config"), "XDG_DATA_HOME": str(folder / "data")}


@dataclass
class Desk:
    """An operator, and what he sees of the robots' store."""

    session: ChannelSession
    names: Sequence[str]
    store: Path

    def states(self) -> dict[str, tuple[bool, float, str]]:
        """Of each robot whether it is stopped, what it was told last, and what it doubts."""
        looks = self._ask("", {LOOK: Inspection.TELEMETRY.value})
        records = {name: body[TELEMETRY] for name, body in looks.items()}
        return {
            name: (bool(each["stopped"]), each["user"].get("told", 0.0), str(each.get("doubt", "")))
            for name, each in records.items()
            if isinstance(each, dict)
        }

    def _ask(self, text: str, body: dict[str, object]) -> dict[str, dict[str, object]]:
        until, answers, asked = time.monotonic() + PATIENCE, dict[str, dict[str, object]](), set[object]()
        while time.monotonic() < until:
            asked.add(self._post(Kind.ASK, text, body).id)
            again = time.monotonic() + 1.0
            while time.monotonic() < again:
                self.session.wait(0.01)
                heard = [each for each in self.session.receive() if each.body.get("command") in asked]
                answers |= {each.sender: each.body for each in heard}
                if answers.keys() >= set(self.names):
                    return answers
        raise RuntimeError(f"{set(self.names) - answers.keys()} have not answered")

    def tell(self, kind: Kind, text: str, after: float, found: Found) -> None:
        """Say this, until every robot has confirmed it and `after` s have passed; note when each had, and since when
        its row was in the store."""
        with closing(sqlite3.connect(f"{self.store.as_uri()}?mode=ro", uri=True)) as connection:
            said, began = self._post(kind, text, {}), time.monotonic()
            heard, rows, until = dict[str, float](), dict[str, float](), began + PATIENCE
            while time.monotonic() < until:
                self._look(connection, said.id, rows)
                select.select([self.session.transport], [], [], LOOK_EVERY)
                for each in self.session.receive():
                    if each.body.get("command") == said.id and each.sender not in heard:
                        if each.body["outcome"] not in CONFIRMED:
                            raise RuntimeError(f"{each.sender} has not obeyed {text or kind}: {each.body}")
                        heard[each.sender] = time.monotonic()
                        self._look(connection, said.id, rows, heard[each.sender])
                        if len(heard) == len(self.names):
                            until = heard[each.sender] + after
        found.confirmed.setdefault(kind, []).append(max(heard[name] for name in self.names) - began)
        found.lag += [rows.get(name, inf) - heard[name] for name in self.names]

    def _look(
        self, connection: sqlite3.Connection, command: str, rows: dict[str, float], at: float | None = None
    ) -> None:
        """Note since when which rows are there. at: the time of what led to this look, if not now."""
        for (name,) in connection.execute("SELECT robot FROM journal WHERE command = ?", (command,)):
            rows.setdefault(name, time.monotonic() if at is None else at)

    def _post(self, kind: Kind, text: str, body: dict[str, object]) -> Message:
        said = self.session.delivery.post(kind, time.time(), text=text, body=body)
        self.session.flush()
        return said


@dataclass
class Lives:
    """The lives of some robots, one after the other."""

    command: Sequence[str]
    uri: str
    names: Sequence[str]
    store: Path

    @contextmanager
    def life(self) -> Iterator[tuple[subprocess.Popen[str], Desk]]:
        """Robots that are up, and a new desk; the desk ends first."""
        words = [*self.command, "--channel", self.uri, "--store", str(self.store)]
        air = AirOptions(self.uri, FLEET, None, None, None)
        with _running(*words) as process:
            assert process.stdout is not None
            if " up" not in process.stdout.readline():
                raise RuntimeError(f"{words} did not begin")
            with closing(session_for(air, None, robot=False, say=lambda _: None)) as session:
                yield process, Desk(session, self.names, self.store)


@contextmanager
def _lives(sort: str, robots: int, folder: Path) -> Iterator[Lives]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free, ExitStack() as stack:
        free.bind(("127.0.0.1", 0))
        uri, store = f"udp://239.255.83.91:{free.getsockname()[1]}?interface=lo", folder / "robots.store"
        command, body = ["swarm", str(robots)], "sim"
        if sort == "bridge":
            server = stack.enter_context(_running("nserver", "--headless", "--port", "0", "--json"))
            assert server.stdout is not None
            body = f"nomad://127.0.0.1:{json.loads(server.stdout.readline())['port']}#1"
        if sort != "swarm":
            command = ["node", "--name", "r1", "--body", body]
        yield Lives(command, uri, [f"r{each + 1}" for each in range(robots)], store)


@contextmanager
def _running(*words: str) -> Iterator[subprocess.Popen[str]]:
    """A command of sleepcast; killed at the end."""
    command = [sys.executable, "-m", "sleepcast", *words]
    quiet = subprocess.DEVNULL
    path = os.pathsep.join(each for each in sys.path if each)
    environment = {**os.environ, "PYTHONPATH": path}
    with subprocess.Popen(
        command, stdin=quiet, stdout=subprocess.PIPE, stderr=quiet, text=True, env=environment
    ) as process:
        try:
            yield process
        finally:
            process.kill()
