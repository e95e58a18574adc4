"""Plans that a vehicle may fly: missions of ground stations, in a folder of its node, each under the name of its file.

Before a plan is sent it is looked at as a whole: whether each item is one whose effect is known here, and whether all
places, and the straight ways between them, lie within the fence, the floor and the ceiling. A vehicle follows a plan by
itself, so that nothing that is here could hold it on the way.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from math import hypot, isfinite, isnan
from pathlib import Path

from sleepcast.bridges.address import BodyError
from sleepcast.bridges.mavlink.transfer import MAX_ITEMS
from sleepcast.core.errors import MisuseError
from sleepcast.core.geodesy import LocalMap
from sleepcast.core.mission_files import (
    ABOVE_HOME,
    ABOVE_SEA,
    HOMEWARD,
    LAND,
    LOITER,
    LOITER_TIME,
    LOITER_TO_ALT,
    LOITER_TURNS,
    SPLINE,
    TAKEOFF,
    WAYPOINT,
    Item,
    Place,
    read_mission_file,
)
from sleepcast.core.outlines import Point
from sleepcast.core.records import dataclass
from sleepcast.robot import FencedError, Limits
from sleepcast.robot.hovering import FARTHEST

ENDINGS = (".plan", ".waypoints")
MAX_BYTES = 1_048_576
"""Of a plan that is flown: ten times what its items need."""
MAX_PLANS = 64
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}\Z")

JUMP, SPEED, DELAY = 177, 178, 93
CIRCLES = {LOITER: 2, LOITER_TURNS: 2, LOITER_TIME: 2, LOITER_TO_ALT: 1}
"""Commands to circle, and the index of the parameter that is the radius, m."""
USUAL_TURN = 10.0
"""m: what ArduPilot's copters take for a radius that a circle does not say."""
GOES = {WAYPOINT, *CIRCLES, HOMEWARD, LAND, TAKEOFF, SPLINE, DELAY}
GOES_NOWHERE = {
    *(112, 114, 115, JUMP, SPEED, 181, 182, 183, 184, 189, 195, 196, 197, 200, 201, 202, 203, 204, 205, 206, 211),
    *(214, 530, 531, 532, 1000, 1001, 2000, 2001, 2500, 2501),
}
"""Conditions, jumps and speeds, servos and relays, the start of a landing, cameras and what holds them."""
FRAMES = {0: ABOVE_SEA, 5: ABOVE_SEA, 3: ABOVE_HOME, 6: ABOVE_HOME}
"""Those of items, with and without numbers of 10^-7 degrees."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A mission by its name, as its node read it."""

    name: str
    items: tuple[Item, ...]

    def places(self) -> Iterator[Place]:
        """Where it leads, in order."""
        return (each.at for each in self.items if each.at and each.command in GOES)


@dataclass(frozen=True, slots=True, eq=False)
class Circumstances:
    """What decides whether a plan may be flown.

    earth: the map of x and y.
    here: x and y of the vehicle, m.
    home: of where it started, None for unknown.
    ground: altitude of where it started, m above the sea; NaN for unknown.
    flies: whether floor and ceiling are kept.
    circle: see `MavlinkVehicle.CIRCLE`.
    """

    limits: Limits
    earth: LocalMap
    here: Point
    home: Point | None
    ground: float
    flies: bool
    circle: float


def read_plans(folder: Path) -> tuple[Plan, ...]:
    """The plans in a folder, in the order of their names. Raises BodyError, or SettingsError with file and line."""
    if not folder.is_dir():
        raise BodyError(f"plans={folder}: wanted a folder with files {' and '.join('*' + each for each in ENDINGS)}")
    files = sorted(each for each in folder.iterdir() if each.suffix.lower() in ENDINGS)
    if not 1 <= len(files) <= MAX_PLANS:
        raise BodyError(f"plans={folder}: it has {len(files)} files of plans: wanted 1 to {MAX_PLANS}")
    known: dict[str, Path] = {}
    for file in files:
        if not NAME.match(file.stem):
            raise BodyError(
                f"{file}: a plan is called by its file: wanted a letter, then up to 31 letters, digits and _"
            )
        other = known.setdefault(file.stem.casefold(), file)
        if other is not file:
            raise BodyError(f"{file}: {other.name} has this name already: rename one of them")
    return tuple(_read_plan(file) for file in files)


def _read_plan(file: Path) -> Plan:
    items = read_mission_file(file, MAX_BYTES).items
    if not 1 <= len(items) < MAX_ITEMS:
        raise BodyError(f"{file}: a mission of {len(items)} items: wanted 1 to {MAX_ITEMS - 1}")
    for number, item in enumerate(items, 1):
        if item.command not in GOES | GOES_NOWHERE:
            raise BodyError(
                f"{file}: item {number} is command {item.command} of MAVLink, and nobody here knows where that leads: "
                "take it out"
            )
        if item.frame < 0:
            raise BodyError(f"{file}: item {number} has a frame that is none of MAVLink: wanted 3, above home")
        if item.command in (WAYPOINT, SPLINE) and not item.at:
            raise BodyError(f"{file}: item {number} is a waypoint without a place: give it one, or take it out")
        if item.command == JUMP and not 1.0 <= item.first <= len(items):
            raise BodyError(f"{file}: item {number} jumps to item {item.first:g}, and there are {len(items)}")
    return Plan(file.stem, tuple(items))


