"""The bridge: it asks robots for telemetry, tells other maps, and tells robots of the markers that are set there."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable

from sleepcast.core.errors import MisuseError, SleepcastError, printable
from sleepcast.core.geodesy import LocalMap
from sleepcast.core.tasks import together
from sleepcast.station.network import NetworkStation
from sleepcast.station.remote import TelemetryClient
from sleepcast.station.validation import MAX_LISTED, SendPolicy
from sleepcast.tak.event import CotEvent
from sleepcast.tak.link import TakLink
from sleepcast.tak.picture import GROUND_ROBOT, Markers, NamedPlace, OperatingPicture, command

LISTEN = 0.05
"""Seconds between two looks at what robots say."""
MIN_BETWEEN = 2.0
"""Seconds between two commands about places at least: somebody may drag a marker to and fro."""
AGAIN, AT_ONCE = 5.0, 4
"""Seconds after which robots that do not know a place are told again: as long as a command is good. And of how many
places at once, old or new: whoever moves all markers all the time may not fill the air."""

TYPE = re.compile(r"[A-Za-z](-[A-Za-z0-9.]{1,20}){1,15}")
"""What a type of Cursor-on-Target looks like."""

Say = Callable[[str], None]


class TakBridge:
    """Between a fleet on the air and other maps. Raises MisuseError for a type that is none.

    say: takes what the person at the terminal must know.
    fleet: its name, as others see it.
    every: s between two pictures.
    markers: whether those of others become places of robots; whoever may set one then says where the place is.
    type: of a robot's event.
    """

    def __init__(
        self,
        station: NetworkStation,
        telemetry: TelemetryClient,
        link: TakLink,
        map: LocalMap,
        say: Say,
        *,
        fleet: str,
        every: float,
        markers: bool = False,
        type: str = GROUND_ROBOT,
    ) -> None:
        if not TYPE.fullmatch(type):
            raise MisuseError(f"{type!r:.60} is no type of an event: wanted one such as {GROUND_ROBOT}")
        station.policy = SendPolicy()  # nobody is here whom the desk could ask
        station.alarm = lambda sentence: self._complain(f"{sentence[0].upper()}{sentence[1:]}.")
        self._station, self._telemetry, self._link, self._say, self._every = station, telemetry, link, say, every
        self._picture = OperatingPicture(map, fleet, type)
        self._markers = Markers(map, fleet) if markers else None
        self._untold: dict[str, NamedPlace] = {}
        self._places: dict[str, NamedPlace] = {}
        self._sent_at: dict[str, float] = {}
        """When a place was last sent to robots."""
        self._may_tell = 0.0
        self._complained: set[str] = set()

    async def run(self) -> None:
        """Go on until cancelled. Raises what the channel raises."""
        await together(self._link.run(self._take), self._serve())

    async def _serve(self) -> None:
        due = 0.0
        while True:
            self._station.pump()
            now = self._station.now
            if now >= due:
                due = now + self._every
                minds, fresh = self._telemetry.minds.values(), self._station.stale_after + self._every
                self._link.send(self._picture.events(minds, now, self._every, fresh, self._places))
                self._telemetry.look()
            self._tell(now)
            await asyncio.sleep(LISTEN)

    def _take(self, event: CotEvent) -> None:
        """Another map's event."""
        place = None if self._markers is None else self._markers.take(event)
        if isinstance(place, str):
            self._complain(place)
        elif place is not None:
            self._places[place.key] = self._untold[place.key] = place

    def _tell(self, now: float) -> None:
        """Tell all robots of new places, and of the others those that do not know them: they are new here, have been
        started anew, or did not hear it."""
        if now < self._may_tell:
            return
        self._may_tell = now + MIN_BETWEEN
        for key in list(self._untold)[:AT_ONCE]:
            place = self._untold.pop(key)
            if self._send(place, now):
                self._say(f"{place.key} is at x = {place.x:.1f} m, y = {place.y:.1f} m for all robots.")
        waiting = sorted((when, key) for key, when in self._sent_at.items() if now >= when + AGAIN)
        minds = [(mind, dict(mind.variables())) for mind in self._telemetry.minds.values()] if waiting else []
        again = 0
        for when, key in waiting:
            place = self._places[key]
            lacking = [mind.name for mind, values in minds if mind.reported_at > when and not place.known(values)]
            if lacking and again < AT_ONCE:
                again += 1
                self._send(place, now, lacking[:MAX_LISTED])

    def _send(self, place: NamedPlace, now: float, only: list[str] | None = None) -> bool:
        """Tell robots of a place; whether that was possible."""
        self._sent_at[place.key] = now
        try:
            self._station.send(command(place), everybody=only is None, only=only, confirmed=True)
        except SleepcastError as error:
            why = printable(str(error).partition("\n")[0])
            self._complain(f"Robots cannot be told of {place.key}: {why}")
            return False
        return True

    def _complain(self, sentence: str) -> None:
        """Say a sentence, once."""
        if sentence not in self._complained and len(self._complained) < 1_000:
            self._complained.add(sentence)
            self._say(sentence)
