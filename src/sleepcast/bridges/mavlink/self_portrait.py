"""What a robot tells a ground station of itself, as messages of MAVLink: that it is a rover of ArduPilot's with two
modes, where it is, and what programs wait for before they command a vehicle: that it knows its place, and where its
home is.

Its home is the origin of its map. Heights count from there, above the sea as well, for nobody knows how high that is.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, degrees, isfinite, nan, pi, sin
from typing import Any

from sleepcast.core.geodesy import LocalMap

HOLD, GUIDED = 4, 15
ROVER, ARDUPILOT = 10, 3
WITH_A_MODE, ARMED = 1, 128
STANDBY, ACTIVE = 3, 4
ATTITUDE_SENSORS, POSITION_SENSORS, READY = 0x7, 0x20, 0x1000_0000
"""Gyroscopes, accelerometers and compasses; GPS; and whether it could be armed: what stands in SYS_STATUS for knowing
one's heading and one's place."""
BEAT, SYS_STATUS, BATTERY_STATUS, HOME_POSITION, AUTOPILOT_VERSION = 0, 1, 147, 242, 148
GPS_RAW_INT, ATTITUDE, LOCAL_POSITION_NED, GLOBAL_POSITION_INT, VFR_HUD = 24, 30, 32, 33, 74
PLACE = frozenset((GPS_RAW_INT, ATTITUDE, LOCAL_POSITION_NED, GLOBAL_POSITION_INT, VFR_HUD))
"""What tells where it is, and how it moves."""
STATE = frozenset((SYS_STATUS, BATTERY_STATUS, HOME_POSITION))
EVERY = {BEAT: 1.0, **dict.fromkeys(PLACE, 0.2), **dict.fromkeys(STATE, 1.0)}
"""Seconds between two messages of each kind, by number, unless the ground station asks for another time."""
PARAMETER = "SYSID_THISMAV"
"""The only one there is: its own number."""
FLOAT = 9
"""The type of a parameter's value."""
CAPABILITIES = 0x4 | 0x8 | 0x80 | 0x100 | 0x800 | 0x2000
"""Missions (there are none, and programs ask for them only then) and places in whole ten-millionths of a degree,
setpoints from the origin and on the Earth, termination, MAVLink 2."""
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
UNKNOWN_16, UNKNOWN_TEMPERATURE = 65_535, 32_767
NO_CELLS = (UNKNOWN_16,) * 9
"""The voltage of a battery stands in the place of its first cell, as ArduPilot has it."""
LARGEST = 1e9
"""Of a place in m, or of a speed: a larger one is none. A robot's variables may be of any size, and messages have room
for 3.4e38."""


