"""Telemetry of a node: its answers to inspection requests; `mind.telemetry` has the records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from sleepcast.channel.message import LOOK, OF, STOPS, TELEMETRY, Inspection
from sleepcast.core.errors import SleepcastError, printable
from sleepcast.language.explain import Explanation
from sleepcast.language.symbols import Group, Operator, UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS
from sleepcast.mind.rules import in_order
from sleepcast.mind.telemetry import (
    MAX_TEXT_BYTES,
    MindRecord,
    Motion,
    TelemetryRecord,
    as_text,
    bits,
    digest,
    packed,
    vocabulary_text,
    why_text,
)
from sleepcast.node.memory import RobotMemory

Details = Mapping[str, object]
"""Fields of an answer's body."""
NOTHING: Details = MappingProxyType({})


class InspectionError(SleepcastError):
    """The robot cannot answer an inspection request."""


@dataclass(frozen=True, slots=True)
class BodyState:
    """What a node knows of its body, and of who holds it: see `Node`. stops: see `Authority.stops`. motion: see
    `TelemetryRecord`."""

    stopped: bool
    driven: bool
    doubt: str
    catching_up: bool
    stops: Sequence[object]
    motion: Motion | None


def answer_inspection(
    body: Mapping[str, object],
    memory: RobotMemory,
    state: BodyState,
    why: Callable[[str | None], Explanation],
) -> Details:
    """The answer to a request with this body. why: explains a command, a rule, or the last command."""
    what, of = body.get(LOOK), body.get(OF)
    try:
        if what == Inspection.TELEMETRY:
            found = telemetry(memory, state).body()
            return {TELEMETRY: found, **({STOPS: state.stops} if state.stops else {})}
        if what == Inspection.VOCABULARY:
            return {TELEMETRY: _fitting(vocabulary_text(memory.vocabulary), "it has more names")}
        if what == Inspection.MIND:
            return {TELEMETRY: _fitting(mind_text(memory), "it has learned more")}
        if what == Inspection.WHY:
            return {TELEMETRY: why_text(why(of if isinstance(of, str) else None))}
        known = ", ".join(Inspection)
        raise InspectionError(f"no look called {printable(str(what))[:80]!r}: there are {known}")
    except SleepcastError as error:
        return {"fault": str(error).splitlines()[0]}


def telemetry(memory: RobotMemory, state: BodyState) -> TelemetryRecord:
    """A robot's current variables and flags."""
    slots = (*range(ACTIVE0 + 1), *range(ACTIVE0 + BUFFERS, memory.vocabulary.size))
    symbols = memory.base.symbols
    return TelemetryRecord(
        digest(vocabulary_text(memory.vocabulary)),
        digest(mind_text(memory)),
        packed([memory.peek(slot) for slot in slots]),
        sum(1 << i - 1 for i in range(1, BUFFERS) if memory.values[ACTIVE0 + i] > 0.0),
        bits([rule.active for rule in in_order(memory.base.rules)]),
        {found.name: memory.values[found.slot] for found in symbols.values() if isinstance(found, UserVariable)},
        [found.name for key, found in symbols.items() if key in memory.groups],
        state.stopped,
        state.driven,
        state.doubt,
        state.catching_up,
        state.motion,
    )


def mind_text(memory: RobotMemory) -> str:
    """What it has learned as JSON: the groups it has heard of, its operators, and its rules in order of evaluation."""
    symbols, operators = memory.base.symbols.items(), memory.base.operators
    return as_text(
        MindRecord(
            [found.name for _, found in symbols if isinstance(found, Group)],
            [
                (found.name, list(found.parameters), operators[key].text)
                for key, found in symbols
                if isinstance(found, Operator)
            ],
            [(rule.name, rule.text, rule.protected) for rule in in_order(memory.base.rules)],
            {rule.name: rule.shown_priority for rule in in_order(memory.base.rules) if rule.shown_priority},
        )
    )


def _fitting(text: str, too_long: str) -> str:
    if len(text.encode()) > MAX_TEXT_BYTES:
        raise InspectionError(f"{too_long} than fits into one message")
    return text
