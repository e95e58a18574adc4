"""Drawings: shapes of an SVG file stand in the world where and as large as they are drawn; no file does harm."""

from __future__ import annotations

import time
from itertools import pairwise
from math import cos, hypot, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sleepcast.simulator import Area, Circle, SettingsError, Shape, Simulator, Wall, load
from sleepcast.simulator.world import drawing as drawing_module
from sleepcast.simulator.world import svg, svg_styles
from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.drawing import MAX_DEPTH, TOLERANCE, Drawing, read_drawing
from sleepcast.simulator.world.fill import filled
from sleepcast.simulator.world.svg import Arc, Bezier, PathError, Subpath, read_path
from sleepcast.simulator.world.world import MAX_SOLIDS, Point
from small_worlds import SCOUTS, write

PAGE = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 60">\n%s\n</svg>\n'


def drawing(folder: Path, inside: str, metre: float | None = 10.0, page: str = PAGE) -> Drawing:
    """A page of 10 by 6 m, unless said otherwise."""
    file = folder / "room.svg"
    file.write_text(page % inside, encoding="utf-8")
    return read_drawing(file, metre)


def shapes(folder: Path, inside: str) -> tuple[Shape, ...]:
    return drawing(folder, inside).shapes


def outline(shape: Shape) -> tuple[Point, ...]:
    """The one outline of an area."""
    assert isinstance(shape, Area)
    (only,) = shape.outlines
    return only


def close(points: tuple[Point, ...], wanted: list[Point]) -> bool:
    return len(points) == len(wanted) and all(
        hypot(x - a, y - b) < 1e-9 for (x, y), (a, b) in zip(points, wanted, strict=True)
    )


