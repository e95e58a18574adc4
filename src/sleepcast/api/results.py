"""What became of a command: the account of its desk, in a program's hands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from sleepcast.api.table import DataTable
from sleepcast.core.model import RestState
from sleepcast.language import Explanation
from sleepcast.station import Account, Command, Station

if TYPE_CHECKING:
    from sleepcast.simulator import Order


class AskedFleet(Protocol):
    """The fleet to which a command was sent."""

    def desk_of(self, operator: str) -> Station:
        """The desk of an operator."""

    def why(self, robot: str, sent: CommandResult | str | None = None) -> Explanation:
        """How a robot evaluated a command."""


class CommandResult:
    """A command that was sent, with what has become of it so far; it goes on counting while the fleet runs."""

    def __init__(self, fleet: AskedFleet, command: Command, order: Order | None = None) -> None:
        self._fleet, self._command, self._order = fleet, command, order

    @property
    def id(self) -> str:
        """Of the message."""
        return self._command.id

    @property
    def text(self) -> str:
        """The expression; `STOP` or `RELEASE` for these two."""
        return self._command.text

    @property
    def by(self) -> str:
        """The operator who has sent it."""
        return self._command.message.sender

    @property
    def account(self) -> Account:
        """Everything that is known of it now."""
        return self._fleet.desk_of(self.by).accounting(self.id)

    @property
    def matched(self) -> tuple[str, ...]:
        """The robots that obeyed; of a question, that answered; of STOP, that have accepted it: see `at_rest`."""
        return self.account.matched

    @property
    def at_rest(self) -> tuple[str, ...]:
        """Of STOP: the robots that have accepted it and say that they are at rest."""
        rest = self.account.rest
        return () if rest is None else rest.at_rest

    @property
    def stopping(self) -> dict[str, RestState]:
        """Of STOP: those that have accepted it and are not at rest yet, each with its `speed` (m/s) and the `distance`
        that it may still go (m); NaN for unknown."""
        rest = self.account.rest
        return {} if rest is None else rest.stopping

    @property
    def not_matched(self) -> tuple[str, ...]:
        """The robots that decided that it was not for them."""
        return self.account.not_matched

    @property
    def held(self) -> tuple[str, ...]:
        """Those among the matched that were to move, and did not because STOP holds them."""
        return self.account.held

    @property
    def unknown(self) -> tuple[str, ...]:
        """The robots on which the test was neither true nor false, since it reads something that they do not know."""
        return self.account.unknown

    @property
    def waiting(self) -> tuple[str, ...]:
        """The robots that wait for the instant of a command with AFTER-ISSUE, or of one that was sent with `at`."""
        return self.account.waiting

    @property
    def instant(self) -> float | None:
        """That instant, in the time of the desk: s of a simulated run, or of Unix time; None if it waits for
        nothing."""
        return self.account.instant

    @property
    def fault(self) -> tuple[str, ...]:
        """The robots on which something went wrong."""
        return self.account.fault

    @property
    def not_stored(self) -> tuple[str, ...]:
        """The robots that have done it, but could not store it: a restart may forget it."""
        return self.account.not_stored

    @property
    def silent(self) -> tuple[str, ...]:
        """The robots that were never heard to answer."""
        return self.account.silent

    @property
    def unmet(self) -> tuple[str, ...]:
        """Of a line of a script that says what shall become of it: a sentence for each count that is not so now."""
        if self._order is None:
            return ()
        from sleepcast.api.session_test import counts_of, unmet  # with scenarios, which no fleet on the air needs

        return tuple(unmet(self._order, counts_of(self.account)))

    @property
    def values(self) -> dict[str, float | None]:
        """What each robot answered that the expression came to, SI; None for unknown."""
        return {name: answer.value for name, answer in self.account.answers.items()}

    def why(self, robot: str) -> Explanation:
        """How this robot evaluated it: the tree of values, and the first test that did not hold. Raises what
        `Fleet.why` raises."""
        return self._fleet.why(robot, self)

    def table(self) -> DataTable:
        """A row for each robot: `robot`, `outcome`, `value` (SI), `fault`."""
        account = self.account
        names = [*account.answers, *account.silent]
        answers = [account.answers.get(name) for name in names]
        values = [np.nan if each is None or each.value is None else each.value for each in answers]
        return DataTable(
            {
                "robot": names,
                "outcome": ["silent" if each is None else str(each.outcome) for each in answers],
                "value": np.array(values),
                "fault": ["" if each is None else each.fault or "" for each in answers],
            }
        )

    def __repr__(self) -> str:
        return "; ".join((f"{self.text}: {self.account.sentence()}", *self.unmet))
