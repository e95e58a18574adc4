"""A ROS 2 robot as a body: the contract of all bridges, clocks, what does not fit; and over DDS with another process.

With SLEEPCAST_RCLPY, the same with real ROS 2: see CONTRIBUTING.md.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from math import cos, degrees, hypot, inf, isclose, isnan, nan, pi, remainder, sin
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed here")

from bridges.ros2_robot import OverDds, Wheels, domain_for
from processes import start
from sleepcast.bridges import BodyError, Opening, OutOfReachError, open_robot
from sleepcast.bridges.ros2.link import DdsLink, Ros2Network
from sleepcast.bridges.ros2.mapping import CLOCK, TURTLEBOT, CommandTopic, TopicField, TopicReading, read_mapping
from sleepcast.bridges.ros2.messages import MAX_RAYS, Bool, LaserScan, Odometry, Twist, sectors_of
from sleepcast.bridges.ros2.robot import SILENT, Ros2Body, body_on, ros_place
from sleepcast.core.clock import Clock, ManualClock, WallClock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.model import RestState
from sleepcast.robot import Limits, Setpoint
from sleepcast.testing.robot_contract import BridgeContract, BridgeRig

PATIENCE = 60.0
"""Seconds that a busy machine may take."""
RCLPY = os.environ.get("SLEEPCAST_RCLPY")
"""A Python that has rclpy."""
HERE = Path(__file__).parent
MAPPING = read_mapping(TURTLEBOT, "/scout3")
ODOM, SCAN, BATTERY = (source.topic for source in MAPPING.sources)


class FakeRobot(Wheels):
    """A robot in this process, and the way to it."""

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self.clock, self.whole, self.ahead, self.charge = clock, True, 0.0, 0.8
        self.simulated = nan
        """What /clock says."""
        self.stuck: float | None = None
        """The time that its messages have, if it stands still."""
        self.sectors = (3.5,) * 16
        self.said: list[tuple[str, tuple[float, ...]]] = []
        self.told_at = nan

    def heard(self) -> Mapping[str, TopicReading]:
        if not self.whole:
            return {}
        stamp = self.clock.now() + self.ahead if self.stuck is None else self.stuck
        heading = remainder(self.heading, 2.0 * pi)
        found = {
            ODOM: TopicReading(stamp, (self.x, self.y, heading, self.speed, self.turn_rate)),
            SCAN: TopicReading(stamp, (min(self.sectors), 1.0, 1.0, 1.0, 1.0), self.sectors),
            BATTERY: TopicReading(nan, (self.charge, 12.0)),
        }
        return found if isnan(self.simulated) else {**found, CLOCK: TopicReading(self.simulated, ())}

    def say(self, topic: str, values: Mapping[str, float], now: float) -> None:
        self.said.append((topic, tuple(values.values())))
        self.told_at = now
        if self.whole and topic == MAPPING.drive.topic:
            self.speed, self.turn_rate = values["speed"], values["turn_rate"]

    def remarks(self) -> list[str]:
        return []

    def is_published(self, topic: str) -> bool:
        return False

    def close(self) -> None:
        self.said.append(("closed", ()))


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def robot(clock: ManualClock) -> FakeRobot:
    return FakeRobot(clock)


DRIVEN = ("/scout3/cmd_vel", (0.0, 0.0))
"""It is told to stand."""


def rig_of(robot: FakeRobot, *, sim_time: bool = False) -> BridgeRig:
    body = Ros2Body(robot, MAPPING, sim_time=sim_time, clock=robot.clock, epoch=robot.clock.now)
    body.measure()  # as it is met

    def cut() -> None:
        robot.whole, robot.speed, robot.turn_rate = False, 0.0, 0.0  # as every base does that hears nothing

    def mend() -> None:
        robot.whole = True

    return BridgeRig(body, robot.clock, robot.advance, cut, mend, resolution=1e-6)


class TestRos2(BridgeContract):
    @pytest.fixture
    def rig(self, robot: FakeRobot) -> BridgeRig:
        return rig_of(robot)


class FakeOmni(FakeRobot):
    """The same on mecanum wheels."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self.side = 0.0

    def heard(self) -> Mapping[str, TopicReading]:
        found = dict(super().heard())
        if ODOM in found:
            odom = found[ODOM]
            found[ODOM] = TopicReading(odom.stamp, (*odom.values, self.side))
        return found

    def say(self, topic: str, values: Mapping[str, float], now: float) -> None:
        super().say(topic, values, now)
        if self.whole and topic == MAPPING.drive.topic:
            self.side = values["side_speed"]

    def advance(self, seconds: float) -> None:
        super().advance(seconds)
        self.x -= self.side * sin(self.heading) * seconds
        self.y += self.side * cos(self.heading) * seconds