class TestElements:
    def test_y_turns_up_and_the_pages_corner_is_the_worlds(self, tmp_path: Path) -> None:
        (room,) = shapes(tmp_path, '<polygon id="desk" points="10,10 30,10 30,50"/>')
        assert close(outline(room), [(1.0, 5.0), (3.0, 5.0), (3.0, 1.0)])
        assert room.name == "desk"

    def test_what_is_not_filled_is_a_wall(self, tmp_path: Path) -> None:
        found = shapes(
            tmp_path,
            '<path fill="none" d="M 0 60 H 50 V 10 z m 60 0 l 10 0"/><line x1="0" y1="0" x2="100" y2="60"/>'
            '<polyline style="fill:none" points="0 0, 10 0, 10 10"/><rect fill="none" width="20" height="10"/>',
        )
        assert all(isinstance(shape, Wall) for shape in found)
        closed, loose, line, poly, rect = (shape.points for shape in found if isinstance(shape, Wall))
        assert close(closed, [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0), (0.0, 0.0)])
        assert close(loose, [(6.0, 0.0), (7.0, 0.0)])
        assert close(line, [(0.0, 6.0), (10.0, 0.0)])
        assert close(poly, [(0.0, 6.0), (1.0, 6.0), (1.0, 5.0)])
        assert close(rect, [(0.0, 6.0), (2.0, 6.0), (2.0, 5.0), (0.0, 5.0), (0.0, 6.0)])

    def test_a_ring_is_one_area_with_a_hole(self, tmp_path: Path) -> None:
        (ring,) = shapes(tmp_path, '<path d="M0 0h40v40h-40z M10 10v20h20v-20z"/>')
        assert isinstance(ring, Area)
        assert [len(each) for each in ring.outlines] == [4, 4]

    def test_a_circle_stays_one_where_it_stays_round(self, tmp_path: Path) -> None:
        found = shapes(
            tmp_path,
            '<circle id="pillar" cx="20" cy="20" r="5" transform="rotate(30 20 20) scale(2)"/>'
            '<circle cx="20" cy="20" r="5" transform="skewX(20)"/><circle r="5" fill="none"/><circle r="0"/>',
        )
        pillar, skewed, line = found
        assert isinstance(pillar, Circle)
        turned = radians(30)
        x, y = 20 + 20 * cos(turned) - 20 * sin(turned), 20 + 20 * sin(turned) + 20 * cos(turned)
        assert (pillar.x, pillar.y, pillar.radius) == pytest.approx((x / 10, 6 - y / 10, 1.0))
        assert pillar.name == "pillar"
        assert isinstance(skewed, Area)
        assert isinstance(line, Wall)
        assert line.points[0] == line.points[-1]

    def test_rectangles_have_round_corners(self, tmp_path: Path) -> None:
        (desk,) = shapes(tmp_path, '<rect x="10" y="10" width="40" height="20" rx="5"/>')
        points = outline(desk)
        for x, y in points:
            beyond = hypot(max(abs(x - 3.0) - 1.5, 0.0), max(abs(y - 4.0) - 0.5, 0.0))
            assert beyond == pytest.approx(0.5, abs=1e-9) or beyond == 0.0
        assert (min(x for x, _ in points), max(x for x, _ in points)) == pytest.approx((1.0, 5.0))
        (round_,) = shapes(tmp_path, '<rect x="10" y="10" width="40" height="20" rx="99" ry="99"/>')
        assert all(((x - 3) / 2) ** 2 + (y - 4) ** 2 == pytest.approx(1.0) for x, y in outline(round_))

    def test_groups_pass_on_transform_fill_name_and_whether_they_are_seen(self, tmp_path: Path) -> None:
        found = shapes(
            tmp_path,
            '<g id="hall" fill="none" transform="translate(10, 20) scale(2)"><g fill="inherit">'
            '<path d="M0 0h5"/><path id="door" fill="red" d="M0 0h5v5z"/></g></g>'
            '<g display="none"><rect width="5" height="5"/></g><rect visibility="hidden" width="5" height="5"/>'
            "<defs><rect width='5' height='5'/></defs><text>not a wall</text><image href='http://nowhere.invalid/x'/>",
        )
        wall, door = found
        assert isinstance(wall, Wall)
        assert close(wall.points, [(1.0, 4.0), (2.0, 4.0)])
        assert close(outline(door), [(1.0, 4.0), (2.0, 4.0), (2.0, 3.0)])
        assert [shape.name for shape in found] == ["hall", "door"]

    def test_classes_say_what_is_filled(self, tmp_path: Path) -> None:
        sheet = "<style>/* .a{fill:red} */ .a, .b { fill: none } rect { fill: blue }</style>"
        found = shapes(tmp_path, f'{sheet}<rect class="x b" width="5" height="5"/><rect width="5" height="5"/>')
        assert [type(shape) for shape in found] == [Wall, Area]

    @pytest.mark.parametrize("around", ["%s", "<defs>%s</defs>", "<defs><g>%s</g></defs>"])
    def test_style_sheets_are_read_wherever_they_stand(self, tmp_path: Path, around: str) -> None:
        """Drawing programs put them among the definitions."""
        sheet = "<style>/* a /* b */.w{fill:none}@media screen{.x, .y {fill: none}}/* </style>"
        found = shapes(tmp_path, around % sheet + "".join(f'<path class="{c}" d="M0,0h9v9z"/>' for c in "wxyz"))
        assert [type(shape) for shape in found] == [Wall, Wall, Wall, Area]

    @pytest.mark.parametrize("said", ["ISO-8859-1", "windows-1252", "nobodys"])
    def test_what_a_file_says_of_its_letters_does_not_matter(self, tmp_path: Path, said: str) -> None:
        """It was read as UTF-8."""
        page = f'<?xml version="1.0" encoding="{said}"?>{PAGE}'
        (door,) = drawing(tmp_path, '<path id="Tür" d="M0,0h9v9z"/>', page=page).shapes
        assert door.name == "Tür"

    def test_matrices_and_skews(self, tmp_path: Path) -> None:
        for transform, wanted in [
            ("matrix(1 2 3 4 5 6)", (1 * 7 + 3 * 8 + 5, 2 * 7 + 4 * 8 + 6)),
            ("skewX(45)", (15, 8)),
            ("skewY(45) translate(1)", (8, 16)),
            ("rotate(90)", (-8, 7)),
        ]:
            (wall,) = shapes(tmp_path, f'<path fill="none" transform="{transform}" d="M0 0M7 8L7 8 0 0"/>')
            assert isinstance(wall, Wall)
            assert close(wall.points[:1], [(wanted[0] / 10, 6 - wanted[1] / 10)]), transform


def solid(folder: Path, inside_page: str, *points: Point) -> list[bool]:
    """Whether these points, in m from the page's upper left corner, are solid."""
    x, y = np.array(points).T
    found = [inside(each, x, 6.0 - y) for each in shapes(folder, inside_page) if isinstance(each, Area | Circle)]
    return np.any([np.zeros(len(points), bool), *found], axis=0).tolist()


