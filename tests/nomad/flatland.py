"""A world of bodies on two wheels on an empty floor, exact and without chance: what the server's own tests need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, isnan, nan, pi, sin

from sleepcast.robot import Axes, Condition, Contact, Corners, Pose

TRACK = 0.3452
SONARS = 16
ZERO_SECONDS = 0.3


@dataclass
class Body:
    pose: Pose = field(default_factory=lambda: Pose(0.0, 0.0, 0.0, 0.0))
    speeds: list[float] = field(default_factory=lambda: [0.0, 0.0])
    left: list[float] = field(default_factory=lambda: [nan, nan])
    cruise: list[float] = field(default_factory=lambda: [0.3, 0.3])
    zeroing: float = 0.0
    order: Sequence[int] = range(SONARS)
    pause: float = 0.0


class Flatland:
    def __init__(self, robots: int = 2, tick: float = 0.02) -> None:
        self.bodies = [Body() for _ in range(robots)]
        self.tick, self.time = tick, 0.0
        self.polygons: list[Corners] = []
        self.steps = 0

    @property
    def count(self) -> int:
        return len(self.bodies)

    def steers(self, robot: int) -> bool:
        return False

    def radius(self, robot: int) -> float:
        return 0.17

    def step(self) -> None:
        self.steps += 1
        self.time = round(self.steps * self.tick, 9)
        for body in self.bodies:
            self._advance(body)

    def _advance(self, body: Body) -> None:
        gone = [0.0, 0.0]
        for wheel in (0, 1):
            if isnan(body.left[wheel]):
                gone[wheel] = body.speeds[wheel] * self.tick
            else:
                most = body.cruise[wheel] * self.tick
                gone[wheel] = max(-most, min(most, body.left[wheel]))
                body.left[wheel] -= gone[wheel]
                body.speeds[wheel] = gone[wheel] / self.tick
                if not body.left[wheel]:
                    body.left[wheel] = nan
                    body.speeds[wheel] = 0.0
        way, turn = sum(gone) / 2.0, (gone[0] - gone[1]) / TRACK
        x, y, heading, _ = body.pose
        body.pose = Pose(x + way * cos(heading), y + way * sin(heading), heading + turn, heading + turn)
        if body.zeroing > 0.0:
            body.zeroing -= self.tick
            if body.zeroing <= 0.0:
                body.pose = Pose(0.0, 0.0, 0.0, 0.0)

    def observe(self, robot: int) -> Condition:
        body = self.bodies[robot]
        moving = [
            bool(speed) or not isnan(left) or body.zeroing > 0.0
            for speed, left in zip(body.speeds, body.left, strict=True)
        ]
        speeds = Axes(body.speeds[0], body.speeds[1], 0.0)
        return Condition(
            self.time, body.pose, body.pose, speeds, (moving[0], moving[1], False), (2.0,) * SONARS, (), (), 1.0
        )

    def set_speeds(self, robot: int, speeds: Axes) -> None:
        self._set(robot, "speeds", speeds)
        self.bodies[robot].left = [nan, nan]

    def _set(self, robot: int, what: str, values: Axes) -> None:
        for wheel in (0, 1):
            if not isnan(values[wheel]):
                getattr(self.bodies[robot], what)[wheel] = values[wheel]

    def travel(self, robot: int, distances: Axes) -> None:
        self._set(robot, "left", distances)

    def cruise(self, robot: int, speeds: Axes) -> None:
        self._set(robot, "cruise", speeds)

    def accelerate(self, robot: int, accelerations: Axes) -> None:
        pass

    def limp(self, robot: int, axes: tuple[bool, bool, bool]) -> None:
        self.rest(robot)

    def rest(self, robot: int) -> None:
        self.set_speeds(robot, Axes(0.0, 0.0))

    def zero(self, robot: int) -> None:
        self.rest(robot)
        self.bodies[robot].zeroing = ZERO_SECONDS

    def believe(self, robot: int, x: float = nan, y: float = nan, heading: float = nan, turret: float = nan) -> None:
        old = self.bodies[robot].pose
        x, y, heading = (was if isnan(new) else new for new, was in zip((x, y, heading), old[:3], strict=True))
        self.bodies[robot].pose = Pose(x, y, heading, heading)

    def place(self, robot: int, pose: Pose) -> None:
        self.rest(robot)
        self.bodies[robot].pose = pose

    def fire(self, robot: int, order: Sequence[int], pause: float) -> None:
        self.bodies[robot].order, self.bodies[robot].pause = order, pause

    def solids(self) -> Sequence[Corners]:
        return self.polygons

    def add(self, corners: Corners) -> bool:
        self.polygons.append(corners)
        return True

    def remove(self, corners: Corners) -> bool:
        if corners not in self.polygons:
            return False
        self.polygons.remove(corners)
        return True

    def move(self, corners: Corners, across: float, up: float) -> bool:
        if not self.remove(corners):
            return False
        return self.add([(x + across, y + up) for x, y in corners])

    def clear(self) -> None:
        self.polygons.clear()

    def predict(self, robot: int, pose: Pose) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return (3.0,) * SONARS, ()

    def along(self, robot: int, start: tuple[float, float], end: tuple[float, float]) -> Contact | None:
        return Contact(1.0, 0.0, pi) if end[0] > 1.0 else None

    def round(self, robot: int, centre: tuple[float, float], radius: float, begin: float, end: float) -> Contact | None:
        return None
