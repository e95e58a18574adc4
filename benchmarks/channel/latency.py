"""From Enter to effect: how long a command takes to robots on this machine, beside plain UDP, zenoh and MQTT.

Each contender carries the same bytes, one signed command, to as many receivers in as many processes, at the same pace
and in turns. What is timed is the way from the sender's call to the receiver's: for sleepcast from `post` until the
message, checked, read and not heard before, is given to a robot's mind. Its robots go on living meanwhile: they
evaluate, answer, move their bodies, and commands are repeated; the others do nothing but receive.

    plain UDP           a socket for each receiver, as robots on their own would have
    plain UDP, shared   one socket for each process, and nothing done with what comes
    zenoh               a session for each process and a subscriber for each receiver; the sender is their router
    MQTT                a connection for each receiver, to mosquitto, quality of service 0
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from unittest import mock

from benchmarks.channel.proofs import YARD, Proof, seconds
from benchmarks.channel.receivers import PUBLISH, TOPIC, mqtt_connected, mqtt_packet, mqtt_text
from benchmarks.report import Bar, number
from sleepcast.api.connection import FLEET, AirOptions, session_for
from sleepcast.api.progress import steps
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import encode
from sleepcast.channel.keyring import development_keys
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import WITHIN, Role
from sleepcast.channel.transports.udp import UdpTransport

BAR = 2.0
"""Times the 99th percentile of plain UDP."""
TURNS = 3
WARM = 3
"""Commands before those that count: what is loaded and compiled for the first of a text is not its way."""
PACE = 0.5
"""Seconds between two commands, by chance half of it more or less: a person is not quicker."""
SPREAD = 0.1
"""Seconds over which robots spread their answers, which then are over before the next command."""
TEXT = "(WHEN (> id 100000) (SETQ drive_speed 0.2))"
PATIENCE = 30.0

Send = Callable[[int, bytes], int]
"""Sends these bytes, which are the command of this number, or another one of their size; gives the number sent."""
Wait = Callable[[float], None]
"""Lets so many seconds pass."""
Contender = Callable[[Path, int, int], AbstractContextManager[tuple[Send, Wait]]]
"""Sets up so many receivers in each of so many processes, which leave their times in a folder."""


def latency(receivers: int, processes: int, commands: int) -> Proof:
    """So many commands of each contender, to so many receivers."""
    contenders: dict[str, Contender] = {
        "plain UDP": _plain,
        "plain UDP, shared": _shared,
        "sleepcast": _sleepcast,
    }
    notes = []
    try:
        import zenoh  # noqa: F401

        contenders["zenoh"] = _zenoh
    except ImportError:
        notes.append("zenoh is not installed")
    if shutil.which("mosquitto"):
        contenders["MQTT (mosquitto)"] = _mqtt
    else:
        notes.append("mosquitto is not installed")
    times: dict[str, list[float]] = {name: [] for name in contenders}
    lost = dict.fromkeys(contenders, 0)
    for _ in steps(TURNS, "latency", quiet=False):
        for name, contender in contenders.items():
            count = -(-commands // TURNS)
            found = _turn(contender, receivers // processes, processes, count)
            times[name] += found
            lost[name] += count * (receivers // processes) * processes - len(found)
    plain = times["plain UDP"]
    rows = []
    for name, each in times.items():
        shares = [1e3 * seconds(each, share) for share in (0.5, 0.99)]
        against = [seconds(each, share) / seconds(plain, share) for share in (0.5, 0.99)]
        rows.append([name, *map(number, shares), *map(number, against), str(lost[name])])
    bar = Bar(
        f"Enter to effect on {receivers} nodes, 99 %, of plain UDP",
        seconds(times["sleepcast"], 0.99) / seconds(plain, 0.99),
        BAR,
        "x",
        at_least=False,
    )
    heads = ["", "50 %, ms", "99 %, ms", "x UDP, 50 %", "x UDP, 99 %", "lost"]
    note = f"{commands:,} commands to {receivers} receivers in {processes} processes, one in {PACE:g} s"
    return Proof("latency", heads, rows, [bar], "; ".join([note, *notes]))


def _turn(contender: Contender, receivers: int, processes: int, count: int) -> list[float]:
    """Seconds that each of these commands took to each receiver that got it."""
    chance, key = Random(1), KeyPair("desk", Role.COMMANDER, b"d" * 32)
    sent: dict[int, float] = {}
    with TemporaryDirectory(prefix="sleepcast-lab-") as place, mock.patch.dict(os.environ, XDG_DATA_HOME=place):
        folder = Path(place)
        with contender(folder, receivers, processes) as (send, wait):
            wait(2.0)
            for index in range(WARM + count):
                data = _command(index + 1, key)
                began = time.monotonic()
                which = send(index + 1, data)
                if index >= WARM:
                    sent[which] = began
                wait(PACE * chance.uniform(0.5, 1.5))
            wait(1.0)
        heard = [each for file in folder.glob("*.times") for each in json.loads(file.read_text())]
    return [when - sent[index] for index, when in heard if index in sent]


# ---- senders, with their receivers


@contextmanager
def _children(folder: Path, sort: str, receivers: int, processes: int, *arguments: str) -> Iterator[None]:
    """Processes with receivers, up during the block, each on a core of its own, as on a computer of its own: else two
    of them now and then wait for the same one."""
    running, cores = [], sorted(os.sched_getaffinity(0))
    path = os.pathsep.join(each for each in sys.path if each)
    for place in range(processes):
        command = [sys.executable, "-m", "benchmarks.channel.receivers", sort, str(folder / f"{place}.times")]
        command += [str(receivers), str(1 + place * receivers), *arguments]
        environment = {**os.environ, "PYTHONPATH": path}
        running.append(
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment)
        )
        os.sched_setaffinity(running[-1].pid, {cores[place % len(cores)]})
    try:
        for each in running:
            assert each.stdout is not None
            if "up" not in each.stdout.readline():
                raise RuntimeError(f"the receivers of {sort} did not begin")
        yield
    finally:
        for each in running:
            each.send_signal(signal.SIGINT)
        for each in running:
            each.communicate(timeout=PATIENCE)


def _command(index: int, key: KeyPair) -> bytes:
    """The bytes that a command with this number has."""
    now = time.time()
    body: dict[str, object] = {"after": index - 1, "until": now + 5.0, "rules": 0, WITHIN: SPREAD}
    (found,) = encode(Message("desk", int(now * 1e3), index, Kind.COMMAND, now, now + 5.0, TEXT, body=body), FLEET, key)
    return found


def _group() -> str:
    """A multicast address of this machine's own, with a port that nobody has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        return f"udp://239.255.83.77:{found.getsockname()[1]}?interface=lo"


