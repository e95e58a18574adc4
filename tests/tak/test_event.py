"""Events go out and come back the same, in both forms, and no bytes from outside do harm."""

from __future__ import annotations

import math
from contextlib import suppress
from xml.etree import ElementTree

import pytest
import takproto
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.tak.event import MAX_EVENT, MESH, CotEvent, EventError, read_datagram, read_protobuf, read_xml
from sleepcast.tak.link import EventStream

NAMES = st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc", "Cn")), min_size=1, max_size=40)
TIMES = st.integers(0, 4_000_000_000_000).map(lambda milliseconds: milliseconds / 1000.0)
EVENTS = st.builds(
    CotEvent,
    uid=NAMES,
    type=NAMES,
    latitude=st.floats(-90.0, 90.0),
    longitude=st.floats(-180.0, 180.0),
    time=TIMES,
    stale=TIMES,
    callsign=NAMES,
    course=st.none() | st.floats(0.0, 360.0),
    speed=st.none() | st.floats(0.0, 100.0),
    battery=st.none() | st.floats(0.0, 1.0),
    team=st.sampled_from(["", "Cyan"]),
    remarks=NAMES,
    outline=st.lists(st.tuples(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0)), max_size=4).map(tuple),
)


def same(found: CotEvent, sent: CotEvent) -> bool:
    """Whether what is read of an event is as it was sent."""
    near = math.isclose(found.latitude, sent.latitude, abs_tol=1e-7)
    near &= math.isclose(found.longitude, sent.longitude, abs_tol=1e-7)
    near &= abs(found.time - sent.time) < 0.0011 and abs(found.stale - sent.stale) < 0.0011
    return near and (found.uid, found.type, found.callsign) == (sent.uid, sent.type, sent.callsign)


@given(EVENTS)
def test_an_event_comes_back_as_it_went(event: CotEvent) -> None:
    assert same(read_xml(event.xml()), event)
    assert same(read_protobuf(event.protobuf()), event)
    assert same(read_datagram(event.xml()), event)
    assert same(read_datagram(MESH + event.protobuf()), event)


def test_what_tak_wants_to_know_stands_where_it_looks_for_it() -> None:
    event = CotEvent(
        "u", "a-f-G", 1.0, 2.0, 0.0, 3.0, "r1", 90.0, 1.5, 0.25, "Cyan", "STOPPED", ((1.0, 2.0), (3.0, 4.0))
    )
    top = ElementTree.fromstring(event.xml())
    assert top.get("time") == "1970-01-01T00:00:00.000000Z"
    assert top.get("stale") == "1970-01-01T00:00:03.000000Z"
    detail = top.find("detail")
    assert detail is not None
    found = {each.tag: dict(each.attrib) for each in detail}
    assert found["track"] == {"course": "90.0", "speed": "1.50"}
    assert found["status"] == {"battery": "25"}
    assert found["__group"] == {"name": "Cyan", "role": "Team Member"}
    assert [each.get("point") for each in detail.findall("link")] == ["1.0000000,2.0000000", "3.0000000,4.0000000"]
    assert detail.findtext("remarks") == "STOPPED"


def test_takproto_loses_nothing_that_an_event_says() -> None:
    """It drops attributes for which TAK's protobuf has no field (docs/counterparts.md)."""
    event = CotEvent("u", "a-f-G", 1.0, 2.0, 0.0, 3.0, "r1", 90.0, 1.5, 0.25, "Cyan", "told", ((1.0, 2.0), (3.0, 4.0)))
    written = ElementTree.fromstring(event.xml())
    message = takproto.parse_mesh(MESH + event.protobuf()).cotEvent
    detail, more = message.detail, ElementTree.fromstring(f"<detail>{message.detail.xmlDetail}</detail>")
    fields = {"contact": detail.contact, "__group": detail.group, "status": detail.status, "track": detail.track}
    for each in written.findall("detail/*"):
        if each.tag in fields:
            values = {key: str(getattr(fields[each.tag], key)) for key in each.attrib}
            assert all(
                value == said or float(value) == float(said)
                for value, said in zip(values.values(), each.attrib.values(), strict=True)
            )
        else:
            assert ElementTree.tostring(each) in [ElementTree.tostring(other) for other in more]


A, B, C, D = "36.6000000,-121.9000000", "36.6100000,-121.9000000", "36.6100000,-121.8000000", "36.6000000,-121.8000000"


