"""Styles of SVG elements: what the style sheets of a drawing, and elements themselves, say of how they look.

A sheet's rules are read if their selectors are names of elements, classes, ids and `*`, one after another or inside one
another (`.a .b`, `.a > .b`). A rule with another selector is refused if it says something that counts here. Where
several rules say something, the order is CSS's: `!important`, then the more exact selector, then the later one; a
`style` attribute comes after rules, and other attributes before them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from functools import lru_cache
from typing import Any, NamedTuple

import tinycss2
from tinycss2.color4 import parse_color

from sleepcast.core.records import dataclass
from sleepcast.simulator.world.svg import Matrix, PathError, css_transform, transform

PROPERTIES = (
    *("display", "fill", "fill-opacity", "fill-rule", "opacity", "transform", "transform-origin", "visibility"),
)
"""What counts here; all else a style may say is for the eye alone."""
STROKE = "stroke"
"""What also counts where an element itself says it, and no style sheet says anything of strokes."""
SIZES = ("cx", "cy", "d", "height", "r", "rx", "ry", "width", "x", "y")
"""What makes a shape another one, and is only read from its attributes."""
MOVES = ("offset-path", "rotate", "scale", "transform-box", "translate")
"""What moves an element, and is not read."""
HARMLESS = ("auto", "none", "view-box")
"""Values of these that change nothing."""
ON_SCREENS = re.compile(r"(only\s+)?(all|screen)", re.IGNORECASE)
"""Media that an upright drawing on a screen is one of."""
ELSEWHERE = re.compile(r"(only\s+)?(print|speech)|\(prefers-color-scheme:\s*dark\)", re.IGNORECASE)
"""Media that it is none of."""
MAX_PARTS = 10_000
"""Parts of all selectors of a drawing."""
MAX_NESTED = 64
"""Brackets in brackets of a style: whoever reads them calls itself for each."""
MAX_VARIABLE = 200
"""Characters of a value with a variable."""
MAX_TRIES = 10_000_000
"""Comparisons of elements with parts of selectors: some ten seconds of them."""
NEVER = ("active", "focus", "hover", "visited", "selection", "before", "after", "first-line", "first-letter")
"""States and additions that no element of a drawing at rest has."""
CONDITIONS = ("container", "layer", "media", "scope", "supports")
"""Rules around rules, which make them count in some cases, or less than others."""

_BRACKET = re.compile(r"[()\[\]{}]")
_VARIABLE = re.compile(r"var\(\s*--[^\s,()]+\s*(?:,([^()]*(?:\([^()]*\))?[^()]*))?\)", re.IGNORECASE)
_SAYS_STROKE = re.compile(r"\bstroke\s*:", re.IGNORECASE)
_SAYS_VARIABLE = re.compile(r"(?:^|[;{])\s*--[^\s:;]+\s*:")

Style = dict[str, str]
"""Values by property."""


class Declared(NamedTuple):
    """What a rule or a `style` attribute says: properties with values, and which of them are important."""

    normal: Mapping[str, str]
    important: Mapping[str, str]


@dataclass(slots=True)
class _Part:
    """One part of a selector, `path#door.wall`.

    follows: the part before it " " anywhere inside, ">" directly inside; "" for the first one
    number: among all parts of a drawing's selectors
    exact: CSS's specificity up to here
    ends: what the rules say whose selector ends here, with their numbers
    """

    name: str
    ids: frozenset[str]
    classes: frozenset[str]
    follows: str
    number: int
    exact: tuple[int, int, int]
    ends: list[tuple[int, Declared]] = field(default_factory=list)

    def fits(self, name: str, own: str, classes: frozenset[str]) -> bool:
        return self.name in ("", name) and self.ids <= {own} and self.classes <= classes


class Match(NamedTuple):
    """Which parts of selectors, as bits, an element fits, and which any of those around it does."""

    here: int = 0
    around: int = 0


class StyleSheets:
    """All rules of one drawing."""

    def __init__(self) -> None:
        self._parts: list[_Part] = []
        self._by: dict[str, list[_Part]] = {}
        """By the id, class or name that an element needs, as "#door", ".wall", "path", or "*"."""
        self._rules = self._tries = 0
        self._variables = False
        """Whether anything is said of CSS's variables, whose values are not followed."""
        self._strokes = False
        """Whether anything is said of strokes, so that an element may have another one than it says."""

    def add(self, sheet: str, line: int) -> None:
        """Read a style sheet that begins in this line of the file. Raises StyleError."""
        if (place := _too_deep(sheet)) >= 0:
            raise StyleError(line + sheet.count("\n", 0, place), f"more than {MAX_NESTED} brackets in brackets")
        self._strokes |= _SAYS_STROKE.search(sheet) is not None
        self._add(tinycss2.parse_stylesheet(sheet, skip_comments=True, skip_whitespace=True), line)

    def style_of(self, name: str, attributes: Mapping[str, str], outer: Match) -> tuple[Style, Match]:
        """What is said of an element, and which parts of selectors it fits. outer: those of the element around it.
        Raises PathError where there is too much to compare."""
        style = {key: attributes[key] for key in (*PROPERTIES, STROKE) if key in attributes}
        if any(_too_deep(each) >= 0 for each in (*style.values(), attributes.get("style", ""))):
            raise PathError(f"style: more than {MAX_NESTED} brackets in brackets")
        match, said = self._match(name, attributes, outer)
        own = _declared(attributes.get("style", ""))
        for each in (*said, own):
            style |= each.normal
        for each in (*said, own):
            style |= each.important
        _refuse_unread(name, style)
        stroke = style.pop(STROKE, "")
        self._variables |= bool(_SAYS_VARIABLE.search(attributes.get("style", "")))
        settled = {key: _settled(key, value, variables=self._variables) for key, value in style.items()}
        return settled | ({STROKE: stroke.strip()} if stroke and not self._strokes else {}), match

    def _match(self, name: str, attributes: Mapping[str, str], outer: Match) -> tuple[Match, list[Declared]]:
        if not self._parts:
            return outer, []
        own, classes = attributes.get("id", ""), frozenset(attributes.get("class", "").split())
        keys = dict.fromkeys(("*", name, f"#{own}", *(f".{each}" for each in sorted(classes))))
        candidates = sorted((part for key in keys for part in self._by.get(key, ())), key=lambda part: part.number)
        self._tries += len(candidates)
        if self._tries > MAX_TRIES:
            raise PathError("its style sheets have too many rules for so many elements: leave some out")
        here, ends = 0, list[tuple[tuple[int, int, int], int, Declared]]()
        for part in candidates:
            before = {"": -1, " ": outer.around << 1, ">": outer.here << 1}[part.follows]
            if before >> part.number & 1 and part.fits(name, own, classes):
                here |= 1 << part.number
                ends += [(part.exact, number, said) for number, said in part.ends]
        ends.sort(key=lambda each: each[:2])
        return Match(here, outer.around | here), [said for *_, said in ends]

    def _add(self, rules: Iterable[Any], line: int) -> None:
        for rule in rules:
            at = line + rule.source_line - 1
            if rule.type == "qualified-rule":
                self._rule(rule, at)
            elif rule.type == "at-rule" and rule.lower_at_keyword == "import":
                raise StyleError(at, "a style sheet in another file, which is not opened: put its rules here")
            elif rule.type == "at-rule" and rule.content and rule.lower_at_keyword in CONDITIONS:
                inside = tinycss2.parse_rule_list(rule.content, skip_comments=True, skip_whitespace=True)
                if _holds(rule, inside, at):
                    self._add(inside, line)

    def _rule(self, rule: Any, line: int) -> None:
        said = _declarations(tinycss2.parse_blocks_contents(rule.content))
        self._variables |= bool(_SAYS_VARIABLE.search(tinycss2.serialize(rule.content)))
        if not said.normal and not said.important:
            return
        self._rules += 1
        for selector in _split(rule.prelude, ","):
            parts = _parts(selector, line)
            if parts:
                self._keep(parts, said, line)

    def _keep(self, parts: Sequence[tuple[str, list[str], list[str], str]], said: Declared, line: int) -> None:
        if len(self._parts) + len(parts) > MAX_PARTS:
            raise StyleError(line, f"more than {MAX_PARTS} parts of selectors: leave some out")
        exact = (0, 0, 0)
        for name, ids, classes, follows in parts:
            exact = exact[0] + len(ids), exact[1] + len(classes), exact[2] + bool(name)
            part = _Part(name, frozenset(ids), frozenset(classes), follows, len(self._parts), exact)
            self._parts.append(part)
            key = f"#{ids[0]}" if ids else f".{classes[0]}" if classes else name or "*"
            self._by.setdefault(key, []).append(part)
        part.ends.append((self._rules, said))


