"""From robots that were selected on the map to the test that holds for exactly these."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Annotated, Protocol

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import MAX_BYTES, PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.view import Scene
from sleepcast.core.errors import MisuseError
from sleepcast.station.facts import FactSource, facts_of
from sleepcast.station.selection import MAX_CONDITIONS, MAX_LISTED, Selection, select

AT_ONCE = 2_000
"""Robots up to which the search takes a few milliseconds; with more it goes on beside the server."""


class Pick(PageMessage):
    """Find the test that holds for exactly the marked robots. marks: a bit for each robot, the first in the lowest bit
    of the first byte."""

    serial: Serial
    marks: Annotated[bytes, Meta(max_length=MAX_BYTES)]


class Picked(DeskMessage):
    """The tests for the selected robots, the shortest first. listed: the one that names each robot, "" if there are too
    many. sentence: what is to be said of it, "" for nothing."""

    serial: int
    count: int
    tests: list[str]
    listed: str
    sentence: str


class PickSource(Protocol):
    """What is known of the robots on the map. at_once: whether answers come at once, whatever they take."""

    at_once: bool

    @property
    def facts(self) -> FactSource: ...
    @property
    def scene(self) -> Scene: ...


@answers(then=run_again)
def pick(source: PickSource, asked: Pick) -> Picked | Awaitable[Picked]:
    """The tests for the marked robots. Raises MisuseError for marks of other robots, or of none."""
    serial, marks, robots = asked.serial, asked.marks, len(source.scene.names)
    bits = np.unpackbits(np.frombuffer(marks, np.uint8), bitorder="little").astype(np.bool_)
    if len(marks) != -(-robots // 8) or bits[robots:].any():
        raise MisuseError(f"marks of {len(bits)} robots came, and there are {robots}: select them once more")
    facts = facts_of(source.facts)
    chosen: NDArray[np.bool_] = np.zeros(len(facts), np.bool_)
    chosen[:robots] = bits[:robots]
    count = int(np.count_nonzero(chosen))
    if source.at_once or len(facts) <= AT_ONCE:
        return _shown(serial, count, select(facts, chosen))

    async def later() -> Picked:
        return _shown(serial, count, await asyncio.to_thread(select, facts, chosen))

    return later()


def _shown(serial: int, count: int, selection: Selection) -> Picked:
    if selection.unknown:
        which = "has" if selection.unknown == 1 else "have"
        why = f"{selection.unknown} of these robots {which} sent no recent telemetry"
        sentence = f"{why}, so no test can be found for them."
    elif not selection.tests:
        sentence = f"No {MAX_CONDITIONS} conditions together hold for exactly these robots. "
        sentence += (
            "They can be listed by their numbers."
            if selection.listed
            else f"They are too many to be listed (more than {MAX_LISTED:,}): let them join a group in parts."
        )
    else:
        sentence = ""
    return Picked(serial, count, list(selection.tests), selection.listed, sentence)
