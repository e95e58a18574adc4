"""Staged sending: first one robot, then a tenth, then all, and no further after a failure.

A robot that says nothing is no proof that all went well, so silence ends it, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

from sleepcast.station.account import Account, Command
from sleepcast.station.network import NetworkStation
from sleepcast.station.validation import Audience, Draft

SHARE = 0.1
"""Of those that may obey, in the second stage."""


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage: the command sent and its account. last: whether no stage follows."""

    command: Command
    account: Account
    last: bool

    @property
    def good(self) -> bool:
        """Whether the next one may come."""
        return self.account.complete and not self.account.n_fault


class Stages:
    """A command that goes out in stages. Raises what `NetworkStation.send` raises, before anything is sent."""

    def __init__(self, station: NetworkStation, draft: Draft) -> None:
        station.validate(draft)
        found = station.forecast(draft.text)
        candidates = [*found.yes, *found.unknown]
        tenth = 1 + ceil(SHARE * len(candidates))
        self._station, self._draft = station, draft
        self._left = [Audience(only=names) for names in (candidates[:1], candidates[1:tenth]) if names]
        self._left.append(Audience(but=candidates[:tenth] or None))

    @property
    def over(self) -> bool:
        """Whether all have been sent."""
        return not self._left

    def send(self) -> Command:
        """Send the next one."""
        draft, audience = self._draft, self._left.pop(0)
        return self._station.send(
            draft.text,
            standing=draft.standing,
            deadline=draft.deadline,
            everybody=draft.everybody,
            count=self._station.forecast(draft.text, only=audience.only, but=audience.but).may,
            only=audience.only,
            but=audience.but,
            confirmed=draft.confirmed,
        )


def staged(station: NetworkStation, draft: Draft, patience: float) -> Iterator[Stage]:
    """Send in stages, and give each when it is over; it ends after the first that is not good. patience: s for which
    answers are waited for beyond their time. Raises what `NetworkStation.send` raises, before anything is sent."""
    stages = Stages(station, draft)
    while not stages.over:
        sent = stages.send()
        station.gather(sent, patience)
        stage = Stage(sent, station.accounting(sent.id), stages.over)
        yield stage
        if not stage.good:
            return
