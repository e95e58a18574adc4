"""The messages of ROS 2 that bodies need, as DDS carries them; the values in them, and how they are made of values.

The layouts are those of ROS 2's newest .msg files. ROS 2 compares only the names of types, and programs of Cyclone DDS
tell each other the layouts as well. Where a type ends later in newer releases (`Range`), its shorter form reads what
ROS 2 of any release sends, since nobody looks beyond the end; and programs that tell their layout need the same one.
"""

# No postponed annotations: cyclonedds reads them when it makes the classes.

from collections.abc import Callable, Mapping
from dataclasses import field
from math import asin, atan2, cos, inf, isfinite, nan, pi, sin
from typing import TYPE_CHECKING, Any, TypeAlias

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, sequence, uint8, uint32

from sleepcast.core.records import dataclass

MAX_RAYS = 20_000
"""Of one scan: beyond, it is no scan of a robot's lidar."""
SECTORS = 16
"""Parts of a scan all round, of which the nearest thing is kept; number 0 is in front, then counter-clockwise."""
SIDES = ("front", "left", "back", "right")
"""Quarters of a scan, counter-clockwise."""

_TURN = 2.0 * pi

if TYPE_CHECKING:
    Transforms: TypeAlias = list["TransformStamped"]
    Numbers: TypeAlias = list[float]
    Numbers9: TypeAlias = list[float]
    Numbers36: TypeAlias = list[float]
else:
    Numbers, Numbers9, Numbers36 = sequence[float32], array[float64, 9], array[float64, 36]


def dds_type(package: str, name: str) -> str:
    """What DDS calls a type of ROS 2."""
    return f"{package}::msg::dds_::{name}_"


def ros_type(name: str) -> str:
    """What people call a type that DDS calls so."""
    package, _, rest = name.partition("::msg::dds_::")
    return f"{package}/{rest.removesuffix('_')}" if rest else name


