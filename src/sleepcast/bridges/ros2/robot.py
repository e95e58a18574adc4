"""ROS 2 robots as bodies: `ros2:///NAMESPACE`, over DDS, without ROS on this computer.

    ros2:///scout3                              a TurtleBot-like robot, whose topics are /scout3/odom and so on
    ros2:///?mapping=rover.toml                 one without a namespace, with a mapping of its own
    ros2:///scout3?use_sim_time=yes&domain=7    one in a simulation, whose time is what /clock says

`mapping` says how topics become names, `link` is the way to them. The robot is told its speeds in every
round; rest, and STOP, are zeros said again and again. STOP is also said at a latched topic, and repeated, so that a
driver of the robot that starts later knows it as well. A robot that has not been heard for `SILENT` is out of reach,
and is told to stand all the same, in every round, since it may hear what we do not.

A goal is a pose for a planner on the robot, which drives it while we say no speeds. Nothing but the lock takes a goal
away from a planner that we know only by its topic: so the latched topic says true from when the body is to do anything
else, STOP or not, until there is a new goal. An old goal never resumes by itself.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import KW_ONLY
from functools import partial
from math import hypot, inf, isfinite, isnan, nan, pi
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from sleepcast.bridges import Opening
from sleepcast.bridges.address import BodyError, read_body_address
from sleepcast.bridges.body import BridgedBody, Motion
from sleepcast.bridges.ros2.mapping import (
    CLOCK,
    TURTLEBOT,
    TYPES,
    CommandTopic,
    RobotMapping,
    SensorTopic,
    TopicField,
    TopicReading,
    Value,
    is_namespace,
    read_mapping,
)
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.core.model import HostFunction
from sleepcast.core.records import dataclass
from sleepcast.core.units import NONE, UNITS, Dimension
from sleepcast.robot import FRESH, Geometry, OutOfReachError, Reading, RobotModel

if TYPE_CHECKING:
    from sleepcast.bridges.ros2.link import Ros2Network

EXAMPLE = "ros2:///scout3"
SILENT = 2.0
"""Seconds without a message of those that come all the time, after which the robot is out of reach."""
ASTRAY = 1.0
"""Seconds by which the times of messages may differ from the clock."""
HIGHEST_DOMAIN = 232
"""DDS has no ports for higher ones."""
AGAIN = 1.0
"""Seconds after which the word at the topic for STOP is said again: not everybody who listens there takes what was
latched before."""
RANGES = SUBNET, LOCALHOST = "subnet", "localhost"
"""Where others are looked for."""
MEETING = 10.0
"""Seconds for its first words: with loss, both sides need some to find each other."""
GLANCE = 0.02
"""Seconds between two looks for its first words."""
LAST_WORDS = 3
"""How often it is told to stand at the end: it may not hear each of them."""


@dataclass(frozen=True, slots=True, eq=False)
class PlannerGoal(Motion):
    """A pose for a planner that listens at a topic. values: as its function got them."""

    _: KW_ONLY
    sink: CommandTopic


class RobotLink(Protocol):
    """The way to a robot. Each may raise OutOfReachError."""

    def heard(self) -> Mapping[str, TopicReading]:
        """The last message of each topic at which something came since the last call."""

    def say(self, topic: str, values: Mapping[str, float], now: float) -> None:
        """Send a message with these values, in the topic's units. now: when it is made, s since 1970 or by /clock."""

    def remarks(self) -> list[str]:
        """Sentences about what does not fit, each once."""

    def is_published(self, topic: str) -> bool:
        """Whether somebody publishes there what can be read."""

    def close(self) -> None:
        """Close the connection, when what was sent has arrived."""


