"""Bodies that hover: their columns, and a tick of their motion.

Across the ground a body is driven or on its way to a place, as its `Mode` says; upwards it is driven, or on its way to
a height (`target_z`): so what rises may be driven meanwhile. Its motors turn while it is armed. With them off it
stands, or falls; what has crashed is locked and stays where it fell. `pilot` says what they can be told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from sleepcast.robot import Limits
from sleepcast.simulator.bodies.air import Air, pushed_down
from sleepcast.simulator.bodies.homes import Homes
from sleepcast.simulator.bodies.moved import Grounded
from sleepcast.simulator.bodies.population import Turnover
from sleepcast.simulator.bodies.wings import Wings
from sleepcast.simulator.motion import flying
from sleepcast.simulator.motion.driving import DRIVE, GOTO, bounded
from sleepcast.simulator.motion.flying import LANDS, FlightColumns, FlightLaws, Power, TypeLaws
from sleepcast.simulator.scenario.flight import BATTERY, CRASHED, SENSORS, FlightSpec
from sleepcast.simulator.scenario.robot_settings import RobotSpec
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.starts import Formation, start_heights
from sleepcast.simulator.simd.formulas import rotated, shortest, sine_cosine, wrap
from sleepcast.simulator.world.roofs import GROUND, Roofs

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.intp]
ROUNDED = 1e-9
"""m above the ground map up to which a plane stands on it."""
MARGIN = 1e-6
"""m that bodies keep from the wall around a world, so that rounding never makes them touch it."""
CRASHED_INTO = "has crashed into "
THE_GROUND = "the ground"
CARRIED = "is carried away: the wind is faster than it flies"


def fence_of(scenario: Scenario, spec: RobotSpec) -> tuple[float, float, float, float]:
    """Left, bottom, right and top edge between which the middles of bodies of this type fly, m."""
    if scenario.torus:
        return -inf, -inf, inf, inf
    margin = 0.0 if scenario.fenced else spec.geometry.radius + MARGIN
    return margin, margin, scenario.width - margin, scenario.height - margin


class Flight:
    """The flying bodies among all; arrays of shape (count,), of which those of bodies on the ground mean nothing.

    z: above the origin, m; nan of bodies on the ground, as all that they sense, but where there is a ground map
    turn_rate, height, climb_rate, armed, flying: as `hovering.sensors` say
    crashed: 1 of those that have crashed
    ground: how high the ground or the roof below each body is, m
    velocity_x, velocity_y: over the ground, m/s
    wanted_side, wanted_climb: of the actuators, m/s, beside the wanted speed and turn rate of `Bodies`
    target_z: where it is to come to, m; nan for nowhere, `LANDS` for the ground
    locked: whether its motors stay off
    """

    collides = True
    """Whether contact is a crash."""
    pitch: Floats | None = None
    """How far each body's own direction points up, rad; None where all look level."""

    def __init__(self, bodies: Grounded) -> None:
        self._bodies, count = bodies, bodies.count
        names = [sensor.name for sensor in bodies.sensors]
        unsensed = np.zeros(count)  # what particles have no sensors for
        rows = {
            name: bodies.known[names.index(name)] if name in names else unsensed.copy() for name in (*SENSORS, CRASHED)
        }
        self.z, self.turn_rate, self.height = rows["z"], rows["turn_rate"], rows["height"]
        self.climb_rate, self.armed, self.flying = rows["climb_rate"], rows["armed"], rows["flying"]
        self.crashed = rows[CRASHED]
        self._sensed = rows
        self._terrain = bodies.scenario.terrain
        """Where the ground is not flat."""
        self._roofs = Roofs(bodies.world, bodies.scenario.around, self._terrain)
        self._version = -1
        """Of the world in which it was looked last what lies below."""
        self.ground: Floats = np.full(count, GROUND)
        self.way: Floats = np.zeros((3, count))
        """How far each body went in the last tick, m: in x, y and z."""
        self.velocity_x, self.velocity_y = np.zeros(count), np.zeros(count)
        self.wanted_side, self.wanted_climb = bodies.wanted_side, np.zeros(count)
        self.target_z = np.full(count, nan)
        self.locked = np.zeros(count, bool)
        specs = bodies.scenario.each_type
        self.flies: Flags = bodies.by_type([float(spec.flight is not None) for spec in specs]) > 0.0
        self._rows = slice(None) if self.flies.all() else np.flatnonzero(self.flies)
        flights = [(spec.limits, spec.flight) for spec in specs]
        self._tallest = max((spec.geometry.radius for spec in specs if spec.flight is None), default=0.0)
        """How high the tallest body on the ground reaches above it, m."""
        self._all_laws = self._laws_of(
            [spec.limits for spec in specs], [each.sink if each else 1.0 for _, each in flights]
        )
        self._laws = self.laws_of(self._rows)
        wind = bodies.scenario.wind
        self.air = Air(wind, bodies.scenario, bodies.seed, count) if wind else None
        """None where it stands still."""
        gliding = any(each is not None and each.stall > 0.0 for _, each in flights)
        self.wings = Wings(bodies, self) if gliding else None
        """Those that are planes; None where none is."""
        self.homes = Homes(bodies, self) if self.returns_home.any() else None
        """Where they have taken off; None where nobody returns there."""
        self._usual: Floats = bodies.by_type([each.height if each else nan for _, each in flights])
        """m above the ground to which a take-off leads that does not say it."""
        charged = BATTERY in bodies.store_names
        self._charge = bodies.stores[bodies.store_names.index(BATTERY)] if charged else None
        full = bodies.scenario.robots.stores[bodies.store_names.index(BATTERY)].full if charged else 0.0
        self._per_second: Floats = bodies.by_type([full / each.hovers if each else 0.0 for _, each in flights])
        self._per_climb: Floats = bodies.by_type([full / each.climbs if each else 0.0 for _, each in flights])

    def _laws_of(self, limits: Sequence[Limits], sink: Sequence[float]) -> FlightLaws:
        bodies = self._bodies
        names = ("speed", "turn_rate", "acceleration", "climb", "floor", "ceiling")
        columns = {name: bodies.by_type([getattr(each, name) for each in limits]) for name in names}
        fences = [fence_of(bodies.scenario, spec) for spec in bodies.scenario.each_type]
        left, bottom, right, top = (bodies.by_type(each) for each in zip(*fences, strict=True))
        edges = (left, bottom, right, top)
        return FlightLaws(**columns, sink=bodies.by_type(sink), edges=edges, tick=bodies.scenario.tick)

    def laws_of(self, which: Whole | slice) -> FlightLaws:
        """The limits of some of all bodies."""
        laws = self._all_laws
        some = {name: getattr(laws, name)[which] for name in FlightLaws._fields[:-2]}
        left, bottom, right, top = (edge[which] for edge in laws.edges)
        return FlightLaws(**some, edges=(left, bottom, right, top), tick=laws.tick)

    @property
    def edges(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Left, bottom, right and top ones between which the middle of each body flies, m."""
        return self._all_laws.edges

    @property
    def columns(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes, by name, besides what bodies sense."""
        names = ("velocity_x", "velocity_y", "wanted_side", "wanted_climb", "target_z", "locked")
        columns = {name: getattr(self, name) for name in names} | (self.air.columns if self.air else {})
        columns |= self.wings.columns if self.wings else {}
        return columns | self.homes.columns if self.homes else columns

    def start(self) -> None:
        """Stand where the scenario says, or on the roof of what is there; who starts in the air hovers there."""
        rows, bodies = self._rows, self._bodies
        self.stand()
        self.look_below()
        if self.air:
            self.air.blow(0.0, rows, bodies.x[rows], bodies.y[rows])
        up = self.z[rows] > self.ground[rows]
        self.armed[rows] = self.flying[rows] = up
        self.height[rows] = self.z[rows] - self.ground[rows]
        self.climb_rate[rows] = self.turn_rate[rows] = self.crashed[rows] = 0.0
        if self.homes:
            self.homes.set(np.flatnonzero(self.flies), self.z[self.flies])
        if self.wings:
            self.wings.start()

    def stand(self) -> None:
        """Be as high as at the start, where the bodies are."""
        rows, bodies = self._rows, self._bodies
        self._start_heights()
        self.z[rows] = np.maximum(self.z[rows], self._roofs.below(bodies.x, bodies.y, np.full(bodies.count, inf))[rows])

    def _start_heights(self) -> None:
        """Let those that fly be as high as the scenario lists, or draws."""
        for spec, part, which in self._each_type():
            if spec.flight is not None:
                drawn = spec.z[0] + (spec.z[1] - spec.z[0]) * part.drawn("z")
                listed = () if isinstance(spec.starts, Formation) else spec.starts
                self.z[which] = start_heights(listed, part.count) if listed else drawn

    def low(self, x: Floats, y: Floats) -> Flags:
        """Which bodies, at these places, are as low as those on the ground: these, and what flies while its lower end
        is below the upper end of the tallest of them. Bodies reach as far up and down as they are wide."""
        rise: Floats = self.z - self.ground_at(x, y)
        return ~self.flies | (rise - self._bodies.radii < self._tallest)

    def below(self, x: Floats, y: Floats, z: Floats) -> Floats:
        """How high the ground or the roof below these places is, m."""
        return self._roofs.below(x, y, z)

    def look_below(self) -> None:
        """Find out again what lies below, since bodies have moved or the world has changed."""
        self._version = self._bodies.world.version
        self.ground[:] = GROUND
        if self._roofs:
            rows, bodies = self._rows, self._bodies
            self.ground[rows] = self._roofs.below(bodies.x[rows], bodies.y[rows], self.z[rows])
        if self._terrain:
            self._ride()

    def _ride(self) -> None:
        """Let bodies that do not fly be as high as the ground map is, and nobody be below it."""
        bodies, rides = self._bodies, ~self.flies
        ground = self.ground_at(bodies.x, bodies.y)
        self.z[rides] = self.ground[rides] = ground[rides]
        self.z[self._rows] = np.maximum(self.z[self._rows], ground[self._rows])
        if self.wings:  # whoever has come around a torus is there by rounding
            low = self.wings.rows[self.z[self.wings.rows] - ground[self.wings.rows] < ROUNDED]
            self.z[low] = ground[low]

    def ground_at(self, x: Floats, y: Floats) -> Floats:
        """How high the ground is at these places, m, whatever stands on it."""
        return self._roofs.ground(x, y)

    def keep_up(self) -> None:
        """Take over what has changed in the world."""
        if self._version != self._bodies.world.version:
            self.look_below()

    # ---- a tick

    def step(self) -> None:
        """Move all that fly through a tick, and let it use up their batteries."""
        bodies, rows, laws = self._bodies, self._rows, self._laws
        self.keep_up()
        if self.homes:
            self.homes.step()
        if self.compiles:
            self._step_compiled()
            return
        ground, before = self.ground[rows], self.z[rows].copy()
        empty, up = self._begin()
        held = bodies.still[rows] & ~empty[rows]
        falls = (before > ground) & (self.armed[rows] == 0.0)
        moves = up & ~held
        turn = self._turn(moves)
        if self.air:
            self._be_blown(self.air, up)
        east, north = self._go(moves, up, wrap(bodies.heading[rows] + turn))
        rate = self._rise(moves, up, falls)
        if self.wings:
            self._glide(self.wings, turn, east, north, rate)
        heading = wrap(bodies.heading[rows] + turn)
        way_x, way_y, way_z = east * laws.tick, north * laws.tick, rate * laws.tick
        way_z = np.where(falls, (self.climb_rate[rows] + rate) / 2.0 * laws.tick, way_z)
        x, y = flying.kept_within(laws, bodies.x[rows], bodies.y[rows], way_x, way_y)
        self.way[:2, rows] = x - bodies.x[rows], y - bodies.y[rows]
        comes_down = self._is_in_air(up | falls)
        rolling = self.wings.on_ground_map() if self.wings else None
        self.z[rows] += way_z
        bodies.x[rows], bodies.y[rows], bodies.heading[rows] = x, y, heading
        self.velocity_x[rows], self.velocity_y[rows], self.climb_rate[rows] = east, north, rate
        if self.wings and rolling is not None:
            self.wings.ride(rolling)
        self._touch_ground(comes_down, before)
        self.way[2, rows] = self.z[rows] - before
        self._measure(turn / laws.tick)
        self._use(up, np.sqrt(way_x * way_x + way_y * way_y), way_z)

    def _begin(self) -> tuple[Flags, Flags]:
        """Let those land that have used up what they fly with, and end the ways to heights of those that are driven
        upwards; gives who of all has used it up, and whom of those that fly motors keep in the air."""
        rows, empty = self._rows, self._come_down_empty()
        self.target_z[rows] = np.where(self.wanted_climb[rows] != 0.0, nan, self.target_z[rows])
        ground, target = self.ground[rows], self.target_z[rows]
        return empty, ((self.z[rows] > ground) | (target > ground)) & (self.armed[rows] > 0.0)

    @property
    def compiles(self) -> bool:
        """Whether compiled code moves them: it knows neither roofs nor planes."""
        bodies = self._bodies
        plain = self.wings is None and bodies.population is None
        return plain and bodies.machine.compiles and not self._roofs

    def _step_compiled(self) -> None:
        """As `step`."""
        bodies = self._bodies
        if self.air:
            self._be_blown(self.air, self._begin()[1])
        for laws, power, which in self.hovering:
            bodies.machine.fly(self.flight_columns, laws, power, which)

    @cached_property
    def flight_columns(self) -> FlightColumns:
        """What compiled code changes."""
        own = {"z", "velocity_x", "velocity_y", "turn_rate", "climb_rate", "armed", "flying", "height"}
        own |= {"wanted_climb", "target_z"}
        names, others = FlightColumns._fields, dict(zip(("way_x", "way_y", "way_z"), self.way, strict=True))
        others["held"] = self._bodies.still
        columns = self.air.columns if self.air else {}
        for name in ("wind_east", "wind_north", "anchor_x", "anchor_y"):
            others[name] = columns.get(name, np.empty(0))
        found = (others[n] if n in others else getattr(self if n in own else self._bodies, n) for n in names)
        return FlightColumns(*found)

    @cached_property
    def hovering(self) -> list[tuple[TypeLaws, Power, slice]]:
        """Of each type that hovers its limits, as single numbers, what flying takes of its stores, and which of all
        bodies it is."""
        types = zip(self._bodies.scenario.each_type, self._bodies.of_each_type, strict=True)
        numbers = [number for number, (spec, which) in enumerate(types) if spec.flight and which.start < which.stop]
        return [(self._laws_for(n), self._power_of(n), self._bodies.of_each_type[n]) for n in numbers]

    def _laws_for(self, number: int) -> TypeLaws:
        first, laws = self._bodies.of_each_type[number].start, self._all_laws
        some = {name: float(getattr(laws, name)[first]) for name in TypeLaws._fields[:7]}
        left, bottom, right, top = (float(edge[first]) for edge in laws.edges)
        around_x, around_y = self._bodies.scenario.around
        edges = left, bottom, right, top
        return TypeLaws(**some, edges=edges, tick=laws.tick, around_x=around_x, around_y=around_y)

    def _power_of(self, number: int) -> Power:
        bodies = self._bodies
        uses, first = bodies.parts[number].uses, bodies.of_each_type[number].start
        ends, battery = uses != 0.0, -1
        if self._charge is not None:
            battery = bodies.store_names.index(BATTERY)
            ends[battery] |= self.empty is not None
        return Power(uses, ends, battery, float(self._per_second[first]), float(self._per_climb[first]))

    def _is_in_air(self, moves: Flags) -> Flags:
        """Which of those that move may touch the ground in this tick: not planes that roll on it."""
        if self.wings is None:
            return moves
        rolls: Flags = self.wings.planes[self._rows] & (self.z[self._rows] <= self.ground[self._rows])
        return moves & ~rolls

    def _glide(self, wings: Wings, *found: Floats) -> None:
        """Write over what was found of planes: their turns (rad), velocities over the ground and climb rates."""
        step, tick = wings.step(), self._laws.tick
        planes = wings.planes[self._rows]
        for column, values in zip(found, (step.turn, step.way_x / tick, step.way_y / tick, step.rate), strict=True):
            column[planes] = values

    def _turn(self, moves: Flags) -> Floats:
        """rad by which each body turns."""
        rows, laws = self._rows, self._laws
        turns = moves & (self._bodies.mode[rows] != GOTO) & (self.target_z[rows] != LANDS)
        return flying.turned(laws, turns, self._bodies.wanted_turn[rows])

    def _go(self, moves: Flags, up: Flags, heading: Floats) -> tuple[Floats, Floats]:
        """The velocity of each body over the ground."""
        bodies, rows, laws = self._bodies, self._rows, self._laws
        around_x, around_y = bodies.scenario.around
        east, north = flying.driven(laws, heading, bodies.wanted_speed[rows], self.wanted_side[rows])
        goes = bodies.mode[rows] == GOTO
        if goes.any():
            dx = shortest(bodies.target_x[rows] - bodies.x[rows], around_x)
            dy = shortest(bodies.target_y[rows] - bodies.y[rows], around_y)
            to_east, to_north = flying.homed(laws, dx, dy)
            east, north = np.where(goes, to_east, east), np.where(goes, to_north, north)
        east, north = flying.within_edges(laws, bodies.x[rows], bodies.y[rows], east, north)
        moves = moves & (self.target_z[rows] != LANDS)
        wanted = np.where(moves, east, 0.0), np.where(moves, north, 0.0)
        if self.air:
            wanted = self._against_wind(self.air, up & ~(goes & moves), wanted)
        east, north = flying.steered(laws, (self.velocity_x[rows], self.velocity_y[rows]), wanted)
        return np.where(up, east, 0.0), np.where(up, north, 0.0)

    def _be_blown(self, air: Air, up: Flags) -> None:
        """Let wind that has changed, and downwash, change the velocities of bodies in the air."""
        bodies, rows = self._bodies, self._rows
        change_x, change_y = air.blow(bodies.tick * bodies.scenario.tick, rows, bodies.x[rows], bodies.y[rows])
        self.velocity_x[rows] += np.where(up, change_x, 0.0)
        self.velocity_y[rows] += np.where(up, change_y, 0.0)
        for robot in self._indices(air.newly_carried(self._laws, rows, up)).tolist():
            bodies.say_of(robot, CARRIED)
        if air.washes:
            everywhere = bodies.x, bodies.y, np.nan_to_num(self.z)
            blowing = self.hovers & (self.armed > 0.0) & (self.z > self.ground)
            push = pushed_down(bodies.machine, bodies.near, everywhere, bodies.radii, blowing)
            self.climb_rate[rows] -= np.where(up, push[rows] * self._laws.tick, 0.0)

    def _against_wind(self, air: Air, may_rest: Flags, wanted: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
        """The velocity over the ground of who wants this one: at rest it keeps its place, if no wind is too fast."""
        bodies, rows, laws = self._bodies, self._rows, self._laws
        around_x, around_y = bodies.scenario.around
        rests = may_rest & (wanted[0] == 0.0) & (wanted[1] == 0.0)
        held = air.hold(rows, rests, bodies.x[rows], bodies.y[rows])
        dx = np.where(held, shortest(air.anchor_x[rows] - bodies.x[rows], around_x), 0.0)
        dy = np.where(held, shortest(air.anchor_y[rows] - bodies.y[rows], around_y), 0.0)
        back = flying.homed(laws, dx, dy)
        return air.reached(laws, rows, *(np.where(held, to, want) for to, want in zip(back, wanted, strict=True)))

    def _indices(self, some: Flags) -> Whole:
        """The indices of these bodies among all; some: a flag for each that flies."""
        return np.flatnonzero(some) if isinstance(self._rows, slice) else self._rows[some]

    def _rise(self, moves: Flags, up: Flags, falls: Flags) -> Floats:
        """The climb rate of each body."""
        rows, laws, target = self._rows, self._laws, self.target_z[self._rows]
        climb = flying.climbed(laws, self.height[rows], self.z[rows] - GROUND, self.wanted_climb[rows])
        wanted = flying.climb_for(laws, target, target - self.z[rows], climb)
        rate = flying.lifted(laws, self.climb_rate[rows], np.where(moves, wanted, 0.0))
        return np.where(up, rate, np.where(falls, flying.fallen(laws, self.climb_rate[rows]), 0.0))

    def _come_down_empty(self) -> Flags:
        """Let those land that have used up what they fly with, whatever holds them; gives which ones."""
        exhausted = self._bodies.exhausted()
        empty = np.zeros(self._bodies.count, bool) if exhausted is None else exhausted & self.flies
        self.rest(np.flatnonzero(empty), LANDS)
        return empty

    def _touch_ground(self, moved: Flags, before: Floats) -> None:
        """Let those stand that have come down to the ground or onto a roof; their motors stop. before: z, m"""
        bodies, rows = self._bodies, self._rows
        self.ground[rows] = ground = self._roofs.below(bodies.x[rows], bodies.y[rows], before)
        some = moved & (self.z[rows] <= ground)
        if not some.any():
            return
        which = self._indices(some)
        rammed = self._rams(which)
        self.z[which] = self.ground[which]
        self.armed[which] = self.climb_rate[which] = 0.0
        self.settle(which if self.wings is None else which[~self.wings.planes[which]])  # a plane rolls out
        self.rest(which)
        for robot in rammed.tolist():
            bodies.say_of(robot, CRASHED_INTO + THE_GROUND)
        self.crash(rammed)

    def _rams(self, which: Whole) -> Whole:
        """Those of these bodies, which have touched what lies below, into whom the ground rose faster than they sink in
        a landing: they have flown into a slope with their motors on."""
        if not self._terrain:
            return which[:0]
        bodies, ground = self._bodies, self.ground_at(self._bodies.x[which], self._bodies.y[which])
        before = self.ground_at(bodies.x[which] - self.way[0, which], bodies.y[which] - self.way[1, which])
        steep = ground - before > self._all_laws.sink[which] * self._all_laws.tick
        rams: Flags = steep & (ground == self.ground[which]) & (self.armed[which] > 0.0)
        return which[rams]

    def _measure(self, turn_rate: Floats) -> None:
        bodies, rows = self._bodies, self._rows
        ahead, _ = rotated(self.velocity_x[rows], self.velocity_y[rows], *sine_cosine(-bodies.heading[rows]))
        most = self._laws.speed
        bodies.speed[rows], self.turn_rate[rows] = bounded(ahead, -most, most), turn_rate
        if self.wings:
            bodies.speed[self.wings.rows] = self.wings.airspeed[self.wings.rows]
        self.height[rows] = self.z[rows] - self.ground[rows]
        self.flying[rows] = (self.height[rows] > 0.0) & (self.armed[rows] > 0.0)

    def _use(self, up: Flags, way: Floats, climb: Floats) -> None:
        """Let stores lose what the motion takes of them."""
        rows = self._rows
        all_ways = np.zeros(self._bodies.count)
        all_ways[rows] = way
        for spec, part, which in self._each_type():
            for row, use in zip(part.stores, part.uses, strict=True):
                if use and spec.flight is not None:
                    row[:] = flying.left_of(row, all_ways[which] * use)
        if self._charge is not None:
            used = self._per_second[rows] * self._laws.tick + self._per_climb[rows] * np.maximum(climb, 0.0)
            self._charge[rows] = flying.left_of(self._charge[rows], np.where(up, used, 0.0))

    def crash(self, which: Whole) -> None:
        """Let these fall where they are: their motors stop for good."""
        self.crashed[which] = 1.0
        self.lock(which)
        self.velocity_x[which] = self.velocity_y[which] = 0.0
        if self.wings:
            self.wings.airspeed[which] = 0.0

    def turn_over(self, turnover: Turnover) -> None:
        """Robots have come, with the columns of their parents, and others have gone."""
        children = turnover.children
        self._begin_anew(children[self.flies[children] != self.flies[turnover.parents]])
        self.clear(turnover.dead)

    def _begin_anew(self, which: Whole) -> None:
        """Let these, whose parents fly if they do not, or the other way round, stand on the ground like new."""
        self.locked[which] = False
        for row in self._sensed.values():
            row[which] = np.where(self.flies[which], 0.0, nan)
        self.clear(which)
        if self.homes:
            self.homes.set(which, self.z[which])

    def clear(self, which: Whole) -> None:
        """Leave nothing in the air of these: others would crash into it."""
        flown = which[self.flies[which]]
        self.ground[flown] = self.ground_at(self._bodies.x[flown], self._bodies.y[flown])
        self.z[flown], self.height[flown] = self.ground[flown], 0.0
        self.settle(flown)
        self.armed[flown] = self.flying[flown] = 0.0
        self.rest(which)

    def lock(self, which: Whole) -> None:
        """Stop the motors of these for good."""
        self.locked[which] = True
        self.armed[which] = self.flying[which] = 0.0
        self.rest(which)

    @property
    def longest(self) -> float:
        """How far any body may go across the ground in a tick, m."""
        wind = self._bodies.scenario.wind
        return (float(np.max(self._laws.speed)) + 2.0 * (wind.fastest if wind else 0.0)) * self._laws.tick

    @property
    def empty(self) -> Flags | None:
        """Which bodies have used up their batteries; None where none can."""
        if self._charge is None or not (self._per_second.any() or self._per_climb.any()):
            return None
        empty: Flags = self.flies & (self._charge <= 0.0)
        return empty

    @property
    def hovers(self) -> Flags:
        """Which bodies fly and are no planes, which take no speeds."""
        return self.flies & ~self.wings.planes if self.wings else self.flies

    @property
    def lands_alone(self) -> Flags:
        """Which bodies land where nobody drives them any more; the others hover."""
        return self._of_types(lambda flight: flight.failsafe == "land")

    @property
    def returns_home(self) -> Flags:
        """Which bodies return to where they have taken off where nobody drives them any more."""
        return self._of_types(lambda flight: flight.failsafe == "rtl")

    @property
    def cuts(self) -> Flags:
        """Which bodies have an emergency stop."""
        return self._of_types(lambda flight: flight.cuts)

    def _of_types(self, test: Callable[[FlightSpec], bool]) -> Flags:
        types = self._bodies.scenario.each_type
        return self._bodies.by_type([float(each.flight is not None and test(each.flight)) for each in types]) > 0.0

    def rise(self, robots: Whole, others: Whole, seen: Floats | None = None) -> Floats:
        """How much higher each of the others is, m; what stands on the ground is as high as that. seen: z at which
        others are seen, if that is not where they are."""
        z = np.nan_to_num(self.z)
        rise: Floats = (z if seen is None else np.nan_to_num(seen))[others] - z[robots]
        return rise

    def usual_height(self, which: Whole) -> Floats:
        """m above the ground to which a take-off of these leads that does not say it."""
        return self._usual[which]

    def rest(self, which: Whole, target: float = nan) -> None:
        """End what moves these bodies, but for the height to which they go, m; nan for none, `LANDS` for the ground. A
        plane in the air circles, and one that lands goes on with it."""
        if self.homes is not None:
            self.homes.returns[which] = False
        if self.wings is not None:
            up, lands = self.wings.is_up(which), (target == LANDS) & (self.target_z[which] == LANDS)
            self.wings.rest(which[up & ~lands], target)
            which = which[~up]
        bodies = self._bodies
        bodies.mode[which] = DRIVE
        for wanted in (bodies.wanted_speed, bodies.wanted_turn, self.wanted_side, self.wanted_climb):
            wanted[which] = 0.0
        self.target_z[which] = target

    def settle(self, which: Whole) -> None:
        """Let bodies be at rest at once, where they are; planes in the air fly on."""
        if self.wings is not None:
            self.wings.settle(which)
        self.velocity_x[which] = self.velocity_y[which] = 0.0
        self.climb_rate[which] = np.where(self.flies[which], 0.0, nan)
        if self.air:
            self.air.anchor_x[which] = self.air.anchor_y[which] = nan

    def speeds(self, which: Whole) -> Floats:
        """How fast these bodies are, in whatever direction, m/s; 0 for those on the ground, and for planes that circle
        under a STOP."""
        east, north, up = self.velocity_x[which], self.velocity_y[which], np.nan_to_num(self.climb_rate[which])
        speeds: Floats = np.sqrt(east * east + north * north + up * up)
        if self.wings is not None:  # a plane comes to no other rest than its circle
            speeds = np.where(self.wings.circles(which) & self._bodies.stopped[which], 0.0, speeds)
        return speeds

    def _each_type(self) -> Iterator[tuple[RobotSpec, Grounded, slice]]:
        """Each type, its bodies, and which of all they are."""
        bodies = self._bodies
        return zip(bodies.scenario.each_type, bodies.parts, bodies.of_each_type, strict=True)
