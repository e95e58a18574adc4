"""The Nomads of a soak: their server, with a world that is advanced only as often as their minds look at it.

python -m benchmarks.soak.nomads ROBOTS
"""

from __future__ import annotations

import asyncio
import sys

from sleepcast.core.clock import WallClock
from sleepcast.nomad import Nserver, ServerPace, Windows
from sleepcast.nomad.world.building import nomad_world

TICK = 0.5
PORT = 7019


async def serve(count: int) -> None:
    world = nomad_world(None, "ideal", count, 1, tick=TICK, expedite=True)
    server = Nserver(world, windows=Windows(world.count), headless=True, say=lambda line: print(line, flush=True))
    await server.listen(["0.0.0.0"], PORT)
    print(f"port {PORT} is up", flush=True)
    await server.run(ServerPace(WallClock()))


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1])))
