"""One Crazyradio for several Crazyflies: cflib on a radio that stands where the USB device would be."""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from math import isclose
from pathlib import Path
from struct import pack
from threading import Event, Thread

import pytest

pytest.importorskip("cflib")

from bridges.crazyradio_dongle import Dongle
from bridges.mind import PATIENCE, Talking
from channel.test_udp import free_port
from cli.calling import called
from sleepcast.bridges import BodyError, OutOfReachError, open_robot
from sleepcast.bridges.crazyflie.quadcopter import CrazyflieBody
from sleepcast.bridges.crazyflie.radio import EMERGENCY_STOP, RadioGoneError, SharedRadio, stop_all_by_port
from sleepcast.core.errors import MisuseError
from sleepcast.robot.hovering import LOCKED_MOTORS

FIRST, SECOND = "E7E7E7E701", "E7E7E7E702"


@pytest.fixture
def port() -> int:
    """The first of three that are free."""
    while True:
        found = free_port()
        try:
            for each in range(3):
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                    probe.bind(("127.0.0.1", found + each))
        except OSError:
            continue
        return found


class Radio(Talking):
    """`sleepcast bridge crazyradio` in a process, with a radio and two quadcopters."""

    def __init__(self, port: int, folder: Path) -> None:
        path = str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")
        dongle = Path(__file__).with_name("crazyradio_dongle.py"), f"{FIRST},{SECOND}"
        command = ("bridge", "crazyradio", "radio0:80", FIRST, SECOND, "--port", port)
        super().__init__(folder / "radio", *dongle, *command, PYTHONPATH=os.pathsep.join(path))
        self.wait_for(*(f"{each} is at crazyflie://127.0.0.1:" for each in (FIRST, SECOND)))

    def close(self) -> None:
        self.end(signal.SIGTERM, 143)
        assert "Traceback" not in self.printed()


def until(true: Callable[[], object]) -> None:
    ends = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < ends
        time.sleep(0.02)


@contextmanager
def looking_at(*bodies: CrazyflieBody) -> Iterator[None]:
    """Like the minds of these bodies, which would land otherwise."""
    ended = Event()

    def look() -> None:
        while not ended.wait(0.1):
            for body in bodies:
                body.sense()

    thread = Thread(target=look)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def flying(uri: str) -> CrazyflieBody:
    body = open_robot(uri)
    assert isinstance(body, CrazyflieBody)
    until(lambda: isclose(sensed(body, "battery"), 0.8))
    body.take_off(0.3)
    until(lambda: isclose(sensed(body, "z"), 0.3, abs_tol=1e-3))
    return body


def sensed(body: CrazyflieBody, name: str) -> float:
    return body.sense().values[[sensor.name for sensor in body.model.sensors].index(name)]


def hear(body: CrazyflieBody, *sentences: str) -> None:
    """Until it has said all of these, whatever else it says."""
    said: list[str] = []

    def all_said() -> bool:
        said.extend(body.complaints())
        return set(sentences) <= set(said)

    until(all_said)


def test_two_programs_share_a_radio_and_what_is_lost_comes_back_by_itself(port: int, tmp_path: Path) -> None:
    uris = [f"crazyflie://127.0.0.1:{port + number}?broadcast={port}" for number in (1, 2)]
    with (
        closing(Radio(port, tmp_path)) as radio,
        closing(flying(uris[0])) as first,
        closing(flying(uris[1])) as second,
        looking_at(first, second),
    ):
        radio.wait_for(f"{FIRST} takes off", f"{SECOND} takes off")
        radio.say(f"away {SECOND}")
        until(lambda: second.lost and not first.lost)
        radio.wait_for(f"{SECOND} is out of reach: the radio does not hear it", f"{SECOND} falls from 0.30 m")
        radio.say(f"back {SECOND}")
        radio.wait_for(f"{SECOND} is within reach again")
        until(lambda: not first.lost and not second.lost)
        hear(second, "the body is within reach again, and at rest until a command moves it", LOCKED_MOTORS)
        until(lambda: sensed(second, "flying") == 0.0)
        with pytest.raises(MisuseError, match="switch it off and on before it flies again"):
            second.take_off(0.3)
        second.cut_all_motors()
        radio.wait_for(f"{FIRST} cuts its motors")
        hear(first, LOCKED_MOTORS)
        until(lambda: sensed(first, "flying") == 0.0)
        radio.say("unplug")
        until(lambda: first.lost and second.lost)
        radio.wait_for("the Crazyradio does not answer; is it unplugged?")
        radio.say("plug")
        radio.wait_for("the Crazyradio is back")
        until(lambda: not first.lost)


