"""Bags of ROS 2: read whole by rosbags, and, with SLEEPCAST_RCLPY, by real ROS 2 (see CONTRIBUTING.md)."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from math import inf, nan, pi
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from exporting.coming import THERE, flock
from exporting.recorded import YARD, flown, one_picture, recorded
from sleepcast.exporting import ExportReport, bag, export_recording
from sleepcast.exporting.bag import Bag, bag_files, topic_names
from sleepcast.exporting.run import PosesEvent, ReadingsEvent, RecordedRun
from sleepcast.exporting.table_files import MissingExtraError
from sleepcast.simulator.recording.recorder import READINGS, Recorder, WorldChange
from sleepcast.simulator.recording.recording import load_recording
from sleepcast.simulator.world.world import Circle

pytestmark = pytest.mark.counterpart("rosbags")

RCLPY = os.environ.get("SLEEPCAST_RCLPY", "")
"""A Python that has rclpy."""


class Heard(NamedTuple):
    """A message of a bag. time: ns."""

    topic: str
    type: str
    time: int
    message: Any
    raw: bytes


def heard(folder: Path) -> list[Heard]:
    """All messages of a bag, as rosbags reads them."""
    from rosbags.highlevel import AnyReader

    with AnyReader([folder]) as reader:
        found = [
            Heard(line.topic, line.msgtype, time, reader.deserialize(raw, line.msgtype), bytes(raw))
            for line, time, raw in reader.messages()
        ]
        assert len(found) == reader.message_count
    return found


def of(topic: str, messages: Iterable[Heard]) -> list[Any]:
    return [each.message for each in messages if each.topic == topic]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ExportReport]:
    folder = tmp_path_factory.mktemp("exported") / "yard-ros2"
    return folder, export_recording(load_recording(YARD), "ros2", folder)


@pytest.fixture(scope="module")
def messages(exported: tuple[Path, ExportReport]) -> list[Heard]:
    return heard(exported[0])


def test_rosbags_reads_it_whole(exported: tuple[Path, ExportReport], messages: list[Heard]) -> None:
    folder, report = exported
    assert {each.name for each in folder.iterdir()} == bag_files("yard-ros2")
    counts: dict[str, int] = {}
    for each in messages:
        counts[each.topic] = counts.get(each.topic, 0) + 1
        assert report.types[each.topic] == each.type
        if (header := getattr(each.message, "header", None)) is not None:
            assert header.stamp.sec * 10**9 + header.stamp.nanosec == each.time
    assert counts == report.counts


def test_where_robots_were(messages: list[Heard]) -> None:
    run = RecordedRun(load_recording(YARD))
    wanted = [event for event in run.events() if isinstance(event, PosesEvent)]
    for robot, name in enumerate(run.names):
        stamped = of(f"/{name}/pose", messages)
        assert {each.header.frame_id for each in stamped} == {"map"}
        told = [(each.pose.position.x, each.pose.position.y, turn(each.pose.orientation)) for each in stamped]
        np.testing.assert_allclose(told, [event.poses[robot] for event in wanted], atol=1e-6)
    together = of("/poses", messages)
    assert [len(each.poses) for each in together] == [3] * 11
    assert together[-1].poses[1].position.x == pytest.approx(float(wanted[-1].poses[1, 0]))


def turn(quaternion: Any) -> float:
    return float(2.0 * np.arctan2(quaternion.z, quaternion.w))


def test_frames_are_one_tree_from_map_to_each_sonar(messages: list[Heard]) -> None:
    """As REP 105 wants it: map, odom, base_link."""
    fixed = {each.child_frame_id: each for message in of("/tf_static", messages) for each in message.transforms}
    moving = {each.child_frame_id: each for message in of("/tf", messages) for each in message.transforms}
    assert not fixed.keys() & moving.keys()
    parents = {child: each.header.frame_id for child, each in (fixed | moving).items()}
    assert len(parents) == 3 * (2 + 16)
    for frame in parents:
        way = [frame]
        while way[-1] in parents:
            way.append(parents[way[-1]])
        assert way[-1] == "map"
    assert parents["scout2/base_link"] == "scout2/odom"
    left = fixed["scout2/sonar_4"].transform
    assert turn(left.rotation) == pytest.approx(pi / 2)
    assert (left.translation.x, left.translation.y) == pytest.approx((0.0, 0.17), abs=1e-9)


def test_sensors_have_the_messages_that_ros_has_for_them(messages: list[Heard]) -> None:
    run = RecordedRun(load_recording(YARD))
    first = next(event for event in run.events() if isinstance(event, ReadingsEvent))
    ranges = of("/scout1/sonar", messages)[:16]
    assert [each.header.frame_id for each in ranges] == [f"scout1/sonar_{number}" for number in range(16)]
    for number, each in enumerate(ranges):
        value = first.values[f"sonar{number}"][0]
        in_reach = value < 255 * 0.0254  # inches
        assert each.range == (pytest.approx(value) if in_reach else inf)
        assert each.field_of_view == pytest.approx(25.0 * pi / 180.0)
    battery = of("/scout1/battery_state", messages)[0]
    assert battery.percentage == pytest.approx(float(first.values["battery"][0]))
    assert np.isnan([battery.voltage, battery.current, battery.charge]).all()
    assert of("/scout1/readings/speed", messages)[0].data == first.values["speed"][0]


def test_what_was_said_and_what_became_of_it(messages: list[Heard]) -> None:
    assert [each.data for each in of("/commands", messages)][0::2] == ["(WHEN (> x 9m) (JOIN east))", "STOP"]
    assert ("scout2", "off we go", 20) in [(each.name, each.msg, each.level) for each in of("/rosout", messages)]
    (status,) = of("/outcomes", messages)[0].status
    assert {pair.key: pair.value for pair in status.values} | {"matched": "1", "not_matched": "2", "fault": "0"} == {
        pair.key: pair.value for pair in status.values
    }
    assert [each.data for each in of("/scout2/group", messages)] == ["", "east"]
    assert [each.data for each in of("/scout2/stopped", messages)] == [False, True]


def test_the_map_is_the_walls(messages: list[Heard]) -> None:
    (grid,) = of("/map", messages)
    assert (grid.info.width, grid.info.height) == (400, 200)
    assert grid.info.resolution == pytest.approx(0.05)
    cells = grid.data.reshape(200, 400)
    assert cells[100, 100] == 100, "the wall at 5 m, 5 m"
    assert (cells[100, 150], cells[20, 100]) == (0, 0)


def test_metadata_is_what_every_release_of_ros2_bag_reads(exported: tuple[Path, ExportReport]) -> None:
    """QoS are a text, with numbers: a list, and names, are for Jazzy and later alone."""
    folder, _ = exported
    told = yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
    assert (told["version"], told["storage_identifier"]) == (8, "mcap")
    assert told["custom_data"]["sleepcast_scenario"] == "yard"
    topics = {each["topic_metadata"]["name"]: each["topic_metadata"] for each in told["topics_with_message_count"]}
    keep_last, reliable, transient_local, volatile = 1, 1, 1, 2  # of rmw
    for name, each in topics.items():
        assert isinstance(each["offered_qos_profiles"], str)
        (qos,) = yaml.safe_load(each["offered_qos_profiles"])
        latched = name in ("/tf_static", "/map") or name.endswith(("/group", "/stopped"))
        assert (qos["durability"], qos["reliability"]) == (transient_local if latched else volatile, reliable)
        assert (qos["history"], qos["depth"]) == (keep_last, 1 if latched else 10)
        assert each["serialization_format"] == "cdr"
        assert each["type_description_hash"].startswith("RIHS01_")
        assert qos["deadline"] == {"sec": 9_223_372_036, "nsec": 854_775_807}


def test_no_channel_is_anything_but_cdr(exported: tuple[Path, ExportReport]) -> None:
    """One that is JSON would make a bag unreadable for rosbags."""
    from mcap.reader import make_reader

    with (exported[0] / "yard-ros2.mcap").open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
    assert summary is not None
    assert {each.message_encoding for each in summary.channels.values()} == {"cdr"}
    told = [yaml.safe_load(each.metadata["offered_qos_profiles"]) for each in summary.channels.values()]
    assert {type(qos["history"]) for (qos,) in told} == {int}
    assert {each.encoding for each in summary.schemas.values()} == {"ros2msg"}


def test_names_become_those_that_ros_allows(tmp_path: Path) -> None:
    assert topic_names(["left-1", "left_1", "3ö", "__", "ö"]) == {
        "left-1": "left_1",
        "left_1": "left_1_2",
        "3ö": "robot_3",
        "__": "robot",
        "ö": "robot_2",
    }
    export_recording(recorded(tmp_path, one_picture), "ros2", tmp_path / "bag")
    topics = {each.topic for each in heard(tmp_path / "bag")}
    assert {"/left_1/pose", "/left_1_2/pose", "/robot_3/pose"} <= topics


@given(st.lists(st.text(min_size=1, max_size=8), unique=True, max_size=6))
def test_each_robot_has_a_name_of_its_own(names: list[str]) -> None:
    told = topic_names(names)
    assert len(set(told.values())) == len(names)
    assert all(re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name) for name in told.values())


def test_numbers_that_are_none_are_as_rep_117_wants_them(tmp_path: Path) -> None:
    """And NaN follows a value that was known, while what a robot has not got has no topic."""

    def fill(recorder: Recorder) -> None:
        far, near = 6.5, 0.0
        for time, x in ((0.0, 1.0), (1.0, None)):
            recorder.note(READINGS, time, {"sonar0": [far, near, None], "x": [x, None, None], "battery": [None] * 3})

    export_recording(recorded(tmp_path, fill), "ros2", tmp_path / "bag")
    messages = heard(tmp_path / "bag")
    assert [each.range for each in of("/left_1/sonar", messages)] == [inf, inf]
    assert [each.range for each in of("/left_1_2/sonar", messages)] == [-inf, -inf]
    np.testing.assert_array_equal([each.data for each in of("/left_1/readings/x", messages)], [1.0, nan])
    topics = {each.topic for each in messages}
    assert topics.isdisjoint({"/robot_3/sonar", "/left_1_2/readings/x", "/left_1/battery_state"})


def test_a_map_follows_the_walls_but_is_not_written_more_often_than_pictures(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        one_picture(recorder)
        for tick in range(1, 6):
            recorder.obstacles(0.1 * tick, WorldChange(tick, {"7": Circle(1.0, 1.0, 0.1 * tick)}, ()))
        one_picture(recorder, 1.0)
        recorder.obstacles(1.5, WorldChange(15, {}, (7,)))
        one_picture(recorder, 2.0)

    export_recording(recorded(tmp_path, fill), "ros2", tmp_path / "bag")
    maps = of("/map", heard(tmp_path / "bag"))
    assert [(each.header.stamp.sec, int((each.data > 0).sum() > 0)) for each in maps] == [(1, 1), (2, 0)]


def test_what_flies_is_as_high_as_it_was(tmp_path: Path) -> None:
    export_recording(recorded(tmp_path, flown), "ros2", tmp_path / "bag")
    messages = heard(tmp_path / "bag")
    (together,), (moved,) = of("/poses", messages), of("/tf", messages)
    assert [pose.position.z for pose in together.poses] == [1.0, 2.0, 3.0]
    assert [each.transform.translation.z for each in moved.transforms] == [1.0, 2.0, 3.0]


def test_of_many_robots_only_what_they_have_in_common_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag, "MAX_OWN_TOPICS", 2)
    report = export_recording(load_recording(YARD), "ros2", tmp_path / "all")
    assert set(report.counts) == {"/map", "/poses", "/commands", "/rosout", "/outcomes"}
    assert "topics and frames of each robot: only up to 2 robots have them" in report.left_out[-1]
    two = export_recording(load_recording(YARD), "ros2", tmp_path / "two", only=["scout2", "scout1"])
    assert "/scout2/pose" in two.counts
    assert len(of("/poses", heard(tmp_path / "two"))[0].poses) == 2


def test_a_recording_of_nothing_is_a_bag_that_opens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag, "MAX_OWN_TOPICS", 2)
    export_recording(recorded(tmp_path, lambda recorder: None), "ros2", tmp_path / "bag")
    assert heard(tmp_path / "bag") == []


def test_a_zero_byte_does_not_end_a_text(tmp_path: Path) -> None:
    export_recording(recorded(tmp_path, lambda recorder: recorder.log(0.0, "a\0b", "c\0d")), "ros2", tmp_path / "bag")
    (line,) = of("/rosout", heard(tmp_path / "bag"))
    assert (line.name, line.msg) == ("ab", "cd")


def test_without_rosbags_a_sentence_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(MissingExtraError, match="written with rosbags, which is not here; to install it: "):
        Bag(tmp_path / "bag", {})
    assert not (tmp_path / "bag").exists()


READER = """
import importlib, json, sys
from rclpy.serialization import deserialize_message
told = []
for line in sys.stdin:
    name, raw = line.split()
    package, _, kind = name.split("/")
    try:
        made_of = getattr(importlib.import_module(package + ".msg"), kind)
    except ImportError:
        told.append(None)  # not among the packages that are installed
        continue
    told.append(str(deserialize_message(bytes.fromhex(raw), made_of)))
