"""Plans of ground stations: QGroundControl's `.plan` (JSON) and ArduPilot's `.waypoints` (QGC WPL 110), which MAVProxy
calls `.txt`.

Both say places on the Earth, which become metres from where the vehicle is at home. Waypoints become places and a
mission that visits them in their order, fences become areas. Heights, speeds, pauses and what cameras do is noted.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sleepcast.core.geodesy import FARTHEST, LocalMap, Origin
from sleepcast.core.settings import SettingsError, read_text
from sleepcast.importing.found import Disc, Found, FoundRobots, Hardware, Point
from sleepcast.simulator.scenario.areas import MAX_AREAS, MAX_CORNERS
from sleepcast.simulator.scenario.scenario import MAX_PLACES
from sleepcast.simulator.scenario.starts import StartPose

MAX_FILE = 16 * 1_048_576
MAX_ITEMS = 100_000
MAX_STOPS = MAX_PLACES - 1
"""Waypoints of a mission: a scenario has 32 places, and one is home."""
ROOM = 20.0
"""m of open space around a plan."""

WAYPOINT, LOITER, LOITER_TURNS, LOITER_TIME, HOMEWARD, LAND, TAKEOFF = 16, 17, 18, 19, 20, 21, 22
SPLINE, VTOL_TAKEOFF, VTOL_LAND = 82, 84, 85
INSIDE_POLYGON, OUTSIDE_POLYGON, INSIDE_CIRCLE, OUTSIDE_CIRCLE = FENCES = 5001, 5002, 5003, 5004
RALLY = 5100
STOPS = {WAYPOINT, LOITER, LOITER_TURNS, LOITER_TIME, LAND, TAKEOFF, SPLINE, VTOL_TAKEOFF, VTOL_LAND}
"""Commands of MAVLink to be somewhere."""
COPTER = "copter", Hardware(0.25, 5.0, 1.5, 2.0, solid=False)
VEHICLES: dict[str, tuple[str, Hardware]] = {
    "1": ("plane", Hardware(0.5, 15.0, 0.5, 2.0, solid=False)),
    "10": ("rover", Hardware(0.3, 2.0, 1.0, 1.0)),
    "11": ("boat", Hardware(0.5, 3.0, 0.5, 0.5)),
}
"""By MAV_TYPE, the numbers of MAVLink's common dialect."""


@dataclass(frozen=True, slots=True)
class Item:
    """One command of a mission. at: latitude and longitude, degrees, None where it says no place; first: its first
    parameter."""

    command: int
    at: Point | None
    first: float = 0.0


def read_waypoints(path: Path) -> Found:
    """The mission, fences or rally points of a file of waypoints. The first line is home, but in MAVProxy's files of
    fences and rally points there is none. Raises SettingsError with file and line."""
    lines = read_text(path, MAX_FILE, "waypoints").splitlines()
    if not lines or lines[0].split() != ["QGC", "WPL", "110"]:
        raise SettingsError(f"{path}:1: no waypoints: wanted QGC WPL 110 in the first line")
    written = [(number, line.strip()) for number, line in enumerate(lines[1:], 2)]
    items = [_item_of(path, number, line) for number, line in written if line and not line.startswith("#")]
    if not items:
        raise SettingsError(f"{path}:2: no waypoints: wanted home and at least one more")
    homeless = items[0].command in (*FENCES, RALLY)
    rest = items if homeless else items[1:]
    places = [each.at for each in rest if each.at]
    origin = _middle(places) if homeless else items[0].at or next(iter(places), None)
    if origin is None:
        raise SettingsError(f"{path}:2: no item says a place on the Earth")
    mission = _Mission(path, Origin(*origin), "a mission of ArduPilot", COPTER)
    if homeless:
        mission.found.leave_out("home", "the file has none: here it is in the middle of what the file has")
    mission.visit(rest)
    mission.fence_items(rest)
    for number, at in enumerate((each.at for each in rest if each.command == RALLY and each.at), 1):
        mission.rally(number, at)
    return mission.found


def _middle(places: list[Point]) -> Point | None:
    """The middle of the box around places on the Earth, or the first one where they lie on both sides of 180 degrees;
    None for no places."""
    if not places:
        return None
    (south, north), (west, east) = ((min(each), max(each)) for each in zip(*places, strict=True))
    return places[0] if east - west > 180.0 else ((south + north) / 2.0, (west + east) / 2.0)


