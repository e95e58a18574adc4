"""Alerts: tests that the desk looks at all the time, and tells when one becomes true.

An alert for anybody fires when its test becomes true for a robot for which it was not true before; robots that follow
within a second are told together. An alert for more than n robots fires when their number rises above n, and again only
after it has been n or less. What is true from the start is counted and does not fire. A robot whose telemetry is old
keeps what it said last.

The desk looks at alerts with every picture, but not more than a few times a second, and at no more of them at a time
than fit into some milliseconds, so that nothing waits for them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import field
from math import inf
from typing import Annotated, Protocol

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from sleepcast.console.feature import answers
from sleepcast.console.incoming import Number, PageMessage, Serial
from sleepcast.console.marks import clock_time
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.values import Values
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError, listed
from sleepcast.core.records import dataclass
from sleepcast.language.evaluate import is_true

MAX_ALERTS = 32
"""Alerts at one desk: more than anybody watches."""
MAX_FIRINGS = 200
"""Latest firings that are kept, each with its robots."""
MAX_SHOWN = 60
"""Latest firings that a page is told."""
MAX_NAMED = 3
"""Robots that a firing names."""
LOOK_EVERY = 0.25
"""Seconds between two looks at the same alert, at least."""
LONGEST_LOOK = 0.006
"""Seconds after which no further alert is looked at until the next picture."""
TOGETHER = 1.0
"""Seconds within which robots are told together."""

Mask = NDArray[np.bool_]


class AddAlert(PageMessage):
    """Watch a test, and tell when it becomes true for anybody, or for more than so many robots."""

    serial: Serial
    text: Annotated[str, Meta(max_length=1_000)]
    above: Annotated[int, Meta(ge=0, le=10_000_000)] = 0


class MuteAlert(PageMessage):
    """Let an alert fire without a word, or no longer."""

    serial: Serial
    alert: Number
    muted: bool


class RemoveAlert(PageMessage):
    """Watch a test no longer."""

    serial: Serial
    alert: Number


class Fired(PageMessage):
    """For which robots an alert has fired."""

    serial: Serial
    firing: Number


class ShownAlert(msgspec.Struct, frozen=True):
    """An alert.

    count: for how many robots it is true now, -1 while that is unknown
    fired: how often
    trouble: why it cannot be looked at, "" if it can
    """

    alert: int
    text: str
    above: int
    muted: bool
    count: int
    fired: int
    trouble: str


class ShownFiring(msgspec.Struct, frozen=True):
    """An alert has become true.

    at: s of the page's time
    count: robots for which it then was
    robots: those that are new, as people name them
    """

    firing: int
    alert: int
    text: str
    at: float
    count: int
    robots: str


class Alerts(DeskMessage):
    """All alerts, and the latest firings, the youngest last."""

    alerts: list[ShownAlert]
    firings: list[ShownFiring]


class Alerted(DeskMessage):
    """An alert was added or changed; or the robots of a firing were asked for: marks, a byte for each robot."""

    serial: int
    marks: bytes = b""


@dataclass(eq=False)
class Alert:
    """One alert.

    true: for whom, None before the first look
    waiting: robots that are to be told
    due, told: when it is looked at, and was told, s of the desk's clock
    """

    number: int
    text: str
    above: int
    muted: bool = False
    fired: int = 0
    trouble: str = ""
    true: Mask | None = None
    waiting: Mask | None = None
    armed: bool = True
    due: float = -inf
    told: float = -inf

    def look(self, values: NDArray[np.float64], now: float) -> Mask | None:
        """Take what the test comes to now; gives the robots for whom it fires, None if it does not."""
        known, true = ~np.isnan(values), is_true(values)
        if self.true is None:
            if known.any():
                self.true = true
                self.armed = self.count <= self.above
            return None
        before = _longer(self.true, len(values))
        self.true = np.where(known, true, before)
        if self.above:
            fires, self.armed = self.armed and self.count > self.above, self.count <= self.above
            return self.true if fires else None
        new = self.true & ~before
        self.waiting = new if self.waiting is None else new | _longer(self.waiting, len(new))
        if not self.waiting.any() or now - self.told < TOGETHER:
            return None
        fired_for, self.waiting, self.told = self.waiting, None, now
        return fired_for

    @property
    def count(self) -> int:
        """For how many robots it is true, -1 while that is unknown."""
        return -1 if self.true is None else int(np.count_nonzero(self.true))


def _longer(mask: Mask, size: int) -> Mask:
    """The same for robots of whom some came later."""
    return mask if len(mask) >= size else np.concatenate((mask, np.zeros(size - len(mask), np.bool_)))


def line_of(firing: ShownFiring) -> str:
    """A firing on one line."""
    return f"alert at {clock_time(firing.at)}: {firing.text}: {firing.robots}"


@dataclass
class AlertBoard:
    """All alerts of a desk, simulated, on the air or of a recording. listeners: are told of every firing; marked:
    likewise, for the timeline of this run alone."""

    values: Values
    clock: Clock
    listeners: list[Callable[[ShownFiring], None]] = field(default_factory=list)
    marked: Callable[[ShownFiring], None] = lambda firing: None
    _alerts: list[Alert] = field(default_factory=list)
    _firings: deque[tuple[ShownFiring, Mask]] = field(default_factory=lambda: deque(maxlen=MAX_FIRINGS))
    _added: int = 0
    _fired: int = 0
    _time: float = -inf

    def add(self, text: str, above: int = 0) -> None:
        """Watch a test. Raises ReadError, CheckError, and MisuseError for what is no test, and for too many alerts."""
        if len(self._alerts) >= MAX_ALERTS:
            raise MisuseError(f"there are {MAX_ALERTS} alerts already: remove one")
        self.values.of(text)
        self._keep(text, above)
        self.look()

    def watch(self, texts: Iterable[str], say: Callable[[str], None]) -> None:
        """Watch these tests, and tell of every firing in a terminal, too. Raises what `add` raises."""
        for text in texts:
            self.add(text)
        self.listeners.append(lambda firing: say(line_of(firing)))

    def _keep(self, text: str, above: int, muted: bool = False) -> None:
        self._added += 1
        self._alerts.append(Alert(self._added, " ".join(text.split()), above, muted))

    def adopt(self, other: AlertBoard) -> None:
        """Watch what another desk does, which another run has taken the place of."""
        for alert in other._alerts:
            self._keep(alert.text, alert.above, alert.muted)
        self.listeners = other.listeners

    def mute(self, number: int, muted: bool) -> None:
        """Let an alert fire without a word, or no longer. Raises MisuseError if it is not there."""
        self._find(number).muted = muted

    def remove(self, number: int) -> None:
        """Watch this one no longer. Raises MisuseError if it is not there."""
        self._alerts.remove(self._find(number))

    def _find(self, number: int) -> Alert:
        for alert in self._alerts:
            if alert.number == number:
                return alert
        raise MisuseError(f"there is no alert number {number}: it was removed")

    def robots(self, number: int) -> bytes:
        """The robots of a firing, a byte each. Raises MisuseError for one that is not kept any more."""
        for firing, marks in self._firings:
            if firing.firing == number:
                return marks.astype(np.uint8).tobytes()
        raise MisuseError(f"the robots of this alert are not known any more: the last {MAX_FIRINGS} firings are kept")

    def look(self) -> None:
        """Look at the alerts that are due, the one that has waited longest first. Where time has gone back, as in a
        recording, everything begins anew."""
        if self.values.time() < self._time:
            for alert in self._alerts:
                alert.true = alert.waiting = None
        self._time = self.values.time()
        began = now = self.clock.now()
        for alert in sorted(self._alerts, key=lambda alert: alert.due):
            if alert.due > began or now - began > LONGEST_LOOK:
                return
            alert.due = now + LOOK_EVERY
            try:
                values, _ = self.values.of(alert.text)
            except SleepcastError as error:
                alert.trouble = str(error).partition("\n")[0]
            else:
                alert.trouble = ""
                fires = alert.look(values, now)
                if fires is not None and not alert.muted:
                    self._fire(alert, fires)
            now = self.clock.now()

    def _fire(self, alert: Alert, robots: Mask) -> None:
        alert.fired += 1
        self._fired += 1
        indices = np.flatnonzero(robots)
        named = [self.values.names[index] for index in indices[:MAX_NAMED].tolist()]
        firing = ShownFiring(
            self._fired,
            alert.number,
            alert.text,
            self.values.time(),
            alert.count,
            listed(named, MAX_NAMED, len(indices)),
        )
        self._firings.append((firing, robots))
        for listener in (self.marked, *self.listeners):
            listener(firing)

    def shown(self) -> Alerts:
        """As a page shows them."""
        alerts = [
            ShownAlert(each.number, each.text, each.above, each.muted, each.count, each.fired, each.trouble)
            for each in self._alerts
        ]
        return Alerts(alerts, [firing for firing, _ in list(self._firings)[-MAX_SHOWN:]])


class AlertSource(Protocol):
    """A desk with alerts."""

    @property
    def alerts(self) -> AlertBoard: ...


@answers()
def add_alert(source: AlertSource, asked: AddAlert) -> Alerted:
    """Watch a test."""
    source.alerts.add(asked.text, asked.above)
    return Alerted(asked.serial)


@answers()
def mute_alert(source: AlertSource, asked: MuteAlert) -> Alerted:
    """Let an alert fire without a word, or no longer."""
    source.alerts.mute(asked.alert, asked.muted)
    return Alerted(asked.serial)


@answers()
def remove_alert(source: AlertSource, asked: RemoveAlert) -> Alerted:
    """Watch a test no longer."""
    source.alerts.remove(asked.alert)
    return Alerted(asked.serial)


@answers()
def fired(source: AlertSource, asked: Fired) -> Alerted:
    """For which robots an alert has fired."""
    return Alerted(asked.serial, source.alerts.robots(asked.firing))
