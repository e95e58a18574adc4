"""Plans of buildings as other programs write them into SVG files: what was drawn stands in the world, and no more."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sleepcast.simulator import Shape, Wall
from sleepcast.simulator.world.drawing import Drawing, read_drawing

PAGE = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 80 60">%s</svg>'
WALL = '<path d="M40 0V40" fill="none" stroke="black"/>'


def read(folder: Path, text: str, metre: float | None = 10.0, *, walls: bool = False) -> Drawing:
    """What stands in an SVG file of this text; unless said otherwise, its page has 8 by 6 m."""
    file = folder / "plan.svg"
    file.write_text(text, encoding="utf-8")
    return read_drawing(file, metre, walls=walls)


def shapes(folder: Path, inside: str) -> tuple[Shape, ...]:
    return read(folder, PAGE % inside).shapes


def extent(*found: Shape) -> tuple[float, ...]:
    """Least and greatest x and y of walls, m."""
    corners = np.array([point for wall in found if isinstance(wall, Wall) for point in wall.points])
    return tuple(np.round((*corners.min(axis=0), *corners.max(axis=0)), 6))


class TestPaper:
    """A page's background comes first and covers the page."""

    @pytest.mark.parametrize(
        "paper",
        [
            '<rect width="80" height="60" style="fill:rgb(100%,100%,100%);fill-opacity:1;stroke:none;"/>',
            '<path d="M0 60L80 60L80 0L0 0z" style="fill: #ffffff"/>',
            '<rect fill="#ffffff" width="80" height="60" fill-opacity="0.0"/>',
            '<rect x="-5" y="-5" width="90" height="70" fill="white"/>',
            '<rect width="80" height="60" fill="white"/><rect width="80" height="60" fill="#eee"/>',
        ],
        ids=["cairo", "matplotlib", "ezdxf", "larger", "twice"],
    )
    def test_it_is_nothing_in_the_world(self, tmp_path: Path, paper: str) -> None:
        (wall,) = shapes(tmp_path, paper + WALL)
        assert isinstance(wall, Wall)
        assert extent(wall) == (4.0, 2.0, 4.0, 6.0)

    @pytest.mark.parametrize(
        "inside",
        [
            '<rect width="80" height="60"/>',
            WALL + '<rect width="80" height="60"/>',
            '<rect width="80" height="59"/>' + WALL,
            '<path d="M0 0H80V60H0z M10 10V50H70V10z"/>' + WALL,
            '<rect width="80" height="60" fill="none"/>' + WALL,
            '<rect width="80" height="60" fill-opacity="0" stroke="black"/>' + WALL,
            '<path d="M0 0H80V60L1 59z"/>' + WALL,
            '<circle cx="40" cy="30" r="60"/>' + WALL,
        ],
        ids=["alone", "last", "smaller", "with a hole", "a wall", "a wall with a stroke", "askew", "round"],
    )
    def test_whatever_else_is_large_stays(self, tmp_path: Path, inside: str) -> None:
        assert len(shapes(tmp_path, inside)) == inside.count("/>")

    def test_a_room_that_fills_the_page_has_walls_where_all_shapes_have(self, tmp_path: Path) -> None:
        found = read(tmp_path, PAGE % ('<rect width="80" height="60"/>' + WALL), walls=True).shapes
        assert extent(*found) == (0.0, 0.0, 8.0, 6.0)


