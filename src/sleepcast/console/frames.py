"""Frames: the picture of the moving swarm, as bytes for the page. `static/frame.js` reads them.

Everything is little endian. A frame of n robots has 32 + 14 n bytes, 4 n more where robots have heights, and n more for
each optional column that follows:

    offset   type        meaning
    0        u8          2, the version of this layout
    1        u8          state: bit 0 time runs, bit 1 STOP is latched, bit 2 time cannot run yet: what ticks take is
                         being compiled, bit 3 time has not begun: it waits for the first command, or to be run
    2        u8          which columns follow after the flags, in this order: bit 0 pings, bit 1 second groups,
                         bit 2 colours; bit 3: whether robots have heights
    3        u8          1 if these 32 bytes are all: the rest is as in the frame before, and nobody has pinged
    4        u32         n
    8        u32         number of the frame; the page sends it back once the frame is drawn
    12       u32         tick, modulo 2^32
    16       f64         simulated time, s
    24       f32         wanted speed: simulated seconds in a second
    28       f32         speed that was reached in the last second or so
    32       f32 x 3n    x (m), y (m), heading (rad, counter-clockwise from x) of each robot in turn; heading NaN: it
                         has no known position and stands aside
    32+12n   f32 x n     z (m) of each robot, above the ground; only where bit 3 of byte 2 is set, else all are on it,
                         and what follows stands here
    ...      u8 x n      group: 0 for none, else the index of its newest group in the list of groups, from 1
    ...      u8 x n      flags: bit 0 stopped, 1 frozen, 2 sleeping, 3 marked and showing it,
                         4 silent: its telemetry is stale, 5 it has used up what it drives with, 6 it has crashed
    ...      u8 x n      pings: 0 for who has not pinged since the frame before, else the caste + 1
    ...      u8 x n      second group: as group, of who is in two or more
    ...      u8 x n      colour that it shows with COLOUR: 0 for none, 255 for what is no whole number from 1 to 254
"""

from __future__ import annotations

import struct
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

ALTERNATE = 255
"""The first byte of something else than a frame: where robots were in another future. Three bytes follow, then u32 n
and f32 x 3n as in a frame, without heights."""

VERSION = 2
Column: TypeAlias = NDArray[np.float64]

_HEADER = struct.Struct("<BBBxIIIdff")
FLAT = 12
"""Bytes of the pose of a robot that has no height."""
STOPPED, SILENT = 1, 16
"""Of the flags of a robot."""
_STILL = b"\x01"


def pack(
    number: int,
    tick: int,
    time: float,
    speeds: tuple[float, float],
    state: tuple[bool, ...],
    poses: bytes,
    marks: tuple[bytes, bytes],
    columns: tuple[bytes, bytes, bytes] = (b"", b"", b""),
) -> bytes:
    """A frame.

    speeds: wanted, reached
    poses: as of `packed_poses`
    state: its bits in turn
    marks: group and flags of each robot
    columns: pings, second groups, colours; each empty where there is none
    """
    count = len(marks[0])
    bits = sum(bit << index for index, bit in enumerate(state))
    high = len(poses) > FLAT * count
    follow = sum(there << index for index, there in enumerate((*map(bool, columns), high)))
    header = _HEADER.pack(VERSION, bits, follow, count, number, tick & 0xFFFFFFFF, time, *speeds)
    return b"".join((header, poses, *marks, *columns))


def packed_poses(x: Column, y: Column, heading: Column, z: Column | None = None) -> bytes:
    """x (m), y (m) and heading (rad, counter-clockwise from x) of each robot in turn, then z (m) of each where robots
    have one, NaN for who has not: float32, little endian."""
    poses = np.empty((len(x), 3), "<f4")
    poses[:, 0], poses[:, 1], poses[:, 2] = x, y, heading
    return poses.tobytes() if z is None else poses.tobytes() + np.nan_to_num(z).astype("<f4").tobytes()


def repeats(frame: bytes, before: bytes) -> bool:
    """Whether robots are in a frame as in the one before, and nobody has pinged."""
    pinged = frame[2] & 1
    return not pinged and frame[2:3] == before[2:3] and memoryview(frame)[_HEADER.size :] == before[_HEADER.size :]


def still(frame: bytes) -> bytes:
    """The frame for a page that has drawn all robots as they are in it."""
    return frame[:3] + _STILL + frame[4 : _HEADER.size]


def alternate_frame(poses: bytes, count: int) -> bytes:
    """Where so many robots were in another future; with empty poses, that it is not known."""
    return struct.pack("<BxxxI", ALTERNATE, count if poses else 0) + poses[: FLAT * count]


def places_of(poses: bytes, count: int) -> NDArray[np.float32]:
    """Where so many robots are, of `packed_poses`: x, y and, where robots have heights, z (m), as rows of float32."""
    numbers = np.frombuffer(poses, "<f4")
    return np.vstack([numbers[: 3 * count].reshape(-1, 3)[:, :2].T, *numbers[3 * count :].reshape(-1, count)])
