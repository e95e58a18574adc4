"""Paths of SVG: the letters and numbers of a `d` attribute to curves, and curves to points that follow them closely.

A point is a complex number. Every curve is a Bézier curve (a line is one with two points) or a piece of an ellipse, so
that a transform of the drawing moves a few points and nothing else; only then is it flattened. The grammar, and how an
arc follows from its ends, are those of SVG 1.1, chapter 8 and appendix F.6.
"""

from __future__ import annotations

import re
from cmath import phase, rect
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import acos, ceil, comb, isfinite, pi, radians, sqrt

MAX_NUMBER = 1e9
"""Of a coordinate: beyond, what is small in a drawing is lost to rounding."""
MAX_PIECES = 10_000
"""Of one flattened curve: a circle of 50 km is as exact as one of 1 m."""

_NUMBER = re.compile(r"[\s,]*([+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+)")
_FLAG = re.compile(r"[\s,]*([01])")
_LETTER = re.compile(r"[\s,]*([MmZzLlHhVvCcSsQqTtAa])")
_MORE = re.compile(r"[\s,]*[^\s,]")
_ARGUMENTS = {"M": 2, "Z": 0, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7}


class PathError(ValueError):
    """Something in a path that is none; the text is a sentence without its place."""


@dataclass(frozen=True, slots=True)
class Bezier:
    """A curve by its two ends, the first and the last of `points`, and those that pull it."""

    points: tuple[complex, ...]

    def moved(self, move: Callable[[complex], complex]) -> Bezier:
        return Bezier(tuple(map(move, self.points)))

    def flat(self, tolerance: float) -> Iterator[complex]:
        """Points on the curve after its start, so dense that no line between two is farther than `tolerance` from it
        (Wang's bound on the second differences)."""
        degree = len(self.points) - 1
        bends = [abs(a - 2.0 * b + c) for a, b, c in zip(self.points, self.points[1:], self.points[2:], strict=False)]
        pieces = _bounded(sqrt(degree * (degree - 1) / 8.0 * max(bends, default=0.0) / tolerance))
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
    """A piece of an ellipse: centre + right * cos(angle) + up * sin(angle), the angle from `start` on by `sweep` rad.
    end: exactly where it ends."""

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
        """As for Bézier curves: the chord of an angle is off by 1 - cos(angle / 2) of the radius at most."""
        radius = sqrt(abs(self.right) ** 2 + abs(self.up) ** 2)  # not less than the longer half axis
        widest = 2.0 * acos(max(0.0, 1.0 - tolerance / radius)) if radius > 0.0 else pi
        pieces = _bounded(abs(self.sweep) / widest) if widest > 0.0 else MAX_PIECES
        for piece in range(1, pieces):
            turned = rect(1.0, self.start + self.sweep * piece / pieces)
            yield self.centre + self.right * turned.real + self.up * turned.imag
        yield self.end


def _bounded(pieces: float) -> int:
    return max(1, ceil(min(pieces, MAX_PIECES)))


@dataclass(slots=True)
class Line:
    """Curves that go on from each other, from `start` on, perhaps closed."""

    start: complex
    curves: list[Bezier | Arc] = field(default_factory=list)
    closed: bool = False

    def moved(self, move: Callable[[complex], complex]) -> Line:
        return Line(move(self.start), [curve.moved(move) for curve in self.curves], self.closed)

    def flat(self, tolerance: float) -> Iterator[complex]:
        """Points along it, the start included."""
        yield self.start
        for curve in self.curves:
            yield from curve.flat(tolerance)


def read_path(text: str) -> list[Line]:
    """The lines that a `d` attribute draws. Raises PathError for what is no path."""
    return _Reader(text).read()


