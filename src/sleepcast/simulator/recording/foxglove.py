"""Poses, points and log lines for standard viewers: Foxglove's schemas `PosesInFrame`, `PointCloud` and `Log`, in
Protobuf.

Foxglove, Lichtblick and Rerun show them without plug-ins: the first two draw poses as arrows, Rerun draws points.
The little of Protobuf that is needed never changes, so it is written here by hand: the description of the schemas (a
`FileDescriptorSet`), and the bytes of the messages. A pose in the plane always takes the same 69 bytes, so the poses
of a whole swarm are one NumPy array, filled by columns.
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

WORLD = "world"
"""The name of the frame: x east, y north, z up, in m."""
POSES, POINTS, LOG = "foxglove.PosesInFrame", "foxglove.PointCloud", "foxglove.Log"

_NANO = 1_000_000_000
_LENGTH_DELIMITED = 2
_FIXED_64, _FIXED_32 = 1, 5
_FLOAT32 = 7
"""The code of single precision in `PackedElementField`."""


class Level(IntEnum):
    """Severity of a log line."""

    INFO = 2
    WARNING = 3
    ERROR = 4


# ---- the bytes of Protobuf


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    found.append(value)
    return bytes(found)


def _tag(number: int, wire: int = _LENGTH_DELIMITED) -> bytes:
    return _varint(number << 3 | wire)


def _field(number: int, content: bytes | str) -> bytes:
    data = content.encode() if isinstance(content, str) else content
    return _tag(number) + _varint(len(data)) + data


def _whole(number: int, value: int) -> bytes:
    return _tag(number, 0) + _varint(value)


def _fixed(number: int, value: int) -> bytes:
    return _tag(number, _FIXED_32) + value.to_bytes(4, "little")


def _timestamp(nanoseconds: int) -> bytes:
    return _field(1, _whole(1, nanoseconds // _NANO) + _whole(2, nanoseconds % _NANO))


# ---- messages

_POSE_HEAD = _tag(3) + b"\x43" + _tag(1) + b"\x1b"
"""A pose of 67 bytes begins with its position of 27."""
_TURN_HEAD = _tag(2) + b"\x24"
"""An orientation of 36 bytes follows."""
_POSE = np.dtype(
    {
        "names": [
            *("head", "tag_x", "x", "tag_y", "y", "tag_z", "z"),
            *("turn", "tag_a", "a", "tag_b", "b", "tag_c", "c", "tag_w", "w"),
        ],
        "formats": ["S4", *("u1", "<f8") * 3, "S2", *("u1", "<f8") * 4],
    }
)
"""One pose: position x, y, z; orientation as the quaternion a, b, c (about x, y, z) and w."""


def pose_frame(count: int) -> NDArray[np.void]:
    """A buffer for `count` poses, reused by `poses`."""
    frame = np.zeros(count, _POSE)
    frame["head"], frame["turn"] = _POSE_HEAD, _TURN_HEAD
    for names in (("tag_x", "tag_y", "tag_z"), ("tag_a", "tag_b", "tag_c", "tag_w")):
        for number, name in enumerate(names, start=1):
            frame[name] = number << 3 | _FIXED_64
    return frame


def poses(
    nanoseconds: int,
    frame: NDArray[np.void],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    heading: NDArray[np.float64],
) -> bytes:
    """A `PosesInFrame`. x, y: m; heading: rad, counter-clockwise from x; float64, shape (count,). frame: `pose_frame`
    of that count, overwritten."""
    half = heading / 2.0
    # Single-precision values have a zero low half, which compresses well; the error is a millimetre at 10 km.
    for name, values in (("x", x), ("y", y), ("c", np.sin(half)), ("w", np.cos(half))):
        frame[name] = values.astype(np.float32)
    return _timestamp(nanoseconds) + _field(2, WORLD) + frame.tobytes()


def read_poses(data: bytes, count: int) -> NDArray[np.float32]:
    """Poses of `count` robots written by `poses`: x, y (m), heading (rad), float32, shape (count, 3). Raises
    ValueError."""
    size = count * _POSE.itemsize
    if len(data) < size:
        raise ValueError(f"{len(data)} bytes hold no {count} poses")
    frame = np.frombuffer(data, _POSE, count, len(data) - size)
    if count and (frame["head"] != _POSE_HEAD).any():
        raise ValueError("these are no poses in the plane")
    heading = 2.0 * np.arctan2(frame["c"], frame["w"])
    return np.column_stack((frame["x"], frame["y"], heading)).astype(np.float32)


_UNMOVED = _field(1, b"") + _field(2, _tag(4, _FIXED_64) + struct.pack("<d", 1.0))
"""The identity pose: zeros are omitted."""
_POINT = 12
"""Bytes of a point: x, y and z."""
_COORDINATES = b"".join(
    _field(5, _field(1, name) + _fixed(2, 4 * place) + _whole(3, _FLOAT32)) for place, name in enumerate("xyz")
)


def points(nanoseconds: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> bytes:
    """A `PointCloud`: one point per robot. x, y: m, float64, shape (count,)."""
    data = np.zeros((len(x), 3), "<f4")
    data[:, 0], data[:, 1] = x, y
    head = _timestamp(nanoseconds) + _field(2, WORLD) + _field(3, _UNMOVED) + _fixed(4, _POINT) + _COORDINATES
    return head + _field(6, data.tobytes())


def log(nanoseconds: int, level: Level, who: str, text: str) -> bytes:
    """A `Log`: `who` said `text`."""
    return _timestamp(nanoseconds) + _whole(2, level) + _field(3, text) + _field(4, who)


def read_log(data: bytes) -> tuple[str, str]:
    """Who said what, from the bytes of a `Log`. Raises ValueError."""
    found = {3: "", 4: ""}
    at = 0
    try:
        while at < len(data):
            tag, at = _read_varint(data, at)
            value, at = _read_varint(data, at)
            if tag & 7 == _LENGTH_DELIMITED:
                if tag >> 3 in found:
                    found[tag >> 3] = data[at : at + value].decode()
                at += value
            elif tag & 7 != 0:
                raise ValueError(f"a log line has no fields of wire type {tag & 7}")
    except IndexError:
        raise ValueError("a log line breaks off") from None
    return found[4], found[3]


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    """An integer at this position, and the position after it. Raises IndexError at the end of the data."""
    value = shift = 0
    while data[at] > 0x7F:
        value |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    return value | data[at] << shift, at + 1


# ---- the description of the schemas


class _Kind(NamedTuple):
    """The type of a field: its number in a FieldDescriptorProto, and the name of a message or enumeration."""

    number: int
    name: str = ""


_DOUBLE, _LONG, _INT, _FIXED, _TEXT, _BYTES = (_Kind(number) for number in (1, 3, 5, 7, 9, 12))


def _message(name: str) -> _Kind:
    return _Kind(11, name)


def _described(name: str, fields: dict[str, _Kind], repeated: str = "") -> bytes:
    """A DescriptorProto; its fields are numbered from 1."""
    found = _field(1, name)
    for number, (field, kind) in enumerate(fields.items(), start=1):
        label = 3 if field == repeated else 1
        about = _field(1, field) + _whole(3, number) + _whole(4, label) + _whole(5, kind.number)
        found += _field(2, about + (_field(6, kind.name) if kind.name else b""))
    return found


def _values_of(name: str, values: tuple[str, ...]) -> bytes:
    """An EnumDescriptorProto; its values are numbered from 0."""
    return _field(1, name) + b"".join(
        _field(2, _field(1, value) + _whole(2, number)) for number, value in enumerate(values)
    )


def _file(package: str, name: str, messages: list[bytes], needs: tuple[str, ...] = ()) -> bytes:
    """A FileDescriptorProto in a FileDescriptorSet."""
    found = _field(1, name) + _field(2, package)
    found += b"".join(_field(3, each) for each in needs)
    found += b"".join(_field(4, each) for each in messages)
    return _field(1, found + _field(12, "proto3"))


_STAMP = "google/protobuf/timestamp.proto"
_TIME = _message(".google.protobuf.Timestamp")
_STAMP_FILE = _file("google.protobuf", _STAMP, [_described("Timestamp", {"seconds": _LONG, "nanos": _INT})])
_LEVELS = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")
_POSES_FIELDS = {"timestamp": _TIME, "frame_id": _TEXT, "poses": _message(".foxglove.Pose")}
_LOG_FIELDS = {"timestamp": _TIME, "level": _Kind(14, ".foxglove.Log.Level"), "message": _TEXT, "name": _TEXT}
_LOG_FIELDS |= {"file": _TEXT, "line": _FIXED}

_POSE_MESSAGES = [
    _described("Vector3", {"x": _DOUBLE, "y": _DOUBLE, "z": _DOUBLE}),
    _described("Quaternion", {"x": _DOUBLE, "y": _DOUBLE, "z": _DOUBLE, "w": _DOUBLE}),
    _described("Pose", {"position": _message(".foxglove.Vector3"), "orientation": _message(".foxglove.Quaternion")}),
]
_NUMBERS = ("UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64")
_ELEMENT_FIELDS = {"name": _TEXT, "offset": _FIXED, "type": _Kind(14, ".foxglove.PackedElementField.NumericType")}
_POINTS_FIELDS = {"timestamp": _TIME, "frame_id": _TEXT, "pose": _message(".foxglove.Pose"), "point_stride": _FIXED}
_POINTS_FIELDS |= {"fields": _message(".foxglove.PackedElementField"), "data": _BYTES}

POSES_SCHEMA = _STAMP_FILE + _file(
    "foxglove",
    "foxglove/PosesInFrame.proto",
    [*_POSE_MESSAGES, _described("PosesInFrame", _POSES_FIELDS, repeated="poses")],
    needs=(_STAMP,),
)
POINTS_SCHEMA = _STAMP_FILE + _file(
    "foxglove",
    "foxglove/PointCloud.proto",
    [
        *_POSE_MESSAGES,
        _described("PackedElementField", _ELEMENT_FIELDS) + _field(4, _values_of("NumericType", _NUMBERS)),
        _described("PointCloud", _POINTS_FIELDS, repeated="fields"),
    ],
    needs=(_STAMP,),
)
LOG_SCHEMA = _STAMP_FILE + _file(
    "foxglove",
    "foxglove/Log.proto",
    [_described("Log", _LOG_FIELDS) + _field(4, _values_of("Level", _LEVELS))],
    needs=(_STAMP,),
)