def omni_rig(clock: ManualClock, tmp_path: Path) -> tuple[BridgeRig, FakeOmni]:
    """A TurtleBot with mecanum wheels."""
    file = tmp_path / "omni.toml"
    text = TURTLEBOT.read_text(encoding="utf-8").replace(
        '= "turn_rate" }', '= "turn_rate", side_speed = "side_speed" }', 1
    )
    file.write_text(text.replace("drive_turn = ", 'drive_side = "side_speed", drive_turn = '), encoding="utf-8")
    robot = FakeOmni(clock)
    body = Ros2Body(robot, read_mapping(file, "/scout3"), clock=clock, epoch=clock.now)
    body.measure()

    def cut() -> None:
        robot.whole, robot.speed, robot.turn_rate, robot.side = False, 0.0, 0.0, 0.0

    def mend() -> None:
        robot.whole = True

    return BridgeRig(body, clock, robot.advance, cut, mend, resolution=1e-6), robot


class TestOmni(BridgeContract):
    @pytest.fixture
    def rig(self, clock: ManualClock, tmp_path: Path) -> BridgeRig:
        return omni_rig(clock, tmp_path)[0]


def test_a_robot_on_mecanum_wheels_drives_to_its_side_within_the_limits_of_the_vector(
    clock: ManualClock, tmp_path: Path
) -> None:
    rig, robot = omni_rig(clock, tmp_path)
    assert [each.name for each in rig.body.model.actuators] == ["drive_speed", "drive_turn", "drive_side"]
    rig.body.act(Setpoint(0.0, 0.0, 0.1))
    rig.wait(1.0)
    assert (robot.speed, robot.side, rig.sensed()["side_speed"]) == pytest.approx((0.0, 0.1, 0.1))
    rig.body.act(Setpoint(speed=3.0, side=-4.0))
    before = robot.speed, robot.side
    for _ in range(30):
        rig.wait(0.1)
        assert hypot(robot.speed - before[0], robot.side - before[1]) <= 0.5 * 0.1 * 1.001
        before = robot.speed, robot.side
    assert before == pytest.approx((0.2 / 2**0.5, -0.2 / 2**0.5), rel=0.05), "each speed is bounded, then the vector"
    state = rig.body.rest_state()
    assert state is not None
    assert state.speed == pytest.approx(0.2, rel=0.05)
    rig.body.stop()
    rig.wait(1.0)
    assert robot.said[-1] == ("/scout3/cmd_vel", (0.0, 0.0, 0.0))
    assert rig.body.rest_state() == RestState(0.0, 0.0)


@pytest.mark.parametrize("side", [0.2, -0.2])
def test_its_fence_is_watched_to_the_side_as_well(clock: ManualClock, tmp_path: Path, side: float) -> None:
    rig, robot = omni_rig(clock, tmp_path)
    rig.body.narrow(Limits(1.0, 1.0, 1.0, fence=(-2.0, -1.0, 2.0, 1.0)))
    rig.body.act(Setpoint(0.0, 0.0, side))
    rig.wait(10.0)
    assert 0.7 < abs(robot.y) <= 1.0
    assert "its fence is ahead" in "".join(rig.body.complaints())


def drive(rig: BridgeRig) -> None:
    rig.body.act(Setpoint(0.2, 0.0))
    rig.wait(1.0)
    assert isclose(rig.sensed()["speed"], 0.2)


def test_stop_is_zeros_again_and_again_and_is_latched(robot: FakeRobot) -> None:
    rig = rig_of(robot)
    drive(rig)
    assert robot.said[0:2] == [("/scout3/cmd_vel", (0.0, 0.0)), ("/scout3/stop", (0.0,))]
    rig.body.stop()
    rig.wait(1.0)
    robot.said.clear()
    rig.wait(1.0)
    assert [each for each in robot.said if each == DRIVEN] == [DRIVEN] * 20
    assert [each for each in robot.said if each != DRIVEN] == [("/scout3/stop", (1.0,))], "once a second"
    robot.said.clear()
    rig.body.release()
    rig.wait(0.9)
    assert [each for each in robot.said if each != DRIVEN] == [("/scout3/stop", (0.0,))]


