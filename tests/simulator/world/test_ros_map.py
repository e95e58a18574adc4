"""Maps of ROS: pixels become walls exactly where they lie, and what is wrong in a file is told in a sentence."""

from __future__ import annotations

import builtins
import re
from collections.abc import Sequence
from io import BytesIO
from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import sleepcast as sc
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.console.adapters.swarm import SwarmAdapter, scene_of
from sleepcast.console.view import PicturePlace
from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.loop import resume, snapshot
from sleepcast.simulator import Area, MapPicture, Scenario, SettingsError, Simulator, load
from sleepcast.simulator.recording.recording import load_recording
from sleepcast.simulator.world.ros_map import MAX_PIXELS, read_map
from small_worlds import SCOUTS, write

YAML = """# a room
image: room.pgm
resolution: 0.5
origin: [-3.0, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
ROOM = """P2
# made by hand
6 4
255
0 0 0 0 0 0
0 254 254 254 254 0 # a remark
0 254 254 205 254 0
0 0 0 0 254 0
"""
"""Six pixels by four, black all round but for a door at the bottom right; one pixel is unknown."""
SOLID = ["######", "#....#", "#....#", "####.#"]


def save(folder: Path, *changes: tuple[str, str], picture: str | bytes = ROOM, name: str = "room.pgm") -> Path:
    text = YAML
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / name).write_bytes(picture if isinstance(picture, bytes) else picture.encode())
    (folder / "room.yaml").write_text(text, encoding="utf-8")
    return folder / "room.yaml"


def shown(cells: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> list[str]:
    """The rows of a map from the top, as people see it."""
    return ["".join(".#"[cell] for cell in row) for row in cells[::-1].tolist()]


def one_row(folder: Path, *changes: tuple[str, str], values: Sequence[int] = (), top: int = 255) -> tuple[str, str]:
    """Which pixels of a map with one row are solid, and which unknown."""
    picture = f"P2\n{len(values)} 1\n{top}\n{' '.join(map(str, values))}\n"
    found = read_map(save(folder, *changes, picture=picture))
    return shown(found.solid)[0], shown(found.unknown)[0]


class TestPictures:
    def test_the_upper_row_of_the_picture_is_north(self, tmp_path: Path) -> None:
        found = read_map(save(tmp_path))
        assert shown(found.solid) == SOLID
        assert shown(found.unknown) == ["......", "......", "...#..", "......"]
        assert (found.resolution, found.x, found.y, found.yaw) == (0.5, -3.0, 2.0, 0.0)

    def test_plain_and_binary_shallow_and_deep_are_the_same(self, tmp_path: Path) -> None:
        grey = np.array([[int(word) for word in line.split("#")[0].split()] for line in ROOM.splitlines()[4:]])
        deep = (grey * 257).astype(">u2").tobytes()
        pictures: list[bytes] = [
            b"P5\n# remark\n6 4\n255\n" + grey.astype(np.uint8).tobytes(),
            b"P5 6 4 65535\n" + deep,
            ("P2\n6 4\n65535\n" + " ".join(map(str, (grey * 257).ravel()))).encode(),
        ]
        wanted = read_map(save(tmp_path))
        for picture in pictures:
            found = read_map(save(tmp_path, picture=picture))
            assert (found.solid == wanted.solid).all()
            assert (found.unknown == wanted.unknown).all()

    @pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "I;16"])
    def test_png(self, tmp_path: Path, mode: str) -> None:
        file = save(tmp_path, ("room.pgm", "room.png"))
        black = np.array([[cell == "#" for cell in row] for row in SOLID])
        picture = Image.fromarray(np.where(black, 0, 255).astype(np.uint8))
        if mode == "I;16":
            picture = Image.fromarray(np.where(black, 0, 65_535).astype(np.uint16))
        (picture if mode == "I;16" else picture.convert(mode)).save(tmp_path / "room.png")
        assert shown(read_map(file).solid) == SOLID

    def test_what_is_transparent_is_unknown_on_the_scale_and_lighter_in_three_parts(self, tmp_path: Path) -> None:
        picture = np.array([[[0, 255], [0, 0], [100, 255], [255, 255]]], np.uint8)
        file = save(tmp_path, ("room.pgm", "room.png"))
        Image.fromarray(picture).save(tmp_path / "room.png")
        assert shown(read_map(file).solid) == [".#.."]  # (0 + 255) / 2 and (100 + 255) / 2: as ROS takes them
        file = save(tmp_path, ("room.pgm", "room.png"), ("negate", "mode: scale\nnegate"))
        Image.fromarray(picture).save(tmp_path / "room.png")
        found = read_map(file)
        assert (shown(found.solid), shown(found.unknown)) == (["#..."], [".#.."])


class TestThresholds:
    def test_in_three_parts(self, tmp_path: Path) -> None:
        values = (0, 89, 90, 127, 205, 206, 255)  # (255 - 89) / 255 = 0.651, (255 - 205) / 255 = 0.19608
        assert one_row(tmp_path, values=values) == ("##.....", "..###..")

    def test_the_thresholds_themselves_are_neither(self, tmp_path: Path) -> None:
        changes = (("0.65", "0.6"), ("0.196", "0.2"))
        assert one_row(tmp_path, *changes, values=(1, 2, 4, 5), top=5) == ("#...", ".##.")

    def test_negated_white_is_solid(self, tmp_path: Path) -> None:
        for negate in ("1", "true"):
            found = one_row(tmp_path, ("negate: 0", f"negate: {negate}"), values=(0, 49, 127, 165, 166, 255))
            assert found == ("....##", "..##..")

    def test_on_a_scale_what_lies_between_is_open(self, tmp_path: Path) -> None:
        assert one_row(tmp_path, ("negate", "mode: scale\nnegate"), values=(0, 127, 255)) == ("#..", "...")

    def test_raw_values_are_percent(self, tmp_path: Path) -> None:
        found = one_row(tmp_path, ("negate", "mode: raw\nnegate"), values=(0, 65, 66, 100, 101, 255))
        assert found == ("..##..", "....##")


class TestPlacing:
    def test_corners_lie_exactly_where_the_cells_end(self, tmp_path: Path) -> None:
        area, low, high = read_map(save(tmp_path)).area(None, unknown_is_solid=False)
        assert (low, high) == ((0.0, 0.0), (3.0, 2.0))
        assert area == Area((
            ((0.0, 0.0), (2.0, 0.0), (2.0, 0.5), (0.5, 0.5), (0.5, 1.5), (2.5, 1.5),
             (2.5, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)),
        ))  # fmt: skip

    def test_unknown_cells_are_open_or_solid(self, tmp_path: Path) -> None:
        area, _, _ = read_map(save(tmp_path)).area(None, unknown_is_solid=True)
        assert (1.5, 1.0) in area.outlines[0]

    def test_the_maps_own_zero_may_lie_anywhere(self, tmp_path: Path) -> None:
        area, low, high = read_map(save(tmp_path)).area((10.0, 20.0), unknown_is_solid=False)
        assert (low, high) == ((7.0, 22.0), (10.0, 24.0))
        assert area.outlines[0][0] == (7.0, 22.0)

    def test_yaw_turns_the_picture_round_its_lower_left_corner(self, tmp_path: Path) -> None:
        yaw = 2.0
        straight, _, _ = read_map(save(tmp_path)).area(None, unknown_is_solid=False)
        file = save(tmp_path, ("2.0, 0.0]", f"2.0, {yaw}]"))
        area, _, _ = read_map(file).area((0.0, 0.0), unknown_is_solid=False)
        turned = np.array(straight.outlines[0]) @ [[cos(yaw), sin(yaw)], [-sin(yaw), cos(yaw)]] + [-3.0, 2.0]
        assert np.allclose(np.array(area.outlines[0]), turned, atol=1e-12)
        laid, low, high = read_map(file).area(None, unknown_is_solid=False)
        assert min(x for x, _ in laid.outlines[0]) == pytest.approx(0.0, abs=1e-12)
        assert low == pytest.approx((0.0, 0.0), abs=1e-12)
        assert high == pytest.approx(
            (2.0 * sin(yaw) + 3.0 * abs(cos(yaw)), 2.0 * abs(cos(yaw)) + 3.0 * sin(yaw)), abs=1e-12
        )


MISTAKES = [
    (("resolution: 0.5", "resolution: fine"), "room.yaml:3: resolution: wanted a length"),
    (("resolution: 0.5", "resolution: 0"), "room.yaml:3: resolution: wanted a length"),
    (("resolution: 0.5", "resolution: .nan"), "room.yaml:3: resolution: "),
    (("resolution", "resolutoin"), "room.yaml:3: resolutoin: unknown key (did you mean resolution?)"),
    (("[-3.0, 2.0, 0.0]", "[-3.0, 2.0]"), "room.yaml:4: origin: wanted a list of x, y, yaw, such as [0, 0, 0], not"),
    (("[-3.0, 2.0, 0.0]", "[-3.0, x, 0.0]"), "room.yaml:4: origin.y: wanted a plain number"),
    (("[-3.0, 2.0, 0.0]", "[-3.0, .inf, 0.0]"), "room.yaml:4: origin.y: wanted a plain number"),
    (("[-3.0, 2.0, 0.0]", "&a [*a, 2, 3]"), "room.yaml:4: a map needs no aliases"),
    (("negate: 0", "negate: 2"), "room.yaml:5: negate: wanted a whole number from 0 to 1"),
    (("negate: 0", "mode: binary\nnegate: 0"), "room.yaml:5: mode: wanted one of trinary, scale, raw"),
    (("0.65", "1.65"), "room.yaml:6: occupied_thresh: "),
    (("0.196", "0.9"), "room.yaml:7: free_thresh: 0.9 is more than occupied_thresh, 0.65"),
    (("room.pgm", "hall.pgm"), "room.yaml:2: image: there is no file"),
    (("room.pgm", "."), "room.yaml:2: image: there is no file"),
    (("image: room.pgm", "image: [room.pgm"), "room.yaml:3: not YAML: "),
    (("image: room.pgm", "image: \true"), "not YAML: "),
    (("# a room\n", "- a room\n"), "room.yaml:2: not YAML: "),
    ((YAML, "just words"), "room.yaml:1: no map: wanted lines such as resolution: 0.05"),
    ((YAML, ""), "room.yaml:1: no map: "),
    ((YAML, "[" * 2_000), "room.yaml:1: not YAML: "),
    ((YAML, "a: 2026-99-99"), "room.yaml:1: not YAML: "),
    ((YAML, "? [a, b]\n: 1\n"), "room.yaml:1: not YAML: found unhashable key"),
    ((YAML, "!!python/object/apply:os.system [echo]"), "room.yaml:1: no"),
    ((YAML, "!!set {a, b}"), "room.yaml:1: no map: "),
    ((YAML, "!!int {=: 5}"), "room.yaml:1: no map: "),
    (("negate: 0", "negate: !!bool maybe"), "room.yaml:1: not YAML: a tag (!!) before a value that it does not fit"),
    (("negate: 0", "negate: !!int ''"), "room.yaml:1: not YAML: a tag (!!)"),
    (("negate: 0", "negate: !!timestamp soon"), "room.yaml:1: not YAML: a tag (!!)"),
    (("room.pgm", "room" * 80), "room.yaml:2: image: there is no file"),
    ((YAML, "image: " + "x" * 70_000), "room.yaml: too long for such a file: at most 65536 bytes"),
    (("0.5", "1" + "0" * 5_000), "room.yaml:1: not YAML: Exceeds the limit"),
]


@pytest.mark.parametrize(("change", "said"), MISTAKES, ids=lambda value: str(value)[:30])
def test_a_mistake_is_told_with_its_place(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    with pytest.raises(SettingsError) as caught:
        read_map(save(tmp_path, change))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("picture", "said"),
    [
        (b"no picture", "no PGM or PNG picture that can be read"),
        (b"", "no PGM or PNG picture that can be read"),
        (b"P5\n6 4\n255\nabc", "no PGM or PNG picture that can be read"),
        (b"P2\n2 1\n255\n1 256\n", "no PGM or PNG picture that can be read"),
        (b"P2\n2 1\n255\n1 x\n", "no PGM or PNG picture that can be read"),
        (b"P5\n9999 9999\n255\nabc", f"9999 by 9999 pixels; at most {MAX_PIXELS} fit"),
        (b"P5\n99999999 99999999\n255\nabc", "far too many pixels"),
        (b"Pf\n1 1\n-1.0\nabcd", "a picture of fractions"),
        (b"GIF89a\x01\x00\x01\x00\x00\x00\x00", "no PGM or PNG picture that can be read"),
    ],
    ids=lambda value: str(value)[:24],
)
def test_a_picture_that_is_none_is_refused(tmp_path: Path, picture: bytes, said: str) -> None:
    with pytest.raises(SettingsError, match=r"room\.pgm: ") as caught:
        read_map(save(tmp_path, picture=picture))
    assert said in str(caught.value)


@pytest.mark.parametrize(("library", "name"), [("yaml", "PyYAML"), ("PIL", "Pillow")])
def test_a_missing_library_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str, name: str) -> None:
    there = builtins.__import__

    def without(wanted: str, *rest: object) -> object:
        if wanted == library:
            raise ImportError(wanted)
        return there(wanted, *rest)  # type: ignore[arg-type]

    file = save(tmp_path)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(
        MisuseError, match=re.escape(f"read with {name}, which is not here; to install it: {installing('maps')}")
    ):
        read_map(file)


SIZE = ('width = "12m"\nheight = "12m"\n', "")
MAP = ('edge = "wall"\n', 'edge = "wall"\nmap = "room.yaml"\n')


def with_map(folder: Path, *changes: tuple[str, str], yaml: Sequence[tuple[str, str]] = ()) -> Scenario:
    save(folder, ("resolution: 0.5", "resolution: 2"), *yaml)
    return load(write(folder, MAP, *changes, text=SCOUTS))


class TestInScenarios:
    def test_a_world_without_a_size_is_as_large_as_its_map(self, tmp_path: Path) -> None:
        scenario = with_map(tmp_path, SIZE)
        assert (scenario.width, scenario.height) == (12.0, 8.0)
        assert (12.0, 8.0) in next(s for s in scenario.shapes if isinstance(s, Area)).outlines[0]

    def test_sonars_see_its_walls(self, tmp_path: Path) -> None:
        simulator = Simulator(with_map(tmp_path, SIZE))
        simulator.place(0, 5.0, 4.0, 0.0)
        assert simulator.robots[0].sonar(0) == pytest.approx(10.0 - 5.0 - 0.17, abs=1e-5)
        assert simulator.robots[0].sonar(12) == pytest.approx(4.0 - 2.0 - 0.17, abs=1e-5)

    def test_robots_start_where_it_is_open(self, tmp_path: Path) -> None:
        changes = (
            SIZE,
            ("count = 1\n", "count = 20\n"),
            ("map =", 'map = { unknown = "solid", file ='),
            ('yaml"\n', 'yaml" }\n'),
        )
        for seed in range(5):
            simulator = Simulator(with_map(tmp_path, *changes), seed)
            column, row = (simulator.x // 2.0).astype(int), 3 - (simulator.y // 2.0).astype(int)
            assert all(SOLID[r][c] == "." and (r, c) != (2, 3) for r, c in zip(row, column, strict=True))

    def test_the_free_threshold_of_nav2_leaves_no_cell_unknown(self, tmp_path: Path) -> None:
        """map_saver writes 205 for what nobody has seen, and 0.25 as free_thresh: for ROS and for us that is free."""
        nav2 = ("free_thresh: 0.196", "free_thresh: 0.25")
        found = read_map(save(tmp_path, nav2))
        assert (found.unknown.any(), found.opened) == (False, True)
        assert not read_map(save(tmp_path)).opened
        assert with_map(tmp_path, SIZE, yaml=[nav2]).shapes, (
            "a world of it is made as long as nobody asks for unknown cells"
        )

    def test_unknown_cells_that_a_map_calls_free_are_not_solid_silently(self, tmp_path: Path) -> None:
        solid = ("map =", 'map = { unknown = "solid", file ='), ('yaml"\n', 'yaml" }\n')
        said = r"world.map.unknown: cells of room.yaml in the grey .* \(205\) are free by its free_thresh"
        with pytest.raises(SettingsError, match=said):
            with_map(tmp_path, SIZE, *solid, yaml=[("free_thresh: 0.196", "free_thresh: 0.25")])
        assert with_map(tmp_path, SIZE, *solid).shapes

    def test_no_open_place_to_start_is_told(self, tmp_path: Path) -> None:
        scenario = with_map(tmp_path, SIZE, ("count = 1\n", 'count = 1\nx = ["0m", "1m"]\n'))
        with pytest.raises(MisuseError, match="where the robots start nearly everything is solid"):
            Simulator(scenario)

    def test_the_page_draws_rooms_as_open(self, tmp_path: Path) -> None:
        scenario = with_map(tmp_path, SIZE, yaml=[("negate: 0", "negate: 1")])
        obstacles = scene_of(scenario, ("scout1",)).obstacles
        assert obstacles[0] == next(s for s in scenario.shapes if isinstance(s, Area)).outlines

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (("map =", "mapp ="), "world.mapp: unknown key (did you mean map?)"),
            (
                ('map = "room.yaml"', 'map = { file = "room.yaml", zero = ["1m"] }'),
                "world.map.zero: wanted a list of x",
            ),
            (('map = "room.yaml"', 'map = { file = "room.yaml", unknown = 1 }'), "world.map.unknown: wanted a text"),
            (('map = "room.yaml"', 'map = { fil = "room.yaml" }'), "world.map.fil: unknown key (did you mean file?)"),
            (
                ('width = "12m"', 'width = "11m"'),
                "world.map: it reaches from 0, 0 to 12, 8 m, beyond a world of 11 by 12 m",
            ),
            (('map = "room.yaml"', 'map = "lab.yaml"'), "world.map.file: there is no file"),
            (('map = "room.yaml"', 'map = "\\u0000"'), "world.map.file: there is no file"),
            (('map = "room.yaml"', "map = 3"), "world.map: wanted a table [world.map], not 3"),
        ],
        ids=lambda value: str(value)[:40],
    )
    def test_a_mistake_is_told_with_its_place(self, tmp_path: Path, change: tuple[str, str], said: str) -> None:
        save(tmp_path, ("resolution: 0.5", "resolution: 2"))
        new = (MAP[0], MAP[1].replace(*change))
        others = () if change[0] in MAP[1] else (change,)
        with pytest.raises(SettingsError) as caught:
            load(write(tmp_path, new, *others, text=SCOUTS))
        assert said in str(caught.value)


def test_a_full_turn_changes_nothing(tmp_path: Path) -> None:
    turned, _, _ = read_map(save(tmp_path, ("2.0, 0.0]", f"2.0, {2 * pi}]"))).area(None, unknown_is_solid=False)
    straight, _, _ = read_map(save(tmp_path)).area(None, unknown_is_solid=False)
    assert np.allclose(turned.outlines[0], straight.outlines[0], atol=1e-12)


class TestPictureOfTheMap:
    """The page shows the image itself under the walls."""

    def test_it_lies_where_the_walls_are(self, tmp_path: Path) -> None:
        save(tmp_path, ("2.0, 0.0]", "2.0, 0.5]"))
        found = read_map(tmp_path / "room.yaml")
        for at in (None, (10.0, 20.0)):
            x, y = found.corner(at)
            area, _, _ = found.area(at, unknown_is_solid=False)
            assert (x, y) in area.outlines[0]  # the lower left pixel is solid

    def test_a_scenario_with_a_map_shows_it(self, tmp_path: Path) -> None:
        scenario = with_map(tmp_path, SIZE)
        assert scene_of(scenario, ("scout1",)).picture == PicturePlace(0.0, 0.0, 0.0, 2.0)
        assert scenario.picture is not None
        with Image.open(BytesIO(scenario.picture.png())) as image:
            assert (image.format, image.size) == ("PNG", (6, 4))
            assert [image.getpixel((column, 2)) for column in range(6)] == [0, 254, 254, 205, 254, 0]

    def test_a_picture_that_is_large_is_made_smaller(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        noise = np.random.default_rng(1).integers(0, 256, (64, 64), np.uint8)
        Image.fromarray(noise).save(tmp_path / "noise.png")
        monkeypatch.setattr("sleepcast.simulator.world.map_picture.MAX_PNG", 3_000)
        found = MapPicture(tmp_path / "noise.png", 0.0, 0.0, 0.0, 1.0)
        with Image.open(BytesIO(found.png())) as image:
            assert image.size == (32, 32)

    def test_it_goes_on_after_a_fork_and_is_found_beside_a_recording(self, tmp_path: Path) -> None:
        scenario = with_map(tmp_path, SIZE)
        (tmp_path / "elsewhere").mkdir()
        file = tmp_path / "elsewhere" / "run.mcap"
        with sc.open(str(tmp_path), seed=2) as fleet, fleet.record(file):
            fleet.run(1)
            shown = SwarmAdapter(fleet.swarm)
            again = resume(snapshot(fleet.swarm))
        assert shown.scene.picture is not None
        assert SwarmAdapter(again).scene.picture is None  # only its name is left
        assert SwarmAdapter(again, shown.map_picture).scene.picture == shown.scene.picture
        timeline = load_timeline(load_recording(file))
        assert (timeline.scene.picture, timeline.picture) == (None, None)
        (tmp_path / "elsewhere" / "room.pgm").write_text(ROOM)
        timeline = load_timeline(load_recording(file))
        assert timeline.scene.picture == shown.scene.picture
        assert timeline.picture is not None
        assert scenario.picture is not None
        assert timeline.picture() == scenario.picture.png()
