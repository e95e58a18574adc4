"""An instant for all on real UDP: robots whose clocks are wrong and drift, on a radio that loses and whose two ways are
unequal, obey `(AFTER-ISSUE 12s ...)`. Each robot is a process; its body notes by the one clock of this machine when it
works, and that is compared with the instant, and with the bound that the robot itself has answered.

    python -m benchmarks.instant                50 robots, three commands: a minute and a half
    python -m benchmarks.instant --robots 10    fewer
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import select
import socket
import statistics
import time
from collections.abc import Sequence
from heapq import heappop, heappush
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from threading import Thread
from typing import NamedTuple

from sleepcast.channel.admission import ROBOT_KINDS, Admission
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import BOUND, Kind, Message, Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import ChannelSession
from sleepcast.channel.transports.arrival import StampedSocket
from sleepcast.channel.transports.transport import ReceivedDatagram, Transport, listen_for, waited
from sleepcast.channel.transports.udp import UdpTransport
from sleepcast.core.clock import Clock, UnixClock, WallClock, epoch_at
from sleepcast.language import HostFunction, Vocabulary
from sleepcast.loop.real import EmbodiedMind, TickTiming, run_robots
from sleepcast.mind.instants import MeasuredClocks
from sleepcast.node.node import Node
from sleepcast.robot import Geometry, Limits, Reading, RobotModel, Setpoint
from sleepcast.station.network import NetworkStation
from sleepcast.station.validation import SendPolicy

FLEET = "instant"
TICK = 0.04
LOSS = 0.2
THERE, BACK, JITTER = 0.022, 0.002, 0.002
"""Seconds from the desk to a robot and back, which differ by 20 ms, and by how much each may be longer."""
OFF, DRIFT = 1.9, 50e-6
"""By how many seconds clocks are wrong at most, which is what messages allow, and by which share they are too fast or
too slow."""
WAIT, PATIENT = 12.0, 8.0
"""Seconds from the issue to the instant, and after it for which answers that were lost are asked for again."""
PATIENCE = 60.0
"""Seconds within which all robots are there."""
ROBOT = KeyPair("r*", Role.ROBOT, b"r" * 32)
DESK = KeyPair("chief", Role.COMMANDER, b"c" * 32)


class WrongClock:
    """A clock that is `off` s ahead now and gains the share `drift` of each second."""

    def __init__(self, off: float, drift: float) -> None:
        self._true, self._off, self._drift = UnixClock(), off, drift
        self._began = self._true.now()

    def now(self) -> float:
        true = self._true.now()
        return true + self._off + self._drift * (true - self._began)


class DelayingTransport:
    """UDP of which one party hears everything late, loses a share, and is heard late. there, back: s, besides
    chance, from when a datagram is sent or arrives: a radio does not wait for its robot's processor."""

    def __init__(self, udp: UdpTransport, chance: Random, there: float, back: float) -> None:
        self._udp, self._chance, self._there, self._back = udp, chance, there, back
        self._ours, self._theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._ours.setblocking(False)
        self._stamped = StampedSocket(self._ours)
        self.ignore = udp.ignore
        self._flying: list[tuple[float, int, bool, bytes]] = []
        self._count = 0
        self._wake, self._waker = os.pipe()
        self._waiting: list[tuple[float, bytes]] = []
        Thread(target=self._fly, daemon=True).start()

    def fileno(self) -> int:
        return self._ours.fileno()

    def send(self, datagram: bytes) -> None:
        self._waiting.append((time.monotonic(), datagram))
        os.write(self._waker, b"1")

    def receive(self) -> list[bytes]:
        found: list[bytes] = []
        self._stamped.compare()
        while True:
            try:
                datagram, _, arrived = self._stamped.receive(2_048)
            except BlockingIOError:
                return found
            found.append(received := ReceivedDatagram(datagram))
            received.arrived = arrived

    def receive_stops(self) -> list[bytes]:
        return []

    def close(self) -> None:
        self._udp.close()

    def _fly(self) -> None:
        """Hand on what is due, in a thread of its own."""
        while True:
            left = self._flying[0][0] - time.monotonic() if self._flying else 1.0
            came, _, _ = select.select([self._udp, self._wake], [], [], max(0.0, left))
            if self._wake in came:
                os.read(self._wake, 4_096)
                waiting, self._waiting = self._waiting, []
                for sent, datagram in waiting:
                    self._let_fly(True, datagram, sent + self._back)
            for datagram in self._udp.receive() if self._udp in came else ():
                if self._chance.random() >= LOSS:
                    self._let_fly(False, datagram, time.monotonic() - waited(datagram) + self._there)
            while self._flying and self._flying[0][0] <= time.monotonic():
                _, _, outward, datagram = heappop(self._flying)
                (self._udp.send if outward else self._theirs.send)(datagram)

    def _let_fly(self, outward: bool, datagram: bytes, due: float) -> None:
        self._count += 1
        heappush(self._flying, (due + self._chance.uniform(0.0, JITTER), self._count, outward, datagram))


class StampingBody:
    """A body that notes by the true clock when it works."""

    model = RobotModel("stamper", (), (), (), Limits(0.0, 0.0, 1.0), Geometry(0.1))

    def __init__(self, name: str, log: Path) -> None:
        self._name, self._log = name, os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)

    def work(self, number: float) -> None:
        os.write(self._log, f"{UnixClock().now()!r} {self._name} {number:.0f}\n".encode())

    def sense(self) -> Reading:
        return Reading(time.monotonic(), ())

    def act(self, wanted: Setpoint) -> None: ...

    def hold(self, still: bool) -> None: ...

    def stop(self) -> None: ...

    def release(self) -> None: ...

    def now(self) -> float:
        return time.monotonic()

    def complaints(self) -> list[str]:
        return []

    def close(self) -> None: ...


