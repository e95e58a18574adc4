"""Where robots are told to be, what a marker becomes, and the area around a group."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import cast
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.core.errors import MisuseError
from sleepcast.core.geodesy import FARTHEST, LocalMap, Origin
from sleepcast.core.model import RestState
from sleepcast.language import read
from sleepcast.station.remote import RemoteMind
from sleepcast.tak.event import CotEvent
from sleepcast.tak.picture import MAX_MARKERS, Markers, NamedPlace, OperatingPicture, command, hull, key_of

ORIGIN = Origin(36.6, -121.9)
POINTS = st.tuples(st.integers(-50, 50), st.integers(-50, 50)).map(lambda point: (float(point[0]), float(point[1])))


@pytest.fixture(scope="module")
def ground() -> LocalMap:
    return LocalMap(ORIGIN)


@given(x=st.floats(-5e5, 5e5), y=st.floats(-5e5, 5e5))
def test_metres_come_back_from_degrees(ground: LocalMap, x: float, y: float) -> None:
    ((latitude, longitude),) = ground.degrees([x], [y])
    found = ground.metres(latitude, longitude)
    assert found is not None
    assert math.dist(found, (x, y)) < 1e-3


def test_north_is_up_and_a_minute_is_a_nautical_mile(ground: LocalMap) -> None:
    (origin, north, east) = ground.degrees([0.0, 0.0, 1_000.0], [0.0, 1_852.0, 0.0])
    assert origin == pytest.approx((36.6, -121.9), abs=1e-9)
    assert north[1] == pytest.approx(-121.9, abs=1e-9)
    assert 60.0 * (north[0] - 36.6) == pytest.approx(1.0, rel=2e-3)
    assert east[1] > -121.9
    assert east[0] == pytest.approx(36.6, abs=1e-5)


def test_what_is_too_far_or_no_place_is_none(ground: LocalMap) -> None:
    assert all(map(math.isnan, ground.degrees([2.0 * FARTHEST], [0.0])[0]))
    assert all(map(math.isnan, ground.degrees([math.nan], [0.0])[0]))
    assert ground.metres(-36.6, 58.1) is None
    assert ground.metres(math.nan, 0.0) is None
    assert ground.metres(95.0, 0.0) is None


@pytest.mark.parametrize("text", ["", "36.6", "36.6,-121.9,3", "x,y", "91,0", "0,181", "nan,0"])
def test_an_origin_that_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(MisuseError, match="wanted LATITUDE,LONGITUDE"):
        Origin.read(text)


@given(st.lists(POINTS, max_size=30))
def test_a_hull_is_around_all_points(points: list[tuple[float, float]]) -> None:
    corners = hull(points)
    assert set(corners) <= set(points)
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        if len(corners) > 2:
            assert all((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0 for x, y in points)


def mind(name: str, place: tuple[float, float], group: str) -> RemoteMind:
    """A robot that was heard at 100 s."""
    told = SimpleNamespace(groups=(group,))
    values = {"x": place[0], "y": place[1]}
    about = {"name": name, "reported_at": 100.0, "stopped": False, "telemetry": told, "others": {}}
    return cast(RemoteMind, SimpleNamespace(**about, variables=values.items))


@pytest.mark.parametrize(
    ("places", "points"),
    [
        ([(0.0, 0.0), (0.0, 0.0)], 0),
        ([(0.0, 0.0), (0.0, 0.001), (0.001, 0.0)], 0),
        ([(0.0, 0.0), (9.0, 0.0), (3.0, 0.0)], 2),
        ([(0.0, 0.0), (9.0, 0.0), (3.0, 3.0), (4.0, 1.0)], 4),
        ([(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)], 5),
    ],
)
def test_a_group_is_the_area_around_its_robots(
    ground: LocalMap, places: list[tuple[float, float]], points: int
) -> None:
    minds = [mind(f"r{number}", place, "bravo") for number, place in enumerate(places)]
    events = {event.uid: event for event in OperatingPicture(ground, "fleet").events(minds, 100.0, 1.0, 5.0)}
    assert len(events) == len(places) + 1
    group = events["fleet.group.bravo"]
    assert (group.type, group.callsign) == ("u-d-f", f"bravo ({len(places)})")
    links = [each.get("point", "") for each in ElementTree.fromstring(group.xml()).iter("link")]
    assert len(links) == points
    assert (links[:1] == links[-1:]) is (points != 2), "an area is closed, a line is not"
    drawn = [ground.metres(*map(float, link.split(","))) for link in links]
    assert all(found and min(math.dist(found, place) for place in places) < 0.02 for found in drawn)


@pytest.mark.parametrize(
    ("state", "said"), [(None, "STOPPED"), (RestState(0.0, 0.0), "STOPPED"), (RestState(2.0, 4.0), "STOPPING")]
)
def test_a_stopped_robot_that_still_moves_is_told(ground: LocalMap, state: RestState | None, said: str) -> None:
    found = SimpleNamespace(**{**vars(mind("r1", (0.0, 0.0), "bravo")), "stopped": True, "rest_state": lambda: state})
    (event,) = OperatingPicture(ground, "fleet").events([cast(RemoteMind, found)], 100.0, 1.0, 5.0)
    assert event.remarks == f"{said}; in bravo"


def test_a_name_that_several_robots_have_is_told(ground: LocalMap) -> None:
    found = mind("r1", (0.0, 0.0), "bravo")
    found.others[7] = False
    (event,) = OperatingPicture(ground, "fleet").events([found], 100.0, 1.0, 5.0)
    assert event.remarks == "SEVERAL ROBOTS HAVE THIS NAME; in bravo"


@pytest.mark.parametrize(
    ("callsign", "key"),
    [("Depot 1", "depot_1"), ("X", "x"), ("  Äpfel-Baum ", "pfel_baum"), ("1st", ""), ("日本", ""), ("", "")],
)
def test_a_marker_gets_a_name_that_robots_can_use(callsign: str, key: str) -> None:
    assert key_of(callsign) == key


@given(st.text(max_size=60))
def test_every_name_can_be_read_in_a_command(callsign: str) -> None:
    if key := key_of(callsign):
        read(command(NamedPlace(key, 1.0, -2.0)))
        assert key.isidentifier()


def marker(uid: str = "m1", callsign: str = "Depot 1", latitude: float = 36.6, type: str = "b-m-p-s-m") -> CotEvent:
    return CotEvent(uid, type, latitude, -121.9, 0.0, 0.0, callsign)


def test_a_marker_becomes_a_place_once_and_again_when_it_moves(ground: LocalMap) -> None:
    markers = Markers(ground, "fleet")
    found = markers.take(marker())
    assert isinstance(found, NamedPlace)
    assert found.key == "depot_1"
    assert math.hypot(found.x, found.y) < 1e-6
    assert markers.take(marker()) is None
    moved = markers.take(marker(latitude=36.601))
    assert isinstance(moved, NamedPlace)
    assert moved.y == pytest.approx(111.0, abs=0.1)
    renamed = markers.take(marker(callsign="Depot 2", latitude=36.601))
    assert isinstance(renamed, NamedPlace)
    assert renamed.key == "depot_2"
    assert markers.take(marker("m2")) == NamedPlace("depot_1", found.x, found.y), "its old name is free"


def test_one_marker_cannot_fill_robots_with_its_names(ground: LocalMap) -> None:
    markers = Markers(ground, "fleet")
    for number in range(MAX_MARKERS):
        assert isinstance(markers.take(marker(callsign=f"p{number}")), NamedPlace)
    assert "one too many" in str(markers.take(marker(callsign="more")))


def test_a_robot_knows_a_place_if_it_has_both_numbers(ground: LocalMap) -> None:
    place = NamedPlace("depot", 3.0, 4.0)
    assert place.known({"depot_x": 3.001, "depot_y": 4.0, "fuel": 0.5})
    for values in ({}, {"depot_x": 3.0}, {"depot_x": 3.0, "depot_y": math.nan}, {"depot_x": 3.0, "depot_y": 9.0}):
        assert not place.known(values)


def test_what_is_no_marker_or_our_own_is_left_out(ground: LocalMap) -> None:
    markers = Markers(ground, "fleet")
    assert markers.take(marker(type="a-f-G")) is None
    assert markers.take(marker(uid="fleet.place.vessel")) is None


def test_a_marker_that_cannot_become_a_place_is_told(ground: LocalMap) -> None:
    markers = Markers(ground, "fleet")
    markers.take(marker())
    for wrong, complaint in (
        (marker("m2", "123"), "no name that robots can use"),
        (marker("m2", "depot-1"), "has the name of another one"),
        (marker("m2", "far", latitude=-36.6), "too far"),
    ):
        found = markers.take(wrong)
        assert isinstance(found, str)
        assert complaint in found
    for number in range(MAX_MARKERS - 1):
        assert isinstance(markers.take(marker(f"n{number}", f"p{number}")), NamedPlace)
    found = markers.take(marker("m2", "more"))
    assert isinstance(found, str)
    assert "one too many" in found
