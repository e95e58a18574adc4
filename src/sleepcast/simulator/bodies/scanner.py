"""The laser scanners of all bodies: computed once a tick for those that are asked, and not before.

A scanner stands in the middle of its robot, and measures from there to walls, round things and other robots' bodies;
what stands behind these it does not see. Ranges are as in ROS: infinite where nothing is within the scanner's range,
minus infinite where something is too near to be measured.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import key
from sleepcast.simulator.bodies.line_of_sight import BetweenWalls
from sleepcast.simulator.bodies.proximity import Neighbours
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.laser.beams import BeamScene, scan
from sleepcast.simulator.scenario.scanners import LaserModel
from sleepcast.simulator.simd.formulas import sine_cosine
from sleepcast.simulator.sonar.cones import Ranges
from sleepcast.simulator.world.grid import CellLists, Floats, Whole, list_solids
from sleepcast.simulator.world.sight import joined_by_top

Pose = tuple[Floats, Floats, Floats]


class Scanner:
    """The scanners of all bodies, which measure on the level.

    radii: of the bodies, m
    near: their spatial index
    seed: of the run
    heights: z of the bodies, m, NaN of those on the ground, changed in place; None where none flies
    sight: what hides, for where the ground is not flat
    """

    def __init__(
        self,
        model: LaserModel,
        radii: Floats,
        near: Neighbours,
        seed: int,
        machine: Machine,
        heights: Floats | None = None,
        sight: BetweenWalls | None = None,
    ) -> None:
        self._heights, self._hiding = heights, sight.ground if sight else None
        self.model = model
        self._radii = np.ascontiguousarray(radii)
        self._near, self._machine, self._seed = near, machine, seed
        self._known = -1, -1
        """The tick and the version of the world in which ranges were measured."""
        self._fresh: NDArray[np.bool_] = np.zeros(len(radii), np.bool_)
        self._version = -1
        """Of the world whose solids, in the frame of the cells, are these, listed for each cell."""
        self._solids = np.empty((0, 5))
        self._tops: Floats | None = None
        self._listed = CellLists(np.empty(0, np.int32), np.empty(0, np.int32))
        self._ranges: Ranges = np.empty((0, model.beams), np.float32)

    def forget(self) -> None:
        """Bodies have moved."""
        self._known = -1, -1

    def ranges(self, robots: Whole, tick: int, pose: Pose) -> Ranges:
        """What these robots measure in this tick: m from their centres, shape (robots, beams), float32; inf where
        nothing is in reach, -inf where something is too near. pose: true x, y (m) and heading (rad) of all bodies."""
        if self._known != (tick, self._near.world.version):
            self._known = tick, self._near.world.version
            self._fresh[:] = False
        if not len(self._ranges):
            self._ranges = np.empty((len(self._fresh), self.model.beams), np.float32)
        old = np.unique(robots[~self._fresh[robots]])
        if old.size:
            drawn = key(self._seed, "laser", tick) if self.model.noise else 0
            look = self._machine.scan if self._heights is None else scan
            self._ranges[old] = look(self.model, self._scene(pose), old, drawn)
            self._fresh[old] = True
        return self._ranges if len(robots) == len(self._fresh) and _all_in_order(robots) else self._ranges[robots]

    def _scene(self, pose: Pose) -> BeamScene:
        near, (x, y, heading) = self._near, pose
        points, images = near.points(x, y), near.images(x, y)
        whose = images.whose(np.arange(len(images.x)))
        if self._version != near.world.version:
            self._version = near.world.version
            tops = None if near.world.tops is None or self._heights is None else near.tops
            self._solids, self._tops = joined_by_top(near.lines, tops)
            self._listed = list_solids(near.grid, self._solids, self.model.reach)
        where = (images.x, images.y, heading[whose], whose, self._radii)
        z = None if self._heights is None else np.nan_to_num(self._heights)
        ground = None if self._hiding is None else partial(self._ground, pose)
        return BeamScene(*where, near.grid, points, self._listed, self._solids, z, self._tops, ground)

    def _ground(self, pose: Pose, robots: Whole) -> Floats:
        """See `BeamScene.ground`."""
        assert self._hiding is not None
        assert self._heights is not None
        beams, reach = self.model.beams, self.model.reach
        x, y, heading, z = (np.repeat(each[robots], beams) for each in (*pose, self._heights))
        sine, cosine = sine_cosine(heading + np.tile(self.model.angles, len(robots)))
        shares = self._hiding.stops((x, y, x + reach * cosine, y + reach * sine), (z, z))
        return (reach * shares).reshape(len(robots), beams)


def _all_in_order(robots: Whole) -> bool:
    return bool((np.diff(robots) == 1).all())
