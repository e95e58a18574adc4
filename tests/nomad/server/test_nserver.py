"""The server over real sockets: many clients, rude ones, time at a pace and in lockstep, and its end."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from math import inf
from random import Random

import pytest

from arriving import AGES, arriving, nothing_left_open, turns
from sleepcast.core.clock import WallClock
from sleepcast.core.errors import MisuseError
from sleepcast.nomad import Nserver, ServerError, ServerPace, Windows, own_addresses
from sleepcast.nomad.server import nserver as nomad_server
from sleepcast.nomad.server.connection import MAX_BUFFERED, TURN
from sleepcast.nomad.server.nserver import BURST, MAX_CLIENTS, MAX_READ, RATE
from sleepcast.nomad.wire.encoding import HEADER, MAX_WORDS, Layout, decode, encode_request
from sleepcast.nomad.wire.requests import RequestType
from sleepcast.nomad.world.building import nomad_world

LONGEST = 60.0
"""Seconds that a busy machine is given."""
GS = encode_request(Layout.FOUR, RequestType.GS)
STATE = 200


class Caller:
    """A client over a real socket."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    async def ask(self, kind: int, *words: int) -> tuple[int, tuple[int, ...]]:
        self.writer.write(encode_request(Layout.FOUR, kind, words))
        return await self.hear()

    async def hear(self) -> tuple[int, tuple[int, ...]]:
        async with asyncio.timeout(LONGEST):
            kind, size = HEADER.unpack(await self.reader.readexactly(4))
            return kind, decode(await self.reader.readexactly(4 * size))

    async def state(self, kind: int, *words: int) -> tuple[int, ...]:
        answered, found = await self.ask(kind, *words)
        assert (answered, len(found)) == (80, 49)
        return found

    async def close(self) -> None:
        self.writer.close()
        await asyncio.wait({asyncio.ensure_future(self.writer.wait_closed())})


class Served:
    """A server that runs. said: what it told the person at its terminal."""

    def __init__(self, robots: int, speed: float, options: dict[str, object]) -> None:
        self.said: list[str] = []
        self.world = nomad_world(None, "ideal", robots, 1)
        self.nserver = Nserver(self.world, windows=Windows(robots), say=self.said.append, **options)  # type: ignore[arg-type]
        self.pace = ServerPace(WallClock(), speed)
        self.callers: list[Caller] = []

    async def bare(self) -> Caller:
        """A client that has not yet asked for a robot."""
        found = Caller(*await asyncio.open_connection("127.0.0.1", self.nserver.port))
        self.callers.append(found)
        return found

    async def caller(self, robot: int = 1) -> Caller:
        found = await self.bare()
        assert await found.ask(102, robot, 4711) == (102, (self.nserver.port,))
        return found


@asynccontextmanager
async def served(robots: int = 1, speed: float = 1.0, **options: object) -> AsyncIterator[Served]:
    made = Served(robots, speed, options)
    await made.nserver.listen(["127.0.0.1"], 0)
    running = asyncio.create_task(made.nserver.run(made.pace))
    try:
        yield made
    finally:
        for caller in made.callers:
            await caller.close()
        running.cancel()
        await asyncio.wait({running})
        await made.nserver.close()
        if not running.cancelled():
            running.result()


def play(scene: Callable[[], Coroutine[None, None, None]]) -> None:
    """Run a test, with an error for what went wrong unseen in the loop."""
    wrong: list[dict[str, object]] = []

    async def watched() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: wrong.append(context))
        async with asyncio.timeout(3 * LONGEST):
            await scene()

    asyncio.run(watched())
    assert not wrong


async def eventually(holds: Callable[[], bool]) -> None:
    async with asyncio.timeout(LONGEST):
        while not holds():
            await asyncio.sleep(0.01)


# ---- clients


