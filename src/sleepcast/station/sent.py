"""Commands that were sent, with the answers of robots to each, as many as are stored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import LOOK
from sleepcast.channel.message_batch import NameIndex, ascending
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.serial import Array, SerialError
from sleepcast.station.answers import MATCHED, SILENT, Answers
from sleepcast.station.leases import in_words
from sleepcast.station.rest import RestAccount, RestStates
from sleepcast.station.roster import Index
from sleepcast.station.serialized import CommandState


class Command:
    """A message that the desk sent and keeps account of.

    addressed: how many robots, from the first on, were on the roster when it went out; only: the places of those among
    them for whom it was, None for all. expected: the places of those of which the desk was certain that they would
    obey. answers: by robot, the first answer of each. conflicts: names that several robots have, each with a sentence
    that says who of them has answered. size: how many robots there are for whom it is, also such as
    were never heard; 0 where nobody knows.
    """

    def __init__(
        self,
        message: Message,
        names: NameIndex,
        expected: Index | None = None,
        last_sent: float = -inf,
        only: Index | None = None,
        size: int = 0,
    ) -> None:
        self.message, self.addressed, self.last_sent, self.only = message, len(names), last_sent, only
        self.size = size
        self.expected: Index = np.empty(0, np.intp) if expected is None else expected
        self.answers = Answers(names)
        self.rest = RestStates(names)
        """Of a STOP: which of those that have accepted it are at rest."""
        self.conflicts: dict[str, str] = {}

    def state(self) -> CommandState:
        expected = Array.of(self.expected.astype(np.int32))
        only = None if self.only is None else Array.of(self.only.astype(np.int32))
        kept = (expected, self.last_sent, self.answers.state(), only, self.rest.state())
        return CommandState(self.message, self.addressed, *kept)

    @classmethod
    def restored(cls, state: CommandState, names: NameIndex) -> Command:
        """The command that was kept. Raises SerialError."""
        found = cls(state.message, names, ascending(state.expected, len(names)), state.last_sent)
        if not 0 <= state.addressed <= len(names):
            raise SerialError(f"a command to {state.addressed} robots, of which there are {len(names)}")
        found.addressed = found.size = state.addressed  # of a swarm, whose robots are all on the roster
        found.only = None if state.only is None else ascending(state.only, state.addressed)
        found.answers.restore(state.answers)
        if state.rest is not None:
            found.rest.restore(state.rest)
        return found

    @property
    def id(self) -> str:
        return self.message.id

    @property
    def is_look(self) -> bool:
        """Whether robots are only to tell of themselves."""
        return LOOK in self.message.body

    @property
    def kind(self) -> Kind:
        return self.message.kind

    @property
    def text(self) -> str:
        """The expression; else what it is in capitals: `STOP`, `RELEASE`, `LEASE take bravo`."""
        return self.message.text or in_words(self.message.body) or self.message.kind.name

    @property
    def predicted(self) -> frozenset[str]:
        """The names of the robots that were expected to obey."""
        return frozenset(self.answers.names[place] for place in self.expected.tolist())

    def extend(self) -> None:
        """It is for those as well that have come onto the roster since."""
        self.answers.make_room()
        self.addressed = len(self.answers.codes)

    @property
    def resting(self) -> RestAccount:
        """Of a STOP: who is at rest among those that have accepted it."""
        places = map(self.answers.names.place, self.conflicts)
        shared = [place for place in places if place is not None]
        return self.rest.among(self.answers.codes == MATCHED, shared)

    @property
    def silent(self) -> NDArray[np.bool_]:
        """Which of the robots that were on the roster are yet to answer, by place."""
        return silent(self.answers.codes, self.addressed, self.only)

    @property
    def n_silent(self) -> int:
        """How many of the addressed robots have not answered, including those whose names are unknown."""
        return int(np.count_nonzero(self.silent)) + self.n_nameless

    @property
    def n_nameless(self) -> int:
        """How many robots are expected that are neither on the roster nor have answered."""
        return nameless(self.size, self.answers.codes, self.addressed, self.only)


def nameless(size: int, codes: NDArray[np.uint8], addressed: int, only: Index | None) -> int:
    """How many of the expected robots are missing, besides those that were asked and those that have answered
    unasked."""
    asked = addressed if only is None else len(only)
    if size <= asked:
        return 0
    unasked = np.count_nonzero(codes[addressed:])
    if only is not None:
        unasked += np.count_nonzero(codes[:addressed]) - np.count_nonzero(codes[only])
    return max(0, size - asked - int(unasked))


def silent(codes: NDArray[np.uint8], addressed: int, only: Index | None) -> NDArray[np.bool_]:
    """Which of the first `addressed` robots, of these only, have the code of silence."""
    found: NDArray[np.bool_] = codes[:addressed] == SILENT
    if only is not None:
        asked = np.zeros(len(found), np.bool_)
        asked[only[only < len(found)]] = True
        found &= asked
    return found


# ---- all of them


MAX_COMMANDS = 1_000
"""Commands whose answers are stored; the journal has them all."""
MAX_LOOKS = 256
"""Questions of the desk itself to robots, whose answers are stored; they are not commands, and are not needed later."""
MAX_ANSWERS = 16_000_000
"""Answers stored for all commands together (with more robots, those of fewer commands): a third of a gigabyte."""


class NoSuchCommandError(MisuseError):
    """An id that belongs to no command of this desk."""

    def __init__(self, command: str, known: Iterable[str]) -> None:
        names = list(known)
        super().__init__(f'no command "{command}" was sent from this desk{did_you_mean(command, names)}')


class SentCommands:
    """The commands of one desk. latch: the last STOP or RELEASE."""

    def __init__(self) -> None:
        self.latch: Command | None = None
        self._commands: dict[str, Command] = {}
        self._looks: dict[str, Command] = {}

    def __contains__(self, command: object) -> bool:
        return command in self._commands

    def ids(self) -> list[str]:
        """The stored commands and questions, oldest first."""
        return list(self._commands)

    def all(self) -> list[Command]:
        """All stored commands, oldest first."""
        return list(self._commands.values())

    def find(self, command: object) -> Command | None:
        """The command with this id, if it is stored."""
        return self._commands.get(str(command)) or self._looks.get(str(command))

    def get(self, command: str) -> Command:
        """The command with this id. Raises NoSuchCommandError."""
        found = self.find(command)
        if found is None:
            raise NoSuchCommandError(command, self._commands)
        return found

    def add(self, command: Command, roster: int) -> None:
        """Store a command to a roster of this size; the oldest ones are dropped."""
        if command.is_look:
            self._looks[command.id] = command
            while len(self._looks) > MAX_LOOKS:
                del self._looks[next(iter(self._looks))]
            return
        self._commands[command.id] = command
        if command.kind in (Kind.STOP, Kind.RELEASE):
            self.latch = command
        most = max(1, min(MAX_COMMANDS, MAX_ANSWERS // max(1, roster)))
        while len(self._commands) > most:
            del self._commands[next(iter(self._commands))]

    def go_back(self, time: float) -> None:
        """Forget what was sent and answered after `time`, s."""
        self._commands = {key: each for key, each in self._commands.items() if each.message.issued <= time}
        self._looks.clear()
        latches = [each for each in self._commands.values() if each.kind in (Kind.STOP, Kind.RELEASE)]
        self.latch = latches[-1] if latches else None
        for command in self._commands.values():
            command.answers.go_back(time)
            command.rest.forget()  # robots will tell anew

    def state(self) -> tuple[list[CommandState], CommandState | None]:
        """The commands and the latch."""
        return [command.state() for command in self.all()], self.latch.state() if self.latch is not None else None

    def restore(self, commands: Sequence[CommandState], latch: CommandState | None, names: NameIndex) -> None:
        """Have what was kept. Raises SerialError."""
        if len(commands) > MAX_COMMANDS:
            raise SerialError(f"{len(commands)} commands of a desk")
        found = [Command.restored(command, names) for command in commands]
        self._commands = {command.id: command for command in found}
        if latch is not None:
            kept = Command.restored(latch, names)
            self.latch = self._commands.get(kept.id, kept)
