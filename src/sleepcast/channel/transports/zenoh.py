"""A transport over Eclipse Zenoh, for fleets across routers and sites.

    zenoh://HOST:PORT/KEY                            at the router that listens there
    zenoh://HOST:PORT/KEY?listen                     being that router, in this process
    zenoh://HOST:PORT/KEY?listen&connect=HOST:PORT   likewise, and linked to the router of another site

All parties with the same KEY (default `sleepcast`) hear each other, at whichever of the linked routers they are. Every
party is a client or a router; none searches for others. While its router is away, a party loses what it sends, and it
reconnects by itself. Zenoh is used as a radio that loses little: what a link cannot take is dropped, and delivery is
ensured by the channel. Messages are signed by their senders, so a router needs no trust.
"""

from __future__ import annotations

import json
from collections import deque
from ipaddress import IPv6Address, ip_address
from threading import Lock

from sleepcast.channel.envelope import MAX_DATAGRAM, kind_of
from sleepcast.channel.message import Kind
from sleepcast.channel.transports.address import AddressError, split_address
from sleepcast.channel.transports.transport import ReceivedDatagram, WakeUp
from sleepcast.core.clock import Clock, seconds_passed
from sleepcast.core.errors import SleepcastError
from sleepcast.core.extras import installing
from sleepcast.core.records import dataclass

try:
    import zenoh
except ImportError:  # an optional dependency
    zenoh = None  # type: ignore[assignment]

KEY = "sleepcast"
MAX_WAITING = 65_536
"""Datagrams that wait to be received; beyond, the oldest are dropped."""
_MAX_AT_ONCE = 2_048
"""Datagrams received in one call, as for UDP."""
LARGEST = 65_535
"""Bytes of the largest message that a link accepts: far more than one of our datagrams."""
_BATCHES = 16
"""Batches of 64 KiB that a busy link queues: a burst of some hundred datagrams. It is the library's maximum."""
PATIENCE = 20_000
"""Microseconds to wait for a link whose queue is full before a datagram is dropped: too short to notice."""
_WANTED = "wanted zenoh://HOST:PORT/KEY, with ?listen to be the router there, for instance zenoh://127.0.0.1:7447"


class ZenohError(SleepcastError):
    """Zenoh is not installed, or there is no router."""


@dataclass(frozen=True, slots=True)
class ZenohAddress:
    """A `zenoh://` address.

    endpoint, connect: `HOST:PORT` of the router, and of one that it links to ("" for none)
    key: the key of all messages
    listen: whether we are the router
    """

    endpoint: str
    key: str
    listen: bool
    connect: str

    @staticmethod
    def read(uri: str) -> ZenohAddress:
        """The parsed address. Raises AddressError."""
        address, options = split_address(uri, _WANTED, {"listen": "no", "connect": ""})
        if address.scheme != "zenoh" or not address.hostname or not address.port:
            raise AddressError(f"{uri!r} is not a channel address: {_WANTED}")
        key = address.path.strip("/") or KEY
        if any(character in "*$#?" for character in key) or "//" in key:
            raise AddressError(f"{uri!r}: a key is one or more words with / between them, without *, $, # and ?")
        listen, connect = options["listen"], options["connect"]
        if listen not in ("no", ""):
            raise AddressError(f"{uri!r}: listen takes no value; {_WANTED}")
        if connect:
            if listen == "no":
                raise AddressError(
                    f"{uri!r}: connect links our own router to another one, so it needs listen as well; {_WANTED}"
                )
            connect = ZenohAddress.read(f"zenoh://{connect}").endpoint
        return ZenohAddress(f"{_host(uri, address.hostname)}:{address.port}", key, not listen, connect)


def _host(uri: str, name: str) -> str:
    """A host in zenoh's form. Raises AddressError if it is none."""
    try:
        address = ip_address(name)
    except ValueError:
        if not all(character.isalnum() or character in "-._" for character in name):
            raise AddressError(f"{uri!r}: {name!r} is not a host; {_WANTED}") from None
        return name
    return f"[{address}]" if isinstance(address, IPv6Address) else str(address)


