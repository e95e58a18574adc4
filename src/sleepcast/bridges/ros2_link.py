"""The way to a ROS 2 robot: its topics over DDS, by Eclipse Cyclone DDS; no ROS is needed on this computer.

Readers keep the last message of each topic only: a body wants what is now. What cannot match is said: a topic of
another type, and somebody else who drives the same robot.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress
from functools import cache
from typing import Any

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from sleepcast.bridges.body import OutOfReachError
from sleepcast.bridges.ros2_mapping import CLOCK, Heard, RobotMapping, Source
from sleepcast.bridges.ros2_messages import READ, Clock, made, read, ros_type, seconds, stamp
from sleepcast.core.errors import MisuseError, printable

AT_ONCE = 100
"""Endpoints of others that are looked at in one round."""
MAX_REMARKED = 1_000
"""Endpoints that were remarked upon: no network of robots has so many that do not fit."""
MAX_LOCAL = 99
"""Programs on this computer that look for each other where there is no multicast."""
PARTING = duration(milliseconds=100)
"""For the last words at a topic to arrive."""

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


class DdsLink:
    """A `Link` of the module `ros2`. local: whether to look for the robot on this computer only. clock: whether it
    hears /clock, too. Raises OutOfReachError, MisuseError."""

    def __init__(self, mapping: RobotMapping, domain: int, *, local: bool, clock: bool) -> None:
        join(domain, local)
        try:
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise OutOfReachError(f"ROS domain {domain} cannot be joined: {error}") from None
        self._sources: dict[str, tuple[Source, DataReader[Any]]] = {}
        self._wanted: dict[str, str] = {}
        """The types of our topics, as DDS calls both."""
        self._writers: dict[str, tuple[str, DataWriter[Any]]] = {}
        self._driven = f"rt{mapping.drive.topic}"
        self._remarked: set[tuple[str, str]] = set()
        self._remarks: list[str] = []
        for source in mapping.sources:
            reader = DataReader(self._participant, self._topic(source.topic, READ[source.sort][0]), QOS[source.qos])
            self._sources[source.topic] = source, reader
        self._clock: DataReader[Any] | None = None
        if clock:
            self._clock = DataReader(self._participant, self._topic(CLOCK, Clock), QOS["sensor"])
        for sink in (mapping.drive, *mapping.switches, *([mapping.stop] if mapping.stop else ())):
            qos = QOS["latched" if sink is mapping.stop else "reliable"]
            writer = DataWriter(self._participant, self._topic(sink.topic, READ[sink.sort][0]), qos)
            self._writers[sink.topic] = sink.sort, writer
        self._others = (
            BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication),
            BuiltinDataReader(self._participant, BuiltinTopicDcpsSubscription),
        )

    def _topic(self, name: str, sort: Any) -> Topic[Any]:
        self._wanted[f"rt{name}"] = sort.__idl_typename__.replace(".", "::")
        return Topic(self._participant, f"rt{name}", sort)

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

    def say(self, topic: str, values: tuple[float, ...]) -> None:
        sort, writer = self._writers[topic]
        try:
            writer.write(made(sort, values, time.time()))
        except DDSException as error:
            raise OutOfReachError(f"{topic} cannot be written: {error}") from None

    def remarks(self) -> list[str]:
        ours = self._participant.guid
        for publishing, reader in zip((True, False), self._others, strict=True):
            for each in reader.take(AT_ONCE):
                wanted = self._wanted.get(each.topic_name)
                if wanted is None or not each.sample_info.valid_data or each.participant_key == ours:
                    continue
                topic = each.topic_name.removeprefix("rt")
                if each.type_name != wanted:
                    there, sort = ros_type(printable(each.type_name)), ros_type(wanted)
                    what = "what it brings is not read" if publishing else "whoever listens there hears nothing of us"
                    self._remark(topic, there, f"{topic} has the type {there}, not {sort} as the mapping says: {what}")
                elif publishing and each.topic_name == self._driven:
                    self._remark(topic, "", f"somebody else drives it, too, by {topic}: STOP does not hold for them")
        said, self._remarks = self._remarks, []
        return said

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
        del self._others, self._clock, self._participant