def test_a_robot_that_is_not_heard_is_told_to_stand_all_the_same(robot: FakeRobot) -> None:
    rig = rig_of(robot)
    drive(rig)
    rig.cut()
    rig.wait(SILENT + 0.2)
    assert rig.body.lost == f"nothing new has come at {ODOM} and {SCAN} for 2 s"
    rig.body.stop()
    robot.said.clear()
    rig.wait(0.2)
    assert robot.said[0] == ("/scout3/cmd_vel", (0.0, 0.0))
    assert robot.said[1] == ("/scout3/stop", (1.0,))
    assert len(robot.said) == 5, "in every round"


def test_messages_that_come_again_and_again_with_an_old_time_are_no_news(robot: FakeRobot) -> None:
    rig = rig_of(robot)
    drive(rig)
    robot.stuck = robot.clock.now()
    rig.wait(1.2)
    assert isnan(rig.sensed()["x"])
    assert rig.sensed()["battery"] == 0.8, "which has no time"
    rig.wait(1.0)
    assert rig.body.lost.startswith("nothing new has come")


def test_a_clock_that_is_wrong_is_told_once_and_the_robot_is_driven(robot: FakeRobot) -> None:
    rig = rig_of(robot)
    robot.ahead = -35.25
    drive(rig)
    (said,) = [each for each in rig.body.complaints() if ODOM in each]
    assert said.startswith(f"{ODOM} has times 35.2 s behind this computer's clock: set both clocks alike")
    robot.ahead = 0.0
    rig.wait(0.1)
    robot.ahead = 3.0
    rig.wait(0.2)
    assert [each for each in rig.body.complaints() if f"{ODOM} has times 3 s ahead of" in each]


def test_in_a_simulation_time_is_what_its_clock_says(robot: FakeRobot, clock: ManualClock) -> None:
    rig = rig_of(robot, sim_time=True)

    def half_as_fast(seconds: float) -> None:
        FakeRobot.advance(robot, seconds)
        robot.simulated = 0.0 if isnan(robot.simulated) else robot.simulated + seconds / 2.0
        robot.ahead = robot.simulated - clock.now()

    robot.advance = half_as_fast  # type: ignore[method-assign]
    rig._advance = half_as_fast
    rig.wait(2.0)
    before = rig.body.sense().time
    rig.wait(2.0)
    assert isclose(rig.body.now() - before, 1.0)
    assert not rig.body.complaints()
    before = rig.body.now()
    drive(rig)
    before = rig.body.now()
    robot.simulated = 0.0  # it begins anew
    rig.wait(1.0)
    assert before < rig.body.now() < before + 1.0
    assert rig.body.complaints() == ["the simulation has begun anew; the robot is at rest until a command moves it"]
    assert rig.sensed()["speed"] == 0.0
    rig._advance = lambda seconds: None
    rig.wait(SILENT + 0.2)
    assert rig.body.lost in (
        "/clock has stood still for 2 s: the simulation pauses, or is gone",
        f"nothing new has come at {ODOM} and {SCAN} for 2 s",
    )


def test_a_clock_that_stands_still_is_told(robot: FakeRobot) -> None:
    rig = rig_of(robot, sim_time=True)
    robot.simulated = 5.0
    rig.wait(SILENT + 0.2)
    assert rig.body.lost == "/clock has stood still for 2 s: the simulation pauses, or is gone"


def test_values_of_another_unit_are_unknown_and_told(robot: FakeRobot) -> None:
    rig = rig_of(robot)
    robot.charge = 80.0
    rig.wait(0.2)
    assert isnan(rig.sensed()["battery"])
    assert rig.body.complaints() == [
        f"battery is 80 by {BATTERY}, beyond 0 to 1, and counts as unknown: does the mapping have its unit?"
    ]


def test_it_keeps_a_range_by_its_scanner(robot: FakeRobot) -> None:
    rig = rig_of(robot)
    rig.body.narrow(Limits(inf, inf, inf, least_range=0.5))
    drive(rig)
    robot.sectors = (0.4, *(3.5,) * 15)
    rig.wait(1.0)
    assert rig.sensed()["speed"] == 0.0
    rig.body.act(Setpoint(-0.2, 0.0))
    rig.wait(1.0)
    assert isclose(rig.sensed()["speed"], -0.2), "it may go back"


