"""How planes fly: formulas for arrays, one number for each plane. SI.

A plane turns by its bank: at a speed v by at most g tan(bank) / v, on a circle of v² / (g tan bank). It goes to a
circle and around it, clockwise as ArduPilot does, along the vector field of Nelson, Barber, McLain and Beard (Vector
field path following for miniature air vehicles, IEEE Transactions on Robotics 23, 2007): from afar straight to the
middle of the circle, on it along the tangent.

A plane cannot stand before a fence. So one of the two circles that it can turn into from where it is must lie inside,
that to its left or that to its right, in every tick: where the course that it wants would leave it without either, it
turns into the one that it has. On it the same circle stays free for ever.

Wind moves the air in which a plane flies, so all of this is about its course, the direction of its way over the
ground, and the arcs are those of that way; its heading is the one that keeps such a course in the wind (the wind
triangle). A plane that flies at v around a circle with the radius R turns its heading fastest where the wind w comes
from behind: its course by (v + w) / R, and its heading by 1 + w/v times as much. So its bank suffices everywhere for a
circle (1 + w/v)² times as wide as in still air, and that one is kept free, for the fastest wind there is. In a wind
that stays it stays free; one that changes on the way, as gusts do, may still carry a plane to an edge.
"""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple
from sleepcast.simulator.motion.driving import bounded
from sleepcast.simulator.scenario.flight import GRAVITY
from sleepcast.simulator.simd.formulas import arc_tangent, either, sine_cosine, wrap
from sleepcast.simulator.world.grid import Floats

Flags = NDArray[np.bool_]
STEEP = 2.0
"""How many times as steeply as its distance, in radii, the course bends towards a circle."""
PROMPT = 1.0
"""1/s: the turn rate for each rad by which the course is wrong."""
ROUNDED = 1e-6
"""m by which places may be wrong from rounding."""


class PlaneLaws(NamedTuple):
    """Of each plane its limits, see `robot.Limits` and `scenario.flight.FlightSpec`.

    speed: at which it flies, m/s
    bank: tangent of its greatest bank
    circle: radius at rest and around a place, m
    wind: fastest one that there is, m/s
    edges, tick: see `flying.FlightLaws`
    """

    speed: Floats
    stall: Floats
    turn_rate: Floats
    acceleration: Floats
    bank: Floats
    circle: Floats
    wind: Floats
    edges: tuple[Floats, Floats, Floats, Floats]
    tick: float

    @property
    def radius(self) -> Floats:
        """Of the narrowest circle over the ground at full speed, m."""
        share = 1.0 + self.wind / self.speed
        return self.speed / narrowest(self, self.speed) * share * share


def narrowest(laws: PlaneLaws, speed: Floats) -> Floats:
    """The greatest turn rate at this speed, rad/s."""
    by_bank = GRAVITY * laws.bank / either(speed > laws.stall, speed, laws.stall)
    return either(by_bank < laws.turn_rate, by_bank, laws.turn_rate)


def hastened(laws: PlaneLaws, before: Floats, wanted: Floats) -> Floats:
    """The speed after a tick in which the one `before` became the wanted one, as far as acceleration allows."""
    most = laws.acceleration * laws.tick
    return before + bounded(wanted - before, -most, most)


