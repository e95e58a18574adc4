"""Whether robots would end the same without the standing commands that a baseline drops.

A mind is made here for each type of robot, from what robots of it say they have learned, and evaluates the commands:
all of them; only those that are kept; and, for robots that were away for a while, the first ones and then the kept
ones. All of these must give what the robots themselves have. Names that none of the commands may change are others'
business: the mind begins with them, and they are not compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import count, islice
from typing import TYPE_CHECKING, NamedTuple

from sleepcast.core.errors import SleepcastError, printable
from sleepcast.core.records import dataclass
from sleepcast.language.vocabulary import buffer_number, rule_key
from sleepcast.mind.limits import MAX_QUEUE

if TYPE_CHECKING:
    from sleepcast.channel import Message
    from sleepcast.language import Vocabulary
    from sleepcast.mind.telemetry import MindRecord
    from sleepcast.node.node import Node
    from sleepcast.station.remote import RemoteMinds

TRIES = 60_000
"""Commands that are evaluated for robots that were away, at most: half a minute's work."""
MOST_CUTS, FEWEST_CUTS = 16, 2
"""Of the places in the stream after which a robot may have been away, so many are tried."""
TYPES = 8
"""Types of robots, with what else they have learned, that are tried."""


class Learned(NamedTuple):
    """What a mind has learned under the names that the commands may change: groups; operators and rules in their order,
    with their texts; and, where it is known, what decides between these commands and others."""

    groups: frozenset[str]
    operators: tuple[tuple[str, tuple[str, ...], str], ...]
    rules: tuple[tuple[str, str, int], ...]
    registers: object = None


@dataclass(frozen=True, slots=True)
class Case:
    """Robots of one type that have learned the same from others. start: what any of them has learned."""

    robots: tuple[str, ...]
    vocabulary: Vocabulary
    start: MindRecord
    touched: frozenset[str]

    def learned(self, messages: Iterable[Message], refused: set[int] | None = None) -> Learned:
        """What a new mind has learned after these commands. refused: takes the numbers of those that it refuses."""
        from sleepcast.node.node import Node

        node = Node("r", self.vocabulary, on_air=True)
        node.catching_up = True  # rules that were replaced would not run on a newcomer, either
        _begin(node, self.start, self.touched)
        waiting = iter(messages)
        for tick in count(1):
            some = list(islice(waiting, MAX_QUEUE))
            if not some:
                break
            for message in some:
                node.receive(message)
            node.think(tick, float(tick))
            node.take_outbox()
            if refused is not None:
                refused |= {message.sequence for message, outcome, _ in node.evaluated if outcome == "fault"}
            node.evaluated.clear()
        return _of(node, self.touched)

    def objection(self, messages: Mapping[int, Message], kept: list[int]) -> str:
        """Why robots might not end the same; "" if they do."""
        full = self.learned(messages.values())
        own = _learned_of(self.start, self.touched)
        if other := _difference(own, full):
            who = ", ".join(self.robots[:3])
            return f"{who} and these commands differ in {other}: robots have refused one, or others have changed it"
        for cut in _cuts(len(messages)):
            numbers = list(messages)
            rest = [*numbers[:cut], *(number for number in kept if number > (numbers[cut - 1] if cut else 0))]
            if other := _difference(full, self.learned(messages[number] for number in rest), registers=True):
                away = f"has the first {cut:,}" if cut else "is new"
                return f"a robot that {away} would differ in {other} if it got only the rest of what is kept"
        return ""


def cases(minds: RemoteMinds, robots: Iterable[str], touched: frozenset[str]) -> list[Case] | str:
    """These robots by their types and by what they have learned, or why that is not known."""
    alike: dict[tuple[bytes, bytes], list[str]] = {}
    for name in robots:
        mind = minds.get(name)
        if mind is None or mind.learned is None or mind.telemetry.type not in minds.types:
            return f"{name} does not tell what it has learned"
        if mind.telemetry.catching_up:
            return f"{name} is still catching up"
        alike.setdefault((mind.telemetry.type, mind.telemetry.mind), []).append(name)
    if len(alike) > TYPES:
        return f"there are {len(alike)} types of robots that have learned different things, and {TYPES} are compared"
    compared = []
    for (kind, _), names in alike.items():
        known = minds[names[0]].learned
        assert known is not None
        compared.append(Case(tuple(names), minds.types[kind], known.record, touched))
    return compared


def _begin(node: Node, start: MindRecord, touched: frozenset[str]) -> None:
    """Give a new mind what the robots have from others, or built in. What it cannot learn here, they have learned in
    another way, which the comparison shows."""
    for name, parameters, text in start.operators:
        if name.casefold() not in touched:
            _try(node.evaluate, f"(DEFUN {name} ({' '.join(parameters)}) {text})")
    for name, text, protected in start.rules:
        priority = start.priorities.get(name, 0)
        if protected or (priority and rule_key(name) not in touched):  # of a RULE or of the host: nobody tells which
            _try(partial(node.install, priority=priority, protected=protected), name, text)
        elif rule_key(name) not in touched:
            _try(node.evaluate, f"({'RULE' if buffer_number(name.casefold()) is None else 'SETQQ'} {name} {text})")
    for name in start.groups:
        if name.casefold() not in touched:
            _try(node.evaluate, f"(JOIN {name})")


def _try(learn: Callable[..., object], *given: str) -> None:
    try:
        learn(*given)
    except SleepcastError:
        return


def _of(node: Node, touched: frozenset[str]) -> Learned:
    from msgspec.json import decode

    from sleepcast.mind.inspection import mind_text
    from sleepcast.mind.telemetry import MindRecord

    learned = _learned_of(decode(mind_text(node.memory.base), type=MindRecord), touched)
    state = node.memory.base.merging.state()
    made = {key: (forgotten, made[:1]) for key, (forgotten, made) in state.made.items()}
    active = [(rule.name, rule.active) for rule in node.rules()]
    return learned._replace(registers=(state.floor, state.written, state.flags, made, active))


def _learned_of(record: MindRecord, touched: frozenset[str]) -> Learned:
    return Learned(
        frozenset(name.casefold() for name in record.groups) & touched,
        tuple((name, tuple(given), text) for name, given, text in record.operators if name.casefold() in touched),
        tuple((n, text, record.priorities.get(n, 0)) for n, text, _ in record.rules if rule_key(n) in touched),
    )


def _difference(one: Learned, other: Learned, *, registers: bool = False) -> str:
    """In what they differ, "" if they do not."""
    if not (one.groups == other.groups if registers else one.groups >= other.groups):
        return f"the groups {printable(', '.join(sorted(one.groups ^ other.groups)))}"
    for what, ours, theirs in (("operator", one.operators, other.operators), ("rule", one.rules, other.rules)):
        texts, others = {each[0]: each for each in ours}, {each[0]: each for each in theirs}
        for name in {**texts, **others}:
            if texts.get(name) != others.get(name):
                return f"the {what} {printable(name)}"
        if list(texts) != list(others):
            return f"the order of their {what}s"
    return "which commands they came by" if registers and one.registers != other.registers else ""


def _cuts(count: int) -> list[int]:
    """After how many commands a robot may have been away: from 0, for a newcomer."""
    cuts = max(FEWEST_CUTS, min(MOST_CUTS, TRIES // max(count, 1)))
    return sorted({at * count // cuts for at in range(cuts)})
