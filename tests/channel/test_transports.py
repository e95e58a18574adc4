"""Every transport keeps the contract of every channel, and that of what carries bytes."""

from __future__ import annotations

import re
import select
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing

import pytest

from channel.endpoints import DESK, MEDIA, PATIENCE, air_over, free_port, heard_everywhere, parties_of
from channel_contract import Air, ChannelContract
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import MAX_DATAGRAM, encode
from sleepcast.channel.transports import open_transport
from sleepcast.channel.transports.address import AddressError
from sleepcast.channel.transports.memory import LATE, MAX_WAITING, MemoryTransport
from sleepcast.channel.transports.transport import Transport, WakeUp
from sleepcast.core.clock import ManualClock
from sleepcast.core.extras import installing


@pytest.fixture(params=list(MEDIA), scope="module")
def everybody(request: pytest.FixtureRequest) -> Iterator[list[Transport]]:
    with parties_of(request.param, 4) as found:
        yield found


@pytest.fixture
def parties(everybody: list[Transport]) -> list[Transport]:
    """Four parties of a medium on which nothing is on its way."""
    air_over(everybody).settle()
    return everybody


def test_stops_can_be_taken_ahead_of_all_others(parties: list[Transport]) -> None:
    sent = [
        encode(Message("desk", 1, number, kind, 10.0), "lab", DESK)[0]
        for number, kind in enumerate((Kind.ASK, Kind.STOP, Kind.COMMAND, Kind.STOP, Kind.ANSWER), 1)
    ]
    for datagram in sent:
        parties[0].send(datagram)
    stops, begin = list[bytes](), time.monotonic()
    while len(stops) < 2 and time.monotonic() - begin < PATIENCE:
        stops += parties[1].receive_stops()
    assert stops == [sent[1], sent[3]]
    assert parties[1].receive_stops() == []
    assert sorted(taken(parties[1], 3)) == sorted((sent[0], sent[2], sent[4]))
    assert sorted(taken(parties[2], 5)) == sorted(sent)


class TestEveryTransport(ChannelContract):
    @pytest.fixture
    def air(self, parties: list[Transport]) -> Air:
        return air_over(parties)


def taken(party: Transport, count: int) -> list[bytes]:
    """So many datagrams, or what has come of them when patience ends."""
    found: list[bytes] = []
    begin = time.monotonic()
    while len(found) < count and time.monotonic() - begin < PATIENCE:
        select.select([party], [], [], 0.1)
        found += party.receive()
    return found


def test_any_bytes_arrive_whole_and_in_order_and_wake_who_waits(parties: list[Transport]) -> None:
    sent = [b"\0", bytes(range(256)), b"\xff" * MAX_DATAGRAM]
    assert select.select([parties[1]], [], [], 0)[0] == []
    for datagram in sent:
        parties[0].send(datagram)
    assert select.select([parties[1]], [], [], PATIENCE)[0] == [parties[1]]
    assert [taken(party, 3) for party in parties[1:]] == [sent] * 3
    assert parties[0].receive() == []


