"""Strangers push out strangers, and whoever is known stays."""

from __future__ import annotations

import asyncio
import resource

import pytest

from arriving import AGES, arriving, nothing_left_open, turns
from sleepcast.core.clock import ManualClock
from sleepcast.core.doorkeeper import FULL, LEAST, PAUSE, Doorkeeper, room, sentences_of, stop_listening


class Line:
    """A connection that only knows whether it is there."""

    def __init__(self) -> None:
        self.gone = False

    def is_closing(self) -> bool:
        return self.gone

    def abort(self) -> None:
        self.gone = True


def test_the_oldest_stranger_makes_room_and_one_sentence_says_so() -> None:
    clock, said = ManualClock(), list[str]()
    keeper = Doorkeeper(3, 10.0, clock, said.append)
    lines = [Line() for _ in range(50)]
    known = Line()
    keeper.enter(known)
    keeper.leave(known)
    for each in lines:
        keeper.enter(each)
    assert [each.gone for each in lines] == [True] * 47 + [False] * 3
    assert (known.gone, len(keeper), keeper.turned_away, len(said)) == (False, 3, 47, 1)
    keeper.touch(lines[47])
    keeper.enter(Line())
    assert (lines[47].gone, lines[48].gone, len(said)) == (False, True, 1)
    clock.advance(PAUSE + 1.0)
    keeper.enter(Line())
    assert len(said) == 2


def test_who_says_nothing_for_too_long_loses_the_place() -> None:
    clock = ManualClock()
    keeper = Doorkeeper(3, 10.0, clock, lambda _: None)
    silent, busy, closed = Line(), Line(), Line()
    for each in (silent, busy, closed):
        keeper.enter(each)
    clock.advance(9.0)
    keeper.touch(busy)
    closed.gone = True
    clock.advance(2.0)
    keeper.sweep()
    assert (silent.gone, busy.gone, len(keeper)) == (True, False, 1)
    assert busy in keeper
    for each in (Line(), Line(), Line()):
        keeper.touch(each)  # one that is not there is nothing
    assert len(keeper) == 1


def test_there_is_less_room_where_fewer_files_may_be_open(monkeypatch: pytest.MonkeyPatch) -> None:
    limit = 1_024
    monkeypatch.setattr(resource, "getrlimit", lambda _: (limit, limit))
    assert (room(128), room(1_000, 2)) == (128, 480)
    limit = 256
    assert room(128) == 48
    limit = 32
    assert (room(128), room(2)) == (LEAST, 2)
    limit = resource.RLIM_INFINITY
    assert room(128) == 128


def test_a_process_without_files_says_it_once() -> None:
    said, loop = list[str](), asyncio.new_event_loop()
    try:
        loop.set_exception_handler(sentences_of(said.append))
        for _ in range(1_000):
            loop.call_exception_handler({"message": FULL, "exception": OSError(24, "Too many open files")})
    finally:
        loop.close()
    assert len(said) == 1
    assert "no file left" in said[0]


@pytest.mark.parametrize("age", AGES)
def test_who_arrives_as_the_server_ends_has_a_protocol_then(age: int) -> None:
    lines: list[asyncio.Transport] = []

    class Known(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            assert isinstance(transport, asyncio.Transport)
            lines.append(transport)

    async def scene() -> None:
        server = await asyncio.get_running_loop().create_server(Known, "127.0.0.1", 0)
        with arriving(server.sockets[0].getsockname()[1]):
            await turns(age)
            await stop_listening([server])
            assert not server.is_serving()
            for line in lines:
                line.abort()

    with nothing_left_open():
        asyncio.run(scene())
