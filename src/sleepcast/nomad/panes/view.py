"""What the page shows of Nomads, and what it asks.

The console knows no wire and no simulator. The roof gives it something with these few members: simulated robots, by
their index from 0, with what their windows show (see `server.windows`). SI units in the world's frame, but for the
numbers of an order, which are the Nomad's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from sleepcast.nomad.server.windows import RobotWindow, Sketch
from sleepcast.robot import Corners

Saying = tuple[float, str]
"""When, in simulated seconds, and what."""


class Nomads(Protocol):
    """Robots that programs drive, and the solid things around them.

    title: what the page calls it.
    count: of the robots.
    tenth: m of one unit of the Nomad's lengths.
    degree: rad of one unit of its angles.
    area: the world's edge, least x, least y, greatest x, greatest y.
    speed: simulated seconds in a second that are wanted, 0 while time stands still, infinite for as fast as possible.
    held: whether every body is kept at rest, whatever is asked.

    Raises SleepcastError for what cannot be done, IndexError for a robot that there is not.
    """

    @property
    def title(self) -> str: ...
    @property
    def count(self) -> int: ...
    @property
    def tenth(self) -> float: ...
    @property
    def degree(self) -> float: ...
    @property
    def area(self) -> tuple[float, float, float, float]: ...
    @property
    def time(self) -> float: ...
    @property
    def speed(self) -> float: ...
    @property
    def held(self) -> bool: ...

    def steers(self, robot: int) -> bool:
        """Whether its axes are way, direction and turret, and not two wheels."""

    def radius(self, robot: int) -> float:
        """Of its body, m."""

    def window(self, robot: int) -> RobotWindow: ...

    def sketches(self) -> Sequence[Sketch]:
        """What programs have drawn, unless it was erased."""

    def solids(self) -> Sequence[Corners]:
        """The polygons that there are now."""

    def set_speed(self, speed: float) -> None: ...

    def step(self) -> None:
        """Let one tick pass."""

    async def perform(self, robot: int, order: str, numbers: Sequence[int]) -> str:
        """What a program's request of this name does, until it is done; gives what there is to say of it."""

    def say(self, robot: int, text: str) -> None:
        """What a program's `tk` does."""

    def click(self, robot: int, x: float, y: float) -> None:
        """A person points at a place."""

    def hold(self, still: bool) -> None:
        """Keep every body at rest from now on, or no longer."""

    def add(self, corners: Corners) -> bool:
        """Put up a polygon; False if there is no room for more or that is none."""

    def remove(self, corners: Corners) -> bool:
        """Take the polygon with these corners away; False if there is none that can be taken."""

    def move(self, corners: Corners, across: float, up: float) -> bool:
        """Move the polygon with these corners by so many m; False if there is none that can be moved."""

    def load(self, name: str, text: str) -> None:
        """Have the polygons of this text in place of all that there are. name: of the file that has it."""

    def written(self) -> str:
        """All polygons as a text that can be loaded."""

    async def live(self) -> None:
        """Serve programs and let time pass until cancelled."""
