"""The STOP latch: which STOPs hold a robot, and which are over. Sequence numbers decide that, not clocks.

A STOP is identified by its mark: its sender, the sender's epoch, and its number; a STOP that is sent again keeps its
first mark. A RELEASE ends the STOPs that its sender sent before it in the same epoch, and those of others that it
names. So a STOP that comes late changes nothing if a RELEASE has ended it, and a RELEASE that comes late ends no STOP
that its sender did not know. Any other STOP stops the robot: in doubt it stands still.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf
from typing import NamedTuple

from sleepcast.channel.message import ENDS, FIRST, MAX_NAME, MAX_NUMBER, Message, age_of, message_id

MAX_MARKS = 64
"""Senders, per epoch, whose STOPs hold at once, and as many whose ended STOPs are remembered; the one that was silent
longest is forgotten."""


Life = tuple[str, int]
"""A sender and one of its epochs."""


class Mark(NamedTuple):
    """A STOP, and all earlier ones of the same sender and epoch."""

    sender: str
    epoch: int
    number: int

    @property
    def id(self) -> str:
        return message_id(*self)

    @property
    def life(self) -> Life:
        return self.sender, self.epoch

    def covers(self, other: Mark) -> bool:
        """Whether the other STOP is one of these."""
        return self.life == other.life and self.number >= other.number


class Latch(NamedTuple):
    """The STOPs of one robot. holding: the latest STOP of each sender that no RELEASE has ended; ended: the STOP of
    each sender up to which all are over."""

    holding: tuple[Mark, ...] = ()
    ended: tuple[Mark, ...] = ()

    def stop(self, message: Message) -> Latch | None:
        """The latch after a STOP; None if the STOP is over already."""
        mark = mark_of(message)
        if any(each.covers(mark) for each in self.ended):
            return None
        return Latch(_with(self.holding, [mark]), self.ended)

    def release(self, message: Message) -> Latch | None:
        """The latch after a RELEASE; the robot is free if no STOP is left. None for a malformed RELEASE. A named STOP
        of somebody else ends only if it has arrived: one that comes later stops the robot, whatever a RELEASE names."""
        if age_of(message.body) == inf:
            return None
        own = mark_of(message)
        ends = [own, *marks_of(message.body.get(ENDS))]
        ended = [held for held in self.holding if any(each.covers(held) for each in ends)]
        return Latch(tuple(held for held in self.holding if held not in ended), _with(self.ended, [*ended, own]))

    def refusal(self) -> str:
        """Why a robot with this latch stays stopped after a RELEASE."""
        held = ", ".join(mark.id for mark in self.holding)
        return f"the STOP {held} holds: the RELEASE does not name it" if held else "a RELEASE that cannot be read"


ENDED = "a RELEASE that was sent later has ended this STOP"
"""The reason why a STOP is not obeyed."""


def mark_of(message: Message) -> Mark:
    """The mark of a STOP; for a RELEASE, the mark of the STOPs that were sent before it."""
    sender, epoch, number = message.sender, message.epoch, message.sequence
    first = message.body.get(FIRST)
    if isinstance(first, str) and first.startswith(f"{sender}-{epoch}."):
        said = first.rpartition(".")[2]
        if len(said) <= len(str(MAX_NUMBER)) and said.isascii() and said.isdigit():
            number = min(number, int(said))
    return Mark(sender, epoch, number)


def marks_of(said: object) -> list[Mark]:
    """The marks in a body's field; malformed ones are left out."""
    return [mark for mark, _ in marks_and_ages(said)]


def marks_and_ages(said: object) -> list[tuple[Mark, float]]:
    """The same, each with its age in s, 0 if it has none."""
    found = []
    for each in said[:MAX_MARKS] if isinstance(said, list | tuple) else ():
        match each:
            case [str() as sender, int() as epoch, int() as number, *rest]:
                if len(sender) <= MAX_NAME and 0 <= epoch <= MAX_NUMBER and 0 <= number <= MAX_NUMBER:
                    age = rest[0] if rest and isinstance(rest[0], float) and rest[0] >= 0.0 else 0.0
                    found.append((Mark(sender, epoch, number), age))
    return found


def restored(state: Mapping[str, object]) -> Latch:
    """The latch that was saved with `_asdict`; missing fields are empty."""
    return Latch(*(_with((), marks_of(state.get(sort))) for sort in Latch._fields))


def _with(marks: Iterable[Mark], more: Iterable[Mark]) -> tuple[Mark, ...]:
    """The highest mark of each sender and epoch, the latest ones last."""
    found = {mark.life: mark for mark in marks}
    for mark in more:
        found[mark.life] = max(found.pop(mark.life, mark), mark)
    return tuple(found.values())[-MAX_MARKS:]
