"""ROS maps: a YAML file and the image it names, interpreted as ROS does, converted to areas along the borders of cells.

A pixel is a cell of `resolution` m; the lower left corner of the image lies at `origin` (x, y, yaw) of the map's
frame. Black pixels are occupied (with `negate`: white ones); with p, the occupancy from 0 to 1,

    trinary   p > occupied_thresh is solid, p < free_thresh is open, the rest unknown
    scale     the same, but values in between are open, and pixels that are not fully opaque are unknown
    raw       a pixel's value is a percentage: above occupied_thresh is solid, above 100 is unknown

PyYAML reads the YAML and Pillow the image, where they are installed; no other file is opened.
"""

from __future__ import annotations

import warnings
from math import cos, sin
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Document, Path_, SettingsError, Table, read_text
from sleepcast.core.units import LENGTH
from sleepcast.simulator.world.world import MAX_SOLIDS, Area, Point

MAX_YAML = 65_536
"""Bytes of a map's YAML file: real ones have about three hundred."""
MAX_PIXELS = 16_777_216
"""Pixels of a map's image: 4096 by 4096, a square of 200 m at 5 cm per pixel."""
MODES = ("trinary", "scale", "raw")
FINEST, COARSEST = 1e-4, 1e4
"""Size of a pixel, m."""
GREY, WHITE = 205, 255
"""The grey that map_saver writes for a cell that nobody has seen, and white."""

Cells = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class RosMap:
    """Which cells are solid and which are unknown, both of shape (rows, columns), bottom row first.

    resolution: size of a cell, m
    x, y, yaw: pose of the lower left corner in the map's frame, m and rad
    file: the image
    opened: whether cells in the grey that map_saver writes for unknown ones are free by the map's own free_thresh, as
        with the 0.25 of Nav2
    """

    solid: Cells
    unknown: Cells
    resolution: float
    x: float
    y: float
    yaw: float
    file: Path
    opened: bool = False

    def corner(self, at: Point | None) -> Point:
        """The lower left corner of the image in the world's frame. at: as in `area`."""
        if at is not None:
            return at[0] + self.x, at[1] + self.y
        box = self._box()
        return -min(x for x, _ in box), -min(y for _, y in box)

    def _box(self) -> list[Point]:
        """The corners of the image, from its lower left one, in the map's frame, m."""
        rows, columns = self.solid.shape
        return [self._turned(column, row) for column in (0, columns) for row in (0, rows)]

    def area(self, at: tuple[float, float] | None, *, unknown_is_solid: bool) -> tuple[Area, Point, Point]:
        """The solid area in the world's frame, and the lower left and upper right corner of the whole image's bounding
        box. at: position of the map's (0, 0) in the world, m; None puts the box's lower left corner on the world's.
        Raises MisuseError for more sides than fit."""
        box = self._box()
        low = min(x for x, _ in box), min(y for _, y in box)
        high = max(x for x, _ in box), max(y for _, y in box)
        move = self.corner(at)
        lines = contours(self.solid | self.unknown if unknown_is_solid else self.solid)
        area = Area(tuple(tuple(_moved(self._turned(*corner), move) for corner in line) for line in lines))
        return area, _moved(low, move), _moved(high, move)

    def _turned(self, column: int, row: int) -> Point:
        """Vector from the image's lower left corner to a corner of a cell, in the map's frame, m."""
        x, y = column * self.resolution, row * self.resolution
        if not self.yaw:
            return x, y
        return x * cos(self.yaw) - y * sin(self.yaw), x * sin(self.yaw) + y * cos(self.yaw)


def _moved(point: Point, move: Point) -> Point:
    return point[0] + move[0], point[1] + move[1]


def read_map(path: Path) -> RosMap:
    """The map described by the YAML file at `path`. Raises SettingsError with the file and, where known, the line;
    MisuseError if a library is missing."""
    needs = "no map: wanted lines such as resolution: 0.05"
    table = yaml_document(path, MAX_YAML, needs, "a map needs no aliases: write the value out").root()
    resolution = table.number("resolution", LENGTH, low=FINEST, high=COARSEST)
    x, y, yaw = table.numbers("origin", ("x", "y", "yaw"))
    mode = table.text("mode", "trinary", choices=MODES)
    negate = _flag(table, "negate")
    occupied = table.number("occupied_thresh", low=0.0, high=1.0)
    free = table.number("free_thresh", low=0.0, high=1.0)
    if free > occupied:
        raise table.error("free_thresh", f"{free:g} is more than occupied_thresh, {occupied:g}")
    file = table.file("image")
    channels, white, colours = picture(file)
    solid, unknown = _judged(channels, white, colours, mode, negate, occupied, free)
    usual = mode == "trinary" and not negate
    opened = usual and bool((_grey(channels, white) & ~solid & ~unknown).any())
    return RosMap(solid[::-1], unknown[::-1], resolution, x, y, yaw, file, opened)