VOCABULARY = Vocabulary(
    "stamper", functions=(HostFunction("WORK", StampingBody.work, dimensions=(None,), arguments="number"),)
)


class MindTime:
    """The time of a mind."""

    def __init__(self, clock: Clock, zero: float) -> None:
        self._clock, self._zero = clock, zero

    def now(self) -> float:
        return self._clock.now() - self._zero


def session_of(name: str, key: KeyPair, transport: Transport, clock: Clock, chance: Random) -> ChannelSession:
    robot = key is ROBOT
    listen_for(transport, ROBOT_KINDS if robot else Kind)
    admission = Admission(Trust((ROBOT.public, DESK.public)), FLEET, clock, robot=robot)
    delivery = ReliableDelivery(name, epoch_at(clock.now()), key, admission, Random(chance.random()))
    return ChannelSession(transport, delivery, clock, Random(chance.random()))


def be_robot(uri: str, name: str, log: Path, seed: int) -> None:
    """A robot until it is killed."""
    chance = Random(seed)
    clock = WrongClock(chance.uniform(-OFF, OFF), chance.uniform(-DRIFT, DRIFT))
    transport = DelayingTransport(UdpTransport(uri), chance, THERE, BACK)
    session = session_of(name, ROBOT, transport, clock, chance)
    body = StampingBody(name, log)
    node = Node(name, VOCABULARY, number=seed, body=body, on_air=True)
    node.zero = session.zero = clock.now()
    node.clock = clock
    node.timing.clocks = MeasuredClocks(session.delivery.trips, lambda: node.zero)
    mind = EmbodiedMind(node, body, MindTime(clock, node.zero), session, TickTiming(), None, 0.0)
    run_robots([mind], WallClock(), tick=TICK, going=lambda: True, sleep=session.wait)


class Seen(NamedTuple):
    """What one robot has made of one command: by how much it missed the instant, and its own bound, s."""

    error: float
    bound: float


class Found(NamedTuple):
    """Of all robots and commands. asked: how many there should be; seen: of those that obeyed and told their bound."""

    asked: int
    seen: Sequence[Seen]

    @property
    def outside(self) -> int:
        """How many missed the instant by more than they have said."""
        return sum(each.error > each.bound for each in self.seen)

    def table(self) -> str:
        bounds, errors = ([1e3 * each[at] for each in self.seen] for at in (1, 0))
        return "\n".join(
            (
                f"robots and commands      {self.asked}",
                f"obeyed, and told a bound {len(self.seen)}",
                f"outside their own bound  {self.outside}",
                f"median bound             {statistics.median(bounds):.1f} ms",
                f"worst bound              {max(bounds):.1f} ms",
                f"median error             {statistics.median(errors):.1f} ms",
                f"worst error              {max(errors):.1f} ms",
            )
        )


def measured(robots: int, commands: int, wait: float = WAIT, seed: int = 1) -> Found:
    """Start this many robots, and send them so many commands, one after the other. wait: s to the instant of each."""
    with TemporaryDirectory() as folder, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        uri, log = f"udp://239.255.83.76:{free.getsockname()[1]}?interface=lo", Path(folder) / "log"
        free.close()
        log.touch()
        fork = multiprocessing.get_context("fork")
        crew = [
            fork.Process(target=be_robot, args=(uri, f"r{number}", log, seed * 1_000 + number), daemon=True)
            for number in range(1, robots + 1)
        ]
        for process in crew:
            process.start()
        try:
            return _commanded(uri, log, robots, commands, wait)
        finally:
            for process in crew:
                process.kill()
                process.join()


def _commanded(uri: str, log: Path, robots: int, commands: int, wait: float) -> Found:
    clock, chance = UnixClock(), Random(7)
    session = session_of("chief", DESK, UdpTransport(uri), clock, chance)
    station = NetworkStation(session, clock, VOCABULARY, {}, policy=SendPolicy())
    bounds: dict[tuple[str, str], float] = {}

    def note(messages: Sequence[Message]) -> None:
        for message in messages:
            if isinstance(bound := message.body.get(BOUND), float):
                bounds[message.sender, str(message.body["command"])] = bound

    station.listeners.append(note)
    until = clock.now() + PATIENCE
    while len(station.names) < robots and clock.now() < until:
        station.gather(station.ask("id"), 1.0)
    sent = []
    for number in range(commands):
        sent.append(station.send(f"(AFTER-ISSUE {wait}s (WORK {number}))", everybody=True))
        station.gather(sent[-1], PATIENT)
    seen = []
    for line in log.read_text().splitlines():
        at, name, number = line.split()
        command = sent[int(number)]
        bound = bounds.get((name, command.id))
        if bound is not None:
            seen.append(Seen(abs(float(at) - command.message.issued - wait), bound))
    session.close()
    return Found(robots * commands, seen)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--robots", type=int, default=50)
    parser.add_argument("--commands", type=int, default=3)
    chosen = parser.parse_args()
    found = measured(chosen.robots, chosen.commands)
    print(found.table())
    return 1 if found.outside or len(found.seen) < found.asked else 0


if __name__ == "__main__":
    raise SystemExit(main())
