"""Mappings of ROS 2 topics: what they say, and the sentence for each mistake."""

from __future__ import annotations

from contextlib import suppress
from math import inf, isclose, pi
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.bridges.ros2.mapping import (
    MAX_TOPICS,
    MAX_VALUES,
    TURTLEBOT,
    TYPES,
    RobotMapping,
    is_namespace,
    read_mapping,
)
from sleepcast.core.settings import SettingsError

HEAD = 'name = "rover"\nradius = "0.3m"\nspeed = "1m/s"\nturn_rate = "90deg/s"\nacceleration = "1m/s2"\n'
ODOM = '[in.odom]\ntype = "Odometry"\nvalues = { x = "x", v = "speed km/h" }\n'
DRIVE = '[out.cmd_vel]\ntype = "Twist"\nvalues = { drive_speed = "speed", drive_turn = "turn_rate deg/s" }\n'

GOAL = '[out.goal_pose]\ntype = "PoseStamped"\nfunction = "NAV_TO"\nvalues = { x = "x", y = "y cm" }\n'


def mapping_of(tmp_path: Path, text: str) -> RobotMapping:
    file = tmp_path / "rover.toml"
    file.write_text(text)
    return read_mapping(file, "/a/b")


def test_the_mapping_of_turtlebots_is_read() -> None:
    found = read_mapping(TURTLEBOT, "/scout3")
    assert [source.topic for source in found.sources] == ["/scout3/odom", "/scout3/scan", "/scout3/battery_state"]
    assert [each.name for each in found.sensors()][:5] == ["x", "y", "heading", "speed", "turn_rate"]
    assert [each.name for each in found.actuators()] == ["drive_speed", "drive_turn"]
    assert found.stop is not None
    assert found.stop.topic == "/scout3/stop"
    battery = next(each for each in found.sensors() if each.name == "battery")
    assert (battery.shown_as, battery.freshness, battery.high) == ("%", 5.0, 1.0)


def test_units_switches_and_absolute_topics(tmp_path: Path) -> None:
    lidar = (
        '[in."/lidar/scan"]\ntype = "LaserScan"\nturned = "90deg"\nqos = "latched"\nvalues = { near = "nearest mm" }\n'
    )
    horn = '[out.horn]\ntype = "Bool"\nfunction = "HORN"\n'
    found = mapping_of(tmp_path, HEAD + ODOM + lidar + DRIVE + horn)
    odom, scan = found.sources
    assert isclose(odom.fields[1].factor, 1 / 3.6)
    assert (scan.topic, scan.qos, scan.turned, scan.fields[0].factor) == ("/lidar/scan", "latched", pi / 2, 0.001)
    assert isclose(found.drive.fields[1].factor, pi / 180)
    assert [(each.topic, each.function) for each in found.functions] == [("/a/b/horn", "HORN")]
    assert found.stop is None
    assert found.sensors()[0].high == inf


def test_a_robot_that_drives_in_every_direction_has_a_third_name(tmp_path: Path) -> None:
    found = mapping_of(tmp_path, HEAD + ODOM + DRIVE.replace(" }", ', drive_side = "side_speed km/h" }'))
    assert [field.name for field in found.drive.fields] == ["drive_speed", "drive_turn", "drive_side"]
    assert [(each.name, each.high) for each in found.actuators()][2:] == [("drive_side", 1.0)]


