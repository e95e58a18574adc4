"""The bids of a fleet's robots for commands with BEST or QUORUM (`mind.bidding`).

Test and cost are evaluated for all robots at once. Whoever bids has a `Bidding` of its own from then on, as a node has;
robots without a bid have nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import nan
from typing import Protocol

import numpy as np

from sleepcast.channel.message import GRANTS, UNKNOWN, Kind, Message
from sleepcast.channel.message_batch import AnswerColumns, PlainBody
from sleepcast.columns.machine import evaluate
from sleepcast.columns.values import Index, Mask, Rows
from sleepcast.core.serial import SerialError
from sleepcast.fleet.authority import FleetAuthority
from sleepcast.fleet.memory import FleetMemory
from sleepcast.language.explain import BidStanding
from sleepcast.language.parts import Auction
from sleepcast.language.program import Program
from sleepcast.mind.bidding import Bidding, BiddingState, EndedBids, bid_of
from sleepcast.mind.rules import Rule
from sleepcast.mind.views import EvaluatedCommand


class TextEvaluator(Protocol):
    """What evaluates for the bids, see `Obeying`."""

    def programs(self, text: str, rows: Rows) -> Iterable[tuple[Program | str, Rows]]: ...

    def outcomes(self, message: Message, text: str, rows: Rows, now: float) -> Iterator[tuple[Rows, AnswerColumns]]: ...


class FleetBids:
    """See the module."""

    def __init__(self, memory: FleetMemory, authority: FleetAuthority, evaluator: TextEvaluator) -> None:
        self._memory, self._authority, self._evaluator = memory, authority, evaluator
        self._of: dict[int, Bidding] = {}
        self._ended: dict[int, EndedBids] = {}
        """Of robots that have bid, or would have if they had known their cost."""

    @property
    def busy(self) -> list[int]:
        """The robots whose bids have something to do in the next tick, ascending."""
        return sorted(self._of)

    def poll(self, message: Message, auction: Auction, rows: Rows, now: float) -> None:
        """Let robots bid for a command, or answer why they do not."""
        asked = rows.take(np.array([self._may_bid(message, robot) for robot in rows.robots.tolist()], np.bool_))
        for some, answers in self._evaluator.outcomes(message, auction.bid, asked, now):
            left = np.ones(some.size, np.bool_)
            for at, robot in enumerate(some.robots.tolist()):
                found = _outcome_at(answers, at)
                outcome = bid_of(found)
                if outcome.word == "matched":
                    self._bidding(robot).begin(message, auction, self._name(robot), outcome.value, now)
                    left[at] = False
                    continue
                if robot in self._of:
                    self._of[robot].withdraw(message)
                if found.word == "matched":
                    self._ended_of(robot).note_unsure(message, auction, found)
            self._answer(message, some, answers, left)

    def _may_bid(self, message: Message, robot: int) -> bool:
        """Whether a robot is to look at its test and cost; it answers if it cannot bid now."""
        bidding, one = self._of.get(robot, _NOBODY), BiddingRobot(self, robot)
        if refusal := bidding.refusal(message, held_still=one.is_held_still):
            one.answer(message, "fault", nan, refusal, {})
        return not refusal and not bidding.is_member(message)

    def _answer(self, message: Message, rows: Rows, answers: AnswerColumns, who: Mask) -> None:
        """Let those who do not bid answer so; of a cost that is unknown, that this is so."""
        unknown = (
            who & (answers.outcome == answers.outcomes.index("matched")) if "matched" in answers.outcomes else ~who
        )
        unknown &= who
        told = who & ~unknown
        few = AnswerColumns(
            *(answers.command, answers.outcomes, answers.outcome[told], answers.value[told]),
            *(answers.faults, answers.fault[told]),
        )
        self._memory.outbox.answer(rows.take(told), few)
        self._memory.outbox.answer_alike(message, rows.take(unknown), UNKNOWN)

    def hear(self, message: Message, robots: Index) -> None:
        """A caller says something about its auction."""
        if GRANTS in message.body and self._of:
            heard = set(robots.tolist())
            for robot, bidding in self._of.items():
                if robot in heard:
                    bidding.hear(message)

    def stop(self, robots: Index) -> None:
        """STOP has come to these robots."""
        for robot in self._of.keys() & set(robots.tolist()) if self._of else ():
            self._of[robot].stop()

    def tick(self, rows: Rows, now: float) -> None:
        """Do what is due on these robots."""
        if not self._of:
            return
        here = set(rows.robots.tolist())
        for robot in [robot for robot in self.busy if robot in here]:
            bidding = self._of[robot]
            bidding.tick(BiddingRobot(self, robot), now)
            if not bidding.is_busy:
                del self._of[robot]

    def _bidding(self, robot: int) -> Bidding:
        return self._of.setdefault(robot, Bidding(self._ended_of(robot)))

    def _ended_of(self, robot: int) -> EndedBids:
        return self._ended.setdefault(robot, EndedBids())

    def standing(self, robot: int, command: str) -> BidStanding | None:
        """See `Bidding.standing`."""
        bidding = self._of.get(robot)
        if bidding is not None:
            return bidding.standing(command)
        ended = self._ended.get(robot)
        return None if ended is None else ended.get(command)

    def _name(self, robot: int) -> str:
        return self._memory.outbox.names[robot]

    def state(self) -> dict[int, BiddingState]:
        """All bids, by robot."""
        return {robot: self._of[robot].state() for robot in self.busy}

    def restore(self, state: Mapping[int, BiddingState]) -> None:
        """Have the bids that were kept. Raises SerialError and MisuseError."""
        if not all(0 <= robot < self._memory.state.count for robot in state):
            raise SerialError("a robot that is not there bids")
        self._of = {robot: Bidding.restored(each) for robot, each in state.items()}
        self._ended = {robot: bidding.ended for robot, bidding in self._of.items()}


_NOBODY = Bidding()
"""Of robots that do not bid."""


class BiddingRobot:
    """One robot of the fleet as its bids need it (`mind.bidding.Evaluating`)."""

    def __init__(self, bids: FleetBids, robot: int) -> None:
        self._bids, self._robot, self._row = bids, robot, Rows.run(robot, robot + 1)
        self._memory, self._authority, self._evaluator = bids._memory, bids._authority, bids._evaluator

    @property
    def name(self) -> str:
        return self._bids._name(self._robot)

    @property
    def groups(self) -> frozenset[str]:
        return self._memory.state.groups_of(self._robot)

    @property
    def rules_by_key(self) -> Mapping[str, Rule]:
        return self._memory.mind_of(self._robot).rules

    @property
    def is_held_still(self) -> bool:
        return bool(self._memory.state.stopped[self._robot]) or self._authority.catching_up.of(self._robot)

    def objection(self, message: Message, text: str, now: float) -> str:
        ((program, _),) = self._evaluator.programs(text, self._row)
        if isinstance(program, str):
            return program
        ((why, _),) = self._authority.objections(message, program, self._row, now)
        return why

    def outcome_of(self, message: Message, text: str, now: float) -> EvaluatedCommand:
        ((_, answers),) = self._evaluator.outcomes(message, text, self._row, now)
        return _outcome_at(answers, 0)

    def end(self, text: str) -> None:
        ((program, _),) = self._evaluator.programs(text, self._row)
        if not isinstance(program, str):  # else it means nothing any more
            evaluate(self._memory, program, self._row)

    def answer(self, message: Message, word: str, value: float, fault: str, details: Mapping[str, object]) -> None:
        answers = AnswerColumns.alike(message.id, 1, word, value, fault, details)
        self._memory.outbox.answer(self._row, answers)

    def say_bid(self, body: dict[str, object]) -> None:
        self._memory.outbox.say(Kind.REQUEST, self._row, PlainBody(body))


def _outcome_at(answers: AnswerColumns, at: int) -> EvaluatedCommand:
    fault = int(answers.fault[at])
    reason = answers.faults[fault - 1] if fault else ""
    return EvaluatedCommand(answers.outcomes[answers.outcome[at]], float(answers.value[at]), reason)
