"""The way to other maps: a TAK server over TCP or TLS, or everybody on a network by multicast.

    tcp://HOST:PORT                                    a server, in the open
    tls://HOST:PORT?cert=FILE&key=FILE&ca=FILE         a server that asks for a certificate
    udp://239.2.3.1:6969?interface=NAME                whoever listens on this network

A link that dies is told once, tried again for ever, and told when it is back. A server that stands still looks like one
that has nothing to say: it is asked now and then whether it is there, and counts as gone when it answers no more.
Events are news: what cannot go out now is dropped, because a newer one follows. A stream begins as XML; a server that
offers protobuf gets it.
"""

from __future__ import annotations

import asyncio
import os
import re
import ssl
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol
from urllib.parse import parse_qs, urlsplit
from uuid import uuid4

from sleepcast.channel.transports.udp import UdpTransport
from sleepcast.core.backoff import Backoff
from sleepcast.core.errors import MisuseError, printable
from sleepcast.core.varint import read_varint, varint
from sleepcast.tak.event import MAX_EVENT, MESH, CotEvent, EventError, read_datagram, read_protobuf, read_xml

EXAMPLE = "tcp://tak.example.org:8087, tls://HOST:8089?cert=me.pem&ca=server.pem, or udp://239.2.3.1:6969?interface=lo"
PATIENCE = 15.0
"""Seconds for a server to take a connection; and for which it may take nothing before it counts as gone."""
ASK_EVERY = 10.0
"""Seconds of silence after which a server is asked whether it is there."""
UNANSWERED = 2
"""Such questions without an answer after which one counts as gone that has answered before: not all know them."""
SOONEST, LATEST = 0.5, 5.0
"""Seconds until a server is tried again, at first and at most: the pause doubles with each failure."""
MAX_WAITING = 256 * 1024
"""Bytes that wait to be sent at most: newer news follows."""
LISTEN = 0.05
"""Seconds between two looks for datagrams."""
PIECE = 4_096
"""Bytes that are read before anything else gets its turn: of events that are none, they have hundreds."""
END = b"</event>"
STREAM = b"\xbf"
"""The first byte of each protobuf event in a stream; its length follows."""
LONGEST_LENGTH = 4
"""Bytes that such a length may take."""
CONTROL = "t-x-"
"""How the type of an event begins that is about the connection, not about the world."""
OFFER, REQUEST, RESPONSE = "t-x-takp-v", "t-x-takp-q", "t-x-takp-r"
"""Types of the events in which a server offers protobuf, a client asks for it, and the server agrees."""
ASKED, ANSWERED = "t-x-c-t", "t-x-c-t-r"
"""Types of the events in which a client asks whether a server is there, and it says so."""
SUPPORTED = re.compile(rb"""<TakProtocolSupport\s+version=["']1["']""")
AGREED = re.compile(rb"""<TakResponse\s+status=["']true["']""")

Take = Callable[[CotEvent], None]
Say = Callable[[str], None]


class TakLink(Protocol):
    """A way to other maps."""

    def send(self, events: Iterable[CotEvent]) -> None:
        """Let others know, if that is possible now."""

    async def run(self, take: Take) -> None:
        """Hand every event that comes to `take`, until cancelled."""


def open_link(address: str, say: Say) -> TakLink:
    """The link to an address. Raises MisuseError for an address that is none, and what a socket or a certificate is
    refused for.

    say: takes a sentence when it is lost, and when it is back.
    """
    parts = urlsplit(address)
    if parts.scheme == "udp":
        return Multicast(UdpTransport(address))
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    options = parse_qs(parts.query)
    if parts.scheme not in ("tcp", "tls") or not host or not port or parts.path or parts.fragment:
        raise MisuseError(f"{address!r:.200} is no address of a TAK server: wanted {EXAMPLE}")
    if unknown := set(options) - ({"cert", "key", "ca"} if parts.scheme == "tls" else set()):
        raise MisuseError(f"{address!r:.200}: {min(unknown)} is no option of {parts.scheme}://; wanted {EXAMPLE}")
    context = _context({name: values[-1] for name, values in options.items()}) if parts.scheme == "tls" else None
    return Server(host, port, context, say)


