"""An evaluation under way: whose it is, what it has cost, what went wrong in it, and which minds it changes.

A refusal is a fault: noted, unknown as a value, and nothing is changed. Robots that have run out of steps take no
further part: whatever is asked for them changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import partial, wraps
from math import nan
from typing import Concatenate, NamedTuple, ParamSpec, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.fleet.columns import Column, FleetState, Index, Mask, Rows
from sleepcast.fleet.minds import Mind, Minds
from sleepcast.fleet.rule_statistics import StatisticsTable
from sleepcast.language.parts import Part
from sleepcast.language.program import MAX_STEPS, Program
from sleepcast.language.reader import show
from sleepcast.language.rehearsal import Answer, Refusal
from sleepcast.language.vocabulary import TICK
from sleepcast.mind.limits import MAX_FAULTS, PROVEN_TICKS
from sleepcast.mind.rules import RuleBase

Sort = TypeVar("Sort", bound=Hashable)
Rest = ParamSpec("Rest")


class Noted(NamedTuple):
    """A fault of some robots."""

    robots: Index
    part: Part
    reason: str


Owner = TypeVar("Owner", bound="Evaluation")
Method: TypeAlias = Callable[Concatenate[Owner, Part, Rows, Rest], Column]


def by_the_living(method: Method[Owner, Rest]) -> Method[Owner, Rest]:
    """Let only robots that have steps left take part; for the others the value is unknown."""

    @wraps(method)
    def living(memory: Owner, part: Part, rows: Rows, /, *columns: Rest.args, **none: Rest.kwargs) -> Column:
        if rows.size == 0:
            return np.empty(0)
        if memory.dead is None:
            return method(memory, part, rows, *columns, **none)
        alive = ~memory.dead[rows.index]
        found = np.full(rows.size, nan)
        if alive.any():
            kept = [column[alive] if isinstance(column, np.ndarray) else column for column in columns]
            found[alive] = method(memory, part, rows.take(alive), *kept, **none)  # type: ignore[arg-type]
        return found

    return living


class Evaluation:
    """See the module; it is used for one evaluation after the other.

    Of the last evaluation: matched (of its rows), noted (its faults in their order) and, if it is a list, answers (what
    the memory gave back; kept only where there is one robot).
    """

    def __init__(self, state: FleetState, minds: Minds) -> None:
        self.state, self.minds, self.statistics = state, minds, StatisticsTable(state)
        self.depth = self.levels = 0
        """Programs entered inside one another, and parentheses open in them: the same for all that have come so far."""
        self.top: Program
        self.matched: Mask = np.zeros(state.count, np.bool_)
        self.dead: Mask | None = None
        """Which robots have run out of steps, if any has."""
        self._entered: NDArray[np.int32] | None = None
        """Steps charged on entering buffers and operators, made when one is first entered."""
        self.noted: list[Noted] = []
        self._faults: NDArray[np.int16] | None = None
        self.answers: list[Answer] | None = None

    # ---- an evaluation and its bounds

    def begin(self, program: Program, rows: Rows) -> None:
        """Begin an evaluation of these robots."""
        self.top, self.depth, self.levels, self.dead = program, 0, program.height, None
        self.noted, self._faults = [], None
        self.matched[rows.index] = program.test is None
        if self._entered is not None:
            self._entered[rows.index] = 0

    def charge(self, program: Program, rows: Rows) -> None:
        """Charge for entering a program; robots that cannot pay are out of the evaluation, with a fault."""
        if self._entered is None:
            self._entered = np.zeros(self.state.count, np.int32)
        self._entered[rows.index] += program.cost
        broke = self._entered[rows.index] > MAX_STEPS - self.top.cost
        if broke.any():
            some = rows.take(broke)
            self.fault(self.top.root, some, f"out of steps: at most {MAX_STEPS} in one evaluation")
            if self.dead is None:
                self.dead = np.zeros(self.state.count, np.bool_)
            self.dead[some.index] = True

    def steps(self, rows: Rows) -> NDArray[np.int32] | int:
        """Steps used by each of these robots, or by all of them alike."""
        return self.top.cost if self._entered is None else self._entered[rows.index] + np.int32(self.top.cost)

    @by_the_living
    def fault(self, part: Part, rows: Rows, reason: str) -> Column:
        """Note a fault; gives unknown."""
        unknown = np.full(rows.size, nan)
        if len(self.noted) >= MAX_FAULTS:
            rows = self._with_room(rows)
        if rows.size:
            self.noted.append(Noted(rows.robots, part, reason))
        return unknown

    def faults(self, part: Part, rows: Rows, places: Index, reasons: Sequence[str]) -> None:
        """Note faults at some places of the rows, each with its reason; nothing is made of those without room."""
        if len(self.noted) >= MAX_FAULTS:
            room = self._counted()[rows.robots[places]] < MAX_FAULTS
            places, reasons = places[room], [reason for reason, there in zip(reasons, room, strict=True) if there]
        sorts: dict[str, list[int]] = {}
        for place, reason in zip(places.tolist(), reasons, strict=True):
            sorts.setdefault(reason, []).append(place)
        for reason, met in sorts.items():
            mask = np.zeros(rows.size, np.bool_)
            mask[met] = True
            self.fault(part, rows.take(mask), reason)

    def _counted(self) -> NDArray[np.int16]:
        """How many faults each robot has so far, which is counted only once there may be too many."""
        if self._faults is None:
            self._faults = np.zeros(self.state.count, np.int16)
            for noted in self.noted:
                self._faults[noted.robots] += 1
        return self._faults

    def _with_room(self, rows: Rows) -> Rows:
        """Those that do not have `MAX_FAULTS` faults yet; now they have one more."""
        faults = self._counted()
        rows = rows.take(faults[rows.index] < MAX_FAULTS)
        faults[rows.index] += 1
        return rows

    @by_the_living
    def refuse(self, part: Part, rows: Rows, reason: str) -> Column:
        """A fault that this memory itself has to note."""
        if self.answers is not None:
            self.answers.append(Refusal(part, reason))
        return self.fault(part, rows, reason)

    def refuse_where(self, part: Part, rows: Rows, wrong: Mask, reason: str, values: Column) -> Rows:
        """Refuse some of the rows, whose values become unknown in place; gives the others."""
        if not wrong.any():
            return rows
        self.refuse(part, rows.take(wrong), reason)
        values[wrong] = nan
        return rows.take(~wrong)

    def answer(self, values: Column) -> Column:
        """Write down what the memory gives back, if that is wanted."""
        if self.answers is not None:
            self.answers.append(float(values[0]))
        return values

    def first_faults(self) -> dict[int, str]:
        """The first fault of each robot that had one in the last evaluation, as people read it."""
        found: dict[int, str] = {}
        for noted in reversed(self.noted):
            found.update(dict.fromkeys(noted.robots.tolist(), fault_text(noted)))
        return found

    # ---- minds

    def divide(self, rows: Rows, sort: Callable[[int], Sort]) -> list[tuple[Sort, Rows, Mask | None]]:
        """The rows by what `sort` says of the number of their mind, each sort with where it is (None: everywhere)."""
        if rows.size == 0:
            return []
        if (one := self.state.one_mind) is not None:
            return [(sort(one), rows, None)]
        numbers = self.state.mind[rows.index]
        if (numbers == numbers[0]).all():
            one = int(numbers[0])
            if rows.size == self.state.count:
                self.state.turn(rows, one)  # to remember it
            return [(sort(one), rows, None)]
        unique, which = distinct(numbers)
        sorts: dict[Sort, int] = {}
        codes = np.array([sorts.setdefault(sort(number), len(sorts)) for number in unique.tolist()])[which]
        if len(sorts) == 1:
            return [(next(iter(sorts)), rows, None)]
        return [(found, rows.take(codes == code), codes == code) for found, code in sorts.items()]

    def where(self, rows: Rows, holds: Callable[[Mind], bool]) -> Mask:
        """On which of the rows something holds of the mind."""
        found = np.zeros(rows.size, np.bool_)
        for truth, _, mask in self.divide(rows, lambda number: holds(self.minds[number])):
            found[... if mask is None else mask] = truth
        return found

    def change(self, part: Part, rows: Rows, how: Callable[[RuleBase], str | None]) -> Mask:
        """Change the minds of these robots, unless `how` says why not; gives where it was done."""
        done = np.ones(rows.size, np.bool_)
        for number, some, mask in self.divide(rows, lambda number: number):
            draft = self.minds.draft(number, partial(self.changing, some))
            reason = how(draft)
            if reason is None:
                self.turn(some, draft)
            else:
                self.refuse(part, some, reason)
                done[... if mask is None else mask] = False
        return done

    def turn(self, rows: Rows, draft: RuleBase) -> None:
        """Give these robots the mind of the draft."""
        self.state.turn(rows, self.minds.settle(draft))
        self.statistics.carry_out(draft.effects, rows)

    def changing(self, rows: Rows) -> None:
        """The rules of these robots are about to change: where they have proved themselves, they are remembered."""
        state = self.state
        ticks = state.column(TICK, rows).astype(np.int64)
        ripe = ticks - state.unproven_since[rows.index] >= PROVEN_TICKS
        if ripe.any():
            some = rows.take(ripe)
            state.proven[some.index] = state.mind[some.index]
            self.statistics.prove(some)
        state.unproven_since[rows.index] = ticks

    def is_dead(self, rows: Rows) -> bool:
        """Whether the first of these robots is out of the evaluation."""
        return self.dead is not None and bool(self.dead[rows.robots[0]])

    def kept(self, robot: int) -> Mind:
        """The mind of one robot."""
        return self.minds[int(self.state.mind[robot])]


def distinct(numbers: NDArray[np.int32]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The different numbers, ascending, and which of them each one is."""
    lowest, highest = (int(numbers.min()), int(numbers.max())) if len(numbers) else (0, -1)
    if lowest >= highest:
        return np.arange(lowest, highest + 1), np.zeros(len(numbers), np.intp)
    if highest > 4 * len(numbers) + 1_024:
        unique, which = np.unique(numbers, return_inverse=True)
        return unique.astype(np.intp), which
    there = np.zeros(highest + 1, np.bool_)
    there[numbers] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[numbers]


def fault_text(noted: Noted) -> str:
    """A fault as people read it."""
    return f"{noted.reason} in {show(noted.part.form)}"
