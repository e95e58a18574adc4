"""A fleet against nodes: random programs in a row, over random states, stored as rules as well; bit for bit."""

from __future__ import annotations

import math
from random import Random
from unittest.mock import patch

import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from fleet.twins import Twins
from language.authors import Author
from language.cases import SENSORS
from sleepcast.channel.message import Kind
from sleepcast.fleet import columns
from sleepcast.fleet.kernels import Kernels, available

EXAMPLES = max(1_000, settings().max_examples)
ROBOTS = 4
STEPS = 7
NUMBERS = (math.nan, 0.0, -0.0, 0.25, 0.5, 1.0, 3.0, -2.0, 1e300, 7.5)


def some(chance: Random) -> list[int] | None:
    """Some of the robots, or None for all of them."""
    if chance.random() < 0.6:
        return None
    return sorted(chance.sample(range(ROBOTS), chance.randint(1, ROBOTS - 1)))


def message(chance: Random, author: Author) -> str:
    """A random expression: as it is, as a rule, or for those only for whom a random test holds."""
    kind = chance.randrange(8)
    if kind == 0:
        return "(ROLLBACK)"
    if kind == 1:
        return f"(RULE r{chance.randint(1, 2)} {author.text()})"
    if kind == 2:
        return f"(WHEN (> {chance.choice(('x', 'fuel', 'id'))} {chance.randint(0, 3)}) {author.text()})"
    if kind == 3:
        return f"(PROGN (SETQQ E{chance.randint(1, 3)} {author.text()}) (ACTIVATE E{chance.randint(1, 3)}))"
    return author.text()


@settings(max_examples=EXAMPLES)
@given(start=st.integers(0, 2**63), chunk=st.sampled_from([1, 3, columns.CHUNK]))
def test_robots_of_a_fleet_do_what_nodes_do(start: int, chunk: int) -> None:
    with patch.object(columns, "CHUNK", chunk), patch.object(columns, "STRETCH", 2 * chunk):
        do_the_same(Random(start), native=False)


@pytest.mark.skipif(not available(), reason="native code needs llvmlite, the extra `fast`")
@settings(max_examples=EXAMPLES)
@given(start=st.integers(0, 2**63), chunk=st.sampled_from([1, 3, columns.CHUNK]))
def test_robots_of_a_fleet_with_native_code_do_what_nodes_do(start: int, chunk: int) -> None:
    with patch.object(columns, "CHUNK", chunk), patch.object(columns, "STRETCH", 2 * chunk):
        do_the_same(Random(start), native=True)


def do_the_same(chance: Random, *, native: bool) -> None:
    """native: everything becomes native code at once."""
    author = Author(chance, deepest=4)
    twins = Twins(ROBOTS, seed=chance.randrange(2**32), first=chance.randrange(1_000))
    kernels = twins.fleet.kernels = twins.fleet.memory.kernels = Kernels(hot=1) if native else None
    for step in range(STEPS):
        if step % 3 == 0:
            twins.sense([[chance.choice(NUMBERS) for _ in SENSORS] for _ in range(ROBOTS)])
        text, robots = message(chance, author), some(chance)
        kind = Kind.ASK if chance.random() < 0.1 else Kind.COMMAND
        note(f"{kind.value} {robots}: {text}")
        twins.send(text, robots, kind)
        twins.think(chance.choice((1, 1, 3, 120)), some(chance))
        twins.compare()
        if kernels is not None:
            kernels.settle()
    twins.compare_reasons()