class Ros2Body(BridgedBody):
    """See the module.

    sim_time: whether time is what /clock says.
    epoch: the clock of this computer, s since 1970, with which times of messages are compared.
    """

    def __init__(
        self,
        link: RobotLink,
        mapping: RobotMapping,
        *,
        sim_time: bool = False,
        clock: Clock | None = None,
        epoch: Callable[[], float] = time.time,
    ) -> None:
        super().__init__(model_of(mapping), clock=clock)
        self._link, self._mapping, self._epoch = link, mapping, epoch
        self._sources = {source.topic: source for source in mapping.sources}
        lively = {topic for topic, source in self._sources.items() if source.freshness <= FRESH}
        self._lively = lively or set(self._sources)
        """Topics at which something comes all the time."""
        self._arrived: dict[str, tuple[float, TopicReading]] = {}
        self._quantities = {sensor.name: sensor for sensor in self.model.sensors}
        self._wrong: set[str] = set()
        """What is wrong and has been said, until it is right."""
        self._locked: bool | None = None
        self._lock_at = -inf
        """What was last said at the topic for STOP, and when it is said again."""
        self._goal: Motion | None = None
        """The goal that a planner has."""
        now = self._clock.now()
        self._pulse, self._time = now, 0.0 if sim_time else now
        """When the robot was last heard; the time of the last reading."""
        self._sim_time = sim_time
        self._simulated, self._ticked, self._before = nan, now, 0.0
        """What /clock last said, when it last changed, and seconds of the simulations before this one."""

    # ---- what a bridge says

    def carry_out(self, motion: Motion) -> None:
        if isinstance(motion, PlannerGoal):
            if motion is not self._goal:
                self._say(motion.sink, motion.values)
                self._goal = motion
            self._lock_others(self._stopped)
        else:
            self._tell(*(motion.values if motion.sort == "speeds" else self._standstill))

    def course(self, motion: Motion) -> tuple[float, float] | None:
        """Of a goal: what its planner has it do now."""
        if not isinstance(motion, PlannerGoal):
            return super().course(motion)
        most = self.model.limits
        known = {} if self.stale else dict(zip(self._quantities, self.reading().values, strict=True))
        measured = known.get("speed", nan), known.get("turn_rate", nan)
        return most.speed if isnan(measured[0]) else measured[0], most.turn_rate if isnan(measured[1]) else measured[1]

    def drift_measured(self) -> tuple[float, float]:
        return self._measured("speed"), self._measured("side_speed")

    def course_measured(self) -> tuple[float, float]:
        speed, turn_rate = super().course_measured()
        return hypot(speed, self._measured("side_speed")) if self.model.is_omni else speed, turn_rate

    def _measured(self, value: str) -> float:
        """What a topic tells of this value, whatever its name; NaN for unknown."""
        known = self._sensed()
        names = (field.name for source in self._mapping.sources for field in source.fields if field.value == value)
        return next((known[name] for name in names if name in known), nan)

    def measure(self) -> None:
        self._listen()
        self._check_pulse()

    def reading(self) -> Reading:
        now, values = self._clock.now(), list[float]()
        for topic, source in self._sources.items():
            arrived, heard = self._arrived.get(topic, (now, None))
            if heard is None or now - arrived > source.freshness:
                values += [nan] * len(source.fields)
            else:
                values += map(partial(self._known, source), source.fields, heard.values)
        return Reading(self._time, tuple(values))

    def seek(self) -> None:
        self._check_pulse()

    def round(self) -> None:
        super().round()
        if self._lost is not None:
            with suppress(*self.FAILURES, *self.REFUSALS):
                self._tell(*self._standstill)
                before = self._pulse
                self._listen()
                if self._pulse > before:  # it is back: no need to wait for the next look
                    self._next = 0.0

    def leave(self) -> None:
        self._stopped = True  # so that others who drive it let go, too
        try:
            for _ in range(LAST_WORDS):
                self._tell(*self._standstill)
        except (OutOfReachError, MisuseError) as error:
            self._lost = error
        self._link.close()

    @property
    def measures_ranges(self) -> bool:
        return any(source.type == "LaserScan" for source in self._mapping.sources)

    def nearest(self, first: float, last: float) -> float:
        now, distances = self._clock.now(), list[float]()
        for topic, source in self._sources.items():
            arrived, heard = self._arrived.get(topic, (now, None))
            if heard is None or not heard.sectors or now - arrived > source.freshness:
                continue
            width = 2.0 * pi / len(heard.sectors)
            wide = last - first + width  # sectors that only begin there, too
            for number, distance in enumerate(heard.sectors):
                if (number * width - first + width / 2.0) % (2.0 * pi) <= wide and not isnan(distance):
                    distances.append(distance)
        return min(distances, default=nan)

    def meet(self, patience: float) -> None:
        """Wait for the robot's first words, so many s at most. Raises OutOfReachError if none come."""
        ends = self._clock.now() + patience
        while not self._lively & self._arrived.keys() or (self._sim_time and isnan(self._simulated)):
            if self._clock.now() > ends:
                where = " and ".join([*sorted(self._lively), *([CLOCK] if self._sim_time else [])])
                why = "; ".join([f"nothing came at {where} for {patience:g} s{self._silence()}", *self.complaints()])
                raise OutOfReachError(why)
            time.sleep(GLANCE)
            self._listen()

    # ---- what expressions may ask

    def tell(self, *values: float, sink: CommandTopic) -> None:
        """Publish these values at a topic, or have a planner drive there. Raises MisuseError, OutOfReachError."""
        for field, value in zip(sink.fields, values, strict=True):
            if wrong := TYPES[sink.type][field.value].wrong(value, field.factor):
                raise MisuseError(f"{field.value} of {sink.type} {wrong}")
        if not sink.goal:
            self.send(lambda: self._say(sink, values))
            return
        before = self._motion
        again = isinstance(before, PlannerGoal) and (before.sink, before.values) == (sink, values)
        self.move(before if again else PlannerGoal("goal", values, sink=sink))  # a rule says it in every tick

    # ---- the robot

    def _say(self, sink: CommandTopic, values: tuple[float, ...]) -> None:
        in_units = {field.value: value / field.factor for field, value in zip(sink.fields, values, strict=True)}
        now = self._simulated if self._sim_time else self._epoch()
        self._link.say(sink.topic, in_units, 0.0 if isnan(now) else now)

    @property
    def _standstill(self) -> tuple[float, ...]:
        """The values of a topic that drives it, at rest."""
        return (0.0,) * len(self._mapping.drive.fields)

    def _tell(self, *speeds: float) -> None:
        self._say(self._mapping.drive, speeds)
        self._lock_others(self._stopped or self._goal is not None)

    def _lock_others(self, lock: bool) -> None:
        """Say at the topic for STOP whether everybody else who drives the robot is to stand."""
        now = self._clock.now()
        if self._mapping.stop is not None and (self._locked is not lock or now >= self._lock_at):
            self._say(self._mapping.stop, (float(lock),))
            self._locked, self._lock_at = lock, now + AGAIN

    def _listen(self) -> None:
        now = self._clock.now()
        for sentence in self._link.remarks():
            self.complain(sentence)
        readings = dict(self._link.heard())
        simulated = readings.pop(CLOCK, None)
        if self._sim_time and simulated is not None and simulated.stamp != self._simulated:
            if simulated.stamp < self._simulated:  # it has begun anew
                self._before += self._simulated - simulated.stamp
                if self._simulated - simulated.stamp > ASTRAY:
                    self.rest()
                    self.complain("the simulation has begun anew; the robot is at rest until a command moves it")
            self._simulated, self._ticked = simulated.stamp, now
        for topic, heard in readings.items():
            _, before = self._arrived.get(topic, (now, None))
            if before is not None and before.stamp == heard.stamp:
                continue  # the same message again is no news
            self._arrived[topic] = now, heard
            if topic in self._lively:
                self._pulse = now
            self._check_stamp(topic, heard.stamp)
            self._check_values(topic, heard)
        if not self._sim_time:
            self._time = self._pulse
        elif not isnan(self._simulated):
            self._time = self._before + self._simulated

    def _check_pulse(self) -> None:
        """Raises OutOfReachError if the robot, or the simulation's clock, has not been heard for too long."""
        now = self._clock.now()
        if now - self._pulse > SILENT:
            where = " and ".join(sorted(self._lively))
            raise OutOfReachError(f"nothing new has come at {where} for {SILENT:g} s{self._silence()}")
        if self._sim_time and now - self._ticked > SILENT:
            raise OutOfReachError(f"{CLOCK} has stood still for {SILENT:g} s: the simulation pauses, or is gone")

    def _silence(self) -> str:
        """What may be behind it that a robot has not said anything yet; "" where nobody could say it."""
        if self._lively & self._arrived.keys() or not any(map(self._link.is_published, self._lively)):
            return ""
        return ", though somebody publishes there: a lifecycle node says nothing until it is active"

    def _check_stamp(self, topic: str, stamp: float) -> None:
        """Times far from the clock: either one is wrong, or messages are late."""
        behind = (self._simulated if self._sim_time else self._epoch()) - stamp
        if not self._is_first(topic, abs(behind) > ASTRAY):
            return
        which = CLOCK if self._sim_time else "this computer's clock"
        side = "behind" if behind > 0.0 else "ahead of"
        self.complain(
            f"{topic} has times {abs(behind):.3g} s {side} {which}: set both clocks alike, or use_sim_time; until then "
            "what it brings counts from when it comes"
        )

    def _known(self, source: SensorTopic, field: TopicField, raw: float) -> float:
        """What a message says of a sensor, in SI; NaN for what it cannot be."""
        quantity, value = self._quantities[field.name], raw * field.factor
        endless = TYPES[source.type][field.value].endless
        return value if quantity.low <= value <= quantity.high and (endless or isfinite(value)) else nan

    def _check_values(self, topic: str, heard: TopicReading) -> None:
        """Values beyond what they can be: mostly, of another unit than the mapping says."""
        source = self._sources[topic]
        for field, raw in zip(source.fields, heard.values, strict=True):
            quantity, value = self._quantities[field.name], raw * field.factor
            wrong = not isnan(value) and isnan(self._known(source, field, raw))
            if self._is_first(f"{topic} {field.name}", wrong):
                beyond = f", beyond {quantity.low:.4g} to {quantity.high:.4g}" if isfinite(value) else ""
                unit = ": does the mapping have its unit?" if beyond else ": it has no such value"
                self.complain(f"{field.name} is {value:.4g} by {topic}{beyond}, and counts as unknown{unit}")

    def _is_first(self, of: str, wrong: bool) -> bool:
        """Whether something is wrong that was right before."""
        if not wrong:
            self._wrong.discard(of)
            return False
        known = of in self._wrong
        self._wrong.add(of)
        return not known


