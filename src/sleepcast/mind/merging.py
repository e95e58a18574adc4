"""Merging several operators' commands: all robots that have received the same commands, in any order, end up in the
same state.

All commands have one order: by time of issue, then by their sender's epoch, number and name. A command's changes
carry its place in that order, and it changes nothing that a later command has already changed. The registers are the
text of each rule, buffer and operator, the flag of each rule and buffer, and each group; a rule's place in the order
of evaluation is that of the first command that made it. Changes that rules make on their own have no place and
always count.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Iterable
from typing import TypeVar

import msgspec

from sleepcast.channel.message import Message

CommandOrder = tuple[int, int, int, str]
"""A command's place: time of issue (microseconds of Unix time), epoch, number, and sender's name."""
NOWHERE: CommandOrder = (0, 0, 0, "")
"""Before all commands."""
Making = tuple[CommandOrder, int]
"""A command that has made a rule, and the index of the rule among those that it has made."""
MAX_NAMES = 1_024
"""Registers of a kind whose last change is remembered; beyond, the oldest one is dropped."""
MAX_MADE = 16
"""Commands remembered that have made a rule: the first one and the latest."""

Value = TypeVar("Value")


class MergingState(msgspec.Struct, frozen=True, array_like=True):
    """See `Merging`; its fields."""

    floor: CommandOrder = NOWHERE
    written: dict[str, CommandOrder] = {}
    flags: dict[str, tuple[CommandOrder, bool]] = {}
    made: dict[str, tuple[CommandOrder, tuple[Making, ...]]] = {}


class Merging:
    """The merging state of one robot. place: of the command being evaluated, None for anything else. floor: of the
    latest ROLLBACK; written: of the last change of each text and group; flags: of each flag, and its value; made: when
    a rule was last forgotten, and the commands that have made it since."""

    def __init__(self) -> None:
        self.place: CommandOrder | None = None
        self.version = 0
        """Increases with every change."""
        self._floor = NOWHERE
        self._written: dict[str, CommandOrder] = {}
        self._flags: dict[str, tuple[CommandOrder, bool]] = {}
        self._made: dict[str, tuple[CommandOrder, tuple[Making, ...]]] = {}
        self._makes = 0

    def begin(self, place: CommandOrder | None) -> None:
        """Begin the changes of the command with this place, or of none."""
        self.place, self._makes = place, 0

    def begun(self, place: CommandOrder | None) -> Merging:
        """The same state at the beginning of such changes."""
        merging = self._copy()
        merging.begin(place)
        return merging

    def draft(self) -> Merging:
        """This state, which the changes of a command leave as it is; itself where there is nothing to be merged."""
        return self if self.place is None else self._copy()

    def _copy(self) -> Merging:
        copy = Merging.of(self.state())
        copy.place, copy._makes = self.place, self._makes
        return copy

    def key(self) -> Hashable:
        """Is equal for equal states."""
        registers = (tuple(each.items()) for each in (self._written, self._flags, self._made))
        return self.place, self._makes, self._floor, *registers

    def write(self, register: str) -> bool:
        """Whether the command may change this text or group; if so, the register takes its place."""
        if self.place is None:
            return True
        if max(self._written.get(register, NOWHERE), self._floor) > self.place:
            return False
        self._put(self._written, register, self.place)
        return True

    def flag(self, key: str, wanted: bool | None) -> bool | None:
        """The new value of the flag of a rule or buffer for which the command wants `wanted` (None: no value); None to
        leave it unchanged."""
        if self.place is None:
            return wanted
        last = self._flags.get(key)
        if last is not None and last[0] > self.place:
            return last[1]
        if wanted is not None:
            self._put(self._flags, key, (self.place, wanted))
        return wanted

    def make(self, key: str) -> None:
        """The command makes a rule, or would if it had come in time."""
        if self.place is not None:
            self._makes += 1
            forgotten, made = self._made.get(key, (NOWHERE, ()))
            self._set_made(key, forgotten, {*made, (self.place, self._makes)})

    def forget(self, key: str) -> None:
        """The command forgets a rule: as if no earlier command had made it."""
        if self.place is not None:
            forgotten, made = self._made.get(key, (NOWHERE, ()))
            self._set_made(key, max(forgotten, self.place), made)

    def _set_made(self, key: str, forgotten: CommandOrder, made: Iterable[Making]) -> None:
        since = sorted(making for making in made if making[0] > forgotten)
        self._put(self._made, key, (forgotten, (*since[:1], *since[1:][1 - MAX_MADE :])))

    def roll_back(self) -> None:
        """The command restores rules: no earlier command changes any."""
        if self.place is not None:
            self._floor = max(self._floor, self.place)
            self.version += 1

    def first(self, key: str) -> Making:
        """The command that made a rule first; `NOWHERE` if no command did."""
        _, made = self._made.get(key, (NOWHERE, ()))
        return made[0] if made else (NOWHERE, 0)

    def state(self) -> MergingState:
        """The state as plain data."""
        return MergingState(self._floor, dict(self._written), dict(self._flags), dict(self._made))

    @staticmethod
    def of(state: MergingState) -> Merging:
        """A robot's merging state as it was."""
        merging = Merging()
        merging.restore(state)
        return merging

    def restore(self, state: MergingState) -> None:
        """Restore the state."""
        self._floor = state.floor
        self._written, self._flags, self._made = dict(state.written), dict(state.flags), dict(state.made)

    def _put(self, registers: dict[str, Value], key: str, value: Value) -> None:
        self.version += 1
        registers.pop(key, None)
        registers[key] = value
        if len(registers) > MAX_NAMES:
            del registers[next(iter(registers))]


def place_of(message: Message, zero: float) -> CommandOrder:
    """The place of a command. zero: start of the mind's time, s of Unix time."""
    return round((message.issued + zero) * 1e6), message.epoch, message.sequence, message.sender


def enqueue(queue: deque[Message], message: Message, zero: float) -> None:
    """Insert a message at its place in the queue, as far as its own sender's order allows."""
    at = len(queue)
    while at > 0 and not comes_after(message, queue[at - 1], zero):
        at -= 1
    queue.insert(at, message)


def comes_after(message: Message, before: Message, zero: float) -> bool:
    """Whether a message does not pass one that waits already: it has its place after it, or is of the same sender."""
    if (before.sender, before.epoch) == (message.sender, message.epoch):
        return True
    return place_of(before, zero) < place_of(message, zero)
