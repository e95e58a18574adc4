"""Particles: points that move in space in their own direction, without ground, wind and contact.

A particle has no yaw of its own: it heads where it goes. STEER gives it a direction, to which it turns by at most its
turn rate, and `drive_speed` a speed, which it comes to as its acceleration allows. It keeps both until it is told
something else; at rest it keeps its direction. The edges of the world, and the bottom and the top of its space, hold it
like a wall along which it slides; a torus has no edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.bodies.flight import Flight
from sleepcast.simulator.bodies.moved import Grounded
from sleepcast.simulator.motion import flying, steering
from sleepcast.simulator.motion.driving import bounded
from sleepcast.simulator.scenario.flight import PITCH
from sleepcast.simulator.simd.formulas import arc_tangent

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.intp]


class Particles(Flight):
    """All bodies of a world, each a particle. Besides the arrays of `Flight`:

    pitch: how far each one's direction points up, rad
    aim: the direction that each wants, of any length; 0, 0, 0 for straight on; shape (3, count)
    """

    collides = False

    def __init__(self, bodies: Grounded) -> None:
        super().__init__(bodies)
        names = [sensor.name for sensor in bodies.sensors]
        self.pitch: Floats = bodies.known[names.index(PITCH)]
        self.aim: Floats = np.zeros((3, bodies.count))

    @property
    def columns(self) -> dict[str, NDArray[np.generic]]:
        return super().columns | {"aim": self.aim}

    @property
    def compiles(self) -> bool:
        """Compiled code moves only what hovers."""
        return False

    @property
    def hovers(self) -> Flags:
        """None of them: they take no speeds to a side."""
        return np.zeros(self._bodies.count, bool)

    def start(self) -> None:
        """Be where the scenario says; without a list of starts, in any direction of space."""
        self._start_heights()
        for spec, part, which in self._each_type():
            rise = 2.0 * part.drawn("pitch") - 1.0  # uniform on a sphere
            level = np.sqrt((1.0 - rise) * (1.0 + rise))
            self.pitch[which] = 0.0 if spec.starts else arc_tangent(rise, level)
        self.climb_rate[:] = 0.0

    def step(self) -> None:
        """Move all through a tick."""
        bodies, laws = self._bodies, self._laws
        exhausted = bodies.exhausted()
        moves = ~bodies.still if exhausted is None else ~(bodies.still | exhausted)
        turns = moves & self.aim.any(axis=0)  # others keep their directions to the last bit
        direction = np.stack(steering.pointing(bodies.heading, self.pitch))
        turned = steering.turned(direction, steering.unit(self.aim), laws.turn_rate * laws.tick)
        direction = np.where(turns, turned, direction)
        heading, pitch = steering.headed(direction)
        bodies.heading[turns], self.pitch[turns] = heading[turns], pitch[turns]
        wanted = np.where(moves, bounded(bodies.wanted_speed, 0.0, laws.speed), 0.0)
        bodies.speed[:] = flying.lifted(laws, bodies.speed, wanted)
        velocity = bodies.speed * direction
        way_x, way_y, way_z = velocity * laws.tick
        x, y = flying.kept_within(laws, bodies.x, bodies.y, way_x, way_y)
        z = bounded(self.z + way_z, laws.floor, laws.ceiling)
        self.way[:] = x - bodies.x, y - bodies.y, z - self.z
        bodies.x[:], bodies.y[:], self.z[:] = x, y, z
        self.velocity_x[:], self.velocity_y[:], self.climb_rate[:] = velocity
        self._use(moves, np.abs(bodies.speed) * laws.tick, way_z)

    def steer(self, which: Whole, direction: tuple[Floats, Floats, Floats]) -> None:
        """Let these turn towards these directions, of any length."""
        self.aim[:, which] = direction

    def rest(self, which: Whole, target: float = np.nan) -> None:
        """Come to rest, straight ahead."""
        super().rest(which, target)
        self.aim[:, which] = 0.0

    def look_below(self) -> None:
        """There is no ground."""
