"""A vehicle that speaks MAVLink 2, made of pymavlink alone: what the bridge is tested against.

It runs in the test's own process, where its time passes only when it is told to, or in one of its own:

    python mavlink_vehicle.py PORT PHRASE [rover|copter|plane [CHARGE]]

It sends to 127.0.0.1:PORT, as vehicles do to ground stations. CHARGE is that of its battery, in percent.

A line "reboot" on its standard input starts it anew, "mute" takes its voice, "speak" gives it back, "mode NUMBER" is
its pilot's switch, "text WORDS" has it say these, and from "refuse" to "allow" it lets nobody arm it. It prints its
modes, and when a copter is in the air or on the ground.
"""

from __future__ import annotations

import hashlib
import select
import socket
import sys
import time
from contextlib import suppress
from io import FileIO
from math import atan, cos, degrees, inf, pi, radians, sin
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect
from pyproj import Geod

HOME = (36.6, -121.9)
EARTH = Geod(ellps="WGS84")
GUIDED = {"rover": 15, "copter": 4, "plane": 15}
TYPES = {"rover": 10, "copter": 2, "plane": 1}
LAND = 9
AUTO, LOITER, TAKEOFF = 10, 12, 13
"""Modes of a plane."""
AUTOS = {"rover": 10, "copter": 3, "plane": AUTO}
ROOM, AGAIN = 700, 1.0
"""Items of a mission, and seconds after which an item that has not come is asked for again."""
AIRSPEEDS, PACE, TIGHTEST, RADIUS = (9.0, 22.0), 15.0, 40.0, 60.0
"""m/s that a plane accepts, and flies at first; m: radius of its turns, and of its circles."""
GROUND = 120.0
"""m above the sea, where it starts."""
VERTICALLY = 2.0
"""m/s, by itself."""
LATE = 3.0
"""Seconds after which a setpoint no longer counts."""
SYSTEM = 1


