"""The machine: evaluates a program for many robots in one walk over its parts, bit for bit as each would by itself.

Where robots take different branches - AND, OR, COND, IF, DICE, buffers that hold different expressions - the rows
are split, and each branch is walked with the robots that take it; nothing is computed for the others. Within one
robot everything happens in the same order as in the one-robot machine.

The columns that `value` returns belong to its caller: they are not views of robots' variables.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import nan

import numpy as np

from sleepcast.columns import pure
from sleepcast.columns.evaluation import Evaluation, Programs
from sleepcast.columns.neighbours import Fold, NeighbourLists, PairRows, reduced
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.language.evaluate import is_true, too_deep
from sleepcast.language.functions import AMONG_ROBOTS, NO_INSTANT
from sleepcast.language.numerics import normal
from sleepcast.language.parts import Part, host_of, is_acting
from sleepcast.language.program import Program

_CHANGING = frozenset({"set_user", "set_local", "write", "defvar", "store", "fetch", "call", "host", "act"})


def evaluate(memory: Evaluation, program: Program, rows: Rows) -> Column:
    """Evaluate a program once on these robots; returns its values, with the other results in the memory."""
    memory.begin(program, rows)
    native = memory.native(program, rows)
    if native is None:
        return walk_through(memory, program, rows)
    values, left = native
    if left.size:
        values[np.isin(rows.robots, left.robots)] = walk_through(memory, program, left)
    return values


def walk_through(memory: Evaluation, program: Program, rows: Rows) -> Column:
    """Walk a program whose evaluation has begun."""
    with np.errstate(all="ignore"):  # exceptional values are found in the results
        pieces = [Sweep(memory, program, chunk).value(program.root, chunk) for chunk in rows.chunks()]
    values = pieces[0] if len(pieces) == 1 else np.concatenate(pieces) if pieces else np.empty(0)
    if memory.dead is not None:
        values = np.where(memory.dead[rows.index], nan, values)
    if program.is_test:
        memory.matched[rows.index] = is_true(values)
        if memory.undecided is not None:
            memory.undecided[rows.index] = np.isnan(values)
    return values


def _is_steady(part: Part) -> bool:
    """Whether variables keep their values while `part` is evaluated."""
    if part.steady is None:
        part.steady = part.op not in _CHANGING and all(map(_is_steady, part.parts))
    return part.steady


class Sweep:
    """One walk through one program.

    rows: all robots that take part
    arguments: values of an operator's parameters
    """

    def __init__(self, memory: Evaluation, program: Program, rows: Rows, arguments: Sequence[Column] = ()) -> None:
        self.memory = memory
        self._width = rows.width
        self._locals: list[Column | None] = [None] * program.locals
        self._of_pairs: dict[int, Column] = {}
        for slot, argument in enumerate(arguments):
            self.set_local(slot, rows, argument)

    def value(self, part: Part, rows: Rows) -> Column:
        """The values of `part`, with all its side effects."""
        if part.parts and is_plain(part):
            return self._plain(rows).column(part)
        return _EVALUATORS[part.op](self, part, rows)

    def _plain(self, rows: Rows) -> Plain:
        return Plain(rows, self.memory.state.read, self.local, self.memory.faults)

    def all(self, parts: Sequence[Part], rows: Rows) -> list[Column]:
        return [self.value(part, rows) for part in parts]

    def last(self, parts: Sequence[Part], rows: Rows) -> Column:
        """Evaluate one after the other; returns the values of the last, 0 if there is none."""
        values = None
        for part in parts:
            values = self.value(part, rows)
        return np.zeros(rows.size) if values is None else values

    def truth(self, part: Part, rows: Rows) -> Mask:
        """Where `part` is true; cheaper than its values."""
        if is_plain(part):
            return self._plain(rows).truth(part, None)
        return is_true(self.value(part, rows))

    def arguments(self, part: Part, rows: Rows) -> list[pure.Argument]:
        """The values of a function's arguments; copied only if something may change them before they are used."""
        if not _is_steady(part):
            return list(self.all(part.parts, rows))
        return [self._seen(inside, rows) for inside in part.parts]

    def _seen(self, part: Part, rows: Rows) -> pure.Argument:
        if part.op == "const":
            return part.number
        if part.op == "var":
            return self.memory.state.read(part.slot, rows)
        return self.value(part, rows)

    def begin_pairs(self, slot: int, ids: Column) -> None:
        """From now on, rows may be pairs of robots and neighbours. slot: of the local name that is the neighbour."""
        self._of_pairs = {slot: ids}

    def local(self, slot: int, rows: Rows) -> Column:
        if isinstance(rows, PairRows) and slot in self._of_pairs:
            return self._of_pairs[slot][rows.places]
        column = self._locals[slot]
        return np.full(rows.size, nan) if column is None else column[rows.within].copy()

    def set_local(self, slot: int, rows: Rows, values: Column | float) -> None:
        if isinstance(rows, PairRows):
            self._of_pairs.setdefault(slot, np.full(rows.most, nan))[rows.places] = values
            return
        column = self._locals[slot]
        if column is None:
            column = self._locals[slot] = np.full(self._width, nan)
        column[rows.within] = values

    def watched(self, part: Part, rows: Rows) -> None:
        """Record that a top-level test has held; tests inside buffers or operators do not count."""
        memory = self.memory
        if part.watch and memory.depth == 0 and rows.size:
            some = rows if memory.dead is None else rows.take(~memory.dead[rows.index])
            memory.matched[some.index] = True

    def tested(self, part: Part, test: Part, rows: Rows) -> Mask:
        """Where a test of `part` holds; where it is unknown is recorded."""
        if self.memory.undecided is None or not part.watch:
            return self.truth(test, rows)
        value = self.value(test, rows)
        self.undecided(part, rows, value)
        return is_true(value)

    def undecided(self, part: Part, rows: Rows, values: Column) -> None:
        """Record where a top-level test with these values is unknown."""
        memory = self.memory
        if memory.undecided is not None and part.watch and memory.depth == 0:
            memory.undecided[rows.take(np.isnan(values)).index] = True

    def enter(self, part: Part, program: Program, rows: Rows, arguments: Sequence[Column]) -> Column:
        """Enter a buffer, rule or operator."""
        memory = self.memory
        refusal = too_deep(memory, program)
        if refusal:
            return memory.fault(part, rows, refusal)
        memory.charge(program, rows if memory.dead is None else rows.take(~memory.dead[rows.index]))
        if memory.dead is None:
            return self._inside(program, rows, arguments)
        values, alive = np.full(rows.size, nan), ~memory.dead[rows.index]
        if alive.any():
            living = [argument[alive] for argument in arguments]
            values[alive] = self._inside(program, rows.take(alive), living)
        return values

    def _inside(self, program: Program, rows: Rows, arguments: Sequence[Column]) -> Column:
        memory = self.memory
        memory.depth, memory.levels = memory.depth + 1, memory.levels + program.height
        values = Sweep(memory, program, rows, arguments).value(program.root, rows)
        memory.depth, memory.levels = memory.depth - 1, memory.levels - program.height
        return values

    def enter_each(self, part: Part, programs: Programs, rows: Rows) -> Column:
        """Enter each of several programs with its robots, and the values of the part's own parts as arguments."""
        if len(programs) == 1:
            return self._enter_one(part, programs[0][0], rows)
        values = np.full(rows.size, nan)
        for program, some, mask in programs:
            if mask is not None:
                values[mask] = self._enter_one(part, program, some)
        return values

    def _enter_one(self, part: Part, program: Program | None, rows: Rows) -> Column:
        if program is None:
            return np.full(rows.size, nan)
        return self.enter(part, program, rows, self.all(part.parts, rows))