print(json.dumps(told))
"""


@pytest.mark.skipif(not RCLPY, reason="needs ROS 2: SLEEPCAST_RCLPY names a Python that has rclpy, see CONTRIBUTING.md")
def test_real_ros_reads_every_message(messages: list[Heard]) -> None:
    """Its numbers and texts are those that rosbags reads; of nine types two belong to packages that have no wheels or
    are not installed."""
    lines = "".join(f"{each.type} {each.raw.hex()}\n" for each in messages)
    done = subprocess.run([RCLPY, "-c", READER], input=lines, capture_output=True, text=True, check=True)
    told = json.loads(done.stdout)
    read = {each.type for each, text in zip(messages, told, strict=True) if text is not None}
    assert {each.type for each in messages} - read <= {"tf2_msgs/msg/TFMessage", "diagnostic_msgs/msg/DiagnosticArray"}
    for each, text in zip(messages, told, strict=True):
        if text is not None and each.type != "nav_msgs/msg/OccupancyGrid":
            assert numbers(text) == pytest.approx(numbers(plain(each.message)), rel=1e-6, nan_ok=True), each


def numbers(text: str) -> list[float]:
    found = re.findall(r"(?<![\w'/.])(-?(?:\d[\d.e+-]*|inf|nan))(?![\w'])", re.sub(r"'[^']*'", "", text))
    return [float(number) for number in found]


def plain(message: Any) -> str:
    """A message as rclpy writes it, without the constants of its type."""
    fields = (name for name in message.__dataclass_fields__ if name != "__msgtype__" and not name.isupper())
    return ", ".join(_plain(getattr(message, name)) for name in fields)


def _plain(value: Any) -> str:
    if hasattr(value, "__dataclass_fields__"):
        return plain(value)
    if isinstance(value, list | np.ndarray):
        return ", ".join(map(_plain, value))
    return "" if isinstance(value, str | bool) else repr(float(value))


def test_robots_that_come_and_go_have_messages_while_they_are_there(tmp_path: Path) -> None:
    export_recording(load_recording(flock(tmp_path / "flock.mcap")), "ros2", tmp_path / "bag")
    messages = heard(tmp_path / "bag")
    assert [len(each.poses) for each in of("/poses", messages)] == [len(each) for each in THERE]
    seconds = {name: [each.header.stamp.sec for each in of(f"/{name}/pose", messages)] for name in ("sheep1", "sheep5")}
    assert seconds == {"sheep1": [0, 1], "sheep5": [3, 4]}
    (static,) = of("/tf_static", messages)
    assert {each.child_frame_id for each in static.transforms} == {f"sheep{number}/odom" for number in range(1, 6)}
