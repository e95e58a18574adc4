"""JSON schemas of what a recording holds as JSON, so that other viewers offer its fields by name.

They keep to what Foxglove and Lichtblick read: each field has one type, each object its properties, and a list holds
values of one type. So an unknown number is null although its schema says number, and what may have any names is an
object without properties.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from sleepcast.channel.message import Kind
from sleepcast.core.model import Quantity

Schema = dict[str, object]

_WHOLE: Schema = {"type": "integer"}
_NUMBER: Schema = {"type": "number"}
_TEXT: Schema = {"type": "string"}
_TRUTH: Schema = {"type": "boolean"}
_TICK: Schema = {"type": "integer", "minimum": 0, "description": "ticks since the start"}


def _object(properties: Mapping[str, Schema], about: str = "", optional: Iterable[str] = ()) -> Schema:
    """An object of these fields and no others."""
    found: Schema = {"type": "object", "properties": dict(properties)}
    required = [name for name in properties if name not in set(optional)]
    return found | {"required": required, "additionalProperties": False} | _said(about)


def _list(items: Schema, about: str = "") -> Schema:
    return {"type": "array", "items": items} | _said(about)


def _said(about: str) -> Schema:
    return {"description": about} if about else {}


def _anything(about: str) -> Schema:
    """An object whose fields may have any names."""
    return {"type": "object", "properties": {}, "description": about}


def _bytes(about: str) -> Schema:
    return {"type": "string", "contentEncoding": "base64", "description": about}


def readings(sensors: Iterable[Quantity]) -> Schema:
    """Of the values of these sensors."""
    return _object({sensor.name: _list(_NUMBER, _described(sensor)) for sensor in sensors}, "one value for each robot")


def _described(sensor: Quantity) -> str:
    unit = "" if sensor.unit == "%" else sensor.unit
    return ", ".join(each for each in (sensor.doc, unit or "a plain number", "null where unknown") if each)


_COUNT: Schema = {"type": "integer", "minimum": 0, "description": "robots"}
ACCOUNTING = _object(
    {
        "command": _TEXT | _said("the id of the command"),
        "text": _TEXT,
        **dict.fromkeys(("matched", "not_matched", "fault", "silent"), _COUNT),
        "predicted": _COUNT | _said("robots expected to obey when it was sent"),
        "values": _TEXT | _said("answers to a question"),
        "unknown": _COUNT | _said("robots whose test was unknown"),
        "held": _COUNT | _said("robots among the matched that STOP held"),
    },
    "what became of a command",
    optional=("values", "unknown", "held"),
)
_RULE = _object(
    {"name": _TEXT, "text": _TEXT, "active": _TRUTH, "priority": _WHOLE | _said("0 if it is left out")},
    optional=("priority",),
)
RULES = _object(
    {"robot": _TEXT, "rules": _list(_RULE)},
    "all expressions stored on a robot",
)
FAILING = _object(
    {
        "rules": _list(
            _object(
                {
                    "rule": _TEXT | _said("the name of the rule"),
                    "count": _COUNT,
                    "inactive": _COUNT | _said("robots among them that have deactivated it"),
                    "reason": _TEXT | _said("the fault of one of them"),
                    "robots": _bytes("for each robot a bit, 1 if it fails there; the first in bit 0 of the first byte"),
                }
            )
        )
    },
    "all rules that fail now or have a short while ago, those on most robots first, 20 at most",
)
MARKS = _object(
    {
        "tick": _TICK,
        "groups": _bytes("for each robot the number of its newest group, a byte; 0 for none"),
        "flags": _bytes("for each robot a byte: bit 0 stopped, 1 frozen, 2 sleeping, 3 marked, 5 out of energy"),
        "names": _list(_TEXT, "of the groups, from number 1"),
        "second": _bytes("for each robot the number of its second newest group; missing if no robot has one"),
        "colours": _bytes("for each robot the colour that it shows; missing if no robot shows one"),
    },
    "groups and flags of the robots",
    optional=("second", "colours"),
)
_FIELDS: Mapping[str, Schema] = {
    "sender": _TEXT,
    "epoch": _WHOLE | _said("the life of the sender"),
    "sequence": _WHOLE | _said("the number of the message in that life"),
    "kind": {"type": "string", "enum": [kind.value for kind in Kind]},
    "issued": _NUMBER | _said("simulated s"),
    "deadline": _NUMBER | _said("simulated s; missing for never"),
    "text": _TEXT,
    "standing": _TRUTH,
    "body": _anything("further fields"),
    "role": _TEXT,
    "heard": _NUMBER | _said("simulated s; missing if unknown"),
    "ahead": _NUMBER | _said("s by which the sender's clock is ahead"),
}
_MESSAGE = _object(_FIELDS, optional=("deadline", "heard"))
RECORDED = frozenset(_FIELDS)
"""The fields of a message that a recording keeps. A new one is no field of recordings before it stands here; it must be
optional then, as older recordings lack it."""
POSTED = _object({"tick": _TICK, "message": _MESSAGE}, "a message of the operator, and the tick in which it was sent")
STATE = _object({"tick": _TICK, "hash": _TEXT}, "the hash of the state after a tick")
OBSTACLES = _object(
    {
        "type of": {"type": "string", "enum": ["WorldChange"]},
        "tick": _TICK,
        "put": _anything("solid things added or moved, by their numbers"),
        "gone": _list(_WHOLE, "numbers of solid things removed"),
        "own": _TRUTH | _said("whether the scenario itself caused it"),
    },
    "solid things added, moved or removed before a tick",
)


def written(schema: Schema) -> bytes:
    """A schema as it stands in a file."""
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema).encode()