def check_plan(plan: Plan, now: Circumstances) -> None:
    """Raise FencedError for a plan that leads beyond the fence, MisuseError for one that is too high, too low or too
    fast, or of which that is not known."""
    for number, item in enumerate(plan.items, 1):
        which = f"plan {plan.name}: item {number}"
        if item.command == SPEED and not item.parameters[1] <= now.limits.speed:
            raise MisuseError(f"{which} asks for {item.parameters[1]:g} m/s, and {now.limits.speed:g} are allowed")
        if item.command == SPLINE and now.limits.are_fenced:
            raise MisuseError(f"{which} is a spline, which may swing beyond the fence: make it a waypoint")
        if now.flies and _says_height(item):
            _check_height(item, now, which)
    stops = _stops(plan, now)
    for number, (point, item) in stops.items():
        _check_place(f"plan {plan.name}: item {number}", point, item, now)
    for begin, end in _ways(plan, stops):
        way = "the way" if begin < end else "the way back"
        start = stops[begin][0] if begin else now.here
        _check_way(f"plan {plan.name}: {way} to item {end}", start, stops[end][0], now)


def _stops(plan: Plan, now: Circumstances) -> dict[int, tuple[Point, Item]]:
    """The places of a plan by the numbers of its items."""
    stops: dict[int, tuple[Point, Item]] = {}
    for number, item in enumerate(plan.items, 1):
        which = f"plan {plan.name}: item {number}"
        if item.command == HOMEWARD:
            if now.home is None and now.limits.are_fenced:
                raise MisuseError(f"{which} goes home, and the vehicle has not said yet where that is")
            point = now.home
        else:
            point = now.earth.metres(*item.at) if item.at and item.command in GOES else None
            if item.at and item.command in GOES and (point is None or not hypot(*point) <= FARTHEST):
                raise MisuseError(f"{which} is farther than {FARTHEST:g} m from the origin")
        if point is not None:
            stops[number] = point, item
    return stops


def _ways(plan: Plan, stops: Collection[int]) -> Iterator[tuple[int, int]]:
    """The ways that a plan may take, each jump done or not, by the numbers of the places; 0 for where it begins."""
    for begin in (0, *stops):
        next_ones, seen = [begin + 1], set[int]()
        while next_ones:
            number = next_ones.pop()
            if number in seen or number > len(plan.items):
                continue
            seen.add(number)
            if number in stops:
                yield begin, number
                continue
            item = plan.items[number - 1]
            next_ones += [number + 1, *([int(item.first)] if item.command == JUMP else ())]


def _says_height(item: Item) -> bool:
    """Whether an item leads to a height: without a place, 0 stands for the one that it has."""
    if item.command not in GOES or item.command == LAND:
        return False
    return bool(item.at) or (item.command not in (HOMEWARD, DELAY) and item.altitude != 0.0 and isfinite(item.altitude))


def _check_height(item: Item, now: Circumstances, which: str) -> None:
    frame, height = FRAMES.get(item.frame, -1), item.altitude
    if frame == ABOVE_SEA:
        height -= now.ground
    elif frame != ABOVE_HOME:
        raise MisuseError(f"{which} counts its height from the terrain, which nobody here knows: from home, or the sea")
    if isnan(height):
        raise MisuseError(f"{which}: nobody knows how high that is")
    if not now.limits.floor <= height <= now.limits.ceiling:
        raise MisuseError(
            f"{which} is at {height:g} m: it flies from {now.limits.floor:g} to {now.limits.ceiling:g} m high"
        )


def _check_place(which: str, point: Point, item: Item, now: Circumstances) -> None:
    if not now.limits.holds(*point):
        raise FencedError(f"{which} lies outside of the fence")
    margin = _radius(item, now)
    if not now.limits.holds(*point, margin):
        raise FencedError(f"{which}: its circle of {margin:g} m passes the fence")


def _check_way(which: str, start: Point, end: Point, now: Circumstances) -> None:
    if not all(map(isfinite, start)):
        raise MisuseError("the vehicle has not said yet where it is")
    if not now.limits.holds_way(start, end):
        raise FencedError(f"{which} passes the fence")


def _radius(item: Item, now: Circumstances) -> float:
    """Of the circle that is flown at a place, m: planes begin their turn there, too."""
    usual = now.circle or (USUAL_TURN if item.command == LOITER_TURNS else 0.0)
    if not usual or item.command in (TAKEOFF, LAND):
        return 0.0
    given = abs(item.parameters[CIRCLES[item.command]]) if item.command in CIRCLES else 0.0
    return given if isfinite(given) and given > 0.0 else usual
