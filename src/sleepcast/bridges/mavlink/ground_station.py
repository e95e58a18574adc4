"""A robot as a vehicle of a ground station: it is seen there, and may be stopped, released and driven from there.

To the ground station it is a rover of ArduPilot's with two modes: HOLD while it is stopped, and GUIDED. What is asked
there becomes a `Wish`, which the node brings to its mind like a command that is typed: so limits, STOP and rules hold
for it as for everybody. HOLD, and disarming, is STOP; GUIDED, and arming, is RELEASE, which ends only the STOP that the
ground station itself has sent.

A ground station that drives must go on doing so: `QUIET` s after its last setpoint the robot is to come to rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import cos, degrees, inf, isfinite, nan, pi, sin
from typing import Any, Literal

from sleepcast.bridges.address import read_body_address
from sleepcast.bridges.mavlink.link import LINK, Link, open_link, system_of
from sleepcast.core.clock import Clock, WallClock
from sleepcast.core.geodesy import LocalMap, Origin

EXAMPLE = "mavlink://127.0.0.1:14550?key=vehicle.key#1"
PORT = 14_550
SETTINGS = {**LINK, "origin": ""}
QUIET = 1.0
"""Seconds after the last setpoint: a dead man's switch, as for every driven robot."""
TELL_AGAIN = 5.0
"""Seconds between two reports of refused messages."""
EVERY = {"heartbeat": 1.0, "place": 0.2, "state": 1.0}
"""Seconds between two messages of each kind."""
HOLD, GUIDED = 4, 15
SET_MODE, ARM_DISARM, TERMINATE, GO_TO, WAYPOINT = 176, 400, 185, 192, 16
STOPPING_MODES = frozenset((HOLD, 5))
"""HOLD and LOITER: a rover stands in both."""
ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
BODY_FRAMES, OFFSET_FRAME = frozenset((8, 9)), 7
"""Along the heading from where the robot is, and to north and east from there."""
GO_THERE, MISSION_DENIED = 2, 14
"""What `current` is in a waypoint that is no part of a mission, and the answer to every other one."""
NO_VELOCITY, NO_PLACE, NO_YAW_RATE = 0x38, 0x7, 0x800
"""Flags of a setpoint that lacks these."""
MAX_TEXT = 50
"""Characters of a text to the ground station."""
FARTHEST = 1e6
"""m: a place farther away is none."""

Sort = Literal["stop", "release", "drive", "goal"]


@dataclass(frozen=True, slots=True)
class Wish:
    """What the ground station wants. values: of "drive", speed in m/s and turn rate in rad/s; of "goal", x and y in
    m."""

    sort: Sort
    values: tuple[float, float] = (0.0, 0.0)


