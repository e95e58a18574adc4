"""The plans of one vehicle: which there are, which one it is given, and how far it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sleepcast.bridges.mavlink.link import MavlinkConnection
from sleepcast.bridges.mavlink.plans import Circumstances, Plan, check_plan
from sleepcast.bridges.mavlink.transfer import MISSION, Party, Upload
from sleepcast.core.errors import MisuseError

COMPLETE = 5
"""MISSION_STATE of a vehicle that has done all of its mission."""


class PlanFlights:
    """See the module. known: numbered from 1; party: who sends them to whom."""

    def __init__(self, known: Sequence[Plan], link: MavlinkConnection, party: Party) -> None:
        self.known, self._link, self._party = tuple(known), link, party
        self._number = 0
        """Of the plan that it is given or flies, 0 for none."""
        self._upload: Upload | None = None
        self._begun = False
        self._waypoint, self._done = 0, 0.0

    def name(self, number: int) -> str:
        return self.known[number - 1].name

    def number(self, wanted: float) -> int:
        """The number of a plan. Raises MisuseError."""
        if wanted not in range(1, len(self.known) + 1):
            raise MisuseError(
                f"there is no plan {wanted:g} here; there are {', '.join(each.name for each in self.known)}"
            )
        return int(wanted)

    def check(self, number: int, now: Circumstances) -> None:
        """See `check_plan`."""
        check_plan(self.known[number - 1], now)

    def flies(self, number: int) -> bool:
        """Whether this one is sent or flown, and not done yet."""
        return self._number == number and self._done < 1.0

    def measured(self) -> dict[str, float]:
        """Values of sensors."""
        return {"waypoint": float(self._waypoint), "plan_progress": self._done}

    def begin(self, number: int, now: float) -> None:
        """Have a plan sent."""
        self._number, self._begun, self._waypoint, self._done = number, False, 0, 0.0
        self._upload = Upload(self._link, self._party, MISSION, self.known[number - 1].items, now)

    def leave(self) -> None:
        """Something else is wanted."""
        self._number, self._upload, self._begun, self._waypoint = 0, None, False, 0

    def tend(self, now: float) -> tuple[bool, str]:
        """Go on sending; gives whether the vehicle has just got all of it, and why it has not taken it."""
        upload = self._upload
        if upload is None:
            return False, ""
        upload.tend(now)
        if upload.over:
            self._upload = None
        self._begun = upload.done
        return upload.done, upload.failed

    def hear(self, message: Any, now: float) -> None:
        """Take what the vehicle says about its mission."""
        if self._upload is not None:
            self._upload.hear(message, now)
        elif self._begun and message.get_type() == "MISSION_CURRENT":
            self._waypoint = message.seq
            if getattr(message, "mission_state", 0) == COMPLETE:
                self._waypoint, self._done = 0, 1.0
        elif self._begun and message.get_type() == "MISSION_ITEM_REACHED":
            self._done = max(self._done, min(message.seq / len(self.known[self._number - 1].items), 1.0))
