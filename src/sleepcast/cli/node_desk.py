"""What `sleepcast node` has in the place of a channel: orders with their times, lines that are typed, plain datagrams.

Nothing here waits. What the robot answers and reports is printed.
"""

from __future__ import annotations

import os
import select
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from math import nan
from typing import TYPE_CHECKING

from sleepcast.channel import Channel, Kind, Message
from sleepcast.channel.message import MAX_TEXT
from sleepcast.channel.payload import ENDS
from sleepcast.channel.plain_datagrams import Datagrams, Numbers
from sleepcast.cli.standard_memory import reported_body
from sleepcast.cli.streams import announce, complain, still_open
from sleepcast.core.clock import Clock
from sleepcast.core.errors import printable
from sleepcast.language import format_value

if TYPE_CHECKING:
    from sleepcast.simulator import Order

OPERATOR, SENDER = "terminal", "datagram"
"""Who sends what is typed and what stands in a file, and who sends plain datagrams."""
MAX_WAITING = 64
"""Datagrams that wait: one is told the robot in each tick, as they come faster than that only from a fault."""
PIECE = 65_536
"""Bytes of standard input that are looked at in one tick."""
SAFETY = {"stopped": "and at rest until RELEASE", "released": "and free to be moved again"}
"""What a robot answers to STOP and RELEASE, in words: these have no value."""
NOTHING_HEARD = "(DEFVAR message FALSE)"
"""Evaluated at the start, so that rules can ask whether a datagram has come."""


def heard(numbers: Numbers) -> str:
    """What a plain datagram says, as an expression. Its numbers become variables when the first one comes, so that a
    robot's own rules may have given them other values for the time before."""
    setting = " ".join(f"(DEFVAR m{i} {n:.9f}) (SETQ m{i} {n:.9f})" for i, n in enumerate(numbers))
    return f"(PROGN {setting} (DEFVAR message FALSE) (SETQ message TRUE))"


class Typed:
    """Lines of standard input, as far as there are any: nothing waits for them."""

    def __init__(self) -> None:
        self._descriptor = _standard_input()
        self._rest = b""

    def texts(self) -> Iterator[str]:
        """The expressions that have been typed since the last call; one goes on until its parentheses are closed."""
        if self._descriptor is None or not self._ready(self._descriptor):
            return
        try:
            data = os.read(self._descriptor, PIECE)
        except OSError:
            data = b""
        ended = not data
        lines = (self._rest + data).split(b"\n")
        self._rest = b"" if ended else lines.pop()
        waiting: list[bytes] = []
        for line in lines:
            waiting.append(line)
            text = b"\n".join(waiting).decode(errors="replace")
            if still_open(text) <= 0:
                waiting = []
                if any(line.partition(";")[0].strip() for line in text.split("\n")):
                    yield text.strip()
        if ended:
            self._descriptor = None
            if waiting:
                yield b"\n".join(waiting).decode(errors="replace")
            return
        self._rest = b"\n".join((*waiting, self._rest))
        if len(self._rest) > MAX_TEXT:
            complain(f"what is typed has grown beyond {MAX_TEXT} characters without an end, and is dropped")
            self._rest = b""

    @staticmethod
    def _ready(descriptor: int) -> bool:
        try:
            if os.isatty(descriptor) and os.tcgetpgrp(descriptor) != os.getpgrp():
                return False  # who reads from a terminal in the background is suspended, and so would the mind be
        except OSError:  # it is not the terminal that controls this process, so it suspends nobody
            pass
        return bool(select.select([descriptor], [], [], 0)[0])


def _standard_input() -> int | None:
    try:
        return None if sys.stdin is None else sys.stdin.fileno()
    except (OSError, ValueError):
        return None


class NodeDesk:
    """The channel of one node: see the module.

    orders: what is to be done when, s after the start. typed: where an operator types. ears: plain datagrams, of which
    one is told in each tick. session: the radio, if there is one. All this is received in the order given here. epoch:
    of what is typed and told. stops: those that hold the robot, which a RELEASE that is typed here ends.
    """

    def __init__(
        self,
        name: str,
        clock: Clock,
        orders: Sequence[Order],
        typed: Typed,
        ears: Datagrams | None,
        session: Channel | None = None,
        epoch: int = 0,
        stops: Callable[[], Sequence[object]] = tuple,
    ) -> None:
        self._name, self._clock, self._start = name, clock, clock.now()
        self._orders, self._typed, self._ears, self._session = deque(orders), typed, ears, session
        self._waiting: deque[Numbers] = deque()
        self._epoch, self._sequence, self._stops = epoch, 0, stops
        self.lost = 0
        """Datagrams that found no room."""

    def receive(self) -> list[Message]:
        """What has come since the last call."""
        found: list[Message] = []
        while self._orders and self._orders[0].time <= self._clock.now() - self._start:
            found.append(self._message(self._orders.popleft().text))
        found += map(self._message, self._typed.texts())
        if self._ears is not None:
            found += self._next_datagram(self._ears)
        if self._session is not None:
            found += self._session.receive()
        return found

    def _next_datagram(self, ears: Datagrams) -> Iterator[Message]:
        for numbers in ears.receive():
            if len(self._waiting) < MAX_WAITING:
                self._waiting.append(numbers)
            else:
                self.lost += 1
        if self._waiting:
            yield self._message(heard(self._waiting.popleft()), SENDER)

    def _message(self, text: str, sender: str = OPERATOR) -> Message:
        kind = {"STOP": Kind.STOP, "RELEASE": Kind.RELEASE}.get(text.upper(), Kind.COMMAND)
        self._sequence += 1
        said = text[:MAX_TEXT] if kind is Kind.COMMAND else ""
        body: dict[str, object] = {ENDS: list(self._stops())} if kind is Kind.RELEASE else {}
        return Message(sender, self._epoch, self._sequence, kind, self._clock.now() - self._start, text=said, body=body)

    def send(self, message: Message) -> None:
        """Print what the robot says to the terminal, and send all else."""
        body = message.body
        if self._session is not None and not str(body.get("command", "")).startswith(f"{OPERATOR}-"):
            self._session.send(message)
            if message.kind is not Kind.REPORT:
                return
        if message.kind is Kind.REPORT:
            announce(f"{self._name}: {printable(reported_body(body))}")
        elif message.kind is Kind.ANSWER:
            value, fault = body.get("value"), body.get("fault")
            if str(body.get("command")).startswith(f"{SENDER}-") and not fault:
                return  # nobody waits for the answer to a datagram
            outcome = str(body.get("outcome"))
            said = SAFETY.get(outcome) or format_value(value if isinstance(value, float) else nan)
            announce(f"{self._name}: {outcome}, {said}")
            if fault:
                complain(printable(f"{self._name}: {fault}"))
        elif message.kind is Kind.COMMAND:
            announce(f"{self._name} tells others, whom nobody reaches from here: {printable(message.text)}")
