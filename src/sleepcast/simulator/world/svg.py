"""SVG syntax: the `d` attribute of a path as curves, curves flattened to points, and the attributes for lengths,
transforms and page size.

A point is a complex number. Every curve is a Bézier curve (a line is one with two points) or a part of an ellipse,
so a transform only moves a few points; curves are flattened afterwards. The grammar, and how an arc follows from its
ends, are those of SVG 1.1, chapter 8 and appendix F.6.
"""

from __future__ import annotations

import re
from cmath import phase, rect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from math import acos, ceil, comb, cos, isfinite, pi, radians, sin, sqrt, tan
from typing import NamedTuple

from sleepcast.core.records import dataclass

MAX_NUMBER = 1e9
"""Largest coordinate: beyond it, small details of a drawing are lost to rounding."""
MAX_PIECES = 10_000
"""Pieces of one flattened curve: a circle of 50 km is as exact as one of 1 m."""

MAX_CURVES = 1_000_000
"""Curves of one drawing: each becomes at least one line, of which no more fit into a world."""

_NEXT_NUMBER = re.compile(r"[\s,]*([+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+)")
_FLAG = re.compile(r"[\s,]*([01])")
_LETTER = re.compile(r"[\s,]*([MmZzLlHhVvCcSsQqTtAa])")
_MORE = re.compile(r"[\s,]*[^\s,]")
_ARGUMENTS = {"M": 2, "Z": 0, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7}


class PathError(ValueError):
    """Invalid path data; the text is a sentence without its location."""


@dataclass(frozen=True, slots=True)
class Bezier:
    """A curve by its end points, the first and the last of `points`, and its control points between them."""

    points: tuple[complex, ...]

    def moved(self, move: Callable[[complex], complex]) -> Bezier:
        return Bezier(tuple(map(move, self.points)))

    def flat(self, tolerance: float) -> Iterator[complex]:
        """Points on the curve after its start, dense enough that chords stay within `tolerance` of it (Wang's bound on
        the second differences)."""
        degree = len(self.points) - 1
        bends = [abs(a - 2.0 * b + c) for a, b, c in zip(self.points, self.points[1:], self.points[2:], strict=False)]
        pieces = _piece_count(sqrt(degree * (degree - 1) / 8.0 * max(bends, default=0.0) / tolerance))
        weights = [comb(degree, number) for number in range(degree + 1)]
        for piece in range(1, pieces):
            t = piece / pieces
            yield sum(
                weight * t**number * (1.0 - t) ** (degree - number) * point
                for number, (weight, point) in enumerate(zip(weights, self.points, strict=True))
            )
        yield self.points[-1]


@dataclass(frozen=True, slots=True)
class Arc:
    """Part of an ellipse: centre + right * cos(angle) + up * sin(angle), the angle from `start` on by `sweep` rad. end:
    its exact end point."""

    centre: complex
    right: complex
    up: complex
    start: float
    sweep: float
    end: complex

    def moved(self, move: Callable[[complex], complex]) -> Arc:
        centre = move(self.centre)
        right, up = move(self.centre + self.right) - centre, move(self.centre + self.up) - centre
        return Arc(centre, right, up, self.start, self.sweep, move(self.end))

    def flat(self, tolerance: float) -> Iterator[complex]:
        """As for Bézier curves: a chord deviates by at most 1 - cos(angle / 2) of the radius."""
        radius = sqrt(abs(self.right) ** 2 + abs(self.up) ** 2)  # at least the longer half axis
        widest = 2.0 * acos(max(0.0, 1.0 - tolerance / radius)) if radius > 0.0 else pi
        pieces = _piece_count(abs(self.sweep) / widest) if widest > 0.0 else MAX_PIECES
        for piece in range(1, pieces):
            turned = rect(1.0, self.start + self.sweep * piece / pieces)
            yield self.centre + self.right * turned.real + self.up * turned.imag
        yield self.end


def _piece_count(pieces: float) -> int:
    return max(1, ceil(min(pieces, MAX_PIECES)))


@dataclass(slots=True)
class Subpath:
    """Connected curves from `start` on, possibly closed."""

    start: complex
    curves: list[Bezier | Arc] = field(default_factory=list)
    closed: bool = False

    def moved(self, move: Callable[[complex], complex]) -> Subpath:
        return Subpath(move(self.start), [curve.moved(move) for curve in self.curves], self.closed)

    def flat(self, tolerance: float) -> Iterator[complex]:
        """Points along the line, the start included."""
        yield self.start
        for curve in self.curves:
            yield from curve.flat(tolerance)


