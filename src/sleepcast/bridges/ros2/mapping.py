"""The mapping of a ROS 2 robot's topics to names: a TOML file such as turtlebot.toml beside this module.

What a topic says has the unit of its type, SI, unless the file says another one: `battery = "percentage %"` for a robot
that counts to 100. A unit must be one of the same dimension. Names without a slash at the front are within the
robot's namespace.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import inf, isfinite, isinf, isnan, pi
from pathlib import Path
from typing import NamedTuple

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.model import Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table, checked_name, toml_document
from sleepcast.core.units import ACCELERATION, LENGTH, NONE, RATE, SPEED, TIME, UNITS
from sleepcast.robot import FRESH, Limits

CLOCK = "/clock"
"""Where a simulation says what time it is."""
TURTLEBOT = Path(__file__).with_name("turtlebot.toml")
MAX_TOPICS, MAX_VALUES = 32, 64
"""Topics of each direction, and values of all that a robot tells: more is no small mapping."""
MAX_NAME = 200
"""Characters of a topic's name with its namespace: ROS has about as many."""
FASTEST, LARGEST = 1_000.0, 100.0
"""Of m/s, rad/s and m/s2, and of m: more is a mistake."""
QOS = ("sensor", "reliable", "latched")
"""How a topic is listened to: what is lost is lost; it is sent again; and what was said before comes, too."""

FLOAT32, FLOAT64 = 3.4028234663852886e38, 1.7976931348623157e308
"""The largest numbers of four and of eight bytes."""

_TOPIC = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")


class TopicReading(NamedTuple):
    """A message of a topic.

    stamp: when it was made, by the clock of who made it, s; NaN if it does not say.
    values: in the order of the mapping and in the topic's units.
    sectors: of a scan, m; see `messages`.
    """

    stamp: float
    values: tuple[float, ...]
    sectors: tuple[float, ...] = ()


class Value(NamedTuple):
    """A value in messages of a type.

    unit: in messages.
    low, high: its range.
    shown_as: the unit in which people read it.
    size: the largest number that fits into its bytes.
    endless: whether infinity means something there.
    whole: whether only 0 and 1 do.
    """

    unit: str = ""
    low: float = -inf
    high: float = inf
    shown_as: str = ""
    doc: str = ""
    size: float = FLOAT64
    endless: bool = False
    whole: bool = False

    def wrong(self, value: float, factor: float) -> str:
        """Why no message can say this, in words such as "is 0 or 1, not 2"; "" if one can.

        value: in SI.
        factor: what one of the topic's unit is in SI.
        """
        if self.whole:
            return "" if value in (0.0, 1.0) else f"is 0 or 1, not {value:g}"
        if isnan(value) or (isinf(value) and not (self.endless and value > 0.0)):
            return f"is a finite number, not {value:g}"
        if self.unit != "rad" and not self.low <= value <= self.high:  # any angle is one
            return f"is from {self.low:g} to {self.high:g}, not {value:g}"
        if isfinite(value) and abs(value / factor) > self.size:
            return f"has no room for {value / factor:g}: at most {self.size:g} fits into it"
        return ""


def _distance(doc: str) -> Value:
    return Value("m", 0.0, doc=doc, size=FLOAT32, endless=True)


