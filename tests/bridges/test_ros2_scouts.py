"""Simulated Scouts as ROS 2 robots: what they tell is so, who drives them, STOP, and what is refused.

The other end is real DDS in this process, while time is let pass by hand; then the command itself with planners in
other processes, twenty robots at once, also where a fifth of everything is lost. With SLEEPCAST_RCLPY, planners of real
ROS 2: see CONTRIBUTING.md.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from math import atan2, cos, inf, isclose, nan, pi, radians, remainder, sin
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed here")

from benchmarks.channel.lab import Lab, why_not
from cyclonedds._clayer import ddspy_write
from cyclonedds.pub import DataWriter

from bridges.ros2_robot import domain_for
from cli.calling import called
from nomad.programs import Bench
from processes import start
from sleepcast.bridges import open_robot
from sleepcast.bridges.ros2 import link as links
from sleepcast.bridges.ros2.link import Ros2Network
from sleepcast.bridges.ros2.mapping import CLOCK
from sleepcast.bridges.ros2.messages import (
    READ,
    BatteryState,
    Bool,
    Clock,
    Imu,
    LaserScan,
    Odometry,
    Range,
    ShortRange,
    TFMessage,
    Twist,
    TwistStamped,
    Vector3,
    made,
    read,
    seconds,
)
from sleepcast.bridges.ros2.robot import join_network
from sleepcast.bridges.ros2.scouts import FORGOTTEN, MAX_ROBOTS, NO_FLOAT, Ros2Scouts, namespaces
from sleepcast.bridges.ros2.sensors import GRAVITY
from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.nomad.client.nomad import Nomad
from sleepcast.nomad.wire.requests import RequestType
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.sites import LIDAR
from sleepcast.robot import Pose, Setpoint

PATIENCE = 60.0
"""Seconds that a busy machine may take."""
RCLPY = os.environ.get("SLEEPCAST_RCLPY")
"""A Python that has rclpy."""
HERE = Path(__file__).parent
DOMAIN = domain_for(4)
BOX = [(1.0, -0.5), (2.0, -0.5), (2.0, 0.5), (1.0, 0.5)]
TELLS = {"odom": "Odometry", "pose": "PoseStamped", "imu": "Imu", "scan": "LaserScan", "battery_state": "BatteryState"}
MANY = 20
REASON = why_not()
EVERYTHING = "meta l4proto udp"
"""That the air may lose."""


class Scene(Bench):
    """A server whose robots are in ROS 2, and other programs there. Time passes while something is waited for."""

    def __init__(self, robots: int, setup: str, domain: int, world: Path | None = None) -> None:
        super().__init__(nomad_world(world, setup, robots, 1))
        self.networks = [join_network(domain, local=True)]
        self.scouts = Ros2Scouts(self.nserver, self.networks[0], namespaces("scout", robots))
        self.nserver.companions.append(self.scouts)
        self.robot = self.nserver.service.simulated_robots[0]

    def elsewhere(self) -> Ros2Network:
        """Another program's way into the domain."""
        self.networks.append(join_network(self.networks[0].domain, local=True))
        return self.networks[-1]

    def until(self, true: Callable[[], Any], what: str = "") -> None:
        ends = time.monotonic() + PATIENCE
        while not true():
            assert time.monotonic() < ends, (what, self.said)
            self.nserver.step()
            self.scouts.look()
            time.sleep(0.002)

    def let_pass(self, simulated: float) -> None:
        ends = self.world.time + simulated
        self.until(lambda: self.world.time >= ends)

    def speed(self) -> float:
        first, second, _ = self.world.observe(0).speeds
        return (first + second) / 2.0

    def has_said(self, text: str) -> Callable[[], bool]:
        return lambda: any(text in line for line in self.said)

    def writer(self, topic: str, message: type[Any], qos: str = "reliable") -> DataWriter[Any]:
        """Of another program; the robot listens to it."""
        writer = self.elsewhere().writer(topic, message, qos)
        self.until(writer.get_matched_subscriptions)
        return writer


@pytest.fixture
def scene(request: pytest.FixtureRequest) -> Iterator[Scene]:
    made = Scene(*getattr(request, "param", (1, "ideal")), DOMAIN)
    yield made
    made.scouts._close()
    for network in made.networks[1:]:
        network.close()


