"""Obstacles that people build, move and clear away in a simulated world while robots are in it.

A thing is known by its index in the list of obstacles and by the version of the world for which that list was made: if
something else has changed meanwhile, it is refused, and never another thing is moved. A change can be undone and done
again while the thing is as that change, or its undoing, left it.
"""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.console.obstacle_log import ObstacleLog, changed_meanwhile
from sleepcast.console.view import ObstacleChange
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Polygon, Shape, Simulator

MAX_THINGS = 2_000
"""Obstacles of a world that people may change: after each change the page is told all of them."""


class WorldEditor:
    """Changes the world of a simulator."""

    def __init__(self, simulator: Simulator) -> None:
        self._world = simulator.world
        self._size = simulator.scenario.width, simulator.scenario.height
        self._log = ObstacleLog[Shape]()

    @property
    def version(self) -> int:
        """Counts the changes."""
        return self._world.version

    def build(self, corners: Sequence[tuple[float, float]]) -> ObstacleChange:
        """Add a polygon with these corners, m. Raises MisuseError for what is none, or lies outside the world."""
        self._room()
        width, height = self._size
        for x, y in corners:
            if not (0.0 <= x <= width and 0.0 <= y <= height):
                raise MisuseError(
                    f"The corner at {x:g} m, {y:g} m lies outside the world of {width:g} m by {height:g} m."
                )
        return self._changed(self._world.add(Polygon(tuple(corners))), None)

    def shift(self, version: int, index: int, dx: float, dy: float) -> ObstacleChange:
        """Move a thing by this vector, m. Raises MisuseError."""
        number = self._number(version, index)
        before = self._world.shapes[number]
        self._world.move(number, dx, dy)
        return self._changed(number, before)

    def clear(self, version: int, index: int) -> ObstacleChange:
        """Take a thing away. Raises MisuseError."""
        number = self._number(version, index)
        before = self._world.shapes[number]
        self._world.remove(number)
        return self._changed(number, before)

    def undo(self, change: int, again: bool) -> None:
        """Undo a change by its number, or (again) do it once more. Raises MisuseError where that is not possible."""
        number, expected, wanted = self._log.find(change, again)
        if self._world.shapes.get(number) != expected:
            raise changed_meanwhile(number)
        if wanted is None:
            self._world.remove(number)
        else:
            if expected is None:
                self._room()
            self._world.put(number, wanted)

    def _changed(self, number: int, before: Shape | None) -> ObstacleChange:
        """Keep how a thing was before a change that has been made, and how it is now."""
        return self._log.keep(number, before, self._world.shapes.get(number))

    def _room(self) -> None:
        if len(self._world.shapes) >= MAX_THINGS:
            raise MisuseError(f"There are {MAX_THINGS:,} obstacles, as many as can be changed here: clear some first.")

    def _number(self, version: int, index: int) -> int:
        numbers = list(self._world.shapes)
        if version != self._world.version or not 0 <= index < len(numbers):
            raise MisuseError("The obstacles have changed meanwhile: choose it again.")
        return numbers[index]


def editor_of(simulator: Simulator) -> WorldEditor | None:
    """What changes this world; None where its robots feel no obstacles, or there are too many of these."""
    feels = any(sort.ring is not None or sort.bumpers or sort.flight for sort in simulator.scenario.each_type)
    return WorldEditor(simulator) if feels and len(simulator.world.shapes) <= MAX_THINGS else None
