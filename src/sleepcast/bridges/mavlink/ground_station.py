"""A robot as a vehicle of a ground station: it is seen there, and may be stopped, released and driven from there.

To the ground station it is a rover of ArduPilot's with two modes: HOLD while it is stopped, and GUIDED. What is asked
there becomes a `PilotRequest`, which the node brings to its mind like a command that is typed: so limits, STOP and
rules hold for it as for everybody. HOLD, and disarming, is STOP; GUIDED, and arming, is RELEASE, which ends only the
STOP that the ground station itself has sent; arming is refused while another one holds. A STOP by disarming is ended by
arming alone: programs choose GUIDED on their way to anything, also after they have switched off the motors. Which it
was is not known any more after a restart: a robot that begins under a STOP counts as disarmed.

A ground station that drives must go on doing so: `QUIET` s after its last setpoint the robot is to come to rest. What
the robot cannot do is refused with a text to the ground station.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from contextlib import suppress
from math import atan2, cos, hypot, inf, isfinite, nan, pi, remainder, sin
from typing import Any, Literal

from sleepcast.bridges.address import read_body_address
from sleepcast.bridges.mavlink.link import LINK, MavlinkConnection, open_link, system_of
from sleepcast.bridges.mavlink.self_portrait import (
    AUTOPILOT_VERSION,
    BEAT,
    EVERY,
    GUIDED,
    HOLD,
    PARAMETER,
    PLACE,
    STATE,
    SelfPortrait,
)
from sleepcast.core.clock import Clock, WallClock
from sleepcast.core.geodesy import LocalMap, Origin
from sleepcast.core.records import dataclass

EXAMPLE = "mavlink://127.0.0.1:14550?key=vehicle.key#1"
PORT = 14_550
SETTINGS = {**LINK, "origin": ""}
QUIET = 1.0
"""Seconds after the last setpoint: a dead man's switch, as for every driven robot."""
TELL_AGAIN = 5.0
"""Seconds between two reports of refused messages, and between two texts to the ground station that are the same."""
SET_MODE, ARM_DISARM, TERMINATE, GO_TO, WAYPOINT = 176, 400, 185, 192, 16
SEND_EVERY, SEND_ONE, TELL_ABILITIES = 511, 512, 520
STOPPING_MODES = frozenset((HOLD, 5))
"""HOLD and LOITER: a rover stands in both."""
BY_FORCE = 21_196
"""Of arming and disarming."""
ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
EARTH_FRAMES = frozenset((0, 3, 5, 6, 10, 11))
"""Degrees, and a height above the sea, above home, or above the ground, which are one here."""
LOCAL_FRAMES = frozenset((1, 7))
"""To north and east, from the origin and from where the robot is."""
BODY_FRAMES, OFFSET_FRAME = frozenset((8, 9)), 7
"""Along the heading from where the robot is, and to north and east from there."""
GO_THERE, MISSION_DENIED = 2, 14
"""What `current` is in a waypoint that is no part of a mission, and the answer to every other one."""
NO_VELOCITY, NO_PLACE, NO_YAW_RATE = 0x38, 0x7, 0x800
"""Flags of a setpoint that lacks these."""
STILL = 0.005
"""m/s: a slower velocity is none."""
HOMING = 2.0
"""How fast a robot turns to where it is to drive, rad/s for each rad that it heads elsewhere."""
MAX_TEXT = 50
"""Characters of a text to the ground station."""
INFORMATION, WARNING = 6, 4
"""How serious texts are."""
FARTHEST = 1e6
"""m: a place farther away is none."""

RequestType = Literal["stop", "release", "drive", "goal"]
Place = tuple[float, float, float]
"""x, y and height in m; NaN where there is none."""
NOWHERE = (nan, nan, nan)


@dataclass(frozen=True, slots=True)
class PilotRequest:
    """What the ground station wants.

    values: of "drive", speed in m/s and turn rate in rad/s; of "goal", x and y in m, and a height above the origin, if
        it has given one.
    """

    type: RequestType
    values: tuple[float, ...] = ()


