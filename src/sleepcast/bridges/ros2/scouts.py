"""Simulated robots of the Nomads' server as ROS 2 robots too: robot 1 is /scout1, robot 2 /scout2, time is /clock.

What they tell is in `sensors`; what nobody listens to is not made. They are told velocities at `cmd_vel`, with or
without a time, and at `stop` whether they must stand. The wire of 1998 and the page go on beside it, and the rules of
who drives are theirs: the last word counts, and two that drive one robot are told to the person at the terminal.

    velocity   holds for `FORGOTTEN` s of simulated time; then, or when who gave it is gone, the robot rests. One that
               is no number, or that no robot can have, is refused, and the robot rests
    STOP       holds the robot for everybody, until each of those programs that said so, and are there, says otherwise;
               if none is there any more, until anybody does, or a person at the page who stops and releases all

Everything happens in the thread of the server: `listen` before every tick, and `look` now and then, also while time
stands still.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from math import isfinite
from sys import float_info
from typing import Any, NamedTuple

from cyclonedds.core import DDSException
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader

from sleepcast.bridges.ros2.link import GRADES, DiscoveredEndpoint, Ros2Network, saying, stays_apart
from sleepcast.bridges.ros2.mapping import CLOCK, FASTEST, is_namespace
from sleepcast.bridges.ros2.messages import Bool, Clock, TFMessage, Twist, TwistStamped, ros_type, seconds, time_of
from sleepcast.bridges.ros2.sensors import TOLD, PublishedTopic, RobotSensors
from sleepcast.core.errors import MisuseError
from sleepcast.robot import OutOfReachError, RobotServer, ServedRobot

FORGOTTEN = 0.5
"""Simulated seconds for which a velocity holds."""
MAX_ROBOTS = 100
"""In one ROS domain: each has a dozen topics that every program there must find."""
GLANCE = 0.1
"""Seconds between two looks on the wall."""
FOREIGN = 60.0
"""Seconds that the time of a velocity may be off: more is another clock."""
MAX_STOPS = 100
"""Words at `stop` that are kept until they are read: none may be missed."""
MAX_PROGRAMS = 1_000
"""Programs whose numbers are kept."""
UNSIGNED = 2**64 - 1
MAX_SAID = 100
"""Sentences of one robot that are said once."""
STATIC = "tf_static"
VELOCITIES = (Twist, TwistStamped)
NO_FLOAT = "as rclpy has it of what is no float of Python: say 1.0, not 1, and float(x) of what numpy has made"
STOPS = ("sensor", "latched")
"""How it is listened to at `stop`: to those who say it to nobody later, and for what was said before. The second misses
nothing, and so has the last word."""


def namespaces(name: str, robots: int) -> list[str]:
    """Of so many robots: /NAME1, /NAME2 and so on; of one, with the name "/", none. Raises MisuseError."""
    if robots > MAX_ROBOTS:
        raise MisuseError(f"{robots} robots: at most {MAX_ROBOTS} fit into a ROS domain")
    if name == "/":
        if robots == 1:
            return [""]
        raise MisuseError(f"--namespace /: only one robot can be without a namespace, and these are {robots}")
    namespaces = [f"/{name.strip('/')}{number}" for number in range(1, robots + 1)]
    if not is_namespace(namespaces[-1]):
        raise MisuseError(f"--namespace {name!r:.60} is no name in ROS 2: wanted letters, digits and _, such as scout")
    return namespaces


class Ros2Scouts:
    """See the module; a `Companion` of the server. names: the namespace of each robot."""

    def __init__(self, server: RobotServer, network: Ros2Network, names: Sequence[str]) -> None:
        self.names, self.domain = tuple(names), network.domain
        self._server, self._network, self._say = server, network, server.say
        self._clock = network.writer(CLOCK, Clock, "reliable")
        programs = Programs()
        self._robots = [
            Ros2Robot(server, robot, network, name, programs) for robot, name in zip(server.robots, names, strict=True)
        ]
        self._ends = {CLOCK: End((Clock,)), **{topic: end for robot in self._robots for topic, end in robot.ends()}}
        self._others: Mapping[str, Sequence[DiscoveredEndpoint]] = {}
        self._misfits: set[str] = set()
        """What does not fit now, in sentences."""
        self._failures: set[str] = set()
        """What has failed in the domain, and was said."""
        self._ticks, self._told = 0, -1.0
        """Ticks until now, and the simulated time that was told last."""

    def before_tick(self) -> None:
        for robot in self._robots:
            with self._goes_on():
                robot.listen()

    def after_tick(self) -> None:
        self._ticks += 1
        with self._goes_on():
            self._tell_time()
        for number, robot in enumerate(self._robots):
            with self._goes_on():
                robot.tell(self._ticks + number)  # not all in the same tick

    def released(self) -> None:
        for robot in self._robots:
            robot.forget_gone()

    async def beside(self, served: Awaitable[None]) -> None:
        """Look now and then, for as long as the robots are served; leave the domain after that."""
        serving = asyncio.ensure_future(served)
        try:
            while not serving.done():
                self.look()
                await asyncio.wait([serving], timeout=GLANCE)
        finally:
            serving.cancel()
            await asyncio.wait([serving])
            self._close()
        await serving  # which may have failed

    def look(self) -> None:
        """Hear what has come, also while time stands still, and say what does not fit."""
        self.before_tick()
        with self._goes_on():
            if self._server.world.time == self._told:
                self._tell_time()  # those who have come meanwhile have not heard it
            others = self._network.others()
            if others is not self._others:
                known = self._misfits
                self._others, self._misfits = others, set(self._all_misfits(others))
                for sentence in sorted(self._misfits - known):
                    self._say(sentence)

    def _close(self) -> None:
        self._robots.clear()
        del self._clock
        self._network.close()

    @contextmanager
    def _goes_on(self) -> Iterator[None]:
        """What fails in the domain is said, once, and no robot waits for it: what is now is told again."""
        try:
            yield
        except (DDSException, OutOfReachError, MisuseError) as error:
            sentence = f"ROS 2 fails: {error}"
            if sentence not in self._failures and len(self._failures) < MAX_SAID:
                self._failures.add(sentence)
                self._say(sentence)

    def _tell_time(self) -> None:
        self._told = self._server.world.time
        with saying(CLOCK):
            self._clock.write(Clock(time_of(self._told)))

    def _all_misfits(self, others: Mapping[str, Sequence[DiscoveredEndpoint]]) -> Iterator[str]:
        for topic, end in self._ends.items():
            for other in others.get(topic, ()):
                yield from end.misfit(other)


class Programs:
    """The ROS 2 programs that drive robots, numbered as they come."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        self._next = count(1)

    def name(self, reader: DataReader[Any], handle: int) -> str:
        """What the one is called whose publication has this handle."""
        end = reader.get_matched_publication_data(handle)
        program = str(end.participant_key) if end else ""
        if program not in self._numbers:
            if len(self._numbers) >= MAX_PROGRAMS:
                self._numbers.clear()
            self._numbers[program] = next(self._next)
        return f"ROS 2 program {self._numbers[program]}"


