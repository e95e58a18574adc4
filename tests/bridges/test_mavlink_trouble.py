"""What the other end of a MAVLink link does to a body while it moves: it freezes, floods, speaks garbage.

That it dies is tried in test_mavlink.py.
"""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from random import Random
from threading import Event, Thread

import pytest

pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")

from pymavlink.dialects.v20 import ardupilotmega as dialect

from bridges.mind import Mind
from bridges.test_ground_station import Desk
from bridges.test_mavlink import Process
from channel.test_udp import free_port
from processes import live_in

PACE = 0.005
"""Seconds between two handfuls of datagrams, of ten each: 2,000 a second."""


@contextmanager
def flood(port: int, piece: Callable[[], bytes]) -> Iterator[None]:
    """Datagrams to a port of this computer, as long as this lasts."""
    over = Event()

    def pour() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            while not over.wait(PACE):
                for _ in range(10):
                    line.sendto(piece(), ("127.0.0.1", port))

    thread = Thread(target=pour)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def garbage(whole: list[bytes]) -> Callable[[], bytes]:
    """Bytes of any kind, and messages with a few bits turned."""
    chance = Random(11)

    def piece() -> bytes:
        if chance.random() < 0.5:
            return chance.randbytes(chance.randrange(1, 300))
        data = bytearray(chance.choice(whole))
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        return bytes(data)

    return piece


def strangers() -> list[bytes]:
    """Heartbeats and places of a vehicle that has not got the key."""
    mav = dialect.MAVLink(None, 1, 1)
    messages = (mav.heartbeat_encode(10, 3, 129, 15, 4), mav.global_position_int_encode(0, 1, 2, 3, 4, 5, 6, 7, 8))
    return [bytes(message.pack(mav)) for message in messages]


def test_a_vehicle_that_freezes_and_a_link_full_of_garbage_keep_no_stop_from_a_body_that_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_in(tmp_path, monkeypatch)
    drive = "(RULE drive (WHEN (AND (= mode GUIDED) (= armed 1)) (SETQ drive_speed 1m/s)))"
    tell = '(RULE say (ONCE (> speed 0.5m/s) (REPORT "rolling")))'
    calm = '(RULE calm (ONCE (< speed 0.05m/s) (REPORT "it rests")))'
    ready = ("(SET_MODE GUIDED)", "(ARM)")
    with closing(Process(tmp_path, "rover")) as vehicle, closing(Mind(vehicle.uri, tmp_path)) as mind:
        mind.wait_for("v1 is up")
        mind.say(drive, tell, calm)
        mind.insist("rolling", *ready)
        with flood(vehicle.port, garbage(strangers())):
            mind.wait_for("messages from the vehicle were refused")
            mind.say("STOP")
            mind.wait_for("stopped, and at rest until RELEASE", "it rests")
            mind.say("RELEASE")
            mind.insist("rolling", *ready)
        os.kill(vehicle.pid, signal.SIGSTOP)
        mind.wait_for("the body is out of reach: vehicle 1 has not been heard for 2 s")
        mind.say("STOP")
        mind.wait_for("stopped, and at rest until RELEASE")
        os.kill(vehicle.pid, signal.SIGCONT)
        mind.wait_for("the body is within reach again", "it rests")


def test_a_ground_station_that_floods_freezes_or_speaks_garbage_does_not_go_on_driving(tmp_path: Path) -> None:
    desk, port = Desk(None), free_port()
    uri = f"mavlink://127.0.0.1:{port}?listen=yes&unsigned=yes#7"
    rolls = '(RULE say (ONCE (> speed 0.1m/s) (REPORT "rolling")))'
    calm = '(RULE calm (ONCE (< speed 0.05m/s) (REPORT "it rests")))'
    with closing(Mind("sim:maze", tmp_path, "--ground-station", uri)) as mind:
        mind.wait_for("v1 is up")
        mind.say(rolls, calm)
        with flood(port, lambda: desk.velocity(0.3, 0.0)):
            mind.wait_for("rolling")
            mind.say("STOP")
            mind.wait_for("stopped, and at rest until RELEASE", "it rests")
            mind.say("RELEASE")
            mind.wait_for("rolling")
        with flood(port, garbage([desk.velocity(0.3, 0.0)])):  # it drives no longer: it is frozen, and others speak
            mind.wait_for("the ground station no longer drives it: it comes to rest", "it rests")
