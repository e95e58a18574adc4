"""Serialization of scenarios as JSON for recordings and snapshots: every dataclass as its name and its fields.

`unpack` follows the annotations of the dataclasses, creates no other types, and rejects data that do not fit.
Renaming a packed class or field would break existing files. Infinities are written as Python's JSON does.
"""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import TypeVar, Union, get_args, get_origin, get_type_hints

TYPE = "type of"
"""The key that holds a dataclass's name; it contains a blank, so no field can have the same name."""

Kind = TypeVar("Kind")


def pack(value: object) -> bytes:
    """`value` as JSON: dataclasses, tuples, dictionaries with text keys, paths (their last part) and plain values."""
    return json.dumps(_plain(value), separators=(",", ":")).encode()


def unpack(kind: type[Kind], data: bytes) -> Kind:
    """The `kind` that was packed into `data`. Raises ValueError if the data hold something else."""
    value = _made(kind, json.loads(data))
    if not isinstance(value, kind):
        raise ValueError(f"wanted {kind.__name__}, got {type(value).__name__}")
    return value


def _plain(value: object) -> object:
    if is_dataclass(value):
        return {TYPE: type(value).__name__} | {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    return value.name if isinstance(value, Path) else value


@cache
def _hints(kind: type) -> dict[str, object]:
    return get_type_hints(kind)


def _made(hint: object, data: object) -> object:
    """The value of type `hint` that `data` stands for."""
    origin, choices = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return _one_of(choices, data)
    if origin is tuple and isinstance(data, list):
        if len(choices) == 2 and choices[1] is Ellipsis:
            return tuple(_made(choices[0], each) for each in data)
        if len(choices) == len(data):
            return tuple(_made(choice, each) for choice, each in zip(choices, data, strict=True))
    elif origin is dict and isinstance(data, dict):
        return {name: _made(choices[1], each) for name, each in data.items()}
    elif isinstance(hint, type):
        return _simple(hint, data)
    raise ValueError(f"wanted {hint}, got {str(data)[:80]}")


def _simple(kind: type, data: object) -> object:
    if is_dataclass(kind) and isinstance(data, dict) and data.get(TYPE) == kind.__name__:
        hints = _hints(kind)
        given = {name: _made(hints.get(name), each) for name, each in data.items() if name != TYPE}
        try:
            return kind(**given)
        except TypeError as error:
            raise ValueError(str(error)) from None
    names, usual = getattr(kind, "_fields", ()), getattr(kind, "_field_defaults", {})
    if names and isinstance(data, list) and len(names) - len(usual) <= len(data) <= len(names):
        return kind(*(_made(_hints(kind)[name], each) for name, each in zip(names, data, strict=False)))
    if kind is Path and isinstance(data, str):
        return Path(data)
    if kind is float and isinstance(data, int) and not isinstance(data, bool):
        return float(data)
    if kind in (bool, int, float, str, NoneType) and type(data) is kind:
        return data
    raise ValueError(f"wanted {kind.__name__}, got {str(data)[:80]}")


def _one_of(choices: tuple[object, ...], data: object) -> object:
    for choice in choices:
        try:
            return _made(choice, data)
        except ValueError:
            continue
    raise ValueError(f"{str(data)[:80]} is none of {', '.join(str(choice) for choice in choices)}")
