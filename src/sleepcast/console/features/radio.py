"""The radio of a simulated swarm over time: copies that arrived and those that did not, messages and bytes by kind.

A meter overhears every message from the start of a desk and keeps sums, as a series that is thinned when it is full;
the page makes rates of them. Bytes are those of the signed messages on a real network. Of a batch of messages from many
robots, which are alike but for their numbers, a few are measured.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Annotated, Any, Protocol

import msgspec
from msgspec import Meta

from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import encoded_size
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.channel.simulated_radio import RadioCounts
from sleepcast.console.feature import answers, begins
from sleepcast.console.incoming import PageMessage, Place, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.series import Series
from sleepcast.console.view import SwarmView
from sleepcast.loop.swarm import Witness

EVERY = 1.0
"""Simulated seconds between two samples at first."""
MEASURED = 4
"""Messages of a batch of which the bytes are measured."""
FATES = {
    "delivered": "delivered",
    "lost": "lost",
    "out of reach": "out_of_reach",
    "queue full": "crowded",
    "refused": "refused",
}
"""What becomes of copies: as it is called, and as the radio counts it."""
KINDS = {
    "commands": (Kind.COMMAND,),
    "questions": (Kind.ASK,),
    "STOP, RELEASE": (Kind.STOP, Kind.RELEASE),
    "answers": (Kind.ANSWER,),
    "reports": (Kind.REPORT,),
    "bids and grants": (Kind.REQUEST,),
}


class GetRadio(PageMessage, tag="radio"):
    """What went over the radio. after: only what is later (s), if it has been thinned this often; -1 for everything."""

    serial: Serial
    after: Annotated[float, Meta(ge=-1.0, le=1e12)] = -1.0
    thinned: Place = 0


class RadioChart(msgspec.Struct, frozen=True):
    """A chart of sums: names of its lines, and how many columns there are before its own, after that of the times."""

    title: str
    lines: list[str]
    first: int


class RadioSums(DeskMessage, tag="radio"):
    """Sums since the start, as columns: times (s), then those of each chart. added: whether they follow those that were
    told before."""

    serial: int
    charts: list[RadioChart]
    columns: list[list[float | None]]
    added: bool
    thinned: int
    told: str


CHARTS = [
    RadioChart("Copies per second", list(FATES), 0),
    RadioChart("Messages per second", list(KINDS), len(FATES)),
    RadioChart("Bytes per second", list(KINDS), len(FATES) + len(KINDS)),
]


class RadioMeter:
    """See the module; a witness of the swarm. now: gives the page's time, s."""

    def __init__(self, now: Callable[[], float]) -> None:
        self.counts = RadioCounts()
        self.series = Series(len(FATES) + 2 * len(KINDS))
        self.series.every = EVERY
        self._now = now
        self._messages, self._bytes = Counter[Kind](), Counter[Kind]()

    def ticking(self) -> None:
        """Nothing."""

    def posted(self, message: Message) -> None:
        """The operator's message is sent."""
        self._count(message.kind, 1, encoded_size(message, ""))

    def said(self, batch: MessageBatch) -> None:
        """Robots' messages are sent."""
        count = len(batch)
        measured = range(0, count, -(-count // MEASURED) or 1)
        if count:
            size = sum(encoded_size(batch.message(each), "") for each in measured) / len(measured)
            self._count(batch.kind, count, round(count * size))

    def ticked(self) -> None:
        """Nothing."""

    def came(self, arrival: object) -> None:
        """Nothing."""

    def _count(self, kind: Kind, messages: int, size: int) -> None:
        self._messages[kind] += messages
        self._bytes[kind] += size

    def sample(self) -> None:
        """Take a sample if one is due; called with every picture."""
        time = self._now()
        if self.series.due(time):
            fates = [float(getattr(self.counts, name)) for name in FATES.values()]
            self.series.take(time, [*fates, *_by_kind(self._messages), *_by_kind(self._bytes)])


def _by_kind(counted: Counter[Kind]) -> list[float]:
    return [float(sum(counted[kind] for kind in kinds)) for kinds in KINDS.values()]


class WatchedDriver(Protocol):
    """What draws pictures. watchers: called with every picture."""

    watchers: list[Callable[[], None]]


class OverheardDesk(Protocol):
    """A desk whose swarm can be overheard. kept: what features keep, by its class. overhear: lets a witness hear every
    message, and gives the counts of copies."""

    kept: dict[type[Any], Any]

    @property
    def overhear(self) -> Callable[[Witness], RadioCounts]: ...
    @property
    def swarm(self) -> SwarmView: ...
    @property
    def driver(self) -> WatchedDriver: ...


@begins
def overhear(desk: OverheardDesk) -> None:
    """Overhear the swarm from now on."""
    meter = desk.kept[RadioMeter] = RadioMeter(desk.swarm.now)
    meter.counts = desk.overhear(meter)
    desk.driver.watchers.append(meter.sample)


@answers(
    lacking="On the air, the desk hears only what reaches it: nobody counts what is lost between robots.",
    recording="A recording does not tell message by message what went over the radio.",
)
def radio(source: OverheardDesk, asked: GetRadio) -> RadioSums:
    """What went over the radio since the start."""
    series: Series = source.kept[RadioMeter].series
    added = asked.after >= 0.0 and asked.thinned == series.thinned
    columns = series.after(asked.after if added else -1.0)
    return RadioSums(asked.serial, CHARTS, columns, added, series.thinned, series.told())