def test_what_is_too_near_for_its_scanner_keeps_it_from_driving_on(robot: FakeRobot) -> None:
    """Twenty rays of the front that see something too near to be measured, and the rest 2 m of free way."""
    rig = rig_of(robot)
    rig.body.narrow(Limits(inf, inf, inf, least_range=0.5))
    robot.sectors = (2.0,) * 16
    drive(rig)
    near = [-inf if ray < 10 or ray >= 350 else 2.0 for ray in range(360)]
    robot.sectors = sectors_of(LaserScan(angle_increment=pi / 180, range_min=0.1, range_max=3.5, ranges=near))
    rig.wait(1.0)
    assert rig.sensed()["speed"] == 0.0
    assert rig.body.complaints() == ["it is at rest: less than its least range of 0.5 m is known to be free ahead"]


def test_an_endless_place_is_unknown_and_told_and_an_endless_range_is_one(robot: FakeRobot) -> None:
    rig = rig_of(robot)
    robot.x, robot.sectors = inf, (inf,) * 16
    rig.wait(0.2)
    assert isnan(rig.sensed()["x"])
    assert rig.sensed()["nearest"] == inf
    assert rig.body.complaints() == [f"x is inf by {ODOM}, and counts as unknown: it has no such value"]


@pytest.mark.parametrize("refusal", [MisuseError("nothing is said at /scout3/horn: too large"), OverflowError("int")])
def test_a_word_that_cannot_be_made_is_told_and_it_is_driven_and_stopped_as_before(
    robot: FakeRobot, refusal: Exception
) -> None:
    """With an I/O thread, which nothing that a link raises ends."""

    class Faulty(FakeRobot):
        def say(self, topic: str, values: Mapping[str, float], now: float) -> None:
            if topic == "/scout3/horn":
                raise refusal
            super().say(topic, values, now)

    clock = WallClock()
    faulty = Faulty(clock)
    horn = CommandTopic("/scout3/horn", "horn", "BatteryState", (TopicField("level", "voltage", 1.0),), "HORN")
    with Ros2Body(faulty, replace(MAPPING, functions=(horn,)), clock=clock, epoch=clock.now) as body:
        body.begin()
        with pytest.raises(MisuseError, match=r"voltage of BatteryState has no room for 1e\+39"):
            body.model.functions[0].call(body, 1e39)
        body.model.functions[0].call(body, 1.0)
        said: list[str] = []

        def driven() -> bool:
            body.sense()
            body.act(Setpoint(0.2, 0.0))
            said.extend(body.complaints())
            return isclose(faulty.speed, 0.2) and any(str(refusal) in each for each in said)

        until(driven)
        body.stop()
        until(lambda: faulty.speed == 0.0 and not faulty.said[-1][1][-1])


def test_units_of_what_it_is_told_and_a_switch(robot: FakeRobot) -> None:
    speed, turn = MAPPING.drive.fields
    mapping = replace(
        MAPPING,
        drive=replace(MAPPING.drive, fields=(replace(speed, factor=0.01), replace(turn, factor=pi / 180.0))),
        functions=(CommandTopic("/scout3/horn", "horn", "Bool", (TopicField("on", "data", 1.0),), "HORN"),),
    )
    body = Ros2Body(robot, mapping, clock=robot.clock)
    body.model.functions[0].call(body, 1.0)
    with pytest.raises(MisuseError, match="data of Bool is 0 or 1, not 2"):
        body.model.functions[0].call(body, 2.0)
    limit = body.model.limits.turn_rate
    body.act(Setpoint(0.2, pi))
    for _ in range(20):
        robot.clock.advance(0.05)
        body.round()
        body.sense()
    assert ("/scout3/horn", (1.0,)) in robot.said
    assert robot.said[-1][0] == "/scout3/cmd_vel"
    assert all(map(isclose, robot.said[-1][1], (20.0, degrees(limit))))


def goal_rig(robot: FakeRobot, tmp_path: Path) -> tuple[BridgeRig, Callable[..., None]]:
    """A robot with a planner that takes goals, in cm, and what gives it one."""
    file = tmp_path / "planner.toml"
    goal = '[out.goal_pose]\ntype = "PoseStamped"\nfunction = "NAV_TO"\nvalues = { x = "x cm", y = "y cm" }\n'
    file.write_text(TURTLEBOT.read_text() + goal)
    body = Ros2Body(robot, read_mapping(file, "/scout3"), clock=robot.clock, epoch=robot.clock.now)
    body.measure()
    rig = BridgeRig(body, robot.clock, robot.advance, lambda: None, lambda: None)
    (function,) = body.model.functions
    assert (function.usage, function.moves) == ("(NAV_TO x y)", True)
    rig.wait(0.1)
    return rig, partial(function.call, body)


