"""What the desk has sent: the latest commands by their ids, and the STOP or RELEASE that holds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sleepcast.channel import Kind
from sleepcast.channel.name_index import NameIndex
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.serial import SerialError
from sleepcast.station.accounting import Command
from sleepcast.station.parcels import CommandParcel

MAX_COMMANDS = 1_000
"""Commands whose answers are kept; the journal has them all."""
MAX_LOOKS = 256
"""Questions to robots about themselves whose answers are kept; they are no commands, and nobody wants them later."""
MAX_ANSWERS = 16_000_000
"""Answers that are kept, of all commands together: with more robots, of fewer commands; a third of a gigabyte."""


class NoSuchCommandError(MisuseError):
    """An id that belongs to no command of this desk."""

    def __init__(self, command: str, known: Iterable[str]) -> None:
        names = list(known)
        super().__init__(f'no command "{command}" was sent from this desk{did_you_mean(command, names)}')


class Sent:
    """See the module. latch: the last STOP or RELEASE."""

    def __init__(self) -> None:
        self.latch: Command | None = None
        self._commands: dict[str, Command] = {}
        self._looks: dict[str, Command] = {}

    def __contains__(self, command: object) -> bool:
        return command in self._commands

    def ids(self) -> list[str]:
        """Of what is kept, oldest first."""
        return list(self._commands)

    def all(self) -> list[Command]:
        """What is kept, oldest first."""
        return list(self._commands.values())

    def find(self, command: object) -> Command | None:
        """The command with this id, if it is kept."""
        return self._commands.get(str(command)) or self._looks.get(str(command))

    def get(self, command: str) -> Command:
        """The same. Raises NoSuchCommandError."""
        found = self.find(command)
        if found is None:
            raise NoSuchCommandError(command, self._commands)
        return found

    def add(self, command: Command, roster: int) -> None:
        """Keep a command to a roster of so many robots; the oldest ones make room."""
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

    def state(self) -> tuple[list[CommandParcel], CommandParcel | None]:
        """The commands and the latch."""
        return [command.state() for command in self.all()], self.latch.state() if self.latch is not None else None

    def restore(self, commands: Sequence[CommandParcel], latch: CommandParcel | None, names: NameIndex) -> None:
        """Have what was kept. Raises ParcelError."""
        if len(commands) > MAX_COMMANDS:
            raise SerialError(f"{len(commands)} commands of a desk")
        found = [Command.restored(command, names) for command in commands]
        self._commands = {command.id: command for command in found}
        if latch is not None:
            kept = Command.restored(latch, names)
            self.latch = self._commands.get(kept.id, kept)
