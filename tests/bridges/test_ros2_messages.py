"""Messages of ROS 2: their bytes, and the values in them."""

from __future__ import annotations

from contextlib import suppress
from math import inf, isclose, isnan, nan, pi
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed here")

from bridges.ros2_robot import scan
from sleepcast.bridges.ros2.mapping import TYPES
from sleepcast.bridges.ros2.messages import (
    MAX_RAYS,
    READ,
    BatteryState,
    Bool,
    Header,
    Imu,
    LaserScan,
    Odometry,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Range,
    RangeOfToday,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
    made,
    read,
    ros_type,
    seconds,
    sectors_of,
    stamp,
    time_of,
    turned_by,
)


@pytest.mark.parametrize("sort", TYPES)
def test_every_value_that_a_mapping_may_name_is_in_a_message(sort: str) -> None:
    made_of: Any = READ[sort][0]
    values, _ = read(sort, made_of.deserialize(made_of().serialize()), 0.0)
    assert values.keys() == TYPES[sort].keys()


@pytest.mark.parametrize("sort", TYPES)
def test_what_is_made_of_values_has_them(sort: str) -> None:
    for values in ({name: 0.25 + 0.125 * place for place, name in enumerate(TYPES[sort])}, dict[str, float]()):
        if sort == "LaserScan":
            values.pop("nearest", None)
        if sort in ("Range", "Bool") and not values:
            continue
        values |= {name: 1.0 for name in ("data", "present") if name in values}
        message: Any = made(sort, values, 7.5, "map")
        found, _ = read(sort, READ[sort][0].deserialize(message.serialize()), 0.0)
        assert {name: found[name] for name in values} == pytest.approx(values)
        if hasattr(message, "header"):
            assert message.header == Header(Time(7, 500_000_000), "map")