class GroundStation:
    """See the module.

    link: to it.
    origin: where x = 0, y = 0 is; None if that is nowhere on the Earth.
    fastest: speed and turn rate of a joystick that is pushed as far as it goes, m/s and rad/s.
    """

    def __init__(
        self,
        link: MavlinkConnection,
        origin: Origin | None,
        fastest: tuple[float, float],
        *,
        clock: Clock | None = None,
    ) -> None:
        self._link, self._clock, self._fastest = link, clock or WallClock(), fastest
        self._map = None if origin is None else LocalMap(origin)
        self._portrait = SelfPortrait(link.mav, self._map)
        self._began = self._clock.now()
        self._every, self._due = dict(EVERY), dict.fromkeys(EVERY, -inf)
        """Of each message, by its number: s between two, and when it is due."""
        self._stopped, self._disarmed, self._mode = False, False, GUIDED
        """Whether any STOP holds; whether the ground station's own is one by disarming; and the mode it has chosen."""
        self._held = False
        """Whether somebody else's STOP holds as well."""
        self._shown_last = (GUIDED, True)
        """See `_appearance`."""
        self._is_new = True
        """Whether it was never told how the robot is."""
        self._here = (nan, nan, nan)
        """x, y in m and heading in rad."""
        self._height = nan
        self._driven, self._last = (0.0, 0.0), -inf
        self._course: tuple[float, float] | None = None
        """A velocity to the east and to the north, m/s, by which it is driven."""
        self._refusals_told = -inf
        """When refused messages were last reported."""
        self._refused_at: dict[str, float] = {}
        """When each text about what cannot be done was last shown."""
        self._complaints: list[str] = []

    # ---- what it wants

    def requests(self) -> list[PilotRequest]:
        """What it has asked for since the last call, of velocities and of places only the last one."""
        requests: list[PilotRequest] = []
        now, before = self._clock.now(), self._driven
        with suppress(OSError):
            for message in self._link.receive():
                news = self._requests_in(message, now)
                if any(each.type == "goal" for each in news):
                    requests = [each for each in requests if each.type != "goal"]
                requests += news
        if self._course is not None:
            self._driven = self._towards(*self._course)
        if (self._course or any(self._driven)) and now - self._last > QUIET:
            self._rest()
            self._complaints.append("the ground station no longer drives it: it comes to rest")
        if self._driven != before:
            requests.append(PilotRequest("drive", self._driven))
        return requests

    def complaints(self) -> list[str]:
        """What has gone wrong since the last call, in sentences."""
        now, sentences = self._clock.now(), self._complaints
        self._complaints = []
        if self._link.refused and now - self._refusals_told > TELL_AGAIN:
            self._refusals_told = now
            sentences += self._link.complaints("the ground station")
        return sentences

    def _requests_in(self, message: Any, now: float) -> list[PilotRequest]:
        """What a message asks for; what drives it is noted, and asked for by `requests`."""
        kind = message.get_type()
        if getattr(message, "target_system", self._link.mav.srcSystem) != self._link.mav.srcSystem:
            return []  # for everybody, or for another one: neither is meant
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            return self._command(message, exact=kind == "COMMAND_INT")
        if kind == "MISSION_ITEM_INT":
            return self._waypoint(message)
        if kind == "SET_MODE":
            return self._choose(message.custom_mode)
        if kind == "MANUAL_CONTROL" and message.target == self._link.mav.srcSystem:
            ahead, aside = (0 if each == 32_767 else each / 1000.0 for each in (message.x, message.r))
            self._drive(ahead * self._fastest[0], -aside * self._fastest[1], now)
        elif kind in ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT"):
            return self._set_point(message, now, earth=kind.endswith("GLOBAL_INT"))
        elif kind == "SET_ATTITUDE_TARGET":
            self._refuse("it cannot be driven by its attitude")
        elif kind in ("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"):
            if kind.endswith("LIST") or message.param_id == PARAMETER or getattr(message, "param_index", -1) == 0:
                self._send(self._portrait.parameter())
        elif kind in ("MISSION_REQUEST_LIST", "MISSION_COUNT", "MISSION_CLEAR_ALL"):
            self._answer_mission(message)
        return []

    def _command(self, message: Any, *, exact: bool) -> list[PilotRequest]:
        """exact: whether a place in it is in whole ten-millionths of a degree."""
        requests, result = [], ACCEPTED
        if message.command == SET_MODE:
            requests = self._choose(message.param2)
            result = ACCEPTED if requests or (self._disarmed and message.param2 == GUIDED) else DENIED
        elif message.command == ARM_DISARM:
            requests = self._arm() if message.param1 == 1.0 else self._disarm()
            if message.param1 != 1.0 and message.param2 == BY_FORCE:  # as MAVSDK 4.1 sends it to arm by force
                self._say("it is disarmed by force, which stops it")
            if message.param1 == 1.0 and self._held:
                result = DENIED
                self._say("it stays stopped: a STOP of somebody else holds")
        elif message.command == TERMINATE:
            requests = self._disarm() if message.param1 == 1.0 else []
            result = ACCEPTED if requests else DENIED
        elif message.command == GO_TO:
            requests = self._goal(self._named_place(message, exact=exact))
            result = ACCEPTED if requests else DENIED
        elif message.command in (SEND_ONE, TELL_ABILITIES):
            result = self._send_one(message.param1 if message.command == SEND_ONE else AUTOPILOT_VERSION)
        elif message.command == SEND_EVERY:
            result = self._send_every(message.param1, message.param2)
        else:
            result = UNSUPPORTED
        self._acknowledge(message, result)
        return requests

    def _acknowledge(self, message: Any, result: int) -> None:
        """Show it the mode first, if that is new: who is answered says where to go at once, and goes by what he saw."""
        if not self._is_new and self._appearance() != self._shown_last:
            self._due[BEAT] = self._clock.now() + self._every[BEAT]
            for beat in self._beat():
                self._send(beat)
        asker = message.get_srcSystem(), message.get_srcComponent()
        self._send(self._link.mav.command_ack_encode(message.command, result, 0, 0, *asker))

    # ---- what it asks for

    def _send_one(self, number: float) -> int:
        """Send a message; gives the answer. One of those that are sent all the time comes when it is told next."""
        asked = self._portrait.one(number)
        for each in asked:
            self._send(each)
        if asked:
            return ACCEPTED
        if number not in self._due:
            return UNSUPPORTED
        self._due[int(number)] = -inf
        return ACCEPTED

    def _send_every(self, number: float, interval: float) -> int:
        """Send a message more or less often; gives the answer. interval: microseconds, 0 as usual, below 0 never.
        Heartbeats are as they are: programs count a vehicle as lost that has none."""
        if number not in EVERY:
            return UNSUPPORTED
        if number == BEAT or not isfinite(interval):
            return DENIED
        kind = int(number)
        self._every[kind] = interval / 1e6 if interval > 0.0 else inf if interval < 0.0 else EVERY[kind]
        self._due[kind] = inf if interval < 0.0 else -inf
        return ACCEPTED

    def _answer_mission(self, message: Any) -> None:
        """There are none, and none is taken; programs wait for such an answer, and ask again and again without one.
        One of no items is none."""
        asker, mav = (message.get_srcSystem(), message.get_srcComponent()), self._link.mav
        if message.get_type() == "MISSION_REQUEST_LIST":
            self._send(mav.mission_count_encode(*asker, 0, message.mission_type))
            return
        refused = getattr(message, "count", 0) > 0
        if refused:
            self._say("it takes no missions")
        result = MISSION_DENIED if refused else ACCEPTED
        self._send(mav.mission_ack_encode(*asker, result, message.mission_type))

    # ---- STOP and RELEASE

    def _choose(self, mode: float) -> list[PilotRequest]:
        """A mode is chosen. GUIDED does not end a STOP by disarming."""
        if mode in STOPPING_MODES:
            self._mode = HOLD
            return self._halt()
        if mode != GUIDED:
            self._say("it has no such mode, only HOLD, LOITER and GUIDED")
            return []
        self._mode = GUIDED
        self._due[BEAT] = -inf  # also where it stays stopped
        return [] if self._disarmed else self._free()

    def _arm(self) -> list[PilotRequest]:
        self._disarmed, self._mode = False, GUIDED
        return self._free()

    def _free(self) -> list[PilotRequest]:
        """Programs say where to go as soon as this is acknowledged, before it is told again how the robot is."""
        self._stopped, self._due[BEAT] = self._held, -inf
        return [PilotRequest("release")]

    def _disarm(self) -> list[PilotRequest]:
        self._disarmed = True
        return self._halt()

    def _halt(self) -> list[PilotRequest]:
        """What it was sent before has ended, and what it is sent from now on meets a robot that is stopped."""
        self._rest()
        self._stopped, self._due[BEAT] = True, -inf
        return [PilotRequest("stop")]

    # ---- places

    def _waypoint(self, message: Any) -> list[PilotRequest]:
        """A waypoint that is to be gone to at once; there are no missions."""
        there = (message.command, message.current) == (WAYPOINT, GO_THERE)
        requests = self._goal(self._named_place(message, exact=True)) if there else []
        asker = message.get_srcSystem(), message.get_srcComponent()
        self._send(self._link.mav.mission_ack_encode(*asker, ACCEPTED if requests else MISSION_DENIED))
        return requests

    def _named_place(self, message: Any, *, exact: bool) -> Place:
        """The place in a command or waypoint. Only what is exact says in which frame it is."""
        if not exact:
            return self._on_map(message.param5, message.param6, message.param7)
        if message.frame in EARTH_FRAMES:
            return self._on_map(message.x / 1e7, message.y / 1e7, message.z)
        self._say(f"it goes to no place in frame {message.frame}")
        return NOWHERE

    def _on_map(self, latitude: float, longitude: float, height: float) -> Place:
        """A place in degrees; NaN if that is nowhere here."""
        if self._map is None:
            self._say("it has no origin, so no place on the Earth")
            return NOWHERE
        x, y = self._map.metres(latitude, longitude) or (nan, nan)
        return x, y, height

    def _goal(self, place: Place) -> list[PilotRequest]:
        """Nothing for what is no place, nor under a STOP: what is asked then may not set it in motion later. A velocity
        of before has ended: who goes to a place is not driven there."""
        if place is NOWHERE:
            return []  # which was said
        if not all(abs(each) <= FARTHEST for each in place[:2]):
            self._say("there is no such place here")
            return []
        if self._stopped or self._disarmed:
            self._say("it is stopped, so it goes nowhere")
            return []
        self._rest()
        return [PilotRequest("goal", place if abs(place[2]) <= FARTHEST else place[:2])]

    # ---- setpoints

    def _set_point(self, message: Any, now: float, *, earth: bool) -> list[PilotRequest]:
        """What a setpoint holds is obeyed, or refused with a text: a place comes before a velocity, except along the
        heading."""
        has_place, has_velocity = not message.type_mask & NO_PLACE, not message.type_mask & NO_VELOCITY
        frame = message.coordinate_frame
        if frame not in (EARTH_FRAMES if earth else LOCAL_FRAMES | BODY_FRAMES):
            self._refuse(f"it takes no setpoints in frame {frame}")
        elif has_velocity and frame in BODY_FRAMES:
            self._follow_heading(message, now)
        elif has_place:
            if earth:
                return self._goal(self._on_map(message.lat_int / 1e7, message.lon_int / 1e7, message.alt))
            return self._goal(self._at(message))
        elif has_velocity:
            self._follow_course(message, now)
        else:
            self._refuse("it takes setpoints with a place or a velocity")
        return []

    def _at(self, message: Any) -> Place:
        """A place in metres, from the origin or from the robot."""
        x, y, heading = self._here
        turned, moved = message.coordinate_frame in BODY_FRAMES, message.coordinate_frame == OFFSET_FRAME
        unknown = "where it is" if not isfinite(x + y) else "its heading" if turned and not isfinite(heading) else ""
        if (turned or moved) and unknown:
            self._say(f"it does not know {unknown}")
            return NOWHERE
        if turned:
            ahead, right = message.x, message.y
            offset = ahead * cos(heading) + right * sin(heading), ahead * sin(heading) - right * cos(heading)
            return x + offset[0], y + offset[1], self._height - message.z
        if moved:
            return x + message.y, y + message.x, self._height - message.z
        return message.y, message.x, -message.z  # north comes first, and down last

    def _follow_heading(self, message: Any, now: float) -> None:
        turn_rate = 0.0 if message.type_mask & NO_YAW_RATE else -message.yaw_rate
        if not (abs(message.vy) <= STILL and abs(message.vz) <= STILL):
            self._refuse("it moves along its heading only")
        else:
            self._drive(message.vx, turn_rate, now)

    def _follow_course(self, message: Any, now: float) -> None:
        """A velocity to north and east. A robot that cannot move sideways turns to where it is to drive."""
        if not abs(message.vz) <= STILL:
            self._refuse("it has no velocity up or down")
        elif not isfinite(self._here[2]):
            self._refuse("it does not know its heading")
        elif isfinite(message.vx) and isfinite(message.vy):
            self._course, self._last = (message.vy, message.vx), now
        else:
            self._refuse("it takes velocities that are numbers")

    def _towards(self, east: float, north: float) -> tuple[float, float]:
        """Speed and turn rate by which it comes to drive so, within the limits."""
        speed, heading = hypot(east, north), self._here[2]
        if speed <= STILL or not isfinite(heading):
            return 0.0, 0.0
        off, fastest = remainder(atan2(north, east) - heading, 2.0 * pi), self._fastest[1]
        return speed * max(cos(off), 0.0), min(max(HOMING * off, -fastest), fastest)

    def _drive(self, speed: float, turn_rate: float, now: float) -> None:
        if isfinite(speed) and isfinite(turn_rate):
            self._driven, self._course, self._last = (speed, turn_rate), None, now
        else:
            self._refuse("it takes velocities that are numbers")

    def _rest(self) -> None:
        self._driven, self._course = (0.0, 0.0), None

    def _refuse(self, why: str) -> None:
        """Take no setpoint, nor go on by the one before."""
        self._rest()
        self._say(why)

    # ---- what it is told

    def tell(self, values: Mapping[str, float], *, stopped: bool, held: bool = False) -> None:
        """Show it the robot, if that is due.

        values: of its sensors, by name, SI.
        held: whether it is stopped by somebody else, whether or not by the ground station as well.
        """
        if stopped:
            self._rest()
            if self._is_new:
                self._disarmed, self._mode = True, HOLD
        else:
            self._disarmed, self._mode = False, GUIDED
        self._here = values.get("x", nan), values.get("y", nan), values.get("heading", nan)
        self._height = values.get("height", nan)
        if stopped != self._stopped:
            self._due[BEAT] = -inf
        self._is_new, self._stopped, self._held, now = False, stopped, held, self._clock.now()
        due = {number for number, when in self._due.items() if now >= when}
        self._due |= {number: now + self._every[number] for number in due}
        for message in self._shown(due, values, int((now - self._began) * 1000.0) & 0xFFFFFFFF):
            if message.get_msgId() in due:
                self._send(message)

    def _shown(self, due: Set[int], values: Mapping[str, float], now: int) -> list[Any]:
        """What is due, and perhaps more of its kind."""
        messages: list[Any] = []
        if BEAT in due:
            messages += self._beat()
        if due & PLACE:
            messages += self._portrait.place(values, now)
        if due & STATE:
            messages += self._portrait.state(values, now)
        return messages

    def _beat(self) -> list[Any]:
        self._shown_last = mode, moves = self._appearance()
        return self._portrait.heartbeat(mode, moves=moves)

    def _appearance(self) -> tuple[int, bool]:
        """The mode to show, and whether it counts as armed."""
        return self._mode if self._disarmed or not self._stopped else HOLD, not self._stopped

    def say(self, text: str) -> None:
        """Show it a text."""
        self._send(self._link.mav.statustext_encode(INFORMATION, _short_text(text)))

    def _say(self, text: str) -> None:
        """Show it why something is not done, at most once in `TELL_AGAIN` s."""
        now = self._clock.now()
        if now - self._refused_at.get(text, -inf) > TELL_AGAIN:
            self._refused_at[text] = now
            self._send(self._link.mav.statustext_encode(WARNING, _short_text(text)))

    def _send(self, message: Any) -> None:
        with suppress(OSError):  # a ground station that cannot be reached sees nothing, and asks for nothing
            self._link.send(message)

    def close(self) -> None:
        self._link.close()


def _short_text(text: str) -> bytes:
    return text[:MAX_TEXT].encode("ascii", "replace")


def open_ground_station(uri: str, number: int, fastest: tuple[float, float]) -> GroundStation:
    """The ground station at `mavlink://HOST:PORT`. Raises BodyError.

    number: of the vehicle that the robot is to it, unless there is one behind #.
    fastest: see `GroundStation`.
    """
    address = read_body_address(uri, EXAMPLE, SETTINGS)
    origin = Origin.read(address.settings["origin"]) if address.settings["origin"] else None
    link = open_link(address, PORT, system_of(address, number if 1 <= number <= 254 else 1), 1)
    return GroundStation(link, origin, fastest)
