"""A transport within one process, without a network, that can be as unreliable as any radio.

    memory:NAME?loss=0.3&delay=0.01&jitter=0.02&duplicate=0.1&reorder=0.1&seed=1&at=3,4&range=10

All parties with the same NAME hear each other. The options say how badly a party receives: the share of datagrams
that it loses, gets twice or gets late (by `LATE`), the seconds that each takes (`delay`), and the largest random
addition (`jitter`). `at` is its place (x, y in m), and `range` the distance from which it receives. What happens to
datagrams depends only on a party's seed, on how many have joined before it, and on what it was sent.
"""

from __future__ import annotations

import threading
from heapq import heapify, heappop, heappush
from math import dist, inf, isfinite
from random import Random
from typing import ClassVar

from sleepcast.channel.envelope import MAX_DATAGRAM, kind_of
from sleepcast.channel.message import Kind
from sleepcast.channel.transports.address import AddressError, number_option, split_address
from sleepcast.channel.transports.transport import WakeUp
from sleepcast.core.clock import Clock
from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import dataclass

LATE = 0.05
"""Seconds by which a reordered datagram is late, so that others overtake it."""
_LONGEST = 3_600.0
"""Seconds of the longest delay."""
MAX_WAITING = 16_384
"""Datagrams that wait for one party; further ones are lost, as in a socket's buffer."""
MAX_PARTIES = 4_096
"""Parties of one medium: each takes two file descriptors of this process."""
_OPTIONS = {
    "loss": "0",
    "delay": "0",
    "jitter": "0",
    "duplicate": "0",
    "reorder": "0",
    "seed": "0",
    "at": "0,0",
    "range": "inf",
}
_WANTED = f"wanted memory:NAME with options of {', '.join(_OPTIONS)}, for instance memory:lab?loss=0.3&seed=1"


class MediumError(SleepcastError):
    """A medium has no room for another party."""


@dataclass(frozen=True, slots=True)
class MemoryAddress:
    """A `memory:` address.

    loss, duplicate, reorder: probabilities, 0..1
    delay, jitter: s
    at, reach: m
    """

    name: str
    loss: float
    delay: float
    jitter: float
    duplicate: float
    reorder: float
    seed: int
    at: tuple[float, float]
    reach: float

    @staticmethod
    def read(uri: str) -> MemoryAddress:
        """The parsed address. Raises AddressError."""
        address, options = split_address(uri, _WANTED, _OPTIONS)
        if address.scheme != "memory" or address.netloc or not address.path.strip("/"):
            raise AddressError(f"{uri!r} is not a channel address: {_WANTED}")
        chances = [number_option(uri, name, options[name], 1.0) for name in ("loss", "duplicate", "reorder")]
        delay, jitter = (number_option(uri, name, options[name], _LONGEST) for name in ("delay", "jitter"))
        loss, duplicate, reorder = chances
        seed, reach = options["seed"], number_option(uri, "range", options["range"])
        if not (seed.isascii() and seed.isdigit() and len(seed) <= 19):
            raise AddressError(f"{uri!r}: seed must be a whole number from 0, not {seed!r}")
        return MemoryAddress(
            address.path, loss, delay, jitter, duplicate, reorder, int(seed), _place(uri, options["at"]), reach
        )


def _place(uri: str, written: str) -> tuple[float, float]:
    try:
        x, y = map(float, written.split(","))
    except ValueError:
        x = y = inf
    if not (isfinite(x) and isfinite(y)):
        raise AddressError(f"{uri!r}: at must be a place, two numbers in metres such as 3,4, not {written!r}")
    return x, y


