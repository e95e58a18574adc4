"""The Nomad's server: it listens, advances simulated time, and serves the clients in turn.

Everything runs in one loop and one thread: between ticks the sockets are served, a few requests of each client at a
time. Time goes at a pace on the wall; or in lockstep, where each tick comes as soon as every client waits for one, so
that runs with programs repeat and go as fast as the programs.
"""

from __future__ import annotations

import asyncio
import errno
import socket
from collections.abc import Callable, Mapping, Sequence
from ipaddress import ip_address
from math import inf

from sleepcast.core.clock import Clock, WallClock
from sleepcast.core.doorkeeper import QUEUE, TURNS, Doorkeeper, room, sentences_of, stop_listening
from sleepcast.core.errors import SleepcastError
from sleepcast.nomad.server.connection import PAGE, ManualClient, ServerConnection
from sleepcast.nomad.server.relay import RealAddress, Relay
from sleepcast.nomad.server.session import Service
from sleepcast.nomad.server.simulated_robot import SimulatedRobot
from sleepcast.nomad.server.windows import Windows
from sleepcast.nomad.wire.encoding import HEADER, ByteOrder, decode
from sleepcast.robot import Companion, SimulatedWorld

DEFAULT_PORT = 7019
"""Where programs of the Nomad's day look for the server."""
LOCAL_HOST = "127.0.0.1"
MAX_CLIENTS = 1000
"""Connections at once: many for each of many robots, and their buffers are less than 200 MB together."""
MAX_STRANGERS = 128
"""Of these, that have not asked anything yet."""
FIRST_WORD = 60.0
"""Seconds for a client to ask its first request: the C library does so as soon as it is connected."""
SWEEP = 1.0
"""Seconds between two looks for those that take longer."""
MAX_READ = 64 * 1024
"""Bytes that are read from a client at a time."""
SLICE = 0.004
"""Seconds for which ticks may run before clients are served; longer if serving them took longer, so that however many
they are, time gets its half."""
LONGEST_SLICE = 0.05
PATIENCE = 0.5
"""Seconds on the wall for which a client that does not ask holds up the others in lockstep."""
GLANCE = 0.05
"""Simulated seconds between two looks of the windows at the robots."""


class ServerError(SleepcastError):
    """The server cannot listen there."""


