"""Looks: what a robot tells of itself when it is asked, so that a desk far away can check names and foresee who obeys.

    telemetry    its numbers in the order of its vocabulary, groups, flags: small, asked for often
    vocabulary   the names of its type: asked for once for all robots of the type
    mind         what it has learned: asked for once for all robots that have learned the same
    why          how it evaluated a command

Vocabulary and mind are JSON texts, and telemetry names both by a digest of their bytes: who has the text of that digest
need not ask for it, and nobody has to be believed about what a digest stands for. docs/wire.md has the layouts.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from math import isfinite, isnan
from struct import pack
from types import MappingProxyType
from weakref import WeakKeyDictionary

from sleepcast.channel.message import MAX_TEXT
from sleepcast.channel.payload import LOOK, OF, STOPS, TOLD, Inspection
from sleepcast.core.errors import SleepcastError, printable
from sleepcast.core.units import Quantity
from sleepcast.language.explain import Explanation, Step
from sleepcast.language.symbols import Group, Operator, UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, Constant, HostFunction, Vocabulary
from sleepcast.mind.rules import in_order
from sleepcast.node.memory import RobotMemory

MAX_TEXT_BYTES = 49_152
"""Bytes of a vocabulary, a mind or an explanation as text: well within one message."""
MAX_DOC = 200
"""Characters of what a vocabulary says about a name."""
STEPS_SENT = (250, 60, 15, 1)
"""Parts of an explained expression that are told, fewer where their texts are too long together."""
MAX_STEP_TEXT = 120
"""Characters of the text of one of them."""
DIGEST_BYTES = 8
"""Bytes of a digest: nobody comes upon two texts of one digest by accident, and who makes them lies about himself."""

Details = Mapping[str, object]
"""What the body of an answer says besides that it is one."""
NOTHING: Details = MappingProxyType({})


class TelemetryError(SleepcastError):
    """What a robot cannot tell."""


def answer_look(
    body: Mapping[str, object],
    memory: RobotMemory,
    stopped: bool,
    doubt: str,
    stops: Sequence[object],
    why: Callable[[str | None], Explanation],
) -> Details:
    """What is told to a question with this body. stopped, doubt: see `Node`; stops: see `Authority.stops`. why:
    explains a command, a rule, or the last command."""
    what, of = body.get(LOOK), body.get(OF)
    try:
        if what == Inspection.TELEMETRY:
            return {TOLD: telemetry(memory, stopped, doubt), **({STOPS: stops} if stops else {})}
        if what == Inspection.VOCABULARY:
            return {TOLD: _fitting(vocabulary_text(memory.vocabulary), "it has more names")}
        if what == Inspection.MIND:
            return {TOLD: _fitting(mind_text(memory), "it has learned more")}
        if what == Inspection.WHY:
            return {TOLD: why_text(why(of if isinstance(of, str) else None))}
        known = ", ".join(Inspection)
        raise TelemetryError(f"no look called {printable(str(what))[:80]!r}: there are {known}")
    except SleepcastError as error:
        return {"fault": str(error).splitlines()[0]}


def digest(text: str) -> bytes:
    """What names a text: the first bytes of the SHA-256 of its UTF-8."""
    return sha256(text.encode()).digest()[:DIGEST_BYTES]


def telemetry(memory: RobotMemory, stopped: bool, doubt: str) -> dict[str, object]:
    """A robot's numbers and flags now.

    values: float64, little endian, SI, NaN for unknown: every variable of the vocabulary in its order, but for the
    active flags of buffers, which are bits of `active`. running: which of the mind's rules run, bits, the first lowest.
    """
    slots = (*range(ACTIVE0 + 1), *range(ACTIVE0 + BUFFERS, memory.vocabulary.size))
    numbers = [memory.peek(slot) for slot in slots]
    rules = list(in_order(memory.base.rules))
    learned = memory.base.symbols.values()
    told = {"doubt": doubt} if doubt else {}
    return told | {
        "type": digest(vocabulary_text(memory.vocabulary)),
        "mind": digest(mind_text(memory)),
        "values": pack(f"<{len(numbers)}d", *numbers),
        "active": sum(1 << i - 1 for i in range(1, BUFFERS) if memory.values[ACTIVE0 + i] > 0.0),
        "running": _bits([rule.active for rule in rules]),
        "user": {found.name: memory.values[found.slot] for found in learned if isinstance(found, UserVariable)},
        "groups": [found.name for key, found in memory.base.symbols.items() if key in memory.groups],
        "stopped": stopped,
        "driven": memory.driven,
    }


def _bits(flags: list[bool]) -> bytes:
    """Flags as bits, the first one the lowest of the first byte."""
    number = sum(1 << at for at, flag in enumerate(flags) if flag)
    return number.to_bytes((len(flags) + 7) // 8, "little")


# ---- what a type knows

_TEXTS: WeakKeyDictionary[Vocabulary, str] = WeakKeyDictionary()


def vocabulary_text(vocabulary: Vocabulary) -> str:
    """The names of a type as JSON; without what is said about them where there are too many."""
    found = _TEXTS.get(vocabulary)
    if found is None:
        found = _described(vocabulary, MAX_DOC)
        if len(found.encode()) > MAX_TEXT_BYTES:
            found = _described(vocabulary, 0)
        _TEXTS[vocabulary] = found
    return found


def _described(vocabulary: Vocabulary, doc: int) -> str:
    def constant(found: Constant) -> object:
        return [found.name, _finite(found.value), found.dimension, found.doc[:doc]]

    def quantity(found: Quantity) -> object:
        bounds = (_finite(found.low), _finite(found.high), _finite(found.freshness))
        return [found.name, found.unit, *bounds, found.doc[:doc], found.shown_as]

    def function(found: HostFunction) -> object:
        least = len(found.dimensions) if found.least is None else found.least
        shape = (
            list(found.dimensions),
            least,
            found.arguments,
            found.result,
            found.acts,
            found.labelled,
            found.irreversible,
        )
        return [found.name, *shape, found.doc[:doc]]

    return _json(
        {
            "name": vocabulary.name,
            "sensors": [quantity(found) for found in vocabulary.sensors],
            "actuators": [quantity(found) for found in vocabulary.actuators],
            "constants": [constant(found) for found in vocabulary.constants],
            "functions": [function(found) for found in vocabulary.functions],
        }
    )


# ---- what a robot has learned


def mind_text(memory: RobotMemory) -> str:
    """What it has learned as JSON: the groups it has heard of, its operators, and its rules in the order of a round."""
    learned = memory.base.symbols.items()
    return _json(
        {
            "groups": [found.name for _, found in learned if isinstance(found, Group)],
            "operators": [
                [found.name, found.parameters, memory.base.operators[key].text]
                for key, found in learned
                if isinstance(found, Operator)
            ],
            "rules": [[rule.name, rule.text, rule.protected] for rule in in_order(memory.base.rules)],
        }
    )


# ---- why


def why_text(explanation: Explanation) -> str:
    """An explanation as JSON: its upper parts, where there are too many."""
    for most in STEPS_SENT:
        found = _json(
            {
                "text": explanation.text[: MAX_TEXT // 8],
                "value": _known(explanation.value),
                "matched": explanation.matched,
                "reason": explanation.reason[: 4 * MAX_STEP_TEXT],
                "faults": [fault[: 4 * MAX_STEP_TEXT] for fault in explanation.faults[:10]],
                "command": explanation.command,
                "time": explanation.time,
                "root": _pruned(explanation.root, most),
            }
        )
        if len(found.encode()) <= MAX_TEXT_BYTES:
            break
    return found


def _pruned(root: Step, most: int) -> object:
    """The first `most` parts of a tree, level by level: [text, value, start, end, what is to be noted, parts]."""
    level: list[tuple[Step, list[object]]] = [(root, [])]
    found = _step(root, level[0][1])
    told = 1
    while level:
        below: list[tuple[Step, list[object]]] = []
        for step, parts in level:
            for child in step.children[: max(0, most - told)]:
                inside: list[object] = []
                parts.append(_step(child, inside))
                below.append((child, inside))
                told += 1
        level = below
    return found


def _step(step: Step, parts: list[object]) -> list[object]:
    text = step.text if len(step.text) <= MAX_STEP_TEXT else f"{step.text[: MAX_STEP_TEXT - 3]}..."
    note = (step.fault or step.note)[: 2 * MAX_STEP_TEXT]
    return [text, None if step.value is None else _known(step.value), step.start, step.end, note, parts]


def _known(value: float) -> object:
    """A value of an explanation: unknown is a text, because null is what was not evaluated."""
    return "UNKNOWN" if isnan(value) else _finite(value)


def _fitting(text: str, too_long: str) -> str:
    if len(text.encode()) > MAX_TEXT_BYTES:
        raise TelemetryError(f"{too_long} than fits into one message")
    return text


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
