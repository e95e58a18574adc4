"""Files of ground stations: QGroundControl's `.plan` (JSON), and ArduPilot's `.waypoints` (QGC WPL 110), which MAVProxy
calls `.txt`.

Each is read into what it says, in degrees: a mission of items, which are commands of MAVLink, fences and rally points.
What becomes of them is the matter of others: they are flown, or made into a scenario.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import field
from math import isfinite, nan
from pathlib import Path

from sleepcast.core.records import dataclass
from sleepcast.core.settings import SettingsError, read_text

MAX_FILE = 16 * 1_048_576
MAX_ITEMS = 100_000
MAX_COMMAND, MAX_FRAME = 65_535, 255
MAX_DEPTH = 8
"""Complex items in complex items."""

WAYPOINT, LOITER, LOITER_TURNS, LOITER_TIME, HOMEWARD, LAND, TAKEOFF = 16, 17, 18, 19, 20, 21, 22
LOITER_TO_ALT, SPLINE, VTOL_TAKEOFF, VTOL_LAND = 31, 82, 84, 85
INSIDE_POLYGON, OUTSIDE_POLYGON, INSIDE_CIRCLE, OUTSIDE_CIRCLE = FENCES = 5001, 5002, 5003, 5004
RALLY = 5100
STOPS = frozenset({WAYPOINT, LOITER, LOITER_TURNS, LOITER_TIME, LAND, TAKEOFF, SPLINE, VTOL_TAKEOFF, VTOL_LAND})
"""Commands of MAVLink to be somewhere."""
ABOVE_SEA, ABOVE_HOME = 0, 3
"""Frames: what altitudes count from."""

Place = tuple[float, float]
"""Latitude and longitude, degrees."""


@dataclass(frozen=True, slots=True)
class Item:
    """One command of a mission.

    at: None where it says no place.
    altitude: m, of its frame; NaN for none.
    frame: -1 for what is none of MAVLink.
    parameters: its first four; NaN where the file has none.
    """

    command: int
    at: Place | None
    altitude: float = nan
    frame: int = ABOVE_HOME
    parameters: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    @property
    def first(self) -> float:
        return self.parameters[0]


@dataclass(frozen=True, slots=True)
class FenceArea:
    """Where vehicles are to stay inside, or outside. corners: of a polygon; else it is round, `radius` m around the one
    corner. A circle without centre or radius has none, nor has a polygon with a corner that is no place: without that
    one it would be another polygon."""

    corners: tuple[Place, ...]
    inside: bool
    radius: float = nan

    @property
    def is_round(self) -> bool:
        return len(self.corners) < 2


@dataclass(slots=True)
class MissionFile:
    """What stands in one file. vehicle: MAV_TYPE, "" for unknown; notes: on what was read otherwise than it is written,
    with the reason."""

    path: Path
    home: Place | None
    items: list[Item] = field(default_factory=list)
    fences: list[FenceArea] = field(default_factory=list)
    rally: list[Place] = field(default_factory=list)
    vehicle: str = ""
    notes: Counter[tuple[str, str]] = field(default_factory=Counter)

    def first_place(self) -> Place | None:
        """Some place of it, None if it has none."""
        items = [each.at for each in self.items if each.at]
        return next(iter([*items, *(corner for area in self.fences for corner in area.corners), *self.rally]), None)


def read_mission_file(path: Path, most: int = MAX_FILE) -> MissionFile:
    """What stands in a `.plan`, or else in a file of waypoints, of at most so many bytes. Raises SettingsError with the
    file and the line or the key."""
    return _read_plan(path, most) if path.suffix.lower() == ".plan" else _read_waypoints(path, most)


# ---- waypoints


def _read_waypoints(path: Path, most: int) -> MissionFile:
    """The first item is home, but in MAVProxy's files of fences and rally points there is none."""
    lines = read_text(path, most, "waypoints").splitlines()
    if not lines or lines[0].split() != ["QGC", "WPL", "110"]:
        raise SettingsError(f"{path}:1: no waypoints: wanted QGC WPL 110 in the first line")
    written = [(number, line.strip()) for number, line in enumerate(lines[1:], 2)]
    items = [_item_of(path, number, line) for number, line in written if line and not line.startswith("#")]
    if not items:
        raise SettingsError(f"{path}:2: no waypoints: wanted home and at least one more")
    homeless = items[0].command in (*FENCES, RALLY)
    rest = items if homeless else items[1:]
    found = MissionFile(path, None if homeless else items[0].at)
    found.items = [each for each in rest if each.command not in (*FENCES, RALLY)]
    found.fences = list(fences_of(rest))
    found.rally = [each.at for each in rest if each.command == RALLY and each.at]
    return found


