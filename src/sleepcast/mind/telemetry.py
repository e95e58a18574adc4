"""Telemetry: what robots report on request, so that a remote desk can check names and predict which robots will obey.
Both ends are here: how a robot describes itself, and how a desk reads that.

    telemetry    its values in the order of its vocabulary, groups, flags: small, requested often
    vocabulary   the names of its type: requested once for all robots of the type
    mind         what it has learned: requested once for all robots that have learned the same
    why          how it evaluated a command

Vocabulary, mind and explanation are JSON texts. Telemetry identifies the first two by a digest of their bytes, so a
desk requests only texts that it does not have, and computes the digest of each text itself. Input is untrusted:
types, lengths and names are checked before it is used, and anything malformed raises `TelemetryError`. docs/wire.md
has the layouts.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from math import inf, isfinite, isnan, nan
from struct import pack
from typing import Annotated, TypeVar
from weakref import WeakKeyDictionary

import msgspec

from sleepcast.channel.message import MAX_TEXT
from sleepcast.core.model import Constant, HostFunction, MapOutline, NeighbourSensor, Quantity, RestState
from sleepcast.core.neighbours import NEAREST_ID, field_named
from sleepcast.core.serial import UNREADABLE
from sleepcast.core.units import UNITS, Dimension
from sleepcast.language.explain import BidStanding, BidState, Explanation, Step
from sleepcast.language.functions import MAX_CHOSEN
from sleepcast.language.reader import is_name
from sleepcast.language.vocabulary import (
    BUFFERS,
    MAX_GROUPS,
    MAX_OPERATORS,
    MAX_RULES,
    MAX_USER_VARIABLES,
    SUPPORT,
    Vocabulary,
    VocabularyError,
)

MAX_NAMES = 512
"""Sensors, actuators, constants and functions of one type, each."""
MAX_TEXT_BYTES = 49_152
"""Bytes of a vocabulary, a mind or an explanation that a robot sends: well within one message."""
MAX_TEXT_READ = 65_536
"""Characters of a text that is read: more does not fit into one message."""
MAX_DOC = 200
"""Characters of a name's description in a vocabulary."""
STEPS_SENT = (250, 60, 15, 1)
"""Parts of an explained expression that are sent: the first number for which they fit into a message."""
MAX_OUTLINES, MAX_COORDINATES, FARTHEST = 96, 400, 1e7
"""Outlines of one type, numbers of each, two a point; and m from the origin within which they lie."""
MAX_STEP_TEXT = 120
"""Characters of the text of one part."""
MAX_EXPONENT = 9
"""Largest exponent in a dimension, positive or negative."""
MAX_LEVELS = 200
"""Nesting of an explanation: an expression has at most a hundred levels, including everything that it enters."""
MAX_DOUBT = 200
"""Characters of the reason why a robot is stopped without a known STOP."""
DIGEST_BYTES = 8
"""Bytes of a digest: accidental collisions do not happen, and a forged one only misrepresents its own robot."""

Name = Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
Words = Annotated[str, msgspec.Meta(max_length=1_024)]
Text = Annotated[str, msgspec.Meta(max_length=16_384)]
Exponents = tuple[int, int, int]
Coordinates = Annotated[list[float], msgspec.Meta(max_length=MAX_COORDINATES)]
Motion = tuple[float | None, float | None]
"""Speed, m/s, and how far the body still goes, m; None for unknown."""


class TelemetryError(ValueError):
    """Telemetry that is malformed; its receiver knows the sender."""


