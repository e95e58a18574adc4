"""A picture of a swarm, as SVG and for notebooks: world, places, lights, robots as `looks` has them, and a legend."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.looks import INKS, LOOKS, NONE, TYPES, body, looks_of, ring
from sleepcast.loop import Swarm
from sleepcast.simulator import Area, Circle, Polygon, Shape, Wall

WIDTH, HEIGHT = 640.0, 480.0
"""Pixels at most."""
MAX_DRAWN = 2_000
"""Robots drawn; of more, so many at equal steps through their numbers, or a page of notebooks would be slow."""
SMALLEST = 4.0
"""Pixels: half a robot's length at least."""
SMALL, ROOM = 8, 10
"""Robots that need less than this part of the world's width and height are drawn closer, with so many radii of a body
around them."""


def picture(swarm: Swarm, caption: str) -> str:
    """The swarm as it is now, as HTML. caption: stands below."""
    legend = [_entry(*each) for each in looks_of(swarm).entries]
    robots = np.flatnonzero(swarm.simulator.there)
    count = len(robots)
    if count > MAX_DRAWN:
        legend.append(f"<span>{len(_shown(robots)):,} of {count:,} robots are drawn</span>")
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
    shown = _shown(np.flatnonzero(simulator.there))
    looks = looks_of(swarm)
    parts = [_ground(shape, frame) for shape in simulator.world.shapes.values()]
    parts += _footprints(swarm, shown, frame)
    pixels = [frame.pixel(x, y) for x, y in zip(simulator.x[shown].tolist(), simulator.y[shown].tolist(), strict=True)]
    headings = (-simulator.bodies.heading[shown]).tolist()
    bodies, rings = dict[int, list[str]](), dict[int, list[str]]()
    for look, around, place, heading in zip(
        looks.bodies[shown].tolist(), looks.rings[shown].tolist(), pixels, headings, strict=True
    ):
        bodies.setdefault(look, []).append(body(look, *place, size, heading))
        if around != NONE:
            rings.setdefault(around, []).append(ring(around, *place, size))
    parts += [f'<path d="{"".join(bodies[look])}" fill="{_ink(look)}"/>' for look in sorted(bodies)]
    parts += [f'<path d="{"".join(rings[look])}" fill="none" stroke="{_ink(look)}"/>' for look in sorted(rings)]
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


def _shown(robots: NDArray[np.intp]) -> NDArray[np.intp]:
    """The indices of the robots that are drawn."""
    return robots[:: max(1, -(-len(robots) // MAX_DRAWN))]


class _Frame(NamedTuple):
    """The part of the world that is drawn.

    left, top: m.
    scale: pixels a metre.
    wide, high: pixels.
    """

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
        there = simulator.there
        if not there.any() and not named:
            named = [(0.0, 0.0), (scenario.width, scenario.height)]
        x, y = (
            np.append(own, others)
            for own, others in zip(
                (simulator.x[there], simulator.y[there]), np.array(named).reshape(-1, 2).T, strict=True
            )
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


def _ink(look: int) -> str:
    return INKS[LOOKS[look].ink]


def _entry(look: int, name: str, count: int) -> str:
    """A line of the legend."""
    heading = -np.pi / 2 if look < TYPES else 0.0
    return (
        f'<span><svg width="14" height="14" viewBox="-7 -7 14 14"><path d="{body(look, 0.0, 0.0, 4.5, heading)}" '
        f'fill="{_ink(look)}"/></svg> {escape(name)}: {count:,}</span>'
    )


def _footprints(swarm: Swarm, shown: NDArray[np.intp], frame: _Frame) -> list[str]:
    """What cameras that look down see of the ground."""
    simulator, reaches = swarm.simulator, swarm.simulator.footprints
    if reaches is None:
        return []
    columns = (each[shown[reaches[shown] > 0.0]].tolist() for each in (simulator.x, simulator.y, reaches))
    discs = ((*frame.pixel(x, y), reach * frame.scale) for x, y, reach in zip(*columns, strict=True))
    look = 'fill="currentColor" opacity="0.1"'
    return ['<circle cx="{:.1f}" cy="{:.1f}" r="{:.1f}" '.format(*disc) + f"{look}/>" for disc in discs]


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