def _context(options: dict[str, str]) -> ssl.SSLContext:
    """What is shown to a server, and what it must show. Raises MisuseError."""
    for name, file in options.items():
        if not Path(file).is_file():
            raise MisuseError(f"{name}={file}: there is no such file; wanted PEM files of certificates and keys")
    try:
        context = ssl.create_default_context(cafile=options.get("ca"))
        if "cert" in options:
            context.load_cert_chain(options["cert"], options.get("key"))
    except (ssl.SSLError, OSError) as error:
        raise MisuseError(
            f"the certificates cannot be used ({error}): wanted PEM files, as openssl writes them"
        ) from None
    return context


class Multicast:
    """Everybody on this network: protobuf goes out, as TAK does it there, and both forms are read."""

    def __init__(self, transport: UdpTransport) -> None:
        self._transport = transport

    def send(self, events: Iterable[CotEvent]) -> None:
        """See `TakLink`."""
        for event in events:
            self._transport.send(MESH + event.protobuf())

    async def run(self, take: Take) -> None:
        """See `TakLink`."""
        try:
            while True:
                for datagram in self._transport.receive():
                    with suppress(EventError):  # other programs use such addresses, too
                        take(read_datagram(datagram))
                await asyncio.sleep(LISTEN)
        finally:
            self._transport.close()


class Server:
    """A TAK server. context: for TLS, None for TCP in the open."""

    def __init__(self, host: str, port: int, context: ssl.SSLContext | None, say: Say) -> None:
        self._host, self._port, self._context, self._say = host, port, context, say
        self._writer: asyncio.StreamWriter | None = None
        self._events = EventStream()
        self._since: float | None = None
        """When it last took nothing of what waits."""
        self._gave_up, self._is_odd = "", False
        """Why we ended the connection, if we did; whether it was told that what it says is no event."""

    def send(self, events: Iterable[CotEvent]) -> None:
        """See `TakLink`."""
        if self._writer is None or self._events.asked or self._writer.is_closing():
            return
        now, waiting = asyncio.get_running_loop().time(), self._writer.transport.get_write_buffer_size()
        if not waiting:
            self._since = None
        elif self._since is None:
            self._since = now
        elif now - self._since > PATIENCE:
            self._gave_up = f"it has taken nothing for {PATIENCE:g} s"
            self._writer.transport.abort()  # a network that swallows everything says nothing of it for minutes
            return
        for event in events:
            if self._writer.transport.get_write_buffer_size() > MAX_WAITING:
                return
            self._writer.write(self._events.written(event))

    async def run(self, take: Take) -> None:
        """See `TakLink`."""
        pauses, lost = Backoff(SOONEST, LATEST), False
        while True:
            try:
                await self._connect()
                self._say(f"{self._name} is {'back' if lost else 'connected'}.")
                pauses.reset()
                lost = False
                await self._read(take)
                why = self._gave_up or "it closed the connection"
            except (OSError, TimeoutError, ssl.SSLError) as error:
                why = _reason(error)
            finally:
                self._close()
            if not lost:
                self._say(f"{self._name} is gone: {why}. Robots go on; it is tried again until it is back.")
            lost = True
            await asyncio.sleep(pauses.take())

    @property
    def _name(self) -> str:
        return f"The TAK server {self._host}:{self._port}"

    async def _connect(self) -> None:
        self._events, self._since, self._gave_up = EventStream(), None, ""
        name = self._host if self._context else None
        async with asyncio.timeout(PATIENCE):
            self._reader, self._writer = await asyncio.open_connection(
                self._host, self._port, ssl=self._context, server_hostname=name
            )

    def _close(self) -> None:
        if self._writer is not None:
            self._writer.transport.abort()
            self._writer = None

    async def _read(self, take: Take) -> None:
        """Raises TimeoutError where it has stopped answering."""
        unanswered = 0
        while True:
            try:
                async with asyncio.timeout(ASK_EVERY):
                    data = await self._reader.read(PIECE)
            except TimeoutError:
                if self._events.answers and unanswered >= UNANSWERED:
                    raise
                unanswered += 1
                now = time.time()
                self.send([CotEvent(f"sleepcast-{uuid4()}-ping", ASKED, 0.0, 0.0, now, now + PATIENCE)])
                continue
            if not data:
                return
            unanswered = 0
            for event in self._events.read(data):
                take(event)
            if self._writer is not None and self._events.reply:
                self._writer.write(self._events.reply)
                self._events.reply = b""
            if self._events.lost and not self._is_odd:
                self._is_odd = True
                self._say(f"{self._name} has sent what is no event of Cursor-on-Target; such things are left out.")
            await asyncio.sleep(0)  # however much has come, robots are told of, too


