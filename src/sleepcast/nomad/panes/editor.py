"""Obstacles of the Nomads' world that people put up, move, take away, load and save while robots are in it.

A thing is known by its place in the list of obstacles and by the version for which that list was made: if something
else has changed meanwhile, it is refused, and never another thing is moved. Programs change obstacles, too.
"""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.console.obstacle_log import ObstacleLog, changed_meanwhile
from sleepcast.console.view import ObstacleChange, Outline
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.panes.features.nomad_orders import FARTHEST
from sleepcast.nomad.panes.view import Nomads

LOOK_AGAIN = 0.25
"""Seconds for which a look at all solid things is good."""


class NomadEditor:
    """See the module. An `ObstacleEditor`."""

    def __init__(self, nomads: Nomads, clock: Clock) -> None:
        self._nomads, self._clock = nomads, clock
        self._outlines: list[Outline] = []
        self._version = 0
        self._looked = -LOOK_AGAIN
        self._log = ObstacleLog[Outline]()
        self._numbers: dict[Outline, int] = {}
        """Of things that were changed from here, as they are now."""
        self._things = 0

    @property
    def version(self) -> int:
        """Counts the changes."""
        self.outlines()
        return self._version

    def outlines(self) -> list[Outline]:
        """Everything solid, looked at anew now and then."""
        now = self._clock.now()
        if now - self._looked >= LOOK_AGAIN:
            self._looked = now
            outlines = self._solids()
            if outlines != self._outlines:
                self._outlines, self._version = outlines, self._version + 1
        return self._outlines

    def build(self, corners: Sequence[tuple[float, float]]) -> ObstacleChange:
        """Put up a polygon with these corners, m. Raises MisuseError."""
        if any(abs(each) > FARTHEST for corner in corners for each in corner):
            raise MisuseError("This cannot be put up: it lies too far away.")
        before = self._solids()
        if not self._nomads.add(corners):
            raise MisuseError("This cannot be put up: it encloses nothing, or the world is full.")
        return self._changed(None, self._new(before))

    def shift(self, version: int, place: int, across: float, up: float) -> ObstacleChange:
        """Move a thing by this vector, m. Raises MisuseError."""
        outline, before = self._outline(version, place), self._solids()
        if max(abs(across), abs(up)) > FARTHEST or not self._nomads.move(outline, across, up):
            raise MisuseError("This one cannot be moved there.")
        return self._changed(outline, self._new(before) or outline)

    def clear(self, version: int, place: int) -> ObstacleChange:
        """Take a thing away. Raises MisuseError."""
        outline = self._outline(version, place)
        if not self._nomads.remove(outline):
            raise MisuseError("This one cannot be taken away.")
        return self._changed(outline, None)

    def undo(self, change: int, again: bool) -> None:
        """Undo a change by its number, or (again) do it once more. Raises MisuseError where that is not possible."""
        number, expected, wanted = self._log.find(change, again)
        there = self._solids()
        if (expected is not None and expected not in there) or (wanted is not None and wanted in there):
            raise changed_meanwhile(number)
        if wanted is not None and not self._nomads.add(wanted):
            raise MisuseError("This cannot be put up: the world is full.")
        if expected is not None:
            self._nomads.remove(expected)
        self._renumber(number, expected, wanted)

    def load(self, name: str, text: str) -> None:
        """Have the polygons of this text in place of all that there are. Raises MisuseError."""
        self._nomads.load(name, text)
        self._looked = -LOOK_AGAIN

    def _solids(self) -> list[Outline]:
        return [tuple((x, y) for x, y in corners) for corners in self._nomads.solids()]

    def _new(self, before: list[Outline]) -> Outline | None:
        """What was not there before."""
        known = set(before)
        return next((outline for outline in self._solids() if outline not in known), None)

    def _outline(self, version: int, place: int) -> Outline:
        if version != self._version or not 0 <= place < len(self._outlines):
            raise MisuseError("The obstacles have changed meanwhile: choose it again.")
        return self._outlines[place]

    def _changed(self, before: Outline | None, after: Outline | None) -> ObstacleChange:
        """Keep how a thing was before a change that has been made, and how it is now."""
        number = self._numbers.get(before, 0) if before is not None else 0
        if not number:
            self._things += 1
            number = self._things
        self._renumber(number, before, after)
        return self._log.keep(number, before, after)

    def _renumber(self, number: int, before: Outline | None, after: Outline | None) -> None:
        if before is not None:
            self._numbers.pop(before, None)
        if after is not None:
            self._numbers[after] = number
        self._looked = -LOOK_AGAIN
