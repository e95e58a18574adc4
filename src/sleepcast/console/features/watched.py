"""The robot that a page looks at, whose news it is told."""

from __future__ import annotations

from typing import Protocol

from sleepcast.console.feature import answers
from sleepcast.console.incoming import Index, PageMessage


class Watch(PageMessage):
    """Tell me of this robot (by its index; -1: of none)."""

    robot: Index


class WatchingPage(Protocol):
    """A page that is told of one robot."""

    def watch(self, robot: int) -> None:
        """Look at this robot; -1: at none."""


@answers()
def watch(source: WatchingPage, asked: Watch) -> None:
    """Look at a robot, and forget what was told of it."""
    source.watch(asked.robot)
