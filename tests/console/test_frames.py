"""Frames byte by byte, and the groups and flags in them."""

from __future__ import annotations

import struct
from math import nan

import numpy as np

from sleepcast.channel import Kind, Message
from sleepcast.console.frames import pack, packed_poses, places_of, repeats, still
from sleepcast.console.replay_client import digest
from sleepcast.fleet import Fleet
from sleepcast.fleet.marks import MAX_GROUPS, GroupCodes, flags_of
from station.fleet import vocabulary


def fleet(count: int) -> Fleet:
    return Fleet([f"s{i}" for i in range(count)], vocabulary())


def test_a_frame_is_laid_out_as_its_docstring_says() -> None:
    poses = struct.pack("<6f", 1.5, -2.0, 0.25, 1e6, 3.0, -3.0)
    frame = pack(7, 2**32 + 5, 12.25, (30.0, 29.5), (True, True), poses, (b"\x00\x02", b"\x01\x08"))
    assert len(frame) == 32 + 14 * 2
    assert struct.unpack_from("<BBBBIIId2f", frame) == (2, 3, 0, 0, 2, 7, 5, 12.25, 30.0, 29.5)
    assert struct.unpack_from("<6f", frame, 32) == (1.5, -2.0, 0.25, 1e6, 3.0, -3.0)
    assert frame[56:] == b"\x00\x02\x01\x08"
    preparing = pack(7, 5, 12.25, (30.0, 29.5), (True, False, True), poses, (b"\x00\x02", b"\x01\x08"))
    assert preparing[1] == 5
    still = pack(7, 5, 12.25, (30.0, 29.5), (False, False), poses, (b"\x00\x02", b"\x01\x08"))
    assert still[1] == 0


def test_columns_follow_a_frame_only_where_there_is_something_in_them() -> None:
    poses, marks, speeds = bytes(24), (b"\x00\x02", b"\x01\x08"), (30.0, 29.5)
    pinged = pack(7, 5, 12.25, speeds, (True, True), poses, marks, (b"\x00\x05", b"", b""))
    assert pinged[2] == 1
    assert pinged[56:] == b"\x00\x02\x01\x08\x00\x05"
    coloured = pack(7, 5, 12.25, speeds, (True, True), poses, marks, (b"", b"\x00\x01", b"\x09\xff"))
    assert coloured[2] == 6
    assert coloured[56:] == b"\x00\x02\x01\x08\x00\x01\x09\xff"


def test_heights_follow_the_poses_of_robots_that_have_any() -> None:
    places = np.array([[1.5, 2.5], [-2.0, 3.0], [0.0, 12.5]])
    x, y, z = places
    heading, marks = np.array([0.25, 0.5]), (b"\x00\x02", b"\x01\x08")
    poses = packed_poses(x, y, heading, np.array([nan, 12.5]))
    frame = pack(7, 5, 12.25, (30.0, 29.5), (True, True), poses, marks, (b"", b"", b"\x00\x09"))
    assert frame[2] == 4 | 8
    assert struct.unpack_from("<8f", frame, 32) == (1.5, -2.0, 0.25, 2.5, 3.0, 0.5, 0.0, 12.5)
    assert frame[64:] == b"\x00\x02\x01\x08\x00\x09"
    assert places_of(poses, 2).tolist() == places.tolist()
    assert places_of(packed_poses(x, y, heading), 2).tolist() == places[:2].tolist()
    risen = packed_poses(x, y, heading, z + 1.0)
    assert digest(risen, 2) != digest(poses, 2), "where all are is more than where they are on the map"


def test_a_frame_in_which_nothing_has_moved_is_its_head() -> None:
    poses, marks, speeds = bytes(24), (b"\x00\x02", b"\x01\x08"), (30.0, 29.5)
    before = pack(7, 5, 12.25, speeds, (True, True), poses, marks)
    after = pack(8, 6, 12.5, speeds, (True, True), poses, marks)
    assert repeats(after, before)
    assert not repeats(pack(8, 6, 12.5, speeds, (True, True), poses, (b"\x00\x03", marks[1])), before)
    pinged = pack(8, 6, 12.5, speeds, (True, True), poses, marks, (b"\x00\x05", b"", b""))
    assert not repeats(pinged, before)
    assert not repeats(after, pinged)
    assert not repeats(pinged, pinged)  # they have pinged again
    assert still(after) == after[:3] + b"\x01" + after[4:32]


def test_flags_tell_stopped_frozen_sleeping_and_marked() -> None:
    minds = fleet(5)
    for robot, text in ((2, "(FREEZE)"), (3, "(SLEEP)"), (4, "(MARK)")):
        minds.evaluate(text, [robot])
    minds.receive(Message("desk", 1, 1, Kind.STOP, 0.0), [1])
    assert list(flags_of(minds)) == [0, 1, 2, 4, 8]


def test_a_robot_is_shown_in_its_newest_group_and_counted_in_all() -> None:
    minds = fleet(3)
    groups = GroupCodes()
    minds.evaluate("(JOIN Bravo)", [0])
    assert list(groups.look(minds)) == [1, 0, 0]
    assert groups.second == b""
    minds.evaluate("(JOIN delta)", [0, 1])
    assert list(groups.look(minds)) == [2, 2, 0]
    assert (groups.names, groups.counts, groups.shown) == (["Bravo", "delta"], [1, 2], [0, 2])
    assert groups.second == b"\x01\x00\x00"
    assert [groups.members(minds, code).tolist() for code in (1, 2, 3)] == [
        [True, False, False],
        [True, True, False],
        [False] * 3,
    ]
    minds.evaluate("(LEAVE delta)", [0])
    assert list(groups.look(minds)) == [1, 2, 0]
    assert (groups.counts, groups.shown) == ([1, 1], [1, 1])


def test_more_groups_than_a_byte_can_tell_apart_are_shown_as_none() -> None:
    minds = fleet(MAX_GROUPS + 10)
    groups = GroupCodes()
    for k in range(MAX_GROUPS + 10):
        minds.evaluate(f"(JOIN g{k})", [k])
        codes = groups.look(minds)
        assert codes[k] == (k + 1 if k < MAX_GROUPS else 0)
    assert len(groups.names) == MAX_GROUPS