class End(NamedTuple):
    """One of our topics. messages: the classes of its messages. listens: whether it is we who listen there. grade: see
    `link.GRADES`."""

    messages: tuple[type[Any], ...]
    listens: bool = False
    grade: str = "reliable"

    def misfit(self, other: DiscoveredEndpoint) -> Iterator[str]:
        """Why nothing passes between another program and us, or what else is wrong, in a sentence."""
        topic, there = other.topic, ros_type(other.type)
        sorts = [ros_type(each.__idl_typename__.replace(".", "::")) for each in self.messages]
        if other.publishes and not self.listens:
            two = "two simulations are in one ROS domain" if topic == CLOCK else "two robots have one name"
            one = "--domain" if topic == CLOCK else "--namespace"
            yield f"somebody else publishes {topic}, too: {two}; start this with another {one}"
        elif other.publishes and there not in sorts:
            yield f"somebody publishes {there} at {topic}, which is not read: wanted {' or '.join(sorts)}"
        elif other.publishes and GRADES.index(other.grade) < GRADES.index(self.grade):
            yield f"somebody publishes {topic} as best effort, which is not read: it must be reliable"
        elif not other.publishes and not self.listens and there not in sorts:
            yield f"somebody listens at {topic} for {there} and hears nothing: it brings {' or '.join(sorts)}"
        elif not other.publishes and not self.listens and GRADES.index(other.grade) > GRADES.index(self.grade):
            yield f"somebody listens at {topic} for what was said before and hears nothing: it must be volatile"
        elif other.publishes is self.listens and (apart := stays_apart(other)):
            yield apart