@pytest.mark.parametrize("aborted", [False, True])
def test_a_program_that_is_gone_without_a_word_leaves_its_robots_at_rest(aborted: bool) -> None:
    async def scene() -> None:
        async with served(3) as made:
            dying, other = await made.caller(1), await made.caller(3)
            await other.state(RequestType.VM, 30, 30, 0)
            await dying.state(RequestType.VM, 50, 50, 0)
            await dying.ask(102, 2, 4711)  # it drives two
            await dying.state(RequestType.VM, 50, 50, 0)
            for robot in range(3):
                await eventually(lambda robot=robot: made.world.observe(robot).speeds.first > 0.05)  # type: ignore[misc]
            dying.writer.transport.abort() if aborted else dying.writer.close()
            for robot in (0, 1):
                await eventually(lambda robot=robot: made.world.observe(robot).speeds.first == 0.0)  # type: ignore[misc]
                assert made.nserver.windows.robots[robot].commands[-2][1] == "stopped: its program is gone"
            assert made.world.observe(2).speeds.first > 0.05
            for robot in (1, 2):
                assert any(f"gone without disconnect_robot: robot {robot} is stopped" in line for line in made.said)

    play(scene)


def test_a_program_that_only_looks_on_stops_nothing_when_it_goes() -> None:
    async def scene() -> None:
        async with served() as made:
            driving, looking = await made.caller(), await made.caller()
            await looking.state(RequestType.PR, 1, 1, 0)  # it did drive once
            await driving.state(RequestType.VM, 50, 50, 0)
            await looking.state(RequestType.GS)
            await looking.close()
            await eventually(lambda: len(made.nserver.lines) == 1)
            await eventually(lambda: made.world.observe(0).speeds.first > 0.1)
            driving.writer.write(encode_request(Layout.FOUR, RequestType.DISCONNECT_ROBOT, (1, 4711)))
            await driving.close()
            await eventually(lambda: not made.nserver.lines)
            assert made.world.observe(0).speeds.first > 0.1  # it was let go as it was told, and goes on

    play(scene)


def test_a_new_program_begins_without_the_timeout_of_the_one_before() -> None:
    async def scene() -> None:
        async with served(speed=20.0) as made:
            first = await made.caller()
            await first.state(RequestType.CONF_TM, 1)
            second = await made.caller()  # while the first is there its timeout holds
            await second.state(RequestType.VM, 10, 10, 0)
            commands = made.nserver.windows.robots[0].commands
            await eventually(lambda: commands[-1][1] == "stopped: nothing came in time")
            await eventually(lambda: made.world.observe(0).speeds.first == 0.0)
            await first.close()
            await eventually(lambda: len(made.nserver.lines) == 1)  # and the second goes on looking
            third = await made.caller()
            await third.state(RequestType.VM, 10, -10, 0)
            began = made.world.time
            await eventually(lambda: made.world.time > began + 5.0)
            assert made.world.observe(0).speeds.first > 0.0

    play(scene)


def test_two_programs_that_drive_one_robot_are_told_of_once() -> None:
    async def scene() -> None:
        async with served(speed=0.0) as made:  # nobody is forgotten meanwhile
            one, two = await made.caller(), await made.caller()
            window, simulated_robot = made.nserver.windows.robots[0], made.nserver.service.simulated_robots[0]
            await one.state(RequestType.VM, 10, 10, 0)
            await two.state(RequestType.GS)
            simulated_robot.glance()
            assert window.rivals == ""
            for _ in range(3):
                await two.state(RequestType.VM, 10, -10, 0)
                await one.state(RequestType.VM, 10, 10, 0)
            simulated_robot.glance()
            names = window.client.split(", ")
            assert window.rivals == " and ".join(sorted(names))
            said = [line for line in made.said if "driven by" in line]
            assert said == [f"robot 1 is driven by {window.rivals}: each replaces what the other asks"]
            made.pace.speed = 20.0
            await eventually(lambda: window.rivals == "")  # the windows look again now and then

    play(scene)


def test_a_robot_drives_waits_and_stops() -> None:
    async def scene() -> None:
        async with served(1, inf) as made:
            client = await made.caller()
            await client.state(RequestType.CT, *(0xFF,) * 5, 0x0E, 0)
            await client.state(RequestType.PR, 500, 500, 0)
            state = await client.state(RequestType.WS, 1, 1, 0, 20)
            assert state[34] == pytest.approx(500, abs=1)
            assert (await client.state(RequestType.ZR))[34:38] == (0, 0, 0, 0)

    play(scene)


