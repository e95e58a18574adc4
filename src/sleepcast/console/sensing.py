"""What the body of one robot senses, for the map: its sonars, what it touches, where its encoders place it, how far its
other senses reach. The page asks for it while it shows a layer that needs it."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite

import msgspec

from sleepcast.core.records import dataclass

Pose = tuple[float, float, float]
"""x, y (m) and heading (rad, counter-clockwise from x)."""


class BodyView(msgspec.Struct, frozen=True):
    """What a robot's body senses.

    pose: where it is
    radius: m
    believed: where its encoders place it, None without any
    sonars: from its front counter-clockwise, m from its rim, None for what was never measured
    beam: opening of each, rad
    farthest: what they measure at most, m
    touched: directions of what its bumper touches, rad from its heading
    reaches: how far other senses reach, by their names, m
    looks: where its first sonar looks, rad
    infrared: as sonars
    sight: what infrared sensors see at most, m
    """

    pose: Pose
    radius: float
    believed: Pose | None
    sonars: tuple[float | None, ...]
    beam: float
    farthest: float
    touched: tuple[float, ...]
    reaches: tuple[tuple[str, float], ...]
    looks: float
    infrared: tuple[float | None, ...] = ()
    sight: float = 1.0


@dataclass(frozen=True, slots=True)
class BodyKind:
    """What bodies of one kind have.

    radius: m
    encoders: whether they measure their own way
    sonars: how many
    beam, farthest, reaches: as in `BodyView`
    """

    radius: float
    encoders: bool
    sonars: int = 0
    beam: float = 0.0
    farthest: float = 0.0
    reaches: tuple[tuple[str, float], ...] = ()

    def sensing(self, pose: Pose, believed: Pose, ranges: Iterable[float], touched: tuple[float, ...] = ()) -> BodyView:
        """What such a body senses. ranges: of its sonars, NaN for what was never measured."""
        return BodyView(
            pose,
            self.radius,
            believed if self.encoders and all(map(isfinite, believed)) else None,
            measured(ranges),
            self.beam,
            self.farthest,
            touched,
            self.reaches,
            pose[2],
        )


def measured(ranges: Iterable[float]) -> tuple[float | None, ...]:
    """The ranges, None for what was never measured."""
    return tuple(each if isfinite(each) else None for each in ranges)
