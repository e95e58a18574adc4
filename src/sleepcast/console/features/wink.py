"""A robot that blinks, so that somebody who looks round finds it."""

from __future__ import annotations

from math import inf
from typing import Protocol

from sleepcast.console.feature import answers, only_now
from sleepcast.console.incoming import Index, PageMessage, Serial
from sleepcast.console.outgoing import Sent
from sleepcast.console.view import SwarmView
from sleepcast.core.errors import MisuseError
from sleepcast.station import Station

WINK_SECONDS = 5.0
"""For which a robot blinks: somebody who looks round finds it."""
WINK = (
    "(PROGN (DEFVAR winked) (SETQ winked marked) "
    f"(RULE wink (IF (WITHIN 0s {WINK_SECONDS:g}s) (SETQ marked (< (MOD time 1s) 0.5s)) "
    "(PROGN (SETQ marked winked) (DEACTIVATE wink)))))"
)
"""What a robot is sent that is to blink."""


class Wink(PageMessage):
    """Let a robot blink, so that it is found."""

    serial: Serial
    robot: Index


class WinkSource(Protocol):
    """Robots that can be sent commands. winks: when each was asked to blink, s of the page's time."""

    winks: dict[str, float]

    @property
    def station(self) -> Station: ...
    @property
    def swarm(self) -> SwarmView: ...

    def name_of(self, robot: int) -> str:
        """The name of the robot with this index. Raises MisuseError."""


@answers(then=only_now)
def wink(source: WinkSource, asked: Wink) -> Sent:
    """Let a robot blink by its mark for a few seconds; then the mark is as it was."""
    name, now = source.name_of(asked.robot), source.swarm.now()
    if now - source.winks.get(name, -inf) < WINK_SECONDS + 1.0:
        raise MisuseError(f"{name} blinks already.")
    source.winks[name] = now
    return Sent(asked.serial, source.station.send(WINK, only=[name], confirmed=True).id)
