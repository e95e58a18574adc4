"""ROS 2 robots for a day: each drives as its cmd_vel says, and tells its place, its lidar and its battery.

    python -m benchmarks.soak.rover NAMESPACE [NAMESPACE ...]

They run on the computer of their minds, and are found there only.
"""

from __future__ import annotations

import sys
import time
from math import cos, inf, pi, sin
from typing import Any

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from sleepcast.bridges.ros2.link import QOS, join
from sleepcast.bridges.ros2.messages import BatteryState, Header, LaserScan, Odometry, Twist, made, time_of

TICK = 0.5
FORGOTTEN = 1.0
"""Seconds after which its base forgets what it was told."""
RAYS = 36
MOST = 8
"""Messages that are taken at once."""


class Rover:
    """One of them. namespace: that of its topics."""

    def __init__(self, participant: DomainParticipant, namespace: str) -> None:
        def topic(name: str, sort: Any) -> Topic[Any]:
            return Topic(participant, f"rt/{namespace}/{name}", sort)

        self._odom = DataWriter(participant, topic("odom", Odometry), QOS["sensor"])
        self._lidar = DataWriter(participant, topic("scan", LaserScan), QOS["sensor"])
        self._battery = DataWriter(participant, topic("battery_state", BatteryState), QOS["reliable"])
        self._told = DataReader(participant, topic("cmd_vel", Twist), QOS["reliable"])
        self._x = self._y = self._heading = self._speed = self._turn_rate = 0.0
        self._heard = time.monotonic()

    def step(self) -> None:
        """Drive for a tick, and tell."""
        for message in self._told.take(MOST):
            if message.sample_info.valid_data:
                self._speed, self._turn_rate = message.linear.x, message.angular.z
                self._heard = time.monotonic()
        if time.monotonic() - self._heard > FORGOTTEN:
            self._speed = self._turn_rate = 0.0
        self._heading += self._turn_rate * TICK
        self._x += self._speed * cos(self._heading) * TICK
        self._y += self._speed * sin(self._heading) * TICK
        place = {"x": self._x, "y": self._y, "heading": self._heading}
        motion, now = {**place, "speed": self._speed, "turn_rate": self._turn_rate}, time.time()
        self._odom.write(made("Odometry", motion, now, "odom"))
        header = Header(time_of(now), "odom")
        self._lidar.write(
            LaserScan(header, -pi, pi, 2.0 * pi / RAYS, range_min=0.1, range_max=3.5, ranges=[inf] * RAYS)
        )
        self._battery.write(made("BatteryState", {"voltage": 12.1, "percentage": 0.8}, now, "odom"))


def main() -> None:
    join(0, True)
    participant = DomainParticipant(0)
    rovers = [Rover(participant, namespace) for namespace in sys.argv[1:]]
    print(f"{len(rovers)} rovers are up", flush=True)
    while True:
        time.sleep(TICK)
        for rover in rovers:
            rover.step()


if __name__ == "__main__":
    main()
