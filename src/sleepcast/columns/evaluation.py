"""One evaluation of a program on many robots: its robots, cost and faults; and what a program touches, robot by robot.

A refused act is recorded as a fault, gives unknown, and changes nothing. Robots that have run out of steps take no
further part: acts have no effect on them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import wraps
from math import nan
from typing import Concatenate, ParamSpec, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.neighbours import NeighbourLists
from sleepcast.columns.values import Column, Columns, Index, Mask, Rows
from sleepcast.core.records import NamedTuple
from sleepcast.language.parts import Part
from sleepcast.language.program import MAX_STEPS, Program
from sleepcast.language.reader import show
from sleepcast.language.rehearsal import Answer, NotedFault
from sleepcast.mind.limits import MAX_FAULTS

Rest = ParamSpec("Rest")


Programs: TypeAlias = list[tuple[Program | None, Rows, Mask | None]]
"""Programs, each with the robots that have it and their places among the rows (None: all)."""


class Noted(NamedTuple):
    """A fault that occurred on some robots."""

    robots: Index
    part: Part
    reason: str


Owner = TypeVar("Owner", bound="Evaluation")
Method: TypeAlias = Callable[Concatenate[Owner, Part, Rows, Rest], Column]


def by_the_living(method: Method[Owner, Rest]) -> Method[Owner, Rest]:
    """Exclude robots that have run out of steps; their value is unknown."""

    @wraps(method)
    def living(memory: Owner, part: Part, rows: Rows, /, *columns: Rest.args, **none: Rest.kwargs) -> Column:
        if rows.size == 0:
            return np.empty(0)
        if memory.dead is None:
            return method(memory, part, rows, *columns, **none)
        alive = ~memory.dead[rows.index]
        values = np.full(rows.size, nan)
        if alive.any():
            columns_left = [column[alive] if isinstance(column, np.ndarray) else column for column in columns]
            values[alive] = method(memory, part, rows.take(alive), *columns_left, **none)  # type: ignore[arg-type]
        return values

    return living


class Evaluation(ABC):
    """See the module; one object is used for successive evaluations, on the variables and groups in `state`.

    Results of the last evaluation: matched (which rows), noted (faults in order) and, if it is a list, answers
    (values that the memory returned; only with one robot).
    """

    state: Columns
    top: Program

    def __init__(self, state: Columns) -> None:
        self.state = state
        self.barred = ""
        """Why nothing may act on the bodies now, "" if it may."""
        self.depth = self.levels = 0
        """Nesting of entered programs, and of parentheses in them: the same for all robots that have come so far."""
        self.matched: Mask = np.zeros(state.count, np.bool_)
        self.undecided: Mask | None = None
        """Where the top-level test was unknown; None in evaluations that do not look for that."""
        self.moved: Mask | None = None
        """Which robots' bodies were asked to move, likewise."""
        self.dead: Mask | None = None
        """Which robots have run out of steps, or None."""
        self._entered: NDArray[np.int32] | None = None
        """Steps charged for entering buffers and operators, allocated when one is first entered."""
        self.noted: list[Noted] = []
        self._faults: NDArray[np.int16] | None = None
        self.answers: list[Answer] | None = None

    # ---- an evaluation and its bounds

    def begin(self, program: Program, rows: Rows) -> None:
        """Begin an evaluation on these robots."""
        self.top, self.depth, self.levels, self.dead = program, 0, program.height, None
        self.noted, self._faults = [], None
        self.matched[rows.index] = program.for_everybody
        if self._entered is not None:
            self._entered[rows.index] = 0

    def charge(self, program: Program, rows: Rows) -> None:
        """Charge for entering a program; robots that cannot pay leave the evaluation, with a fault."""
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
        """Steps used by each of these robots, or one number if all are equal."""
        return self.top.cost if self._entered is None else self._entered[rows.index] + np.int32(self.top.cost)

    @by_the_living
    def fault(self, part: Part, rows: Rows, reason: str) -> Column:
        """Record a fault; returns unknown."""
        unknown = np.full(rows.size, nan)
        if len(self.noted) >= MAX_FAULTS:  # some robots may have too many already
            counts = self._counted()
            rows = rows.take(counts[rows.index] < MAX_FAULTS)
            counts[rows.index] += 1
        if rows.size:
            self.noted.append(Noted(rows.robots, part, reason))
        return unknown

    def faults(self, part: Part, rows: Rows, indices: Index, reasons: Sequence[str]) -> None:
        """Record faults at some indices of the rows, each with its reason; dropped on robots that have too many
        already."""
        if len(self.noted) >= MAX_FAULTS:
            room = self._counted()[rows.robots[indices]] < MAX_FAULTS
            indices, reasons = indices[room], [reason for reason, fits in zip(reasons, room, strict=True) if fits]
        by_reason: dict[str, list[int]] = {}
        for index, reason in zip(indices.tolist(), reasons, strict=True):
            by_reason.setdefault(reason, []).append(index)
        for reason, met in by_reason.items():
            mask = np.zeros(rows.size, np.bool_)
            mask[met] = True
            self.fault(part, rows.take(mask), reason)

    def _counted(self) -> NDArray[np.int16]:
        """Number of faults of each robot so far; counted only once there may be too many."""
        if self._faults is None:
            self._faults = np.zeros(self.state.count, np.int16)
            for noted in self.noted:
                self._faults[noted.robots] += 1
        return self._faults

    @by_the_living
    def refuse(self, part: Part, rows: Rows, reason: str) -> Column:
        """Record a fault that this memory itself detects."""
        if self.answers is not None:
            self.answers.append(NotedFault(part, reason))
        return self.fault(part, rows, reason)

    def refuse_where(self, part: Part, rows: Rows, wrong: Mask, reason: str, values: Column) -> Rows:
        """Refuse the rows where `wrong`, setting their values to unknown in place; returns the other rows."""
        if not wrong.any():
            return rows
        self.refuse(part, rows.take(wrong), reason)
        values[wrong] = nan
        return rows.take(~wrong)

    def answer(self, values: Column) -> Column:
        """Append to `answers` what the memory returned, if that is recorded."""
        if self.answers is not None:
            self.answers.append(float(values[0]))
        return values

    @property
    def repeatable(self) -> bool:
        """Whether what does nothing may be evaluated in another order, and again: nothing is recorded of it, and nobody
        has left."""
        return self.answers is None and self.dead is None and len(self.noted) < MAX_FAULTS

    def forget_faults(self, since: int) -> None:
        """Take back what was recorded after so many faults."""
        del self.noted[since:]
        self._faults = None

    def first_faults(self) -> dict[int, str]:
        """The first fault of each robot that had one in the last evaluation, as text."""
        texts: dict[int, str] = {}
        for noted in reversed(self.noted):
            texts.update(dict.fromkeys(noted.robots.tolist(), fault_text(noted)))
        return texts

    def is_dead(self, rows: Rows) -> bool:
        """Whether the first of these robots has left the evaluation."""
        return self.dead is not None and bool(self.dead[rows.robots[0]])

    def near(self, part: Part, rows: Rows, *arguments: Column) -> NeighbourLists:
        """The neighbours that an `over` or `each` part goes through; of robots that have left the evaluation, and where
        an argument is unknown, they are not known."""
        known = np.ones(rows.size, np.bool_) if self.dead is None else ~self.dead[rows.index]
        alive = bool(known[:1].all())
        for argument in arguments:
            known &= ~np.isnan(argument)
        if known.all():
            near = self.sensed(part, rows, *arguments)
        elif known.any():
            near = self.sensed(part, rows.take(known), *(each[known] for each in arguments)).spread(known)
        else:
            near = NeighbourLists(np.zeros(rows.size + 1, np.intp), np.empty(0), known)
        if self.answers is not None and alive and rows.size:
            self.answers.append(near.of(0))
        return near

    # ---- what a program touches: `language.evaluate.Memory` for many robots; each method gives a column

    def native(self, program: Program, rows: Rows) -> tuple[Column, Rows] | None:
        """What native code comes to, and the robots that are left for a walk; None where there is none."""
        return None

    @abstractmethod
    def draw(self, part: Part, rows: Rows) -> Column:
        """The next random number in [0, 1)."""

    @abstractmethod
    def read(self, part: Part, rows: Rows) -> Column:
        """A linked variable of a `linked` part."""

    @abstractmethod
    def fetch(self, part: Part, rows: Rows) -> Programs:
        """The programs in a buffer or rule, each with the robots that have it there."""

    @abstractmethod
    def operator(self, part: Part, rows: Rows) -> Programs:
        """The programs of an operator; none where it does not exist with this number of parameters."""

    @abstractmethod
    def host(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        """Call a function of the robots' own software."""

    @abstractmethod
    def sensed(self, part: Part, rows: Rows, *arguments: Column) -> NeighbourLists:
        """The neighbours that these robots sense, at most as many each as the part says. arguments: all known."""

    @abstractmethod
    def assign(self, part: Part, rows: Rows, values: Column) -> Column:
        """SETQ of an existing user variable."""

    @abstractmethod
    def write(self, part: Part, rows: Rows, values: Column) -> Column:
        """Assign an actuator, a support variable, or one that is not certainly declared."""

    @abstractmethod
    def defined(self, part: Part, rows: Rows) -> Mask:
        """Where the user variable exists."""

    @abstractmethod
    def define(self, part: Part, rows: Rows, values: Column) -> Column:
        """DEFVAR of a new name."""

    @abstractmethod
    def store(self, part: Part, rows: Rows, values: Column) -> Column:
        """SETQQ, RULE, and SETQ of a buffer."""

    @abstractmethod
    def act(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        """What an expression may do besides assigning."""


def fault_text(noted: Noted) -> str:
    """A fault as text for people."""
    return f"{noted.reason} in {show(noted.part.form)}"