class ZenohTransport:
    """One party at a router. Raises AddressError for the address, ZenohError without zenoh or without a router.

    lost: datagrams that the link would not take, as far as it says so.
    """

    def __init__(self, uri: str) -> None:
        site = ZenohAddress.read(uri)
        if zenoh is None:
            raise ZenohError(f"{uri}: zenoh is not installed here; to install it: {installing('zenoh')}")
        self.lost = 0
        self._wakeup = WakeUp()
        self._taking = Lock()  # otherwise it may be set for datagrams that were received already
        self._heard: deque[bytes] = deque(maxlen=MAX_WAITING)
        self._stops = False
        """Whether a STOP may be among them."""
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
        # indirect=True would start a Python thread that keeps the process from ending.
        subscriber = zenoh.handlers.Callback(self._hear, indirect=False)
        self._session.declare_subscriber(site.key, subscriber, allowed_origin=remote)

    def fileno(self) -> int:
        """See `Transport.fileno`."""
        return self._wakeup.fileno()

    def send(self, datagram: bytes) -> None:
        """Broadcast."""
        try:
            self._publisher.put(datagram)
        except zenoh.ZError:  # no link: as if lost on the way
            self.lost += 1

    def receive(self) -> list[bytes]:
        """See `Transport.receive`."""
        with self._taking:
            self._wakeup.clear()
            datagrams = [self._heard.popleft() for _ in range(min(len(self._heard), _MAX_AT_ONCE))]
            if self._heard:
                self._wakeup.set()
        return datagrams

    def receive_stops(self) -> list[bytes]:
        """See `Transport.receive_stops`."""
        with self._taking:
            stops = [datagram for datagram in self._heard if kind_of(datagram) is Kind.STOP] if self._stops else []
            if stops:
                others = [datagram for datagram in self._heard if kind_of(datagram) is not Kind.STOP]
                self._heard.clear()
                self._heard.extend(others)
            self._stops = False
        return stops

    def close(self) -> None:
        """See `Transport.close`."""
        self._session.close()  # type: ignore[no-untyped-call]
        self._wakeup.close()

    def _hear(self, sample: zenoh.Sample) -> None:
        """Called in a thread of zenoh."""
        payload = sample.payload
        if len(payload) <= MAX_DATAGRAM:
            data = ReceivedDatagram(payload.to_bytes())
            data.arrived = seconds_passed()
            with self._taking:
                self._heard.append(data)
                self._stops |= kind_of(data) is Kind.STOP
                self._wakeup.set()


def _config(site: ZenohAddress) -> zenoh.Config:
    config = zenoh.Config()
    for name, value in {
        "mode": "router" if site.listen else "client",
        "listen/endpoints": [f"tcp/{site.endpoint}"] if site.listen else [],
        "connect/endpoints": [f"tcp/{each}" for each in ((site.connect,) if site.listen else (site.endpoint,)) if each],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/rx/max_message_size": LARGEST,
        "transport/link/tx/queue/size/real_time": _BATCHES,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": PATIENCE,
    }.items():
        config.insert_json5(name, json.dumps(value))
    return config


def _refusal(uri: str, site: ZenohAddress, error: str) -> str:
    """Why there is no connection, and what to do about it."""
    if "Address already in use" in error:
        return f"{uri}: another program listens at {site.endpoint}: leave out ?listen to join it, or take another port"
    if not site.listen:
        return f"{uri}: no router answers at {site.endpoint}: start one there, or be one with ?listen"
    return f"{uri}: zenoh cannot listen at {site.endpoint}: {error.partition(' at /')[0]}"


def open_zenoh(uri: str, clock: Clock) -> ZenohTransport:
    """The entry point of `zenoh:`, which has no use for a clock."""
    return ZenohTransport(uri)
