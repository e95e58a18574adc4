"""Drawings: an SVG file converted to solid areas, discs and walls.

Filled shapes become solid areas, others thin walls along their lines; circles stay circles. Paths, polygons,
polylines, rectangles, circles, ellipses and lines are read, with the transforms, fills and ids of the groups around
them; text and pictures are skipped. The page's lower left corner becomes the world's, its y axis turns up, and
curves become lines within TOLERANCE of them.

Expat reads the XML. Entities, which can expand a short file without limit, are refused; files that the drawing names
are not opened.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

from sleepcast.core.records import dataclass
from sleepcast.core.settings import SettingsError, read_text
from sleepcast.simulator.world.fill import encloses, filled, pairs_compared
from sleepcast.simulator.world.svg import (
    MAX_CURVES,
    MAX_NUMBER,
    Matrix,
    Page,
    PathError,
    Subpath,
    length,
    page_of,
    read_path,
)
from sleepcast.simulator.world.svg_styles import (
    STROKE,
    Match,
    Style,
    StyleError,
    StyleSheets,
    is_filled,
    is_paint,
    matrix_of,
    share,
)
from sleepcast.simulator.world.world import MAX_NAME, MAX_SOLIDS, Area, Circle, Point, Shape, Wall

TOLERANCE = 0.001
"""Largest distance between a curve and the lines that replace it, m: less than sonars and bumpers can resolve."""
PAPER = 0.001
"""By which part of the page's size its background may be smaller: programs round."""
MAX_BYTES = 8_388_608
"""Bytes of a drawing: floor plans of large buildings have a tenth of it."""
MAX_ELEMENTS = 100_000
"""Elements of a drawing: each is converted by itself."""
MAX_COMPARED = 400_000_000
"""Pairs of sides of all shapes that are compared for where they cross: some ten seconds of them. A plan of 2,000 shapes
with 300 sides each has as many."""
MAX_DEPTH = 128
"""Depth of nested groups."""
TOO_MANY = f"more than {MAX_SOLIDS} lines: leave some out"

SVG = "http://www.w3.org/2000/svg"
HREF = "http://www.w3.org/1999/xlink href"
_LETTER = re.compile(r"#glyph-?\d")
"""What programs that use Cairo, such as pdftocairo, make of a letter: a copy of its shape."""
GROUPS = ("g", "a", "switch")
DRAWN = ("path", "polygon", "polyline", "rect", "circle", "ellipse", "line")


@dataclass(frozen=True, slots=True)
class Drawing:
    """The contents of a drawing in the world's frame; low, high: corners of its page there, m."""

    shapes: tuple[Shape, ...]
    low: Point
    high: Point


@dataclass(frozen=True, slots=True)
class _Inherited:
    """What an element inherits from the groups around it.

    stroke: "" where nothing is said of it
    shown: whether anything of it is
    visible: unless it says otherwise itself
    match: which selectors it fits
    """

    matrix: Matrix = Matrix()  # frozen: nobody can change it
    name: str = ""
    fill: str = "black"
    fill_opacity: float = 1.0
    fill_rule: str = "nonzero"
    stroke: str = ""
    shown: bool = True
    visible: bool = True
    match: Match = Match()  # as above

    @property
    def filled(self) -> bool:
        return self.fill_opacity > 0.0 and is_filled(self.fill)

    @property
    def seen(self) -> bool:
        """Whether it is drawn: programs put boxes around shapes which they say have neither fill nor stroke."""
        return self.shown and self.visible and (self.filled or self.stroke != "none")

    @property
    def clear(self) -> bool:
        """Whether it is filled with a colour that lets everything through, and nothing is said of a stroke."""
        return not self.filled and is_filled(self.fill) and not self.stroke

    def inside(self, name: str, attributes: dict[str, str], style: Style, match: Match) -> _Inherited:
        """What holds inside an element that has this style. Raises PathError."""
        matrix = self.matrix.after(matrix_of(style, attributes))
        if not all(abs(value) <= MAX_NUMBER for value in matrix):
            raise PathError("transform: too large")
        fill, visible = style.get("fill", "inherit"), style.get("visibility", "inherit").casefold()
        stroke = style.get(STROKE, "inherit").casefold()
        rule, opacity = style.get("fill-rule", "inherit").casefold(), style.get("fill-opacity", "inherit")
        return _Inherited(
            matrix=matrix,
            name=attributes.get("id", self.name)[:MAX_NAME],
            fill=self.fill if fill.casefold() == "inherit" or not is_paint(fill) else fill,
            fill_opacity=self.fill_opacity if opacity.casefold() == "inherit" else share(opacity),
            fill_rule=rule if rule in ("nonzero", "evenodd") else self.fill_rule,
            stroke=self.stroke if stroke == "inherit" else stroke,
            shown=self.shown
            and style.get("display", "").casefold() != "none"
            and share(style.get("opacity", "1")) > 0.0,
            visible=self.visible if visible == "inherit" else visible not in ("hidden", "collapse"),
            match=match,
        )


