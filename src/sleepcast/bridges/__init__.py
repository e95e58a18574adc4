"""Bridges to bodies: `open_robot` finds the right one by the scheme of its URI, and gives a `Robot` with an end.

Schemes are entry points in the group `sleepcast.bodies`, those of sleepcast itself and those of installed packages
alike: a scheme, and what opens such a body, `open(uri, opening)`. What it gives derives from `BridgedBody`, which has
the watchdog, the limits and STOP; a body that does not is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from types import TracebackType
from typing import Protocol, Self, cast

from sleepcast.bridges.address import BodyAddress, BodyError, read_body_address
from sleepcast.bridges.body import REST, BridgedBody, BusyError, Motion
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.extensions import BODIES, extensions, find_extension, load_extension
from sleepcast.core.records import dataclass
from sleepcast.robot import Limits, OutOfReachError, Robot

__all__ = [
    "REST",
    "BodyAddress",
    "BodyError",
    "BridgedBody",
    "BusyError",
    "Motion",
    "Opening",
    "OutOfReachError",
    "RealRobot",
    "begin_body",
    "open_robot",
    "read_body_address",
]

EXAMPLE = "nomad://127.0.0.1:7019#1 or sim:bravo"
UNLIMITED = Limits(inf, inf, inf)


class RealRobot(Robot, Protocol):
    """A body that is brought to rest at the end, and closed.

    `sense` raises SleepcastError when the body can no longer be reached, and will not be.
    """

    @property
    def lost(self) -> str:
        """Why the body cannot be reached now, "" while it can."""

    def now(self) -> float:
        """The time of the last reading: in step, a body is its mind's clock."""

    def complaints(self) -> list[str]:
        """What has gone wrong since the last call, in sentences, without anything being lost by it."""

    def close(self) -> None:
        """Bring the body to rest and close the connection."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


@dataclass(frozen=True, slots=True)
class Opening:
    """How a body is to be opened.

    in_step: whether every `sense` waits for the body's next tick, and nothing happens between two of them (for a
        simulation whose time waits for its programs).
    limits: kept as well as the body's own.
    number: the robot's id.
    seed: of a simulated body's chance.
    vocabulary: in which units its functions are wanted; a body that has no such vocabulary keeps to SI.
    """

    in_step: bool = False
    limits: Limits = UNLIMITED
    number: int = 0
    seed: int = 0
    vocabulary: str = "standard"


def open_robot(uri: str, opening: Opening | None = None) -> RealRobot:
    """Connect to the body at a URI, for instance `nomad://127.0.0.1:7019#1`.

    Raises BodyError for a URI that leads nowhere, SleepcastError if nobody is there.
    """
    scheme = uri.partition(":")[0]
    added = find_extension(BODIES, scheme)
    if added is None:
        schemes = tuple(extensions(BODIES))
        raise BodyError(
            f"{uri!r:.100} names no body{did_you_mean(scheme, schemes)}; wanted something like {EXAMPLE}; "
            f"installed are {', '.join(schemes)}"
        )
    opening = opening or Opening()
    opens = cast(Callable[[str, Opening], object], load_extension(added, "body"))
    body = opens(uri, opening)
    if not isinstance(body, BridgedBody):
        raise MisuseError(
            f'body "{scheme}" of {added.value} gives a {type(body).__name__}, which is no BridgedBody: nothing would '
            "bring it to rest without its mind, or keep its limits"
        )
    begin_body(body, opening.limits)
    return body


def begin_body(body: BridgedBody, limits: Limits) -> None:
    """Have a body keep these limits, too, and start its I/O thread; it is closed if it cannot. Raises MisuseError for
    limits that it cannot keep."""
    try:
        body.narrow(limits)
        body.begin()
    except BaseException:
        body.close()
        raise
