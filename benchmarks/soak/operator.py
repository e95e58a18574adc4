"""An operator's program that does as it is told on standard input, and says on standard output what became of it.

    python -m benchmarks.soak.operator OWNER KEYS NAMES

Each line in is a JSON object: `do` names a function below, the rest are its arguments; each line out is its result.
Nothing waits for answers: what robots said is asked later. NAMES is the file of the robots' names. Sequence numbers and
the journal lie in the data folder, and outlive the program.
"""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks.channel.desk import obey
from benchmarks.channel.lab import URI
from benchmarks.report import Json
from sleepcast.api.connection import FLEET, AirOptions, station_for
from sleepcast.channel import Kind
from sleepcast.channel.message import LeaseAction
from sleepcast.station.leases import lease_body
from sleepcast.station.network import NetworkStation
from sleepcast.station.roster import read_expectation
from sleepcast.station.sent import Command
from sleepcast.station.validation import SendPolicy

WITHIN = 2.0
"""Simulated seconds over which answers are spread, so that slow robots are not asked again before they answer."""
MOMENT = 0.2
"""Simulated seconds for which it listens at a time."""


class Operator:
    """A station, and what it is asked to do with it."""

    def __init__(self, station: NetworkStation) -> None:
        self._station = station
        station.policy = SendPolicy()

    def send(
        self, text: str, standing: bool = False, deadline: float | None = None, only: list[str] | None = None
    ) -> Json:
        """Send a command to everybody, or to these."""
        everybody = only is None
        return _sent(
            self._station.send(
                text, standing=standing, deadline=deadline, everybody=everybody, only=only, confirmed=True
            )
        )

    def lease(self, deed: str, group: str, seconds: float) -> Json:
        """Take the lease of a group, or give it back."""
        return _sent(self._station.post(Kind.COMMAND, body=lease_body(LeaseAction(deed), group, seconds)))

    def ask(self, text: str) -> Json:
        """Ask everybody for a value."""
        return _sent(self._station.ask(text))

    def stop(self) -> Json:
        """STOP."""
        return _sent(self._station.stop())

    def release(self) -> Json:
        """RELEASE."""
        return _sent(self._station.release_all())

    def answers(self, command: str) -> Json:
        """What each robot has answered to a command: its outcome, value, and when it was heard; and who is silent."""
        found = self._station.accounting(command)
        said = {name: [each.outcome.value, each.value, each.heard] for name, each in found.answers.items()}
        return {"answers": said, "silent": list(found.silent)}

    def listen(self) -> None:
        """Go on listening."""
        self._station.wait(MOMENT)


def _sent(command: Command) -> Json:
    message = command.message
    return {"id": message.id, "issued": message.issued, "deadline": min(message.deadline, 1e12)}


def main() -> None:
    owner, keys, names = sys.argv[1:]
    air = AirOptions(URI, FLEET, owner, None, Path(keys), within=WITHIN)
    with station_for(air, lambda line: print(line, file=sys.stderr), expected=read_expectation(names)) as station:
        operator = Operator(station)
        obey(operator, operator.listen)


if __name__ == "__main__":
    main()