def ahead(speed: float, turn_rate: float = 0.0) -> Twist:
    return Twist(Vector3(speed), Vector3(z=turn_rate))


def driving(scene: Scene, speed: float = 0.3) -> DataWriter[Any]:
    """A program that has set robot 1 in motion."""
    writer = scene.writer("/scout1/cmd_vel", Twist)
    writer.write(ahead(speed))
    scene.until(lambda: isclose(scene.speed(), speed))
    return writer


# ---- who drives


def test_a_velocity_holds_for_half_a_second_of_simulated_time(scene: Scene) -> None:
    writer = driving(scene)
    began = scene.world.time
    scene.until(lambda: scene.speed() == 0.0)
    assert scene.world.time - began < FORGOTTEN + 0.5
    assert scene.said[-1] == (
        "ROS 2 program 1 gave no velocity by /scout1/cmd_vel for 0.5 s of simulated time: robot 1 rests"
    )
    writer.write(ahead(0.2, 0.4))
    scene.until(lambda: isclose(scene.speed(), 0.2))
    first, second, _ = scene.world.observe(0).speeds
    assert isclose((first - second) / scene.world.track(0), 0.4)
    assert scene.robot.window.client == "ROS 2 program 1"
    assert (scene.robot.window.commands[-1][1]) == "0.2 m/s, 0.4 rad/s"


def test_a_program_that_goes_leaves_its_robot_at_rest(scene: Scene) -> None:
    driving(scene)
    scene.networks.pop().close()
    scene.until(scene.has_said("ROS 2 program 1 is gone: robot 1 rests"))
    scene.until(lambda: scene.speed() == 0.0)
    assert scene.robot.window.client == ""
    assert not scene.has_said("gave no velocity")()


def test_velocities_with_times_drive_as_well_and_foreign_clocks_are_told(scene: Scene) -> None:
    writer = scene.writer("/scout1/cmd_vel", TwistStamped)
    writer.write(made("TwistStamped", {"speed": 0.2}, scene.world.time))
    scene.until(lambda: isclose(scene.speed(), 0.2))
    assert not scene.has_said("set use_sim_time")()
    writer.write(made("TwistStamped", {"speed": 0.3}, 1.7e9))
    scene.until(lambda: isclose(scene.speed(), 0.3))
    assert scene.has_said("times by ROS 2 program 1 are 1.7e+09 s ahead of /clock: set use_sim_time there")()


@pytest.mark.parametrize(
    ("twist", "why"),
    [
        (ahead(nan), "linear.x is nan"),
        (ahead(0.1, -inf), "angular.z is -inf"),
        (ahead(1e9), "linear.x is 1e+09, beyond 1,000"),
        (ahead(5e-324), f"linear.x is 4.94066e-324, {NO_FLOAT}"),  # of 1
        (ahead(0.1, 5.222099017e-315), f"angular.z is 5.2221e-315, {NO_FLOAT}"),  # of numpy.float32(0.5)
        (Twist(Vector3(0.1, nan)), "linear.y is nan"),
    ],
)
def test_what_is_no_velocity_is_refused_and_the_robot_rests(scene: Scene, twist: Twist, why: str) -> None:
    writer = driving(scene)
    for _ in range(3):
        writer.write(twist)
    scene.until(lambda: scene.speed() == 0.0)
    refused = f"/scout1/cmd_vel: {why} by ROS 2 program 1: refused, and robot 1 rests"
    assert scene.said.count(refused) == 1
    assert not scene.has_said("gave no velocity")()
    writer.write(ahead(0.1))
    scene.until(lambda: isclose(scene.speed(), 0.1))
    writer.write(twist)
    scene.until(lambda: scene.said.count(refused) == 2)


def test_faster_than_it_can_is_as_fast_as_it_can(scene: Scene) -> None:
    writer = scene.writer("/scout1/cmd_vel", Twist)

    def keeps_asking() -> bool:
        writer.write(ahead(5.0))
        return isclose(scene.speed(), 1.0)

    scene.until(keeps_asking)


