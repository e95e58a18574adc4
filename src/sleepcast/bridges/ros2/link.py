"""The way to ROS 2 robots: their topics over DDS, by Eclipse Cyclone DDS; no ROS is needed on this computer.

A `Ros2Network` is one participant in a domain, however many robots are reached through it: each one more would have to
be found by every other program there. It also knows which topics others have. A `DdsLink` is the way to one robot. Its
readers keep the last message of each topic only: a body wants what is now. What cannot match is said: a topic of
another type or with another quality of service, and somebody else who drives the same robot.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from threading import Lock
from typing import Any, NamedTuple

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from sleepcast.bridges.body import OutOfReachError
from sleepcast.bridges.ros2.mapping import CLOCK, Heard, RobotMapping, Sink, Source
from sleepcast.bridges.ros2.messages import READ, Clock, made, read, ros_type, seconds, stamp
from sleepcast.core.errors import MisuseError, printable

AT_ONCE = 1_000
"""Endpoints of others that are looked at in one round."""
MAX_ENDPOINTS = 20_000
"""Of others that are known at a time: some hundred robots have so many."""
MAX_REMARKED = 1_000
"""Messages that were remarked upon: no robot has so many topics."""
MAX_LOCAL = 99
"""Programs on this computer that look for each other where there is no multicast."""
PARTING = duration(milliseconds=100)
"""For the last words at a topic to arrive."""
TOPICS = "rt"
"""What DDS has before the names of ROS 2's topics; services have others."""

_HERE = f"""<General><AllowMulticast>false</AllowMulticast>
<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{MAX_LOCAL}</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>"""
"""As ROS has it with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST."""
_ANYWHERE = """<Discovery><SPDPInterval>1 s</SPDPInterval></Discovery>
<Internal><WriterLingerDuration>100 ms</WriterLingerDuration></Internal>"""
"""We say more often that we are there than every 30 s, since it may be lost; and wait less for who has gone."""

_ONE = Policy.History.KeepLast(1)
_RELIABLE = Policy.Reliability.Reliable(max_blocking_time=duration(milliseconds=100))
QOS = {
    "sensor": Qos(_ONE, Policy.Reliability.BestEffort, Policy.Durability.Volatile),
    "reliable": Qos(_ONE, _RELIABLE, Policy.Durability.Volatile),
    "latched": Qos(_ONE, _RELIABLE, Policy.Durability.TransientLocal),
}
GRADES = tuple(QOS)
"""Each gives what those before it give, and more: who listens hears only who gives at least what is wanted."""


@cache
def join(domain: int, local: bool) -> Domain | None:
    """Settle once in this process how others are found in a domain; None: as CYCLONEDDS_URI says, where it is set."""
    if "CYCLONEDDS_URI" in os.environ and not local:
        return None
    try:
        return Domain(domain, f"<CycloneDDS><Domain>{_HERE if local else ''}{_ANYWHERE}</Domain></CycloneDDS>")
    except DDSException as error:
        where = "localhost" if local else "subnet"
        raise MisuseError(f"ROS domain {domain} cannot be joined with discovery={where}: {error}") from None


def dds_name(sort: str) -> str:
    """What DDS calls a type that mappings call so."""
    name: str = READ[sort][0].__idl_typename__.replace(".", "::")
    return name


class Endpoint(NamedTuple):
    """A topic of another program: its type, as DDS calls it, whether it publishes there or listens, and which of
    `GRADES` it gives or wants."""

    topic: str
    sort: str
    publishes: bool
    grade: str


class Ros2Network:
    """See the module. local: whether to look for others on this computer only. Raises OutOfReachError, MisuseError."""

    def __init__(self, domain: int, *, local: bool) -> None:
        join(domain, local)
        try:
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise OutOfReachError(f"ROS domain {domain} cannot be joined: {error}") from None
        self.domain = domain
        self._looking = (
            (True, BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)),
            (False, BuiltinDataReader(self._participant, BuiltinTopicDcpsSubscription)),
        )
        self._lock = Lock()
        self._known: dict[Any, Endpoint] = {}
        self._there: dict[str, tuple[Endpoint, ...]] = {}

    def reader(self, topic: str, message: type[Any], qos: str, depth: int = 1) -> DataReader[Any]:
        """message: the class of its messages. depth: how many are kept until they are taken."""
        return DataReader(self._participant, Topic(self._participant, TOPICS + topic, message), _deep(qos, depth))

    def writer(self, topic: str, message: type[Any], qos: str, depth: int = 1) -> DataWriter[Any]:
        """depth: how many are kept to be sent again, or for who listens later."""
        return DataWriter(self._participant, Topic(self._participant, TOPICS + topic, message), _deep(qos, depth))

    def others(self) -> Mapping[str, tuple[Endpoint, ...]]:
        """The topics that other programs have now, each with theirs; another one after every change."""
        with self._lock:
            changed = False
            for publishes, reader in self._looking:
                for each in reader.take(AT_ONCE):
                    changed |= self._note(each, publishes)
            if changed:
                there: dict[str, tuple[Endpoint, ...]] = {}
                for endpoint in self._known.values():
                    there[endpoint.topic] = (*there.get(endpoint.topic, ()), endpoint)
                self._there = there
            return self._there

    def _note(self, sample: Any, publishes: bool) -> bool:
        """Whether anything has changed by it."""
        if not sample.sample_info.valid_data:  # it is gone
            return self._known.pop(sample.key, None) is not None
        if sample.participant_key == self._participant.guid or not sample.topic_name.startswith(TOPICS + "/"):
            return False
        if len(self._known) >= MAX_ENDPOINTS:
            return False
        topic = printable(sample.topic_name.removeprefix(TOPICS))
        self._known[sample.key] = Endpoint(topic, printable(sample.type_name), publishes, _grade(sample.qos))
        return True

    def close(self) -> None:
        """Leave the domain; links are closed before."""
        del self._looking, self._participant