def model_of(mapping: RobotMapping) -> RobotModel:
    """What a robot with this mapping is."""
    functions = tuple(
        HostFunction(
            sink.function,
            partial(Ros2Body.tell, sink=sink),
            tuple(_dimension(TYPES[sink.type][field.value]) for field in sink.fields),
            arguments=" ".join(field.name for field in sink.fields),
            doc=f"A planner that listens at {sink.topic} drives there." if sink.goal else f"Published at {sink.topic}.",
            moves=sink.goal,
        )
        for sink in mapping.functions
    )
    return RobotModel(
        mapping.name, mapping.sensors(), mapping.actuators(), functions, mapping.limits, Geometry(mapping.radius)
    )


def _dimension(value: Value) -> Dimension:
    return UNITS[value.unit].dimension if value.unit else NONE


def ros_place(domain: str | None, discovery: str | None, otherwise: str = SUBNET) -> tuple[int, str]:
    """The number of a ROS domain, and in which of `RANGES` others are looked for. None: as ROS has it in
    ROS_DOMAIN_ID, or 0, and in ROS_LOCALHOST_ONLY=1, which still comes first in ROS 2 Jazzy, or
    ROS_AUTOMATIC_DISCOVERY_RANGE, or `otherwise`. Raises BodyError."""
    source, number = _setting("domain", domain, "ROS_DOMAIN_ID", "0")
    if not (number.isascii() and number.isdigit() and len(number) <= 3 and int(number) <= HIGHEST_DOMAIN):
        raise BodyError(f"{source} is a whole number from 0 to {HIGHEST_DOMAIN}, not {number!r:.40}")
    if discovery is None and os.environ.get("ROS_LOCALHOST_ONLY") == "1":
        discovery = LOCALHOST
    source, where = _setting("discovery", discovery, "ROS_AUTOMATIC_DISCOVERY_RANGE", otherwise.upper())
    names = RANGES if discovery is not None else tuple(map(str.upper, RANGES))
    if (where if discovery is None else where.lower()) not in names:
        also = "; ROS 2 takes it for LOCALHOST" if where.lower() == SUBNET else ""  # with a warning
        raise BodyError(f"{source} is {' or '.join(names)}, not {where!r:.40}{also}")
    return int(number), where.lower()


