"""`sleepcast swarm` or `node`, watched: besides, it notes when each robot had dealt with each message and, of a swarm,
when its body was at rest after STOP.

    python -m benchmarks.channel.watched FILE ARGUMENTS...

At the end it writes to FILE, as JSON, `answers`: [robot, command, outcome, Unix time], `halts`: [robot, Unix time], and
`rests`: [robot, Unix time, whether it is at rest from then on].
"""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import sleepcast.channel.session
import sleepcast.loop.real
from sleepcast.channel import Kind, Message
from sleepcast.channel.session import ChannelSession
from sleepcast.cli import main as sleepcast_main
from sleepcast.loop.real import NetworkSwarm
from sleepcast.node.node import Node

ANSWERS: list[tuple[str, str, str, float]] = []
HALTS: list[tuple[str, float]] = []
RESTS: list[tuple[str, float, bool]] = []


class WatchedSession(ChannelSession):
    """Notes what a robot answers, and when."""

    def send(self, message: Message) -> None:
        if message.kind is Kind.ANSWER:
            body = message.body
            ANSWERS.append((self.delivery.name, str(body.get("command")), str(body.get("outcome")), time.time()))
        super().send(message)


class WatchedSwarm(NetworkSwarm):
    """Notes when bodies come to rest after STOP, and when that is over."""

    _resting: NDArray[np.bool_] | None = None

    def step(self) -> None:
        super().step()
        bodies = self.simulator.bodies
        resting = bodies.stopped & (bodies.speed == 0.0)
        before = np.zeros_like(resting) if self._resting is None else self._resting
        now = time.time()
        for place in np.flatnonzero(resting != before).tolist():
            RESTS.append((self.members[place].node.name, now, bool(resting[place])))
        self._resting = resting


def _watched(halt: Callable[[Node, str], None]) -> Callable[[Node, str], None]:
    """Notes when a body is told to halt."""

    def halted(node: Node, doubt: str = "") -> None:
        halt(node, doubt)
        HALTS.append((node.name, time.time()))

    return halted


def main() -> None:
    file, *arguments = sys.argv[1:]
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs would ignore it
    sleepcast.channel.session.ChannelSession = WatchedSession  # type: ignore[misc]
    sleepcast.loop.real.NetworkSwarm = WatchedSwarm  # type: ignore[misc]
    Node.halt = _watched(Node.halt)  # type: ignore[method-assign]
    try:
        sleepcast_main(arguments)
    finally:
        Path(file).write_text(json.dumps({"answers": ANSWERS, "halts": HALTS, "rests": RESTS}))


if __name__ == "__main__":
    main()
