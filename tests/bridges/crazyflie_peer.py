"""A Crazyflie over UDP, as far as its bridge needs one: CRTP packets, a table of variables, logs, setpoints.

    python tests/bridges/crazyflie_peer.py [PORT [CHARGE [SECONDS]]]

It moves as it is told, with no dynamics of flight; without setpoints it falls after two seconds, as the firmware lets
it, or after so many, and then needs to be started anew. CHARGE is that of its battery, in percent. It prints what
happens to it, a line each. From SIGUSR1 to the next one it speaks garbage besides.
"""

from __future__ import annotations

import math
import select
import signal
import socket
import struct
import sys
import time
from random import Random

VARIABLES = (
    *(("stateEstimate", name, 7) for name in ("x", "y", "z", "vx", "vy", "vz", "yaw")),
    ("gyro", "z", 7),
    ("pm", "batteryLevel", 1),
    ("supervisor", "info", 2),
)
"""Group, name and type (7: float, 1: uint8, 2: uint16) of what can be logged."""
CODES = {1: "B", 2: "H", 7: "f"}
AT_ONCE = 20
"""Packets of garbage in each twentieth of a second."""
FORGOTTEN = 2.0
"""Seconds without a setpoint after which the motors stop."""


class Peer:
    """The quadcopter; `advance` lets time pass for it. charge: %. forgotten: see `FORGOTTEN`."""

    def __init__(self, charge: float = 80.0, forgotten: float = FORGOTTEN) -> None:
        self.values = dict.fromkeys(("x", "y", "z", "vx", "vy", "vz", "yaw", "turn"), 0.0) | {"charge": charge}
        self.forgotten = forgotten
        self.armed = self.flying = self.locked = False
        self.command = (0.0, 0.0, 0.0, 0.0)
        self.landing = 0.0
        """m/s at which it comes down by itself."""
        self.since = 0.0
        """s since the last setpoint."""
        self.blocks: dict[int, list[int]] = {}
        self.started: dict[int, float] = {}
        self.said: list[str] = []

    def say(self, what: str) -> None:
        self.said.append(what)
        print(what, flush=True)

    def advance(self, seconds: float) -> None:
        now = self.values
        before = now["z"]
        self.since += seconds
        if self.flying and not self.landing and self.since > self.forgotten:
            self.say(f"falls from {now['z']:.2f} m")
            self.flying, self.locked, now["z"] = False, True, 0.0
        vx, vy, turn, height = self.command if self.flying and not self.landing else (0.0, 0.0, 0.0, 0.0)
        now["turn"] = turn
        now["yaw"] = (now["yaw"] + turn * seconds + 180.0) % 360.0 - 180.0
        yaw = math.radians(now["yaw"])  # after it has turned, so that all that is told is of one instant
        now["vx"], now["vy"] = vx * math.cos(yaw) - vy * math.sin(yaw), vx * math.sin(yaw) + vy * math.cos(yaw)
        now["x"] += now["vx"] * seconds
        now["y"] += now["vy"] * seconds
        if self.landing:
            now["z"] = max(0.0, now["z"] - self.landing * seconds)
            if not now["z"]:
                self.flying, self.landing = False, 0.0
                self.say("has landed by itself")
        elif self.flying:
            now["z"] = height
        now["vz"] = (now["z"] - before) / seconds if seconds else 0.0

    def answers(self, packet: bytes) -> list[bytes]:
        """What it says to a packet: a header (port, two bits, channel) and data."""
        header, data = packet[0], packet[1:]
        port, channel = header >> 4, header & 3
        if port == 15:  # the link: echo, and who is there
            return [bytes([header]) + (b"Bitcraze Crazyflie\0" if channel == 1 else data)]
        if port == 13 and channel == 1 and data[:1] == b"\0":
            return [bytes([header, 0, 12])]
        if port in (2, 5) and channel == 0:
            return self._table(header, data, VARIABLES if port == 5 else ())
        if port == 4 and data[:1] == b"\1":
            return [bytes([header, 1, 0])]
        if port == 5 and channel == 1:
            return [self._log(header, data)]
        if port == 9 and channel == 1:
            self._supervise(data)
        elif port == 7:
            self._steer(channel, data)
        elif port == 8 and data[:1] == b"\x08":  # land
            duration = struct.unpack("<BBff?f", data)[-1]
            self.landing = self.values["z"] / max(duration, 0.1)
            self.say("lands by itself")
        return []

    def _table(self, header: int, data: bytes, entries: tuple[tuple[str, str, int], ...]) -> list[bytes]:
        if data[0] == 3:
            return [bytes([header, 3]) + struct.pack("<HI", len(entries), 0x5EE9 + len(entries))]
        number = struct.unpack("<H", data[1:3])[0]
        group, name, sort = entries[number]
        return [bytes([header, 2]) + struct.pack("<HB", number, sort) + f"{group}\0{name}\0".encode()]

    def _log(self, header: int, data: bytes) -> bytes:
        command, block = data[0], data[1] if len(data) > 1 else 0
        if command == 5:
            self.blocks, self.started = {}, {}
        elif command == 6:
            self.blocks[block] = [struct.unpack_from("<H", data, at + 1)[0] for at in range(2, len(data), 3)]
        elif command == 3:
            self.started[block] = 0.0
        return bytes([header, command, block, 0])

    def _supervise(self, data: bytes) -> None:
        if data[0] == 1:
            self.armed = bool(data[1])
            self.say("is armed" if self.armed else "is disarmed")
            if self.flying and not self.armed:
                self.say(f"falls from {self.values['z']:.2f} m")
                self.flying, self.locked, self.values["z"] = False, True, 0.0
        elif data[0] == 3 and not self.locked:
            self.flying, self.locked, self.values["z"] = False, True, 0.0
            self.say("cuts its motors")

    def _steer(self, channel: int, data: bytes) -> None:
        if channel == 1 or not self.armed or self.locked:
            return
        self.since = 0.0
        if data[0] == 10:
            _, *command = struct.unpack("<Bffff", data)
            if not self.flying:
                self.say("takes off")
            self.flying, self.command = True, (command[0], command[1], command[2], command[3])
        elif data[0] == 0:
            if self.flying:
                self.say(f"stops its motors at {self.values['z']:.2f} m")
            self.flying, self.values["z"] = False, 0.0

    def info(self) -> int:
        """What its supervisor says: may be armed, is armed, may fly, flies, is locked."""
        free = not self.locked
        return free | self.armed << 1 | (free and self.armed) << 3 | self.flying << 4 | self.locked << 6

    def logs(self) -> list[bytes]:
        """A packet for each log that runs."""
        now = self.values
        shown = [
            *(now[name] for name in ("x", "y", "z", "vx", "vy", "vz", "yaw", "turn")),
            int(now["charge"]),
            self.info(),
        ]
        found = []
        for block in self.started:
            numbers = self.blocks[block]
            form = "<" + "".join(CODES[VARIABLES[number][2]] for number in numbers)
            data = struct.pack(form, *(shown[number] for number in numbers))
            found.append(bytes([5 << 4 | 2, block, 0, 0, 0]) + data)
        return found


def garbage(chance: Random) -> bytes:
    """A packet of any port and channel, with any bytes."""
    return chance.randbytes(chance.randrange(1, 32))


def serve(port: int, *settings: float) -> None:
    """Be a quadcopter at this port (0: any) until killed. settings: of `Peer`."""
    chance, raving = Random(7), False

    def rave(*_: object) -> None:
        nonlocal raving
        raving = not raving

    signal.signal(signal.SIGUSR1, rave)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", port))
        print(f"the Crazyflie is at port {line.getsockname()[1]}", flush=True)
        peer, ground = Peer(*settings), None
        last = time.monotonic()
        while True:
            ready, _, _ = select.select([line], [], [], 0.02)
            if ready:
                packet, ground = line.recvfrom(64)
                for answer in peer.answers(packet):
                    line.sendto(answer, ground)
            now = time.monotonic()
            if now - last >= 0.05:
                peer.advance(now - last)
                last = now
                if ground is not None:
                    for log in (*peer.logs(), *(garbage(chance) for _ in range(AT_ONCE * raving))):
                        line.sendto(log, ground)


if __name__ == "__main__":
    serve(int(sys.argv[1]) if sys.argv[1:] else 0, *map(float, sys.argv[2:]))
