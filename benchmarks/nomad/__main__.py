"""Prints what asking a Nomad's server costs beside a bare echo, and whether many who ask keep it from real time.

    python -m benchmarks.nomad [--quick] [--json]

Servers are processes of their own on loopback. A round trip is `gs`, 4 bytes there and 200 back, on one connection with
one robot at real time; the echo gets and gives the same bytes. Both are asked in turns of short batches on the wall
clock, so a slow second hits both, and the ratio is the median of the ratios within each turn. Then every robot of a
larger world gets a client that asks as fast as it is answered; how fast simulated time went is read from the clock in
the replies.
"""

from __future__ import annotations

import argparse
import json
import selectors
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass

from benchmarks.children import ROOT
from benchmarks.nomad.serve import HOST, STATE
from benchmarks.report import Bar, described, machine, middle, number, table
from sleepcast.nomad.wire.encoding import HEADER, Layout, decode, encode_request

GS = encode_request(Layout.FOUR, 15)
CLOCK = -3
"""Where the clock stands among the words of a state."""
MOST_RATIO, REAL_TIME = 3.0, 0.98
"""A round trip against the echo; simulated seconds in a second, less what the ends of the measurement may lack."""
PATIENCE = 300.0
"""Seconds until a server that says nothing is given up: the first one may have kernels to compile."""


@dataclass(frozen=True)
class Effort:
    """How long to measure: turns of so many round trips; robots, and seconds for which each is asked."""

    turns: int
    trips: int
    robots: Sequence[int]
    seconds: float


FULL, QUICK = Effort(41, 500, (1, 7, 50), 10.0), Effort(3, 50, (5,), 0.5)


@dataclass(frozen=True)
class Trip:
    """A round trip: us on the wall clock; ratio: to the echo."""

    name: str
    us: float
    ratio: float


@dataclass(frozen=True)
class Crowd:
    """Many clients. asked: requests a second of all together; least, most: of one client; realtime: simulated
    seconds in a second."""

    robots: int
    asked: float
    least: float
    most: float
    realtime: float


@contextmanager
def server(*arguments: str) -> Iterator[int]:
    """The port of a server in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.nomad.serve", *arguments]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield int(process.stdout.readline())
        finally:
            assert process.stdin is not None
            process.stdin.close()
            process.wait(PATIENCE)


def connected(port: int, robot: int | None = None) -> socket.socket:
    """A connection, to this robot if it is one."""
    found = socket.create_connection((HOST, port), PATIENCE)
    found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    if robot is not None:
        found.sendall(encode_request(Layout.FOUR, 102, (robot, 1)))
        if not any(read(found, 8)[4:]):
            raise RuntimeError(f"robot {robot} is refused")
    return found


def read(source: socket.socket, size: int) -> bytes:
    """So many bytes."""
    data = source.recv(size)
    while len(data) < size:
        more = source.recv(size - len(data))
        if not more:
            raise RuntimeError("the server has hung up")
        data += more
    return data


def batch(source: socket.socket, trips: int) -> float:
    """Seconds of a round trip."""
    begin = time.perf_counter()
    for _ in range(trips):
        source.sendall(GS)
        read(source, len(STATE))
    return (time.perf_counter() - begin) / trips


def round_trips(effort: Effort) -> list[Trip]:
    """A round trip with both servers."""
    with ExitStack() as stack:
        echo = stack.enter_context(connected(stack.enter_context(server("echo"))))
        asked = stack.enter_context(connected(stack.enter_context(server("nserver", "1")), 1))
        times: list[tuple[float, float]] = []
        for turn in range(effort.turns + 1):
            pair = batch(echo, effort.trips), batch(asked, effort.trips)
            if turn:  # the first only warms up
                times.append(pair)
    bare, served = (middle([pair[which] for pair in times]) * 1e6 for which in (0, 1))
    return [
        Trip("bare asyncio echo of as many bytes", bare, 1.0),
        Trip("gs", served, middle([pair[1] / pair[0] for pair in times])),
    ]


def crowd(robots: int, seconds: float) -> Crowd:
    """A client for each robot, all asking as fast as they are answered."""
    with ExitStack() as stack:
        port = stack.enter_context(server("nserver", str(robots)))
        choose = stack.enter_context(selectors.DefaultSelector())
        clients = [stack.enter_context(connected(port, robot + 1)) for robot in range(robots)]
        begin = end = time.perf_counter()
        for place, client in enumerate(clients):
            choose.register(client, selectors.EVENT_READ, place)
            client.sendall(GS)
        asked, seen = [0] * robots, clock(clients[0])
        now = seen
        clients[0].sendall(GS)
        while end - begin < seconds or not all(asked):
            for key, _ in choose.select(1.0):
                client = clients[key.data]
                if key.data == 0:
                    end, now = time.perf_counter(), clock(client)
                else:
                    read(client, len(STATE))
                asked[key.data] += 1
                client.sendall(GS)
    rates = [count / (end - begin) for count in asked]
    return Crowd(robots, sum(rates), min(rates), max(rates), (now - seen) / (end - begin))


def clock(client: socket.socket) -> float:
    """Simulated seconds, as the state that comes says."""
    return decode(read(client, len(STATE))[HEADER.size :])[CLOCK] / 1000.0


def bars(trips: Sequence[Trip], crowds: Sequence[Crowd]) -> list[Bar]:
    largest = crowds[-1]
    return [
        Bar("a round trip for the state / a bare echo", trips[-1].ratio, MOST_RATIO, "x", at_least=False),
        Bar(f"real time with {largest.robots} clients that ask all the time", largest.realtime, REAL_TIME, "x"),
    ]


def show(trips: Sequence[Trip], crowds: Sequence[Crowd]) -> str:
    first = [[trip.name, number(trip.us), f"{trip.ratio:.2f}"] for trip in trips]
    rows = [
        [str(each.robots), *map(number, (each.asked, each.least, each.most)), f"{each.realtime:.3f}"] for each in crowds
    ]
    heads = ["robots, each with a client", "requests a second", "slowest client", "fastest", "x real time"]
    return "\n\n".join([table(["round trip", "us", "x echo"], first), table(heads, rows)])


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.nomad", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a few seconds, to see that it works")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    options = parser.parse_args()
    effort = QUICK if options.quick else FULL
    trips = round_trips(effort)
    crowds = [crowd(robots, effort.seconds) for robots in effort.robots]
    found = bars(trips, crowds)
    if options.json:
        rows = {"trips": [asdict(trip) for trip in trips], "crowds": [asdict(each) for each in crowds]}
        print(json.dumps({"machine": machine(), **rows, "bars": [bar.to_dict() for bar in found]}))
        return
    print(f"{described(machine())}\n\n{show(trips, crowds)}\n")
    print("\n".join(bar.text for bar in found))


if __name__ == "__main__":
    main()
