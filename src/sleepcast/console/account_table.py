"""The accounts of all commands as rows for the page, and the progress of STOP."""

from __future__ import annotations

from collections.abc import Sequence, Set

import msgspec

from sleepcast.channel.desks import sent_by
from sleepcast.console.driver import AT_START
from sleepcast.console.failing import FailingRules, ShownFailing
from sleepcast.console.view import SwarmView
from sleepcast.core.errors import printable
from sleepcast.language import Vocabulary
from sleepcast.station import Account, Command, Station
from sleepcast.station.account import values_in_words

MAX_ROWS = 50
"""Commands that a page shows, the latest; the journal has them all."""
ON_ITS_WAY = 1.0
"""Simulated s after which the answers to a command have come, so that who is silent then is not only waiting."""
NAMED = 3
"""Silent robots named in the sentence about STOP."""
FARTHEST = 1
"""Robots named there that still move, those that go farthest: how far is what a person must know."""


class CommandRow(msgspec.Struct, frozen=True):
    """One command.

    at: when it was sent, in simulated s
    kind: command, ask, stop or release
    matched, not_matched, fault, silent, predicted: counts of robots
    standing: whether it has no deadline
    values: what was answered to a question, in words
    scope: among whom silence was counted, in words
    unknown: those whose test was neither true nor false
    held: those among the matched that were to move, and did not because STOP holds them
    not_stored: those that have done it, but may forget it over a restart
    waiting: why the silent ones could not answer yet, "" if they could
    failing: rules that it brought and that fail now
    moving: those that have accepted STOP and are not at rest yet
    by: the operator who has sent it, "" where nobody is named
    bids: how an auction stands, in words, "" for a command that chooses nobody
    pending: those that wait for the instant of the command
    instant: when that is, in simulated s, None for a command that waits for nothing
    """

    id: str
    kind: str
    text: str
    at: float
    matched: int
    not_matched: int
    fault: int
    silent: int
    predicted: int
    standing: bool = False
    values: str = ""
    scope: str = ""
    unknown: int = 0
    held: int = 0
    not_stored: int = 0
    waiting: str = ""
    failing: tuple[ShownFailing, ...] = ()
    moving: int = 0
    by: str = ""
    bids: str = ""
    pending: int = 0
    instant: float | None = None


State = tuple[int, int, int, int, str, tuple[ShownFailing, ...]]
"""What a row depends on: how many answered, how many were addressed, how often robots reported coming to rest, how
often an auction has changed, why robots wait, which rules fail."""


