"""The read set: which variables robots look at in their next tick, so that nobody measures what no robot asks for."""

from __future__ import annotations

from collections.abc import Iterable
from weakref import WeakKeyDictionary

from sleepcast.channel.message import Message
from sleepcast.core.errors import SleepcastError
from sleepcast.fleet.columns import Index
from sleepcast.fleet.evaluation import Evaluation, distinct
from sleepcast.fleet.minds import Mind, Named
from sleepcast.language.parts import Part, Storing, walk, written
from sleepcast.language.program import Program
from sleepcast.language.reader import read
from sleepcast.language.rehearsal import FLAGS
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS

_HARMLESS = frozenset({*FLAGS, "report", "tell", "ping", "join", "leave", "deactivate", "lease"})
"""Acts after which no robot runs or names anything that it did not before."""
_READING = frozenset({"var", "write", "defvar", "set_user"})
_ANYTHING = "*"
_NOWHERE = -1
"""The slot of a name that was unknown when the program was checked."""


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
        slots, _ = reads_of(program, [mind])
        if slots is None:
            return None
        found |= slots
    return frozenset(found)


def _teaches(part: Part) -> bool:
    """Whether other rules or names may be there after a part was evaluated; what it enters was there before."""
    if part.op == "write":
        return ACTIVE0 < part.slot < ACTIVE0 + BUFFERS
    return part.op in ("store", "fetch", "call") or (part.op == "act" and part.name not in _HARMLESS)


def reads_of(program: Program, minds: Iterable[Mind]) -> tuple[set[int] | None, set[str]]:
    """The slots and groups that a program can look at, with all that it can enter in these minds; None for any."""
    slots: set[int] = set()
    groups: set[str] = set()
    taught: set[str] = set()
    named: set[str] = set()
    seen: set[Program] = set()
    waiting = [program]
    while waiting:
        found = waiting.pop()
        if found in seen:
            continue
        seen.add(found)
        named |= found.uses
        for part in walk(found.root):
            if part.op in _READING:
                slots |= {part.slot} - {_NOWHERE}
            elif part.op == "in":
                groups.add(part.name)
            else:
                taught |= _taught(part)
        for mind in minds:
            waiting += [mind.rules[key].program for key in found.uses if key in mind.rules]
            waiting += [mind.operators[key] for key in found.uses if key in mind.operators]
    if named and (_ANYTHING in taught or not named.isdisjoint(taught)):
        # It may enter what it has only just learned, so it may look at anything.
        return None, groups
    return slots, groups


def _taught(part: Part) -> set[str]:
    """The keys of what a part stores."""
    if isinstance(part.data, Storing):
        return {part.data.key}
    if part.op == "act" and part.name == "defun":
        return {written(part).casefold()}
    return {_ANYTHING} if part.op == "act" and part.name == "rollback" else set()
