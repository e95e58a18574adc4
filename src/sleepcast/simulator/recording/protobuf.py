"""The little of Protobuf that recordings need, written by hand since it never changes: the bytes of fields, and the
description of schemas (a `FileDescriptorSet`), which stands in an MCAP file beside its messages.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Mapping
from typing import NamedTuple

from sleepcast.core.varint import varint

NANO = 1_000_000_000
LENGTH_DELIMITED, FIXED_32, FIXED_64 = 2, 5, 1
"""Wire types."""

# ---- the bytes of fields


def tag(number: int, wire: int = LENGTH_DELIMITED) -> bytes:
    """What stands before a field: its number and wire type."""
    return varint(number << 3 | wire)


def field(number: int, content: bytes | str) -> bytes:
    """A text, bytes or message."""
    data = content.encode() if isinstance(content, str) else content
    return tag(number) + varint(len(data)) + data


def whole(number: int, value: int) -> bytes:
    """A whole number, an enumeration or a truth value."""
    return tag(number, 0) + varint(value)


def fixed(number: int, value: int) -> bytes:
    """A `fixed32`."""
    return tag(number, FIXED_32) + value.to_bytes(4, "little")


def double(number: int, value: float) -> bytes:
    """A `double`; 0 is omitted."""
    return tag(number, FIXED_64) + struct.pack("<d", value) if value else b""


def timestamp(number: int, nanoseconds: int) -> bytes:
    """A `google.protobuf.Timestamp`."""
    return field(number, whole(1, nanoseconds // NANO) + whole(2, nanoseconds % NANO))


# ---- the description of schemas


class FieldType(NamedTuple):
    """The type of a field: its number in a FieldDescriptorProto, and the name of a message or enumeration."""

    number: int
    name: str = ""


DOUBLE, LONG, INT, FIXED, BOOL, TEXT, BYTES = (FieldType(number) for number in (1, 3, 5, 7, 8, 9, 12))

STAMP_FILE_NAME, DURATION_FILE_NAME = "google/protobuf/timestamp.proto", "google/protobuf/duration.proto"


def of(name: str) -> FieldType:
    """A message as the type of a field."""
    return FieldType(11, f".{name}")


def one_of(name: str) -> FieldType:
    """An enumeration as the type of a field."""
    return FieldType(14, f".{name}")


TIME, DURATION = of("google.protobuf.Timestamp"), of("google.protobuf.Duration")


def described(name: str, fields: Mapping[str, FieldType], repeated: Collection[str] = ()) -> bytes:
    """A DescriptorProto; its fields are numbered from 1. repeated: those of which there may be many."""
    content = field(1, name)
    for number, (called, kind) in enumerate(fields.items(), start=1):
        label = 3 if called in repeated else 1
        about = field(1, called) + whole(3, number) + whole(4, label) + whole(5, kind.number)
        content += field(2, about + (field(6, kind.name) if kind.name else b""))
    return content


def with_values(descriptor: bytes, name: str, values: tuple[str, ...]) -> bytes:
    """A DescriptorProto with an enumeration inside, whose values are numbered from 0."""
    numbered = (field(2, field(1, value) + whole(2, number)) for number, value in enumerate(values))
    return descriptor + field(4, field(1, name) + b"".join(numbered))


def described_file(package: str, name: str, messages: Collection[bytes], needs: Collection[str] = ()) -> bytes:
    """A FileDescriptorProto, as it stands in a FileDescriptorSet. needs: names of other files."""
    content = field(1, name) + field(2, package)
    content += b"".join(field(3, each) for each in needs)
    content += b"".join(field(4, each) for each in messages)
    return field(1, content + field(12, "proto3"))


_SECONDS = {"seconds": LONG, "nanos": INT}
STAMP_FILE = described_file("google.protobuf", STAMP_FILE_NAME, [described("Timestamp", _SECONDS)])
DURATION_FILE = described_file("google.protobuf", DURATION_FILE_NAME, [described("Duration", _SECONDS)])
