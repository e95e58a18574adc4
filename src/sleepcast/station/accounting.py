"""Commands that were sent and what became of each: matched, did not match, fault, or not heard from.

Silence is never taken for consent: a robot that was on the roster when the command went out and has not spoken
is silent, with the time at which it was last heard.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from sys import float_info

from sleepcast.channel import Kind, Message


class Outcome(StrEnum):
    """What a robot answers to a command."""

    MATCHED = "matched"
    NOT_MATCHED = "not matched"
    FAULT = "fault"


SAID: Mapping[str, Outcome] = {
    "matched": Outcome.MATCHED,
    "not matched": Outcome.NOT_MATCHED,
    "fault": Outcome.FAULT,
    "late": Outcome.FAULT,
    "stopped": Outcome.MATCHED,
    "released": Outcome.MATCHED,
}
"""What an outcome counts as, by the word that a robot uses. Late: it heard the command past its deadline and did
nothing, which nobody should take for a decision of its own."""
LATE = "heard after its deadline, so not evaluated"


@dataclass(frozen=True, slots=True)
class Answer:
    """What one robot answered. heard: when, in s of the desk's clock. value: of the command; None for unknown."""

    outcome: Outcome
    heard: float
    value: float | None = None
    fault: str | None = None


def answer_from(body: Mapping[str, object], now: float) -> Answer | None:
    """The answer in the body of an ANSWER heard at `now`; None if it says nothing that can be understood."""
    said = body.get("outcome")
    outcome = SAID.get(said) if isinstance(said, str) else None
    if outcome is None:
        return None
    value, fault = body.get("value"), body.get("fault")
    if said == "late":
        fault = LATE
    known = float(value) if isinstance(value, int | float) and abs(value) <= float_info.max else None
    return Answer(outcome, now, known, fault if isinstance(fault, str) else None)


@dataclass(eq=False)
class Command:
    """A message that the desk sent and keeps account of.

    addressed: the roster when it went out. predicted: the robots of which the desk was certain that they would obey.
    answers: by robot, the first answer of each.
    """

    message: Message
    addressed: tuple[str, ...]
    predicted: frozenset[str] = frozenset()
    answers: dict[str, Answer] = field(default_factory=dict)
    last_sent: float = -inf

    @property
    def id(self) -> str:
        return self.message.id

    @property
    def kind(self) -> Kind:
        return self.message.kind

    @property
    def text(self) -> str:
        """The expression; `STOP` or `RELEASE` for these two."""
        return self.message.text or self.message.kind.name

    def silent(self) -> list[str]:
        """The addressed robots that have not answered."""
        return [name for name in self.addressed if name not in self.answers]


@dataclass(frozen=True, slots=True)
class Accounting:
    """What became of one command, names in the order of the roster. For a STOP, matched means that the robot says it
    is stopped; for a RELEASE, that it is not stopped any more. last_heard: of each silent robot, the s of the desk's
    clock at which it last said anything, None if it never did. faults: of each robot with a fault, what it said."""

    command: str
    text: str
    now: float
    matched: tuple[str, ...]
    not_matched: tuple[str, ...]
    fault: tuple[str, ...]
    silent: tuple[str, ...]
    last_heard: Mapping[str, float | None]
    faults: Mapping[str, str]

    @property
    def n_matched(self) -> int:
        return len(self.matched)

    @property
    def n_not_matched(self) -> int:
        return len(self.not_matched)

    @property
    def n_fault(self) -> int:
        return len(self.fault)

    @property
    def n_silent(self) -> int:
        return len(self.silent)

    @property
    def complete(self) -> bool:
        """Whether every robot has been heard from."""
        return not self.silent

    def sentence(self) -> str:
        """The account for a person: `matched 29, did not match 970, fault 0, silent 1: r12 last heard 8 s ago`."""
        counts = (
            f"matched {self.n_matched}, did not match {self.n_not_matched}, "
            f"fault {self.n_fault}, silent {self.n_silent}"
        )
        if not self.silent:
            return counts
        shown = [f"{name} {self._ago(name)}" for name in self.silent[:SHOWN]]
        if len(self.silent) > SHOWN:
            shown.append(f"and {len(self.silent) - SHOWN} more")
        return f"{counts}: {', '.join(shown)}"

    def to_dict(self) -> dict[str, object]:
        """The counts, as the command line prints them."""
        return {
            "text": self.text,
            "matched": self.n_matched,
            "not_matched": self.n_not_matched,
            "fault": self.n_fault,
            "silent": self.n_silent,
        }

    def _ago(self, name: str) -> str:
        heard = self.last_heard[name]
        return "never heard" if heard is None else f"last heard {self.now - heard:.0f} s ago"


SHOWN = 5
"""Silent robots named in a sentence; more are counted."""


def account(command: Command, now: float, heard: Mapping[str, float]) -> Accounting:
    """The account of `command` at `now`. heard: when each robot was last heard (-inf: never)."""
    by_outcome: dict[Outcome, list[str]] = {outcome: [] for outcome in Outcome}
    for name in dict.fromkeys((*command.addressed, *command.answers)):
        answer = command.answers.get(name)
        if answer is not None:
            by_outcome[answer.outcome].append(name)
    silent = command.silent()
    return Accounting(
        command.id,
        command.text,
        now,
        tuple(by_outcome[Outcome.MATCHED]),
        tuple(by_outcome[Outcome.NOT_MATCHED]),
        tuple(by_outcome[Outcome.FAULT]),
        tuple(silent),
        {name: heard[name] if heard.get(name, -inf) > -inf else None for name in silent},
        {name: command.answers[name].fault or "" for name in by_outcome[Outcome.FAULT]},
    )