def test_bytes_that_are_no_message_leave_it_at_rest(scene: Scene) -> None:
    writer = driving(scene)
    stamped = scene.writer("/scout1/cmd_vel", TwistStamped)
    text = made("TwistStamped", {"speed": 0.3}, 1.0, "odd").serialize().replace(b"odd", b"\xff\xfe\xfd")
    assert ddspy_write(stamped._ref, text) == 0
    scene.until(lambda: scene.speed() == 0.0)
    assert scene.has_said("/scout1/cmd_vel brings something that is no message: UnicodeDecodeError")()
    writer.write(ahead(0.1))
    scene.until(lambda: isclose(scene.speed(), 0.1))


def test_programs_of_1998_and_of_ros_replace_what_the_other_asks(scene: Scene) -> None:
    program = scene.program()
    driving(scene)
    program.state(RequestType.VM, 50, 50, 0)
    assert (
        scene.said[-1]
        == "robot 1 is driven by ROS 2 program 1 and test (process 4711): each replaces what the other asks"
    )
    assert scene.robot.window.client == "test (process 4711), ROS 2 program 1"
    scene.robot.glance()
    assert scene.robot.window.rivals == "ROS 2 program 1 and test (process 4711)"
    scene.let_pass(2.0 * FORGOTTEN)
    assert isclose(scene.speed(), 50 * 0.00254), "what nobody has replaced goes on"


def test_two_programs_of_ros_are_told_apart(scene: Scene) -> None:
    first, second = driving(scene), driving(scene, 0.2)
    first.write(ahead(0.3))
    second.write(ahead(0.2))
    both = "robot 1 is driven by ROS 2 program 1 and ROS 2 program 2: each replaces what the other asks"
    scene.until(scene.has_said(both))


@pytest.mark.parametrize("scene", [(1, "nomad200")], indirect=True)
def test_wheels_that_steer_are_driven_as_well(scene: Scene) -> None:
    transforms = scene.elsewhere().reader("/scout1/tf", TFMessage, "reliable")
    writer, found = scene.writer("/scout1/cmd_vel", Twist), list[Any]()

    def turned() -> bool:
        writer.write(ahead(0.2, 0.5))
        found.extend(transforms.take(1))
        return bool(found) and scene.world.observe(0).real.heading > 1.0

    scene.until(turned)
    way, turret = found[-1].transforms
    assert (way.child_frame_id, turret.header.frame_id, turret.child_frame_id) == ("base_link", "base_link", "turret")
    condition = scene.world.observe(0)
    assert isclose(condition.speeds.first, 0.2)
    angles = [2.0 * atan2(each.transform.rotation.z, each.transform.rotation.w) for each in (way, turret)]
    assert abs(remainder(sum(angles) - condition.believed.turret, 2.0 * pi)) < 0.1


# ---- STOP


def test_stop_holds_it_for_everybody_until_who_said_so_says_otherwise(scene: Scene) -> None:
    writer, program = driving(scene), scene.program()
    stop, other = scene.writer("/scout1/stop", Bool, "latched"), scene.writer("/scout1/stop", Bool, "latched")
    stop.write(Bool(True))
    scene.until(lambda: scene.robot.held and scene.speed() == 0.0)
    assert "robot 1 must stand, until /scout1/stop says false" in scene.said
    assert scene.robot.window.held == "/scout1/stop"
    program.state(RequestType.VM, 50, 50, 0)
    other.write(Bool(False))

    def keeps_asking() -> bool:
        writer.write(ahead(0.3))
        return scene.world.time > ends

    ends = scene.world.time + 1.0
    scene.until(keeps_asking)
    assert scene.speed() == 0.0
    scene.nserver.hold(True)
    scene.nserver.hold(False)
    assert scene.robot.held, "the page does not end what a program says that is there"
    stop.write(Bool(False))
    scene.until(lambda: not scene.robot.held)
    assert scene.said[-1] == "robot 1 is free again (/scout1/stop)"
    assert scene.speed() == 0.0, "nothing old resumes"
    writer.write(ahead(0.3))
    scene.until(lambda: isclose(scene.speed(), 0.3))


