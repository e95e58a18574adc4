"""The memory of a fleet as a program sees it: what `language.evaluate.Memory` is for one robot, for many at once.

Every method works on some rows and returns a column, one value for each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import nan
from typing import TypeAlias

import numpy as np

from sleepcast.columns.evaluation import Programs, by_the_living
from sleepcast.columns.neighbours import NeighbourLists
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.model import HostFunction, NeighbourSensor
from sleepcast.core.neighbours import EVERY, crowded, listed
from sleepcast.fleet.bodies import ManyBodies
from sleepcast.fleet.evaluation import FleetEvaluation
from sleepcast.fleet.messages import Outbox
from sleepcast.fleet.native.kernels import Kernels
from sleepcast.fleet.state import FleetState, Minds, draws
from sleepcast.language.acts import FLAGS
from sleepcast.language.functions import DEADLY, MAX_HOPS
from sleepcast.language.parts import (
    Auction,
    Defining,
    Label,
    Part,
    Storing,
    Template,
    host_of,
    label_of,
    sensor_of,
    written,
)
from sleepcast.language.program import Program
from sleepcast.language.reader import MAX_TEXT, Form, Number, show
from sleepcast.language.symbols import UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, TICK, TIME_SLOT, Variable, VariableKind, buffer_number
from sleepcast.mind import rules
from sleepcast.mind.calling import Calls
from sleepcast.mind.limits import PROVEN_TICKS, TELLS_TOO_FAR, TELLS_TOO_OFTEN, TOO_MANY_CALLS
from sleepcast.mind.merging import Merging
from sleepcast.mind.rules import (
    UNKNOWN_CASTE,
    UNKNOWN_LEASE,
    UNKNOWN_STORED,
    UNKNOWN_TOLD,
    built_in,
    failed,
    no_operator,
    no_variable,
    stopped,
    too_long,
    unknown_asked,
    unknown_assigned,
)

Act = Callable[..., Column]
"""Implementation of one act: (memory, part, rows, *arguments) to its values."""


HostResult: TypeAlias = float | str | tuple[float, ...]
"""What a robot's own function has given: a number, ids of neighbours, or why it failed."""
HostResults: TypeAlias = tuple[Rows, Column | NeighbourLists | Sequence[HostResult]]
"""What the robots' own functions have given: robots, and what each of them has."""


def nobody_waits(rows: Rows) -> Column:
    """What CANCEL discards where nobody has sent what is evaluated."""
    return np.zeros(rows.size)


