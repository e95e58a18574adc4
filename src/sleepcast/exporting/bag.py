"""A recorded run as a bag of ROS 2: a folder with `metadata.yaml` and one MCAP file whose messages are CDR, for Humble
and later releases.

    /poses        PoseArray        all robots, in the frame map
    /tf           TFMessage        NAME/odom to NAME/base_link; map to NAME/odom, and sonars, are in /tf_static
    /NAME/pose    PoseStamped      where it really was, in the frame map
    /NAME/sonar   Range            one message for each sonar that has heard or missed an echo
    /NAME/...     BatteryState, String, Bool, Float64: battery, groups, STOP, all other sensors
    /map          OccupancyGrid    the solid things, at the start and when they have changed
    /rosout       Log              what was said
    /commands     String           the operator's expressions
    /outcomes     DiagnosticArray  what became of a command

Times are simulated, from 0. What ROS 2 has no field for is left out rather than made up: a pose has no covariance, and
there is no Odometry, since nobody has measured a turn rate.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from math import cos, inf, isnan, nan, pi, sin
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sleepcast.core.extras import installing
from sleepcast.exporting.occupancy import occupancy
from sleepcast.exporting.run import (
    CommandEvent,
    Event,
    LogLineEvent,
    MarksEvent,
    OutcomeEvent,
    PosesEvent,
    ReadingsEvent,
    RecordedRun,
    RobotsEvent,
    SolidsEvent,
)
from sleepcast.exporting.table_files import MissingExtraError
from sleepcast.simulator.recording.foxglove import Level
from sleepcast.simulator.recording.json_messages import AccountBody
from sleepcast.simulator.recording.recorder import NANO
from sleepcast.simulator.scenario.robot_settings import Ring
from sleepcast.simulator.world.world import Shape

MAX_OWN_TOPICS = 100
"""Robots that have topics of their own: each has about twenty, and programs for bags list all of them."""
SEVERITY = {Level.INFO: 20, Level.WARNING: 30, Level.ERROR: 40}
"""Of rcl_interfaces/Log."""
METADATA_VERSION: Literal[8] = 8
"""Of `metadata.yaml`. In 9 QoS are no text any more, which Humble and Iron refuse; Jazzy reads 8, too."""
FOREVER = 9_223_372_036, 854_775_807
"""Seconds and nanoseconds, as `ros2 bag` writes an infinite duration."""
MAP = "map"
BATTERY = "battery"
STOPPED = 1
"""The flag of a robot that STOP holds."""
TYPES = {
    name: f"{package}/msg/{name}"
    for package, names in (
        ("builtin_interfaces", "Time"),
        ("std_msgs", "Header Bool Float64 String"),
        ("geometry_msgs", "Point Quaternion Pose PoseArray PoseStamped Vector3 Transform TransformStamped"),
        ("tf2_msgs", "TFMessage"),
        ("sensor_msgs", "Range BatteryState"),
        ("nav_msgs", "MapMetaData OccupancyGrid"),
        ("rcl_interfaces", "Log"),
        ("diagnostic_msgs", "DiagnosticArray DiagnosticStatus KeyValue"),
    )
    for name in names.split()
}
_SONAR = re.compile(r"sonar(\d{1,4})")
_OUTCOMES = ("matched", "not_matched", "unknown", "fault", "silent", "held", "predicted")


def bag_files(name: str) -> frozenset[str]:
    """The files of a bag whose folder has this name."""
    return frozenset({"metadata.yaml", f"{name}.mcap"})


def topic_names(names: Iterable[str]) -> dict[str, str]:
    """What robots are called in ROS, where names consist of letters, digits and _ and begin with a letter; each has its
    own."""
    told, taken = dict[str, str](), set[str]()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
        plain = plain if plain[:1].isalpha() else f"robot_{plain}".rstrip("_")
        wanted, number = plain, 2
        while plain in taken:
            plain, number = f"{wanted}_{number}", number + 1
        taken.add(plain)
        told[name] = plain
    return told


@cache
def _message_types() -> Any:
    """The message types of Jazzy. The library makes code of each that is used, which takes half a second."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


