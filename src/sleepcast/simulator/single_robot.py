"""Single-robot adapter: one simulated body in its own world, for a node in its own process; and safety limits.

Each reading first advances the world to the clock's time; without a clock it advances the world by one tick.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from math import atan2, hypot, inf, pi
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import Table, toml_document
from sleepcast.core.units import ACCELERATION, LENGTH, RATE, SPEED
from sleepcast.robot import Limits, Reading
from sleepcast.simulator.bodies.bodies import TURN, Mode
from sleepcast.simulator.bodies.body import Body
from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_WORLD, RobotSpec
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simulation import Simulator

MAX_AT_ONCE = 10
"""Ticks that one reading catches up at most; any others are skipped."""


class SingleRobot(Body):
    """The first robot of `simulator`. clock: sets the pace of its world; None: one tick per reading. limits: enforced
    in each tick.

    A `Robot` that can be closed, like those behind a bridge.
    """

    __slots__ = ("_clock", "_limits", "_simulator", "_start")

    def __init__(self, simulator: Simulator, clock: Clock | None, limits: SafetyLimits | None = None) -> None:
        super().__init__(simulator.bodies, simulator.senses, simulator.model, 0)
        self._simulator, self._clock, self._limits = simulator, clock, limits
        self._start = 0.0 if clock is None else clock.now()

    def sense(self) -> Reading:
        for _ in range(self._due()):
            if self._limits is not None:
                self._limits.enforce()
            self._simulator.step()
        return super().sense()

    def now(self) -> float:
        """Time in its world, s."""
        return self._simulator.time

    @property
    def lost(self) -> str:
        """The reason why it cannot be reached: always empty."""
        return ""

    def complaints(self) -> list[str]:
        """What has befallen it since the last call."""
        return [news.text for news in self._simulator.take_news() if news.robot == self.number]

    def close(self) -> None:
        """Stop the body."""
        self.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _due(self) -> int:
        """Number of ticks due now."""
        if self._clock is None:
            return 1
        tick = self._simulator.scenario.tick
        behind = self._clock.now() - self._start - self._simulator.time
        due = int(behind / tick + 0.5)
        if due > MAX_AT_ONCE:
            self._start += (due - MAX_AT_ONCE) * tick
        return min(due, MAX_AT_ONCE)


# Safety limits read from a file; neither a scenario nor an expression can override them.


def read_limits(file: Path) -> Limits:
    """Read the limits from `file`. Raises SettingsError."""
    with toml_document(file).root() as root:
        return Limits(
            speed=root.number("speed", SPEED, inf, low=LEAST),
            turn_rate=root.number("turn_rate", RATE, inf, low=LEAST),
            acceleration=root.number("acceleration", ACCELERATION, inf, low=LEAST),
            fence=_fence(root) if root.has("fence") else None,
            least_range=root.number("range", LENGTH, 0.0, low=0.0, high=MAX_WORLD),
        )


def _fence(root: Table) -> tuple[float, float, float, float]:
    with root.table("fence") as table:
        x, y = (table.span(axis, LENGTH, low=-MAX_WORLD, high=MAX_WORLD) for axis in "xy")
        for axis, (least, greatest) in (("x", x), ("y", y)):
            if least.value == greatest.value:
                raise table.error(axis, "there is no room between these ends")
        return x[0].value, y[0].value, x[1].value, y[1].value


def limited(scenario: Scenario, limits: Limits) -> Scenario:
    """The scenario with robots that also keep these limits and start inside the fence. Raises MisuseError if the fence
    lies outside the world, or if there is a least range but robots have no range sensor."""
    specs = (scenario.robots, *scenario.sorts)
    if limits.least_range > 0.0 and not all(spec.geometry.sonars for spec in specs):
        raise MisuseError(f"the robots of {scenario.name} have no sonars, so they cannot keep a range to anything")
    if limits.fence is not None and scenario.robots.flight is not None:
        raise MisuseError(f"the robots of {scenario.name} fly: their fence is the edge of their world, and no other")
    robots, *others = (_limited(spec, limits, (scenario.width, scenario.height)) for spec in specs)
    return replace(scenario, robots=robots, sorts=tuple(others))


def _limited(spec: RobotSpec, limits: Limits, size: tuple[float, float]) -> RobotSpec:
    slower = replace(spec.limits.within(limits), fence=spec.limits.fence)  # robots still turn back at the world's edge
    wander = replace(spec.wander, speed=min(spec.wander.speed, slower.speed))
    limited_spec = replace(spec, limits=slower, wander=wander)
    if limits.fence is None:
        return limited_spec
    left, bottom, right, top = limits.fence
    x, y = _part(spec.x, (left, right), size[0]), _part(spec.y, (bottom, top), size[1])
    return replace(limited_spec, x=x, y=y, disc=None)


def _part(start: tuple[float, float], fence: tuple[float, float], size: float) -> tuple[float, float]:
    """The part of the start interval inside the fence, or the whole fenced interval if they do not overlap."""
    within = max(fence[0], 0.0), min(fence[1], size)
    if within[0] >= within[1]:
        raise MisuseError(f"a fence from {fence[0]:g} m to {fence[1]:g} m is outside of a world of {size:g} m")
    both = max(start[0], within[0]), min(start[1], within[1])
    return both if both[0] < both[1] else within


class SafetyLimits:
    """Keeps the bodies of a simulator inside the fence and beyond the least range of `limits`. All begin at rest, since
    some may stand where they could not brake in time."""

    def __init__(self, simulator: Simulator, limits: Limits) -> None:
        self._simulator, self._limits = simulator, limits
        self._headings = simulator.bodies.heading.copy()
        if limits.are_watched:
            bodies = simulator.bodies
            for moving in (
                bodies.speed,
                bodies.left,
                bodies.right,
                *((bodies.side_speed,) if bodies.omni.all() else ()),
            ):
                moving[:] = 0.0

    def enforce(self) -> None:
        """Call this before each tick."""
        if not self._limits.are_watched:
            return
        bodies, tick = self._simulator.bodies, self._simulator.scenario.tick
        driving = np.where(bodies.mode == Mode.DRIVE, bodies.wanted_speed, bodies.limits.speed)
        turning = np.where(bodies.mode == Mode.DRIVE, bodies.wanted_turn, bodies.limits.turn_rate)
        turning = np.where(bodies.swing != 0.0, bodies.limits.turn_rate, turning)
        change = np.abs(np.mod(bodies.heading - self._headings + pi, TURN) - pi)
        turning = np.maximum(np.abs(turning), change / tick)  # a body may still turn faster than it wants to
        moves = (driving != 0.0) | (bodies.speed != 0.0) | bodies.omni
        for i in np.flatnonzero(moves & ~bodies.stopped).tolist():
            body = self._simulator.robots[i]
            limits = bodies.part_of(i).limits.within(self._limits)
            pose = float(bodies.x[i]), float(bodies.y[i]), float(bodies.heading[i])
            ways = self._vectors(i) if bodies.omni[i] else ((0.0, float(bodies.speed[i]), float(driving[i])),)
            for course, speed, wanted in ways:
                towards = (*pose[:2], pose[2] + course)
                nearest = partial(_nearest_beside, body, course)
                if not limits.may_go_on(towards, speed, wanted, float(turning[i]), 2.0 * tick, nearest):
                    body.halt()
                    break
        self._headings = bodies.heading.copy()

    def _vectors(self, robot: int) -> Iterator[tuple[float, float, float]]:
        """Of a body that drives in every direction, the course on which it goes and that on which it wants to go, rad
        from its heading, with its speed and the wanted one, m/s: on the way from one velocity to the other it is never
        faster towards a side than in one of them."""
        bodies = self._simulator.bodies
        ahead, side = float(bodies.wanted_speed[robot]), float(bodies.wanted_side[robot])
        if bodies.mode[robot] == Mode.GOTO:
            dx, dy = bodies.target_x[robot] - bodies.x[robot], bodies.target_y[robot] - bodies.y[robot]
            course, wanted = atan2(dy, dx) - float(bodies.heading[robot]), bodies.limits.speed
        elif bodies.mode[robot] == Mode.WANDER:
            course, wanted = 0.0, bodies.limits.speed
        else:
            course, wanted = atan2(side, ahead), min(hypot(ahead, side), bodies.limits.speed)
        speed, aside = float(bodies.speed[robot]), float(bodies.side_speed[robot])
        pace = hypot(speed, aside)
        yield atan2(aside, speed), pace, pace
        yield course, pace if wanted else 0.0, wanted


def _nearest_beside(body: Body, course: float, first: float, last: float) -> float:
    """See `Body.nearest`, with angles from a course that differs so much from its heading."""
    return body.nearest(first + course, last + course)
