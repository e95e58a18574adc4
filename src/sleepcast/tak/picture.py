"""What others see of robots, and what robots learn of others' markers.

Every robot whose telemetry is fresh becomes an event at its place, every group of two or more an area around its
robots, every place that robots know by name a point. A marker that somebody sets on a map becomes a named place: all
robots get NAME_x and NAME_y (m), and a predicate can use them: (< (DIST x y NAME_x NAME_y) 100m).
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Iterator, Mapping

from sleepcast.core.geodesy import LocalMap
from sleepcast.core.records import dataclass
from sleepcast.station.remote import RemoteMind
from sleepcast.tak.event import CotEvent

STALE = 3.0
"""Times the period between two events of a thing: after that it counts as lost on other maps."""
GROUND_ROBOT = "a-f-G-E-V-U"
"""A friendly uncrewed ground vehicle, unless told otherwise."""
AREA, POINT = "u-d-f", "b-m-p-s-m"
"""A drawn area, and a spot on the map."""
MARKER = "b-m-p"
"""How the type of a marker begins that somebody sets on a map."""
TEAMS = ("Cyan", "Green", "Yellow", "Orange", "Magenta", "Red", "Blue", "Purple", "Teal", "Maroon")
"""Colours of teams that every TAK client knows; groups get them in turn."""
MAX_MARKERS = 64
"""Markers that are taken; a robot has room for not many more variables."""
MAX_KEY = 24
"""Characters of a place's name."""
MOVED = 1.0
"""m: a marker that moved less stays where robots know it."""
BATTERIES = ("battery", "fuel")


@dataclass(frozen=True, slots=True)
class NamedPlace:
    """A place that robots know: x and y in m."""

    key: str
    x: float
    y: float

    @property
    def spot(self) -> tuple[float, float]:
        return self.x, self.y

    def variables(self) -> tuple[tuple[str, float], tuple[str, float]]:
        """What it is called on a robot, with the values."""
        return (f"{self.key}_x", self.x), (f"{self.key}_y", self.y)

    def known(self, values: Mapping[str, float]) -> bool:
        """Whether a robot with these variables knows it."""
        return all(abs(values.get(name, math.nan) - value) < MOVED for name, value in self.variables())


class OperatingPicture:
    """What is sent to other maps.

    map: from metres to degrees.
    fleet: its name, which begins the uid of everything sent.
    type: of a robot's event.
    """

    def __init__(self, map: LocalMap, fleet: str, type: str = GROUND_ROBOT) -> None:
        self._map, self._fleet, self._type = map, fleet, type
        self._teams: dict[str, str] = {}

    def events(
        self, minds: Iterable[RemoteMind], now: float, period: float, fresh: float, others: Container[str] = ()
    ) -> Iterator[CotEvent]:
        """The events of now.

        now: Unix time, s.
        period: s until the next ones.
        fresh: how old telemetry may be, s.
        others: names of places that came from other maps, and are on them already.
        """
        fresh_minds = [(mind, dict(mind.variables())) for mind in minds if mind.reported_at >= now - fresh]
        x, y = ([values.get(name, math.nan) for _, values in fresh_minds] for name in "xy")
        where = self._map.degrees(x, y)
        stale = now + STALE * max(period, 1.0)
        members: dict[str, list[tuple[float, float]]] = {}
        for (mind, values), spot, place in zip(fresh_minds, where, zip(x, y, strict=True), strict=True):
            if not math.isnan(spot[0]):
                for group in sorted(mind.telemetry.groups):
                    members.setdefault(group, []).append(place)
                yield self._robot(mind, values, spot, now, stale)
        for group, places in members.items():
            if len(places) > 1:
                yield self._group(group, places, now, stale)
        yield from self._places((values for _, values in fresh_minds), others, now, stale)

    def _robot(
        self, mind: RemoteMind, values: Mapping[str, float], where: tuple[float, float], now: float, stale: float
    ) -> CotEvent:
        groups = sorted(mind.telemetry.groups)
        shared = ["SEVERAL ROBOTS HAVE THIS NAME"] if mind.others else []
        stopped, within = [_stopped(mind)] if mind.stopped else [], [f"in {', '.join(groups)}"] if groups else []
        states = [*shared, *stopped, *within]
        supply = next((values[name] for name in BATTERIES if 0.0 <= values.get(name, math.nan) <= 1.0), None)
        heading, speed = values.get("heading", math.nan), values.get("speed", math.nan)
        return CotEvent(
            uid=f"{self._fleet}.{mind.name}",
            type=self._type,
            latitude=where[0],
            longitude=where[1],
            time=now,
            stale=stale,
            callsign=mind.name,
            course=None if math.isnan(heading) else (90.0 - math.degrees(heading)) % 360.0,
            speed=None if math.isnan(speed) else abs(speed),
            battery=supply,
            team=self._team(groups[-1]) if groups else "White",
            remarks="; ".join(states),
        )

    def _team(self, group: str) -> str:
        return self._teams.setdefault(group, TEAMS[len(self._teams) % len(TEAMS)])

    def _group(self, group: str, places: list[tuple[float, float]], now: float, stale: float) -> CotEvent:
        corners = hull(places)
        middle = (math.fsum(x for x, _ in places) / len(places), math.fsum(y for _, y in places) / len(places))
        (latitude, longitude), *outline = self._map.degrees(*zip(middle, *corners, strict=True))
        name = f"{group} ({len(places)})"
        uid = f"{self._fleet}.group.{group}"
        return CotEvent(
            uid, AREA, latitude, longitude, now, stale, name, team=self._team(group), outline=tuple(outline)
        )

    def _places(
        self, tables: Iterable[Mapping[str, float]], others: Container[str], now: float, stale: float
    ) -> Iterator[CotEvent]:
        """Pairs of variables NAME_x and NAME_y, as the first robot has them that knows them."""
        places: dict[str, tuple[float, float]] = {}
        for values in tables:
            for name, x in values.items():
                if name.endswith("_x") and not math.isnan(x + (y := values.get(f"{name[:-1]}y", math.nan))):
                    places.setdefault(name[:-2], (x, y))
        spots = self._map.degrees([x for x, _ in places.values()], [y for _, y in places.values()])
        for key, (latitude, longitude) in zip(places, spots, strict=True):
            if not math.isnan(latitude) and key not in others:
                yield CotEvent(f"{self._fleet}.place.{key}", POINT, latitude, longitude, now, stale, key)


