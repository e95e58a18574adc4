"""Lines over the number of robots, both axes logarithmic, as an SVG file that follows the reader's light or dark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import ceil, floor, log10
from pathlib import Path

WIDTH, HEIGHT = 760, 430
LEFT, RIGHT, TOP, BOTTOM = 66, 215, 44, 46
"""Pixels round the field of the chart; the names of the lines stand on the right."""
APART = 15
"""Pixels between two names."""
COLOURS = ("#2f7fe6", "#259b50", "#d0761f", "#b84bc9", "#e0483f", "#7d8896", "#1595ab", "#7a9a21")
"""Of the lines, to be read on white and on black."""
STYLE = """
.paper { fill: #ffffff } .ink { fill: #1f2328 } .faint { stroke: #d5d9de } .bar { stroke: #6b7280 }
@media (prefers-color-scheme: dark) {
  .paper { fill: #0d1117 } .ink { fill: #e6edf3 } .faint { stroke: #30363d } .bar { stroke: #9aa4af }
}
text { font: 12px system-ui, sans-serif } .title { font-size: 14px; font-weight: 600 }
"""


@dataclass(frozen=True)
class Line:
    """A named line through (robots, value). wanted: a line that others are to stay above: drawn dashed."""

    name: str
    points: Sequence[tuple[float, float]]
    wanted: bool = False


class _Frame:
    """Where a value is drawn."""

    def __init__(self, lines: Sequence[Line]) -> None:
        across = [log10(x) for line in lines for x, _ in line.points]
        up = [log10(y) for line in lines for _, y in line.points]
        self.left, self.right = floor(min(across)), max(ceil(max(across)), floor(min(across)) + 1)
        self.bottom, self.top = floor(min(up)), max(ceil(max(up)), floor(min(up)) + 1)

    def x(self, value: float) -> float:
        return LEFT + (log10(value) - self.left) / (self.right - self.left) * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        return HEIGHT - BOTTOM - (log10(value) - self.bottom) / (self.top - self.bottom) * (HEIGHT - TOP - BOTTOM)


def draw(path: Path, title: str, across: str, up: str, lines: Sequence[Line]) -> None:
    """Write the chart. across, up: what the axes show. All values must be positive."""
    lines = [line for line in lines if line.points]
    frame = _Frame(lines)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">',
        f"<title>{escape(title)}</title><style>{STYLE}</style>",
        f'<rect class="paper" width="{WIDTH}" height="{HEIGHT}"/>',
        f'<text class="ink title" x="{LEFT}" y="24">{escape(title)}</text>',
        *_grid(frame),
        f'<text class="ink" x="{(LEFT + WIDTH - RIGHT) / 2:.0f}" y="{HEIGHT - 8}" text-anchor="middle">{escape(across)}'
        "</text>",
        f'<text class="ink" transform="translate(14 {(TOP + HEIGHT - BOTTOM) / 2:.0f}) rotate(-90)" '
        f'text-anchor="middle">{escape(up)}</text>',
        *_lines(frame, lines),
        "</svg>",
    ]
    path.write_text("\n".join(out) + "\n")


def _grid(frame: _Frame) -> list[str]:
    out = []
    for power in range(frame.left, frame.right + 1):
        x = frame.x(10.0**power)
        out.append(f'<path class="faint" d="M{x:.1f} {TOP}V{HEIGHT - BOTTOM}"/>')
        out.append(
            f'<text class="ink" x="{x:.1f}" y="{HEIGHT - BOTTOM + 17}" text-anchor="middle">{_named(power)}</text>'
        )
    for power in range(frame.bottom, frame.top + 1):
        y = frame.y(10.0**power)
        out.append(f'<path class="faint" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>')
        out.append(f'<text class="ink" x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{_named(power)}</text>')
    return out


def _named(power: int) -> str:
    return f"{10**power:,}" if power >= 0 else f"{10.0**power:.{-power}f}"


def _lines(frame: _Frame, lines: Sequence[Line]) -> list[str]:
    """The lines, and their names beside their ends, pushed apart where they would overlap."""
    out = []
    lowest = 0.0
    for line in sorted(lines, key=lambda line: frame.y(line.points[-1][1])):
        colour = COLOURS[lines.index(line) % len(COLOURS)]
        points = [(frame.x(x), frame.y(y)) for x, y in line.points]
        path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
        if line.wanted:
            out.append(f'<path class="bar" d="{path}" fill="none" stroke-dasharray="5 4"/>')
        else:
            out.append(f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
            out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in points]
        name_y = max(points[-1][1] + 4, lowest + APART)
        lowest = name_y
        fill = 'class="ink"' if line.wanted else f'fill="{colour}"'
        out.append(f'<text {fill} x="{WIDTH - RIGHT + 10}" y="{name_y:.1f}">{escape(line.name)}</text>')
    return out