def test_a_burst_of_a_long_message_arrives(parties: list[Transport]) -> None:
    sent = [number.to_bytes(2, "big") * (MAX_DATAGRAM // 2) for number in range(96)]
    for datagram in sent:
        parties[2].send(datagram)
    assert taken(parties[0], len(sent)) == sent


@pytest.mark.parametrize("medium", ["multicast", "memory", "zenoh"])
def test_who_has_left_harms_nobody(medium: str) -> None:
    with parties_of(medium, 3) as parties:
        parties[1].close()
        parties[0].send(b"still there?")
        assert taken(parties[2], 1) == [b"still there?"]


def opened(uri: str, clock: ManualClock, count: int = 2) -> list[MemoryTransport]:
    found = [open_transport(uri.replace("#", str(number)), clock) for number in range(count)]
    return [party for party in found if isinstance(party, MemoryTransport)]


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(100.0)


@pytest.fixture
def local(clock: ManualClock) -> Iterator[Callable[..., list[MemoryTransport]]]:
    """Opens parties of a medium in simulated time."""
    with ExitStack() as stack:

        def found(uri: str, count: int = 2) -> list[MemoryTransport]:
            parties = opened(uri, clock, count)
            for party in parties:
                stack.callback(party.close)
            return parties

        yield found


def numbers(count: int) -> list[bytes]:
    return [number.to_bytes(4, "big") for number in range(count)]


def test_each_hears_a_share_and_twice_as_its_address_says(local: Callable[..., list[MemoryTransport]]) -> None:
    speaker, *hearers = local("memory:lossy?loss=0.3&duplicate=0.1&seed=4", 4)
    sent = numbers(2_000)
    for datagram in sent:
        speaker.send(datagram)
    heard = [Counter(party.receive()) for party in hearers]
    for counts in heard:
        assert set(counts) < set(sent)
        assert sum(counts.values()) == pytest.approx(2_000 * 1.1 * 0.7, rel=0.05)
        assert sum(count == 2 for count in counts.values()) == pytest.approx(2_000 * 0.1 * 0.49, rel=0.4)
    assert heard[0] != heard[1] != heard[2], "each loses its own"


def test_the_same_seed_makes_the_same_losses(local: Callable[..., list[MemoryTransport]]) -> None:
    def heard(seed: int) -> list[bytes]:
        speaker, hearer = local(f"memory:repeated?loss=0.5&seed={seed}")
        for datagram in numbers(200):
            speaker.send(datagram)
        found = hearer.receive()
        speaker.close()
        hearer.close()
        return found

    assert heard(1) == heard(1) != heard(2)


def test_what_is_on_its_way_comes_when_it_is_due(
    local: Callable[..., list[MemoryTransport]], clock: ManualClock
) -> None:
    speaker, hearer = local("memory:slow?delay=0.5&jitter=0.5")
    sent = numbers(50)
    for datagram in sent:
        speaker.send(datagram)
    clock.advance(0.49)
    assert hearer.receive() == []
    clock.advance(0.26)
    first = hearer.receive()
    assert 0 < len(first) < 50
    clock.advance(0.3)
    assert sorted(first + hearer.receive()) == sent != first


def test_some_overtake_others(local: Callable[..., list[MemoryTransport]], clock: ManualClock) -> None:
    speaker, hearer = local("memory:reordered?reorder=0.2&seed=2")
    sent, heard = numbers(100), []
    for datagram in sent:
        speaker.send(datagram)
        heard += hearer.receive()
        clock.advance(LATE / 4)
    clock.advance(LATE)
    heard += hearer.receive()
    assert heard != sent
    assert sorted(heard) == sent


def test_who_is_out_of_range_hears_nothing_until_it_comes_near(local: Callable[..., list[MemoryTransport]]) -> None:
    speaker, far = local("memory:wide?at=0,#&range=0.5")
    speaker.send(b"1")
    assert far.receive() == []
    far.at = (0.0, 0.4)
    speaker.send(b"2")
    assert far.receive() == [b"2"]


def test_who_never_takes_what_waits_loses_it_and_knows(local: Callable[..., list[MemoryTransport]]) -> None:
    speaker, hearer = local("memory:full")
    for datagram in numbers(MAX_WAITING + 5):
        speaker.send(datagram)
    assert (hearer.lost, hearer.receive()) == (5, numbers(MAX_WAITING))


def test_a_medium_is_heard_by_its_name_only_and_forgotten_when_it_is_empty(
    local: Callable[..., list[MemoryTransport]],
) -> None:
    (one,), (other,) = local("memory:one", 1), local("memory:other", 1)
    one.send(b"x")
    assert other.receive() == []
    other.close()
    other.close()
    assert "other" not in MemoryTransport._media


def test_delays_wake_who_waits_in_another_thread() -> None:
    with (
        closing(open_transport("memory:threads?delay=0.05")) as hearer,
        closing(open_transport("memory:threads?delay=0.05")) as speaker,
    ):
        woken = threading.Thread(target=lambda: heard.extend(taken(hearer, 1)))
        heard: list[bytes] = []
        woken.start()
        speaker.send(b"wake up")
        woken.join(PATIENCE)
        assert heard == [b"wake up"]


def test_who_was_woken_early_is_woken_again(local: Callable[..., list[MemoryTransport]], clock: ManualClock) -> None:
    """The clock that says what is due may have been set back meanwhile."""
    speaker, hearer = local("memory:early?delay=0.05")
    hearer.fileno()
    speaker.send(b"wake up")
    assert select.select([hearer], [], [], PATIENCE)[0]
    assert hearer.receive() == []
    assert select.select([hearer], [], [], PATIENCE)[0]
    clock.advance(0.05)
    assert hearer.receive() == [b"wake up"]


def test_nobody_is_woken_for_what_is_received_already() -> None:
    """A datagram that comes just when somebody begins to receive."""
    with closing(open_transport("memory:just-then")) as hearer, closing(open_transport("memory:just-then")) as speaker:
        assert isinstance(hearer, MemoryTransport)
        began = threading.Event()

        class Clearing(WakeUp):
            def clear(self) -> None:
                super().clear()
                began.set()
                time.sleep(0.2)  # as on a busy machine; whoever speaks now is to wait, or to be heard later

        hearer._wakeup.close()
        hearer._wakeup = Clearing()
        heard: list[bytes] = []
        receiving = threading.Thread(target=lambda: heard.extend(hearer.receive()))
        receiving.start()
        assert began.wait(PATIENCE)
        speaker.send(b"now")
        receiving.join(PATIENCE)
        woken = bool(select.select([hearer], [], [], 0)[0])
        assert woken == (not heard)


def test_a_router_that_was_away_is_found_again() -> None:
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed here")
    place = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    router = open_transport(f"zenoh://{place}?listen")
    try:
        with closing(open_transport(f"zenoh://{place}")) as one, closing(open_transport(f"zenoh://{place}")) as other:
            heard_everywhere([one, other])
            router.close()
            one.send(b"nobody carries this")
            router = open_transport(f"zenoh://{place}?listen")
            heard_everywhere([one, other])
    finally:
        router.close()


@pytest.mark.counterpart("eclipse-zenoh")
def test_a_router_of_zenoh_passes_nothing_between_peers_and_so_each_party_is_a_client() -> None:
    zenoh = pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed here")
    place = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("connect/endpoints", f'["tcp/{place}"]')
    config.insert_json5("listen/endpoints", "[]")
    config.insert_json5("scouting/multicast/enabled", "false")
    with ExitStack() as stack:
        _, one = (stack.enter_context(closing(open_transport(f"zenoh://{place}{end}"))) for end in ("?listen", ""))
        speaker, hearer = (stack.enter_context(zenoh.open(config)) for _ in range(2))
        heard, taken = list[bytes](), set[bytes]()
        listening = zenoh.handlers.Callback(lambda sample: heard.append(sample.payload.to_bytes()), indirect=False)
        hearer.declare_subscriber("sleepcast", listening)
        ends = time.monotonic() + PATIENCE
        while b"a client" not in heard or b"a peer" not in taken:
            assert time.monotonic() < ends
            one.send(b"a client")
            speaker.put("sleepcast", b"a peer")
            time.sleep(0.01)
            taken |= {*one.receive()}
        assert b"a peer" not in heard


def test_keys_of_zenoh_part_what_is_heard() -> None:
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed here")
    place = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    with ExitStack() as stack:
        router, lab, sea = (
            stack.enter_context(closing(open_transport(f"zenoh://{place}{rest}")))
            for rest in ("/lab/1?listen", "/lab/1", "/sea")
        )
        heard_everywhere([router, lab])
        assert sea.receive() == []


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("", "begins with memory:, udp:, zenoh:"),
        ("x" * 2_000, "begins with memory:, udp:"),
        ("zenooh://127.0.0.1:7447", "did you mean zenoh://127.0.0.1:7447?"),
        ("memory:", "wanted memory:NAME"),
        ("memory://lab", "wanted memory:NAME"),
        ("memory:lab?loss=2", "loss must be a number from 0 to 1, not '2'"),
        ("memory:lab?loss=nan", "loss must be a number from 0 to 1, not 'nan'"),
        ("memory:lab?delay=1e9", "delay must be a number from 0 to 3600"),
        ("memory:lab?los=0.1", "did you mean loss?"),
        ("memory:lab?loss=0&loss=0", "has an option twice"),
        ("memory:lab?seed=-1", "seed must be a whole number from 0"),
        ("memory:lab?at=3", "two numbers in metres"),
        ("memory:lab?at=nan,1", "two numbers in metres"),
        ("memory:lab#x", "wanted memory:NAME"),
        ("memory:lab\n", "wanted memory:NAME"),
        ("zenoh://127.0.0.1", "wanted zenoh://HOST:PORT/KEY"),
        ("zenoh://:7447", "wanted zenoh://HOST:PORT/KEY"),
        ("zenoh://a b:7447", "'a b' is not a host"),
        ("zenoh://127.0.0.1:99999", "Port out of range"),
        ("zenoh://127.0.0.1:7447?listen=1", "listen takes no value"),
        ("zenoh://127.0.0.1:7447?connect=127.0.0.1:7448", "it needs listen as well"),
        ("zenoh://127.0.0.1:7447?listen&connect=here", "wanted zenoh://HOST:PORT/KEY"),
        ("zenoh://127.0.0.1:7447/a*", "without *"),
        ("zenoh://127.0.0.1:7447/a//b", "words with / between them"),
    ],
)
def test_an_address_that_means_nothing_is_refused_with_what_was_wanted(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=re.escape(complaint)):
        open_transport(uri)


def test_where_there_is_no_router_or_no_place_for_one_a_sentence_says_so() -> None:
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed here")
    from sleepcast.channel.transports.zenoh import ZenohError

    place = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    with pytest.raises(ZenohError, match="no router answers"):
        open_transport(f"zenoh://{place}")
    with socket.create_server(("127.0.0.1", int(place.split(":")[1]))), pytest.raises(ZenohError, match="another port"):
        open_transport(f"zenoh://{place}?listen")
    with pytest.raises(ZenohError, match=r"cannot listen at 192\.0\.2\.1:7447"):
        open_transport("zenoh://192.0.2.1:7447?listen")


def test_without_its_library_zenoh_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    from sleepcast.channel.transports import zenoh

    monkeypatch.setattr(zenoh, "zenoh", None)
    with pytest.raises(zenoh.ZenohError, match=re.escape(installing("zenoh"))):
        open_transport("zenoh://127.0.0.1:7447")
