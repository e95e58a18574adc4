"""Cursor-on-Target events: what a TAK server and its clients tell each other, as XML and as protobuf.

An event says what something is (`type`), where it is, and until when that is worth knowing. Facts about the format: the
MITRE report MP090284 and the schemas that come with TAK; the protobuf form is TAK protocol version 1, made by
`takproto`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any
from xml.etree import ElementTree

from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.extras import installing
from sleepcast.core.records import dataclass

UNKNOWN_SIZE = "9999999.0"
"""What an event says of an error or a height that nobody knows."""
DECIMALS = 7
"""Of degrees: a centimetre."""
MAX_EVENT = 64 * 1024
"""Bytes of one event that is read; those of people and of markers have some hundreds."""
MAX_TEXT = 256
"""Characters that are read of any one text of an event."""
MESH = b"\xbf\x01\xbf"
"""The first bytes of a protobuf event in a datagram."""


class EventError(SleepcastError):
    """Bytes that are no event."""


class MissingTakError(MisuseError):
    """A library for TAK's formats is not installed."""


@dataclass(frozen=True, slots=True)
class CotEvent:
    """One event.

    uid: of the thing, the same each time.
    type: what it is, in the tree of MIL-STD-2525.
    latitude, longitude: degrees of WGS 84.
    time, stale: s since 1970.
    course: degrees clockwise from north.
    speed: m/s.
    battery: a share of 1.
    team: the name of its colour.
    outline: corners, (latitude, longitude), each once, of an area around it; two are the ends of a line.
    """

    uid: str
    type: str
    latitude: float
    longitude: float
    time: float
    stale: float
    callsign: str = ""
    course: float | None = None
    speed: float | None = None
    battery: float | None = None
    team: str = ""
    remarks: str = ""
    outline: tuple[tuple[float, float], ...] = ()

    def xml(self) -> bytes:
        """The event as XML."""
        begun = _written(self.time)
        top = ElementTree.Element("event", version="2.0", uid=self.uid, type=self.type, how="m-g")
        top.attrib |= {"time": begun, "start": begun, "stale": _written(self.stale)}
        place = {"lat": _degrees(self.latitude), "lon": _degrees(self.longitude), "hae": UNKNOWN_SIZE}
        ElementTree.SubElement(top, "point", place | {"ce": UNKNOWN_SIZE, "le": UNKNOWN_SIZE})
        detail = ElementTree.SubElement(top, "detail")
        if self.callsign:
            ElementTree.SubElement(detail, "contact", callsign=self.callsign)
        if self.team:
            ElementTree.SubElement(detail, "__group", name=self.team, role="Team Member")
        if self.course is not None or self.speed is not None:
            course, speed = self.course or 0.0, self.speed or 0.0
            ElementTree.SubElement(detail, "track", course=f"{course:.1f}", speed=f"{speed:.2f}")
        if self.battery is not None:
            ElementTree.SubElement(detail, "status", battery=f"{100.0 * self.battery:.0f}")
        for point in _drawn(self.outline):
            ElementTree.SubElement(detail, "link", point=point)
        if self.remarks:
            ElementTree.SubElement(detail, "remarks").text = self.remarks
        text: bytes = ElementTree.tostring(top, encoding="utf-8")
        return text

    def protobuf(self) -> bytes:
        """The event as protobuf, without what stands before it. Raises MissingTakError."""
        event: bytes = _takproto().xml2proto(self.xml())[len(MESH) :]
        return bytes(event)


def _drawn(outline: Iterable[tuple[float, float]]) -> list[str]:
    """The points of a drawing with these corners: an area ends where it begins, two points are a line, and one place is
    no drawing. Corners that cannot be told apart as they are written are one."""
    points = list(dict.fromkeys(f"{_degrees(latitude)},{_degrees(longitude)}" for latitude, longitude in outline))
    if len(points) < 2:
        return []
    return points if len(points) == 2 else [*points, points[0]]


def read_xml(data: bytes) -> CotEvent:
    """The event in this XML. Raises EventError."""
    if len(data) > MAX_EVENT:
        raise EventError(f"an event of {len(data):,} bytes: at most {MAX_EVENT:,} are read")
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:  # nothing that TAK writes, and how a few bytes become a gigabyte
        raise EventError("an event with a document type of its own")
    try:
        top = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise EventError(f"an event that is no XML: {error}") from None
    point, contact = top.find("point"), top.find("detail/contact")
    if top.tag != "event" or point is None:
        raise EventError("XML that is no event with a point")
    return _checked(
        CotEvent(
            uid=top.get("uid", ""),
            type=top.get("type", ""),
            latitude=_number(point.get("lat")),
            longitude=_number(point.get("lon")),
            time=_read_time(top.get("time", "")),
            stale=_read_time(top.get("stale", "")),
            callsign="" if contact is None else contact.get("callsign", "")[:MAX_TEXT],
        )
    )


def read_protobuf(data: bytes) -> CotEvent:
    """The event in this protobuf, without what stands before it. Raises EventError, and MissingTakError."""
    takproto = _takproto()
    from google.protobuf.message import DecodeError

    if len(data) > MAX_EVENT:
        raise EventError(f"an event of {len(data):,} bytes: at most {MAX_EVENT:,} are read")
    try:
        event = takproto.parse_mesh(MESH + data).cotEvent
    except DecodeError as error:
        raise EventError(f"an event that is no protobuf: {error}") from None
    return _checked(
        CotEvent(
            uid=event.uid,
            type=event.type,
            latitude=event.lat,
            longitude=event.lon,
            time=event.sendTime / 1000.0,
            stale=event.staleTime / 1000.0,
            callsign=event.detail.contact.callsign[:MAX_TEXT],
        )
    )


def read_datagram(data: bytes) -> CotEvent:
    """The event in a datagram, in either form. Raises EventError, and MissingTakError."""
    return read_protobuf(data[len(MESH) :]) if data.startswith(MESH) else read_xml(data)


def _checked(event: CotEvent) -> CotEvent:
    """The event, if it says what it is and where. Raises EventError."""
    if not 0 < len(event.uid) <= MAX_TEXT or not 0 < len(event.type) <= MAX_TEXT:
        raise EventError("an event without a uid and a type of a usual length")
    if not (abs(event.latitude) <= 90.0 and abs(event.longitude) <= 180.0):
        raise EventError(f"an event at {event.latitude:g}, {event.longitude:g}, which is no place on the Earth")
    return event


def _takproto() -> Any:
    try:
        import takproto
    except ImportError:
        raise MissingTakError(f"protobuf for TAK needs takproto; to install it: {installing('tak')}") from None
    return takproto


def _number(text: str | None) -> float:
    try:
        return float(text or "")
    except ValueError:
        return math.nan


def _degrees(angle: float) -> str:
    return f"{round(angle, DECIMALS) + 0.0:.{DECIMALS}f}"  # no -0


def _written(time: float) -> str:
    return datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def _read_time(text: str) -> float:
    """s since 1970, NaN for what is no time."""
    try:
        when = datetime.fromisoformat(text)
        return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        return math.nan
