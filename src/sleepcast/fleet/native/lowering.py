"""Lowering: checked expressions to native code, as `machine` walks them, for all lanes at once.

A mask says which lanes reach a part. Anything exceptional - a fault, an unknown for an actuator, anything that only
a walk can do - marks its lanes as trouble; whatever the code computes there afterwards is discarded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import TypeAlias

from sleepcast.core.model import BodyColumn, HostFunction
from sleepcast.fleet.native import formulas
from sleepcast.fleet.native.assembly import Assembly
from sleepcast.fleet.native.symbols import Meaning, constants, entered, is_native
from sleepcast.language.acts import FLAGS
from sleepcast.language.numerics import GOLDEN, MASK, UNIT
from sleepcast.language.parts import Part, host_of, walk
from sleepcast.language.program import Program
from sleepcast.language.vocabulary import Variable, VariableKind

LIGHT = 3
"""Parts at most that are computed even if not needed, rather than skipped."""
ELEMENTS = {
    "slot": ("double", 8),
    "value": ("double", 8),
    "keys": ("i64", 8),
    "draws": ("i32", 4),
    "steps": ("i16", 2),
    "part": ("i8", 1),
    "group": ("i8", 1),
    "acted": ("i8", 1),
    "fresh": ("i8", 1),
    "held": ("i8", 1),
    "ping": ("double", 8),
    "body": ("i8", 1),
    "body_real": ("double", 8),
}
"""The LLVM type and bytes of an element of each kind of column."""
_FIRST, _SECOND = 0xBF58_476D_1CE4_E5B9, 0x94D0_49BB_1331_11EB


class Addresses:
    """The addresses of columns that the code uses, created as needed.

    read: gives the lanes of a column. call: calls a robots' own function. `written` holds the cells of slots that the
    code assigns: their new values, and in which lanes; `moved` those of columns of bodies, by name,
    `pinged` those of castes.
    """

    def __init__(self, a: Assembly, read: Callable[[str, int | str, str], str], call: Call) -> None:
        self.a, self.read, self.call = a, read, call
        self.written: dict[int, tuple[str, str]] = {}
        self.moved: dict[str, tuple[str, str]] = {}
        self.pinged = "", ""
        self.actuators: set[int] = set()

    def slot(self, slot: int) -> str:
        """The current value of a variable."""
        if slot in self.written:
            return self.a.get(self.written[slot][0], self.a.real)
        return self.read("slot", slot, self.a.real)

    def assign(self, slot: int, value: str, mask: str) -> None:
        a = self.a
        cell, where = self.written[slot]
        a.put(cell, a.real, a.select(mask, value, a.get(cell, a.real)))
        a.put(where, a.truth, a.either(a.get(where, a.truth), mask))

    def write(self, column: BodyColumn, value: str, mask: str) -> None:
        """Write lanes of a column of bodies, at the end of the round."""
        a, kind = self.a, self.a.vector(ELEMENTS[kind_of(column)][0])
        cell, where = self.moved[column.name]
        a.put(cell, kind, a.select(mask, value, a.get(cell, kind), kind))
        a.put(where, a.truth, a.either(a.get(where, a.truth), mask))


Call: TypeAlias = Callable[[HostFunction, tuple[float | None, ...], Sequence[str], str], str]
"""Calls a function: with the constants among its arguments, all of them, and the lanes that do."""


def kind_of(column: BodyColumn) -> str:
    """The kind of column, of `ELEMENTS`, for the elements of a body's column."""
    return "body" if column.size == 1 else "body_real"