def _holds(rule: Any, inside: Sequence[Any], line: int) -> bool:
    """Whether a condition around rules holds. Raises StyleError for one that is not read, if it matters."""
    said = tinycss2.serialize(rule.prelude).strip()
    media = [each.strip() for each in said.split(",")] if rule.lower_at_keyword == "media" else []
    if any(map(ON_SCREENS.fullmatch, media)):
        return True
    if (media and all(map(ELSEWHERE.fullmatch, media))) or not any(map(_matters, inside)):
        return False
    raise StyleError(
        line,
        f'the condition "@{rule.lower_at_keyword} {said[:60]}" is not read: put its rules outside, or leave them out',
    )


def _matters(rule: Any) -> bool:
    """Whether a rule, or one in it, says anything that counts here."""
    if rule.type == "at-rule":
        return bool(rule.content) and any(map(_matters, tinycss2.parse_rule_list(rule.content)))
    if rule.type != "qualified-rule":
        return False
    said = _declarations(tinycss2.parse_blocks_contents(rule.content))
    return bool(said.normal or said.important)


class StyleError(ValueError):
    """A style that is not read; the text is a sentence without its place. line: in the file."""

    def __init__(self, line: int, sentence: str) -> None:
        super().__init__(sentence)
        self.line = line


# ---- selectors


