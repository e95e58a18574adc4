"""Messages of ROS 2: their bytes, and the values in them."""

from __future__ import annotations

import os
import subprocess
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
    SECTORS,
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
    ShortRange,
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

RCLPY = os.environ.get("SLEEPCAST_RCLPY", "")
"""A Python that has rclpy."""


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


def test_a_battery_that_was_not_filled_in_is_unknown() -> None:
    """As messages of ROS 2 begin: zeros, and not present."""
    empty = {"voltage": 0.0, "temperature": 0.0, "current": 0.0, "charge": 0.0, "percentage": 0.0}
    forgotten = read("BatteryState", BatteryState(**{**empty, "voltage": 12.5}, present=False), 0.0)[0]
    assert (forgotten["voltage"], forgotten["present"]) == (12.5, 0.0)
    assert all(isnan(forgotten[name]) for name in empty if name != "voltage")
    flat = read("BatteryState", BatteryState(**empty, present=True), 0.0)[0]
    assert all(flat[name] == 0.0 for name in empty), "it is there, and flat"


DRIVER = """
from rclpy.serialization import serialize_message
from sensor_msgs.msg import BatteryState, Imu
print(serialize_message(BatteryState(voltage=12.5)).hex(), serialize_message(Imu()).hex())
"""


@pytest.mark.counterpart("ros-jazzy-rclpy", "cyclonedds")
@pytest.mark.skipif(not RCLPY, reason="needs ROS 2: SLEEPCAST_RCLPY names a Python that has rclpy, see CONTRIBUTING.md")
def test_what_a_driver_of_real_ros_does_not_fill_in() -> None:
    """Its battery is unknown; that it has no orientation cannot be seen."""
    done = subprocess.run([RCLPY, "-c", DRIVER], capture_output=True, text=True, check=True)
    battery, imu = map(bytes.fromhex, done.stdout.split())
    values = read("BatteryState", BatteryState.deserialize(battery), 0.0)[0]
    assert (values["voltage"], values["present"]) == (12.5, 0.0)
    assert isnan(values["percentage"])
    assert isnan(values["temperature"])
    assert read("Imu", Imu.deserialize(imu), 0.0)[0]["heading"] == 0.0


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
    sonar = Range(Header(Time(1, 2), "s"), 0, 0.5, 0.1, 4.0, inf, 0.25)
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


