"""Moving pictures: frames of the same size as one animated PNG, with few colours and only what changes in each frame.

The format is that of the PNG specification, third edition: the first frame is an ordinary picture (IDAT), each later
one an `fcTL` with its delay and `fdAT` with its pixels. What has not changed is transparent, and compresses to nothing.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
COLOURS = 127
"""Colours of a picture; one more is transparent. Fewer make a smaller file; a page of plain colours needs no more."""
UNCHANGED = COLOURS
UNSEEN = 7
"""A change of a channel by so much or less is left out: it is the shimmer at the edges of what moves."""
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def decoded(png: bytes) -> Pixels:
    """The pixels of a PNG with 8 bits a channel and no interlacing, shape (height, width, 3), uint8."""
    width = height = channels = 0
    data = b""
    for kind, body in chunks(png):
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", body)
            channels = {2: 3, 6: 4}.get(colour, 0)
            if depth != 8 or not channels or interlaced:
                raise ValueError(
                    f"wanted 8 bits of RGB or RGBA without interlacing, not depth {depth} of type {colour}"
                )
        elif kind == b"IDAT":
            data += body
    lines = np.frombuffer(zlib.decompress(data), np.uint8).reshape(height, 1 + width * channels)
    return _unfiltered(lines, channels).reshape(height, width, channels)[:, :, :3]


def chunks(png: bytes) -> Iterable[tuple[bytes, bytes]]:
    """The chunks of a PNG in order: their kind and their body."""
    place = len(_SIGNATURE)
    while place < len(png):
        (length,) = struct.unpack_from(">I", png, place)
        yield png[place + 4 : place + 8], png[place + 8 : place + 8 + length]
        place += 12 + length


def _unfiltered(lines: Pixels, channels: int) -> Pixels:
    """Lines with their filters undone: each byte was written as its difference from a prediction."""
    found = np.zeros((len(lines), lines.shape[1] - 1), np.uint8)
    above = np.zeros(lines.shape[1] - 1, np.uint8)
    for row, line in enumerate(lines):
        how, here = int(line[0]), line[1:].copy()
        if how == 2:
            here += above
        elif how == 1:
            here = np.add.accumulate(here.reshape(-1, channels), axis=0, dtype=np.uint8).ravel()
        elif how in (3, 4):
            here = _predicted(here, above, channels, paeth=how == 4)
        found[row] = above = here
    return found


def _predicted(line: Pixels, above: Pixels, channels: int, *, paeth: bool) -> Pixels:
    here, over = bytearray(line.tobytes()), above.tobytes()
    for i in range(len(here)):
        left = here[i - channels] if i >= channels else 0
        corner = over[i - channels] if i >= channels else 0
        if paeth:
            guess = left + over[i] - corner
            near = min((left, over[i], corner), key=lambda candidate: abs(guess - candidate))
        else:
            near = (left + over[i]) // 2
        here[i] = (here[i] + near) & 0xFF
    return np.frombuffer(bytes(here), np.uint8)


def write(path: Path, frames: Sequence[Pixels], delays: Sequence[float]) -> None:
    """Write frames, all of one shape (height, width, 3), each shown for so many seconds, repeating for ever."""
    palette, indexed = _reduced(frames)
    height, width = indexed[0].shape
    out = [
        _SIGNATURE,
        _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
        _chunk(b"acTL", struct.pack(">II", len(frames), 0)),
        _chunk(b"PLTE", palette.tobytes()),
        _chunk(b"tRNS", b"\xff" * COLOURS + b"\x00"),
    ]
    number = 0
    shown = indexed[0]
    for i, (frame, delay) in enumerate(zip(indexed, delays, strict=True)):
        same = np.abs(palette[frame].astype(np.int16) - palette[shown]).max(axis=2) <= UNSEEN
        changed = frame if i == 0 else np.where(same, UNCHANGED, frame).astype(np.uint8)
        shown = np.where(same, shown, frame)
        x, y, w, h = (0, 0, width, height) if i == 0 else _box(changed)
        control = (number, w, h, x, y, round(delay * 1000), 1000, 0, 1 if i else 0)
        out.append(_chunk(b"fcTL", struct.pack(">IIIIIHHBB", *control)))
        number += 1
        data = _packed(changed[y : y + h, x : x + w])
        if i == 0:
            out.append(_chunk(b"IDAT", data))
        else:
            out.append(_chunk(b"fdAT", struct.pack(">I", number) + data))
            number += 1
    out.append(_chunk(b"IEND", b""))
    path.write_bytes(b"".join(out))


def _reduced(frames: Sequence[Pixels]) -> tuple[Pixels, list[Pixels]]:
    """A palette of `COLOURS` colours (and one that is not seen), and each frame in places of it.

    Colours of 5 bits a channel are taken one by one, each time the one that is common and far from those taken before;
    every other becomes the nearest of them.
    """
    counts = np.zeros(1 << 15, np.int64)
    sums = np.zeros((1 << 15, 3), np.float64)
    for frame in frames:
        keys = _keys(frame)
        counts += np.bincount(keys, minlength=1 << 15)
        for channel in range(3):
            sums[:, channel] += np.bincount(keys, frame[:, :, channel].ravel(), minlength=1 << 15)
    used = np.flatnonzero(counts)
    means = sums[used] / counts[used][:, None]
    colours = np.zeros((COLOURS + 1, 3))
    away = np.full(len(used), np.inf)
    places = np.zeros(len(used), np.uint8)
    for place in range(min(COLOURS, len(used))):
        chosen = int(np.argmax(counts[used])) if place == 0 else int(np.argmax(np.sqrt(counts[used]) * away))
        colours[place] = means[chosen]
        from_it = ((means - means[chosen]) ** 2).sum(axis=1)
        places[from_it < away] = place
        away = np.minimum(away, from_it)
    nearest = np.zeros(1 << 15, np.uint8)
    nearest[used] = places
    return np.round(colours).astype(np.uint8), [nearest[_keys(frame)].reshape(frame.shape[:2]) for frame in frames]


def _keys(frame: Pixels) -> NDArray[np.int64]:
    r, g, b = (frame[:, :, channel].astype(np.int64).ravel() >> 3 for channel in range(3))
    return r << 10 | g << 5 | b


def _box(changed: Pixels) -> tuple[int, int, int, int]:
    """x, y, width and height of what has changed; one pixel if nothing has."""
    rows, columns = (np.flatnonzero((changed != UNCHANGED).any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return 0, 0, 1, 1
    x, y = int(columns[0]), int(rows[0])
    return x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1


def _packed(pixels: Pixels) -> bytes:
    """The lines of a picture, each without a filter, compressed."""
    lines = np.zeros((pixels.shape[0], pixels.shape[1] + 1), np.uint8)
    lines[:, 1:] = pixels
    return zlib.compress(lines.tobytes(), 9)


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