def test_when_who_said_stop_is_gone_anybody_may_end_it(scene: Scene) -> None:
    scene.writer("/scout1/stop", Bool).write(Bool(True))  # as `ros2 topic pub` does, without latching
    scene.until(lambda: scene.robot.held)
    scene.networks.pop().close()
    scene.let_pass(1.0)
    assert scene.robot.held
    stop = scene.writer("/scout1/stop", Bool)
    stop.write(Bool(False))
    scene.until(lambda: not scene.robot.held)
    stop.write(Bool(True))
    scene.until(lambda: scene.robot.held)
    del stop
    scene.networks.pop().close()
    scene.let_pass(1.0)
    assert scene.robot.held
    scene.nserver.hold(True)
    scene.nserver.hold(False)
    assert not scene.robot.held, "by the page, too"


def test_stop_that_was_said_before_it_came_holds_it_from_the_start() -> None:
    network = join_network(DOMAIN, local=True)
    stop = network.writer("/scout1/stop", Bool, "latched")
    stop.write(Bool(True))
    scene = Scene(1, "ideal", DOMAIN)
    scene.until(lambda: scene.robot.held)
    scene.scouts._close()
    network.close()


# ---- what they tell


def test_what_it_tells_is_so(scene: Scene) -> None:
    boxes = [BOX, [(x - 0.2, y + 0.95) for x, y in BOX]]
    assert all(map(scene.world.add, boxes))
    away, found = scene.elsewhere(), dict[str, Any]()
    readers = {name: away.reader(f"/scout1/{name}", READ[sort][0], "reliable") for name, sort in TELLS.items()}

    def told(name: str) -> dict[str, float]:
        return read(TELLS[name], found[name], 0.0)[0]

    def is_new() -> bool:
        for name, reader in readers.items():
            found.update((name, message) for message in reader.take(1))
        return len(found) == len(readers) and all(seconds(each.header.stamp) > since for each in found.values())

    def turns() -> bool:
        writer.write(ahead(0.0, 0.5))
        return is_new() and isclose(told("imu")["turn_rate"], 0.5, rel_tol=1e-3)

    writer, since = driving(scene, 0.1), 0.0
    scene.until(turns)
    assert isclose(told("odom")["turn_rate"], 0.5)
    writer.write(ahead(0.0))
    scene.until(lambda: not any(scene.world.observe(0).moving))
    since = scene.world.time + 0.2
    scene.until(is_new)
    real = scene.world.observe(0).real
    for name in ("odom", "pose"):
        assert [told(name)[each] for each in ("x", "y", "heading")] == pytest.approx(real[:3], abs=1e-9)
    assert [found[name].header.frame_id for name in ("odom", "pose", "scan", "imu")] == [
        "odom",
        "map",
        "laser",
        "base_link",
    ]
    assert (found["odom"].child_frame_id, told("odom")["speed"], told("odom")["turn_rate"]) == ("base_link", 0.0, 0.0)
    assert (told("imu")["up_acceleration"], told("battery_state")["percentage"]) == (GRAVITY, 1.0)
    scan = found["scan"]
    assert len(scan.ranges) * scan.angle_increment == pytest.approx(2.0 * pi)
    rays = [real.heading + scan.angle_min + k * scan.angle_increment for k in range(len(scan.ranges))]
    seen = [to_the_nearest_side(real, angle, boxes) for angle in rays]
    assert min(seen) < 1.0 < LIDAR.reach < max(seen)
    assert scan.ranges == pytest.approx([each if each < LIDAR.reach else inf for each in seen], rel=1e-4)


def to_the_nearest_side(real: Pose, angle: float, boxes: list[list[tuple[float, float]]]) -> float:
    """m in this direction to a box, or to the edge of the empty room."""
    edge, found = 9.144, list[float]()
    dx, dy = cos(angle), sin(angle)
    for corners in (*boxes, [(-edge, -edge), (edge, -edge), (edge, edge), (-edge, edge)]):
        for (x, y), (next_x, next_y) in zip(corners, [*corners[1:], corners[0]], strict=True):
            ex, ey = next_x - x, next_y - y
            if (across := dx * ey - dy * ex) != 0.0:
                along, share = (((x - real.x) * b - (y - real.y) * a) / across for a, b in ((ex, ey), (dx, dy)))
                found += [along] if along > 0.0 and 0.0 <= share <= 1.0 else []
    return min(found)