class SelfPortrait:
    """See the module. Values are a robot's sensors by name, in SI; `now` is in ms since the start.

    mav: encodes.
    place: where x = 0, y = 0 is on the Earth; None if that is nowhere.
    """

    def __init__(self, mav: Any, place: LocalMap | None) -> None:
        self._mav, self._map = mav, place

    def heartbeat(self, mode: int, *, moves: bool) -> list[Any]:
        """mode: HOLD or GUIDED; moves: whether it is free to, which is what armed means."""
        flags = WITH_A_MODE | (ARMED if moves else 0)
        return [self._mav.heartbeat_encode(ROVER, ARDUPILOT, flags, mode, ACTIVE if moves else STANDBY)]

    def place(self, values: Mapping[str, float], now: int) -> list[Any]:
        """Where it is, and how it moves; nothing if it does not know."""
        x, y, heading = (_known(values, name, nan) for name in ("x", "y", "heading"))
        if not all(map(isfinite, (x, y, heading))):
            return []
        speed, turn, height, climb = (
            _known(values, name, 0.0) for name in ("speed", "turn_rate", "height", "climb_rate")
        )
        north, east, azimuth = speed * sin(heading), speed * cos(heading), (pi / 2.0 - heading) % (2.0 * pi)
        signed = azimuth - 2.0 * pi if azimuth > pi else azimuth
        messages = [
            self._mav.attitude_encode(now, 0.0, 0.0, signed, 0.0, 0.0, -turn),
            self._mav.local_position_ned_encode(now, y, x, -height, north, east, -climb),
            self._mav.vfr_hud_encode(abs(speed), abs(speed), int(degrees(azimuth)) % 360, 0, height, climb),
        ]
        if (position := self._on_earth(x, y)) is not None:
            above = _whole(1000.0 * height, 31)
            pace = (_whole(100.0 * north, 15), _whole(100.0 * east, 15), _whole(-100.0 * climb, 15))
            course = int(100.0 * degrees(azimuth)) % 36_000
            messages.append(self._mav.global_position_int_encode(now, *position, above, above, *pace, course))
            unknown = (UNKNOWN_16,) * 4
            messages.append(self._mav.gps_raw_int_encode(now * 1000, 3, *position, above, *unknown, 255))
        return messages

    def state(self, values: Mapping[str, float], _: int) -> list[Any]:
        """What works, and how full its battery is; and where its home is."""
        left = next((values[name] for name in ("battery", "fuel") if isfinite(values.get(name, nan))), nan)
        volts = next((values[name] for name in ("volts", "motor_volts") if isfinite(values.get(name, nan))), nan)
        millivolts = min(max(round(1000.0 * volts), 0), UNKNOWN_16 - 1) if isfinite(volts) else UNKNOWN_16
        percent = round(100.0 * min(max(left, 0.0), 1.0)) if isfinite(left) else -1
        present = ATTITUDE_SENSORS | POSITION_SENSORS | READY
        works = READY
        if isfinite(values.get("heading", nan)):
            works |= ATTITUDE_SENSORS
        if self._on_earth(values.get("x", nan), values.get("y", nan)) is not None:
            works |= POSITION_SENSORS
        battery = (millivolts, -1, percent)
        return [
            self._mav.sys_status_encode(present, present, works, 0, *battery, 0, 0, 0, 0, 0, 0),
            self._mav.battery_status_encode(0, 0, 0, UNKNOWN_TEMPERATURE, [millivolts, *NO_CELLS], -1, -1, -1, percent),
            *self.home(),
        ]

    def home(self) -> list[Any]:
        """Where its home is, if that is on the Earth."""
        position = self._on_earth(0.0, 0.0)
        if position is None:
            return []
        return [self._mav.home_position_encode(*position, 0, 0.0, 0.0, 0.0, UPRIGHT, 0.0, 0.0, 0.0)]

    def about(self) -> list[Any]:
        """What it can do, and who it is."""
        none = (0,) * 8
        return [
            self._mav.autopilot_version_encode(CAPABILITIES, 0, 0, 0, 0, none, none, none, 0, 0, self._mav.srcSystem)
        ]

    def parameter(self) -> Any:
        """Its only parameter, which nobody can change."""
        return self._mav.param_value_encode(PARAMETER.encode(), self._mav.srcSystem, FLOAT, 1, 0)

    def one(self, number: float) -> list[Any]:
        """The message with this number, if it is one that is sent when it is asked for."""
        if number == HOME_POSITION:
            return self.home()
        return self.about() if number == AUTOPILOT_VERSION else []

    def _on_earth(self, x: float, y: float) -> tuple[int, int] | None:
        """Latitude and longitude of a place on the map, in ten-millionths of a degree."""
        if self._map is None or not (isfinite(x) and isfinite(y)):
            return None
        ((latitude, longitude),) = self._map.degrees([x], [y])
        return (round(latitude * 1e7), round(longitude * 1e7)) if isfinite(latitude) else None


def _known(values: Mapping[str, float], name: str, otherwise: float) -> float:
    """A value, if it is one that can be."""
    value = values.get(name, nan)
    return value if abs(value) <= LARGEST else otherwise


def _whole(value: float, bits: int) -> int:
    """The nearest whole number that a signed field has room for; bits: of its size, without the sign."""
    return min(max(round(value), -(1 << bits)), (1 << bits) - 1)
