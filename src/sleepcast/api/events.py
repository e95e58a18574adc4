"""What robots do, as it happens: answers, faults, reports and joins, each as an event."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Literal

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import MATCHED, TELEMETRY
from sleepcast.core.errors import printable
from sleepcast.core.records import dataclass
from sleepcast.language import format_value
from sleepcast.language.reading_units import report_in_words
from sleepcast.station import Outcome
from sleepcast.station.sent import answer_from

MAX_EVENTS = 1_000_000
"""Events that wait to be taken; of more, the oldest are lost."""


@dataclass(frozen=True, slots=True)
class FleetEvent:
    """What a robot did.

    time: s, see `Fleet.time`.
    kind: `answer` to a command, `fault`, `say` or `join`.
    robot: its name.
    text: the outcome; what went wrong; what it reported; the group.
    command: the id of the command of an answer.
    value: what it came to, SI; None for unknown.
    """

    time: float
    kind: Literal["answer", "fault", "say", "join"]
    robot: str
    text: str
    command: str = ""
    value: float | None = None


class EventQueue:
    """Events that have not been taken yet.

    now: gives the time, s.
    groups: gives the members of each group now.
    """

    def __init__(self, now: Callable[[], float], groups: Callable[[], Mapping[str, tuple[str, ...]]]) -> None:
        self._now, self._groups, self._known = now, groups, groups()
        self._events: deque[FleetEvent] = deque(maxlen=MAX_EVENTS)

    def hear(self, messages: list[Message]) -> None:
        """Take in messages of robots. Telemetry, and answers to the desk's own questions, are no events."""
        for message in messages:
            if message.kind is Kind.REPORT:
                self._events.append(FleetEvent(self._now(), "say", message.sender, printable(_exactly(message))))
            elif message.kind is Kind.ANSWER and not message.body.keys() & {TELEMETRY, MATCHED}:
                self._answered(message)

    def _answered(self, message: Message) -> None:
        answer = answer_from(message.body, self._now())
        if answer is not None:
            wrong = answer.outcome is Outcome.FAULT
            text = printable(answer.fault or "") if wrong else answer.outcome.value
            command = str(message.body.get("command", ""))
            kind: Literal["answer", "fault"] = "fault" if wrong else "answer"
            self._events.append(FleetEvent(self._now(), kind, message.sender, text, command, answer.value))

    def take(self) -> list[FleetEvent]:
        """The events since the last call."""
        before, self._known = self._known, self._groups()
        for group, members in self._known.items():
            if members != before.get(group):
                old = set(before.get(group, ()))
                joined = (FleetEvent(self._now(), "join", name, group) for name in members if name not in old)
                self._events.extend(joined)
        return [self._events.popleft() for _ in range(len(self._events))]


def in_words(message: Message) -> str:
    """What a robot says, for people: a report as its label and values, anything else as its kind and text."""
    if message.kind is not Kind.REPORT:
        return f"{message.kind.value} {message.text}"
    return report_in_words(message.body.get("label"), message.body.get("values"))


def _exactly(message: Message) -> str:
    """A report for a program: its label and the very numbers."""
    values = message.body.get("values")
    shown = [format_value(each) for each in values if isinstance(each, float)] if isinstance(values, list) else []
    return " ".join([str(message.body.get("label", "")), *shown])
