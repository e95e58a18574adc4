"""What a node takes besides the messages of its channel, or in the channel's place: orders with their times, typed
lines, plain datagrams, and what a ground station wants. Nothing here waits.
"""

from __future__ import annotations

import os
import select
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from math import nan

from sleepcast.bridges.mavlink.ground_station import GroundStation, PilotRequest
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import ENDS, MAX_TEXT
from sleepcast.channel.plain_datagrams import Datagrams, Numbers
from sleepcast.channel.session import ChannelSession
from sleepcast.cli.streams import announce, complain, still_open
from sleepcast.core.clock import Clock
from sleepcast.core.errors import printable
from sleepcast.core.units import value_in_words
from sleepcast.language.reading_units import report_in_words
from sleepcast.simulator.scenario.mission import Order

OPERATOR, SENDER, GROUND = "terminal", "datagram", "ground-station"
"""Who sends what is typed and what stands in a file, who sends plain datagrams, and who sends MAVLink."""
MAX_WAITING = 64
"""Datagrams that wait: the robot receives one in each tick; only a fault makes them come faster."""
PIECE = 65_536
"""Bytes of standard input that are looked at in one tick."""
SAFETY = {"stopped": "and at rest until RELEASE", "released": "and free to be moved again"}
"""What a robot answers to STOP and RELEASE, in words: these have no value."""


def heard(numbers: Numbers) -> str:
    """What a plain datagram says, as an expression. Its numbers become variables when the first one comes, so that a
    robot's own rules may have given them other values for the time before."""
    setting = " ".join(f"(DEFVAR m{i} {n:.9f}) (SETQ m{i} {n:.9f})" for i, n in enumerate(numbers))
    return f"(PROGN {setting} (DEFVAR message FALSE) (SETQ message TRUE))"


def request_text(request: PilotRequest, actuators: Sequence[str]) -> str:
    """What a ground station wants, as an expression, STOP or RELEASE. A place becomes variables, which the robot's own
    rules may drive to.

    actuators: the names of speed and turn rate.
    """
    if request.type == "drive":
        return f"(PROGN {' '.join(f'(SETQ {n} {v:.4f})' for n, v in zip(actuators, request.values, strict=False))})"
    if request.type == "goal":
        pairs = zip(("goal_x", "goal_y", "goal_height"), request.values, strict=False)
        return f"(PROGN {' '.join(f'(DEFVAR {n} {v:.3f}) (SETQ {n} {v:.3f})' for n, v in pairs)})"
    return request.type.upper()


class TypedLines:
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


