"""A Crazyflie quadcopter as a body: on the ground until it is told to take off, then a hovering robot that is driven.

    crazyflie://radio0:80?rate=2M#E7E7E7E7E7     a Crazyradio, channel 80, and the address of the quadcopter
    crazyflie://usb0                             the first one on USB
    crazyflie://127.0.0.1:19850                  a simulated one over UDP, or one of a shared radio (see `crazyradio`)

Speeds go along its heading and to its side, at the height to which it took off or has climbed. Rest means hovering on
the spot: nobody lets it fall by saying no more, and what it has begun, to rise or to land, it ends. STOP keeps it at
the height where it is. It lands when it is told to, or when its mind has been gone for `LANDS_AFTER`. If this process
dies, the quadcopter hears no setpoints any more, and its own watchdog stops the motors after two seconds.

It is sent nothing but speeds and a height, twenty times a second, on its way to a place, too: the firmware would fly
there by itself as well, but then its watchdog would not wait for us. It knows one height, its own estimate: `z` and
`height` are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from math import atan2, cos, hypot, isfinite, isnan, nan, pi, radians, remainder, sin
from typing import Protocol

from sleepcast.bridges import Opening
from sleepcast.bridges.address import BodyError, read_body_address
from sleepcast.bridges.body import LAG, REST, BridgedBody, Motion, clamped
from sleepcast.bridges.crazyflie.radio import RATES, is_radio_address, radio_uri, stop_all_by_port, stop_all_by_radio
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.robot import FRESH, Geometry, Limits, OutOfReachError, Reading, RobotModel, hovering
from sleepcast.robot.hovering import FLYING, GROUNDED, LANDING, LOCKED_MOTORS

EXAMPLE = "crazyflie://radio0:80#E7E7E7E7E7"
SETTINGS = {"rate": "2M", "height": "0.5", "ceiling": "3", "speed": "0.5", "turn_rate": "1.5", "broadcast": ""}
"""What can be set of it in its URI, and what holds otherwise: of the radio, m, m, m/s, rad/s, and the UDP port of a
shared radio that takes the emergency stop for all."""
HIGHEST = 3.0
"""m above the ground to which it may be sent: indoors there is a ceiling."""
CLIMB, DESCENT = 0.5, 0.3
"""m/s up and down, and down in a landing."""
LANDED = 0.05
"""m above the ground at which the motors are stopped."""
LOWEST = 0.1
"""m above the ground, below which it only takes off and lands."""
LANDS_AFTER = 10.0
"""Seconds without a look from the mind after which a flying body lands, where it is."""
RADIUS = 0.07
"""m from its middle to the tips of its propellers."""
ACCELERATION = 1.0
"""m/s2: a third of what it could do, so that it need not lean far."""
LOGGED = {
    "stateEstimate.x": "m",
    "stateEstimate.y": "m",
    "stateEstimate.vx": "m/s",
    "stateEstimate.vy": "m/s",
    "stateEstimate.yaw": "degrees counter-clockwise",
    "gyro.z": "degrees/s",
    "stateEstimate.z": "m",
    "stateEstimate.vz": "m/s",
    "pm.batteryLevel": "%",
    "supervisor.info": "bits",
}
"""Variables that the firmware sends, with their units. The first six fit into one packet, and so are of one instant:
its speeds along its heading are made of four of them."""
ARMED, FLIES, LOCKED = 1 << 1, 1 << 4, 1 << 6
"""Bits of `supervisor.info`, as the firmware's supervisor.c has them: it is armed; it flies; its motors stand until it
is started anew, after an emergency stop, a crash, or two seconds without a setpoint in the air."""
STEERS_BY = 2.0 * LAG
"""Seconds of its way to a place that are left when it begins to brake: more than the limits want, so that none of them
ever stops it on the way to a place that they allow."""
STARTS = 2.0
"""Seconds after which a take-off without turning motors has failed."""


class Quadcopter(Protocol):
    """The way to one; every method may raise OutOfReachError."""

    def hover(self, speed: float, side: float, turn_rate: float, height: float) -> None:
        """Fly at this height (m) with these speeds ahead and to its left (m/s) and this turn rate (rad/s,
        counter-clockwise); it is forgotten within half a second."""

    def arm(self, armed: bool) -> None:
        """Let the motors run when they are asked to, or not; in the air the second makes it fall."""

    def stop_motors(self) -> None:
        """Stop the motors until the next `hover`."""

    def cut(self) -> None:
        """Stop the motors for good, until it is started anew."""

    def land(self, seconds: float) -> None:
        """Land by itself, in so many s, even if nobody is there any more."""

    def logged(self) -> Mapping[str, float] | None:
        """The values of `LOGGED` that came since the last call, None if none came."""

    def close(self) -> None:
        """Close the connection."""


class CrazyflieBody(BridgedBody):
    """See the module. Its motion besides "speeds" and "climb" is "goto" (x, y; m).

    open: reaches the quadcopter, or raises OutOfReachError.
    height: of its flight, m, unless TAKEOFF says another one.
    stop_all: sends the emergency stop to all of its radio channel, or raises OutOfReachError or OSError; None where
        nothing can.
    """

    RESTING = 0.1
    """How far it drifts about the spot on which it hovers."""

    def __init__(
        self,
        open: Callable[[], Quadcopter],
        model: RobotModel,
        height: float,
        *,
        stop_all: Callable[[], None] | None = None,
        clock: Clock | None = None,
    ) -> None:
        super().__init__(model, clock=clock)
        self._open, self._usual, self._stop_all = open, height, stop_all
        self._copter = open()
        self._height = self._wanted = 0.0
        """Where it is told to fly and where it is to come to, m; 0 on the ground."""
        self._asked: float | None = None
        """Where it is to come to, m, as an expression has asked since the last round."""
        self._moved = self._time = self._flown = self._clock.now()
        """When it was last told where to fly, when it was heard, and when it last flew, or was to stand."""
        self._values: dict[str, float] = {}
        """Of `LOGGED`; what has not come yet is missing."""
        self._grounded: Motion | None = None
        """What it could not do on the ground, and was complained of."""

    # ---- what a bridge says

    def carry_out(self, motion: Motion) -> None:
        now = self._clock.now()
        passed, self._moved = min(now - self._moved, FRESH), now
        if len(self._values) < len(LOGGED):  # whether it flies is not known yet; the next round asks again
            return
        with self._lock:
            asked, self._asked = self._asked, None
        if self._stopped:
            self._wanted = self._height
        elif asked is not None and not self._held:
            if asked and not self._height:
                self._copter.arm(True)
            self._wanted = asked
        if now - self._attended > LANDS_AFTER and self._wanted:
            self.complain(hovering.let_go(hovering.FAILSAFES["land"]))
            self._wanted = 0.0
        if not self._height and not self._wanted:
            self._stay_grounded(motion)
            return
        driven = motion.values if motion.sort == "speeds" and self._wanted else (0.0,) * 4
        speed, turn_rate, side, climb = driven
        self._rise(climb, passed)
        if not self._wanted and self._height < LANDED:
            self._height = 0.0
            self._copter.stop_motors()
            return
        self._copter.hover(speed, side, turn_rate, self._height)

    def _rise(self, climb: float, seconds: float) -> None:
        """Change its height for so many seconds: at this rate (m/s) if it is driven up or down, else towards where it
        is to come to."""
        if climb:
            limits = self.model.limits
            higher, lowest = self._height + climb * seconds, min(limits.floor, self._height)
            self._height = self._wanted = min(max(higher, lowest), max(limits.ceiling, self._height))
        else:
            self._height += clamped(self._wanted - self._height, (CLIMB if self._wanted else DESCENT) * seconds)

    def _stay_grounded(self, motion: Motion) -> None:
        if motion.sort == "speeds" and self._grounded is None:
            self.complain(GROUNDED)
        self._grounded = motion if motion.sort == "speeds" else None

    def measure(self) -> None:
        values = self._copter.logged()
        if values is not None:
            self._take(values)
        elif self._clock.now() - self._time > FRESH:
            raise OutOfReachError(f"nothing has been heard of it for {FRESH:g} s")

    def _take(self, values: Mapping[str, float]) -> None:
        self._time, before, was_locked = self._clock.now(), len(self._values), self._has(LOCKED)
        self._values.update(values)
        if before < len(self._values) == len(LOGGED) and self._has(FLIES):  # in the air, where it was lost
            self._height = self._wanted = max(self._values["stateEstimate.z"], LANDED)
        if not self._height or self._has(FLIES):
            self._flown = self._time
        if self._has(LOCKED) and not was_locked:
            self._come_down(LOCKED_MOTORS)
        elif self._time - self._flown > STARTS:
            self._come_down("its motors do not turn: it has not taken off, or has come down by itself")

    def _has(self, bit: int) -> bool:
        return bool(int(self._values.get("supervisor.info", 0.0)) & bit)

    def _come_down(self, why: str) -> None:
        """It stands, whatever it was told."""
        self._height = self._wanted = 0.0
        self.rest()
        self.complain(why)

    def reading(self) -> Reading:
        x, y, _, _, _, turning, z, climb, charge, info = (self._values.get(name, nan) for name in LOGGED)
        armed, flies = (float(self._has(bit)) if isfinite(info) else nan for bit in (ARMED, FLIES))
        speed, _ = self.drift_measured()
        place, pace = (x, y, z, self._heading()), (speed, radians(turning), z, climb)
        pairs = zip((*place, *pace, armed, flies, charge / 100.0), self.model.sensors, strict=True)
        return Reading(self._time, tuple(min(max(value, of.low), of.high) for value, of in pairs))

    def _heading(self) -> float:
        yaw = self._values.get("stateEstimate.yaw", nan)
        return remainder(radians(yaw), 2.0 * pi) if isfinite(yaw) else nan

    def drift_measured(self) -> tuple[float, float]:
        along_x, along_y = (self._values.get(f"stateEstimate.v{axis}", nan) for axis in "xy")
        heading = self._heading()
        ahead, left = cos(heading), sin(heading)
        return along_x * ahead + along_y * left, along_y * ahead - along_x * left

    def course_measured(self) -> tuple[float, float]:
        if self.stale or len(self._values) < len(LOGGED):
            return nan, nan
        speed = hypot(*(self._values[f"stateEstimate.v{axis}"] for axis in "xyz"))
        return speed, radians(self._values["gyro.z"])

    def seek(self) -> None:
        self._copter.close()
        self._copter = self._open()
        self._time, self._values = self._clock.now(), {}
        self._height = self._wanted = 0.0

    def leave(self) -> None:
        try:
            if self._height:
                self._copter.land(self._height / DESCENT)
        except OutOfReachError as error:
            self._lost = error
        self._copter.close()

    def stop(self) -> None:
        super().stop()
        self._asked = None

    def let_go(self) -> None:
        if self._is_up() and not self._stopped:
            self.complain(hovering.let_go(hovering.FAILSAFES["hover"]))
        super().let_go()

    def rest(self) -> None:
        super().rest()
        self._asked = None

    def course(self, motion: Motion) -> tuple[float, float] | None:
        return super().course(motion) if self._height else None

    def steered(self, motion: Motion) -> Motion:
        """On its way to a place: straight there, no faster than it can come to rest."""
        if motion.sort != "goto":
            return super().steered(motion)
        known, (x, y) = self._sensed(), motion.values
        heading = known.get("heading", nan)
        east, north = x - known.get("x", nan), y - known.get("y", nan)
        if isnan(heading + east + north):
            return REST
        limits, way = self.model.limits, atan2(north, east) - heading
        speed = min(limits.speed, limits.speed_before(hypot(east, north), STEERS_BY))
        return Motion("speeds", (speed * cos(way), 0.0, speed * sin(way), 0.0))

    # ---- what expressions may ask; see Hovering

    def arm(self) -> float:
        """A take-off arms it, and nothing else."""
        self.check_free()
        return 1.0

    def disarm(self) -> None:
        if self._is_up():
            raise MisuseError(f"{FLYING}, or (MOTORS-OFF)")
        self.send(self._disarm_on_ground)

    def _disarm_on_ground(self) -> None:
        if not self._is_up():  # it may have been told to take off since
            self._copter.arm(False)

    def _is_up(self) -> bool:
        return bool(self._has(FLIES) or self._height or self._wanted or self._asked)

    def take_off(self, height: float = nan) -> None:
        wanted = self._usual if isnan(height) else height
        hovering.check_height(self.model.limits, wanted)
        if self._has(LOCKED):
            raise MisuseError(LOCKED_MOTORS)
        self._ask_for(wanted)

    def touch_down(self) -> None:
        self._ask_for(0.0)

    def go_to(self, x: float, y: float, z: float = nan) -> None:
        limits = self.model.limits
        hovering.check_place(limits, x, y)
        if not isnan(z):
            hovering.check_height(limits, z)
        if not self._is_up():
            raise MisuseError(GROUNDED)
        if isnan(z) and not (self._wanted or self._asked):
            raise MisuseError(LANDING)
        self.move(Motion("goto", (x, y)))
        with self._lock:
            if not (self._stopped or isnan(z)):
                self._asked = z

    def _ask_for(self, height: float) -> None:
        """What moves it already ends; what the same tick asks for after this does not take its place."""
        self.move(REST)
        with self._lock:
            if not self._stopped:
                self._asked = height

    def cut_motors(self) -> None:
        """Stop the motors, in the air too; it falls, and flies again only after it was switched off and on."""
        self.send(lambda: self._copter.cut())

    def cut_all_motors(self) -> None:
        """The same for all quadcopters on its radio channel, also if it is itself out of reach."""
        if self._stop_all is None:
            raise MisuseError("this link carries nothing to all Crazyflies: it is no radio, and has no broadcast=PORT")
        self.beside(self._stop_all, "the emergency stop for all Crazyflies was not sent")
        with suppress(OutOfReachError):
            self.cut_motors()


FUNCTIONS = (*hovering.functions(CrazyflieBody), *hovering.emergency_functions(CrazyflieBody))


def model_of(limits: Limits) -> RobotModel:
    """What all Crazyflies with these limits have in common."""
    return RobotModel(
        "crazyflie", hovering.sensors(limits, FRESH), hovering.actuators(limits), FUNCTIONS, limits, Geometry(RADIUS)
    )


def open_body(uri: str, opening: Opening) -> CrazyflieBody:
    """Reach the Crazyflie at a URI; see the module. Raises BodyError, OutOfReachError."""
    from sleepcast.bridges.crazyflie.link import CflibQuadcopter

    address = read_body_address(uri, EXAMPLE, SETTINGS)
    if opening.in_step:
        raise MisuseError(f"{uri!r:.100}: a Crazyflie does not wait for its mind: leave out --lockstep")
    host, port, part = address.host, address.port, address.part
    stop_all: Callable[[], None] | None = None
    if host.startswith("radio"):
        base = radio_uri(host, port, address.choice("rate", RATES))
        if base is None or not is_radio_address(part):
            raise BodyError(f"{uri!r:.100}: wanted the radio, its channel up to 125, and an address: {EXAMPLE}")
        uri_of_cflib, stop_all = f"{base}/{part}", partial(stop_all_by_radio, base)
    elif host.startswith("usb"):
        uri_of_cflib = f"usb://{host[3:] or '0'}"
    elif port is None:
        raise BodyError(f"{uri!r:.100}: wanted a port, as in crazyflie://127.0.0.1:19850")
    else:
        uri_of_cflib = f"udp://{host}:{port}"
    if broadcast := address.settings["broadcast"]:
        is_number = broadcast.isascii() and broadcast.isdigit() and len(broadcast) < 6
        if not (uri_of_cflib.startswith("udp") and is_number and 0 < int(broadcast) < 65_536):
            raise BodyError(f"{uri!r:.100}: broadcast is a UDP port of the same host, of a radio that is shared there")
        stop_all = partial(stop_all_by_port, host, int(broadcast))
    ceiling = address.number("ceiling", LOWEST, HIGHEST, "m")
    height = address.number("height", LOWEST, ceiling, "m")
    speed, turn = address.number("speed", unit="m/s"), address.number("turn_rate", unit="rad/s")
    limits = Limits(speed, turn, ACCELERATION, climb=CLIMB, floor=LOWEST, ceiling=ceiling)
    model = model_of(limits.within(opening.limits))
    return CrazyflieBody(lambda: CflibQuadcopter(uri_of_cflib, LOGGED), model, height, stop_all=stop_all)
