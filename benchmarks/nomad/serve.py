"""One server in a process of its own, for a client that measures it: `python -m benchmarks.nomad.serve WHAT [ROBOTS]`.

`echo` is the least that asyncio can do: whatever comes, it writes the bytes of a state reply. `nserver` is the server
with so many robots at real time, all of them driving in circles. Both say their port, and serve until standard input
ends.
"""

from __future__ import annotations

import asyncio
import sys

from sleepcast.core.clock import WallClock
from sleepcast.nomad import Nserver, ServerPace, Windows
from sleepcast.nomad.world.building import nomad_world
from sleepcast.robot import Axes

STATE = bytes.fromhex("00500031") + bytes(196)
"""As many bytes as the smallest reply with the state."""
HOST = "127.0.0.1"
WARM_TICKS = 5

LARGE = 16 * 1024 * 1024


class Echo(asyncio.Protocol):
    """Writes a reply for what has come, at once."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.transport.write(STATE)  # type: ignore[attr-defined]


async def echo() -> None:
    bytes(LARGE)  # frees so much that the C library keeps memory for asyncio's reads instead of asking for it each time
    server = await asyncio.get_running_loop().create_server(Echo, HOST, 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    await _until_input_ends()


async def nserver(robots: int) -> None:
    world = nomad_world(None, "ideal", robots, 1)
    for robot in range(robots):
        world.set_speeds(robot, Axes(0.1, 0.08))
    for _ in range(WARM_TICKS):
        world.step()
        world.observe(0)
    server = Nserver(world, windows=Windows(robots), say=lambda line: None)
    await server.listen([HOST], 0)
    print(server.port, flush=True)
    running = asyncio.create_task(server.run(ServerPace(WallClock())))
    await _until_input_ends()
    running.cancel()
    await asyncio.wait({running})


async def _until_input_ends() -> None:
    ended = asyncio.Event()
    asyncio.get_running_loop().add_reader(sys.stdin, ended.set)
    await ended.wait()


if __name__ == "__main__":
    asyncio.run(echo() if sys.argv[1] == "echo" else nserver(int(sys.argv[2])))
