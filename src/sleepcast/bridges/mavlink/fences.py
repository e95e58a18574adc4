"""Fences of a vehicle: polygons and circles, read from it, or from a file and written to it.

The vehicle keeps its fence by itself, if it is switched on there. Its body keeps the same one, so that what a mind asks
comes to rest before it. Several areas to stay inside count all at once, as ArduPilot has it unless told otherwise.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from math import isfinite
from pathlib import Path

from sleepcast.bridges.address import BodyAddress, BodyError
from sleepcast.bridges.mavlink.link import MavlinkConnection
from sleepcast.bridges.mavlink.transfer import FENCE, MAX_ITEMS, Download, Party, Upload, finish
from sleepcast.core.geodesy import FARTHEST, LocalMap
from sleepcast.core.mission_files import (
    INSIDE_CIRCLE,
    INSIDE_POLYGON,
    OUTSIDE_CIRCLE,
    OUTSIDE_POLYGON,
    FenceArea,
    Item,
    fences_of,
    read_mission_file,
)
from sleepcast.core.model import MapOutline, NamedArea
from sleepcast.core.outlines import corners_of
from sleepcast.core.records import NamedTuple

VEHICLE = "vehicle"
"""In place of a file: the fence that is in the vehicle."""
MAX_BYTES = 1_048_576


class Fence(NamedTuple):
    """Areas that a vehicle does not leave, and areas that it does not enter."""

    inside: tuple[NamedArea, ...] = ()
    outside: tuple[NamedArea, ...] = ()

    def outlines(self) -> Iterator[MapOutline]:
        """What maps show of it."""
        return (MapOutline(area.name, corners_of(area), True) for area in (*self.inside, *self.outside))


def fence_of(address: BodyAddress, link: MavlinkConnection, party: Party, earth: LocalMap | None) -> Fence:
    """The fence that the setting `fence` names, after it was read from the vehicle or written to it. earth: the map of
    x and y. Raises BodyError, or SettingsError with file and line."""
    wanted = address.settings["fence"]
    if not wanted:
        return Fence()
    if earth is None:
        raise BodyError(
            f"{address.uri!r:.100}: fence={wanted} needs origin=LATITUDE,LONGITUDE, from which it is measured"
        )
    what = "the fence in the vehicle" if wanted == VEHICLE else f"fence={wanted}"
    areas = read_fence(link, party) if wanted == VEHICLE else read_mission_file(Path(wanted), MAX_BYTES).fences
    if not areas:
        raise BodyError(f"{what} is empty: wanted a polygon or a circle, or no setting fence")
    fence = fence_on(earth, areas, what)
    if wanted != VEHICLE:
        write_fence(link, party, areas)
    return fence


def fence_on(earth: LocalMap, areas: Sequence[FenceArea], what: str) -> Fence:
    """A fence in metres. what: it is, for errors. Raises BodyError."""
    inside: list[NamedArea] = []
    outside: list[NamedArea] = []
    for number, area in enumerate(areas, 1):
        points = [earth.metres(*corner) for corner in area.corners]
        near = [point for point in points if point is not None]
        is_whole = len(near) == len(points) and (len(near) > 2 or (len(near) == 1 and 0.0 < area.radius < FARTHEST))
        if not is_whole:
            raise BodyError(
                f"{what}: area {number} is neither a polygon of three corners or more nor a circle near here"
            )
        sizes = (*near[0], area.radius) if area.is_round else tuple(each for point in near for each in point)
        name = f"{'fence' if area.inside else 'keep_out'}{number}"
        (inside if area.inside else outside).append(NamedArea(name, sizes))
    return Fence(tuple(inside), tuple(outside))


def items_of(areas: Sequence[FenceArea]) -> Iterator[Item]:
    """A fence as items: of a polygon, each corner says how many there are."""
    for area in areas:
        circle, polygon = (INSIDE_CIRCLE, INSIDE_POLYGON) if area.inside else (OUTSIDE_CIRCLE, OUTSIDE_POLYGON)
        command, first = (circle, area.radius) if area.is_round else (polygon, float(len(area.corners)))
        for corner in area.corners:
            yield Item(command, corner, 0.0, parameters=(first, 0.0, 0.0, 0.0))


def read_fence(link: MavlinkConnection, party: Party) -> list[FenceArea]:
    """The fence that is in the vehicle. Raises BodyError."""
    download = Download(link, party, FENCE, time.monotonic())
    finish(download, link, party, "the fence in the vehicle was not read")
    return [area for area in fences_of(download.items) if not area.is_round or isfinite(area.radius)]


def write_fence(link: MavlinkConnection, party: Party, areas: Sequence[FenceArea]) -> None:
    """Write a fence over the one that is in the vehicle. Raises BodyError."""
    items = list(items_of(areas))
    if len(items) > MAX_ITEMS:
        raise BodyError(f"a fence of {len(items)} corners and circles: wanted {MAX_ITEMS} at most")
    finish(Upload(link, party, FENCE, items, time.monotonic()), link, party, "the vehicle has not taken its fence")
