"""Robots with a soil probe: `sc.open("bravo", robots="prober")`, and what else a package can add to sleepcast.

prober, probers     robots with a probe: an object for each, and the same with arrays for all
folder:/tmp/lab     a transport over Unix sockets: all parties of one computer that use the same folder
probed              a measure: the share of robots that have taken a sample
"""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from math import sin
from pathlib import Path

import numpy as np

import sleepcast as sc
from sleepcast.channel.transports.address import AddressError
from sleepcast.core.clock import Clock
from sleepcast.node.linking import actuator, command, function, sensor


class Prober:
    """A robot that lowers a probe into the soil, and takes samples when it is deep enough."""

    def __init__(self, body: sc.SimulatedBody) -> None:
        self.body = body
        self.lowering, self.depth_cm, self.taken = 0.0, 0.0, 0

    def step(self) -> None:
        """Called after each tick."""
        self.depth_cm = min(max(self.depth_cm + 100.0 * self.lowering * self.body.tick, 0.0), 30.0)

    @property
    @actuator(unit="m/s", low=-0.05, high=0.05)
    def probe_speed(self) -> float:
        """How fast the probe is lowered."""
        return self.lowering

    @probe_speed.setter
    def probe_speed(self, value: float) -> None:
        self.lowering = value

    @property
    @sensor(unit="cm", low=0, high=30)
    def depth(self) -> float:
        """How deep the probe is."""
        return self.depth_cm

    @property
    @sensor(unit="%", low=0, high=100)
    def moisture(self) -> float | None:
        """Of the soil; unknown while the probe is in the air."""
        if self.depth_cm < 1.0:
            return None
        return 50.0 + 40.0 * sin(self.body.x / 100.0) + 5.0 * (self.body.random("moisture") - 0.5)

    @property
    @sensor()
    def samples(self) -> float:
        """How many samples it has taken."""
        return self.taken

    @command
    def sample(self) -> None:
        """Takes a sample, if the probe is at least 10 cm deep."""
        if self.depth_cm < 10.0:
            raise ValueError(f"the probe is {self.depth_cm:.0f} cm deep: lower it to 10 cm")
        self.taken += 1

    @function(units=("cm",), result="s")
    def time_to_depth(self, depth: float) -> float | None:
        """How long the probe needs to this depth."""
        return (depth - self.depth_cm) / (100.0 * self.lowering) if self.lowering else float("nan")


class Probers:
    """The same robots, all at once: a thousand take as long as one."""

    vectorised = True

    def __init__(self, body: sc.SimulatedBody) -> None:
        self.body = body
        count = len(body.numbers)
        self.probe_speed_now, self.depth_cm, self.taken = np.zeros(count), np.zeros(count), np.zeros(count)

    def step(self) -> None:
        """Called after each tick."""
        self.depth_cm = np.clip(self.depth_cm + 100.0 * self.probe_speed_now * self.body.tick, 0.0, 30.0)

    @property
    @actuator(unit="m/s", low=-0.05, high=0.05)
    def probe_speed(self) -> np.ndarray:
        """How fast the probe is lowered."""
        return self.probe_speed_now

    @probe_speed.setter
    def probe_speed(self, values: np.ndarray) -> None:
        self.probe_speed_now = values

    @property
    @sensor(unit="cm", low=0, high=30)
    def depth(self) -> np.ndarray:
        """How deep the probe is."""
        return self.depth_cm

    @property
    @sensor(unit="%", low=0, high=100)
    def moisture(self) -> np.ndarray:
        """Of the soil; unknown while the probe is in the air."""
        found = 50.0 + 40.0 * np.sin(self.body.x / 100.0) + 5.0 * (self.body.random("moisture") - 0.5)
        return np.where(self.depth_cm < 1.0, np.nan, found)

    @property
    @sensor()
    def samples(self) -> np.ndarray:
        """How many samples it has taken."""
        return self.taken

    @command
    def sample(self, robots: np.ndarray) -> None:
        """Takes a sample, if the probe is at least 10 cm deep."""
        self.taken[robots] += self.depth_cm[robots] >= 10.0

    @function(units=("cm",), result="s")
    def time_to_depth(self, robots: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """How long the probe needs to this depth."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (depth - self.depth_cm[robots]) / (100.0 * self.probe_speed_now[robots])


def probed(fleet: sc.Fleet) -> float:
    """The share of robots that have taken a sample."""
    return float((fleet["samples"] > 0).mean())


class FolderTransport:
    """All parties that use the same folder hear each other: `folder:/tmp/lab`."""

    def __init__(self, uri: str, clock: Clock) -> None:
        self._folder = Path(uri.partition(":")[2])
        if not self._folder.is_dir():
            raise AddressError(f"{uri!r} is not a channel address: wanted folder:PATH of a folder that exists")
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._own = self._folder / f"{os.getpid()}-{self._socket.fileno()}"
        self._own.unlink(missing_ok=True)
        self._socket.bind(str(self._own))

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, datagram: bytes) -> None:
        for party in self._folder.iterdir():
            if party != self._own:
                with suppress(OSError):  # it has left, or has not read enough: a radio loses datagrams, too
                    self._socket.sendto(datagram, str(party))

    def receive(self) -> list[bytes]:
        found = []
        with suppress(BlockingIOError):
            while True:
                found.append(self._socket.recv(65_536))
        return found

    def close(self) -> None:
        self._socket.close()
        self._own.unlink(missing_ok=True)