class FleetMemory(FleetEvaluation):
    """See the module.

    bodies: targets of the vocabulary's functions, by robot
    printed: collects reports, if it is a list
    hosts: if it is a list, collects the results of the robots' own functions, and how many commands CANCEL discarded
    script: these results when an evaluation is repeated
    kernels: native code, if there is any
    """

    def __init__(
        self,
        state: FleetState,
        minds: Minds,
        outbox: Outbox,
        bodies: Sequence[object | None],
        kernels: Kernels | None = None,
    ) -> None:
        super().__init__(state, minds)
        self.outbox, self.bodies, self.vocabulary = outbox, bodies, minds.vocabulary
        self._many = bodies if isinstance(bodies, ManyBodies) else None
        self.printed: list[tuple[Index, str, Sequence[Column]]] | None = None
        self.hosts: list[HostResults] | None = None
        self.script: Iterator[HostResult] | None = None
        self.kernels = kernels
        self.merges = False
        """Whether the changes are those of a command that is merged with others."""
        self.drivers: Callable[[Rows], Sequence[tuple[str, Rows]]] = lambda rows: [("", rows)]
        """For whom these robots speak, "" for nobody."""
        self.calls: Callable[[int], Calls | None] = lambda robot: None
        """The auctions that a robot calls, None while it is stopped."""
        self.childless = ""
        """Why no robot comes or goes while robots evaluate what they do, "" if they may."""
        self.cancel: Callable[[Rows], Column] = nobody_waits
        """Discards what waits on these robots of the sender whom they obey; gives how many each has had."""
        self.hops = MAX_HOPS
        """How many hops a TELL may travel: fewer while robots evaluate what another one has told them."""

    @by_the_living
    def draw(self, part: Part, rows: Rows) -> Column:
        """The next random number of this tick."""
        state = self.state
        counts = state.draws[rows.index]
        ticks = state.column(TICK, rows).astype(np.int64)
        numbers = draws(state.keys[rows.index], ticks, counts)
        state.draws[rows.index] = counts + 1
        return self.answer(numbers)

    @by_the_living
    def assign(self, part: Part, rows: Rows, values: Column) -> Column:
        """SETQ of an existing user variable."""
        self.state.assign(part.slot, rows, values)
        return values

    @by_the_living
    def write(self, part: Part, rows: Rows, values: Column) -> Column:
        """See `RobotMemory.write`."""
        variable = part.data
        values = values.copy()
        if not isinstance(variable, Variable):
            existing = self.where(rows, lambda mind: isinstance(mind.symbols.get(part.name), UserVariable))
            done = self.refuse_where(part, rows, ~existing, no_variable(part.name), values)
            if done.size:
                # The name may have been unknown when the text was checked: then the part has no slot.
                self.state.assign(self.vocabulary.user_slot(part.name), done, values[existing])
            return self.answer(values)
        unknown = np.isnan(values)
        done = rows
        if unknown.any():
            self.state.dropped[rows.take(unknown).index] += 1
            done = self.refuse_where(part, rows, unknown, unknown_assigned(variable), values)
        if self.barred and variable.kind is VariableKind.ACTUATOR:
            self.refuse(part, done, self.barred)
            return self.answer(np.full(rows.size, nan))
        done = self._refuse_built_in(part, done, values)
        if done.size:
            self.state.assign(part.slot, done, values if done is rows else values[~np.isnan(values)])
            if variable.kind is VariableKind.ACTUATOR:
                self.state.assigned(part.slot)[done.index] = True
                self._note_moving(done)
            elif ACTIVE0 < part.slot < ACTIVE0 + BUFFERS:
                self._flag_assigned(part.slot, done)
        return self.answer(values)

    def _note_moving(self, rows: Rows) -> None:
        """The bodies of these robots are asked to move."""
        if self.moved is not None:
            self.moved[rows.index] = True

    def _refuse_built_in(self, part: Part, rows: Rows, values: Column) -> Rows:
        """Refuse to assign the flag of a protected buffer; returns the robots that may.

        values: of all rows of the part, set to unknown for those that have been refused.
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
        """Make the buffer whose flag was assigned as active as the flag says, if the command that does so counts."""
        key = f"e{slot - ACTIVE0}"
        flags = self.state.column(slot, rows) > 0.0
        self.changing(rows)
        for wanted in (False, True):
            for number, merging, some in self.each_mind(rows.take(flags == wanted)):
                draft = self.minds.draft(number, merging=merging)
                flag = merging.flag(key, wanted) is True
                if flag is not wanted:
                    self.state.assign(slot, some, float(flag))
                rule = draft.rules.get(key)
                if rule is not None and rule.active != flag:
                    draft.assign_flag(key, flag)
                if draft.merges or (rule is not None and rule.active != flag):
                    self.turn(some, draft)

    def defined(self, part: Part, rows: Rows) -> Mask:
        """Where the user variable exists."""
        existing = self.where(rows, lambda mind: isinstance(mind.symbols.get(part.name), UserVariable))
        if self.answers is not None and not self.is_dead(rows):
            self.answers.append(bool(existing[0]))
        return existing

    @by_the_living
    def define(self, part: Part, rows: Rows, values: Column) -> Column:
        """DEFVAR of a new name."""
        values = values.copy()

        done = self.change(part, rows, partial(rules.define, key=part.name, name=written(part), slot=part.slot))
        values[~done] = nan
        if done.any():
            self.state.assign(part.slot, rows.take(done), values[done])
        return self.answer(values)

    def native(self, program: Program, rows: Rows) -> tuple[Column, Rows] | None:
        """See `Kernels.run`; native code does not tell what moves, or why a test fails."""
        if self.kernels is None or self.moved is not None or self.barred:
            return None
        return self.kernels.run(self, program, rows)

    def read(self, part: Part, rows: Rows) -> Column:
        """A fleet has no linked variables: a program that reads one is of other robots."""
        raise TypeError(f"{part.name} is linked to the memory of one robot")

    def fetch(self, part: Part, rows: Rows) -> Programs:
        """The programs in a buffer or rule, each with the robots that have it there."""
        programs = self.divide(rows, lambda number: self.minds[number].fetch(part))
        self._answer_program(rows, programs)
        return programs

    def operator(self, part: Part, rows: Rows) -> Programs:
        """The programs of an operator; none, and a fault, where it does not exist with this number of parameters."""

        def suiting(number: int) -> Program | None:
            operator = self.minds[number].operator(part)
            return operator if operator is not None and operator.parameters == len(part.parts) else None

        programs = self.divide(rows, suiting)
        for program, some, _ in programs:
            if program is None:
                self.refuse(part, some, no_operator(part.name, len(part.parts)))
        self._answer_program(rows, programs)
        return programs

    def _answer_program(self, rows: Rows, programs: Programs) -> None:
        if self.answers is not None and not self.is_dead(rows):
            self.answers.append(programs[0][0])

    @by_the_living
    def host(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        """Call a function of the robots' own software; any exception becomes a fault."""
        function = host_of(part)
        unknown = np.zeros(rows.size, np.bool_)
        for argument in arguments:
            unknown |= np.isnan(argument)
        if unknown.any() and function.acts:
            self.state.dropped[rows.take(unknown).index] += 1
            self.refuse(part, rows.take(unknown), unknown_asked(function))
        if self.childless and function.name.casefold() in DEADLY:
            self.refuse(part, rows.take(~unknown), self.childless)
            unknown = np.ones(rows.size, np.bool_)
        if function.acts:
            unknown = self._held_too(function, part, rows, unknown)
        known, columns = rows, arguments
        if unknown.any():
            known, columns = rows.take(~unknown), tuple(argument[~unknown] for argument in arguments)
        if function.acts and function.moves:
            self._note_moving(known)
        results = self._ask(function, part, known, columns)
        if self.hosts is not None:
            self.hosts.append((known, results))
        if isinstance(results, list):
            for robot, why in zip(known.robots.tolist(), results, strict=True):
                if isinstance(why, str):
                    self.refuse(part, Rows(np.array([robot]), 1, rows.first), why)
            results = np.array([nan if isinstance(result, str) else result for result in results])
        if known is rows:
            return self.answer(np.array(results))
        values = np.full(rows.size, nan)
        values[~unknown] = results
        return self.answer(values)

    def _held_too(self, function: HostFunction, part: Part, rows: Rows, unknown: Mask) -> Mask:
        """Refuse a function that acts to robots that may not act on their bodies now; gives those of the rows that do
        not call it, for this reason or because something is `unknown`."""
        held = ~unknown if self.barred else self.state.held[rows.index] & ~unknown
        if held.any():
            self.refuse(part, rows.take(held), self.barred or stopped(function))
        return unknown | held

    @property
    def repeatable(self) -> bool:
        return super().repeatable and self.hosts is None

    def near(self, part: Part, rows: Rows, *arguments: Column) -> NeighbourLists:
        """See `Evaluation.near`; a robot reports once that it has more neighbours than it goes through."""
        near = super().near(part, rows, *arguments)
        if near.totals is None or self.script is not None:
            return near
        most, totals = int(part.number), near.totals
        new = (totals > most) & ~self.state.crowded[rows.index]
        if new.any():
            some, label, values = rows.take(new), crowded(most), [totals[new].astype(np.float64)]
            self.state.crowded[some.index] = True
            self.outbox.report(some, label, values)
            if self.printed is not None:
                self.printed.append((some.robots, label, values))
        return near

    def sensed(self, part: Part, rows: Rows, *arguments: Column) -> NeighbourLists:
        """See `Evaluation.sensed`; any exception of a robot's own software becomes a fault."""
        function, sensor = sensor_of(part)
        most = int(part.number)
        if self.script is not None:
            given = [next(self.script) for _ in range(rows.size)]
        elif self._many is not None and sensor.many is not None:
            first, ids = sensor.many(self._many, rows.robots, most, *arguments)
            full = np.diff(first) == most
            near = NeighbourLists(first, ids.astype(np.float64))
            if full.any():
                every, _ = sensor.many(self._many, rows.robots[full], EVERY, *(column[full] for column in arguments))
                totals = np.diff(first)
                totals[full] = np.maximum(np.diff(every), most)
                near = near._replace(totals=totals)
            if self.hosts is not None:
                self.hosts.append((rows, near))
            return near
        else:
            columns = zip(*(column.tolist() for column in arguments), strict=True)
            asked = zip(rows.robots.tolist(), columns, strict=True)
            given = [_near(function, sensor, self.bodies[robot], most, each) for robot, each in asked]
        if self.hosts is not None:
            self.hosts.append((rows, given))
        for robot, why in zip(rows.robots.tolist(), given, strict=True):
            if isinstance(why, str):
                self.refuse(part, Rows(np.array([robot]), 1, rows.first), why)
        return NeighbourLists.listed([each if isinstance(each, tuple) else None for each in given])

    def _ask(
        self, function: HostFunction, part: Part, rows: Rows, columns: Sequence[Column]
    ) -> Column | list[float | str]:
        """The result of the robots' own function on each of them: a number, NaN if it is not finite, or why it
        failed."""
        if self.script is not None:
            return [_number(next(self.script)) for _ in range(rows.size)]
        if self._many is not None and function.many is not None:
            results = function.many(self._many, rows.robots, *columns)
            if results is None:
                return np.broadcast_to(1.0, rows.size)
            if isinstance(results, list):
                return [failed(function, each) if isinstance(each, Exception) else each for each in results]
            finite = np.isfinite(results)
            values: Column = results if finite.all() else np.where(finite, results, nan)
            return values
        label = (part.data.text,) if isinstance(part.data, Label) else ()
        lists = [column.tolist() for column in columns]
        return [
            _call(function, self.bodies[robot], (*label, *(values[index] for values in lists)))
            for index, robot in enumerate(rows.robots.tolist())
        ]

    @by_the_living
    def act(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        """See `RobotMemory.act`."""
        if part.name in FLAGS:
            slot, value = FLAGS[part.name]
            self.state.assign(slot, rows, value)
            return self.answer(np.ones(rows.size))
        values = self.answer(ACTS[part.name](self, part, rows, *arguments))
        if part.name == "rollback" and self.answers is not None:
            self.answers += self.state.row(int(rows.robots[0]))[ACTIVE0 + 1 : ACTIVE0 + BUFFERS]
        return values

    @by_the_living
    def store(self, part: Part, rows: Rows, values: Column) -> Column:
        """SETQQ, RULE, and SETQ of a buffer."""
        return self.answer(_store(self, part, rows, values))


def _number(result: HostResult) -> float | str:
    """What one of the robots' own functions has given that gives numbers."""
    return nan if isinstance(result, tuple) else result


def _near(
    function: HostFunction, sensor: NeighbourSensor, body: object | None, most: int, arguments: Sequence[float]
) -> HostResult:
    """One robot's neighbours, or why they could not be found."""
    try:
        return listed(sensor, body, most, arguments)
    except Exception as error:
        return failed(function, error)


def _call(function: HostFunction, body: object | None, arguments: tuple[str | float, ...]) -> float | str:
    """The result of one robot's own function: a number, NaN if it is not finite, or why it failed."""
    try:
        result = function.call(body, *arguments)
        number = 1.0 if result is None else float(result)
    except Exception as error:
        return failed(function, error)
    return number if np.isfinite(number) else nan


# ---- acts: what an expression may do besides assigning; `mind.rules` defines what each means


def _values(done: Mask, value: float = 1.0) -> Column:
    return np.where(done, value, nan)


def _store(memory: FleetMemory, part: Part, rows: Rows, values: Column) -> Column:
    storing = part.data
    if not isinstance(storing, Storing):
        raise TypeError(f"a part of op {part.op} stores nothing")
    if not storing.value:
        done = _store_form(memory, part, rows, storing.form, storing)
        return _values(done, 1.0 if storing.activate else 0.0)
    stored = values.copy()
    storing_rows = memory.refuse_where(part, rows, np.isnan(values), UNKNOWN_STORED, stored)
    numbers = values[~np.isnan(values)]
    done = np.zeros(storing_rows.size, np.bool_)
    for bits in np.unique(numbers.view(np.int64)):  # 0 and -0 are two expressions
        same = numbers.view(np.int64) == bits
        number = float(bits.view(np.float64))
        done[same] = _store_form(memory, part, storing_rows.take(same), Number(number), storing)
    known = ~np.isnan(stored)
    stored[known] = np.where(done, numbers, nan)
    return stored


def _store_form(memory: FleetMemory, part: Part, rows: Rows, form: Form, storing: Storing) -> Mask:
    """Store an expression in a buffer or rule; returns where it was done."""
    key, text, number = storing.key, show(form), buffer_number(storing.key)
    name = written(part) if number is None else key.upper()
    done = np.zeros(rows.size, np.bool_)
    flags = np.zeros(rows.size, np.bool_)
    if number is not None:
        flags = memory.state.column(ACTIVE0 + number, rows) > 0.0
    for flag in (False, True):
        chosen = flags == flag
        if chosen.any():
            store = partial(rules.store, key=key, name=name, text=text, flag=flag)
            store = partial(store, activate=storing.activate, rank=storing.rank)
            done[chosen] = memory.change(part, rows.take(chosen), store)
    return done


def _join(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    name = label_of(part)
    done = memory.change(part, rows, partial(rules.join, name=name))
    if done.any():
        memory.state.group(name.casefold())[rows.take(done).index] = True
    return _values(done)


def _leave(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    name = label_of(part)
    done = np.ones(rows.size, np.bool_)
    if memory.merges:  # otherwise nothing forbids it
        done = memory.change(part, rows, partial(rules.leave, name=name))
    if name.casefold() in memory.state.groups:
        memory.state.groups[name.casefold()][rows.take(done).index] = False
    return _values(done)


def _activate(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    activate = partial(rules.activate, key=label_of(part), wanted=part.name == "activate")
    return _values(memory.change(part, rows, activate))


def _forget(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    return _values(memory.change(part, rows, partial(rules.forget, key=label_of(part))))


def _lease(memory: FleetMemory, part: Part, rows: Rows, seconds: Column) -> Column:
    key = label_of(part)
    values = seconds.copy()
    known = memory.refuse_where(part, rows, np.isnan(seconds), UNKNOWN_LEASE, values)
    if known.size == 0:
        return values
    lasting = ~np.isnan(values)
    done = memory.change(part, known, partial(rules.lease, key=key))
    if done.any():
        some = known.take(done)
        memory.statistics.lease(key, some, memory.state.column(TIME_SLOT, some) + values[lasting][done])
    values[lasting] = np.where(done, 1.0, nan)
    return values


def _defun(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    defining = part.data
    if not isinstance(defining, Defining):
        raise TypeError(f"a part of op {part.op} defines nothing")
    text = " ".join(map(show, defining.body))
    define = partial(rules.define_operator, name=written(part), parameters=defining.parameters, text=text)
    return _values(memory.change(part, rows, define))


def _rollback(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    state = memory.state
    if memory.merges:
        state.merging.change(rows, _rolled_back)
    unproven = state.column(TICK, rows) - state.unproven_since[rows.index] < PROVEN_TICKS
    for proven in np.unique(state.proven[rows.index][unproven]).tolist():
        wanted = [rule for rule in memory.minds[proven].rules.values() if not rule.protected]
        some = rows.take(unproven & (state.proven[rows.index] == proven))
        memory.change(part, some, partial(rules.roll_back, wanted=wanted))
        for rule in wanted:
            memory.statistics.restore_lease(rule.key, some)
    return np.ones(rows.size)


def _rolled_back(merging: Merging) -> Merging:
    draft = merging.draft()
    draft.roll_back()
    return draft


def _report(memory: FleetMemory, part: Part, rows: Rows, *arguments: Column) -> Column:
    memory.outbox.report(rows, label_of(part), arguments)
    if memory.printed is not None:
        memory.printed.append((rows.robots, label_of(part), arguments))
    return arguments[-1] if arguments else np.ones(rows.size)


def _tell(memory: FleetMemory, part: Part, rows: Rows, *arguments: Column) -> Column:
    if not isinstance(part.data, Template):
        raise TypeError(f"a part of op {part.op} tells nothing")
    values = np.ones(rows.size)
    unknown = np.zeros(rows.size, np.bool_)
    for argument in arguments:
        unknown |= np.isnan(argument)
    memory.refuse_where(part, rows, unknown, UNKNOWN_TOLD, values)
    hops, auction = min(part.data.hops, memory.hops), part.data.auction
    number = None if auction is None else part.data.number
    telling = ~unknown
    if auction is not None:
        telling = _calling(memory, part, rows, telling, values)
    telling[telling] = _may_tell(memory, rows.take(telling), hops)  # first: only what is sent needs a text
    told: dict[str, list[int]] = {}
    columns = [argument.tolist() for argument in arguments]
    for index in np.flatnonzero(telling).tolist():
        told.setdefault(part.data.text([column[index] for column in columns]), []).append(index)
    for text, indices in told.items():
        mask = np.zeros(rows.size, np.bool_)
        mask[indices] = True
        if len(text) > MAX_TEXT:
            memory.refuse_where(part, rows, mask, too_long(text), values)
        else:
            for driver, some in memory.drivers(rows.take(mask)):
                memory.outbox.tell(some, text, hops, driver, number)
                if auction is not None:
                    _begin_calls(memory, auction, part.data.number, some)
    return values


def _begin_calls(memory: FleetMemory, auction: Auction, number: int, rows: Rows) -> None:
    """These robots tell the poll of an auction."""
    for robot, now in zip(rows.robots.tolist(), memory.state.column(TIME_SLOT, rows).tolist(), strict=True):
        if (calls := memory.calls(robot)) is not None:
            calls.begin(auction, number, now)


def _calling(memory: FleetMemory, part: Part, rows: Rows, telling: Mask, values: Column) -> Mask:
    """Which of the robots tell the poll of an auction now; it goes on in any case for who did a moment ago."""
    assert isinstance(part.data, Template)
    auction, number = part.data.auction, part.data.number
    due, full = np.zeros((2, rows.size), np.bool_)
    robots, now = rows.robots, memory.state.column(TIME_SLOT, rows)
    for index in np.flatnonzero(telling).tolist():
        calls = memory.calls(int(robots[index]))
        if auction is not None and calls is not None and not calls.renew(auction, number, float(now[index])):
            due[index], full[index] = calls.has_room(number), not calls.has_room(number)
    memory.refuse_where(part, rows, full, TOO_MANY_CALLS, values)
    return due


def _may_tell(memory: FleetMemory, rows: Rows, hops: int) -> Mask:
    """Which of these robots may TELL something now, over this many hops."""
    told, less = memory.outbox.may_tell(rows, hops)
    label = TELLS_TOO_OFTEN if hops >= 1 else TELLS_TOO_FAR
    if less.size:
        memory.outbox.report(less, label)
        if memory.printed is not None:
            memory.printed.append((less.robots, label, ()))
    return told


def _ping(memory: FleetMemory, part: Part, rows: Rows, caste: Column | None = None) -> Column:
    castes = np.zeros(rows.size) if caste is None else caste
    values = np.ones(rows.size)
    known = memory.refuse_where(part, rows, np.isnan(castes), UNKNOWN_CASTE, values)
    memory.outbox.ping(known, castes[~np.isnan(castes)])
    return values


def _cancel(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    if memory.script is not None:
        return np.array([_number(next(memory.script)) for _ in range(rows.size)], np.float64)
    discarded = memory.cancel(rows)
    if memory.hosts is not None:
        memory.hosts.append((rows, discarded))
    return discarded


ACTS: dict[str, Act] = {
    "join": _join,
    "leave": _leave,
    "activate": _activate,
    "deactivate": _activate,
    "forget": _forget,
    "lease": _lease,
    "defun": _defun,
    "rollback": _rollback,
    "report": _report,
    "tell": _tell,
    "cancel": _cancel,
    "ping": _ping,
}
