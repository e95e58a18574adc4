"""Frames byte by byte, and the groups and flags in them."""

from __future__ import annotations

import struct

from sleepcast.console.frames import MAX_GROUPS, Groups, flags_of, pack
from sleepcast.node.node import Node
from station.fleet import vocabulary


def nodes(count: int, *texts: str) -> list[Node]:
    names = vocabulary()
    made = [Node(f"s{i}", names, number=i) for i in range(count)]
    for text in texts:
        for node in made:
            node.evaluate(text)
    return made


def test_a_frame_is_laid_out_as_its_docstring_says() -> None:
    poses = struct.pack("<6f", 1.5, -2.0, 0.25, 1e6, 3.0, -3.0)
    frame = pack(7, 2**32 + 5, 12.25, (30.0, 29.5), (True, True), poses, (b"\x00\x02", b"\x01\x08"))
    assert len(frame) == 32 + 14 * 2
    assert struct.unpack_from("<BBBBIIId2f", frame) == (1, 3, 0, 0, 2, 7, 5, 12.25, 30.0, 29.5)
    assert struct.unpack_from("<6f", frame, 32) == (1.5, -2.0, 0.25, 1e6, 3.0, -3.0)
    assert frame[56:] == b"\x00\x02\x01\x08"
    still = pack(7, 5, 12.25, (30.0, 29.5), (False, False), poses, (b"\x00\x02", b"\x01\x08"))
    assert still[1] == 0
    pinged = pack(7, 5, 12.25, (30.0, 29.5), (True, True), poses, (b"\x00\x02", b"\x01\x08"), b"\x00\x05")
    assert pinged[2] == 1
    assert pinged[56:] == b"\x00\x02\x01\x08\x00\x05"


def test_flags_tell_stopped_frozen_sleeping_and_marked() -> None:
    plain, frozen, sleeping, marked, stopped = nodes(5)
    frozen.evaluate("(FREEZE)")
    sleeping.evaluate("(SLEEP)")
    marked.evaluate("(MARK)")
    stopped.stopped = True
    assert list(flags_of([plain, stopped, frozen, sleeping, marked])) == [0, 1, 2, 4, 8]


def test_a_robot_is_shown_in_its_newest_group_and_counted_in_all() -> None:
    first, second, third = nodes(3)
    groups = Groups()
    first.evaluate("(JOIN Bravo)")
    assert list(groups.look([first, second, third])) == [1, 0, 0]
    first.evaluate("(JOIN delta)")
    second.evaluate("(JOIN delta)")
    assert list(groups.look([first, second, third])) == [2, 2, 0]
    assert (groups.names, groups.counts, groups.shown) == (["Bravo", "delta"], [1, 2], [0, 2])
    first.evaluate("(LEAVE delta)")
    assert list(groups.look([first, second, third])) == [1, 2, 0]
    assert (groups.counts, groups.shown) == ([1, 1], [1, 1])


def test_more_groups_than_a_byte_can_tell_apart_are_shown_as_none() -> None:
    groups = Groups()
    for k in range(MAX_GROUPS + 10):
        (node,) = nodes(1, f"(JOIN g{k})")
        code = groups.look([node])[0]
        assert code == (k + 1 if k < MAX_GROUPS else 0)
    assert len(groups.names) == MAX_GROUPS