class _Reader:
    """Reads one path: `_here` is where the pen is, `_last` the letter before and `_pull` its last pulling point."""

    def __init__(self, text: str) -> None:
        self._text, self._place = text, 0
        self._lines: list[Line] = []
        self._here = 0j
        self._last, self._pull = "", 0j

    def read(self) -> list[Line]:
        letter = ""
        while _MORE.match(self._text, self._place):
            found = _LETTER.match(self._text, self._place)
            if found:
                letter, self._place = found[1], found.end()
            elif not letter or letter in "Zz":
                raise PathError(f"wanted a letter such as L at {self._shown()}")
            if not self._last and letter not in "Mm":
                raise PathError(f'a path begins with M, not "{letter}"')
            self._step(letter)
            self._last = letter.upper()
            letter = {"M": "L", "m": "l"}.get(letter, letter)  # further points of a move are lines
        return self._lines

    def _step(self, letter: str) -> None:
        upper, values = letter.upper(), self._values(letter.upper())
        origin = self._here if letter.islower() else 0j
        if upper == "Z":
            self._lines[-1].closed = True
            self._here = self._lines[-1].start
        elif upper == "M":
            self._here = origin + complex(*values)
            self._lines.append(Line(self._here))
        elif upper == "H":
            self._curve(complex(values[0] + origin.real, self._here.imag))
        elif upper == "V":
            self._curve(complex(self._here.real, values[0] + origin.imag))
        elif upper == "A":
            self._arc(values, origin + complex(values[5], values[6]))
        else:
            points = [origin + complex(*pair) for pair in zip(values[::2], values[1::2], strict=True)]
            if upper in "ST":  # smooth: the first pull mirrors the one before
                smooth = self._last in ("CS" if upper == "S" else "QT")
                points.insert(0, 2.0 * self._here - self._pull if smooth else self._here)
            self._curve(*points)

    def _values(self, letter: str) -> list[float]:
        values = []
        for number in range(_ARGUMENTS[letter]):
            pattern = _FLAG if letter == "A" and number in (3, 4) else _NUMBER
            found = pattern.match(self._text, self._place)
            if not found:
                raise PathError(f"wanted {_ARGUMENTS[letter]} numbers after {letter}, at {self._shown()}")
            value = float(found[1])
            if not isfinite(value) or abs(value) > MAX_NUMBER:
                raise PathError(f"{found[1][:20]} is too far away: at most {MAX_NUMBER:g}")
            values.append(value)
            self._place = found.end()
        return values

    def _curve(self, *points: complex) -> None:
        self._draw(Bezier((self._here, *points)))
        self._pull = points[-2] if len(points) > 1 else points[-1]
        self._here = points[-1]

    def _arc(self, values: list[float], end: complex) -> None:
        if end != self._here:
            across, up, turn, large, sweep = values[:5]
            drawn = arc_between(self._here, end, abs(across), abs(up), radians(turn), large > 0.0, sweep > 0.0)
            self._draw(drawn)
        self._here = end

    def _draw(self, curve: Bezier | Arc) -> None:
        if self._lines[-1].closed:  # goes on from where the closed one began
            self._lines.append(Line(self._here))
        self._lines[-1].curves.append(curve)

    def _shown(self) -> str:
        rest = self._text[self._place :].strip()
        return f'"{rest[:20]}"' if rest else "its end"


def arc_between(
    start: complex, end: complex, across: float, up: float, turn: float, large: bool, sweep: bool
) -> Arc | Bezier:
    """The arc from `start` to `end` of an ellipse with the half axes `across` and `up`, turned by `turn` rad: the
    `large` part or the small one, with growing angles (`sweep`) or falling ones. A line where an axis is 0."""
    if not across or not up:
        return Bezier((start, end))
    turned = rect(1.0, turn)
    # In a frame where the ellipse is a circle of radius 1, half of the chord, and the middle's way to the centre.
    half = (start - end) / 2.0 / turned
    chord = complex(half.real / across, half.imag / up)
    if abs(chord) > 1.0:  # too small for its ends: it grows until it just reaches them
        across, up, chord = across * abs(chord), up * abs(chord), chord / abs(chord)
    away = sqrt(max(0.0, 1.0 / abs(chord) ** 2 - 1.0)) * (1.0 if large != sweep else -1.0)
    middle = complex(chord.imag, -chord.real) * away
    first, last = phase(chord - middle), phase(-chord - middle)
    through = (last - first) % (2.0 * pi)
    centre = (start + end) / 2.0 + complex(middle.real * across, middle.imag * up) * turned
    return Arc(centre, across * turned, up * 1j * turned, first, through if sweep else through - 2.0 * pi, end)
