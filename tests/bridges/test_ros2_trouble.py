"""What others in a ROS 2 domain do to a body while it moves: they freeze, flood, speak garbage, have other layouts.

That they die is tried in test_ros2.py. With SLEEPCAST_RCLPY, the robot that freezes is one of real ROS 2: see
CONTRIBUTING.md.
"""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from math import inf, isclose, nan
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed here")

from cyclonedds._clayer import ddspy_write
from cyclonedds.core import Policy, Qos
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import float32, uint8
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from bridges.ros2_robot import OverDds, domain_for, heard_at
from bridges.test_ros2 import PATIENCE, another, needs_ros
from sleepcast.bridges import open_robot
from sleepcast.bridges.ros2 import link as links
from sleepcast.bridges.ros2.link import QOS, DdsLink, Ros2Network, dds_name
from sleepcast.bridges.ros2.mapping import TURTLEBOT, read_mapping
from sleepcast.bridges.ros2.messages import Bool, Header, LaserScan, Odometry, Range, dds_type
from sleepcast.bridges.ros2.robot import Ros2Body
from sleepcast.core.errors import MisuseError
from sleepcast.robot import Setpoint

DOMAIN = domain_for(3)
LAYOUT = {"header": Header, "radiation_type": uint8, "field_of_view": float32, "min_range": float32}
LAYOUT |= {"max_range": float32, "range": float32}
OLD: Any = make_idl_struct("Old", dds_type("sensor_msgs", "Range"), LAYOUT)
"""The Range of ROS 2 before Iron, as another program of Cyclone DDS has it."""
TODAY: Any = make_idl_struct("Today", dds_type("sensor_msgs", "Range"), {**LAYOUT, "variance": float32})
"""Today's, likewise."""
STRANGE: Any = make_idl_struct("Strange", dds_type("sensor_msgs", "Range"), {"range": float32})
"""What somebody else calls a Range."""
ZEROS = {OLD: ("radiation_type", "field_of_view"), TODAY: ("radiation_type", "field_of_view", "variance")}


def until(true: Callable[[], object]) -> None:
    ends = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < ends
        time.sleep(0.02)


class Moving:
    """A robot in another process, that a body has set in motion."""

    def __init__(self, process: subprocess.Popen[str], body: Ros2Body) -> None:
        self.process, self.body = process, body
        self.heard = list[str]()
        """What it has printed."""
        self.said = list[str]()
        """What its body has complained of."""
        Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        self.heard += (line.split(maxsplit=1)[-1].strip() for line in self.process.stdout)

    def drive(self) -> None:
        """Until it moves."""
        before = len(self.heard)
        until(lambda: self.look(Setpoint(0.2, 0.0)) and "moves" in self.heard[before:])

    def look(self, wanted: Setpoint | None = None) -> bool:
        self.body.sense()
        if wanted is not None:
            self.body.act(wanted)
        self.said += self.body.complaints()
        return True

    def tells(self, *sentences: str) -> bool:
        return all(any(said.startswith(each) for said in self.said) for each in sentences)

    def sensed(self, name: str) -> float:
        names = [sensor.name for sensor in self.body.model.sensors]
        return self.body.sense().values[names.index(name)]

    def stop(self) -> None:
        """Until it knows of STOP, and rests."""
        before = len(self.heard)
        self.body.stop()
        until(lambda: self.look() and {"rests", "stopped"} <= set(self.heard[before:]))


@contextmanager
def moving(ros: bool = False) -> Iterator[Moving]:
    with (
        another(ros=ros, domain=DOMAIN) as process,
        closing(open_robot(f"ros2:///scout3?domain={DOMAIN}&discovery=localhost")) as body,
    ):
        assert isinstance(body, Ros2Body)
        robot = Moving(process, body)
        robot.drive()
        yield robot