class Bag:
    """A bag to which messages are written. counts: messages so far by topic; types: of topics. Raises
    MissingExtraError, and OSError if it cannot be written."""

    def __init__(self, folder: Path, facts: Mapping[str, object]) -> None:
        try:
            from rosbags import interfaces
            from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
        except ImportError as error:
            raise MissingExtraError(
                f"bags of ROS 2 are written with rosbags, which is not here; to install it: {installing('bags')}"
            ) from error
        self._ros: Any = interfaces
        self._store = _message_types()
        self._writer = Writer(folder, version=METADATA_VERSION, storage_plugin=StoragePlugin.MCAP)
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        for key, value in facts.items():
            self._writer.set_custom_data(f"sleepcast_{key}", str(value))
        self._writer.open()
        self._topics: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        self.types: dict[str, str] = {}

    def new(self, type_name: str, **fields: Any) -> Any:
        """A message, or a part of one, of a type of `TYPES`."""
        return self._store.types[TYPES[type_name]](**fields)

    def write(self, topic: str, type_name: str, time: float, message: Any, *, latched: bool = False) -> None:
        """Write a message of `time`, s. latched: who comes later gets the last one, too."""
        if topic not in self._topics:
            qos = self._qos(latched=latched)
            self._topics[topic] = self._writer.add_connection(
                topic, TYPES[type_name], typestore=self._store, offered_qos_profiles=[qos]
            )
            self.counts[topic], self.types[topic] = 0, TYPES[type_name]
        data = self._store.serialize_cdr(message, TYPES[type_name])
        self._writer.write(self._topics[topic], round(time * NANO), data)
        self.counts[topic] += 1

    def close(self) -> None:
        """Write the index and `metadata.yaml`."""
        self._writer.close()

    def abort(self) -> None:
        """Close what is open."""
        self._writer.abort()

    def _qos(self, *, latched: bool) -> Any:
        ros, forever = self._ros, self._ros.QosTime(*FOREVER)
        return ros.Qos(
            history=ros.QosHistory.KEEP_LAST,
            depth=1 if latched else 10,
            reliability=ros.QosReliability.RELIABLE,
            durability=ros.QosDurability.TRANSIENT_LOCAL if latched else ros.QosDurability.VOLATILE,
            deadline=forever,
            lifespan=forever,
            liveliness=ros.QosLiveliness.AUTOMATIC,
            liveliness_lease_duration=forever,
            avoid_ros_namespace_conventions=False,
        )


