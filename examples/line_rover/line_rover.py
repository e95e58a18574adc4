"""A bridge from sleepcast to a rover that speaks lines of text: `line://HOST:PORT`.

What a mind may ask, and what keeps it safe, comes from `BridgedBody`; here stands only what this rover is, how it is
told a motion, and how it is measured.
"""

from __future__ import annotations

import socket
from contextlib import suppress
from math import inf, pi

from sleepcast.bridges import BridgedBody, Motion, Opening, OutOfReachError, read_body_address
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.model import Quantity
from sleepcast.robot import Geometry, Limits, Reading, RobotModel

EXAMPLE = "line://127.0.0.1:9000"
PATIENCE = 1.0
"""Seconds for an answer."""
MAX_LINE = 200
"""Bytes of an answer: more than seven numbers need."""
FRESH = 1.0
"""Seconds after which a value counts as unknown."""

MODEL = RobotModel(
    "line_rover",
    sensors=(
        Quantity("x", "m", -inf, inf, FRESH, "where it believes to be, along x"),
        Quantity("y", "m", -inf, inf, FRESH, "where it believes to be, along y"),
        Quantity("heading", "rad", -pi, pi, FRESH, "counter-clockwise from x"),
        Quantity("speed", "m/s", -0.6, 0.6, FRESH, "along its heading"),
        Quantity("turn_rate", "rad/s", -2.5, 2.5, FRESH, "counter-clockwise"),
        Quantity("battery", "", 0.0, 1.0, FRESH, "1 is full", "%"),
    ),
    actuators=(
        Quantity("drive_speed", "m/s", -0.5, 0.5, doc="drives at this speed"),
        Quantity("drive_turn", "rad/s", -2.0, 2.0, doc="turns at this rate"),
    ),
    functions=(),
    limits=Limits(speed=0.5, turn_rate=2.0, acceleration=1.0),
    geometry=Geometry(radius=0.1),
)


class Line:
    """A connection to a rover. Raises OSError where there is none."""

    def __init__(self, host: str, port: int) -> None:
        self._where = host, port
        self.open()

    def open(self) -> None:
        self._socket = socket.create_connection(self._where, PATIENCE)
        self._answers = self._socket.makefile("r", encoding="ascii", errors="replace")

    def ask(self, line: str) -> str:
        """The answer to a line."""
        self._socket.sendall(f"{line}\n".encode())
        return self._answers.readline(MAX_LINE)

    def close(self) -> None:
        self._socket.close()


class LineRover(BridgedBody):
    """See the module."""

    def __init__(self, line: Line, *, clock: Clock | None = None) -> None:
        super().__init__(MODEL, clock=clock)
        self._line, self._before = line, 0.0
        self._reading = Reading(0.0, (0.0,) * len(MODEL.sensors))
        self.carry_out(Motion("rest"))

    def carry_out(self, motion: Motion) -> None:
        speed, turn_rate = motion.values or (0.0, 0.0)
        answer = self._line.ask(f"drive {speed:.4f} {turn_rate:.4f}")
        if not answer:
            raise OutOfReachError("the rover has closed the connection")
        try:
            time, *values = map(float, answer.split())
            if len(values) != len(MODEL.sensors):
                raise ValueError
        except ValueError:
            raise OutOfReachError(f"the rover answered {answer!r:.60}, which is not seven numbers") from None
        if self._before + time < self._reading.time:  # it was started anew, and counts from 0
            self._before = self._reading.time
        self._reading = Reading(self._before + time, tuple(values))

    def measure(self) -> None:
        """Every answer to a motion has brought it, and each round tells the motion."""

    def reading(self) -> Reading:
        return self._reading

    def seek(self) -> None:
        self._line.close()
        self._line.open()
        self.carry_out(Motion("rest"))

    def leave(self) -> None:
        with suppress(*self.FAILURES):  # it stands by itself when it hears nothing
            self.carry_out(Motion("rest"))
        self._line.close()


def open_body(uri: str, opening: Opening) -> LineRover:
    """The rover at `line://HOST:PORT`."""
    address = read_body_address(uri, EXAMPLE, {})
    if opening.in_step:
        raise MisuseError(f"{uri!r:.100}: this rover's time waits for nobody: no --lockstep")
    try:
        return LineRover(Line(address.host, address.port or 9_000))
    except OSError as error:
        raise OutOfReachError(f"no rover listens at {address.host}:{address.port}: {error}") from None
