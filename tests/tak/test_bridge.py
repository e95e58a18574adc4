"""The command `bridge tak` between robots on the air and a real TAK server, with another client of that server."""

from __future__ import annotations

import asyncio
import configparser
import json
import subprocess
import time
import warnings
from contextlib import AbstractContextManager
from pathlib import Path
from socket import SOCK_STREAM
from types import SimpleNamespace
from typing import cast

import pytest

from channel.test_udp import free_port
from cli.calling import called
from cli.test_swarm import account
from processes import SLEEPCAST, live_in, running, tak_server
from sleepcast.core.errors import MisuseError
from sleepcast.core.geodesy import LocalMap, Origin
from sleepcast.station.network import NetworkStation
from sleepcast.station.remote import TelemetryClient
from sleepcast.tak.bridge import AT_ONCE, TakBridge
from sleepcast.tak.event import MESH, CotEvent, read_xml
from sleepcast.tak.link import TakLink
from sleepcast.tak.picture import GROUND_ROBOT, MAX_MARKERS

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it would like another library for what is not done here
    import pytak

PATIENCE = 90.0
"""Seconds that a busy machine may take."""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user with no keys and no memory of any fleet."""
    live_in(tmp_path, monkeypatch)
    return tmp_path


async def heard(port: int, marker: CotEvent, wanted: dict[str, str]) -> dict[str, CotEvent]:
    """What another client of the server, which sets a marker, hears of these uids, until all have these names: the
    latest event of each."""
    config = configparser.ConfigParser()
    config["client"] = {"COT_URL": f"tcp://127.0.0.1:{port}"}
    ends = time.monotonic() + PATIENCE
    while True:
        try:
            reader, writer = await pytak.protocol_factory(config["client"])
            break
        except OSError:  # the server is still starting
            assert time.monotonic() < ends
            await asyncio.sleep(0.1)
    incoming: asyncio.Queue[bytes] = asyncio.Queue()
    outgoing: asyncio.Queue[bytes] = asyncio.Queue()
    workers = [
        asyncio.ensure_future(pytak.RXWorker(incoming, config["client"], reader).run()),
        asyncio.ensure_future(pytak.TXWorker(outgoing, config["client"], writer).run()),
    ]
    found: dict[str, CotEvent] = {}
    now = time.time()
    await outgoing.put(CotEvent("other", "a-f-G-U-C", 36.6, -121.9, now, now + 99.0, "other").xml())
    try:
        while not all(uid in found and name in found[uid].callsign for uid, name in wanted.items()):
            await outgoing.put(marker.xml())
            event = read_xml(await asyncio.wait_for(incoming.get(), ends - time.monotonic()))
            found[event.uid] = event
    finally:
        for worker in workers:
            worker.cancel()
        await asyncio.gather(*workers, return_exceptions=True)
        writer.transport.abort()
    return found


def values_of(names: str, channel: str) -> dict[str, tuple[float, ...]]:
    """What robots report of these variables: those that know all of them."""
    known = called("watch", "--once", "--json", "--show", names, "--channel", channel)
    robots = json.loads(known.out)["robots"] if known.out else []  # nobody knows them yet
    told = {robot["name"]: tuple(robot["values"].get(name) for name in names.split(",")) for robot in robots}
    return {name: values for name, values in told.items() if None not in values}


def line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def test_robots_groups_and_places_are_seen_and_markers_become_places(home: Path) -> None:
    channel, port = f"udp://239.255.83.76:{free_port()}?interface=lo", free_port(SOCK_STREAM)
    now = time.time()
    marker = CotEvent("m1", "b-m-p-s-m", 36.601, -121.9, now, now + 99.0, "Depot 1")
    server = ("--server", f"tcp://127.0.0.1:{port}", "--origin", "36.6,-121.9", "--markers", "--every", "0.2")

    def swarm() -> AbstractContextManager[subprocess.Popen[str]]:
        return running(*SLEEPCAST, "swarm", "3", "--channel", channel, up="up")

    with swarm(), running(*SLEEPCAST, "bridge", "tak", *server, "--channel", channel) as bridge:
        assert "is gone" in line(bridge)
        with tak_server(home, port):
            assert "is back" in line(bridge)
            ends = time.monotonic() + PATIENCE
            while account(channel, "send", "--all", "--count", "3", "(JOIN bravo)")["n_matched"] < 3:
                assert time.monotonic() < ends, "all have joined"
            wanted = {
                **{f"sleepcast.r{number}": f"r{number}" for number in (1, 2, 3)},
                "sleepcast.group.bravo": "bravo (3)",
                "sleepcast.place.vessel": "",
            }
            found = asyncio.run(heard(port, marker, wanted))
            assert line(bridge).startswith("depot_1 is at x = ")
            ends = time.monotonic() + PATIENCE
            while len(known := values_of("depot_1_x,depot_1_y", channel)) < 3:
                assert time.monotonic() < ends, "all are told"
            while not account(channel, "send", "--only", "r2", "--blind", "(SETQ depot_1_x 70m)")["n_matched"]:
                assert time.monotonic() < ends, "r2 is told another place"
            while values_of("depot_1_x", channel).get("r2") != known["r1"][:1]:
                assert time.monotonic() < ends, "r2 is told again"
        assert "is gone" in line(bridge)
    assert len(known) == 3
    for depot_x, depot_y in known.values():
        assert depot_x == pytest.approx(0.0, abs=0.1)
        assert depot_y == pytest.approx(111.0, abs=0.5)
    assert found["sleepcast.group.bravo"].callsign == "bravo (3)"
    assert found["sleepcast.r2"].callsign == "r2"
    assert "sleepcast.place.depot_1" not in found  # it is on that map already


def bridge_of(station: SimpleNamespace, type: str = GROUND_ROBOT) -> TakBridge:
    """A bridge that sends with this station, and knows of no robots."""
    telemetry, link = cast(TelemetryClient, SimpleNamespace(minds={})), cast(TakLink, SimpleNamespace())
    ground, sends = LocalMap(Origin(36.6, -121.9)), cast(NetworkStation, station)
    return TakBridge(sends, telemetry, link, ground, print, fleet="f", every=1.0, markers=True, type=type)


def test_robots_are_told_of_a_few_places_at_a_time_however_many_are_moved() -> None:
    told = list[str]()

    def send(text: str, **_: object) -> None:
        told.append(text)

    bridge = bridge_of(SimpleNamespace(send=send))
    for second in range(20):
        for number in range(MAX_MARKERS):
            where = 36.6 + 0.001 * (second % 2), -121.9
            bridge._take(CotEvent(f"m{number}", "b-m-p-s-m", *where, 0.0, 0.0, f"p{number}"))
        bridge._tell(float(second))
    assert len(told) == 10 * AT_ONCE, "every two seconds"
    names = {text.split()[2].rstrip(")") for text in told}
    assert len(names) == 10 * AT_ONCE, "each in its turn"


class Datagrams:
    """As pytak reads from multicast."""

    def __init__(self, datagram: bytes) -> None:
        self._datagram = datagram

    async def recv(self) -> tuple[bytes, object]:
        return self._datagram, None


@pytest.mark.counterpart("pytak")
@pytest.mark.parametrize("told", [False, True])
def test_pytak_reads_our_multicast_only_if_it_is_told_to(told: bool) -> None:
    """Otherwise it hands on the bytes of the datagram, in the place of XML."""
    datagram = MESH + CotEvent("fleet.r1", GROUND_ROBOT, 36.6, -121.9, 0.0, 3.0, "r1").protobuf()
    config = configparser.ConfigParser()
    config["client"] = {"TAK_PROTO": "1"} if told else {}
    found = asyncio.run(pytak.RXWorker(asyncio.Queue(), config["client"], Datagrams(datagram)).readcot())
    assert found.cotEvent.uid == "fleet.r1" if told else found == datagram


@pytest.mark.parametrize("type", ["", "a", "robot", "a-f-<G>", "a" + "-b" * 99])
def test_a_type_that_is_none_is_refused(type: str) -> None:
    with pytest.raises(MisuseError, match="is no type of an event"):
        bridge_of(SimpleNamespace(), type=type)


def test_a_user_is_told_what_a_type_is(home: Path) -> None:
    said = called("bridge", "tak", "--server", "tcp://127.0.0.1:1", "--origin", "36.6,-121.9", "--type", "robot")
    assert (said.status, "is no type of an event" in said.err) == (2, True)