_PLACE = {
    "x": Value("m", doc="along x of its frame"),
    "y": Value("m", doc="along y of its frame"),
    "z": Value("m", doc="above the ground of its frame"),
    "heading": Value("rad", -pi, pi, "deg", "counter-clockwise from x"),
}
_PACE = {
    "speed": Value("m/s", doc="along its heading"),
    "side_speed": Value("m/s", doc="to its left"),
    "turn_rate": Value("rad/s", shown_as="deg/s", doc="counter-clockwise"),
}
TYPES: Mapping[str, Mapping[str, Value]] = {
    "Odometry": {**_PLACE, **_PACE},
    "PoseStamped": _PLACE,
    "Twist": _PACE,
    "TwistStamped": _PACE,
    "LaserScan": {
        "nearest": _distance("to the nearest thing all round"),
        "front": _distance("to the nearest thing in front"),
        "left": _distance("to the nearest thing on its left"),
        "back": _distance("to the nearest thing behind it"),
        "right": _distance("to the nearest thing on its right"),
    },
    "Range": {"range": _distance("to the nearest thing before the sensor")},
    "BatteryState": {
        "percentage": Value("", 0.0, 1.0, "%", "1 is full", FLOAT32),
        "voltage": Value("", doc="in volts", size=FLOAT32),
        "current": Value("", doc="in amperes", size=FLOAT32),
        "temperature": Value("", doc="in degrees Celsius", size=FLOAT32),
        "charge": Value("", doc="in ampere-hours", size=FLOAT32),
        "present": Value("", 0.0, 1.0, doc="whether there is a battery", whole=True),
    },
    "Imu": {
        "heading": Value("rad", -pi, pi, "deg", "counter-clockwise from x"),
        "roll": Value("rad", -pi, pi, "deg", "to the right"),
        "pitch": Value("rad", -pi, pi, "deg", "nose down"),
        "turn_rate": Value("rad/s", shown_as="deg/s", doc="counter-clockwise"),
        "acceleration": Value("m/s2", doc="forwards"),
        "side_acceleration": Value("m/s2", doc="to its left"),
        "up_acceleration": Value("m/s2", doc="upwards"),
    },
    "Bool": {"data": Value("", 0.0, 1.0, doc="whether it is so", whole=True)},
}
"""Types of messages, and the values in each."""
DRIVES = ("Twist", "TwistStamped")
"""Types that a robot can be driven by."""
DRIVE_SIDE = "drive_side"
"""The name that a speed to the side has on every robot that is driven so."""
STOPPED = "stopped"
"""The name that the topic for STOP has."""
FRAMES = {"PoseStamped": "map", "Odometry": "odom"}
"""In which frame things are, if the mapping does not say it; else, in that of the robot."""
BASE = "base_link"
ANGLES = ("deg", "rad")
"""Units without a dimension that are no shares."""


@dataclass(frozen=True, slots=True)
class TopicField:
    """A value of a topic, and the name that it has in expressions. factor: what one of the topic's unit is in SI."""

    name: str
    value: str
    factor: float


@dataclass(frozen=True, slots=True)
class SensorTopic:
    """A topic that a robot publishes.

    topic: with its namespace.
    name: without it, as the file has it.
    type: of its messages, as mappings call it.
    qos: one of `QOS`.
    freshness: s for which a value counts.
    turned: where the front of its scanner looks, rad.
    """

    topic: str
    name: str
    type: str
    fields: tuple[TopicField, ...]
    qos: str
    freshness: float
    turned: float


@dataclass(frozen=True, slots=True)
class CommandTopic:
    """A topic that a robot listens to.

    topic, name, type: as those of a source.
    fields: of a function, its arguments.
    function: that publishes there, its name in expressions.
    frame: of the messages.
    goal: whether a planner drives the robot there.
    """

    topic: str
    name: str
    type: str
    fields: tuple[TopicField, ...]
    function: str = ""
    frame: str = ""
    goal: bool = False

    @property
    def qos(self) -> str:
        """One of `QOS`: what is said for STOP reaches who comes later."""
        return "latched" if self.type == "Bool" and not self.function else "reliable"


@dataclass(frozen=True, slots=True)
class RobotMapping:
    """What a file says of a robot.

    radius: m.
    stop: where STOP is published; None if nowhere.
    """

    name: str
    limits: Limits
    radius: float
    sources: tuple[SensorTopic, ...]
    drive: CommandTopic
    stop: CommandTopic | None
    functions: tuple[CommandTopic, ...]

    @property
    def sinks(self) -> tuple[CommandTopic, ...]:
        """All that it is told."""
        return (self.drive, *self.functions, *((self.stop,) if self.stop else ()))

    def sensors(self) -> tuple[Quantity, ...]:
        """In the order of sources and fields."""
        return tuple(
            Quantity(field.name, known.unit, known.low, known.high, source.freshness, known.doc, known.shown_as)
            for source in self.sources
            for field in source.fields
            for known in (TYPES[source.type][field.value],)
        )

    def actuators(self) -> tuple[Quantity, ...]:
        """Speed and turn rate, and the speed to its left of what drives in every direction, within the limits."""
        speed, turn, *side = self.drive.fields
        most, fastest = self.limits.speed, self.limits.turn_rate
        return (
            Quantity(speed.name, "m/s", -most, most, doc="drives ahead at this speed"),
            Quantity(turn.name, "rad/s", -fastest, fastest, doc="turns at this rate", shown_as="deg/s"),
            *(Quantity(DRIVE_SIDE, "m/s", -most, most, doc="drives to its left at this speed") for _ in side),
        )


