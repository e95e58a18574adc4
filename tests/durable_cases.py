"""Stored, then answered: what every robot says and still knows after a restart, whatever its disk does. The same steps
are taken by minds in bodies, by swarms, and by small computers with other code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from sleepcast.channel.message import NOT_STORED


class Do(StrEnum):
    """What happens to a robot."""

    STOP = "stop"
    RELEASE = "release"
    KEYS = "a change of keys"
    REFUSE = "its disk refuses from now on"
    MEND = "its disk writes again"
    RESTART = "it is killed, and starts again"


@dataclass(frozen=True)
class Step:
    """One of those, and what must come of it. outcome: of the answer; stored: whether it says so; stopped: whether the
    robot is, after a restart."""

    do: Do
    outcome: str = ""
    stored: bool = True
    stopped: bool = False


STEPS: Sequence[Step] = (
    Step(Do.STOP, "stopped"),
    Step(Do.RESTART, stopped=True),
    Step(Do.RELEASE, "released"),
    Step(Do.RESTART, stopped=False),
    Step(Do.KEYS, "matched"),
    Step(Do.REFUSE),
    Step(Do.STOP, "stopped", stored=False),
    Step(Do.STOP, "stopped", stored=False),
    Step(Do.KEYS, "matched", stored=False),
    Step(Do.MEND),
    Step(Do.STOP, "stopped"),
    Step(Do.RESTART, stopped=True),
    Step(Do.REFUSE),
    Step(Do.RELEASE, "released", stored=False),
    Step(Do.MEND),
    Step(Do.RESTART, stopped=True),
    Step(Do.RELEASE, "released"),
    Step(Do.RESTART, stopped=False),
)


class Subject(Protocol):
    """A robot to which this is done."""

    def say(self, do: Do) -> tuple[object, object]:
        """Say this to it; the outcome and the fault of its answer."""

    def refuse(self) -> None:
        """Let its disk refuse."""

    def mend(self) -> None:
        """Let its disk write again."""

    def restart(self) -> bool:
        """Kill it, and start it again; whether it is stopped."""


def try_all(robot: Subject) -> None:
    """Take all steps."""
    for number, step in enumerate(STEPS):
        where = f"step {number}: {step.do}"
        if step.do is Do.REFUSE:
            robot.refuse()
        elif step.do is Do.MEND:
            robot.mend()
        elif step.do is Do.RESTART:
            assert robot.restart() is step.stopped, where
        else:
            outcome, fault = robot.say(step.do)
            assert outcome == step.outcome, where
            assert fault is None if step.stored else str(fault).endswith(NOT_STORED), f"{where}: {fault}"
