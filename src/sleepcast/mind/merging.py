"""Merging of several operators' commands: all robots that have heard the same commands, in any order, end up the same.

All commands have one order: by the time at which they were issued, then by their sender's epoch, number and name. A
command's changes carry its place in that order, and it changes nothing that a later command has changed already. The
registers are the text of each rule, buffer and operator, the flag of each rule and buffer, and each group; a rule's
place in the round is that of the first command that made it. What rules do by themselves has no place and always
counts."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import TypeVar

import msgspec

from sleepcast.channel.message import Message

CommandOrder = tuple[int, int, int, str]
"""Of a command: when it was issued (microseconds of Unix time), its epoch, its number, and its sender's name."""
NOWHERE: CommandOrder = (0, 0, 0, "")
"""Before all commands."""
Making = tuple[CommandOrder, int]
"""A command that has made a rule, and which of those that it has made."""
MAX_NAMES = 1_024
"""Registers of a kind whose last change is remembered; of more, the oldest one is forgotten."""
MAX_MADE = 16
"""Commands that have made a rule, the first one and the latest."""

Value = TypeVar("Value")


class MergingState(msgspec.Struct, frozen=True, array_like=True):
    """See `Merging`; its fields."""

    floor: CommandOrder = NOWHERE
    written: dict[str, CommandOrder] = {}
    flags: dict[str, tuple[CommandOrder, bool]] = {}
    made: dict[str, tuple[CommandOrder, tuple[Making, ...]]] = {}


class Merging:
    """One robot's. place: of the command that is being evaluated, None for anything else. floor: of the latest
    ROLLBACK; written: of the last change of each text and group; flags: of each flag, and what it was set to; made:
    when a rule was last forgotten, and the commands that have made it since."""

    def __init__(self) -> None:
        self.place: CommandOrder | None = None
        self.version = 0
        """Grows with every change."""
        self._floor = NOWHERE
        self._written: dict[str, CommandOrder] = {}
        self._flags: dict[str, tuple[CommandOrder, bool]] = {}
        self._made: dict[str, tuple[CommandOrder, tuple[Making, ...]]] = {}
        self._makes = 0

    def begin(self, place: CommandOrder | None) -> None:
        """What comes now is done by the command of this place, or by none."""
        self.place, self._makes = place, 0

    def write(self, register: str) -> bool:
        """Whether the command may change this text or group, which is then its own."""
        if self.place is None:
            return True
        if max(self._written.get(register, NOWHERE), self._floor) > self.place:
            return False
        self._put(self._written, register, self.place)
        return True

    def flag(self, key: str, wanted: bool | None) -> bool | None:
        """What the flag of a rule or buffer is to be, where the command wants this of it (None: nothing); None to leave
        it as it is."""
        if self.place is None:
            return wanted
        last = self._flags.get(key)
        if last is not None and last[0] > self.place:
            return last[1]
        if wanted is not None:
            self._put(self._flags, key, (self.place, wanted))
        return wanted

    def make(self, key: str) -> None:
        """The command makes a rule, or would, had it come in time."""
        if self.place is not None:
            self._makes += 1
            forgotten, made = self._made.get(key, (NOWHERE, ()))
            self._set_made(key, forgotten, {*made, (self.place, self._makes)})

    def forget(self, key: str) -> None:
        """The command forgets a rule: it is as if none before had made it."""
        if self.place is not None:
            forgotten, made = self._made.get(key, (NOWHERE, ()))
            self._set_made(key, max(forgotten, self.place), made)

    def _set_made(self, key: str, forgotten: CommandOrder, made: Iterable[Making]) -> None:
        since = sorted(making for making in made if making[0] > forgotten)
        self._put(self._made, key, (forgotten, (*since[:1], *since[1:][1 - MAX_MADE :])))

    def roll_back(self) -> None:
        """The command restores rules: none before it changes any."""
        if self.place is not None:
            self._floor = max(self._floor, self.place)
            self.version += 1

    def first(self, key: str) -> Making:
        """Which command has made a rule; `NOWHERE` for what no command has made."""
        _, made = self._made.get(key, (NOWHERE, ()))
        return made[0] if made else (NOWHERE, 0)

    def state(self) -> MergingState:
        """As plain data."""
        return MergingState(self._floor, dict(self._written), dict(self._flags), dict(self._made))

    def restore(self, state: MergingState) -> None:
        """Go on with that."""
        self._floor = state.floor
        self._written, self._flags, self._made = dict(state.written), dict(state.flags), dict(state.made)

    def _put(self, registers: dict[str, Value], key: str, value: Value) -> None:
        self.version += 1
        registers.pop(key, None)
        registers[key] = value
        if len(registers) > MAX_NAMES:
            del registers[next(iter(registers))]


def place_of(message: Message, zero: float) -> CommandOrder:
    """The place of a command. zero: when the mind's time began, s of Unix time."""
    return round((message.issued + zero) * 1e6), message.epoch, message.sequence, message.sender


def enqueue(queue: deque[Message], message: Message, zero: float) -> None:
    """Let a message wait in its place, as far as its own sender's order allows."""
    at = len(queue)
    place = place_of(message, zero) if at else NOWHERE
    while at > 0:
        before = queue[at - 1]
        if (before.sender, before.epoch) == (message.sender, message.epoch) or place_of(before, zero) < place:
            break
        at -= 1
    queue.insert(at, message)