class QuantityRecord(msgspec.Struct, array_like=True):
    """See `Quantity`. Bounds that are None are infinite."""

    name: Name
    unit: str
    low: float | None
    high: float | None
    freshness: float | None
    doc: Words
    shown_as: str

    @classmethod
    def of(cls, quantity: Quantity, doc: int) -> QuantityRecord:
        """doc: characters kept of its description."""
        bounds = _finite(quantity.low), _finite(quantity.high), _finite(quantity.freshness)
        return cls(quantity.name, quantity.unit, *bounds, quantity.doc[:doc], quantity.shown_as)

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

    @classmethod
    def of(cls, constant: Constant, doc: int) -> ConstantRecord:
        return cls(constant.name, _finite(constant.value), constant.dimension, constant.doc[:doc])

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

    @classmethod
    def of(cls, function: HostFunction, doc: int) -> FunctionRecord:
        least = len(function.dimensions) if function.least is None else function.least
        flags = function.acts, function.labelled, function.irreversible
        return cls(
            function.name,
            list(function.dimensions),
            least,
            function.arguments,
            function.result,
            *flags,
            function.doc[:doc],
        )

    def made(self) -> HostFunction:
        _named(self.name)
        if not 0 <= self.least <= len(self.dimensions):
            raise TelemetryError(f"a function {self.name!r} of {self.least} to {len(self.dimensions)} arguments")
        dimensions = tuple(map(_dimension, self.dimensions))
        result = _dimension(self.result)
        shape = (self.least, self.arguments, result, self.acts, self.labelled, self.doc)
        return HostFunction(self.name, _far_away, dimensions, *shape, irreversible=self.irreversible)


class VocabularyRecord(msgspec.Struct, omit_defaults=True):
    """See `Vocabulary`. forms: forms and parts of forms that robots of 0.2.0 do not have, and that these robots know.
    neighbours: what their neighbours show, by name, each with its unit. numbers: functions whose name alone is a
    number, see `HostFunction.value`. outlines: see `MapOutline`: name, x and y of the points, closed."""

    name: Words
    sensors: Annotated[list[QuantityRecord], msgspec.Meta(max_length=MAX_NAMES)]
    actuators: Annotated[list[QuantityRecord], msgspec.Meta(max_length=MAX_NAMES)]
    constants: Annotated[list[ConstantRecord], msgspec.Meta(max_length=MAX_NAMES)]
    functions: Annotated[list[FunctionRecord], msgspec.Meta(max_length=MAX_NAMES)]
    forms: Annotated[list[Name], msgspec.Meta(max_length=MAX_NAMES)] = []
    neighbours: Annotated[list[tuple[Name, str]], msgspec.Meta(max_length=MAX_NAMES)] = []
    numbers: Annotated[list[tuple[Name, float]], msgspec.Meta(max_length=MAX_NAMES)] = []
    outlines: Annotated[list[tuple[Name, Coordinates, bool]], msgspec.Meta(max_length=MAX_OUTLINES)] = []

    @classmethod
    def of(cls, vocabulary: Vocabulary, doc: int) -> VocabularyRecord:
        return cls(
            vocabulary.name,
            [QuantityRecord.of(each, doc) for each in vocabulary.sensors],
            [QuantityRecord.of(each, doc) for each in vocabulary.actuators],
            [ConstantRecord.of(each, doc) for each in vocabulary.constants],
            [FunctionRecord.of(each, doc) for each in vocabulary.functions],
            sorted(vocabulary.forms),
            _shown(vocabulary),
            [(each.name, each.value) for each in vocabulary.functions if each.value is not None],
            [each for each in map(_drawn, vocabulary.outlines) if each is not None] if doc else [],
        )

    def made(self) -> Vocabulary:
        """The vocabulary, without callable functions."""
        numbers = dict(self.numbers)
        functions = (replace(each.made(), value=numbers.get(each.name)) for each in self.functions)
        return Vocabulary(
            self.name,
            tuple(each.made() for each in self.sensors),
            tuple(each.made() for each in self.actuators),
            constants=tuple(each.made() for each in self.constants),
            functions=tuple(map(self._with_neighbours, functions)),
            forms=frozenset(self.forms),
            outlines=tuple(map(_outline, self.outlines)),
        )

    def _with_neighbours(self, function: HostFunction) -> HostFunction:
        """The same function, with what neighbours show if it is the one that finds them."""
        if function.name != NEAREST_ID or not self.neighbours:
            return function
        for name, unit in self.neighbours:
            if not is_name(name) or unit not in {*UNITS, ""}:
                raise TelemetryError(f"neighbours that show {name!r} in {unit[:20]!r}")
        fields = tuple(field_named(name, unit, "", _far_away, None) for name, unit in self.neighbours)
        return replace(function, neighbours=NeighbourSensor(_nobody, None, fields))


