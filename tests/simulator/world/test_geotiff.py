"""GeoTIFFs as ground maps: heights in metres, and how wide they reach; whatever leaves that open is refused."""

from __future__ import annotations

import base64
import struct
import sys
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Scenario, load
from sleepcast.simulator.world.geotiff import BITS, COLUMNS, NOT_READ, TILE_COLUMNS, read_geotiff

OF_GDAL = (
    "SUkqAAgAAAAQAAABAwABAAAADAAAAAEBAwABAAAACAAAAAIBAwABAAAAIAAAAAMBAwABAAAABQAAAAYBAwABAAAAAQAAABEBBAABAAAAdAEAABUB"
    "AwABAAAAAQAAABYBAwABAAAACAAAABcBBAABAAAAcAAAABwBAwABAAAAAQAAAD0BAwABAAAAAwAAAFMBAwABAAAAAwAAAA6DDAADAAAAzgAAAIKE"
    "DAAGAAAA5gAAAK+HAwAgAAAAFgEAALGHAgAeAAAAVgEAAAAAAAAAAAAAAAAkQAAAAAAAABRAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA"
    "AAAAAAAAgIQeQQAAAADIN1RBAAAAAAAAAAABAAEAAAAHAAAEAAABAAEAAQQAAAEAAQACBLGHFgAAAAEIsYcHABYABggAAAEAjiMADAAAAQB4fwQM"
    "AAABACkjV0dTIDg0IC8gVVRNIHpvbmUgMzJOfFdHUyA4NHwAgBDAEDgkFACUAABhUJhcKELAiERiUQg0VgUVgsIhQBhkchRBichUEYgsXkkHj0Nh"
    "phkMTQEngcmkiUlM1hKBlsSMEwAEyjE0m0bAChnMRIE8n0VoEdpjBosQEFInlAoMKcFPYE8ntToVdhdYcE8gIA=="
)
"""What GDAL 3.10.3 has written by way of rasterio 1.4.4: 12 by 8 pixels of 10 by 5 m in UTM zone 32, float32, LZW with
predictor 3; 430 m in its upper left pixel, 1.5 m more with each to the right, and 0.25 m more with each below."""
HEIGHTS = 430.0 + 1.5 * np.arange(12) + 0.25 * np.arange(8)[:, None]
UTM_32 = {1024: 1, 1025: 1, 3072: 32632, 3076: 9001}
WORLD = """
format = 2
title = "over a GeoTIFF"
seconds = "1min"

[world]
ground = "hills.tif"

[robots]
like = "copter"
starts = [["15m", "12.5m", "0deg"]]
"""


def written(
    folder: Path,
    heights: np.ndarray = HEIGHTS.astype(np.float32),  # noqa: B008  # nobody changes it
    keys: Mapping[int, int] = UTM_32,
    tags: Mapping[int, object] = {},
    compression: str | None = None,
) -> Path:
    """A GeoTIFF that Pillow has written: of pixels of 10 by 5 m, with these keys of GeoTIFF and other tags."""
    info = ImageFileDirectory_v2()
    info[33550] = (10.0, 5.0, 0.0)
    if keys:
        info[34735] = (1, 1, 0, len(keys), *(part for key, value in keys.items() for part in (key, 0, 1, value)))
        info.tagtype[34735] = 3
    for tag, value in tags.items():
        info[tag] = value
        info.tagtype[tag] = 2 if isinstance(value, str) else 12 if isinstance(value, tuple) else 3
    Image.fromarray(heights).save(folder / "hills.tif", tiffinfo=info, compression=compression)
    return folder / "hills.tif"


def noted(name: str, value: str) -> dict[int, str]:
    """The tag in which GDAL notes this of a band."""
    return {
        42112: f'<GDALMetadata>\n  <Item name="{name}" sample="0" role="{name.lower()}">{value}</Item>\n</GDALMetadata>'
    }


def scenario(folder: Path, change: tuple[str, str] = ("", "")) -> Scenario:
    (folder / "scenario.toml").write_text(WORLD.replace(*change), encoding="utf-8")
    return load(folder)


def test_a_file_of_gdal_is_read_to_the_millimetre(tmp_path: Path) -> None:
    (tmp_path / "hills.tif").write_bytes(base64.b64decode(OF_GDAL))
    found = read_geotiff(tmp_path / "hills.tif")
    assert found.heights.tolist() == HEIGHTS.tolist()
    assert (found.width, found.height) == (120.0, 40.0)