@dataclass(frozen=True, slots=True)
class _Drawn:
    """One element, in units of the drawing.

    solid: whether it is filled
    paper: whether it would be the page's background, were it as large
    disc: centre and radius of a circle, which is also given as lines
    number: line number in the file
    """

    lines: list[Subpath]
    around: _Inherited
    solid: bool
    paper: bool
    number: int
    disc: tuple[complex, float] | None = None


def read_drawing(path: Path, metre: float | None, at: Point = (0.0, 0.0), *, walls: bool = False) -> Drawing:
    """The drawing in the SVG file at `path`.

    metre: units of the drawing per metre; None uses the size that the file states
    at: position of the page's lower left corner in the world, m
    walls: whether filled shapes are thin walls along their outlines, too

    Raises SettingsError.
    """
    reader = _DrawingReader(path, walls=walls)
    reader.read(read_text(path, MAX_BYTES))
    page = reader.page
    scale = 1.0 / metre if metre else page.unit
    if scale is None:
        raise SettingsError(
            f"{path}:{reader.page_number}: the SVG does not say how large it is in the world (its width is no length "
            "in mm, cm or in): say how many of its units are a metre, such as metre = 100"
        )
    low, top = complex(page.x, page.y), page.y + page.height
    upright = Matrix(scale, 0.0, 0.0, -scale, at[0] - low.real * scale, at[1] + top * scale)
    high = at[0] + page.width * scale, at[1] + page.height * scale
    shapes, sides, compared = list[Shape](), 0, ComparisonBudget()
    for number, drawn in enumerate(reader.drawn, 1):
        try:
            for shape in _shapes(drawn, upright, MAX_SOLIDS - sides, compared):
                sides += _sides(shape)
                if shapes or number == len(reader.drawn) or not (drawn.paper and _covers(shape, at, high)):
                    shapes.append(shape)
        except PathError as error:
            raise SettingsError(f"{path}:{drawn.number}: {error}") from None
        if sides > MAX_SOLIDS:
            raise SettingsError(f"{path}:{drawn.number}: {TOO_MANY}")
    return Drawing(tuple(shapes), at, high)


def _covers(shape: Shape, low: Point, high: Point) -> bool:
    """Whether it is a rectangle as large as the page or larger. low, high: corners of the page, m"""
    outlines = shape.outlines if isinstance(shape, Area) else (_open(shape.points),) if isinstance(shape, Wall) else ()
    return [*map(len, outlines)] == [4] and all(
        len(sides := sorted({point[axis] for point in outlines[0]})) == 2
        and sides[0] <= low[axis] + PAPER * (high[axis] - low[axis])
        and sides[1] >= high[axis] - PAPER * (high[axis] - low[axis])
        for axis in (0, 1)
    )


@dataclass(slots=True)
class ComparisonBudget:
    """How many pairs of sides of a drawing have been compared for where they cross."""

    used: int = 0

    def spend(self, outlines: tuple[tuple[Point, ...], ...]) -> None:
        """Let these outlines be compared. Raises PathError if that takes too long."""
        self.used += pairs_compared(outlines)
        if self.used > MAX_COMPARED:
            raise PathError(
                f"with it more than {MAX_COMPARED:,} pairs of sides have to be compared for where they cross: simplify "
                "shapes of many sides, or leave some out"
            )


def _shapes(drawn: _Drawn, upright: Matrix, room: int, compared: ComparisonBudget) -> Iterator[Shape]:
    """The shapes that an element becomes in the world. room: for so many lines. Raises PathError for more."""
    around = drawn.around
    whole = upright.after(around.matrix)
    if drawn.disc and drawn.solid and whole.grows:
        centre = whole.of(drawn.disc[0])
        yield Circle(centre.real, centre.imag, drawn.disc[1] * whole.grows, around.name)
        return
    flat, outlines, walls = _flat(drawn, whole, room), list[tuple[Point, ...]](), list[tuple[Point, ...]]()
    if drawn.solid:
        compared.spend(flat)
    for line, points in zip(drawn.lines, flat, strict=True):
        if drawn.solid and encloses(_open(points)):
            outlines.append(_open(points))
        elif len(points) > 1:
            walls.append((*points, points[0]) if line.closed and points[0] != points[-1] else points)
    if area := filled(tuple(outlines), around.fill_rule) if outlines else ():
        yield Area(area, around.name)
    yield from (Wall(points, around.name) for points in walls)