def test_bytes_that_come_one_by_one_and_requests_that_come_all_at_once() -> None:
    async def scene() -> None:
        async with served() as made:
            client = await made.caller()
            for byte in encode_request(Layout.FOUR, RequestType.DP, (100, -100)):
                client.writer.write(bytes((byte,)))
                await client.writer.drain()
                await asyncio.sleep(0)
            assert (await client.hear())[1][34:36] == (100, -100)
            client.writer.write(b"".join(encode_request(Layout.FOUR, RequestType.DP, (turn, 0)) for turn in range(100)))
            assert [(await client.hear())[1][34] for _ in range(100)] == list(range(100))

    play(scene)


def test_robots_have_clients_of_their_own_and_share_them() -> None:
    async def scene() -> None:
        async with served(2) as made:
            one, two, other = await made.caller(1), await made.caller(1), await made.caller(2)
            await one.state(RequestType.DP, 100, 0)
            assert (await two.state(RequestType.GS))[34] == 100
            assert (await other.state(RequestType.GS))[34] != 100
            assert made.nserver.windows.robots[0].client.count("process 4711") == 2
            await one.close()
            await eventually(lambda: made.nserver.windows.robots[0].client.count("process") == 1)
            assert len(made.nserver.lines) == 2

    play(scene)


def test_a_32_bit_client_that_wants_robot_0_is_refused_after_a_moment() -> None:
    async def scene() -> None:
        async with served() as made:
            client = await made.bare()
            assert await client.ask(102, 0, 4711) == (102, (0,))
            assert (await client.ask(102, 1, 4711))[1][0] == made.nserver.port

    play(scene)


# ---- rude clients


def test_a_flood_of_commands_keeps_nobody_waiting() -> None:
    async def scene() -> None:
        async with served(2) as made:
            flood, calm = await made.caller(1), await made.caller(2)

            answered = 0

            async def hurry() -> None:
                nonlocal answered
                while True:
                    await flood.state(RequestType.ST)
                    answered += 1

            hurried = asyncio.create_task(hurry())
            began, wall = made.world.time, time.monotonic()
            waits = []
            for _ in range(50):
                before = answered
                await calm.state(RequestType.GS)
                waits.append(answered - before)
                await asyncio.sleep(0.005)
            assert answered > 50
            assert sorted(waits)[25] <= TURN

            def in_time() -> bool:
                passed = made.world.time - began + made.pace.let_go
                return passed == pytest.approx(time.monotonic() - wall, abs=0.3)

            await eventually(in_time)
            hurried.cancel()

    play(scene)


def test_who_never_reads_is_not_read_from_and_the_others_do_not_feel_it() -> None:
    async def scene() -> None:
        async with served(2) as made:
            deaf, other = await made.caller(1), await made.caller(2)
            (line,) = (each for each in made.nserver.lines if each.session.robot == 0)
            raw = deaf.writer.get_extra_info("socket")
            deaf.writer.transport.pause_reading()  # type: ignore[attr-defined]
            sent = 0
            flood = GS * 10_000
            idle = time.monotonic()
            with socket.fromfd(raw.fileno(), raw.family, raw.type) as bare:
                bare.setblocking(False)
                enough = 10 * MAX_BUFFERED / 4
                while time.monotonic() - idle < (0.3 if sent > enough else LONGEST):
                    try:
                        sent += bare.send(flood)
                        idle = time.monotonic()
                    except BlockingIOError:
                        await asyncio.sleep(0.01)
                    assert line.kept <= 2 * MAX_BUFFERED + MAX_READ + STATE
                    await other.state(RequestType.GS)
            assert sent > enough  # it took what it could answer, and then no more
            assert await other.state(RequestType.GS)

    play(scene)


