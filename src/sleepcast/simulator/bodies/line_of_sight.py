"""What robots do not see, because a wall, the ground or another robot stands between: see `world.sight` and
`world.ground_sight`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sleepcast.simulator.engine import Machine
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.world.grid import Floats, Whole
from sleepcast.simulator.world.ground_sight import HidingGround
from sleepcast.simulator.world.sight import Ends, Flags, Levels, SightLines, crossings, hidden, stops, unrolled
from sleepcast.simulator.world.world import World


class BetweenWalls:
    """What walls hide, and where heights are known a ground map. walls: the solids of the world; up to date after
    `keep_up`."""

    def __init__(self, scenario: Scenario, world: World, machine: Machine) -> None:
        self.walls = SightLines((scenario.width, scenario.height), scenario.around)
        self._world, self._machine, self._around = world, machine, scenario.around
        self._terrain = scenario.terrain
        self.ground: HidingGround | None = None
        """None where the ground is flat."""
        if scenario.ground is not None and self._terrain is not None:
            widest = max(spec.geometry.radius for spec in scenario.each_type)
            self.ground = HidingGround(scenario.ground, self._terrain, (scenario.width, scenario.height), widest)

    def keep_up(self) -> None:
        """Take over what has changed in the world."""
        self.walls.keep_up(self._world)

    def any_between(self, x: Floats, y: Floats, to_x: Floats, to_y: Floats, levels: Levels | None = None) -> Flags:
        """Whether walls or rising ground lie between each point x, y and `to_x`, `to_y`, m; on a torus the shortest
        way. levels: z of both, None on the ground, where that does not count."""
        self.keep_up()
        ends = self._ends(x, y, to_x, to_y)
        if levels is not None and self.walls.levels is not None:
            found = hidden(self.walls, *ends, levels=levels)
        else:
            found = self._machine.hidden(self.walls, *ends)
        return found if levels is None or self.ground is None else found | self.ground.hide(ends, levels)

    def from_points(self, x: Floats, y: Floats) -> Callable[[Whole, Floats, Floats], Flags]:
        """Whether walls hide other places from those of these points, on the ground, whose indices are given."""
        return lambda which, to_x, to_y: self.any_between(x[which], y[which], to_x, to_y)

    def count_between(self, x: Floats, y: Floats, to_x: Floats, to_y: Floats, levels: Levels | None = None) -> Whole:
        """How many walls do; the ground is one more."""
        self.keep_up()
        ends = self._ends(x, y, to_x, to_y)
        if levels is not None and self.walls.levels is not None:
            found = crossings(self.walls, *ends, levels=levels)
        else:
            found = self._machine.crossings(self.walls, *ends)
        return found if levels is None or self.ground is None else found + self.ground.hide(ends, levels)

    def _ends(self, x: Floats, y: Floats, to_x: Floats, to_y: Floats) -> Ends:
        across, up = self._around
        return x, y, unrolled(x, to_x, across), unrolled(y, to_y, up)


class LineOfSight(BetweenWalls):
    """The lines of sight among bodies at x, y (m, changed in place).

    radii: of the bodies, m; as far up and down does a body that flies hide
    heights: z of the bodies, m, NaN of those on the ground, changed in place; None where none flies
    there: which of them are there, None if all are; changed in place
    moved: whether bodies have moved since they were last looked at; set by who moves them
    """

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        machine: Machine,
        places: tuple[Floats, Floats],
        radii: Floats,
        there: Flags | None = None,
        heights: Floats | None = None,
    ) -> None:
        super().__init__(scenario, world, machine)
        self._discs = SightLines((scenario.width, scenario.height), scenario.around)
        self.moved = True
        self._places, self._radii, self._bodies_hide = places, radii, scenario.sight.bodies_hide
        self._heights = heights
        self._there, self._disc_of = there, np.arange(len(places[0]))
        """The disc of each body."""

    def behind_walls(
        self, robots: Whole, seen_x: Floats, seen_y: Floats, seen: Whole | None = None, z: Floats | None = None
    ) -> Flags:
        """Whether walls hide from each of these robots what stands at `seen_x`, `seen_y`, m. seen: the robots that are
        there; None if something on the ground is. z: of all robots as they are seen, m, if that is not where they
        are."""
        return self.any_between(
            *self._places_of(robots), seen_x, seen_y, self._levels(robots, (seen_x, seen_y), seen, z)
        )

    def hidden(
        self, robots: Whole, seen_x: Floats, seen_y: Floats, *, walls: bool, senders: Whole | None = None
    ) -> Flags:
        """Whether walls (if these count) or bodies (if the scenario says that they do) hide from each of these robots
        what stands at `seen_x`, `seen_y`, m. senders: the robots that stand there, if any do: no body hides itself, nor
        what is sent from it."""
        found = self.behind_walls(robots, seen_x, seen_y, senders) if walls else np.zeros(len(robots), bool)
        if not self._bodies_hide:
            return found
        left = np.flatnonzero(~found)
        bodies = self._where_bodies_are()
        passing = [self._disc_of[each[left]] for each in ([robots] if senders is None else [robots, senders])]
        place = seen_x[left], seen_y[left]
        lines = self._ends(*self._places_of(robots[left]), *place)
        levels = self._levels(robots[left], place, None if senders is None else senders[left])
        found[left] = hidden(bodies, *lines, passing=passing, levels=levels)
        return found

    def stops(
        self, robots: Whole, seen_x: Floats, seen_y: Floats, *, walls: bool, bodies: bool, senders: Whole | None = None
    ) -> Floats:
        """At which share of the way from each of these robots to `seen_x`, `seen_y` (m) the first thing lies that hides
        what stands there; infinite where it is seen. bodies: whether these count if the scenario says that they do; the
        rest as for `hidden`."""
        ends, found = self._ends(*self._places_of(robots), seen_x, seen_y), np.full(len(robots), np.inf)
        levels = self._levels(robots, (seen_x, seen_y), senders)
        if walls:
            self.keep_up()
            found = stops(self.walls, *ends, levels=levels)
            if self.ground is not None and levels is not None:
                found = np.minimum(found, self.ground.stops(ends, levels))
        if bodies and self._bodies_hide:
            discs = self._where_bodies_are()
            passing = [self._disc_of[each] for each in ([robots] if senders is None else [robots, senders])]
            found = np.minimum(found, stops(discs, *ends, passing=passing, levels=levels))
        return found

    def _where_bodies_are(self) -> SightLines:
        """The bodies where they are now."""
        if self.moved:
            x, y = self._places
            z = np.zeros(len(x)) if self._heights is None else np.nan_to_num(self._heights)
            radii = np.broadcast_to(self._radii, len(x))
            if self._there is not None:
                x, y, z, radii = (each[self._there] for each in (x, y, z, radii))
                self._disc_of = np.cumsum(self._there) - 1
            levels = None if self._heights is None else (z - radii, z + radii)
            self._discs.put(np.stack((x, y, x, y, radii), axis=1), levels)
            self.moved = False
        return self._discs

    def _levels(
        self, robots: Whole, place: tuple[Floats, Floats], seen: Whole | None, heights: Floats | None = None
    ) -> Levels | None:
        """z of these robots and of what they look at, None where none flies. place: x and y of that, m; seen: the
        robots that are there, None if it stands on the ground; heights: z of all as they are seen."""
        if self._heights is None:
            return None
        z = np.nan_to_num(self._heights[robots])
        heights = self._heights if heights is None else heights
        if seen is None:
            return z, np.zeros(len(z)) if self._terrain is None else self._terrain.at(*place)[0]
        return z, np.nan_to_num(heights[seen])

    def _places_of(self, robots: Whole) -> tuple[Floats, Floats]:
        x, y = self._places
        return x[robots], y[robots]