@pytest.mark.parametrize(
    ("corners", "drawn"),
    [
        ([], []),
        ([A], []),
        ([A, A], []),
        ([A, B], [A, B]),
        ([A, B, A], [A, B]),
        ([A, B, C], [A, B, C, A]),
        ([A, B, C, D], [A, B, C, D, A]),
        ([A, B, C, A], [A, B, C, A]),
    ],
)
@pytest.mark.parametrize("protobuf", [False, True])
def test_an_area_is_a_ring_of_links_two_places_are_a_line_and_one_is_neither(
    corners: list[str], drawn: list[str], protobuf: bool
) -> None:
    """By that, programs tell areas from lines in what is drawn by hand (`u-d-f`)."""
    outline = tuple((float(y) + 1e-9, float(x) - 1e-9) for y, x in (corner.split(",") for corner in corners))
    event = CotEvent("fleet.group.bravo", "u-d-f", 36.6, -121.9, 0.0, 3.0, "bravo (3)", outline=outline)
    if protobuf:
        detail = takproto.parse_mesh(MESH + event.protobuf()).cotEvent.detail.xmlDetail
        top = ElementTree.fromstring(f"<detail>{detail}</detail>")
    else:
        top = ElementTree.fromstring(event.xml())
    assert [each.get("point") for each in top.iter("link")] == drawn


def test_nothing_is_written_as_less_than_nothing() -> None:
    event = CotEvent("u", "u-d-f", -1e-9, 0.0, 0.0, 3.0, outline=((-1e-9, 0.0), (0.0, -1e-9)))
    assert b"-0.0" not in event.xml()
    assert b"link" not in event.xml(), "they are one place"


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"", "no XML"),
        (b"<event", "no XML"),
        (b"\xff\xfe<", "no XML"),
        (b"<event><point lat='1' lon='2'/></event>", "uid and a type"),
        (b"<event uid='a' type='b'></event>", "with a point"),
        (b"<html><point lat='1' lon='2'/></html>", "with a point"),
        (b"<event uid='a' type='b'><point lat='91' lon='2'/></event>", "no place on the Earth"),
        (b"<event uid='a' type='b'><point lat='nan' lon='x'/></event>", "no place on the Earth"),
        (b"<!DOCTYPE a [<!ENTITY b 'c'>]><event uid='&b;' type='b'><point lat='1' lon='2'/></event>", "document type"),
        (b"<event uid='" + b"a" * MAX_EVENT + b"'/>", "at most"),
    ],
)
def test_what_is_no_event_is_refused_with_the_reason(data: bytes, complaint: str) -> None:
    with pytest.raises(EventError, match=complaint):
        read_xml(data)


@given(st.binary(max_size=300))
def test_random_bytes_are_an_event_or_refused(data: bytes) -> None:
    for read in (read_xml, read_protobuf, read_datagram):
        with suppress(EventError):
            read(data)


@given(st.lists(EVENTS, max_size=4), st.booleans(), st.integers(1, 60), st.binary(max_size=30))
def test_events_are_found_in_a_stream_however_it_is_cut(
    events: list[CotEvent], protobuf: bool, size: int, noise: bytes
) -> None:
    sender, receiver = EventStream(), EventStream()
    sender.protobuf = receiver.protobuf = protobuf
    sent = b"".join(map(sender.written, events))
    found = [event for at in range(0, len(sent), size) for event in receiver.read(sent[at : at + size])]
    control = [event for event in events if event.type.startswith("t-x-")]
    assert len(found) == len(events) - len(control)
    assert all(same(*pair) for pair in zip(found, (event for event in events if event not in control), strict=True))
    list(receiver.read(noise))  # whatever comes then


def test_a_stream_keeps_no_more_than_one_event() -> None:
    stream = EventStream()
    for _ in range(20):
        assert list(stream.read(b"<event " + b"a" * MAX_EVENT)) == []
        assert len(stream._waiting) <= MAX_EVENT
    assert stream.lost == 20
    event = CotEvent("u", "b", 1.0, 2.0, 0.0, 0.0)
    assert [found.uid for found in stream.read(event.xml())] == ["u"]


def test_beginnings_of_events_that_are_none_do_no_harm() -> None:
    stream = EventStream()
    stream.protobuf = True
    event = CotEvent("u", "b", 1.0, 2.0, 0.0, 0.0)
    for piece in (b"\xbf\xff\xff\xff\x7f", b"\xbf\xff\xff\xff\xff"):
        noise = piece * 5_000 + b"\x00"
        assert [each.uid for each in stream.read(noise + stream.written(event))] == ["u"]
    assert stream.lost == 10_000