def is_namespace(text: str) -> bool:
    """Whether ROS takes this for a namespace: "" or /parts, each of letters, digits and _."""
    return len(text) <= MAX_NAME and bool(_NAMESPACE.fullmatch(text))


def read_mapping(path: Path, namespace: str, text: str | None = None) -> RobotMapping:
    """The mapping in a file, for a robot with this namespace. Raises SettingsError.

    text: what is in the file; None to read it.
    """
    with toml_document(path, text).root() as root:
        limits = Limits(
            root.number("speed", SPEED, low=0.01, high=FASTEST),
            root.number("turn_rate", RATE, low=0.01, high=FASTEST),
            root.number("acceleration", ACCELERATION, low=0.01, high=FASTEST),
        )
        name = checked_name(root, root.text("name", "robot"), "name")
        reader = _MappingReader(namespace)
        inputs = root.tables("in", most=MAX_TOPICS)
        sources = tuple(reader.source(topic, table) for topic, table in inputs.items())
        if not sources:
            raise root.error("in", "a robot that tells nothing: wanted at least one topic, such as [in.odom]")
        tables = root.tables("out", most=MAX_TOPICS)
        sinks = [reader.sink(topic, table) for topic, table in tables.items()]
        drives = [sink for sink in sinks if sink.type in DRIVES]
        if len(drives) != 1:
            wanted = f"wanted one topic of the type {' or '.join(DRIVES)}, to drive it"
            raise root.error("out", f"{wanted}; there are {len(drives)}")
        functions = tuple(sink for sink in sinks if sink.function)
        stops = [sink for sink in sinks if sink.type == "Bool" and not sink.function]
        if len(stops) > 1:
            raise root.error("out", f"{len(stops)} topics for STOP; at most one fits: give the others a function")
        goals = [sink.function for sink in functions if sink.goal]
        if goals and not stops:
            wanted = f'wanted a topic of the type Bool with values = {{ {STOPPED} = "data" }}, as a lock of twist_mux'
            raise root.error(
                "out", f"{goals[0]} has a planner drive the robot, and nothing would stop it: {wanted}; or goal = false"
            )
        return RobotMapping(
            name,
            limits,
            root.number("radius", LENGTH, low=0.01, high=LARGEST),
            sources,
            drives[0],
            stops[0] if stops else None,
            functions,
        )


