"""Runs of the scenario `stop`, measured from outside: when each robot stopped, and how far from what is before it.

The distance is taken with a ruler, not with sonars: points lie close together along everything solid and along the rim
of the other robots, and the nearest counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot, inf, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.assembly import assemble
from sleepcast.loop import Swarm
from sleepcast.simulator import Scenario, find_scenario
from sleepcast.simulator.scenario.robot_settings import CrosstalkModel
from sleepcast.simulator.world.world import Polygon, Shape, Wall

INCH = 0.0254
CLEAR = 15 * INCH
"""m that every robot has around it when the order is sent."""
RADIUS = 0.17
FINE = 0.002
"""m between two points of the ruler."""
SETTLED, PATIENCE = 20.0, 600.0
"""s before the order may be sent, and until everybody should have stopped."""
ANSWERED = 5
"""Ticks after which an answer that is not lost is there."""

Floats = NDArray[np.float64]
Pose = tuple[float, float, float]
"""x, y in m, heading in rad."""
SCENARIO = find_scenario("stop")
RULES, ORDER = (order.text for order in SCENARIO.mission)


class Stop(NamedTuple):
    """One robot that stopped: how long after the order was first sent (s), and how far from the nearest thing (m)."""

    after: float
    distance: float


@dataclass(frozen=True)
class Outcome:
    """stops: of each robot by its index. stood: how many stood still before the order. moved: m that they moved in the
    time after all had stopped, in all."""

    stops: tuple[Stop, ...]
    stood: int
    moved: float


def laboratory(pause: float | None = None, *, loss: float = 0.0) -> Scenario:
    """The scenario with another radio, and with sonars that fire in order and hear each other. pause: from an echo to
    the next ping, s; None for the ideal setup, in which all fire at once."""
    ring = SCENARIO.robots.ring
    assert ring
    if pause is not None:
        ring = replace(ring, pause=pause, crosstalk=CrosstalkModel(chance=1.0, spread=pi / 6, robots=True))
    return replace(
        SCENARIO, mission=(), robots=replace(SCENARIO.robots, ring=ring), radio=replace(SCENARIO.radio, loss=loss)
    )


def ruler(shapes: tuple[Shape, ...], fine: float = FINE) -> Floats:
    """Points along all sides, at most `fine` m apart, m, shape (points, 2)."""
    lines = []
    for shape in shapes:
        assert isinstance(shape, Polygon | Wall)
        corners = shape.corners + shape.corners[:1] if isinstance(shape, Polygon) else shape.points
        for (x, y), (to_x, to_y) in pairwise(corners):
            count = 2 + int(hypot(to_x - x, to_y - y) / fine)
            lines.append(np.column_stack((np.linspace(x, to_x, count), np.linspace(y, to_y, count))))
    return np.concatenate(lines)


def distance(points: Floats, poses: list[Pose], which: int) -> float:
    """From the rim of robot `which` to the nearest of the points and of the other robots, m. poses: of all robots."""
    x, y, _ = poses[which]
    round_ = np.linspace(-pi, pi, 1 + int(2 * pi * RADIUS / FINE))
    rim = RADIUS * np.column_stack((np.cos(round_), np.sin(round_)))
    others = [rim + pose[:2] for number, pose in enumerate(poses) if number != which]
    apart = np.concatenate([points, *others]) - (x, y)
    return float(np.hypot(*apart.T).min()) - RADIUS


def poses_of(swarm: Swarm) -> list[Pose]:
    bodies = swarm.simulator.bodies
    return list(zip(bodies.x.tolist(), bodies.y.tolist(), bodies.heading.tolist(), strict=True))


class Trial:
    """One run, from the rules to the last stop."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.swarm, self.desk = assemble(scenario, seed, mission=False)
        self._points = ruler(scenario.shapes)
        self.stops: dict[int, Stop] = {}
        self._sent = inf
        self.stood = 0

    def run(self, order: str = ORDER) -> Outcome:
        """Teach everybody the rules, send the order when the way is clear, and wait until everybody has stopped."""
        self._tell(RULES)
        while self.swarm.now() < SETTLED or not self._clear():
            self._step()
            self.stood += self._standing()
        self._sent = self.swarm.now()
        self._tell(order)
        while len(self.stops) < len(self.swarm.minds) and self.swarm.now() < PATIENCE:
            self._step()
        before = poses_of(self.swarm)
        self.swarm.run(20)
        moved = sum(hypot(x - a, y - b) for (x, y, _), (a, b, _) in zip(poses_of(self.swarm), before, strict=True))
        return Outcome(tuple(stop for _, stop in sorted(self.stops.items())), self.stood, moved)

    def _tell(self, text: str) -> None:
        """Broadcast until everybody has answered; the order, each time when the way is clear."""
        heard: set[str] = set()
        while True:
            command = self.desk.send(text, everybody=True)
            for _ in range(ANSWERED):
                self._step()
            heard |= set(self.desk.accounting(command.id).matched)
            if heard == set(self.swarm.minds):
                return
            while self.swarm.now() >= self._sent and not self._clear():
                self._step()

    def _step(self) -> None:
        assert self.swarm.now() < 2 * PATIENCE, "the way is never clear, or somebody never hears"
        self.swarm.step()
        for number, mind in enumerate(self.swarm.minds.values()):
            if number not in self.stops and dict(mind.variables())["frozen"]:
                after = self.swarm.now() - self._sent
                self.stops[number] = Stop(after, distance(self._points, poses_of(self.swarm), number))

    def _clear(self) -> bool:
        """Whether nobody who drives has anything near by, on any side."""
        poses = poses_of(self.swarm)
        driving = set(range(len(poses))) - set(self.stops)
        return all(distance(self._points, poses, each) >= CLEAR for each in driving)

    def _standing(self) -> int:
        bodies = self.swarm.simulator.bodies
        return int(((bodies.left == 0.0) & (bodies.right == 0.0)).sum())
