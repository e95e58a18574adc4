"""A fleet made from a snapshot goes on as the fleet would have that it was taken of; and nothing else is taken in."""

from __future__ import annotations

from random import Random

from hypothesis import given, note, settings
from hypothesis import strategies as st

from fleet.test_fleet_differential import NUMBERS, message, some
from fleet.twins import Twins, vocabulary
from language.authors import Author
from language.cases import SENSORS, Body
from sleepcast.channel.message import Kind, Message
from sleepcast.core.serial import pack, unpack
from sleepcast.fleet import Fleet
from sleepcast.fleet.schema import FleetSnapshot
from sleepcast.fleet.snapshot import restore, state_of

ROBOTS = 4
MOST = 1 << 20


def packed(fleet: Fleet) -> bytes:
    return pack(state_of(fleet), MOST)


def resumed(data: bytes, like: Fleet, bodies: list[Body] | None = None) -> Fleet:
    """A fleet from a snapshot of one like `like`."""
    fleet = Fleet(like.names, vocabulary(), numbers=like.numbers, seed=SEED, bodies=bodies)
    restore(fleet, unpack(FleetSnapshot, data, MOST, "fleet"), 0.0)
    return fleet


SEED = 11


@settings(max_examples=max(25, settings().max_examples))
@given(start=st.integers(0, 2**63))
def test_a_fleet_goes_on_as_if_it_had_never_been_put_away(start: int) -> None:
    """Twins go on together; every few steps the fleet is replaced by one made from its snapshot."""
    chance = Random(start)
    author = Author(chance, deepest=4)
    twins = Twins(ROBOTS, seed=SEED)
    for step in range(9):
        if step % 3 == 0:
            twins.sense([[chance.choice(NUMBERS) for _ in SENSORS] for _ in range(ROBOTS)])
        text, robots = message(chance, author), some(chance)
        note(f"{robots}: {text}")
        twins.send(text, robots, Kind.ASK if chance.random() < 0.1 else Kind.COMMAND)
        if chance.random() < 0.5:
            replace(twins)  # with messages that wait
        twins.think(chance.choice((1, 1, 3, 120)), some(chance))
        if chance.random() < 0.5:
            replace(twins)  # with things said that nobody has read
        twins.compare()


def test_a_stop_still_holds_against_a_release_that_was_sent_before_it() -> None:
    twins = Twins(ROBOTS, seed=SEED)
    twins.think(10)
    twins.hear(Message("desk", 1, 2, Kind.STOP, 0.9), [0, 1])
    replace(twins)
    twins.hear(Message("desk", 1, 1, Kind.RELEASE, 0.8))
    assert [view.stopped for view in twins.views] == [True, True, False, False]
    twins.compare()


def replace(twins: Twins) -> None:
    before = packed(twins.fleet)
    twins.fleet = resumed(before, twins.fleet, twins.here)
    twins.views = list(twins.fleet.values())
    assert packed(twins.fleet) == before
