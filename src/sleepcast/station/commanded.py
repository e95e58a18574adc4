"""When robots were last commanded, by this desk or another: what they reported before does not say who will obey."""

from __future__ import annotations

from math import inf

import numpy as np

from sleepcast.station.roster import Index, Seconds


class CommandedTimes:
    """Of all robots of a roster, and of single ones that were commanded since; s of the desk's clock."""

    def __init__(self) -> None:
        self._all = -inf
        self._some: dict[int, float] = {}
        self.latest = -inf
        """When any robot was commanded last."""

    def note(self, at: float, places: Index | None = None) -> None:
        """Robots were commanded at a time. places: of these robots, None for all."""
        self.latest = max(self.latest, at)
        if places is None:
            self._all = max(self._all, at)
            self._some = {place: time for place, time in self._some.items() if time > self._all}
            return
        for place in places.tolist():
            self._some[place] = max(at, self._some.get(place, self._all))

    def of(self, count: int) -> Seconds:
        """Of the first robots on the roster, so many of them: when each was commanded last, -inf for never."""
        found = np.full(count, self._all)
        for place, time in self._some.items():
            if place < count:
                found[place] = time
        return found
