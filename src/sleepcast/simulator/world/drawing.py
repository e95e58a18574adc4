"""Drawings: an SVG file converted to solid areas, discs and walls.

Filled shapes become solid areas, others thin walls along their lines; circles stay circles. Paths, polygons,
polylines, rectangles, circles, ellipses and lines are read, with the transforms, fills and ids of the groups around
them; text and pictures are skipped. The page's lower left corner becomes the world's, its y axis turns up, and
curves become lines within TOLERANCE of them.

Expat reads the XML. Entities, which can expand a short file without limit, are refused; files that the drawing names
are not opened.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from xml.parsers import expat

from sleepcast.core.settings import SettingsError, read_text
from sleepcast.simulator.world.svg import (
    MAX_CURVES,
    MAX_NUMBER,
    Line,
    Matrix,
    Page,
    PathError,
    length,
    page_of,
    read_path,
    rules,
    style_of,
    transform,
)
from sleepcast.simulator.world.world import MAX_SOLIDS, Area, Circle, Point, Shape, Wall

TOLERANCE = 0.001
"""Largest distance between a curve and the lines that replace it, m: less than sonars and bumpers can resolve."""
MAX_BYTES = 8_388_608
"""Bytes of a drawing: floor plans of large buildings have a tenth of it."""
MAX_ELEMENTS = 100_000
"""Elements of a drawing: each is converted by itself."""
MAX_DEPTH = 128
"""Depth of nested groups."""
TOO_MANY = f"more than {MAX_SOLIDS} lines: leave some out"
MAX_NAME = 64
"""Characters of an id that are kept."""

SVG = "http://www.w3.org/2000/svg"
GROUPS = ("g", "a", "switch")
DRAWN = ("path", "polygon", "polyline", "rect", "circle", "ellipse", "line")


@dataclass(frozen=True, slots=True)
class Drawing:
    """The contents of a drawing in the world's frame; low, high: corners of its page there, m."""

    shapes: tuple[Shape, ...]
    low: Point
    high: Point


@dataclass(frozen=True, slots=True)
class _Around:
    """What an element inherits from the groups around it."""

    matrix: Matrix = Matrix()  # noqa: RUF009  # frozen: nobody can change it
    name: str = ""
    filled: bool = True
    shown: bool = True


@dataclass(frozen=True, slots=True)
class _Drawn:
    """One element, in units of the drawing. disc: centre and radius of a circle, which is also given as lines. number:
    line number in the file."""

    lines: list[Line]
    around: _Around
    number: int
    disc: tuple[complex, float] | None = None


def read_drawing(path: Path, metre: float | None, at: Point = (0.0, 0.0)) -> Drawing:
    """The drawing in the SVG file at `path`. metre: units of the drawing per metre; None uses the size that the file
    states. at: position of the page's lower left corner in the world, m. Raises SettingsError."""
    reader = _Reader(path)
    reader.read(read_text(path, MAX_BYTES))
    page = reader.page
    scale = 1.0 / metre if metre else page.unit
    if scale is None:
        raise SettingsError(
            f"{path}:{reader.page_number}: how large it is in the world it does not say (its width is no length in mm, "
            "cm or in): say how many of its units are a metre, such as metre = 100"
        )
    low, top = complex(page.x, page.y), page.y + page.height
    upright = Matrix(scale, 0.0, 0.0, -scale, at[0] - low.real * scale, at[1] + top * scale)
    shapes, sides = [], 0
    for drawn in reader.drawn:
        try:
            for shape in _shapes(drawn, upright, MAX_SOLIDS - sides):
                sides += _sides(shape)
                shapes.append(shape)
        except PathError as error:
            raise SettingsError(f"{path}:{drawn.number}: {error}") from None
        if sides > MAX_SOLIDS:
            raise SettingsError(f"{path}:{drawn.number}: {TOO_MANY}")
    return Drawing(tuple(shapes), at, (at[0] + page.width * scale, at[1] + page.height * scale))


def _shapes(drawn: _Drawn, upright: Matrix, room: int) -> Iterator[Shape]:
    """The shapes that an element becomes in the world. room: for so many lines. Raises PathError for more."""
    around = drawn.around
    whole = upright.after(around.matrix)
    if drawn.disc and around.filled and whole.grows:
        centre = whole.of(drawn.disc[0])
        yield Circle(centre.real, centre.imag, drawn.disc[1] * whole.grows, around.name)
        return
    lines: list[tuple[bool, tuple[Point, ...]]] = []
    for line in drawn.lines:
        lines.append((line.closed, _points(line.moved(whole.of), room)))
        room -= len(lines[-1][1]) - 1
        if room < 0:
            raise PathError(TOO_MANY)
    outlines = tuple(_open(points) for _, points in lines if around.filled and len(_open(points)) > 2)
    if outlines:
        yield Area(outlines, around.name)
    for closed, points in lines:
        if len(points) > 1 and not (around.filled and len(_open(points)) > 2):
            again = (points[0],) if closed and points[0] != points[-1] else ()
            yield Wall((*points, *again), around.name)


def _points(line: Line, room: int) -> tuple[Point, ...]:
    """Points along a line, without repeats, at most two more than there is room for."""
    found: list[Point] = []
    for point in line.flat(TOLERANCE):
        if not found or found[-1] != (point.real, point.imag):
            found.append((point.real, point.imag))
        if len(found) > room + 1:
            break
    return tuple(found)


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


