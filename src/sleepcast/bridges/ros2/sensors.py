"""What a simulated robot of the Nomads' server tells as a ROS 2 robot: which messages, how often, and made of what.

Frames are those of ROS (REP 105). `odom` is where the robot believes to be, by its wheels; it begins at the same place
as `map`, the world's frame, in which `pose` says where it really is. Under `base_link`, which looks along its heading,
are `laser`, a lidar in its middle, and a `sonar_K` for each sonar, from 0 in front, counter-clockwise;
those of a robot with a turret are under `turret`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, inf, isnan, pi, remainder, sin
from typing import Any, NamedTuple

from sleepcast.bridges.ros2.messages import (
    BatteryState,
    Bool,
    Header,
    Imu,
    LaserScan,
    Odometry,
    PoseStamped,
    Range,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    made,
    time_of,
    turned_by,
)
from sleepcast.robot import ServedRobot

OFTEN, SELDOM, RARELY = 0.04, 0.2, 1.0
"""Simulated seconds between two messages."""
GRAVITY = 9.80665
"""m/s2, which every accelerometer at rest measures upwards."""
UNSEEN = 2.0 * OFTEN
"""Simulated seconds after which the inertial unit begins anew: nobody has listened meanwhile."""


class PublishedTopic(NamedTuple):
    """A topic that a robot tells. message: the class of its messages. every: simulated s between two. depth: how many
    are kept for who listens. make: those that are due now, at a simulated time, s."""

    topic: str
    message: type[Any]
    every: float
    depth: int
    make: Callable[[RobotSensors, float], Sequence[Any]]


class RobotSensors:
    """See the module. robot: the one that is told of."""

    def __init__(self, robot: ServedRobot) -> None:
        self._robot, self._world = robot, robot.world
        self._before: tuple[float, float, float] | None = None
        """When the inertial unit last measured, and heading and speed then."""

    def odometry(self, now: float) -> Sequence[Any]:
        """Where it believes to be, m and rad in `odom`, and its speeds by its wheels, in `base_link`."""
        believed, (speed, turn_rate) = self._robot.condition().believed, self._motion()
        values = {"x": believed.x, "y": believed.y, "heading": believed.heading}
        return [made("Odometry", {**values, "speed": speed, "turn_rate": turn_rate}, now, "odom")]

    def transforms(self, now: float) -> Sequence[Any]:
        """The same as a transform, and where its turret looks if it has one."""
        believed, header = self._robot.condition().believed, Header(time_of(now), "odom")
        transforms = [_transform(header, "base_link", believed.x, believed.y, believed.heading)]
        if self._robot.steers:
            turret = believed.turret - believed.heading
            transforms.append(_transform(Header(header.stamp, "base_link"), "turret", 0.0, 0.0, turret))
        return [TFMessage(transforms)]

    def pose(self, now: float) -> Sequence[Any]:
        """Where it really is, m and rad in `map`."""
        real = self._robot.condition().real
        return [made("PoseStamped", {"x": real.x, "y": real.y, "heading": real.heading}, now, "map")]

    def inertia(self, now: float) -> Sequence[Any]:
        """Its real heading, and by what has changed since the last time its turn rate, rad/s, and accelerations, m/s2,
        in `base_link`."""
        heading, (speed, _), before = self._robot.condition().real.heading, self._motion(), self._before
        self._before = now, heading, speed
        if before is None or not 0.0 < now - before[0] <= UNSEEN:
            return []
        passed = now - before[0]
        turned = remainder(heading - before[1], 2.0 * pi) / passed
        values = {"heading": heading, "turn_rate": turned, "acceleration": (speed - before[2]) / passed}
        return [
            made("Imu", {**values, "side_acceleration": speed * turned, "up_acceleration": GRAVITY}, now, "base_link")
        ]

    def scan(self, now: float) -> Sequence[Any]:
        """All beams of its lidar at one moment: m from the middle of the body, counter-clockwise; infinite where
        nothing is in reach, minus infinite where something is too near (REP 117)."""
        beams, first, increment, least, most = self._world.lidar(self._robot.robot)
        return [
            LaserScan(
                Header(time_of(now), "laser"),
                angle_min=first,
                angle_max=first + increment * (beams - 1),
                angle_increment=increment,
                scan_time=SELDOM,
                range_min=least,
                range_max=most,
                ranges=list(self._world.scan(self._robot.robot)),
            )
        ]

    def sonars(self, now: float) -> Sequence[Any]:
        """One message for each sonar that has fired: m from the rim of the body; infinite where it heard nothing."""
        beam, least, most = self._world.sonar(self._robot.robot)
        return [
            Range(
                Header(time_of(now), f"sonar_{number}"),
                field_of_view=beam,
                min_range=least,
                max_range=most,
                range=reading if reading < most else inf,
            )
            for number, reading in enumerate(self._robot.condition().sonars)
            if not isnan(reading)
        ]

    def bumper(self, now: float) -> Sequence[Any]:
        """Whether it touches something."""
        return [Bool(bool(self._robot.condition().touched))]

    def battery(self, now: float) -> Sequence[Any]:
        """Its charge, as a share; nothing else of its battery is simulated."""
        return [made("BatteryState", {"percentage": self._robot.condition().battery}, now, "base_link")]

    def fixed(self) -> TFMessage:
        """Where its sensors are, which is said once."""
        stamp, away = time_of(0.0), self._world.radius(self._robot.robot)
        count = len(self._robot.condition().sonars)
        ring = Header(stamp, "turret" if self._robot.steers else "base_link")
        transforms = [_transform(Header(stamp, "base_link"), "laser", 0.0, 0.0, 0.0)]
        for number in range(count):
            angle = 2.0 * pi * number / count
            transforms.append(_transform(ring, f"sonar_{number}", away * cos(angle), away * sin(angle), angle))
        return TFMessage(transforms)

    def _motion(self) -> tuple[float, float]:
        """Speed along its heading, m/s, and turn rate, rad/s, by its wheels."""
        first, second, _ = self._robot.condition().speeds
        if self._robot.steers:
            return first, second
        return (first + second) / 2.0, (first - second) / self._world.track(self._robot.robot)


def _transform(header: Header, child: str, x: float, y: float, heading: float) -> TransformStamped:
    return TransformStamped(header, child, Transform(Vector3(x, y), turned_by(heading)))


TOLD = (
    PublishedTopic("odom", Odometry, OFTEN, 10, RobotSensors.odometry),
    PublishedTopic("tf", TFMessage, OFTEN, 10, RobotSensors.transforms),
    PublishedTopic("pose", PoseStamped, OFTEN, 10, RobotSensors.pose),
    PublishedTopic("imu", Imu, OFTEN, 10, RobotSensors.inertia),
    PublishedTopic("bumper", Bool, OFTEN, 10, RobotSensors.bumper),
    PublishedTopic("scan", LaserScan, SELDOM, 5, RobotSensors.scan),
    PublishedTopic("sonar", Range, SELDOM, 32, RobotSensors.sonars),
    PublishedTopic("battery_state", BatteryState, RARELY, 5, RobotSensors.battery),
)
"""What every robot tells, within its namespace."""
