"""What robots of a Nomad's kind sense of the world around them, and what they would sense elsewhere.

Everything is worked out once for all robots when the first of them is asked in a tick, from where they really are:
what their sonars read when they last fired, what their infrared sensors see, and what presses their bumpers.
"""

from __future__ import annotations

import numpy as np

from sleepcast.robot import Pose
from sleepcast.simulator.bodies.bodies import Bodies, Floats
from sleepcast.simulator.bodies.bumpers import reach
from sleepcast.simulator.nomads.paths import discs
from sleepcast.simulator.nomads.setups import Infrared
from sleepcast.simulator.sonar import cones
from sleepcast.simulator.sonar.cones import Cones, View
from sleepcast.simulator.sonar.sonar import Echoes
from sleepcast.simulator.world import grid
from sleepcast.simulator.world.grid import distance, nearest_point, pairs, spread

FELT = 1e-3
"""m of a gap that a bumper still feels: bodies that were stopped keep a little less between them."""

Values = tuple[float, ...]


class NomadSenses:
    """The sensors of `bodies`, all of one kind, with a ring of sonars `echoes`."""

    def __init__(self, bodies: Bodies, echoes: Echoes, infrared: Infrared | None) -> None:
        self._bodies, self._echoes = bodies, echoes
        robots = bodies.scenario.robots
        self._reach = reach(robots, bodies.scenario.tick)
        radius = robots.geometry.radius
        self._infrared = (
            Cones(infrared.count, infrared.beam / 2.0, infrared.most, np.pi / 2.0, radius) if infrared else None
        )
        self._known = False
        self._sonars: list[Values] = []
        self._seen: list[Values] = []
        self._touched: list[Values] = []

    def forget(self) -> None:
        """Something has changed."""
        self._known = False

    def sonars(self, robot: int) -> Values:
        """What each sonar last read, m; NaN before it has fired."""
        self._look()
        return self._sonars[robot]

    def infrared(self, robot: int) -> Values:
        """What each infrared sensor sees, m; none without such sensors."""
        self._look()
        return self._seen[robot]

    def touched(self, robot: int) -> Values:
        """Angles of what presses the bumper, rad from the heading, each once."""
        self._look()
        return self._touched[robot]

    def predict(self, pose: Pose) -> tuple[Values, Values]:
        """What sonars and infrared sensors of a body at this pose would read, m, if there were no other robots."""
        ring = self._echoes.ring
        at = np.array([pose.x]), np.array([pose.y]), np.array([pose.turret])
        heard = np.clip(self._lonely(self._echoes.cones, at), ring.least, ring.most)
        seen = self._lonely(self._infrared, at) if self._infrared else np.empty(0)
        return tuple(heard.tolist()), tuple(seen.tolist())

    def _lonely(self, ring: Cones, pose: tuple[Floats, Floats, Floats]) -> Floats:
        near = self._bodies.near
        points, listed = grid.sort(near.grid, pose[0], pose[1]), near.solids(ring.radius + ring.most)
        view = View(ring, near.grid, points, listed, near.world.solids, pose)
        seen: Floats = cones.ranges(view, np.zeros(1, np.int64))[0].astype(np.float64)
        return seen

    def _look(self) -> None:
        if self._known:
            return
        self._known = True
        bodies, ring = self._bodies, self._echoes.ring
        read = self._echoes.readings
        exact = np.where(read <= np.float32(ring.least), ring.least, np.minimum(read.astype(np.float64), ring.most))
        self._sonars = [tuple(row) for row in exact.tolist()]
        self._seen = [()] * bodies.count
        if self._infrared:
            aim = bodies.heading if self._echoes.turret is None else bodies.heading + self._echoes.turret
            pose, near = (bodies.x, bodies.y, aim), bodies.near
            listed = near.in_sight(self._infrared.radius + self._infrared.most)
            view = View(self._infrared, near.grid, near.points(bodies.x, bodies.y), listed, near.world.solids, pose)
            seen = bodies.machine.ranges(view, np.arange(bodies.count))
            self._seen = [tuple(row) for row in np.minimum(seen.astype(np.float64), self._infrared.most).tolist()]
        self._touched = self._pressed()

    def _pressed(self) -> list[Values]:
        """What presses each bumper."""
        bodies, every = self._bodies, np.arange(self._bodies.count)
        x, y, radius, near = bodies.x, bodies.y, bodies.geometry.radius, bodies.near
        listed, solids, cell = near.solids(self._reach), near.world.solids, near.grid.cells_of(x, y)
        i, item = spread(every, listed.start[cell], listed.start[cell + 1])
        lines = solids[listed.items[item]]
        close = distance(x[i], y[i], *lines[:, :4].T) <= radius + lines[:, 4] + FELT
        i, lines = i[close], lines[close]
        j, other = pairs(near.grid, near.points(x, y), x, y, 2.0 * radius + FELT, every)
        lines = np.concatenate((lines, discs(x[other], y[other], bodies.radii[other])))
        i = np.concatenate((i, j))
        across, up = nearest_point(x[i], y[i], *lines[:, :4].T)
        angles = np.round(np.arctan2(up, across) - bodies.heading[i], 9) % (2.0 * np.pi)
        found: list[set[float]] = [set() for _ in every]
        for robot, angle in zip(i.tolist(), angles.tolist(), strict=True):
            found[robot].add(angle)
        return [tuple(sorted(each)) for each in found]
