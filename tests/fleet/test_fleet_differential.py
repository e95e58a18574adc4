"""A fleet against nodes: random programs in a row, over random states, stored as rules as well; bit for bit.

What goes past a bound is rare where bounds are wide. So in half of the lives some of them are narrow, for both alike:
then budgets end anywhere, rules are deactivated, rolled back and left over, and outboxes run full.
"""

from __future__ import annotations

import math
import pkgutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from random import Random
from unittest.mock import patch

import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from fleet.twins import Twins
from language.authors import Author
from language.cases import SENSORS
from sleepcast import columns, fleet, language, node
from sleepcast import mind as shared
from sleepcast.channel.message import Kind, Message
from sleepcast.columns import values
from sleepcast.core.errors import SleepcastError
from sleepcast.fleet.native.kernels import Kernels, available

pytestmark = pytest.mark.usefixtures("rules_elsewhere")

EXAMPLES = max(50, settings().max_examples)
"""Lives: so many, or as many as the chosen hypothesis profile says if that is more."""
ROBOTS = 4
STEPS = 5
BOUNDS = {
    "MAX_STEPS": (20, 60, 150, 600),
    "TICK_STEPS": (15, 60, 200, 1_000),
    "MAX_FAULTS": (1, 3),
    "MAX_FAULTS_IN_ROW": (1, 2, 3),
    "PROVEN_TICKS": (1, 2, 5),
    "MAX_QUEUE": (1, 2),
    "MAX_OUTBOX": (1, 4),
    "REPORTS_A_SECOND": (1, 3),
    "MAX_RULES": (1, 2),
    "MAX_OPERATORS": (1,),
    "MAX_GROUPS": (1,),
    "MAX_DEPTH": (0, 1, 2),
    "MAX_LEVELS": (8, 20),
    "SPARE_MINDS": (0,),
    "MAX_KERNELS": (1, 3),
    "MAX_PARTS": (5, 30),
    "LANES": (1, 2, 4),
    "HOT": (0, 2),
}
"""Bounds by name, of fleets and nodes, and how narrow they may be."""
NUMBERS = (math.nan, 0.0, -0.0, 0.25, 0.5, 1.0, 3.0, -2.0, 1e300, 7.5)


def some(chance: Random, robots: int = ROBOTS) -> list[int] | None:
    """Some of the robots, or None for all of them."""
    if robots == 1 or chance.random() < 0.6:
        return None
    return sorted(chance.sample(range(robots), chance.randint(1, robots - 1)))


def message(chance: Random, author: Author) -> str:
    """A random expression: as it is, as a rule, or for those only for whom a random test holds."""
    kind = chance.randrange(9)
    if kind == 0:
        return "(ROLLBACK)"
    if kind == 4:
        return f"(RULE r{chance.randint(1, 2)} (PROGN {author.text()} (ROLLBACK) {author.text()}))"
    if kind == 1:
        rank = chance.choice(("", "", f" :priority {chance.randint(-9, 9)}"))
        return f"(RULE r{chance.randint(1, 2)} {author.text()}{rank})"
    if kind == 2:
        return f"(WHEN (> {chance.choice(('x', 'fuel', 'id'))} {chance.randint(0, 3)}) {author.text()})"
    if kind == 3:
        return f"(PROGN (SETQQ E{chance.randint(1, 3)} {author.text()}) (ACTIVATE E{chance.randint(1, 3)}))"
    return author.text()


@settings(max_examples=EXAMPLES)
@given(start=st.integers(0, 2**63), chunk=st.sampled_from([1, 3, values.CHUNK]))
def test_robots_of_a_fleet_do_what_nodes_do(start: int, chunk: int) -> None:
    with patch.object(values, "CHUNK", chunk), patch.object(values, "STRETCH", 2 * chunk):
        do_the_same(Random(start), native=False)


@pytest.mark.skipif(not available(), reason="native code needs llvmlite, the extra `fast`")
@settings(max_examples=EXAMPLES)
@given(start=st.integers(0, 2**63), chunk=st.sampled_from([1, 3, values.CHUNK]))
def test_robots_of_a_fleet_with_native_code_do_what_nodes_do(start: int, chunk: int) -> None:
    with patch.object(values, "CHUNK", chunk), patch.object(values, "STRETCH", 2 * chunk):
        do_the_same(Random(start), native=True)


