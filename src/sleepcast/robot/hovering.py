"""The vocabulary of whatever hovers, in one place: so one sentence moves copters of every make.

A model is made of `sensors`, `actuators` and `functions`, and adds what its robot alone has. The body behind it is a
`Hovering`. Heights of its limits and of TAKEOFF count from the ground as the robot measures it, z from the origin.
"""

from __future__ import annotations

from math import hypot, inf, isnan, nan, pi
from typing import Protocol

from sleepcast.core.errors import MisuseError
from sleepcast.core.model import HostFunction, Quantity
from sleepcast.core.units import LENGTH, SPEED
from sleepcast.robot import NOBODY_DRIVES, FencedError, Limits

FARTHEST = 1e5
"""m from the origin: farther away, nothing is meant to be."""
OTHERS_MOVE_IT = 10.0
"""How many times as fast as its limits it may be measured: others move it, too."""
FASTEST_CLIMB = 100.0
"""m/s that are measured, up or down."""
SELDOM = 5.0
"""Seconds after which the charge of a battery counts as unknown: it is told once a second."""
GROUNDED = "it stands on the ground: send (TAKEOFF) before it is driven"
LANDING = "it is landing: say at which height it is to go there"
FLYING = "it is in the air, where (DISARM) would make it fall: (LAND) first"
GLIDES = "a plane does not hover: (GOTO x y z) brings it to another height"
ON_ITS_CIRCLE = 1.5
"""Radii from the middle within which a plane circles around it, and is not on its way there."""
OF_PLANES = {
    "GOTO": "Goes to a place and circles around it, at its own height if z is not given.",
    "CLIMB": "Is a fault: a plane does not hover.",
}
"""What these functions do on planes."""
FAILSAFES = {"hover": "hovers", "land": "lands", "rtl": "returns home and lands"}
FAILSAFES_OF_PLANES = {"hover": "circles", "land": "lands", "rtl": "circles at home"}
"""What they do where nobody drives them any more, by the names of a scenario."""
LOCKED_MOTORS = (
    "its motors are locked, by an emergency stop, a crash or a lost link: switch it off and on before it flies again"
)


def let_go(does: str) -> str:
    """The sentence that says what it does now that nobody drives it any more: of `FAILSAFES`, say."""
    return f"{NOBODY_DRIVES}: it {does}"


def exhausted(store: str = "battery", *, in_air: bool = False) -> str:
    """The sentence that says what it does now that this is used up."""
    return f"its {store} is empty: it {'lands' if in_air else 'does not take off'}"


class Hovering(Protocol):
    """What expressions may ask of a body that hovers. Each raises MisuseError for what it does not do, and
    OutOfReachError."""

    def arm(self) -> float | None:
        """Let its motors turn, if nothing else does so."""

    def disarm(self) -> None:
        """Switch its motors off, on the ground only."""

    def take_off(self, height: float = nan) -> None:
        """Arm, choose the mode for it, and rise to this height, m; in the air, come to this height."""

    def touch_down(self) -> None:
        """Land where it is."""

    def go_to(self, x: float, y: float, z: float = nan) -> None:
        """Go to this place, m from the origin, at its own height if z is not given. Raises FencedError, too."""

    def climb(self, speed: float) -> None:
        """Climb at this speed, m/s, or sink, on the spot."""


class Cutting(Protocol):
    """What expressions may ask of a body that hovers and has an emergency stop, after which it falls."""

    def cut_motors(self) -> None:
        """Stop its motors until it is switched off and on again."""

    def cut_all_motors(self) -> None:
        """The same of all on its radio channel."""