def _item_of(path: Path, number: int, line: str) -> Item:
    """One line: index, current, frame, command, four parameters, latitude, longitude, altitude, autocontinue."""
    if number > MAX_ITEMS:
        raise SettingsError(f"{path}:{number}: more than {MAX_ITEMS} items")
    parts = line.split()
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) != 12:
        raise SettingsError(f"{path}:{number}: wanted twelve numbers, not {line.strip()!r:.60}")
    return Item(int(numbers[3]), _place(numbers[8], numbers[9]), numbers[4])


def _place(latitude: object, longitude: object) -> Point | None:
    """A place on the Earth; None for what is none, and for 0, 0, which ground stations write where there is none."""
    at = [each for each in (latitude, longitude) if isinstance(each, int | float) and not isinstance(each, bool)]
    if len(at) != 2 or not any(at) or not (abs(at[0]) <= 90.0 and abs(at[1]) <= 180.0):
        return None
    return float(at[0]), float(at[1])


def read_plan(path: Path) -> Found:
    """The mission, fences and rally points of a plan. Raises SettingsError with the file and the key."""
    try:
        plan = json.loads(read_text(path, MAX_FILE, "a plan"))
    except (ValueError, RecursionError) as error:
        raise SettingsError(f"{path}:{getattr(error, 'lineno', 1)}: not JSON: {getattr(error, 'msg', error)}") from None
    if not isinstance(plan, dict) or plan.get("fileType") != "Plan":
        raise SettingsError(f'{path}: no plan of QGroundControl: wanted {{"fileType": "Plan", ...}}')
    mission = _table(path, plan, "mission")
    fence, rally = _table(path, plan, "geoFence"), _table(path, plan, "rallyPoints")
    written = mission.get("items", [])
    items = list(_items(path, written, 0))
    home = _places(mission.get("plannedHomePosition")) or _first(items, fence)
    if home is None:
        raise SettingsError(f"{path}: mission.plannedHomePosition: wanted [latitude, longitude, altitude]")
    kind = VEHICLES.get(str(mission.get("vehicleType")), COPTER)
    built = _Mission(path, Origin(*home), "a plan of QGroundControl", kind)
    for each in written if isinstance(written, list) else []:
        if "complexItemType" in each:
            built.found.leave_out(f"a {each['complexItemType']!s:.40} as such", "its waypoints are there, one by one")
    for what, version, known in (("the plan", plan.get("version"), 1), ("its mission", mission.get("version"), 2)):
        if version != known:
            built.found.leave_out(f"version {version!s:.20} of {what}", f"read as version {known}")
    built.visit(items)
    built.fence(fence)
    points = rally.get("points", [])
    for number, point in enumerate(points if isinstance(points, list) else [], 1):
        if place := _places(point):
            built.rally(number, place)
    return built.found


def _table(path: Path, plan: dict[str, object], key: str) -> dict[str, object]:
    table = plan.get(key, {})
    if not isinstance(table, dict):
        raise SettingsError(f"{path}: {key}: wanted a table, not {table!r:.60}")
    return table


def _items(path: Path, items: object, depth: int) -> Iterator[Item]:
    """The simple items, those of surveys and other complex ones included."""
    if not isinstance(items, list) or depth > 8:
        raise SettingsError(f"{path}: mission.items: wanted a list of items")
    for each in items:
        if not isinstance(each, dict):
            raise SettingsError(f"{path}: mission.items: wanted items, not {each!r:.60}")
        inside = each.get("TransectStyleComplexItem", each)
        if "complexItemType" in each:
            yield from _items(path, inside.get("Items", []) if isinstance(inside, dict) else [], depth + 1)
            continue
        command, params, old = each.get("command"), each.get("params"), each.get("coordinate")
        if not isinstance(command, int) or not isinstance(params or old, list):
            raise SettingsError(f"{path}: mission.items: wanted a command with seven params, not {each!r:.60}")
        place = (_places(params[4:]) if isinstance(params, list) else None) or _places(
            old
        )  # as versions before 3.2 wrote
        yield Item(command, place)


def _places(value: object) -> Point | None:
    """Latitude and longitude of [latitude, longitude, ...]; None for something else."""
    if not isinstance(value, list) or len(value) < 2:
        return None
    return _place(value[0], value[1])


def _first(items: list[Item], fence: dict[str, object]) -> Point | None:
    """Some place of a plan without a home."""
    for each in items:
        if each.at:
            return each.at
    return next((corners[0] for corners, _ in _polygons(fence) if corners), None)


def _polygons(fence: dict[str, object]) -> Iterator[tuple[list[Point], bool]]:
    """The corners of each polygon of a fence, and whether vehicles are to stay inside."""
    polygons = fence.get("polygons", [])
    for each in polygons if isinstance(polygons, list) else []:
        corners = each.get("polygon", []) if isinstance(each, dict) else []
        yield [place for corner in corners if (place := _places(corner))], bool(each.get("inclusion", True))
    old = fence.get("polygon", [])  # version 1 has one polygon
    if isinstance(old, list) and old:
        yield [place for corner in old if (place := _places(corner))], True