class AccountTable:
    """The rows of all operators' desks; a row is made anew only when another robot has answered.

    station: the first operator's desk
    swarm: on the map
    began: when its time began, s of the station's clock
    others: the desks of further operators
    """

    def __init__(self, station: Station, swarm: SwarmView, began: float = 0.0, others: Sequence[Station] = ()) -> None:
        self._station, self._swarm, self._began = station, swarm, began
        self._others = {desk.operator: desk for desk in others}
        self._rows: dict[str, tuple[State, CommandRow]] = {}
        self._asked: dict[str, tuple[State, CommandRow]] = {}
        """The same of those that were asked for by their ids."""
        self.failing = FailingRules(swarm, self.desk_of, dict(getattr(swarm, "operators", ())))

    def commands(self) -> list[Command]:
        """What all operators have sent, oldest first."""
        return sent_by((self._station, *self._others.values()))

    def desk_of(self, command: Command) -> Station:
        """The desk that has sent a command."""
        return self._others.get(command.message.sender, self._station)

    def desk_for(self, number: str) -> Station:
        """The desk that has sent the command with this id; the first where nobody has."""
        return next((self.desk_of(each) for each in self.commands() if each.id == number), self._station)

    def rows(self, held_up: str = "") -> list[CommandRow]:
        """The latest commands, oldest first. held_up: why time stands still, "" while it runs."""
        commands = self.commands()[-MAX_ROWS:]
        self.failing.look(commands)
        self._rows = {each.id: self._current(each, self._rows.get(each.id), held_up) for each in commands}
        return [row for _, row in self._rows.values()]

    def rows_of(self, ids: Set[str]) -> dict[str, CommandRow]:
        """Those of these commands that are still known, by their ids, however many came after them."""
        commands = [command for command in self.commands() if command.id in ids]
        self._asked = {each.id: self._current(each, self._asked.get(each.id)) for each in commands}
        return {key: row for key, (_, row) in self._asked.items()}

    def _current(
        self, command: Command, before: tuple[State, CommandRow] | None, held_up: str = ""
    ) -> tuple[State, CommandRow]:
        """The row of a command, made anew only if something was reported since. before: what it was."""
        late = self._swarm.now() + self._began - command.message.issued > ON_ITS_WAY
        waiting = held_up if held_up and not late and command.n_silent else ""
        bids = 0 if command.auctioneer is None else command.auctioneer.version
        counts = command.answers.version, command.addressed, command.rest.version, bids
        state = *counts, waiting, self.failing.of(command.id)
        if before is not None and before[0] == state:
            return before
        return state, self._row(command, self.desk_of(command).accounting(command.id), *state[4:])

    def _row(self, command: Command, account: Account, waiting: str, failing: tuple[ShownFailing, ...]) -> CommandRow:
        return CommandRow(
            command.id,
            command.kind.value,
            command.text.strip(),
            command.message.issued - self._began,
            account.n_matched,
            account.n_not_matched,
            account.n_fault,
            account.n_silent,
            len(command.expected),
            command.message.standing,
            values_in_words(command, account),
            account.scope,
            account.n_unknown,
            account.n_held,
            account.n_not_stored,
            waiting,
            failing,
            0 if account.rest is None else account.rest.n_stopping,
            command.message.sender if self._others else "",
            "" if account.auction is None else account.auction.sentence(),
            account.n_waiting,
            None if account.instant is None else account.instant - self._began,
        )

    def outcomes(self, command: str, time: float, names: Sequence[str]) -> bytes:
        """For each of these robots, by place, what its answer was at a time, as `station.SILENT` and the others. Raises
        NoSuchCommandError."""
        return self.desk_for(command).outcomes(command, time, names)[: len(names)].tobytes()

    def stop(self) -> Command | None:
        """The STOP that holds, None if none does."""
        for command in reversed(self.commands()):
            if command.kind == "stop":
                return command
            if command.kind == "release":
                return None
        return None

    def stop_sentence(self, stop: Command, held_up: str) -> str:
        """What has become of a STOP: never more than what the robots themselves have said. held_up: why time stands
        still, "" while it runs."""
        account = self.desk_of(stop).accounting(stop.id)
        total = account.n_matched + account.n_silent
        if held_up == AT_START:
            return (
                "STOP holds: the run has not started, so no robot moves. All robots are sent STOP with the first tick."
            )
        if not total:
            return "STOP was sent, but no robot has been heard yet: none has confirmed it."
        doubts = f"{_still(account, self._swarm.vocabulary)}{_not_stored(account)}"
        if account.complete:
            rests = account.rest is not None and account.rest.n_at_rest == account.n_matched
            state = "are at rest" if rests else "report stopped"
            return f"STOP: all {account.scope.removeprefix('of ')} {state}{doubts}."
        if held_up:
            return (
                f"STOP is on its way: {account.n_matched:,} of {total:,} robots report stopped. Time stands "
                "still, so nothing moves; the others hear it with the next tick."
            )
        stopped = f"{account.n_matched:,} {account.scope} report stopped"
        return f"STOP: {stopped}{doubts}; silent: {account.missing(NAMED)}."


def _still(account: Account, vocabulary: Vocabulary) -> str:
    """Who of those that report stopped is not known to be at rest, as the end of a sentence."""
    rest = account.rest
    if rest is None or not (rest.n_stopping or rest.n_accepted):
        return ""
    move = f"; {rest.n_stopping:,} still move: {rest.who_moves(vocabulary, FARTHEST)}" if rest.n_stopping else ""
    if rest.n_accepted == account.n_matched:
        return "; none tells whether it is at rest"
    return f"{move}; {rest.n_accepted:,} do not tell whether they are at rest" if rest.n_accepted else move


def _not_stored(account: Account) -> str:
    """Who may forget it, as the end of a sentence."""
    if not account.n_not_stored:
        return ""
    names = printable(", ".join(account.not_stored[:NAMED])) + (", ..." if account.n_not_stored > NAMED else "")
    return f", but {account.n_not_stored:,} could not store it, so a restart may forget it there: {names}"