def read_path(text: str) -> list[Subpath]:
    """The lines that a `d` attribute draws. Raises PathError for invalid data."""
    return _PathReader(text).read()


class _PathReader:
    """Reads one path: `_here` is the current point, `_last` the previous letter and `_pull` its last control point."""

    def __init__(self, text: str) -> None:
        self._text, self._place = text, 0
        self._lines: list[Subpath] = []
        self._here = 0j
        self._last, self._pull = "", 0j
        self._steps = 0

    def read(self) -> list[Subpath]:
        letter = ""
        while _MORE.match(self._text, self._place):
            match = _LETTER.match(self._text, self._place)
            if match:
                letter, self._place = match[1], match.end()
            elif not letter or letter in "Zz":
                raise PathError(f"wanted a letter such as L at {self._shown()}")
            if not self._last and letter not in "Mm":
                raise PathError(f'a path begins with M, not "{letter}"')
            self._step(letter)
            self._last = letter.upper()
            letter = {"M": "L", "m": "l"}.get(letter, letter)  # further points of a move are lines
        return self._lines

    def _step(self, letter: str) -> None:
        self._steps += 1
        if self._steps > MAX_CURVES:
            raise PathError(f"more than {MAX_CURVES} curves: leave some out")
        upper, values = letter.upper(), self._values(letter.upper())
        origin = self._here if letter.islower() else 0j
        if upper == "Z":
            self._lines[-1].closed = True
            self._here = self._lines[-1].start
        elif upper == "M":
            self._here = origin + complex(*values)
            self._lines.append(Subpath(self._here))
        elif upper == "H":
            self._curve(complex(values[0] + origin.real, self._here.imag))
        elif upper == "V":
            self._curve(complex(self._here.real, values[0] + origin.imag))
        elif upper == "A":
            self._arc(values, origin + complex(values[5], values[6]))
        else:
            points = [origin + complex(*pair) for pair in zip(values[::2], values[1::2], strict=True)]
            if upper in "ST":  # smooth: mirrors the last control point
                smooth = self._last in ("CS" if upper == "S" else "QT")
                points.insert(0, 2.0 * self._here - self._pull if smooth else self._here)
            self._curve(*points)

    def _values(self, letter: str) -> list[float]:
        values = []
        for number in range(_ARGUMENTS[letter]):
            pattern = _FLAG if letter == "A" and number in (3, 4) else _NEXT_NUMBER
            match = pattern.match(self._text, self._place)
            if not match:
                raise PathError(f"wanted {_ARGUMENTS[letter]} numbers after {letter}, at {self._shown()}")
            value = float(match[1])
            if not isfinite(value) or abs(value) > MAX_NUMBER:
                raise PathError(f"{match[1][:20]} is too far away: at most {MAX_NUMBER:g}")
            values.append(value)
            self._place = match.end()
        return values

    def _curve(self, *points: complex) -> None:
        self._draw(Bezier((self._here, *points)))
        self._pull = points[-2] if len(points) > 1 else points[-1]
        self._here = points[-1]

    def _arc(self, values: list[float], end: complex) -> None:
        if end != self._here:
            radius_x, radius_y, turn, large, sweep = values[:5]
            drawn = arc_between(self._here, end, abs(radius_x), abs(radius_y), radians(turn), large > 0.0, sweep > 0.0)
            self._draw(drawn)
        self._here = end

    def _draw(self, curve: Bezier | Arc) -> None:
        if self._lines[-1].closed:  # continues from the start of the closed line
            self._lines.append(Subpath(self._here))
        self._lines[-1].curves.append(curve)

    def _shown(self) -> str:
        rest = self._text[self._place :].strip()
        return f'"{rest[:20]}"' if rest else "its end"


def arc_between(
    start: complex, end: complex, radius_x: float, radius_y: float, turn: float, large: bool, sweep: bool
) -> Arc | Bezier:
    """The arc from `start` to `end` of an ellipse with the half axes `radius_x` and `radius_y`, turned by `turn` rad:
    the `large` part or the small one, with increasing angles (`sweep`) or decreasing ones. A line if an axis is 0."""
    if not radius_x or not radius_y:
        return Bezier((start, end))
    turned = rect(1.0, turn)
    # In a frame where the ellipse is a unit circle: half of the chord, and the vector from its middle to the centre.
    half = (start - end) / 2.0 / turned
    chord = complex(half.real / radius_x, half.imag / radius_y)
    if abs(chord) > 1.0:  # too small for its ends: scaled up until it just reaches them
        radius_x, radius_y, chord = radius_x * abs(chord), radius_y * abs(chord), chord / abs(chord)
    away = sqrt(max(0.0, 1.0 / abs(chord) ** 2 - 1.0)) * (1.0 if large != sweep else -1.0)
    middle = complex(chord.imag, -chord.real) * away
    first, last = phase(chord - middle), phase(-chord - middle)
    through = (last - first) % (2.0 * pi)
    centre = (start + end) / 2.0 + complex(middle.real * radius_x, middle.imag * radius_y) * turned
    return Arc(centre, radius_x * turned, radius_y * 1j * turned, first, through if sweep else through - 2.0 * pi, end)


