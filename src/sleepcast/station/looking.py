"""Looking: asking robots on the air to tell of themselves, and keeping what they told where the desk finds it.

A look goes to everybody, or to some; answers come spread over a time, and those that are lost are asked for again, as
for every question. What has to be known besides (the names of a type, what was learned) is asked for as soon as a
robot's telemetry mentions it.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from typing import Protocol

from sleepcast.channel import Kind, Message
from sleepcast.channel.bodies import TOLD, Look
from sleepcast.errors import SleepcastError, printable
from sleepcast.language import Explanation
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.station.accounting import Command
from sleepcast.station.minds import Telemetry
from sleepcast.station.remote import RemoteMinds
from sleepcast.station.telling import TellingError, read_why

MAX_LOOKS = 256
"""Looks whose answers are still expected."""
MAX_FAULT = 200
"""Characters of what a robot says went wrong."""


class Asker(Protocol):
    """A desk that can ask robots to tell of themselves."""

    vocabulary: Vocabulary

    def look(self, what: str, *, of: str | None = None, only: Sequence[str] | None = None) -> Command: ...

    def observe(self, now: float, rows: Iterable[Telemetry]) -> None: ...


class Looker:
    """See the module. minds: where it is kept what robots told."""

    def __init__(self, station: Asker, minds: RemoteMinds) -> None:
        self.minds = minds
        self._station = station
        self._looks: OrderedDict[str, Command] = OrderedDict()
        self._whys: OrderedDict[tuple[str, str], Explanation | SleepcastError | None] = OrderedDict()
        """What was said to questions why, by the id of the question and the robot; None so far."""
        self.recall()

    def recall(self) -> None:
        """Give the desk what `minds` knows already."""
        self._station.vocabulary = self.minds.vocabulary
        for mind in self.minds.values():
            self._station.observe(mind.told_at, [mind])

    def look(self, robots: Sequence[str] | None = None) -> Command:
        """Ask these robots (None: all) for telemetry."""
        return self._asked(self._station.look(Look.TELEMETRY, only=robots))

    def ask_why(self, robot: str, command: str | None) -> Command:
        """Ask a robot how it evaluated a command (its id), what a rule (its name) would do, or, for None, how the last
        command went. Raises UnknownRobotError."""
        found = self._station.look(Look.WHY, of=command, only=[robot])
        self._whys[found.id, robot] = None
        if len(self._whys) > MAX_LOOKS:
            self._whys.popitem(last=False)
        return found

    def explanation(self, asked: Command, robot: str) -> Explanation | None:
        """What the robot said to that question; None while nothing has come. Raises SleepcastError for what it said it
        cannot tell."""
        found = self._whys.get((asked.id, robot))
        if isinstance(found, SleepcastError):
            raise found
        return found

    def hear(self, heard: Iterable[Message], now: float) -> None:
        """Take in what robots said at `now`, s of Unix time, and ask for what is missing then."""
        for message in heard:
            command = str(message.body.get("command"))
            if message.kind is not Kind.ANSWER:
                continue
            if (command, message.sender) in self._whys:
                self._whys[command, message.sender] = _why(message)
            elif TOLD in message.body and command in self._looks:
                self._take(message, self._looks[command].message.issued)
        for look, robots in self.minds.wanted(now):
            self._asked(self._station.look(look, only=robots))

    def _take(self, message: Message, asked: float) -> None:
        """asked: s; what is told is of that time or later, since answers wait for their moment."""
        found = self.minds.take(message, asked)
        self._station.vocabulary = self.minds.vocabulary
        for mind in found:
            self._station.observe(mind.told_at, [mind])

    def _asked(self, command: Command) -> Command:
        self._looks[command.id] = command
        if len(self._looks) > MAX_LOOKS:
            self._looks.popitem(last=False)
        return command

    @property
    def complete(self) -> bool:
        """Whether everybody has answered the looks that are under way."""
        return not any(command.n_silent for command in self._looks.values())


def _why(message: Message) -> Explanation | SleepcastError:
    told, fault = message.body.get(TOLD), message.body.get("fault")
    if isinstance(told, str):
        try:
            return read_why(told)
        except TellingError as error:
            return SleepcastError(f"{message.sender} explained it in a way that cannot be read: {error}")
    said = printable(fault)[:MAX_FAULT] if isinstance(fault, str) else "it does not tell why"
    return SleepcastError(f"{message.sender}: {said}")
