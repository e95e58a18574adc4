"""The robot of ros2_robot.py in real ROS 2, for a Python that has rclpy: `python rclpy_robot.py NAMESPACE`, with the
domain, and where others are looked for, in the environment as ROS has it. See CONTRIBUTING.md."""

import math
import sys

import rclpy  # type: ignore[import-not-found]
from geometry_msgs.msg import Twist  # type: ignore[import-not-found]
from nav_msgs.msg import Odometry  # type: ignore[import-not-found]
from rclpy.node import Node  # type: ignore[import-not-found]
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data  # type: ignore[import-not-found]
from sensor_msgs.msg import BatteryState, Imu, LaserScan, Range  # type: ignore[import-not-found]
from std_msgs.msg import Bool  # type: ignore[import-not-found]

TICK, FORGOTTEN, WALL = 0.02, 0.5, 2.0


class Robot(Node):  # type: ignore[misc]
    def __init__(self, namespace: str) -> None:
        super().__init__("robot", namespace=namespace)
        self.x = self.y = self.heading = self.speed = self.turn_rate = 0.0
        self.heard = self.get_clock().now().nanoseconds
        self.odom = self.create_publisher(Odometry, "odom", qos_profile_sensor_data)
        self.scan = self.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self.battery = self.create_publisher(BatteryState, "battery_state", 10)
        self.imu = self.create_publisher(Imu, "imu", qos_profile_sensor_data)
        self.sonar = self.create_publisher(Range, "sonar", qos_profile_sensor_data)
        self.create_subscription(Twist, "cmd_vel", self.drive, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(Bool, "stop", self.stop, latched)
        self.create_timer(TICK, self.tick)

    def drive(self, twist: Twist) -> None:
        self.heard = self.get_clock().now().nanoseconds
        self.speed, self.turn_rate = twist.linear.x, twist.angular.z

    def stop(self, message: Bool) -> None:
        print("stopped" if message.data else "free", flush=True)

    def tick(self) -> None:
        now = self.get_clock().now()
        if now.nanoseconds - self.heard > FORGOTTEN * 1e9:
            self.speed = self.turn_rate = 0.0
        self.heading += self.turn_rate * TICK
        self.x += self.speed * math.cos(self.heading) * TICK
        self.y += self.speed * math.sin(self.heading) * TICK
        stamp = now.to_msg()
        odom = Odometry()
        odom.header.stamp, odom.header.frame_id, odom.child_frame_id = stamp, "odom", "base_link"
        odom.pose.pose.position.x, odom.pose.pose.position.y = self.x, self.y
        odom.pose.pose.orientation.z = math.sin(self.heading / 2.0)
        odom.pose.pose.orientation.w = math.cos(self.heading / 2.0)
        odom.twist.twist.linear.x, odom.twist.twist.angular.z = self.speed, self.turn_rate
        self.odom.publish(odom)
        scan = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=math.pi / 360.0)
        scan.header.stamp, scan.range_min, scan.range_max = stamp, 0.1, 3.5
        ranges = [math.inf] * 720
        ranges[350:371] = [WALL] * 21
        scan.ranges = ranges
        self.scan.publish(scan)
        battery = BatteryState(voltage=12.1, percentage=0.8)
        battery.header.stamp = stamp
        self.battery.publish(battery)
        imu = Imu()
        imu.header.stamp, imu.angular_velocity.z = stamp, self.turn_rate
        self.imu.publish(imu)
        sonar = Range(min_range=0.1, max_range=4.0, range=1.5)
        sonar.header.stamp = stamp
        self.sonar.publish(sonar)


rclpy.init()
robot = Robot(sys.argv[1])
print("is up", flush=True)
rclpy.spin(robot)