class Lowering:
    """Writes the code of one program after the other. drawn: the cell with the number of draws in this tick."""

    def __init__(self, a: Assembly, columns: Addresses, names: Meaning, *, calls: bool) -> None:
        self.a, self._columns, self._names, self._calls = a, columns, names, calls
        self.trouble = a.cell(a.truth, a.no)
        self.drawn = ""
        self.matched = self.steps = ""
        self._locals: list[str] = []
        self._depth = self._levels = 0

    def program(self, program: Program, mask: str) -> str:
        """The values of a program; afterwards the cells `matched` and, if it enters others, `steps` hold its other
        results."""
        a = self.a
        self.matched = a.cell(a.truth, a.no)
        self.steps = a.cell(a.whole, a.integer("i32", program.cost)) if enters(program, self._names) else ""
        self._locals = [a.cell(a.real, a.nan) for _ in range(program.locals)]
        self._depth, self._levels = 0, program.height
        value = self.value(program.root, mask)
        if program.for_everybody:
            a.put(self.matched, a.truth, mask)
        elif program.is_test:
            a.put(self.matched, a.truth, self._true(value))
        return value

    # ---- values

    def value(self, part: Part, mask: str) -> str:
        """The values of a part in the lanes of the mask, with all its side effects."""
        a = self.a
        if not is_native(part, self._names, self._depth, self._levels, self._calls):
            return self._give_up(mask)
        match part.op:
            case "const":
                return a.number(part.number)
            case "absent":
                return a.nan
            case "var":
                return self._columns.slot(part.slot)
            case "local":
                return a.get(self._locals[part.slot], a.real)
            case "progn":
                return self._last(part.parts, mask)
            case "known":
                return a.select(self._unknown(self.value(part.parts[0], mask)), a.zero, a.one)
            case "in":
                member = self._columns.read("group", part.name, a.byte)
                return a.convert("uitofp", a.byte, member, a.real)
            case "defvar":
                return self._columns.slot(part.slot)
            case "act" if part.name == "ping":
                return self._ping(part, mask)
            case "act":
                slot, value = FLAGS[part.name]
                self._columns.assign(slot, a.number(value), mask)
                return a.one
            case "pure":
                return self._pure(part, [self.value(each, mask) for each in part.parts], mask)
            case _:
                how: Callable[[Part, str], str] = getattr(self, f"_{part.op}")
                return how(part, mask)

    def _guarded(self, parts: Sequence[Part], mask: str) -> str:
        """One part after the other; skipped where no lane reaches them, if that saves anything."""
        if sum(map(weight, parts)) <= LIGHT:
            return self._last(parts, mask)
        a = self.a
        result = a.cell(a.real, a.zero)
        with a.when(a.any(mask)):
            a.put(result, a.real, self._last(parts, mask))
        return a.get(result, a.real)

    def _last(self, parts: Sequence[Part], mask: str) -> str:
        value = self.a.zero
        for part in parts:
            value = self.value(part, mask)
        return value

    def _truth(self, part: Part, mask: str) -> str:
        """Where a part is true."""
        if part.op == "pure" and part.function.name in formulas.ORDERED and len(part.parts) == 2:
            first, second = (self.value(each, mask) for each in part.parts)
            return self.a.compare(formulas.ORDERED[part.function.name], first, second)
        if part.op == "and" and not part.watch:
            truths = self.a.yes
            for inside in part.parts:
                truths = self.a.both(truths, self._truth(inside, self.a.both(mask, truths)))
            return truths
        return self._true(self._guarded([part], mask))

    def _true(self, value: str) -> str:
        return self.a.compare("one", value, self.a.zero)

    def _unknown(self, value: str) -> str:
        return self.a.compare("uno", value, value)

    def _in_trouble(self, truth: str, mask: str) -> None:
        a = self.a
        a.put(self.trouble, a.truth, a.either(a.get(self.trouble, a.truth), a.both(truth, mask)))

    def _give_up(self, mask: str) -> str:
        self._in_trouble(self.a.yes, mask)
        return self.a.nan

    def _watched(self, part: Part, mask: str) -> None:
        if part.watch and self._depth == 0:
            a = self.a
            a.put(self.matched, a.truth, a.either(a.get(self.matched, a.truth), mask))

    # ---- functions of numbers

    def _pure(self, part: Part, numbers: list[str], mask: str) -> str:
        a, name = self.a, part.function.name
        if not formulas.is_known(part):
            return self._give_up(mask)
        known = a.yes
        for number in numbers:
            known = a.both(known, a.compare("ord", number, number))
        if name in formulas.TRUTHS:
            held = a.select(formulas.holds(a, name, numbers), a.one, a.zero)
            return a.select(known, held, a.nan)
        result = formulas.FORMULAS[name](a, numbers, a.both(known, mask))
        self._in_trouble(a.both(known, self._unknown(a.binary("fsub", a.real, result, result))), mask)
        return a.select(known, result, a.nan)

    # ---- pings

    def _ping(self, part: Part, mask: str) -> str:
        """Note one ping; robots that ping twice are walked, and so are those that do not know its caste."""
        a = self.a
        caste = self.value(part.parts[0], mask) if part.parts else a.zero
        cell, where = self._columns.pinged
        again = a.compare("ord", a.get(cell, a.real), a.zero)
        self._in_trouble(a.either(again, self._unknown(caste)), mask)
        a.put(cell, a.real, a.select(mask, caste, a.get(cell, a.real)))
        a.put(where, a.truth, a.either(a.get(where, a.truth), mask))
        return a.one

    # ---- the robots' own functions

    def _host(self, part: Part, mask: str) -> str:
        """As `FleetMemory.host`: what acts is refused for an unknown argument and while the robot is held."""
        a, function = self.a, host_of(part)
        numbers = [self.value(each, mask) for each in part.parts]
        known = a.yes
        for number in numbers:
            known = a.both(known, a.compare("ord", number, number))
        if function.acts:
            held = a.emit(f"icmp ne {a.byte} {self._columns.read('held', '', a.byte)}, {a.integer('i8', 0)}")
            self._in_trouble(a.either(a.neither(known), held), mask)
            self._act(function, numbers, mask)
            return a.one
        if part.slot >= 0:  # robots whose rules read a sensor have measured it before they think
            value = self._columns.slot(part.slot)
        else:
            value = self._columns.call(function, constants(part), numbers, a.both(known, mask))
        finite = a.neither(self._unknown(a.binary("fsub", a.real, value, value)))
        return a.select(a.both(known, finite), value, a.nan)

    def _act(self, function: HostFunction, numbers: Sequence[str], mask: str) -> None:
        """Write what an acting function writes."""
        a = self.a
        for writing in function.writes:
            free, kind = mask, kind_of(writing.into)
            if writing.unless is not None:
                flags = self._columns.read(kind_of(writing.unless), writing.unless.name, a.byte)
                free = a.both(mask, a.emit(f"icmp eq {a.byte} {flags}, {a.integer('i8', 0)}"))
            if writing.argument is not None:
                value = self._clipped(numbers[writing.argument], writing.low, writing.high)
            else:
                value = a.number(writing.value) if kind == "body_real" else a.integer("i8", int(writing.value))
            self._columns.write(writing.into, value, free)

    def _clipped(self, value: str, low: float, high: float) -> str:
        """The value within bounds; what equals one stays as it is, 0 or -0."""
        a = self.a
        if low > -inf:
            value = a.select(a.compare("olt", value, a.number(low)), a.number(low), value)
        if high < inf:
            value = a.select(a.compare("ogt", value, a.number(high)), a.number(high), value)
        return value

    # ---- branches

    def _and(self, part: Part, mask: str) -> str:
        a = self.a
        result, holding = a.one, a.yes
        for index, inside in enumerate(part.parts):
            reached = a.both(mask, holding)
            if part.watch == index:
                self._watched(part, reached)
            value = self._guarded([inside], reached)
            result = a.select(holding, value, result)
            holding = a.both(holding, self._true(value))
        if part.watch == len(part.parts):
            self._watched(part, a.both(mask, holding))
        return result

    def _or(self, part: Part, mask: str) -> str:
        a = self.a
        result, holds, unknown = a.zero, a.no, a.no
        for inside in part.parts:
            still = a.neither(holds)
            value = self._guarded([inside], a.both(mask, still))
            true = a.both(still, self._true(value))
            result = a.select(true, value, result)
            unknown = a.either(unknown, a.both(still, self._unknown(value)))
            holds = a.either(holds, true)
        return a.select(holds, result, a.select(unknown, a.nan, a.zero))

    def _cond(self, part: Part, mask: str) -> str:
        a = self.a
        result, still = a.zero, mask
        for clause in part.parts:
            test, *body = clause.parts
            value = a.zero if body else self.value(test, still)
            true = a.both(still, self._truth(test, still) if body else self._true(value))
            self._watched(clause, true)
            result = a.select(true, self._guarded(body, true) if body else value, result)
            still = a.both(still, a.neither(true))
        return result

    def _if(self, part: Part, mask: str) -> str:
        a = self.a
        true = self._truth(part.parts[0], mask)
        taken = a.both(mask, true)
        self._watched(part, taken)
        value = self._guarded(part.parts[1:2], taken)
        return a.select(true, value, self._guarded(part.parts[2:], a.both(mask, a.neither(true))))

    def _let(self, part: Part, mask: str) -> str:
        count = int(part.number)
        for index, value in enumerate([self.value(each, mask) for each in part.parts[:count]]):
            self._set(part.slot + index, value, mask)
        return self._last(part.parts[count:], mask)

    def _dotimes(self, part: Part, mask: str) -> str:
        if part.number:
            with self.a.repeated(int(part.number)) as number:
                self._set(part.slot, number, mask)
                self._last(part.parts, mask)
        return self.a.zero

    # ---- assigning, entering

    def _set(self, local: int, value: str, mask: str) -> None:
        a, cell = self.a, self._locals[local]
        a.put(cell, a.real, a.select(mask, value, a.get(cell, a.real)))

    def _set_local(self, part: Part, mask: str) -> str:
        value = self.value(part.parts[0], mask)
        self._set(part.slot, value, mask)
        return value

    def _set_user(self, part: Part, mask: str) -> str:
        value = self.value(part.parts[0], mask)
        self._columns.assign(part.slot, value, mask)
        return value

    def _write(self, part: Part, mask: str) -> str:
        value = self.value(part.parts[0], mask)
        if isinstance(part.data, Variable):
            self._in_trouble(self._unknown(value), mask)
            if part.data.kind is VariableKind.ACTUATOR:
                self._columns.actuators.add(part.slot)
        self._columns.assign(part.slot, value, mask)
        return value

    def _fetch(self, part: Part, mask: str) -> str:
        return self._enter(part, mask)

    def _call(self, part: Part, mask: str) -> str:
        return self._enter(part, mask)

    def _enter(self, part: Part, mask: str) -> str:
        """A buffer, rule or operator, inlined; an empty buffer is unknown."""
        a, program = self.a, entered(part, self._names)
        if program is None:
            return a.nan
        arguments = [self.value(each, mask) for each in part.parts]
        charged = a.binary("add", a.whole, a.get(self.steps, a.whole), a.integer("i32", program.cost))
        a.put(self.steps, a.whole, a.select(mask, charged, a.get(self.steps, a.whole), a.whole))
        outer_locals, levels = self._locals, self._levels
        self._locals = [a.cell(a.real) for _ in range(program.locals)]
        for cell, value in zip(self._locals, [*arguments, *[a.nan] * program.locals], strict=False):
            a.put(cell, a.real, value)
        self._depth, self._levels = self._depth + 1, levels + program.height
        value = self._guarded([program.root], mask)
        self._locals, self._depth, self._levels = outer_locals, self._depth - 1, levels
        return value

    # ---- random numbers

    def _draw(self, mask: str) -> str:
        """The next number in [0, 1) of the lanes of the mask."""
        a = self.a
        golden, number = a.integer("i64", _signed(GOLDEN)), a.get(self.drawn, a.whole)
        tick = self._columns.read("tick", "", a.long)
        of_tick = self._mixed(
            a.binary("add", a.long, self._columns.read("keys", "", a.long), a.binary("mul", a.long, tick, golden))
        )
        later = a.binary("mul", a.long, a.convert("zext", a.whole, number, a.long), golden)
        word = self._mixed(a.binary("add", a.long, of_tick, later))
        following = a.binary("add", a.whole, number, a.convert("zext", a.truth, mask, a.whole))
        a.put(self.drawn, a.whole, following)
        high = a.binary("lshr", a.long, word, a.integer("i64", 11))
        return a.binary("fmul", a.real, a.convert("sitofp", a.long, high, a.real), a.number(UNIT))

    def _mixed(self, z: str) -> str:
        """The finaliser of SplitMix64, see `language.numerics.mix`."""
        a = self.a
        for shift, factor in ((30, _FIRST), (27, _SECOND)):
            z = a.binary("xor", a.long, z, a.binary("lshr", a.long, z, a.integer("i64", shift)))
            z = a.binary("mul", a.long, z, a.integer("i64", _signed(factor)))
        return a.binary("xor", a.long, z, a.binary("lshr", a.long, z, a.integer("i64", 31)))

    def _prob(self, part: Part, mask: str) -> str:
        a = self.a
        chance = self.value(part.parts[0], mask)
        known = a.compare("ord", chance, chance)
        held = a.compare("olt", self._draw(a.both(mask, known)), chance)
        return a.select(known, a.select(held, a.one, a.zero), a.nan)

    def _random(self, part: Part, mask: str) -> str:
        a = self.a
        low, high = (self.value(each, mask) for each in part.parts)
        known = a.compare("ord", low, high)
        offset = a.binary("fmul", a.real, self._draw(a.both(mask, known)), a.binary("fsub", a.real, high, low))
        result = a.binary("fadd", a.real, low, offset)
        self._in_trouble(a.both(known, self._unknown(a.binary("fsub", a.real, result, result))), mask)
        return a.select(known, result, a.nan)

    def _gauss(self, part: Part, mask: str) -> str:
        a = self.a
        if not formulas.has_logarithm():
            return self._give_up(mask)
        mean, deviation = (self.value(each, mask) for each in part.parts)
        known = a.compare("ord", mean, deviation)
        self._in_trouble(a.compare("olt", deviation, a.zero), a.both(mask, known))
        reached = a.both(mask, known)
        out = a.binary("fmul", a.real, deviation, formulas.quantile(a, self._draw(reached), reached))
        result = a.binary("fadd", a.real, mean, out)
        self._in_trouble(a.both(known, self._unknown(a.binary("fsub", a.real, result, result))), mask)
        return a.select(known, result, a.nan)

    def _dice(self, part: Part, mask: str) -> str:
        a = self.a
        drawn, total, result, still = self._draw(mask), a.zero, a.zero, mask
        for side in part.parts:
            total = a.binary("fadd", a.real, total, self._guarded(side.parts[:1], still))
            unknown = a.both(still, self._unknown(total))
            hit = a.both(still, a.compare("olt", drawn, total))
            value = self._guarded(side.parts[1:], hit)
            result = a.select(hit, value, a.select(unknown, a.nan, result))
            still = a.both(still, a.neither(a.either(hit, unknown)))
        return result


def weight(part: Part) -> int:
    """Approximate cost of a part, in the unit of `LIGHT`."""
    heavy = {"host", "prob", "random", "gauss", "dice", "dotimes", "fetch", "call", "in"}
    total = 0
    for inside in walk(part):
        costly = inside.op in heavy or (inside.op == "pure" and inside.function.name in formulas.COSTLY)
        total += 10 * LIGHT if costly else 1
    return total


def enters(program: Program, names: Meaning) -> bool:
    """Whether a program enters others."""
    return any(entered(part, names) is not None for part in walk(program.root))


def _signed(word: int) -> int:
    """A 64-bit word as LLVM writes it."""
    return word - (1 << 64) if word > MASK >> 1 else word
