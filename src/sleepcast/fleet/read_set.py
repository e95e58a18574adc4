"""Attention: which variables robots look at in their next tick, so that nobody measures what no robot asks for."""

from __future__ import annotations

from collections.abc import Iterable
from weakref import WeakKeyDictionary

from sleepcast.channel.message import Message
from sleepcast.core.errors import SleepcastError
from sleepcast.fleet.columns import Index
from sleepcast.fleet.evaluation import Evaluation, distinct
from sleepcast.fleet.evaluation_log import reach
from sleepcast.language.parts import Part, walk
from sleepcast.language.program import Program
from sleepcast.language.reader import read
from sleepcast.language.rehearsal import FLAGS
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS
from sleepcast.mind.rules import Mind, Named

_HARMLESS = frozenset({*FLAGS, "report", "tell", "ping", "join", "leave", "deactivate", "lease"})
"""Acts after which no robot runs or names anything that it did not before."""


class ReadSet:
    """What the robots of a memory look at; None stands for everything. It errs only by naming too much."""

    def __init__(self, memory: Evaluation) -> None:
        self._memory = memory
        self._of_mind: WeakKeyDictionary[Mind, frozenset[int] | None] = WeakKeyDictionary()

    def slots(self, waiting: Iterable[tuple[Message, Index]]) -> frozenset[int] | None:
        """The slots that any active rule may read, or any waiting message, each given with its robots."""
        memory = self._memory
        found: set[int] = set()
        one = memory.state.one_mind
        for number in distinct(memory.state.mind)[0].tolist() if one is None else [one]:
            looked_at = self._by_rules(memory.minds[number])
            if looked_at is None:
                return None
            found |= looked_at
        for message, robots in waiting:
            for number in distinct(memory.state.mind[robots])[0].tolist() if one is None else [one]:
                slots = self._by_message(message, memory.minds[number])
                if slots is None:
                    return None
                found |= slots
        return frozenset(found)

    def _by_rules(self, mind: Mind) -> frozenset[int] | None:
        if mind not in self._of_mind:
            self._of_mind[mind] = _together((kept.program for kept in mind.running), mind)
        return self._of_mind[mind]

    def _by_message(self, message: Message, mind: Mind) -> frozenset[int] | None:
        """What a message looks at, or the rules that it changes; one that cannot be read now may be readable then."""
        names = Named(self._memory.minds.vocabulary, mind)
        try:
            program = self._memory.minds.library.program(message.text, lambda: [read(message.text)], names)
        except SleepcastError:
            return None
        return None if any(map(_teaches, walk(program.root))) else _together([program], mind)


def _together(programs: Iterable[Program], mind: Mind) -> frozenset[int] | None:
    found: set[int] = set()
    for program in programs:
        slots, _ = reach(program, [mind])
        if slots is None:
            return None
        found |= slots
    return frozenset(found)


def _teaches(part: Part) -> bool:
    """Whether other rules or names may be there after a part was evaluated; what it enters was there before."""
    if part.op == "write":
        return ACTIVE0 < part.slot < ACTIVE0 + BUFFERS
    return part.op in ("store", "fetch", "call") or (part.op == "act" and part.name not in _HARMLESS)