class _Branches:
    """The rows of a form with branches: those still open, and the values of the others."""

    def __init__(self, rows: Rows) -> None:
        self.open = rows
        self.values = np.zeros(rows.size)
        self._open_at: Index | None = None
        """Indices of the open rows among all; None while all are open."""

    def settle(self, mask: Mask, values: Column | float) -> None:
        """Set the values (one for each) of the open rows in `mask`, and close these rows."""
        if self._open_at is None:
            self.values[mask] = values
            self._open_at = np.flatnonzero(~mask)
        else:
            self.values[self._open_at[mask]] = values
            self._open_at = self._open_at[~mask]
        self.open = self.open.take(~mask)

    def settle_all(self, values: Column | float) -> Column:
        """Set the values of all open rows; returns the values of all rows."""
        if self._open_at is None:
            self.values[...] = values
        else:
            self.values[self._open_at] = values
        return self.values


def _and(w: Sweep, part: Part, rows: Rows) -> Column:
    branches, value = _Branches(rows), np.ones(rows.size)
    for done, inside in enumerate(part.parts):
        if part.watch == done:
            w.watched(part, branches.open)
        value = w.value(inside, branches.open)
        true = is_true(value)
        if not true.all():
            if done < part.watch:
                w.undecided(part, branches.open, value)
            branches.settle(~true, value[~true])
            value = value[true]
            if branches.open.size == 0:
                return branches.values
    if part.watch == len(part.parts):
        w.watched(part, branches.open)
    return branches.settle_all(value)