def _flat(drawn: _Drawn, whole: Matrix, room: int) -> tuple[tuple[Point, ...], ...]:
    """Points along each line of an element. room: for so many lines. Raises PathError for more."""
    lines = list[tuple[Point, ...]]()
    for line in drawn.lines:
        lines.append(_points(line.moved(whole.of), room))
        room -= len(lines[-1]) - 1
        if room < 0:
            raise PathError(TOO_MANY)
    return tuple(lines)


def _points(line: Subpath, room: int) -> tuple[Point, ...]:
    """Points along a line, without repeats, at most two more than there is room for."""
    points: list[Point] = []
    for point in line.flat(TOLERANCE):
        if not points or points[-1] != (point.real, point.imag):
            points.append((point.real, point.imag))
        if len(points) > room + 1:
            break
    return tuple(points)


def _open(points: tuple[Point, ...]) -> tuple[Point, ...]:
    """The points of a closed line without the repeated first point at the end."""
    return points[:-1] if len(points) > 1 and points[0] == points[-1] else points


def _sides(shape: Shape) -> int:
    if isinstance(shape, Area):
        return sum(map(len, shape.outlines))
    return len(shape.points) - 1 if isinstance(shape, Wall) else 1


def _disc(attributes: dict[str, str]) -> tuple[complex, float] | None:
    centre = complex(length(attributes, "cx"), length(attributes, "cy"))
    radius = length(attributes, "r")
    return (centre, radius) if radius > 0.0 else None


def _lines(name: str, attributes: dict[str, str]) -> list[Subpath]:
    """The lines of an element, by way of an equivalent path. Raises PathError."""
    if name == "path":
        return read_path(attributes.get("d", ""))
    if name in ("polygon", "polyline"):
        points = attributes.get("points", "").strip()
        return read_path(f"M{points}{'z' if name == 'polygon' else ''}") if points else []
    if name == "line":
        x1, y1, x2, y2 = (length(attributes, key) for key in ("x1", "y1", "x2", "y2"))
        return read_path(f"M{x1!r},{y1!r}L{x2!r},{y2!r}")
    if name == "rect":
        return _rectangle(attributes)
    radius_x, radius_y = (length(attributes, "r" if name == "circle" else key) for key in ("rx", "ry"))
    if radius_x <= 0.0 or radius_y <= 0.0:
        return []
    x, y, arc = length(attributes, "cx"), length(attributes, "cy"), f"A{radius_x!r},{radius_y!r} 0 0 1"
    return read_path(f"M{x - radius_x!r},{y!r}{arc}{x + radius_x!r},{y!r}{arc}{x - radius_x!r},{y!r}z")


def _rectangle(attributes: dict[str, str]) -> list[Subpath]:
    x, y, width, height = (length(attributes, key) for key in ("x", "y", "width", "height"))
    if width <= 0.0 or height <= 0.0:
        return []
    radius_x = length(attributes, "rx", length(attributes, "ry"))
    radius_y = min(length(attributes, "ry", radius_x), height / 2.0)
    radius_x = min(radius_x, width / 2.0)
    if radius_x <= 0.0 or radius_y <= 0.0:
        return read_path(f"M{x!r},{y!r}h{width!r}v{height!r}h{-width!r}z")
    level, upright, arc = width - 2.0 * radius_x, height - 2.0 * radius_y, f"a{radius_x!r},{radius_y!r} 0 0 1"
    return read_path(
        f"M{x + radius_x!r},{y!r}h{level!r}{arc}{radius_x!r},{radius_y!r}v{upright!r}{arc}{-radius_x!r},{radius_y!r}"
        f"h{-level!r}{arc}{-radius_x!r},{-radius_y!r}v{-upright!r}{arc}{radius_x!r},{-radius_y!r}z"
    )


def parse_xml(parser: expat.XMLParserType, text: str, path: Path) -> None:
    """Let a parser go through the text of a file. Raises SettingsError for what is not XML."""
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        said = expat.errors.messages.get(error.code, error.code)
        raise SettingsError(f"{path}:{error.lineno}: not XML: {said}") from None


def _parser() -> expat.XMLParserType:
    return expat.ParserCreate("utf-8", " ")  # whatever encoding the file declares: it was read as this one


@dataclass(slots=True)
class _Sheet:
    """A style sheet; number: line number of its beginning."""

    text: str
    number: int


