"""The way to ROS 2 robots: their topics over DDS, by Eclipse Cyclone DDS; no ROS is needed on this computer.

A `Ros2Network` is one participant in a domain, however many robots are reached through it: each one more would have to
be found by every other program there. It also knows which topics others have. A `DdsLink` is the way to one robot. Its
readers keep the last message of each topic only: a body wants what is now. What cannot match is said: a topic of
another type or with another quality of service, and somebody else who drives the same robot.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from math import inf
from threading import Lock
from typing import Any, NamedTuple, TypeAlias
from weakref import ReferenceType, ref

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from sleepcast.bridges.ros2.mapping import CLOCK, CommandTopic, RobotMapping, SensorTopic, TopicReading
from sleepcast.bridges.ros2.messages import READ, SHORT, Clock, made, read, ros_type, seconds, stamp
from sleepcast.core.clock import Clock as Time
from sleepcast.core.clock import WallClock
from sleepcast.core.errors import MisuseError, printable
from sleepcast.robot import OutOfReachError

AT_ONCE = 1_000
"""Endpoints of others that are looked at in one round."""
MAX_ENDPOINTS = 20_000
"""Of others that are known at a time: some hundred robots have so many."""
MAX_REMARKED = 1_000
"""Messages that were remarked upon: no robot has so many topics."""
UNLIMITED = -1
"""As DDS says it of what has no bound but its history's."""
MAX_LOCAL = 99
"""Programs on this computer that look for each other where there is no multicast."""
JOINED = 5.0
"""Seconds that DDS may take to join two ends of a topic: beyond, it does not, for whatever reason."""
CHECK_EVERY = 1.0
"""Seconds between two looks at which ends are joined."""
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


def dds_name(type_: str) -> str:
    """What DDS calls a type that mappings call so."""
    return _dds_name(READ[type_][0])


def _dds_name(message: Any) -> str:
    name: str = message.__idl_typename__.replace(".", "::")
    return name


End: TypeAlias = DataReader[Any] | DataWriter[Any]
"""One of our own."""


class DiscoveredEndpoint(NamedTuple):
    """A topic of another program.

    type: as DDS calls it.
    publishes: whether it publishes there, or listens.
    grade: which of `GRADES` it gives or wants.
    layout: identifies that of its type; b"" where it is not told, as in ROS 2.
    apart: why DDS does not join it with ours that has the same type and grade: "layout" or "conditions"; "" if it does,
        or nobody knows yet.
    """

    topic: str
    type: str
    publishes: bool
    grade: str
    layout: bytes = b""
    apart: str = ""