def yaml_document(path: Path, most: int, wanted: str, aliases: str) -> Document:
    """The values of a YAML file of at most `most` bytes that holds one table, and the line of each key. It runs
    nothing, and has no aliases, by which a small file could be a huge one. wanted, aliases: what to say of another
    file, and of one with aliases. Raises SettingsError, and MisuseError without PyYAML."""
    try:
        import yaml
    except ImportError:
        raise _missing("PyYAML") from None
    text = read_text(path, most)
    try:
        for token in yaml.scan(text, yaml.SafeLoader):
            if isinstance(token, yaml.AliasToken):
                raise SettingsError(f"{path}:{token.start_mark.line + 1}: {aliases}")
        loader = yaml.SafeLoader(text)
        node = loader.get_single_node()
        if not isinstance(node, yaml.MappingNode):
            raise SettingsError(f"{path}:1: {wanted}")
        lines: dict[Path_, int] = {(str(key.value),): key.start_mark.line + 1 for key, _ in node.value}
        document = loader.construct_document(node)
        if not isinstance(document, dict):  # for example a set
            raise SettingsError(f"{path}:1: {wanted}")
        values: dict[str, object] = {str(key): value for key, value in document.items()}
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise SettingsError(f"{path}:{line}: not YAML: {error.problem or error.context}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # bad characters, impossible dates, depth
        raise SettingsError(f"{path}:1: not YAML: {str(error).splitlines()[0]}") from None
    except (LookupError, AttributeError):  # !!bool or !!timestamp before something else
        raise SettingsError(f"{path}:1: not YAML: a tag (!!) before a value that it does not fit") from None
    return Document(path, values, lines)


def _flag(table: Table, key: str) -> bool:
    """A boolean as 0 or 1, whether written as a number or in YAML's words."""
    if isinstance(table.values.get(key), bool):
        return table.flag(key, False)
    return table.whole(key, low=0, high=1) == 1


def picture(path: Path) -> tuple[NDArray[np.uint32], int, int]:
    """The channels of a PGM or PNG image, shape (rows, columns, channels), top row first; the value of white; and the
    number of colour channels."""
    try:
        from PIL import Image
    except ImportError:
        raise _missing("Pillow") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the bound below is far lower
            with Image.open(path, formats=("PPM", "PNG")) as image:
                columns, rows = image.size
                if columns * rows > MAX_PIXELS:
                    raise SettingsError(f"{path}: {columns} by {rows} pixels; at most {MAX_PIXELS} fit")
                if image.mode == "F":
                    raise SettingsError(f"{path}: a picture of fractions; wanted a PGM or PNG with whole numbers")
                deep = image.mode.startswith("I")  # one channel of 16 bits
                colour = "L" if image.mode in ("1", "L", "LA") else "RGB"
                alpha = "A" if "transparency" in image.info or image.mode in ("LA", "PA", "RGBA") else ""
                plain = image if deep else image.convert(colour + alpha)
                values = np.asarray(plain).astype(np.uint32).reshape(rows, columns, -1)
    except Image.DecompressionBombError:
        raise SettingsError(f"{path}: far too many pixels; at most {MAX_PIXELS} fit") from None
    except (OSError, ValueError, SyntaxError, EOFError) as error:  # what Pillow raises for a damaged image
        raise SettingsError(f"{path}: no PGM or PNG picture that can be read: {error}") from None
    channels = values.shape[2]
    return values, 65_535 if deep else 255, channels - 1 if channels in (2, 4) else channels


def _judged(
    channels: NDArray[np.uint32], white: int, colours: int, mode: str, negate: bool, occupied: float, free: float
) -> tuple[Cells, Cells]:
    """Which pixels are solid and which are unknown."""
    # In trinary maps transparency counts as partly white, as in ROS.
    looked_at = channels if mode == "trinary" else channels[:, :, :colours]
    total = looked_at.sum(axis=2, dtype=np.uint32)
    most = white * looked_at.shape[2]
    light = np.arange(most + 1) / most
    if mode == "raw":
        percent = np.rint(255.0 * light)
        return (percent / 100.0 > occupied)[total] & (percent <= 100.0)[total], (percent > 100.0)[total]
    dark = light if negate else light[::-1]
    solid = (dark > occupied)[total]
    if mode == "scale":
        clear = np.zeros_like(solid) if colours == channels.shape[2] else channels[:, :, -1] != white
        return solid & ~clear, clear
    return solid, ((dark <= occupied) & (dark >= free))[total]


def _grey(channels: NDArray[np.uint32], white: int) -> Cells:
    """Which pixels have the grey of an unknown cell, in whatever depth and with however many channels."""
    return cast(Cells, (channels * np.uint32(WHITE) == white * GREY).all(axis=2))


def _missing(library: str) -> MisuseError:
    return MisuseError(
        f"maps and pictures are read with {library}, which is not here; to install it: {installing('maps')}"
    )


# Outlines of the solid cells of a grid: closed lines along the borders of cells, corner by corner, exact.

Corner = tuple[int, int]

SOUTH_WEST, SOUTH_EAST, NORTH_WEST, NORTH_EAST = 1, 2, 4, 8
"""Which of the four cells around a grid point are solid: bits that are added up."""
RISING = SOUTH_WEST + NORTH_EAST
FALLING = SOUTH_EAST + NORTH_WEST
CORNER_COUNTS = np.array([2 if code in (RISING, FALLING) else bin(code).count("1") % 2 for code in range(16)])
CORNERS = CORNER_COUNTS > 0


def corners_of(solid: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint8]]:
    """Column, row and surroundings of each corner, row by row from the bottom. solid: shape (rows, columns), bottom row
    first. A point where two solid cells touch counts as two corners. Raises MisuseError for more than MAX_SOLIDS."""
    cells = np.pad(solid, 1).astype(np.uint8)
    round_ = cells[:-1, :-1] * SOUTH_WEST
    round_ += cells[:-1, 1:] * SOUTH_EAST
    round_ += cells[1:, :-1] * NORTH_WEST
    round_ += cells[1:, 1:] * NORTH_EAST
    sides = int(np.bincount(round_.ravel(), minlength=16) @ CORNER_COUNTS)
    if sides > MAX_SOLIDS:  # before there is a list of them: a small file may be a chessboard of millions of pixels
        raise MisuseError(f"the map's walls have {sides} sides; at most {MAX_SOLIDS} fit: take a coarser map")
    row, column = np.nonzero(CORNERS[round_])
    code = round_[row, column]
    times = 1 + ((code == RISING) | (code == FALLING))
    return np.repeat(column, times), np.repeat(row, times), np.repeat(code, times)


