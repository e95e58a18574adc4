"""The memory of a fleet as a program sees it: what `language.operations.Memory` is for one robot, for many at once.

Every method is about some rows and gives a column, one value for each of them. A refusal is a fault: noted, unknown
as a value, and nothing is changed. Robots that have run out of steps take no further part: whatever is asked for
them changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import wraps
from math import nan
from typing import Concatenate, NamedTuple, ParamSpec, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.fleet.chance import draws
from sleepcast.fleet.columns import Column, FleetState, Index, Mask, Rows
from sleepcast.fleet.limits import MAX_FAULTS, PROVEN_TICKS
from sleepcast.fleet.minds import Draft, Mind, Minds
from sleepcast.fleet.speech import Speech
from sleepcast.fleet.tallies import Tallies
from sleepcast.language.form import List, Symbol, show
from sleepcast.language.machine import MAX_STEPS, Program
from sleepcast.language.names import UserVariable
from sleepcast.language.parts import Label, Part, host_of
from sleepcast.language.rehearsal import FLAGS, Answer, Refusal
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, TICK, Kind, Variable

Sort = TypeVar("Sort", bound=Hashable)
Rest = ParamSpec("Rest")
Act = Callable[..., Column]
"""How one act is carried out: (memory, part, rows, *arguments) to its values."""


class Noted(NamedTuple):
    """A fault of some robots."""

    robots: Index
    part: Part
    reason: str


Method: TypeAlias = Callable[Concatenate["FleetMemory", Part, Rows, Rest], Column]


def by_the_living(method: Method[Rest]) -> Method[Rest]:
    """Let only robots that have steps left take part; for the others the value is unknown."""

    @wraps(method)
    def living(memory: FleetMemory, part: Part, rows: Rows, /, *columns: Rest.args, **none: Rest.kwargs) -> Column:
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


class FleetMemory:
    """See the module. bodies: what the functions of the vocabulary are called on, by robot.

    Of the last evaluation: matched (of its rows), noted (its faults in their order), printed and, if it is a list,
    answers (what the memory gave back; kept only where there is one robot). hosts: if it is a dictionary, what the
    robots' own functions gave: a number, or why they failed. script: what they gave when it is all done again.
    """

    def __init__(
        self,
        state: FleetState,
        minds: Minds,
        speech: Speech,
        acts: dict[str, Act],
        bodies: Sequence[object | None],
    ) -> None:
        self.state, self.minds, self.speech, self.bodies = state, minds, speech, bodies
        self.vocabulary, self.tallies, self._acts = minds.vocabulary, Tallies(state), acts
        self.depth = 0
        self.top: Program
        self.matched: Mask = np.zeros(state.count, np.bool_)
        self.dead: Mask | None = None
        self._entered: NDArray[np.int32] | None = None
        """Steps charged on entering buffers and operators, made when one is first entered."""
        self.noted: list[Noted] = []
        self._faults: NDArray[np.int16] | None = None
        self.printed: list[tuple[Index, str, Sequence[Column]]] | None = None
        self.answers: list[Answer] | None = None
        self.hosts: dict[int, list[float | str]] | None = None
        self.script: Iterator[float | str] | None = None

    # ---- an evaluation and its bounds

    def begin(self, program: Program, rows: Rows) -> None:
        """Begin an evaluation of these robots."""
        self.top, self.depth, self.dead = program, 0, None
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

    def _with_room(self, rows: Rows) -> Rows:
        """Those that do not have `MAX_FAULTS` faults yet, which are counted only once there may be so many."""
        if self._faults is None:
            self._faults = np.zeros(self.state.count, np.int16)
            for noted in self.noted:
                self._faults[noted.robots] += 1
        rows = rows.take(self._faults[rows.index] < MAX_FAULTS)
        self._faults[rows.index] += 1
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
        numbers = self.state.mind[rows.index]
        if (numbers == numbers[0]).all():
            return [(sort(int(numbers[0])), rows, None)]
        unique, which = np.unique(numbers, return_inverse=True)
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

    def change(self, part: Part, rows: Rows, how: Callable[[Draft], str | None], *, proving: bool = False) -> Mask:
        """Change the minds of these robots, unless `how` says why not; gives where it was done.

        proving: it changes the rules, which then have to prove themselves anew.
        """
        done = np.ones(rows.size, np.bool_)
        for number, some, mask in self.divide(rows, lambda number: number):
            draft = self.minds.draft(number)
            reason = how(draft)
            if reason is not None:
                self.refuse(part, some, reason)
                done[... if mask is None else mask] = False
                continue
            if proving:
                self.changing(some)
            self.turn(some, draft)
        return done

    def turn(self, rows: Rows, draft: Draft) -> None:
        """Give these robots the mind of the draft."""
        self.state.mind[rows.index] = self.minds.settle(draft)
        self.tallies.carry_out(draft.effects, rows)

    def changing(self, rows: Rows) -> None:
        """The rules of these robots are about to change: where they have proved themselves, they are remembered."""
        state = self.state
        ticks = state.column(TICK, rows).astype(np.int64)
        ripe = ticks - state.unproven_since[rows.index] >= PROVEN_TICKS
        if ripe.any():
            some = rows.take(ripe)
            state.proven[some.index] = state.mind[some.index]
            self.tallies.prove(some)
        state.unproven_since[rows.index] = ticks

    # ---- what the machine asks

    @by_the_living
    def draw(self, part: Part, rows: Rows) -> Column:
        """The next random number of this tick."""
        state = self.state
        numbers = state.draws[rows.index]
        ticks = state.column(TICK, rows).astype(np.int64)
        found = draws(state.keys[rows.index], ticks, numbers)
        state.draws[rows.index] = numbers + 1
        return self.answer(found)

    @by_the_living
    def assign(self, part: Part, rows: Rows, values: Column) -> Column:
        """SETQ of a user variable that is there."""
        self.state.assign(part.slot, rows, values)
        return values

    @by_the_living
    def write(self, part: Part, rows: Rows, values: Column) -> Column:
        """SETQ of an actuator, a support variable, or a user variable that may not be there."""
        variable = part.data
        values = values.copy()
        if not isinstance(variable, Variable):
            there = self.where(rows, lambda mind: isinstance(mind.learned.get(part.name), UserVariable))
            reason = f"no variable {part.name}: make it first with (DEFVAR {part.name})"
            done = self.refuse_where(part, rows, ~there, reason, values)
            if done.size:
                self.state.assign(part.slot, done, values[there])
            return self.answer(values)
        unknown = np.isnan(values)
        if unknown.any():
            self.state.dropped[rows.take(unknown).index] += 1
        never = "never reaches an actuator" if variable.kind is Kind.ACTUATOR else "cannot be assigned to a flag"
        done = self.refuse_where(part, rows, unknown, f"unknown {never} ({variable.name})", values)
        if done.size:
            self.state.assign(part.slot, done, values if done is rows else values[~unknown])
            if variable.kind is Kind.ACTUATOR:
                self.state.assigned(part.slot)[done.index] = True
            elif ACTIVE0 < part.slot < ACTIVE0 + BUFFERS:
                self._flag_assigned(part.slot, done)
        return self.answer(values)

    def _flag_assigned(self, slot: int, rows: Rows) -> None:
        """Let the buffer whose flag has been assigned be as active as the flag says."""
        key = f"e{slot - ACTIVE0}"
        flags = self.state.column(slot, rows) > 0.0
        self.changing(rows)
        for flag in (False, True):
            for number, some, _ in self.divide(rows.take(flags == flag), lambda number: number):
                kept = self.minds[number].rules.get(key)
                if kept is not None and kept.active != flag:
                    draft = self.minds.draft(number)
                    draft.activate(key, flag)
                    draft.effects.clear()  # the flag is set already, and a lease stays as it is
                    self.turn(some, draft)

    def defined(self, part: Part, rows: Rows) -> Mask:
        """Where the user variable is there."""
        there = self.where(rows, lambda mind: isinstance(mind.learned.get(part.name), UserVariable))
        if self.answers is not None and not self.is_dead(rows):
            self.answers.append(bool(there[0]))
        return there

    def is_dead(self, rows: Rows) -> bool:
        """Whether the first of these robots is out of the evaluation."""
        return self.dead is not None and bool(self.dead[rows.robots[0]])

    @by_the_living
    def define(self, part: Part, rows: Rows, values: Column) -> Column:
        """DEFVAR of a new name."""
        values = values.copy()

        def learn(draft: Draft) -> str | None:
            reason = draft.taken(part.name, UserVariable)
            if reason is None:
                draft.learn(part.name, UserVariable(written(part), part.slot))
            return reason

        done = self.change(part, rows, learn)
        values[~done] = nan
        if done.any():
            self.state.assign(part.slot, rows.take(done), values[done])
        return self.answer(values)

    def fetch(self, part: Part, rows: Rows) -> list[tuple[Program | None, Rows, Mask | None]]:
        """The programs in a buffer or rule, each with the robots that have it there."""

        def program(number: int) -> Program | None:
            kept = self.minds[number].rules.get(part.name)
            return None if kept is None else kept.program

        found = self.divide(rows, program)
        self._answer_program(rows, found)
        return found

    def operator(self, part: Part, rows: Rows) -> list[tuple[Program | None, Rows, Mask | None]]:
        """The programs of an operator; none, and a fault, where there is none of so many parameters."""

        def program(number: int) -> Program | None:
            found = self.minds[number].operators.get(part.name)
            return found if found is not None and found.parameters == len(part.parts) else None

        found = self.divide(rows, program)
        for one, some, _ in found:
            if one is None:
                self.refuse(part, some, f"no operator {part.name} of {len(part.parts)} arguments")
        self._answer_program(rows, found)
        return found

    def _answer_program(self, rows: Rows, found: list[tuple[Program | None, Rows, Mask | None]]) -> None:
        if self.answers is not None and not self.is_dead(rows):
            self.answers.append(found[0][0])

    @by_the_living
    def host(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        """Call a function of the robots' own software, robot by robot; whatever it raises is a fault."""
        function = host_of(part)
        unknown = np.zeros(rows.size, np.bool_)
        for argument in arguments:
            unknown |= np.isnan(argument)
        values = np.full(rows.size, nan)
        known = rows
        if unknown.any():
            known = rows.take(~unknown)
            if function.acts:
                self.state.dropped[rows.take(unknown).index] += 1
                self.refuse(part, rows.take(unknown), f"unknown never reaches the body ({function.name})")
        label = (part.data.text,) if isinstance(part.data, Label) else ()
        columns = [argument[~unknown].tolist() for argument in arguments]
        found = np.full(known.size, nan)
        for place, robot in enumerate(known.robots.tolist()):
            given = self._call(robot, function.name, lambda body, a: function.call(body, *label, *a), columns, place)
            if isinstance(given, str):
                self.refuse(part, Rows(np.array([robot]), 1, rows.first), given)
            else:
                found[place] = given
        values[~unknown] = found
        return self.answer(values)

    def _call(
        self,
        robot: int,
        name: str,
        call: Callable[[object | None, list[float]], float | None],
        columns: Sequence[list[float]],
        place: int,
    ) -> float | str:
        """What one robot's own function gives: a number, NaN if it is not finite, or why it failed."""
        if self.script is not None:
            return next(self.script)
        given: float | str
        try:
            result = call(self.bodies[robot], [column[place] for column in columns])
            given = 1.0 if result is None else float(result)
            given = given if np.isfinite(given) else nan
        except Exception as error:
            given = f"{name} failed: {type(error).__name__}: {error}"
        if self.hosts is not None:
            self.hosts.setdefault(robot, []).append(given)
        return given

    @by_the_living
    def act(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        """Everything else that an expression may do."""
        if part.name in FLAGS:
            slot, value = FLAGS[part.name]
            self.state.assign(slot, rows, value)
            return self.answer(np.ones(rows.size))
        return self.answer(self._acts[part.name](self, part, rows, *arguments))

    @by_the_living
    def store(self, part: Part, rows: Rows, values: Column) -> Column:
        """SETQQ, RULE, and SETQ of a buffer."""
        return self.answer(self._acts["store"](self, part, rows, values))

    def kept(self, robot: int) -> Mind:
        """The mind of one robot."""
        return self.minds[int(self.state.mind[robot])]


def fault_text(noted: Noted) -> str:
    """A fault as people read it."""
    return f"{noted.reason} in {show(noted.part.form)}"


def written(part: Part) -> str:
    """The name that a declaring part declares, as written."""
    target = part.form.items[1] if isinstance(part.form, List) else part.form
    return target.text if isinstance(target, Symbol) else part.name
