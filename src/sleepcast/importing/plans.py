"""Missions of ground stations, as `core.mission_files` reads them, made into scenarios.

Their places on the Earth become metres from where the vehicle is at home. Waypoints become places and a mission that
visits them in their order, fences become areas. Heights, speeds, pauses and what cameras do is noted.
"""

from __future__ import annotations

from pathlib import Path

from sleepcast.core.geodesy import FARTHEST, LocalMap, Origin
from sleepcast.core.mission_files import (
    HOMEWARD,
    LAND,
    STOPS,
    TAKEOFF,
    FenceArea,
    Item,
    MissionFile,
    read_mission_file,
)
from sleepcast.core.settings import SettingsError
from sleepcast.importing.found import Disc, Found, FoundRobots, Hardware, Point
from sleepcast.simulator.scenario.areas import MAX_AREAS, MAX_CORNERS
from sleepcast.simulator.scenario.scenario import MAX_PLACES
from sleepcast.simulator.scenario.starts import StartPose

MAX_STOPS = MAX_PLACES - 1
"""Waypoints of a mission: a scenario has 32 places, and one is home."""
ROOM = 20.0
"""m of open space around a plan."""

COPTER = "copter", Hardware(0.25, 5.0, 1.5, 2.0, solid=False)
VEHICLES: dict[str, tuple[str, Hardware]] = {
    "1": ("plane", Hardware(0.5, 15.0, 0.5, 2.0, solid=False)),
    "10": ("rover", Hardware(0.3, 2.0, 1.0, 1.0)),
    "11": ("boat", Hardware(0.5, 3.0, 0.5, 0.5)),
}
"""By MAV_TYPE, the numbers of MAVLink's common dialect."""


def read_waypoints(path: Path) -> Found:
    """The mission, fences or rally points of a file of waypoints. Raises SettingsError with file and line."""
    mission = read_mission_file(path)
    homeless = mission.home is None and not mission.items
    origin = _middle(mission) if homeless else mission.home or mission.first_place()
    if origin is None:
        raise SettingsError(f"{path}:2: no item says a place on the Earth")
    built = _Mission(path, Origin(*origin), "a mission of ArduPilot", COPTER)
    if homeless:
        built.found.leave_out("home", "the file has none: here it is in the middle of what the file has")
    return built.all_of(mission)


def _middle(mission: MissionFile) -> Point | None:
    """The middle of the box around fences and rally points, or the first one where they lie on both sides of 180
    degrees; None for no places."""
    places = [*(corner for area in mission.fences for corner in area.corners), *mission.rally]
    if not places:
        return None
    (south, north), (west, east) = ((min(each), max(each)) for each in zip(*places, strict=True))
    return places[0] if east - west > 180.0 else ((south + north) / 2.0, (west + east) / 2.0)


def read_plan(path: Path) -> Found:
    """The mission, fences and rally points of a plan. Raises SettingsError with the file and the key."""
    mission = read_mission_file(path)
    home = mission.home or mission.first_place()
    if home is None:
        raise SettingsError(f"{path}: mission.plannedHomePosition: wanted [latitude, longitude, altitude]")
    kind = VEHICLES.get(mission.vehicle, COPTER)
    return _Mission(path, Origin(*home), "a plan of QGroundControl", kind).all_of(mission)


class _Mission:
    """Puts places on the Earth onto a flat map around home."""

    def __init__(self, path: Path, origin: Origin, what: str, kind: tuple[str, Hardware]) -> None:
        self._path, self._map = path, LocalMap(origin)
        about = f"Imported from {path.name}, {what}. Home is at {origin.latitude:.7f},{origin.longitude:.7f}."
        self.found = Found(path.stem, about, margin=ROOM)
        name, hardware = kind
        self.found.robots.append(FoundRobots(name, hardware, [StartPose(0.0, 0.0, 0.0, f"{name}1")]))
        self.found.places["home"] = (0.0, 0.0), "home"

    def all_of(self, mission: MissionFile) -> Found:
        """Take everything in, and give what was found."""
        self.found.notes.update(mission.notes)
        self.visit(mission.items)
        for area in mission.fences:
            self.fence(area)
        for number, at in enumerate(mission.rally, 1):
            self.place(f"rally{number}", f"rally point {number}", at)
        return self.found

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

    def visit(self, items: list[Item]) -> None:
        """Make a mission of what leads somewhere."""
        for each in items:
            if each.command == HOMEWARD:
                self.found.route.append("home")
            elif each.command in STOPS and each.at:
                number = len([stop for stop in self.found.route if stop != "home"]) + 1
                if self.place(f"wp{number}", f"waypoint {number}", each.at):
                    self.found.route.append(f"wp{number}")
            elif each.command not in (TAKEOFF, LAND):  # where the vehicle is
                self.found.leave_out(f"command {each.command} of MAVLink", "it leads nowhere: say as a rule what for")
        if self.found.route:
            self.found.leave_out("heights, pauses and speeds", "the vehicle drives from place to place in a plane")

    def fence(self, area: FenceArea) -> None:
        """Make an area of a fence."""
        points = [point for corner in area.corners if (point := self._map.metres(*corner))]
        if not area.is_round and 3 <= len(points) <= MAX_CORNERS:
            self._area(tuple(points), area.inside)
        elif not area.is_round:
            self.found.leave_out(f"a fence with {len(area.corners)} corners", f"an area has 3 to {MAX_CORNERS}")
        elif points and 0.0 < area.radius < FARTHEST:
            self._area(Disc(points[0], area.radius), area.inside)
        else:
            self.found.leave_out("a round fence without centre or radius", "nobody knows where it is")

    def _area(self, area: tuple[Point, ...] | Disc, inside: bool) -> None:
        if len(self.found.areas) == MAX_AREAS:
            self.found.leave_out("further fences", f"a scenario has {MAX_AREAS} areas")
            return
        self.found.areas[f"{'fence' if inside else 'keep_out'}{len(self.found.areas) + 1}"] = area
        self.found.leave_out("what fences do", "areas do nothing by themselves here: rules ask (INSIDE fence1)")