def _or(w: Sweep, part: Part, rows: Rows) -> Column:
    branches, unknown = _Branches(rows), np.zeros(rows.size, np.bool_)
    for inside in part.parts:
        value = w.value(inside, branches.open)
        unknown |= np.isnan(value)
        true = is_true(value)
        if true.any():
            branches.settle(true, value[true])
            unknown = unknown[~true]
            if branches.open.size == 0:
                return branches.values
    return branches.settle_all(np.where(unknown, nan, 0.0))


def _known(w: Sweep, part: Part, rows: Rows) -> Column:
    return np.where(np.isnan(w.value(part.parts[0], rows)), 0.0, 1.0)


def _cond(w: Sweep, part: Part, rows: Rows) -> Column:
    branches = _Branches(rows)
    for clause in part.parts:
        test, *body = clause.parts
        value = np.empty(0) if body else w.value(test, branches.open)
        true = w.tested(clause, test, branches.open) if body else is_true(value)
        if not body:
            w.undecided(clause, branches.open, value)
        if true.any():
            taken = branches.open.take(true) if not true.all() else branches.open
            w.watched(clause, taken)
            branches.settle(true, w.last(body, taken) if body else value[true])
            if branches.open.size == 0:
                return branches.values
    return branches.settle_all(0.0)


def _if(w: Sweep, part: Part, rows: Rows) -> Column:
    branches = _Branches(rows)
    true = w.tested(part, part.parts[0], rows)
    if true.any():
        taken = rows.take(true) if not true.all() else rows
        w.watched(part, taken)
        branches.settle(true, w.value(part.parts[1], taken))
        if branches.open.size == 0:
            return branches.values
    return branches.settle_all(w.last(part.parts[2:], branches.open))


def _let(w: Sweep, part: Part, rows: Rows) -> Column:
    count = int(part.number)
    for index, values in enumerate(w.all(part.parts[:count], rows)):
        w.set_local(part.slot + index, rows, values)
    return w.last(part.parts[count:], rows)


def _dotimes(w: Sweep, part: Part, rows: Rows) -> Column:
    for i in range(int(part.number)):
        w.set_local(part.slot, rows, float(i))
        w.all(part.parts, rows)
    return np.zeros(rows.size)


def _over(w: Sweep, part: Part, rows: Rows) -> Column:
    *which, body = part.parts
    near = w.memory.near(part, rows, *w.all(which, rows))
    value = _at_once(w, part, near, rows) if is_pairwise(body) and w.memory.repeatable else None
    if value is None:
        fold = Fold(part.name, rows.size)
        for some, places, ids in near.turns(rows):
            w.set_local(part.slot, some, ids)
            fold.take(places, ids, w.last(body.parts, some))
        value = fold.value()
        if fold.overflowed.any():
            w.memory.fault(part, rows.take(fold.overflowed), "overflow")
            value[fold.overflowed] = nan
    if near.known is not None:
        value[~near.known] = nan
    return value


def _at_once(w: Sweep, part: Part, near: NeighbourLists, rows: Rows) -> Column | None:
    """The same for all neighbours of all robots at once; None where there is any fault: then they are gone through one
    after the other, so that faults come in their order."""
    before, values = len(w.memory.noted), np.empty(rows.size)
    for start, stop in near.pieces():
        pairs, ids = near.pairs(rows, start, stop)
        w.begin_pairs(part.slot, ids)
        given = w.last(part.parts[-1].parts, pairs)
        fold = reduced(part.name, pairs.asked, ids, given, stop - start)
        if fold is None:
            break
        values[start:stop] = fold
    if fold is not None and len(w.memory.noted) == before:
        return values
    w.memory.forget_faults(before)
    return None


