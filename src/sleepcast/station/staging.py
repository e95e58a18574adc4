"""Staged sending: first one robot, then a tenth, then all, and no further after a failure.

A robot that says nothing is no proof that all went well, so silence ends it, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil

from sleepcast.core.records import dataclass
from sleepcast.language.parts import auction_of, timed_of
from sleepcast.station.account import Account
from sleepcast.station.network import NetworkStation
from sleepcast.station.prepared import Prepared
from sleepcast.station.sent import Command
from sleepcast.station.validation import Audience, CommandTypeError

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
    """A command that goes out in stages. Raises what `NetworkStation.commit` raises, and CommandTypeError for
    one that chooses among robots, or waits for an instant, before anything is sent.

    count, confirmed: the sender's answers, for all of them
    """

    def __init__(
        self, station: NetworkStation, prepared: Prepared, *, count: int | None = None, confirmed: bool = False
    ) -> None:
        self._station, self._confirmed = station, confirmed
        if (auction := auction_of(prepared.draft.program.root)) is not None:
            raise CommandTypeError(f"{auction.name} chooses among all robots at once: send it without stages")
        if timed_of(prepared.draft.program.root) is not None:
            raise CommandTypeError("an instant is the same for all: send it without stages")
        self._whole = station.accept(prepared, count=count, confirmed=confirmed)
        forecast = self._whole.forecast
        candidates = [*forecast.yes, *forecast.unknown]
        tenth = 1 + ceil(SHARE * len(candidates))
        self._left = [Audience(only=names) for names in (candidates[:1], candidates[1:tenth]) if names]
        self._left.append(Audience(but=candidates[:tenth] or None))

    @property
    def over(self) -> bool:
        """Whether all have been sent."""
        return not self._left

    def send(self) -> Command:
        """Send the next one, counting anew who may obey of those whom it is for."""
        stage = self._station.foresee(self._whole.draft.to(self._left.pop(0)), of=self._whole)
        return self._station.commit(stage, count=stage.may, confirmed=self._confirmed)

    def run(self, patience: float) -> Iterator[Stage]:
        """Send them, and give each when it is over; it ends after the first that is not good. patience: s for which
        answers are waited for beyond their time. Raises what `send` raises."""
        while not self.over:
            sent = self.send()
            self._station.gather(sent, patience)
            stage = Stage(sent, self._station.accounting(sent.id), self.over)
            yield stage
            if not stage.good:
                return


class StagedSending:
    """A command that goes out in stages, for an owner who has other things to do: it calls `attend` time and again.
    The rest: see `Stages`. patience: s for which answers are waited for beyond their time.
    """

    def __init__(
        self,
        station: NetworkStation,
        prepared: Prepared,
        patience: float,
        *,
        count: int | None = None,
        confirmed: bool = False,
    ) -> None:
        self._stages = Stages(station, prepared, count=count, confirmed=confirmed)
        self._station, self._patience = station, patience
        self.done: list[Stage] = []
        self.current: Command | None = self._stages.send()
        """The one whose answers are awaited, None once all is over."""
        self.first = self.current

    def attend(self) -> None:
        """Go on to the next stage if this one is over and good. Raises what sending raises: then nothing more is
        sent."""
        sent, station = self.current, self._station
        if sent is None:
            return
        if station.awaits(sent) and station.listened < station.answered(sent) + self._patience:
            return
        self.halt()
        if self.done[-1].good and not self.done[-1].last:
            self.current = self._stages.send()

    def halt(self) -> None:
        """Send no further stage; what was sent, was sent."""
        if self.current is not None:
            self.done.append(Stage(self.current, self._station.accounting(self.current.id), self._stages.over))
            self.current = None
