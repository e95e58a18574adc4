"""The two ends of `sockets`, each a process: all robots, and the sender. They are told what to do on standard input."""

from __future__ import annotations

import json
import random
import resource
import selectors
import socket
import struct
import sys
import time
from contextlib import ExitStack

from sleepcast.channel.reliable import REPEATS

BROADCAST, IN_TURN, AT_ONCE = "broadcast", "sockets, in turn", "sockets, at once"
WAYS = (BROADCAST, IN_TURN, AT_ONCE)
GROUP, PORT = "239.255.83.77", 47_124
AFTER = 0.25
"""Seconds after the last sending until bytes are counted: the last acknowledgements are still on their way."""
LONGEST = 60.0
"""Seconds that one robot's answer may take."""
SEED = 7


# ---- the process of the robots


def hear(way: str, robots: int, loss: float, address: str) -> None:
    """Note when each robot has each order first. The orders are on the first line of the input; its end ends us."""
    expected = [bytes.fromhex(each) for each in json.loads(sys.stdin.readline())]
    heard: dict[bytes, dict[int, float]] = {each: {} for each in expected}
    size = len(expected[0])
    allow_sockets(robots)
    with ExitStack() as stack, selectors.DefaultSelector() as selector:
        if way == BROADCAST:
            chances = [random.Random(f"{SEED}-{robot}") for robot in range(robots)]
            for robot in range(robots):
                selector.register(stack.enter_context(joined(address)), selectors.EVENT_READ, robot)
            print("up", flush=True)
        else:
            listener = stack.enter_context(socket.create_server((address, PORT), backlog=robots))
            print("up", flush=True)
            for robot in range(robots):
                connection = stack.enter_context(listener.accept()[0])
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                selector.register(connection, selectors.EVENT_READ, robot)
        begun = [b""] * robots
        selector.register(sys.stdin, selectors.EVENT_READ)
        while True:
            for each, _ in selector.select():
                if each.data is None:
                    print(json.dumps([list(heard[order].values()) for order in expected]), flush=True)
                    return
                ears, robot = each.fileobj, each.data
                assert isinstance(ears, socket.socket)
                data = ears.recv(2 * size)
                if way == BROADCAST:
                    if chances[robot].random() >= loss and data in heard:
                        heard[data].setdefault(robot, time.monotonic())
                    continue
                if not data:
                    selector.unregister(ears)
                    continue
                begun[robot] += data
                if len(begun[robot]) == size:
                    heard[begun[robot]][robot] = time.monotonic()
                    begun[robot] = b""
                    ears.sendall(b"!")


def joined(address: str) -> socket.socket:
    """A robot's socket for datagrams."""
    ears = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ears.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    ears.bind((GROUP, PORT))
    membership = struct.pack("4s4s", socket.inet_aton(GROUP), socket.inet_aton(address))
    ears.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    return ears


def allow_sockets(count: int) -> None:
    """Let this process open so many, if the system lets it."""
    wanted, (_, most) = count + 64, resource.getrlimit(resource.RLIMIT_NOFILE)
    if most != resource.RLIM_INFINITY and most < wanted:
        raise SystemExit(f"{count} robots take {wanted} open files, and the system allows {most}: see ulimit -n")
    resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


# ---- the process of the sender


def tell(way: str, robots: int, address: str, there: str) -> None:
    """Send the next order at each further line of the input; say then when that began (s, monotonic)."""
    said = [bytes.fromhex(each) for each in json.loads(sys.stdin.readline())]
    allow_sockets(robots)
    with ExitStack() as stack:
        if way == BROADCAST:
            mouth = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
        else:
            lines = [stack.enter_context(socket.create_connection((there, PORT), LONGEST)) for _ in range(robots)]
            for line in lines:
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        print("up", flush=True)
        for order in said:
            sys.stdin.readline()
            began = time.monotonic()
            if way == BROADCAST:
                for at in (0.0, *REPEATS):
                    time.sleep(max(0.0, began + at - time.monotonic()))
                    mouth.sendto(order, (GROUP, PORT))
            elif way == IN_TURN:
                for line in lines:
                    line.sendall(order)
                    answered(line)
            else:
                for line in lines:
                    line.sendall(order)
                for line in lines:
                    answered(line)
            time.sleep(AFTER)
            print(began, flush=True)


def answered(line: socket.socket) -> None:
    if line.recv(1) != b"!":
        raise SystemExit("a robot has gone without an answer")
