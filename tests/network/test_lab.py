"""The laboratory itself: what it does to the air is what it says."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest
from benchmarks.channel.lab import MAX_HOSTS, URI, Lab, LabError, Traffic, why_not

from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Role

REASON = why_not()
needs_networks = pytest.mark.skipif(bool(REASON), reason=f"no networks of our own here: {REASON}")

HEAR = """
import select, sys
from sleepcast.channel.transports.udp import UdpTransport
ears, heard, over = UdpTransport(sys.argv[1]), 0, False
print("up", flush=True)
while select.select([ears], [], [], 0.1)[0] or not over:
    heard += len(ears.receive())
    over = bool(select.select([sys.stdin], [], [], 0.0)[0])  # it is closed when everything has been said
print(heard, flush=True)
"""
SPEAK = """
import sys, time
from sleepcast.channel.transports.udp import UdpTransport
mouth, said = UdpTransport(sys.argv[1]), bytes.fromhex(sys.argv[3])
for _ in range(int(sys.argv[2])):
    mouth.send(said)
    time.sleep(0.0005)
"""
MOST_STOPS = 100
"""So many wait for one who does not look, as happens on a busy machine; of all else more do."""


@pytest.fixture
def lab() -> Iterator[Lab]:
    with Lab(["one", "two", "three"]) as found:
        yield found


def said(kind: Kind) -> bytes:
    (datagram,) = encode(Message("desk", 1, 1, kind, 1.0), "lab", KeyPair("desk", Role.COMMANDER, b"d" * 32))
    return datagram


def heard(lab: Lab, count: int, kind: Kind = Kind.STOP, settle: Callable[[], object] = lambda: None) -> list[int]:
    """How many of so many datagrams of the first host the two others hear; those that are cut off hear none. settle:
    waits until nothing is on its way any more."""
    assert kind is not Kind.STOP or count <= MOST_STOPS
    pipe = subprocess.PIPE
    ears = [lab.start(host, sys.executable, "-c", HEAR, URI, stdin=pipe, stdout=pipe) for host in lab.hosts[1:]]
    outs = [each.stdout for each in ears if each.stdout is not None]
    assert [out.readline() for out in outs] == ["up\n"] * 2
    mouth = lab.start(lab.hosts[0], sys.executable, "-c", SPEAK, URI, str(count), said(kind).hex())
    assert mouth.wait(60.0) == 0
    settle()
    return [int(each.communicate(timeout=60.0)[0]) for each in ears]


@needs_networks
def test_a_clear_air_carries_everything_and_counts_it_by_kind(lab: Lab) -> None:
    assert heard(lab, 50) == [50, 50]
    assert heard(lab, 20, Kind.ANSWER) == [20, 20]
    sizes = [len(said(kind)) + 28 for kind in (Kind.STOP, Kind.ANSWER)]  # with the heads of IP and UDP
    assert lab.traffic() == {"stop": Traffic(50, 50 * sizes[0]), "answer": Traffic(20, 20 * sizes[1])}


@needs_networks
def test_each_receiver_loses_by_itself(lab: Lab) -> None:
    lab.lose(0.5, ["two"])
    one, other = heard(lab, 400, Kind.ANSWER)
    assert 120 < one < 280
    assert other == 400
    lab.lose(0.0)
    assert heard(lab, 50) == [50, 50]


@needs_networks
def test_who_is_cut_off_hears_nothing_until_he_is_back(lab: Lab) -> None:
    lab.cut("three")
    assert heard(lab, 50) == [50, 0]
    lab.heal()
    assert heard(lab, 50) == [50, 50]


@needs_networks
def test_a_disturbed_air_repeats_and_reorders_but_loses_nothing(lab: Lab) -> None:
    relay = lab.disturb(delay=0.05, twice=0.2, seed=3)
    counts: dict[str, int] = {}
    numbers = heard(lab, 200, Kind.ANSWER, settle=lambda: counts.update(lab.end(relay)))
    assert all(200 < number < 280 for number in numbers)
    assert counts["refused"] == 0
    assert counts["overtaken"] > counts["taken"] / 2


def test_a_laboratory_that_cannot_be_made_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.channel.lab.PATH", "/nowhere")
    assert "wanted Linux with ip, nft, " in why_not.__wrapped__()  # not what is known of this machine


@needs_networks
def test_a_laboratory_has_bounds() -> None:
    with pytest.raises(LabError, match=f"at most {MAX_HOSTS} hosts"):
        Lab([f"h{number}" for number in range(MAX_HOSTS + 1)])
