"""Links: a server that offers protobuf gets it, TLS shows and asks for certificates, a lost server is found again."""

from __future__ import annotations

import asyncio
import signal
import ssl
import subprocess
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from socket import SOCK_STREAM

import pytest
import takproto

from channel.test_udp import free_port
from processes import tak_server
from sleepcast.core.doorkeeper import stop_listening
from sleepcast.core.errors import MisuseError
from sleepcast.tak import link as links
from sleepcast.tak.event import MESH, CotEvent, read_xml
from sleepcast.tak.link import END, UNANSWERED, EventStream, Server, TakLink, open_link

PATIENCE = 60.0
"""Seconds that a busy machine may take."""
NOW = time.time()
ROBOT = CotEvent("fleet.r1", "a-f-G-E-V-U", 36.6, -121.9, NOW, NOW + 9.0, "r1")
MARKER = CotEvent("m1", "b-m-p-s-m", 36.7, -121.8, NOW, NOW + 9.0, "Depot 1")
POINT = '<point lat="0.0" lon="0.0" hae="0.0" ce="999999" le="999999"/>'
CONTROL = '<event version="2.0" uid="s" type="{}">{}<detail><TakControl>{}</TakControl></detail></event>'
OFFER = CONTROL.format("t-x-takp-v", POINT, '<TakProtocolSupport version="1"/>')
AGREED = CONTROL.format("t-x-takp-r", POINT, '<TakResponse status="true"/>')

Serve = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


async def until(done: Callable[[], bool]) -> None:
    """Wait until that is so."""
    ends = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < ends, "it did not come"
        await asyncio.sleep(0.01)


@asynccontextmanager
async def served(serve: Serve, context: ssl.SSLContext | None = None, port: int = 0) -> AsyncIterator[int]:
    """A server with this behaviour on the port that is given; all its connections end with it."""
    handlers: list[asyncio.Task[None] | None] = []

    async def handle(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        handlers.append(asyncio.current_task())
        try:
            await serve(reader, writer)
        finally:
            writer.transport.abort()
            with suppress(OSError):
                await writer.wait_closed()

    server = await asyncio.start_server(handle, "127.0.0.1", port, ssl=context)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        await stop_listening([server])
        for handler in filter(None, handlers):
            handler.cancel()
        await asyncio.gather(*filter(None, handlers), return_exceptions=True)


async def linked(link: TakLink, taken: list[CotEvent], job: Awaitable[None]) -> None:
    """Do the job while the link runs and sends a robot's event time and again."""

    async def send() -> None:
        while True:
            link.send([ROBOT])
            await asyncio.sleep(0.02)

    others = [asyncio.ensure_future(link.run(taken.append)), asyncio.ensure_future(send())]
    try:
        await job
        assert not any(other.done() for other in others)
    finally:
        for other in others:
            other.cancel()
        await asyncio.gather(*others, return_exceptions=True)


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """server.pem and me.pem with their keys; each is its own authority."""
    folder = tmp_path_factory.mktemp("certificates")
    for name in ("server", "me"):
        subprocess.run(
            [
                *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"),
                *("-days", "2", "-subj", f"/CN={name}", "-addext", "subjectAltName=IP:127.0.0.1"),
                *("-keyout", folder / f"{name}.key", "-out", folder / f"{name}.pem"),
            ],
            check=True,
            capture_output=True,
        )
    return folder


def server_context(certificates: Path) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificates / "server.pem", certificates / "server.key")
    context.load_verify_locations(certificates / "me.pem")
    context.verify_mode = ssl.CERT_REQUIRED
    return context


