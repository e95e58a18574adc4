"""A server in a thread of its own, for clients that wait."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from threading import Event, Thread

from sleepcast.core.clock import WallClock
from sleepcast.nomad import Nserver, ServerPace, Windows
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.nomad_world import NomadWorld
from sleepcast.robot import SimulatedWorld
from sleepcast.simulator.engine import NumPyMachine

LONGEST = 60.0
"""Seconds that a busy machine is given."""
TICK = 0.1
"""Seconds in a tick of these worlds."""


def empty_room(setup: str = "ideal") -> NomadWorld:
    """One robot in an empty room, with nothing to compile."""
    return nomad_world(None, setup, 1, 1, tick=TICK, machine=NumPyMachine())


class Served:
    """A running server. said: what it told the person at its terminal."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self._up = Event()
        self._nserver: Nserver | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def nserver(self) -> Nserver:
        assert self._nserver is not None
        return self._nserver

    @property
    def port(self) -> int:
        return self.nserver.port

    async def run(self, world: SimulatedWorld, speed: float, port: int, options: dict[str, bool]) -> None:
        self._nserver = Nserver(world, windows=Windows(world.count), say=self.said.append, **options)
        self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
        try:
            await self._nserver.listen(["127.0.0.1"], port)
        finally:
            self._up.set()
        await self._nserver.run(ServerPace(WallClock(), speed))

    def await_up(self) -> None:
        assert self._up.wait(LONGEST)

    def call(self, do: Callable[..., object], *arguments: object) -> None:
        """Do something in the server's own thread."""
        assert self._loop is not None
        self._loop.call_soon_threadsafe(do, *arguments)

    def end(self) -> None:
        if self._task is not None and not self._task.done():
            self.call(self._task.cancel)


@contextmanager
def serving(world: SimulatedWorld, *, speed: float = inf, port: int = 0, **options: bool) -> Iterator[Served]:
    """A server of `world` with the `options` of `Nserver`, as many times as fast as real time, at any port or this."""
    served = Served()

    def run() -> None:
        try:
            asyncio.run(served.run(world, speed, port, options))
        except asyncio.CancelledError:
            return

    thread = Thread(target=run)
    thread.start()
    try:
        served.await_up()
        yield served
    finally:
        served.end()
        thread.join(LONGEST)
