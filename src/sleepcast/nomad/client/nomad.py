"""A robot behind a Nserver, for Python programs; every call waits for the server's reply, as in Nclient.

    with Nomad.connect("127.0.0.1", 7019, robot=1) as nomad:
        nomad.stop_after(1)
        while min(nomad.drive(0.2, 0.2).sonars[:4]) > 0.5:
            pass

Names that can be read take and give SI units, and angles in rad counter-clockwise; Nclient's own short names (`vm`,
`pr`, `gs`, `conf_sn`; see `nclient`) take and give the wire's tenths. A `State` has both. At the end of the `with` the
robot is brought to rest; `conf_tm` stops it if the program dies before.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from math import cos, sin
from types import TracebackType
from typing import NamedTuple, Self

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.nomad.client.connection import Connection, LostError, NomadError
from sleepcast.nomad.client.nclient import ALL, TIMEOUT, Nclient, RefusedError, RequestError
from sleepcast.nomad.wire.requests import RequestType
from sleepcast.nomad.wire.state import Stamp, State
from sleepcast.nomad.wire.units import (
    CONFIGURED_PAUSE,
    INCH,
    INFRARED_STEP,
    TENTH,
    direction,
    metres,
    radians,
    tenth_degrees,
    tenths,
)

__all__ = ["Kind", "LostError", "Nomad", "NomadError", "Pose", "RefusedError", "RequestError", "Stamp", "State"]

Kind = RequestType
"""The name that programs know."""
HOST, PORT = "127.0.0.1", 7019
"""Where a server listens unless somebody says otherwise."""
PARTING_SECONDS = 2.0
"""For bringing the robot to rest at the end: a server that does not even do that is not waited for."""

Points = Sequence[tuple[float, float]]
"""Corners of a polygon, counter-clockwise, x and y in m."""
LAYERS = tuple(kind.name.removeprefix("REFRESH_").lower() for kind in RequestType if kind.name.startswith("REFRESH_"))
"""Of the server's windows, as `erase` takes them."""


class Pose(NamedTuple):
    """A place: x, y in m, heading and turret in rad."""

    x: float
    y: float
    heading: float = 0.0
    turret: float = 0.0