def _drawn(outline: MapOutline) -> tuple[str, list[float], bool] | None:
    """An outline as it goes over the air, in centimetres; None for one of too many points."""
    numbers = [round(number, 2) for point in outline.points for number in point]
    return (outline.name, numbers, outline.closed) if len(numbers) <= MAX_COORDINATES else None


def _outline(sent: tuple[str, list[float], bool]) -> MapOutline:
    """The outline that was sent. Raises TelemetryError."""
    name, numbers, closed = sent
    if not is_name(name) or len(numbers) % 2 or not all(abs(number) <= FARTHEST for number in numbers):
        raise TelemetryError(f"an outline {name!r} of {len(numbers)} numbers")
    return MapOutline(name, tuple(zip(numbers[::2], numbers[1::2], strict=True)), closed)


def _shown(vocabulary: Vocabulary) -> list[tuple[str, str]]:
    """What neighbours show to robots of a vocabulary, each with its unit."""
    sensor = None if vocabulary.neighbours is None else vocabulary.neighbours.neighbours
    return [] if sensor is None else [(name, function.unit) for name, function in sensor.fields]


class MindRecord(msgspec.Struct, omit_defaults=True):
    """What a robot has learned.

    operators: name, parameters, text.
    rules: name, text, whether it is built in.
    priorities: of the rules that have another than 0, by their names.
    """

    groups: Annotated[list[Name], msgspec.Meta(max_length=MAX_GROUPS)]
    operators: Annotated[list[tuple[Name, list[Name], Text]], msgspec.Meta(max_length=MAX_OPERATORS)]
    rules: Annotated[list[tuple[Name, Text, bool]], msgspec.Meta(max_length=MAX_RULES + BUFFERS)]
    priorities: Annotated[dict[Name, int], msgspec.Meta(max_length=MAX_RULES + BUFFERS)] = {}


class TelemetryRecord(msgspec.Struct):
    """A robot's current state.

    type, mind: digests of the texts.
    values: float64, little endian, SI, NaN for unknown: every variable of the vocabulary in its order, except for the
        active flags of buffers, which are bits of `active`.
    running: which of the mind's rules are active, as bits, lowest first.
    user: user variables.
    groups: those it is in.
    catching_up: whether it rests until it has the standing commands that others have.
    motion: see `rest_state`; None if it is not stopped, or does not tell.
    """

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
    catching_up: bool = False
    motion: Motion | None = None

    def body(self) -> dict[str, object]:
        """The record as part of an answer's body; what is rarely so is left out unless it is."""
        fields = msgspec.structs.asdict(self)
        return {key: value for key, value in fields.items() if value or key not in ("doubt", "catching_up", "motion")}

    @property
    def rest_state(self) -> RestState | None:
        """Whether the stopped body has come to rest; None if it is not stopped, or does not tell."""
        return read_motion(self.motion) if self.stopped else None

    @property
    def group_keys(self) -> frozenset[str]:
        """Keys of the groups that it is in."""
        return frozenset(name.casefold() for name in self.groups)

    def runs(self, rule: int) -> bool:
        """Whether a rule of the mind is active."""
        return rule // 8 < len(self.running) and bool(self.running[rule // 8] >> rule % 8 & 1)