def test_a_world_is_as_large_as_its_geotiff_and_begins_at_its_lowest_place(tmp_path: Path) -> None:
    written(tmp_path)
    world = scenario(tmp_path)
    assert (world.width, world.height) == (120.0, 40.0)
    middles = [(x, y) for y in np.arange(37.5, 0.0, -5.0) for x in np.arange(5.0, 120.0, 10.0)]
    heights = [world.ground_at(x, y) for x, y in middles]
    assert heights == pytest.approx((HEIGHTS - 430.0).ravel(), abs=2e-4)
    raised = scenario(tmp_path, ('"hills.tif"', '{ file = "hills.tif", low = "3m" }'))
    assert raised.ground_at(5.0, 37.5) == 3.0
    assert scenario(tmp_path, ("[world]", '[world]\nwidth = "120m"\nheight = "40m"')) == world


@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_adobe_deflate", "packbits"])
@pytest.mark.parametrize("kind", ["<f4", "<i4", "<u2", "u1"])
def test_numbers_of_all_kinds_are_heights(tmp_path: Path, kind: str, compression: str | None) -> None:
    heights = np.arange(96).reshape(8, 12)
    assert read_geotiff(written(tmp_path, heights.astype(kind), compression=compression)).heights.tolist() == (
        heights.tolist()
    )


def turned_round(folder: Path, *, compressed: bool) -> Path:
    """A TIFF of whole heights whose numbers begin with their greatest bytes."""
    data = HEIGHTS.astype(">i2").tobytes()
    data = zlib.compress(data) if compressed else data
    rows, columns = HEIGHTS.shape
    tags = {256: columns, 257: rows, 258: 16, 259: 8 if compressed else 1, 262: 1, 273: 0, 277: 1, 278: rows}
    tags |= {279: len(data), 339: 2}
    tags[273] = 8 + 2 + 12 * len(tags) + 4
    entries = b"".join(struct.pack(">HHII", tag, 4, 1, value) for tag, value in tags.items())
    (folder / "hills.tif").write_bytes(b"MM\0*" + struct.pack(">IH", 8, len(tags)) + entries + bytes(4) + data)
    return folder / "hills.tif"


def test_compressed_numbers_that_are_turned_round_are_refused_since_pillow_reads_others(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="begin with their greatest bytes: gdal_translate -co ENDIANNESS=LITTLE"):
        read_geotiff(turned_round(tmp_path, compressed=True))
    with pytest.raises(SettingsError, match="it does not say how large its pixels are"):
        read_geotiff(turned_round(tmp_path, compressed=False))


@pytest.mark.parametrize(
    "note", [noted("SCALE", "1"), noted("OFFSET", "0"), noted("UNITTYPE", "metre"), noted("TINT", "0.1")]
)
def test_what_gdal_notes_of_a_band_may_say_that_it_is_in_metres(tmp_path: Path, note: Mapping[int, object]) -> None:
    assert read_geotiff(written(tmp_path, tags=note)).heights.tolist() == HEIGHTS.tolist()


@pytest.mark.parametrize("content", [b"", b"heights", b"II*\0" + bytes(4), b"II*\0\x08\0\0\0" + bytes(6)])
def test_a_file_with_the_name_of_one_is_refused_as_one(tmp_path: Path, content: bytes) -> None:
    for name in ("hills.tif", "hills.TIFF"):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(SettingsError, match=r"(?i)hills\.tiff?: no GeoTIFF that can be read"):
            scenario(tmp_path, ("hills.tif", name))


def test_a_level_one_is_level(tmp_path: Path) -> None:
    written(tmp_path, np.full((8, 12), 99.0, np.float32))
    assert scenario(tmp_path).ground_at(50.0, 20.0) == 0.0


@pytest.mark.parametrize(
    ("keys", "tags", "why"),
    [
        ({}, {}, "it does not say how large its pixels are"),
        ({1024: 2, 2048: 4326}, {}, "its pixels are degrees; gdalwarp -t_srs"),
        ({1024: 1, 3072: 2263, 3076: 9003}, {}, "measured in something else than metres"),
        ({1024: 1, 3072: 32632, 3076: 9001, 4099: 9002}, {}, "measured in something else than metres"),
        ({1024: 1, 3072: 2263}, {}, "it does not say that its pixels are measured in metres"),
        (UTM_32, {33550: (0.0, 5.0, 0.0)}, "its pixels are 0 by 5 m"),
        (UTM_32, {42113: "430"}, "1 of its pixels have no height: gdal_fillnodata.py"),
        (UTM_32, {42113: "many"}, "no GeoTIFF that can be read"),
        (UTM_32, noted("SCALE", "0.1"), "its heights are scaled: gdal_translate -unscale"),
        (UTM_32, noted("OFFSET", "-100"), "its heights are scaled: gdal_translate -unscale"),
        (UTM_32, noted("SCALE", "half"), "no GeoTIFF that can be read"),
        (UTM_32, noted("UNITTYPE", "US survey foot"), "something else than metres: gdal_calc.py turns US survey foot"),
    ],
)
def test_what_it_leaves_open_is_refused(
    tmp_path: Path, keys: Mapping[int, int], tags: Mapping[int, object], why: str
) -> None:
    written(tmp_path, keys=keys, tags=tags)
    with pytest.raises(SettingsError, match=why) as caught:
        scenario(tmp_path)
    assert "hills.tif: " in str(caught.value)


