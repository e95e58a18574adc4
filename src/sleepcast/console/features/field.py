"""Maps of the fields of a world, for a page that asks for them: drawn only then, and never too often."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Annotated, Protocol

import msgspec
from msgspec import Meta

from sleepcast.console.feature import Then, answers
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.view import FieldPicture, Scene, ShownField
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError

AGAIN = 0.25
"""Seconds for which all pages are given the same map, however fast time passes."""


class Field(PageMessage):
    """A map of a field, by its name."""

    serial: Serial
    name: Annotated[str, Meta(max_length=64)]


class Fielded(DeskMessage):
    """A field as it was in a tick."""

    serial: int
    field: str
    tick: int
    picture: FieldPicture


class FieldSource(Protocol):
    """A world that may have fields."""

    @property
    def scene(self) -> Scene: ...

    def field(self, asked: Field) -> Fielded | Awaitable[msgspec.Raw]:
        """The map of a field that there is. Raises SleepcastError where it cannot be drawn."""


def _field_then(source: FieldSource, asked: Field, then: Then) -> Awaitable[msgspec.Raw] | None:
    """A field that does not grow is as it is now."""
    return then.again(asked) if field_of(source.scene, asked.name).grows else None


@answers(then=_field_then)
def field(source: FieldSource, asked: Field) -> Fielded | Awaitable[msgspec.Raw]:
    """The map of a field. Raises MisuseError if there is no such field."""
    field_of(source.scene, asked.name)
    return source.field(asked)


def field_of(scene: Scene, name: str) -> ShownField:
    """The field of a scene by its name. Raises MisuseError."""
    for field in scene.fields:
        if field.name == name:
            return field
    raise MisuseError(f'There is no field "{name:.40}" in this world.')


class FieldMaps:
    """See the module. draw: gives the map of a field as it is now."""

    def __init__(self, draw: Callable[[str], FieldPicture], clock: Clock) -> None:
        self._draw, self._clock = draw, clock
        self._drawn: dict[str, tuple[float, int, FieldPicture]] = {}
        """Of each field the latest map, when it was drawn, and of which tick it is."""

    def answer(self, asked: Field, tick: int) -> Fielded:
        """The map of a field, which is now in this tick."""
        name = asked.name
        now = self._clock.now()
        at, drawn, picture = self._drawn.get(name, (now, -1, None))
        if picture is None or (drawn != tick and not 0.0 < now - at < AGAIN):  # where no time passes, ticks count
            at, drawn, picture = self._drawn[name] = now, tick, self._draw(name)
        return Fielded(asked.serial, name, drawn, picture)
