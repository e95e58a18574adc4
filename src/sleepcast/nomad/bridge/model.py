"""What a mind can call by name on a Nomad behind a Nserver: its sensors and its functions, those of Nclient by their
short names; and how it is reached."""

from __future__ import annotations

from math import inf, pi

from sleepcast.bridges import Opening
from sleepcast.bridges.address import BodyError, read_body_address
from sleepcast.bridges.body import PATIENCE
from sleepcast.core.model import HostFunction, Quantity
from sleepcast.core.units import ACCELERATION, LENGTH, NONE, RATE, SPEED, TIME, Dimension
from sleepcast.nomad.bridge.robot import BASES, Base, NomadRobot
from sleepcast.nomad.bridge.vocabulary import VOCABULARY, nomad_vocabulary
from sleepcast.nomad.client.nomad import PORT, Nomad
from sleepcast.nomad.wire.state import RING
from sleepcast.nomad.wire.units import INCH, INFRARED_STEP, NOTHING_HEARD, NOTHING_NEAR
from sleepcast.robot import FRESH, Geometry, Limits, RobotModel

_RANGE = NOTHING_HEARD * INCH
_VOLTS = (0.0, 13.0)


def sensors(base: Base) -> tuple[Quantity, ...]:
    """Of one type of Nomad, in the order of a reading."""
    # Another program may drive the same robot as fast as it can go, and a bit faster than the limits say.
    speed, turn = 1.1 * BASES[base.name].limits.speed, 3.0 * BASES[base.name].limits.turn_rate
    common = (
        Quantity("x", "m", -inf, inf, FRESH, "where the robot believes to be, along x", "in"),
        Quantity("y", "m", -inf, inf, FRESH, "where the robot believes to be, along y", "in"),
        Quantity("heading", "rad", -pi, pi, FRESH, "where it believes to go, counter-clockwise from x", "deg"),
        Quantity("speed", "m/s", -speed, speed, FRESH, "along the heading", "in/s"),
        Quantity("turn_rate", "rad/s", -turn, turn, FRESH, "how fast it turns", "deg/s"),
        Quantity("moving", "", 0.0, 1.0, FRESH, "whether a motor is active"),
        Quantity("bumper", "", 0.0, 32.0, FRESH, "the first switch that is pressed, from 1 in front; 0 for none"),
        Quantity("computer_volts", "", *_VOLTS, FRESH, "of the computer's battery"),
        Quantity("motor_volts", "", *_VOLTS, FRESH, "of the motors' battery"),
        *(Quantity(f"sonar{i}", "m", 0.0, _RANGE, FRESH, f"range of sonar {i}", "in") for i in range(RING)),
        Quantity("front_range", "m", 0.0, _RANGE, FRESH, "least range of the sonars in front", "in"),
    )
    if base.track:
        return common
    near = NOTHING_NEAR * INFRARED_STEP
    return (
        *common,
        Quantity("turret", "rad", -pi, pi, FRESH, "where its turret believes to look", "deg"),
        *(Quantity(f"infrared{i}", "m", 0.0, near, FRESH, f"range of infrared sensor {i}", "in") for i in range(RING)),
    )


def functions(base: Base) -> tuple[HostFunction, ...]:
    """Of one type of Nomad."""
    if base.track:
        return (*_axes("right left", (SPEED,) * 2, (LENGTH,) * 2, (ACCELERATION,) * 2), *_places(""), *FUNCTIONS)
    speeds, ways, accelerations = (SPEED, RATE, RATE), (LENGTH, NONE, NONE), (ACCELERATION, None, None)
    return (*_axes("way steering turret", speeds, ways, accelerations), *_places(" turret"), *FUNCTIONS)


Dimensions = tuple[Dimension | None, ...]


def _axes(names: str, speeds: Dimensions, ways: Dimensions, accelerations: Dimensions) -> tuple[HostFunction, ...]:
    """What is asked of each axis. names: of the axes."""
    said = "and rests there; `moving` says until when."
    return (
        HostFunction("VM", NomadRobot.turn_axes, speeds, arguments=names, doc="Turns its axes at these speeds."),
        HostFunction("PR", NomadRobot.travel, ways, arguments=names, doc=f"Turns its axes so far, {said}"),
        HostFunction("SP", NomadRobot.cruise, speeds, arguments=names, doc="How fast PR turns its axes.", moves=False),
        HostFunction(
            "AC",
            NomadRobot.accelerate,
            accelerations,
            arguments=names,
            doc="How fast its axes change their speed.",
            moves=False,
        ),
    )


