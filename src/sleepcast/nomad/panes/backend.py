"""The desk behind the pages of the Nomads: what can be asked of it, and what it tells unasked.

All pages share one desk. It checks what they ask in words for people, and keeps what they have in common: the solid
things with their version, and the frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import ClassVar

import msgspec

from sleepcast.console.feature import NOT_HERE_AT_ALL
from sleepcast.console.outgoing import (
    DeskMessage,
    Done,
    Hello,
    Obstacles,
    Safety,
    ShownReport,
    ShownValue,
    WatchedRobot,
)
from sleepcast.console.sensing import BodyView
from sleepcast.console.view import Scene
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.tasks import together
from sleepcast.nomad.panes.driver import NomadDriver
from sleepcast.nomad.panes.editor import NomadEditor
from sleepcast.nomad.panes.features.nomad_orders import Click, Perform
from sleepcast.nomad.panes.orders import ORDERS, NomadOrder, check
from sleepcast.nomad.panes.view import Nomads, Saying
from sleepcast.nomad.panes.windows import body_of
from sleepcast.robot import Condition, Pose

MOST_LINES = 100
"""Texts, and commands, of the watched robot that a page shows."""
HELD = "STOP holds: every robot is kept at rest, whatever its program asks."
STORY = "Each robot does what its program asks over the wire, and what you ask here."
WHEELS = ("right", "left", "third")
STEERED = ("way", "steering", "turret")


class NomadKinds(msgspec.Struct, frozen=True):
    """What a page needs of Nomads beside the scene.

    tenth: m of a unit of length in orders.
    degree: rad of a unit of angle.
    steers: whether the axes of each robot are way, direction and turret, and not two wheels.
    orders: that programs, and the page, can give.
    """

    tenth: float
    degree: float
    steers: list[bool]
    orders: list[NomadOrder]


class NomadsBackend:
    """See the module. Its questions raise SleepcastError, with a sentence for the person who asked."""

    recorded: ClassVar[bool] = False
    lacks: ClassVar[str] = NOT_HERE_AT_ALL

    def __init__(self, nomads: Nomads, clock: Clock) -> None:
        self.nomads, self.driver = nomads, NomadDriver(nomads, clock)
        self.editor = NomadEditor(nomads, clock)

    def hello(self) -> Hello:
        """What a page needs first."""
        nomads, obstacles = self.nomads, self._obstacles()
        robots = range(nomads.count)
        scene = Scene(
            nomads.title,
            STORY,
            "robots",
            tuple(str(robot + 1) for robot in robots),
            nomads.area,
            "in",
            tuple((1, nomads.radius(robot)) for robot in robots),
            obstacles=obstacles.obstacles,
            version=obstacles.version,
        )
        steers = [nomads.steers(robot) for robot in robots]
        kinds = NomadKinds(nomads.tenth, nomads.degree, steers, list(ORDERS.values()))
        return Hello(scene, nomads.count, [], nomads=kinds)

    async def live(self) -> None:
        """Serve programs, let time pass and show it, until cancelled or until a program ends the server."""
        await together(self.nomads.live(), self.driver.run())

    # ---- orders

    async def obey(self, asked: Perform) -> Done:
        """Do what a program's request would do."""
        serial, robot, order, numbers, text = asked.serial, asked.robot, asked.order, asked.numbers, asked.text
        self._check_robot(robot)
        known = ORDERS.get(order)
        if known is not None and known.text:
            if not text or numbers:
                raise MisuseError(f"{order} takes words, and no numbers beside them")
            self.nomads.say(robot, text)
            return Done(serial)
        if text:
            raise MisuseError(f"{order} takes numbers, not words")
        given = check(order, numbers, steers=self.nomads.steers(robot))
        return Done(serial, await self.nomads.perform(robot, order, given))

    async def turn(self, robot: int, numbers: list[int]) -> None:
        """Turn the axes this fast; rest where all are 0."""
        self._check_robot(robot)
        order, given = ("vm", check("vm", numbers)) if any(numbers) else ("st", [])
        await self.nomads.perform(robot, order, given)

    def click(self, asked: Click) -> Done:
        """Answer a program that waits for somebody to point at a place."""
        robot = asked.robot
        self._check_robot(robot)
        if not self.nomads.window(robot).waiting:
            raise MisuseError(f"no program waits for a place in the window of robot {robot + 1}")
        self.nomads.click(robot, asked.x, asked.y)
        return Done(asked.serial)

    def sense(self, robot: int) -> BodyView:
        """What the body of the robot with this index senses."""
        self._check_robot(robot)
        body = body_of(self.nomads, robot)
        if body is None:
            raise MisuseError(f"robot {robot + 1} has sensed nothing yet")
        return body

    def _check_robot(self, robot: int) -> None:
        if not 0 <= robot < self.nomads.count:
            raise MisuseError(f"there is no robot {robot + 1}: there are {self.nomads.count}")

    # ---- STOP

    def stop(self, by: str = "") -> None:
        """Stop every body and keep it so."""
        self.nomads.hold(True)
        self.driver.draw()

    def release(self, by: str = "") -> None:
        """End STOP."""
        self.nomads.hold(False)
        self.driver.draw()

    # ---- solid things

    def load(self, name: str, text: str) -> None:
        """Have the obstacles of this text in place of all that there are."""
        self.editor.load(name, text)

    def written(self) -> str:
        """All obstacles as the text of a file."""
        return self.nomads.written()

    def _obstacles(self) -> Obstacles:
        outlines = self.editor.outlines()
        return Obstacles(tuple((outline,) for outline in outlines), self.editor.version)

    # ---- unasked

    def news(self, watched: int) -> Iterator[DeskMessage]:
        """Everything that may have changed; `watched`: the index of the robot that the page looks at, or -1."""
        held = self.nomads.held
        yield Safety(held, HELD if held else "")
        yield self._obstacles()
        if 0 <= watched < self.nomads.count:
            yield self._robot(watched)

    def _robot(self, robot: int) -> WatchedRobot:
        window = self.nomads.window(robot)
        state = [f"held by {window.held}"] if window.held else []
        state.append(f"driven by {window.client}" if window.client else "no program drives it")
        values = [] if window.condition is None else list(self._values(robot, window.condition))
        return WatchedRobot(robot, [], state, values, [], _lines(window.said), _lines(window.commands))

    def _values(self, robot: int, condition: Condition) -> Iterator[ShownValue]:
        """What it knows of itself, in the Nomad's units."""
        steers = self.nomads.steers(robot)
        for kind, pose in (("encoder", condition.believed), ("actual", condition.real)):
            yield from self._place(kind, pose)
        for axis, (name, speed) in enumerate(zip(STEERED if steers else WHEELS, condition.speeds, strict=False)):
            turns = steers and axis > 0
            unit, shown = (self.nomads.degree, "1/10°/s") if turns else (self.nomads.tenth, "1/10 in/s")
            yield ShownValue(f"{name} speed", f"{_whole(speed / unit)} {shown}", "motors")
        yield ShownValue("motion", "moving" if any(condition.moving) else "standing", "motors")
        yield ShownValue("battery", f"{condition.battery:.0%}".replace("%", " %"), "battery")

    def _place(self, kind: str, pose: Pose) -> Iterator[ShownValue]:
        for name, length in (("x", pose.x), ("y", pose.y)):
            yield ShownValue(name, f"{_whole(length / self.nomads.tenth)} 1/10 in", kind)
        for name, angle in (("heading", pose.heading), ("turret", pose.turret)):
            yield ShownValue(name, f"{_whole(angle / self.nomads.degree) % 3600} 1/10°", kind)


def _whole(number: float) -> int:
    """The nearest whole number, 0 for what is not known."""
    return round(number) if number == number else 0


def _lines(row: Sequence[Saying]) -> list[ShownReport]:
    """The latest of a row, the youngest first."""
    return [ShownReport(time, text) for time, text in islice(reversed(row), MOST_LINES)]