class Markers:
    """Markers that others set, as places that robots are to know. fleet: whose own events are left out."""

    def __init__(self, map: LocalMap, fleet: str) -> None:
        self._map, self._own = map, f"{fleet}."
        self._known: dict[str, NamedPlace] = {}
        """By the uid of the marker."""
        self._keys: set[str] = set()
        """All names that robots were told, also those that markers had before."""

    def take(self, event: CotEvent) -> NamedPlace | str | None:
        """The place that this marker stands for, if robots have to learn it or where it is now; a sentence if it cannot
        become one; None if there is nothing to do."""
        if not event.type.startswith(MARKER) or event.uid.startswith(self._own):
            return None
        key, spot = key_of(event.callsign), self._map.metres(event.latitude, event.longitude)
        known = self._known.get(event.uid)
        if known is not None and spot is not None and key == known.key and math.dist(spot, known.spot) < MOVED:
            return None
        name = event.callsign or event.uid
        if not key:
            return f"The marker {name!r:.60} has no name that robots can use: call it by letters, such as Depot 1."
        if spot is None:
            return f"The marker {name!r:.60} is too far from the robots' origin."
        if any(place.key == key for uid, place in self._known.items() if uid != event.uid):
            return f"The marker {name!r:.60} has the name of another one: rename it."
        if key not in self._keys and len(self._keys) >= MAX_MARKERS:
            return f"The marker {name!r:.60} is one too many: at most {MAX_MARKERS} become places."
        self._keys.add(key)
        self._known[event.uid] = NamedPlace(key, *spot)
        return self._known[event.uid]


def command(place: NamedPlace) -> str:
    """What tells robots of a place."""
    settings = " ".join(f"(DEFVAR {name}) (SETQ {name} {value:.2f}m)" for name, value in place.variables())
    return f"(PROGN {settings})"


def key_of(callsign: str) -> str:
    """A name for SLEEP of a marker's name; "" if there is none."""
    words = re.findall(r"[a-z0-9]+", callsign.casefold())
    key = "_".join(words)[:MAX_KEY].strip("_")
    return key if key[:1].isalpha() else ""


def hull(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The corners of the smallest convex area around these points, counter-clockwise (Andrew, 1979)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered

    def chain(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
        corners: list[tuple[float, float]] = []
        for point in points:
            while len(corners) > 1 and _turn(corners[-2], corners[-1], point) <= 0.0:
                corners.pop()
            corners.append(point)
        return corners[:-1]

    return chain(ordered) + chain(reversed(ordered))


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _stopped(mind: RemoteMind) -> str:
    """Whether a stopped robot is known to move still."""
    rest = mind.rest_state()
    return "STOPPED" if rest is None or rest.at_rest else "STOPPING"