def houses() -> Iterator[str]:
    """Every module of fleets, their columns, nodes, what both share, and their language."""
    for house in (columns, fleet, language, shared, node):
        yield from (module.name for module in pkgutil.walk_packages(house.__path__, f"{house.__name__}."))


HOUSES = [import_module(name) for name in houses()]


@contextmanager
def narrow(chance: Random) -> Iterator[None]:
    """Some bounds are narrow while this lasts."""
    with ExitStack() as stack:
        for name, values in BOUNDS.items():
            if chance.random() < 0.3:
                value = chance.choice(values)
                note(f"{name} {value}")
                for module in HOUSES:
                    if name in vars(module):
                        stack.enter_context(patch.object(module, name, value))
        yield


def do_the_same(chance: Random, *, native: bool) -> None:
    """native: everything becomes native code at once."""
    with narrow(chance) if chance.random() < 0.5 else ExitStack():
        live(chance, chance.choice((1, ROBOTS, ROBOTS, 9)), native=native)


def live(chance: Random, robots: int, *, native: bool) -> None:
    author = Author(chance, deepest=4)
    twins = Twins(robots, seed=chance.randrange(2**32), first=chance.randrange(1_000))
    kernels = twins.fleet.kernels = twins.fleet.memory.kernels = Kernels(hot=1) if native else None
    for step in range(STEPS):
        if step % 3 == 0:
            twins.sense([[chance.choice(NUMBERS) for _ in SENSORS] for _ in range(robots)])
        if chance.random() < 0.1:
            install(twins, chance, author.text())
        if chance.random() < 0.1:
            order(twins, chance)
        for _ in range(chance.choice((1, 1, 1, 3))):
            text, those = message(chance, author), some(chance, robots)
            kind = Kind.ASK if chance.random() < 0.1 else Kind.COMMAND
            note(f"{kind.value} {those}: {text}")
            twins.send(text, those, kind)
        twins.think(chance.choice((1, 1, 3, 120)), some(chance, robots))
        told = [said for each in twins.nodes for said in each.outbox if said.kind is Kind.COMMAND]
        twins.compare()
        for said in told[:2]:
            twins.hear(said, some(chance, robots))
        if kernels is not None:
            kernels.settle()
    twins.compare_reasons()


def install(twins: Twins, chance: Random, text: str) -> None:
    """Give a robot a rule of its own, if it takes it."""
    robot, name, priority = chance.randrange(len(twins.nodes)), chance.choice(("r1", "E2")), chance.choice((-1, 0, 3))
    protected, refused = chance.random() < 0.5, []
    note(f"install {robot} {name} {priority} {protected}: {text}")
    for mind in (twins.views[robot], twins.nodes[robot]):
        try:
            mind.install(name, text, priority=priority, protected=protected)
        except SleepcastError as error:
            refused.append(str(error))
    assert len(refused) == 2 * len(set(refused))


def order(twins: Twins, chance: Random) -> None:
    """STOP or RELEASE of somebody, late perhaps, sent again for others, or naming what it ends."""
    kind, those = chance.choice((Kind.STOP, Kind.RELEASE)), some(chance, len(twins.nodes))
    issued = twins.now - chance.choice((0.0, 0.0, 0.2, 30.0))
    sender, epoch = chance.choice(("desk", "desk", "anna", "bert")), chance.choice((1, 1, 2))
    first = f"{sender}-{epoch}.{chance.randint(0, twins.sent + 2)}"
    ends = [[chance.choice(("desk", "anna")), 1, chance.randint(0, twins.sent + 1)], chance.choice(("none", []))]
    body = chance.choice(
        ({}, {"age": 0.5}, {"age": 20.0, "for": ["r0"]}, {"not": ["r0"]}, {"first": first, "age": 1.0}, {"age": "old"})
    )
    body = body | chance.choice(({}, {}, {"ends": ends}))
    number = max(1, twins.sent + 1 - chance.choice((0, 0, 0, 1, 4)))
    note(f"{kind.value} {sender} {epoch} {number} {those} {issued} {body}")
    twins.sent += 1
    twins.hear(Message(sender, epoch, number, kind, issued, body=body), those)
