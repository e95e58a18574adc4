"""Files of ground stations: what they say, and that no file does any harm."""

from __future__ import annotations

import json
from math import isnan
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given
from hypothesis import strategies as st

from sleepcast.core.mission_files import MissionFile, read_mission_file
from sleepcast.core.settings import SettingsError

PLACE = [47.5, 8.5]
WAYPOINTS = """QGC WPL 110
0 1 0 16 0 0 0 0 47.5 8.5 488 1
1 0 3 22 0 0 0 0 0 0 10 1
2 0 3 16 0 0 0 nan 47.6 8.6 20 1
3 0 3 5001 3 0 0 0 47.0 8.0 0 1
4 0 3 5001 3 0 0 0 48.0 8.0 0 1
5 0 3 5001 3 0 0 0 48.0 9.0 0 1
6 0 3 5004 25 0 0 0 47.5 8.5 0 1
7 0 3 5100 0 0 0 0 47.7 8.7 0 1
"""
PLAN = {
    "fileType": "Plan",
    "version": 1,
    "mission": {
        "version": 2,
        "vehicleType": 2,
        "plannedHomePosition": [*PLACE, 488],
        "items": [
            {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, 47.6, 8.6, 20]},
            {"complexItemType": "survey", "TransectStyleComplexItem": {"Items": [{"command": 206, "params": [25, 0]}]}},
        ],
    },
    "geoFence": {
        "circles": [{"circle": {"center": PLACE, "radius": 25}, "inclusion": False}],
        "polygons": [{"polygon": [[47.0, 8.0], [48.0, 8.0], [48.0, 9.0]], "inclusion": True}],
    },
    "rallyPoints": {"points": [[47.7, 8.7, 0]]},
}


def read(ending: str, data: bytes) -> MissionFile | None:
    """What is read of a file; None if that is refused in a sentence."""
    with TemporaryDirectory() as folder:
        file = Path(folder, f"a{ending}")
        file.write_bytes(data)
        try:
            return read_mission_file(file)
        except SettingsError as error:
            said = str(error)
    assert said.startswith(str(file))
    assert len(said) < len(str(file)) + 300
    return None


def test_both_say_the_same() -> None:
    for found in (read(".waypoints", WAYPOINTS.encode()), read(".plan", json.dumps(PLAN).encode())):
        assert found is not None
        assert found.home == (47.5, 8.5)
        way = next(each for each in found.items if each.command == 16)
        assert (way.at, way.altitude, way.frame, way.first) == ((47.6, 8.6), 20.0, 3, 0.0)
        assert isnan(way.parameters[3])
        polygon, circle = sorted(found.fences, key=lambda area: area.is_round)
        assert (len(polygon.corners), polygon.inside) == (3, True)
        assert (circle.corners, circle.radius, circle.inside) == (((47.5, 8.5),), 25.0, False)
        assert found.rally == [(47.7, 8.7)]


def test_surveys_have_their_items_and_are_noted() -> None:
    found = read(".plan", json.dumps(PLAN).encode())
    assert found is not None
    assert [each.command for each in found.items] == [16, 206]
    assert list(found.notes) == [("a survey as such", "its waypoints are there, one by one")]


def test_a_fence_with_a_corner_that_is_no_place_is_not_another_fence() -> None:
    square = [[47.0, 8.0], [48.0, 8.0], [148.0, 9.0], [47.0, 9.0]]
    lines = [f"{n} 0 3 5001 4 0 0 0 {at[0]} {at[1]} 0 1" for n, at in enumerate(square)]
    plan = {"fileType": "Plan", "geoFence": {"polygons": [{"polygon": square}]}}
    for found in (
        read(".waypoints", "\n".join(["QGC WPL 110", *lines]).encode()),
        read(".plan", json.dumps(plan).encode()),
    ):
        assert found is not None
        assert [area.corners for area in found.fences] == [()]


def test_numbers_that_no_message_can_carry_are_unknown() -> None:
    found = read(
        ".waypoints",
        WAYPOINTS.splitlines()[0].encode() + b"\n0 1 0 16 0 0 0 0 1 1 1 1\n1 0 256 16 1e300 inf 2 3 1 1 1e39 1",
    )
    assert found is not None
    (item,) = found.items
    assert (item.frame, item.parameters[2:]) == (-1, (2.0, 3.0))
    assert all(map(isnan, (item.altitude, *item.parameters[:2])))


@given(st.data())
def test_files_that_are_cut_or_damaged_are_read_or_refused(data: st.DataObject) -> None:
    ending, text = data.draw(st.sampled_from([(".waypoints", WAYPOINTS), (".plan", json.dumps(PLAN))]))
    raw = bytearray(text.encode())
    for _ in range(data.draw(st.integers(0, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    read(ending, bytes(raw[: data.draw(st.integers(0, len(raw)))]))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**400) | st.just(-1),
    lambda inner: st.lists(inner, max_size=7) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=20,
)


@given(st.data())
def test_anything_in_the_place_of_anything_is_read_or_refused(data: st.DataObject) -> None:
    plan = json.loads(json.dumps(PLAN))
    here = plan
    while True:
        key = data.draw(st.sampled_from(sorted(here) if isinstance(here, dict) else range(len(here))))
        if not here[key] or not isinstance(here[key], dict | list) or data.draw(st.booleans()):
            here[key] = data.draw(JSON)
            break
        here = here[key]
    read(".plan", json.dumps(plan).encode())


@given(st.lists(st.sampled_from(["nan", "inf", "-1", "1e300", "16", "5001", "0", "47.5", "x", "1_0"]), max_size=13))
def test_any_numbers_of_waypoints_are_read_or_refused(parts: list[str]) -> None:
    read(".waypoints", f"QGC WPL 110\n{' '.join(parts)}\n{WAYPOINTS.splitlines()[2]}".encode())