def _deep(qos: str, depth: int) -> Qos:
    return Qos(Policy.History.KeepLast(depth), base=QOS[qos])


def _grade(qos: Qos) -> str:
    if qos[Policy.Reliability] == Policy.Reliability.BestEffort:
        return "sensor"
    return "reliable" if qos[Policy.Durability] == Policy.Durability.Volatile else "latched"


class DdsLink:
    """A `Link` of the module `ros2`. clock: whether it hears /clock, too."""

    def __init__(self, network: Ros2Network, mapping: RobotMapping, *, clock: bool) -> None:
        self._network = network
        self._driven = mapping.drive.topic
        self._wanted: dict[tuple[str, bool], tuple[str, str]] = {}
        """For each topic, and whether others are to publish there: the type, as mappings call it, and what is wanted or
        given by us."""
        self._sources: dict[str, tuple[Source, DataReader[Any]]] = {}
        self._writers: dict[str, tuple[Sink, DataWriter[Any]]] = {}
        for source in mapping.sources:
            self._wanted[source.topic, True] = source.sort, source.qos
            self._sources[source.topic] = source, network.reader(source.topic, READ[source.sort][0], source.qos)
        for sink in mapping.sinks:
            self._wanted[sink.topic, False] = sink.sort, sink.qos
            self._writers[sink.topic] = sink, network.writer(sink.topic, READ[sink.sort][0], sink.qos)
        self._clock = network.reader(CLOCK, Clock, "sensor") if clock else None
        self._seen: Mapping[str, tuple[Endpoint, ...]] = {}
        self._misfits: set[str] = set()
        """What does not fit now, in sentences."""
        self._remarked: set[tuple[str, str]] = set()
        self._remarks: list[str] = []

    def heard(self) -> dict[str, Heard]:
        found: dict[str, Heard] = {}
        for topic, (source, reader) in self._sources.items():
            for message in self._take(topic, reader):
                try:
                    values, sectors = read(source.sort, message, source.turned)
                except ValueError as error:
                    self._remark(topic, "", f"{topic} brings {error}")
                    continue
                found[topic] = Heard(stamp(message), tuple(values[each.value] for each in source.fields), sectors)
        if self._clock is not None:
            for message in self._take(CLOCK, self._clock):
                found[CLOCK] = Heard(seconds(message.clock), ())
        return found

    def _take(self, topic: str, reader: DataReader[Any]) -> list[Any]:
        """What came. Bytes that are no such message raise whatever they raise, in a library that reads what it is
        sent."""
        try:
            return [message for message in reader.take(1) if message.sample_info.valid_data]
        except DDSException as error:
            raise OutOfReachError(f"{topic} cannot be read: {error}") from None
        except Exception as error:
            self._remark(topic, "?", f"{topic} brings something that is no message: {type(error).__name__}: {error}")
            return []

    def say(self, topic: str, values: Mapping[str, float], now: float) -> None:
        sink, writer = self._writers[topic]
        try:
            writer.write(made(sink.sort, values, now, sink.frame))
        except DDSException as error:
            raise OutOfReachError(f"{topic} cannot be written: {error}") from None

    def remarks(self) -> list[str]:
        others = self._network.others()
        if others is not self._seen:
            self._seen, before = others, self._misfits
            self._misfits = set(self._all_misfits(others))
            self._remarks += sorted(self._misfits - before)
        said, self._remarks = self._remarks, []
        return said

    def _all_misfits(self, others: Mapping[str, tuple[Endpoint, ...]]) -> Iterable[str]:
        for (topic, published), (sort, qos) in self._wanted.items():
            ends = others.get(topic, ())
            is_heard = any(not each.publishes and not misfit(each, sort, qos) for each in ends)
            for each in ends:
                if each.publishes == published:
                    wrong = misfit(each, sort, qos)
                    if wrong and (published or not is_heard):  # some robots take velocities of both types
                        yield wrong
                elif each.publishes and topic == self._driven:
                    yield f"somebody else drives it, too, by {topic}: STOP does not hold for them"

    def _remark(self, topic: str, why: str, sentence: str) -> None:
        """Say it once."""
        if (topic, why) not in self._remarked and len(self._remarked) < MAX_REMARKED:
            self._remarked.add((topic, why))
            self._remarks.append(sentence)

    def close(self) -> None:
        for _, writer in self._writers.values():
            with suppress(DDSException, AttributeError):  # which cyclonedds 11 raises when the time is over
                writer.wait_for_acks(PARTING)
        self._sources.clear()
        self._writers.clear()
        self._clock = None


def misfit(other: Endpoint, sort: str, qos: str) -> str:
    """Why nothing passes between another program's topic and ours, in a sentence; "" if it does. sort: its type, as
    mappings call it. qos: which of `GRADES` we want, or give."""
    topic, there, wanted = other.topic, ros_type(other.sort), ros_type(dds_name(sort))
    if there != wanted:
        what = "what it brings is not read" if other.publishes else "whoever listens there hears nothing of us"
        return f"{topic} has the type {there}, not {wanted} as the mapping says: {what}"
    if other.publishes and GRADES.index(other.grade) < GRADES.index(qos):
        return (
            f'nothing comes by {topic}: the mapping wants qos = "{qos}", and it is published as "{other.grade}": '
            f'say qos = "{other.grade}" there'
        )
    if not other.publishes and GRADES.index(other.grade) > GRADES.index(qos):
        return f"whoever listens at {topic} hears nothing of us: they want what is {other.grade}, and we are {qos}"
    return ""
