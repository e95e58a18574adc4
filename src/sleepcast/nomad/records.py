"""PosData: where a robot was, and how fast, when each of its sensors last measured.

A sonar's record is latched when its reading changes, a bumper's when it begins to feel something; infrared sensors
and the compass measure all the time.
"""

from __future__ import annotations

from sleepcast.nomad.state import (
    POS_BUMPER,
    POS_COMPASS,
    POS_INFRARED,
    POS_LASER,
    POS_SONAR,
    RING,
    position,
    tail,
    velocity,
)
from sleepcast.robot import Condition

Record = tuple[int, ...]
"""x, y, steering, turret; the speeds of the axes; the clock then, and the clock of the reading."""
BLANK: Record = (0,) * 9


class Records:
    """The records of one robot. steers: as of its world."""

    def __init__(self, *, steers: bool) -> None:
        self._steers = steers
        self._before: Condition | None = None
        self._infrared = [BLANK] * RING
        self._sonar = [BLANK] * RING
        self._bumper = BLANK
        self._now = BLANK

    def look(self, condition: Condition) -> None:
        """The robot is now like this."""
        clock = tail(condition)[0]
        now = (*position(condition.believed), *velocity(condition.speeds, steers=self._steers), clock, clock)
        before, self._before, self._now = self._before, condition, now
        self._infrared = [now if number < len(condition.infrared) else BLANK for number in range(RING)]
        heard = before.sonars if before else ()
        for number, reading in enumerate(condition.sonars[:RING]):
            if number >= len(heard) or reading != heard[number]:
                self._sonar[number] = now
        if condition.touched and not (before and before.touched):
            self._bumper = now

    def words(self, sensors: int) -> list[int]:
        """The records of these sensors (bits as in the mask), in the order of the wire."""
        found: list[Record] = []
        if sensors & POS_INFRARED:
            found += self._infrared
        if sensors & POS_SONAR:
            found += self._sonar
        if sensors & POS_BUMPER:
            found.append(self._bumper)
        if sensors & POS_LASER:
            found.append(BLANK)
        if sensors & POS_COMPASS:
            found.append(self._now)
        return [word for record in found for word in record]
