"""Requesting telemetry from robots on the air, and keeping it where the desk finds it.

A look goes to everybody, or to some; answers come spread over a time, and those that are lost are asked for again, as
for every question. What has to be known besides (the names of a type, what was learned) is asked for as soon as a
robot's telemetry mentions it.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import LOOK, OF, TELEMETRY, Inspection
from sleepcast.core.errors import SleepcastError, printable
from sleepcast.language import Explanation
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.mind.telemetry import TelemetryError, read_why
from sleepcast.station.account import Command
from sleepcast.station.preview import Telemetry
from sleepcast.station.remote import RemoteMind, RemoteMinds

MAX_LOOKS = 256
"""Looks whose answers are still expected."""
MAX_FAULT = 200
"""Characters of a robot's error."""


class Requester(Protocol):
    """A desk that can ask robots to tell of themselves."""

    vocabulary: Vocabulary

    @property
    def now(self) -> float: ...

    def post(self, kind: Kind, *, body: Mapping[str, object], only: Sequence[str] | None = None) -> Command: ...

    def observe(self, now: float, rows: Iterable[Telemetry]) -> None: ...


class TelemetryClient:
    """See the module. minds: where the telemetry is kept."""

    def __init__(self, station: Requester, minds: RemoteMinds) -> None:
        self.minds = minds
        self._station = station
        self._looks: OrderedDict[str, Command] = OrderedDict()
        self._whys: OrderedDict[tuple[str, str], Explanation | SleepcastError | None] = OrderedDict()
        """Explanations by the id of the request and the robot; None until they arrive."""
        self._tell(minds.values())

    def look(self, robots: Sequence[str] | None = None) -> Command:
        """Ask these robots (None: all) for telemetry."""
        return self._ask({LOOK: Inspection.TELEMETRY}, robots)

    def ask_why(self, robot: str, command: str | None) -> Command:
        """Ask a robot how it evaluated a command (its id), what a rule (its name) would do, or, for None, how the last
        command went. Raises UnknownRobotError."""
        found = self._ask({LOOK: Inspection.WHY} | ({} if command is None else {OF: command}), [robot])
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

    def hear(self, heard: Iterable[Message]) -> None:
        """Take in answers, and request what is missing then."""
        for message in heard:
            command = str(message.body.get("command"))
            if message.kind is not Kind.ANSWER:
                continue
            if (command, message.sender) in self._whys:
                self._whys[command, message.sender] = _why(message)
            elif TELEMETRY in message.body and command in self._looks:
                self._take(message, self._looks[command].message.issued)
        for look, robots in self.minds.wanted(self._station.now):
            self._ask({LOOK: look}, robots)

    def _take(self, message: Message, asked: float) -> None:
        """asked: s; the telemetry is of that time or later, since answers are spread over time."""
        self._tell(self.minds.take(message, asked))

    def _tell(self, minds: Iterable[RemoteMind]) -> None:
        """Give the desk what is known of these."""
        self._station.vocabulary = self.minds.vocabulary
        for mind in minds:
            self._station.observe(mind.reported_at, [mind])

    def _ask(self, body: Mapping[str, object], robots: Sequence[str] | None) -> Command:
        command = self._station.post(Kind.ASK, body=body, only=robots)
        self._looks[command.id] = command
        if len(self._looks) > MAX_LOOKS:
            self._looks.popitem(last=False)
        return command

    def learning(self, since: float) -> bool:
        """Whether names or minds were asked for, at this time (s of Unix time) or later, that have not come yet."""
        asked = (
            c
            for c in self._looks.values()
            if c.message.issued >= since and c.message.body[LOOK] != Inspection.TELEMETRY
        )
        return any(command.n_silent for command in asked)


def _why(message: Message) -> Explanation | SleepcastError:
    sent, fault = message.body.get(TELEMETRY), message.body.get("fault")
    if isinstance(sent, str):
        try:
            return read_why(sent)
        except TelemetryError as error:
            return SleepcastError(f"{message.sender} explained it in a way that cannot be read: {error}")
    return SleepcastError(printable(fault)[:MAX_FAULT] if isinstance(fault, str) else f"{message.sender} does not tell")