def request() -> bytes:
    """What asks a server for protobuf."""
    now = time.time()
    asking = b'<detail><TakControl><TakRequest version="1" /></TakControl></detail>'
    return CotEvent(f"protouid-{uuid4()}", REQUEST, 0.0, 0.0, now, now + 60.0).xml().replace(b"<detail />", asking)


def _reason(error: Exception) -> str:
    if isinstance(error, TimeoutError):
        return "no answer"
    if isinstance(error, ConnectionError) and error.errno:  # asyncio's own words name the address once more
        return os.strerror(error.errno)
    return printable(str(error) or type(error).__name__)


class EventStream:
    """Events in a stream of bytes: XML at first, protobuf once the server has agreed to it.

    protobuf: whether it has.
    asked: whether it is asked; nothing else may be written meanwhile.
    answers: whether it has said that it is up.
    reply: bytes that the server is to get now.
    lost: how often bytes were no event.
    """

    def __init__(self) -> None:
        self._waiting = b""
        self.protobuf = self.asked = self.answers = False
        self.reply = b""
        self.lost = 0

    def written(self, event: CotEvent) -> bytes:
        """The bytes of an event."""
        if not self.protobuf:
            return event.xml()
        data = event.protobuf()
        return STREAM + varint(len(data)) + data

    def read(self, data: bytes) -> Iterator[CotEvent]:
        """The events that are whole with these bytes; what is no event is counted and left out."""
        self._waiting += data
        while (data_of_event := self._next()) is not None:
            try:
                event = read_protobuf(data_of_event) if self.protobuf else read_xml(data_of_event)
            except EventError:
                self.lost += 1
                continue
            if event.type.startswith(CONTROL):
                self._agree(event.type, data_of_event)
            else:
                yield event
        if len(self._waiting) > MAX_EVENT:
            self.lost += 1
            self._waiting = b""

    def _agree(self, type: str, content: bytes) -> None:
        """What the server says of how it talks."""
        self.answers |= type == ANSWERED
        if type == OFFER and SUPPORTED.search(content) and not (self.asked or self.protobuf) and find_spec("takproto"):
            self.asked, self.reply = True, request()
        elif type == RESPONSE and self.asked:
            self.asked, self.protobuf = False, bool(AGREED.search(content))

    def _next(self) -> bytes | None:
        """The bytes of the next event, taken from what waits; None if it is not whole yet."""
        if self.protobuf:
            return self._next_protobuf()
        end = self._waiting.find(END)
        if end < 0:
            return None
        end += len(END)
        event, self._waiting = self._waiting[:end], self._waiting[end:]
        begin = event.find(b"<event")
        return event[max(begin, 0) :]

    def _next_protobuf(self) -> bytes | None:
        waiting, begin = self._waiting, 0
        while (begin := waiting.find(STREAM, begin)) >= 0:
            head = waiting[begin : begin + 1 + LONGEST_LENGTH]
            try:
                length, first = read_varint(head, 1)
            except IndexError:
                if len(head) <= LONGEST_LENGTH:
                    break
                length = first = MAX_EVENT + 1
            if length <= MAX_EVENT:
                end = begin + first + length
                if len(waiting) < end:
                    break
                self._waiting = waiting[end:]
                return waiting[begin + first : end]
            begin += 1  # what looked like a beginning is none
            self.lost += 1
        self._waiting = waiting[begin:] if begin >= 0 else b""
        return None