@dataclass
class Time(IdlStruct, typename=dds_type("builtin_interfaces", "Time")):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename=dds_type("std_msgs", "Header")):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3(IdlStruct, typename=dds_type("geometry_msgs", "Vector3")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Point(IdlStruct, typename=dds_type("geometry_msgs", "Point")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename=dds_type("geometry_msgs", "Quaternion")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Pose(IdlStruct, typename=dds_type("geometry_msgs", "Pose")):
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseWithCovariance(IdlStruct, typename=dds_type("geometry_msgs", "PoseWithCovariance")):
    pose: Pose = field(default_factory=Pose)
    covariance: Numbers36 = field(default_factory=lambda: [0.0] * 36)


@dataclass
class PoseStamped(IdlStruct, typename=dds_type("geometry_msgs", "PoseStamped")):
    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass
class Transform(IdlStruct, typename=dds_type("geometry_msgs", "Transform")):
    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@dataclass
class TransformStamped(IdlStruct, typename=dds_type("geometry_msgs", "TransformStamped")):
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)


if not TYPE_CHECKING:
    Transforms = sequence[TransformStamped]


@dataclass
class TFMessage(IdlStruct, typename=dds_type("tf2_msgs", "TFMessage")):
    transforms: Transforms = field(default_factory=list)


@dataclass
class Twist(IdlStruct, typename=dds_type("geometry_msgs", "Twist")):
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class TwistStamped(IdlStruct, typename=dds_type("geometry_msgs", "TwistStamped")):
    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


@dataclass
class TwistWithCovariance(IdlStruct, typename=dds_type("geometry_msgs", "TwistWithCovariance")):
    twist: Twist = field(default_factory=Twist)
    covariance: Numbers36 = field(default_factory=lambda: [0.0] * 36)


@dataclass
class Odometry(IdlStruct, typename=dds_type("nav_msgs", "Odometry")):
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@dataclass
class LaserScan(IdlStruct, typename=dds_type("sensor_msgs", "LaserScan")):
    header: Header = field(default_factory=Header)
    angle_min: float32 = 0.0
    angle_max: float32 = 0.0
    angle_increment: float32 = 0.0
    time_increment: float32 = 0.0
    scan_time: float32 = 0.0
    range_min: float32 = 0.0
    range_max: float32 = 0.0
    ranges: Numbers = field(default_factory=list)
    intensities: Numbers = field(default_factory=list)


@dataclass
class ShortRange(IdlStruct, typename=dds_type("sensor_msgs", "Range")):
    """Of ROS 2 before Iron."""

    header: Header = field(default_factory=Header)
    radiation_type: uint8 = 0
    field_of_view: float32 = 0.0
    min_range: float32 = 0.0
    max_range: float32 = 0.0
    range: float32 = 0.0


@dataclass
class Range(IdlStruct, typename=dds_type("sensor_msgs", "Range")):
    header: Header = field(default_factory=Header)
    radiation_type: uint8 = 0
    field_of_view: float32 = 0.0
    min_range: float32 = 0.0
    max_range: float32 = 0.0
    range: float32 = 0.0
    variance: float32 = 0.0


@dataclass
class BatteryState(IdlStruct, typename=dds_type("sensor_msgs", "BatteryState")):
    header: Header = field(default_factory=Header)
    voltage: float32 = 0.0
    temperature: float32 = nan
    current: float32 = nan
    charge: float32 = nan
    capacity: float32 = nan
    design_capacity: float32 = nan
    percentage: float32 = nan
    power_supply_status: uint8 = 0
    power_supply_health: uint8 = 0
    power_supply_technology: uint8 = 0
    present: bool = True
    cell_voltage: Numbers = field(default_factory=list)
    cell_temperature: Numbers = field(default_factory=list)
    location: str = ""
    serial_number: str = ""


@dataclass
class Imu(IdlStruct, typename=dds_type("sensor_msgs", "Imu")):
    header: Header = field(default_factory=Header)
    orientation: Quaternion = field(default_factory=Quaternion)
    orientation_covariance: Numbers9 = field(default_factory=lambda: [0.0] * 9)
    angular_velocity: Vector3 = field(default_factory=Vector3)
    angular_velocity_covariance: Numbers9 = field(default_factory=lambda: [0.0] * 9)
    linear_acceleration: Vector3 = field(default_factory=Vector3)
    linear_acceleration_covariance: Numbers9 = field(default_factory=lambda: [0.0] * 9)


@dataclass
class Bool(IdlStruct, typename=dds_type("std_msgs", "Bool")):
    data: bool = False


@dataclass
class Clock(IdlStruct, typename=dds_type("rosgraph_msgs", "Clock")):
    clock: Time = field(default_factory=Time)


# ---- the values in them, by the names that a mapping has for them; see mapping.TYPES


def seconds(time: Time) -> float:
    return float(time.sec + time.nanosec * 1e-9)


def time_of(seconds: float) -> Time:
    whole, part = divmod(seconds, 1.0)
    return Time(*divmod(int(whole) * 1_000_000_000 + round(part * 1e9), 1_000_000_000))


def stamp(message: Any) -> float:
    """When it was made, by the clock of who made it, s; NaN if it does not say."""
    header = getattr(message, "header", None)
    return seconds(header.stamp) or nan if header is not None else nan


def _angles(q: Quaternion) -> dict[str, float]:
    """Roll, pitch and yaw, rad; unknown without an orientation: a quaternion of zeros is none."""
    if not 0.9 < q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w < 1.1:
        return {"heading": nan, "roll": nan, "pitch": nan}
    return {
        "heading": atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z)),
        "roll": atan2(2.0 * (q.w * q.x + q.y * q.z), 1.0 - 2.0 * (q.x * q.x + q.y * q.y)),
        "pitch": asin(min(max(2.0 * (q.w * q.y - q.z * q.x), -1.0), 1.0)),
    }


def _pose(pose: Pose) -> dict[str, float]:
    place = pose.position
    return {"x": place.x, "y": place.y, "z": place.z, "heading": _angles(pose.orientation)["heading"]}


def _twist(twist: Twist) -> dict[str, float]:
    return {"speed": twist.linear.x, "side_speed": twist.linear.y, "turn_rate": twist.angular.z}


