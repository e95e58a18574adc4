"""The job that everybody does: robots on two wheels wander about a walled square and keep off what is near.

Ten control steps a second, one robot for every four square metres, sixteen ranges up to 6.5 m each, and one rule:
drive at half a metre a second with a drifting course; when something ahead is nearer than 30 inches, slow down and
turn away from the side on which something is nearer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, pi, radians, sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TICK = 0.1
AREA = 4.0
RADIUS, TRACK = 0.17, 0.3452
BEAMS, REACH = 16, 6.5
"""REACH: metres from the middle of the robot."""
TOP_SPEED, TOP_TURN = 1.0, pi
SPEED, SLOW = 0.5, 0.25
DRIFT, AWAY = radians(30.0), radians(60.0)
"""Rad/s: the most by which the course drifts, and the turn away from what is near."""
CLOSE = 0.762 + RADIUS
"""Metres from the middle of the robot to what is near: 30 inches from its rim."""
SEED = 7


@dataclass(frozen=True)
class Job:
    """A simulator that is ready to go.

    step: one tick: sense, decide, move. places: where the robots are, shape (robots, 2), in metres from a corner of
    their square. ranges: what they last sensed, shape (robots, beams), in metres. setting: how it was set up, in words.
    """

    step: Callable[[], object]
    places: Callable[[], Floats]
    ranges: Callable[[], Floats]
    setting: str


def side(robots: int) -> float:
    """Metres along the square of so many robots."""
    return sqrt(AREA * robots)


def start(robots: int) -> tuple[Floats, Floats]:
    """Where the robots start, shape (robots, 2), on a grid; and their headings (rad), drawn from the seed."""
    across = ceil(sqrt(robots))
    pitch = side(robots) / across
    number = np.arange(robots)
    places = np.stack([(number % across + 0.5) * pitch, (number // across + 0.5) * pitch], axis=1)
    return places, np.random.default_rng(SEED).uniform(-pi, pi, robots)


def corners(robots: int) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """The four walls, each from corner to corner."""
    far = side(robots)
    points = [(0.0, 0.0), (far, 0.0), (far, far), (0.0, far)]
    return list(zip(points, points[1:] + points[:1], strict=True))


def decide(ranges: Floats, source: np.random.Generator) -> tuple[Floats, Floats]:
    """The rule for everybody at once: speeds (m/s) and turns (rad/s).

    ranges: shape (robots, beams) in metres from the robots' middles, beam 0 ahead, counter-clockwise.
    """
    ahead = np.minimum(ranges[:, :3].min(axis=1), ranges[:, -2:].min(axis=1))
    near = ahead < CLOSE
    away = np.where(ranges[:, 1:5].min(axis=1) < ranges[:, -4:].min(axis=1), -AWAY, AWAY)
    turns = np.where(near, away, source.uniform(-DRIFT, DRIFT, len(ranges)))
    return np.where(near, SLOW, SPEED), turns


def check(before: Floats, job: Job, robots: int, seconds: float) -> None:
    """That the job was done: robots moved, stayed inside their walls, and saw something. Raises RuntimeError."""
    after = job.places()
    moved = float(np.hypot(*(after - before).T).mean())
    if seconds > 1.0 and moved < 0.1:
        raise RuntimeError(f"the robots do not wander: {moved:.3f} m in {seconds:.1f} s")
    if after.min() < -RADIUS or after.max() > side(robots) + RADIUS:
        raise RuntimeError("robots left through the walls")
    ranges = job.ranges()
    if not (ranges.min() < REACH and ranges.max() > ranges.min()):
        raise RuntimeError("the robots see nothing")
