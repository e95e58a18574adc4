"""Planes among the bodies that fly: they cannot stand, so they circle, at rest and around each place.

Where a plane circles, or goes to circle, is its target (`Bodies.target_x`), and `Flight.target_z` the height. It rolls
until it is fast enough, climbs straight on to `LEVEL`, and then goes to its circle. A landing circles down at its sink
rate, with `Flight.target_z` as for every body that lands, and rolls out. In the air it drifts with the wind, and holds
its circle and its course over the ground against it. `motion.gliding` has the formulas.
"""

from __future__ import annotations

from math import nan, tan

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple
from sleepcast.robot import hovering
from sleepcast.simulator.bodies.moved import Aloft, Grounded
from sleepcast.simulator.motion import flying, gliding
from sleepcast.simulator.motion.driving import DRIVE, GOTO, bounded
from sleepcast.simulator.motion.gliding import PlaneLaws
from sleepcast.simulator.scenario.flight import GRAVITY
from sleepcast.simulator.simd.formulas import shortest, sine_cosine

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.intp]
LEVEL = 30.0
"""m of height up to which a plane climbs straight on, as the bridge to ArduPilot has it."""
PLACES = 1_000
"""Places on the way of a take-off of which it is found how high the ground is there."""


class PlaneStep(NamedTuple):
    """What a tick does to each plane: its turn (rad), its way in x and y (m), and its climb rate (m/s)."""

    turn: Floats
    way_x: Floats
    way_y: Floats
    rate: Floats