class _MappingReader:
    """Reads topics, and refuses what is there twice."""

    def __init__(self, namespace: str) -> None:
        self._namespace = namespace
        self._names: dict[str, str] = {}
        self._topics: set[str] = set()

    def source(self, topic: str, table: Table) -> SensorTopic:
        with table:
            type_ = table.text("type", choices=tuple(TYPES))
            turned = table.number("turned", NONE, 0.0, low=-pi, high=pi) if type_ == "LaserScan" else 0.0
            return SensorTopic(
                self._topic(table, topic, "in"),
                topic,
                type_,
                self._fields(table, type_),
                table.text("qos", "sensor", choices=QOS),
                table.number("freshness", TIME, FRESH, low=0.1, high=3600.0),
                turned,
            )

    def sink(self, topic: str, table: Table) -> CommandTopic:
        with table:
            type_ = table.text("type", choices=tuple(TYPES))
            full_name = self._topic(table, topic, "out")
            if type_ not in DRIVES and (type_ != "Bool" or table.has("function")):
                return self._function(table, full_name, topic, type_)
            fields = self._fields(table, type_)
            if type_ == "Bool":
                if fields[0].name.casefold() != STOPPED:
                    wanted = f'wanted {STOPPED} = "data", or a function'
                    raise table.error("values", wanted)
                return CommandTopic(full_name, topic, type_, fields)
            by_value = {field.value: field for field in fields}
            if by_value.keys() - {"side_speed"} != {"speed", "turn_rate"} or len(by_value) < len(fields):
                wanted = "wanted two names, one for speed and one for turn_rate, and perhaps one for side_speed"
                raise table.error("values", wanted)
            side = by_value.get("side_speed")
            if side is not None and side.name.casefold() != DRIVE_SIDE:
                raise table.error("values", f'what drives it to its side is called {DRIVE_SIDE}, not "{side.name}"')
            driven = (by_value["speed"], by_value["turn_rate"], *((side,) if side else ()))
            return CommandTopic(full_name, topic, type_, driven, frame=BASE)

    def _function(self, table: Table, topic: str, name: str, type_: str) -> CommandTopic:
        function = checked_name(table, table.text("function"), "function")
        self._take(table, "function", function)
        if type_ == "Bool" and not table.has("values"):
            return CommandTopic(topic, name, type_, (TopicField("on", "data", 1.0),), function)
        fields = self._fields(table, type_, arguments=True)
        values = [field.value for field in fields]
        if len(set(values)) < len(values):
            raise table.error("values", "one of them is there twice")
        if type_ == "LaserScan" and "nearest" in values:
            raise table.error("values", "a scan is made of front, left, back and right; nearest follows from them")
        frame = table.text("frame", FRAMES.get(type_, BASE), most=MAX_NAME)
        if not frame.isprintable():
            raise table.error("frame", f"{frame!r:.60} is no name of a frame: wanted one such as {BASE}")
        goal = type_ == "PoseStamped" and table.flag("goal", True)
        return CommandTopic(topic, name, type_, fields, function, frame, goal)

    def _topic(self, table: Table, topic: str, direction: str) -> str:
        full_name = topic if topic.startswith("/") else f"{self._namespace}/{topic}"
        if not _TOPIC.fullmatch(topic) or len(full_name) > MAX_NAME:
            wanted = 'wanted letters, digits and _, in parts with slashes between them, such as "sensors/front"'
            raise table.error("type", f'"{topic:.60}" is no topic of ROS 2: {wanted}')
        if (direction + full_name) in self._topics:
            raise table.error("type", f"{full_name} is there twice")
        self._topics.add(direction + full_name)
        return full_name

    def _fields(self, table: Table, type_: str, *, arguments: bool = False) -> tuple[TopicField, ...]:
        """arguments: whether the names are those of a function's arguments, which others may have, too."""
        values = table.table("values")
        if not values.names():
            raise table.error("values", f"is missing; wanted names for its values, such as {{ {_example(type_)} }}")
        fields = []
        for name in values.names():
            value, _, unit = values.text(name).partition(" ")
            known = TYPES[type_].get(value)
            if known is None:
                hint = f"{did_you_mean(value, TYPES[type_])}; there are {', '.join(TYPES[type_])}"
                raise values.error(name, f'{type_} has no value "{value}"{hint}')
            checked_name(values, name)
            if not arguments:
                self._take(values, name, name)
            with values.answering(name):
                fields.append(TopicField(name, value, _factor(type_, value, known, unit.strip())))
        return tuple(fields)

    def _take(self, table: Table, key: str, name: str) -> None:
        before = self._names.setdefault(name.casefold(), name)
        if before is not name:
            raise table.error(key, f'there is a "{before}" already; case does not count')
        if len(self._names) > MAX_VALUES:
            raise table.error(key, f"more than {MAX_VALUES} names")


def _factor(type_: str, value: str, known: Value, unit: str) -> float:
    """What one of this unit is in SI. Raises MisuseError where it does not fit."""
    if not unit:
        return 1.0
    if known.unit == "rad":
        raise MisuseError(f'{value} of {type_} is that of an orientation, which has no unit: leave out "{unit:.20}"')
    dimension = UNITS[known.unit].dimension if known.unit else NONE
    fitting = [name for name, each in UNITS.items() if each.dimension == dimension and name not in ANGLES]
    if unit not in UNITS:
        raise MisuseError(f'unknown unit "{unit:.20}"{did_you_mean(unit, fitting)}; wanted one of {", ".join(fitting)}')
    if unit not in fitting:
        what = "angles" if unit in ANGLES else f"{UNITS[unit].dimension}"
        raise MisuseError(
            f'{value} of {type_} is {dimension}, and "{unit}" is a unit of {what}; wanted one of {", ".join(fitting)}'
        )
    return UNITS[unit].factor


def _example(type_: str) -> str:
    value = next(iter(TYPES[type_]))
    return f'{value} = "{value}"'