@pytest.mark.parametrize("ros", [False, pytest.param(True, marks=needs_ros)])
def test_a_robot_that_freezes_is_lost_and_stands_when_it_goes_on(ros: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sleepcast.bridges.ros2.robot.SILENT", 0.5)
    with moving(ros) as robot:
        robot.process.send_signal(signal.SIGSTOP)
        until(lambda: robot.look(Setpoint(0.2, 0.0)) and robot.body.lost)
        assert "nothing new has come at /scout3/odom and /scout3/scan" in robot.body.lost
        robot.body.stop()
        before = len(robot.heard)
        robot.process.send_signal(signal.SIGCONT)
        until(lambda: {"rests", "stopped"} <= set(robot.heard[before:]))
        until(lambda: robot.look() and not robot.body.lost)
        robot.body.release()
        until(lambda: robot.look() and "free" in robot.heard[before:])
        odometry, free = robot.sensed("x"), robot.heard.index("free", before)
        words = [word for word in robot.heard[before:] if word in ("moves", "rests")]
        assert words[-1] == "rests", "what has waited for it in its own queue is over"
        assert "moves" not in robot.heard[free:], "nothing old resumes"
        robot.drive()
        until(lambda: robot.sensed("x") > odometry)


@contextmanager
def again_and_again(say: Callable[[], object]) -> Iterator[None]:
    """As fast as this process can."""
    ended = Event()

    def go_on() -> None:
        while not ended.is_set():
            say()

    thread = Thread(target=go_on, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def test_a_flood_at_its_topics_does_not_keep_stop_away() -> None:
    over = OverDds("/scout3", DOMAIN)
    odometry, scans, stops = over.writer("odom", Odometry), over.writer("scan", LaserScan), over.writer("stop", Bool)
    rays = LaserScan(angle_increment=0.001, range_max=5.0, ranges=[1.0] * 2_000)

    def say() -> None:
        for _ in range(20):
            odometry.write(Odometry())
            stops.write(Bool(False))
        scans.write(rays)

    with moving() as robot:
        with again_and_again(say):
            robot.stop()
        robot.body.release()
        robot.drive()


def test_garbage_at_its_topics_is_told_and_it_is_driven_and_stopped_as_before() -> None:
    over = OverDds("/scout3", DOMAIN)
    odometry, lidar = over.writer("odom", Odometry), over.writer("scan", LaserScan)
    no_text = Odometry(Header(frame_id="odd")).serialize().replace(b"odd", b"\xff\xfe\xfd")
    scans = LaserScan(angle_min=nan, ranges=[1.0]), LaserScan(range_max=-1.0, ranges=[-inf] * 100)

    def say() -> None:
        ddspy_write(odometry._ref, no_text)
        for each in scans:
            lidar.write(each)
        time.sleep(0.001)

    with moving() as robot:
        with again_and_again(say):
            told = "/scout3/odom brings something that is no", "/scout3/scan brings a scan that"
            until(lambda: robot.look(Setpoint(0.2, 0.0)) and robot.tells(*told))
            robot.stop()
            robot.body.release()
            robot.drive()
            assert sum(" brings " in each for each in robot.said) == 2, "each topic once"
        until(lambda: robot.look(Setpoint(0.2, 0.0)) and isclose(robot.sensed("speed"), 0.2))


# ---- layouts, and what else keeps two ends of a topic apart

MAPPING = """
[in.sonar]
type = "Range"
values = { ahead = "range" }

[out.echo]
type = "Range"
function = "ECHO"
values = { distance = "range" }
"""


@pytest.fixture
def ranger(tmp_path: Path) -> Iterator[DdsLink]:
    """The way to a robot with a range sensor, which is told ranges as well."""
    (file := tmp_path / "ranger.toml").write_text(TURTLEBOT.read_text() + MAPPING)
    network = Ros2Network(DOMAIN, local=True)
    with closing(network), closing(DdsLink(network, read_mapping(file, "/ranger"), clock=False)) as link:
        yield link


@pytest.mark.parametrize("layout", [OLD, TODAY])
def test_a_peer_with_the_range_of_any_release_is_heard(ranger: DdsLink, layout: Any) -> None:
    over, found, said = OverDds("/ranger", DOMAIN), dict[str, Any](), list[str]()
    sonar = over.writer("sonar", layout)

    def comes() -> bool:
        sonar.write(layout(Header(), range=1.5, min_range=0.1, max_range=4.0, **dict.fromkeys(ZEROS[layout], 0)))
        said.extend(ranger.remarks())
        found.update(ranger.heard())
        return "/ranger/sonar" in found

    until(comes)
    assert found["/ranger/sonar"].values == (1.5,)
    assert said == []


def test_a_peer_with_the_range_of_today_hears(ranger: DdsLink) -> None:
    echo, heard = OverDds("/ranger", DOMAIN).reader("echo", TODAY), list[float]()

    def comes() -> bool:
        ranger.say("/ranger/echo", {"range": 2.5}, 1.0)
        heard.extend(each.range for each in heard_at(echo))
        return 2.5 in heard

    until(comes)


@pytest.mark.counterpart("cyclonedds")
def test_a_peer_with_another_layout_is_told_both_ways(ranger: DdsLink, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "JOINED", 0.5)
    over, said = OverDds("/ranger", DOMAIN), list[str]()
    ends = [over.writer("sonar", STRANGE), over.reader("echo", OLD)]
    until(lambda: said.extend(ranger.remarks()) or len(said) >= 2)  # type: ignore[func-returns-value]
    other = "has a sensor_msgs/Range of another layout than that of ROS 2"
    assert sorted(said) == [
        f"/ranger/echo {other}: whoever listens there hears nothing of us",
        f"/ranger/sonar {other}: what it brings is not read",
    ]
    del ends


def test_what_dds_keeps_apart_for_another_reason_is_told(ranger: DdsLink, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "JOINED", 0.5)
    over, said = OverDds("/ranger", DOMAIN), list[str]()
    publisher = Publisher(over.participant, Qos(Policy.Partition(["elsewhere"])))
    sonar = DataWriter(publisher, Topic(over.participant, "rt/ranger/sonar", TODAY), QOS["sensor"])
    until(lambda: said.extend(ranger.remarks()) or said)  # type: ignore[func-returns-value]
    assert said == [
        "/ranger/sonar has conditions that ours do not meet, such as a partition or a deadline of DDS: what it brings "
        "is not read"
    ]
    del sonar


def test_who_comes_late_to_a_latched_topic_gets_as_much_as_is_kept() -> None:
    with closing(Ros2Network(DOMAIN, local=True)) as network:
        writer = network.writer("/ranger/numbers", Range, "latched", 5)
        for number in range(7):
            writer.write(Range(range=float(number)))
        over = OverDds("/ranger", DOMAIN)
        topic, kept = Topic(over.participant, "rt/ranger/numbers", TODAY), Policy.History.KeepLast(10)
        reader, found = DataReader(over.participant, topic, Qos(kept, base=QOS["latched"])), list[float]()
        until(lambda: found.extend(each.range for each in heard_at(reader)) or len(found) >= 5)  # type: ignore[func-returns-value]
        assert found == [2.0, 3.0, 4.0, 5.0, 6.0]


def test_a_message_that_cannot_be_made_is_refused_and_the_next_is_said(ranger: DdsLink) -> None:
    assert dds_name("Range") == "sensor_msgs::msg::dds_::Range_"
    with pytest.raises(MisuseError, match=r"nothing is said at /ranger/echo: .*1e\+39"):
        ranger.say("/ranger/echo", {"range": 1e39}, 1.0)
    with pytest.raises(MisuseError, match="nothing is said at /ranger/echo: Failed to encode member header"):
        ranger.say("/ranger/echo", {"range": 1.0}, 1e12)
    ranger.say("/ranger/echo", {"range": 1.0}, 1.0)


def test_words_about_others_that_cannot_be_read_cost_no_more_than_that_one(monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(Ros2Network(DOMAIN, local=True)) as network:
        (_, reader), failed = network._looking[0], list[int]()
        usual = reader.take

        def take(most: int) -> Any:
            if not failed:
                failed.append(most)
                raise UnicodeDecodeError("utf-8", b"\xff", 0, 1, "a name that is none")
            return usual(most)

        monkeypatch.setattr(reader, "take", take)
        writer = OverDds("/ranger", DOMAIN).writer("odom", Odometry)
        until(lambda: "/ranger/odom" in network.others())
        assert failed == [1]
        del writer
