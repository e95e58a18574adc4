"""What a robot answers when it is asked to tell about itself; `mind.telemetry` has the records."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

from sleepcast.channel.message import LOOK, MATCHED, OF, STOPS, TELEMETRY, UNKNOWN, Inspection, Message
from sleepcast.core.errors import SleepcastError, printable
from sleepcast.core.records import dataclass
from sleepcast.language.explain import Explanation, Foretold
from sleepcast.language.program import Program
from sleepcast.language.symbols import Declared, Group, Operator, UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, Vocabulary
from sleepcast.mind.rules import Rule, in_order
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

Details = Mapping[str, object]
"""Fields of an answer's body."""
NOTHING: Details = MappingProxyType({})


class InspectionError(SleepcastError):
    """The robot cannot answer an inspection request."""


class Knowledge(Protocol):
    """What a robot has learned, by key in order of arrival."""

    @property
    def rules(self) -> Mapping[str, Rule]: ...

    @property
    def symbols(self) -> Mapping[str, Declared]: ...

    @property
    def operators(self) -> Mapping[str, Program]: ...


@dataclass(frozen=True, slots=True)
class Self:
    """What a robot knows of itself.

    values: by slot.
    peek: gives a value wherever it is stored.
    groups: keys.
    """

    vocabulary: Vocabulary
    learned: Knowledge
    values: Sequence[float]
    peek: Callable[[int], float]
    groups: Collection[str]


@dataclass(frozen=True, slots=True)
class BodyState:
    """What a robot knows of its body, and of who holds it: see `Node`. stops: see `authority.stops_told`. motion: see
    `TelemetryRecord`."""

    stopped: bool
    driven: bool
    doubt: str
    catching_up: bool
    stops: Sequence[object]
    motion: Motion | None


def answer_inspection(
    body: Mapping[str, object],
    robot: Self,
    state: BodyState,
    why: Callable[[str | None], Explanation],
) -> Details:
    """The answer to a request with this body. why: explains a command, a rule, or the last command."""
    what, of = body.get(LOOK), body.get(OF)
    try:
        if what == Inspection.TELEMETRY:
            record = telemetry(robot, state).body()
            return {TELEMETRY: record, **({STOPS: state.stops} if state.stops else {})}
        if what == Inspection.VOCABULARY:
            return {TELEMETRY: _fitting(vocabulary_text(robot.vocabulary), "it has more names")}
        if what == Inspection.MIND:
            return {TELEMETRY: _fitting(mind_text(robot.learned), "it has learned more")}
        if what == Inspection.WHY:
            return {TELEMETRY: why_text(why(of if isinstance(of, str) else None))}
        known = ", ".join(Inspection)
        raise InspectionError(f"no look called {printable(str(what))[:80]!r}: there are {known}")
    except SleepcastError as error:
        return {"fault": str(error).splitlines()[0]}


def telemetry(robot: Self, state: BodyState) -> TelemetryRecord:
    """A robot's current variables and flags."""
    slots = (*range(ACTIVE0 + 1), *range(ACTIVE0 + BUFFERS, robot.vocabulary.size))
    symbols = robot.learned.symbols
    return TelemetryRecord(
        digest(vocabulary_text(robot.vocabulary)),
        digest(mind_text(robot.learned)),
        packed([robot.peek(slot) for slot in slots]),
        sum(1 << i - 1 for i in range(1, BUFFERS) if robot.values[ACTIVE0 + i] > 0.0),
        bits([rule.active for rule in in_order(robot.learned.rules)]),
        {each.name: robot.values[each.slot] for each in symbols.values() if isinstance(each, UserVariable)},
        [each.name for key, each in symbols.items() if key in robot.groups],
        state.stopped,
        state.driven,
        state.doubt,
        state.catching_up,
        state.motion,
    )


def mind_text(learned: Knowledge) -> str:
    """What it has learned as JSON: the groups it has heard of, its operators, and its rules in order of evaluation."""
    symbols = learned.symbols.items()
    return as_text(
        MindRecord(
            [each.name for _, each in symbols if isinstance(each, Group)],
            [
                (each.name, list(each.parameters), learned.operators[key].text)
                for key, each in symbols
                if isinstance(each, Operator)
            ],
            [(rule.name, rule.text, rule.protected) for rule in in_order(learned.rules)],
            {rule.name: rule.shown_priority for rule in in_order(learned.rules) if rule.shown_priority},
        )
    )


def _fitting(text: str, too_long: str) -> str:
    if len(text.encode()) > MAX_TEXT_BYTES:
        raise InspectionError(f"{too_long} than fits into one message")
    return text


def foretold(message: Message, outcome: Foretold, *, undecided: bool) -> Details:
    """What an answer to a question says besides the value, where it asks whether the robot would obey. undecided:
    whether its test was unknown."""
    if MATCHED not in message.body:
        return NOTHING
    unknown = {UNKNOWN: True} if undecided and not outcome.matched else {}
    return {MATCHED: outcome.matched, **unknown}