class Vehicle:
    """heading: rad clockwise from north; forward, right, climb: m/s; turn: rad/s clockwise; ground: m above the sea,
    from which its heights count."""

    def __init__(self, kind: str, key: bytes | None, *, stamp: float | None = None) -> None:
        self.kind, self.key, self.stamp = kind, key, stamp
        self.latitude, self.longitude = HOME
        self.heading, self.height, self.ground = pi / 2.0, 0.0, GROUND
        self.charge = 80
        """%, of its battery."""
        self.orders: list[tuple[int, float]] = []
        self.heard: list[str] = []
        self.refuse: set[int] = set()
        self.deaf: set[int] = set()
        self.fastest = PACE if kind == "plane" else 9.0
        self.stored: dict[int, list[Any]] = {0: [], 1: []}
        """Items of its mission and of its fence, as they were written."""
        self.upload: tuple[int, int] | None = None
        """What is being written, and how many items."""
        self.swallows = False
        """Whether its next word that it has got all items is lost."""
        self.forgets = 0
        """How many of the next messages about missions it loses."""
        self.lands = False
        """Whether the mission of a plane has a landing."""
        self.reboot()

    def reboot(self) -> None:
        self.time = self.forward = self.right = self.climb = self.turn = 0.0
        self.rest_at, self.mode, self.armed = -1.0, 0, False
        self.target: tuple[float, float, float] | None = None
        self.radius = RADIUS
        self.rising: float | None = None
        self.item, self.ask_at, self.reports = 0, inf, list[Any]()
        self.due = dict.fromkeys(("heartbeat", "position", "state"), 0.0)
        self.mav = dialect.MAVLink(None, SYSTEM, 1)
        self.mav.robust_parsing = True
        if self.key is not None:
            self.mav.signing.secret_key, self.mav.signing.sign_outgoing = self.key, True
            self.mav.signing.timestamp = self.steps()

    # ---- what it hears

    def hear(self, data: bytes) -> list[bytes]:
        """Its answers to a datagram."""
        return [self.pack(answer) for message in self.mav.parse_buffer(data) or () for answer in self.obey(message)]

    def obey(self, message: Any) -> list[Any]:
        kind = message.get_type()
        self.heard.append(kind)
        if kind in ("COMMAND_LONG", "COMMAND_INT") and message.command not in self.deaf:
            self.orders.append((message.command, message.param2 if message.command == 176 else message.param1))
            result = 2 if message.command in self.refuse else 4 if self.fails(message) else 0
            if not result:
                self.do(message)
            return [self.mav.command_ack_encode(message.command, result)]
        if kind.startswith("MISSION_"):
            if self.forgets > 0:
                self.forgets -= 1
                return []
            return self.exchange(kind, message)
        if kind.startswith("SET_POSITION_TARGET") and self.mode == GUIDED[self.kind] and self.armed:
            self.rest_at, self.target, self.rising = self.time + LATE, None, None
            if kind.endswith("LOCAL_NED"):
                self.forward, self.right = message.vx, message.vy
                self.climb, self.turn = -message.vz, message.yaw_rate
            else:
                self.target = message.lat_int / 1e7, message.lon_int / 1e7, message.alt
        return []

    # ---- missions and fences, as ArduPilot has them

    def exchange(self, kind: str, message: Any) -> list[Any]:
        """Its answers to the mission protocol. It asks with MISSION_REQUEST, is told with MISSION_ITEM_INT, and says of
        a repeated item that it is out of order."""
        to, of = (message.get_srcSystem(), message.get_srcComponent()), message.mission_type
        if kind == "MISSION_COUNT":
            if message.count > ROOM:
                return [self.mav.mission_ack_encode(*to, 4, of)]
            self.upload, self.stored[of] = (of, message.count), []
            return self.ask_for_item()
        if kind == "MISSION_ITEM_INT":
            if self.upload is None or message.seq != len(self.stored[of]):
                return [self.mav.mission_ack_encode(*to, 13, of)]
            self.stored[of].append(message)
            if len(self.stored[of]) < self.upload[1]:
                return self.ask_for_item()
            self.upload, self.ask_at = None, inf
            if self.swallows:
                self.swallows = False
                return []
            return [self.mav.mission_ack_encode(*to, 0, of)]
        if kind == "MISSION_REQUEST_LIST":
            return [self.mav.mission_count_encode(*to, len(self.stored[of]), of)]
        if kind == "MISSION_REQUEST_INT":
            m = self.stored[of][message.seq]
            parameters = m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z
            return [self.mav.mission_item_int_encode(*to, message.seq, m.frame, m.command, 0, 1, *parameters, of)]
        return []

    def ask_for_item(self) -> list[Any]:
        if self.upload is None:
            return []
        self.ask_at = self.time + AGAIN
        return [self.mav.mission_request_encode(255, 190, len(self.stored[self.upload[0]]), self.upload[0])]

    def go_to_item(self) -> None:
        """In AUTO: on to the place of the present item, or to the next one."""
        while self.mode == AUTOS[self.kind] and 0 < self.item < len(self.stored[0]):
            m = self.stored[0][self.item]
            if m.command in (16, 17, 18, 19, 20, 21, 22, 82):
                at = (m.x / 1e7, m.y / 1e7) if m.x or m.y else (self.latitude, self.longitude)
                at = HOME if m.command == 20 else at
                height = 0.0 if self.kind == "rover" or m.command == 21 else m.z or self.height
                self.target = (*at, height)
                _, _, far = EARTH.inv(self.longitude, self.latitude, at[1], at[0])
                near = self.radius + 20.0 if self.kind == "plane" else 1.0
                if far > near or abs(self.height - height) > 0.5:
                    return
                self.reports.append(self.mav.mission_item_reached_encode(self.item))
            self.item += 1

    def change_mode(self, mode: int) -> None:
        """As its pilot does with a switch, too, or its own failsafe."""
        self.mode = mode
        self.forward = self.right = self.turn = self.climb = 0.0
        self.target = self.rising = None
        if self.kind == "plane" and self.flies:
            self.forward, self.radius = self.fastest, RADIUS
            self.target = self.latitude, self.longitude, self.height

    @property
    def flies(self) -> bool:
        return self.kind != "rover" and self.height > 0.05

    def fails(self, message: Any) -> bool:
        """A copter takes off from the ground, armed and in GUIDED, and is not armed while it is in LAND. A plane goes
        to places in GUIDED, at airspeeds that it can fly, and lands if its mission says how."""
        if self.kind == "plane":
            at = message.param1 == 0.0 and AIRSPEEDS[0] <= message.param2 <= AIRSPEEDS[1]
            follows = self.mode == GUIDED["plane"]
            return not {178: at and (follows or self.mode == AUTO), 192: follows, 189: self.lands, 22: False}.get(
                message.command, True
            )
        if message.command == 22:
            return self.mode != GUIDED[self.kind] or not self.armed or self.flies
        return message.command == 400 and message.param1 == 1.0 and (self.kind, self.mode) == ("copter", LAND)

    def do(self, message: Any) -> None:
        if message.command == 176:
            self.change_mode(int(message.param2))
        elif message.command == 400:
            self.armed = message.param1 == 1.0
        elif message.command == 178:
            self.fastest = message.param2
        elif message.command == 22:
            self.rising = message.param7
        elif message.command == 224:
            self.item = int(message.param1)
        elif message.command == 300:
            self.change_mode(AUTOS[self.kind])
        elif message.command == 192:
            self.target, self.radius = (message.x / 1e7, message.y / 1e7, message.z), message.param3
        elif message.command == 189:
            self.change_mode(AUTO)
            self.target = (*HOME, 0.0)

    # ---- what it does

    def advance(self, seconds: float) -> list[bytes]:
        """What it says on the way."""
        self.time += seconds
        if self.time >= self.ask_at:
            self.reports += self.ask_for_item()
        if self.armed:
            self.go_to_item()
        if self.kind == "plane":
            self.fly(seconds)
            return self.go(seconds)
        if self.time > self.rest_at:
            self.forward = self.right = self.turn = self.climb = 0.0
        if self.rising is not None:
            self.climb = VERTICALLY if self.height < self.rising else 0.0
        if (self.kind, self.mode) == ("copter", LAND):
            self.climb = -1.0 if self.flies else 0.0
            self.armed = self.armed and self.flies
        if self.target is not None:
            azimuth, _, far = EARTH.inv(self.longitude, self.latitude, self.target[1], self.target[0])
            self.heading, self.forward = radians(azimuth), min(self.fastest, far)
            self.climb = max(-VERTICALLY, min(VERTICALLY, (self.target[2] - self.height) / max(seconds, 0.01)))
            self.rest_at = self.time + LATE
        return self.go(seconds)

    def fly(self, seconds: float) -> None:
        """Of a plane: it circles around its target, clockwise, and climbs or sinks to its height on the way."""
        self.turn = self.climb = 0.0
        if not self.armed:
            self.forward = 0.0
            return
        takes_off = self.mode == AUTO and self.item and self.stored[0][self.item : self.item + 1]
        if (self.mode == TAKEOFF or takes_off) and not self.flies:
            self.forward, self.target = self.fastest, (*self.ahead(200.0), 50.0)
            self.height = 0.1
        if self.target is None or not self.flies:
            return
        azimuth, _, far = EARTH.inv(self.target[1], self.target[0], self.longitude, self.latitude)
        course = radians(azimuth) + pi / 2.0 + atan(0.02 * (far - self.radius))
        aside = (course - self.heading + pi) % (2.0 * pi) - pi
        most = self.fastest / TIGHTEST
        self.turn = max(-most, min(most, aside / max(seconds, 0.01)))
        self.climb = max(-VERTICALLY, min(VERTICALLY, (self.target[2] - self.height) / max(seconds, 0.01)))
        if self.mode == AUTO and self.height < 0.5 and self.target[2] <= 0.0:
            self.armed, self.height, self.forward = False, 0.0, 0.0

    def ahead(self, far: float) -> tuple[float, float]:
        """Latitude and longitude of a place so many m ahead."""
        longitude, latitude, _ = EARTH.fwd(self.longitude, self.latitude, degrees(self.heading), far)
        return latitude, longitude

    def go(self, seconds: float) -> list[bytes]:
        self.heading += self.turn * seconds
        self.height += self.climb * seconds
        for speed, aside in ((self.forward, 0.0), (self.right, pi / 2.0)):
            if go := speed * seconds:
                way = degrees(self.heading + aside)
                self.longitude, self.latitude, _ = EARTH.fwd(self.longitude, self.latitude, way, go)
        return [self.pack(each) for each in self.say()]

    def say(self) -> list[Any]:
        said, self.reports = self.reports, []
        for what, every in (("heartbeat", 1.0), ("position", 0.05), ("state", 0.25)):
            if self.time >= self.due[what] - 1e-9:
                self.due[what] = self.time + every
                said += getattr(self, what)()
        return said

    def heartbeat(self) -> list[Any]:
        return [self.mav.heartbeat_encode(TYPES[self.kind], 3, 1 | 128 * self.armed, self.mode, 4)]

    def position(self) -> list[Any]:
        now, heading = int(self.time * 1000), self.heading % (2.0 * pi)
        ahead, east_of = cos(heading), sin(heading)
        north = round(100 * (self.forward * ahead - self.right * east_of))
        east = round(100 * (self.forward * east_of + self.right * ahead))
        above = int(self.height * 1000)
        place = round(self.latitude * 1e7), round(self.longitude * 1e7), round(self.ground * 1000) + above, above
        pace = north, east, round(-100 * self.climb), int(degrees(heading) * 100) % 36_000
        return [
            self.mav.global_position_int_encode(now, *place, *pace),
            self.mav.attitude_encode(now, 0, 0, 0, 0, 0, self.turn),
        ]

    def state(self) -> list[Any]:
        return [
            self.mav.sys_status_encode(0, 0, 0, 0, 12_600, -1, self.charge, 0, 0, 0, 0, 0, 0),
            self.mav.gps_raw_int_encode(0, 3, 0, 0, 0, 0, 0, 0, 0, 11),
            self.mav.mission_current_encode(self.item, len(self.stored[0]), self.mission_state()),
            self.mav.home_position_encode(
                *(round(each * 1e7) for each in HOME), round(GROUND * 1e3), *(0,) * 3, [0] * 4, *(0,) * 3
            ),
            *([self.mav.extended_sys_state_encode(0, self.landed())] if self.kind != "rover" else []),
        ]

    def mission_state(self) -> int:
        """Not started, active, or complete."""
        if self.item and self.item >= len(self.stored[0]):
            return 5
        return 3 if self.mode == AUTOS[self.kind] else 2

    def landed(self) -> int:
        """As ArduPilot's copters tell it: on the ground, in the air, taking off, landing."""
        if not self.flies:
            return 1
        return (
            4
            if (self.kind, self.mode) == ("copter", LAND)
            else 2
            if self.rising is None or self.height >= self.rising
            else 3
        )

    def pack(self, message: Any) -> bytes:
        self.mav.seq = (self.mav.seq + 1) % 256
        signing, now = self.mav.signing, self.steps()
        # Another clock may be ahead and is followed, unless ours is not set by others.
        signing.timestamp = max(signing.timestamp, now) if self.stamp is None else now
        return bytes(message.pack(self.mav))

    def steps(self) -> int:
        """The time of its clock, as signatures count it."""
        now = time.time() if self.stamp is None else self.stamp + self.time
        return int((now - 1_420_070_400) * 1e5)


