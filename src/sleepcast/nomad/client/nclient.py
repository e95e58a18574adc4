"""The functions of Nclient in Python, by their own names and in the wire's own units.

Lengths are tenths of inches, angles tenths of degrees; of a Scout the axes are right wheel, left wheel, nothing. What
brings news of the robot gives it as a `State`, and keeps it as `state`; what the server refuses raises `RequestError`.
`client.Nomad` has the same functions, and others with names and units for people of today.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from struct import Struct

from sleepcast.core.errors import MisuseError
from sleepcast.nomad.client.connection import Connection, NomadError
from sleepcast.nomad.wire.encoding import CONNECTING, MAX_WORDS
from sleepcast.nomad.wire.requests import MAX_CORNERS, AxisMode, Reply, RequestType, name_of
from sleepcast.nomad.wire.state import (
    BUMPER,
    COMPASS,
    ERROR,
    INFRARED,
    POS_BUMPER,
    POS_COMPASS,
    POS_INFRARED,
    POS_LASER,
    POS_SONAR,
    POSITION,
    RING,
    SONAR,
    VELOCITY,
    ReplyReader,
    State,
    read_state,
)
from sleepcast.nomad.wire.units import HUNDREDTHS, MILLIONTHS, word

TIMEOUT = 10.0
"""Seconds for an answer that takes no time by itself."""
LONGEST_WAY = 255.0
"""Seconds that a robot may take to come to rest, to turn home or to calibrate its compass."""
ALL = tuple(range(RING))
"""Sensors, in sequence."""
LINE_NUMBERS, POINT_NUMBERS = 4, 2
"""Numbers of a line, and of a point, that a laser has seen."""
ROTATION = 0.118597
"""1/10 in that each wheel of a Scout goes while it turns by 1/10 deg."""
MAX_ROBOTS = 1000
"""In an answer to `get_rpx`."""

Click = tuple[int, int, int, int]
"""x, y, steering, turret."""


class RefusedError(NomadError):
    """The server has no such robot."""


class RequestError(NomadError):
    """The server answered a request with an error. code: its number."""

    def __init__(self, name: str, code: int) -> None:
        super().__init__(f"the server refused {name} with error {code}; see whether this robot can do that")
        self.code = code


class Nclient:
    """One connection, for one robot; everything raises LostError when the connection is gone.

    timeout: seconds to wait for an answer, beyond what the request itself takes. big_endian_text: the server reads the
    text of `tk` as from a big-endian computer.
    """

    def __init__(self, connection: Connection, *, timeout: float = TIMEOUT, big_endian_text: bool = False) -> None:
        self.connection, self.timeout = connection, timeout
        self.state = State()
        """The robot's latest state."""
        self.mask: list[int] = []
        """Which of State[1] to State[43] the server measures (1) or not (0), and at place 0 the bits of those sensors
        that are to come with a record of where they measured; `ct` tells it."""
        self.robot = 0
        self._laser_numbers = POINT_NUMBERS
        self._big_endian_text = big_endian_text
        self.init_mask()

    # ---- a connection

    def connect_robot(self, robot: int) -> State:
        """Take over a robot, from 1; the one that this connection had is let go. Raises RefusedError."""
        self.create_robot(robot, RequestType.CONNECT_ROBOT)
        self.init_mask()
        return self.ct()

    def create_robot(self, robot: int, kind: RequestType = RequestType.CREATE_ROBOT) -> None:
        """The same without asking for its state. Raises RefusedError."""
        self.robot = 0
        (port,) = self._ask(kind, (robot, os.getpid())).take(1)
        if not port:
            peer = self.connection.peer
            raise RefusedError(f"{peer} has no robot {robot}; they are numbered from 1, as many as it was started with")
        self.robot = robot

    def disconnect_robot(self) -> None:
        """Let go of the robot, which keeps its last setpoint until its timeout (`conf_tm`), and hang up."""
        if self.connection.open and self.robot:
            self.connection.send(RequestType.DISCONNECT_ROBOT, (self.robot, os.getpid()))
        self.robot = 0
        self.connection.close()

    def quit_server(self) -> None:
        """End the server, where it allows that."""
        self._ask(RequestType.QUIT_SERVER)

    def real_robot(self) -> None:
        """From here on, drive the real robot that the server knows."""
        self._ask(RequestType.REAL_ROBOT)

    def simulated_robot(self) -> None:
        """From here on, drive the simulated one again."""
        self._ask(RequestType.SIMULATED_ROBOT)

    # ---- moving

    def ac(self, first: int, second: int, third: int = 0) -> State:
        """Accelerations, 1/10 in/s2 or 1/10 deg/s2."""
        return self._state(RequestType.AC, first, second, third)

    def sp(self, first: int, second: int, third: int = 0) -> State:
        """Speeds at which `pr` goes, 1/10 in/s or 1/10 deg/s."""
        return self._state(RequestType.SP, first, second, third)

    def vm(self, first: int, second: int, third: int = 0) -> State:
        """Go on at these velocities, 1/10 in/s or 1/10 deg/s."""
        return self._state(RequestType.VM, first, second, third)

    def pr(self, first: int, second: int, third: int = 0) -> State:
        """Go so far and rest there, 1/10 in or 1/10 deg."""
        return self._state(RequestType.PR, first, second, third)

    def scout_vm(self, along: int, turn: int) -> State:
        """Drive a Scout on at a speed along its heading, 1/10 in/s, and a rate of turning, 1/10 deg/s."""
        return self.vm(*_wheels(along, turn))

    def scout_pr(self, along: int, turn: int) -> State:
        """Drive a Scout so far, 1/10 in, or turn it so far, 1/10 deg, or both at once."""
        return self.pr(*_wheels(along, turn))

    def mv(self, first: tuple[int, int], second: tuple[int, int], third: tuple[int, int] = (0, 0)) -> State:
        """For each axis a mode (see `requests.Mode`) and its value. Raises MisuseError for a mode that is none."""
        for mode, _ in (first, second, third):
            if mode not in set(AxisMode):
                raise MisuseError(f"mv takes the modes 0 to {max(AxisMode)}, not {mode}")
        return self._state(RequestType.MV, *first, *second, *third)

    def st(self) -> State:
        """Stop and hold the position."""
        return self._state(RequestType.ST)

    def lp(self) -> State:
        """Let the motors go limp."""
        return self._state(RequestType.LP)

    def ws(self, first: bool, second: bool, third: bool = False, seconds: int = 0) -> State:
        """Wait until these axes are still, for so many seconds at most (0..255; 0: until they are)."""
        return self._state(RequestType.WS, int(first), int(second), int(third), seconds, longer=seconds or LONGEST_WAY)

    def zr(self) -> State:
        """Turn home and be at the origin."""
        return self._state(RequestType.ZR, longer=LONGEST_WAY)

    def dp(self, x: int, y: int) -> State:
        """Say where the robot is to believe to be."""
        return self._state(RequestType.DP, x, y)

    def da(self, steering: int, turret: int) -> State:
        """Say how the robot is to believe to stand."""
        return self._state(RequestType.DA, steering, turret)

    def place_robot(self, x: int, y: int, steering: int, turret: int) -> None:
        """Put a simulated robot somewhere."""
        self._ask(RequestType.PLACE_ROBOT, (x, y, steering, turret))

    # ---- what is measured, and how

    def gs(self) -> State:
        """Ask for the state."""
        return self._state(RequestType.GS)

    def init_mask(self) -> None:
        """Set `mask` to everything that a state has, without telling the server."""
        self.mask[:] = [0, *(1,) * 43]

    def ct(self) -> State:
        """Tell the server what to measure: `mask`."""
        return self._state(RequestType.CT, *mask_words(self.mask))

    def conf_tm(self, seconds: int) -> State:
        """Stop the robot when nothing is asked for so long, 0..255; 0: never."""
        return self._state(RequestType.CONF_TM, seconds)

    def conf_sn(self, rate: int, order: Sequence[int] = ALL) -> State:
        """Fire these sonars one after the other, `rate` times 4 ms (0..255) after the echo before; none: off."""
        return self._state(RequestType.CONF_SN, rate, *order_words("conf_sn", order))

    def conf_ir(self, history: int, order: Sequence[int] = ALL) -> State:
        """Use these infrared sensors, and the mean of so many readings (0..10)."""
        return self._state(RequestType.CONF_IR, history, *order_words("conf_ir", order))

    def conf_cp(self, mode: int) -> State:
        """Turn the compass off (0) or on (1), or calibrate it (2)."""
        return self._state(RequestType.CONF_CP, mode, longer=LONGEST_WAY)

    def conf_ls(self, mode: int, threshold: int, width: int, numbers: int, processing: int) -> State:
        """Set up the laser."""
        self._laser_numbers = LINE_NUMBERS if mode in (1, 33) else POINT_NUMBERS if mode in (19, 50, 51) else 1
        return self._state(RequestType.CONF_LS, mode, threshold, width, numbers, processing)

    def conf_sg(self, threshold: int, least: int, gap: int) -> State:
        """Set up how the laser finds lines."""
        return self._state(RequestType.CONF_SG, threshold, least, gap)

    def get_sn(self) -> State:
        """Ask for the sonars alone."""
        return self._sensor(RequestType.GET_SN, SONAR, RING, POS_SONAR)

    def get_ir(self) -> State:
        """Ask for the infrared sensors alone."""
        return self._sensor(RequestType.GET_IR, INFRARED, RING, POS_INFRARED)

    def get_bp(self) -> State:
        """Ask for the bumper alone."""
        return self._sensor(RequestType.GET_BP, BUMPER, 1, POS_BUMPER)

    def get_cp(self) -> State:
        """Ask for the compass alone."""
        return self._sensor(RequestType.GET_CP, COMPASS, 1, POS_COMPASS)

    def get_ls(self) -> State:
        """Ask for the laser's points alone."""
        return self._scan(RequestType.GET_LS, self._laser_numbers)

    def get_sg(self) -> State:
        """Ask for the laser's lines alone."""
        return self._scan(RequestType.GET_SG, LINE_NUMBERS)

    def get_rc(self) -> State:
        """Ask where the robot believes to be."""
        return self._news(self.state.with_words(POSITION, self._ask(RequestType.GET_RC).take(4)))

    def get_rv(self) -> State:
        """Ask how fast its axes turn."""
        return self._news(self.state.with_words(VELOCITY, self._ask(RequestType.GET_RV).take(3)))

    def get_ra(self) -> tuple[int, ...]:
        """Ask for the accelerations of its three axes."""
        return self._ask(RequestType.GET_RA).take(3)

    def get_robot_conf(self, seconds: float | None = None) -> Click:
        """Have the person at the server click where the robot is. seconds: to wait at most; None: for ever."""
        x, y, steering, turret = self._ask(RequestType.GET_ROBOT_CONF, longer=seconds).take(4)
        return x, y, steering, turret

    def get_rpx(self) -> tuple[tuple[int, ...], ...]:
        """Ask for all robots: three numbers for each."""
        answer = self._ask(RequestType.GET_RPX)
        (count,) = answer.take(1)
        if not 0 <= count <= MAX_ROBOTS:
            raise self.connection.distrust(f"it claims to have {count} robots")
        return tuple(answer.take(3) for _ in range(count))

    # ---- the world, the windows, and the rest

    def tk(self, text: str) -> None:
        """Say a text."""
        self._ask(RequestType.TK, text_words(text, big_endian=self._big_endian_text))

    def add_obstacle(self, corners: Corners) -> None:
        """Put up a polygon."""
        self._ask(RequestType.ADD_OBSTACLE, corner_words("add_obstacle", corners))

    def delete_obstacle(self, corners: Corners) -> None:
        """Take the polygon with these corners away."""
        self._ask(RequestType.DELETE_OBSTACLE, corner_words("delete_obstacle", corners))

    def move_obstacle(self, corners: Corners, across: int, up: int) -> Corners:
        """Move the polygon with these corners; gives where they are then."""
        answer = self._ask(RequestType.MOVE_OBSTACLE, corner_words("move_obstacle", corners, across, up))
        answer.take(1)
        return tuple((x, y) for x, y in (answer.take(2) for _ in corners))

    def new_world(self) -> None:
        """Take every obstacle away."""
        self._ask(RequestType.NEW_WORLD)

    def predict_sensors(self, x: int, y: int, steering: int, turret: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """What the infrared sensors and the sonars would read there."""
        answer = self._ask(RequestType.PREDICT_SENSORS, (x, y, steering, turret))
        answer.take(INFRARED)
        return answer.take(RING), answer.take(RING)

    def motion_check(self, sort: int, *numbers: float) -> tuple[float, float, float] | None:
        """Whether a way is free: None, or where the body would touch something (x, y) and the direction from there back
        into the body (rad).

        sort 0: a straight way, numbers x, y of both ends. 1: an arc, numbers x, y of the start, both angles (rad), the
        radius, x, y of the centre. Raises MisuseError.
        """
        if len(numbers) != {0: 4, 1: 7}.get(sort):
            raise MisuseError("motion_check takes 0 and the 4 numbers of a straight way, or 1 and the 7 of an arc")
        angles = (2, 3) if sort else ()
        scaled = [word(n * (MILLIONTHS if i in angles else HUNDREDTHS)) for i, n in enumerate(numbers)]
        answer = self._ask(RequestType.MOTION_CHECK, (sort, *scaled, *(0,) * (7 - len(scaled))))
        touches, x, y, normal = answer.take(4)
        return (x / HUNDREDTHS, y / HUNDREDTHS, normal / MILLIONTHS) if touches else None

    def draw_robot(self, x: int, y: int, steering: int, turret: int, mode: int = 1) -> None:
        """Draw a robot into the World window."""
        self._ask(RequestType.DRAW_ROBOT, (x, y, steering, turret, mode))

    def draw_line(self, x1: int, y1: int, x2: int, y2: int, mode: int = 1) -> None:
        """Draw a line."""
        self._ask(RequestType.DRAW_LINE, (x1, y1, x2, y2, mode))

    def draw_arc(self, left: int, top: int, width: int, height: int, begin: int, end: int, mode: int = 1) -> None:
        """Draw an arc of the ellipse in a box, from one angle to the other."""
        self._ask(RequestType.DRAW_ARC, (left, top, width, height, begin, end, mode))

    def refresh(self, layer: RequestType = RequestType.REFRESH_ALL) -> None:
        """Erase a layer of the windows, one of `RequestType.REFRESH_...`."""
        self._ask(layer)

    def special_request(self, serial: int, kind: int, data: bytes = b"", seconds: float = TIMEOUT) -> bytes:
        """Send a user packet; gives the packet that answers it, all of it."""
        answer = self._ask(RequestType.SPECIAL_REQUEST, packet_words(serial, kind, data), longer=seconds)
        return bytes(number & 0xFF for number in answer.rest())

    # ---- asking

    def _state(self, kind: RequestType, *words: int, longer: float = 0.0) -> State:
        """What a request gives that is answered with the state."""
        return self._news(read_state(self._ask(kind, words, longer), self._laser_numbers, self.mask[0]))

    def _sensor(self, kind: RequestType, first: int, count: int, bit: int) -> State:
        """What a request gives that is answered with some numbers of the state, when and perhaps where measured."""
        answer = self._ask(kind)
        state = self.state.with_words(first, answer.take(count))
        return self._measured(state, answer, bit)

    def _scan(self, kind: RequestType, numbers: int) -> State:
        answer = self._ask(kind)
        state = replace(self.state, laser=answer.laser(numbers), laser_numbers=numbers)
        return self._measured(state, answer, POS_LASER)

    def _measured(self, state: State, answer: ReplyReader, bit: int) -> State:
        stamps = {**state.stamps, **answer.stamps(self.mask[0] & bit)}
        (clock,) = answer.take(1)
        return self._news(replace(state, stamps=stamps, clock=clock))

    def _news(self, state: State) -> State:
        self.state = state
        return state

    def _ask(self, kind: RequestType, words: Sequence[int] = (), longer: float | None = 0.0) -> ReplyReader:
        """Send a request. longer: seconds that it may take by itself, None for as long as it does. Raises LostError,
        RequestError, and MisuseError for words that are none."""
        seconds = None if longer is None else self.timeout + longer
        reply = self.connection.ask(kind, in_words(name_of(kind), words), seconds)
        if reply.type == Reply.ERROR and kind not in CONNECTING:
            code = reply.words[0] if reply.words else 0
            self.state = self.state.with_words(ERROR, (code,))
            raise RequestError(name_of(kind), code)
        return ReplyReader(reply.words, self.connection.distrust)


def _wheels(along: int, turn: int) -> tuple[int, int]:
    """The right and the left wheel of a Scout; cut off to whole numbers as Nclient does it."""
    part = int(turn * ROTATION)
    return along + part, along - part


# How a program's values look as the words of a request: masks, orders, texts, corners, packets; pure, and bounded.

MASK_ENTRIES = 44
"""Of a mask: the records wanted, then one for each of State[1] to State[43]."""
END_OF_ORDER = 255
"""Stands behind the last sensor of an order that has fewer than all."""

Corners = Sequence[tuple[int, int]]
"""Of a polygon, counter-clockwise, x and y in tenths of inches."""


def in_words(name: str, numbers: Sequence[int]) -> tuple[int, ...]:
    """Numbers for the function `name`. Raises MisuseError for what no word can hold."""
    for number in numbers:
        if word(number) != number:
            raise MisuseError(f"{name} takes whole numbers of at most 32 bits, not {number!r:.40}; round it first")
    return tuple(map(word, numbers))


def mask_words(mask: Sequence[int]) -> tuple[int, ...]:
    """The words of `ct` for a mask: an entry above 0 is on. Raises MisuseError for one of another length."""
    if len(mask) != MASK_ENTRIES:
        raise MisuseError(f"a mask has {MASK_ENTRIES} entries, not {len(mask)}")
    on = [int(entry > 0) for entry in mask]
    bytes_ = [sum(bit << place for place, bit in enumerate(on[first : first + 8])) for first in range(1, 41, 8)]
    return (*bytes_, on[0] | on[41] << 1 | on[42] << 2 | on[43] << 3, mask[0] & 0xFF)


def order_words(name: str, order: Sequence[int]) -> tuple[int, ...]:
    """The order in which sensors work, ended where there are fewer than all. Raises MisuseError."""
    if len(order) > RING or any(number not in range(RING) for number in order):
        raise MisuseError(f"{name} takes at most {RING} sensors, each 0 to {RING - 1}, not {list(order)!r:.80}")
    return (*order, *(END_OF_ORDER,) * (RING - len(order)))


def text_words(text: str, *, big_endian: bool) -> tuple[int, ...]:
    """A text for `tk`, as a program's memory holds it: four characters a word, and a zero at its end. big_endian: of a
    computer that has the first of them in the word's highest byte. Raises MisuseError for one that is too long."""
    data = text.encode("latin-1", "replace").replace(b"\0", b" ")
    if len(data) >= 4 * MAX_WORDS:
        raise MisuseError(f"tk takes at most {4 * MAX_WORDS - 1} bytes of text, not {len(data)}")
    data += bytes(4 - len(data) % 4)
    return Struct(f"{'>' if big_endian else '<'}{len(data) // 4}i").unpack(data)


def corner_words(name: str, corners: Corners, *more: int) -> tuple[int, ...]:
    """A polygon: how many corners, then each. Raises MisuseError for fewer than 3 or more than an obstacle may have."""
    if not 3 <= len(corners) <= MAX_CORNERS:
        raise MisuseError(f"{name} takes 3 to {MAX_CORNERS} corners, not {len(corners)}")
    return (len(corners), *(number for corner in corners for number in corner), *more)


def packet_words(serial: int, kind: int, data: bytes) -> tuple[int, ...]:
    """A user packet, one byte a word: its length (of all, low byte first), serial number, type and data. Raises
    MisuseError for one that is too long."""
    length = len(data) + 4
    if length > MAX_WORDS:
        raise MisuseError(f"a packet has at most {MAX_WORDS - 4} bytes of data, not {len(data)}")
    return (length & 0xFF, length >> 8, serial & 0xFF, kind & 0xFF, *data)