def _parts(selector: Sequence[Any], line: int) -> list[tuple[str, list[str], list[str], str]]:
    """Names, ids, classes and how they follow, part by part; none for a selector that fits no element of a drawing at
    rest. Raises StyleError for one that is not read."""
    parts: list[tuple[str, list[str], list[str], str]] = []
    shown, follows, fresh = tinycss2.serialize(selector).strip(), "", True
    tokens = [*_without_space(selector)]
    while tokens:
        token = tokens.pop(0)
        if token.type == "whitespace" or token == ">":
            follows, fresh = ">" if token == ">" or follows == ">" else " ", True
            continue
        if token == ":":
            state = next((each for each in tokens if each.type == "ident"), None)
            if state is not None and state.lower_value in NEVER:
                return []
        if fresh:
            parts.append(("", [], [], follows if parts else ""))
            fresh, follows = False, ""
        name, ids, classes, before = parts[-1]
        if token.type == "ident" and not (name or ids or classes):
            parts[-1] = (token.value, ids, classes, before)
        elif token.type == "hash":
            ids.append(token.value)
        elif token == "." and tokens and tokens[0].type == "ident":
            classes.append(tokens.pop(0).value)
        elif token != "*":
            raise StyleError(
                line, f'the selector "{shown[:60]}" is not read: wanted names, .classes, #ids, or * for all elements'
            )
    if fresh:
        raise StyleError(line, f'the selector "{shown[:60]}" is none: something is missing at its end')
    return parts


def _without_space(selector: Sequence[Any]) -> Iterator[Any]:
    """Without comments, and without blanks at both ends."""
    rest = [token for token in selector if token.type != "comment"]
    while rest and rest[0].type == "whitespace":
        rest.pop(0)
    while rest and rest[-1].type == "whitespace":
        rest.pop()
    return iter(rest)