def test_a_planner_drives_to_a_goal_until_something_else_is_wanted(robot: FakeRobot, tmp_path: Path) -> None:
    rig, navigate = goal_rig(robot, tmp_path)
    robot.said.clear()
    navigate(1.5, -2.0)
    rig.wait(0.5)
    assert [(topic, [round(v) for v in values]) for topic, values in robot.said] == [("/scout3/goal_pose", [150, -200])]
    navigate(1.5, -2.0)
    rig.wait(0.2)
    assert len(robot.said) == 1, "as a rule does, which says it in every tick"
    rig.body.stop()
    robot.said.clear()
    rig.wait(0.9)
    assert robot.said == [DRIVEN, ("/scout3/stop", (1.0,)), *[DRIVEN] * 17]
    rig.body.release()
    robot.said.clear()
    rig.wait(2.0)
    assert set(robot.said) == {DRIVEN, ("/scout3/stop", (1.0,))}, "the planner still has its goal: it stays locked"
    navigate(1.0, 0.0)
    robot.said.clear()
    rig.wait(0.9)
    assert [topic for topic, _ in robot.said] == ["/scout3/goal_pose", "/scout3/stop"]
    assert robot.said[1][1] == (0.0,)
    rig.body.act(Setpoint(0.1, 0.0))
    robot.said.clear()
    rig.wait(0.2)
    assert robot.said[1] == ("/scout3/stop", (1.0,)), "we drive, and the planner does not"


@pytest.mark.parametrize("gone", ["mind", "robot", "operator"])
def test_a_goal_ends_with_whoever_gave_it(robot: FakeRobot, tmp_path: Path, gone: str) -> None:
    rig, navigate = goal_rig(robot, tmp_path)
    navigate(1.0, 0.0)
    rig.wait(0.2)
    robot.said.clear()
    if gone == "operator":
        rig.body.let_go()
    robot.whole = gone != "robot"
    rig.look_away(SILENT + 1.0, looking=gone != "mind")
    robot.whole = True
    rig.wait(1.0)
    locked = robot.said.index(("/scout3/stop", (1.0,)))
    assert set(robot.said[locked:]) == {DRIVEN, ("/scout3/stop", (1.0,))}, "nothing old resumes"


def test_a_planner_keeps_within_the_fence(robot: FakeRobot, tmp_path: Path) -> None:
    rig, navigate = goal_rig(robot, tmp_path)
    rig.body.narrow(Limits(inf, inf, inf, fence=(-1.0, -1.0, 1.0, 1.0)))
    navigate(9.0, 0.0)
    rig.wait(0.2)
    robot.speed = 0.2  # as its planner says
    rig.wait(10.0)
    assert robot.x < 1.0
    assert ("/scout3/stop", (1.0,)) in robot.said


def test_messages_have_the_time_of_the_simulation(robot: FakeRobot) -> None:
    rig = rig_of(robot, sim_time=True)
    robot.simulated = robot.stuck = 17.0
    rig.wait(0.2)
    assert robot.told_at == 17.0


def test_without_a_scanner_it_keeps_no_range(robot: FakeRobot) -> None:
    body = Ros2Body(robot, replace(MAPPING, sources=MAPPING.sources[:1]), clock=robot.clock)
    with pytest.raises(MisuseError, match="has no range sensors"):
        body.narrow(Limits(inf, inf, inf, least_range=0.5))


