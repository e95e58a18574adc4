"""The robots of a ROS 2 domain: which namespaces have the topics of a mapping, and a body for each, on one network.

A namespace is a robot's if somebody listens there to what drives it, and somebody publishes one of the topics at which
something comes all the time, both with the types that the mapping says. What else is missing or different is told:
these values alone are unknown then.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sleepcast.bridges.ros2.mapping import MAX_NAME, CommandTopic, RobotMapping, SensorTopic, is_namespace, read_mapping
from sleepcast.bridges.ros2.robot import Ros2Body, body_on
from sleepcast.core.settings import SettingsError, read_text
from sleepcast.robot import FRESH

if TYPE_CHECKING:
    from sleepcast.bridges.ros2.link import DiscoveredEndpoint, Ros2Network

MAX_NAMESPACES = 1_000
"""Of those that have one of the topics at least: more are no fleet of one mapping."""


class DiscoveredTopic(NamedTuple):
    """A topic of a mapping in a namespace.

    comes: whether the robot publishes it.
    wrong: why nothing passes by it; "" if something does.
    missing: whether nobody else has it.
    names: what it gives or takes, in expressions.
    vital: whether the robot cannot do without it.
    doubt: why perhaps nothing passes by it, which is known as soon as there is a body.
    """

    topic: str
    type: str
    comes: bool
    wrong: str
    missing: bool
    names: tuple[str, ...]
    vital: bool
    doubt: str = ""


class DiscoveredRobot(NamedTuple):
    """What a namespace has of a mapping."""

    namespace: str
    topics: tuple[DiscoveredTopic, ...]

    @property
    def is_robot(self) -> bool:
        """See the module."""
        drives = any(each.vital and not each.comes and not each.wrong for each in self.topics)
        return drives and any(each.vital and each.comes and not each.wrong for each in self.topics)

    def lacks(self, *, only_missing: bool = False) -> list[str]:
        """What is wrong, a sentence each; not that nobody listens at what a robot can do without.

        only_missing: leave out topics that exist and do not fit.
        """
        sentences = []
        for each in self.topics:
            if (each.missing and not each.comes and not each.vital) or (only_missing and not each.missing):
                continue
            if each.wrong:
                are = "is" if len(each.names) == 1 else "are"
                sentences.append(each.wrong + (f": {_listed(each.names)} {are} unknown" if each.comes else ""))
        return sentences


class Ros2Fleet:
    """See the module. Raises SettingsError.

    path: of the mapping.
    sim_time: whether time is what /clock says.
    """

    def __init__(self, network: Ros2Network, path: Path, *, sim_time: bool) -> None:
        self._network, self._path, self._sim_time = network, path, sim_time
        self._text = read_text(path)
        self.mapping = read_mapping(path, "", self._text)
        """Without a namespace."""
        lively = [source for source in self.mapping.sources if source.freshness <= FRESH] or self.mapping.sources
        self._vital = [source.name for source in lively if not source.name.startswith("/")]
        """Topics by which a robot is heard, and no other one."""
        drive = self.mapping.drive.name
        if drive.startswith("/"):
            raise SettingsError(f'{path}: out."{drive}": all robots would be driven by one topic: leave out its slash')
        if not self._vital:
            raise SettingsError(f"{path}: in: all robots would be heard by one topic: leave out its slash")
        sources, sinks = self.mapping.sources, self.mapping.sinks
        self._longest = max(len(topic) for topic in (*(s.topic for s in sources), *(s.topic for s in sinks)))
        self._mappings: dict[str, RobotMapping] = {}
        self._seen: Mapping[str, tuple[DiscoveredEndpoint, ...]] = {}
        self._robots: dict[str, DiscoveredRobot] = {}

    def look(self) -> Mapping[str, DiscoveredRobot]:
        """What there is now, by namespace: robots, and what has a part of what a robot has."""
        others = self._network.others()
        if others is not self._seen:
            self._seen = others
            self._robots = {
                namespace: DiscoveredRobot(namespace, tuple(self._topics(self.mapping_of(namespace))))
                for namespace in sorted(self._namespaces(others))
            }
        return self._robots

    def nobody(self) -> str:
        """What to look for where nothing is found, in a sentence."""
        names, domain = (*self._vital, self.mapping.drive.name), self._network.domain
        topics = " or ".join(f"NAMESPACE/{name}" for name in names)
        return (
            f"nobody has a topic such as {topics} in ROS domain {domain}: is it that of the robots, and do they look "
            "beyond their own computer?"
        )

    def mapping_of(self, namespace: str) -> RobotMapping:
        """The mapping of the robot in this namespace. Raises SettingsError."""
        if namespace not in self._mappings:
            if len(self._mappings) >= MAX_NAMESPACES:
                self._mappings.clear()
            self._mappings[namespace] = read_mapping(self._path, namespace, self._text)
        return self._mappings[namespace]

    def body(self, namespace: str) -> Ros2Body:
        """The body of the robot in this namespace, whether that is present or not. Raises OutOfReachError."""
        return body_on(self._network, self.mapping_of(namespace), sim_time=self._sim_time)

    def _namespaces(self, others: Mapping[str, tuple[DiscoveredEndpoint, ...]]) -> set[str]:
        namespaces: set[str] = set()
        for topic in others:
            for name in (*self._vital, self.mapping.drive.name):
                namespace = topic[: -len(name) - 1]
                if topic.endswith("/" + name) and self._fits(namespace) and len(namespaces) < MAX_NAMESPACES:
                    namespaces.add(namespace)
        return namespaces

    def _fits(self, namespace: str) -> bool:
        """Whether a robot may have it: DDS lets names be anything."""
        return is_namespace(namespace) and len(namespace) + self._longest < MAX_NAME

    def _topics(self, mapping: RobotMapping) -> Iterator[DiscoveredTopic]:
        for source in mapping.sources:
            names = tuple(field.name for field in source.fields)
            yield self._topic(source, True, names, source.name in self._vital)
        for sink in mapping.sinks:
            names = (sink.function,) if sink.function else tuple(field.name for field in sink.fields)
            yield self._topic(sink, False, names, sink is mapping.drive)

    def _topic(
        self, ours: SensorTopic | CommandTopic, comes: bool, names: tuple[str, ...], vital: bool
    ) -> DiscoveredTopic:
        from sleepcast.bridges.ros2.link import doubt, misfit

        others = [each for each in self._seen.get(ours.topic, ()) if each.publishes == comes]
        reasons = [misfit(each, ours.type, ours.qos) for each in others]
        wrong = (
            ""
            if "" in reasons
            else next(iter(reasons), f"nobody {'publishes' if comes else 'listens at'} {ours.topic}")
        )
        doubts = [] if wrong else [doubt(each, ours.type) for each in others]
        unsure = "" if "" in doubts else next(iter(doubts), "")
        return DiscoveredTopic(ours.topic, ours.type, comes, wrong, not others, names, vital, unsure)


def _listed(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
