"""Rules that fail, for the page: which, on how many robots, and by which command they came.

A rule that fails on a robot came by the latest command that stores a rule of this name and that this robot obeyed.
Rules that robots were given in another way belong to no command. What fails is kept with the pictures of a run, live or
recorded, so that it can be told of any of its moments.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import msgspec
import numpy as np

from sleepcast.channel.message import Role
from sleepcast.console.view import SwarmView
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.fleet.failing import MAX_FAILING, FailingRule
from sleepcast.station import FAULT, MATCHED, Command, Station
from sleepcast.station.sent import HELD_BY_STOP

_OBEYED = (MATCHED, HELD_BY_STOP, FAULT)
"""Outcomes of robots that may have stored a rule: a fault may have come after that."""


class ShownFailing(msgspec.Struct, frozen=True):
    """A rule that fails on so many robots. inactive: how many of them have deactivated it. reason: the fault of one of
    them, "" where that is unknown."""

    rule: str
    robots: int
    inactive: int
    reason: str


@dataclass(frozen=True, slots=True)
class Failures:
    """What fails at a moment: rules, and of each for every robot a bit that says whether it fails there
    (`FailingRule.bits`)."""

    rules: tuple[ShownFailing, ...] = ()
    bits: tuple[bytes, ...] = ()

    @classmethod
    def of(cls, rules: Sequence[FailingRule], count: int) -> Failures:
        """What is told of these rules on so many robots."""
        told = rules[:MAX_FAILING]
        shown = (ShownFailing(r.name, len(r.robots), r.inactive, r.reason) for r in told)
        return cls(tuple(shown), tuple(rule.bits(count) for rule in told))

    def robots(self, rule: str, count: int) -> bytes:
        """For each of so many robots whether this rule ("": any rule) fails there, a byte each. Raises MisuseError."""
        each = zip(self.rules, self.bits, strict=True)
        chosen = [bits for shown, bits in each if not rule or shown.rule.casefold() == rule.casefold()]
        if rule and not chosen:
            raise MisuseError(f"The rule {rule} does not fail on any robot at this time.")
        marks = np.zeros(count, np.uint8)
        for bits in chosen:
            marks |= np.unpackbits(np.frombuffer(bits, np.uint8), count=count, bitorder="little")
        return marks.tobytes()

    @property
    def size(self) -> int:
        """Bytes that it takes, about."""
        return sum(map(len, self.bits))


class FailingRules:
    """The rules that failed when `look` was last called (`now`).

    swarm: on the map
    desk_of: gives the desk that has sent a command
    roles: of the operators whom the run names; commands of others than commanders bring no rules
    """

    def __init__(self, swarm: SwarmView, desk_of: Callable[[Command], Station], roles: Mapping[str, str]) -> None:
        self._swarm, self._desk_of, self._roles = swarm, desk_of, roles
        self.now = Failures()
        self._by_command: dict[str, tuple[ShownFailing, ...]] = {}
        self._stored: dict[str, frozenset[str]] = {}

    def look(self, commands: Sequence[Command]) -> None:
        """See what fails now, and by which of these commands, the oldest first, it came."""
        rules = self._swarm.failing()
        self.now = Failures.of(rules, len(self._swarm.scene.names))
        brought: dict[str, list[ShownFailing]] = {}
        for rule in rules[:MAX_FAILING]:
            left = rule.robots
            for command in reversed(commands):
                if not left.size or rule.key not in self._stores(command):
                    continue
                codes = command.answers.codes
                obeyed = np.zeros(len(left), np.bool_)
                known = left < len(codes)
                obeyed[known] = np.isin(codes[left[known]], _OBEYED)
                if obeyed.any():
                    mine = ShownFailing(rule.name, int(np.count_nonzero(obeyed)), 0, rule.reason)
                    brought.setdefault(command.id, []).append(mine)
                    left = left[~obeyed]
        self._by_command = {command: tuple(failing) for command, failing in brought.items()}
        latest = {command.id for command in commands}
        self._stored = {command: keys for command, keys in self._stored.items() if command in latest}

    def _stores(self, command: Command) -> frozenset[str]:
        """The keys of the rules that a command stores, where its sender may change rules."""
        if self._roles.get(command.message.sender, Role.COMMANDER) != Role.COMMANDER:
            return frozenset()
        keys = self._stored.get(command.id)
        if keys is None:
            try:
                program = self._desk_of(command).check(command.message.text).program
            except SleepcastError:  # STOP has no text, and what a name means may have changed
                program = None
            keys = self._stored[command.id] = frozenset() if program is None else frozenset(program.stores)
        return keys

    def of(self, command: str) -> tuple[ShownFailing, ...]:
        """What fails of what the command with this id brought."""
        return self._by_command.get(command, ())
