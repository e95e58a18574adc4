"""One client of the server, without its socket: requests in, replies out, some of them later.

A client connects to a robot by its number, from 1, and may change to another. What it asks without a robot, or in the
wrong words, is answered with an error, so that it is never left waiting.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sleepcast.nomad import units
from sleepcast.nomad.behaviour import COMMANDS, LONGEST_TIMEOUT, NO_LASER, Behaviour
from sleepcast.nomad.requests import Fault, Kind, Reply, misfit, name_of
from sleepcast.nomad.scenery import ERASED, checked, moved, polygon, prediction, sketch
from sleepcast.nomad.state import (
    BUMPER,
    COMPASS,
    INFRARED,
    MOTORS,
    POS_BUMPER,
    POS_COMPASS,
    POS_INFRARED,
    POS_LASER,
    POS_SONAR,
    POSITION,
    SONAR,
    VELOCITY,
    Mask,
    position,
    tail,
)
from sleepcast.nomad.texts import ByteOrder, text_of
from sleepcast.nomad.windows import Windows
from sleepcast.nomad.wire import Layout, Parser, Request, encode
from sleepcast.robot import SimulatedWorld

Words = Sequence[int]


@dataclass(slots=True)
class Service:
    """What all clients share: the world and its robots, the windows, and what the person who started it allows.

    port: where clients come in. say: tells the person at the terminal. quitting: whether the server is to end.
    """

    world: SimulatedWorld
    windows: Windows
    behaviours: list[Behaviour]
    say: Callable[[str], None]
    tk_order: ByteOrder
    may_quit: bool
    lockstep: bool
    headless: bool
    port: int = 0
    quitting: bool = False


@dataclass(frozen=True, slots=True)
class Wait:
    """A reply that is still to come. ready: gives it once it is time. ticks: whether simulated time brings it."""

    ready: Callable[[], bytes | None]
    ticks: bool = True


Answer = bytes | Wait | None
"""None: the request gets no reply."""


class Session:
    """See the module. peer: where the client is, as text. robot: its index, None before it has one."""

    def __init__(self, service: Service, peer: str, parser: Parser) -> None:
        self.peer, self.robot = peer, -1
        self.clicked: tuple[float, float] | None = None
        self._service, self._parser = service, parser
        self._behaviour: Behaviour | None = None
        self._mask = Mask()
        self._client = peer
        self._asks = 0
        """1 while a click is waited for."""

    def answer(self, request: Request) -> Answer:
        """What comes of a request."""
        kind, words, size = request
        wrong = misfit(kind, size)
        if wrong:
            return self._refuse(wrong, kind)
        connecting = CONNECTING.get(kind)
        if connecting is not None:
            return connecting(self, kind, words)
        behaviour = self._behaviour
        if behaviour is None:
            return self._error(f"{name_of(kind)} came without a robot", Fault.NO_CONNECTION)
        if kind in COMMANDS:
            behaviour.command(kind, words)
            return self._afterwards(kind, behaviour)
        behaviour.alive()
        return HANDLERS[kind](self, behaviour, kind, words)

    def leave(self) -> None:
        """The client has gone, or lets its robot go."""
        if self._behaviour is not None:
            self._ask(0)
            self._behaviour.clients.remove(self._client)
            self._tell_window()
            self._behaviour, self.robot = None, -1

    # ---- replies

    @property
    def _layout(self) -> Layout | None:
        return self._parser.layout

    def _reply(self, kind: int, words: Words = ()) -> bytes:
        return encode(self._layout, kind, words)

    def _error(self, said: str, fault: Fault) -> bytes:
        self._service.say(f"{self._client}: {said}: refused")
        return self._reply(Reply.ERROR, (fault,))

    def _refuse(self, said: str, kind: int) -> bytes:
        """A request in the wrong words: what connects would take any error for success."""
        if kind in CONNECTING:
            self._service.say(f"{self._client}: {said}: refused")
            return self._reply(kind, (0,))
        return self._error(said, Fault.MALFORMED)

    def _when_it_is_time(self, reply: Callable[[], bytes]) -> Answer:
        """A reply that carries state: in lockstep, after the next tick."""
        return Wait(reply) if self._service.lockstep else reply()

    def _afterwards(self, kind: int, behaviour: Behaviour) -> Answer:
        """The reply to a command: the state, once the command is done if it is one that takes its time."""
        if kind == Kind.PLACE_ROBOT:
            return self._reply(Reply.SIMPLE)
        layout, mask = self._layout, self._mask
        if kind == Kind.ZR:
            return Wait(lambda: None if behaviour.zeroing else behaviour.state_reply(layout, mask))
        if self._service.lockstep:
            return Wait(lambda: behaviour.state_reply(layout, mask))
        return behaviour.state_reply(layout, mask)

    # ---- connecting

    def _connect(self, kind: int, words: Words) -> Answer:
        number, process = words
        if not 1 <= number <= len(self._service.behaviours):
            self._service.say(
                f"{self._client}: there is no robot {number}, only 1 to {len(self._service.behaviours)}: refused"
            )
            return self._reply(kind, (0,))
        self.leave()
        self.robot = number - 1
        self._behaviour = behaviour = self._service.behaviours[self.robot]
        self._mask = Mask()
        self._client = f"{self.peer} (process {process})"
        behaviour.clients.append(self._client)
        behaviour.alive()
        self._tell_window()
        self._service.say(f"{self._client} has connected to robot {number}")
        return self._reply(kind, (self._service.port,))

    def _disconnect(self, kind: int, words: Words) -> Answer:
        self.leave()
        return None

    def _tell_window(self) -> None:
        if self._behaviour is not None:
            self._service.windows.robots[self.robot].client = ", ".join(self._behaviour.clients)

    # ---- what the robot tells

    def _state(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        if self._service.lockstep:
            return Wait(lambda: behaviour.state_reply(self._layout, self._mask))
        return behaviour.state_reply(self._layout, self._mask)

    def _set_mask(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        self._mask.configure(words)
        return self._state(behaviour, kind, words)

    def _part(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        """A reply with a part of the state, PosData if it is wanted, and the clock where there is one."""
        part = PARTS[kind]

        def reply() -> bytes:
            found = list(NO_LASER) if part.laser else behaviour.state()[part.begin : part.end]
            if kind == Kind.GET_RA:
                found = list(behaviour.accelerations)
            if part.clock:
                found += behaviour.posdata(self._mask.posdata & part.posdata)
                found.append(tail(behaviour.condition())[0])
            return self._reply(part.reply, found)

        return self._when_it_is_time(reply)

    def _wait_until_stopped(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        *flags, timeout = words
        world = self._service.world
        until = world.time + min(timeout, LONGEST_TIMEOUT) if timeout > 0 else float("inf")

        def ready() -> bytes | None:
            if behaviour.stopped(flags) or world.time >= until:
                return behaviour.state_reply(self._layout, self._mask)
            return None

        if self._service.lockstep:
            return Wait(ready)
        return ready() or Wait(ready)

    def _positions(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        def reply() -> bytes:
            poses = [position(each.condition().real) for each in self._service.behaviours]
            return self._reply(Reply.ROBOT_POSITIONS, [len(poses), *(word for pose in poses for word in pose[:3])])

        return self._when_it_is_time(reply)

    # ---- the world and the windows

    def _speak(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        text = text_of(words, self._service.tk_order)
        behaviour.window.said.append((self._service.world.time, text))
        self._service.say(f"robot {self.robot + 1} says: {text}")
        return self._reply(Reply.SIMPLE)

    def _change_obstacle(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        corners = polygon(words)
        if corners is None:
            return self._no_polygon(kind, words)
        world = self._service.world
        done = world.add(corners) if kind == Kind.ADD_OBSTACLE else world.remove(corners)
        if not done:
            why = "is none, or the world is full" if kind == Kind.ADD_OBSTACLE else "is not there"
            self._service.say(f"{self._client}: {name_of(kind)}: the polygon {why}")
        return self._reply(Reply.SIMPLE)

    def _move_obstacle(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        corners = polygon(words, more=2)
        if corners is None:
            return self._no_polygon(kind, words)
        if self._service.world.move(corners, units.metres(words[-2]), units.metres(words[-1])):
            return self._reply(Reply.MOVED, moved(words))
        self._service.say(f"{self._client}: {name_of(kind)}: the polygon is not there, or has no room there")
        return self._reply(Reply.MOVED, words[:-2])

    def _no_polygon(self, kind: int, words: Words) -> bytes:
        return self._error(f"{name_of(kind)} says {words[0]} corners in {len(words)} words", Fault.MALFORMED)

    def _new_world(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        self._service.world.clear()
        return self._reply(Reply.SIMPLE)

    def _draw(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        self._service.windows.sketches.append(sketch(kind, words))
        return self._reply(Reply.SIMPLE)

    def _refresh(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        self._service.windows.erase(self.robot, ERASED[kind])
        return self._reply(Reply.SIMPLE)

    def _predict(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        return self._reply(Reply.STATE, prediction(self._service.world, self.robot, behaviour.pose(words)))

    def _check_motion(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        found = checked(self._service.world, self.robot, words)
        if found is None:
            return self._error(f"motion_check of a way of type {words[0]}", Fault.MALFORMED)
        return self._reply(kind, found)

    def _ask_for_click(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        """The place that somebody clicks at, or where the robot believes to be if nobody can."""

        def reply() -> bytes | None:
            x, y, heading, turret = position(behaviour.condition().believed)
            if not self._service.headless:
                if self.clicked is None:
                    return None
                x, y = map(units.tenths, self.clicked)
            self._ask(0)
            return self._reply(kind, (x, y, heading, turret))

        self.clicked = None
        self._ask(1)
        return reply() or Wait(reply, ticks=False)

    def _ask(self, clicks: int) -> None:
        """From now on wait for so many clicks, 0 or 1."""
        if self._behaviour is not None:
            self._behaviour.window.waiting += clicks - self._asks
        self._asks = clicks

    # ---- the server itself

    def _quit(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        if not self._service.may_quit:
            self._service.say(f"{self._client}: quit_server is not permitted here (--may-quit permits it): refused")
            return self._reply(Reply.SIMPLE)
        self._service.say(f"{self._client} ends the server")
        self._service.quitting = True
        return self._reply(Reply.SIMPLE)

    def _switch_body(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        return self._reply(Reply.SIMPLE)

    def _special(self, behaviour: Behaviour, kind: int, words: Words) -> Answer:
        return self._error("a user packet that nothing here understands", Fault.MALFORMED)


@dataclass(frozen=True, slots=True)
class _Part:
    """A stretch of the state vector with a reply of its own. posdata: bit of its sensors; clock: whether it follows."""

    reply: Reply
    begin: int
    end: int
    posdata: int = 0
    clock: bool = True
    laser: bool = False


PARTS: dict[int, _Part] = {
    Kind.GET_IR: _Part(Reply.INFRARED, INFRARED, SONAR, POS_INFRARED),
    Kind.GET_SN: _Part(Reply.SONAR, SONAR, BUMPER, POS_SONAR),
    Kind.GET_RC: _Part(Reply.CONFIGURATION, POSITION, VELOCITY, clock=False),
    Kind.GET_RV: _Part(Reply.VELOCITY, VELOCITY, MOTORS, clock=False),
    Kind.GET_RA: _Part(Reply.ACCELERATION, 0, 0, clock=False),
    Kind.GET_CP: _Part(Reply.COMPASS, COMPASS, COMPASS + 1, POS_COMPASS),
    Kind.GET_LS: _Part(Reply.LASER, 0, 0, POS_LASER, laser=True),
    Kind.GET_SG: _Part(Reply.LASER, 0, 0, POS_LASER, laser=True),
    Kind.GET_BP: _Part(Reply.BUMPER, BUMPER, POSITION, POS_BUMPER),
}

CONNECTING: dict[int, Callable[[Session, int, Words], Answer]] = {
    Kind.CREATE_ROBOT: Session._connect,
    Kind.CONNECT_ROBOT: Session._connect,
    Kind.DISCONNECT_ROBOT: Session._disconnect,
}

HANDLERS: dict[int, Callable[[Session, Behaviour, int, Words], Answer]] = {
    Kind.GS: Session._state,
    Kind.CT: Session._set_mask,
    Kind.WS: Session._wait_until_stopped,
    Kind.GET_RPX: Session._positions,
    Kind.TK: Session._speak,
    Kind.ADD_OBSTACLE: Session._change_obstacle,
    Kind.DELETE_OBSTACLE: Session._change_obstacle,
    Kind.MOVE_OBSTACLE: Session._move_obstacle,
    Kind.NEW_WORLD: Session._new_world,
    Kind.PREDICT_SENSORS: Session._predict,
    Kind.MOTION_CHECK: Session._check_motion,
    Kind.GET_ROBOT_CONF: Session._ask_for_click,
    Kind.QUIT_SERVER: Session._quit,
    Kind.REAL_ROBOT: Session._switch_body,
    Kind.SIMULATED_ROBOT: Session._switch_body,
    Kind.SPECIAL_REQUEST: Session._special,
    **dict.fromkeys(PARTS, Session._part),
    **dict.fromkeys((Kind.DRAW_ROBOT, Kind.DRAW_LINE, Kind.DRAW_ARC), Session._draw),
    **dict.fromkeys(ERASED, Session._refresh),
}
"""What every request does that neither connects nor is a command."""
