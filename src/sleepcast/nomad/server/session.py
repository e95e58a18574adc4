"""One client of the server, without its socket: its robot, its mask, and the layout of its replies.

What each request does stands in `answers`; here is what that needs to know of the client and of what clients share. A
client connects to a robot by its number, from 1, and may change to another. It may ask for the real robot that stands
behind its simulated one, if there is one: then a `Relay` passes on what it asks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field

from sleepcast.core.records import dataclass
from sleepcast.nomad.server.relay import RealAddress, Relay
from sleepcast.nomad.server.simulated_robot import SimulatedRobot
from sleepcast.nomad.server.windows import Windows
from sleepcast.nomad.wire import units
from sleepcast.nomad.wire.encoding import ByteOrder, Parser, encode
from sleepcast.nomad.wire.requests import ErrorCode, Reply, RequestType
from sleepcast.nomad.wire.state import Mask
from sleepcast.robot import SimulatedWorld

Words = Sequence[int]


@dataclass(slots=True)
class Service:
    """What all clients share: the world and its robots, the windows, and what the person who started it allows.

    say: tells that person. real: the real robots, by the index of the simulated one in whose place they can be put.
    port: where clients come in. quitting: whether the server is to end.
    """

    world: SimulatedWorld
    windows: Windows
    simulated_robots: list[SimulatedRobot]
    say: Callable[[str], None]
    tk_order: ByteOrder
    may_quit: bool
    lockstep: bool
    headless: bool
    real: dict[int, RealAddress] = field(default_factory=dict)
    port: int = 0
    quitting: bool = False


@dataclass(frozen=True, slots=True)
class Wait:
    """A reply that is still to come. ready: gives it once it is time. ticks: whether simulated time brings it."""

    ready: Callable[[], bytes | None]
    ticks: bool = True


Answer = bytes | Wait | None
"""None: the request gets no reply."""


class Refusal(Exception):
    """A request that is not done. text: why, for a person; fault: for the program."""

    def __init__(self, text: str, fault: ErrorCode = ErrorCode.MALFORMED) -> None:
        super().__init__(text)
        self.text, self.fault = text, fault


class ClientSession:
    """See the module.

    peer: where the client is, as text; name: the same with its process. robot: its index, -1 before it has one.
    simulated_robot: the one of that index. mask: what the client wants to see. relay: the real robot that it drives
    instead. nudge: to be called when something has come that the client may wait for.
    """

    def __init__(self, service: Service, peer: str, parser: Parser, nudge: Callable[[], None]) -> None:
        self.service, self.peer, self.name, self.nudge = service, peer, peer, nudge
        self.robot = -1
        self.simulated_robot: SimulatedRobot | None = None
        self.mask = Mask()
        self.relay: Relay | None = None
        self._driven: list[SimulatedRobot] = []
        """What moves because this client said so, as far as nobody else has said anything since."""
        self._parser = parser
        self._clicked: tuple[int, int] | None = None
        self._asks = 0
        """1 while a click is waited for."""

    # ---- which robot

    def connect(self, number: int, process: int) -> None:
        """Drive the robot of this number, and no other. Raises Refusal."""
        service = self.service
        if not 1 <= number <= len(service.simulated_robots):
            raise Refusal(
                f"there is no robot {number}, only 1 to {len(service.simulated_robots)}", ErrorCode.NO_CONNECTION
            )
        self.leave()
        self.robot, self.mask = number - 1, Mask()
        self.name = f"{self.peer} (process {process})"
        self.simulated_robot = service.simulated_robots[self.robot]
        if self.simulated_robot.timed_by not in self.simulated_robot.clients:
            self.simulated_robot.timeout = 0
        self.simulated_robot.admit(self.name)
        self.simulated_robot.alive()
        service.say(f"{self.name} has connected to robot {number}")

    def leave(self) -> None:
        """The client has gone, or lets its robot go."""
        self.let_real_go()
        if self.simulated_robot is not None:
            self._ask(0)
            self.simulated_robot.dismiss(self.name)
            self.service.say(f"{self.name} has left robot {self.robot + 1}")
        self.simulated_robot, self.robot = None, -1

    def disconnect(self) -> None:
        """The client lets go of its robot, which keeps its last setpoint."""
        self.leave()
        for simulated_robot in self._driven:
            simulated_robot.let_go_by(self.name)
        self._driven.clear()

    def lost(self) -> None:
        """The client has gone without a word: what it has set in motion stops."""
        self.leave()
        for simulated_robot in self._driven:
            if simulated_robot.let_go_by(self.name):
                simulated_robot.abandon()
                self.service.say(
                    f"{self.name} is gone without disconnect_robot: robot {simulated_robot.robot + 1} is stopped"
                )
        self._driven.clear()

    def drive(self, simulated_robot: SimulatedRobot, kind: int) -> None:
        """The client is about to move its robot. The terminal reports if another client does so, too; but a
        program that drives may go home over a connection of its own."""
        contest = simulated_robot.driven_by(self.name)
        if simulated_robot not in self._driven:
            self._driven.append(simulated_robot)
        if contest and kind != RequestType.ZR:
            self.service.say(contest)

    @property
    def simulated(self) -> bool:
        """Whether it drives a simulated robot."""
        return self.simulated_robot is not None and self.relay is None

    # ---- the real robot

    def take_real(self) -> None:
        """From now on what the client asks of its robot is asked of the real one. Raises Refusal if there is none."""
        real = self.service.real.get(self.robot)
        if real is None or self.simulated_robot is None:
            raise Refusal(f"there is no real robot in place of robot {self.robot + 1}", ErrorCode.NO_CONNECTION)
        self.let_real_go()
        self.simulated_robot.command(RequestType.ST, ())
        self.relay = Relay(real, self.mask.words, self.simulated_robot.timeout, self.nudge, self.service.say)
        self.service.say(f"{self.name} drives the real robot at {real}")

    def let_real_go(self) -> None:
        """What the client asks is asked of its simulated robot again; the real one is stopped."""
        if self.relay is not None:
            self.relay.close()
            self.relay = None

    # ---- replies

    def reply(self, kind: int, words: Words = ()) -> bytes:
        """A reply as the client reads it."""
        return encode(self._parser.layout, kind, words)

    def state(self, simulated_robot: SimulatedRobot) -> bytes:
        """The reply to what gets the state."""
        return simulated_robot.state_reply(self._parser.layout, self.mask)

    def error(self, refusal: Refusal) -> bytes:
        """The reply to what is refused."""
        return self.reply(Reply.ERROR, (refusal.fault,))

    def in_time(self, reply: Callable[[], bytes]) -> Answer:
        """A reply that carries state: now, or in lockstep after the next tick."""
        return Wait(reply) if self.service.lockstep else reply()

    # ---- clicks

    def ask_click(self) -> None:
        """Wait for a click in the robot's window."""
        self._clicked = None
        self._ask(1)

    def click(self, x: float, y: float) -> None:
        """A person clicked there: x, y in m."""
        if self._asks:
            self._clicked = units.tenths(x), units.tenths(y)
            self.nudge()

    def clicked(self) -> tuple[int, int] | None:
        """The place of that click, as on the wire."""
        if self._clicked is not None:
            self._ask(0)
        return self._clicked

    def _ask(self, clicks: int) -> None:
        """From now on wait for so many clicks, 0 or 1."""
        if self.simulated_robot is not None:
            self.simulated_robot.window.waiting += clicks - self._asks
        self._asks = clicks