def sensors(limits: Limits, fresh: float) -> tuple[Quantity, ...]:
    """What all that hover measure. fresh: seconds after which it counts as unknown; of the battery, `SELDOM`."""
    speed, turn = OTHERS_MOVE_IT * limits.speed, OTHERS_MOVE_IT * limits.turn_rate
    return (
        Quantity("x", "m", -FARTHEST, FARTHEST, fresh, "to the east of the origin"),
        Quantity("y", "m", -FARTHEST, FARTHEST, fresh, "to the north of the origin"),
        Quantity("z", "m", -FARTHEST, FARTHEST, fresh, "above the origin"),
        Quantity("heading", "rad", -pi, pi, fresh, "counter-clockwise from east", "deg"),
        Quantity("speed", "m/s", -speed, speed, fresh, "along its heading"),
        Quantity("turn_rate", "rad/s", -turn, turn, fresh, "counter-clockwise", "deg/s"),
        Quantity("height", "m", -FARTHEST, FARTHEST, fresh, "above where it started"),
        Quantity("climb_rate", "m/s", -FASTEST_CLIMB, FASTEST_CLIMB, fresh, "upwards"),
        Quantity("armed", "", 0.0, 1.0, fresh, "whether its motors may turn"),
        Quantity("flying", "", 0.0, 1.0, fresh, "whether it is in the air"),
        Quantity("battery", "", 0.0, 1.0, SELDOM, "1 is full", "%"),
    )


def actuators(limits: Limits) -> tuple[Quantity, ...]:
    """In the order of a `Setpoint`."""
    speed, turn, climb = limits.speed, limits.turn_rate, limits.climb
    return (
        Quantity("drive_speed", "m/s", -speed, speed, doc="goes at this speed along its heading"),
        Quantity("drive_turn", "rad/s", -turn, turn, doc="turns at this rate", shown_as="deg/s"),
        Quantity("drive_side", "m/s", -speed, speed, doc="goes at this speed to its left"),
        Quantity("drive_climb", "m/s", -climb, climb, doc="climbs at this speed"),
    )


def functions(body: type[Hovering]) -> tuple[HostFunction, ...]:
    """What all that hover do, of bodies of this class."""
    return (
        HostFunction("ARM", body.arm, doc="Lets its motors turn."),
        HostFunction("DISARM", body.disarm, doc="Switches its motors off, if it stands on the ground."),
        HostFunction(
            "TAKEOFF",
            body.take_off,
            (LENGTH,),
            least=0,
            arguments="height",
            doc="Arms and rises to this height; without one, to that of its address.",
        ),
        HostFunction("LAND", body.touch_down, doc="Lands where it is."),
        HostFunction(
            "GOTO",
            body.go_to,
            (LENGTH, LENGTH, LENGTH),
            least=2,
            arguments="x y z",
            doc="Goes to a place, at its own height if z is not given.",
        ),
        HostFunction(
            "CLIMB",
            body.climb,
            (SPEED,),
            arguments="speed",
            doc="Climbs at this speed, or sinks, in one place until it is told something else.",
        ),
    )


def emergency_functions(body: type[Cutting]) -> tuple[HostFunction, ...]:
    """What those do besides that have an emergency stop, of bodies of this class."""
    return (
        HostFunction(
            "MOTORS-OFF",
            body.cut_motors,
            doc="Stops the motors, in the air too, until it is switched off and on again.",
            irreversible=True,
            moves=False,
        ),
        HostFunction(
            "ALL-MOTORS-OFF",
            body.cut_all_motors,
            doc="Stops the motors of all Crazyflies on its radio channel, until they are switched off and on again.",
            irreversible=True,
            moves=False,
        ),
    )


def check_place(limits: Limits, x: float, y: float, circle: float = 0.0) -> None:
    """Raise FencedError for a place (m) outside of the fence, MisuseError for one that is too far away. circle: radius
    of the one that is flown around it, m."""
    if not limits.holds(x, y):
        raise FencedError(f"({x:g}, {y:g}) m lies outside of the fence")
    if not limits.holds(x, y, circle):
        raise FencedError(f"its circle of {circle:g} m around ({x:g}, {y:g}) m passes the fence")
    if not hypot(x, y) <= FARTHEST:
        raise MisuseError(f"({x:g}, {y:g}) m is farther than {FARTHEST:g} m from the origin")


def check_room(width: float, height: float, circle: float) -> None:
    """Raise MisuseError for a fence so many m wide and high that has no room for a circle with this radius (m)."""
    if min(width, height) < 2.0 * circle:
        raise MisuseError(f"a plane that circles at {circle:g} m needs a fence twice as wide")


def check_height(limits: Limits, height: float) -> None:
    """Raise MisuseError for a height (m) to which it is not flown."""
    if isnan(height) or not limits.floor <= height <= limits.ceiling or height == inf:
        raise MisuseError(f"it flies from {limits.floor:g} to {limits.ceiling:g} m high, not at {height:g} m")