def _each(w: Sweep, part: Part, rows: Rows) -> Column:
    *which, body = part.parts
    near = w.memory.near(part, rows, *w.all(which, rows))
    for some, _, ids in near.turns(rows):
        w.set_local(part.slot, some, ids)
        w.all(body.parts, some)
    return np.zeros(rows.size) if near.known is None else np.where(near.known, 0.0, nan)


def _set_local(w: Sweep, part: Part, rows: Rows) -> Column:
    values = w.value(part.parts[0], rows)
    w.set_local(part.slot, rows, values)
    return values


def _defvar(w: Sweep, part: Part, rows: Rows) -> Column:
    branches, existing = _Branches(rows), w.memory.defined(part, rows)
    if existing.any():
        branches.settle(existing, w.memory.state.column(part.slot, rows.take(existing)))
        if branches.open.size == 0:
            return branches.values
    new = w.value(part.parts[0], branches.open) if part.parts else np.full(branches.open.size, nan)
    return branches.settle_all(w.memory.define(part, branches.open, new))


def _fetch(w: Sweep, part: Part, rows: Rows) -> Column:
    return w.enter_each(part, w.memory.fetch(part, rows), rows)


def _call(w: Sweep, part: Part, rows: Rows) -> Column:
    return w.enter_each(part, w.memory.operator(part, rows), rows)


def _pure(w: Sweep, part: Part, rows: Rows) -> Column:
    return pure.apply(part, w.arguments(part, rows), rows.size, partial(w.memory.faults, part, rows))


def _prob(w: Sweep, part: Part, rows: Rows) -> Column:
    values = w.value(part.parts[0], rows).copy()
    known = ~np.isnan(values)
    values[known] = np.where(w.memory.draw(part, rows.take(known)) < values[known], 1.0, 0.0)
    return values


def _dice(w: Sweep, part: Part, rows: Rows) -> Column:
    branches, drawn, total = _Branches(rows), w.memory.draw(part, rows), np.zeros(rows.size)
    for side in part.parts:
        total = total + w.value(side.parts[0], branches.open)
        unknown = np.isnan(total)
        hit = ~unknown & (drawn < total)
        if hit.any():
            settled = np.full(hit.size, nan)
            settled[hit] = w.value(side.parts[1], branches.open.take(hit))
            branches.settle(hit | unknown, settled[hit | unknown])
        elif unknown.any():
            branches.settle(unknown, nan)
        else:
            continue
        drawn, total = drawn[~(hit | unknown)], total[~(hit | unknown)]
        if branches.open.size == 0:
            return branches.values
    return branches.settle_all(0.0)


def _finite(w: Sweep, part: Part, rows: Rows, values: Column) -> Column:
    """Random values, with a fault where they are not finite."""
    wrong = ~np.isfinite(values)
    if wrong.any():
        w.memory.fault(part, rows.take(wrong), "overflow")
        values[wrong] = nan
    return values


def _random(w: Sweep, part: Part, rows: Rows) -> Column:
    low, high = w.all(part.parts, rows)
    known = ~(np.isnan(low) | np.isnan(high))
    some, low, high = rows.take(known), low[known], high[known]
    values = np.full(rows.size, nan)
    drawn = w.memory.draw(part, some)
    values[known] = _finite(w, part, some, low + drawn * (high - low))
    return values


def _gauss(w: Sweep, part: Part, rows: Rows) -> Column:
    mean, deviation = w.all(part.parts, rows)
    values = np.full(rows.size, nan)
    unknown = np.isnan(mean) | np.isnan(deviation)
    for index in np.flatnonzero(~unknown & (deviation < 0)).tolist():
        one = np.zeros(rows.size, np.bool_)
        one[index] = True
        w.memory.fault(part, rows.take(one), f"deviation of {deviation[index]:g}: it cannot be negative")
    known = ~unknown & (deviation >= 0)
    some = rows.take(known)
    drawn = w.memory.draw(part, some)
    quantiles = np.array([nan if u != u else normal(u) for u in drawn.tolist()])
    values[known] = _finite(w, part, some, mean[known] + deviation[known] * quantiles)
    return values