@pytest.mark.parametrize("secret", [False, True], ids=["tcp", "tls"])
def test_a_server_that_offers_protobuf_gets_it(certificates: Path, secret: bool) -> None:
    seen: list[object] = []
    taken: list[CotEvent] = []
    said: list[str] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(MARKER.xml() + OFFER.encode())
        while (found := read_xml(await reader.readuntil(END))).type != "t-x-takp-q":
            seen.append(found.uid)
        writer.write(AGREED.encode())
        server_side = EventStream()
        server_side.protobuf = True
        writer.write(server_side.written(MARKER))
        while data := await reader.read(4_096):
            assert data[:1] == b"\xbf"  # nothing in XML comes after that
            seen.append(takproto.parse_proto(bytearray(data)).cotEvent.detail.contact.callsign)

    async def job() -> None:
        async with served(serve, server_context(certificates) if secret else None) as port:
            host = f"127.0.0.1:{port}"
            files = {"cert": "me.pem", "key": "me.key", "ca": "server.pem"}
            options = "&".join(f"{name}={certificates / file}" for name, file in files.items())
            link = open_link(f"tls://{host}?{options}" if secret else f"tcp://{host}", said.append)
            await linked(link, taken, until(lambda: seen.count("r1") > 1 and len(taken) == 2))

    asyncio.run(job())
    assert [event.callsign for event in taken] == ["Depot 1", "Depot 1"]
    assert said[0].endswith("is connected.")


def test_a_server_with_a_certificate_of_nobody_we_trust_gets_nothing(certificates: Path) -> None:
    said: list[str] = []
    seen: list[bytes] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        seen.append(await reader.read(1))

    async def job() -> None:
        async with served(serve, server_context(certificates)) as port:
            await linked(open_link(f"tls://127.0.0.1:{port}", said.append), [], until(lambda: bool(said)))

    asyncio.run(job())
    assert not seen
    assert "is gone: " in said[0]
    assert "certificate" in said[0].casefold()


def test_a_lost_server_is_told_once_and_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "SOONEST", 0.05)
    monkeypatch.setattr(links, "LATEST", 0.05)
    said: list[str] = []
    port = free_port(SOCK_STREAM)
    seen: list[bytes] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        seen.append(await reader.readuntil(END))
        writer.write_eof()
        await reader.read()  # one who leaves with something unread breaks the connection

    async def job() -> None:
        async def server_comes() -> None:
            await until(lambda: len(said) == 1)
            await asyncio.sleep(0.3)  # several tries, of which nothing is said
            assert len(said) == 1
            async with served(serve, port=port):
                await until(lambda: len(said) >= 3 and len(seen) > 1)

        await linked(open_link(f"tcp://127.0.0.1:{port}", said.append), [], server_comes())

    asyncio.run(job())
    name = f"The TAK server 127.0.0.1:{port}"
    assert said[0].startswith(f"{name} is gone: ")
    assert said[0].endswith("Robots go on; it is tried again until it is back.")
    assert said[1] == f"{name} is back."
    assert said[2].startswith(f"{name} is gone: it closed the connection.")
    assert read_xml(seen[0]).uid == "fleet.r1"


