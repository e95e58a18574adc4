"""A ROS 2 robot for a day: it drives as /rover/cmd_vel says, and tells its place, its lidar and its battery.

    python -m benchmarks.soak.rover

It runs on the computer of its mind, and is found there only.
"""

from __future__ import annotations

import time
from math import cos, inf, pi, sin
from typing import Any

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from sleepcast.bridges.ros2_link import QOS, join
from sleepcast.bridges.ros2_messages import BatteryState, Header, LaserScan, Odometry, Twist, made, time_of

NAMESPACE = "/rover"
TICK = 0.25
FORGOTTEN = 1.0
"""Seconds after which its base forgets what it was told."""
RAYS = 36


def main() -> None:
    join(0, True)
    participant = DomainParticipant(0)

    def topic(name: str, sort: Any) -> Topic[Any]:
        return Topic(participant, f"rt{NAMESPACE}/{name}", sort)

    odom = DataWriter(participant, topic("odom", Odometry), QOS["sensor"])
    lidar = DataWriter(participant, topic("scan", LaserScan), QOS["sensor"])
    battery = DataWriter(participant, topic("battery_state", BatteryState), QOS["reliable"])
    told = DataReader(participant, topic("cmd_vel", Twist), QOS["reliable"])
    x = y = heading = speed = turn_rate = 0.0
    heard = time.monotonic()
    print("rover is up", flush=True)
    while True:
        time.sleep(TICK)
        for message in told.take(1):
            if message.sample_info.valid_data:
                heard, speed, turn_rate = time.monotonic(), message.linear.x, message.angular.z
        if time.monotonic() - heard > FORGOTTEN:
            speed = turn_rate = 0.0
        heading += turn_rate * TICK
        x, y = x + speed * cos(heading) * TICK, y + speed * sin(heading) * TICK
        now, motion = time.time(), {"x": x, "y": y, "heading": heading, "speed": speed, "turn_rate": turn_rate}
        odom.write(made("Odometry", motion, now, "odom"))
        header = Header(time_of(now), "odom")
        lidar.write(LaserScan(header, -pi, pi, 2.0 * pi / RAYS, range_min=0.1, range_max=3.5, ranges=[inf] * RAYS))
        battery.write(made("BatteryState", {"voltage": 12.1, "percentage": 0.8}, now, "odom"))


if __name__ == "__main__":
    main()