class TestBoxes:
    """LibreOffice draws a box around each shape, with neither fill nor stroke."""

    BOX = '<rect class="BoundingBox" stroke="none" fill="none" x="10" y="10" width="20" height="20"/>'

    @pytest.mark.parametrize(
        "box",
        [
            BOX,
            f'<g fill="none" stroke="none">{BOX}<path d="M0 0H10V10z"/></g>',
            '<rect style="fill:none;stroke:none" width="20" height="20"/>',
            '<rect fill="white" fill-opacity="0" stroke="NONE" width="20" height="20"/>',
        ],
    )
    def test_a_box_that_is_not_drawn_is_no_wall(self, tmp_path: Path, box: str) -> None:
        assert extent(*shapes(tmp_path, box + WALL)) == (4.0, 2.0, 4.0, 6.0)

    def test_in_a_group_without_a_stroke_a_line_may_have_one(self, tmp_path: Path) -> None:
        found = shapes(tmp_path, f'<g fill="none" stroke="none"><path d="M0 0H80" stroke="#979797"/></g>{WALL}')
        assert len(found) == 2

    def test_what_says_nothing_of_its_stroke_is_a_wall_as_before(self, tmp_path: Path) -> None:
        assert len(shapes(tmp_path, '<rect fill="none" width="20" height="20"/>')) == 1

    def test_a_style_sheet_may_give_it_another_stroke(self, tmp_path: Path) -> None:
        sheet = "<style>.wall { stroke: black }</style>"
        assert len(shapes(tmp_path, sheet + '<path class="wall" fill="none" stroke="none" d="M0 0H80"/>')) == 1


class TestLetters:
    """A plan that was a PDF has its names as copies of letters' shapes."""

    def test_they_are_text_and_stay_out(self, tmp_path: Path) -> None:
        letters = "".join(
            f'<g fill="black"><use xlink:href="#{each}" x="5" y="50"/></g>' for each in ("glyph0-1", "glyph-0-1")
        )
        font = '<defs><g><g id="glyph0-1"><path d="M1 1h2v2z"/></g></g></defs>'
        assert len(shapes(tmp_path, font + WALL + letters)) == 1


@pytest.mark.counterpart("matplotlib")
def test_what_matplotlib_draws(tmp_path: Path) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    figure = pyplot.figure(figsize=(8.0, 6.0))
    try:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, 8.0), ylim=(0.0, 6.0))
        axes.plot([4.0, 4.0], [0.0, 4.0])
        axes.axis("off")
        figure.savefig(tmp_path / "drawn.svg")
    finally:
        pyplot.close(figure)
    found = read(tmp_path, (tmp_path / "drawn.svg").read_text(encoding="utf-8"), metre=72.0)  # 72 points an inch
    assert len(found.shapes) == 1
    assert np.allclose(extent(*found.shapes), (4.0, 0.0, 4.0, 4.0), atol=0.02)


def converter() -> str:
    """The program in docs/scenarios.md that makes plan.svg of plan.dxf."""
    page = Path(__file__).parents[3] / "docs" / "scenarios.md"
    (program,) = [each for each in page.read_text(encoding="utf-8").split("```") if "import ezdxf" in each]
    return program.removeprefix("text\n")


@pytest.mark.counterpart("ezdxf")
@pytest.mark.parametrize("unit", ["MM", "CM", "M", "IN"])
@pytest.mark.parametrize("seen", [True, False])
def test_a_dxf_file_has_its_size_and_no_background(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unit: str, seen: bool
) -> None:
    """ezdxf writes a background in any case; unless it is to be seen, in a colour that lets everything through."""
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed here")
    document = ezdxf.new(units=getattr(ezdxf.units, unit))
    metre = ezdxf.units.conversion_factor(ezdxf.units.M, document.units)
    model = document.modelspace()
    model.add_lwpolyline([(x * metre, y * metre) for x, y in ((0, 0), (8, 0), (8, 6), (0, 6))], close=True)
    model.add_line((4 * metre, 0), (4 * metre, 4 * metre))
    model.add_text("Kitchen", height=0.3 * metre, dxfattribs={"insert": (metre, metre)})
    document.saveas(tmp_path / "plan.dxf")
    program = converter()
    if not seen:
        program = program.replace("Configuration(", "Configuration(background_policy=config.BackgroundPolicy.OFF, ")
    monkeypatch.chdir(tmp_path)
    exec(program, {})
    assert "<rect" in (tmp_path / "plan.svg").read_text(encoding="utf-8")
    found = read_drawing(tmp_path / "plan.svg", None)
    assert np.allclose(found.high, (8.0, 6.0), atol=1e-3)
    outer, inner = found.shapes
    assert np.allclose(extent(outer), (0.0, 0.0, 8.0, 6.0), atol=1e-3)
    assert np.allclose(extent(inner), (4.0, 0.0, 4.0, 4.0), atol=1e-3)