def _in(w: Sweep, part: Part, rows: Rows) -> Column:
    members = w.memory.state.members(part.name)
    return np.zeros(rows.size) if members is None else members[rows.index].astype(np.float64)


def _var(w: Sweep, part: Part, rows: Rows) -> Column:
    values = w.memory.state.read(part.slot, rows)
    return np.full(rows.size, values) if isinstance(values, float) else values.copy()


_EVALUATORS: dict[str, Callable[[Sweep, Part, Rows], Column]] = {
    "const": lambda w, p, r: np.full(r.size, p.number),
    "var": _var,
    "linked": lambda w, p, r: w.memory.read(p, r),
    "local": lambda w, p, r: w.local(p.slot, r),
    "absent": lambda w, p, r: np.full(r.size, nan),
    "pure": _pure,
    "and": _and,
    "or": _or,
    "known": _known,
    "cond": _cond,
    "if": _if,
    "progn": lambda w, p, r: w.last(p.parts, r),
    "let": _let,
    "dotimes": _dotimes,
    "over": _over,
    "each": _each,
    "set_user": lambda w, p, r: w.memory.assign(p, r, w.value(p.parts[0], r)),
    "set_local": _set_local,
    "write": lambda w, p, r: w.memory.write(p, r, w.value(p.parts[0], r)),
    "defvar": _defvar,
    "store": lambda w, p, r: w.memory.store(p, r, w.last(p.parts, r)),
    "fetch": _fetch,
    "call": _call,
    "host": lambda w, p, r: w.memory.host(p, r, *w.all(p.parts, r)),
    "missing": lambda w, p, r: w.memory.fault(p, r, f"this robot has no function {p.name}"),
    "auction": lambda w, p, r: w.memory.fault(p, r, f"{p.name} chooses {AMONG_ROBOTS}"),
    "timed": lambda w, p, r: w.memory.fault(p, r, NO_INSTANT),
    "in": _in,
    "prob": _prob,
    "dice": _dice,
    "random": _random,
    "gauss": _gauss,
    "act": lambda w, p, r: w.memory.act(p, r, *w.all(p.parts, r)),
}


# Plain parts: numbers, variables, functions of numbers and tests; without side effects or random numbers.

_PLAIN = frozenset({"const", "var", "local", "absent", "pure", "and", "or", "known"})
_PAIRWISE = _PLAIN | {"if", "cond", "clause", "progn", "let", "in"}
_COSTLY = frozenset({"^", "EXP", "LOG", "SIN", "COS", "TAN", "ATAN2", "BEARING", "EDGE-DIST"})

Local = Callable[[int, Rows], Column]
Faults = Callable[[Part, Rows, Index, Sequence[str]], None]


def is_pairwise(part: Part) -> bool:
    """Whether `part` can be evaluated for all neighbours of all robots at once: it does, draws and enters nothing."""
    if part.pairwise is None:
        itself = part.op in _PAIRWISE or (part.op == "host" and _repeats(part))
        part.pairwise = itself and all(map(is_pairwise, part.parts))
    return part.pairwise


def _repeats(part: Part) -> bool:
    """Whether a robot's own function can be asked of one robot for several of its neighbours at once."""
    function = host_of(part)
    return function.repeats and function.many is not None and not is_acting(part)


def is_plain(part: Part) -> bool:
    """Whether `part` is plain throughout, and cheap enough to compute even if not needed."""
    if part.plain is None:
        costly = part.op == "pure" and part.function.name in _COSTLY
        itself = part.op in _PLAIN and not part.watch and not costly
        part.plain = itself and all(map(is_plain, part.parts))
    return part.plain


def _is_test(part: Part) -> bool:
    """Whether a part is a comparison of two values, which never holds if either is unknown."""
    return part.op == "pure" and len(part.parts) == 2 and part.function.name in pure.TESTS


