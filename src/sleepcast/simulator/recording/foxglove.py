"""Poses, points and log lines for standard viewers: Foxglove's schemas `PosesInFrame`, `PointCloud` and `Log`, in
Protobuf.

Foxglove, Lichtblick and Rerun show them without plug-ins: the first two draw poses as arrows, all three draw points in
their colours. A pose in the plane always takes the same 69 bytes, so the poses of a whole swarm are one NumPy array,
filled by columns.
"""

from __future__ import annotations

import struct
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.varint import read_varint
from sleepcast.simulator.recording.protobuf import (
    BYTES,
    DOUBLE,
    FIXED,
    FIXED_64,
    LENGTH_DELIMITED,
    STAMP_FILE,
    STAMP_FILE_NAME,
    TEXT,
    TIME,
    described,
    described_file,
    field,
    fixed,
    of,
    one_of,
    tag,
    timestamp,
    whole,
    with_values,
)

WORLD = "world"
"""The name of the frame: x east, y north, z up, in m."""
POSES, POINTS, LOG = "foxglove.PosesInFrame", "foxglove.PointCloud", "foxglove.Log"

_UINT8, _FLOAT32 = 1, 7
"""The codes of bytes and of single precision in `PackedElementField`."""


class Level(IntEnum):
    """Severity of a log line."""

    INFO = 2
    WARNING = 3
    ERROR = 4


# ---- messages

_POSE_HEAD = tag(3) + b"\x43" + tag(1) + b"\x1b"
"""A pose of 67 bytes begins with its position of 27."""
_TURN_HEAD = tag(2) + b"\x24"
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
            frame[name] = number << 3 | FIXED_64
    return frame


def poses(
    nanoseconds: int,
    frame: NDArray[np.void],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    heading: NDArray[np.float64],
    z: NDArray[np.float64] | None = None,
) -> bytes:
    """A `PosesInFrame`.

    x, y: m
    z: m, None where nothing flies
    heading: rad, counter-clockwise from x; float64, shape (count,)
    frame: `pose_frame` of that count, overwritten
    """
    half = heading / 2.0
    # Single-precision values have a zero low half, which compresses well; the error is a millimetre at 10 km.
    height = () if z is None else (("z", z),)
    for name, values in (("x", x), ("y", y), *height, ("c", np.sin(half)), ("w", np.cos(half))):
        frame[name] = values.astype(np.float32)
    return timestamp(1, nanoseconds) + field(2, WORLD) + frame.tobytes()


def read_poses(data: bytes, count: int) -> NDArray[np.float32]:
    """Poses of `count` robots written by `poses`: x, y (m), heading (rad), float32, shape (count, 3). Raises
    ValueError."""
    frame = _read_frame(data, count)
    heading = 2.0 * np.arctan2(frame["c"], frame["w"])
    return np.column_stack((frame["x"], frame["y"], heading)).astype(np.float32)


def read_heights(data: bytes, count: int) -> NDArray[np.float64]:
    """z of `count` robots written by `poses`, m, 0 where nothing flies, shape (count,). Raises ValueError."""
    heights: NDArray[np.float64] = _read_frame(data, count)["z"].copy()
    return heights


def _read_frame(data: bytes, count: int) -> NDArray[np.void]:
    size = count * _POSE.itemsize
    if len(data) < size:
        raise ValueError(f"{len(data)} bytes hold no {count} poses")
    frame = np.frombuffer(data, _POSE, count, len(data) - size)
    if count and (frame["head"] != _POSE_HEAD).any():
        raise ValueError("these are no poses in the plane")
    return frame


_UNMOVED = field(1, b"") + field(2, tag(4, FIXED_64) + struct.pack("<d", 1.0))
"""The identity pose: zeros are omitted."""
_POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("colour", "u1", 4)])
_ELEMENTS = b"".join(
    field(5, field(1, name) + fixed(2, place) + whole(3, kind))
    for name, place, kind in (
        *(("x", 0, _FLOAT32), ("y", 4, _FLOAT32), ("z", 8, _FLOAT32)),
        *(("red", 12, _UINT8), ("green", 13, _UINT8), ("blue", 14, _UINT8), ("alpha", 15, _UINT8)),
    )
)


