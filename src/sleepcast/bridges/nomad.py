"""What a mind can call by name on a Scout behind a Nserver: its sensors and its functions, those of Nclient by their
short names; and how it is reached."""

from __future__ import annotations

from dataclasses import replace
from math import inf, pi

from sleepcast.bridges.nomad_robot import FRESH, PATIENCE, RADIUS, SCOUT, TRACK, NomadRobot
from sleepcast.nomad.client import PORT, Nomad
from sleepcast.nomad.units import INCH, NOTHING_HEARD
from sleepcast.robot import BodyFunction, Geometry, RobotModel
from sleepcast.units import ACCELERATION, LENGTH, NONE, RATE, SPEED, TIME, Quantity

__all__ = ["PORT", "open_nomad"]

SONARS = 16
_RANGE = NOTHING_HEARD * INCH
_VOLTS = (0.0, 13.0)
_FASTEST = 1.1 * SCOUT.speed
"""m/s that may be measured: another program may drive the same robot as fast as it can go."""

SENSORS = (
    Quantity("x", "m", -inf, inf, FRESH, "where the robot believes to be, along x", "in"),
    Quantity("y", "m", -inf, inf, FRESH, "where the robot believes to be, along y", "in"),
    Quantity("heading", "rad", -pi, pi, FRESH, "where it believes to look, counter-clockwise from x", "deg"),
    Quantity("speed", "m/s", -_FASTEST, _FASTEST, FRESH, "along the heading", "in/s"),
    Quantity("turn_rate", "rad/s", -2 * _FASTEST / TRACK, 2 * _FASTEST / TRACK, FRESH, "how fast it turns", "deg/s"),
    Quantity("moving", "", 0.0, 1.0, FRESH, "whether a motor is active"),
    Quantity("bumper", "", 0.0, 32.0, FRESH, "the first switch that is pressed, from 1 in front; 0 for none"),
    Quantity("computer_volts", "", *_VOLTS, FRESH, "of the computer's battery"),
    Quantity("motor_volts", "", *_VOLTS, FRESH, "of the motors' battery"),
    *(Quantity(f"sonar{i}", "m", 0.0, _RANGE, FRESH, f"range of sonar {i}", "in") for i in range(SONARS)),
    Quantity("front_range", "m", 0.0, _RANGE, FRESH, "least range of the sonars in front", "in"),
)

FUNCTIONS = (
    BodyFunction(
        "DRIVE",
        NomadRobot.drive,
        (SPEED, RATE),
        arguments="speed turn_rate",
        doc="Drives on at this speed and turn rate.",
    ),
    BodyFunction(
        "VM",
        NomadRobot.turn_wheels,
        (SPEED, SPEED),
        arguments="right left",
        doc="Turns the right and the left wheel at these speeds.",
    ),
    BodyFunction(
        "PR",
        NomadRobot.travel,
        (LENGTH, LENGTH),
        arguments="right left",
        doc="Turns the right and the left wheel so far, and rests there; `moving` says until when.",
    ),
    BodyFunction("SP", NomadRobot.cruise, (SPEED, SPEED), arguments="right left", doc="How fast PR turns the wheels."),
    BodyFunction(
        "AC",
        NomadRobot.accelerate,
        (ACCELERATION, ACCELERATION),
        arguments="right left",
        doc="How fast the wheels change their speed.",
    ),
    BodyFunction("ST", NomadRobot.halt, doc="Comes to rest."),
    BodyFunction("LP", NomadRobot.limp, doc="Lets the wheels roll."),
    BodyFunction("ZR", NomadRobot.zero, doc="Turns home; the robot believes to be at the origin then."),
    BodyFunction(
        "DP",
        NomadRobot.believe_place,
        (LENGTH, LENGTH),
        arguments="x y",
        doc="Says where the robot is to believe to be.",
    ),
    BodyFunction(
        "DA",
        NomadRobot.believe_heading,
        (NONE,),
        arguments="heading",
        doc="Says where the robot is to believe to look.",
    ),
    BodyFunction(
        "PLACE_ROBOT",
        NomadRobot.place,
        (LENGTH, LENGTH, NONE),
        arguments="x y heading",
        doc="Puts a simulated robot somewhere.",
    ),
    BodyFunction(
        "CONF_SN",
        NomadRobot.fire_sonars,
        (TIME, *(NONE,) * SONARS),
        least=1,
        arguments="pause sonar...",
        doc="Fires these sonars one after the other, so long after the echo before; without any: all in sequence.",
    ),
    BodyFunction("TK", NomadRobot.say, arguments='"text"', labelled=True, doc="Says the text aloud."),
    BodyFunction(
        "SONAR",
        NomadRobot.sonar,
        (NONE,),
        arguments="number",
        result=LENGTH,
        acts=False,
        doc="Distance to the nearest thing before this sonar; 0 is in front, then counter-clockwise.",
    ),
    BodyFunction(
        "NEAREST",
        NomadRobot.nearest,
        (NONE, NONE),
        arguments="from to",
        result=LENGTH,
        acts=False,
        doc="Distance to the nearest thing between two angles, counter-clockwise from the heading.",
    ),
)


def scout(speed: float = SCOUT.speed, turn_rate: float = SCOUT.turn_rate) -> RobotModel:
    """A Scout that is never asked for more than `speed` m/s and `turn_rate` rad/s; more than it can is not granted."""
    limits = replace(SCOUT, speed=min(speed, SCOUT.speed), turn_rate=min(turn_rate, SCOUT.turn_rate))
    return RobotModel(
        "scout",
        SENSORS,
        (
            Quantity("drive_speed", "m/s", -limits.speed, limits.speed, doc="drives at this speed", shown_as="in/s"),
            Quantity(
                "drive_turn", "rad/s", -limits.turn_rate, limits.turn_rate, doc="turns at this rate", shown_as="deg/s"
            ),
        ),
        FUNCTIONS,
        limits,
        Geometry(RADIUS, SONARS, _RANGE),
    )


def open_nomad(host: str, port: int, robot: int, model: RobotModel, *, in_step: bool = False) -> NomadRobot:
    """Take over a Scout; see `open_robot`. Raises LostError, RefusedError."""
    nomad = Nomad.connect(host, port, robot=robot, timeout=PATIENCE)
    try:
        return NomadRobot(nomad, model, in_step=in_step)
    except BaseException:
        nomad.close()
        raise