class Ros2Network:
    """See the module. Raises OutOfReachError, MisuseError.

    local: whether to look for others on this computer only.
    clock: for how long it has known others.
    """

    def __init__(self, domain: int, *, local: bool, clock: Time | None = None) -> None:
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
        self._lock, self._clock = Lock(), clock or WallClock()
        self._known: dict[Any, DiscoveredEndpoint] = {}
        self._by_topic: dict[str, tuple[DiscoveredEndpoint, ...]] = {}
        self._unjoined: dict[Any, float] = {}
        """Those that are joined with none of ours, as far as we know, and since when they are known."""
        self._check_at = -inf
        self._ours: dict[str, list[tuple[float, ReferenceType[End]]]] = {}
        """Our own ends of each topic, for as long as there are any, and when they were made."""

    def reader(self, topic: str, message: type[Any], qos: str, depth: int = 1) -> DataReader[Any]:
        """A reader of ours.

        message: the class of its messages.
        depth: how many are stored until they are taken.
        """
        reader = DataReader(self._participant, Topic(self._participant, TOPICS + topic, message), _deep(qos, depth))
        self._remember(topic, reader)
        return reader

    def writer(self, topic: str, message: type[Any], qos: str, depth: int = 1) -> DataWriter[Any]:
        """A writer of ours.

        message: the class of its messages.
        depth: how many are stored to be sent again, or for who listens later.
        """
        writer = DataWriter(self._participant, Topic(self._participant, TOPICS + topic, message), _deep(qos, depth))
        self._remember(topic, writer)
        return writer

    def _remember(self, topic: str, end: End) -> None:
        with self._lock:
            ends = [(made, each) for made, each in self._ours.get(topic, ()) if each() is not None]
            self._ours[topic] = [*ends, (self._clock.now(), ref(end))]

    def others(self) -> Mapping[str, tuple[DiscoveredEndpoint, ...]]:
        """The topics that other programs have now, each with theirs; another one after every change. Raises
        OutOfReachError."""
        with self._lock:
            changed = False
            for sample, publishes in self._news():
                changed |= self._note(sample, publishes)
            if self._clock.now() >= self._check_at:
                changed |= self._check_joined(self._clock.now())
            if changed:
                by_topic: dict[str, list[DiscoveredEndpoint]] = {}
                for endpoint in self._known.values():
                    by_topic.setdefault(endpoint.topic, []).append(endpoint)
                self._by_topic = {topic: tuple(ends) for topic, ends in by_topic.items()}
            return self._by_topic

    def _news(self) -> Iterator[tuple[Any, bool]]:
        """What has become of ends of others, and whether they publish. One at a time: words that the library cannot
        read, which come from others, cost no more than the end that they describe."""
        for publishes, reader in self._looking:
            for _ in range(AT_ONCE):
                try:
                    samples = reader.take(1)
                except DDSException as error:
                    raise OutOfReachError(f"ROS domain {self.domain} cannot be read: {error}") from None
                except Exception:
                    continue
                if not samples:
                    break
                yield samples[0], publishes

    def _note(self, sample: Any, publishes: bool) -> bool:
        """Whether anything has changed by it."""
        if not sample.sample_info.valid_data:  # it is gone
            self._unjoined.pop(sample.key, None)
            return self._known.pop(sample.key, None) is not None
        if sample.participant_key == self._participant.guid or not sample.topic_name.startswith(TOPICS + "/"):
            return False
        if len(self._known) >= MAX_ENDPOINTS:
            return False
        topic = printable(sample.topic_name.removeprefix(TOPICS))
        type_, grade, layout = printable(sample.type_name), _grade(sample.qos), _layout(sample.type_id)
        self._known[sample.key] = DiscoveredEndpoint(topic, type_, publishes, grade, layout)
        self._unjoined[sample.key] = self._clock.now()
        return True

    def _check_joined(self, now: float) -> bool:
        """Ask DDS which of the others it has joined with ours; whether anything has changed by it."""
        self._check_at, changed = now + CHECK_EVERY, False
        joined = cache(_joined)  # asked once of each of ours, however many are at the other end
        for key, since in list(self._unjoined.items()):
            before = self._known[key]
            ours = {end: made for made, each in self._ours.get(before.topic, ()) if (end := each()) is not None}
            ours = {end: made for end, made in ours.items() if _is_other_end(end, before)}
            if any(key in joined(end) for end in ours):
                del self._unjoined[key]
                apart = ""
            elif not ours or now - max(since, *ours.values()) < JOINED:
                continue
            else:
                same = not before.layout or any(layout_of(end.topic.data_type) == before.layout for end in ours)
                apart = "conditions" if same else "layout"
            self._known[key] = before._replace(apart=apart)
            changed |= apart != before.apart
        return changed

    def close(self) -> None:
        """Leave the domain; links are closed before."""
        del self._looking, self._participant


def _deep(qos: str, depth: int) -> Qos:
    """What DDS keeps for who listens later is counted apart from what it sends again, and is one message if nothing
    else is said."""
    history = Policy.History.KeepLast(depth)
    return Qos(history, Policy.DurabilityService(0, history, *[UNLIMITED] * 3), base=QOS[qos])


def _is_other_end(ours: End, other: DiscoveredEndpoint) -> bool:
    """Whether ours is one that DDS might join with it."""
    return isinstance(ours, DataReader) is other.publishes and _dds_name(ours.topic.data_type) == other.type


def _joined(ours: End) -> set[Any]:
    """The keys of the ends of others that DDS has joined with ours."""
    if isinstance(ours, DataReader):
        ends = [ours.get_matched_publication_data(each) for each in ours.get_matched_publications()]
    else:
        ends = [ours.get_matched_subscription_data(each) for each in ours.get_matched_subscriptions()]
    return {each.key for each in ends if each is not None}


def layout_of(message: type[Any]) -> bytes:
    """The layout of a class of messages, as an `DiscoveredEndpoint` has it."""
    return _layout(message.__idl__.get_type_id())


