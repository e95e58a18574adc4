"""Staged sending: first one robot, then a tenth, then everybody, and no further once something has gone wrong.

A robot that says nothing is no proof that all went well, so silence ends it, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

from sleepcast.station.accounting import Accounting, Command
from sleepcast.station.aired import AirStation
from sleepcast.station.audience import Audience
from sleepcast.station.settling import Draft

SHARE = 0.1
"""Of those that may obey, in the second stage."""


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage: what was sent, and what became of it. last: whether nothing comes after it."""

    command: Command
    account: Accounting
    last: bool

    @property
    def good(self) -> bool:
        """Whether the next one may come."""
        return self.account.complete and not self.account.n_fault


def staged(station: AirStation, draft: Draft, patience: float) -> Iterator[Stage]:
    """Send in stages, and give each when it is over; it ends after the first that is not good. patience: s for which
    answers are waited for beyond their time. Raises what `AirStation.send` raises, before anything is sent."""
    station.settle(draft)
    found = station.foresee(draft.text)
    candidates = [*found.yes, *found.unknown]
    tenth = 1 + ceil(SHARE * len(candidates))
    done: list[str] = []
    for step in filter(None, (candidates[:1], candidates[1:tenth])):
        stage = _sent(station, draft, patience, Audience(only=step))
        yield stage
        if not stage.good:
            return
        done += step
    yield _sent(station, draft, patience, Audience(but=done or None))


def _sent(station: AirStation, draft: Draft, patience: float, audience: Audience) -> Stage:
    sent = station.send(
        draft.text,
        standing=draft.standing,
        deadline=draft.deadline,
        everybody=draft.everybody,
        count=station.foresee(draft.text, only=audience.only, but=audience.but).may,
        only=audience.only,
        but=audience.but,
    )
    station.gather(sent, patience)
    return Stage(sent, station.accounting(sent.id), audience.only is None)
