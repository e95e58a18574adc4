"""Which namespaces of a ROS 2 domain are robots, and what others lack."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed here")

from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import float32

from bridges.ros2_robot import OverDds, domain_for
from sleepcast.bridges.ros2.fleet import Ros2Fleet
from sleepcast.bridges.ros2.link import Ros2Network
from sleepcast.bridges.ros2.mapping import TURTLEBOT
from sleepcast.bridges.ros2.messages import BatteryState, Bool, LaserScan, Odometry, Twist, dds_type
from sleepcast.core.settings import SettingsError

DOMAIN = domain_for(2)
PATIENCE = 60.0
"""Seconds that a busy machine may take."""


@pytest.fixture
def fleet() -> Iterator[Ros2Fleet]:
    with closing(Ros2Network(DOMAIN, local=True)) as network:
        yield Ros2Fleet(network, TURTLEBOT, sim_time=False)


def until(true: Callable[[], bool]) -> None:
    ends = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < ends
        time.sleep(0.02)


def whole(namespace: str, over: OverDds) -> list[Any]:
    """All topics of a robot."""
    return [
        over.writer(f"{namespace}/odom", Odometry),
        over.writer(f"{namespace}/scan", LaserScan),
        over.writer(f"{namespace}/battery_state", BatteryState, "reliable"),
        over.reader(f"{namespace}/cmd_vel", Twist),
        over.reader(f"{namespace}/stop", Bool, "latched"),
    ]


def test_robots_are_found_with_what_they_lack_and_go_again(fleet: Ros2Fleet) -> None:
    over = OverDds("", DOMAIN)
    kept = [*whole("/a/scout1", over), over.writer("/scout2/odom", Odometry), over.reader("/scout2/cmd_vel", Twist)]
    kept += [over.writer("/scout3/odom", Bool), over.reader("/scout3/cmd_vel", Twist), *whole("", over)]
    kept += [over.writer("/scout3/scan", LaserScan, "reliable"), over.writer("/map/odom", Odometry)]
    until(lambda: len(fleet.look()) == 5 and sum(each.is_robot for each in fleet.look().values()) == 4)
    found = fleet.look()
    assert list(found) == ["", "/a/scout1", "/map", "/scout2", "/scout3"]
    until(lambda: not fleet.look()["/a/scout1"].lacks() and not fleet.look()[""].lacks())
    assert fleet.look()["/scout2"].lacks() == [
        "nobody publishes /scout2/scan: nearest, front, left, back and right are unknown",
        "nobody publishes /scout2/battery_state: battery and volts are unknown",
    ]
    assert fleet.look()["/scout3"].lacks()[0] == (
        "/scout3/odom has the type std_msgs/Bool, not nav_msgs/Odometry as the mapping says: what it brings is not "
        "read: x, y, heading, speed and turn_rate are unknown"
    )
    assert not fleet.look()["/scout3"].lacks(only_missing=True)[0].startswith("/scout3/odom")
    assert fleet.look()["/map"].lacks()[-1] == "nobody listens at /map/cmd_vel"
    assert not fleet.look()["/map"].is_robot
    stops = [each.wrong for each in fleet.look()["/scout2"].topics if each.topic == "/scout2/stop"]
    assert stops == ["nobody listens at /scout2/stop"]
    kept.clear()
    over.participant = None  # type: ignore[assignment]
    until(lambda: not fleet.look())


def test_a_layout_that_is_none_of_ours_is_doubted(fleet: Ros2Fleet) -> None:
    """It is a robot all the same: whether DDS joins them is known as soon as it has a body."""
    odd: Any = make_idl_struct("Odd", dds_type("sensor_msgs", "BatteryState"), {"percentage": float32})
    over = OverDds("", DOMAIN)
    kept = [*whole("/scout1", over), over.writer("/scout2/battery_state", odd), over.writer("/scout2/odom", Odometry)]
    kept.append(over.reader("/scout2/cmd_vel", Twist))

    def doubts() -> list[str]:
        return [each.doubt for robot in fleet.look().values() for each in robot.topics if each.doubt]

    until(lambda: len(fleet.look()) == 2 and doubts())
    assert doubts() == [
        "/scout2/battery_state has a sensor_msgs/BatteryState of another layout than that of ROS 2: perhaps nothing "
        "passes by it"
    ]
    assert fleet.look()["/scout2"].is_robot
    del kept


def test_names_that_are_none_are_no_robots(fleet: Ros2Fleet) -> None:
    over = OverDds("", DOMAIN)
    names = ("/../../etc", "/2", "/" + "a" * 195, "/good")
    kept = [over.writer(f"{name}/odom", Odometry) for name in names]
    until(lambda: bool(fleet.look()))
    assert list(fleet.look()) == ["/good"]
    del kept


def test_a_quality_of_service_that_does_not_fit_is_told(tmp_path: Path) -> None:
    file = tmp_path / "sure.toml"
    file.write_text(TURTLEBOT.read_text().replace('type = "Odometry"', 'type = "Odometry"\nqos = "latched"'))
    over = OverDds("/scout1", DOMAIN)
    kept = [over.writer("odom", Odometry, "reliable"), over.writer("scan", LaserScan)]
    kept += [over.reader("cmd_vel", Twist, "latched")]
    with closing(Ros2Network(DOMAIN, local=True)) as network:
        fleet = Ros2Fleet(network, file, sim_time=False)
        until(lambda: "/scout1" in fleet.look() and len(fleet.look()["/scout1"].lacks()) == 3)
        said = fleet.look()["/scout1"].lacks()
        assert said[0].startswith(
            'nothing comes by /scout1/odom: the mapping wants qos = "latched", and it is published'
        )
        assert said[2] == (
            "whoever listens at /scout1/cmd_vel hears nothing of us: they want what is latched, and we are reliable"
        )
        body = fleet.body("/scout1")
        with closing(body):
            told: list[str] = []
            until(lambda: told.extend(body._link.remarks()) or len(told) >= 2)  # type: ignore[func-returns-value]
            assert said[0].startswith(next(each for each in told if "odom" in each))
    del kept


@pytest.mark.parametrize(
    ("ours", "complaint"), [(("out.cmd_vel",), "driven by one topic"), (("in.odom", "in.scan"), "heard by one topic")]
)
def test_a_fleet_has_no_topics_for_all(tmp_path: Path, ours: tuple[str, ...], complaint: str) -> None:
    file, text = tmp_path / "one.toml", TURTLEBOT.read_text()
    for table in ours:
        text = text.replace(f"[{table}]", '[{}."/{}"]'.format(*table.split(".")))
    file.write_text(text)
    with closing(Ros2Network(DOMAIN, local=True)) as network, pytest.raises(SettingsError, match=complaint):
        Ros2Fleet(network, file, sim_time=False)
