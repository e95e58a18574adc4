"""Robots that a person adds to a run whose scenario has room for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Protocol

from msgspec import Meta

from sleepcast.console.driver import Driver
from sleepcast.console.feature import NO_ROBOTS, answers, only_now
from sleepcast.console.incoming import Metres, PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage

FULL = "No robots can be added to this run: a table of robots in its scenario says most = ... for that."


class AddRobot(PageMessage):
    """Add a robot of this type at x, y, m; without a place where one of its table may start."""

    serial: Serial
    kind: Annotated[str, Meta(max_length=64)]
    x: Metres | None = None
    y: Metres | None = None


class RobotAdded(DeskMessage):
    """A robot of this name is there now."""

    serial: int
    robot: str


class ArrivalSource(Protocol):
    """A run to which robots may be added. add_robot: adds one of a type at x, y, m, None for by chance, and gives its
    name. Raises MisuseError where there is no room."""

    @property
    def add_robot(self) -> Callable[[str, float | None, float | None], str]: ...
    @property
    def driver(self) -> Driver: ...


@answers(then=only_now, lacking=FULL, recording=NO_ROBOTS)
def add(source: ArrivalSource, asked: AddRobot) -> RobotAdded:
    """Add a robot, which is seen at once, also while time stands still."""
    name = source.add_robot(asked.kind, asked.x, asked.y)
    source.driver.draw()
    return RobotAdded(asked.serial, name)