def test_the_emergency_stop_reaches_one_whose_node_has_died_and_nothing_else_goes_to_all(
    port: int, tmp_path: Path
) -> None:
    with closing(Radio(port, tmp_path)) as radio:
        body = flying(f"crazyflie://127.0.0.1:{port + 2}?broadcast={port}")
        radio.wait_for(f"{SECOND} takes off")
        land = bytes((0x8C,)) + pack("<BBff?f", 8, 0, 0.0, 0.0, True, 1.0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            for data in (b"", b"\x00", b"\xff", bytes(64), EMERGENCY_STOP[0] + b"\0", land):
                stranger.sendto(data, ("127.0.0.1", port))
            for data in (b"", b"\xff", bytes(64)):
                stranger.sendto(data, ("127.0.0.1", port + 1))
        stop_all_by_port("127.0.0.1", port)  # of any program
        radio.wait_for(f"{FIRST} cuts its motors", f"{SECOND} cuts its motors")
        assert "lands" not in radio.printed(), "it came before"
        body.close()


def plug(monkeypatch: pytest.MonkeyPatch, *dongles: Dongle) -> None:
    """These are the radios of this computer."""
    from cflib.crtp.radiodriver import RadioManager
    from cflib.drivers import crazyradio

    monkeypatch.setattr(RadioManager, "_radios", [])
    monkeypatch.setattr(crazyradio, "_find_devices", lambda serial=None: list(dongles))


def test_bodies_of_one_program_share_its_radio(monkeypatch: pytest.MonkeyPatch) -> None:
    dongle = Dongle([FIRST, SECOND])
    plug(monkeypatch, dongle)
    uris = [f"crazyflie://radio0:80#{address}" for address in (FIRST, SECOND)]
    with closing(flying(uris[0])) as first, closing(flying(uris[1])):
        peers = [ear.peer for ear in dongle.ears.values()]
        assert all(peer.flying for peer in peers)
        first.cut_all_motors()
        until(lambda: all(peer.locked for peer in peers))


def test_without_a_radio_nothing_is_shared(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    plug(monkeypatch)
    with pytest.raises(RadioGoneError, match="Cannot find a Crazyradio Dongle: plug it in, or end the program"):
        SharedRadio("radio://0/80/2M", [FIRST], port, print)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as used:
        used.bind(("127.0.0.1", port + 1))
        with pytest.raises(BodyError, match=f"port {port + 1}: Address already in use; choose others with --port"):
            SharedRadio("radio://0/80/2M", [FIRST], port, print)


@pytest.mark.parametrize(
    "uri",
    ["crazyflie://127.0.0.1:1?broadcast=x", "crazyflie://127.0.0.1:1?broadcast=0", "crazyflie://usb0?broadcast=1"],
)
def test_a_broadcast_that_is_none(uri: str) -> None:
    with pytest.raises(MisuseError, match="broadcast is a UDP port of the same host"):
        open_robot(uri)


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (("radio0:126", FIRST), 2, "'radio0:126': wanted a radio and its channel up to 125, as radio0:80"),
        (("radio0:80", "E7"), 2, "'E7': wanted the address of a Crazyflie, ten hexadecimal digits"),
        (("radio0:80", FIRST, FIRST.lower()), 2, "2 addresses: wanted up to 20, each once"),
        (("radio99:80", FIRST), 1, "Cannot find a Crazyradio Dongle: plug it in, or end the program that has it"),
    ],
)
def test_a_radio_that_is_none(words: tuple[str, ...], status: int, said: str, port: int) -> None:
    done = called("bridge", "crazyradio", "--port", str(port), *words)
    assert done.status == status, done.err
    assert said in done.err
    assert "Traceback" not in done.err


def test_a_relay_of_which_a_thread_has_died_ends_and_says_why(monkeypatch: pytest.MonkeyPatch, port: int) -> None:
    """It would fly some, and perhaps not take the emergency stop."""

    class NoRadio:
        def __init__(self, uri: str) -> None:
            self.device = 0

        def send(self, packet: bytes) -> bool:
            raise KeyError("usb")

        def close(self) -> None:
            pass

    monkeypatch.setattr("sleepcast.bridges.crazyflie.radio.RadioBroadcast", NoRadio)
    failed = "what relays to Crazyflies has failed, please report it: KeyError: 'usb'"
    with SharedRadio("radio://0/80/2M", [], port, print) as radio, pytest.raises(OutOfReachError, match=failed):
        radio.run(lambda: None)