def over_ground(speed: Floats, heading: Floats, wind: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """The course (rad) and the speed over the ground (m/s) of a plane that flies at this airspeed and heading."""
    sine, cosine = sine_cosine(heading)
    east, north = speed * cosine + wind[0], speed * sine + wind[1]
    still = (wind[0] == 0.0) & (wind[1] == 0.0)
    course = either(still, heading, arc_tangent(north, east))
    return course, either(still, speed, np.sqrt(east * east + north * north))


def headed(laws: PlaneLaws, speed: Floats, heading: Floats, wind: tuple[Floats, Floats], course: Floats) -> Floats:
    """rad by which a plane turns in a tick to the heading that keeps this course, as far as its bank allows; none keeps
    one across a wind that is faster."""
    sine, cosine = sine_cosine(course)
    still = (speed == 0.0) | ((wind[0] == 0.0) & (wind[1] == 0.0))
    lead = bounded((wind[0] * sine - wind[1] * cosine) / either(still, 1.0, speed), -1.0, 1.0)
    crab = either(still, 0.0, arc_tangent(lead, np.sqrt(1.0 - lead * lead)))
    most = narrowest(laws, speed) * laws.tick
    return bounded(wrap(course + crab - heading), -most, most)


def banked(laws: PlaneLaws, speed: Floats, heading: Floats, wind: tuple[Floats, Floats], turn: Floats) -> Floats:
    """The turn rate of its course nearest to this one for which its bank suffices, rad/s."""
    course, _ = over_ground(speed, heading, wind)
    bend = headed(laws, speed, heading, wind, course + turn * laws.tick)
    after, _ = over_ground(speed, heading + bend, wind)
    return wrap(after - course) / laws.tick


def circling(laws: PlaneLaws, dx: Floats, dy: Floats, course: Floats, speed: Floats) -> Floats:
    """The turn rate of its course that leads a plane to a circle, whose middle lies `dx` and `dy` from it, and around
    it. speed: over the ground, m/s"""
    away = np.sqrt(dx * dx + dy * dy)
    beyond = away / laws.circle - 1.0
    wanted = arc_tangent(-dy, -dx) - pi / 2.0 - arc_tangent(STEEP * beyond, np.ones_like(beyond))
    error = wrap(wanted - course)
    near = 1.0 - np.abs(beyond)
    along = -speed / laws.circle * either(near > 0.0, near, 0.0)
    return along + error * min(PROMPT, 1.0 / laws.tick)


def moved(speed: Floats, course: Floats, turn: Floats, tick: float) -> tuple[Floats, Floats]:
    """The way of a plane in a tick on its arc over the ground, in x and y: exact, so that the middle of its circle
    stays."""
    half = turn * tick / 2.0
    still = half == 0.0
    chord = speed * tick * either(still, 1.0, sine_cosine(half)[0] / either(still, 1.0, half))
    sine, cosine = sine_cosine(course + half)
    return chord * cosine, chord * sine


def kept_inside(laws: PlaneLaws, x: Floats, y: Floats, course: Floats, speed: Floats, turn: Floats) -> Floats:
    """The turn rate of its course nearest to this one after which it still has a circle inside of the edges; one that
    has none, as at a start beside them, turns towards the middle. speed: over the ground, m/s"""
    way_x, way_y = moved(speed, course, turn, laws.tick)
    after = x + way_x, y + way_y, course + turn * laws.tick
    free = has_circle(laws, *after, 1.0) | has_circle(laws, *after, -1.0)
    if free.all():
        return turn
    on_circle = speed / laws.radius
    right, left = has_circle(laws, x, y, course, -1.0), has_circle(laws, x, y, course, 1.0)
    west, south, east, north = laws.edges
    inwards = wrap(arc_tangent((south + north) / 2.0 - y, (west + east) / 2.0 - x) - course)
    back = either(inwards < 0.0, -on_circle, on_circle)
    turns = either(right, -on_circle, either(left, on_circle, back))
    return either(free, turn, turns)


def has_circle(laws: PlaneLaws, x: Floats, y: Floats, course: Floats, side: float) -> Flags:
    """Whether the narrowest circle to its left (side 1) or right (-1) lies inside of the edges."""
    sine, cosine = sine_cosine(course)
    middle_x, middle_y = x - side * laws.radius * sine, y + side * laws.radius * cosine
    west, south, east, north = laws.edges
    room = laws.radius - ROUNDED
    inside = (middle_x >= west + room) & (middle_x <= east - room)
    return inside & (middle_y >= south + room) & (middle_y <= north - room)