class Nomad(Nclient):
    """See the module and `Nclient`. On a Scout the axes are the right and the left wheel."""

    @classmethod
    def connect(
        cls,
        host: str = HOST,
        port: int = PORT,
        *,
        robot: int = 1,
        timeout: float = TIMEOUT,
        big_endian_text: bool = False,
    ) -> Self:
        """Connect to a server and take over a robot. Raises LostError if no server answers, RefusedError if it has no
        such robot."""
        nomad = cls(Connection(host, port), timeout=timeout, big_endian_text=big_endian_text)
        try:
            nomad.connect_robot(robot)
        except BaseException:
            nomad.connection.close()
            raise
        return nomad

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Bring the robot to rest, if it can still be reached, and let go of it."""
        if self.connection.open and self.robot:
            self.timeout = min(self.timeout, PARTING_SECONDS)
            with suppress(NomadError):  # what cannot be reached any more stops by its own timeout
                self.st()
        with suppress(LostError):
            self.disconnect_robot()

    # ---- moving

    def drive(self, right: float, left: float) -> State:
        """Turn the wheels at these speeds, m/s."""
        return self.vm(tenths(right), tenths(left))

    def travel(self, right: float, left: float) -> State:
        """Turn the wheels so far, m, and rest there."""
        return self.pr(tenths(right), tenths(left))

    def cruise(self, right: float, left: float) -> State:
        """How fast the wheels go for `travel`, m/s."""
        return self.sp(tenths(right), tenths(left))

    def accelerate(self, right: float, left: float) -> State:
        """How fast their speeds change, m/s2."""
        return self.ac(tenths(right), tenths(left))

    def stop(self) -> State:
        """Stop and hold the position."""
        return self.st()

    def limp(self) -> State:
        """Let the motors go limp."""
        return self.lp()

    def wait_until_still(self, seconds: int = 0) -> State:
        """Wait until the wheels are still, for so many seconds at most, 0 to 255; 0: until they are."""
        return self.ws(True, True, False, seconds)

    def zero(self) -> State:
        """Turn home and be at the origin."""
        return self.zr()

    def place(self, pose: Pose) -> None:
        """Put a simulated robot somewhere; it believes to be there."""
        self.place_robot(*_words(pose))

    def believe_place(self, x: float, y: float) -> State:
        """Say where the robot is to believe to be, m; it stays where it is."""
        return self.dp(tenths(x), tenths(y))

    def believe_heading(self, heading: float, turret: float) -> State:
        """Say how the robot is to believe to stand, rad."""
        return self.da(direction(heading), direction(turret))

    def stop_after(self, seconds: int) -> State:
        """Stop the robot when nothing is asked for so long, 0 to 255; 0: never."""
        return self.conf_tm(seconds)

    # ---- sensing

    def look(self) -> State:
        """How things stand now."""
        return self.gs()

    def fire_sonars(self, pause: float, order: Sequence[int] = ALL) -> State:
        """Fire these sonars one after the other for ever, each so many s (in steps of 4 ms, 1.02 s at most) after the
        echo before; none: switch them off."""
        return self.conf_sn(round(pause / CONFIGURED_PAUSE), order)

    def say(self, text: str) -> None:
        """Say a text aloud."""
        self.tk(text)

    def ask_for_pose(self, seconds: float | None = None) -> Pose:
        """Have the person at the server click where the robot is. seconds: to wait at most; None: for ever."""
        return _pose(*self.get_robot_conf(seconds))

    # ---- the world

    def put_up(self, corners: Points) -> None:
        """Put up a polygon of 3 to 10 corners."""
        self.add_obstacle(_corners(corners))

    def take_away(self, corners: Points) -> None:
        """Take the polygon with these corners away."""
        self.delete_obstacle(_corners(corners))

    def shift(self, corners: Points, across: float, up: float) -> Points:
        """Move the polygon with these corners by so many m; gives its corners then."""
        moved = self.move_obstacle(_corners(corners), tenths(across), tenths(up))
        return [(metres(x), metres(y)) for x, y in moved]

    def clear_world(self) -> None:
        """Take every obstacle away."""
        self.new_world()

    def predict(self, pose: Pose) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """What the infrared sensors and the sonars would read there, m."""
        infrared, sonars = self.predict_sensors(*_words(pose))
        return tuple(step * INFRARED_STEP for step in infrared), tuple(inches * INCH for inches in sonars)

    def touches_along(self, start: tuple[float, float], end: tuple[float, float]) -> Pose | None:
        """Where a body that goes straight from one point to the other (m) would touch something; its heading is then
        the direction from what it touches back into the body. None: the way is free."""
        numbers = (*start, *end)
        return _contact(self.motion_check(0, *(number / TENTH for number in numbers)))

    def touches_round(self, centre: tuple[float, float], radius: float, begin: float, end: float) -> Pose | None:
        """The same on a circle round `centre`, from the angle `begin` to `end`."""
        x, y, r = (number / TENTH for number in (*centre, radius))
        start = (x + r * cos(begin), y + r * sin(begin))
        return _contact(self.motion_check(1, *start, begin, end, r, x, y))

    # ---- the server's windows

    def sketch_robot(self, pose: Pose, mode: int = 1) -> None:
        """Draw a robot into the World window. mode: 1 to 3 black, above one of the named colours."""
        self.draw_robot(*_words(pose), mode)

    def sketch_line(self, start: tuple[float, float], end: tuple[float, float], mode: int = 1) -> None:
        """Draw a line, m."""
        x1, y1, x2, y2 = map(tenths, (*start, *end))
        self.draw_line(x1, y1, x2, y2, mode)

    def sketch_arc(
        self, corner: tuple[float, float], size: tuple[float, float], begin: float, end: float, mode: int = 1
    ) -> None:
        """Draw an arc of the ellipse in a box, given by its upper left corner and its size in m."""
        left, top, width, height = map(tenths, (*corner, *size))
        self.draw_arc(left, top, width, height, tenth_degrees(begin), tenth_degrees(end), mode)

    def erase(self, layer: str = "all") -> None:
        """Erase a layer of the windows, one of `LAYERS`. Raises MisuseError for another."""
        if layer not in LAYERS:
            raise MisuseError(
                f"there is no layer {layer!r:.40}{did_you_mean(layer, LAYERS)}; there are {', '.join(LAYERS)}"
            )
        self.refresh(RequestType[f"REFRESH_{layer.upper()}"])


def _words(pose: Pose) -> tuple[int, int, int, int]:
    return tenths(pose.x), tenths(pose.y), direction(pose.heading), direction(pose.turret)


def _pose(x: int, y: int, steering: int, turret: int) -> Pose:
    return Pose(metres(x), metres(y), radians(steering), radians(turret))


def _corners(corners: Points) -> list[tuple[int, int]]:
    return [(tenths(x), tenths(y)) for x, y in corners]


def _contact(place: tuple[float, float, float] | None) -> Pose | None:
    return None if place is None else Pose(metres(place[0]), metres(place[1]), place[2])
