"""What a recording holds as JSON: a class for each message, and the schemas by which other viewers offer its fields by
name.

Schemas keep to what Foxglove and Lichtblick read: each field has one type, each object its properties, and a list holds
values of one type; nothing refers to a definition elsewhere. So an unknown number is null although its schema says
number, and what may have any names is an object without properties.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from math import inf
from typing import Annotated, Any, Self, cast

import msgspec
from msgspec import UNSET, Meta, UnsetType

from sleepcast.channel import Kind, Message
from sleepcast.core.model import Quantity

Schema = dict[str, Any]

_Robots = Annotated[int, Meta(ge=0, description="robots")]
_Tick = Annotated[int, Meta(ge=0, description="ticks since the start")]
_Anything = Annotated[dict[str, Any], Meta(extra_json_schema={"properties": {}})]


class MarksBody(msgspec.Struct, omit_defaults=True):
    """Groups and flags of the robots."""

    tick: _Tick
    groups: Annotated[bytes, Meta(description="for each robot the number of its newest group, a byte; 0 for none")]
    flags: Annotated[
        bytes,
        Meta(
            description="for each robot a byte: bit 0 stopped, 1 frozen, 2 sleeping, 3 marked, 5 out of energy, "
            "6 crashed"
        ),
    ]
    names: Annotated[list[str], Meta(description="of the groups, from number 1")]
    second: Annotated[
        bytes, Meta(description="for each robot the number of its second newest group; missing if no robot has one")
    ] = b""
    colours: Annotated[
        bytes, Meta(description="for each robot the colour that it shows; missing if no robot shows one")
    ] = b""


class AccountBody(msgspec.Struct, omit_defaults=True):
    """What became of a command."""

    command: Annotated[str, Meta(description="the id of the command")]
    text: str
    matched: _Robots
    not_matched: _Robots
    fault: _Robots
    silent: _Robots
    predicted: Annotated[int, Meta(ge=0, description="robots expected to obey when it was sent")]
    values: Annotated[str, Meta(description="answers to a question")] = ""
    unknown: Annotated[int, Meta(ge=0, description="robots whose test was unknown")] = 0
    held: Annotated[int, Meta(ge=0, description="robots among the matched that STOP held")] = 0


class RuleBody(msgspec.Struct, omit_defaults=True):
    """An expression stored on a robot."""

    name: str
    text: str
    active: bool
    priority: Annotated[int, Meta(description="0 if it is left out")] = 0


class RulesBody(msgspec.Struct):
    """All expressions stored on a robot."""

    robot: str
    rules: list[RuleBody]


class FailureBody(msgspec.Struct):
    """A rule that fails."""

    rule: Annotated[str, Meta(description="the name of the rule")]
    count: _Robots
    inactive: Annotated[int, Meta(ge=0, description="robots among them that have deactivated it")]
    reason: Annotated[str, Meta(description="the fault of one of them")]
    robots: Annotated[
        bytes, Meta(description="for each robot a bit, 1 if it fails there; the first in bit 0 of the first byte")
    ]


class FailuresBody(msgspec.Struct):
    """All rules that fail now or have a short while ago, those on most robots first, 20 at most."""

    rules: list[FailureBody]


class RecordedMessage(msgspec.Struct, kw_only=True):
    """A message of the operator."""

    sender: str
    epoch: Annotated[int, Meta(description="the life of the sender")]
    sequence: Annotated[int, Meta(description="the number of the message in that life")]
    kind: Kind
    issued: Annotated[float, Meta(description="simulated s")]
    deadline: Annotated[float, Meta(description="simulated s; missing for never")] | UnsetType = UNSET
    text: str
    standing: bool
    body: Annotated[_Anything, Meta(description="further fields")]
    role: str
    heard: Annotated[float, Meta(description="simulated s; missing if unknown")] | UnsetType = UNSET
    ahead: Annotated[float, Meta(description="s by which the sender's clock is ahead")]

    @classmethod
    def of(cls, message: Message) -> Self:
        """Of `message`. A new field of messages is no field of recordings before it stands here, and must then be
        optional, as older recordings lack it."""
        fields = {name: getattr(message, name) for name in cls.__struct_fields__}
        if message.deadline == inf:  # which JSON does not have; it is what a message without one has
            fields["deadline"] = UNSET
        if message.heard is None:
            fields["heard"] = UNSET
        return cls(**fields)


class PostedBody(msgspec.Struct):
    """A message of the operator, and the tick in which it was sent."""

    tick: _Tick
    message: RecordedMessage


class StateBody(msgspec.Struct):
    """The hash of the state after a tick."""

    tick: _Tick
    hash: str


class ObstaclesBody(msgspec.Struct, rename={"type_of": "type of"}):
    """Solid things added, moved or removed, and robots added, before a tick."""  # as `packing` writes a `WorldChange`

    type_of: Annotated[str, Meta(extra_json_schema={"enum": ["WorldChange"]})]
    tick: _Tick
    put: Annotated[_Anything, Meta(description="solid things added or moved, by their numbers")]
    gone: Annotated[list[int], Meta(description="numbers of solid things removed")]
    own: Annotated[bool, Meta(description="whether the scenario itself caused it")]
    came: Annotated[list[_Anything], Meta(description="robots that somebody has added, with their places")] = []


class ArrivalBody(msgspec.Struct, omit_defaults=True):
    """A robot that has come."""

    robot: str
    number: Annotated[int, Meta(ge=1, description="its id, which none has a second time")]
    row: Annotated[int, Meta(ge=0, description="its place in lists of all robots, from 0")]
    parent: Annotated[str, Meta(description="who has hatched it; missing if nobody has")] = ""


class DepartureBody(msgspec.Struct):
    """A robot that has gone."""

    robot: str
    row: Annotated[int, Meta(ge=0, description="its place in lists of all robots, from 0")]


class RobotsBody(msgspec.Struct, omit_defaults=True):
    """Robots that have come and gone at the end of a tick."""

    tick: _Tick
    came: list[ArrivalBody]
    gone: list[DepartureBody]
    everybody: Annotated[bool, Meta(description="whether all that there are have come: nobody else is there")] = False


def schema_of(body: type[msgspec.Struct]) -> Schema:
    """The JSON schema of a class of this module."""
    (schema,), definitions = msgspec.json.schema_components([body], ref_template="{name}")
    return cast(Schema, _inlined(schema, definitions))


def _inlined(schema: Any, definitions: Schema) -> Any:
    """The same with every definition in its place, no other fields than those of a class, and no names of ours."""
    if isinstance(schema, list):
        return [_inlined(each, definitions) for each in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        return _inlined(definitions[schema["$ref"]], definitions)
    typed = {"type": "string"} if "enum" in schema else {}
    closed = {"additionalProperties": False} if schema.get("properties") else {}
    left = {key: each for key, each in schema.items() if key not in ("title", "additionalProperties", "default")}
    return typed | {key: _inlined(each, definitions) for key, each in left.items()} | closed


def readings(sensors: Iterable[Quantity]) -> Schema:
    """Of the values of these sensors."""
    properties = {}
    for sensor in sensors:
        unit = "" if sensor.unit == "%" else sensor.unit
        about = ", ".join(each for each in (sensor.doc, unit or "a plain number", "null where unknown") if each)
        properties[sensor.name] = {"type": "array", "items": {"type": "number"}, "description": about}
    of_all = {"description": "one value for each robot", "required": list(properties), "additionalProperties": False}
    return {"type": "object", "properties": properties} | of_all


def written(schema: Schema) -> bytes:
    """A schema as it stands in a file."""
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema).encode()