PIXEL = 0.0254 / 96.0
"""Size of SVG's px, m; numbers without a unit are px."""
UNITS = {"": 1.0, "px": 1.0, "pt": 4 / 3, "pc": 16.0, "in": 96.0, "cm": 96 / 2.54, "mm": 9.6 / 2.54, "Q": 2.4 / 2.54}
"""SVG's units, in px."""
ON_SCREEN = ("", "px")
"""Units that do not state a real size."""

_NUMBER = re.compile(r"[+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+")
_LENGTH = re.compile(rf"\s*({_NUMBER.pattern})\s*([A-Za-z%]*)\s*")
_LIST = re.compile(rf"[\s,]*(?:{_NUMBER.pattern}[\s,]*+)*+")
_TRANSFORM = re.compile(r"[\s,]*(\w+)\s*\(([^()]*)\)[\s,]*")
_SIZE = re.compile(rf"({_NUMBER.pattern})([A-Za-z]*)")
_TURNS = {"deg": 1.0, "grad": 0.9, "rad": 180.0 / pi, "turn": 360.0}
"""CSS's units of angles, in degrees."""
_SIDES = {"translatex": "translate", "translatey": "translate", "scalex": "scale", "scaley": "scale"}


class Matrix(NamedTuple):
    """Maps x, y to a x + c y + e, b x + d y + f; points are complex numbers."""

    a: float = 1.0
    b: float = 0.0
    c: float = 0.0
    d: float = 1.0
    e: float = 0.0
    f: float = 0.0

    def of(self, at: complex) -> complex:
        x, y = at.real, at.imag
        return complex(self.a * x + self.c * y + self.e, self.b * x + self.d * y + self.f)

    def after(self, first: Matrix) -> Matrix:
        """The matrix that applies `first`, then this one."""
        a, b, c, d, e, f = first
        return Matrix(
            self.a * a + self.c * b,
            self.b * a + self.d * b,
            self.a * c + self.c * d,
            self.b * c + self.d * d,
            self.a * e + self.c * f + self.e,
            self.b * e + self.d * f + self.f,
        )

    @property
    def grows(self) -> float | None:
        """The factor by which circles are scaled; None if they do not stay circles."""
        right, up = complex(self.a, self.b), complex(self.c, self.d)
        same = abs(abs(right) - abs(up)) + abs((right * up.conjugate()).real) / max(abs(right), 1e-300)
        return abs(right) if same <= 1e-9 * abs(right) else None


class Page(NamedTuple):
    """The visible part of the drawing: least x and y, width and height, in units of the drawing; and the size of such a
    unit in m, None if the file does not state it."""

    x: float
    y: float
    width: float
    height: float
    unit: float | None


def page_of(attributes: Mapping[str, str]) -> Page:
    """The page described by the outermost element. Raises PathError if there is none."""
    sizes = [sized(attributes.get(key, "")) for key in ("width", "height")]
    if "viewBox" in attributes:
        x, y, width, height = numbers(attributes["viewBox"], "viewBox", 4)
        units = [
            size[0] * PIXEL / own
            for size, own in zip(sizes, (width, height), strict=True)
            if size is not None and size[1] not in ON_SCREEN and own > 0.0
        ]
        page = Page(x, y, width, height, min(units, default=None))
    elif sizes[0] is not None and sizes[1] is not None:
        real = all(size is not None and size[1] not in ON_SCREEN for size in sizes)
        page = Page(0.0, 0.0, sizes[0][0], sizes[1][0], PIXEL if real else None)
    else:
        raise PathError("it has neither viewBox nor width and height")
    if not (page.width > 0.0 and page.height > 0.0):
        raise PathError("its page is empty: wanted a width and a height above 0")
    return page


def sized(text: str) -> tuple[float, str] | None:
    """A length in px and its unit; None if it is no length, or a percentage."""
    match = _LENGTH.fullmatch(text)
    if match is None or match[2] not in UNITS:
        return None
    return _bounded(match[1]) * UNITS[match[2]], match[2]


