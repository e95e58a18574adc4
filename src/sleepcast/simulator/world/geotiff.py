"""GeoTIFFs of one band of heights, in metres, on a map whose pixels are measured in metres: how high the ground is, and
how wide it reaches.

Pillow reads them, where it is installed. What it would have to guess is refused: a file that does not say how large its
pixels are, pixels of degrees or feet, places without a height, and numbers that it cannot read.
"""

from __future__ import annotations

import re
import struct
import warnings
from collections.abc import Mapping
from io import BytesIO
from math import isfinite
from pathlib import Path

import numpy as np

from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.core.records import NamedTuple
from sleepcast.core.settings import SettingsError, read_raw
from sleepcast.simulator.world.grey_picture import MAX_PIXELS
from sleepcast.simulator.world.grid import Floats

MAX_BYTES = 16_777_216
"""Of such a file: sixteen times the pixels that fit, with four bytes each."""
MAX_TILE = 1_048_576
"""Pixels of a tile, each of which is decoded as a whole."""
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
"""How a TIFF begins: with numbers in either order of bytes, and with room for large files."""
COLUMNS, ROWS, BITS, COMPRESSION, COLOURS, ORIENTATION, BANDS = 256, 257, 258, 259, 262, 274, 277
TILE_COLUMNS, TILE_ROWS, PIXEL_SIZE, TURNED, GEO_KEYS, NO_DATA, KIND = 322, 323, 33550, 34264, 34735, 42113, 339
METADATA = 42112
"""Tags of TIFF, GeoTIFF and GDAL."""
MODEL, SYSTEM, UNIT, HEIGHT_UNIT = 1024, 3072, 3076, 4099
PROJECTED, METRE = 1, 9001
"""Keys of GeoTIFF (OGC 19-008), and the values of these that are read."""
UTM = (*range(32_601, 32_661), *range(32_701, 32_761), *range(25_828, 25_839))
"""Systems of EPSG that are measured in metres, for files that name the system alone."""

OF_BAND = re.compile(r'<Item name="(SCALE|OFFSET|UNITTYPE)"[^>]*>([^<]*)<')
"""What GDAL notes of a band, in XML."""
METRES = ("", "m", "metre", "metres", "meter", "meters")
OTHER_UNIT = "its pixels or its heights are measured in something else than metres"

NOT_READ = (
    "its numbers, or how they are compressed, are not read: gdal_translate -ot Float32 -co COMPRESS=LZW writes others"
)

Tags = Mapping[int, object]


class HeightMap(NamedTuple):
    """heights: m, shape (rows, columns), top row first. width, height: of what it covers, m."""

    heights: Floats
    width: float
    height: float


