"""What comes of each request: the robot does something, the windows show something, and the client gets its reply.

Every request has one reply, except the one that disconnects. What is asked without a robot, or in the wrong words, is
answered with an error, so that no client is left waiting; what connects gets a 0, because a client takes any error for
success.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from struct import Struct

from sleepcast.core.errors import SleepcastError
from sleepcast.nomad import units
from sleepcast.nomad.relay import Pending, Relay
from sleepcast.nomad.requests import Fault, Kind, Reply, misfit, name_of
from sleepcast.nomad.session import Answer, Refusal, Session, Wait, Words
from sleepcast.nomad.simulated_robot import COMMANDS, LONGEST_TIMEOUT, MOTIONS, NO_LASER, STOPS, SimulatedRobot
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
    position,
    tail,
)
from sleepcast.nomad.wire import CONNECTING, Request, text_of
from sleepcast.nomad.world_requests import ERASED, checked, moved, polygon, prediction, sketch


def answer(session: Session, request: Request) -> Answer:
    """Do what a request asks; what is wrong with it is told to the person at the terminal, and to the client."""
    try:
        return take(session, request)
    except Refusal as refusal:
        session.service.say(f"{session.name}: {refusal.text}: refused")
        if request.type in CONNECTING:
            return session.reply(request.type, (0,))
        return session.error(refusal)


def take(session: Session, request: Request) -> Answer:
    """Do what a request asks. Raises Refusal."""
    kind, words, size = request
    wrong = misfit(kind, size)
    if wrong:
        raise Refusal(wrong)
    if kind in CONNECTING:
        return _connecting(session, kind, words)
    behaviour = session.behaviour
    if behaviour is None:
        raise Refusal(f"{name_of(kind)} came without a robot", Fault.NO_CONNECTION)
    if session.relay is not None and kind in RELAYED:
        return _relayed(session, session.relay, behaviour, kind, words)
    try:
        if kind in COMMANDS:
            return _command(session, behaviour, kind, words)
        behaviour.alive()
        return HANDLERS[kind](session, behaviour, kind, words)
    except SleepcastError as error:
        raise Refusal(f"{name_of(kind)}: {error}") from None


def _connecting(session: Session, kind: int, words: Words) -> Answer:
    if kind == Kind.DISCONNECT_ROBOT:
        session.disconnect()
        return None
    session.connect(*words)
    return session.reply(kind, (session.service.port,))


def _relayed(session: Session, relay: Relay, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    """Ask the real robot, which is not moved while all robots are held."""
    if kind == Kind.CT:
        session.mask.configure(words)
    pending: Pending = relay.ask(*((Kind.ST, ()) if behaviour.held and kind in MOTIONS else (kind, words)))

    def ready() -> bytes | None:
        if pending.reply is not None:
            return session.reply(*pending.reply)
        return session.error(Refusal("", Fault.NO_ANSWER)) if relay.broken else None

    return ready() or Wait(ready, ticks=False)


def _command(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    """Command the robot; the reply has the state once that is done, if it is something that takes its time."""
    if kind in MOTIONS or kind in STOPS:
        session.drive(behaviour, kind)
    if kind == Kind.CONF_TM:
        behaviour.timed_by = session.name
    behaviour.command(kind, words)
    if kind == Kind.PLACE_ROBOT:
        return session.reply(Reply.SIMPLE)
    if kind == Kind.ZR:
        return Wait(lambda: None if behaviour.zeroing else session.state(behaviour))
    return _state(session, behaviour, kind, words)


# ---- what the robot tells


def _state(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    if session.service.lockstep:
        return Wait(lambda: session.state(behaviour))
    return session.state(behaviour)


def _set_mask(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    session.mask.configure(words)
    return _state(session, behaviour, kind, words)


@dataclass(frozen=True, slots=True)
class Part:
    """A stretch of the state vector with a reply of its own. posdata: bit of its sensors; clock: whether it follows."""

    reply: Reply
    begin: int
    end: int
    posdata: int = 0
    clock: bool = True


PARTS: dict[int, Part] = {
    Kind.GET_IR: Part(Reply.INFRARED, INFRARED, SONAR, POS_INFRARED),
    Kind.GET_SN: Part(Reply.SONAR, SONAR, BUMPER, POS_SONAR),
    Kind.GET_RC: Part(Reply.CONFIGURATION, POSITION, VELOCITY, clock=False),
    Kind.GET_RV: Part(Reply.VELOCITY, VELOCITY, MOTORS, clock=False),
    Kind.GET_RA: Part(Reply.ACCELERATION, 0, 0, clock=False),
    Kind.GET_CP: Part(Reply.COMPASS, COMPASS, COMPASS + 1, POS_COMPASS),
    Kind.GET_LS: Part(Reply.LASER, 0, 0, POS_LASER),
    Kind.GET_SG: Part(Reply.LASER, 0, 0, POS_LASER),
    Kind.GET_BP: Part(Reply.BUMPER, BUMPER, POSITION, POS_BUMPER),
}


def _part(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    part = PARTS[kind]

    def reply() -> bytes:
        if part.reply is Reply.LASER:
            found = list(NO_LASER)
        elif part.reply is Reply.ACCELERATION:
            found = list(behaviour.accelerations)
        else:
            found = behaviour.state()[part.begin : part.end]
        if part.clock:
            found += behaviour.posdata(session.mask.posdata & part.posdata)
            found.append(tail(behaviour.condition())[0])
        return session.reply(part.reply, found)

    return session.in_time(reply)


def _wait_until_stopped(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    """0 as the time to wait means for as long as it takes."""
    *flags, timeout = words
    world = session.service.world
    until = world.time + min(timeout, LONGEST_TIMEOUT) if timeout > 0 else float("inf")

    def ready() -> bytes | None:
        if behaviour.stopped(flags) or world.time >= until:
            return session.state(behaviour)
        return None

    return Wait(ready) if session.service.lockstep else ready() or Wait(ready)


def _positions(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    """x, y and steering of each robot, where it really is."""

    def reply() -> bytes:
        poses = [position(each.condition().real) for each in session.service.behaviours]
        return session.reply(Reply.ROBOT_POSITIONS, [len(poses), *(word for pose in poses for word in pose[:3])])

    return session.in_time(reply)


# ---- the world and the windows


def _speak(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    text = text_of(words, session.service.tk_order)
    behaviour.window.said.append((session.service.world.time, text))
    session.service.say(f"robot {session.robot + 1} says: {text}")
    return session.reply(Reply.SIMPLE)


def _change_obstacle(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    corners = polygon(words)
    world = session.service.world
    if not (world.add(corners) if kind == Kind.ADD_OBSTACLE else world.remove(corners)):
        why = "is none, or the world is full" if kind == Kind.ADD_OBSTACLE else "is not there"
        raise Refusal(f"{name_of(kind)}: the polygon {why}")
    return session.reply(Reply.SIMPLE)


def _move_obstacle(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    """A client copies as many words as it has sent for the corners, whatever comes: so they come, moved or not."""
    across, up = words[-2:]
    if session.service.world.move(polygon(words, more=2), units.metres(across), units.metres(up)):
        return session.reply(Reply.MOVED, moved(words))
    session.service.say(f"{session.name}: move_obstacle: the polygon is not there, or cannot be put there")
    return session.reply(Reply.MOVED, words[:-2])


def _new_world(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    session.service.world.clear()
    return session.reply(Reply.SIMPLE)


def _draw(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    session.service.windows.sketches.append(sketch(kind, words))
    return session.reply(Reply.SIMPLE)


def _refresh(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    session.service.windows.erase(session.robot, ERASED[kind])
    return session.reply(Reply.SIMPLE)


def _predict(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    return session.reply(Reply.STATE, prediction(session.service.world, session.robot, behaviour.pose(words)))


def _check_motion(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    return session.reply(kind, checked(session.service.world, session.robot, words))


def _ask_for_click(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    """The place that somebody clicks at, or at once where the robot believes to be if there are no windows."""

    def reply() -> bytes | None:
        x, y, heading, turret = position(behaviour.condition().believed)
        if not session.service.headless:
            clicked = session.clicked()
            if clicked is None:
                return None
            x, y = clicked
        return session.reply(kind, (x, y, heading, turret))

    if not session.service.headless:
        session.ask_click()
    return reply() or Wait(reply, ticks=False)


# ---- the server itself


def _quit(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    if not session.service.may_quit:
        raise Refusal("quit_server is not permitted here (--may-quit permits it)")
    session.service.say(f"{session.name} ends the server")
    session.service.quitting = True
    return session.reply(Reply.SIMPLE)


def _switch_body(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    if kind == Kind.REAL_ROBOT:
        session.take_real()
    else:
        session.let_real_go()
    return session.reply(Reply.SIMPLE)


def _special(session: Session, behaviour: SimulatedRobot, kind: int, words: Words) -> Answer:
    return session.reply(kind, packet_reply(words))


HANDLERS: dict[int, Callable[[Session, SimulatedRobot, int, Words], Answer]] = {
    Kind.GS: _state,
    Kind.CT: _set_mask,
    Kind.WS: _wait_until_stopped,
    Kind.GET_RPX: _positions,
    Kind.TK: _speak,
    Kind.ADD_OBSTACLE: _change_obstacle,
    Kind.DELETE_OBSTACLE: _change_obstacle,
    Kind.MOVE_OBSTACLE: _move_obstacle,
    Kind.NEW_WORLD: _new_world,
    Kind.PREDICT_SENSORS: _predict,
    Kind.MOTION_CHECK: _check_motion,
    Kind.GET_ROBOT_CONF: _ask_for_click,
    Kind.QUIT_SERVER: _quit,
    Kind.REAL_ROBOT: _switch_body,
    Kind.SIMULATED_ROBOT: _switch_body,
    Kind.SPECIAL_REQUEST: _special,
    **dict.fromkeys(PARTS, _part),
    **dict.fromkeys((Kind.DRAW_ROBOT, Kind.DRAW_LINE, Kind.DRAW_ARC), _draw),
    **dict.fromkeys(ERASED, _refresh),
}
"""What every request does that neither connects nor is a command."""

RELAYED = frozenset({*COMMANDS, *PARTS, Kind.GS, Kind.CT, Kind.WS, Kind.TK, Kind.SPECIAL_REQUEST})
"""What a real robot is asked instead of the simulated one. The rest is about the world, which is simulated."""


# User packets: bytes, one in each word, that Nserver passes on to what is built upon a robot.

HEAD = Struct("<HBB")
ZERO, WAIT, MOVE = 40, 41, 42
"""Types of the arm's packets."""
DATA = {ZERO: 2, WAIT: 8, MOVE: 16}
"""Bytes of their data: a mode; two flags and a time to wait; four numbers."""
WAIT_TIME = slice(4, 8)
DONE = bytes(4)
"""The result: no fault."""


def packet_reply(words: Sequence[int]) -> bytes:
    """The packet that answers a packet, a byte for each word. Raises Refusal if nobody understands it."""
    if not all(0 <= word <= 0xFF for word in words):
        raise Refusal("a user packet has one byte in each word")
    packet = bytes(words)
    length, serial, kind = HEAD.unpack_from(packet)
    data = packet[HEAD.size :]
    if length != len(packet):
        raise Refusal(f"a user packet says that it has {length} bytes, and has {len(packet)}")
    if len(data) != DATA.get(kind):
        raise Refusal(f"nobody here understands a user packet of type {kind} with {len(data)} bytes of data")
    answer = DONE + data[WAIT_TIME] if kind == WAIT else DONE
    return HEAD.pack(HEAD.size + len(answer), serial, kind) + answer
