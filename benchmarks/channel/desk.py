"""An operator's desk that does as it is told on standard input, and says on standard output what became of it, as JSON.

    python -m benchmarks.channel.desk URI

Each line in is an order: `do` (send, ask, stop, release, flood, who) with the arguments of the function of that name
below. Each line out is its result. Between two orders it goes on listening, as a desk does.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing

import numpy as np

from benchmarks.report import Json
from sleepcast.api.connection import FLEET, AirOptions, session_for
from sleepcast.channel import Kind
from sleepcast.channel.message import WITHIN
from sleepcast.core.clock import UnixClock
from sleepcast.language import Vocabulary
from sleepcast.station.network import NetworkStation
from sleepcast.station.sent import Command
from sleepcast.station.validation import SendPolicy

MOMENT = 0.005
"""Seconds for which it listens at a time."""
LISTED = 1_000
"""Names that are told of the silent ones."""


class Desk:
    """A station on the air, and what it is asked to do with it."""

    def __init__(self, station: NetworkStation) -> None:
        self._station = station

    def who(self) -> Json:
        """How many robots are on the roster."""
        return {"robots": len(self._station.roster)}

    def send(self, text: str, patience: float, standing: bool = False) -> Json:
        """A command, and its account as soon as nobody is silent or so many s have passed."""
        return self._account(lambda: self._station.send(text, standing=standing, everybody=True), patience)

    def ask(self, text: str, patience: float) -> Json:
        """A question, and its account."""
        return self._account(lambda: self._station.ask(text), patience)

    def stop(self, patience: float) -> Json:
        """STOP, and its account."""
        return self._account(self._station.stop, patience)

    def release(self, patience: float) -> Json:
        """RELEASE, and its account."""
        return self._account(self._station.release, patience)

    def flood(self, texts: list[str], count: int, rate: float, life: float = 0.0, standing: bool = False) -> Json:
        """So many commands, of these texts in turn, so many a second, each good for `life` s unless it stands, and
        their ids with their times; nobody waits for their answers, which are spread over a second. Ends when the last
        one is over."""
        delivery, session = self._station.session.delivery, self._station.session
        sent, begin = [], time.time()
        while len(sent) < count:
            now = time.time()
            while len(sent) < min(count, (now - begin) * rate):
                text, deadline = texts[len(sent) % len(texts)], None if standing else now + life
                message = delivery.post(
                    Kind.COMMAND, now, text=text, deadline=deadline, standing=standing, body={WITHIN: 1.0}
                )
                sent.append((message.id, message.issued, 0.0 if standing else message.deadline))
            session.wait(MOMENT)
            session.receive()
        until = time.time() + life + 1.0
        while time.time() < until:
            session.wait(MOMENT)
            session.receive()
        return {"sent": sent}

    def _account(self, sending: Callable[[], Command], patience: float) -> Json:
        station, begin = self._station, time.time()
        command = sending()
        done = begin + patience
        while (now := time.time()) < done and (command.n_silent or now < begin + command_window(command)):
            station.wait(min(MOMENT, done - now))
        silent = np.flatnonzero(command.silent)
        answers = command.answers
        return {
            "id": command.id,
            "began": begin,
            "issued": command.message.issued,
            "took": time.time() - begin,
            "ended": time.time(),
            "answers": int((answers.codes != 0).sum()),
            "n_silent": command.n_silent,
            "silent": sorted(answers.names[place] for place in silent[:LISTED].tolist()),
        }

    def idle(self) -> None:
        """Go on listening."""
        self._station.wait(MOMENT)


class Ordered:
    """A process of this module, and what it is ordered to do. Raises RuntimeError if it has ended."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self._reply()

    def order(self, do: str, **arguments: object) -> Json:
        """Have it do something, and give what became of it."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
        self._process.stdin.flush()
        return self._reply()

    def _reply(self) -> Json:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("the desk has ended")
        found: Json = json.loads(line)
        return found


def obey(desk: object, idle: Callable[[], None]) -> None:
    """Say that it is ready, do what each line of standard input orders, by a method of `desk`, and say what became of
    it, until the input ends. idle: called between two looks."""
    print(json.dumps({"ready": os.getpid()}), flush=True)
    waiting = b""
    while True:
        idle()
        if not select.select([0], [], [], 0.0)[0]:
            continue
        came = os.read(0, 1 << 20)
        if not came:
            return
        *orders, waiting = (waiting + came).split(b"\n")
        for order in map(json.loads, orders):
            print(json.dumps(getattr(desk, order.pop("do"))(**order)), flush=True)


def command_window(command: Command) -> float:
    """Seconds for which answers are taken although nobody is missed, for there may be robots nobody knows of yet."""
    within = command.message.body.get(WITHIN)
    return 0.0 if command.addressed else 1.0 + (within if isinstance(within, float) else 0.0)


def main() -> None:
    air = AirOptions(sys.argv[1], FLEET, None, None, None, None)
    with closing(session_for(air, None, robot=False, say=lambda _: None)) as session:
        desk = Desk(NetworkStation(session, UnixClock(), Vocabulary(), {}, policy=SendPolicy()))
        obey(desk, desk.idle)


if __name__ == "__main__":
    main()