def _places(turret: str) -> tuple[HostFunction, ...]:
    """Where it is, or believes to be. turret: the name of one more argument, if there is a turret."""
    angles = (NONE,) * (2 if turret else 1)
    return (
        HostFunction(
            "DA",
            NomadRobot.believe_heading,
            angles,
            arguments=f"heading{turret}",
            doc="Says how the robot is to believe to stand.",
            moves=False,
        ),
        HostFunction(
            "PLACE_ROBOT",
            NomadRobot.place,
            (LENGTH, LENGTH, *angles),
            arguments=f"x y heading{turret}",
            doc="Puts a simulated robot somewhere.",
        ),
    )


FUNCTIONS = (
    HostFunction(
        "DRIVE",
        NomadRobot.drive,
        (SPEED, RATE),
        arguments="speed turn_rate",
        doc="Drives on at this speed and turn rate.",
    ),
    HostFunction("ST", NomadRobot.halt, doc="Comes to rest."),
    HostFunction("LP", NomadRobot.limp, doc="Lets the wheels roll."),
    HostFunction("ZR", NomadRobot.zero, doc="Turns home; the robot believes to be at the origin then."),
    HostFunction(
        "DP",
        NomadRobot.believe_place,
        (LENGTH, LENGTH),
        arguments="x y",
        doc="Says where the robot is to believe to be.",
        moves=False,
    ),
    HostFunction(
        "CONF_SN",
        NomadRobot.fire_sonars,
        (TIME, *(NONE,) * RING),
        least=1,
        arguments="pause sonar...",
        doc="Fires these sonars one after the other, so long after the echo before; without any: all in sequence.",
        moves=False,
    ),
    HostFunction("TK", NomadRobot.say, arguments='"text"', labelled=True, doc="Says the text aloud.", moves=False),
    HostFunction(
        "SONAR",
        NomadRobot.sonar,
        (NONE,),
        arguments="number",
        result=LENGTH,
        acts=False,
        doc="Distance to the nearest thing before this sonar; 0 is in front, then counter-clockwise.",
    ),
    HostFunction(
        "NEAREST",
        NomadRobot.nearest,
        (NONE, NONE),
        arguments="from to",
        result=LENGTH,
        acts=False,
        doc="Distance to the nearest thing between two angles, counter-clockwise from the heading.",
    ),
)


def model_of(base: Base) -> RobotModel:
    """What all Nomads of one type have in common."""
    speed, turn = base.limits.speed, base.limits.turn_rate
    return RobotModel(
        base.name,
        sensors(base),
        (
            Quantity("drive_speed", "m/s", -speed, speed, doc="drives at this speed", shown_as="in/s"),
            Quantity("drive_turn", "rad/s", -turn, turn, doc="turns at this rate", shown_as="deg/s"),
        ),
        functions(base),
        base.limits,
        Geometry(base.radius, RING, _RANGE),
    )


EXAMPLE = "nomad://127.0.0.1:7019#1"
SETTINGS = {"type": "scout", "speed": "inf", "turn_rate": "inf"}
"""What can be set of a Nomad in its URI, and what holds otherwise."""


def open_body(uri: str, opening: Opening) -> NomadRobot:
    """Take over the Nomad at `nomad://HOST:PORT#ROBOT`, a Scout behind a Nserver; if wanted, of another type, or with
    lower limits of speed (m/s) and turn rate (rad/s): `nomad://HOST:PORT?type=nomad200&speed=0.3&turn_rate=1#ROBOT`.

    Raises BodyError, LostError, RefusedError.
    """
    address = read_body_address(uri, EXAMPLE, SETTINGS)
    base = BASES[address.choice("type", tuple(BASES))]
    said = Limits(address.number("speed", unit="m/s"), address.number("turn_rate", unit="rad/s"), inf)
    base, robot = base.limited(said.within(opening.limits)), _number(uri, address.part or "1")
    port = PORT if address.port is None else address.port
    nomad = Nomad.connect(address.host, port, robot=robot, timeout=PATIENCE)
    try:
        model = nomad_vocabulary(model_of(base)) if opening.vocabulary == VOCABULARY else model_of(base)
        return NomadRobot(nomad, base, model, in_step=opening.in_step)
    except BaseException:
        nomad.close()
        raise


def _number(uri: str, text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:6]) < 100_000 or len(text) > 5:
        raise BodyError(f"{uri!r:.100}: robots are numbered from 1, so #{text:.20} is none; for example #1")
    return int(text)
