"""A small planner, as programs of ROS 2 have one: it brings robots to their goals by odometry and lidar.

It knows nothing of ROS, so that `ros2_planner.py` and `rclpy_planner.py` have it in common.
"""

from __future__ import annotations

import json
from math import atan2, cos, hypot, pi, remainder, sin

NEAR, CLOSE, CLEAR = 0.1, 0.5, 0.9
"""m: to a goal that counts as reached; to what it turns away from; to what it slows down for."""
FAST, TURN = 0.6, 1.5
"""m/s and rad/s."""
WIDE = pi / 4.0
"""rad to both sides in which something is ahead."""


class Pilot:
    """Drives one robot. away: how much farther from 0, 0 than at its start its goal is."""

    def __init__(self, away: float) -> None:
        self.away = away
        self.pose: tuple[float, float, float] | None = None
        self.goal = (0.0, 0.0)
        self.ranges: list[float] = []
        self.heard = 0
        self.began = self.ended = 0.0
        """When it was heard first, and last, by the robot's clock, s."""
        self.arrived = -1.0
        """When, by that clock."""

    def odometry(self, now: float, x: float, y: float, heading: float) -> None:
        if self.pose is None:
            self.goal = (x * self.away, y * self.away) if hypot(x, y) > NEAR else (x - 0.5, y)
            self.began = now
        self.ended = now
        self.pose = x, y, heading
        self.heard += 1
        if self.left() < NEAR and self.arrived < 0.0:
            self.arrived = now

    def scan(self, ranges: list[float]) -> None:
        """Evenly all round, from the front counter-clockwise."""
        self.ranges = ranges

    def left(self) -> float:
        """m to the goal."""
        assert self.pose is not None
        return hypot(self.goal[0] - self.pose[0], self.goal[1] - self.pose[1])

    def velocity(self) -> tuple[float, float]:
        """m/s and rad/s now."""
        if self.pose is None or not self.ranges or self.left() < NEAR / 2.0:
            return 0.0, 0.0
        x, y, heading = self.pose
        towards = remainder(atan2(self.goal[1] - y, self.goal[0] - x) - heading, 2.0 * pi)
        step = 2.0 * pi / len(self.ranges)
        ahead = min((r for k, r in enumerate(self.ranges) if abs(remainder(k * step, 2.0 * pi)) < WIDE), default=9.0)
        if ahead < CLOSE:  # along what is there, to the side that is freer
            left, right = (min(r * abs(sin(k * step)) for k, r in side) for side in self._sides())
            return 0.0, TURN if left > right else -TURN
        fast = FAST * max(0.0, cos(towards)) * min(1.0, ahead / CLEAR, 2.0 * self.left() + 0.1)
        return fast, max(-TURN, min(TURN, 2.0 * towards))

    def _sides(self) -> tuple[list[tuple[int, float]], list[tuple[int, float]]]:
        half, every = len(self.ranges) // 2, [(k, min(r, 9.0)) for k, r in enumerate(self.ranges)]
        return every[half // 4 : half - half // 4], every[half + half // 4 : -half // 4]


def report(pilots: list[Pilot], lags: list[float]) -> str:
    """What came of it, as a line. lags: s from when each message of odometry was sent."""
    lags.sort()
    share = {f"p{part}": 1e3 * lags[min(len(lags) - 1, len(lags) * part // 100)] for part in (50, 99)} if lags else {}
    began = min(pilot.began for pilot in pilots)
    rates = [(pilot.heard - 1) / (pilot.ended - pilot.began) for pilot in pilots if pilot.ended > pilot.began]
    most = {"least_rate": min(rates, default=0.0), "most_rate": max(rates, default=0.0)}
    arrived = [pilot.arrived - began for pilot in pilots if pilot.arrived >= 0.0]
    heard = sum(pilot.heard for pilot in pilots)
    return json.dumps({"arrived": len(arrived), "latest": max(arrived, default=-1.0), **most, **share, "heard": heard})