def test_functions_publish_what_they_are_given(tmp_path: Path) -> None:
    stop = '[out.lock]\ntype = "Bool"\nvalues = { stopped = "data" }\n'
    level = '[out.level]\ntype = "BatteryState"\nfunction = "LEVEL"\nvalues = { x = "percentage %" }\n'
    place = '[out.seen]\ntype = "PoseStamped"\nfunction = "SEEN"\nframe = "odom"\ngoal = false\nvalues = { x = "x" }\n'
    found = mapping_of(tmp_path, HEAD + ODOM + DRIVE + stop + GOAL + level + place)
    goal, level_, seen = found.functions
    assert (goal.topic, goal.name, goal.frame, goal.goal) == ("/a/b/goal_pose", "goal_pose", "map", True)
    assert [(each.name, each.value, each.factor) for each in goal.fields] == [("x", "x", 1.0), ("y", "y", 0.01)]
    assert (level_.frame, level_.fields[0].factor) == ("base_link", 0.01), "arguments may be called as anything else"
    assert (seen.frame, seen.goal) == ("odom", False)
    assert found.stop is not None
    assert found.sinks == (found.drive, goal, level_, seen, found.stop)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (HEAD + DRIVE, "rover.toml:1: in: a robot that tells nothing: wanted at least one topic, such as [in.odom]"),
        (HEAD + ODOM, "out: wanted one topic of the type Twist or TwistStamped, to drive it; there are 0"),
        (
            HEAD + ODOM + DRIVE + DRIVE.replace("cmd_vel", "b").replace("drive", "d"),
            "to drive it; there are 2",
        ),
        (HEAD + ODOM.replace("Odometry", "Odometri") + DRIVE, 'not "Odometri" (did you mean Odometry?)'),
        (HEAD + ODOM.replace('"x"', '"xx"') + DRIVE, 'rover.toml:8: in.odom.values.x: Odometry has no value "xx"'),
        (HEAD + ODOM.replace("km/h", "kg") + DRIVE, 'speed of Odometry is a speed, and "kg" is a unit of a mass'),
        (HEAD + ODOM.replace("km/h", "deg") + DRIVE, '"deg" is a unit of angles; wanted one of m/s, km/h'),
        (HEAD + ODOM.replace('"x"', '"heading %"') + DRIVE, "heading of Odometry is that of an orientation, which"),
        (HEAD + ODOM.replace("km/h", "kmh") + DRIVE, 'unknown unit "kmh" (did you mean km/h?)'),
        (HEAD + ODOM.replace("v =", "X =") + DRIVE, 'there is a "x" already; case does not count'),
        (HEAD + ODOM.replace("v =", '"v w" =') + DRIVE, '"v w" is no name'),
        (HEAD + ODOM.replace("odom]", '"od om"]') + DRIVE, '"od om" is no topic of ROS 2'),
        (HEAD + ODOM + DRIVE.replace("drive_turn", "w").replace("turn_rate", "side_speed"), "unit of a rate"),
        (HEAD + ODOM + DRIVE.replace("turn_rate deg/s", "side_speed"), "one for speed and one for turn_rate"),
        (
            HEAD + ODOM + DRIVE.replace(" }", ', aside = "side_speed" }'),
            'to its side is called drive_side, not "aside"',
        ),
        (HEAD + ODOM + DRIVE.replace(" }", ', drive_side = "speed" }'), "and perhaps one for side_speed"),
        (HEAD + ODOM + '[in."/a/b/odom"]\ntype = "Bool"\nvalues = { b = "data" }\n' + DRIVE, "is there twice"),
        (HEAD + ODOM + 'qos = "best"\n' + DRIVE, "wanted one of sensor, reliable, latched"),
        (HEAD + ODOM + 'turned = "1rad"\n' + DRIVE, "in.odom.turned: unknown key"),
        (HEAD + ODOM + 'freshness = "1m"\n' + DRIVE, 'wanted a time such as "30s", not "1m", a length'),
        (HEAD.replace("1m/s2", "0m/s2") + ODOM + DRIVE, "acceleration"),
        (HEAD + ODOM + DRIVE + '[out.a]\ntype = "Bool"\nvalues = { lamp = "data" }\n', 'wanted stopped = "data"'),
        (HEAD + ODOM + DRIVE + '[out.a]\ntype = "Bool"\nfunction = "V"\n', 'there is a "v" already'),
        (HEAD + ODOM + DRIVE + '[out.a]\ntype = "Bool"\n', "is missing; wanted names for its values"),
        (HEAD + ODOM + DRIVE + '[out.a]\ntype = "Range"\nvalues = { a = "range" }\n', "out.a.function: is missing"),
        (HEAD + ODOM + DRIVE + GOAL, "NAV_TO has a planner drive the robot, and nothing would stop it: wanted a topic"),
        (HEAD + ODOM + DRIVE + GOAL + "frame = 3\n", "wanted a text in quotes, not 3"),
        (HEAD + ODOM + DRIVE + GOAL.replace('"y cm"', '"x"'), "one of them is there twice"),
        (
            HEAD + ODOM + DRIVE + GOAL.replace("y cm", "y kg"),
            'y of PoseStamped is a length, and "kg" is a unit of a mass',
        ),
        (HEAD + ODOM + DRIVE + '[out.a]\ntype = "Range"\nfunction = "A"\n', "is missing; wanted names"),
        (
            HEAD + ODOM + DRIVE + '[out.a]\ntype = "LaserScan"\nfunction = "A"\nvalues = { a = "nearest" }\n',
            "nearest follows from them",
        ),
        (HEAD + ODOM + DRIVE + '[out.a]\ntype = "Range"\nfunction = "A"\ngoal = true\n', "is missing"),
        (HEAD + "[in]\n" + "".join(f"t{i} = {{}}\n" for i in range(MAX_TOPICS + 1)) + DRIVE, "at most 32 fit"),
        (
            HEAD + ODOM + "x2 = 1\n[in.many.values]\n" + "".join(f'n{i} = "x"\n' for i in range(MAX_VALUES)) + DRIVE,
            "unknown key",
        ),
        (
            HEAD
            + '[in.many]\ntype = "PoseStamped"\n[in.many.values]\n'
            + "".join(f'n{i} = "x"\n' for i in range(MAX_VALUES + 1))
            + DRIVE,
            "more than 64 names",
        ),
    ],
)
def test_each_mistake_is_a_sentence_with_its_place(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(SettingsError) as error:
        mapping_of(tmp_path, text)
    assert complaint in str(error.value)
    assert "rover.toml:" in str(error.value)


@given(st.data())
def test_no_file_ends_in_anything_but_a_mapping_or_a_sentence(data: st.DataObject) -> None:
    text = TURTLEBOT.read_text()
    for _ in range(data.draw(st.integers(1, 4))):
        place, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 20))
        piece = data.draw(
            st.sampled_from(['"', "[out.a]\n", "= -1", "goal = true\n", "speed", "kg", "[[in]]", "x"]) | st.text()
        )
        text = text[:place] + piece + text[place + length :]
    with suppress(SettingsError):
        assert read_mapping(Path("any.toml"), "/scout1", text).sources


@pytest.mark.parametrize(
    ("text", "good"), [("", True), ("/a", True), ("/a/b_2", True), ("/2a", False), ("/a b", False)]
)
def test_namespaces(text: str, good: bool) -> None:
    assert is_namespace(text) is good


def test_the_mapping_in_the_documentation_is_one(tmp_path: Path) -> None:
    page = Path(__file__).parents[2] / "docs" / "howto" / "ros2.md"
    found = mapping_of(tmp_path, page.read_text().split("```toml\n")[1].split("```")[0])
    assert [each.name for each in found.sensors()][-2:] == ["battery", "gate"]
    assert [each.function for each in found.functions] == ["HORN", "NAV_TO", "SAY_BATTERY"]
    for sort, values in TYPES.items():
        assert ", ".join(f"`{value}`" for value in values) in page.read_text(), sort