class TestFillRules:
    RING = "M0 0h40v40h-40z M10 10h20v20h-20z"
    STAR = "M20 0L32 38L0 14H40L8 38z"

    @pytest.mark.parametrize(
        ("said", "middle"),
        [
            ("", True),
            ('fill-rule="evenodd"', False),
            ('style="fill-rule:evenodd"', False),
            ('fill-rule="evenodd" style="fill-rule: nonzero !important"', True),
        ],
    )
    def test_an_outline_of_the_same_direction_is_a_hole_by_one_rule_only(
        self, tmp_path: Path, said: str, middle: bool
    ) -> None:
        assert solid(tmp_path, f'<path {said} d="{self.RING}"/>', (0.5, 0.5), (2, 2), (5, 5)) == [True, middle, False]
        assert solid(tmp_path, f'<g {said}><path d="{self.STAR}"/></g>', (2, 1), (2, 2), (2, 3.5), (0.2, 3)) == [
            *(True, middle, False, False)
        ]

    def test_holes_and_isles_by_direction(self, tmp_path: Path) -> None:
        isle = "M0 0h50v50h-50z M10 10v30h30v-30z M20 20h10v10h-10z M22 22h4v4h-4z"
        (area,) = shapes(tmp_path, f'<path d="{isle}"/>')
        assert isinstance(area, Area)
        assert len(area.outlines) == 3, "the innermost is within the isle, and runs as it does"
        assert solid(tmp_path, f'<path d="{isle}"/>', (0.5, 0.5), (1.5, 1.5), (2.1, 2.1), (2.4, 2.4)) == [
            *(True, False, True, True)
        ]

    def test_outlines_that_cross_each_other_are_united(self, tmp_path: Path) -> None:
        both = '<path d="M0 0h30v30h-30z M20 20h30v30h-30z"/>'
        assert solid(tmp_path, both, (1, 1), (2.5, 2.5), (4, 4), (1, 4)) == [True, True, True, False]

    @pytest.mark.parametrize(
        "path",
        [
            "M0 0h20v30h-20z M0 0h20v30h-20z",
            "M0 0h20v30h-20z h20v30h-20z",
            "M0 0h20v20h-20z M10 0h20v20h-20z",
            "M0 0h20v20h-20z M10 0l20-10v50l-20-20z",
            "M0 0h10v50h-10z M20 0h10v50h-10z M40 0h10v50h-10z M0 0h50v10h-50z M0 40h50v10h-50z",
        ],
    )
    def test_what_is_drawn_twice_or_along_each_other_stays_solid(self, tmp_path: Path, path: str) -> None:
        assert solid(tmp_path, f'<path d="{path}"/>', (0.5, 0.5), (0.5, 1.5), (5.5, 0.5)) == [True, True, False]

    def test_what_goes_to_and_fro_encloses_nothing_and_is_a_wall(self, tmp_path: Path) -> None:
        for path in ("M0 0H20H40", "M0 0L20 10L40 20z", "M0 0H20V20V0z"):
            (wall,) = shapes(tmp_path, f'<path d="{path}"/>')
            assert isinstance(wall, Wall)
        (area,) = shapes(tmp_path, '<path d="M0 0L20 20V0L0 20z"/>')
        assert isinstance(area, Area), "two triangles, one each way round"

    @given(st.lists(st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), min_size=3, max_size=6), max_size=4))
    def test_as_the_winding_number_says(self, outlines: list[list[Point]]) -> None:
        outlines = [[corner for corner, before in pairwise([*each, each[0]]) if corner != before] for each in outlines]
        drawn = tuple(tuple(each) for each in outlines if len(each) > 2)
        assume(drawn)
        area = filled(drawn, "nonzero")
        for x, y in ((1.231, 2.387), (4.429, 4.173), (6.617, 2.951), (3.337, 6.741), (0.51, 0.487), (7.41, 7.533)):
            turns = 0
            for (x0, y0), (x1, y1) in (side for each in drawn for side in pairwise([*each, each[0]])):
                if (y0 <= y) != (y1 <= y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
                    turns += 1 if y1 > y0 else -1
            found = bool(area) and bool(inside(Area(area), np.array([x]), np.array([y]))[0])
            assert found == (turns != 0), (x, y)


class TestStyles:
    @pytest.mark.parametrize(
        ("sheet", "element", "is_wall"),
        [
            ("path{fill:none}", "", True),
            ("*{fill:none}", "", True),
            ("#p{fill:none}", 'id="p"', True),
            ("path.a#p, .b {fill: none}", 'class="a" id="p"', True),
            ("path.a.c{fill:none}", 'class="a"', False),
            (".g path{fill:none}", "", True),
            (".g > path{fill:none}", "", False),
            (".h > path{fill:none}", "", True),
            ("svg .g .h path{fill:none}", "", True),
            (".h .g path{fill:none}", "", False),
            (".g rect{fill:none}", "", False),
            ("path{fill:red} path{fill:none}", "", True),
            (".a{fill:none} path{fill:red}", 'class="a"', True),
            ("#p{fill:none} .a.a{fill:red}", 'id="p" class="a"', True),
            ("path{fill:none}", 'style="fill:red"', False),
            ("path{fill:none!important}", 'style="fill:red"', True),
            ("path{fill:none ! important} #p{fill:red}", 'id="p"', True),
            ("path{fill:none}", 'fill="red"', True),
            ("path{FILL:NONE}", "", True),
            ("path{fill:nonsense}", 'fill="none"', True),
            ("path{fill:var(--x)}", "", False),
            ("path{fill:var(--x, none)}", "", True),
            ("path{fill:var( --x ,rgb(0 0 0 / 0%))}", "", True),
            ("@media print{path{fill:none}}", "", False),
            ("@media (prefers-color-scheme: dark){path{fill:none}}", "", False),
            ("@media only screen, print{path{fill:none}}", "", True),
            ("@media (max-width: 9px){path{stroke:red}} @layer a;", "", False),
            ("path:hover{fill:none}", "", False),
            ("path[d]{stroke:red}", "", False),
            ("@font-face{font-family:x}@media screen{path{fill:none}}", "", True),
            ("<![CDATA[ .a > b {} path { fill : none } ]]>", "", True),
        ],
    )
    def test_selectors_and_their_order(self, tmp_path: Path, sheet: str, element: str, is_wall: bool) -> None:
        inside_page = f'<g class="g"><g class="h"><path {element} d="M0,0h9v9z"/></g></g><style>{sheet}</style>'
        (found,) = shapes(tmp_path, inside_page.replace("> path", "&gt; path") if "CDATA" not in sheet else inside_page)
        assert isinstance(found, Wall if is_wall else Area)

    @pytest.mark.parametrize(
        ("said", "wanted"),
        [
            ('fill="#ffffff00"', Wall),
            ('fill="rgba(1, 2, 3, 0)"', Wall),
            ('fill="rgb(1 2 3 / 0%)"', Wall),
            ('fill="transparent"', Wall),
            ('fill="#fff0"', Wall),
            ('fill="#fff1"', Area),
            ('fill="red" fill-opacity="0"', Wall),
            ('style="fill-opacity:0%"', Wall),
            ('fill="url(#pattern)"', Area),
            ('fill="currentColor"', Area),
            ('fill="none" style="fill:inherit"', Area),
            ('opacity="0"', None),
            ('style="display:none"', None),
            ('visibility="hidden"', None),
        ],
    )
    def test_what_cannot_be_seen_is_not_filled(self, tmp_path: Path, said: str, wanted: type | None) -> None:
        found = shapes(tmp_path, f'<g fill="blue"><path {said} d="M0,0h9v9z"/></g>')
        assert [type(each) for each in found] == ([] if wanted is None else [wanted])

    @pytest.mark.parametrize(
        ("said", "sentence"),
        [
            ("<style>\n" + "@media screen{" * 3_000 + "</style>", "3: <style>: more than 64 brackets in brackets"),
            (f"<style>path{{fill:{'(' * 5_000}}}</style>", "2: <style>: more than 64 brackets in brackets"),
            (f'<path style="fill:{"(" * 5_000}" d="M0,0h9v9z"/>', "2: <path>: style: more than 64 brackets"),
            (f'<path fill="{"[" * 5_000}" d="M0,0h9v9z"/>', "2: <path>: style: more than 64 brackets"),
            ("<style>@media (max-width: 9px){path{fill:none}}</style>", "2: <style>: the condition .@media"),
            ("<style>\n@layer a{\n@media screen{path{fill:none}}}</style>", "3: <style>: the condition .@layer a"),
            ("<style>@supports not (d: e){path{fill:none}}</style>", "2: <style>: the condition .@supports not"),
            ('<rect width="9" height="9" style="width: 20px"/>', "2: <rect>: style: width is not read there"),
            ('<g style="rotate: 45deg"/>', "2: <g>: style: rotate is not read there"),
            ('<g style="--x: none"><path style="fill:var(--x, red)" d="M0,0h9v9z"/></g>', "2: <path>: fill: .var"),
            ('<path fill="var(--x" d="M0,0h9v9z"/>', "2: <path>: fill: .var"),
            ('<style>.a{--x:none}</style><path fill="var(--x)" d="M0,0h9v9z"/>', "2: <path>: fill: .var"),
        ],
    )
    def test_styles_that_are_not_read_and_would_count_are_refused(
        self, tmp_path: Path, said: str, sentence: str
    ) -> None:
        with pytest.raises(SettingsError, match=sentence):
            shapes(tmp_path, said)

    def test_nothing_is_asked_of_what_is_hidden(self, tmp_path: Path) -> None:
        inside_page = '<g style="display:none"><use href="#p"/><path d="nonsense"/><g><svg/></g></g>'
        assert len(shapes(tmp_path, f'{inside_page}<rect width="9" height="9" style="width:auto;rotate:none"/>')) == 1

    def test_what_is_visible_in_a_hidden_group_is_seen(self, tmp_path: Path) -> None:
        assert shapes(tmp_path, '<g visibility="hidden"><path visibility="visible" d="M0,0h9v9z"/></g>')
        assert not shapes(tmp_path, '<g display="none"><path style="display:inline" d="M0,0h9v9z"/></g>')

    @pytest.mark.parametrize(
        ("said", "wanted"),
        [
            ("translate(10px, 20px)", (17, 28)),
            ("translateX(10px) translateY(1in)", (17, 104)),
            ("rotate(90deg)", (-8, 7)),
            ("rotate(0.25turn) scale(2)", (-16, 14)),
            ("scaleX(3) scaleY(0.5)", (21, 4)),
            ("skewX(45deg)", (15, 8)),
            ("skew(45deg, 50grad)", (15, 15)),
            ("matrix(1,2,3,4,5,6)", (36, 52)),
            ("none", (7, 8)),
            ("rotate(90deg); transform-origin: 7px 8px", (7, 8)),
            ("rotate(180deg); transform-origin: 10px 10px", (13, 12)),
        ],
    )
    @pytest.mark.parametrize("how", ['style="transform: {}"', 'class="m"'])
    def test_transforms_in_a_style(self, tmp_path: Path, said: str, wanted: tuple[float, float], how: str) -> None:
        sheet = f"<style>.m{{transform: {said}}}</style>"
        (wall,) = shapes(tmp_path, f'{sheet}<path fill="none" transform="scale(9)" {how.format(said)} d="M7 8L0 0"/>')
        assert isinstance(wall, Wall)
        assert close(wall.points[:1], [(wanted[0] / 10, 6 - wanted[1] / 10)])

    def test_all_are_walls_if_that_is_wanted(self, tmp_path: Path) -> None:
        file = tmp_path / "room.svg"
        file.write_text(PAGE % '<rect width="20" height="10"/><circle r="5" cx="9" cy="9"/><path d="M0 0h9v9z"/>')
        assert {type(each) for each in read_drawing(file, 10.0, walls=True).shapes} == {Wall}
        assert {type(each) for each in read_drawing(file, 10.0).shapes} == {Area, Circle}
        for walls, solid_things in (("all", False), ("unfilled", True)):
            table = f'drawing = {{ file = "room.svg", metre = 10, walls = "{walls}" }}'
            (tmp_path / "scenario.toml").write_text(SCOUTS.replace("[world]", f"[world]\n{table}"))
            assert (Area in {type(each) for each in load(tmp_path / "scenario.toml").shapes}) == solid_things
        (tmp_path / "scenario.toml").write_text(
            SCOUTS.replace("[world]", '[world]\ndrawing = { file = "room.svg", walls = "some" }')
        )
        with pytest.raises(SettingsError, match=r"unfilled.*all"):
            load(tmp_path / "scenario.toml")

    def test_many_rules_for_many_elements_are_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(svg_styles, "MAX_TRIES", 10_000)
        sheet = "<style>" + "* * *{fill:none}" * 100 + "</style>"
        with pytest.raises(
            SettingsError, match=r"room.svg:2: <path>: its style sheets have too many rules for so many"
        ):
            drawing(tmp_path, sheet + '<path d="M0,0h9v9z"/>' * 100)
        monkeypatch.setattr(svg_styles, "MAX_PARTS", 100)
        with pytest.raises(SettingsError, match=r"room.svg:2: <style>: more than 100 parts of selectors"):
            drawing(tmp_path, sheet)


class TestCurves:
    @pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
    def test_a_circle_of_arcs_is_within_the_tolerance(self, tmp_path: Path, scale: float) -> None:
        path = f'<path transform="scale({scale})" d="M0 30a30 30 0 1 1 60 0 30 30 0 01-60 0z"/>'
        points = outline(shapes(tmp_path, path)[0])
        centre, radius = (3.0 * scale, 6.0 - 3.0 * scale), 3.0 * scale
        away = [hypot(x - centre[0], y - centre[1]) for x, y in points]
        middles = [
            hypot((x0 + x1) / 2 - centre[0], (y0 + y1) / 2 - centre[1]) for (x0, y0), (x1, y1) in pairwise(points)
        ]
        assert all(abs(each - radius) < 1e-9 * max(scale, 1.0) for each in away)
        assert all(radius - each <= TOLERANCE + 1e-12 for each in middles)
        assert len(points) < 4.0 * pi / sqrt(TOLERANCE / radius) + 10  # and no denser than that needs

    @pytest.mark.parametrize(
        "path", ["M0 0C40 0 0 60 100 60", "M0 0Q80 10 20 50T100 60", "M0 0c10-50 90 50 0 50s50 90 10 0"]
    )
    def test_bezier_curves_are_within_the_tolerance(self, path: str) -> None:
        (line,) = read_path(path)
        start = line.start
        for curve in line.curves:
            assert isinstance(curve, Bezier)
            flat = [start, *curve.flat(0.01)]
            fine = [start, *curve.flat(1e-7)]
            assert max(min(away(point, a, b) for a, b in pairwise(flat)) for point in fine[::50]) <= 0.01
            assert len(flat) > 5
            start = curve.points[-1]

    def test_small_letters_count_from_where_the_pen_is(self) -> None:
        absolute = read_path("M10 10L20 10H30V40C40 40 50 50 60 50S70 60 80 60Q90 60 90 70T90 90A5 5 0 0 1 90 95Z")
        relative = read_path("m10 10l10 0h10v30c10 0 20 10 30 10s10 10 20 10q10 0 10 10t0 20a5 5 0 0 1 0 5z")
        assert absolute == relative

    def test_smooth_curves_mirror_only_curves_of_their_own_sort(self) -> None:
        (line,) = read_path("M0 0C0 10 10 10 10 0T20 0S30 10 40 0")
        pulls = [curve.points[1] for curve in line.curves if isinstance(curve, Bezier)]
        assert pulls == [10j, 10 + 0j, 20 + 0j]

    def test_numbers_need_no_gaps(self) -> None:
        assert read_path("M.5.5-1-1e0L1-.5") == read_path("M 0.5,0.5 L -1 -1 L 1,-0.5")
        assert read_path("M0 0a5 5 0 0110 0") == read_path("M0 0 a 5 5 0 0 1 10 0")

    def test_an_arc_too_small_for_its_ends_grows(self) -> None:
        (line,) = read_path("M0 0A1 1 0 0 1 10 0")
        (arc,) = line.curves
        assert isinstance(arc, Arc)
        assert (abs(arc.right), abs(arc.centre - 5)) == pytest.approx((5.0, 0.0))

    def test_which_of_four_arcs(self) -> None:
        for large, sweep, centre in ((0, 0, 3 - 4j), (0, 1, 3 + 4j), (1, 0, 3 + 4j), (1, 1, 3 - 4j)):
            (line,) = read_path(f"M0 0A5 5 0 {large} {sweep} 6 0")
            (arc,) = line.curves
            assert isinstance(arc, Arc)
            assert abs(arc.centre - centre) < 1e-12
            assert (arc.sweep > 0) == bool(sweep)
            assert (abs(arc.sweep) > pi) == bool(large)

    def test_what_follows_a_closed_line_begins_where_it_began(self) -> None:
        lines = read_path("M1 1h4v4zl2 2")
        assert [(line.start, line.closed, len(line.curves)) for line in lines] == [
            (1 + 1j, True, 2),
            (1 + 1j, False, 1),
        ]

    @pytest.mark.parametrize(
        ("path", "said"),
        [
            ("L 5 5", 'a path begins with M, not "L"'),
            ("5 5", 'wanted a letter such as L at "5 5"'),
            ("M 5", "wanted 2 numbers after M, at its end"),
            ("M 5 nan", 'wanted 2 numbers after M, at "nan"'),
            ("M 0 0 L 1 1 zz 3", 'wanted a letter such as L at "3"'),
            ("M 0 0 B 1 1", 'wanted 2 numbers after L, at "B 1 1"'),
            ("M 0 1e999", "1e999 is too far away"),
            ("M 0 0 A 1 1 0 2 0 5 5", 'wanted 7 numbers after A, at "2 0 5 5"'),
        ],
    )
    def test_what_is_no_path_is_told(self, path: str, said: str) -> None:
        with pytest.raises(PathError) as caught:
            read_path(path)
        assert said in str(caught.value)


def away(point: complex, start: complex, end: complex) -> float:
    """From a point to a line, m."""
    way = end - start
    share = ((point - start) * way.conjugate()).real / abs(way) ** 2
    return abs(start + min(max(share, 0.0), 1.0) * way - point)


SIZED = '<svg xmlns="http://www.w3.org/2000/svg" %s>\n%%s\n</svg>'


class TestScale:
    @pytest.mark.parametrize(
        ("page", "wanted"),
        [
            ('width="4m" height="3m" viewBox="0 0 4 3"', None),  # SVG has no metres
            ('width="400" height="300"', None),
            ('viewBox="0 0 400 300"', None),
            ('width="4000mm" height="3000mm" viewBox="0 0 400 300"', (4.0, 3.0)),
            ('width="400cm" viewBox="-7 9 800 600"', (4.0, 3.0)),
            ('width="400cm" height="1000cm" viewBox="0 0 800 600"', (4.0, 3.0)),  # the page keeps its shape
            ('width="100in" height="50in"', (2.54, 1.27)),
        ],
    )
    def test_the_page_says_how_large_it_is(self, tmp_path: Path, page: str, wanted: Point | None) -> None:
        if wanted is None:
            with pytest.raises(SettingsError, match=r"room.svg:1: the SVG does not say how large it is in the world"):
                drawing(tmp_path, "", None, SIZED % page)
        else:
            assert drawing(tmp_path, "", None, SIZED % page).high == pytest.approx(wanted)

    def test_a_page_need_not_begin_at_nought(self, tmp_path: Path) -> None:
        found = drawing(
            tmp_path, '<path fill="none" d="M-7 9h10"/>', None, SIZED % 'width="400cm" viewBox="-7 9 800 600"'
        )
        (wall,) = found.shapes
        assert isinstance(wall, Wall)
        assert close(wall.points, [(0.0, 3.0), (0.05, 3.0)])


BOMB = '<!DOCTYPE svg [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>\n' + PAGE
OUTSIDE = '<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]>\n' + PAGE
MISTAKES = [
    (PAGE, '<path id="p" d="M 0 0 L x"/>', 'room.svg:2: <path id="p">: wanted 2 numbers after L, at "x"'),
    (PAGE, '<rect width="50%" height="5"/>', 'room.svg:2: <rect>: width="50%" is no length'),
    (PAGE, '<rect width="1e999" height="5"/>', "room.svg:2: <rect>: 1e999 is too large"),
    (PAGE, '\n<g transform="roll(5)"/>', "room.svg:3: <g>: transform: wanted matrix, translate"),
    (PAGE, '<g transform="scale(1 2 3)"/>', "transform: scale takes 2 numbers"),
    (PAGE, '<g transform="scale(1 NaN)"/>', 'scale: wanted numbers, not "1 NaN"'),
    (PAGE, '<g transform="scale(1e9)"><g transform="scale(1e9)"/></g>', "transform: too large"),
    (PAGE, '<g style="transform: rotate3d(1,1,1,45deg)"/>', 'room.svg:2: <g>: transform: "rotate3d" with 4 numbers'),
    (PAGE, '<g style="transform: translate(50%)"/>', 'transform: "50%" is not read: wanted a number, or one in px'),
    (PAGE, '<g style="transform: rotate(1deg); transform-origin: center"/>', 'transform-origin: "center" is not read'),
    (PAGE, "<style>\n path[d]{fill:none}</style>", 'room.svg:3: <style>: the selector "path[d]" is not read'),
    (PAGE, "<style>a + b{fill:none}</style>", 'room.svg:2: <style>: the selector "a + b" is not read'),
    (PAGE, "<style>g &gt;{fill:none}</style>", 'the selector "g >" is none: something is missing at its end'),
    (PAGE, "<style>@import url(a.css);</style>", "room.svg:2: <style>: a style sheet in another file"),
    (f'<?xml-stylesheet href="a.css"?>{PAGE}', "", "room.svg:1: its style sheet is in another file"),
    (PAGE, '<use href="#a"/>', "room.svg:2: <use>: a drawing within the drawing"),
    (PAGE, "<svg/>", "room.svg:2: <svg>: a drawing within the drawing"),
    (PAGE, "<g>" * (MAX_DEPTH + 1), f"more than {MAX_DEPTH} groups in groups"),
    (PAGE, "<g>", "room.svg:3: not XML: mismatched tag"),
    (PAGE, "&a;", "room.svg:2: not XML: undefined entity"),
    (BOMB, "&b;", 'room.svg:1: it declares an entity "a"'),
    (OUTSIDE, "&a;", 'room.svg:1: it declares an entity "a"'),
    ("<html>%s</html>", "", "room.svg:1: <html>: is no drawing: wanted an svg"),
    ("%s", "", "room.svg:1: not XML: no element found"),
    ("<svg>%s</svg>", "", "room.svg:1: <svg>: it has neither viewBox nor width and height"),
    ('<svg viewBox="0 0 0 5">%s</svg>', "", "room.svg:1: <svg>: its page is empty"),
    ('<svg viewBox="0 0 5">%s</svg>', "", 'room.svg:1: <svg>: viewBox: wanted 4 numbers, not "0 0 5"'),
]


class TestHostileFiles:
    @pytest.mark.parametrize(("page", "inside", "said"), MISTAKES, ids=lambda value: str(value)[-30:])
    def test_a_mistake_is_told_with_its_place(self, tmp_path: Path, page: str, inside: str, said: str) -> None:
        with pytest.raises(SettingsError) as caught:
            drawing(tmp_path, inside, page=page)
        assert said in str(caught.value)

    def test_a_document_type_is_passed_over(self, tmp_path: Path) -> None:
        kind = '<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://nowhere.invalid/svg11.dtd">\n'
        assert drawing(tmp_path, '<rect width="5" height="5"/>', page=kind + PAGE).shapes

    def test_more_lines_than_fit_are_refused_before_they_are_made(self, tmp_path: Path) -> None:
        arcs = "a9 9 0 1 1 1 0" * 10_000  # each of them 10,000 pieces: with a bound, none of it is kept
        start = time.process_time()
        with pytest.raises(SettingsError, match=rf"room.svg:2: more than {MAX_SOLIDS} lines: leave some out"):
            drawing(tmp_path, f'<g transform="scale(1e6)"><path d="M0 0{arcs}"/></g>')
        assert time.process_time() - start < 20.0

    def test_shapes_that_would_be_compared_for_a_minute_are_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """8 MB have room for 500 shapes whose 2,000 sides cross each other anywhere."""
        monkeypatch.setattr(drawing_module, "MAX_COMPARED", 50_000)
        shape = f'<path d="M0 0L{" ".join(f"{7 * i % 10} {3 * i % 10}" for i in range(1, 100))}z"/>'
        assert drawing(tmp_path, shape * 2).shapes
        with pytest.raises(SettingsError, match=r"room.svg:2: with it more than 50,000 pairs of sides have to be"):
            drawing(tmp_path, shape * 3)
        triangle = '<path d="M0 0h5v5z"/>'  # of which nothing has to be compared
        assert len(drawing(tmp_path, triangle * 3_000).shapes) == 3_000

    def test_many_curves_of_one_path_stop_where_there_is_no_room(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Each subpath fits by itself, and all of them are ten million points."""
        made, points = [0], drawing_module._points
        monkeypatch.setattr(drawing_module, "MAX_SOLIDS", 12_000)

        def counted(line: Subpath, room: int) -> tuple[Point, ...]:
            found = points(line, room)
            made[0] += len(found)
            return found

        monkeypatch.setattr(drawing_module, "_points", counted)
        with pytest.raises(SettingsError, match=r"room.svg:2: more than .* lines: leave some out"):
            drawing(tmp_path, f'<g transform="scale(1e6)"><path d="{"M0 0a9 9 0 1 1 1 1" * 1_000}"/></g>')
        assert made[0] < 30_000

    def test_curves_are_counted_before_there_is_a_list_of_them(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(svg, "MAX_CURVES", 100)
        monkeypatch.setattr(drawing_module, "MAX_CURVES", 100)
        drawing(tmp_path, f'<path d="M0 0{"h1" * 98}"/>')
        with pytest.raises(SettingsError, match="more than 100 curves"):
            drawing(tmp_path, f'<path d="M0 0{"h1" * 200}"/>')
        with pytest.raises(SettingsError, match="more than 100 curves"):
            drawing(tmp_path, '<path d="M0 0h1h1h1"/>' * 30)

    @pytest.mark.parametrize(
        "inside",
        [
            f'<path fill="none" d="M0,0{" 1 2 3 4" * 50_000}"/>',
            f"<style>{'a' * 200_000}</style>",
            f"<style>{'/*' * 100_000}</style>",
        ],
        ids=["path", "style", "comments"],
    )
    def test_a_long_text_takes_as_long_as_it_is_long(self, tmp_path: Path, inside: str) -> None:
        before = time.process_time()
        drawing(tmp_path, inside)
        assert time.process_time() - before < 4.0

    def test_numbers_of_a_million_digits_take_no_time(self, tmp_path: Path) -> None:
        start = time.process_time()
        with pytest.raises(SettingsError, match="too far away"):
            drawing(tmp_path, f'<path d="M0 {"9" * 1_000_000}"/>')
        with pytest.raises(SettingsError, match="numbers"):
            drawing(tmp_path, f'<g transform="translate({"9 " * 100_000}x)"/>')
        assert time.process_time() - start < 5.0


class TestInScenarios:
    def test_sonars_see_what_is_drawn(self, tmp_path: Path) -> None:
        (tmp_path / "room.svg").write_text(PAGE % '<rect x="80" width="20" height="60"/>', encoding="utf-8")
        file = write(
            tmp_path,
            ('width = "12m"\nheight = "12m"\n', ""),
            ('edge = "wall"\n', '[world.drawing]\nfile = "room.svg"\nmetre = 10\nat = ["1m", "2m"]\n'),
            ("count = 1\n", "count = 30\n"),
            text=SCOUTS,
        )
        scenario = load(file)
        assert (scenario.width, scenario.height) == (11.0, 8.0)
        simulator = Simulator(scenario)
        inside = (simulator.x > 9.0) & (simulator.y > 2.0)
        assert not inside.any()
        lone = Simulator(load(write(tmp_path, ("count = 30\n", "count = 1\n"), text=file.read_text(encoding="utf-8"))))
        lone.place(0, 5.0, 5.0, 0.0)
        assert lone.robots[0].sonar(0) == pytest.approx(9.0 - 5.0 - 0.17, abs=1e-5)