def _layout(type_id: Any) -> bytes:
    return b"" if type_id is None else bytes(type_id.serialize())


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
        self._sources: dict[str, tuple[SensorTopic, list[DataReader[Any]]]] = {}
        """Of each topic, a second reader where somebody publishes it who tells a layout that the first does not read;
        see `messages.SHORT`."""
        self._writers: dict[str, tuple[CommandTopic, DataWriter[Any]]] = {}
        for source in mapping.sources:
            self._wanted[source.topic, True] = source.type, source.qos
            first = SHORT.get(source.type, READ[source.type][0])
            self._sources[source.topic] = source, [network.reader(source.topic, first, source.qos)]
        for sink in mapping.sinks:
            self._wanted[sink.topic, False] = sink.type, sink.qos
            self._writers[sink.topic] = sink, network.writer(sink.topic, READ[sink.type][0], sink.qos)
        self._clock = network.reader(CLOCK, Clock, "sensor") if clock else None
        self._seen: Mapping[str, tuple[DiscoveredEndpoint, ...]] = {}
        self._misfits: set[str] = set()
        """What does not fit now, in sentences."""
        self._remarked: set[tuple[str, str]] = set()
        self._remarks: list[str] = []

    def heard(self) -> dict[str, TopicReading]:
        readings: dict[str, TopicReading] = {}
        for topic, (source, readers) in self._sources.items():
            for message in (message for reader in readers for message in self._take(topic, reader)):
                try:
                    values, sectors = read(source.type, message, source.turned)
                except ValueError as error:
                    self._remark(topic, "", f"{topic} brings {error}")
                    continue
                readings[topic] = TopicReading(
                    stamp(message), tuple(values[each.value] for each in source.fields), sectors
                )
        if self._clock is not None:
            for message in self._take(CLOCK, self._clock):
                readings[CLOCK] = TopicReading(seconds(message.clock), ())
        return readings

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
        with saying(topic):
            writer.write(made(sink.type, values, now, sink.frame))

    def remarks(self) -> list[str]:
        others = self._network.others()
        if others is not self._seen:
            self._seen, before = others, self._misfits
            self._meet_layouts(others)
            self._misfits = set(self._all_misfits(others))
            self._remarks += sorted(self._misfits - before)
        sentences, self._remarks = self._remarks, []
        return sentences

    def is_published(self, topic: str) -> bool:
        type_, qos = self._wanted[topic, True]
        return any(each.publishes and not misfit(each, type_, qos) for each in self._network.others().get(topic, ()))

    def _meet_layouts(self, others: Mapping[str, tuple[DiscoveredEndpoint, ...]]) -> None:
        """Listen also to those who tell that they have the layout of a newer release."""
        for topic, (source, readers) in self._sources.items():
            whole = READ[source.type][0]
            if source.type in SHORT and len(readers) == 1:
                new = layout_of(whole)
                if any(each.publishes and each.layout == new for each in others.get(topic, ())):
                    readers.append(self._network.reader(topic, whole, source.qos))

    def _all_misfits(self, others: Mapping[str, tuple[DiscoveredEndpoint, ...]]) -> Iterable[str]:
        for (topic, published), (type_, qos) in self._wanted.items():
            ends = others.get(topic, ())
            is_heard = any(not each.publishes and not misfit(each, type_, qos) for each in ends)
            for each in ends:
                if each.publishes == published:
                    wrong = misfit(each, type_, qos)
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


@contextmanager
def saying(topic: str) -> Iterator[None]:
    """Make a message and publish it at a topic. Raises OutOfReachError, and MisuseError for values that do not fit into
    it: the library raises plain Exceptions for them, of which no thread of a bridge may die."""
    try:
        yield
    except DDSException as error:
        raise OutOfReachError(f"{topic} cannot be written: {error}") from None
    except Exception as error:
        raise MisuseError(f"nothing is said at {topic}: {error}") from None


def misfit(other: DiscoveredEndpoint, type_: str, qos: str) -> str:
    """Why nothing passes between another program's topic and ours, in a sentence; "" if it does.

    type_: of ours, as mappings call it.
    qos: which of `GRADES` we want, or give.
    """
    topic, theirs, wanted = other.topic, ros_type(other.type), ros_type(dds_name(type_))
    if theirs != wanted:
        what = "what it brings is not read" if other.publishes else "whoever listens there hears nothing of us"
        return f"{topic} has the type {theirs}, not {wanted} as the mapping says: {what}"
    if other.publishes and GRADES.index(other.grade) < GRADES.index(qos):
        return (
            f'nothing comes by {topic}: the mapping wants qos = "{qos}", and it is published as "{other.grade}": '
            f'say qos = "{other.grade}" there'
        )
    if not other.publishes and GRADES.index(other.grade) > GRADES.index(qos):
        return f"whoever listens at {topic} hears nothing of us: they want what is {other.grade}, and we are {qos}"
    return stays_apart(other)


def doubt(other: DiscoveredEndpoint, type_: str) -> str:
    """That its layout is none of ours, in a sentence, of an end which DDS has not tried to join; "" otherwise.

    type_: of the topic, as mappings call it.
    """
    known = {layout_of(READ[type_][0]), *([layout_of(SHORT[type_])] if other.publishes and type_ in SHORT else [])}
    if not other.layout or other.layout in known:
        return ""
    return (
        f"{other.topic} has a {ros_type(other.type)} of another layout than that of ROS 2: perhaps nothing passes by it"
    )


def stays_apart(other: DiscoveredEndpoint) -> str:
    """That DDS does not join another program's topic with ours although its type and grade fit, in a sentence; "" if
    it does."""
    what = "what it brings is not read" if other.publishes else "whoever listens there hears nothing of us"
    if other.apart == "layout":
        return f"{other.topic} has a {ros_type(other.type)} of another layout than that of ROS 2: {what}"
    if other.apart:
        return f"{other.topic} has conditions that ours do not meet, such as a partition or a deadline of DDS: {what}"
    return ""
