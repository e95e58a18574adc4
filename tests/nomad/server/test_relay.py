"""A real robot in place of a simulated one: behind another server, which here simulates it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from nomad.server.test_nserver import Caller, Served, eventually, play, served
from sleepcast.core.errors import MisuseError
from sleepcast.nomad import RealAddress, real_robot
from sleepcast.nomad.server.relay import REAL_TIMEOUT
from sleepcast.nomad.wire.encoding import Layout, encode_request
from sleepcast.nomad.wire.requests import RequestType


@asynccontextmanager
async def pair(number: int = 2) -> AsyncIterator[tuple[Served, Served, Caller]]:
    """Ours, theirs with two robots, and a client of ours; its real robot is theirs of this number."""
    async with served(2) as theirs:
        robot = RealAddress("127.0.0.1", theirs.nserver.port, number)
        async with served(1, real={0: robot}) as ours:
            yield ours, theirs, await ours.caller()


def test_what_is_asked_goes_to_the_real_robot_until_the_simulated_one_is_wanted() -> None:
    async def scene() -> None:
        async with pair() as (ours, theirs, client):
            await client.state(RequestType.CT, *(255,) * 5, 14, 0)
            assert await client.ask(RequestType.REAL_ROBOT) == (82, ())
            assert (await client.state(RequestType.DP, 777, -5))[34:36] == (777, -5)
            await client.state(RequestType.VM, 50, -50, 0)
            await eventually(lambda: theirs.world.observe(1).speeds.first > 0.1)
            assert ours.world.observe(0).speeds.first == 0.0
            assert "process" in theirs.nserver.windows.robots[1].client
            assert (await client.ask(RequestType.GET_RC))[1][:2] == (777, -5)
            assert await client.ask(RequestType.DRAW_LINE, 0, 0, 1, 1, 1) == (82, ())  # the windows stay ours
            assert (len(ours.nserver.windows.sketches), len(theirs.nserver.windows.sketches)) == (1, 0)
            assert (await client.ask(77))[0] == 91
            assert await client.ask(RequestType.SIMULATED_ROBOT) == (82, ())
            assert (await client.state(RequestType.GS))[34] == 0
            await eventually(lambda: theirs.world.observe(1).speeds.first == 0.0)  # who lets it go stops it
            await eventually(lambda: theirs.nserver.windows.robots[1].client == "")

    play(scene)


def test_a_real_robot_stops_by_itself_even_if_its_program_never_wanted_that() -> None:
    async def scene() -> None:
        async with pair() as (_, theirs, client):
            real = theirs.nserver.service.simulated_robots[1]
            await client.ask(RequestType.REAL_ROBOT)
            await client.state(RequestType.GS)
            assert real.timeout == REAL_TIMEOUT
            for wanted, got in ((3, 3), (0, REAL_TIMEOUT), (255, 255)):
                await client.state(RequestType.CONF_TM, wanted)
                assert real.timeout == got
            await client.ask(RequestType.SIMULATED_ROBOT)
            await client.state(RequestType.CONF_TM, 2)
            await client.ask(RequestType.REAL_ROBOT)  # what it wanted of the simulated one it wants of the real one
            await client.state(RequestType.VM, 50, 50, 0)
            await eventually(lambda: theirs.world.observe(1).speeds.first > 0.1)
            assert real.timeout == 2
            await eventually(lambda: theirs.world.observe(1).speeds.first == 0.0)

    play(scene)


def test_posdata_and_64_bit_clients_go_through() -> None:
    async def scene() -> None:
        async with pair() as (ours, _, _):
            client = await ours.bare()
            client.writer.write(encode_request(Layout.EIGHT_TAIL, 102, (1, 5)))
            await client.reader.readexactly(12)
            client.writer.write(encode_request(Layout.EIGHT_TAIL, RequestType.CT, (*(255,) * 5, 14, 2)))
            assert len(await client.reader.readexactly(4 + 8 * (49 + 144))) > 0
            client.writer.write(encode_request(Layout.EIGHT_TAIL, RequestType.REAL_ROBOT))
            await client.reader.readexactly(4)
            client.writer.write(encode_request(Layout.EIGHT_TAIL, RequestType.GS))
            reply = await client.reader.readexactly(4 + 8 * (49 + 144))
            assert reply[:4] == bytes.fromhex("005000c1")

    play(scene)


@pytest.mark.parametrize("robot", [None, 0])
def test_stop_stops_the_real_robot_too(robot: int | None) -> None:
    async def scene() -> None:
        async with pair() as (ours, theirs, client):
            await client.ask(RequestType.REAL_ROBOT)
            await client.state(RequestType.VM, 50, -50, 0)
            await eventually(lambda: theirs.world.observe(1).speeds.first > 0.1)
            ours.nserver.hold(True, robot=robot)
            await eventually(lambda: theirs.world.observe(1).speeds.first == 0.0)
            await client.state(RequestType.VM, 50, -50, 0)
            await client.state(RequestType.PR, 500, 500, 0)
            assert (await client.state(RequestType.WS, 1, 1, 0, 5))[38:40] == (0, 0)

    play(scene)


@pytest.mark.parametrize("how", ["held", "gone", "ended"])
def test_a_robot_that_is_waited_for_is_stopped_all_the_same(how: str) -> None:
    async def scene() -> None:
        async with pair() as (ours, theirs, client):
            await client.ask(RequestType.REAL_ROBOT)
            await client.state(RequestType.VM, 50, -50, 0)
            client.writer.write(encode_request(Layout.FOUR, RequestType.WS, (1, 1, 1, 255)))
            await eventually(lambda: len(theirs.nserver.waiting) == 1 and theirs.world.observe(1).speeds.first > 0.1)
            if how == "held":
                ours.nserver.hold(True)
                assert (await client.hear())[0] == 80  # what it waited for has come
            elif how == "gone":
                client.writer.transport.abort()
            else:
                await ours.nserver.close()
            await eventually(lambda: theirs.world.observe(1).speeds.first == 0.0)
            await eventually(lambda: len(theirs.nserver.lines) == (1 if how == "held" else 0))

    play(scene)


def test_a_server_that_ends_stops_its_real_robots() -> None:
    async def scene() -> None:
        async with pair() as (ours, theirs, client):
            await client.ask(RequestType.REAL_ROBOT)
            await client.state(RequestType.VM, 50, -50, 0)
            await eventually(lambda: theirs.world.observe(1).speeds.first > 0.1)
            await ours.nserver.close()
            await eventually(lambda: theirs.nserver.windows.robots[1].client == "")
            await eventually(lambda: theirs.world.observe(1).speeds.first == 0.0)

    play(scene)


def test_a_real_robot_that_is_not_there_is_an_error_for_its_program_alone() -> None:
    async def scene() -> None:
        async with pair(number=3) as (ours, theirs, client):
            other = await ours.caller()
            await client.ask(RequestType.REAL_ROBOT)
            assert await client.ask(RequestType.VM, 1, 1, 0) == (91, (5,))
            assert await client.ask(RequestType.GS) == (91, (5,))
            assert any("does not obey: it has no robot 3" in line for line in ours.said)
            assert await other.state(RequestType.GS)
            await client.ask(RequestType.SIMULATED_ROBOT)
            assert await client.state(RequestType.GS)
            await theirs.nserver.close()
            await client.ask(RequestType.REAL_ROBOT)
            assert await client.ask(RequestType.GS) == (91, (5,))

    play(scene)


def test_a_real_robot_that_is_lost_on_the_way() -> None:
    async def scene() -> None:
        async with pair() as (ours, theirs, client):
            await client.ask(RequestType.REAL_ROBOT)
            assert await client.state(RequestType.GS)
            for line in list(theirs.nserver.lines):
                line.end()
            await asyncio.sleep(0)
            assert await client.ask(RequestType.GS) == (91, (5,))
            assert any("the connection is lost" in line for line in ours.said)

    play(scene)


def test_who_has_no_real_robot_stays_with_the_simulated_one() -> None:
    async def scene() -> None:
        async with served() as made:
            client = await made.caller()
            assert await client.ask(RequestType.REAL_ROBOT) == (91, (111,))
            assert await client.state(RequestType.GS)

    play(scene)


@pytest.mark.parametrize(
    ("text", "robot"),
    [
        ("nomad://scout.local:7019#2", RealAddress("scout.local", 7019, 2)),
        ("nomad://127.0.0.1:7771", RealAddress("127.0.0.1", 7771, 1)),
        ("nomad://[::1]:7019#1", RealAddress("::1", 7019, 1)),
    ],
)
def test_where_a_robot_is(text: str, robot: RealAddress) -> None:
    assert real_robot(text) == robot


@pytest.mark.parametrize(
    "text", ["", "nomad://host", "nomad://:7019#1", "http://host:1#1", "nomad://host:99999#1", "nomad://host:1#zero"]
)
def test_where_no_robot_is(text: str) -> None:
    with pytest.raises(MisuseError, match="wanted a robot such as nomad://"):
        real_robot(text)