def contours(solid: NDArray[np.bool_]) -> list[list[Corner]]:
    """The closed lines around all solid cells, holes included: for each its corners (column, row), no three of them
    collinear. solid: shape (rows, columns), bottom row first."""
    column, row, code = corners_of(solid)
    count = len(column)
    numbers = np.arange(count)
    # Of two corners at one point the first belongs to the line going left, the second to the one going right; the first
    # is the lower one where the solid cells rise to the right.
    second = np.zeros(count, bool)
    second[1:] = (column[1:] == column[:-1]) & (row[1:] == row[:-1])
    upwards = np.lexsort((second ^ (code == FALLING), row, column))
    beside = numbers ^ 1
    above = np.empty(count, np.int64)
    above[upwards] = upwards[numbers ^ 1]
    return _rounds(list(zip(column.tolist(), row.tolist(), strict=True)), beside.tolist(), above.tolist())


def _rounds(corners: list[Corner], beside: list[int], above: list[int]) -> list[list[Corner]]:
    """The corners in order along each line, beginning with its lowest one."""
    seen = bytearray(len(corners))
    lines = []
    for first in range(len(corners)):
        here, line = first, []
        while not seen[here]:
            beyond = beside[here]
            seen[here] = seen[beyond] = 1
            line += [corners[here], corners[beyond]]
            here = above[beyond]
        if line:
            lines.append(line)
    return lines
