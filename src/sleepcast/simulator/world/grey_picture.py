"""Grey pictures that stand for numbers, stretched over the whole world: a part of a field, or the ground's height."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import dataclass
from sleepcast.core.settings import SettingsError, Table
from sleepcast.simulator.world.grid import Floats, Whole

MAX_PIXELS = 262_144
"""Pixels of such a picture, 512 by 512: snapshots and recordings contain it."""


@dataclass(frozen=True, slots=True)
class Picture:
    """Grey values, stretched over the whole world: black is `low`, white is `high`. grey: two hexadecimal digits
    for each pixel, or four where it is deep, row by row from the top."""

    columns: int
    rows: int
    grey: str
    low: float
    high: float
    deep: bool = False


def read_picture(table: Table, low: float, high: float, *, heights: bool = False) -> Picture:
    """The picture that `file` of a table names. heights: whether it is a ground map: 16 bits are kept of one that has
    them, and colours are refused. Raises SettingsError for none that can be read and for too many pixels, MisuseError
    without Pillow."""
    from sleepcast.simulator.world.ros_map import picture

    path = table.file("file")
    channels, white, colours = picture(path)
    rows, columns, _ = channels.shape
    if rows * columns > MAX_PIXELS:
        raise SettingsError(f"{path}: {columns} by {rows} pixels; at most {MAX_PIXELS} fit: take a smaller picture")
    if heights and not _is_plain(channels, white, colours):
        wanted = f"wanted greys alone, from black, which is {low:g} m high, to white, {high:g} m"
        raise SettingsError(f"{path}: a picture in colours, or partly transparent: {wanted}. Save it in greys")
    deep = heights and white > 255
    grey = np.rint(channels[:, :, :colours].mean(axis=2) * (_white(deep) / white)).astype(_kind(deep))
    return Picture(columns, rows, grey.tobytes().hex(), low, high, deep)


def _is_plain(channels: NDArray[np.uint32], white: int, colours: int) -> bool:
    """Whether these are greys that hide nothing below them."""
    grey = channels[:, :, :1]
    return bool((channels[:, :, :colours] == grey).all() and (channels[:, :, colours:] == white).all())


def picture_of(heights: Floats, low: float) -> Picture:
    """Numbers as a picture of 16 bits, whose least one is `low`; shape (rows, columns), the top row first."""
    least, most = float(heights.min()), float(heights.max())
    shares = (heights - least) / (most - least if most > least else 1.0)
    rows, columns = heights.shape
    grey = np.rint(shares * _white(True)).astype(_kind(True))
    return Picture(columns, rows, grey.tobytes().hex(), low, low + most - least, deep=True)


class Stretched:
    """A picture over a world of this size, m. wraps: whether what lies beyond an edge is what lies at the opposite one,
    as on a torus."""

    def __init__(self, picture: Picture, size: tuple[float, float], *, wraps: bool = False) -> None:
        pixels = np.frombuffer(bytes.fromhex(picture.grey), _kind(picture.deep))
        self._grey = pixels.reshape(picture.rows, picture.columns)[::-1]
        self._low, self._size, self._wraps = picture.low, size, wraps
        self._step = (picture.high - picture.low) / _white(picture.deep)

    def at(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """The value at each place, m, and how it rises to the east and to the north, for a metre: linear between the
        middles of pixels, and, unless it wraps, even in the outer half of those at the border and beyond."""
        axes = []
        (rows, columns), grey, low, step = self._grey.shape, self._grey, self._low, self._step
        for points, side, count in ((x, self._size[0], columns), (y, self._size[1], rows)):
            axes.append(self._between(points * (count / side) - 0.5, count, count / side))
        (left, right, share, per_x), (below, above, height, per_y) = axes
        corners = [low + step * grey[row, column] for row in (below, above) for column in (left, right)]
        bottom, top = (corners[i] + share * (corners[i + 1] - corners[i]) for i in (0, 2))
        slope = (1.0 - height) * (corners[1] - corners[0]) + height * (corners[3] - corners[2])
        return bottom + height * (top - bottom), slope * per_x, (top - bottom) * per_y

    def _between(self, wanted: Floats, count: int, steep: float) -> tuple[Whole, Whole, Floats, Floats]:
        """Between which two of so many pixels each place of an axis lies, at which share of the way from one to the
        other, and by what to multiply what it rises from pixel to pixel, for a metre. wanted: in pixels; steep: of
        these, in a metre"""
        if self._wraps:
            first = np.floor(wanted).astype(np.int64)
            return first % count, (first + 1) % count, wanted - first, np.full(len(wanted), steep)
        here = np.clip(wanted, 0.0, count - 1.0)
        before = np.minimum(np.floor(here), max(count - 2, 0)).astype(np.int64)
        return before, np.minimum(before + 1, count - 1), here - before, (wanted == here) * steep


def bounds_of_picture(picture: Picture) -> Iterator[tuple[str, float, float, float]]:
    """See `fields.bounds_of_fields`."""
    yield "columns of pixels", picture.columns, 1, MAX_PIXELS
    yield "rows of pixels", picture.rows, 1, MAX_PIXELS
    pixels = picture.columns * picture.rows
    yield "pixels", pixels, 1, MAX_PIXELS
    digits = len(picture.grey) if {*picture.grey} <= {*"0123456789abcdef"} else -1
    wanted = (4 if picture.deep else 2) * pixels
    yield "digits of a picture", digits, wanted, wanted


def _white(deep: bool) -> float:
    return 65_535.0 if deep else 255.0


def _kind(deep: bool) -> str:
    """The type of a pixel in `Picture.grey`."""
    return ">u2" if deep else ">u1"
