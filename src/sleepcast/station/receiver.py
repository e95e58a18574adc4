"""What a desk hears: who is there, what robots answer, report and tell of themselves, and the journal of it all.

Robots speak one by one or many at once; what they say finds the command that it is about, and the robot's place on the
roster. Every public method may be called from any thread.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from threading import RLock

import numpy as np

from sleepcast.channel import Kind, Message
from sleepcast.channel.message_batch import Answers, MessageBatch
from sleepcast.channel.payload import TOLD
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.station.account import SentCommands
from sleepcast.station.answers import answer_from
from sleepcast.station.journal.journal import Event, Journal, MemoryJournal, Report
from sleepcast.station.journal.write_batch import PendingEntry, WriteBatch
from sleepcast.station.minds import FleetTelemetry, ManyMinds, Mask, Minds, Telemetry
from sleepcast.station.preview import Rows
from sleepcast.station.roster import Index, Roster

MAX_REPORTS = 1_000
"""Latest reports that are kept for the page."""
MANY = "robots"
"""Who spoke, in the journal, where many said the same sort of thing at once."""


class Hearing:
    """The ears and the memory of one desk. operator: whose it is; minds: as for `Station`."""

    def __init__(self, operator: str, minds: Minds, clock: Clock, journal: Journal | None) -> None:
        self.operator = operator
        self.notes = WriteBatch(MemoryJournal() if journal is None else journal)
        self.reports: deque[Report] = deque(maxlen=MAX_REPORTS)
        """What robots said unasked, the latest last."""
        self._minds, self._clock = minds, clock
        self._roster = Roster(minds.names if isinstance(minds, ManyMinds) else minds, len(minds))
        self._rows = Rows(minds)
        self._told: FleetTelemetry | None = minds.telemetry if isinstance(minds, ManyMinds) else None
        self._sent = SentCommands()
        self._lock = RLock()

    @property
    def journal(self) -> Journal:
        """Everything that was sent, heard and decided."""
        return self.notes.journal

    @property
    def trouble(self) -> str:
        """What is wrong with the journal, for a person; "" while nothing is."""
        return self.notes.trouble

    @property
    def names(self) -> Sequence[str]:
        """Of all robots on the roster, in its order."""
        return self._roster.names

    @property
    def roster(self) -> dict[str, float | None]:
        """Every robot by name, with the time at which it was last heard (s of the desk's clock), None if never."""
        with self._lock:
            heard = self._roster.heard.tolist()
            return {name: at if at > -inf else None for name, at in zip(self._roster.names, heard, strict=False)}

    @property
    def fleet_size(self) -> int:
        """How many robots there are at least, heard or not; 0 where nobody has said."""
        return self._roster.size

    # ---- what comes in

    def hear(self, message: Message) -> None:
        """Take in what a robot says: an ANSWER to a command, a REPORT, or anything that shows that it is there."""
        with self._lock:
            now = self._clock.now()
            place = self._roster.hear(message.sender, now)
            if message.kind is Kind.REPORT:
                self.reports.append(Report(message.sender, now, message.body))
            elif message.kind is Kind.ANSWER:
                command = self._sent.find(message.body.get("command"))
                answer = answer_from(message.body, now)
                if command is not None and answer is not None and place is not None:
                    command.answers.add(place, answer)
                if TOLD in message.body or (command is not None and command.is_look):
                    return
            else:
                return
            details = {"kind": message.kind.value, **message.body}
            subject = message.body.get("command", "")
            self._note(Event.HEARD, message.sender, subject=str(subject), details=details)

    def hear_many(self, batch: MessageBatch) -> None:
        """Take in what many robots say at once; their places are those of the roster. Reports are heard one by one, as
        many as are kept; answers are one entry in the journal."""
        said = batch.words
        if not isinstance(said, Answers):
            for message in batch.take(slice(-MAX_REPORTS, None)).messages():
                self.hear(message)
        with self._lock:
            now = self._clock.now()
            self._roster.heard[batch.robots] = now
            if isinstance(said, Answers):
                command = self._sent.find(said.command)
                if command is not None:
                    command.answers.take(batch.robots, batch.places, said, now)
                counts = np.bincount(said.sort[batch.places], minlength=len(said.sorts)).tolist()
                found = {word: count for word, count in zip(said.sorts, counts, strict=True) if count}
                details = {"kind": batch.kind.value, "robots": len(batch), "outcomes": found}
                self._note(Event.HEARD, MANY, subject=said.command, details=details)

    def observe(self, now: float, rows: Iterable[Telemetry]) -> None:
        """Take in telemetry of `now` (s of the desk's clock): what robots tell of themselves. Nodes are such rows."""
        with self._lock:
            told, stopped = [], []
            for row in rows:
                place = self._roster.enrol(row.name)
                if place is not None:
                    self._rows.take(place, row)
                    told.append(place)
                    stopped.append(row.stopped)
            robots = np.array(told, np.intp)
            self._roster.observe(robots, now)
            self._update_latch(robots, np.array(stopped, np.bool_), now)

    def observe_many(self, now: float, robots: Index) -> None:
        """The same of these robots, whose minds answer for many. Raises MisuseError for minds that do not."""
        if self._told is None:
            raise MisuseError("these minds tell one by one: give their rows to observe")
        with self._lock:
            self._told.take(robots)
            self._roster.observe(robots, now)
            if self._sent.latch is not None:
                self._update_latch(robots, self._told.stopped(robots), now)

    def _update_latch(self, robots: Index, stopped: Mask, now: float) -> None:
        """Robots that tell that they are stopped, or not, account for a STOP or RELEASE that was sent before."""
        latest = self._sent.latch
        if latest is None or now < latest.message.issued:
            return
        there = robots[stopped == (latest.kind is Kind.STOP)]
        said = Answers.alike(latest.id, len(there), "stopped")
        latest.answers.take(there, np.arange(len(there)), said, now)

    def _note(
        self,
        event: Event,
        who: str = "",
        *,
        subject: str = "",
        text: str = "",
        details: Mapping[str, object],
        first: bool = False,
    ) -> None:
        """Write an entry. first: before what it tells happens; then it raises JournalError."""
        with self._lock:
            note = PendingEntry(self._clock.now(), who or self.operator, event, subject, text, details)
            (self.notes.write_first if first else self.notes.write)(note)