class StepRecord(msgspec.Struct, array_like=True):
    """See `Step`. A value that is a text is unknown."""

    text: Words
    value: float | str | None
    start: int
    end: int
    note: Words
    parts: list[StepRecord]

    @classmethod
    def of(cls, root: Step, most: int) -> StepRecord:
        """The first `most` parts of a tree, level by level."""
        tree = cls._alone(root)
        level, sent = [(root, tree)], 1
        while level:
            below: list[tuple[Step, StepRecord]] = []
            for step, record in level:
                for child in step.children[: max(0, most - sent)]:
                    record.parts.append(cls._alone(child))
                    below.append((child, record.parts[-1]))
                    sent += 1
            level = below
        return tree

    @classmethod
    def _alone(cls, step: Step) -> StepRecord:
        text = step.text if len(step.text) <= MAX_STEP_TEXT else f"{step.text[: MAX_STEP_TEXT - 3]}..."
        note = (step.fault or step.note)[: 2 * MAX_STEP_TEXT]
        return cls(text, None if step.value is None else _known(step.value), step.start, step.end, note, [])

    def made(self, levels: int = MAX_LEVELS) -> Step:
        if not levels:
            raise TelemetryError(f"an explanation of more than {MAX_LEVELS} levels")
        children = tuple(part.made(levels - 1) for part in self.parts)
        value = None if self.value is None else _value(self.value)
        return Step(self.text, value, self.start, self.end, None, self.note, children)


class BidRecord(msgspec.Struct, omit_defaults=True):
    """See `BidStanding`; a number that is unknown is none."""

    name: Words
    cost: float | None
    state: BidState
    better: Annotated[list[tuple[Words, float | None]], msgspec.Meta(max_length=MAX_CHOSEN)] = []

    @classmethod
    def of(cls, bid: BidStanding) -> BidRecord:
        better = [(name, _finite(cost)) for name, cost in bid.better[:MAX_CHOSEN]]
        return cls(bid.name, _finite(bid.cost), bid.state, better)

    def made(self) -> BidStanding:
        better = tuple((name, nan if cost is None else cost) for name, cost in self.better)
        return BidStanding(self.name, nan if self.cost is None else self.cost, self.state, better)