@given(st.sampled_from(list(TYPES)), st.binary(max_size=400), st.integers(0, 5))
def test_any_bytes_are_a_message_with_its_values_or_are_refused(sort: str, noise: bytes, kept: int) -> None:
    """The library that makes a message of bytes raises what it likes; `DdsLink` takes it."""
    whole: bytes = READ[sort][0]().serialize()
    try:
        message = READ[sort][0].deserialize(whole[: 4 + kept * len(whole) // 5] + noise)
    except Exception:
        return
    with suppress(ValueError):
        assert read(sort, message, 0.0)[0].keys() == TYPES[sort].keys()


def test_what_is_not_given_is_not_measured() -> None:
    assert isnan(read("BatteryState", made("BatteryState", {"percentage": 0.5}, 0.0), 0.0)[0]["voltage"])
    turning = made("Imu", {"turn_rate": 0.5}, 0.0)
    assert isnan(read("Imu", turning, 0.0)[0]["heading"])
    assert turning.linear_acceleration_covariance[0] == -1.0
    assert turning.angular_velocity_covariance[0] == 0.0
    assert isnan(read("LaserScan", made("LaserScan", {"front": 1.0}, 0.0), 0.0)[0]["left"])


def test_bytes_are_those_of_ros() -> None:
    """As rclpy.serialization.serialize_message of ROS 2 Jazzy writes them."""
    twist = made("Twist", {"speed": 0.5, "turn_rate": -1.0}, 0.0)
    assert twist.serialize().hex() == (
        "00010000000000000000e03f" + "00" * 8 + "00" * 8 + "00" * 8 + "00" * 8 + "000000000000f0bf"
    )
    stamped = made("TwistStamped", {"speed": 0.5, "turn_rate": -1.0}, 7.5, "base_link")
    assert (stamped.header, stamped.twist) == (Header(Time(7, 500_000_000), "base_link"), twist)
    assert Bool(True).serialize().hex() == "0001000001"
    way = TransformStamped(Header(Time(1, 2), "odom"), "base_link", Transform(Vector3(0.5, -1.0)))
    sonar = RangeOfToday(Header(Time(1, 2), "s"), 0, 0.5, 0.1, 4.0, inf, 0.25)
    assert sonar.serialize().hex() == (
        "00010000"
        + "0100000002000000"
        + "0200000073000000"
        + "0000003f"
        + "cdcccc3d"
        + "00008040"
        + "0000807f"
        + "0000803e"
    )
    head = "0100000002000000050000006f646f6d000000000a000000626173655f6c696e6b00"
    numbers = "000000000000e03f" + "000000000000f0bf" + "00" * 32 + "000000000000f03f"
    assert way.serialize().hex() == "00010000" + head + "00" * 6 + numbers
    assert TFMessage([way]).serialize().hex() == "00010000" + "01000000" + head + "00" * 2 + numbers
    assert Header(Time(1, 2), "odom").serialize().hex() == "000100000100000002000000050000006f646f6d00"


def test_headings_come_from_quaternions() -> None:
    for heading in (-3.0, -0.1, 0.0, 1.0, 3.1):
        odometry = Odometry(pose=PoseWithCovariance(Pose(orientation=turned_by(heading))))
        assert isclose(read("Odometry", odometry, 0.0)[0]["heading"], heading, abs_tol=1e-12)
    nothing = Odometry(pose=PoseWithCovariance(Pose(orientation=Quaternion(w=0.0))))
    assert isnan(read("Odometry", nothing, 0.0)[0]["heading"])


def test_an_imu_that_measures_no_orientation_says_so() -> None:
    assert isnan(read("Imu", Imu(orientation_covariance=[-1.0] + [0.0] * 8), 0.0)[0]["heading"])


def test_a_scan_is_seen_in_sectors() -> None:
    values, sectors = read("LaserScan", scan(Header()), 0.0)
    assert values == {"nearest": 2.0, "front": 2.0, "left": 3.5, "back": 3.5, "right": 3.5}
    assert sectors[0] == 2.0
    assert set(sectors[1:]) == {3.5}
    values, _ = read("LaserScan", scan(Header()), pi / 2.0)
    assert values["left"] == 2.0, "a scanner that looks to the left"
    assert values["front"] == 3.5


def test_a_scan_of_a_half_knows_nothing_of_the_other() -> None:
    half = LaserScan(Header(), -pi / 4, pi / 4, pi / 8, range_min=0.1, range_max=5.0, ranges=[1.0, nan, 2.0, 9.0, 3.0])
    values, _ = read("LaserScan", half, 0.0)
    assert values["front"] == 1.0
    assert isnan(values["back"])


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        (LaserScan(ranges=[1.0] * (MAX_RAYS + 1)), "at most 20,000 are read"),
        (LaserScan(angle_increment=nan, ranges=[1.0]), "angles are no numbers"),
        (LaserScan(angle_min=inf, ranges=[1.0]), "angles are no numbers"),
    ],
)
def test_what_is_no_scan_is_refused(wrong: LaserScan, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        sectors_of(wrong)


def test_ranges_without_an_echo_are_their_bounds() -> None:
    for distance, known in ((1.5, 1.5), (inf, 4.0), (-inf, 0.1)):
        assert read("Range", Range(min_range=0.1, max_range=4.0, range=distance), 0.0)[0]["range"] == known


def test_times() -> None:
    assert seconds(time_of(1_700_000_000.25)) == 1_700_000_000.25
    assert (time_of(6.92), time_of(1.9999999999)) == (Time(6, 920_000_000), Time(2, 0))
    assert stamp(BatteryState(Header(Time(3, 500_000_000)))) == 3.5
    assert isnan(stamp(BatteryState())), "a robot that does not fill it in"
    assert isnan(stamp(Twist()))


def test_types_as_people_call_them() -> None:
    assert ros_type("sensor_msgs::msg::dds_::LaserScan_") == "sensor_msgs/LaserScan"
    assert ros_type("Whatever") == "Whatever"
