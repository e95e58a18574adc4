"""A real fleet on the air, with the methods of a simulated one."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from datetime import datetime
from math import ceil, inf
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Self
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.commands import WAIT, Fleet, placed, read_only
from sleepcast.api.connection import CHANNEL, FLEET, AirOptions, observing_station
from sleepcast.api.progress import steps
from sleepcast.api.results import CommandResult
from sleepcast.core.errors import MisuseError
from sleepcast.core.given_numbers import in_seconds, read_seconds
from sleepcast.core.time_of_day import instant_of
from sleepcast.language import Explanation
from sleepcast.language.functions import MAX_WAIT
from sleepcast.station import Command, Preview, Station, asking
from sleepcast.station.asking import AHEAD, ask_why, look_around, may_be_known_to_robots, prepare_with_robots
from sleepcast.station.network import NetworkStation
from sleepcast.station.prepared import Prepared, Terms
from sleepcast.station.remote import TelemetryClient
from sleepcast.station.validation import MAX_LISTED

if TYPE_CHECKING:
    from sleepcast.api.mission import Mission
    from sleepcast.notebook import NotebookDesk
    from sleepcast.simulator import Order

TURN = 0.05
"""Seconds of hearing in one turn, after which another thread may have its own."""
FRESH = 1.0
"""Seconds for which telemetry is as good as new: several arrays in a row are of the same moment."""
KEY = ".key"
"""How the name of a key's file ends."""


class ConnectedFleet(Fleet):
    """A real fleet and its operator's desk; `connect` makes one.

    Robots are heard while a method runs; driven robots then go on, and stop by themselves a second after the last one.
    telemetry: what robots reported.
    """

    station: NetworkStation

    def __init__(self, station: NetworkStation, telemetry: TelemetryClient, channel: str, ends: ExitStack) -> None:
        super().__init__(station)
        station.holding, station.between = True, self._pass_on  # a STOP waits for no other thread's question
        self.telemetry, self.channel = telemetry, channel
        station.alarm = logging.getLogger("sleepcast").warning
        self._began, self._looked, self._asked = station.now, -inf, -inf
        self._end = finalize(self, ends.close)

    # ---- time

    @property
    def time(self) -> float:
        """Seconds since it was connected."""
        return self.station.now - self._began

    def run(self, seconds: float | str, *, quiet: bool = False) -> Self:
        seconds = read_seconds(seconds, "cannot run for")
        began = self.station.now
        with closing(steps(ceil(seconds / TURN), self.channel, quiet=quiet)) as turns:
            for turn in turns:
                with self._turn():
                    self.station.wait(min(began + seconds, began + (turn + 1) * TURN) - self.station.now)
                self._changed(soon=True)
        self._changed()
        return self

    def _pass(self) -> None:
        """Hear robots for a moment, and ask them for telemetry now and then."""
        with self._turn():
            if self.station.now - self._asked > FRESH:
                self._asked = self.station.now
                self.telemetry.look()
            self.station.wait(TURN)
        self._changed(soon=True)

    def _until(self, sent: Command, seconds: float) -> CommandResult:
        self._looked = -inf  # robots may have changed
        if seconds:
            with self._turn():
                if sent.instant is None:
                    self.station.gather(sent, seconds)
                else:  # which may be an hour ahead
                    self.station.wait_until(lambda: not sent.n_silent, self.station.now + seconds)
        self._changed()
        return CommandResult(self, sent)

    # ---- the operator's desk

    def _look(self) -> None:
        """Ask robots for telemetry unless they have sent it a moment ago."""
        with self._turn():
            if self.station.now - self._looked > FRESH:
                look_around(self.station, self.telemetry)
                self._looked = self.station.now

    def _instant(self, at: float | str | datetime) -> float:
        if isinstance(at, datetime):
            return at.timestamp()
        return instant_of(at, self.station.now, MAX_WAIT) if isinstance(at, str) else super()._instant(at)

    def _prepare(self, text: str, terms: Terms, desk: Station) -> Prepared:
        with self._turn():
            return prepare_with_robots(self.station, self.telemetry, text, terms)

    def preview(self, text: str, *, by: str = "") -> Preview:
        self.desk_of(by)
        self._look()
        return super().preview(text, by=by)

    def ask(
        self,
        text: str,
        *,
        wait: float | str = WAIT,
        only: Sequence[str] | None = None,
        but: Sequence[str] | None = None,
        sure: bool = False,
        by: str = "",
    ) -> CommandResult:
        """See `Fleet`. Raises UnknownNameError for names that no robot has, too."""
        wait = in_seconds(wait, "wait")
        self.desk_of(by)
        with self._turn():
            if not sure and may_be_known_to_robots(self.station, self.station.check(text)):
                look_around(self.station, self.telemetry, patience=AHEAD)
        return super().ask(text, wait=wait, only=only, but=but, sure=sure)

    def _played(self, order: Order, sent: Command | None) -> None:
        """Nothing: no scenario with a mission lies behind robots on the air."""

    def _refuse_release(self, lines: Mission) -> None:
        """Also for a line that would end the STOPs of other operators, who are persons."""
        super()._refuse_release(lines)
        for line in lines:
            if line.instruction.kind == "RELEASE ALL":
                with placed(line.order.place):
                    raise MisuseError(
                        "on the air no script ends STOPs of other operators: write RELEASE, and release them by hand"
                    )

    def release(self, *, wait: float | str = WAIT, by: str = "") -> CommandResult:
        wait = in_seconds(wait, "wait")
        self.desk_of(by)
        with self._turn():
            sent = asking.release(self.station, self.telemetry)
        return self._until(sent, wait)

    def why(self, robot: str, sent: CommandResult | str | None = None) -> Explanation:
        with self._turn():
            return ask_why(self.station, self.telemetry, robot, sent.id if isinstance(sent, CommandResult) else sent)

    # ---- what is so now

    @property
    def notices(self) -> list[str]:
        """What a person should know now, as sentences: names that several robots have, wrong clocks, forgeries."""
        return self.station.notices()

    @property
    def names(self) -> Sequence[str]:
        """The robots that were ever heard, in the order of all arrays; new ones come at the end."""
        return tuple(self.station.names)

    def __getitem__(self, expression: str) -> NDArray[np.float64]:
        """See `Fleet`: robots are asked for telemetry, unless they told it a second ago; those whose telemetry does not
        tell are asked for the value. NaN for robots that do not answer."""
        self._look()
        values, asked = self.station.values(expression)
        if asked:
            answers = super().ask(expression, only=asked if len(asked) <= MAX_LISTED else None).values
            for index, name in enumerate(self.names[: len(values)]):
                value = answers.get(name)
                values[index] = values[index] if value is None else value
        return read_only(values)

    @property
    def groups(self) -> Mapping[str, tuple[str, ...]]:
        """The members of each group, by telemetry."""
        self._look()
        return self._members()

    def _members(self) -> Mapping[str, tuple[str, ...]]:
        groups: dict[str, tuple[str, ...]] = {}
        for name in self.names:
            mind = self.telemetry.minds.get(name)
            for key in sorted(mind.groups) if mind is not None else ():
                groups[key] = (*groups.get(key, ()), name)
        return dict(sorted(groups.items()))

    @property
    def stopped(self) -> NDArray[np.bool_]:
        """Which robots last told that STOP holds them, shape (robots,)."""
        self._look()
        minds = map(self.telemetry.minds.get, self.names)
        return read_only(np.array([mind is not None and mind.stopped for mind in minds], np.bool_))

    # ---- closed, and shown

    def close(self) -> None:
        """Leave the channel, and remember who was heard. Driven robots stop by themselves."""
        with self._turns.last():
            self._end()

    def __repr__(self) -> str:
        return f"{self.channel}: {len(self):,} robots after {self.time:.0f} s, as {self.station.operator}"

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()

    def _make_desk(self) -> NotebookDesk:
        from sleepcast.notebook import connected_desk

        return connected_desk(self.station, self.telemetry, self.channel, self._began, self._turn)


