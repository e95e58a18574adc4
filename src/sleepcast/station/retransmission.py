"""What is sent again, for robots that are not accounted for.

For STOP until all have confirmed or a person gives up; for everything else while it is good. A STOP, a RELEASE and a
question are sent again as a new message that names the first one and the robots that are to answer; a command, which
must not be evaluated twice, goes out as it was, and its answer is requested.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from math import inf

import msgspec
import numpy as np

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import AGAIN, AGE, FIRST, FOR, NOT, WITHIN
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.mind.authority import is_ended_by, mark_of
from sleepcast.station.roster import Roster
from sleepcast.station.sent import REPEAT_AFTER, Command, SentCommands
from sleepcast.station.validation import DEADLINE

SETTLE = 0.15
"""Seconds after the time for answers before a robot counts as missed: for a tick, and the way there and back."""
MAX_NAMED = 400
"""Names in a message that is sent again: two to four datagrams; where more are missed, all robots answer again."""
MAX_IN_STOP = 700
"""Bytes of names in a STOP: it stays one datagram, because in a flood of forgeries each datagram may be lost."""
RELEASE_SELDOM = 30.0
"""Seconds between two RELEASEs for robots that stay silent, at most: it has no deadline, and they may come back."""
MAX_AGAIN = 4_096
"""Messages sent again whose answers are still known to be meant for the first one."""
LATCHING = frozenset({Kind.STOP, Kind.RELEASE})


class Retransmission:
    """Of one desk.

    delivery: where messages leave
    sent, roster: the desk's own
    within: seconds over which so many robots are to spread their answers
    note: called with each command of which something is sent again
    over: with each that has timed out
    """

    def __init__(
        self,
        delivery: ReliableDelivery,
        sent: SentCommands,
        roster: Roster,
        within: Callable[[int], float],
        note: Callable[[Command], None],
        over: Callable[[Command], None],
    ) -> None:
        self._delivery, self._sent, self._roster, self._within = delivery, sent, roster, within
        self._note, self._over = note, over
        self._due: dict[str, float] = {}
        """When those that are not accounted for are next asked again, s, by the id of the command."""
        self._first: OrderedDict[str, str] = OrderedDict()
        """Of messages sent again, by their ids, that of the first one."""
        self._given_up: str | None = None
        """The id of the STOP that was given up."""

    def begin(self, command: str, answered: float) -> None:
        """Go after this command once the time for its answers is over (s of Unix time)."""
        self._due[command] = answered + SETTLE

    def give_up(self, command: str) -> None:
        """Wait no longer for answers to this command."""
        self._given_up = command
        self._end(command)

    def end(self) -> None:
        """Go after nothing any more."""
        for command in list(self._due):
            self._end(command)

    def _end(self, command_id: str) -> None:
        command = self._sent.find(command_id)
        if self._due.pop(command_id, None) is not None and command is not None:
            self._over(command)

    def overtaken(self, by: Message) -> None:
        """Another operator has stopped or released the robots: our message to the contrary is over. A RELEASE that does
        not name our STOP ends it on no robot."""
        latch = self._sent.latch
        if latch is None or by.kind not in LATCHING or latch.kind is by.kind:
            return
        if by.kind is Kind.STOP or is_ended_by(mark_of(latch.message), by):
            latch.ended_by = by.sender
            self.give_up(latch.id)

    def due(self) -> float:
        """When there is something to be sent again, s of Unix time."""
        return min(self._due.values(), default=inf)

    def known(self, message: Message) -> Message:
        """A robot's message, in which an answer to a repeated message names the first one."""
        first = self._first.get(str(message.body.get("command"))) if self._first else None
        return message if first is None else msgspec.structs.replace(message, body={**message.body, "command": first})

    def attend(self, now: float) -> None:
        """Ask those again that are not accounted for."""
        latch = self._sent.latch
        if latch is not None and latch.kind is Kind.STOP and latch.id != self._given_up:
            latch.extend()
            if latch.n_silent:
                self._due.setdefault(latch.id, now)
        for command_id, when in list(self._due.items()):
            if when <= now:
                self._pursue(command_id, now)

    def _pursue(self, command_id: str, now: float) -> None:
        command = self._sent.find(command_id)
        if command is None or not self._still_good(command, now):
            self._end(command_id)
            return
        silent = int(np.count_nonzero(command.owing(now))) + command.n_nameless
        if not silent and command.waits and command.instant is not None:
            self._due[command_id] = command.instant + self._within(command.addressed) + SETTLE
            return
        if not silent:
            self._end(command_id)
            return
        within = self._within(min(silent, MAX_NAMED) if command.kind is Kind.COMMAND else silent)
        self._note(command)
        if command.kind is Kind.COMMAND:
            self._ask_again(command, within, now)
        else:
            self._send_again(command, within, now)
        pause, age = 0.0, now - command.message.issued
        if command.kind is Kind.STOP:
            pause = REPEAT_AFTER
        elif age > DEADLINE:  # less and less often, since a command may be good for an hour, and a RELEASE has no end
            pause = min(age / 2.0, RELEASE_SELDOM if command.kind is Kind.RELEASE else inf)
        self._due[command_id] = now + max(within + SETTLE, pause)

    def _ask_again(self, command: Command, within: float, now: float) -> None:
        """Have those that are missed say their answer again. They may have missed the command as well: it goes
        out once more, which no robot evaluates twice."""
        self._delivery.repeat(command.message.sequence, now)
        missed = self._missed(command, now)
        if not missed:  # not everybody: those that are known first
            places = np.flatnonzero(command.owing(now))[:MAX_NAMED].tolist()
            missed = {FOR: [self._roster.names[place] for place in places]}
        body = {AGAIN: command.id, WITHIN: within, **missed}
        self._delivery.post(Kind.ASK, now, deadline=now + DEADLINE, body=body)

    def _send_again(self, command: Command, within: float, now: float) -> None:
        message = command.message
        body = {
            **message.body,
            FIRST: command.id,
            AGE: now - message.issued,
            WITHIN: within,
            **self._missed(command, now),
        }
        deadline = None if message.kind is Kind.RELEASE else message.deadline
        again = self._delivery.post(message.kind, now, text=message.text, deadline=deadline, body=body)
        self._first[again.id] = command.id
        if len(self._first) > MAX_AGAIN:
            self._first.popitem(last=False)

    def _still_good(self, command: Command, now: float) -> bool:
        """Whether it is still to be gone after: of STOP and RELEASE only the last one is, a one-shot command until its
        deadline, all else for `DEADLINE`."""
        if command.kind in LATCHING:
            return command is self._sent.latch
        message = command.message
        if command.kind is Kind.COMMAND and not message.standing:
            return now < (
                message.deadline if command.instant is None else max(message.deadline, command.instant + DEADLINE)
            )
        return now < min(message.deadline, message.issued + DEADLINE)

    def _missed(self, command: Command, now: float) -> dict[str, object]:
        """Which robots are to answer a repeated message, as fields of its body: all, if there are too many names."""
        names, owing = self._roster.names, command.owing(now)
        missed = [names[at] for at in np.flatnonzero(owing).tolist()]
        if _fits(command.kind, missed) and not command.n_nameless:
            return {FOR: missed}
        answered = command.answers.codes > 0
        answered[: len(owing)] &= ~owing
        there = [names[place] for place in np.flatnonzero(answered).tolist()]
        if FOR not in command.message.body and _fits(command.kind, there):
            return {NOT: there}
        return {}


def _fits(kind: Kind, names: Sequence[str]) -> bool:
    """Whether this number of names fits into a message of this kind."""
    if kind is not Kind.STOP:
        return len(names) <= MAX_NAMED
    return len(names) <= MAX_NAMED and sum(len(name.encode()) + 2 for name in names) <= MAX_IN_STOP