def length(attributes: Mapping[str, str], key: str, default: float = 0.0) -> float:
    """The length under `key` in units of the drawing. Raises PathError if it is none."""
    if key not in attributes:
        return default
    size = sized(attributes[key])
    if size is None:
        raise PathError(
            f'{key}="{attributes[key][:20]}" is no length: wanted a number, plain or in {", ".join(UNITS)[2:]}'
        )
    return size[0]


def numbers(text: str, what: str, count: int | None = None) -> list[float]:
    """The numbers in `text`, exactly `count` of them if given. Raises PathError for anything else."""
    texts = _NUMBER.findall(text) if _LIST.fullmatch(text) else None
    if texts is None or (count is not None and len(texts) != count):
        raise PathError(f'{what}: wanted {"" if count is None else f"{count} "}numbers, not "{text[:20]}"')
    return [_bounded(each) for each in texts]


def _bounded(text: str) -> float:
    value = float(text)
    if not isfinite(value) or abs(value) > MAX_NUMBER:
        raise PathError(f"{text[:20]} is too large: at most {MAX_NUMBER:g}")
    return value


def transform(text: str) -> Matrix:
    """The matrix of a `transform` attribute. Raises PathError for invalid text."""
    matrix, place = Matrix(), 0
    while place < len(text):
        match = _TRANSFORM.match(text, place)
        if match is None or match[1] not in _STEPS:
            raise PathError(f'transform: wanted {", ".join(_STEPS)}, not "{text[place : place + 20]}"')
        values = numbers(match[2], match[1])
        if len(values) not in _STEPS[match[1]]:
            raise PathError(f'transform: {match[1]} takes {_STEPS[match[1]][-1]} numbers, not "{match[2][:20]}"')
        matrix = matrix.after(_step(match[1], values))
        place = match.end()
    return matrix


def css_transform(text: str) -> Matrix:
    """The matrix of a `transform` in a style, where lengths and angles have units. Raises PathError for one that is not
    read, such as a percentage or one in space."""
    matrix, place = Matrix(), 0
    while place < len(text) and text.strip().casefold() not in ("none", "inherit", "initial", "unset"):
        match = _TRANSFORM.match(text, place)
        if match is None:
            raise PathError(f'transform: wanted none, {", ".join(_STEPS)}, not "{text[place : place + 20]}"')
        matrix = matrix.after(
            _css_step(match[1], [_css_number(each) for each in re.split(r"[\s,]+", match[2].strip())])
        )
        place = match.end()
    return matrix


def _css_step(kind: str, values: list[float]) -> Matrix:
    folded = kind.casefold()
    name = next((each for each in _STEPS if each.casefold() == folded), _SIDES.get(folded, ""))
    if folded == "skew" and len(values) in (1, 2):
        tilted = [tan(radians(each)) for each in values]
        return Matrix(c=tilted[0], b=tilted[1] if len(tilted) > 1 else 0.0)
    if not name or len(values) not in ((1,) if folded in _SIDES or name == "rotate" else _STEPS[name]):
        raise PathError(f'transform: "{kind[:20]}" with {len(values)} numbers: wanted {", ".join(_STEPS)}')
    if folded in _SIDES:
        rest = 0.0 if name == "translate" else 1.0
        values = [values[0], rest] if folded.endswith("x") else [rest, values[0]]
    return _step(name, values)


def _css_number(text: str) -> float:
    """A number, a length in px, or an angle in degrees."""
    match = _SIZE.fullmatch(text)
    factor = None if match is None else (UNITS | _TURNS).get(match[2])
    if match is None or factor is None:
        raise PathError(
            f'transform: "{text[:20]}" is not read: wanted a number, or one in {", ".join((*UNITS, *_TURNS))[2:]}'
        )
    return _bounded(match[1]) * factor


_STEPS = {
    "matrix": (6,),
    "translate": (1, 2),
    "scale": (1, 2),
    "rotate": (1, 3),
    "skewX": (1,),
    "skewY": (1,),
}
"""Numbers of arguments that each kind of transform takes."""


def _step(kind: str, values: list[float]) -> Matrix:
    first = values[0]
    if kind == "matrix":
        return Matrix(*values)
    if kind == "translate":
        return Matrix(e=first, f=values[1] if len(values) == 2 else 0.0)
    if kind == "scale":
        return Matrix(a=first, d=values[1] if len(values) == 2 else first)
    if kind == "skewX":
        return Matrix(c=tan(radians(first)))
    if kind == "skewY":
        return Matrix(b=tan(radians(first)))
    turn = Matrix(cos(radians(first)), sin(radians(first)), -sin(radians(first)), cos(radians(first)))
    if len(values) == 1:
        return turn
    return Matrix(e=values[1], f=values[2]).after(turn).after(Matrix(e=-values[1], f=-values[2]))
