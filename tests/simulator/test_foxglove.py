"""Poses and log lines in the standard schemas, read back by a Protobuf reader of the test's own."""

from __future__ import annotations

import struct
from collections import defaultdict

import numpy as np
import pytest

from sleepcast.simulator import foxglove
from sleepcast.simulator.foxglove import Level

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


@pytest.mark.parametrize("data", [b"", b"x" * 68, b"x" * 69])
def test_bytes_that_are_no_poses_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="poses"):
        foxglove.read_poses(data, 1)


def test_a_log_line_holds_who_said_what() -> None:
    message = fields(foxglove.log(5, Level.WARNING, "scout7", "föhn"))
    assert message == {1: [b"\x08\x00\x10\x05"], 2: [3], 3: ["föhn".encode()], 4: [b"scout7"]}


@pytest.mark.parametrize(
    ("schema", "messages"),
    [
        (foxglove.POSES_SCHEMA, ["Vector3", "Quaternion", "Pose", "PosesInFrame"]),
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