class ExplanationRecord(msgspec.Struct, omit_defaults=True):
    """See `Explanation`."""

    text: Text
    value: float | str | None
    matched: bool
    reason: Words
    faults: list[Words]
    command: Words
    time: float
    root: StepRecord
    held: bool = False
    priority: int = 0
    bid: BidRecord | None = None

    @classmethod
    def of(cls, explanation: Explanation, most: int) -> ExplanationRecord:
        """most: parts of the expression that are included."""
        return cls(
            explanation.text[: MAX_TEXT // 8],
            _known(explanation.value),
            explanation.matched,
            explanation.reason[: 4 * MAX_STEP_TEXT],
            [fault[: 4 * MAX_STEP_TEXT] for fault in explanation.faults[:10]],
            explanation.command,
            explanation.time,
            StepRecord.of(explanation.root, most),
            explanation.held,
            explanation.priority,
            None if explanation.bid is None else BidRecord.of(explanation.bid),
        )

    def made(self) -> Explanation:
        bid = None if self.bid is None else self.bid.made()
        about = (tuple(self.faults), self.command, self.time, self.held, self.priority, bid)
        return Explanation(self.text, _value(self.value), self.matched, self.reason, self.root.made(), *about)


def digest(text: str) -> bytes:
    """The digest of a text: the first bytes of the SHA-256 of its UTF-8."""
    return sha256(text.encode()).digest()[:DIGEST_BYTES]


# ---- written by a robot

_TEXTS: WeakKeyDictionary[Vocabulary, str] = WeakKeyDictionary()


def vocabulary_text(vocabulary: Vocabulary) -> str:
    """The names of a type as JSON; without descriptions and outlines if it would be too long."""
    text = _TEXTS.get(vocabulary)
    if text is None:
        text = as_text(VocabularyRecord.of(vocabulary, MAX_DOC))
        if len(text.encode()) > MAX_TEXT_BYTES:
            text = as_text(VocabularyRecord.of(vocabulary, 0))
        _TEXTS[vocabulary] = text
    return text


def why_text(explanation: Explanation) -> str:
    """An explanation as JSON: only its upper parts if it would be too long."""
    for most in STEPS_SENT:
        text = as_text(ExplanationRecord.of(explanation, most))
        if len(text.encode()) <= MAX_TEXT_BYTES:
            break
    return text


def as_text(record: msgspec.Struct) -> str:
    """A record as JSON: equal records give equal bytes, because texts are identified by digests."""
    return json.dumps(msgspec.to_builtins(record), ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def bits(flags: Sequence[bool]) -> bytes:
    """Flags as bits, the first one the lowest of the first byte."""
    number = sum(1 << at for at, flag in enumerate(flags) if flag)
    return number.to_bytes((len(flags) + 7) // 8, "little")


def packed(numbers: Sequence[float]) -> bytes:
    """Numbers in the format of `TelemetryRecord.values`."""
    return pack(f"<{len(numbers)}d", *numbers)


def _known(value: float) -> float | str | None:
    """A value in an explanation: unknown is a text, because null stands for parts that were not evaluated."""
    return "UNKNOWN" if isnan(value) else _finite(value)


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


# ---- read by a desk


def read_telemetry(record: object) -> TelemetryRecord:
    """The telemetry in a body. Raises TelemetryError."""
    try:
        if isinstance(record, TelemetryRecord):
            telemetry = record
        else:
            telemetry = msgspec.convert(record, TelemetryRecord, strict=True)
    except UNREADABLE as error:
        raise TelemetryError(str(error)) from None
    telemetry.groups = [name for name in telemetry.groups if is_name(name)]
    if len(telemetry.values) % 8:
        raise TelemetryError(f"{len(telemetry.values)} bytes of numbers of eight bytes each")
    return telemetry


def motion_of(state: RestState) -> Motion:
    """How a body moves, as it goes over the air."""
    return _finite(state.speed), _finite(state.distance)


def read_motion(sent: object) -> RestState | None:
    """How a stopped body moves, as a body says it; None for what says nothing."""
    match sent:
        case [speed, distance]:
            return RestState(_amount(speed), _amount(distance))
    return None


def _amount(sent: object) -> float:
    """A number that is not below 0; NaN for anything else."""
    return float(sent) if isinstance(sent, int | float) and 0.0 <= sent < inf else nan


def read_vocabulary(text: str) -> Vocabulary:
    """A vocabulary, without callable functions. Raises TelemetryError."""
    record = _decoded(VocabularyRecord, text)
    try:
        return record.made()
    except VocabularyError as error:
        raise TelemetryError(str(error)) from None


def read_mind(text: str) -> MindRecord:
    """What a robot has learned. Raises TelemetryError."""
    record = _decoded(MindRecord, text)
    for name in (*record.groups, *(each[0] for each in (*record.operators, *record.rules))):
        _named(name)
    for _, parameters, _ in record.operators:
        for name in parameters:
            _named(name)
    return record


def read_why(text: str) -> Explanation:
    """An explanation. Raises TelemetryError."""
    return _decoded(ExplanationRecord, text).made()


Record = TypeVar("Record", bound=msgspec.Struct)


def _decoded(kind: type[Record], text: object) -> Record:
    if not isinstance(text, str) or len(text) > MAX_TEXT_READ:
        raise TelemetryError("no text, or one that is too long")
    try:
        return msgspec.json.decode(text, type=kind)
    except UNREADABLE as error:
        raise TelemetryError(str(error)) from None


def _named(name: str) -> None:
    if not is_name(name):
        raise TelemetryError(f"a name {name!r}, which cannot stand in an expression")


def _dimension(exponents: Exponents | None) -> Dimension | None:
    if exponents is None:
        return None
    if max(map(abs, exponents)) > MAX_EXPONENT:
        raise TelemetryError(f"a dimension of {exponents}")
    return Dimension(*exponents)


def _value(sent: float | str | None) -> float:
    return float(sent) if isinstance(sent, float | int) else nan


def _nobody(body: object, most: int, *arguments: float) -> Sequence[float]:
    raise TypeError("neighbours are what a robot senses, and the robot is far away")


def _far_away(body: object, *arguments: float) -> float:
    raise TypeError("this function is a robot's own, and the robot is far away")
