"""A mission in a program's hands: lines with their times, what shall become of each, and what became of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, overload

from sleepcast.core.records import dataclass
from sleepcast.simulator.scenario.mission import Instruction, Order, instruction, parse_mission

if TYPE_CHECKING:
    from sleepcast.api.results import CommandResult


@dataclass(frozen=True)
class MissionLine:
    """A line of a mission.

    time: s of the run.
    text: what is sent, with the words before it, as in a script.
    wanted: what shall have become of it when the run ends, in words, as "matched 98, unknown at most 3"; "" for no
        matter.
    result: what became of it; None while it is not sent, and of HOLD and AWAY.
    sent: whether it was given.
    """

    order: Order
    result: CommandResult | None = None
    sent: bool = False

    @property
    def time(self) -> float:
        return self.order.time

    @property
    def text(self) -> str:
        return self.order.text

    @property
    def wanted(self) -> str:
        return ", ".join(map(str, self.order.wanted))

    @property
    def instruction(self) -> Instruction:
        """What the words before its text mean."""
        return instruction(self.order)

    @property
    def unmet(self) -> tuple[str, ...]:
        """A sentence for each count that is not as wanted now; none while it is not sent."""
        return () if self.result is None else self.result.unmet

    def __repr__(self) -> str:
        state = "sent" if self.sent else "not sent"
        wanted = f"; wanted {self.wanted}" if self.wanted else ""
        return f"{self.order.in_short()} [{state}{wanted}]{''.join(f' {each}' for each in self.unmet)}"


class Mission(Sequence[MissionLine]):
    """A sequence of lines in the order of their times; `Fleet.send` takes one. Raises MissionError.

    text: a mission script.
    name: of its file, for errors.
    """

    def __init__(self, text: str = "", name: str = "the script") -> None:
        self._lines = tuple(MissionLine(order) for order in parse_mission(text, name))

    @classmethod
    def of(
        cls,
        orders: Sequence[Order],
        results: Mapping[int, CommandResult] | None = None,
        wordless: Collection[int] = (),
    ) -> Mission:
        """These orders.

        results: of those that were sent, by index.
        wordless: the indices of those that were given, too, and have no result.
        """
        mission, results = cls(), results or {}
        mission._lines = tuple(
            MissionLine(order, results.get(number), number in results or number in wordless)
            for number, order in enumerate(orders)
        )
        return mission

    @overload
    def __getitem__(self, index: int) -> MissionLine: ...
    @overload
    def __getitem__(self, index: slice) -> Mission: ...
    def __getitem__(self, index: int | slice) -> MissionLine | Mission:
        if isinstance(index, int):
            return self._lines[index]
        some = Mission()
        some._lines = self._lines[index]
        return some

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def rest(self) -> Mission:
        """The lines that were not sent yet."""
        some = Mission()
        some._lines = tuple(line for line in self._lines if not line.sent)
        return some

    def sentence(self, by_itself: bool = False, halted: bool = False) -> str:
        """How far it is, and how to play it; "" for none.

        by_itself: whether the desk sends the rest at its times.
        halted: whether STOP has ended that.
        """
        if not self:
            return ""
        commands, rest = f"{len(self)} command{'s' * (len(self) > 1)}", len(self.rest)
        if not rest:
            return f"its mission of {commands} was sent"
        sent = "none was sent" if rest == len(self) else f"{len(self) - rest} sent"
        if by_itself:
            return f"a mission of {commands}, {sent}: the rest is sent by itself while time passes"
        if halted:
            return f"a mission of {commands}, {sent}: STOP ended it; fleet.release(), then fleet.play() sends the rest"
        what = f"{'it' if len(self) == 1 else 'them'} at {'its time' if len(self) == 1 else 'their times'}"
        return f"a mission of {commands}, {sent}: fleet.play() sends {what if rest == len(self) else 'the rest'}"

    def __repr__(self) -> str:
        return "\n".join(map(repr, self)) or "no mission"
