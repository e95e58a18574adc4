"""Attributes of SVG: lengths, transforms, the size of the page, and which fill is said where."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import cos, isfinite, radians, sin, tan
from typing import NamedTuple

from sleepcast.simulator.world.svg_paths import MAX_NUMBER, PathError

PIXEL = 0.0254 / 96.0
"""m: of what SVG calls px, its unit without a name."""
UNITS = {"": 1.0, "px": 1.0, "pt": 4 / 3, "pc": 16.0, "in": 96.0, "cm": 96 / 2.54, "mm": 9.6 / 2.54, "Q": 2.4 / 2.54}
"""Of SVG, in px."""
ON_SCREEN = ("", "px")
"""Units that do not say how large something really is."""

_NUMBER = re.compile(r"[+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+")
_LENGTH = re.compile(rf"\s*({_NUMBER.pattern})\s*([A-Za-z%]*)\s*")
_LIST = re.compile(rf"[\s,]*(?:{_NUMBER.pattern}[\s,]*+)*+")
_TRANSFORM = re.compile(r"[\s,]*(\w+)\s*\(([^()]*)\)[\s,]*")


class Matrix(NamedTuple):
    """Takes x, y to a x + c y + e, b x + d y + f; points are complex numbers."""

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
        """What comes of `first` and then this one."""
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
        """By what circles grow; None where they do not stay circles."""
        right, up = complex(self.a, self.b), complex(self.c, self.d)
        same = abs(abs(right) - abs(up)) + abs((right * up.conjugate()).real) / max(abs(right), 1e-300)
        return abs(right) if same <= 1e-9 * abs(right) else None


class Page(NamedTuple):
    """The part of the drawing that is seen: its least x and y, width and height, in units of the drawing; and how many
    m one of these is, None where the file does not say it."""

    x: float
    y: float
    width: float
    height: float
    unit: float | None


def page_of(attributes: Mapping[str, str]) -> Page:
    """The page that the outermost element says. Raises PathError if it says none."""
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
        raise PathError("how large its page is it does not say: wanted a viewBox, or width and height")
    if not (page.width > 0.0 and page.height > 0.0):
        raise PathError("its page is empty: wanted a width and a height above 0")
    return page


def sized(text: str) -> tuple[float, str] | None:
    """A length in px and its unit; None for none, or for a share of something."""
    found = _LENGTH.fullmatch(text)
    if found is None or found[2] not in UNITS:
        return None
    return _bounded(found[1]) * UNITS[found[2]], found[2]


def length(attributes: Mapping[str, str], key: str, default: float = 0.0) -> float:
    """The length under `key` in units of the drawing. Raises PathError for what is none."""
    if key not in attributes:
        return default
    found = sized(attributes[key])
    if found is None:
        raise PathError(
            f'{key}="{attributes[key][:20]}" is no length: wanted a number, plain or in {", ".join(UNITS)[2:]}'
        )
    return found[0]


def numbers(text: str, what: str, count: int | None = None) -> list[float]:
    """The numbers in `text`, so many of them if it is said. Raises PathError for anything else."""
    found = _NUMBER.findall(text) if _LIST.fullmatch(text) else None
    if found is None or (count is not None and len(found) != count):
        raise PathError(f'{what}: wanted {"" if count is None else f"{count} "}numbers, not "{text[:20]}"')
    return [_bounded(each) for each in found]


def _bounded(text: str) -> float:
    value = float(text)
    if not isfinite(value) or abs(value) > MAX_NUMBER:
        raise PathError(f"{text[:20]} is too large: at most {MAX_NUMBER:g}")
    return value


def transform(text: str) -> Matrix:
    """The matrix that a `transform` attribute says. Raises PathError for what is none."""
    found, place = Matrix(), 0
    while place < len(text):
        match = _TRANSFORM.match(text, place)
        if match is None or match[1] not in _STEPS:
            raise PathError(f'transform: wanted {", ".join(_STEPS)}, not "{text[place : place + 20]}"')
        values = numbers(match[2], match[1])
        if len(values) not in _STEPS[match[1]]:
            raise PathError(f'transform: {match[1]} takes {_STEPS[match[1]][-1]} numbers, not "{match[2][:20]}"')
        found = found.after(_step(match[1], values))
        place = match.end()
    return found


_STEPS = {
    "matrix": (6,),
    "translate": (1, 2),
    "scale": (1, 2),
    "rotate": (1, 3),
    "skewX": (1,),
    "skewY": (1,),
}
"""Of how many numbers each sort of transform is made."""


def _step(sort: str, values: list[float]) -> Matrix:
    first = values[0]
    if sort == "matrix":
        return Matrix(*values)
    if sort == "translate":
        return Matrix(e=first, f=values[1] if len(values) == 2 else 0.0)
    if sort == "scale":
        return Matrix(a=first, d=values[1] if len(values) == 2 else first)
    if sort == "skewX":
        return Matrix(c=tan(radians(first)))
    if sort == "skewY":
        return Matrix(b=tan(radians(first)))
    turn = Matrix(cos(radians(first)), sin(radians(first)), -sin(radians(first)), cos(radians(first)))
    if len(values) == 1:
        return turn
    return Matrix(e=values[1], f=values[2]).after(turn).after(Matrix(e=-values[1], f=-values[2]))


def style_of(attributes: Mapping[str, str], classes: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """What an element says of its looks: attributes, then its classes, then its own `style`, the last one holds."""
    said = {key: attributes[key] for key in ("fill", "display", "visibility") if key in attributes}
    for name in attributes.get("class", "").split():
        said |= classes.get(name, {})
    return {key: value.strip().casefold() for key, value in (said | declarations(attributes.get("style", ""))).items()}


def rules(sheet: str) -> dict[str, dict[str, str]]:
    """What a style sheet says of each class; other rules are passed over."""
    found: dict[str, dict[str, str]] = {}
    for rule in _without_comments(sheet).split("}"):
        selectors, _, said = rule.rpartition("{")
        for selector in selectors.rpartition("{")[2].split(","):
            if selector.strip().startswith("."):
                found.setdefault(selector.strip()[1:], {}).update(declarations(said))
    return found


def _without_comments(sheet: str) -> str:
    first, *others = sheet.split("/*")
    return first + "".join(each.partition("*/")[2] for each in others)


def declarations(text: str) -> dict[str, str]:
    """`fill: none; stroke: red` by name."""
    pairs = (part.split(":", 1) for part in text.split(";") if ":" in part)
    return {key.strip(): value.strip() for key, value in pairs}
