"""Tellings: what robots tell of themselves on the air, read as something that anybody may have written.

`sleepcast.node.telemetry` writes these; here every one of them is checked before anything is made of it: sorts,
lengths, names. Whatever else comes is a `TelemetryError`, and no other.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from math import inf, isfinite, nan
from struct import unpack
from typing import Annotated, TypeVar

import msgspec

from sleepcast.core.serial import UNREADABLE
from sleepcast.core.units import UNITS, Dimension, Quantity
from sleepcast.language.explain import Explanation, Step
from sleepcast.language.reader import is_name
from sleepcast.language.vocabulary import (
    BUFFERS,
    MAX_GROUPS,
    MAX_OPERATORS,
    MAX_RULES,
    MAX_USER_VARIABLES,
    SUPPORT,
    Constant,
    HostFunction,
    Vocabulary,
    VocabularyError,
)

MAX_NAMES = 512
"""Sensors, actuators, constants and functions of one type, of each sort."""
MAX_TEXT_BYTES = 65_536
"""Bytes of a text that is looked at: more does not come in one message."""
MAX_EXPONENT = 9
"""Of a dimension, either way."""
MAX_LEVELS = 200
"""Parts of an explanation within each other: an expression has a hundred at most, through all that it enters."""
MAX_DOUBT = 200
"""Characters of why a robot stands although nobody may have stopped it."""
DIGEST_BYTES = 8
TOLD_SUPPORT = len(SUPPORT) - (BUFFERS - 1)
"""Support variables that are told as numbers; the others are the active flags of buffers."""

Name = Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
Words = Annotated[str, msgspec.Meta(max_length=1_024)]
Text = Annotated[str, msgspec.Meta(max_length=16_384)]
Exponents = tuple[int, int, int]


class TelemetryError(ValueError):
    """A telling that says something else than it should; whoever asked for it knows whose it is."""


class QuantityRecord(msgspec.Struct, array_like=True):
    """See `Quantity`. Bounds that are None are infinite."""

    name: Name
    unit: str
    low: float | None
    high: float | None
    freshness: float | None
    doc: Words
    shown_as: str

    def made(self) -> Quantity:
        if not is_name(self.name) or not {self.unit, self.shown_as} <= {*UNITS, ""}:
            raise TelemetryError(f"a variable {self.name!r} in {self.unit[:20]!r} or {self.shown_as[:20]!r}")
        low, high = -inf if self.low is None else self.low, inf if self.high is None else self.high
        if not low <= high:
            raise TelemetryError(f"a variable {self.name!r} from {low:g} to {high:g}")
        freshness = inf if self.freshness is None else self.freshness
        return Quantity(self.name, self.unit, low, high, freshness, self.doc, self.shown_as)


class ConstantRecord(msgspec.Struct, array_like=True):
    """See `Constant`. A value that is None is unknown."""

    name: Name
    value: float | None
    dimension: Exponents | None
    doc: Words

    def made(self) -> Constant:
        _named(self.name)
        return Constant(self.name, nan if self.value is None else self.value, _dimension(self.dimension), self.doc)


class FunctionRecord(msgspec.Struct, array_like=True):
    """See `HostFunction`."""

    name: Name
    dimensions: Annotated[list[Exponents | None], msgspec.Meta(max_length=100)]
    least: int
    arguments: Words
    result: Exponents | None
    acts: bool
    labelled: bool
    irreversible: bool
    doc: Words

    def made(self) -> HostFunction:
        _named(self.name)
        if not 0 <= self.least <= len(self.dimensions):
            raise TelemetryError(f"a function {self.name!r} of {self.least} to {len(self.dimensions)} arguments")
        dimensions = tuple(map(_dimension, self.dimensions))
        result = _dimension(self.result)
        shape = (self.least, self.arguments, result, self.acts, self.labelled, self.doc)
        return HostFunction(self.name, _far_away, dimensions, *shape, irreversible=self.irreversible)


class VocabularyRecord(msgspec.Struct):
    """See `Vocabulary`."""

    name: Words
    sensors: Annotated[list[QuantityRecord], msgspec.Meta(max_length=MAX_NAMES)]
    actuators: Annotated[list[QuantityRecord], msgspec.Meta(max_length=MAX_NAMES)]
    constants: Annotated[list[ConstantRecord], msgspec.Meta(max_length=MAX_NAMES)]
    functions: Annotated[list[FunctionRecord], msgspec.Meta(max_length=MAX_NAMES)]


class MindRecord(msgspec.Struct):
    """What a robot has learned. operators: name, parameters, text. rules: name, text, whether it is built in."""

    groups: Annotated[list[Name], msgspec.Meta(max_length=MAX_GROUPS)]
    operators: Annotated[list[tuple[Name, list[Name], Text]], msgspec.Meta(max_length=MAX_OPERATORS)]
    rules: Annotated[list[tuple[Name, Text, bool]], msgspec.Meta(max_length=MAX_RULES + BUFFERS)]


class TelemetryRecord(msgspec.Struct):
    """What a robot tells of itself now; see `sleepcast.node.telemetry.telemetry`."""

    type: Annotated[bytes, msgspec.Meta(min_length=DIGEST_BYTES, max_length=DIGEST_BYTES)]
    mind: Annotated[bytes, msgspec.Meta(min_length=DIGEST_BYTES, max_length=DIGEST_BYTES)]
    values: Annotated[bytes, msgspec.Meta(max_length=8 * (2 * MAX_NAMES + len(SUPPORT)))]
    active: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
    running: Annotated[bytes, msgspec.Meta(max_length=(MAX_RULES + BUFFERS) // 8 + 1)]
    user: Annotated[dict[Name, float], msgspec.Meta(max_length=MAX_USER_VARIABLES)]
    groups: Annotated[list[Name], msgspec.Meta(max_length=MAX_GROUPS)]
    stopped: bool
    driven: bool = False
    doubt: Annotated[str, msgspec.Meta(max_length=MAX_DOUBT)] = ""

    def numbers(self) -> Sequence[float]:
        """The numbers, NaN for unknown: the support variables but for the active flags, sensors, actuators."""
        return [value if isfinite(value) else nan for value in unpack(f"<{len(self.values) // 8}d", self.values)]

    def runs(self, rule: int) -> bool:
        """Whether a rule of the mind runs."""
        return rule // 8 < len(self.running) and bool(self.running[rule // 8] >> rule % 8 & 1)


class StepRecord(msgspec.Struct, array_like=True):
    """See `Step`. A value that is a text is unknown."""

    text: Words
    value: float | str | None
    start: int
    end: int
    note: Words
    parts: list[StepRecord]

    def made(self, levels: int = MAX_LEVELS) -> Step:
        if not levels:
            raise TelemetryError(f"an explanation of more than {MAX_LEVELS} levels")
        children = tuple(part.made(levels - 1) for part in self.parts)
        value = None if self.value is None else _value(self.value)
        return Step(self.text, value, self.start, self.end, None, self.note, children)


class ExplanationRecord(msgspec.Struct):
    """See `Explanation`."""

    text: Text
    value: float | str | None
    matched: bool
    reason: Words
    faults: list[Words]
    command: Words
    time: float
    root: StepRecord

    def made(self) -> Explanation:
        about = (tuple(self.faults), self.command, self.time)
        return Explanation(self.text, _value(self.value), self.matched, self.reason, self.root.made(), *about)


Record = TypeVar("Record", bound=msgspec.Struct)


def digest(text: str) -> bytes:
    """What names a text."""
    return sha256(text.encode()).digest()[:DIGEST_BYTES]


def read_telemetry(told: object) -> TelemetryRecord:
    """Telemetry as it comes in a body. Raises TellingError."""
    try:
        found = msgspec.convert(told, TelemetryRecord, strict=True)
    except UNREADABLE as error:
        raise TelemetryError(str(error)) from None
    found.groups = [name for name in found.groups if is_name(name)]
    if len(found.values) % 8:
        raise TelemetryError(f"{len(found.values)} bytes of numbers of eight bytes each")
    return found


def read_vocabulary(text: str) -> Vocabulary:
    """A vocabulary. Its functions cannot be called. Raises TellingError."""
    told = _decoded(VocabularyRecord, text)
    try:
        return Vocabulary(
            told.name,
            tuple(found.made() for found in told.sensors),
            tuple(found.made() for found in told.actuators),
            constants=tuple(found.made() for found in told.constants),
            functions=tuple(found.made() for found in told.functions),
        )
    except VocabularyError as error:
        raise TelemetryError(str(error)) from None


def read_mind(text: str) -> MindRecord:
    """What a robot has learned. Raises TellingError."""
    told = _decoded(MindRecord, text)
    for name in (*told.groups, *(found[0] for found in (*told.operators, *told.rules))):
        _named(name)
    for _, parameters, _ in told.operators:
        for name in parameters:
            _named(name)
    return told


def read_why(text: str) -> Explanation:
    """An explanation. Raises TellingError."""
    return _decoded(ExplanationRecord, text).made()


def _decoded(kind: type[Record], text: object) -> Record:
    if not isinstance(text, str) or len(text) > MAX_TEXT_BYTES:
        raise TelemetryError("no text, or one that is too long")
    try:
        return msgspec.json.decode(text, type=kind)
    except UNREADABLE as error:
        raise TelemetryError(str(error)) from None


def _named(name: str) -> None:
    if not is_name(name):
        raise TelemetryError(f"a name {name!r}, which cannot stand in an expression")


def _dimension(told: Exponents | None) -> Dimension | None:
    if told is None:
        return None
    if max(map(abs, told)) > MAX_EXPONENT:
        raise TelemetryError(f"a dimension of {told}")
    return Dimension(*told)


def _value(told: float | str | None) -> float:
    return float(told) if isinstance(told, float | int) else nan


def _far_away(body: object, *arguments: float) -> float:
    raise TypeError("this function is a robot's own, and the robot is far away")
