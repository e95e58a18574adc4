"""The planner of pilot.py over DDS, where there is no ROS: `python ros2_planner.py SECONDS AWAY NAMESPACE...`. See
rclpy_planner.py; the domain, and where others are looked for, are in the environment as ROS has it."""

from __future__ import annotations

import sys
import time
from math import atan2

from bridges.pilot import Pilot, report
from sleepcast.bridges.ros2.messages import Clock, LaserScan, Odometry, Twist, TwistStamped, made, seconds
from sleepcast.bridges.ros2.robot import LOCALHOST, join_network, ros_place

PERIOD, GLANCE = 0.1, 0.002
"""Simulated seconds between two velocities; seconds between two looks."""
DEPTH = 1_000
"""Messages that wait for a look, which may come late on a busy machine: more than a robot says until it arrives."""


def main(patience: str, away: str, *names: str) -> None:
    domain, discovery = ros_place(None, None)
    network = join_network(domain, local=discovery == LOCALHOST)
    clock = network.reader("/clock", Clock, "sensor")
    robots = []
    for number, name in enumerate(names):
        sort = (Twist, TwistStamped)[number % 2]  # old Nav2 and new
        writer = network.writer(f"{name}/cmd_vel", sort, "reliable")
        odom = network.reader(f"{name}/odom", Odometry, "reliable", DEPTH)
        robots.append((Pilot(float(away)), odom, network.reader(f"{name}/scan", LaserScan, "sensor"), sort, writer))
    pilots, lags, now, told = [robot[0] for robot in robots], list[float](), 0.0, -1.0
    ends = time.monotonic() + float(patience)
    while time.monotonic() < ends and any(pilot.arrived < 0.0 for pilot in pilots):
        time.sleep(GLANCE)
        for message in clock.take(1):
            now = seconds(message.clock)
        for pilot, odom, lidar, sort, writer in robots:
            for message in odom.take(DEPTH):
                pose, stamp = message.pose.pose, seconds(message.header.stamp)
                lags.append(time.time() - message.sample_info.source_timestamp * 1e-9)
                turned = 2.0 * atan2(pose.orientation.z, pose.orientation.w)
                pilot.odometry(stamp, pose.position.x, pose.position.y, turned)
            for message in lidar.take(1):
                pilot.scan(message.ranges)
            if now - told >= PERIOD:
                speed, turn = pilot.velocity()
                writer.write(made(sort.__name__, {"speed": speed, "turn_rate": turn}, now))
        told = now if now - told >= PERIOD else told
    print(report(pilots, lags), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
