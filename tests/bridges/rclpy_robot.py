"""The robots of ros2_robot.py in real ROS 2, for a Python that has rclpy: `python rclpy_robot.py NAMESPACE...`, with
the domain, and where others are looked for, in the environment as ROS has it. See CONTRIBUTING.md."""

import math
import sys

import rclpy  # type: ignore[import-not-found]
from geometry_msgs.msg import PoseStamped, Twist  # type: ignore[import-not-found]
from nav_msgs.msg import Odometry  # type: ignore[import-not-found]
from rclpy.node import Node  # type: ignore[import-not-found]
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data  # type: ignore[import-not-found]
from sensor_msgs.msg import BatteryState, Imu, LaserScan, Range  # type: ignore[import-not-found]
from std_msgs.msg import Bool  # type: ignore[import-not-found]

TICK, FORGOTTEN, WALL = 0.05, 0.5, 2.0
RAYS = 360


class Robot:
    def __init__(self, node: Node, namespace: str) -> None:
        def topic(name: str) -> str:
            return f"{namespace}/{name}"

        self.node, self.namespace = node, namespace
        self.x = self.y = self.heading = self.speed = self.turn_rate = 0.0
        self.heard = node.get_clock().now().nanoseconds
        self.stopped: bool | None = None
        self.odom = node.create_publisher(Odometry, topic("odom"), qos_profile_sensor_data)
        self.scan = node.create_publisher(LaserScan, topic("scan"), qos_profile_sensor_data)
        self.battery = node.create_publisher(BatteryState, topic("battery_state"), 10)
        self.imu = node.create_publisher(Imu, topic("imu"), qos_profile_sensor_data)
        self.sonar = node.create_publisher(Range, topic("sonar"), qos_profile_sensor_data)
        node.create_subscription(Twist, topic("cmd_vel"), self.drive, 10)
        node.create_subscription(PoseStamped, topic("goal_pose"), self.navigate, 10)
        node.create_subscription(BatteryState, topic("dashboard"), self.show, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(Bool, topic("stop"), self.stop, latched)

    def drive(self, twist: Twist) -> None:
        self.heard = self.node.get_clock().now().nanoseconds
        if bool(self.speed) != bool(twist.linear.x):
            print(self.namespace, "moves" if twist.linear.x else "rests", flush=True)
        self.speed, self.turn_rate = twist.linear.x, twist.angular.z

    def navigate(self, goal: PoseStamped) -> None:
        place = goal.pose.position
        print(self.namespace, f"goal {goal.header.frame_id} {place.x:g} {place.y:g}", flush=True)

    def show(self, battery: BatteryState) -> None:
        print(self.namespace, f"shows {battery.percentage:g}", flush=True)

    def stop(self, message: Bool) -> None:
        if self.stopped is not message.data:
            print(self.namespace, "stopped" if message.data else "free", flush=True)
        self.stopped = message.data

    def tick(self, turn: int) -> None:
        now = self.node.get_clock().now()
        if now.nanoseconds - self.heard > FORGOTTEN * 1e9 and self.speed:
            self.speed = self.turn_rate = 0.0
            print(self.namespace, "rests", flush=True)
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
        if turn % 4:
            return
        scan = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=2.0 * math.pi / RAYS)
        scan.header.stamp, scan.range_min, scan.range_max = stamp, 0.1, 3.5
        scan.ranges = [WALL if abs(ray - RAYS // 2) <= 5 else math.inf for ray in range(RAYS)]
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


def main(*namespaces: str) -> None:
    rclpy.init()
    node = Node("robots", start_parameter_services=False)
    robots = [Robot(node, namespace) for namespace in namespaces]
    turns = iter(range(sys.maxsize))

    def tick() -> None:
        turn = next(turns)
        for robot in robots:
            robot.tick(turn)

    node.create_timer(TICK, tick)
    print("up", flush=True)
    rclpy.spin(node)


main(*sys.argv[1:])