class LocalInput:
    """The channel of one node: see the module. Orders, typed lines, datagrams and the session are polled in this order.

    orders: what is to be done when, s after the start.
    typed: where an operator types, if one does.
    listener: plain datagrams, of which one is delivered in each tick.
    session: the radio, if there is one.
    epoch: of the messages that are made of typed lines and datagrams.
    stops: the marks of those that hold the robot; a RELEASE that is typed here ends them, one of the ground station its
        own.
    ground: the ground station, if there is one.
    actuators: names of speed and turn rate.
    unit_of: gives the unit in which people read the value of a command, by its id.
    """

    def __init__(
        self,
        name: str,
        clock: Clock,
        orders: Sequence[Order],
        typed: TypedLines | None,
        listener: Datagrams | None,
        session: ChannelSession | None = None,
        epoch: int = 0,
        stops: Callable[[], Sequence[Sequence[object]]] = tuple,
        ground: GroundStation | None = None,
        actuators: Sequence[str] = (),
        unit_of: Callable[[str], str] = lambda command: "",
    ) -> None:
        self._ground, self._actuators, self._unit_of = ground, actuators, unit_of
        self._name, self._clock, self._start = name, clock, clock.now()
        self._orders, self._typed, self._listener, self._session = deque(orders), typed, listener, session
        self._waiting: deque[Numbers] = deque()
        self._read: list[Message] = []
        self._epoch, self._sequence, self._stops = epoch, 0, stops
        self._stopped_by = 0
        """The number of the latest STOP that was read with `stops`."""
        self.lost = 0
        """Datagrams that found no room."""

    def receive(self) -> list[Message]:
        """What has come since the last call."""
        messages, self._read = self._read, []
        while self._orders and self._orders[0].time <= self._clock.now() - self._start:
            messages.append(self._message(self._orders.popleft().text))
        if self._typed is not None:
            messages += map(self._message, self._typed.texts())
        if self._listener is not None:
            messages += self._next_datagram(self._listener)
        if self._ground is not None:
            messages += self._of_ground(self._ground)
        if self._session is not None:
            messages += self._session.receive()
        return messages

    def stops(self) -> list[Message]:
        """The STOPs that have come since the last call of this or `receive`, from wherever a person may send one; what
        is typed with them waits."""
        if self._typed is not None:
            self._read += map(self._message, self._typed.texts())
        if self._ground is not None:
            self._read += self._of_ground(self._ground)
        stops = [message for message in self._read if message.kind is Kind.STOP]
        self._read = [message for message in self._read if message.kind is not Kind.STOP]
        self._stopped_by = max((message.sequence for message in stops), default=self._stopped_by)
        return stops if self._session is None else stops + self._session.stops()

    @property
    def is_releasing(self) -> bool:
        """Whether a RELEASE was read after the latest STOP and waits for the next `receive`: whoever sent it may have
        an acknowledgement already, and say where to go."""
        return any(each.kind is Kind.RELEASE and each.sequence > self._stopped_by for each in self._read)

    def _of_ground(self, ground: GroundStation) -> list[Message]:
        return [self._message(request_text(request, self._actuators), GROUND) for request in ground.requests()]

    def _next_datagram(self, listener: Datagrams) -> Iterator[Message]:
        for numbers in listener.receive():
            if len(self._waiting) < MAX_WAITING:
                self._waiting.append(numbers)
            else:
                self.lost += 1
        if self._waiting:
            yield self._message(heard(self._waiting.popleft()), SENDER)

    def _message(self, text: str, sender: str = OPERATOR) -> Message:
        kind = {"STOP": Kind.STOP, "RELEASE": Kind.RELEASE}.get(text.upper(), Kind.COMMAND)
        self._sequence += 1
        text = text[:MAX_TEXT] if kind is Kind.COMMAND else ""
        body: dict[str, object] = {}
        if (
            kind is Kind.RELEASE
        ):  # one that is typed ends all STOPs that hold; others those of their sender, even before a restart
            body[ENDS] = [mark for mark in self._stops() if sender in (OPERATOR, mark[0])]
        return Message(sender, self._epoch, self._sequence, kind, self._clock.now() - self._start, text=text, body=body)

    def send(self, message: Message) -> None:
        """Print what the robot says to the terminal, and send all else."""
        body = message.body
        if self._session is not None and not str(body.get("command", "")).startswith((f"{OPERATOR}-", f"{GROUND}-")):
            self._session.send(message)
            if message.kind is not Kind.REPORT:
                return
        if message.kind is Kind.REPORT:
            report = printable(report_in_words(body.get("label"), body.get("values")))
            announce(f"{self._name}: {report}")
            if self._ground is not None:
                self._ground.say(report)
        elif message.kind is Kind.ANSWER:
            value, fault = body.get("value"), body.get("fault")
            outcome, whose = str(body.get("outcome")), str(body.get("command"))
            if whose.startswith((f"{SENDER}-", f"{GROUND}-")) and not fault and outcome not in SAFETY:
                return  # nobody waits for the answer to a datagram, nor to a setpoint
            number = value if isinstance(value, float) else nan
            result = SAFETY.get(outcome) or value_in_words(number, self._unit_of(whose))
            announce(f"{self._name}: {outcome}, {result}")
            if fault:
                complain(printable(f"{self._name}: {fault}"))
                if self._ground is not None and whose.startswith(f"{GROUND}-"):
                    self._ground.say(printable(str(fault)))
        elif message.kind is Kind.COMMAND:
            announce(f"{self._name} tells others, whom nobody reaches from here: {printable(message.text)}")
