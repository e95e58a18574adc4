"""A picture of a swarm, as SVG and for notebooks: world, places, lights, robots by their groups, and a legend.

Groups differ by colour and by shape, so that neither has to be told by the other alone. The colours are told apart on
light and on dark pages.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple

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
SMALL, ROOM = 8, 10
"""Robots that need less than this part of the world's width and height are drawn closer, with so many radii of a body
around them."""
NO_GROUP, GROUPS = "#7a8b9c", ("#d9622b", "#3b7de0", "#1f9d78", "#c04fb7", "#a07a12", "#7d63e0", "#d23f66")


def picture(swarm: Swarm, caption: str) -> str:
    """The swarm as it is now, as HTML. caption: stands below."""
    _, groups = _groups(swarm)
    legend = _legend(groups)
    count = len(swarm.simulator.names)
    if count > MOST:
        legend.append(f"<span>{len(_shown(count)):,} of {count:,} robots are drawn</span>")
    return (
        f'<div style="font: 13px system-ui, sans-serif">{drawing(swarm, caption)}'
        f'<div style="display: flex; flex-wrap: wrap; gap: 4px 16px">{"".join(legend)}</div>'
        f"<div>{escape(caption)}</div></div>"
    )


def drawing(swarm: Swarm, label: str) -> str:
    """The swarm as it is now, as an SVG element, in the colour of the text around it. label: for those who see no
    pictures."""
    simulator = swarm.simulator
    frame = _Frame.of(swarm)
    size = max(SMALLEST, simulator.scenario.robots.geometry.radius * frame.scale)
    shown = _shown(len(simulator.names))
    codes, groups = _groups(swarm)
    parts = [_ground(shape, frame) for shape in simulator.world.shapes.values()]
    for code in range(len(groups) + 1):
        of_code = shown[codes[shown] == code]
        shapes = "".join(
            _robot(code, *frame.pixel(x, y), size, -heading)
            for x, y, heading in zip(
                simulator.x[of_code].tolist(),
                simulator.y[of_code].tolist(),
                simulator.bodies.heading[of_code].tolist(),
                strict=True,
            )
        )
        if shapes:
            parts.append(f'<path d="{shapes}" fill="{_colour(code)}"/>')
    places = [("&#9733;", place.title, place.x, place.y) for place in simulator.scenario.named_points]
    lights = [("&#9728;", light.title, light.x, light.y) for light in simulator.scenario.lights]
    parts += [
        '<text x="{:.1f}" y="{:.1f}" font-size="11" fill="currentColor" text-anchor="middle">'.format(
            *frame.pixel(x, y)
        )
        + f"{sign} {escape(title)}</text>"
        for sign, title, x, y in (*places, *lights)
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {frame.wide:.0f} {frame.high:.0f}" '
        f'width="{frame.wide:.0f}" height="{frame.high:.0f}" style="max-width: 100%; height: auto" role="img" '
        f'aria-label="{escape(label)}">{"".join(parts)}<rect width="100%" height="100%" fill="none" '
        f'stroke="currentColor"/></svg>'
    )


def _shown(count: int) -> NDArray[np.intp]:
    """The indices of the robots that are drawn."""
    return np.arange(0, count, max(1, -(-count // MOST)))


class _Frame(NamedTuple):
    """The part of the world that is drawn. left, top: m; scale: pixels a metre; wide, high: pixels."""

    left: float
    top: float
    scale: float
    wide: float
    high: float

    @classmethod
    def of(cls, swarm: Swarm) -> _Frame:
        """All of the world; or, where robots, places and lights are together in a small part of it, that part."""
        simulator, scenario = swarm.simulator, swarm.simulator.scenario
        named = [(place.x, place.y) for place in scenario.named_points] + [
            (light.x, light.y) for light in scenario.lights
        ]
        x, y = (
            np.append(own, others)
            for own, others in zip((simulator.x, simulator.y), np.array(named).reshape(-1, 2).T, strict=True)
        )
        room = ROOM * scenario.robots.geometry.radius
        left, right, bottom, top = x.min() - room, x.max() + room, y.min() - room, y.max() + room
        if SMALL * (right - left) >= scenario.width or SMALL * (top - bottom) >= scenario.height:
            left, right, bottom, top = 0.0, scenario.width, 0.0, scenario.height
        scale = min(WIDTH / (right - left), HEIGHT / (top - bottom))
        return cls(float(left), float(top), float(scale), float((right - left) * scale), float((top - bottom) * scale))

    def pixel(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of the world is in the picture."""
        return (x - self.left) * self.scale, (self.top - y) * self.scale


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


def _ground(shape: Shape, frame: _Frame) -> str:
    """A solid thing, in pixels."""

    def points(corners: Sequence[tuple[float, float]]) -> str:
        return " ".join("{:.1f},{:.1f}".format(*frame.pixel(*corner)) for corner in corners)

    match shape:
        case Circle():
            x, y = frame.pixel(shape.x, shape.y)
            return (
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{shape.radius * frame.scale:.1f}" fill="currentColor" '
                'opacity="0.3"/>'
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
