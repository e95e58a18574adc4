"""The changes of obstacles that people made here, so that they can be undone and done again."""

from __future__ import annotations

from typing import Generic, TypeVar

from sleepcast.console.view import ObstacleChange
from sleepcast.core.errors import MisuseError

MAX_CHANGES = 200
"""Changes that can be undone; of earlier ones nothing is kept."""

Thing = TypeVar("Thing")


class ObstacleLog(Generic[Thing]):
    """How each thing was before and after a change; None where it did not stand."""

    def __init__(self) -> None:
        self._changes: dict[int, tuple[int, Thing | None, Thing | None]] = {}
        self._last = 0

    def keep(self, number: int, before: Thing | None, after: Thing | None) -> ObstacleChange:
        """Keep a change that has been made to the thing of this number."""
        self._last += 1
        self._changes[self._last] = number, before, after
        self._changes.pop(self._last - MAX_CHANGES, None)
        return ObstacleChange(self._last, number)

    def find(self, change: int, again: bool) -> tuple[int, Thing | None, Thing | None]:
        """The number of the thing that a change was made to, how the thing must be now, and how it is to become, if the
        change is undone or (again) done once more. Raises MisuseError."""
        if change not in self._changes:
            raise MisuseError(f"Only the last {MAX_CHANGES} changes of obstacles can be undone.")
        number, before, after = self._changes[change]
        return (number, before, after) if again else (number, after, before)


def changed_meanwhile(number: int) -> MisuseError:
    """That a thing is not any more as the change left it that is to be undone."""
    return MisuseError(f"Obstacle {number} has been changed by somebody else meanwhile.")