class Nserver:
    """The server of one world's robots.

    windows: what it shows.
    tk_order: byte order of the clients' machines, for their texts.
    may_quit: whether a client can end it.
    lockstep: see the module.
    headless: nobody can click at a window.
    real: the real robots, by the index of the simulated one in whose place a client can put them.
    say: tells the person at the terminal.
    """

    def __init__(
        self,
        world: SimulatedWorld,
        *,
        windows: Windows,
        tk_order: ByteOrder = "little",
        may_quit: bool = False,
        lockstep: bool = False,
        headless: bool = False,
        real: Mapping[int, RealAddress] | None = None,
        say: Callable[[str], None] = print,
        clock: Clock | None = None,
    ) -> None:
        robots = [SimulatedRobot(world, robot, windows.robots[robot]) for robot in range(world.count)]
        said = ThrottledLog(say, clock or WallClock())
        self.service = Service(world, windows, robots, said, tk_order, may_quit, lockstep, headless, dict(real or {}))
        self.world, self.windows, self.robots = world, windows, robots
        self.say: Callable[[str], None] = said
        self.room = memoryview(bytearray(MAX_READ))
        self.lines: set[ServerConnection] = set()
        self.companions: list[Companion] = []
        self.waiting: set[ServerConnection | ManualClient] = set()
        self._strangers = Doorkeeper(room(MAX_STRANGERS), FIRST_WORD, clock or WallClock(), said)
        self._hands: dict[int, ManualClient] = {}
        self._servers: list[asyncio.Server] = []
        self._news = asyncio.Event()
        self._glanced = world.time - GLANCE
        self._ticked = 0.0

    @property
    def port(self) -> int:
        """Where it listens, 0 before it does."""
        return self.service.port

    async def listen(self, hosts: Sequence[str], port: int) -> None:
        """Listen on these addresses, all on one port; 0 takes any that is free. Raises ServerError."""
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(sentences_of(self.service.say))
        try:
            for host in hosts:
                listener = _listener(host, self.port or port)
                address, self.service.port = listener.getsockname()[:2]
                if not ip_address(address).is_loopback:
                    self.service.say(f"whoever can reach {host} can drive these robots: their wire knows no passwords")
                self._servers.append(
                    await loop.create_server(
                        lambda: ServerConnection(self), sock=listener, backlog=room(MAX_STRANGERS) // TURNS
                    )
                )
                listener.listen(QUEUE)
        except ServerError:
            await self.close()
            raise

    async def run(self, pace: ServerPace) -> None:
        """Let time pass until a client that may has ended the server; however this ends, all connections are closed."""
        sweeping = asyncio.create_task(self._sweep())
        try:
            while not self.service.quitting:
                if self.service.lockstep:
                    await self._keep_step(pace)
                else:
                    await self._keep_pace(pace)
        finally:
            sweeping.cancel()
            await self.close()

    async def _sweep(self) -> None:
        while True:
            await asyncio.sleep(SWEEP)
            self._strangers.sweep()

    async def close(self) -> None:
        """Stop listening and hang up; real robots are stopped."""
        servers, self._servers = self._servers, []
        relays = self._hang_up()
        await stop_listening(servers)
        relays |= self._hang_up()  # on those who came in meanwhile
        for line in list(self.lines):
            line.abort()  # it does not read what it was sent
        for server in servers:
            await server.wait_closed()
        for relay in relays:
            await relay.gone()

    def _hang_up(self) -> set[Relay]:
        """Close all connections once they have got what was sent to them; gives the relays that stop real robots."""
        relays = set(self._relays())
        for relay in relays:
            relay.close()
        for line in list(self.lines):
            line.end()
        return relays

    def step(self) -> None:
        """Let one tick pass, and answer who waits for it."""
        for companion in self.companions:
            companion.before_tick()
        self.world.step()
        for simulated_robot in self.robots:
            simulated_robot.after_tick()
        for companion in self.companions:
            companion.after_tick()
        for line in list(self.waiting):
            line.look()
        if not self.service.headless and self.world.time - self._glanced >= GLANCE:
            self._glanced = self.world.time
            for simulated_robot in self.robots:
                simulated_robot.glance()

    # ---- for the page

    async def perform(self, robot: int, name: str, numbers: Sequence[int]) -> Sequence[int]:
        """Do what a client's request would do, until it is done: `name` as in the C library, such as vm, `numbers` as
        on the wire. Gives the words of its reply. Raises MisuseError for what is refused."""
        hand = self._hands.get(robot)
        if hand is None:
            hand = self._hands[robot] = ManualClient(self.service, robot)
        async with hand.turn:
            hand.ask(name, numbers)
            if hand.wait is not None:
                self.waiting.add(hand)
                self.news()
                try:
                    await hand.done()
                finally:
                    hand.wait = None
                    self.waiting.discard(hand)
            return decode(hand.reply[HEADER.size :])

    def click(self, robot: int, x: float, y: float) -> None:
        """A person clicked in this robot's window, at x, y in m: the client that waits for that gets it."""
        for each in list(self.waiting):
            if each.session.robot == robot:
                each.session.click(x, y)

    @property
    def held(self) -> bool:
        """Whether the page keeps all robots at rest."""
        return all(PAGE in simulated_robot.holders for simulated_robot in self.robots)

    def hold(self, still: bool, by: str = PAGE, robot: int | None = None) -> None:
        """Keep one robot (None: all) at rest from now on, whatever is asked, or no longer as far as `by` is concerned;
        real ones too."""
        for simulated_robot in self.robots if robot is None else [self.robots[robot]]:
            simulated_robot.hold(still, by)
        if still:
            for relay in self._relays(robot):
                relay.stop()
        elif by == PAGE:
            for companion in self.companions:
                companion.released()

    def _relays(self, robot: int | None = None) -> list[Relay]:
        sessions = [*(line.session for line in self.lines), *(hand.session for hand in self._hands.values())]
        return [each.relay for each in sessions if each.relay is not None and robot in (None, each.robot)]

    # ---- for the lines

    def admit(self, line: ServerConnection) -> bool:
        """Take a new connection; False if there are too many. One that has not asked anything yet only takes the place
        of others like it."""
        most = room(MAX_CLIENTS, 2)
        if len(self.lines) - len(self._strangers) >= most:
            self.service.say(f"{line.session.peer} is turned away: {most} clients are enough")
            return False
        self.lines.add(line)
        self._strangers.enter(line)
        return True

    def know(self, line: ServerConnection) -> None:
        """It has asked something."""
        self._strangers.leave(line)

    def news(self) -> None:
        """A client waits, or has gone."""
        self._news.set()

    # ---- time

    async def _keep_pace(self, pace: ServerPace) -> None:
        tick = self.world.tick
        for simulated_robot in self.robots:
            simulated_robot.speed = pace.speed
        loop = asyncio.get_running_loop()
        pace.look(tick)
        now = loop.time()
        until = now + max(SLICE, min(LONGEST_SLICE, now - self._ticked))
        while pace.due(tick) and not self.service.quitting:
            self.step()
            if loop.time() > until:
                break
        self._ticked = loop.time()
        await asyncio.sleep(pace.wait(tick))

    async def _keep_step(self, pace: ServerPace) -> None:
        """One tick, once every client waits for it, those apart that have not asked for a while; none while time is
        told to stand still."""
        if pace.speed <= 0.0:
            await asyncio.sleep(STANDSTILL)
            return
        loop = asyncio.get_running_loop()
        held = [line for line in self.lines if line.session.simulated and not (line.wait and line.wait.ticks)]
        patience = max((line.asked + PATIENCE - loop.time() for line in held), default=0.0)
        ready = any(line.wait is not None and line.wait.ticks for line in self.waiting)
        if ready and patience <= 0.0:
            self.step()
            await asyncio.sleep(0)
            return
        self._news.clear()
        try:
            async with asyncio.timeout(patience if ready else None):
                await self._news.wait()
        except TimeoutError:
            return


