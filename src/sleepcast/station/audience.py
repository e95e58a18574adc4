"""For whom a message is, where it is not for all who hear it: robots by their names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sleepcast.channel.payload import FOR, NOT
from sleepcast.core.errors import MisuseError
from sleepcast.station.roster import Index, Roster

MAX_LISTED = 4_096
"""Names in one message: some forty datagrams; whoever means more says it by a test."""


class AudienceError(MisuseError):
    """Robots that cannot be addressed by name."""


class Audience(NamedTuple):
    """only: these robots, None for all; but: all except these."""

    only: Sequence[str] | None = None
    but: Sequence[str] | None = None

    @property
    def named(self) -> bool:
        """Whether it is for robots that are named, so that nobody is meant by accident."""
        return self.only is not None

    def body(self) -> dict[str, object]:
        """As it stands in a message. Raises AudienceError for more names than fit."""
        found: dict[str, object] = {}
        for key, names in ((FOR, self.only), (NOT, self.but)):
            if names is not None:
                if len(names) > MAX_LISTED:
                    raise AudienceError(f"{len(names)} robots are too many to be named: at most {MAX_LISTED}")
                found[key] = list(names)
        return found

    def places(self, roster: Roster) -> Index | None:
        """The places of those on the roster that are meant, ascending; None for all. Raises UnknownRobotError."""
        if self.only is None and self.but is None:
            return None
        listed = range(len(roster)) if self.only is None else map(roster.place, self.only)
        return np.array(sorted(set(listed) - set(map(roster.place, self.but or ()))), np.intp)


EVERYBODY = Audience()
