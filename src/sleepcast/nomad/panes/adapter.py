"""A Nomad server, its robots, windows and world, as its page shows them."""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.core.errors import MisuseError
from sleepcast.nomad.server.connection import PAGE
from sleepcast.nomad.server.nserver import Nserver, ServerPace
from sleepcast.nomad.server.windows import RobotWindow, Sketch
from sleepcast.nomad.wire.state import in_words
from sleepcast.nomad.wire.units import TENTH, TENTH_DEGREE
from sleepcast.nomad.world.sites import read_polygons, write_polygons
from sleepcast.robot import Corners

ASKING = ("gs", "ws")
"""Orders of which a person wants to see the reply."""
Area = tuple[float, float, float, float]


class NomadsAdapter:
    """A server of Nomads as the console wants to see it (its `Nomads`)."""

    tenth, degree = TENTH, TENTH_DEGREE

    def __init__(self, nserver: Nserver, pace: ServerPace, title: str, area: Area) -> None:
        self._nserver, self._pace, self._world = nserver, pace, nserver.world
        self.title, self.area = title, area

    @property
    def count(self) -> int:
        """How many robots there are."""
        return self._world.count

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._world.time

    @property
    def speed(self) -> float:
        """Simulated seconds in a second that are wanted."""
        return self._pace.speed

    @property
    def held(self) -> bool:
        """Whether every robot is kept at rest."""
        return self._nserver.held

    def steers(self, robot: int) -> bool:
        """See `SimulatedWorld`."""
        return self._world.steers(robot)

    def radius(self, robot: int) -> float:
        """See `SimulatedWorld`."""
        return self._world.radius(robot)

    def window(self, robot: int) -> RobotWindow:
        """What there is to see of it now, also while time stands still."""
        self._nserver.service.simulated_robots[robot].glance()
        return self._nserver.windows.robots[robot]

    def sketches(self) -> Sequence[Sketch]:
        """What programs have drawn."""
        return self._nserver.windows.sketches

    def solids(self) -> Sequence[Corners]:
        """See `SimulatedWorld`."""
        return self._world.solids()

    # ---- what the page asks

    def set_speed(self, speed: float) -> None:
        """As fast as this from now on."""
        self._pace.speed = speed

    def step(self) -> None:
        """Let one tick pass."""
        self._nserver.step()

    async def perform(self, robot: int, order: str, numbers: Sequence[int]) -> str:
        """Do what a program's request does, until it is done. Raises MisuseError."""
        state = await self._nserver.perform(robot, order, numbers)
        if order in ASKING:
            return in_words(state)
        rivals = self.window(robot).rivals
        return f"It is driven by {rivals}: each replaces what the other asks." if PAGE in rivals else ""

    def say(self, robot: int, text: str) -> None:
        """What a program's `tk` does."""
        self._nserver.windows.robots[robot].said.append((self._world.time, text))

    def click(self, robot: int, x: float, y: float) -> None:
        """Answer a program that waits for a place."""
        self._nserver.click(robot, x, y)

    def hold(self, still: bool) -> None:
        """Keep every robot at rest, or no longer."""
        self._nserver.hold(still)

    def add(self, corners: Corners) -> bool:
        """See `SimulatedWorld`."""
        return self._world.add(corners)

    def remove(self, corners: Corners) -> bool:
        """See `SimulatedWorld`."""
        return self._world.remove(corners)

    def move(self, corners: Corners, across: float, up: float) -> bool:
        """See `SimulatedWorld`."""
        return self._world.move(corners, across, up)

    def load(self, name: str, text: str) -> None:
        """Have the world of this text. Raises SleepcastError."""
        polygons = list(read_polygons(name, text))
        if not self._world.fill(polygons):
            many = f"{name}: its {len(polygons)} polygons are too many for a running server, or one of them has no area"
            raise MisuseError(f"{many}; the command `sleepcast nserver FILE` takes more")

    def written(self) -> str:
        """The world as a text that can be loaded."""
        return write_polygons(self.title, self._world.solids())

    async def live(self) -> None:
        """Serve programs and let time pass until cancelled, or until a program ends the server."""
        await self._nserver.run(self._pace)