class MemoryTransport:
    """One party of the medium at `uri`.

    clock: s, for its delays
    lost: datagrams for which it had no room
    at: where it is (m); it may move

    Raises AddressError for the address, MediumError where too many have joined.
    """

    _media: ClassVar[dict[str, list[MemoryTransport]]] = {}
    _joined: ClassVar[dict[str, int]] = {}
    """Parties that have joined each medium since it was empty."""
    _lock: ClassVar[threading.Lock] = threading.Lock()

    def __init__(self, uri: str, clock: Clock) -> None:
        self._address = MemoryAddress.read(uri)
        self.at, self.lost = self._address.at, 0
        self._clock = clock
        self._wakeup = WakeUp()
        self._waiting: list[tuple[float, int, bytes]] = []
        self._heard = 0
        self._watched = False
        self._timer: threading.Timer | None = None
        self._rings = inf
        """When the timer fires, s."""
        name = self._address.name
        with MemoryTransport._lock:
            parties = MemoryTransport._media.setdefault(name, [])
            if len(parties) >= MAX_PARTIES:
                self._wakeup.close()
                raise MediumError(f"{uri}: at most {MAX_PARTIES} parties of one process can share a medium: use udp://")
            number = MemoryTransport._joined.get(name, 0)
            MemoryTransport._joined[name] = number + 1
            parties.append(self)
        self._chance = Random(f"{self._address.seed} {number}")

    def fileno(self) -> int:
        """See `Transport.fileno`."""
        self._watched = True
        return self._wakeup.fileno()

    def send(self, datagram: bytes) -> None:
        """Send to all others that are in range."""
        with MemoryTransport._lock:
            parties = MemoryTransport._media.get(self._address.name, ())
            if self in parties:
                for party in parties:
                    if party is not self and dist(party.at, self.at) <= party._address.reach:
                        party._take(datagram)

    def receive(self) -> list[bytes]:
        """See `Transport.receive`."""
        datagrams = []
        with MemoryTransport._lock:
            self._wakeup.clear()  # here, or it may be set for datagrams that are received now
            now = self._clock.now()
            while self._waiting and self._waiting[0][0] <= now:
                datagrams.append(heappop(self._waiting)[2])
            self._wake_up(now)
        return datagrams

    def receive_stops(self) -> list[bytes]:
        """See `Transport.receive_stops`."""
        with MemoryTransport._lock:
            now = self._clock.now()
            stops = sorted(each for each in self._waiting if each[0] <= now and kind_of(each[2]) is Kind.STOP)
            if stops:
                self._waiting = [each for each in self._waiting if each not in stops]
                heapify(self._waiting)
        return [datagram for _, _, datagram in stops]

    def close(self) -> None:
        """See `Transport.close`."""
        with MemoryTransport._lock:
            parties = MemoryTransport._media.get(self._address.name, [])
            if self in parties:
                parties.remove(self)
            if not parties:
                MemoryTransport._media.pop(self._address.name, None)
                MemoryTransport._joined.pop(self._address.name, None)
            self._waiting.clear()
            self._wake_up(0.0)
            self._wakeup.close()

    def _take(self, datagram: bytes) -> None:
        """Receive, lose, delay or duplicate a datagram that is sent to us."""
        address, now = self._address, self._clock.now()
        for _ in range(1 + (self._chance.random() < address.duplicate)):
            due = now + address.delay + address.jitter * self._chance.random()
            due += LATE * (self._chance.random() < address.reorder)
            if self._chance.random() < address.loss:
                continue
            if len(self._waiting) >= MAX_WAITING:
                self.lost += 1
                continue
            self._heard += 1
            heappush(self._waiting, (due, self._heard, datagram[: MAX_DATAGRAM + 1]))
        self._wake_up(now)

    def _wake_up(self, now: float) -> None:
        """Become readable when the next datagram is due: a caller that waits on `fileno` does not know when that is."""
        due = self._waiting[0][0] if self._waiting else inf
        if self._timer is not None and due != self._rings:
            self._timer.cancel()
            self._timer = None
        if due <= now:
            self._wakeup.set()
        elif self._timer is None and self._watched and due < inf:
            self._rings = due
            self._timer = threading.Timer(due - now, self._wake_at, (due,))
            self._timer.daemon = True
            self._timer.start()

    def _wake_at(self, due: float) -> None:
        """Become readable, unless the datagram that was due has been received meanwhile."""
        with MemoryTransport._lock:
            self._timer = None  # by the clock it may be early: then there is another one, once that was seen
            if self._waiting and self._waiting[0][0] <= due:
                self._wakeup.set()