def test_a_system_of_utm_is_known_to_be_of_metres(tmp_path: Path) -> None:
    assert read_geotiff(written(tmp_path, keys={1024: 1, 3072: 32632})).width == 120.0


@pytest.mark.parametrize(
    ("heights", "why"),
    [
        (np.zeros((8, 12, 3), np.uint8), "it has 3 bands; wanted one, of heights"),
        (np.zeros((600, 500), np.uint8), "500 by 600 pixels; at most 262144 fit"),
        (np.full((8, 12), np.nan, np.float32), "96 of its pixels have no height"),
        (np.array([[0.0, 2e4]], np.float32), "its heights differ by 20000 m; at most"),
    ],
)
def test_more_than_heights_that_fit_is_refused(tmp_path: Path, heights: np.ndarray, why: str) -> None:
    written(tmp_path, heights)
    with pytest.raises(SettingsError, match=why):
        scenario(tmp_path)


def test_it_is_refused_before_anything_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Image, "open", lambda *_, **__: pytest.fail("it was opened"))
    for at, tag, value, why in (
        (10, COLUMNS, 65_535, "65535 by 8 pixels"),
        (34, BITS, 64, NOT_READ),
        (46, TILE_COLUMNS, 2**31 - 1, "its tiles have more than"),
    ):
        changed = bytearray(base64.b64decode(OF_GDAL))
        changed[at : at + 12] = struct.pack("<HHII", tag, 4, 1, value)
        (tmp_path / "hills.tif").write_bytes(changed)
        with pytest.raises(SettingsError, match=why):
            read_geotiff(tmp_path / "hills.tif")
    (tmp_path / "hills.tif").write_bytes(b"II*\0" + bytes(2**24))
    with pytest.raises(SettingsError, match="too long for a GeoTIFF"):
        read_geotiff(tmp_path / "hills.tif")


def test_a_damaged_file_is_refused_whatever_is_wrong_with_it(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    whole, chance = base64.b64decode(OF_GDAL), np.random.default_rng(7)
    refused = 0
    for _ in range(300):
        damaged = bytearray(whole)
        for at in chance.integers(4, 360, 4).tolist():
            damaged[at] = int(chance.integers(256))
        (tmp_path / "hills.tif").write_bytes(damaged[: int(chance.integers(8, len(whole) + 200))])
        try:
            read_geotiff(tmp_path / "hills.tif")
        except SettingsError:
            refused += 1
    capfd.readouterr()  # what the library writes about them
    assert refused > 200
    (tmp_path / "hills.tif").write_bytes(b"II*\0")
    with pytest.raises(SettingsError, match="no GeoTIFF that can be read"):
        read_geotiff(tmp_path / "hills.tif")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (('"hills.tif"', '{ file = "hills.tif", high = "9m" }'), "ground.high: a GeoTIFF has heights in metres"),
        (("[world]", '[world]\nwidth = "100m"'), "it covers 120 by 40 m, and the world is 100 by 40 m: leave out"),
        (("[world]", "[world]\narea_per_robot = 50"), "it covers 120 by 40 m"),
        (('"hills.tif"', '"none.tif"'), "there is no file"),
    ],
)
def test_a_scenario_that_says_otherwise_is_refused(tmp_path: Path, change: tuple[str, str], why: str) -> None:
    written(tmp_path)
    with pytest.raises(SettingsError, match=why):
        scenario(tmp_path, change)


def test_without_its_library_it_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = written(tmp_path)
    monkeypatch.setitem(sys.modules, "PIL.TiffImagePlugin", None)
    with pytest.raises(MisuseError, match="GeoTIFFs are read with Pillow, which is not here; to install it: "):
        read_geotiff(file)
