"""The desk behind the pages of the Nomads: what can be asked of it, and what it tells unasked.

All pages share one desk. It checks what they ask in words for people, and keeps what they have in common: the solid
things with their version, and how fast time really goes.
"""

from __future__ import annotations

from collections import deque

import msgspec

from sleepcast.console.nomads.orders import ORDERS, NomadOrder, check
from sleepcast.console.nomads.updates import FASTEST
from sleepcast.console.nomads.view import Nomads
from sleepcast.console.outgoing import Said
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.robot import Corners

GRID = 240
"""The grid of the World window in tenths of inches: two feet."""
MEASURED = 1.5
"""Seconds of which the page says how fast time really goes."""
LOOK_AGAIN = 0.25
"""Seconds for which a look at all solid things is good."""
REAL_TIME = 1.0
HELD = "STOP holds: every robot is kept at rest, whatever its program asks."


class RobotKind(msgspec.Struct):
    """What does not change of a robot. name: its number on the wire. radius: m."""

    name: str
    steers: bool
    radius: float


class Hello(Said):
    """The first words. tenth: m of a unit of length in orders; degree: rad of a unit of angle; grid: m."""

    title: str
    tenth: float
    degree: float
    grid: float
    area: tuple[float, float, float, float]
    robots: list[RobotKind]
    orders: list[NomadOrder]


class Solids(Said):
    """Everything solid: corners of polygons, m."""

    version: int
    solids: list[list[tuple[float, float]]]


class Safety(Said):
    """Whether STOP holds, in words."""

    latched: bool
    sentence: str


class Done(Said):
    """It was done. note: what there is to say of it, in words for a person."""

    serial: int
    note: str = ""


class World(Said):
    """All polygons as the text of a file."""

    serial: int
    text: str


class NomadsBackend:
    """See the module. Its questions raise SleepcastError, with a sentence for the person who asked."""

    def __init__(self, nomads: Nomads, clock: Clock) -> None:
        self.nomads = nomads
        self._clock = clock
        self._wanted = nomads.speed or REAL_TIME
        self._times = deque([(clock.now(), nomads.time)])
        self._solids = Solids(0, [])
        self._looked = -LOOK_AGAIN

    def hello(self) -> Hello:
        """What a page needs first."""
        nomads = self.nomads
        robots = [
            RobotKind(str(robot + 1), nomads.steers(robot), nomads.radius(robot)) for robot in range(nomads.count)
        ]
        return Hello(
            nomads.title,
            nomads.tenth,
            nomads.degree,
            GRID * nomads.tenth,
            nomads.area,
            robots,
            list(ORDERS.values()),
        )

    # ---- time

    def set_pace(self, running: bool | None, factor: float | None) -> None:
        """Change whether time runs and how fast; None leaves it as it is."""
        if factor is not None:
            self._wanted = float("inf") if factor >= FASTEST else factor
        runs = self.nomads.speed > 0.0 if running is None else running
        self.nomads.set_speed(self._wanted if runs else 0.0)

    def step(self) -> None:
        """One tick, and time stands still."""
        self.set_pace(False, None)
        self.nomads.step()

    def paces(self) -> tuple[float, float]:
        """Simulated seconds in a second: wanted, and reached in the last moments."""
        now = (self._clock.now(), self.nomads.time)
        while len(self._times) > 1 and now[0] - self._times[1][0] > MEASURED:
            self._times.popleft()
        began = self._times[0]
        if now[0] - self._times[-1][0] > MEASURED / 10:
            self._times.append(now)
        passed = now[0] - began[0]
        return min(self._wanted, FASTEST), (now[1] - began[1]) / passed if passed > 0.0 else 0.0

    # ---- orders

    async def perform(self, robot: int, order: str, numbers: list[int], text: str) -> str:
        """What a program's request would do, and what there is to say of it."""
        self._check_robot(robot)
        known = ORDERS.get(order)
        if known is not None and known.text:
            if not text or numbers:
                raise MisuseError(f"{order} takes words, and no numbers beside them")
            self.nomads.say(robot, text)
            return ""
        if text:
            raise MisuseError(f"{order} takes numbers, not words")
        return await self.nomads.perform(robot, order, check(order, numbers, steers=self.nomads.steers(robot)))

    async def drive(self, robot: int, numbers: list[int]) -> str:
        """Turn the axes this fast; rest where all are 0."""
        self._check_robot(robot)
        order, given = ("vm", check("vm", numbers)) if any(numbers) else ("st", [])
        return await self.nomads.perform(robot, order, given)

    def click(self, robot: int, x: float, y: float) -> None:
        """Answer a program that waits for somebody to point at a place."""
        self._check_robot(robot)
        if not self.nomads.window(robot).waiting:
            raise MisuseError(f"no program waits for a place in the window of robot {robot + 1}")
        self.nomads.click(robot, x, y)

    def _check_robot(self, robot: int) -> None:
        if robot >= self.nomads.count:
            raise MisuseError(f"there is no robot {robot + 1}: there are {self.nomads.count}")

    # ---- STOP

    def hold(self, still: bool) -> None:
        """Stop every body and keep it so, or let go."""
        self.nomads.hold(still)

    def safety(self) -> Safety:
        """Whether STOP holds."""
        held = self.nomads.held
        return Safety(held, HELD if held else "")

    # ---- solid things

    def solids(self) -> Solids:
        """Everything solid, looked at anew now and then; the version grows when something has changed."""
        now = self._clock.now()
        if now - self._looked >= LOOK_AGAIN:
            self._looked = now
            found = [[(x, y) for x, y in corners] for corners in self.nomads.solids()]
            if found != self._solids.solids:
                self._solids = Solids(self._solids.version + 1, found)
        return self._solids

    def build(self, corners: Corners) -> None:
        """Put up a polygon."""
        self._changed(self.nomads.add(corners), "this cannot be put up: it encloses nothing, or the world is full")

    def shift(self, version: int, solid: int, across: float, up: float) -> None:
        """Move a polygon, by its place among those of this version, by so many m."""
        self._changed(self.nomads.move(self._solid(version, solid), across, up), "this one cannot be moved there")

    def clear(self, version: int, solid: int) -> None:
        """Take a polygon away, by its place among those of this version."""
        self._changed(self.nomads.remove(self._solid(version, solid)), "this one cannot be taken away")

    def load(self, name: str, text: str) -> None:
        """Have the polygons of this text in place of all that there are."""
        self.nomads.load(name, text)
        self._looked = -LOOK_AGAIN

    def _solid(self, version: int, place: int) -> Corners:
        if version != self._solids.version or place >= len(self._solids.solids):
            raise MisuseError("the obstacles have changed in the meantime: look again")
        return self._solids.solids[place]

    def _changed(self, done: bool, otherwise: str) -> None:
        if not done:
            raise MisuseError(otherwise)
        self._looked = -LOOK_AGAIN