def is_tiff(path: Path) -> bool:
    """Whether a file begins as a TIFF does, or is named so. Raises SettingsError for one that cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(4) in TIFF or path.suffix.lower() in (".tif", ".tiff")
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read: {error.strerror or error}") from error


def read_geotiff(path: Path) -> HeightMap:
    """The heights of a GeoTIFF. Raises SettingsError for one that has none, or that is too large, MisuseError without
    Pillow."""
    raw = read_raw(path, MAX_BYTES, "a GeoTIFF")
    try:
        tags = _tags(raw)
        _check_layout(tags, raw[:2] == b"MM")
        _check_band(tags)
        width, height = _extent(tags)
        return HeightMap(_heights(raw, tags), width, height)
    except _RefusedError as error:
        raise SettingsError(f"{path}: {error}") from None
    except (OSError, ValueError, SyntaxError, TypeError, LookupError, OverflowError, struct.error) as error:  # damaged
        raise SettingsError(f"{path}: no GeoTIFF that can be read: {error}") from None


class _RefusedError(Exception):
    """Why a file is no height map."""


def _tags(raw: bytes) -> Tags:
    """The tags of the first picture in a file."""
    try:
        from PIL.TiffImagePlugin import ImageFileDirectory_v2
    except ImportError:
        raise MisuseError(
            f"GeoTIFFs are read with Pillow, which is not here; to install it: {installing('maps')}"
        ) from None
    file = BytesIO(raw)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of tags that are cut off: what is wanted of them is missed below
        head = file.read(16 if raw[:4] in TIFF[2:] else 8)
        directory = ImageFileDirectory_v2(head)
        file.seek(directory.next)
        directory.load(file)
        return {tag: directory[tag] for tag in directory}


def _whole(tags: Tags, tag: int, usual: int) -> int:
    value = tags.get(tag, usual)
    value = value[0] if isinstance(value, tuple) and len(set(value)) == 1 else value
    if not isinstance(value, int):
        raise _RefusedError(f"no GeoTIFF that can be read: its tag {tag} is {value!r:.40}")
    return value


def _check_layout(tags: Tags, swapped: bool) -> None:
    """Refuse, before anything is decoded, what is no band of heights, or more than fits. swapped: the first bytes of
    its numbers are the greatest ones."""
    columns, rows, bits = _whole(tags, COLUMNS, 0), _whole(tags, ROWS, 0), _whole(tags, BITS, 1)
    if (bands := _whole(tags, BANDS, 1)) != 1:
        raise _RefusedError(f"it has {bands} bands; wanted one, of heights: gdal_translate -b 1 takes the first")
    if min(columns, rows) < 1:
        raise _RefusedError("no GeoTIFF that can be read: it has no pixels")
    if columns * rows > MAX_PIXELS:
        raise _RefusedError(
            f"{columns} by {rows} pixels; at most {MAX_PIXELS} fit: gdal_translate -outsize 512 0 makes a smaller one"
        )
    if _whole(tags, TILE_COLUMNS, 1) * _whole(tags, TILE_ROWS, 1) > MAX_TILE:
        raise _RefusedError(f"its tiles have more than {MAX_TILE} pixels")
    if bits not in (8, 16, 32) or (bits == 8 and _whole(tags, KIND, 1) != 1):
        raise _RefusedError(NOT_READ)
    if _whole(tags, COLOURS, 1) != 1 or _whole(tags, ORIENTATION, 1) != 1:
        raise _RefusedError("wanted heights, the upper row first, not the colours of a picture")
    if swapped and bits > 8 and _whole(tags, COMPRESSION, 1) != 1:  # which Pillow decodes to other numbers
        raise _RefusedError(
            "its numbers begin with their greatest bytes: gdal_translate -co ENDIANNESS=LITTLE turns them"
        )


def _check_band(tags: Tags) -> None:
    """Refuse numbers that become heights in metres only by what GDAL notes of their band."""
    noted = {name: value.strip() for name, value in OF_BAND.findall(str(tags.get(METADATA, "")))}
    if noted.get("UNITTYPE", "m").lower() not in METRES:
        raise _RefusedError(f"{OTHER_UNIT}: gdal_calc.py turns {noted['UNITTYPE']:.20} into metres")
    if (float(noted.get("SCALE", 1.0)), float(noted.get("OFFSET", 0.0))) != (1.0, 0.0):
        raise _RefusedError("its heights are scaled: gdal_translate -unscale -ot Float32 makes metres of them")


def _extent(tags: Tags) -> tuple[float, float]:
    """How wide and how high the map is, m."""
    size, keys = tags.get(PIXEL_SIZE), _geo_keys(tags)
    if TURNED in tags and size is None:
        raise _RefusedError("it is turned: gdalwarp makes one whose upper edge is in the north")
    model = keys.get(MODEL)
    if model is None or not isinstance(size, tuple) or len(size) < 2:
        raise _RefusedError("it does not say how large its pixels are; take a GeoTIFF, or a picture with low and high")
    if model != PROJECTED:
        raise _RefusedError("its pixels are degrees; gdalwarp -t_srs EPSG:32632, for example, makes some of metres")
    unit = keys.get(UNIT, METRE if keys.get(SYSTEM) in UTM else None)
    if unit is None:
        raise _RefusedError(
            "it does not say that its pixels are measured in metres; gdalwarp -t_srs EPSG:32632 makes such"
        )
    if unit != METRE or keys.get(HEIGHT_UNIT, METRE) != METRE:
        raise _RefusedError(f"{OTHER_UNIT}: gdalwarp changes that")
    across, down = float(size[0]), float(size[1])
    if not (isfinite(across) and isfinite(down) and min(across, down) > 0.0):
        raise _RefusedError(f"its pixels are {across:g} by {down:g} m")
    return across * _whole(tags, COLUMNS, 0), down * _whole(tags, ROWS, 0)


def _geo_keys(tags: Tags) -> dict[int, int]:
    """The keys that have whole numbers for values."""
    told = tags.get(GEO_KEYS, ())
    if not isinstance(told, tuple) or len(told) < 4 or not all(isinstance(each, int) for each in told):
        return {}
    rows = [told[at : at + 4] for at in range(4, len(told) - 3, 4)]
    return {key: value for key, place, _, value in rows if place == 0}


def _heights(raw: bytes, tags: Tags) -> Floats:
    from PIL import Image, UnidentifiedImageError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of damaged tags: those that count were looked at
        try:
            with Image.open(BytesIO(raw), formats=("TIFF",)) as image:
                heights: Floats = np.asarray(image).astype(np.float64)
        except UnidentifiedImageError:
            raise _RefusedError(NOT_READ) from None
    if heights.shape != (_whole(tags, ROWS, 0), _whole(tags, COLUMNS, 0)):
        raise _RefusedError(NOT_READ)
    told = str(tags.get(NO_DATA, "")).strip(" \0")
    unknown = ~np.isfinite(heights)
    if told:
        unknown |= np.isclose(heights, float(told), rtol=1e-6, atol=0.0)
    if unknown.any():
        raise _RefusedError(f"{int(unknown.sum())} of its pixels have no height: gdal_fillnodata.py fills them")
    return heights
