"""Receivers of each contender of `latency`: they note when which command came, and do nothing else.

    python -m benchmarks.channel.receivers SORT FILE COUNT FIRST ...

COUNT receivers in this process; SORT is udp, shared, swarm, zenoh or mqtt, and what follows depends on it. When all are
there it says that they are up; at Ctrl-C it writes the numbers and times (s, monotonic) to FILE.
"""

from __future__ import annotations

import json
import selectors
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from threading import Event

from sleepcast.channel import Message
from sleepcast.channel.envelope import PAYLOAD_AT
from sleepcast.channel.transports.udp import UdpTransport
from sleepcast.cli import main as sleepcast_main
from sleepcast.node.node import Node

NUMBER_AT = PAYLOAD_AT + 13
"""Where a message's number lies in its bytes."""
TOPIC = "sleepcast/lab"
CONNECT, SUBSCRIBE, PUBLISH = 0x10, 0x82, 0x30
KEPT_ALIVE = 600
"""Seconds that MQTT's broker waits for a word of a client."""

TIMES: list[tuple[int, float]] = []


def note(data: bytes) -> None:
    """This command has come."""
    now = time.monotonic()
    TIMES.append((int.from_bytes(data[NUMBER_AT : NUMBER_AT + 8], "big"), now))


def udp(sockets: int, receivers: int, uri: str) -> None:
    """So many sockets, whose datagrams are for so many receivers in all."""
    with ExitStack() as stack, selectors.DefaultSelector() as selector:
        for _ in range(sockets):
            ears = stack.enter_context(closing(UdpTransport(uri)))
            selector.register(ears, selectors.EVENT_READ, ears)
        print("up", flush=True)
        while True:
            for key, _ in selector.select():
                for datagram in key.data.receive():
                    for _ in range(receivers // sockets):
                        note(datagram)


def swarm(count: int, first: int, *options: str) -> None:
    """`sleepcast swarm`, whose minds note what they are given."""
    receive = Node.receive

    def noted(node: Node, message: Message) -> None:
        TIMES.append((message.sequence, time.monotonic()))
        receive(node, message)

    Node.receive = noted  # type: ignore[method-assign]
    sleepcast_main(["swarm", str(count), "--first", str(first), *options])


def zenoh(count: int, where: str) -> None:
    """A session that is a client of the router there, with so many subscribers."""
    import zenoh

    config = zenoh.Config()
    for key, value in (
        ("mode", '"client"'),
        ("connect/endpoints", f'["{where}"]'),
        ("scouting/multicast/enabled", "false"),
    ):
        config.insert_json5(key, value)
    with zenoh.open(config) as session:
        for _ in range(count):
            session.declare_subscriber(TOPIC, lambda sample: note(sample.payload.to_bytes()))
        print("up", flush=True)
        Event().wait()


def mqtt(count: int, first: int, port: int) -> None:
    """So many connections to the broker at this port."""
    with ExitStack() as stack, selectors.DefaultSelector() as selector:
        for number in range(count):
            ears = stack.enter_context(mqtt_connected(port, f"r{first + number}"))
            ears.sendall(mqtt_packet(SUBSCRIBE, b"\0\1" + mqtt_text(TOPIC) + b"\0"))
            ears.recv(5)
            selector.register(ears, selectors.EVENT_READ, bytearray())
        print("up", flush=True)
        while True:
            for key, _ in selector.select():
                key.data.extend(key.fileobj.recv(65_536))
                for topic_and_data in mqtt_published(key.data):
                    note(topic_and_data[2 + len(TOPIC) :])


@contextmanager
def mqtt_connected(port: int, name: str) -> Iterator[socket.socket]:
    """A connection to the broker at this port, by MQTT 3.1.1."""
    with socket.create_connection(("127.0.0.1", port), timeout=10.0) as found:
        found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        greeting = mqtt_text("MQTT") + b"\4\2" + KEPT_ALIVE.to_bytes(2, "big") + mqtt_text(name)
        found.sendall(mqtt_packet(CONNECT, greeting))
        if found.recv(4) != b"\x20\2\0\0":
            raise RuntimeError("the broker does not let us in")
        yield found


def mqtt_text(text: str) -> bytes:
    """A text with its length, as MQTT writes it."""
    return len(text).to_bytes(2, "big") + text.encode()


def mqtt_packet(sort: int, content: bytes) -> bytes:
    """A packet: its sort, its length seven bits at a time, its content."""
    length, left = bytearray(), len(content)
    while left > 127:
        length.append(left & 127 | 128)
        left >>= 7
    length.append(left)
    return bytes([sort]) + bytes(length) + content


def mqtt_published(buffer: bytearray) -> Iterator[bytes]:
    """The contents of whole packets, which are taken out of the buffer."""
    while len(buffer) > 2:
        size = 1 if buffer[1] < 128 else 2  # commands have some hundred bytes
        length = buffer[1] & 127 | (buffer[2] << 7 if size == 2 else 0)
        if len(buffer) < 1 + size + length:
            return
        content = bytes(buffer[1 + size : 1 + size + length])
        del buffer[: 1 + size + length]
        yield content


def main() -> None:
    sort, file, count, first, *others = sys.argv[1:]
    signal.signal(signal.SIGINT, signal.default_int_handler)
    receive: dict[str, Callable[[], None]] = {
        "udp": lambda: udp(int(count), int(count), *others),
        "shared": lambda: udp(1, int(count), *others),
        "swarm": lambda: swarm(int(count), int(first), *others),
        "zenoh": lambda: zenoh(int(count), *others),
        "mqtt": lambda: mqtt(int(count), int(first), *map(int, others)),
    }
    try:
        receive[sort]()
    except KeyboardInterrupt:
        pass
    finally:
        Path(file).write_text(json.dumps(TIMES))


if __name__ == "__main__":
    main()