class Wings:
    """The planes among the bodies that fly. Arrays of shape (count,), of which only those of planes count.

    planes: which bodies they are
    airspeed: m/s
    climbs_out: whether it has taken off and climbs straight on
    was_held: whether it was held still in the last tick
    """

    def __init__(self, bodies: Grounded, flight: Aloft) -> None:
        self._bodies, self._flight = bodies, flight
        specs, wind = bodies.scenario.each_type, bodies.scenario.wind
        flights = [spec.flight for spec in specs]
        self.planes: Flags = bodies.by_type([float(each is not None and each.stall > 0.0) for each in flights]) > 0.0
        self.rows: Whole = np.flatnonzero(self.planes)
        self.airspeed = np.zeros(bodies.count)
        self.climbs_out, self.was_held = np.zeros(bodies.count, bool), np.zeros(bodies.count, bool)
        self.circle: Floats = bodies.by_type([each.circle if each else 0.0 for each in flights])
        limits = {
            name: np.array(bodies.by_type([getattr(spec.limits, name) for spec in specs]))
            for name in ("speed", "turn_rate", "acceleration", "climb", "floor", "ceiling")
        }
        self._climb, self._floor, self._ceiling = limits["climb"], limits["floor"], limits["ceiling"]
        self._sink: Floats = bodies.by_type([each.sink if each else 1.0 for each in flights])
        self._all = PlaneLaws(
            speed=limits["speed"],
            stall=bodies.by_type([each.stall if each and each.stall else 1.0 for each in flights]),
            turn_rate=limits["turn_rate"],
            acceleration=limits["acceleration"],
            bank=bodies.by_type([tan(each.bank) if each and each.stall else 1.0 for each in flights]),
            circle=self.circle,
            wind=np.full(bodies.count, wind.fastest if wind else 0.0),
            edges=flight.laws_of(slice(None)).edges,
            tick=bodies.scenario.tick,
        )
        self._laws = self.laws_of(self.rows)
        self._flight_laws = flight.laws_of(self.rows)

    @property
    def columns(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes, by name."""
        return {"airspeed": self.airspeed, "climbs_out": self.climbs_out, "was_held": self.was_held}

    def laws_of(self, which: Whole) -> PlaneLaws:
        """The limits of some of the planes."""
        laws = self._all
        some = {name: getattr(laws, name)[which] for name in PlaneLaws._fields[:-2]}
        left, bottom, right, top = (edge[which] for edge in laws.edges)
        return PlaneLaws(**some, edges=(left, bottom, right, top), tick=laws.tick)

    def start(self) -> None:
        """Circle from the start, where a plane is in the air."""
        up = self.rows[self.is_up(self.rows)]
        self.airspeed[up] = self._all.speed[up]
        self.rest(up)

    def is_up(self, which: Whole) -> Flags:
        """Which of these are planes in the air."""
        up: Flags = self.planes[which] & (self._flight.z[which] > self._flight.ground[which])
        return up

    # ---- a tick

    def step(self) -> PlaneStep:
        """What the tick does to each plane."""
        bodies, flight, rows, laws = self._bodies, self._flight, self.rows, self._laws
        self._circle_while_held()
        self._level_out()
        on, up = flight.armed[rows] > 0.0, self.is_up(rows)
        target = flight.target_z[rows]
        goes = (on & (up | (target > flight.ground[rows]))) | up
        wanted = np.where(goes, np.where(target == -np.inf, laws.stall, laws.speed), 0.0)
        speed = gliding.hastened(laws, self.airspeed[rows], wanted)
        speed = np.where(up, np.maximum(speed, laws.stall), speed)
        speed = np.where(up & ~on, 0.0, speed)  # with its motors off for good it falls
        heading, wind = bodies.heading[rows], self._wind(rows, on & up)
        course, fast = gliding.over_ground(speed, heading, wind)
        circles = up & ~self.climbs_out[rows]
        turn = gliding.banked(laws, speed, heading, wind, self._wanted(circles, course, fast))
        if not bodies.scenario.torus:
            turn = gliding.kept_inside(laws, bodies.x[rows], bodies.y[rows], course, fast, turn)
        way_x, way_y = gliding.moved(fast, course, turn, laws.tick)
        bend = gliding.headed(laws, speed, heading, wind, course + turn * laws.tick)
        self.airspeed[rows] = speed
        return PlaneStep(bend, way_x, way_y, self._rise(on & (up | (speed >= laws.stall)), up))

    def _wind(self, which: Whole, blown: Flags) -> tuple[Floats, Floats]:
        """The wind at these bodies, m/s; 0 for all that it does not move."""
        air, still = self._flight.air, np.zeros(len(which))
        if air is None:
            return still, still
        return np.where(blown, air.east[which], still), np.where(blown, air.north[which], still)

    def _wanted(self, circles: Flags, course: Floats, fast: Floats) -> Floats:
        """The turn rate of each plane's course that leads it to its circle. fast: m/s over the ground"""
        bodies, rows = self._bodies, self.rows
        around_x, around_y = bodies.scenario.around
        dx = shortest(bodies.target_x[rows] - bodies.x[rows], around_x)
        dy = shortest(bodies.target_y[rows] - bodies.y[rows], around_y)
        return np.where(circles, gliding.circling(self._laws, dx, dy, course, fast), 0.0)

    def _rise(self, flies: Flags, up: Flags) -> Floats:
        """The climb rate of each plane."""
        flight, rows = self._flight, self.rows
        laws, target, before = self._flight_laws, flight.target_z[rows], flight.climb_rate[rows]
        there = np.isfinite(target)
        wanted = np.where(there, flying.raised(laws, np.where(there, target, 0.0) - flight.z[rows]), 0.0)
        wanted = np.where(target == -np.inf, -self._sink[rows], bounded(wanted, -self._sink[rows], self._climb[rows]))
        rate = np.where(flies, flying.lifted(laws, before, wanted), 0.0)
        rate = np.where(up, rate, np.maximum(rate, 0.0))
        falls = np.maximum(before - GRAVITY * laws.tick, -hovering.FASTEST_CLIMB)
        return np.where(up & ~flies, falls, rate)

    def _circle_while_held(self) -> None:
        """Let those circle where they are that are held still from this tick on."""
        held = self._bodies.still[self.rows]
        newly = self.rows[held & ~self.was_held[self.rows]]
        self.was_held[self.rows] = held
        lands = self._flight.target_z[newly] == -np.inf
        self.rest(newly[self.is_up(newly) & ~lands])

    def _level_out(self) -> None:
        """Let those bank that have climbed high enough after a take-off."""
        flight, rows = self._flight, self.rows
        enough = np.fmin(flight.target_z[rows], flight.ground[rows] + LEVEL) <= flight.z[rows]
        done = rows[self.climbs_out[rows] & self.is_up(rows) & enough]
        self.climbs_out[done] = False
        aimless = done[self._bodies.mode[done] != GOTO]
        self.rest(aimless, flight.target_z[aimless])

    # ---- on the ground

    def on_ground_map(self) -> Whole | None:
        """Which planes stand or roll on the ground, and on no roof; None where the ground is flat."""
        bodies, flight, rows = self._bodies, self._flight, self.rows
        if bodies.scenario.ground is None:
            return None
        on_roof = flight.ground[rows] > flight.ground_at(bodies.x[rows], bodies.y[rows])
        return rows[~self.is_up(rows) & ~on_roof]

    def ride(self, which: Whole) -> None:
        """Let these planes, which were on the ground before the tick, be as high as it is now, but for those that leave
        it."""
        bodies, flight = self._bodies, self._flight
        ground = flight.ground_at(bodies.x[which], bodies.y[which])
        leaves = flight.climb_rate[which] > 0.0
        flight.z[which] = np.where(leaves, np.maximum(flight.z[which], ground), ground)

    # ---- circles

    def rest(self, which: Whole, height: float | Floats = nan) -> None:
        """Let these planes, which are in the air, circle where they are: on the circle that they fly, if they fly one.
        height: to which they go, m; nan for the one at which they are, within floor and ceiling."""
        bodies, flight = self._bodies, self._flight
        new = which[~self.circles(which)]
        bodies.target_x[new], bodies.target_y[new] = self.roomy(new, bodies.x[new], bodies.y[new])
        bodies.mode[which] = GOTO
        self.climbs_out[which] = False
        level = bounded(flight.z[which], flight.ground[which] + self._floor[which], self._ceiling[which])
        flight.target_z[which] = np.where(np.isnan(height), level, height)

    def circles(self, which: Whole) -> Flags:
        """Which of these are planes that fly the circle of their targets."""
        bodies = self._bodies
        around_x, around_y = bodies.scenario.around
        dx = shortest(bodies.target_x[which] - bodies.x[which], around_x)
        dy = shortest(bodies.target_y[which] - bodies.y[which], around_y)
        near = np.sqrt(dx * dx + dy * dy) <= hovering.ON_ITS_CIRCLE * self.circle[which]
        on: Flags = self.is_up(which) & near & ~self.climbs_out[which]
        return on

    def roomy(self, which: Whole, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """The places nearest to these around which there is room for the circles of these planes."""
        circle = self.circle[which]
        left, bottom, right, top = self.laws_of(which).edges
        return bounded(x, left + circle, right - circle), bounded(y, bottom + circle, top - circle)

    def settle(self, which: Whole) -> None:
        """Let these planes stand at once, or, in the air, fly at their speed."""
        speed = np.where(self.is_up(which), self._all.speed[which], 0.0)
        self.airspeed[which] = np.where(self.planes[which], speed, 0.0)

    def take_off(self, which: Whole) -> None:
        """Let these planes, which stand, roll and climb straight on; the height is their `target_z`."""
        self._bodies.mode[which] = DRIVE
        self.climbs_out[which] = True

    def lacks_room(self, which: Whole) -> Flags:
        """Which of these are planes that stand where they would be beyond the fence when they are in the air."""
        bodies, laws = self._bodies, self.laws_of(which)
        if bodies.scenario.torus:
            return np.zeros(len(which), bool)
        wind = self._wind(which, self.planes[which])
        course, _ = gliding.over_ground(laws.stall, bodies.heading[which], wind)
        after = *self._run(which), course
        free = gliding.has_circle(laws, *after, 1.0) | gliding.has_circle(laws, *after, -1.0)
        lacks: Flags = self._stands(which) & ~free
        return lacks

    def rolls_off(self, which: Whole) -> Flags:
        """Which of these are planes that stand on a roof that ends before they are fast enough to fly."""
        bodies, flight = self._bodies, self._flight
        ends = flight.below(*self._run(which), flight.z[which]) < flight.ground[which]
        on_roof = flight.ground[which] > flight.ground_at(bodies.x[which], bodies.y[which])
        off: Flags = self._stands(which) & on_roof & ends
        return off

    def meets_slope(self, which: Whole) -> Flags:
        """Which of these are planes that stand where the ground ahead rises faster than they climb, up to `LEVEL`."""
        found = np.zeros(len(which), bool)
        for number in np.flatnonzero(self._stands(which)).tolist() if self._bodies.scenario.ground else ():
            found[number] = self._is_slope_ahead(which[number : number + 1])
        return found

    def _is_slope_ahead(self, one: Whole) -> bool:
        bodies, flight, laws = self._bodies, self._flight, self._flight.laws_of(one)
        steep, late = laws.climb / self._all.speed[one], laws.climb * self._all.speed[one] / laws.acceleration
        sine, cosine = sine_cosine(bodies.heading[one])
        x, y = self._run(one)
        far = np.linspace(0.0, LEVEL / steep + late, PLACES)[:, 0]
        ground = flight.ground_at(x + far * cosine, y + far * sine)
        slack = np.where(far > late, laws.climb * laws.climb / (2.0 * laws.acceleration), 0.0)
        return bool((ground > ground[0] + steep * far - slack).any())

    def _stands(self, which: Whole) -> Flags:
        stands: Flags = self.planes[which] & ~self.is_up(which)
        return stands

    def _run(self, which: Whole) -> tuple[Floats, Floats]:
        """Where these planes come to on the ground before they fly."""
        bodies, laws = self._bodies, self.laws_of(which)
        run = laws.stall * laws.stall / (2.0 * laws.acceleration) + laws.stall * laws.tick
        sine, cosine = sine_cosine(bodies.heading[which])
        return bodies.x[which] + run * cosine, bodies.y[which] + run * sine