@pytest.mark.counterpart("taky")
def test_a_server_that_freezes_is_told_and_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A real one. Its computer goes on to take what is sent, so that nothing but its silence tells."""
    monkeypatch.setattr(links, "ASK_EVERY", 0.1)
    monkeypatch.setattr(links, "SOONEST", 0.05)
    monkeypatch.setattr(links, "LATEST", 0.05)
    port, said = free_port(SOCK_STREAM), list[str]()
    link = open_link(f"tcp://127.0.0.1:{port}", said.append)
    assert isinstance(link, Server)

    async def freezes() -> None:
        with tak_server(tmp_path, port) as server:
            await until(lambda: bool(said) and not said[-1].endswith("until it is back.") and link._events.answers)
            server.send_signal(signal.SIGSTOP)
            frozen = len(said)
            await until(lambda: "is gone: no answer." in "".join(said[frozen:]))
            server.send_signal(signal.SIGCONT)
            await until(lambda: said[-1].endswith("is back."))

    asyncio.run(linked(link, [], freezes()))


def test_a_server_that_does_not_know_the_question_is_not_called_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "ASK_EVERY", 0.02)
    asked, said = list[bytes](), list[str]()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            asked.append(await reader.readuntil(END))

    async def job() -> None:
        async with served(serve) as port:
            link = open_link(f"tcp://127.0.0.1:{port}", said.append)
            await linked(link, [], until(lambda: sum(b'"t-x-c-t"' in each for each in asked) > 2 * UNANSWERED))

    asyncio.run(job())
    assert len(said) == 1, "that it is connected"


@pytest.mark.parametrize("noise", [b"</event>", MARKER.xml()])
def test_a_server_that_floods_us_with_whatever_gets_our_events_all_the_same(noise: bytes) -> None:
    said, taken, seen = list[str](), list[CotEvent](), list[bytes]()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async def flood() -> None:
            while True:
                writer.write(noise * 20)
                await writer.drain()

        flooding = asyncio.ensure_future(flood())
        try:
            while True:
                seen.append(await reader.readuntil(END))
        finally:
            flooding.cancel()

    async def job() -> None:
        async with served(serve) as port:
            link = open_link(f"tcp://127.0.0.1:{port}", said.append)
            is_event = noise == MARKER.xml()
            await linked(link, taken, until(lambda: len(seen) > 5 and bool(taken if is_event else said[1:])))

    asyncio.run(job())
    assert {read_xml(each).uid for each in seen} == {"fleet.r1"}
    odd = [each for each in said if "has sent what is no event of Cursor-on-Target; such things are left out" in each]
    assert len(odd) == (0 if taken else 1), "once"


def test_multicast_reaches_others_in_protobuf_and_reads_both_forms() -> None:
    address = f"udp://239.2.3.1:{free_port()}?interface=lo"
    taken: list[CotEvent] = []
    theirs: list[CotEvent] = []

    async def job() -> None:
        ours, other = open_link(address, print), open_link(address, print)

        async def talk() -> None:
            listening = asyncio.ensure_future(other.run(theirs.append))
            other._transport.send(b"\x00 no event")  # type: ignore[attr-defined]
            other._transport.send(MARKER.xml())  # type: ignore[attr-defined]
            other._transport.send(MESH + MARKER.protobuf())  # type: ignore[attr-defined]
            await until(lambda: len(taken) == 2 and bool(theirs))
            listening.cancel()
            await asyncio.wait({listening})

        await linked(ours, taken, talk())

    asyncio.run(job())
    assert {event.uid for event in taken} == {"m1"}
    assert theirs[0].callsign == "r1"


@pytest.mark.parametrize(
    ("address", "complaint"),
    [
        ("", "no address of a TAK server"),
        ("127.0.0.1:8087", "no address of a TAK server"),
        ("tcp://host", "no address of a TAK server"),
        ("tcp://host:99999", "no address of a TAK server"),
        ("tcp://host:8087/path", "no address of a TAK server"),
        ("http://host:8087", "no address of a TAK server"),
        ("tcp://host:8087?cert=a.pem", "cert is no option of tcp://"),
        ("tls://host:8089?cert=/no/such.pem", "there is no such file"),
        ("udp://host:8089", "not a channel address"),
    ],
)
def test_an_address_that_means_nothing_is_refused(address: str, complaint: str) -> None:
    with pytest.raises(MisuseError, match=complaint):
        open_link(address, print)


def test_a_file_that_is_no_certificate_is_refused(tmp_path: Path) -> None:
    (tmp_path / "me.pem").write_text("no certificate")
    with pytest.raises(MisuseError, match="the certificates cannot be used"):
        open_link(f"tls://host:8089?cert={tmp_path / 'me.pem'}", print)


def test_what_goes_to_a_connection_that_is_gone_is_not_written() -> None:
    """Each of these writes is a warning of asyncio's at the terminal until somebody reads that it is gone."""

    async def scene() -> None:
        written: list[bytes] = []

        class Gone:
            transport = None

            def is_closing(self) -> bool:
                return True

            def write(self, data: bytes) -> None:
                written.append(data)

        server = Server("127.0.0.1", 1, None, lambda _: None)
        server._writer = Gone()  # type: ignore[assignment]  # as much of one as is looked at
        server.send([ROBOT] * 100)
        assert not written

    asyncio.run(scene())