@pytest.mark.parametrize("sector", range(SECTORS))
def test_what_is_too_near_to_be_measured_is_at_the_least_range_in_every_sector(sector: int) -> None:
    """REP 117: -inf is too near, inf is nothing in reach, NaN and what is beyond the bounds is no measurement."""
    ranges, first = [2.0] * 320, (320 * sector // SECTORS - 10) % 320
    for ray in range(first, first + 20):
        ranges[ray % 320] = -inf
    blind = LaserScan(Header(), 0.0, 0.0, 2.0 * pi / 320, range_min=0.15, range_max=3.5, ranges=ranges)
    values, sectors = read("LaserScan", blind, 0.0)
    assert sectors == tuple(0.15 if each == sector else 2.0 for each in range(SECTORS))
    assert values["nearest"] == 0.15
    for wrong in (nan, 0.01, 9.0):
        blind.ranges = [wrong] * 320
        assert all(map(isnan, read("LaserScan", blind, 0.0)[1]))
    blind.ranges = [inf] * 320
    assert set(read("LaserScan", blind, 0.0)[1]) == {3.5}


@pytest.mark.parametrize(
    ("least", "most", "said", "known"),
    [
        (0.1, 4.0, 1.5, 1.5),
        (0.1, 4.0, 0.1, 0.1),
        (0.1, 4.0, inf, 4.0),
        (0.1, 4.0, -inf, 0.1),
        (0.1, 4.0, 0.05, nan),
        (0.1, 4.0, 4.5, nan),
        (0.1, 4.0, -1.0, nan),
        (0.1, 4.0, nan, nan),
        (0.5, 0.5, -inf, 0.0),
        (0.5, 0.5, inf, 0.5),
        (0.5, 0.5, 0.5, nan),
        (0.0, 0.0, 0.0, nan),
    ],
)
def test_ranges_mean_what_rep_117_says(least: float, most: float, said: float, known: float) -> None:
    """Of a ranger for one fixed distance, -inf is something within it and inf nothing."""
    found = read("Range", Range(min_range=least, max_range=most, range=said), 0.0)[0]["range"]
    assert found == known or (isnan(found) and isnan(known))


def test_bounds_that_nobody_has_filled_in_are_told() -> None:
    with pytest.raises(ValueError, match="a range that says to measure from 0 m to 0 m"):
        read("Range", Range(range=1.5), 0.0)
    with pytest.raises(ValueError, match="a scan that says to measure from 0 m to nan m"):
        read("LaserScan", LaserScan(range_max=nan, ranges=[1.0]), 0.0)


def test_the_short_form_reads_a_range_of_any_release() -> None:
    short = ShortRange(Header(Time(1, 2), "sonar"), 0, 0.5, 0.25, 4.0, 1.5)
    whole = Range(*vars(short).values(), variance=0.75)
    for message in (short, whole):
        assert ShortRange.deserialize(message.serialize()) == short
        assert read("Range", message, 0.0) == ({"range": 1.5}, ())


NUMBERS = (0.0, 1.0, -1.0, 0.5, 2.0, 256.0, 1e9, -1e9, 1e39, -1e39, 1e-320, inf, -inf, nan)


@pytest.mark.parametrize("sort", TYPES)
@pytest.mark.parametrize("factor", [1.0, 1e-3])
def test_every_number_is_written_as_it_is_or_refused(sort: str, factor: float) -> None:
    for name, value in TYPES[sort].items():
        if (sort, name) == ("LaserScan", "nearest"):
            continue  # which follows from the others
        largest = value.size * factor
        for number in (*NUMBERS, largest, -largest, 2.0 * largest, -2.0 * largest):
            if value.wrong(number, factor):
                continue
            message: Any = made(sort, {name: number / factor}, 1.0)
            found = read(sort, READ[sort][0].deserialize(message.serialize()), 0.0)[0][name]
            told = number if value.whole else number / factor
            assert value.unit == "rad" or found == pytest.approx(told, rel=1e-6)
        assert value.wrong(nan, factor)
        assert value.wrong(-inf, factor)
        assert value.wrong(2.0 * largest, factor)


def test_what_is_refused_is_told_with_what_fits() -> None:
    percentage, voltage, x = (*map(TYPES["BatteryState"].get, ("percentage", "voltage")), TYPES["PoseStamped"]["x"])
    assert percentage is not None
    assert voltage is not None
    assert percentage.wrong(1.5, 0.01) == "is from 0 to 1, not 1.5"
    assert voltage.wrong(1e39, 1.0) == "has no room for 1e+39: at most 3.40282e+38 fits into it"
    assert x.wrong(inf, 1.0) == "is a finite number, not inf"
    assert TYPES["Bool"]["data"].wrong(0.5, 1.0) == "is 0 or 1, not 0.5"
    assert not TYPES["Range"]["range"].wrong(inf, 1.0), "nothing is in reach"


def test_times() -> None:
    assert seconds(time_of(1_700_000_000.25)) == 1_700_000_000.25
    assert (time_of(6.92), time_of(1.9999999999)) == (Time(6, 920_000_000), Time(2, 0))
    assert stamp(BatteryState(Header(Time(3, 500_000_000)))) == 3.5
    assert isnan(stamp(BatteryState())), "a robot that does not fill it in"
    assert isnan(stamp(Twist()))


def test_types_as_people_call_them() -> None:
    assert ros_type("sensor_msgs::msg::dds_::LaserScan_") == "sensor_msgs/LaserScan"
    assert ros_type("Whatever") == "Whatever"
