"""A radio of bad manners, in the place of a bridge: what one host sends reaches each of the others after a time of its
own, and some of it twice.

    python -m benchmarks.channel.relay --delay S --twice SHARE --seed N PORT...

It takes whole frames from the cables' ends by packet sockets, says `ready`, and ends with its standard input, once it
has given out all that came until then. Then it says as JSON how many frames came, how many it gave out, and how many
times one overtook another.
"""

from __future__ import annotations

import argparse
import json
import select
import socket
import sys
import time
from heapq import heappop, heappush
from random import Random

ETH_ALL = 3
LONGEST = 65_536
OUTGOING = 4
"""Sort of frame that a packet socket shows to us although we have sent it."""
AT_ONCE = 256
"""Frames taken from one cable before the others have their turn."""
IPV4, UDP = b"\x08\x00", 17
BUFFER = 8 * 1024 * 1024


class Relay:
    """ports: names of the cables' ends. delay: s at most; twice: share of copies that come twice."""

    def __init__(self, ports: list[str], delay: float, twice: float, chance: Random) -> None:
        self._delay, self._twice, self._chance = delay, twice, chance
        self._sockets = [_opened(port) for port in ports]
        self._flying: list[tuple[float, int, int, bytes]] = []
        self._latest = [0] * len(ports)
        self.taken = self.given = self.overtaken = self.refused = 0

    def run(self) -> None:
        """Until standard input ends, and all that came before is given out."""
        places = {each.fileno(): place for place, each in enumerate(self._sockets)}
        poll = select.poll()
        for descriptor in (sys.stdin.fileno(), *places):
            poll.register(descriptor, select.POLLIN)
        going = True
        while going:
            ready = [descriptor for descriptor, _ in poll.poll(1e3 * self._due(1.0))]
            going = sys.stdin.fileno() not in ready
            for descriptor in ready if going else places:
                self._take(places[descriptor])
            self._give()
        while self._flying:
            time.sleep(self._due(0.0))
            self._give()

    def _due(self, otherwise: float) -> float:
        """Seconds until something is to be given out."""
        return max(0.0, self._flying[0][0] - time.monotonic()) if self._flying else otherwise

    def _take(self, place: int) -> None:
        for _ in range(AT_ONCE):
            try:
                frame, (_, _, sort, *_) = self._sockets[place].recvfrom(LONGEST)
            except BlockingIOError:
                return
            if sort == OUTGOING:
                continue
            self.taken += 1
            frame, now = _without_checksum(frame), time.monotonic()
            for to in range(len(self._sockets)):
                for _ in range(0 if to == place else 1 + (self._chance.random() < self._twice)):
                    heappush(self._flying, (now + self._chance.random() * self._delay, self.taken, to, frame))

    def _give(self) -> None:
        now = time.monotonic()
        while self._flying and self._flying[0][0] <= now:
            _, number, to, frame = heappop(self._flying)
            self.overtaken += number < self._latest[to]
            self._latest[to] = max(self._latest[to], number)
            try:
                self._sockets[to].send(frame)
                self.given += 1
            except OSError:  # a full queue: lost on the way, as on any radio
                self.refused += 1


def _opened(port: str) -> socket.socket:
    made = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETH_ALL))
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
    made.bind((port, 0))
    made.setblocking(False)
    return made


def _without_checksum(frame: bytes) -> bytes:
    """The sender leaves UDP's checksum to a network card that does not exist here: zero says that there is none."""
    if frame[12:14] != IPV4 or frame[23] != UDP:
        return frame
    at = 14 + 4 * (frame[14] & 15) + 6
    return frame[:at] + b"\0\0" + frame[at + 2 :]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.channel.relay", description=__doc__.split("\n")[0])
    parser.add_argument("--delay", type=float, required=True)
    parser.add_argument("--twice", type=float, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("ports", nargs="+")
    options = parser.parse_args()
    relay = Relay(options.ports, options.delay, options.twice, Random(options.seed))
    print("ready", flush=True)
    relay.run()
    counts = {name: getattr(relay, name) for name in ("taken", "given", "overtaken", "refused")}
    print(json.dumps(counts), flush=True)


if __name__ == "__main__":
    main()