class Ros2Robot:
    """One robot in ROS 2. name: its namespace."""

    def __init__(
        self, server: RobotServer, robot: ServedRobot, network: Ros2Network, name: str, programs: Programs
    ) -> None:
        self._server, self._robot, self._world, self._say = server, robot, robot.world, server.say
        self._name, self._programs = name, programs
        self._driving, self._stopping = f"{name}/cmd_vel", f"{name}/stop"
        self._velocities = [network.reader(self._driving, each, "reliable") for each in VELOCITIES]
        self._stops = [network.reader(self._stopping, Bool, grade, MAX_STOPS) for grade in STOPS]
        self._sensors = RobotSensors(robot)
        self._tellers = [
            (told, max(1, round(told.every / self._world.tick)), self._writer(network, told)) for told in TOLD
        ]
        self._static = network.writer(f"{name}/{STATIC}", TFMessage, "latched")
        self._static.write(self._sensors.fixed())
        self._drivers: dict[int, str] = {}
        """The names of those who publish velocities, by their publication."""
        self._driver, self._asked = "", 0.0
        """Who moves it, "" if nobody does, and when that was last asked, simulated s."""
        self._said: set[tuple[str, str]] = set()
        """What has been said to the person, and of whom."""
        self._stoppers: set[int] = set()
        """The publications that last said that it must stand."""

    def _writer(self, network: Ros2Network, told: PublishedTopic) -> DataWriter[Any]:
        return network.writer(f"{self._name}/{told.topic}", told.message, "reliable", told.depth)

    def ends(self) -> Iterator[tuple[str, End]]:
        """Its topics."""
        yield self._driving, End(VELOCITIES, listens=True)
        yield self._stopping, End((Bool,), listens=True, grade="sensor")
        yield f"{self._name}/{STATIC}", End((TFMessage,), grade="latched")
        yield from ((f"{self._name}/{told.topic}", End((told.message,))) for told in TOLD)

    # ---- what it tells

    def tell(self, ticks: int) -> None:
        """Tell what is due and somebody listens to."""
        for told, every, writer in self._tellers:
            if ticks % every == 0 and writer.get_matched_subscriptions():
                self._publish(told, writer)

    def _publish(self, told: PublishedTopic, writer: DataWriter[Any]) -> None:
        topic = f"{self._name}/{told.topic}"
        try:
            with saying(topic):
                for message in told.make(self._sensors, self._world.time):
                    writer.write(message)
        except MisuseError as error:
            self._say_once("", topic, str(error))

    # ---- what it is told

    def listen(self) -> None:
        """Do what has come."""
        self._greet()
        for reader in self._velocities:
            for message in self._take(reader, self._driving, 1):
                self._obey(message)
        for reader in self._stops:
            for message in self._take(reader, self._stopping, MAX_STOPS):
                self._heed(message)
        if self._driver and self._world.time - self._asked > FORGOTTEN:
            self._come_to_rest(f"gave no velocity by {self._driving} for {FORGOTTEN:g} s of simulated time")

    def _take(self, reader: DataReader[Any], topic: str, most: int) -> Iterator[Any]:
        """What came, None for what is no message: that raises whatever it raises, in a library that reads what it is
        sent."""
        for _ in range(most):
            try:
                samples = reader.take(1)
            except Exception as error:
                self._say_once(
                    "?", topic, f"{topic} brings something that is no message: {type(error).__name__}: {error}"
                )
                yield None
                continue
            if not samples:
                return
            if samples[0].sample_info.valid_data:
                yield samples[0]

    def _greet(self) -> None:
        """Know who publishes velocities."""
        there = _publications(self._velocities)
        if there.keys() == self._drivers.keys():
            return
        number = self._robot.robot + 1
        for publication in [each for each in self._drivers if each not in there]:
            name = self._drivers.pop(publication)
            self._robot.dismiss(name)
            self._say(f"{name} has left robot {number}")
            if name not in self._drivers.values():
                if name == self._driver:
                    self._come_to_rest("is gone")
                self._said = {each for each in self._said if each[0] != name}
        for publication, (reader, handle) in there.items():
            if publication not in self._drivers:
                name = self._drivers[publication] = self._programs.name(reader, handle)
                self._robot.admit(name)
                self._say(f"{name} has connected to robot {number} ({self._driving})")

    def _obey(self, message: Any) -> None:
        """Go on at this velocity, if it is one and its program is there."""
        if message is None:
            self._come_to_rest(f"drives while something comes by {self._driving} that is no velocity")
            return
        publication = _publication(message)
        if publication not in self._drivers:
            self._greet()
        name = self._drivers.get(publication)
        if name is None:
            return  # it has gone already
        twist, stamp = message, 0.0
        if isinstance(message, TwistStamped):
            twist, stamp = message.twist, seconds(message.header.stamp)
        wrong = wrong_velocity(twist)
        self._note_clock(name, stamp)
        if wrong:
            refused = f"{self._driving}: {wrong} by {name}: refused, and robot {self._robot.robot + 1} rests"
            self._say_once(name, "wrong", refused)
        else:
            self._said.discard((name, "wrong"))
        speed, turn_rate = (0.0, 0.0) if wrong else (float(twist.linear.x), float(twist.angular.z))
        if contest := self._robot.driven_by(name):
            self._say(contest)
        self._robot.drive(speed, turn_rate)
        self._driver, self._asked = (name if speed or turn_rate else ""), self._world.time

    def _come_to_rest(self, why: str) -> None:
        """Rest, if the last word was of who does not drive any more."""
        driver, self._driver = self._driver, ""
        if driver and self._robot.let_go_by(driver):
            self._robot.drive(0.0, 0.0)
            self._say_once(driver, why, f"{driver} {why}: robot {self._robot.robot + 1} rests")

    def _note_clock(self, name: str, stamp: float) -> None:
        """Say that a program's clock is another one. stamp: of a velocity, s; 0 if it has none."""
        away = stamp - self._world.time
        if stamp and abs(away) > FOREIGN:
            side = "ahead of" if away > 0.0 else "behind"
            self._say_once(
                name,
                "clock",
                f"{self._driving}: times by {name} are {abs(away):.3g} s {side} /clock: set use_sim_time there; its "
                "velocities count from when they come",
            )

    def _heed(self, message: Any) -> None:
        """Stand from now on, or no longer as far as this program is concerned; what is no message may mean to."""
        publication = _publication(message) if message is not None else 0
        if message is None or message.data:
            self._stoppers.add(publication)
        else:
            self._stoppers.discard(publication)
            self.forget_gone()
        self._hold()

    def forget_gone(self) -> None:
        """End what is said at `stop` by those who are there no more."""
        self._stoppers &= _publications(self._stops).keys()
        self._hold()

    def _hold(self) -> None:
        held = self._stopping in self._robot.holders
        if held is not bool(self._stoppers):
            self._server.hold(not held, self._stopping, self._robot.robot)
            end = f"is free again ({self._stopping})" if held else f"must stand, until {self._stopping} says false"
            self._say(f"robot {self._robot.robot + 1} {end}")

    def _say_once(self, who: str, what: str, sentence: str) -> None:
        if (who, what) not in self._said and len(self._said) < MAX_SAID:
            self._said.add((who, what))
            self._say(sentence)


def _publication(message: Any) -> int:
    """Who published it: the handle as an unsigned number."""
    return int(message.sample_info.publication_handle) & UNSIGNED


def _publications(readers: Sequence[DataReader[Any]]) -> dict[int, tuple[DataReader[Any], int]]:
    """Those who publish to these readers now, by the handle as an unsigned number; DDS has it with a sign here."""
    return {handle & UNSIGNED: (reader, handle) for reader in readers for handle in reader.get_matched_publications()}


def wrong_velocity(twist: Twist) -> str:
    """What is wrong with a velocity, "" if nothing is. What a robot on wheels cannot do, as to go sideways, may be
    asked, and is left out."""
    for part, vector in (("linear", twist.linear), ("angular", twist.angular)):
        for axis in "xyz":
            value = getattr(vector, axis)
            if not isfinite(value):
                return f"{part}.{axis} is {value}"
            if 0.0 < abs(value) < float_info.min:
                return f"{part}.{axis} is {value:g}, {NO_FLOAT}"
            if abs(value) > FASTEST:
                return f"{part}.{axis} is {value:g}, beyond {FASTEST:,.0f}"
    return ""