def connect(
    channel: str = CHANNEL,
    *,
    key: str | PathLike[str] | None = None,
    fleet: str = FLEET,
    trust: str | PathLike[str] | None = None,
    keys: str | PathLike[str] | None = None,
    expect: int | str | PathLike[str] | None = None,
    within: float | str | None = None,
    journal: str | PathLike[str] | None = None,
) -> ConnectedFleet:
    """A real fleet on a channel, with the options of the command line. What a person has to know is logged by the
    logger `sleepcast`. Raises SleepcastError for a channel, keys or numbers that will not do.

    channel: its address.
    key: its owner's name or its file; None for the key in use or this machine's development key.
    fleet: messages of other fleets are ignored.
    trust: the file of trusted keys; None for the one beside the keys.
    keys: the folder of keys.
    expect: how many robots there are, or a file of their names.
    within: time for answers, s; None: one millisecond per robot.
    journal: a file; None for the fleet's own.
    """
    owner, folder = (None if key is None else fspath(key)), _path(keys)
    if owner is not None and owner.endswith(KEY):
        file = Path(owner).expanduser()
        owner, folder = file.stem, file.parent
    within = None if within is None else in_seconds(within, "answers within")
    if within is not None and not 0.0 <= within <= inf:
        raise MisuseError(f"answers within {within} s: wanted a number of seconds, 0 or more")
    expected = None if expect is None else str(expect) if isinstance(expect, int) else fspath(expect)
    air = AirOptions(channel, fleet, owner, _path(trust), folder, within, _path(journal), expect=expected)
    with ExitStack() as ends:
        station, telemetry = ends.enter_context(observing_station(air, logging.getLogger("sleepcast").warning))
        connected = ConnectedFleet(station, telemetry, channel, ends.pop_all())
    connected._look()
    return connected


def _path(given: str | PathLike[str] | None) -> Path | None:
    return None if given is None else Path(given).expanduser()
