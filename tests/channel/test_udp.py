"""UDP on this machine's own network: what its addresses say, and what comes from strangers."""

from __future__ import annotations

import re
import select
import socket
import sys
import time
from contextlib import closing

import pytest

from channel.endpoints import DESK, PATIENCE, ROBOTS, channel, free_port
from channel_contract import message
from sleepcast.channel import Kind, Message
from sleepcast.channel.drops import DropReason
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Role
from sleepcast.channel.transports import arrival, open_transport
from sleepcast.channel.transports.address import AddressError
from sleepcast.channel.transports.arrival import StampedSocket
from sleepcast.channel.transports.transport import ReceivedDatagram, address_of, waited
from sleepcast.channel.transports.udp import MAX_STOPS, UdpError
from sleepcast.core.clock import seconds_passed

SLACK = 0.005
"""Seconds by which the system may have adjusted its clock meanwhile."""


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("upd://239.1.1.1:5", "(did you mean udp://239.1.1.1:5?)"),
        ("239.1.1.1:5", "(did you mean udp://239.1.1.1:5?)"),
        ("udb://a:1", "(did you mean udp://a:1?)"),
        ("", "wanted one that begins with"),
        ("udp://239.255.83.76", "wanted udp://ADDRESS:PORT"),
        ("udp://239.255.83.76:0", "wanted udp://ADDRESS:PORT"),
        ("udp://239.255.83.76:99999", "Port out of range"),
        ("udp://somewhere:47123", "does not appear to be an IPv4 or IPv6 address"),
        ("udp:239.255.83.76:47123", "wanted udp://ADDRESS:PORT"),
        ("udpp://239.255.83.76:47123", "did you mean udp"),
        ("udp://239.255.83.76:47123/path", "wanted udp://ADDRESS:PORT"),
        ("udp://239.255.83.76:47123?interfaces=lo", "did you mean interface"),
        ("udp://239.255.83.76:47123?interface=lp", "this machine has no interface 'lp'"),
    ],
)
def test_an_address_that_means_nothing_is_refused_with_what_was_wanted(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=re.escape(complaint)):
        channel(uri, DESK)


def test_strangers_are_counted_and_not_heard() -> None:
    uri = f"udp://239.255.83.76:{free_port()}?interface=lo"
    stranger = KeyPair("desk", Role.COMMANDER, b"s" * 32)
    with channel(uri, ROBOTS) as robot, channel(uri, stranger) as other, channel(uri, DESK) as desk:
        other.send(message(Kind.COMMAND))
        desk.send(message(Kind.COMMAND, sequence=2))
        heard: list[Message] = []
        begin = time.monotonic()
        while not heard and time.monotonic() - begin < PATIENCE:
            heard = robot.receive()
        assert [each.sequence for each in heard] == [2]
        assert robot.admission.counts == {DropReason.UNKNOWN_KEY: 1}


def test_a_port_that_somebody_has_for_himself_alone_is_named() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as greedy:
        greedy.bind(("127.255.255.255", 0))
        uri = f"udp://127.255.255.255:{greedy.getsockname()[1]}"
        with pytest.raises(UdpError, match="take another port"):
            channel(uri, DESK)


def test_a_stop_is_heard_behind_a_flood_of_anything_else() -> None:
    """More than the system keeps, before anybody looks: STOP has a socket of its own, where there is a filter."""
    uri = f"udp://239.255.83.76:{free_port()}?interface=lo"
    with closing(open_transport(uri)) as receiving, closing(open_transport(uri)) as sending:
        flood = encode(message(Kind.COMMAND), "lab", DESK)[0]
        (stop,) = encode(message(Kind.STOP, sequence=2), "lab", DESK)
        for _ in range(30_000):
            sending.send(flood)
        sending.send(stop)
        if sys.platform == "linux":
            assert receiving.receive()[0] == stop
        assert select.select([receiving], [], [], PATIENCE)[0]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such filters")
def test_all_else_is_heard_behind_a_flood_of_stops() -> None:
    uri = f"udp://239.255.83.76:{free_port()}?interface=lo"
    with closing(open_transport(uri)) as receiving, closing(open_transport(uri)) as sending:
        (flood,) = encode(message(Kind.STOP), "lab", DESK)
        command = encode(message(Kind.COMMAND, sequence=2), "lab", DESK)[0]
        for _ in range(30_000):
            sending.send(flood)
        sending.send(command)
        found = receiving.receive()
        assert found.count(flood) == MAX_STOPS
        assert found[-1] == command


def test_a_datagram_has_the_address_of_its_sender() -> None:
    uri = f"udp://239.255.83.76:{free_port()}?interface=lo"
    with closing(open_transport(uri)) as here, closing(open_transport(uri)) as there:
        (heard,) = encode(Message("r1", 1, 1, Kind.ANSWER, 1.0), "lab", ROBOTS)
        there.send(heard)
        select.select([here], [], [], PATIENCE)
        (found,) = here.receive()
        assert found == heard
        host, _, port = address_of(found).rpartition(":")
        assert host
        assert 0 < int(port) < 65_536


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such stamps")
def test_a_datagram_counts_from_its_arrival_however_late_it_is_read() -> None:
    uri = f"udp://239.255.83.76:{free_port()}?interface=lo"
    with closing(open_transport(uri)) as here, closing(open_transport(uri)) as there:
        sent = seconds_passed()
        there.send(encode(message(Kind.COMMAND), "lab", DESK)[0])
        assert select.select([here], [], [], PATIENCE)[0]
        came = seconds_passed()
        time.sleep(0.05)
        (found,) = here.receive()
        assert isinstance(found, ReceivedDatagram)
        assert found.arrived is not None
        assert sent - SLACK <= found.arrived <= came + SLACK
        assert waited(found) >= 0.05 - SLACK


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such stamps")
def test_stamps_of_a_computer_whose_clock_was_set_meanwhile_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    right, passed = time.time(), arrival.seconds_passed()
    monkeypatch.setattr(
        arrival, "seconds_passed", lambda: passed
    )  # a busy computer may stand still between both clocks
    monkeypatch.setattr(time, "time", lambda: right)
    with ours, theirs:
        stamped = StampedSocket(ours)
        for ahead, counts in ((0.0, True), (5.0, False), (5.0, True)):
            monkeypatch.setattr(time, "time", lambda ahead=ahead: right + ahead)
            theirs.send(b"abc")
            stamped.compare()
            datagram, _, arrived = stamped.receive(100)
            assert (datagram, arrived is not None) == (b"abc", counts)