def _item_of(path: Path, number: int, line: str) -> Item:
    """One line: index, current, frame, command, four parameters, latitude, longitude, altitude, autocontinue."""
    if number > MAX_ITEMS:
        raise SettingsError(f"{path}:{number}: more than {MAX_ITEMS} items")
    try:
        numbers = [float(part) for part in line.split()]
    except ValueError:
        numbers = []
    whole = [each for each in numbers[2:4] if isfinite(each) and 0.0 <= each <= MAX_COMMAND]
    if len(numbers) != 12 or len(whole) != 2:
        raise SettingsError(f"{path}:{number}: wanted twelve numbers, not {line.strip()!r:.60}")
    frame, command = map(int, whole)
    first, second, third, fourth = map(_number, numbers[4:8])
    height = _number(numbers[10])
    return Item(command, _place(numbers[8], numbers[9]), height, _frame(frame), (first, second, third, fourth))


def fences_of(items: list[Item]) -> Iterator[FenceArea]:
    """The fences in a list of items: a corner an item, whose first parameter says how many there are; but files with
    fewer are about."""
    corners: list[Place | None] = []
    for each, following in zip(items, (*items[1:], None), strict=False):
        if each.command not in FENCES:
            continue
        inside = each.command in (INSIDE_POLYGON, INSIDE_CIRCLE)
        if each.command in (INSIDE_CIRCLE, OUTSIDE_CIRCLE):
            yield _circle(each.at, each.first, inside)
            continue
        corners.append(each.at)
        if following is None or following.command != each.command or len(corners) >= each.first:
            yield FenceArea(_whole(corners), inside)
            corners = []


def _circle(center: Place | None, radius: object, inside: bool) -> FenceArea:
    """A round fence; without corners if that says nothing."""
    number = _number(radius)
    return FenceArea((center,) if center and number > 0.0 else (), inside, number)


def _place(latitude: object, longitude: object) -> Place | None:
    """A place on the Earth; None for what is none, and for 0, 0, which ground stations write where there is none."""
    at = [each for each in (latitude, longitude) if isinstance(each, int | float) and not isinstance(each, bool)]
    if len(at) != 2 or not any(at) or not (abs(at[0]) <= 90.0 and abs(at[1]) <= 180.0):
        return None
    return float(at[0]), float(at[1])


def _frame(number: float) -> int:
    return int(number) if 0.0 <= number <= MAX_FRAME else -1


