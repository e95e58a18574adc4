"""A channel over Eclipse Zenoh, for fleets across routers and sites.

    zenoh://HOST:PORT/KEY                            at the router that listens there
    zenoh://HOST:PORT/KEY?listen                     being that router, in this process
    zenoh://HOST:PORT/KEY?listen&connect=HOST:PORT   likewise, and linked to the router of another site

All who name the same KEY (`sleepcast` if none is named) hear each other, whichever of the linked routers they are at.
Every party is a client, or a router: neither looks for anybody by itself. Where the router goes away, a party loses
what it says and finds the router again by itself. It is used as a radio that loses little: what a link cannot take is
dropped, and all that the channel promises comes from the channel. What is said is signed by whoever
says it, so a router has to be believed no more than the air.
"""

from __future__ import annotations

import json
from collections import deque
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from threading import Lock

from sleepcast.channel.envelope import MAX_DATAGRAM
from sleepcast.channel.transports.address import AddressError, split_address
from sleepcast.channel.transports.transport import WakeUp
from sleepcast.core.errors import SleepcastError

try:
    import zenoh
except ImportError:  # it is an extra
    zenoh = None  # type: ignore[assignment]

KEY = "sleepcast"
MAX_WAITING = 65_536
"""Datagrams that wait for us to take them; what comes then pushes out the oldest, as in a socket's buffer."""
MOST_AT_ONCE = 2_048
"""Datagrams taken by one call, as for UDP."""
LARGEST = 65_535
"""Bytes of what a link takes in at all: far more than a datagram of ours."""
BATCHES = 16
"""Of 64 KiB each, that a link keeps while it is busy: a burst of some hundred datagrams. It is the library's most."""
PATIENCE = 20_000
"""Microseconds that a link which is that busy is waited for before a datagram is dropped: less than anybody notices."""
WANTED = "wanted zenoh://HOST:PORT/KEY, with ?listen to be the router there, for instance zenoh://127.0.0.1:7447"


class ZenohError(SleepcastError):
    """No zenoh here, or no router there."""


@dataclass(frozen=True, slots=True)
class ZenohAddress:
    """What a `zenoh://` address says. place, connect: `HOST:PORT` of the router, and of one that it links to ("" for
    none); key: what is said and heard under; listen: whether we are the router."""

    place: str
    key: str
    listen: bool
    connect: str

    @staticmethod
    def read(uri: str) -> ZenohAddress:
        """Raises AddressError, with a sentence that says what is wrong."""
        found, options = split_address(uri, WANTED, {"listen": "no", "connect": ""})
        if found.scheme != "zenoh" or not found.hostname or not found.port:
            raise AddressError(f"{uri!r} is no address of a channel: {WANTED}")
        key = found.path.strip("/") or KEY
        if any(character in "*$#?" for character in key) or "//" in key:
            raise AddressError(f"{uri!r}: a key is one or more words with / between them, without *, $, # and ?")
        listen, connect = options["listen"], options["connect"]
        if listen not in ("no", ""):
            raise AddressError(f"{uri!r}: listen has no value, it is there or not; {WANTED}")
        if connect:
            if listen == "no":
                raise AddressError(f"{uri!r}: connect links a router that we are, so it needs listen as well; {WANTED}")
            connect = ZenohAddress.read(f"zenoh://{connect}").place
        return ZenohAddress(f"{_host(uri, found.hostname)}:{found.port}", key, not listen, connect)


def _host(uri: str, name: str) -> str:
    """A host as a place of zenoh has it. Raises AddressError for what is no host."""
    try:
        address = ip_address(name)
    except ValueError:
        if not all(character.isalnum() or character in "-._" for character in name):
            raise AddressError(f"{uri!r}: {name!r} is no host; {WANTED}") from None
        return name
    return f"[{address}]" if isinstance(address, IPv6Address) else str(address)


class ZenohTransport:
    """One party at a router. Raises AddressError for the address, ZenohError where there is no zenoh or no router.

    lost: datagrams that the link would not take, as far as it says so.
    """

    def __init__(self, uri: str) -> None:
        site = ZenohAddress.read(uri)
        if zenoh is None:
            raise ZenohError(f"{uri}: zenoh is not installed here: pip install 'sleepcast[zenoh]'")
        self.lost = 0
        self._wakeup, self._taking = WakeUp(), Lock()  # else the bell may ring for what has been taken already
        self._heard: deque[bytes] = deque(maxlen=MAX_WAITING)
        try:
            self._session = zenoh.open(_config(site))
        except zenoh.ZError as error:
            self._wakeup.close()
            raise ZenohError(_refusal(uri, site, str(error))) from None
        remote = zenoh.Locality.REMOTE
        self._publisher = self._session.declare_publisher(
            site.key,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
            allowed_destination=remote,
        )
        # Not indirectly: that takes a thread of Python's, which keeps a process from ending.
        subscriber = zenoh.handlers.Callback(self._hear, indirect=False)
        self._session.declare_subscriber(site.key, subscriber, allowed_origin=remote)

    def fileno(self) -> int:
        """What to wait on for news."""
        return self._wakeup.fileno()

    def send(self, datagram: bytes) -> None:
        """Broadcast."""
        try:
            self._publisher.put(datagram)
        except zenoh.ZError:  # no link now: as good as lost on the way
            self.lost += 1

    def receive(self) -> list[bytes]:
        """What has come in since the last call, in the order in which it came; nothing of our own."""
        with self._taking:
            self._wakeup.clear()
            found = [self._heard.popleft() for _ in range(min(len(self._heard), MOST_AT_ONCE))]
            if self._heard:
                self._wakeup.set()
        return found

    def close(self) -> None:
        """Leave. Nothing can be sent or heard afterwards."""
        self._session.close()  # type: ignore[no-untyped-call]
        self._wakeup.close()

    def _hear(self, sample: zenoh.Sample) -> None:
        """In a thread of zenoh's."""
        payload = sample.payload
        if len(payload) <= MAX_DATAGRAM:
            data = payload.to_bytes()
            with self._taking:
                self._heard.append(data)
                self._wakeup.set()


def _config(site: ZenohAddress) -> zenoh.Config:
    config = zenoh.Config()
    for name, value in {
        "mode": "router" if site.listen else "client",
        "listen/endpoints": [f"tcp/{site.place}"] if site.listen else [],
        "connect/endpoints": [f"tcp/{place}" for place in ((site.connect,) if site.listen else (site.place,)) if place],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/rx/max_message_size": LARGEST,
        "transport/link/tx/queue/size/real_time": BATCHES,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": PATIENCE,
    }.items():
        config.insert_json5(name, json.dumps(value))
    return config


def _refusal(uri: str, site: ZenohAddress, error: str) -> str:
    """Why there is no session, and what a person may do about it."""
    if "Address already in use" in error:
        return f"{uri}: another program listens at {site.place}: leave out ?listen to join it, or take another port"
    if not site.listen:
        return f"{uri}: no router answers at {site.place}: start one there, or be one with ?listen"
    return f"{uri}: zenoh cannot listen at {site.place}: {error.partition(' at /')[0]}"