def sectors_of(scan: LaserScan, turned: float = 0.0) -> tuple[float, ...]:
    """Distance to the nearest thing in each sector, m; NaN where it does not look. Raises ValueError for what is no
    scan.

    turned: where its front looks, rad counter-clockwise from the robot's.
    """
    if len(scan.ranges) > MAX_RAYS:
        raise ValueError(f"a scan of {len(scan.ranges):,} rays; at most {MAX_RAYS:,} are read")
    nearest = [nan] * SECTORS
    step, angle = SECTORS / _TURN * scan.angle_increment, SECTORS / _TURN * (scan.angle_min + turned) + 0.5
    if not isfinite(step) or not isfinite(angle):
        raise ValueError("a scan whose angles are no numbers")
    least, most = _bounds("scan", scan.range_min, scan.range_max, bool(scan.ranges))
    for number, ray in enumerate(scan.ranges):
        distance = ray if least <= ray <= most else _measured(ray, least, most)
        if distance == distance:
            sector = int((angle + number * step) // 1.0) % SECTORS
            if not nearest[sector] <= distance:
                nearest[sector] = distance
    return tuple(nearest)


def _bounds(what: str, least: float, most: float, measures: bool) -> tuple[float, float]:
    """From where to where a sensor measures, m. Raises ValueError for bounds between which nothing can be, as those
    that nobody has filled in.

    measures: whether it says that it has measured something.
    """
    if measures and not (0.0 <= least <= most and most > 0.0):
        raise ValueError(f"a {what} that says to measure from {least:g} m to {most:g} m: no such distance can be")
    return least, most


def _measured(distance: float, least: float, most: float) -> float:
    """A distance, m, by REP 117: -inf is too near to be measured, inf is nothing in reach, and what is beyond the
    bounds is no measurement, NaN."""
    if abs(distance) == inf:
        return most if distance > 0.0 else least
    return distance if least <= distance <= most else nan


def _sides(sectors: tuple[float, ...]) -> dict[str, float]:
    """The nearest thing in each quarter, and all round."""
    quarter = SECTORS // 4
    sides = {"nearest": _least(sectors)}
    for number, side in enumerate(SIDES):
        middle = number * quarter
        sides[side] = _least([sectors[(middle + k) % SECTORS] for k in range(-quarter // 2, quarter // 2 + 1)])
    return sides


def _least(distances: Any) -> float:
    return min((each for each in distances if each == each), default=nan)


def _range(message: Range | ShortRange) -> dict[str, float]:
    """A ranger for one fixed distance says only whether something is within it: nearer than it by all means, so 0."""
    least, most = _bounds("range", message.min_range, message.max_range, message.range != 0.0)
    if least == most:
        return {"range": {-inf: 0.0, inf: most}.get(message.range, nan)}
    return {"range": _measured(message.range, least, most)}


def _battery(message: BatteryState) -> dict[str, float]:
    """Of a battery that is not said to be present, what is 0 was never filled in: a message of ROS 2 begins so, though
    what is not measured should be NaN. What else a driver says counts: many forget to say that it is present."""
    names = ("percentage", "voltage", "current", "temperature", "charge")
    values = {name: float(getattr(message, name)) for name in names}
    if not message.present:
        values = {name: value or nan for name, value in values.items()}
    return {**values, "present": float(message.present)}


def _imu(message: Imu) -> dict[str, float]:
    turning, pushing = message.angular_velocity, message.linear_acceleration
    known = message.orientation_covariance[0] != -1.0  # how a sensor says that it measures none
    angles = _angles(message.orientation if known else Quaternion(w=0.0))
    along = {"acceleration": pushing.x, "side_acceleration": pushing.y, "up_acceleration": pushing.z}
    return {**angles, "turn_rate": turning.z, **along}


READ: Mapping[str, tuple[type[Any], Callable[[Any], dict[str, float]]]] = {
    "Odometry": (Odometry, lambda message: {**_pose(message.pose.pose), **_twist(message.twist.twist)}),
    "Twist": (Twist, _twist),
    "TwistStamped": (TwistStamped, lambda message: _twist(message.twist)),
    "LaserScan": (LaserScan, lambda message: _sides(sectors_of(message))),
    "Range": (Range, _range),
    "BatteryState": (BatteryState, _battery),
    "Imu": (Imu, _imu),
    "PoseStamped": (PoseStamped, lambda message: _pose(message.pose)),
    "Bool": (Bool, lambda message: {"data": float(message.data)}),
}
"""Of each type: its class, and the values in a message."""
SHORT: Mapping[str, type[Any]] = {"Range": ShortRange}
"""Of each type that ends later in newer releases: what reads that of any release; see the module."""


def read(type_: str, message: Any, turned: float) -> tuple[dict[str, float], tuple[float, ...]]:
    """The values in a message, and the sectors of a scan; see `sectors_of`."""
    if type_ == "LaserScan":
        sectors = sectors_of(message, turned)
        return _sides(sectors), sectors
    return READ[type_][1](message), ()


# ---- the other way: messages of such values


def turned_by(heading: float, roll: float = 0.0, pitch: float = 0.0) -> Quaternion:
    """An orientation by its angles, rad, as a mapping has them: a heading counter-clockwise from x."""
    (cr, sr), (cp, sp), (cy, sy) = ((cos(angle / 2.0), sin(angle / 2.0)) for angle in (roll, pitch, heading))
    return Quaternion(
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    )


def _as_pose(values: Mapping[str, float]) -> Pose:
    place = Point(values.get("x", 0.0), values.get("y", 0.0), values.get("z", 0.0))
    return Pose(place, turned_by(values.get("heading", 0.0)))


def _as_twist(values: Mapping[str, float]) -> Twist:
    along = Vector3(values.get("speed", 0.0), values.get("side_speed", 0.0))
    return Twist(along, Vector3(z=values.get("turn_rate", 0.0)))


def _as_odometry(values: Mapping[str, float], header: Header) -> Odometry:
    return Odometry(header, "base_link", PoseWithCovariance(_as_pose(values)), TwistWithCovariance(_as_twist(values)))


def _as_battery(values: Mapping[str, float], header: Header) -> BatteryState:
    names = ("voltage", "temperature", "current", "charge", "percentage")
    voltage, temperature, current, charge, share = (values.get(name, nan) for name in names)
    return BatteryState(
        header, voltage, temperature, current, charge, percentage=share, present=values.get("present", 1.0) != 0.0
    )


def _as_imu(values: Mapping[str, float], header: Header) -> Imu:
    def exactness(*names: str) -> list[float]:
        """Of what is measured, not known: zeros; of what is not, as sensors say it, -1 in front."""
        return [0.0 if any(name in values for name in names) else -1.0] + [0.0] * 8

    angles, pushes = ("heading", "roll", "pitch"), ("acceleration", "side_acceleration", "up_acceleration")
    return Imu(
        header,
        turned_by(*(values.get(name, 0.0) for name in angles)),
        exactness(*angles),
        Vector3(z=values.get("turn_rate", 0.0)),
        exactness("turn_rate"),
        Vector3(*(values.get(name, 0.0) for name in pushes)),
        exactness(*pushes),
    )


def _as_scan(values: Mapping[str, float], header: Header) -> LaserScan:
    """Four rays: a side that is not known has no range."""
    ranges = [values.get(side, nan) for side in SIDES]
    return LaserScan(header, 0.0, 0.75 * _TURN, _TURN / 4.0, range_max=inf, ranges=ranges)


MADE: Mapping[str, Callable[[Mapping[str, float], Header], Any]] = {
    "Odometry": _as_odometry,
    "Twist": lambda values, _: _as_twist(values),
    "TwistStamped": lambda values, header: TwistStamped(header, _as_twist(values)),
    "LaserScan": _as_scan,
    "Range": lambda values, header: Range(header, max_range=inf, range=values["range"]),
    "BatteryState": _as_battery,
    "Imu": _as_imu,
    "PoseStamped": lambda values, header: PoseStamped(header, _as_pose(values)),
    "Bool": lambda values, _: Bool(values["data"] != 0.0),
}
"""Of each type: a message of these values, by their names in `READ`; what is not given is 0, or unknown where the type
has something for that."""


def made(type_: str, values: Mapping[str, float], now: float, frame: str = "") -> Any:
    """A message of a type.

    type_: as mappings call it.
    values: SI, by their names in `READ`.
    now: s since 1970, or by /clock.
    frame: in which frame it is.
    """
    return MADE[type_](values, Header(time_of(now), frame))
