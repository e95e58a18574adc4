"""Speech: what robots say, kept as it was said - by many at once - and turned into messages when somebody looks.

A command to a hundred thousand robots brings a hundred thousand answers; as columns they cost nothing until they are
read, robot by robot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import Kind, Message
from sleepcast.fleet.columns import Column, FleetState, Index, Mask, Rows
from sleepcast.fleet.limits import MAX_OUTBOX, REPORTS_A_SECOND
from sleepcast.language.vocabulary import TIME_SLOT

Body = dict[str, object]
Answered = tuple[str, float, str]
"""What came of a message on one robot: the sort of outcome, the value and the first fault, "" for none."""


class Saying(NamedTuple):
    """What some robots said at once. places: of the robots in what `body` and `text` were made for."""

    kind: Kind
    robots: Index
    places: Index
    sequences: NDArray[np.int32]
    issued: Column
    lasts: float
    text: Callable[[int], str]
    body: Callable[[int], Body]


class Speech:
    """The outboxes of a fleet. names: of the robots."""

    def __init__(self, state: FleetState, names: Sequence[str]) -> None:
        self._state, self._names = state, names
        self.epoch = 0
        self._sayings: list[Saying] = []
        self._outboxes: dict[int, list[Message]] = {}
        self._pings: dict[int, list[float]] = {}

    def say(
        self,
        kind: Kind,
        rows: Rows,
        body: Callable[[int], Body] = lambda place: {},
        text: Callable[[int], str] = lambda place: "",
        lasts: float = inf,
    ) -> None:
        """Say something on each of these robots. body, text: of the robot at each place among them."""
        if rows.size == 0:
            return
        state = self._state
        if (state.said[rows.index] >= MAX_OUTBOX).any():
            self._count_again(rows)
        room = state.said[rows.index] < MAX_OUTBOX
        if not room.all():
            state.lost[rows.take(~room).index] += 1
            rows, places = rows.take(room), np.flatnonzero(room)
        else:
            places = np.arange(rows.size)
        state.said[rows.index] += 1
        state.sequence[rows.index] += 1
        issued = state.column(TIME_SLOT, rows).copy()
        self._sayings.append(
            Saying(kind, rows.robots, places, state.sequence[rows.index].copy(), issued, lasts, text, body)
        )

    def _count_again(self, rows: Rows) -> None:
        """Outboxes that seem full may have been emptied since."""
        self._deliver_all()
        for robot in rows.robots[self._state.said[rows.index] >= MAX_OUTBOX].tolist():
            self._state.said[robot] = len(self._outboxes.get(robot, ()))

    def report(self, rows: Rows, label: str, values: Sequence[Column] = ()) -> None:
        """REPORT on each of these robots."""

        def body(place: int) -> Body:
            found = [float(column[place]) for column in values]
            return {"label": label, "values": [None if v != v else v for v in found]}

        heard = self._within_rate(rows)
        if heard.all():
            self.say(Kind.REPORT, rows, body)
        else:
            places = np.flatnonzero(heard)
            self._state.lost[rows.take(~heard).index] += 1
            self.say(Kind.REPORT, rows.take(heard), lambda place: body(int(places[place])))

    def _within_rate(self, rows: Rows) -> Mask:
        """Which of the robots have not reported too much in this second of their clock; they have done so once more."""
        state = self._state
        seconds = state.column(TIME_SLOT, rows).astype(np.int32)
        before = np.where(state.reported_in[rows.index] == seconds, state.reported[rows.index], 0)
        state.reported_in[rows.index] = seconds
        state.reported[rows.index] = before + 1
        return before < REPORTS_A_SECOND

    def answer(self, message: Message, rows: Rows, outcome: Callable[[int], Answered]) -> None:
        """Answer a message on each of these robots."""

        def body(place: int) -> Body:
            sort, value, fault = outcome(place)
            known = None if value != value else value
            return {"command": message.id, "outcome": sort, "value": known, "fault": fault or None}

        self.say(Kind.ANSWER, rows, body)

    def ping(self, rows: Rows, castes: Column) -> None:
        """PING on each of these robots."""
        for robot, caste in zip(rows.robots.tolist(), castes.tolist(), strict=True):
            pings = self.pings(robot)
            if len(pings) < MAX_OUTBOX:
                pings.append(caste)
            else:
                self._state.lost[robot] += 1

    def pings(self, robot: int) -> list[float]:
        """The castes of a robot's pings; whoever sends them clears the list."""
        return self._pings.setdefault(robot, [])

    def outbox(self, robot: int) -> list[Message]:
        """What a robot has to say; whoever sends it clears the list."""
        self._deliver_all()
        return self._outboxes.setdefault(robot, [])

    def take(self) -> list[Saying]:
        """What is in no outbox yet; it will not come into one."""
        taken, self._sayings = self._sayings, []
        for saying in taken:
            self._state.said[saying.robots] -= 1
        return taken

    def _deliver_all(self) -> None:
        for saying in self._sayings:
            self._deliver(saying)
        self._sayings.clear()

    def _deliver(self, saying: Saying) -> None:
        told = zip(
            saying.robots.tolist(),
            saying.places.tolist(),
            saying.sequences.tolist(),
            saying.issued.tolist(),
            strict=True,
        )
        for robot, place, sequence, issued in told:
            self._outboxes.setdefault(robot, []).append(
                Message(
                    self._names[robot],
                    self.epoch,
                    sequence,
                    saying.kind,
                    issued,
                    issued + saying.lasts,
                    saying.text(place),
                    False,
                    saying.body(place),
                )
            )
