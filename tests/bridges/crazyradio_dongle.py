"""A Crazyradio with Crazyflies around it, in the place where its USB device would be: all of cflib above that is real.

    python tests/bridges/crazyradio_dongle.py ADDRESS[,ADDRESS...] COMMAND ...

runs `sleepcast COMMAND ...` with such a radio plugged in. It prints what happens to each quadcopter. A line
"away ADDRESS" on standard input takes one out of reach, "back ADDRESS" brings it back while a link begins; "unplug" and
"plug" do so with the radio.
"""

from __future__ import annotations

import sys
import time
from array import array
from collections import deque
from threading import Thread

import usb.core
from cflib.drivers import crazyradio

from bridges.crazyflie_peer import Peer

CHANNEL, ADDRESS = 1, 2
"""Requests of the USB device that set these."""
EVERYBODY = bytes((0xFF, 0xE7, 0xE7, 0xE7, 0xE7))
SAFE_LINK = bytes((0xFF, 0x05, 0x01))
TRIES = 10
"""How often cflib asks for a safe link when one begins."""
ROOM = 8
"""Packets that wait to be taken along, beyond which a quadcopter logs nothing: a busy machine takes few along."""


class Neighbour(Peer):
    """Several print into one stream."""

    name = ""

    def say(self, what: str) -> None:
        print(f"{self.name} {what}", flush=True)


class Ear:
    """A quadcopter's end of its radio link: acknowledged packets are taken once, and answers go with the next one."""

    def __init__(self, name: str) -> None:
        self.peer, self.near = Neighbour(), True
        self.peer.name = name
        self.up = self.down = 1
        self.misses = 0
        """Requests for a safe link that it does not hear."""
        self.waiting: deque[bytes] = deque(maxlen=100)
        self.answer = b"\xf3"
        self.last, self.logged = time.monotonic(), 0.0

    def live(self) -> None:
        now = time.monotonic()
        self.peer.advance(now - self.last)
        self.last = now
        if now - self.logged > 0.05 and len(self.waiting) < ROOM:  # else nobody would ever hear an answer behind them
            self.logged = now
            self.waiting.extend(self.peer.logs())

    def hear(self, packet: bytes) -> bytes | None:
        if packet == SAFE_LINK and self.misses:
            self.misses -= 1
            return None
        if packet == SAFE_LINK:
            self.up = self.down = 1
            return packet
        if packet[0] & 8 != self.up << 3:
            self.up = 1 - self.up
            if packet[0] & 0xF3 != 0xF3:
                self.waiting.extend(self.peer.answers(packet))
        if packet[0] & 4 != self.down << 2:
            self.down = 1 - self.down
            next_one = self.waiting.popleft() if self.waiting else b"\xf3"
            self.answer = bytes(((next_one[0] & 0xF3) | self.down << 2,)) + next_one[1:]
        return self.answer


class Context:
    def dispose(self, device: object) -> None:
        pass


class Dongle:
    """What cflib's Crazyradio asks of a device of pyusb's."""

    bcdDevice = 0x0099
    serial_number = "0"

    def __init__(self, addresses: list[str]) -> None:
        self.ears = {bytes.fromhex(each): Ear(each) for each in addresses}
        self.address, self.reply, self.plugged = b"", array("B", [0]), True
        self._ctx = Context()

    def set_configuration(self, number: int) -> None:
        self._check()

    def reset(self) -> None:
        self._check()

    def _check(self) -> None:
        if not self.plugged:
            raise usb.core.USBError("no such device")

    def ctrl_transfer(
        self, kind: int, request: int, wValue: int, wIndex: int, timeout: int, data_or_wLength: bytes
    ) -> None:
        self._check()
        if request == ADDRESS:
            self.address = bytes(data_or_wLength)

    def write(self, endpoint: int, data: bytes, timeout: int) -> None:
        self._check()
        time.sleep(0.001)  # as long as a packet and its answer are in the air
        packet, reply = bytes(data), None
        for address, ear in self.ears.items():
            ear.live()
            if ear.near and self.address == EVERYBODY and packet[0] & 0xF3 != 0xF3:
                ear.peer.answers(packet)
            elif ear.near and self.address == address:
                reply = ear.hear(packet)
        self.reply = array("B", [0]) if reply is None else array("B", [1, *reply])

    def read(self, endpoint: int, size: int, timeout: int) -> array[int]:
        self._check()
        return self.reply


def main() -> None:
    from sleepcast.__main__ import start

    dongle = Dongle(sys.argv[1].split(","))
    crazyradio._find_devices = lambda serial=None: [dongle] if dongle.plugged else []

    def obey() -> None:
        for line in sys.stdin:
            word, _, address = line.strip().partition(" ")
            if address:
                ear = dongle.ears[bytes.fromhex(address)]
                ear.near, ear.misses = word == "back", TRIES
            else:
                dongle.plugged = word == "plug"

    Thread(target=obey, daemon=True).start()
    sys.argv[1:2] = []
    start()


if __name__ == "__main__":
    main()
