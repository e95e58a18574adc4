"""Metres on a flat map, and degrees on the Earth.

Robots think in metres from a point of their own, x to the east and y to the north; ground stations and maps in degrees
of WGS 84. The map between them is the azimuthal equidistant projection around the origin, computed by PROJ: distances
and directions from the origin are exact, and 100 km away from it lengths across are wrong by 0.04 per mille.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.core.records import dataclass

FARTHEST = 1e6
"""m from the origin: farther away the flat map no longer stands for the round Earth."""


class MissingGeodesyError(MisuseError):
    """PROJ's Python library is not installed."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where x = 0, y = 0 lies: latitude and longitude in degrees of WGS 84."""

    latitude: float
    longitude: float

    @staticmethod
    def read(text: str) -> Origin:
        """The origin written as LATITUDE,LONGITUDE. Raises MisuseError for anything else."""
        parts = text.split(",")
        try:
            latitude, longitude = map(float, parts)
        except ValueError:
            latitude = longitude = math.nan
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
            raise MisuseError(
                f"{text!r:.60} is no place on the Earth: wanted LATITUDE,LONGITUDE in degrees, such as 36.6,-121.9"
            )
        return Origin(latitude, longitude)


class LocalMap:
    """The flat map around an origin. Raises MissingGeodesyError where pyproj is not installed."""

    def __init__(self, origin: Origin) -> None:
        try:
            from pyproj import Transformer
        except ImportError:
            raise MissingGeodesyError(
                f"positions on the Earth need pyproj; to install it: {installing('tak')}"
            ) from None
        flat = f"+proj=aeqd +lat_0={origin.latitude!r} +lon_0={origin.longitude!r} +datum=WGS84 +units=m +no_defs"
        self._down: Any = Transformer.from_crs(flat, "EPSG:4326", always_xy=True)
        self._up: Any = Transformer.from_crs("EPSG:4326", flat, always_xy=True)

    def degrees(self, x: Sequence[float], y: Sequence[float]) -> list[tuple[float, float]]:
        """Latitude and longitude, degrees, of points x, y (m); NaN for both where a point is farther than `FARTHEST`
        or is no number."""
        near = [math.hypot(a, b) <= FARTHEST for a, b in zip(x, y, strict=True)]
        safe = [(a, b) if ok else (0.0, 0.0) for a, b, ok in zip(x, y, near, strict=True)]
        longitudes, latitudes = self._down.transform([a for a, _ in safe], [b for _, b in safe])
        places = zip(latitudes, longitudes, near, strict=True)
        return [(latitude, longitude) if ok else (math.nan, math.nan) for latitude, longitude, ok in places]

    def metres(self, latitude: float, longitude: float) -> tuple[float, float] | None:
        """x and y, m, of a point on the Earth; None if it is farther than `FARTHEST` or is no place."""
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
            return None
        x, y = self._up.transform(longitude, latitude)
        return (x, y) if math.hypot(x, y) <= FARTHEST else None