def test_half_messages_and_long_ones_are_borne() -> None:
    async def scene() -> None:
        async with served() as made:
            client, other = await made.caller(), await made.caller()
            (line,) = (each for each in made.nserver.lines if each.session.peer.endswith(str(_port(client))))
            client.writer.write(HEADER.pack(RequestType.TK, -1 & 0x7FFF) + bytes(4 * 10_000))
            await other.state(RequestType.GS)
            client.writer.write(bytes(4 * (0x7FFF - 10_000)))
            assert await client.hear() == (91, (4,))
            assert line.kept < 4 * MAX_WORDS
            assert f"tk takes 1 to {MAX_WORDS} words, not 32767" in made.said[-1]
            client.writer.write(encode_request(Layout.FOUR, RequestType.VM, (1, 2, 3))[:-1])
            assert await other.state(RequestType.GS)
            await client.close()
            await eventually(lambda: len(made.nserver.lines) == 1)
            assert (await other.state(RequestType.GS))[38] == 0  # half a command is none

    play(scene)


def test_noise_is_answered_with_errors_and_few_words_at_the_terminal() -> None:
    async def scene() -> None:
        async with served() as made:
            began, client = time.monotonic(), await made.caller()
            for number in range(200):
                assert await client.ask(1000 + number) == (91, (4,))
            told = [line for line in made.said if not line.startswith("...")]
            assert 10 < len(told) <= BURST + RATE * (time.monotonic() - began) + 1
            assert await client.state(RequestType.GS)

    play(scene)


def test_junk_from_many_is_borne() -> None:
    async def scene() -> None:
        chance, began = Random(1), time.monotonic()
        async with served(2) as made:
            other = await made.caller(2)
            for _ in range(40):
                client = await (made.caller() if chance.random() < 0.5 else made.bare())
                client.writer.write(chance.randbytes(chance.randrange(1, 5000)))
                assert await other.state(RequestType.GS)
                if chance.random() < 0.5:
                    client.writer.transport.abort()
            told = [line for line in made.said if not line.startswith("...")]
            assert len(told) <= BURST + RATE * (time.monotonic() - began) + 1

    play(scene)


def test_clients_that_vanish_leave_nothing_behind() -> None:
    async def scene() -> None:
        async with served(1, headless=False) as made:
            for kind, words in (
                (RequestType.ZR, ()),
                (RequestType.WS, (1, 1, 1, 255)),
                (RequestType.GET_ROBOT_CONF, ()),
            ):
                client = await made.caller()
                made.pace.speed = 1.0
                await client.state(RequestType.VM, 20, -20, 0)
                await eventually(lambda: made.world.observe(0).speeds.first > 0.0)
                made.pace.speed = 0.0  # so that nothing that takes time is ever done
                client.writer.write(encode_request(Layout.FOUR, kind, words))
                await eventually(lambda: len(made.nserver.waiting) == 1)
                client.writer.transport.abort()
                await eventually(lambda: not made.nserver.waiting and not made.nserver.lines)
            window = made.nserver.windows.robots[0]
            assert (window.client, window.waiting) == ("", 0)

    play(scene)


