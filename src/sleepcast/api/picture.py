"""A picture of a swarm for notebooks, as SVG in HTML: world, places, robots by their groups, and a legend.

Groups differ by colour and by shape, so that neither has to be told by the other alone. The colours are told apart on
light and on dark pages.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from sleepcast.loop import Swarm
from sleepcast.simulator import Area, Circle, Polygon, Shape, Wall

WIDTH, HEIGHT = 640.0, 480.0
"""Pixels at most."""
MOST = 2_000
"""Robots drawn; of more, so many at equal steps through their numbers, or a page of notebooks would be slow."""
SMALLEST = 4.0
"""Pixels: half a robot's length at least."""
NO_GROUP, GROUPS = "#7a8b9c", ("#d9622b", "#3b7de0", "#1f9d78", "#c04fb7", "#a07a12", "#7d63e0", "#d23f66")


def picture(swarm: Swarm, caption: str) -> str:
    """The swarm as it is now. caption: stands below."""
    scenario, simulator = swarm.simulator.scenario, swarm.simulator
    scale = min(WIDTH / scenario.width, HEIGHT / scenario.height)
    wide, high = scenario.width * scale, scenario.height * scale
    size = max(SMALLEST, scenario.robots.geometry.radius * scale)
    shown = np.arange(0, len(simulator.names), max(1, -(-len(simulator.names) // MOST)))
    codes, groups = _groups(swarm)
    parts = [_ground(shape, scale, high) for shape in simulator.world.shapes.values()]
    for code in range(len(groups) + 1):
        of_code = shown[codes[shown] == code]
        shapes = "".join(
            _robot(code, x * scale, high - y * scale, size, -heading)
            for x, y, heading in zip(
                simulator.x[of_code].tolist(),
                simulator.y[of_code].tolist(),
                simulator.bodies.heading[of_code].tolist(),
                strict=True,
            )
        )
        if shapes:
            parts.append(f'<path d="{shapes}" fill="{_colour(code)}"/>')
    parts += [
        f'<text x="{place.x * scale:.1f}" y="{high - place.y * scale:.1f}" font-size="11" fill="currentColor" '
        f'text-anchor="middle">&#9733; {escape(place.title)}</text>'
        for place in scenario.places
    ]
    legend = _legend(groups)
    if len(shown) < len(simulator.names):
        legend.append(f"<span>{len(shown):,} of {len(simulator.names):,} robots are drawn</span>")
    return (
        f'<div style="font: 13px system-ui, sans-serif"><svg viewBox="0 0 {wide:.0f} {high:.0f}" width="{wide:.0f}" '
        f'height="{high:.0f}" style="max-width: 100%; height: auto; border: 1px solid currentColor" role="img" '
        f'aria-label="{escape(caption)}">{"".join(parts)}</svg>'
        f'<div style="display: flex; flex-wrap: wrap; gap: 4px 16px">{"".join(legend)}</div>'
        f"<div>{escape(caption)}</div></div>"
    )


def _groups(swarm: Swarm) -> tuple[NDArray[np.intp], dict[str, int]]:
    """The number of each robot's newest group, from 1 (0: none), and the groups in turn, with how many are in each."""
    codes, groups = np.zeros(len(swarm.fleet), np.intp), dict[str, int]()
    for key, members in swarm.fleet.groups.items():
        if members.any():
            declared = swarm.fleet.declared(key)
            groups[key if declared is None else declared.name] = int(members.sum())
            codes[members] = len(groups)
    return codes, groups


def _colour(code: int) -> str:
    return GROUPS[(code - 1) % len(GROUPS)] if code else NO_GROUP


def _legend(groups: Mapping[str, int]) -> list[str]:
    return [
        f'<span><svg width="14" height="14" viewBox="-7 -7 14 14"><path d="{_robot(code, 0.0, 0.0, 4.5, 0.0)}" '
        f'fill="{_colour(code)}"/></svg> {escape(name)}: {count:,}</span>'
        for code, (name, count) in enumerate(groups.items(), 1)
    ]


def _ground(shape: Shape, scale: float, high: float) -> str:
    """A solid thing, in pixels."""

    def points(corners: Sequence[tuple[float, float]]) -> str:
        return " ".join(f"{x * scale:.1f},{high - y * scale:.1f}" for x, y in corners)

    match shape:
        case Circle():
            return (
                f'<circle cx="{shape.x * scale:.1f}" cy="{high - shape.y * scale:.1f}" r="{shape.radius * scale:.1f}" '
                'fill="currentColor" opacity="0.3"/>'
            )
        case Polygon():
            return f'<polygon points="{points(shape.corners)}" fill="currentColor" opacity="0.3"/>'
        case Area():
            outlines = "".join(f"M{points(outline)}Z" for outline in shape.outlines)
            return f'<path d="{outlines}" fill="currentColor" fill-rule="evenodd" opacity="0.3"/>'
        case Wall():
            return f'<polyline points="{points(shape.points)}" fill="none" stroke="currentColor" opacity="0.6"/>'


def _polygon(count: int, first: float, size: float) -> list[tuple[float, float]]:
    """The corners of a regular polygon, the first at an angle (rad)."""
    angles = first + np.arange(count) * 2.0 * np.pi / count
    return list(zip((size * np.cos(angles)).tolist(), (size * np.sin(angles)).tolist(), strict=True))


_ARROW = ((1.35, 0.0), (-0.9, 0.8), (-0.45, 0.0), (-0.9, -0.8))
_BODIES = (
    _polygon(4, 0.0, 1.35),
    _polygon(4, np.pi / 4, 1.3),
    _polygon(12, 0.0, 1.05),
    _polygon(5, -np.pi / 2, 1.3),
    _polygon(3, -np.pi / 2, 1.45),
    _polygon(6, 0.0, 1.25),
    _polygon(3, np.pi / 2, 1.45),
)
"""Corners of a robot that looks along x, and of robots in groups, which do not turn."""


def _robot(code: int, x: float, y: float, size: float, heading: float) -> str:
    """The outline of a robot as a path. heading: rad, clockwise, as pixels are counted downwards."""
    cos, sin = (size * np.cos(heading), size * np.sin(heading)) if code == 0 else (size, 0.0)
    body = _BODIES[(code - 1) % len(_BODIES)] if code else _ARROW
    corners = (f"{x + a * cos - b * sin:.1f} {y + a * sin + b * cos:.1f}" for a, b in body)
    return f"M{'L'.join(corners)}Z"
