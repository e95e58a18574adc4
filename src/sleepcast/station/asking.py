"""What a desk asks robots on the air for itself: telemetry, whether they would obey, and why they did."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sleepcast.channel.message import Kind
from sleepcast.core.errors import SleepcastError
from sleepcast.language import Checked, Explanation
from sleepcast.language.parts import walk
from sleepcast.language.rehearsal import CHANCE
from sleepcast.station.validation import COMMANDED, MAX_LISTED, NEVER_HEARD, STALE, TEST_UNKNOWN

if TYPE_CHECKING:
    from sleepcast.station.network import NetworkStation
    from sleepcast.station.prepared import Draft, Prepared, Terms
    from sleepcast.station.remote import TelemetryClient
    from sleepcast.station.sent import Command

PATIENCE = 1.0
"""Seconds after the time for answers for which they are still taken: they are asked for again where they were lost."""
AHEAD = 0.3
"""Refuse before anything is sent: a silent robot then counts as one that may obey."""


class SilentError(SleepcastError):
    """A robot that does not answer."""


def look_around(
    station: NetworkStation, telemetry: TelemetryClient, robots: list[str] | None = None, patience: float = PATIENCE
) -> None:
    """Ask robots (None: all) for telemetry, and for whatever is missing then, and wait for it. patience: s for which
    answers are waited for beyond their time, and what is missing as long again."""
    began = station.now
    station.gather(telemetry.look(robots), patience)
    until = station.now + (station.within or 0.0) + patience
    station.wait_until(lambda: not (telemetry.learning(began) or station.is_deciding), until)


def prepare_with_robots(
    station: NetworkStation, telemetry: TelemetryClient, text: str, terms: Terms, draft: Draft | None = None
) -> Prepared:
    """Prepare a command by what robots tell now: request telemetry, and let those decide themselves whose decision does
    not follow from it; nothing is done. draft: the command as it was checked before. Raises what `Station.prepare`
    raises."""
    look_around(station, telemetry, patience=AHEAD)
    draft = station.draft(text, terms) if draft is None else station.renewed(draft)
    prepared = station.foresee(draft)
    unknown = prepared.preview.unknown
    asked = [name for name, why in unknown.items() if why not in (NEVER_HEARD, STALE, COMMANDED, CHANCE, TEST_UNKNOWN)]
    if not asked:
        return prepared
    station.poll(text, AHEAD, only=asked if len(asked) <= MAX_LISTED else None)
    return station.foresee(station.renewed(draft))


class AwaitedRelease:
    """A RELEASE that goes out once robots have told whose STOPs hold them, which it has to name. It ends those that
    were there when it was decided, which is now. Raises RoleError for an observer."""

    def __init__(self, station: NetworkStation, telemetry: TelemetryClient) -> None:
        station.require(Kind.RELEASE)
        self._station, self._decided, self.asked = station, station.now, telemetry.look()

    @property
    def until(self) -> float:
        """When it goes out at the latest, s of Unix time."""
        return self._station.answered(self.asked) + AHEAD

    def attend(self) -> bool:
        """Send it if it is time, and say whether it was."""
        if self._station.awaits(self.asked) and self._station.listened < self.until:
            return False
        self.send()
        return True

    def send(self) -> Command:
        """Send it now."""
        return self._station.release_all(self._decided)


def release(station: NetworkStation, telemetry: TelemetryClient) -> Command:
    """The same for who waits for it."""
    awaited = AwaitedRelease(station, telemetry)
    station.gather(awaited.asked, AHEAD)
    return awaited.send()


def may_be_known_to_robots(station: NetworkStation, checked: Checked) -> bool:
    """Whether a text names anything of which this desk has not heard, so that robots should be asked first."""
    names = station.learned
    groups = () if checked.program is None else (p for p in walk(checked.program.root) if p.op == "in")
    return bool(checked.unknown or checked.by) or any(names.declared(part.name) is None for part in groups)


def ask_why(station: NetworkStation, telemetry: TelemetryClient, robot: str, command: str | None) -> Explanation:
    """Ask a robot, see `TelemetryClient.ask_why`, and wait for its answer. Raises UnknownRobotError, SilentError, and
    SleepcastError for what the robot cannot explain."""
    if robot not in station.roster:  # it may be there all the same: all robots are asked for telemetry
        look_around(station, telemetry)
    asked = telemetry.ask_why(robot, command)
    station.wait_until(lambda: telemetry.explanation(asked, robot) is not None, asked.message.issued + PATIENCE)
    if (explanation := telemetry.explanation(asked, robot)) is None:
        raise SilentError(f"{robot} does not answer ({station.accounting(asked.id).ago(robot)})")
    return explanation
