"""Obstacles that people build, move and clear away in a simulated world while robots are in it.

A thing is known by its place in the list of obstacles and by the version of the world for which that list was made: if
something else has changed meanwhile, it is refused, and never another thing is moved.
"""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Polygon, Simulator

MAX_THINGS = 2_000
"""Obstacles of a world that people may change: after each change the page is told all of them."""


class WorldEditor:
    """Changes the world of a simulator."""

    def __init__(self, simulator: Simulator) -> None:
        self._world = simulator.world
        self._size = simulator.scenario.width, simulator.scenario.height

    @property
    def version(self) -> int:
        """Counts the changes."""
        return self._world.version

    def build(self, corners: Sequence[tuple[float, float]]) -> None:
        """Add a polygon with these corners, m. Raises MisuseError for what is none, or lies outside the world."""
        if len(self._world.shapes) >= MAX_THINGS:
            raise MisuseError(f"There are {MAX_THINGS:,} obstacles, as many as can be changed here: clear some first.")
        self._within(corners)
        self._world.add(Polygon(tuple(corners)))

    def shift(self, version: int, place: int, across: float, up: float) -> None:
        """Move a thing by this vector, m. Raises MisuseError."""
        self._world.move(self._number(version, place), across, up)

    def clear(self, version: int, place: int) -> None:
        """Take a thing away. Raises MisuseError."""
        self._world.remove(self._number(version, place))

    def _within(self, corners: Sequence[tuple[float, float]]) -> None:
        width, height = self._size
        for x, y in corners:
            if not (0.0 <= x <= width and 0.0 <= y <= height):
                raise MisuseError(
                    f"The corner at {x:g} m, {y:g} m lies outside the world of {width:g} m by {height:g} m."
                )

    def _number(self, version: int, place: int) -> int:
        numbers = list(self._world.shapes)
        if version != self._world.version or not 0 <= place < len(numbers):
            raise MisuseError("The obstacles have changed meanwhile: choose it again.")
        return numbers[place]


def editor_of(simulator: Simulator) -> WorldEditor | None:
    """What changes this world; None where its robots feel no obstacles, or there are too many of these."""
    feels = any(sort.ring is not None or sort.bumpers for sort in simulator.scenario.each_sort)
    return WorldEditor(simulator) if feels and len(simulator.world.shapes) <= MAX_THINGS else None
