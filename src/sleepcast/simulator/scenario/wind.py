"""The air of a world: the table [wind], which pushes what flies."""

from __future__ import annotations

from math import hypot, sqrt

from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table
from sleepcast.core.units import LENGTH, SPEED
from sleepcast.simulator.scenario.fields import VectorField, read_flow
from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_WORLD

FASTEST_WIND = 200.0
"""m/s: faster than any wind near the ground but a tornado's."""
GUST_SIZE = 20.0
"""m."""


@dataclass(frozen=True, slots=True)
class WindSpec:
    """How the air moves over the ground.

    flow: the mean wind, m/s
    gusts: by how much it differs at most from place to place, to the east and to the north each, m/s
    gust_size: m from one gust to the next; they come with the uniform part of the flow
    downwash: whether those that fly push down who is below them
    """

    flow: VectorField
    gusts: float = 0.0
    gust_size: float = GUST_SIZE
    downwash: bool = False

    @property
    def fastest(self) -> float:
        """m/s: no air of it is faster."""
        return hypot(*self.flow.uniform) + sum(abs(each.peak) for each in self.flow.swirls) + sqrt(2.0) * self.gusts


def read_wind(root: Table, size: tuple[float, float], *, flies: bool) -> WindSpec | None:
    """The table [wind], None without one. size: of the world, m. Raises SettingsError where nothing flies, for gusts
    that no wind carries along, and for a wind that is too fast."""
    if not root.has("wind"):
        return None
    if not flies:
        raise root.error("wind", "it pushes only robots that fly: give them a table flight, or leave this out")
    with root.table("wind") as table:
        spec = WindSpec(
            flow=read_flow(table, "wind", "m/s", size),
            gusts=table.number("gusts", SPEED, 0.0, low=0.0, high=FASTEST_WIND),
            gust_size=table.number("gust_size", LENGTH, GUST_SIZE, low=LEAST, high=MAX_WORLD),
            downwash=table.flag("downwash", False),
        )
        if spec.gusts and not any(spec.flow.uniform):
            raise table.error("gusts", "gusts come with the wind: give it a uniform part")
        if spec.fastest > FASTEST_WIND:
            raise root.error("wind", f"up to {spec.fastest:g} m/s; at most {FASTEST_WIND:g} are possible")
        return spec