def test_at_its_end_it_is_told_to_stand(robot: FakeRobot) -> None:
    rig = rig_of(robot)
    drive(rig)
    robot.said.clear()
    rig.body.close()
    rest = ("/scout3/cmd_vel", (0.0, 0.0))
    assert robot.said == [rest, ("/scout3/stop", (1.0,)), rest, rest, ("closed", ())], "others who drive it let go, too"


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("ros2://scout3", "has a host, or no path; wanted something like ros2:///scout3"),
        ("ros2:/", None),
        ("ros2:///scout 3", "is no namespace of ROS 2"),
        ("ros2:///3", "is no namespace of ROS 2"),
        ("ros2:///scout3?domain=233", "domain is a whole number from 0 to 232, not '233'"),
        ("ros2:///scout3?domain=x", "domain is a whole number"),
        ("ros2:///scout3?discovery=off", "discovery is subnet or localhost, not 'off'"),
        ("ros2:///scout3?use_sim_time=true", "there is no use_sim_time 'true'"),
        ("ros2:///scout3?map=x", "there is no setting 'map'; there are mapping, domain, discovery, use_sim_time"),
        ("ros2:///scout3?mapping=/nowhere.toml", "cannot be read"),
    ],
)
def test_an_address_that_means_nothing_is_refused(
    uri: str, complaint: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sleepcast.bridges.ros2.robot.MEETING", 0.0)
    with pytest.raises(SleepcastError) as error:
        open_robot(uri)
    assert complaint is None or complaint in str(error.value)
    assert complaint is None or isinstance(error.value, BodyError | MisuseError)


@pytest.mark.parametrize(
    ("environment", "said", "place"),
    [
        (("", ""), (None, None), (0, "subnet")),
        (("42", "LOCALHOST"), (None, None), (42, "localhost")),
        (("seven", "OFF"), ("7", "Subnet"), (7, "subnet")),
        (("42", "SUBNET"), ("0", None), (0, "subnet")),
    ],
)
def test_the_place_is_that_of_the_environment_unless_another_is_said(
    environment: tuple[str, str],
    said: tuple[str | None, str | None],
    place: tuple[int, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("ROS_LOCALHOST_ONLY", raising=False)
    for name, value in zip(("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"), environment, strict=True):
        monkeypatch.setenv(name, value)
    assert ros_place(*said) == place


@pytest.mark.parametrize(
    ("only", "range_", "said", "where"),
    [("1", "SUBNET", None, "localhost"), ("0", "SUBNET", None, "subnet"), ("1", "", "subnet", "subnet")],
)
def test_the_old_variable_for_this_computer_alone_still_comes_first(
    only: str, range_: str, said: str | None, where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in ROS 2 Jazzy, whose robots nobody would find otherwise."""
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", only)
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", range_)
    assert ros_place("7", said) == (7, where)


@pytest.mark.parametrize("number", ["", "-1", "+1", "1.0", "0x1", "٣", "1" * 5_000, "233"])
def test_what_is_no_domain_is_refused(number: str) -> None:
    with pytest.raises(BodyError, match="domain is a whole number from 0 to 232, not"):
        ros_place(number, None)


def test_it_does_not_wait_for_its_mind() -> None:
    with pytest.raises(MisuseError, match="does not wait for its mind"):
        open_robot("ros2:///scout3", Opening(in_step=True))


# ---- over DDS, with another process

DOMAIN, SIMULATED = domain_for(0), domain_for(1)
"""Of robots, and of what is simulated or wrong."""


@contextmanager
def another(
    *namespaces: str, ros: bool = False, domain: int = DOMAIN, factor: float = 0.0
) -> Iterator[subprocess.Popen[str]]:
    """Robots in another process, /scout3 if no other is said. factor: of a simulation's time, 0 for none."""
    names = namespaces or ("/scout3",)
    with start(*robots_command(ros, domain, factor), *names, **robots_place(ros, domain)) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "up\n", process.communicate()
            yield process
        finally:
            process.kill()


def robots_command(ros: bool, domain: int, factor: float = 0.0) -> tuple[object, ...]:
    """The program of the robots, before their namespaces."""
    if ros:
        return RCLPY, HERE / "rclpy_robot.py"
    return sys.executable, HERE / "ros2_robot.py", domain, factor


def robots_place(ros: bool, domain: int, where: str = "LOCALHOST") -> dict[str, str]:
    """Its environment."""
    path = "" if ros else os.pathsep.join([str(HERE.parent), *sys.path])
    return {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": where, "PYTHONPATH": path}


def line(process: subprocess.Popen[str]) -> str:
    """The next one that it prints about STOP, without the robot's name."""
    assert process.stdout is not None
    while True:
        said = process.stdout.readline().split(maxsplit=1)[-1].strip()
        if said in ("stopped", "free", ""):
            return said


def until(true: Callable[[], bool]) -> None:
    ends = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < ends
        time.sleep(0.02)


needs_ros = pytest.mark.skipif(
    not RCLPY, reason="needs ROS 2: SLEEPCAST_RCLPY names a Python that has rclpy, see CONTRIBUTING.md"
)


@pytest.mark.parametrize("ros", [False, pytest.param(True, marks=needs_ros)])
def test_another_process_is_driven_lost_and_found_again(ros: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sleepcast.bridges.ros2.robot.SILENT", 0.5)
    with (
        another(ros=ros) as process,
        closing(open_robot(f"ros2:///scout3?domain={DOMAIN}&discovery=localhost")) as body,
    ):
        names = [sensor.name for sensor in body.model.sensors]

        def sensed(name: str) -> float:
            return body.sense().values[names.index(name)]

        def driven(speed: float, turn_rate: float = 0.0) -> bool:
            """As it is asked to, time and again: on a busy machine it may be out of reach for a moment, and at rest."""
            body.act(Setpoint(speed, turn_rate))
            return isclose(sensed("speed"), speed)

        until(lambda: isclose(sensed("battery"), 0.8, rel_tol=1e-6) and sensed("front") == 2.0)
        until(lambda: driven(0.2, 0.5) and sensed("heading") > 0.1)
        body.stop()
        until(lambda: sensed("speed") == 0.0)
        until(lambda: line(process) == "stopped")
        body.release()
        until(lambda: line(process) == "free")
        until(lambda: driven(0.2))
        process.kill()
        until(lambda: bool(body.lost))
        body.stop()
        with another(ros=ros) as again:
            assert line(again) == "stopped", "what is latched reaches who comes later"
            until(lambda: not body.lost)
            until(lambda: sensed("speed") == 0.0)
            said = body.complaints()
            gone = [each for each in said if each.startswith("the body is out of reach")]
            assert gone[-1].startswith("the body is out of reach: nothing new has come at /scout3/odom")
            assert said[-1].startswith("the body is within reach again")
            body.release()
            until(lambda: driven(0.1))


@needs_ros
def test_other_messages_of_real_ros(tmp_path: Path) -> None:
    """Range has one more value at its end since ROS 2 Iron."""
    text = TURTLEBOT.read_text()
    text += '[in.imu]\ntype = "Imu"\nvalues = { turning = "turn_rate", lifted = "up_acceleration" }\n'
    text += '[in.sonar]\ntype = "Range"\nvalues = { ahead = "range" }\n'
    text += '[out.goal_pose]\ntype = "PoseStamped"\nfunction = "NAV_TO"\nvalues = { x = "x", y = "y cm" }\n'
    text += '[out.dashboard]\ntype = "BatteryState"\nfunction = "SHOW"\nvalues = { level = "percentage" }\n'
    file = tmp_path / "more.toml"
    file.write_text(text)
    with (
        another(ros=True) as process,
        closing(open_robot(f"ros2:///scout3?domain={DOMAIN}&discovery=localhost&mapping={file}")) as body,
    ):
        assert process.stdout is not None
        navigate, show = body.model.functions
        until(lambda: body.sense().values[-3:] == (0.0, 0.0, 1.5))
        assert process.stdout.readline() == "/scout3 free\n", "by which we know that it hears us"
        navigate.call(body, 1.5, -0.02)
        assert process.stdout.readline() == "/scout3 goal map 1.5 -2\n"
        show.call(body, 0.5)
        assert process.stdout.readline() == "/scout3 shows 0.5\n"
        body.stop()
        assert process.stdout.readline() == "/scout3 stopped\n"


def test_a_simulation_with_its_clock_and_others_that_do_not_fit_are_told() -> None:
    domain = SIMULATED
    over = OverDds("/scout3", domain)
    wrong, rival = over.writer("battery_state", Bool), over.writer("cmd_vel", Twist, "reliable")
    with (
        another(domain=domain, factor=3.0),
        closing(open_robot(f"ros2:///scout3?domain={domain}&discovery=localhost&use_sim_time=yes")) as body,
    ):
        began, first = time.monotonic(), body.sense().time
        # Three times as fast as ours: it gets ever farther ahead, however late each look is.
        until(lambda: body.sense().time - first > time.monotonic() - began + 1.0)
        said: set[str] = set()
        until(lambda: said.update(body.complaints()) or len(said) >= 2)  # type: ignore[func-returns-value]
        assert said == {
            "/scout3/battery_state has the type std_msgs/Bool, not sensor_msgs/BatteryState as the mapping says: what "
            "it brings is not read",
            "somebody else drives it, too, by /scout3/cmd_vel: STOP does not hold for them",
        }
    del wrong, rival


def test_what_cannot_be_read_is_told_once_and_the_rest_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    over = OverDds("/scout3", SIMULATED)
    lidar = over.writer("scan", LaserScan)
    link = DdsLink(Ros2Network(SIMULATED, local=True), MAPPING, clock=False)
    monkeypatch.setattr(link._sources[ODOM][1][0], "take", lambda most: [Odometry.deserialize(b"\0\1\0\0short")])
    said: list[str] = []
    found: dict[str, TopicReading] = {}

    def all_is_said() -> bool:
        lidar.write(LaserScan(ranges=[1.0] * (MAX_RAYS + 1)))
        found.update(link.heard())
        said.extend(link.remarks())
        return len(said) >= 2

    with closing(link):
        until(all_is_said)
        assert sorted(said)[1] == f"{SCAN} brings a scan of 20,001 rays; at most 20,000 are read"
        assert sorted(said)[0].startswith(f"{ODOM} brings something that is no message: error: ")
        lidar.write(LaserScan(angle_increment=0.1, range_max=5.0, ranges=[1.0]))
        until(lambda: SCAN in link.heard())
        assert not link.remarks()
    assert not found


LIFECYCLE = """
import select, sys
import rclpy
from nav_msgs.msg import Odometry
from rclpy.lifecycle import LifecycleNode
rclpy.init()
node = LifecycleNode("driver", namespace="/scout5")
odom = node.create_lifecycle_publisher(Odometry, "odom", 10)
node.create_timer(0.05, lambda: odom.publish(Odometry()))
print("up", flush=True)
while sys.stdin not in select.select([sys.stdin], [], [], 0.0)[0]:
    rclpy.spin_once(node, timeout_sec=0.1)
node.trigger_configure(), node.trigger_activate()
rclpy.spin(node)
"""


@pytest.mark.counterpart("ros-jazzy-rclpy", "cyclonedds")
@needs_ros
def test_a_driver_that_is_not_active_is_named_as_what_may_be_behind_the_silence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its topics are there, and it says nothing until somebody activates it."""
    monkeypatch.setattr("sleepcast.bridges.ros2.robot.SILENT", 0.5)
    network = Ros2Network(DOMAIN, local=True)
    with (
        start(RCLPY, "-c", LIFECYCLE, **robots_place(True, DOMAIN), stdin=subprocess.PIPE) as process,
        closing(body_on(network, read_mapping(TURTLEBOT, "/scout5"), sim_time=False)) as body,
    ):
        body.begin()
        try:
            until(lambda: "somebody publishes there: a lifecycle node says nothing until it is active" in body.lost)
            assert process.stdin is not None
            process.stdin.write("go on\n")
            process.stdin.flush()
            until(lambda: not body.lost)
        finally:
            process.kill()


@pytest.mark.counterpart("ros-jazzy-rclpy", "cyclonedds")
@needs_ros
@pytest.mark.parametrize("small", ["subnet", "Subnet"])
def test_ros_takes_small_letters_for_this_computer_alone(small: str) -> None:
    """And so we refuse them: robots that are looked for on the network would not be found."""
    environment = {**os.environ, **robots_place(True, DOMAIN, small)}
    command = [str(RCLPY), "-c", "import rclpy; rclpy.init(); rclpy.create_node('small')"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert (
        f"Invalid value '{small}' specified for 'ROS_AUTOMATIC_DISCOVERY_RANGE', assuming localhost only" in done.stderr
    )


PARAMETERS = """
import json, sys
import rclpy
from rclpy.node import Node
rclpy.init(args=["--ros-args", "--params-file", sys.argv[1]])
for namespace in ("/", "/scout3", "/fleet/scout3"):
    node = Node("twist_mux", namespace=namespace, automatically_declare_parameters_from_overrides=True)
    found = node.get_parameters_by_prefix("locks.sleepcast")
    print(json.dumps({name: each.value for name, each in found.items()}))
"""


@pytest.mark.counterpart("ros-jazzy-rclpy", "cyclonedds")
@needs_ros
def test_the_lock_of_the_page_is_that_of_a_robot_in_any_namespace(tmp_path: Path) -> None:
    """With a plain `twist_mux:` the parameters of a robot in a namespace were none, without a word."""
    page = (HERE.parents[1] / "docs" / "howto" / "ros2.md").read_text()
    (tmp_path / "lock.yaml").write_text(page.partition("```yaml\n")[2].partition("```")[0])
    command = (str(RCLPY), "-c", PARAMETERS, str(tmp_path / "lock.yaml"))
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    lock = {"topic": "stop", "timeout": 3.0, "priority": 255}
    assert [json.loads(line) for line in done.stdout.splitlines()] == [lock] * 3
    assert all(type(json.loads(line)["timeout"]) is float for line in done.stdout.splitlines())


def test_nobody_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sleepcast.bridges.ros2.robot.MEETING", 0.2)
    with pytest.raises(OutOfReachError, match=r"nothing came at /scout4/odom and /scout4/scan for 0\.2 s"):
        open_robot(f"ros2:///scout4?domain={DOMAIN}&discovery=localhost")