class _Mission:
    """Puts places on the Earth onto a flat map around home."""

    def __init__(self, path: Path, origin: Origin, what: str, kind: tuple[str, Hardware]) -> None:
        self._path, self._map = path, LocalMap(origin)
        about = f"Imported from {path.name}, {what}. Home is at {origin.latitude:.7f},{origin.longitude:.7f}."
        self.found = Found(path.stem, about, margin=ROOM)
        name, hardware = kind
        self.found.robots.append(FoundRobots(name, hardware, [StartPose(0.0, 0.0, 0.0, f"{name}1")]))
        self.found.places["home"] = (0.0, 0.0), "home"

    def place(self, name: str, title: str, at: Point) -> bool:
        """Add a place; false where there is no room for it, which is noted."""
        point = self._map.metres(*at)
        if point is None:
            self.found.leave_out("places farther than 1,000 km", "no flat map reaches them")
        elif len(self.found.places) > MAX_STOPS:
            self.found.leave_out("further places", f"a scenario has {MAX_PLACES} of them")
        else:
            self.found.places[name] = point, title
            return True
        return False

    def rally(self, number: int, at: Point) -> None:
        """Add a rally point."""
        self.place(f"rally{number}", f"rally point {number}", at)

    def visit(self, items: list[Item]) -> None:
        """Make a mission of what leads somewhere."""
        for each in items:
            if each.command == HOMEWARD:
                self.found.route.append("home")
            elif each.command in STOPS and each.at:
                number = len([stop for stop in self.found.route if stop != "home"]) + 1
                if self.place(f"wp{number}", f"waypoint {number}", each.at):
                    self.found.route.append(f"wp{number}")
            elif each.command not in (TAKEOFF, LAND, RALLY, *FENCES):  # the first two: where the vehicle is
                self.found.leave_out(f"command {each.command} of MAVLink", "it leads nowhere: say as a rule what for")
        if self.found.route:
            self.found.leave_out("heights, pauses and speeds", "the vehicle drives from place to place in a plane")

    def fence_items(self, items: list[Item]) -> None:
        """Make areas of the fences in a list of waypoints: a corner an item, whose first parameter says how many there
        are; but files with fewer are about."""
        corners: list[Point] = []
        for each, following in zip(items, [*items[1:], None], strict=True):
            if each.command not in FENCES or not each.at:
                continue
            inside = each.command in (INSIDE_POLYGON, INSIDE_CIRCLE)
            if each.command in (INSIDE_CIRCLE, OUTSIDE_CIRCLE):
                self._circle(each.at, each.first, inside)
                continue
            corners.append(each.at)
            if following is None or following.command != each.command or len(corners) >= each.first:
                self._polygon(corners, inside)
                corners = []

    def fence(self, fence: dict[str, object]) -> None:
        """Make areas of a plan's fences."""
        for corners, inside in _polygons(fence):
            self._polygon(corners, inside)
        circles = fence.get("circles", [])
        for each in circles if isinstance(circles, list) else []:
            circle = each.get("circle") if isinstance(each, dict) else None
            if isinstance(circle, dict):
                self._circle(_places(circle.get("center")), circle.get("radius"), bool(each.get("inclusion", True)))

    def _polygon(self, corners: list[Point], inside: bool) -> None:
        points = [point for corner in corners if (point := self._map.metres(*corner))]
        if 3 <= len(points) <= MAX_CORNERS:
            self._area(tuple(points), inside)
        else:
            self.found.leave_out(f"a fence with {len(corners)} corners", f"an area has 3 to {MAX_CORNERS}")

    def _circle(self, center: Point | None, radius: object, inside: bool) -> None:
        point = self._map.metres(*center) if center else None
        if point and isinstance(radius, int | float) and 0.0 < radius < FARTHEST:
            self._area(Disc(point, float(radius)), inside)
        else:
            self.found.leave_out("a round fence without centre or radius", "nobody knows where it is")

    def _area(self, area: tuple[Point, ...] | Disc, inside: bool) -> None:
        if len(self.found.areas) == MAX_AREAS:
            self.found.leave_out("further fences", f"a scenario has {MAX_AREAS} areas")
            return
        self.found.areas[f"{'fence' if inside else 'keep_out'}{len(self.found.areas) + 1}"] = area
        self.found.leave_out("what fences do", "areas do nothing by themselves here: rules ask (INSIDE fence1)")
