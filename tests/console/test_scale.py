"""One scale of type, one of spacing and one palette, in every style sheet of the page; and text that can be read."""

from __future__ import annotations

import re
from itertools import product

import pytest

from console.test_colours import STATIC, THEMES, contrast

SHEETS = sorted(sheet for sheet in STATIC.rglob("*.css") if "vendor" not in sheet.parts)
RULE = re.compile(r"([\w-]+):\s*([^;{}]+);")
SIZED = re.compile(r"font|font-size|(?:padding|margin)(?:-\w+)*|(?:row-|column-)?gap")
LENGTH = re.compile(r"(?<![\w.-])-?(\d*\.?\d+)(px|rem|em|pt|ch)\b")
COLOUR = re.compile(r"#[0-9a-fA-F]{3,8}\b|\b(?:rgb|hsl|oklch|lab)a?\(")
HAIRLINE = 4.0
"""Pixels up to which a length belongs to a drawn shape."""

TEXT = ("ink", "muted", "faint", "accent", "good", "bad", "warn", "alternate")
PAIRS = [
    *product(TEXT, ("panel", "sunk", "page")),
    *product(("ink", "muted", "faint", "accent", "good", "bad", "warn"), ("accent-soft",)),
    ("ink", "bad-soft"),
    ("bad", "bad-soft"),
    ("warn", "warn-soft"),
    ("muted", "warn-soft"),
    *product(("panel",), ("accent", "good", "bad", "warn", "muted", "ink")),
    *product(("on-stop",), ("stop", "stop-deep")),
    ("robot-4", "sunk"),
]
"""Text and what it stands on; `robot-4` is the colour of numbers in the prompt."""


def rules(css: str) -> list[tuple[str, str]]:
    return RULE.findall(re.sub(r"/\*.*?\*/", "", css, flags=re.DOTALL).replace("}", ";}"))


def raw(value: str) -> list[str]:
    """The lengths in it that are neither a step of a scale nor a hairline."""
    return [found[0] for found in LENGTH.finditer(value) if found[2] != "px" or float(found[1]) > HAIRLINE]


def outside(css: str) -> list[str]:
    """What a sheet says past the scales and the palette."""
    found = []
    for name, value in rules(css):
        root = name == "font-size" and value.startswith("clamp(")  # what the steps are measured in
        if SIZED.fullmatch(name) and not root and raw(value):
            found.append(f"{name}: {value}")
        if not name.startswith("--") and COLOUR.search(value):
            found.append(f"{name}: {value}")
    return found


def test_sizes_and_colours_are_steps_of_the_scales() -> None:
    found = {sheet.name: outside(sheet.read_text(encoding="utf-8")) for sheet in SHEETS}
    assert {name: said for name, said in found.items() if said} == {}


def test_what_is_outside_the_scales_is_found() -> None:
    css = "a { font-size: .93rem; padding: 0 var(--space-2) 7px; margin: -1px; color: #fff } b { font: 12px/1.2 serif }"
    found = ["font-size: .93rem", "padding: 0 var(--space-2) 7px", "color: #fff ", "font: 12px/1.2 serif "]
    assert outside(css) == found


@pytest.mark.parametrize("name", THEMES)
def test_text_is_read_on_what_it_stands_on(name: str) -> None:
    theme = THEMES[name]
    bad = {pair: round(contrast(theme[pair[0]], theme[pair[1]]), 2) for pair in PAIRS}
    assert {pair: found for pair, found in bad.items() if found < 4.5} == {}
