"""The planner of pilot.py in real ROS 2: `python rclpy_planner.py SECONDS AWAY NAMESPACE...`. It drives by simulated
time, and prints a line of JSON when all have arrived, or so many seconds have passed on the wall."""

import math
import sys
import time

import rclpy  # type: ignore[import-not-found]
from geometry_msgs.msg import Twist, TwistStamped  # type: ignore[import-not-found]
from nav_msgs.msg import Odometry  # type: ignore[import-not-found]
from pilot import Pilot, report
from rclpy.executors import SingleThreadedExecutor  # type: ignore[import-not-found]
from rclpy.node import Node  # type: ignore[import-not-found]
from rclpy.parameter import Parameter  # type: ignore[import-not-found]
from rclpy.qos import qos_profile_sensor_data  # type: ignore[import-not-found]
from sensor_msgs.msg import LaserScan  # type: ignore[import-not-found]

PERIOD = 0.1
DEPTH = 1_000  # messages that may wait, which on a busy machine they do


class Planner(Node):  # type: ignore[misc]
    def __init__(self, away: float, names: list[str]) -> None:
        super().__init__("planner", parameter_overrides=[Parameter("use_sim_time", value=True)])
        self.pilots = [Pilot(away) for _ in names]
        self.lags: list[float] = []
        self.speaking = []
        for number, (pilot, name) in enumerate(zip(self.pilots, names, strict=True)):
            self.create_subscription(Odometry, f"{name}/odom", self.heard_by(pilot), DEPTH)
            self.create_subscription(LaserScan, f"{name}/scan", self.seen_by(pilot), qos_profile_sensor_data)
            sort = (Twist, TwistStamped)[number % 2]  # old Nav2 and new
            self.speaking.append((pilot, sort, self.create_publisher(sort, f"{name}/cmd_vel", 10)))
        self.create_timer(PERIOD, self.drive)

    def heard_by(self, pilot):  # type: ignore[no-untyped-def]
        def heard(odometry, info) -> None:  # type: ignore[no-untyped-def]
            self.lags.append(time.time() - info["source_timestamp"] * 1e-9)
            pose, now = odometry.pose.pose, odometry.header.stamp.sec + odometry.header.stamp.nanosec * 1e-9
            turned = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
            pilot.odometry(now, pose.position.x, pose.position.y, turned)

        return heard

    def seen_by(self, pilot):  # type: ignore[no-untyped-def]
        return lambda scan: pilot.scan(list(scan.ranges))

    def drive(self) -> None:
        for pilot, sort, publisher in self.speaking:
            speed, turn = pilot.velocity()
            message = sort()
            twist = message
            if sort is TwistStamped:
                message.header.stamp, twist = self.get_clock().now().to_msg(), message.twist
            twist.linear.x, twist.angular.z = speed, turn
            publisher.publish(message)


rclpy.init()
planner = Planner(float(sys.argv[2]), sys.argv[3:])
executor = SingleThreadedExecutor()
executor.add_node(planner)
ends = time.monotonic() + float(sys.argv[1])
while time.monotonic() < ends and any(pilot.arrived < 0.0 for pilot in planner.pilots):
    executor.spin_once(timeout_sec=0.1)
print(report(planner.pilots, planner.lags), flush=True)