class BagSink:
    """Makes messages of events. bag: into which they go; run: of which."""

    def __init__(self, run: RecordedRun, bag: Bag) -> None:
        self._run, self._bag = run, bag
        self._topics = topic_names(run.wanted)
        self._robots = self._there()
        self.own_topics = len(run.wanted) <= MAX_OWN_TOPICS
        self._sensors = topic_names(run.sensors)
        self._solids: Mapping[int, Shape] | None = None
        """What is to be in the map that is not written yet."""
        self._mapped = False
        self._shown: dict[str, object] = {}
        """What a topic said last that speaks only when something has changed."""
        if self.own_topics:
            self._frames(run.recording.began)

    def take(self, event: Event) -> None:
        """Write what an event says. Raises ValueError for what fits no message."""
        match event:
            case PosesEvent():
                self._map(event.time)
                self._poses(event)
            case ReadingsEvent() if self.own_topics:
                for name, robot in self._robots:
                    self._readings(event, name, robot)
            case MarksEvent() if self.own_topics:
                for name, robot in self._robots:
                    self._changed(f"/{name}/group", "String", event.time, event.name_of(int(event.group[robot])))
                    self._changed(f"/{name}/stopped", "Bool", event.time, bool(event.flags[robot] & STOPPED))
            case RobotsEvent():
                self._robots = self._there()
            case LogLineEvent():
                self._line(event)
            case CommandEvent(time, _, message):
                self._bag.write("/commands", "String", time, self._string(message.text or message.kind.name))
            case OutcomeEvent(time, account):
                self._outcome(time, account)
            case SolidsEvent(_, _, _, solids):
                self._solids = solids

    # ---- robots

    def _there(self) -> list[tuple[str, int]]:
        """The wanted robots that are there: what each is called in topics, and its index."""
        names = map(self._topics.__getitem__, self._run.chosen_names)
        return list(zip(names, self._run.chosen.tolist(), strict=True))

    def _frames(self, time: float) -> None:
        """Say where frames are that do not move: `odom` begins at `map`, and sonars stand round the rim."""
        fixed = []
        for robot_name, (robot, _) in self._run.wanted.items():
            name = self._topics[robot_name]
            fixed.append(self._transform(time, MAP, f"{name}/odom", 0.0, 0.0, 0.0))
            spec = self._run.spec(robot)
            for number in range(spec.ring.count if spec.ring else 0):
                angle, away = 2.0 * pi * number / (spec.ring.count if spec.ring else 1), spec.geometry.radius
                at = (away * cos(angle), away * sin(angle), angle)
                fixed.append(self._transform(time, f"{name}/base_link", f"{name}/sonar_{number}", *at))
        self._bag.write("/tf_static", "TFMessage", time, self._bag.new("TFMessage", transforms=fixed), latched=True)

    def _poses(self, event: PosesEvent) -> None:
        time, bag = event.time, self._bag
        chosen = self._run.chosen
        rows = np.column_stack((event.poses[chosen].astype(np.float64), event.z[chosen])).tolist()
        poses = [self._pose(*row) for row in rows]
        bag.write("/poses", "PoseArray", time, bag.new("PoseArray", header=self._header(time, MAP), poses=poses))
        if not self.own_topics:
            return
        moved = []
        for (name, _), row, pose in zip(self._robots, rows, poses, strict=True):
            stamped = bag.new("PoseStamped", header=self._header(time, MAP), pose=pose)
            bag.write(f"/{name}/pose", "PoseStamped", time, stamped)
            moved.append(self._transform(time, f"{name}/odom", f"{name}/base_link", *row))
        bag.write("/tf", "TFMessage", time, bag.new("TFMessage", transforms=moved))

    def _readings(self, event: ReadingsEvent, name: str, robot: int) -> None:
        ring = self._run.spec(robot).ring
        for sensor, values in event.values.items():
            value, sonar = float(values[robot]), _SONAR.fullmatch(sensor)
            if sonar is not None and ring is not None:
                self._sonar(event.time, name, int(sonar[1]), ring, value)
            elif sensor == BATTERY and self._is_share(sensor):
                made = partial(self._battery, f"{name}/base_link")
                self._known(f"/{name}/battery_state", "BatteryState", event.time, value, made)
            else:
                topic = f"/{name}/readings/{self._sensors.get(sensor) or topic_names([sensor])[sensor]}"
                self._known(topic, "Float64", event.time, value, self._number)

    def _sonar(self, time: float, name: str, number: int, ring: Ring, value: float) -> None:
        """Infinite where nothing was in reach, minus infinite for what is too near to be measured (REP 117)."""
        if isnan(value):  # it has not fired
            return
        bag = self._bag
        message = bag.new(
            "Range",
            header=self._header(time, f"{name}/sonar_{number}"),
            radiation_type=0,  # ultrasound
            field_of_view=ring.beam,
            min_range=ring.least,
            max_range=ring.most,
            range=inf if value >= ring.most else -inf if value <= ring.least else value,
            variance=0.0,  # unknown
        )
        bag.write(f"/{name}/sonar", "Range", time, message)

    def _is_share(self, sensor: str) -> bool:
        return sensor in self._run.sensors and self._run.sensors[sensor].unit == "%"

    def _known(self, topic: str, type_name: str, time: float, value: float, made: Any) -> None:
        """Write a number, NaN for unknown, once it was known: what a robot lacks has no topic."""
        if not isnan(value) or topic in self._bag.counts:
            self._bag.write(topic, type_name, time, made(time, value))

    def _number(self, _: float, value: float) -> Any:
        return self._bag.new("Float64", data=value)

    def _battery(self, frame: str, time: float, value: float) -> Any:
        none = np.zeros(0, np.float32)
        unmeasured = dict.fromkeys(("voltage", "temperature", "current", "charge", "capacity", "design_capacity"), nan)
        unknown = dict.fromkeys(("power_supply_status", "power_supply_health", "power_supply_technology"), 0)
        return self._bag.new(
            "BatteryState",
            header=self._header(time, frame),
            percentage=value,
            present=True,
            cell_voltage=none,
            cell_temperature=none,
            location="",
            serial_number="",
            **unmeasured,
            **unknown,
        )

    def _changed(self, topic: str, type_name: str, time: float, value: object) -> None:
        if self._shown.get(topic) != value:
            self._shown[topic] = value
            message = self._string(value) if isinstance(value, str) else self._bag.new(type_name, data=value)
            self._bag.write(topic, type_name, time, message, latched=True)

    # ---- the run

    def _map(self, time: float) -> None:
        """Write the solid things, if they have changed since, and if there are or were any."""
        if self._solids is None or not (self._solids or self._mapped):
            return
        self._mapped, bag, scenario = True, self._bag, self._run.scenario
        grid = occupancy(scenario.width, scenario.height, self._solids.values())
        self._solids = None
        rows, columns = grid.values.shape
        info = bag.new(
            "MapMetaData",
            map_load_time=self._stamp(time),
            resolution=grid.cell,
            width=columns,
            height=rows,
            origin=self._pose(0.0, 0.0, 0.0, 0.0),
        )
        message = bag.new("OccupancyGrid", header=self._header(time, MAP), info=info, data=grid.values.ravel())
        bag.write("/map", "OccupancyGrid", time, message, latched=True)

    def _line(self, event: LogLineEvent) -> None:
        message = self._bag.new(
            "Log",
            stamp=self._stamp(event.time),
            level=SEVERITY[event.level],
            name=_plain(event.name),
            msg=_plain(event.text),
            file="",
            function="",
            line=0,
        )
        self._bag.write("/rosout", "Log", event.time, message)

    def _outcome(self, time: float, account: AccountBody) -> None:
        bag = self._bag
        told = {name: str(getattr(account, name)) for name in _OUTCOMES} | {"values": account.values}
        status = bag.new(
            "DiagnosticStatus",
            level=1 if account.fault or account.silent else 0,
            name=_plain(account.command),
            message=_plain(account.text),
            hardware_id="",
            values=[bag.new("KeyValue", key=key, value=_plain(text)) for key, text in told.items()],
        )
        message = bag.new("DiagnosticArray", header=self._header(time, ""), status=[status])
        bag.write("/outcomes", "DiagnosticArray", time, message)

    # ---- parts of messages

    def _string(self, text: str) -> Any:
        return self._bag.new("String", data=_plain(text))

    def _stamp(self, time: float) -> Any:
        seconds, nanoseconds = divmod(round(time * NANO), NANO)
        return self._bag.new("Time", sec=seconds, nanosec=nanoseconds)

    def _header(self, time: float, frame: str) -> Any:
        return self._bag.new("Header", stamp=self._stamp(time), frame_id=frame)

    def _pose(self, x: float, y: float, heading: float, z: float) -> Any:
        bag = self._bag
        return bag.new("Pose", position=bag.new("Point", x=x, y=y, z=z), orientation=self._turn(heading))

    def _turn(self, heading: float) -> Any:
        return self._bag.new("Quaternion", x=0.0, y=0.0, z=sin(heading / 2.0), w=cos(heading / 2.0))

    def _transform(
        self, time: float, frame: str, child: str, x: float, y: float, heading: float, z: float = 0.0
    ) -> Any:
        bag = self._bag
        transform = bag.new("Transform", translation=bag.new("Vector3", x=x, y=y, z=z), rotation=self._turn(heading))
        return bag.new("TransformStamped", header=self._header(time, frame), child_frame_id=child, transform=transform)


def _plain(text: str) -> str:
    """As strings of ROS can be: they end at a zero byte."""
    return text.replace("\0", "")


def left_out(sink: BagSink) -> Sequence[str]:
    """What a bag lacks of a recording, in sentences."""
    said = ["stored and failing rules, second groups, colours, and flags other than STOP: --to csv has them"]
    if not sink.own_topics:
        said.append(
            f"topics and frames of each robot: only up to {MAX_OWN_TOPICS} robots have them, choose some with --only"
        )
    return said
