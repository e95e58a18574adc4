"""ROS 2 robots on this computer, as far as their bridge needs them: each drives as /NAMESPACE/cmd_vel says, and tells
where it is, what its lidar sees and how full its battery is.

    python tests/bridges/ros2_robot.py DOMAIN FACTOR NAMESPACE...

With a FACTOR above 0 it says at /clock what time it is: as many s as that since the start. It prints, a line each, what
they hear at their latched topics, and when they begin to move and to rest.
"""

from __future__ import annotations

import os
import sys
import time
from math import cos, inf, pi, sin
from typing import Any

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from sleepcast.bridges.ros2.link import QOS, join
from sleepcast.bridges.ros2.messages import (
    BatteryState,
    Bool,
    Clock,
    Header,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Twist,
    TwistWithCovariance,
    Vector3,
    time_of,
    turned_by,
)

TICK = 0.02
FORGOTTEN = 0.5
"""Seconds after which a robot's base forgets what it was told."""
WALL = 2.0
"""m to what its lidar sees in front."""


def domain_for(use: int) -> int:
    """A ROS domain of this process alone: two tests that meet there would find each other's robots. use: from 0 to 4.
    Up to 101, no other program gets their ports by chance."""
    return 1 + (5 * os.getpid() + use) % 100


class Wheels:
    """What moves."""

    def __init__(self) -> None:
        self.x = self.y = self.heading = self.speed = self.turn_rate = 0.0

    def advance(self, seconds: float) -> None:
        self.heading += self.turn_rate * seconds
        self.x += self.speed * cos(self.heading) * seconds
        self.y += self.speed * sin(self.heading) * seconds


def scan(header: Header) -> LaserScan:
    """Two rays a degree: a wall in front, something too near on the left, nothing elsewhere."""
    ranges = [inf] * 720
    ranges[350:371] = [WALL] * 21
    ranges[540] = 0.01
    return LaserScan(header, -pi, pi, pi / 360.0, range_min=0.1, range_max=3.5, ranges=ranges)


class OverDds:
    """Its topics."""

    def __init__(self, namespace: str, domain: int) -> None:
        join(domain, True)
        self.participant, self.namespace = DomainParticipant(domain), namespace

    def writer(self, name: str, sort: Any, qos: str = "sensor") -> DataWriter[Any]:
        return DataWriter(self.participant, self._topic(name, sort), QOS[qos])

    def reader(self, name: str, sort: Any, qos: str = "reliable") -> DataReader[Any]:
        return DataReader(self.participant, self._topic(name, sort), QOS[qos])

    def _topic(self, name: str, sort: Any) -> Topic[Any]:
        return Topic(self.participant, f"rt{name if name[0] == '/' else self.namespace + '/' + name}", sort)


def heard_at(reader: DataReader[Any]) -> list[Any]:
    """What came; that somebody has gone is no message."""
    return [message for message in reader.take(1) if message.sample_info.valid_data]


class OneRobot:
    """A robot with its topics."""

    def __init__(self, over: OverDds, namespace: str) -> None:
        def topic(name: str) -> str:
            return f"{namespace}/{name}"

        self.namespace, self.wheels, self.heard = namespace, Wheels(), time.monotonic()
        self.stopped: bool | None = None
        self.odom, self.lidar = over.writer(topic("odom"), Odometry), over.writer(topic("scan"), LaserScan)
        self.battery = over.writer(topic("battery_state"), BatteryState, "reliable")
        self.told, self.stop = over.reader(topic("cmd_vel"), Twist), over.reader(topic("stop"), Bool, "latched")

    def tick(self, now: float, header: Header) -> None:
        wheels, moved = self.wheels, self.wheels.speed != 0.0
        for twist in heard_at(self.told):
            self.heard, wheels.speed, wheels.turn_rate = now, twist.linear.x, twist.angular.z
        if now - self.heard > FORGOTTEN:
            wheels.speed = wheels.turn_rate = 0.0
        if (wheels.speed != 0.0) is not moved:
            print(self.namespace, "rests" if moved else "moves", flush=True)
        for each in heard_at(self.stop):
            if each.data is not self.stopped:
                print(self.namespace, "stopped" if each.data else "free", flush=True)
            self.stopped = each.data
        wheels.advance(TICK)
        pose = Pose(Point(wheels.x, wheels.y), turned_by(wheels.heading))
        twist = Twist(Vector3(wheels.speed), Vector3(z=wheels.turn_rate))
        self.odom.write(Odometry(header, "base_link", PoseWithCovariance(pose), TwistWithCovariance(twist)))
        self.lidar.write(scan(header))
        self.battery.write(BatteryState(header, voltage=12.1, percentage=0.8))


def main(domain: str, factor: str, *namespaces: str) -> None:
    over, fast = OverDds("", int(domain)), float(factor)
    robots, clock = [OneRobot(over, namespace) for namespace in namespaces], over.writer("/clock", Clock)
    print("up", flush=True)
    began = time.monotonic()
    while True:
        time.sleep(TICK)
        now = time.monotonic()
        stamp = time_of(fast * (now - began) + TICK if fast else time.time())
        if fast:
            clock.write(Clock(stamp))
        for robot in robots:
            robot.tick(now, Header(stamp, "odom"))


if __name__ == "__main__":
    main(*sys.argv[1:])
