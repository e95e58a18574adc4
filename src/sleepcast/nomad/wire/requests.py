"""The requests of the wire by number and name: how many words each takes, and what kind of reply it gets.

Lengths are tenths of inches, angles tenths of degrees. Of a body on two wheels the three axes are the right wheel, the
left wheel and nothing; of one that steers they are translation, steering and turret.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from sleepcast.nomad.wire.encoding import MAX_WORDS
from sleepcast.robot import Axes

MAX_CORNERS = 10
"""Of a polygon on the wire."""


class RequestType(IntEnum):
    """Types of requests, by the names of the functions that send them."""

    AC = 10
    SP = 11
    VM = 12
    PR = 13
    GS = 15
    CT = 16
    ST = 17
    LP = 18
    TK = 19
    ZR = 20
    DP = 21
    CONF_IR = 22
    CONF_SN = 23
    CONF_CP = 24
    CONF_LS = 25
    CONF_TM = 26
    GET_IR = 27
    GET_SN = 28
    GET_RC = 29
    GET_RV = 30
    GET_RA = 31
    GET_CP = 32
    GET_LS = 33
    GET_BP = 35
    CONF_SG = 36
    GET_SG = 37
    DA = 38
    WS = 39
    PLACE_ROBOT = 41
    PREDICT_SENSORS = 42
    MV = 43
    ADD_OBSTACLE = 50
    DELETE_OBSTACLE = 51
    MOVE_OBSTACLE = 52
    NEW_WORLD = 53
    DRAW_ROBOT = 60
    DRAW_LINE = 61
    DRAW_ARC = 62
    QUIT_SERVER = 70
    REAL_ROBOT = 71
    SIMULATED_ROBOT = 74
    GET_RPX = 75
    CREATE_ROBOT = 101
    CONNECT_ROBOT = 102
    DISCONNECT_ROBOT = 103
    REFRESH_ALL = 150
    REFRESH_ALL_TRACES = 151
    REFRESH_ACTUAL_TRACE = 152
    REFRESH_ENCODER_TRACE = 153
    REFRESH_ALL_SENSORS = 154
    REFRESH_BUMPER_SENSOR = 155
    REFRESH_INFRARED_SENSOR = 156
    REFRESH_SONAR_SENSOR = 157
    REFRESH_LASER_SENSOR = 158
    REFRESH_CLIENT_GRAPHICS = 159
    GET_ROBOT_CONF = 200
    SPECIAL_REQUEST = 300
    MOTION_CHECK = 400


class Reply(IntEnum):
    """Types of replies; a reply to what connects or is a request of the 200s and above has that request's type."""

    ROBOT_POSITIONS = 76
    STATE = 80
    MOVED = 81
    SIMPLE = 82
    INFRARED = 83
    SONAR = 84
    LASER = 85
    COMPASS = 86
    BUMPER = 87
    CONFIGURATION = 88
    VELOCITY = 89
    ACCELERATION = 90
    ERROR = 91


class ErrorCode(IntEnum):
    """What a reply of type ERROR says, in the client's State[44]."""

    MALFORMED = 4
    """No such request, or not with these words."""
    NO_ANSWER = 5
    """The real robot's server has not answered in time."""
    NO_CONNECTION = 111
    """This connection has no robot."""


class Shape(NamedTuple):
    """How many words a request has."""

    least: int
    most: int

    def __str__(self) -> str:
        return f"{self.least}" if self.least == self.most else f"{self.least} to {self.most}"


def _exactly(words: int, *kinds: RequestType) -> dict[int, Shape]:
    return {int(kind): Shape(words, words) for kind in kinds}


SHAPES: dict[int, Shape] = {
    **{int(kind): Shape(0, 0) for kind in RequestType},
    **_exactly(1, RequestType.CONF_CP, RequestType.CONF_TM),
    **_exactly(
        2,
        RequestType.CONNECT_ROBOT,
        RequestType.CREATE_ROBOT,
        RequestType.DISCONNECT_ROBOT,
        RequestType.DP,
        RequestType.DA,
    ),
    **_exactly(3, RequestType.AC, RequestType.SP, RequestType.VM, RequestType.PR, RequestType.CONF_SG),
    **_exactly(4, RequestType.WS, RequestType.PLACE_ROBOT, RequestType.PREDICT_SENSORS),
    **_exactly(5, RequestType.CONF_LS, RequestType.DRAW_ROBOT, RequestType.DRAW_LINE),
    **_exactly(6, RequestType.MV),
    **_exactly(7, RequestType.CT, RequestType.DRAW_ARC),
    **_exactly(8, RequestType.MOTION_CHECK),
    **_exactly(17, RequestType.CONF_IR, RequestType.CONF_SN),
    RequestType.TK: Shape(1, MAX_WORDS),
    RequestType.SPECIAL_REQUEST: Shape(4, MAX_WORDS),
    RequestType.ADD_OBSTACLE: Shape(7, 1 + 2 * MAX_CORNERS),
    RequestType.DELETE_OBSTACLE: Shape(7, 1 + 2 * MAX_CORNERS),
    RequestType.MOVE_OBSTACLE: Shape(9, 3 + 2 * MAX_CORNERS),
}
"""Of every request, by its type."""


class AxisMode(IntEnum):
    """What mv wants of an axis."""

    IGNORE = 0
    VELOCITY = 1
    POSITION = 2
    LIMP = 3
    ACCELERATION = 4
    SPEED = 5


def name_of(kind: int) -> str:
    """The function that sends this request, or `type N`."""
    try:
        return RequestType(kind).name.lower()
    except ValueError:
        return f"type {kind}"


def misfit(kind: int, size: int) -> str:
    """What is wrong with a request of this type and size, "" for nothing."""
    shape = SHAPES.get(kind)
    if shape is None:
        return f"there is no request of type {kind}"
    if not shape.least <= size <= shape.most:
        return f"{name_of(kind)} takes {shape} words, not {size}"
    return ""


def firing_order(words: Sequence[int]) -> tuple[int, ...]:
    """The sensors of an order list, which ends before the first entry that is none; each at most once."""
    order: list[int] = []
    for number in words:
        if not 0 <= number <= 15:
            break
        if number not in order:
            order.append(number)
    return tuple(order)


def moves(words: Sequence[int], mode: AxisMode, values: Axes) -> Axes:
    """Of the words of mv, what is wanted of the axes in this mode; NaN for the others. values: of all, in SI."""
    nothing = Axes()
    return Axes(*(value if words[2 * axis] == mode else nothing[axis] for axis, value in enumerate(values)))