class GroundStation:
    """See the module. link: to it; origin: where x = 0, y = 0 is, None if that is nowhere on the Earth. most: speed and
    turn rate of a joystick that is pushed as far as it goes, m/s and rad/s."""

    def __init__(
        self, link: Link, origin: Origin | None, most: tuple[float, float], *, clock: Clock | None = None
    ) -> None:
        self._link, self._clock, self._most = link, clock or WallClock(), most
        self._map = None if origin is None else LocalMap(origin)
        self._began = self._clock.now()
        self._due = dict.fromkeys(EVERY, -inf)
        self._stopped = False
        self._here = (nan, nan, nan)
        """x, y in m and heading in rad."""
        self._driven, self._last = (0.0, 0.0), -inf
        self._told_again = -inf
        self._complaints: list[str] = []

    # ---- what it wants

    def wishes(self) -> list[Wish]:
        """What it has asked for since the last call, of setpoints only the last one."""
        found: list[Wish] = []
        now, before = self._clock.now(), self._driven
        with suppress(OSError):
            for message in self._link.receive():
                found += self._wish(message, now)
        if any(self._driven) and now - self._last > QUIET:
            self._driven = (0.0, 0.0)
            self._complaints.append("the ground station no longer drives it: it comes to rest")
        if self._driven != before:
            found.append(Wish("drive", self._driven))
        return found

    def complaints(self) -> list[str]:
        """What has gone wrong since the last call, in sentences."""
        now, said = self._clock.now(), self._complaints
        self._complaints = []
        if self._link.refused and now - self._told_again > TELL_AGAIN:
            self._told_again = now
            said += self._link.complaints("the ground station")
        return said

    def _wish(self, message: Any, now: float) -> list[Wish]:
        kind = message.get_type()
        if getattr(message, "target_system", self._link.mav.srcSystem) != self._link.mav.srcSystem:
            return []  # for everybody, or for another one: neither is meant
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            return self._command(message, exact=kind == "COMMAND_INT")
        if kind == "MISSION_ITEM_INT":
            there = (message.command, message.current) == (WAYPOINT, GO_THERE)
            found = self._goal(self._on_map(message.x / 1e7, message.y / 1e7)) if there else []
            asker = message.get_srcSystem(), message.get_srcComponent()
            self._send(self._link.mav.mission_ack_encode(*asker, ACCEPTED if found else MISSION_DENIED))
            return found
        if kind == "SET_MODE":
            return self._mode(message.custom_mode)
        if kind == "MANUAL_CONTROL" and message.target == self._link.mav.srcSystem:
            ahead, aside = (0 if each == 32_767 else each / 1000.0 for each in (message.x, message.r))
            self._drive(ahead * self._most[0], -aside * self._most[1], now)
        elif kind in ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT"):
            return self._set_point(message, now, earth=kind.endswith("GLOBAL_INT"))
        elif kind == "PARAM_REQUEST_LIST":
            self._send(self._link.mav.param_value_encode(b"SYSID_THISMAV", self._link.mav.srcSystem, 9, 1, 0))
        return []

    def _command(self, message: Any, *, exact: bool) -> list[Wish]:
        """exact: whether a place in it is in whole ten-millionths of a degree."""
        found, result = [], ACCEPTED
        if message.command == SET_MODE:
            found = self._mode(message.param2)
            result = ACCEPTED if found else DENIED
        elif message.command == ARM_DISARM:
            found = [Wish("release" if message.param1 == 1.0 else "stop")]
        elif message.command == TERMINATE:
            found = [Wish("stop")] if message.param1 == 1.0 else []
        elif message.command == GO_TO:
            place = (message.x / 1e7, message.y / 1e7) if exact else (message.param5, message.param6)
            found = self._goal(self._on_map(*place))
            result = ACCEPTED if found else DENIED
        else:
            result = UNSUPPORTED
        self._send(self._link.mav.command_ack_encode(message.command, result))
        return found

    def _mode(self, mode: float) -> list[Wish]:
        if mode in STOPPING_MODES:
            return [Wish("stop")]
        return [Wish("release")] if mode == GUIDED else []

    def _set_point(self, message: Any, now: float, *, earth: bool) -> list[Wish]:
        mask = message.type_mask
        if not earth and message.coordinate_frame in BODY_FRAMES and not mask & NO_VELOCITY:
            self._drive(message.vx, 0.0 if mask & NO_YAW_RATE else -message.yaw_rate, now)
        elif not mask & NO_PLACE:
            return self._goal(
                self._on_map(message.lat_int / 1e7, message.lon_int / 1e7) if earth else self._at(message)
            )
        return []

    def _goal(self, place: tuple[float, float]) -> list[Wish]:
        """Nothing for what is no place, nor under a STOP: what is asked then may not set it in motion later."""
        is_one = all(abs(each) <= FARTHEST for each in place)
        return [Wish("goal", place)] if is_one and not self._stopped else []

    def _on_map(self, latitude: float, longitude: float) -> tuple[float, float]:
        """In degrees; NaN if that is nowhere here."""
        return (self._map and self._map.metres(latitude, longitude)) or (nan, nan)

    def _at(self, message: Any) -> tuple[float, float]:
        """A place in metres, from the origin or from the robot."""
        x, y, heading = self._here
        if message.coordinate_frame in BODY_FRAMES:
            ahead, right = message.x, message.y
            return x + ahead * cos(heading) + right * sin(heading), y + ahead * sin(heading) - right * cos(heading)
        if message.coordinate_frame == OFFSET_FRAME:
            return x + message.y, y + message.x
        return message.y, message.x  # north comes first

    def _drive(self, speed: float, turn_rate: float, now: float) -> None:
        if isfinite(speed) and isfinite(turn_rate):
            self._driven, self._last = (speed, turn_rate), now

    # ---- what it is told

    def tell(self, values: Mapping[str, float], *, stopped: bool) -> None:
        """Show it the robot, if that is due. values: of its sensors, by name."""
        if stopped:
            self._driven = (0.0, 0.0)
        self._here = values.get("x", nan), values.get("y", nan), values.get("heading", nan)
        if stopped != self._stopped:
            self._due["heartbeat"] = -inf
        self._stopped, now = stopped, self._clock.now()
        for kind, every in EVERY.items():
            if now >= self._due[kind]:
                self._due[kind] = now + every
                for message in getattr(self, f"_{kind}")(values, int((now - self._began) * 1000.0) & 0xFFFFFFFF):
                    self._send(message)

    def say(self, text: str) -> None:
        """Show it a text."""
        self._send(self._link.mav.statustext_encode(6, text[:MAX_TEXT].encode("ascii", "replace")))

    def _heartbeat(self, _: Mapping[str, float], __: int) -> list[Any]:
        armed, mode = (0, HOLD) if self._stopped else (128, GUIDED)
        return [self._link.mav.heartbeat_encode(10, 3, 1 | armed, mode, 4)]

    def _place(self, values: Mapping[str, float], now: int) -> list[Any]:
        x, y, heading, speed = (values.get(name, nan) for name in ("x", "y", "heading", "speed"))
        if not all(map(isfinite, (x, y, heading))):
            return []
        turn = values.get("turn_rate", 0.0)
        speed, turn = (each if isfinite(each) else 0.0 for each in (speed, turn))
        north, east, azimuth = speed * sin(heading), speed * cos(heading), (pi / 2.0 - heading) % (2.0 * pi)
        mav, signed = self._link.mav, azimuth - 2.0 * pi if azimuth > pi else azimuth
        found = [
            mav.attitude_encode(now, 0.0, 0.0, signed, 0.0, 0.0, -turn),
            mav.local_position_ned_encode(now, y, x, 0.0, north, east, 0.0),
        ]
        if self._map is not None:
            ((latitude, longitude),) = self._map.degrees([x], [y])
            if isfinite(latitude):
                pace = (_short(100.0 * north), _short(100.0 * east), 0, int(100.0 * degrees(azimuth)) % 36_000)
                place = (round(latitude * 1e7), round(longitude * 1e7), 0, 0)
                found.append(mav.global_position_int_encode(now, *place, *pace))
                found.append(mav.gps_raw_int_encode(now * 1000, 3, *place[:3], 65_535, 65_535, 65_535, 65_535, 255))
        return found

    def _state(self, values: Mapping[str, float], _: int) -> list[Any]:
        left = next((values[name] for name in ("battery", "fuel") if isfinite(values.get(name, nan))), nan)
        volts = next((values[name] for name in ("volts", "motor_volts") if isfinite(values.get(name, nan))), nan)
        millivolts = min(max(round(1000.0 * volts), 0), 65_534) if isfinite(volts) else 65_535
        percent = round(100.0 * min(max(left, 0.0), 1.0)) if isfinite(left) else -1
        return [self._link.mav.sys_status_encode(0, 0, 0, 0, millivolts, -1, percent, 0, 0, 0, 0, 0, 0)]

    def _send(self, message: Any) -> None:
        with suppress(OSError):  # a ground station that cannot be reached sees nothing, and asks for nothing
            self._link.send(message)

    def close(self) -> None:
        self._link.close()


def _short(value: float) -> int:
    return min(max(round(value), -32_768), 32_767)


def open_ground_station(uri: str, number: int, most: tuple[float, float]) -> GroundStation:
    """The ground station at `mavlink://HOST:PORT`, to which the robot is the vehicle behind #, otherwise the one with
    its own number. Raises BodyError."""
    address = read_body_address(uri, EXAMPLE, SETTINGS)
    origin = Origin.read(address.settings["origin"]) if address.settings["origin"] else None
    link = open_link(address, PORT, system_of(address, number if 1 <= number <= 254 else 1), 1)
    return GroundStation(link, origin, most)
