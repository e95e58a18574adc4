"""Poses and log lines in the standard schemas, read back by a Protobuf reader of the test's own."""

from __future__ import annotations

import struct
from collections import defaultdict

import numpy as np
import pytest

from sleepcast.simulator.recording import foxglove
from sleepcast.simulator.recording.foxglove import Level

Fields = dict[int, list[bytes | int | float]]


def varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        value |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if data[at - 1] < 0x80:
            return value, at


def fields(data: object) -> Fields:
    """The fields of a Protobuf message by their numbers, as its specification tells them apart."""
    assert isinstance(data, bytes)
    found: Fields = defaultdict(list)
    at = 0
    while at < len(data):
        tag, at = varint(data, at)
        if tag & 7 == 0:
            value, at = varint(data, at)
            found[tag >> 3].append(value)
        elif tag & 7 == 5:
            found[tag >> 3].append(int.from_bytes(data[at : at + 4], "little"))
            at += 4
        elif tag & 7 == 1:
            found[tag >> 3].append(struct.unpack_from("<d", data, at)[0])
            at += 8
        else:
            assert tag & 7 == 2
            size, at = varint(data, at)
            found[tag >> 3].append(data[at : at + size])
            at += size
    assert at == len(data)
    return found


def test_poses_in_frame_hold_time_frame_and_every_pose() -> None:
    x, y, heading = np.array([1.5, -2.0, 0.0]), np.array([0.25, 1e7, 0.0]), np.array([0.0, 3.0, -1.5])
    data = foxglove.poses(3_000_000_007, foxglove.pose_frame(3), x, y, heading)
    message = fields(data)
    assert fields(message[1][0]) == {1: [3], 2: [7]}
    assert message[2] == [b"world"]
    assert len(message[3]) == 3
    for pose, across, up, angle in zip(message[3], x, y, heading, strict=True):
        position, orientation = fields(fields(pose)[1][0]), fields(fields(pose)[2][0])
        assert position == {1: [across], 2: [up], 3: [0.0]}
        assert orientation == {
            1: [0.0],
            2: [0.0],
            3: [np.float32(np.sin(angle / 2))],
            4: [np.float32(np.cos(angle / 2))],
        }


def test_poses_come_back() -> None:
    values = np.linspace(-3.0, 3.0, 50)
    data = foxglove.poses(10**18, foxglove.pose_frame(50), 100 * values, values**2, values)
    found = foxglove.read_poses(data, 50)
    np.testing.assert_allclose(found, np.column_stack((100 * values, values**2, values)), rtol=1e-6, atol=1e-6)


def test_heights_come_back_and_are_none_on_the_ground() -> None:
    x, z = np.linspace(-3.0, 3.0, 50), np.linspace(0.0, 30.0, 50)
    flown = foxglove.poses(10**18, foxglove.pose_frame(50), x, x, x, z)
    np.testing.assert_allclose(foxglove.read_heights(flown, 50), z, rtol=1e-6)
    np.testing.assert_array_equal(foxglove.read_poses(flown, 50)[:, 0], x.astype(np.float32))
    rolled = foxglove.poses(10**18, foxglove.pose_frame(50), x, x, x)
    assert not foxglove.read_heights(rolled, 50).any()


@pytest.mark.parametrize("data", [b"", b"x" * 68, b"x" * 69])
def test_bytes_that_are_no_poses_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="poses"):
        foxglove.read_poses(data, 1)


def test_a_log_line_holds_who_said_what() -> None:
    message = fields(foxglove.log(5, Level.WARNING, "scout7", "föhn"))
    assert message == {1: [b"\x08\x00\x10\x05"], 2: [3], 3: ["föhn".encode()], 4: [b"scout7"]}


def test_a_point_cloud_holds_a_point_for_each_robot() -> None:
    colours = np.array([[1, 2, 3, 255], [0, 0, 0, 0], [255, 254, 253, 128]], np.uint8)
    data = foxglove.points(3_000_000_007, np.array([1.5, -2.0, 1e5]), np.array([0.25, 7.0, -1.0]), colours)
    message = fields(data)
    assert fields(message[1][0]) == {1: [3], 2: [7]}
    assert message[2] == [b"world"]
    assert fields(message[3][0]) == {1: [b""], 2: [b"\x21" + struct.pack("<d", 1.0)]}  # no shift, no turn
    assert message[4] == [16]
    elements = [fields(each) for each in message[5]]
    shades = ((b"red", 12), (b"green", 13), (b"blue", 14), (b"alpha", 15))
    assert elements == [
        *({1: [name], 2: [place], 3: [7]} for name, place in ((b"x", 0), (b"y", 4), (b"z", 8))),
        *({1: [name], 2: [place], 3: [1]} for name, place in shades),
    ]
    rows = np.frombuffer(message[6][0], np.uint8).reshape(-1, 16)
    assert rows[:, :12].copy().view("<f4").tolist() == [[1.5, 0.25, 0.0], [-2.0, 7.0, 0.0], [1e5, -1.0, 0.0]]
    assert rows[:, 12:].tolist() == colours.tolist()


POSE = {
    "Vector3": [("x", 1), ("y", 1), ("z", 1)],
    "Quaternion": [("x", 1), ("y", 1), ("z", 1), ("w", 1)],
    "Pose": [("position", 11), ("orientation", 11)],
}
PUBLISHED = {
    "PosesInFrame": POSE | {"PosesInFrame": [("timestamp", 11), ("frame_id", 9), ("poses", 11)]},
    "PointCloud": POSE
    | {
        "PackedElementField": [("name", 9), ("offset", 7), ("type", 14)],
        "PointCloud": [
            *(("timestamp", 11), ("frame_id", 9), ("pose", 11), ("point_stride", 7), ("fields", 11), ("data", 12)),
        ],
    },
    "Log": {
        "Log": [("timestamp", 11), ("level", 14), ("message", 9), ("name", 9), ("file", 9), ("line", 7)],
    },
}
"""The fields of Foxglove's schemas as they are published, in order, with the numbers of their types in a
FieldDescriptorProto."""


@pytest.mark.parametrize(
    ("schema", "name"),
    [
        (foxglove.POSES_SCHEMA, "PosesInFrame"),
        (foxglove.POINTS_SCHEMA, "PointCloud"),
        (foxglove.LOG_SCHEMA, "Log"),
    ],
)
def test_a_schema_is_the_published_one(schema: bytes, name: str) -> None:
    _, own = (fields(each) for each in fields(schema)[1])
    found = {}
    for message in map(fields, own[4]):
        told = [fields(each) for each in message[2]]
        found[message[1][0].decode()] = [(each[1][0].decode(), each[5][0]) for each in told]
    assert found == PUBLISHED[name]


@pytest.mark.parametrize(
    ("schema", "messages"),
    [
        (foxglove.POSES_SCHEMA, ["Vector3", "Quaternion", "Pose", "PosesInFrame"]),
        (foxglove.POINTS_SCHEMA, ["Vector3", "Quaternion", "Pose", "PackedElementField", "PointCloud"]),
        (foxglove.LOG_SCHEMA, ["Log"]),
    ],
)
def test_a_schema_describes_its_messages_and_what_they_need(schema: bytes, messages: list[str]) -> None:
    stamp, own = (fields(each) for each in fields(schema)[1])
    assert stamp[1] == [b"google/protobuf/timestamp.proto"] == own[3]
    assert own[2] == [b"foxglove"]
    assert [fields(each)[1][0] for each in own[4]] == [name.encode() for name in messages]
    last = fields(own[4][-1])
    assert [fields(each)[3][0] for each in last[2]] == list(range(1, len(last[2]) + 1))