def _lines(name: str, attributes: dict[str, str]) -> list[Line]:
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
    across, up = (length(attributes, "r" if name == "circle" else key) for key in ("rx", "ry"))
    if across <= 0.0 or up <= 0.0:
        return []
    x, y, arc = length(attributes, "cx"), length(attributes, "cy"), f"A{across!r},{up!r} 0 0 1"
    return read_path(f"M{x - across!r},{y!r}{arc}{x + across!r},{y!r}{arc}{x - across!r},{y!r}z")


def _rectangle(attributes: dict[str, str]) -> list[Line]:
    x, y, width, height = (length(attributes, key) for key in ("x", "y", "width", "height"))
    if width <= 0.0 or height <= 0.0:
        return []
    across = length(attributes, "rx", length(attributes, "ry"))
    up = min(length(attributes, "ry", across), height / 2.0)
    across = min(across, width / 2.0)
    if across <= 0.0 or up <= 0.0:
        return read_path(f"M{x!r},{y!r}h{width!r}v{height!r}h{-width!r}z")
    level, upright, arc = width - 2.0 * across, height - 2.0 * up, f"a{across!r},{up!r} 0 0 1"
    return read_path(
        f"M{x + across!r},{y!r}h{level!r}{arc}{across!r},{up!r}v{upright!r}{arc}{-across!r},{up!r}"
        f"h{-level!r}{arc}{-across!r},{-up!r}v{-upright!r}{arc}{across!r},{-up!r}z"
    )


class _Reader:
    """Goes through the elements of one file."""

    def __init__(self, path: Path) -> None:
        self.drawn: list[_Drawn] = []
        self.page = Page(0.0, 0.0, 0.0, 0.0, None)
        self.page_number = 0
        self._path = path
        self._around = [_Around()]
        self._classes: dict[str, dict[str, str]] = {}
        self._sheet: list[str] | None = None
        self._skipped = 0
        self._elements = self._curves = 0
        self._parser = expat.ParserCreate("utf-8", " ")  # whatever encoding the file declares: it was read as this one
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text
        self._parser.EntityDeclHandler = self._entity

    def read(self, text: str) -> None:
        try:
            self._parser.Parse(text.encode(), True)
        except expat.ExpatError as error:
            said = expat.errors.messages.get(error.code, error.code)
            raise SettingsError(f"{self._path}:{error.lineno}: not XML: {said}") from None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        space, _, name = tag.rpartition(" ")
        self._elements += 1
        if self._elements > MAX_ELEMENTS:
            raise self._error("", f"more than {MAX_ELEMENTS} elements")
        if not self.page_number and (name != "svg" or space not in ("", SVG)):
            raise self._error(name, "is no drawing: wanted an svg")
        if name == "style" and space in ("", SVG):  # often among definitions, which are skipped
            self._sheet = []
        if self._skipped or space not in ("", SVG):
            self._skipped += 1
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
        if not self._skipped:
            self._around.pop()
            return
        self._skipped -= 1
        if self._sheet is not None:
            self._classes |= rules("".join(self._sheet))
            self._sheet = None

    def _text(self, text: str) -> None:
        if self._sheet is not None:
            self._sheet.append(text)

    def _entity(self, name: str, *_: object) -> None:
        raise self._error("", f'it declares an entity "{name[:20]}": wanted a drawing without them')

    def _enter(self, name: str, attributes: dict[str, str]) -> None:
        around = self._inside(attributes)
        if len(self._around) > MAX_DEPTH:
            raise PathError(f"more than {MAX_DEPTH} groups in groups")
        self._around.append(around)
        if name == "svg":
            self.page, self.page_number = page_of(attributes), self._parser.CurrentLineNumber
        elif name in DRAWN and around.shown:
            disc = _disc(attributes) if name == "circle" else None
            lines = _lines(name, attributes)
            self._curves += sum(1 + len(line.curves) for line in lines)
            if self._curves > MAX_CURVES:
                raise PathError(f"with it the drawing has more than {MAX_CURVES} curves: leave some out")
            filled = replace(around, filled=around.filled and name != "line")
            self.drawn.append(_Drawn(lines, filled, self._parser.CurrentLineNumber, disc))

    def _inside(self, attributes: dict[str, str]) -> _Around:
        outer, said = self._around[-1], style_of(attributes, self._classes)
        fill = said.get("fill", "inherit")
        matrix = outer.matrix.after(transform(attributes.get("transform", "")))
        if not all(abs(value) <= MAX_NUMBER for value in matrix):
            raise PathError("transform: too large")
        return _Around(
            matrix=matrix,
            name=attributes.get("id", outer.name)[:MAX_NAME],
            filled=outer.filled if fill == "inherit" else fill not in ("none", "transparent"),
            shown=outer.shown
            and said.get("display") != "none"
            and said.get("visibility") not in ("hidden", "collapse"),
        )

    def _error(self, what: str, sentence: str) -> SettingsError:
        shown = f"<{what[:60]}>: " if what else ""
        return SettingsError(f"{self._path}:{self._parser.CurrentLineNumber}: {shown}{sentence}")
