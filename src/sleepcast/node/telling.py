"""How often one robot may TELL: a leaky bucket in one number."""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.mind.limits import TELL_BURST, TELLS_A_SECOND, TELLS_TOO_FAR, TELLS_TOO_OFTEN


class TellLimit:
    """See the module. until: when everything that was told would be paid off at `TELLS_A_SECOND`, s."""

    def __init__(self) -> None:
        self._until = 0.0
        self._refused = False
        """Whether a TELL has been refused since the robot was last below its rate."""

    def allows(self, hops: int, now: float, report: Callable[[str], None]) -> bool:
        """Whether something may be told at `now`, s, over this many hops; counted as told if so. report: takes why not,
        once until the robot has been below its rate again."""
        begin = max(self._until, now)
        if hops < 1 or begin - now > (TELL_BURST - 1) / TELLS_A_SECOND:
            if not self._refused:
                self._refused = True
                report(TELLS_TOO_OFTEN if hops >= 1 else TELLS_TOO_FAR)
            return False
        self._refused &= begin > now
        self._until = begin + 1.0 / TELLS_A_SECOND
        return True
