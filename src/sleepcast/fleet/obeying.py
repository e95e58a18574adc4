"""What many robots do with a message that has waited for their tick: who may have it done, what comes of it, and what
they answer. The steps, and their order, are those of `Node`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import HELD, HOPS, KEYS, LEASE, LOOK, UNKNOWN, Kind, Message, hops_left
from sleepcast.channel.message_batch import AnswerColumns
from sleepcast.columns.evaluation import Noted, fault_text
from sleepcast.columns.machine import evaluate
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.fleet.authority import FleetAuthority
from sleepcast.fleet.bidding import FleetBids
from sleepcast.fleet.inspection import EvaluationLog, LogEntry, rehearsal
from sleepcast.fleet.memory import FleetMemory, nobody_waits
from sleepcast.fleet.state import MindNames
from sleepcast.fleet.timing import FleetTiming
from sleepcast.language.explain import foretell
from sleepcast.language.functions import MAX_HOPS
from sleepcast.language.parts import auction_of, timed_of
from sleepcast.language.program import Program
from sleepcast.language.reader import read
from sleepcast.mind.authority import bars, bars_population, driver_of, outcome_of_keys
from sleepcast.mind.inspection import NOTHING, Details, foretold
from sleepcast.mind.merging import CommandOrder, comes_after, place_of


@dataclass
class Evaluated:
    """The result of one text on the robots `rows`. Columns have one value for each of them; faults are in order.

    undecided: where its top-level test was unknown
    moved: where its bodies were asked to move
    held: where STOP holds them; None where nobody asks for that
    """

    rows: Rows
    entry: LogEntry
    values: Column
    matched: Mask
    steps: NDArray[np.int32]
    faults: list[Noted]
    printed: list[tuple[Index, str, Sequence[Column]]]
    undecided: Mask | None = None
    moved: Mask | None = None
    held: Mask | None = None


class Obeying:
    """See the module.

    look: what a robot tells about itself
    on_air: see `Fleet`
    zero: see `Node`
    """

    def __init__(
        self,
        memory: FleetMemory,
        log: EvaluationLog,
        authority: FleetAuthority,
        look: Callable[[Message, int, float], Details],
        *,
        on_air: bool,
    ) -> None:
        self._memory, self._outbox, self._log, self._authority = memory, memory.outbox, log, authority
        self._look, self._on_air, self.zero = look, on_air, 0.0
        self.bids = FleetBids(memory, authority, self)
        self.timing = FleetTiming(memory.state, memory.outbox, self._is_held_still, self._obey_text)
        """Commands that wait for their instants."""
        if on_air:
            memory.drivers = authority.drivers

    def comes_after(self, message: Message, before: Message) -> bool:
        """See `merging.comes_after`."""
        return comes_after(message, before, self.zero)

    def run(
        self, program: Program, rows: Rows, command: str = "", *, answered: bool = False, watched: bool = False
    ) -> Evaluated:
        """Evaluate a program on these robots, and log its inputs for explanations. answered: whether a person is told
        what came of it; watched: whether it matters which bodies it moves."""
        memory = self._memory
        entry = self._log.remember(program, rows, command)
        memory.hosts, memory.printed = entry.hosts, []
        if answered or watched:
            undecided, memory.moved = np.zeros((2, memory.state.count), np.bool_)
            memory.undecided = undecided if answered else None
        values = evaluate(memory, program, rows)
        steps = np.broadcast_to(np.asarray(memory.steps(rows), np.int32), rows.size)
        printed, memory.hosts, memory.printed = memory.printed, None, None
        self._log.weigh(entry)
        outcome = Evaluated(rows, entry, values, memory.matched[rows.index].copy(), steps, memory.noted, printed)
        if memory.moved is not None:
            outcome.moved = memory.moved[rows.index]
        if memory.undecided is not None and outcome.moved is not None:
            outcome.undecided = memory.undecided[rows.index]
            outcome.held = outcome.moved & memory.state.stopped[rows.index]
        memory.undecided = memory.moved = None
        return outcome

    def obey_all(self, messages: Sequence[tuple[Message, Rows]], rows: Rows, now: float) -> None:
        """Deal with the messages that have waited on robots among these, then with bids, and then with what is due."""
        for message, some in messages:
            self._obey(message, some, now)
        self.bids.tick(rows, now)
        if self.timing.is_busy:
            self.timing.run(rows, now)

    def _obey(self, message: Message, rows: Rows, now: float) -> None:
        asked = message.kind is Kind.ASK
        if now > message.deadline:
            self._outbox.answer_alike(message, rows, "late")
        elif asked and LOOK in message.body:
            self._tell_of_itself(message, rows, now)
        elif not asked and LEASE in message.body:
            for outcome, fault, some in self._authority.settle(message, rows, now):
                self._outbox.answer_alike(message, some, outcome, fault)
        elif not asked and KEYS in message.body:
            self._outbox.answer_alike(message, rows, *outcome_of_keys(message, lambda: True))
        else:
            self._obey_text(message, rows, now)

    def _is_held_still(self, rows: Rows) -> Mask:
        """See `Node.is_held_still`."""
        held: Mask = self._memory.state.stopped[rows.index].copy()
        held[rows.indices_of(self._authority.behind(rows).robots)] = True
        return held

    def _obey_text(self, message: Message, rows: Rows, now: float, details: Details = NOTHING) -> None:
        """details: of the answers to a command."""
        for compiled, some in self.programs(message.text, rows, asked=message.kind is Kind.ASK):
            if isinstance(compiled, str):
                self._outbox.answer_alike(message, some, "fault", compiled, details)
                continue
            timed = timed_of(compiled.root)
            for why, few in self._authority.objections(message, compiled, some, now):
                if why:
                    self._outbox.answer_alike(message, few, "fault", why, details)
                elif message.kind is Kind.ASK:
                    self._foretell(message, compiled, few)
                elif (auction := auction_of(compiled.root)) is not None:
                    self.bids.poll(message, auction, few, now)
                elif timed is not None:
                    self.timing.hear(message, timed, few, now)
                else:
                    self._outbox.answer(few, _came_of(message, self._evaluated(message, compiled, few, now), details))

    def programs(self, text: str, rows: Rows, *, asked: bool = False) -> Iterable[tuple[Program | str, Rows]]:
        """What a text means to these robots, or why it cannot be checked, each with its robots. asked: whether it is a
        question: then of a command that waits for an instant, what is evaluated there."""
        memory = self._memory

        def made(text: str, number: int) -> Program:
            names = MindNames(memory.vocabulary, memory.minds[number])
            return memory.minds.library.program(text, lambda: [read(text)], names, asked=asked)

        def program(number: int) -> Program | str:
            try:
                whole = made(text, number)
                timed = timed_of(whole.root) if asked else None
                return whole if timed is None else made(timed.command, number)
            except SleepcastError as error:
                return str(error).splitlines()[0]

        return [(compiled, some) for compiled, some, _ in memory.divide(rows, program)]

    def outcomes(self, message: Message, text: str, rows: Rows, now: float) -> Iterator[tuple[Rows, AnswerColumns]]:
        """Evaluate a text in the place of that of a message; gives what robots would answer."""
        for program, some in self.programs(text, rows):
            if isinstance(program, str):
                yield some, AnswerColumns.alike(message.id, some.size, "fault", fault=program)
            else:
                yield some, _came_of(message, self._evaluated(message, program, some, now))

    def _evaluated(self, message: Message, program: Program, rows: Rows, now: float) -> Evaluated:
        """Evaluate a command, or what stands for it, for whom it comes from."""
        memory, driver = self._memory, driver_of(message)
        sender = message.sender
        memory.cancel = lambda some: self.timing.cancel(some, sender) + self.bids.cancel(some, sender)
        memory.hops, memory.barred = (
            hops_left(message.body, message.role, MAX_HOPS),
            bars(message, self._authority.tells),
        )
        memory.childless = bars_population(message, self._authority.tells_hatch)
        if self._on_air:
            self._merge(rows, place_of(message, self.zero))
            if driver:
                memory.drivers = lambda some: [(driver, some)]
        answered = HOPS not in message.body  # nobody counts what becomes of what robots tell each other
        outcome = self.run(program, rows, message.id, answered=answered, watched=self._authority.moves(message))
        memory.hops, memory.barred, memory.childless, memory.cancel = MAX_HOPS, "", "", nobody_waits
        if self._on_air:
            self._merge(rows, None)
            memory.drivers = self._authority.drivers
        if outcome.moved is not None and self._authority.moves(message):
            self._authority.moved(message, rows.take(outcome.moved), now)
        return outcome

    def _merge(self, rows: Rows, place: CommandOrder | None) -> None:
        """The changes of the command with this place begin on these robots, or of none."""
        self._memory.merges = place is not None
        self._memory.state.merging.change(rows, lambda merging: merging.begun(place))

    def _tell_of_itself(self, message: Message, rows: Rows, now: float) -> None:
        for robot in rows.robots.tolist():
            answers = AnswerColumns.alike(message.id, 1, "answer", details=self._look(message, robot, now))
            self._outbox.answer(Rows.run(robot, robot + 1), answers)

    def _foretell(self, message: Message, program: Program, rows: Rows) -> None:
        """Answer a question robot by robot: it changes nothing, so there is nothing to do for all at once."""
        for robot in rows.robots.tolist():
            memory = rehearsal(self._memory, robot)
            result = foretell(program, memory)
            details = foretold(message, result, undecided=memory.undecided)
            answers = AnswerColumns.alike(message.id, 1, "answer", result.value, "; ".join(result.faults), details)
            self._outbox.answer(Rows.run(robot, robot + 1), answers)


_KINDS = ("not matched", "matched", "fault", UNKNOWN, HELD)


def _came_of(message: Message, outcome: Evaluated, details: Details = NOTHING) -> AnswerColumns:
    """The answers to a command with these details, in the order of the robots that evaluated it."""
    rows, faults = outcome.rows, [fault_text(noted) for noted in outcome.faults]
    fault = np.zeros(rows.size, np.int32) if faults else np.broadcast_to(np.int32(0), rows.size)
    for number, noted in reversed(list(enumerate(outcome.faults, 1))):
        fault[rows.indices_of(noted.robots)] = number
    kind = outcome.matched.view(np.uint8)
    if outcome.undecided is not None and outcome.undecided.any():
        kind = np.where(outcome.undecided & (kind == 0), np.uint8(3), kind)
    if outcome.held is not None and outcome.held.any():
        kind = np.where(outcome.held & (kind == 1), np.uint8(4), kind)
    kind = np.where(fault > 0, np.uint8(2), kind) if faults else kind
    return AnswerColumns(message.id, _KINDS, kind, outcome.values, tuple(faults), fault, dict(details))
