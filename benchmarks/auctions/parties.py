"""Parties of a channel on real UDP, each a process that is forked and may be killed at any moment: robots, whose bodies
note when they work, and desks.

What a party receives is lost as the run says, datagram by datagram, by a chance of its own.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterable, Sequence
from ctypes import c_double
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import RawValue
from pathlib import Path
from random import Random, SystemRandom
from typing import Any, Self

from sleepcast.channel.admission import ROBOT_KINDS, Admission
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import Kind, Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import ChannelSession
from sleepcast.channel.transports.transport import listen_for
from sleepcast.channel.transports.udp import UdpTransport
from sleepcast.cli.node_life import NodeProcess, StartScript
from sleepcast.core.clock import UnixClock, WallClock, epoch_at
from sleepcast.language import HostFunction
from sleepcast.loop import vocabulary_of
from sleepcast.loop.real import run_robots
from sleepcast.node.store import Store
from sleepcast.robot import Geometry, Limits, Reading, RobotModel, Setpoint
from sleepcast.station.network import NetworkStation
from sleepcast.station.validation import SendPolicy

FLEET = "auctions"
TICK = 0.1
ROBOT = KeyPair("r*", Role.ROBOT, b"r" * 32)
DESKS = {name: KeyPair(name, Role.COMMANDER, name[:1].encode() * 32) for name in ("anna", "bert", "chief")}
FORKED = "fork"
"""How a party begins, so that it is up at once: what it needs is imported already."""


@dataclass(frozen=True)
class Air:
    """What all parties have in common. uri: of the channel; loss: share of datagrams that each of them loses; log: the
    file in which bodies note that they work."""

    uri: str
    log: Path
    loss: Any

    @classmethod
    def at(cls, uri: str, log: Path) -> Self:
        return cls(uri, log, RawValue(c_double, 0.0))

    def session(self, name: str, key: KeyPair, store: Store | None = None) -> ChannelSession:
        clock, robot = UnixClock(), key is ROBOT
        transport = LossyTransport(UdpTransport(self.uri), self.loss)
        listen_for(transport, ROBOT_KINDS if robot else Kind)
        trust = Trust(each.public for each in (ROBOT, *DESKS.values()))
        admission = Admission(trust, FLEET, clock, robot=robot)
        epoch = epoch_at(clock.now()) if store is None else store.new_epoch(name)
        delivery = ReliableDelivery(name, epoch, key, admission, _chance())
        return ChannelSession(transport, delivery, clock, _chance())


class LossyTransport:
    """UDP of which one party loses a share of what comes. loss: a shared number."""

    def __init__(self, udp: UdpTransport, loss: Any) -> None:
        self._udp, self._loss, self._chance = udp, loss, _chance()
        self.fileno, self.send, self.ignore, self.close = udp.fileno, udp.send, udp.ignore, udp.close

    def receive(self) -> list[bytes]:
        return self._kept(self._udp.receive())

    def receive_stops(self) -> list[bytes]:
        return self._kept(self._udp.receive_stops())

    def _kept(self, datagrams: list[bytes]) -> list[bytes]:
        return [datagram for datagram in datagrams if self._chance.random() >= self._loss.value]


def _chance() -> Random:
    return Random(SystemRandom().getrandbits(64))


class Party:
    """A process that does this until it is killed."""

    def __init__(self, does: Callable[..., None], *arguments: object) -> None:
        self._arguments = does, arguments
        self._process: BaseProcess | None = None
        self.start()

    def start(self) -> None:
        """Begin, or begin anew."""
        does, arguments = self._arguments
        self._process = multiprocessing.get_context(FORKED).Process(target=does, args=arguments, daemon=True)
        self._process.start()

    def kill(self) -> None:
        """kill -9."""
        if self._process is not None and self._process.pid is not None:
            os.kill(self._process.pid, signal.SIGKILL)
            self._process.join()
            self._process.close()
            self._process = None

    @property
    def is_alive(self) -> bool:
        return self._process is not None and self._process.is_alive()


# ---- robots


class WorkingBody:
    """A body that can do nothing but work, which it notes with the time of this machine's one monotonic clock."""

    lost = ""

    def __init__(self, name: str, log: Path) -> None:
        self.name, self.stopped = name, False
        self._log = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)

    @property
    def model(self) -> RobotModel:
        return MODEL

    def work(self, number: float) -> None:
        os.write(self._log, f"{time.monotonic()} {self.name} {number:.0f}\n".encode())

    def sense(self) -> Reading:
        return Reading(time.monotonic(), ())

    def act(self, wanted: Setpoint) -> None: ...

    def hold(self, still: bool) -> None: ...

    def stop(self) -> None:
        self.stopped = True

    def release(self) -> None:
        self.stopped = False

    def now(self) -> float:
        return time.monotonic()

    def complaints(self) -> list[str]:
        return []

    def close(self) -> None:
        os.close(self._log)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


MODEL = RobotModel(
    "worker",
    (),
    (),
    (HostFunction("WORK", WorkingBody.work, dimensions=(None,), arguments="number"),),
    Limits(0.0, 0.0, 1.0),
    Geometry(0.1),
)


def be_robots(air: Air, names: Sequence[str]) -> None:
    """Robots of one process, each with a store of its own, from which it goes on where the last life ended."""
    processes = [_robot(air, name) for name in names]
    first = processes[0].session
    sleep = time.sleep if first is None or len(names) > 1 else first.wait
    run_robots([process.mind() for process in processes], WallClock(), tick=TICK, going=lambda: True, sleep=sleep)


def _robot(air: Air, name: str) -> NodeProcess:
    store = Store(air.log.parent / f"{name}.store", UnixClock(), lambda sentence: None)
    session = air.session(name, ROBOT, store)
    number = int(name[1:])
    process = NodeProcess(
        name, WorkingBody(name, air.log), None, session, store, number=number, seed=number, lease=1.0, typed=False
    )
    process.begin(StartScript(), StartScript(), seeks_time=False)
    return process


# ---- desks


class Desk:
    """An operator's desk in a process of its own, which does what it is told here."""

    def __init__(self, air: Air, name: str, robots: Iterable[str]) -> None:
        self._ours, theirs = multiprocessing.Pipe()
        self._party = Party(be_desk, air, name, tuple(robots), theirs)
        theirs.close()

    def ask(self, *order: object) -> Any:
        """Have it do this, and give what it answers; None if it is dead."""
        try:
            self._ours.send(order)
            return self._ours.recv()
        except (EOFError, OSError):
            return None

    def kill(self) -> None:
        self._party.kill()
        self._ours.close()

    @property
    def is_alive(self) -> bool:
        return self._party.is_alive


def be_desk(air: Air, name: str, robots: Sequence[str], orders: Connection) -> None:
    """A desk that knows these robots."""
    clock = UnixClock()
    heard = dict.fromkeys(robots, clock.now())
    station = NetworkStation(
        air.session(name, DESKS[name]), clock, vocabulary_of(MODEL), {}, heard=heard, policy=SendPolicy()
    )
    sent: list[str] = []
    while True:
        station.wait(TICK / 5.0)
        while orders.poll():
            match orders.recv():
                case ["send", str() as text, float() as deadline]:
                    sent.append(station.send(text, deadline=deadline, confirmed=True).id)
                case ["stop"]:
                    sent.append(station.stop().id)
                case ["release"]:
                    sent.append(station.release_all().id)
            orders.send(station.accounting(sent[-1]).to_dict() if sent else {})