def test_who_says_nothing_takes_the_place_of_nobody_who_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many connect: who has asked goes on, who asks now is heard, and the silent ones are closed in time."""
    monkeypatch.setattr("sleepcast.nomad.server.nserver.MAX_STRANGERS", 16)
    monkeypatch.setattr("sleepcast.nomad.server.nserver.SWEEP", 0.05)

    async def scene() -> None:
        async with served() as made:
            one = await made.caller()
            silent = [await made.bare() for _ in range(200)]
            assert await one.state(RequestType.GS)
            assert await (await made.caller()).state(RequestType.GS)
            await eventually(lambda: len(made.nserver.lines) <= 2 + 16)
            assert sum("many connections" in line for line in made.said) == 1
            monkeypatch.setattr(made.nserver._strangers, "_patience", 0.0)
            await eventually(lambda: len(made.nserver.lines) == 2)
            assert [await each.reader.read() for each in silent] == [b""] * 200
            assert await one.state(RequestType.GS)

    play(scene)


def test_more_clients_than_there_is_room_for_are_turned_away(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MAX_CLIENTS * (2 * MAX_BUFFERED + MAX_READ) < 256 * 1024**2
    monkeypatch.setattr("sleepcast.nomad.server.nserver.MAX_CLIENTS", 2)

    async def scene() -> None:
        async with served() as made:
            one, _ = await made.caller(), await made.caller()
            late = await made.bare()
            assert await late.reader.read() == b""
            assert await one.state(RequestType.GS)
            await one.close()
            await eventually(lambda: len(made.nserver.lines) == 1)
            assert await (await made.caller()).state(RequestType.GS)

    play(scene)


# ---- time


def test_time_goes_as_fast_as_it_is_told_to_and_stands_still() -> None:
    async def scene() -> None:
        async with served(1, 0.0) as made:
            client = await made.caller()
            await client.state(RequestType.GS)
            await asyncio.sleep(0.1)
            assert made.world.time == 0.0
            made.pace.speed = 20.0
            await eventually(lambda: made.world.time >= 2.0)
            assert (await client.state(RequestType.GS))[0] == 200

    play(scene)


def test_in_lockstep_each_tick_comes_when_everybody_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nomad_server, "PATIENCE", LONGEST)  # a busy machine may take long to ask

    async def run() -> list[tuple[int, ...]]:
        async with served(2, lockstep=True) as made:
            one, two = await made.caller(1), await made.caller(2)
            found = []
            for turn in range(30):
                states = await asyncio.gather(one.state(RequestType.VM, 50, turn, 0), two.state(RequestType.GS))
                assert [state[46] for state in states] == [20 * (turn + 1)] * 2
                found += states

            async def travel() -> tuple[int, ...]:
                await one.state(RequestType.PR, 100, 100, 0)
                state = await one.state(RequestType.WS, 1, 1, 0, 0)
                await one.close()
                return state

            async def look() -> list[tuple[int, ...]]:
                return [await two.state(RequestType.GS) for _ in range(150)]

            last, seen = await asyncio.gather(travel(), look())
            assert last[34] == pytest.approx(130, abs=15)
            return [*found, last, *seen]

    assert asyncio.run(run()) == asyncio.run(run())


def test_in_lockstep_nobody_waits_for_long_for_who_does_not_ask() -> None:
    async def scene() -> None:
        async with served(2, lockstep=True) as made:
            began = time.monotonic()
            idle, busy = await made.caller(1), await made.caller(2)
            for _ in range(20):
                await busy.state(RequestType.GS)
            assert nomad_server.PATIENCE <= time.monotonic() - began < LONGEST
            assert made.world.time == pytest.approx(0.4)
            await asyncio.sleep(0.05)
            assert made.world.time == pytest.approx(0.4)  # nobody asks, and time stands still
            made.pace.speed = 0.0
            asked = asyncio.create_task(busy.state(RequestType.GS))
            await asyncio.sleep(0.1)
            assert not asked.done()
            made.pace.speed = 1.0
            assert await asked
            assert (await idle.ask(102, 1, 4711))[1][0]
            await busy.close()
            assert await idle.state(RequestType.GS)

    play(scene)


# ---- the page's side


def test_the_page_asks_as_a_client_does() -> None:
    async def scene() -> None:
        async with served(2, inf) as made:
            await made.nserver.perform(1, "dp", [100, 200])
            await made.nserver.perform(1, "pr", [50, 50, 0])
            await made.nserver.perform(1, "ws", [1, 1, 0, 0])
            assert made.world.observe(1).believed[:2] == pytest.approx((150 * 0.00254, 200 * 0.00254), abs=0.003)
            await asyncio.gather(made.nserver.perform(0, "zr", []), made.nserver.perform(0, "add_obstacle", SQUARE))
            for name, numbers, said in (
                ("vm", [1, 2], "vm takes 3 words, not 2"),
                ("wm", [1, 2, 3], "there is no request 'wm'"),
                ("connect_robot", [1, 2], "there is no request"),
                ("vm", [1, 2, 2**40], "fit into 32 bits"),
                ("quit_server", [], "not permitted"),
                ("real_robot", [], "there is no real robot in place of robot 1"),
                ("delete_obstacle", [3, 0, 0, 1, 0, 1, 1], "the polygon is not there"),
            ):
                with pytest.raises(MisuseError, match=said):
                    await made.nserver.perform(0, name, numbers)

    play(scene)


SQUARE = [4, 500, 500, 900, 500, 900, 900, 500, 900]


def test_stop_holds_every_robot_whatever_is_asked() -> None:
    async def scene() -> None:
        async with served(2, inf) as made:
            client = await made.caller()
            await client.state(RequestType.VM, 50, -50, 0)
            await eventually(lambda: made.world.observe(0).speeds.first > 0.0)
            made.nserver.hold(True)
            assert made.nserver.held
            for kind, words in (
                (RequestType.VM, (50, 50, 0)),
                (RequestType.PR, (50, 50, 0)),
                (RequestType.MV, (1, 9, 1, 9, 0, 0)),
                (RequestType.ZR, ()),
            ):
                await client.state(kind, *words)
            await eventually(lambda: made.world.observe(0).speeds.first == 0.0)
            here = made.world.observe(0).real
            later = made.world.time + 1.0
            await eventually(lambda: made.world.time > later)
            assert made.world.observe(0).real == here
            made.nserver.hold(False)
            await client.state(RequestType.VM, 50, -50, 0)
            await eventually(lambda: made.world.observe(0).speeds.first > 0.0)

    play(scene)


def test_a_click_answers_who_waits_at_that_window() -> None:
    async def scene() -> None:
        async with served(2) as made:
            one, other = await made.caller(1), await made.caller(2)
            one.writer.write(encode_request(Layout.FOUR, RequestType.GET_ROBOT_CONF))
            other.writer.write(encode_request(Layout.FOUR, RequestType.GET_ROBOT_CONF))
            await eventually(lambda: len(made.nserver.waiting) == 2)
            made.nserver.click(0, 0.254, 0.508)
            assert await one.hear() == (200, (100, 200, 0, 0))
            assert len(made.nserver.waiting) == 1

    play(scene)


# ---- the beginning and the end


def test_a_client_that_may_ends_the_server() -> None:
    async def scene() -> None:
        made = Served(1, 1.0, {"may_quit": True})
        await made.nserver.listen(own_addresses(), 0)
        running = asyncio.create_task(made.nserver.run(made.pace))
        client = await made.caller()
        assert await client.ask(RequestType.QUIT_SERVER) == (82, ())
        assert await client.reader.read() == b""
        async with asyncio.timeout(LONGEST):
            await running
        with pytest.raises(ConnectionRefusedError):
            await made.bare()
        await client.close()

    play(scene)


@pytest.mark.parametrize("age", AGES)
def test_whoever_arrives_as_the_server_ends_is_hung_up_on(age: int) -> None:
    async def scene() -> None:
        async with served() as made:
            with arriving(made.nserver.port) as client:
                await turns(age)
                await made.nserver.close()
                with suppress(ConnectionResetError):
                    async with asyncio.timeout(LONGEST):
                        assert await asyncio.get_running_loop().sock_recv(client, 1) == b""
            assert not made.nserver.lines

    with nothing_left_open():
        play(scene)


def test_who_never_reads_does_not_hold_up_the_end() -> None:
    async def scene() -> None:
        async with served() as made:
            deaf = await made.caller()
            deaf.writer.transport.pause_reading()  # type: ignore[attr-defined]
            (line,) = made.nserver.lines
            deaf.writer.write(GS * 100_000)
            await eventually(lambda: line.kept > MAX_BUFFERED)
            async with asyncio.timeout(LONGEST):
                await made.nserver.close()
            await eventually(lambda: not made.nserver.lines)

    with nothing_left_open():
        play(scene)


def test_a_port_that_is_taken_is_named() -> None:
    async def scene() -> None:
        async with served() as made:
            other = Nserver(made.world, windows=Windows(1))
            with pytest.raises(ServerError, match=f"port {made.nserver.port} of 127.0.0.1 is in use"):
                await other.listen(["127.0.0.1"], made.nserver.port)
            with pytest.raises(ServerError, match=r"cannot listen on 192\.0\.2\.1"):
                await other.listen(["192.0.2.1"], 0)
            with pytest.raises(ServerError, match="cannot listen on no host"):
                await other.listen(["no host"], 0)

    play(scene)


def _port(caller: Caller) -> int:
    port: int = caller.writer.get_extra_info("sockname")[1]
    return port