def _setting(name: str, text: str | None, variable: str, otherwise: str) -> tuple[str, str]:
    """Who says it, for an error, and what. An empty variable says nothing."""
    if text is not None:
        return name, text
    return variable, os.environ.get(variable) or otherwise


def join_network(domain: int, *, local: bool) -> Ros2Network:
    """Join a ROS domain. local: whether to look for robots on this computer only. Raises MisuseError,
    OutOfReachError."""
    try:
        from sleepcast.bridges.ros2.link import Ros2Network
    except ImportError:
        raise MisuseError(f"ROS 2 robots need Cyclone DDS; to install it: {installing('ros2')}") from None
    return Ros2Network(domain, local=local)


def body_on(network: Ros2Network, mapping: RobotMapping, *, sim_time: bool) -> Ros2Body:
    """The body of a robot in a ROS domain, whether it is there or not."""
    from sleepcast.bridges.ros2.link import DdsLink

    return Ros2Body(DdsLink(network, mapping, clock=sim_time), mapping, sim_time=sim_time)


def open_body(uri: str, opening: Opening) -> Ros2Body:
    """Reach the robot at a URI; see the module. Raises BodyError, SettingsError, OutOfReachError."""
    settings = {"mapping": str(TURTLEBOT), "domain": "", "discovery": "", "use_sim_time": "no"}
    address = read_body_address(uri, EXAMPLE, settings, by_path=True)
    namespace = address.path.rstrip("/")
    if not is_namespace(namespace):
        raise BodyError(f"{uri!r:.100}: {namespace:.60} is no namespace of ROS 2; wanted something like {EXAMPLE}")
    try:
        domain, discovery = ros_place(address.settings["domain"] or None, address.settings["discovery"] or None)
    except BodyError as error:
        raise BodyError(f"{uri!r:.100}: {error}") from None
    sim_time = address.choice("use_sim_time", ("no", "yes")) == "yes"
    if opening.in_step:
        raise MisuseError(f"{uri!r:.100}: a ROS 2 robot does not wait for its mind: leave out --lockstep")
    mapping = read_mapping(Path(address.settings["mapping"]), namespace)
    body = body_on(join_network(domain, local=discovery == LOCALHOST), mapping, sim_time=sim_time)
    try:
        body.meet(MEETING)
    except BaseException:
        body.close()
        raise
    return body