class Plain:
    """Evaluates plain parts on some rows.

    read: a variable by slot
    local: a local name
    faults: records some
    """

    def __init__(self, rows: Rows, read: Callable[[int, Rows], Column | float], local: Local, faults: Faults) -> None:
        self._rows, self._read, self._local, self._faults = rows, read, local, faults

    def value(self, part: Part, mask: Mask | None) -> pure.Argument:
        """The values of a part. mask: the rows that reach it, None for all; other rows' values are meaningless."""
        match part.op:
            case "const":
                return part.number
            case "var":
                return self._read(part.slot, self._rows)
            case "local":
                return self._local(part.slot, self._rows)
            case "absent":
                return np.nan
            case "known":
                return np.where(np.isnan(self.value(part.parts[0], mask)), 0.0, 1.0)
            case "and":
                return self._and(part, mask)
            case "or":
                return self._or(part, mask)
            case _:
                return self._pure(part, mask)

    def column(self, part: Part) -> Column:
        """The values of a part that all rows reach, not a view of anything."""
        if part.op == "pure":
            return self._pure(part, None)
        return np.array(np.broadcast_to(self.value(part, None), self._rows.size))

    def truth(self, part: Part, mask: Mask | None) -> Mask:
        """Where a part is true, among the rows that reach it."""
        if _is_test(part):
            first, second = (self.value(inside, mask) for inside in part.parts)
            return self._mask(pure.TESTS[part.function.name](first, second))
        if part.op == "and":
            truths: Mask | None = None
            for inside in part.parts:
                open_rows = mask if truths is None else truths if mask is None else truths & mask
                true = self.truth(inside, open_rows)
                truths = true if truths is None else truths & true
            return self._mask(True) if truths is None else truths
        return self._mask(is_true(self.value(part, mask)))

    def _mask(self, truths: object) -> Mask:
        return np.broadcast_to(np.asarray(truths, np.bool_), self._rows.size)

    def _and(self, part: Part, mask: Mask | None) -> pure.Argument:
        if len(part.parts) > 1 and all(map(_is_test, part.parts)):
            return self._all_hold(part, mask)
        values: pure.Argument = 1.0
        for index, inside in enumerate(part.parts):
            if index == 0:
                values = self.value(inside, mask)
                continue
            true: Mask = np.asarray(is_true(values))
            values = np.where(true, self.value(inside, true if mask is None else true & mask), values)
        return values

    def _all_hold(self, part: Part, mask: Mask | None) -> Column:
        """AND of comparisons of two values, the most common predicate: 1 where all hold, unknown where the first that
        does not hold is unknown."""
        holding = unknown = None
        for inside in part.parts:
            reached = mask if holding is None else holding if mask is None else holding & mask
            numbers = [self.value(each, reached) for each in inside.parts]
            for number in numbers:
                missing = np.isnan(number)
                if missing.any():
                    missing = missing if holding is None else missing & holding
                    unknown = missing if unknown is None else unknown | missing
            holds = pure.TESTS[inside.function.name](*numbers)
            holding = holds if holding is None else holding & holds
        values: Column = np.asarray(holding, np.float64)
        return values if unknown is None else np.where(unknown, np.nan, values)

    def _or(self, part: Part, mask: Mask | None) -> pure.Argument:
        values: pure.Argument = 0.0
        unknown: Mask | bool = False
        for index, inside in enumerate(part.parts):
            false: Mask = ~np.asarray(is_true(values))
            reached = mask if index == 0 else false if mask is None else false & mask
            values = np.where(false, self.value(inside, reached), values)
            unknown = unknown | np.isnan(values)
        return np.where(np.asarray(is_true(values)), values, np.where(unknown, np.nan, 0.0))

    def _pure(self, part: Part, mask: Mask | None) -> Column:
        def report(indices: Index, reasons: Sequence[str]) -> None:
            if mask is not None:
                reached = np.broadcast_to(mask, self._rows.size)[indices]
                indices = indices[reached]
                reasons = [reason for reason, met in zip(reasons, reached, strict=True) if met]
            self._faults(part, self._rows, indices, reasons)

        return pure.apply(part, [self.value(inside, mask) for inside in part.parts], self._rows.size, report)


def no_local(slot: int, rows: Rows) -> Column:
    raise AssertionError(f"a local name {slot} outside of anything that could have bound it")


def no_fault(part: Part, rows: Rows, places: Index, reasons: Sequence[str]) -> None:
    """Nobody is told what is undefined; it is unknown."""