class _Sheets:
    """Goes through a file in search of style sheets, which often stand among definitions, and of what is refused."""

    def __init__(self, path: Path) -> None:
        self._path, self._parser = path, _parser()
        self._found: list[_Sheet] = []
        self._open = False
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text
        self._parser.EntityDeclHandler = self._entity
        self._parser.ProcessingInstructionHandler = self._instruction

    def read(self, text: str) -> list[_Sheet]:
        with suppress(expat.ExpatError):  # whoever reads the elements says so
            self._parser.Parse(text.encode(), True)
        return self._found

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        space, _, name = tag.rpartition(" ")
        if name == "style" and space in ("", SVG):
            self._found.append(_Sheet("", self._parser.CurrentLineNumber))
            self._open = True

    def _end(self, _: str) -> None:
        self._open = False

    def _text(self, text: str) -> None:
        if self._open:
            self._found[-1].text += text

    def _entity(self, name: str, *_: object) -> None:
        self._refuse(f'it declares an entity "{name[:20]}": wanted a drawing without them')

    def _instruction(self, target: str, _: str) -> None:
        if target == "xml-stylesheet":
            self._refuse("its style sheet is in another file, which is not opened: put its rules into a <style>")

    def _refuse(self, sentence: str) -> None:
        raise SettingsError(f"{self._path}:{self._parser.CurrentLineNumber}: {sentence}")


class _DrawingReader:
    """Goes through the elements of one file, after its style sheets, which count for all of them."""

    def __init__(self, path: Path, *, walls: bool) -> None:
        self.drawn: list[_Drawn] = []
        self.page = Page(0.0, 0.0, 0.0, 0.0, None)
        self.page_number = 0
        self._path, self._walls = path, walls
        self._around = [_Inherited()]
        self._sheets = StyleSheets()
        self._skipped = 0
        self._elements = self._curves = 0

    def read(self, text: str) -> None:
        for sheet in _Sheets(self._path).read(text):
            try:
                self._sheets.add(sheet.text, sheet.number)
            except StyleError as error:
                raise SettingsError(f"{self._path}:{error.line}: <style>: {error}") from None
        self._parser = _parser()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        parse_xml(self._parser, text, self._path)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        space, _, name = tag.rpartition(" ")
        self._elements += 1
        if self._elements > MAX_ELEMENTS:
            raise self._error("", f"more than {MAX_ELEMENTS} elements")
        if not self.page_number and (name != "svg" or space not in ("", SVG)):
            raise self._error(name, "is no drawing: wanted an svg")
        if self._skipped or space not in ("", SVG) or not self._around[-1].shown:
            self._skipped += 1
        elif name == "use" and _LETTER.match(attributes.get(HREF, attributes.get("href", ""))):
            self._skipped = 1
        elif name in ("use", "svg") and self.page_number:
            raise self._error(name, "a drawing within the drawing; unlink it, so that its shapes stand here themselves")
        elif name in (*GROUPS, "svg", *DRAWN):
            try:
                self._enter(name, attributes)
            except PathError as error:
                raise self._error(
                    f'{name} id="{attributes["id"]}"' if "id" in attributes else name, str(error)
                ) from None
        else:
            self._skipped = 1

    def _end(self, _: str) -> None:
        if self._skipped:
            self._skipped -= 1
        else:
            self._around.pop()

    def _enter(self, name: str, attributes: dict[str, str]) -> None:
        outer = self._around[-1]
        around = outer.inside(name, attributes, *self._sheets.style_of(name, attributes, outer.match))
        if len(self._around) > MAX_DEPTH:
            raise PathError(f"more than {MAX_DEPTH} groups in groups")
        self._around.append(around)
        if name == "svg":
            self.page, self.page_number = page_of(attributes), self._parser.CurrentLineNumber
        elif name in DRAWN and around.seen:
            disc = _disc(attributes) if name == "circle" else None
            lines = _lines(name, attributes)
            self._curves += sum(1 + len(line.curves) for line in lines)
            if self._curves > MAX_CURVES:
                raise PathError(f"with it the drawing has more than {MAX_CURVES} curves: leave some out")
            solid = around.filled and name != "line" and not self._walls
            paper = solid or around.clear
            self.drawn.append(_Drawn(lines, around, solid, paper, self._parser.CurrentLineNumber, disc))

    def _error(self, what: str, sentence: str) -> SettingsError:
        shown = f"<{what[:60]}>: " if what else ""
        return SettingsError(f"{self._path}:{self._parser.CurrentLineNumber}: {shown}{sentence}")