def _split(tokens: Sequence[Any], mark: str) -> list[list[Any]]:
    pieces: list[list[Any]] = [[]]
    for token in tokens:
        if token == mark:
            pieces.append([])
        else:
            pieces[-1].append(token)
    return pieces


# ---- declarations


def _too_deep(text: str) -> int:
    """Where there are too many brackets in brackets; -1 for nowhere. Those in comments and strings count, too."""
    depth = 0
    for bracket in _BRACKET.finditer(text):
        depth = max(depth + (1 if bracket[0] in "([{" else -1), 0)
        if depth > MAX_NESTED:
            return bracket.start()
    return -1


@lru_cache(maxsize=4_096)
def _declared(text: str) -> Declared:
    """What a `style` attribute says."""
    return _declarations(tinycss2.parse_blocks_contents(text), STROKE) if text else Declared({}, {})


def _declarations(declared: Iterable[Any], *more: str) -> Declared:
    """more: properties that are read besides those that rules are read for."""
    declared_values = Declared({}, {})
    for each in declared:
        if each.type == "declaration" and each.lower_name in (*PROPERTIES, *SIZES, *MOVES, *more):
            value = tinycss2.serialize(each.value).strip()
            if each.lower_name != "fill" or is_paint(value):
                (declared_values.important if each.important else declared_values.normal)[each.lower_name] = value  # type: ignore[index]
    return declared_values


# ---- values


def _refuse_unread(name: str, said: Mapping[str, str]) -> None:
    """Raise PathError for a style that is not read and would move or reshape an element. name: of the element."""
    for key in MOVES if name in ("svg", "g", "a", "switch") else (*SIZES, *MOVES):
        if key in said and said[key].casefold() not in HARMLESS:
            raise PathError(f"style: {key} is not read there: write it as an attribute or into the transform")


def _settled(key: str, value: str, *, variables: bool) -> str:
    """A value, or what stands in it for a variable that nobody has said. variables: whether some are said. Raises
    PathError."""
    if "var(" not in value.casefold():
        return value.strip()
    match = _VARIABLE.fullmatch(value.strip()[:MAX_VARIABLE])
    if match is None or variables:
        raise PathError(f'{key}: "{value[:40]}" is not read: write the value itself, without a variable')
    return (match[1] or "inherit").strip()


@lru_cache(maxsize=4_096)
def is_paint(text: str) -> bool:
    """Whether this is a value of `fill`; any other one says nothing."""
    plain = text.strip().casefold()
    return (
        plain in ("none", "inherit") or plain.startswith(("url(", "context-", "var(")) or parse_color(text) is not None
    )


@lru_cache(maxsize=4_096)
def is_filled(text: str) -> bool:
    """Whether a value of `fill` fills anything: not "none", and no colour that cannot be seen at all."""
    if text.strip().casefold() == "none":
        return False
    colour = parse_color(text)
    return colour is None or isinstance(colour, str) or colour.alpha > 0.0


def share(text: str) -> float:
    """An opacity; 1 for a text that is none."""
    try:
        number = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        return 1.0
    return min(max(number, 0.0), 1.0)


def matrix_of(style: Mapping[str, str], attributes: Mapping[str, str]) -> Matrix:
    """The transform of an element: that of its style, else that of its attribute. Raises PathError."""
    said = style.get("transform", "")
    if not said or said == attributes.get("transform", "").strip():
        matrix = transform(attributes.get("transform", ""))
    else:
        matrix = css_transform(said)
    origin = style.get("transform-origin", "")
    return matrix if not origin or matrix == Matrix() else _around(matrix, origin)


def _around(matrix: Matrix, origin: str) -> Matrix:
    try:
        sizes = [css_transform(f"translate({each})") for each in origin.split()[:2]]
    except PathError:
        raise PathError(
            f'transform-origin: "{origin[:20]}" is not read: wanted two lengths, such as 10px 20px'
        ) from None
    x, y = sizes[0].e, sizes[-1].e if len(sizes) > 1 else 0.0
    return Matrix(e=x, f=y).after(matrix).after(Matrix(e=-x, f=-y))
