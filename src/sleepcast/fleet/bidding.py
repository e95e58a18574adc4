"""The part of a fleet's robots in auctions: their bids for commands with BEST or QUORUM (`mind.bidding`), and what they
call themselves by TELL (`mind.calling`).

Test and cost are evaluated for all robots at once. Whoever bids has a `Bidding` of its own from then on, as a node has;
so has a caller its `Calls`. All others have nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from math import nan
from typing import Protocol, TypeVar

import numpy as np

from sleepcast.channel.message import GRANTS, UNKNOWN, Kind, Message
from sleepcast.channel.message_batch import AnswerColumns, PlainBodies
from sleepcast.columns.machine import evaluate
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.serial import SerialError
from sleepcast.fleet.authority import FleetAuthority
from sleepcast.fleet.memory import FleetMemory
from sleepcast.fleet.schema import AuctionsState
from sleepcast.language.explain import BidStanding
from sleepcast.language.parts import Auction
from sleepcast.language.program import Program
from sleepcast.language.vocabulary import FROZEN, SLEEPING
from sleepcast.mind.bidding import Bidding, EndedBids, bid_of
from sleepcast.mind.calling import Calls
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
        self._calls: dict[int, Calls] = {}
        self.said: dict[int, list[dict[str, object]]] = {}
        """What robots say in this tick about bids and calls, by robot."""
        memory.calls = self.calls

    @property
    def busy(self) -> list[int]:
        """The robots whose auctions have something to do in the next tick, ascending."""
        return sorted({*self._of, *(robot for robot, calls in self._calls.items() if calls.is_busy)})

    def calls(self, robot: int) -> Calls | None:
        """What a robot calls, None while it is stopped."""
        if self._memory.state.stopped[robot]:
            return None
        return self._calls.get(robot) or self._calls.setdefault(robot, Calls(self._name(robot)))

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
        """A caller or a bidder says something about an auction."""
        hearing: Mapping[int, Bidding | Calls] = self._of if GRANTS in message.body else self._calls
        heard = set(robots.tolist()) if hearing else ()
        for robot, each in hearing.items():
            if robot in heard:
                each.hear(message)

    def stop(self, robots: Index) -> None:
        """STOP has come to these robots."""
        stopped = set(robots.tolist()) if self._of or self._calls else set[int]()
        for bidding in _at(self._of, stopped):
            bidding.stop()
        for calls in _at(self._calls, stopped):
            calls.stop()

    def _send(self) -> None:
        """Put what was said into the outbox: the first of each robot, then the second of each that says more."""
        said, self.said = self.said, {}
        while said:
            bodies = tuple(each.pop(0) for each in said.values())
            self._memory.outbox.say(Kind.REQUEST, Rows.of(np.array([*said], np.intp)), PlainBodies(bodies))
            said = {robot: each for robot, each in said.items() if each}

    def cancel(self, rows: Rows, sender: str) -> Column:
        """See `Bidding.cancel`."""
        counts = np.zeros(rows.size)
        for at, robot in enumerate(rows.robots.tolist() if self._of else ()):
            if robot in self._of:
                counts[at] = self._of[robot].cancel(sender)
        return counts

    def turn_over(self, parents: Index, children: Index, dead: Index) -> None:
        """Other robots, or none, are in these rows from now on, which have bid for nothing and choose nobody. What a
        grant has made of a parent ends in its child at once: the lease, which ends it in time, is the parent's."""
        for parent, child in zip(parents.tolist(), children.tolist(), strict=True) if self._of else ():
            if parent in self._of:
                one = BiddingRobot(self, child)
                for text in self._of[parent].endings(one.rules_by_key):
                    one.end(text)
        for robot in (*children.tolist(), *dead.tolist()) if self._of or self._ended or self._calls else ():
            self._of.pop(robot, None)
            self._ended.pop(robot, None)
            self._calls.pop(robot, None)

    def tick(self, rows: Rows, now: float) -> None:
        """Do what is due on these robots."""
        if not self._of and not self._calls:
            return
        here = set(rows.robots.tolist())
        for robot in [robot for robot in self.busy if robot in here]:
            one = BiddingRobot(self, robot)
            if robot in self._of:
                self._of[robot].tick(one, now)
            for grants in self._calls[robot].tick(now) if robot in self._calls else ():
                one.say_bid(grants.body())
        self._send()
        self._of = {robot: bidding for robot, bidding in self._of.items() if bidding.is_busy}
        self._calls = {robot: calls for robot, calls in self._calls.items() if calls.is_busy}

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

    def state(self) -> AuctionsState:
        """All bids and calls, by robot."""
        calls = {robot: calls.state() for robot, calls in sorted(self._calls.items())}
        return AuctionsState({robot: bidding.state() for robot, bidding in sorted(self._of.items())}, calls)

    def restore(self, state: AuctionsState) -> None:
        """Have what was kept. Raises SerialError and MisuseError."""
        if not all(0 <= robot < self._memory.state.count for robot in (*state.bids, *state.calls)):
            raise SerialError("a robot that is not there takes part in an auction")
        self._of = {robot: Bidding.restored(each) for robot, each in state.bids.items()}
        self._ended = {robot: bidding.ended for robot, bidding in self._of.items()}
        for robot, calls in state.calls.items():
            self._calls[robot] = Calls(self._name(robot))
            self._calls[robot].restore(calls)


Of = TypeVar("Of")


def _at(table: Mapping[int, Of], robots: Set[int]) -> list[Of]:
    return [each for robot, each in table.items() if robot in robots]


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
        stopped = bool(self._memory.state.stopped[self._robot])
        return stopped or self._authority.catching_up.of(self._robot) or self.is_at_rest

    @property
    def is_at_rest(self) -> bool:
        return any(self._memory.state.column(slot, self._row)[0] > 0 for slot in (SLEEPING, FROZEN))

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
        self._bids.said.setdefault(self._robot, []).append(body)


def _outcome_at(answers: AnswerColumns, at: int) -> EvaluatedCommand:
    fault = int(answers.fault[at])
    reason = answers.faults[fault - 1] if fault else ""
    return EvaluatedCommand(answers.outcomes[answers.outcome[at]], float(answers.value[at]), reason)