SCANNED = """
format = 2

[world]
width = "10m"
height = "10m"
edge = "wall"

[[world.walls]]
name = "ahead"
points = [["6m", "4.9m"], ["6m", "5.1m"]]

[[world.walls]]
name = "too near"
points = [["2.9m", "5.25m"], ["3.1m", "5.25m"]]

[laser]
beams = 7
from = "-90deg"
to = "90deg"
least = "0.3m"
range = "4m"

[nomad]
origin = ["3m", "5m"]
"""
SCAN = {
    "frame": "laser",
    "angle_min": pytest.approx(-pi / 2.0),
    "angle_max": pytest.approx(pi / 2.0),
    "angle_increment": pytest.approx(pi / 6.0),
    "time_increment": 0.0,
    "scan_time": pytest.approx(0.2),
    "range_min": pytest.approx(0.3),
    "range_max": 4.0,
    "ranges": pytest.approx([inf, inf, inf, 3.0, inf, inf, -inf]),
}
"""What a scan says there."""


def test_the_scanner_of_a_world_is_told_beam_by_beam(tmp_path: Path) -> None:
    (tmp_path / "world.toml").write_text(SCANNED)
    scene = Scene(1, "ideal", DOMAIN, tmp_path / "world.toml")
    reader, found = scene.elsewhere().reader("/scout1/scan", LaserScan, "sensor"), list[LaserScan]()
    scene.until(lambda: found.extend(reader.take(1)) or found)  # type: ignore[func-returns-value]
    (scan,) = found
    assert {"frame": scan.header.frame_id, **{name: getattr(scan, name) for name in SCAN if name != "frame"}} == SCAN
    scene.scouts._close()
    scene.networks[-1].close()


def test_sonars_and_bumper_tell_what_they_feel(scene: Scene) -> None:
    assert scene.world.add(BOX)
    away = scene.elsewhere()
    sonar, bumper = away.reader("/scout1/sonar", Range, "reliable", 32), away.reader("/scout1/bumper", Bool, "reliable")
    static = away.reader("/scout1/tf_static", TFMessage, "latched")
    writer, found, pressed = scene.writer("/scout1/cmd_vel", Twist), dict[str, Any](), list[bool]()

    def has_bumped() -> bool:
        writer.write(ahead(0.5))
        pressed.extend(message.data for message in bumper.take(1))
        found.update((message.header.frame_id, message) for message in sonar.take(32))
        return len(found) == 16 and pressed[-1]

    scene.until(has_bumped)
    assert not pressed[0]

    def feels_it() -> bool:
        found.update((message.header.frame_id, message) for message in sonar.take(32))
        return bool(found["sonar_0"].range < 0.2)

    scene.until(feels_it)
    behind = found["sonar_8"]
    assert behind.range == inf
    assert (behind.min_range, behind.max_range) == pytest.approx((6 * 0.0254, 255 * 0.0254))
    assert isclose(behind.field_of_view, radians(25.0), rel_tol=1e-6)
    (fixed,) = static.take(1)
    left = next(each for each in fixed.transforms if each.child_frame_id == "sonar_4")
    assert (left.header.frame_id, len(fixed.transforms)) == ("base_link", 17)
    assert (left.transform.translation.x, left.transform.translation.y) == pytest.approx((0.0, 0.17))
    assert 2.0 * atan2(left.transform.rotation.z, left.transform.rotation.w) == pytest.approx(pi / 2.0)


