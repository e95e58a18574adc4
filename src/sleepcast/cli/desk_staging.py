"""A command that the terminal desk sends in stages, without ever waiting: one robot, a tenth, everybody."""

from __future__ import annotations

from sleepcast.cli.account import FEW
from sleepcast.core.errors import SleepcastError, printable
from sleepcast.station.network import ANSWERS_A_SECOND, AirStation
from sleepcast.station.staging import Stages
from sleepcast.station.validation import Draft

PATIENCE = 2.0
"""Seconds after the time for answers for which a stage waits for those that are missing."""


class HaltedError(SleepcastError):
    """A stage went wrong, and nothing comes after it."""


class Staging:
    """See the module. said: how far it has come, for a person; over: whether all stages went well. Raises what
    `AirStation.send` raises, before anything is sent."""

    def __init__(self, station: AirStation, draft: Draft) -> None:
        self._station, self._stages = station, Stages(station, draft)
        self._number, self.over = 0, False
        self._send()

    def _send(self) -> None:
        self._number += 1
        self._sent = self._stages.send()
        self._until = self._station.now + self._sent.addressed / ANSWERS_A_SECOND + PATIENCE
        self.said = f"stage {self._number}: waiting for the answers"

    def tick(self) -> None:
        """Go on if this stage is over. Raises HaltedError if it went wrong."""
        found = self._station.accounting(self._sent.id)
        if found.n_fault:
            name = found.fault[0]
            fault = printable(found.answers[name].fault or "")
            raise HaltedError(f"halted after stage {self._number}: fault on {name}: {fault}")
        if found.complete and self._stages.over:
            self.over = True
            self.said = f"all {self._number} stages went well"
        elif found.complete:
            self._send()
        elif self._station.now > self._until:
            raise HaltedError(f"halted after stage {self._number}: {found.silence(FEW)}")
