"""The effect and the reply of each request.

Every request has one reply, except the one that disconnects. What is asked without a robot, or in the wrong words, is
answered with an error, so that no client is left waiting; what connects gets a 0, because a client takes any error for
success.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from struct import Struct
from typing import Literal

from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.nomad.server.relay import Pending, Relay
from sleepcast.nomad.server.session import Answer, ClientSession, Refusal, Wait, Words
from sleepcast.nomad.server.simulated_robot import COMMANDS, LONGEST_TIMEOUT, MOTIONS, NO_LASER, STOPS, SimulatedRobot
from sleepcast.nomad.server.windows import LAYERS, SENSORS, TRACES, Layer, Sketch
from sleepcast.nomad.wire import units
from sleepcast.nomad.wire.encoding import CONNECTING, Request, text_of
from sleepcast.nomad.wire.requests import ErrorCode, Reply, RequestType, misfit, name_of
from sleepcast.nomad.wire.state import (
    BUMPER,
    COMPASS,
    ENTRIES,
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
    ring,
    tail,
)
from sleepcast.robot import Contact, Pose, SimulatedWorld


def answer(session: ClientSession, request: Request) -> Answer:
    """Do what a request asks; errors are printed at the terminal and sent to the client."""
    try:
        return take(session, request)
    except Refusal as refusal:
        session.service.say(f"{session.name}: {refusal.text}: refused")
        if request.type in CONNECTING:
            return session.reply(request.type, (0,))
        return session.error(refusal)


def take(session: ClientSession, request: Request) -> Answer:
    """Do what a request asks. Raises Refusal."""
    kind, words, size = request
    wrong = misfit(kind, size)
    if wrong:
        raise Refusal(wrong)
    if kind in CONNECTING:
        return _connecting(session, kind, words)
    simulated_robot = session.simulated_robot
    if simulated_robot is None:
        raise Refusal(f"{name_of(kind)} came without a robot", ErrorCode.NO_CONNECTION)
    if session.relay is not None and kind in RELAYED:
        return _relayed(session, session.relay, simulated_robot, kind, words)
    try:
        if kind in COMMANDS:
            return _command(session, simulated_robot, kind, words)
        simulated_robot.alive()
        return HANDLERS[kind](session, simulated_robot, kind, words)
    except SleepcastError as error:
        raise Refusal(f"{name_of(kind)}: {error}") from None


def _connecting(session: ClientSession, kind: int, words: Words) -> Answer:
    if kind == RequestType.DISCONNECT_ROBOT:
        session.disconnect()
        return None
    session.connect(*words)
    return session.reply(kind, (session.service.port,))


def _relayed(session: ClientSession, relay: Relay, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    """Ask the real robot, which is not moved while all robots are held."""
    if kind == RequestType.CT:
        session.mask.configure(words)
    pending: Pending = relay.ask(*((RequestType.ST, ()) if simulated_robot.held and kind in MOTIONS else (kind, words)))

    def ready() -> bytes | None:
        if pending.reply is not None:
            return session.reply(*pending.reply)
        return session.error(Refusal("", ErrorCode.NO_ANSWER)) if relay.broken else None

    return ready() or Wait(ready, ticks=False)


def _command(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    """Command the robot; the reply has the state once that is done, if it is something that takes its time."""
    if kind in MOTIONS or kind in STOPS:
        session.drive(simulated_robot, kind)
    if kind == RequestType.CONF_TM:
        simulated_robot.timed_by = session.name
    simulated_robot.command(kind, words)
    if kind == RequestType.PLACE_ROBOT:
        return session.reply(Reply.SIMPLE)
    if kind == RequestType.ZR:
        return Wait(lambda: None if simulated_robot.zeroing else session.state(simulated_robot))
    return _state(session, simulated_robot, kind, words)


# ---- what the robot tells


def _state(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    if session.service.lockstep:
        return Wait(lambda: session.state(simulated_robot))
    return session.state(simulated_robot)


def _set_mask(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    session.mask.configure(words)
    return _state(session, simulated_robot, kind, words)


@dataclass(frozen=True, slots=True)
class StatePart:
    """A stretch of the state vector with a reply of its own. posdata: bit of its sensors; clock: whether it follows."""

    reply: Reply
    begin: int
    end: int
    posdata: int = 0
    clock: bool = True


PARTS: dict[int, StatePart] = {
    RequestType.GET_IR: StatePart(Reply.INFRARED, INFRARED, SONAR, POS_INFRARED),
    RequestType.GET_SN: StatePart(Reply.SONAR, SONAR, BUMPER, POS_SONAR),
    RequestType.GET_RC: StatePart(Reply.CONFIGURATION, POSITION, VELOCITY, clock=False),
    RequestType.GET_RV: StatePart(Reply.VELOCITY, VELOCITY, MOTORS, clock=False),
    RequestType.GET_RA: StatePart(Reply.ACCELERATION, 0, 0, clock=False),
    RequestType.GET_CP: StatePart(Reply.COMPASS, COMPASS, COMPASS + 1, POS_COMPASS),
    RequestType.GET_LS: StatePart(Reply.LASER, 0, 0, POS_LASER),
    RequestType.GET_SG: StatePart(Reply.LASER, 0, 0, POS_LASER),
    RequestType.GET_BP: StatePart(Reply.BUMPER, BUMPER, POSITION, POS_BUMPER),
}


def _part(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    part = PARTS[kind]

    def reply() -> bytes:
        if part.reply is Reply.LASER:
            block = list(NO_LASER)
        elif part.reply is Reply.ACCELERATION:
            block = list(simulated_robot.accelerations)
        else:
            block = simulated_robot.state()[part.begin : part.end]
        if part.clock:
            block += simulated_robot.posdata(session.mask.posdata & part.posdata)
            block.append(tail(simulated_robot.condition())[0])
        return session.reply(part.reply, block)

    return session.in_time(reply)


def _wait_until_stopped(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    """0 as the time to wait means for as long as it takes."""
    *flags, timeout = words
    world = session.service.world
    until = world.time + min(timeout, LONGEST_TIMEOUT) if timeout > 0 else float("inf")

    def ready() -> bytes | None:
        if simulated_robot.stopped(flags) or world.time >= until:
            return session.state(simulated_robot)
        return None

    return Wait(ready) if session.service.lockstep else ready() or Wait(ready)


def _positions(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    """x, y and steering of each robot, where it really is."""

    def reply() -> bytes:
        poses = [position(each.condition().real) for each in session.service.simulated_robots]
        return session.reply(Reply.ROBOT_POSITIONS, [len(poses), *(word for pose in poses for word in pose[:3])])

    return session.in_time(reply)


# ---- the world and the windows


def _speak(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    text = text_of(words, session.service.tk_order)
    simulated_robot.window.said.append((session.service.world.time, text))
    session.service.say(f"robot {session.robot + 1} says: {text}")
    return session.reply(Reply.SIMPLE)


def _change_obstacle(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    corners = polygon(words)
    world = session.service.world
    if not (world.add(corners) if kind == RequestType.ADD_OBSTACLE else world.remove(corners)):
        why = "is none, or the world is full" if kind == RequestType.ADD_OBSTACLE else "is not there"
        raise Refusal(f"{name_of(kind)}: the polygon {why}")
    return session.reply(Reply.SIMPLE)


def _move_obstacle(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    """A client copies as many words as it has sent for the corners, whatever comes: so they come, moved or not."""
    across, up = words[-2:]
    if session.service.world.move(polygon(words, more=2), units.metres(across), units.metres(up)):
        return session.reply(Reply.MOVED, moved(words))
    session.service.say(f"{session.name}: move_obstacle: the polygon is not there, or cannot be put there")
    return session.reply(Reply.MOVED, words[:-2])


def _new_world(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    session.service.world.clear()
    return session.reply(Reply.SIMPLE)


def _draw(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    session.service.windows.sketches.append(sketch(kind, words))
    return session.reply(Reply.SIMPLE)


def _refresh(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    session.service.windows.erase(session.robot, ERASED[kind])
    return session.reply(Reply.SIMPLE)


def _predict(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    return session.reply(Reply.STATE, prediction(session.service.world, session.robot, simulated_robot.pose(words)))


def _check_motion(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    return session.reply(kind, checked(session.service.world, session.robot, words))


def _ask_for_click(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    """The place of the next click, or at once where the robot believes to be if there are no windows."""

    def reply() -> bytes | None:
        x, y, heading, turret = position(simulated_robot.condition().believed)
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


def _quit(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    if not session.service.may_quit:
        raise Refusal("quit_server is not permitted here (--may-quit permits it)")
    session.service.say(f"{session.name} ends the server")
    session.service.quitting = True
    return session.reply(Reply.SIMPLE)


def _switch_body(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    if kind == RequestType.REAL_ROBOT:
        session.take_real()
    else:
        session.let_real_go()
    return session.reply(Reply.SIMPLE)


def _special(session: ClientSession, simulated_robot: SimulatedRobot, kind: int, words: Words) -> Answer:
    return session.reply(kind, packet_reply(words))


ERASED: dict[int, tuple[Layer, ...]] = {
    RequestType.REFRESH_ALL: LAYERS,
    RequestType.REFRESH_ALL_TRACES: TRACES,
    RequestType.REFRESH_ACTUAL_TRACE: ("actual",),
    RequestType.REFRESH_ENCODER_TRACE: ("encoder",),
    RequestType.REFRESH_ALL_SENSORS: SENSORS,
    RequestType.REFRESH_BUMPER_SENSOR: ("bumper",),
    RequestType.REFRESH_INFRARED_SENSOR: ("infrared",),
    RequestType.REFRESH_SONAR_SENSOR: ("sonar",),
    RequestType.REFRESH_LASER_SENSOR: ("laser",),
    RequestType.REFRESH_CLIENT_GRAPHICS: ("graphics",),
}
"""The layers of the windows that each request clears."""

HANDLERS: dict[int, Callable[[ClientSession, SimulatedRobot, int, Words], Answer]] = {
    RequestType.GS: _state,
    RequestType.CT: _set_mask,
    RequestType.WS: _wait_until_stopped,
    RequestType.GET_RPX: _positions,
    RequestType.TK: _speak,
    RequestType.ADD_OBSTACLE: _change_obstacle,
    RequestType.DELETE_OBSTACLE: _change_obstacle,
    RequestType.MOVE_OBSTACLE: _move_obstacle,
    RequestType.NEW_WORLD: _new_world,
    RequestType.PREDICT_SENSORS: _predict,
    RequestType.MOTION_CHECK: _check_motion,
    RequestType.GET_ROBOT_CONF: _ask_for_click,
    RequestType.QUIT_SERVER: _quit,
    RequestType.REAL_ROBOT: _switch_body,
    RequestType.SIMULATED_ROBOT: _switch_body,
    RequestType.SPECIAL_REQUEST: _special,
    **dict.fromkeys(PARTS, _part),
    **dict.fromkeys((RequestType.DRAW_ROBOT, RequestType.DRAW_LINE, RequestType.DRAW_ARC), _draw),
    **dict.fromkeys(ERASED, _refresh),
}
"""What every request does that neither connects nor is a command."""

RELAYED = frozenset(
    {*COMMANDS, *PARTS, RequestType.GS, RequestType.CT, RequestType.WS, RequestType.TK, RequestType.SPECIAL_REQUEST}
)
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
    """The packet that answers a packet, a byte for each word. Raises Refusal for an unknown one."""
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


# ---- the world: polygons, drawings, predicted readings and checked motions

Corners = list[tuple[float, float]]

LEAST_CORNERS = 3
SEGMENT, ARC = 0, 1
"""The ways that motion_check knows."""


def polygon(words: Words, more: int = 0) -> Corners:
    """n, x1, y1 ... xn, yn and so many more words as corners in m. Raises Refusal if that is not what they are."""
    corners = words[0]
    if corners < LEAST_CORNERS or len(words) != 1 + 2 * corners + more:
        raise Refusal(f"a polygon of {corners} corners in {len(words)} words")
    lengths = [units.metres(word) for word in words[1 : 1 + 2 * corners]]
    return list(zip(lengths[::2], lengths[1::2], strict=True))


def moved(words: Words) -> list[int]:
    """The polygon of move_obstacle, in words, after the move."""
    across, up = words[-2:]
    return [words[0], *(units.word(word + (up if place % 2 else across)) for place, word in enumerate(words[1:-2]))]


def sketch(kind: int, words: Words) -> Sketch:
    """What one of the drawing requests draws."""
    name: dict[int, Literal["robot", "line", "arc"]] = {RequestType.DRAW_ROBOT: "robot", RequestType.DRAW_LINE: "line"}
    lengths = {RequestType.DRAW_ROBOT: 2}.get(RequestType(kind), 4)
    *numbers, mode = words
    placed = [units.metres(number) for number in numbers[:lengths]]
    turned = [units.radians(number) for number in numbers[lengths:]]
    return Sketch(name.get(kind, "arc"), (*placed, *turned), mode)


def prediction(world: SimulatedWorld, robot: int, pose: Pose) -> list[int]:
    """The words of the reply to predict_sensors: an unused one, the sensors, unused ones, and an empty laser block."""
    sonars, infrared = world.predict(robot, pose)
    words = [0] * ENTRIES
    words[INFRARED:SONAR] = ring(infrared, units.infrared, units.NOTHING_NEAR)
    words[SONAR:BUMPER] = ring(sonars, units.inches, units.NOTHING_HEARD)
    return words


def checked(world: SimulatedWorld, robot: int, words: Words) -> list[int]:
    """The words of the reply to motion_check. Raises Refusal for a way of a kind that there is not."""
    start = (_hundredths(words[1]), _hundredths(words[2]))
    if words[0] == SEGMENT:
        met = world.along(robot, start, (_hundredths(words[3]), _hundredths(words[4])))
    elif words[0] == ARC:
        centre = (_hundredths(words[6]), _hundredths(words[7]))
        begin, end = words[3] / units.MILLIONTHS, words[4] / units.MILLIONTHS
        met = world.round(robot, centre, _hundredths(words[5]), begin, end)
    else:
        raise Refusal(f"motion_check knows ways of types {SEGMENT} and {ARC}, not {words[0]}")
    return [0, 0, 0, 0] if met is None else _contact(met)


def _contact(met: Contact) -> list[int]:
    x, y = (units.word(length / units.TENTH * units.HUNDREDTHS) for length in (met.x, met.y))
    return [1, x, y, units.word(met.normal * units.MILLIONTHS)]


def _hundredths(word: int) -> float:
    return units.metres(word / units.HUNDREDTHS)
