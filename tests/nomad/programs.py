"""Programs against a server without sockets and without a clock: bytes in, bytes out, and time that is let pass."""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.nomad import Nserver, Windows
from sleepcast.nomad.server.answers import answer
from sleepcast.nomad.server.session import ClientSession, Wait
from sleepcast.nomad.wire.encoding import HEADER, Layout, Parser, decode, encode_request
from sleepcast.nomad.world.building import nomad_world
from sleepcast.robot import SimulatedWorld

PORT = 7771
EVERYTHING = (0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x0E, 0x00)
MOST_TICKS = 5000


class Bench:
    """A server with its robots, where nobody listens."""

    def __init__(self, world: SimulatedWorld, **options: object) -> None:
        self.said: list[str] = []
        self.world, self.windows = world, Windows(world.count)
        self.nserver = Nserver(world, windows=self.windows, say=self.said.append, **options)  # type: ignore[arg-type]
        self.nserver.service.port = PORT

    def program(self, robot: int | None = 1, layout: Layout = Layout.FOUR) -> Program:
        """A program, connected to that robot."""
        return Program(self, robot, layout)


def bench(robots: int = 1, setup: str = "ideal", **options: object) -> Bench:
    """A server of robots in an empty room."""
    return Bench(nomad_world(None, setup, robots, 1), **options)


class Program:
    """One client. wait: the reply that is still to come."""

    def __init__(self, bench: Bench, robot: int | None, layout: Layout) -> None:
        self.bench, self.layout = bench, layout
        self.parser = Parser()
        self.session = ClientSession(bench.nserver.service, "test", self.parser, lambda: None)
        self.wait: Wait | None = None
        if robot is not None:
            assert self.ask(102, robot, 4711) == (102, (PORT,))

    def send(self, data: bytes) -> bytes | None:
        """What comes at once of these bytes, one request or a part of it."""
        self.parser.feed(data)
        request = self.parser.next()
        found = None if request is None else answer(self.session, request)
        if isinstance(found, Wait):
            self.wait = found
            return None
        return found

    def exchange(self, data: bytes) -> bytes:
        """The reply to these bytes, with as much time as it takes."""
        reply = self.send(data)
        for _ in range(MOST_TICKS):
            if reply is not None:
                return reply
            self.bench.nserver.step()
            assert self.wait is not None
            reply = self.wait.ready()
        raise AssertionError("no reply")

    def ask(self, kind: int, *words: int) -> tuple[int, Sequence[int]]:
        """Type and words of the reply."""
        reply = self.exchange(encode_request(self.layout, kind, words))
        answered, size = HEADER.unpack_from(reply)
        numbers = decode(reply[HEADER.size :])
        numbers = numbers if self.layout is Layout.FOUR else numbers[::2]
        assert len(numbers) == size
        return answered, numbers

    def state(self, kind: int, *words: int) -> Sequence[int]:
        """The words of a reply with the state."""
        answered, numbers = self.ask(kind, *words)
        assert answered == 80
        return numbers