def _number(value: object) -> float:
    """A finite number; NaN for anything else."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < 1e30:
        return nan
    return float(value)


# ---- plans


def _read_plan(path: Path, most: int) -> MissionFile:
    try:
        plan = json.loads(read_text(path, most, "a plan"))
    except (ValueError, RecursionError) as error:
        raise SettingsError(f"{path}:{getattr(error, 'lineno', 1)}: not JSON: {getattr(error, 'msg', error)}") from None
    if not isinstance(plan, dict) or plan.get("fileType") != "Plan":
        raise SettingsError(f'{path}: no plan of QGroundControl: wanted {{"fileType": "Plan", ...}}')
    mission = _table(path, plan, "mission")
    fence, rally = _table(path, plan, "geoFence"), _table(path, plan, "rallyPoints")
    written, points = mission.get("items", []), rally.get("points", [])
    found = MissionFile(path, _places(mission.get("plannedHomePosition")))
    found.vehicle = str(mission.get("vehicleType", ""))
    found.items = list(_items(path, written, 0))
    found.fences = list(_areas(fence))
    found.rally = [place for each in (points if isinstance(points, list) else []) if (place := _places(each))]
    for each in written if isinstance(written, list) else []:
        if "complexItemType" in each:
            found.notes[
                f"a {each['complexItemType']!s:.40} as such",
                "its waypoints are there, one by one",
            ] += 1
    for what, version, known in (("the plan", plan.get("version"), 1), ("its mission", mission.get("version"), 2)):
        if version != known:
            found.notes[f"version {version!s:.20} of {what}", f"read as version {known}"] += 1
    return found


def _table(path: Path, plan: dict[str, object], key: str) -> dict[str, object]:
    table = plan.get(key, {})
    if not isinstance(table, dict):
        raise SettingsError(f"{path}: {key}: wanted a table, not {table!r:.60}")
    return table


def _items(path: Path, items: object, depth: int) -> Iterator[Item]:
    """The simple items, those of surveys and other complex ones included."""
    if not isinstance(items, list) or depth > MAX_DEPTH:
        raise SettingsError(f"{path}: mission.items: wanted a list of items")
    for each in items:
        if not isinstance(each, dict):
            raise SettingsError(f"{path}: mission.items: wanted items, not {each!r:.60}")
        inside = each.get("TransectStyleComplexItem", each)
        if "complexItemType" in each:
            yield from _items(path, inside.get("Items", []) if isinstance(inside, dict) else [], depth + 1)
        else:
            yield _simple_item(path, each)


def _simple_item(path: Path, each: dict[str, object]) -> Item:
    command, params, old = each.get("command"), each.get("params"), each.get("coordinate")
    is_command = isinstance(command, int) and not isinstance(command, bool) and 0 <= command <= MAX_COMMAND
    if not is_command or not isinstance(params or old, list):
        raise SettingsError(f"{path}: mission.items: wanted a command with seven params, not {each!r:.60}")
    assert isinstance(command, int)
    numbers = [_number(value) for value in params[:7]] if isinstance(params, list) else []
    first, second, third, fourth = (*numbers, *(nan,) * 4)[:4]
    place, altitude = (_places(params[4:]), numbers[6:]) if isinstance(params, list) else (None, [])
    if place is None and isinstance(old, list):  # as versions before 3.2 wrote
        place, altitude = _places(old), [_number(value) for value in old[2:3]]
    frame = _number(each.get("frame", ABOVE_HOME))
    height = altitude[0] if altitude else nan
    return Item(command, place, height, _frame(frame), (first, second, third, fourth))


def _places(value: object) -> Place | None:
    """Latitude and longitude of [latitude, longitude, ...]; None for something else."""
    if not isinstance(value, list) or len(value) < 2:
        return None
    return _place(value[0], value[1])


def _areas(fence: dict[str, object]) -> Iterator[FenceArea]:
    """The areas of a plan's fence."""
    polygons, circles = fence.get("polygons", []), fence.get("circles", [])
    for each in polygons if isinstance(polygons, list) else []:
        corners = each.get("polygon", []) if isinstance(each, dict) else []
        yield FenceArea(_corners(corners), bool(isinstance(each, dict) and each.get("inclusion", True)))
    old = fence.get("polygon", [])  # version 1 has one polygon
    if isinstance(old, list) and old:
        yield FenceArea(_corners(old), True)
    for each in circles if isinstance(circles, list) else []:
        circle = each.get("circle") if isinstance(each, dict) else None
        if isinstance(circle, dict):
            yield _circle(_places(circle.get("center")), circle.get("radius"), bool(each.get("inclusion", True)))


def _corners(corners: object) -> tuple[Place, ...]:
    return _whole([_places(corner) for corner in corners] if isinstance(corners, list) else [])


def _whole(corners: Sequence[Place | None]) -> tuple[Place, ...]:
    """All corners of a polygon; none if one of them is no place."""
    places = tuple(corner for corner in corners if corner)
    return places if len(places) == len(corners) else ()