@contextmanager
def _plain(folder: Path, receivers: int, processes: int, sort: str = "udp") -> Iterator[tuple[Send, Wait]]:
    uri = _group()
    with _children(folder, sort, receivers, processes, uri), closing(UdpTransport(uri)) as mouth:

        def send(index: int, data: bytes) -> int:
            mouth.send(data)
            return index

        yield send, time.sleep


def _shared(folder: Path, receivers: int, processes: int) -> AbstractContextManager[tuple[Send, Wait]]:
    return _plain(folder, receivers, processes, "shared")


@contextmanager
def _sleepcast(folder: Path, receivers: int, processes: int) -> Iterator[tuple[Send, Wait]]:
    uri, keys = _group(), folder / "keys"
    development_keys(keys)
    options = ("--channel", uri, "--keys", str(keys), *YARD)
    with (
        _children(folder, "swarm", receivers, processes, *options),
        closing(
            session_for(AirOptions(uri, FLEET, None, None, keys, None), None, robot=False, say=lambda _: None)
        ) as session,
    ):

        def send(_: int, __: bytes) -> int:
            sent = session.delivery.post(Kind.COMMAND, time.time(), text=TEXT, body={WITHIN: SPREAD})
            session.flush()
            return sent.sequence

        def wait(seconds: float) -> None:
            session.wait(seconds)
            session.receive()

        yield send, wait


@contextmanager
def _zenoh(folder: Path, receivers: int, processes: int) -> Iterator[tuple[Send, Wait]]:
    import zenoh

    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{found.getsockname()[1]}"
    config = zenoh.Config()
    for key, value in (
        ("mode", '"router"'),
        ("listen/endpoints", f'["{where}"]'),
        ("scouting/multicast/enabled", "false"),
    ):
        config.insert_json5(key, value)
    with (
        zenoh.open(config) as session,
        _children(folder, "zenoh", receivers, processes, where),
        session.declare_publisher(TOPIC) as publisher,
    ):

        def send(index: int, data: bytes) -> int:
            publisher.put(data)
            return index

        yield send, time.sleep


@contextmanager
def _mqtt(folder: Path, receivers: int, processes: int) -> Iterator[tuple[Send, Wait]]:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    settings = folder / "mosquitto.conf"
    settings.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\npersistence false\n")
    broker = subprocess.Popen(["mosquitto", "-c", settings], stderr=subprocess.DEVNULL)
    try:
        with _children(folder, "mqtt", receivers, processes, str(port)), mqtt_connected(port, "desk") as mouth:

            def send(index: int, data: bytes) -> int:
                mouth.sendall(mqtt_packet(PUBLISH, mqtt_text(TOPIC) + data))
                return index

            yield send, time.sleep
    finally:
        broker.terminate()
        broker.wait(PATIENCE)
