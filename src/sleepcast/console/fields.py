"""Maps of the fields of a world, for a page that asks for them: drawn only then, and never too often."""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.console.outgoing import Fielded
from sleepcast.console.view import FieldPicture, Scene, ShownField
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError

AGAIN = 0.25
"""Seconds for which all pages are given the same map, however fast time passes."""


def field_of(scene: Scene, name: str) -> ShownField:
    """The field of a scene by its name. Raises MisuseError."""
    found = next((field for field in scene.fields if field.name == name), None)
    if found is None:
        raise MisuseError(f'There is no field "{name:.40}" in this world.')
    return found


class FieldMaps:
    """See the module. draw: gives the map of a field as it is now."""

    def __init__(self, draw: Callable[[str], FieldPicture], clock: Clock) -> None:
        self._draw, self._clock = draw, clock
        self._drawn: dict[str, tuple[float, int, FieldPicture]] = {}
        """Of each field the latest map, when it was drawn, and of which tick it is."""

    def answer(self, serial: int, name: str, tick: int) -> Fielded:
        """The map of a field, which is now in this tick."""
        now = self._clock.now()
        at, drawn, picture = self._drawn.get(name, (now, -1, None))
        if picture is None or (drawn != tick and not 0.0 < now - at < AGAIN):  # where no time passes, ticks count
            at, drawn, picture = self._drawn[name] = now, tick, self._draw(name)
        return Fielded(serial, name, drawn, picture)
