"""The Nomad's server on a page: its robots, windows and world put into the shape that the console shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain

from sleepcast.cli.page import Address
from sleepcast.cli.streams import announce
from sleepcast.clock import Clock
from sleepcast.console import serve_nomads
from sleepcast.errors import MisuseError
from sleepcast.nomad import Nserver, Pace, RobotWindow, Sketch, commands
from sleepcast.nomad.requests import Kind
from sleepcast.nomad.scenery import ERASED, polygon, sketch
from sleepcast.nomad.units import TENTH, TENTH_DEGREE
from sleepcast.robot import Corners

AROUND = 0.6
"""m in sight around everything that there is."""
LEAST = 3.0
"""m in sight from the middle to each side at least, however little there is."""

Area = tuple[float, float, float, float]


class NomadsOnPage:
    """A server of Nomads as the console wants to see it (its `Nomads`)."""

    tenth, degree = TENTH, TENTH_DEGREE

    def __init__(self, nserver: Nserver, pace: Pace, title: str) -> None:
        self._nserver, self._pace, self._world = nserver, pace, nserver.world
        self.title, self.held = title, False
        self.area = area_of(nserver)

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

    def steers(self, robot: int) -> bool:
        """See `SimulatedWorld`."""
        return self._world.steers(robot)

    def radius(self, robot: int) -> float:
        """See `SimulatedWorld`."""
        return self._world.radius(robot)

    def window(self, robot: int) -> RobotWindow:
        """What there is to see of it now, also while time stands still."""
        window = self._nserver.windows.robots[robot]
        window.look(self._nserver.service.behaviours[robot].condition(), self._world.radius(robot))
        return window

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

    def perform(self, robot: int, order: str, numbers: Sequence[int]) -> None:
        """Do what a program's request does. Raises MisuseError."""
        if order in commands():
            self._nserver.perform(robot, order, numbers)
            return
        kind = Kind[order.upper()]
        if kind in ERASED:
            self._nserver.windows.erase(robot, ERASED[kind])
        elif kind in (Kind.DRAW_ROBOT, Kind.DRAW_LINE, Kind.DRAW_ARC):
            self._nserver.windows.sketches.append(sketch(kind, numbers))
        elif kind is Kind.NEW_WORLD:
            self._world.clear()
        else:
            self._change_obstacle(kind, numbers)

    def _change_obstacle(self, kind: Kind, numbers: Sequence[int]) -> None:
        corners = polygon(numbers, more=2 if kind is Kind.MOVE_OBSTACLE else 0)
        if corners is None:
            raise MisuseError("these are not the corners of a polygon")
        if kind is Kind.ADD_OBSTACLE:
            done = self._world.add(corners)
        elif kind is Kind.DELETE_OBSTACLE:
            done = self._world.remove(corners)
        else:
            done = self._world.move(corners, numbers[-2] * TENTH, numbers[-1] * TENTH)
        if not done:
            raise MisuseError("there is no such polygon, or no room for it")

    def say(self, robot: int, text: str) -> None:
        """What a program's `tk` does."""
        self._nserver.windows.robots[robot].said.append((self._world.time, text))

    def click(self, robot: int, x: float, y: float) -> None:
        """Answer a program that waits for a place."""
        self._nserver.click(robot, x, y)

    def hold(self, still: bool) -> None:
        """Keep every robot at rest, or no longer."""
        self.held = still
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

    async def live(self) -> None:
        """Serve programs and let time pass until cancelled, or until a program ends the server."""
        await self._nserver.run(self._pace)


def area_of(nserver: Nserver) -> Area:
    """Everything that there is, and a little around it."""
    world = nserver.world
    robots = [world.observe(robot).real for robot in range(world.count)]
    points = [(pose.x, pose.y) for pose in robots] + list(chain.from_iterable(world.solids()))
    left, right = min((x for x, _ in points), default=0.0), max((x for x, _ in points), default=0.0)
    bottom, top = min((y for _, y in points), default=0.0), max((y for _, y in points), default=0.0)
    across, up = max(LEAST, (right - left) / 2.0 + AROUND), max(LEAST, (top - bottom) / 2.0 + AROUND)
    x, y = (left + right) / 2.0, (bottom + top) / 2.0
    return (x - across, y - up, x + across, y + up)


async def show(
    nserver: Nserver,
    pace: Pace,
    clock: Clock,
    *,
    title: str,
    address: Address,
    say: Callable[[str], None] = announce,
) -> None:
    """Serve the page of a server that listens already, and let its time pass, until Ctrl-C or until a program ends it.

    Raises what the console raises for the address.
    """
    await serve_nomads(
        NomadsOnPage(nserver, pace, title),
        clock,
        host=address.host,
        port=address.port,
        insecure=address.insecure,
        open_browser=address.browser,
        say=say,
    )
