"""A ROS 2 robot on this computer, as far as its bridge needs one: it drives as /NAMESPACE/cmd_vel says, and tells where
it is, what its lidar sees and how full its battery is.

    python tests/bridges/ros2_robot.py NAMESPACE DOMAIN [SIMULATED]

With a third argument it says at /clock what time it is: as many s as that since the start. It prints what it hears at
its latched topic, a line each.
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

from sleepcast.bridges.ros2_link import QOS, join
from sleepcast.bridges.ros2_messages import (
    BatteryState,
    Bool,
    Clock,
    Header,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Twist,
    TwistWithCovariance,
    Vector3,
    time_of,
)

TICK = 0.02
FORGOTTEN = 0.5
"""Seconds after which a robot's base forgets what it was told."""
WALL = 2.0
"""m to what its lidar sees in front."""


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


def main(namespace: str, domain: str, factor: str = "") -> None:
    over, wheels = OverDds(namespace, int(domain)), Wheels()
    odom, lidar = over.writer("odom", Odometry), over.writer("scan", LaserScan)
    battery, clock = over.writer("battery_state", BatteryState, "reliable"), over.writer("/clock", Clock)
    told, stop = over.reader("cmd_vel", Twist), over.reader("stop", Bool, "latched")
    print("is up", flush=True)
    began = heard = time.monotonic()
    while True:
        time.sleep(TICK)
        now = time.monotonic()
        for twist in heard_at(told):
            heard, wheels.speed, wheels.turn_rate = now, twist.linear.x, twist.angular.z
        if now - heard > FORGOTTEN:
            wheels.speed = wheels.turn_rate = 0.0
        for each in heard_at(stop):
            print("stopped" if each.data else "free", flush=True)
        wheels.advance(TICK)
        stamp = time_of(float(factor) * (now - began) + TICK if factor else time.time())
        header, half = Header(stamp, "odom"), wheels.heading / 2.0
        if factor:
            clock.write(Clock(stamp))
        pose = Pose(Point(wheels.x, wheels.y), Quaternion(z=sin(half), w=cos(half)))
        twist = Twist(Vector3(wheels.speed), Vector3(z=wheels.turn_rate))
        odom.write(Odometry(header, "base_link", PoseWithCovariance(pose), TwistWithCovariance(twist)))
        lidar.write(scan(header))
        battery.write(BatteryState(header, voltage=12.1, percentage=0.8))


if __name__ == "__main__":
    main(*sys.argv[1:])