def points(
    nanoseconds: int,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    colours: NDArray[np.uint8],
    z: NDArray[np.float64] | None = None,
) -> bytes:
    """A `PointCloud`: one point per robot. x, y: m, float64, shape (count,). colours: red, green, blue and alpha of
    each, 0 to 255, shape (count, 4). z: m, None where nothing flies."""
    data = np.zeros(len(x), _POINT)
    data["x"], data["y"], data["colour"], data["z"] = x, y, colours, 0.0 if z is None else z
    head = timestamp(1, nanoseconds) + field(2, WORLD) + field(3, _UNMOVED) + fixed(4, _POINT.itemsize) + _ELEMENTS
    return head + field(6, data.tobytes())


def log(nanoseconds: int, level: Level, who: str, text: str) -> bytes:
    """A `Log`: `who` said `text`."""
    return timestamp(1, nanoseconds) + whole(2, level) + field(3, text) + field(4, who)


def read_colours(data: bytes, count: int) -> NDArray[np.uint8]:
    """The colours of `count` robots from the bytes of `points`: red, green, blue and alpha, shape (count, 4). Raises
    ValueError."""
    size = count * _POINT.itemsize
    if len(data) < size:
        raise ValueError(f"{len(data)} bytes hold no {count} points")
    colours: NDArray[np.uint8] = np.frombuffer(data, _POINT, count, len(data) - size)["colour"]
    return colours


def read_log(data: bytes) -> tuple[str, str, Level]:
    """Who said what, and how severe that is, from the bytes of a `Log`. Raises ValueError."""
    texts, level = {3: "", 4: ""}, int(Level.INFO)
    at = 0
    try:
        while at < len(data):
            tag, at = read_varint(data, at)
            value, at = read_varint(data, at)
            if tag & 7 == LENGTH_DELIMITED:
                if tag >> 3 in texts:
                    texts[tag >> 3] = data[at : at + value].decode()
                at += value
            elif tag & 7 != 0:
                raise ValueError(f"a log line has no fields of wire type {tag & 7}")
            elif tag >> 3 == 2:
                level = value
    except IndexError:
        raise ValueError("a log line breaks off") from None
    return texts[4], texts[3], Level(level)


# ---- the schemas

_LEVELS = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")
_POSES_FIELDS = {"timestamp": TIME, "frame_id": TEXT, "poses": of("foxglove.Pose")}
_LOG_FIELDS = {"timestamp": TIME, "level": one_of("foxglove.Log.Level"), "message": TEXT, "name": TEXT}
_LOG_FIELDS |= {"file": TEXT, "line": FIXED}

POSE_MESSAGES = (
    described("Vector3", dict.fromkeys("xyz", DOUBLE)),
    described("Quaternion", dict.fromkeys("xyzw", DOUBLE)),
    described("Pose", {"position": of("foxglove.Vector3"), "orientation": of("foxglove.Quaternion")}),
)
_NUMBERS = ("UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64")
_ELEMENT_FIELDS = {"name": TEXT, "offset": FIXED, "type": one_of("foxglove.PackedElementField.NumericType")}
_POINTS_FIELDS = {"timestamp": TIME, "frame_id": TEXT, "pose": of("foxglove.Pose"), "point_stride": FIXED}
_POINTS_FIELDS |= {"fields": of("foxglove.PackedElementField"), "data": BYTES}

POSES_SCHEMA = STAMP_FILE + described_file(
    "foxglove",
    "foxglove/PosesInFrame.proto",
    [*POSE_MESSAGES, described("PosesInFrame", _POSES_FIELDS, repeated=("poses",))],
    needs=(STAMP_FILE_NAME,),
)
POINTS_SCHEMA = STAMP_FILE + described_file(
    "foxglove",
    "foxglove/PointCloud.proto",
    [
        *POSE_MESSAGES,
        with_values(described("PackedElementField", _ELEMENT_FIELDS), "NumericType", _NUMBERS),
        described("PointCloud", _POINTS_FIELDS, repeated=("fields",)),
    ],
    needs=(STAMP_FILE_NAME,),
)
LOG_SCHEMA = STAMP_FILE + described_file(
    "foxglove",
    "foxglove/Log.proto",
    [with_values(described("Log", _LOG_FIELDS), "Level", _LEVELS)],
    needs=(STAMP_FILE_NAME,),
)
