"""What the body of a robot senses, for the map's layers."""

from __future__ import annotations

from typing import Protocol

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import Index, PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.sensing import BodyView


class Sense(PageMessage):
    """What the body of a robot (by its index) senses now."""

    serial: Serial
    robot: Index


class Sensed(DeskMessage):
    """What the body of a robot senses."""

    serial: int
    robot: int
    body: BodyView


class SenseSource(Protocol):
    """Robots with bodies."""

    def sense(self, robot: int) -> BodyView:
        """What the body of the robot with this index senses. Raises MisuseError where nobody knows."""


@answers(then=run_again)
def sense(source: SenseSource, asked: Sense) -> Sensed:
    """What a robot's body senses."""
    return Sensed(asked.serial, asked.robot, source.sense(asked.robot))