def test_what_nobody_listens_to_is_not_made(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    scans = list[int]()
    monkeypatch.setattr(scene.world, "scan", lambda *_: scans.append(1) or (1.0,))  # type: ignore[func-returns-value]
    scene.let_pass(1.0)
    assert not scans
    reader = scene.elsewhere().reader("/scout1/scan", LaserScan, "sensor")
    scene.until(lambda: reader.take(1))
    assert scans


def test_the_clock_goes_on_being_told_while_it_stands_still(scene: Scene) -> None:
    scene.let_pass(0.5)
    clock, heard = scene.elsewhere().reader(CLOCK, Clock, "sensor"), list[float]()
    writer = scene.writer("/scout1/cmd_vel", Twist)
    now, ends = scene.world.time, time.monotonic() + PATIENCE
    writer.write(ahead(0.3))
    while len(heard) < 3 or scene.robot.window.client != "ROS 2 program 1":
        assert time.monotonic() < ends
        scene.scouts.look()
        time.sleep(0.01)
        heard += [seconds(message.clock) for message in clock.take(1)]
    assert heard[-2:] == pytest.approx([now, now])
    scene.until(lambda: isclose(scene.speed(), 0.3), "what was asked meanwhile is done when time goes on")


def test_others_that_do_not_fit_are_told(scene: Scene) -> None:
    away = scene.elsewhere()
    ends: Any = [
        away.writer(CLOCK, Clock, "reliable"),
        away.writer("/scout1/odom", Odometry, "reliable"),
        away.writer("/scout1/cmd_vel", Bool, "reliable"),
        away.writer("/scout1/cmd_vel", Twist, "sensor"),
        away.reader("/scout1/scan", Range, "sensor"),
        away.reader("/scout1/imu", Imu, "latched"),
    ]
    wanted = {
        "somebody else publishes /clock, too: two simulations are in one ROS domain; start this with another --domain",
        "somebody else publishes /scout1/odom, too: two robots have one name; start this with another --namespace",
        "somebody publishes std_msgs/Bool at /scout1/cmd_vel, which is not read: wanted geometry_msgs/Twist or "
        "geometry_msgs/TwistStamped",
        "somebody publishes /scout1/cmd_vel as best effort, which is not read: it must be reliable",
        "somebody listens at /scout1/scan for sensor_msgs/Range and hears nothing: it brings sensor_msgs/LaserScan",
        "somebody listens at /scout1/imu for what was said before and hears nothing: it must be volatile",
    }
    scene.until(lambda: wanted <= set(scene.said))
    said = len(scene.said)
    scene.let_pass(0.5)
    assert scene.said[said:] == [], "once"
    del ends


def test_a_program_with_another_layout_is_told(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "JOINED", 0.5)
    away = scene.elsewhere()
    ends: Any = [away.reader("/scout1/sonar", ShortRange, "reliable"), away.reader("/scout1/sonar", Range, "reliable")]
    wanted = (
        "/scout1/sonar has a sensor_msgs/Range of another layout than that of ROS 2: whoever listens there hears "
        "nothing of us"
    )
    scene.until(scene.has_said(wanted))
    scene.let_pass(0.5)
    assert scene.said.count(wanted) == 1
    del ends


def test_a_message_that_cannot_be_made_is_told_once_and_the_others_are_made(scene: Scene) -> None:
    (robot,) = scene.scouts._robots
    robot._tellers = [
        (told._replace(make=lambda *_: [BatteryState(percentage=1e39)]), every, writer)
        if told.topic == "battery_state"
        else (told, every, writer)
        for told, every, writer in reversed(robot._tellers)
    ]
    away = scene.elsewhere()
    battery = away.reader("/scout1/battery_state", BatteryState, "reliable")
    odometry = away.reader("/scout1/odom", Odometry, "reliable")
    scene.until(scene.has_said("nothing is said at /scout1/battery_state: Failed to encode member percentage"))
    driving(scene)
    scene.until(lambda: odometry.take(1))
    scene.let_pass(2.0)
    assert sum("battery_state" in sentence for sentence in scene.said) == 1
    assert not battery.take(1)


@pytest.mark.parametrize(
    ("name", "robots", "said"),
    [
        ("/", 2, "only one robot can be without a namespace, and these are 2"),
        ("3 x", 1, "'3 x' is no name in ROS 2"),
        ("x" * 300, 1, "is no name in ROS 2"),
        ("scout", MAX_ROBOTS + 1, "101 robots: at most 100"),
    ],
)
def test_names_that_cannot_be_are_refused(name: str, robots: int, said: str) -> None:
    with pytest.raises(MisuseError, match=said):
        namespaces(name, robots)


def test_names() -> None:
    assert namespaces("scout", 2) == ["/scout1", "/scout2"]
    assert namespaces("/lab/r", 1) == ["/lab/r1"]
    assert namespaces("/", 1) == [""]


# ---- the command, and other processes

needs_ros = pytest.mark.skipif(
    not RCLPY, reason="needs ROS 2: SLEEPCAST_RCLPY names a Python that has rclpy, see CONTRIBUTING.md"
)
SERVE = ("-m", "sleepcast", "nserver", "--headless", "--port", "0", "--json", "--ros2")


def planner(ros: bool, robots: int, patience: float = PATIENCE, away: float = 1.5) -> list[str]:
    """The command of a planner for so many robots."""
    program = (RCLPY, HERE / "rclpy_planner.py") if ros else (sys.executable, HERE / "ros2_planner.py")
    return [str(word) for word in (*program, patience, away, *namespaces("scout", robots))]


def place(ros: bool) -> dict[str, str]:
    """The environment of a planner."""
    path = str(HERE) if ros else os.pathsep.join([str(HERE.parent), *sys.path])
    return {"ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "PYTHONPATH": path}


@contextmanager
def serving(*options: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """The command, and its port for programs of 1998."""
    with start(sys.executable, *SERVE, "--domain", DOMAIN, *options) as server:
        try:
            assert server.stdout is not None
            where = json.loads(server.stdout.readline())
            assert where["ros2"][0] == "/scout1"
            yield server, where["port"]
        finally:
            server.kill()


@pytest.mark.parametrize("ros", [False, pytest.param(True, marks=needs_ros)])
def test_twenty_robots_arrive_faster_than_real_time(ros: bool) -> None:
    with serving("--robots", str(MANY), "--speed", "3"), start(*planner(ros, MANY), **place(ros)) as process:
        out, err = process.communicate(timeout=2.0 * PATIENCE)
    found = json.loads(out or "{}")
    assert found.get("arrived") == MANY, (out, err)
    assert 20.0 < found["least_rate"] <= found["most_rate"] < 26.0


@pytest.mark.skipif(bool(REASON), reason=f"no networks of our own here: {REASON}")
def test_twenty_robots_arrive_although_a_fifth_is_lost() -> None:
    ros = bool(RCLPY)
    pipe, serve = subprocess.PIPE, (*SERVE, "--robots", str(MANY), "--speed", "2")
    with Lab(["server", "planner"]) as lab:
        lab.lose(0.2, what=EVERYTHING)
        subnet = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
        ours, theirs = ({**os.environ, **place(each), **subnet} for each in (False, ros))
        server = lab.start("server", sys.executable, *serve, environment=ours, stdout=pipe, stderr=pipe)
        assert server.stdout is not None
        assert "scout1" in server.stdout.readline()
        process = lab.start("planner", *planner(ros, MANY), environment=theirs, stdout=pipe, stderr=pipe)
        out, err = process.communicate(timeout=2.0 * PATIENCE)
    found = json.loads(out or "{}")
    assert found.get("arrived") == MANY, (out, err)


WHO = """
import sys, time
import rclpy
from rclpy.node import Node
rclpy.init()
node = Node("onlooker")
while not node.get_publishers_info_by_topic("/scout1/odom"):
    time.sleep(0.1)
(end,) = node.get_publishers_info_by_topic("/scout1/odom")
print(end.topic_type, end.node_name, node.get_node_names())
"""


@pytest.mark.counterpart("ros-jazzy-rclpy", "cyclonedds")
@needs_ros
def test_to_ros_a_robot_has_topics_and_no_node() -> None:
    with serving(), start(RCLPY, "-c", WHO, **place(True)) as process:
        try:
            out, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert out == "nav_msgs/msg/Odometry _CREATED_BY_BARE_DDS_APP_ ['onlooker']\n", err


READ_SCAN = """
import json
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
rclpy.init()
node, found = Node("onlooker", parameter_overrides=[Parameter("use_sim_time", value=True)]), []
node.create_subscription(LaserScan, "/scout1/scan", found.append, qos_profile_sensor_data)
while not found or not node.get_clock().now().nanoseconds:
    rclpy.spin_once(node, timeout_sec=0.1)
scan, now = found[0], node.get_clock().now().nanoseconds / 1e9
fields = "angle_min angle_max angle_increment time_increment scan_time range_min range_max".split()
said = {"frame": scan.header.frame_id, **{name: getattr(scan, name) for name in fields}, "ranges": list(scan.ranges)}
stamp = scan.header.stamp.sec + scan.header.stamp.nanosec / 1e9
print(json.dumps({"scan": said, "stamp": stamp, "now": now}))
"""


@needs_ros
def test_ros_reads_the_whole_scan_as_sensor_data(tmp_path: Path) -> None:
    (tmp_path / "world.toml").write_text(SCANNED)
    with serving(str(tmp_path / "world.toml")), start(RCLPY, "-c", READ_SCAN, **place(True)) as process:
        try:
            out, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    found = json.loads(out or "{}")
    assert found.get("scan") == SCAN, err
    assert 0.0 < found["stamp"] <= found["now"] + 1.0, "simulated time, as /clock"


def test_a_planner_that_is_killed_leaves_its_robot_at_rest_and_a_mind_of_sleepcast_takes_it_over() -> None:
    with serving("--speed", "2") as (server, _), start(*planner(False, 1, away=50.0), **place(False)) as process:
        uri = f"ros2:///scout1?domain={DOMAIN}&discovery=localhost&use_sim_time=yes"
        with closing(open_robot(uri)) as body:
            names = [sensor.name for sensor in body.model.sensors]

            def until(true: Callable[[dict[str, float]], bool]) -> None:
                ends = time.monotonic() + PATIENCE
                while not true(dict(zip(names, body.sense().values, strict=True))):
                    assert time.monotonic() < ends
                    time.sleep(0.02)

            process.kill()
            until(lambda sensed: sensed["speed"] == 0.0)
            until(lambda sensed: body.act(Setpoint(0.2, 0.0)) or isclose(sensed["speed"], 0.2))  # type: ignore[func-returns-value]
            body.stop()
            until(lambda sensed: sensed["speed"] == 0.0)
            body.release()
        server.terminate()
        _, err = server.communicate(timeout=PATIENCE)
    assert "robot 1 must stand, until /scout1/stop says false" in err
    assert "Traceback" not in err


def test_in_lockstep_the_clock_goes_as_programs_of_1998_ask() -> None:
    with (
        serving("--lockstep") as (_, port),
        closing(join_network(DOMAIN, local=True)) as network,
        Nomad.connect(port=port) as nomad,
    ):
        clock, now = network.reader(CLOCK, Clock, "sensor"), 0.0

        def heard() -> float:
            ends = time.monotonic() + PATIENCE
            while not (found := clock.take(1)):
                assert time.monotonic() < ends
                time.sleep(0.01)
            return seconds(found[0].clock)

        for _ in range(3):
            before, asked = now, nomad.gs().time
            ends = time.monotonic() + PATIENCE
            while (now := heard()) < asked - 1e-6:  # what was said before may still be under way
                assert time.monotonic() < ends
            assert now == heard(), "it stands until it is asked"
        assert isclose(now - before, 0.02, abs_tol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "environment", "said"),
    [
        (["--namespace", "x"], {}, "--namespace, --domain and --discovery are for ROS 2: add --ros2"),
        (["--ros2", "--domain", "233"], {}, "domain is a whole number from 0 to 232, not '233'"),
        (["--ros2", "--robots", "101"], {}, "101 robots: at most 100 fit into a ROS domain"),
        (["--ros2", "--namespace", "3 x"], {}, "'3 x' is no name in ROS 2"),
        (["--ros2"], {"PYTHONPATH": "WITHOUT"}, f"ROS 2 robots need Cyclone DDS; to install it: {installing('ros2')}"),
    ],
)
def test_what_cannot_be_is_misuse(
    arguments: list[str], environment: dict[str, str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cyclonedds.py").write_text("raise ImportError\n")
    without = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    for name, value in environment.items():
        monkeypatch.setenv(name, without if value == "WITHOUT" else value)
    outcome = called("nserver", "--headless", "--port", "0", *arguments)
    assert (outcome.status, outcome.out) == (2, "")
    assert said in outcome.err
    assert "Traceback" not in outcome.err