def named_addresses() -> list[str]:
    """What this machine's own name stands for: where programs that name no server look for one. Empty for a name that
    nobody knows."""
    try:
        addresses = socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET, socket.SOCK_STREAM)
    except (OSError, UnicodeError):  # the second for a name that can be none
        return []
    return sorted({str(address[0]) for *_, address in addresses})


def own_addresses() -> list[str]:
    """127.0.0.1, and the other loopback addresses that this machine's own name stands for."""
    return [LOCAL_HOST, *(host for host in named_addresses() if host.startswith("127.") and host != LOCAL_HOST)]


def unheard(places: Sequence[str]) -> str:
    """Why programs that name no server do not find one that listens in these places, "" if they do."""
    named = named_addresses()
    if "0.0.0.0" in places or any(host in places for host in named):
        return ""
    name = socket.gethostname()
    if not named:
        return f"programs that name no server look for {name}, this machine, which has no address: name {LOCAL_HOST}"
    return (
        f"programs that name no server look for {name}, this machine, at {named[0]}, and nobody listens there: name "
        f"{LOCAL_HOST} in them, or start this with --host {named[0]}"
    )


def listening_places(hosts: Sequence[str]) -> list[str]:
    """This machine's own addresses and these, each once. Where one of them stands for all of its kind (0.0.0.0, ::), no
    other of that kind is listed."""
    places = list(dict.fromkeys([*own_addresses(), *hosts]))
    for everywhere, version in (("0.0.0.0", 4), ("::", 6)):
        if everywhere in places:
            places = [place for place in places if place == everywhere or _version(place) != version]
    return places


def _version(host: str) -> int:
    """Of the internet protocol: a name's is the fourth."""
    return 6 if ":" in host else 4


def _listener(host: str, port: int) -> socket.socket:
    sixth = _version(host) == 6
    listener = socket.socket(socket.AF_INET6 if sixth else socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        if sixth:
            listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listener.bind((host, port))
        listener.listen(MAX_CLIENTS)
    except OSError as error:
        listener.close()
        raise ServerError(_why_not(host, port, error)) from None
    listener.setblocking(False)
    return listener


def _why_not(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return (
            f"port {port} of {host} is in use, perhaps by another nserver: stop that one, or take another with "
            f"--port {DEFAULT_PORT + 1} (--port 0 finds a free one)"
        )
    if error.errno == errno.EACCES:
        return f"port {port} needs more rights than you have: take one above 1023, such as --port {DEFAULT_PORT}"
    return f"cannot listen on {host} port {port}: {error.strerror or error}"


# What the server says to the person at the terminal, at a rate that a person can read.

BURST = 20
"""Lines at once,"""
RATE = 2.0
"""and lines a second on the whole. A client that floods the server cannot flood the terminal."""


class ThrottledLog:
    """Passes lines on to `say`, and counts those that are too many."""

    def __init__(self, say: Callable[[str], None], clock: Clock) -> None:
        self._say, self._clock = say, clock
        self._credit, self._looked = float(BURST), clock.now()
        self._left_out = 0

    def __call__(self, line: str) -> None:
        """Say this, if there is room for it."""
        now = self._clock.now()
        self._credit = min(BURST, self._credit + RATE * (now - self._looked))
        self._looked = now
        if self._credit < 1.0:
            self._left_out += 1
            return
        self._credit -= 1.0
        if self._left_out:
            self._say(f"... and {self._left_out} more lines that are left out")
            self._left_out = 0
        self._say(line)


# How fast simulated time goes against the clock on the wall.

LONGEST_DEBT = 0.25
"""Seconds on the wall that a server that could not keep up makes up for; what is older is let go."""

STANDSTILL = 0.05
"""Seconds on the wall after which it is looked again whether time goes on."""


class ServerPace:
    """speed: simulated seconds in a second of `clock`, 0 for none, infinite for as fast as possible; it may be changed.
    let_go: simulated seconds that were not made up for."""

    def __init__(self, clock: Clock, speed: float = 1.0) -> None:
        self.speed = speed
        self.let_go = 0.0
        self._clock = clock
        self._looked = clock.now()
        self._credit = 0.0

    def look(self, tick: float) -> None:
        """Count the time that has passed since the last look. tick: simulated s of one."""
        now = self._clock.now()
        passed, self._looked = now - self._looked, now
        if self.speed == inf:
            self._credit = 0.0
            return
        most = max(LONGEST_DEBT * self.speed, tick)
        self._credit += passed * self.speed
        if self._credit > most:
            self.let_go += self._credit - most
            self._credit = most

    def due(self, tick: float) -> bool:
        """Whether a tick is due; it is then taken as done."""
        if self.speed == inf:
            return True
        if self._credit < tick:
            return False
        self._credit -= tick
        return True

    def wait(self, tick: float) -> float:
        """Seconds on the wall to wait for the next tick, or until speed is to be looked at again."""
        if self.speed == inf or self._credit >= tick:
            return 0.0
        if self.speed <= 0.0:
            return STANDSTILL
        return min(STANDSTILL, (tick - self._credit) / self.speed)
