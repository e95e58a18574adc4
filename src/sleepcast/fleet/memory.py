"""The memory of a fleet as a program sees it: what `language.operations.Memory` is for one robot, for many at once.

Every method is about some rows and gives a column, one value for each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import nan
from typing import TypeAlias

import numpy as np

from sleepcast.fleet.bodies import ManyBodies
from sleepcast.fleet.columns import Column, FleetState, Index, Mask, Rows, draws
from sleepcast.fleet.evaluation import Evaluation, by_the_living
from sleepcast.fleet.messages import Outbox
from sleepcast.fleet.minds import Minds
from sleepcast.fleet.native.kernels import Kernels
from sleepcast.language.functions import MAX_HOPS
from sleepcast.language.parts import Label, Part, host_of, written
from sleepcast.language.program import Program
from sleepcast.language.rehearsal import FLAGS
from sleepcast.language.symbols import UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, TICK, HostFunction, Kind, Variable
from sleepcast.mind import rules
from sleepcast.mind.refusals import built_in, failed, no_operator, no_variable, stopped, unknown_asked, unknown_assigned

Act = Callable[..., Column]
"""How one act is carried out: (memory, part, rows, *arguments) to its values."""


Found: TypeAlias = list[tuple[Program | None, Rows, Mask | None]]
"""Programs, each with the robots that have it and where they are among the rows (None: everywhere)."""


Given: TypeAlias = tuple[Rows, Column | list[float | str]]


class FleetMemory(Evaluation):
    """See the module. bodies: what the functions of the vocabulary are called on, by robot.

    printed: what is reported, if it is a list. hosts: if it is a list, what the robots' own functions gave: robots, and
    for each of them a number, or why it failed. script: what they gave when it is all done again. kernels: native code,
    if there is any.
    """

    def __init__(
        self,
        state: FleetState,
        minds: Minds,
        outbox: Outbox,
        acts: dict[str, Act],
        bodies: Sequence[object | None],
        kernels: Kernels | None = None,
    ) -> None:
        super().__init__(state, minds)
        self.outbox, self.bodies, self.vocabulary, self._acts = outbox, bodies, minds.vocabulary, acts
        self._many = bodies if isinstance(bodies, ManyBodies) else None
        self.printed: list[tuple[Index, str, Sequence[Column]]] | None = None
        self.hosts: list[Given] | None = None
        self.script: Iterator[float | str] | None = None
        self.kernels = kernels
        self.hops = MAX_HOPS
        """How far what robots tell may go: less while they evaluate what another one has told."""

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
            there = self.where(rows, lambda mind: isinstance(mind.symbols.get(part.name), UserVariable))
            done = self.refuse_where(part, rows, ~there, no_variable(part.name), values)
            if done.size:
                # The name may have been unknown when the text was checked: then the part has no slot.
                self.state.assign(self.vocabulary.user_slot(part.name), done, values[there])
            return self.answer(values)
        unknown = np.isnan(values)
        if unknown.any():
            self.state.dropped[rows.take(unknown).index] += 1
        done = self.refuse_where(part, rows, unknown, unknown_assigned(variable), values)
        done = self._refuse_built_in(part, done, values)
        if done.size:
            self.state.assign(part.slot, done, values if done is rows else values[~np.isnan(values)])
            if variable.kind is Kind.ACTUATOR:
                self.state.assigned(part.slot)[done.index] = True
            elif ACTIVE0 < part.slot < ACTIVE0 + BUFFERS:
                self._flag_assigned(part.slot, done)
        return self.answer(values)

    def _refuse_built_in(self, part: Part, rows: Rows, values: Column) -> Rows:
        """Refuse to assign the flag of a protected buffer; gives the robots that may.

        values: of all rows of the part, unknown for those that have been refused already.
        """
        number = part.slot - ACTIVE0
        if not 0 < number < BUFFERS or rows.size == 0:
            return rows
        key = f"e{number}"
        protected = self.where(rows, lambda mind: key in mind.rules and mind.rules[key].protected)
        mine = values[~np.isnan(values)]
        left = self.refuse_where(part, rows, protected, built_in(f"E{number}"), mine)
        values[~np.isnan(values)] = mine
        return left

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
                    draft.assign_flag(key, flag)
                    self.turn(some, draft)

    def defined(self, part: Part, rows: Rows) -> Mask:
        """Where the user variable is there."""
        there = self.where(rows, lambda mind: isinstance(mind.symbols.get(part.name), UserVariable))
        if self.answers is not None and not self.is_dead(rows):
            self.answers.append(bool(there[0]))
        return there

    @by_the_living
    def define(self, part: Part, rows: Rows, values: Column) -> Column:
        """DEFVAR of a new name."""
        values = values.copy()

        done = self.change(part, rows, partial(rules.define, key=part.name, name=written(part), slot=part.slot))
        values[~done] = nan
        if done.any():
            self.state.assign(part.slot, rows.take(done), values[done])
        return self.answer(values)

    def fetch(self, part: Part, rows: Rows) -> Found:
        """The programs in a buffer or rule, each with the robots that have it there."""

        def program(number: int) -> Program | None:
            kept = self.minds[number].rules.get(part.name)
            return None if kept is None else kept.program

        found = self.divide(rows, program)
        self._answer_program(rows, found)
        return found

    def operator(self, part: Part, rows: Rows) -> Found:
        """The programs of an operator; none, and a fault, where there is none of so many parameters."""

        def program(number: int) -> Program | None:
            found = self.minds[number].operators.get(part.name)
            return found if found is not None and found.parameters == len(part.parts) else None

        found = self.divide(rows, program)
        for one, some, _ in found:
            if one is None:
                self.refuse(part, some, no_operator(part.name, len(part.parts)))
        self._answer_program(rows, found)
        return found

    def _answer_program(self, rows: Rows, found: Found) -> None:
        if self.answers is not None and not self.is_dead(rows):
            self.answers.append(found[0][0])

    @by_the_living
    def host(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        """Call a function of the robots' own software; whatever it raises is a fault."""
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
                self.refuse(part, rows.take(unknown), unknown_asked(function))
        held = self.state.held[known.index]
        if function.acts and held.any():
            self.refuse(part, known.take(held), stopped(function))
            known = known.take(~held)
            unknown[~unknown] = held
        columns = [argument[~unknown] for argument in arguments]
        given = self._ask(function, part, known, columns)
        if self.hosts is not None:
            self.hosts.append((known, given))
        if isinstance(given, list):
            for robot, why in zip(known.robots.tolist(), given, strict=True):
                if isinstance(why, str):
                    self.refuse(part, Rows(np.array([robot]), 1, rows.first), why)
            given = np.array([nan if isinstance(one, str) else one for one in given])
        values[~unknown] = given
        return self.answer(values)

    def _ask(
        self, function: HostFunction, part: Part, rows: Rows, columns: Sequence[Column]
    ) -> Column | list[float | str]:
        """What the robots' own function gives each of them: a number, NaN if it is not finite, or why it failed."""
        if self.script is not None:
            return [next(self.script) for _ in range(rows.size)]
        if self._many is not None and function.many:
            found = getattr(self._many, function.many)(rows.robots, *columns)
            return np.broadcast_to(1.0, rows.size) if found is None else np.where(np.isfinite(found), found, nan)
        label = (part.data.text,) if isinstance(part.data, Label) else ()
        lists = [column.tolist() for column in columns]
        return [
            _call(function, self.bodies[robot], (*label, *(values[place] for values in lists)))
            for place, robot in enumerate(rows.robots.tolist())
        ]

    @by_the_living
    def act(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        """Everything else that an expression may do."""
        if part.name in FLAGS:
            slot, value = FLAGS[part.name]
            self.state.assign(slot, rows, value)
            return self.answer(np.ones(rows.size))
        found = self.answer(self._acts[part.name](self, part, rows, *arguments))
        if part.name == "rollback" and self.answers is not None:
            self.answers += self.state.row(int(rows.robots[0]))[ACTIVE0 + 1 : ACTIVE0 + BUFFERS]
        return found

    @by_the_living
    def store(self, part: Part, rows: Rows, values: Column) -> Column:
        """SETQQ, RULE, and SETQ of a buffer."""
        return self.answer(self._acts["store"](self, part, rows, values))


def _call(function: HostFunction, body: object | None, arguments: tuple[str | float, ...]) -> float | str:
    """What one robot's own function gives: a number, NaN if it is not finite, or why it failed."""
    try:
        result = function.call(body, *arguments)
        given = 1.0 if result is None else float(result)
    except Exception as error:
        return failed(function, error)
    return given if np.isfinite(given) else nan
