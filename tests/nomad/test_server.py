"""The server over real sockets, on any world."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from math import inf

from nomad.flatland import Flatland
from sleepcast.clock import WallClock
from sleepcast.nomad import Nserver, Pace, Windows
from sleepcast.nomad.requests import Kind
from sleepcast.nomad.wire import Layout, encode_request

LONGEST = 20.0
HEADER = struct.Struct(">hH")


class Caller:
    """A client over a real socket, which asks and reads."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    async def ask(self, kind: int, *words: int) -> tuple[int, tuple[int, ...]]:
        self.writer.write(encode_request(Layout.FOUR, kind, words))
        async with asyncio.timeout(LONGEST):
            head = HEADER.unpack(await self.reader.readexactly(4))
            return head[0], struct.unpack(f">{head[1]}i", await self.reader.readexactly(4 * head[1]))

    async def state(self, kind: int, *words: int) -> Sequence[int]:
        answered, found = await self.ask(kind, *words)
        assert (answered, len(found)) == (80, 49)
        return found


@asynccontextmanager
async def served(world: Flatland, **options: bool) -> AsyncIterator[Nserver]:
    nserver = Nserver(world, windows=Windows(world.count), say=lambda line: None, **options)
    await nserver.listen(["127.0.0.1"], 0)
    running = asyncio.create_task(nserver.run(Pace(WallClock(), inf)))
    try:
        yield nserver
    finally:
        running.cancel()
        await asyncio.wait({running})


@asynccontextmanager
async def caller(nserver: Nserver, robot: int = 1) -> AsyncIterator[Caller]:
    client = Caller(*await asyncio.open_connection("127.0.0.1", nserver.port))
    try:
        assert await client.ask(102, robot, 4711) == (102, (nserver.port,))
        yield client
    finally:
        client.writer.close()
        await client.writer.wait_closed()


def test_a_robot_drives_and_stops() -> None:
    async def play() -> None:
        async with served(Flatland()) as nserver, caller(nserver) as client:
            await client.state(Kind.CT, *(0xFF,) * 5, 0x0E, 0)
            await client.state(Kind.SP, 3000, 3000, 0)
            await client.state(Kind.PR, 1000, 1000, 0)
            state = await client.state(Kind.WS, 1, 1, 0, 20)
            assert state[34:37] == (1000, 0, 0)
            state = await client.state(Kind.ZR)
            assert state[34:38] == (0, 0, 0, 0)
            assert await client.ask(Kind.PLACE_ROBOT, -100, -200, 900, 0) == (82, ())
            assert (await client.state(Kind.GS))[34:38] == (-100, -200, 900, 900)

    asyncio.run(play())


def test_lockstep() -> None:
    async def play() -> list[int]:
        world = Flatland()
        async with served(world, lockstep=True) as nserver, caller(nserver, 1) as one, caller(nserver, 2) as two:
            found = []
            for _ in range(50):
                states = await asyncio.gather(one.state(Kind.VM, 100, 100, 0), two.state(Kind.GS))
                found += [states[0][34], states[0][46]]
            assert world.steps == 50
            return found

    assert asyncio.run(play()) == asyncio.run(play())