def main() -> None:
    port, phrase = int(sys.argv[1]), sys.argv[2]
    vehicle = Vehicle(sys.argv[3] if len(sys.argv) > 3 else "rover", hashlib.sha256(phrase.encode()).digest())
    vehicle.charge = int(sys.argv[4]) if len(sys.argv) > 4 else vehicle.charge
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.connect(("127.0.0.1", port))
    typed = FileIO(sys.stdin.fileno())  # so that no line waits where `select` does not see it
    began, mute, inputs = time.monotonic(), False, [wire, typed]
    shown, flew = -1, False
    while True:
        if vehicle.flies is not flew:
            flew = vehicle.flies
            print("in the air" if flew else "on the ground", flush=True)
        if vehicle.mode != shown:
            shown = vehicle.mode
            print(f"mode {shown}", flush=True)
        ready, _, _ = select.select(inputs, [], [], 0.02)
        if typed in ready:
            match typed.readline().decode().strip():
                case "reboot":
                    vehicle.reboot()
                    began = time.monotonic()
                case "mute" | "speak" as word:
                    mute = word == "mute"
                case word if word.startswith("mode "):
                    vehicle.change_mode(int(word.removeprefix("mode ")))
                case word if word.startswith("text "):
                    said_so = vehicle.mav.statustext_encode(2, word.removeprefix("text ").encode())
                    wire.send(vehicle.pack(said_so))
                case "refuse":
                    vehicle.refuse.add(400)
                case "allow":
                    vehicle.refuse.clear()
                case _:
                    return
        said = vehicle.advance(time.monotonic() - began - vehicle.time)
        if wire in ready:
            try:
                said += vehicle.hear(wire.recv(2048))
            except ConnectionRefusedError:
                continue
        for each in () if mute else said:
            with suppress(ConnectionRefusedError):  # nobody listens yet
                wire.send(each)


if __name__ == "__main__":
    main()
