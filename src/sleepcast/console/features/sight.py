"""What a robot sees, and what hides the rest from it, for a layer of the map."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, Protocol

import msgspec

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import Index, PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.view import Outline, Scene
from sleepcast.core.errors import MisuseError

MAX_SIGHT_LINES = 256
"""Lines of each sense, to what is nearest: more would only be a fog."""
Sense = Literal["neighbours", "pings", "lights"]


class Sight(PageMessage):
    """What a robot (by its index) sees now."""

    serial: Serial
    robot: Index


class SightLine(msgspec.Struct, frozen=True):
    """A line from a robot to something in the reach of one of its senses.

    sense: which
    robot: the index of the robot at its end, -1 for a light
    x, y: its end, m; on a torus it may lie outside of the world
    stop: where on the way the first thing lies that hides the end, x and y in m; None if it is seen
    """

    sense: Sense
    robot: int
    x: float
    y: float
    stop: tuple[float, float] | None


class SightView(msgspec.Struct, frozen=True):
    """What a robot at x, y (m) sees.

    lines: to what is in reach
    area: corners of what it overlooks between walls, as far as the farthest of its senses reaches that walls hide
        things from; empty where walls hide nothing
    scan: where the beams of its scanner have met something, m; empty where there is none, or nobody knows
    """

    x: float
    y: float
    lines: tuple[SightLine, ...]
    area: Outline
    scan: Outline = ()


class Seen(DeskMessage):
    """What a robot sees."""

    serial: int
    robot: int
    sight: SightView


class SightSource(Protocol):
    """Robots in a world. sight: what the robot with this index sees."""

    @property
    def scene(self) -> Scene: ...
    @property
    def sight(self) -> Callable[[int], SightView] | None: ...


@answers(then=run_again)
def sight(source: SightSource, asked: Sight) -> Seen:
    """What a robot sees. Raises MisuseError if there is no such robot."""
    count = len(source.scene.names)
    if asked.robot >= count:
        raise MisuseError(f"there is no robot number {asked.robot}: they are numbered from 0 to {count - 1}")
    assert source.sight is not None  # else the question was refused
    return Seen(asked.serial, asked.robot, source.sight(asked.robot))
