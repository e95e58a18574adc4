"""What ROS 2 and Cyclone DDS do, as docs/counterparts.md says."""

from __future__ import annotations

import math
import os
import subprocess
import time
from collections.abc import Callable

import pytest

import families

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed here")

from cyclonedds.core import Policy, Qos
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from bridges.ros2_robot import OverDds, domain_for, heard_at
from sleepcast.bridges.ros2.messages import Header, Range

DOMAIN = domain_for(4)
PLACE = {"ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
PATIENCE = 60.0


def until(true: Callable[[], object]) -> None:
    ends = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < ends
        time.sleep(0.02)


def said_by_ros(program: str, **changes: str) -> subprocess.CompletedProcess[str]:
    command = [str(families.ROS), "-c", program]
    return subprocess.run(
        command, env={**os.environ, **PLACE, **changes}, capture_output=True, text=True, check=False, timeout=PATIENCE
    )


WHOLE = """
from geometry_msgs.msg import Twist
from rclpy.serialization import deserialize_message, serialize_message
for value in (1, -1):
    twist = Twist()
    twist.linear.x = value
    print(deserialize_message(serialize_message(twist), Twist).linear.x)
"""


@pytest.mark.counterpart("ros-jazzy-rclpy")
def test_rclpy_sends_a_whole_number_as_its_bytes() -> None:
    one, less = map(float, said_by_ros(WHOLE, ROS_PYTHON_CHECK_FIELDS="0").stdout.split())
    assert one == 5e-324
    assert math.isnan(less)
    assert "must be of type 'float'" in said_by_ros(WHOLE, ROS_PYTHON_CHECK_FIELDS="1").stderr


QUEUE = """
import rclpy
from std_msgs.msg import Bool, Int32
rclpy.init()
node = rclpy.create_node("slow")
heard = []
hearer = node.create_subscription(Int32, "number", lambda message: heard.append(message.data), 10)
speaker = node.create_publisher(Int32, "number", 10)
while not speaker.get_subscription_count():
    rclpy.spin_once(node, timeout_sec=0.1)
for number in range(15):
    speaker.publish(Int32(data=number))
speaker.wait_for_all_acked()
while len(heard) < 10:
    rclpy.spin_once(node, timeout_sec=1.0)
rclpy.spin_once(node, timeout_sec=0.5)
print(heard)
"""


@pytest.mark.counterpart("ros-jazzy-rclpy", "ros-jazzy-rmw-fastrtps-cpp")
def test_what_came_while_nobody_looked_is_heard_first() -> None:
    done = said_by_ros(QUEUE)
    assert done.stdout.split("\n")[-2] == str([*range(5, 15)]), done.stderr


SILENT = """
import rclpy
from rclpy.lifecycle import LifecycleNode
from std_msgs.msg import Bool
rclpy.init()
node = LifecycleNode("driver")
speaker = node.create_lifecycle_publisher(Bool, "word", 10)
heard = []
other = rclpy.create_node("other")
hearer = other.create_subscription(Bool, "word", lambda message: heard.append(message.data), 10)
while not other.count_publishers("word") or not speaker.get_subscription_count():
    rclpy.spin_once(other, timeout_sec=0.1)
speaker.publish(Bool(data=False))
node.trigger_configure(), node.trigger_activate()
speaker.publish(Bool(data=True))
while not heard:
    rclpy.spin_once(other, timeout_sec=1.0)
print(heard)
"""


@pytest.mark.counterpart("ros-jazzy-rclpy")
def test_a_lifecycle_node_that_is_not_active_has_topics_and_drops_what_it_publishes() -> None:
    done = said_by_ros(SILENT)
    assert (done.stdout, done.stderr) == ("[True]\n", "")


@pytest.mark.counterpart("cyclonedds")
def test_what_does_not_fit_into_a_field_is_a_plain_exception_and_a_nul_is_written() -> None:
    for message in (Range(range=1e39), Range(radiation_type=300)):
        with pytest.raises(Exception, match="Failed to encode member") as raised:
            message.serialize()
        assert type(raised.value) is Exception
    assert Header(frame_id="a\0b").serialize().endswith(b"a\0b\0")


GARBLED = """
import time
import rclpy
from std_msgs.msg import Header
rclpy.init()
speaker = rclpy.create_node("garbled").create_publisher(Header, "word", 10)
while True:
    speaker.publish(b"\\0\\1\\0\\0" + b"\\xff" * 16)
    speaker.publish(Header(frame_id="a word"))
    time.sleep(0.05)
"""


@pytest.mark.counterpart("cyclonedds", "ros-jazzy-rclpy")
def test_bytes_that_are_no_message_never_come_and_are_told_on_standard_error(capfd: pytest.CaptureFixture[str]) -> None:
    """Fast DDS writes any: here a text of 4 GB of which nothing follows."""
    reader = OverDds("/garbled", DOMAIN).reader("/word", Header)
    process = subprocess.Popen([str(families.ROS), "-c", GARBLED], env={**os.environ, **PLACE})
    heard = list[str]()
    try:
        until(lambda: heard.extend(each.frame_id for each in heard_at(reader)) or len(heard) >= 5)  # type: ignore[func-returns-value]
    finally:
        process.kill()
        process.wait()
    assert set(heard) == {"a word"}
    assert "deserialization" in capfd.readouterr().err


@pytest.mark.counterpart("cyclonedds")
@pytest.mark.parametrize(("said", "kept"), [(False, [6.0]), (True, [2.0, 3.0, 4.0, 5.0, 6.0])])
def test_a_latched_writer_keeps_one_message_unless_it_says_how_many(said: bool, kept: list[float]) -> None:
    over, five = OverDds("/late", DOMAIN), Policy.History.KeepLast(5)
    latched = (Policy.Reliability.Reliable(10**9), Policy.Durability.TransientLocal)
    service = (Policy.DurabilityService(0, five, -1, -1, -1),) if said else ()
    topic = Topic(over.participant, f"rt/late/{said}", Range)
    writer = DataWriter(over.participant, topic, Qos(*latched, five, *service))
    for number in range(7):
        writer.write(Range(range=float(number)))
    reader = DataReader(over.participant, topic, Qos(*latched, Policy.History.KeepLast(10)))
    heard = list[float]()
    until(lambda: heard.extend(each.range for each in heard_at(reader)) or 6.0 in heard)  # type: ignore[func-returns-value]
    assert heard == kept
