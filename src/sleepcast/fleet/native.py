"""Native code: a program becomes one loop over columns, through LLVM; the only module that knows llvmlite.

The loop follows every way for every robot and picks with masks, in 64-bit floats, without contraction and without
fast-math, so each number is the one that NumPy and the one-robot machine give. Only what a loop can do without asking
anybody is translated: numbers, variables, tests, choices, PROB, and assigning actuators and user variables. Whatever
is out of the ordinary for any robot - a fault, an unknown for an actuator - is only noticed: then nothing has
happened yet, and the chunk is walked as always.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from math import nan
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sleepcast.fleet.columns import Column, Rows, spread
from sleepcast.fleet.evaluation import Evaluation
from sleepcast.language.chance import GOLDEN, UNIT
from sleepcast.language.machine import Program
from sleepcast.language.parts import Part, walk
from sleepcast.language.vocabulary import TICK

if TYPE_CHECKING:
    from llvmlite import ir


SPLIT = 131_072
"""Robots from which on two threads share the work: with fewer, waiting for the other costs more than it saves."""
_HELPER = ThreadPoolExecutor(1, "sleepcast-native-half")

ORDERED = {"<": "<", "<=": "<=", ">": ">", ">=": ">=", "=": "==", "EQ": "=="}


class Lowering:
    """Writes the body of one robot's turn of the loop. mask: which robots come to a part, as one truth each."""

    def __init__(
        self, builder: ir.IRBuilder, load: Callable[[int], ir.Value], draws: Callable[[], Sequence[ir.Value]]
    ) -> None:
        from llvmlite import ir

        self.ir, self.b, self._load, self._draws = ir, builder, load, draws
        self.f64, self.i1, self.i32, self.i64 = ir.DoubleType(), ir.IntType(1), ir.IntType(32), ir.IntType(64)
        self.yes, self.no = self.i1(1), self.i1(0)
        self.values: dict[int, ir.Value] = {}
        self.written: dict[int, ir.Value] = {}
        self.assigned: set[int] = set()
        self.locals: dict[int, ir.Value] = {}
        self.trouble = self.matched = self.no
        self.drawn: ir.Value | None = None

    def number(self, value: float) -> ir.Value:
        return self.ir.Constant(self.f64, value)

    def slot(self, slot: int) -> ir.Value:
        if slot not in self.values:
            self.values[slot] = self._load(slot)
        return self.values[slot]

    def true(self, value: ir.Value) -> ir.Value:
        return self.b.fcmp_ordered("!=", value, self.number(0.0))

    def unknown(self, value: ir.Value) -> ir.Value:
        return self.b.fcmp_unordered("uno", value, value)

    def truth(self, part: Part, mask: ir.Value) -> ir.Value:
        """Where a part is true."""
        if part.op == "pure" and part.function.name in ORDERED and len(part.parts) == 2:
            first, second = (self.value(each, mask) for each in part.parts)
            return self.b.fcmp_ordered(ORDERED[part.function.name], first, second)
        if part.op == "and" and not part.watch:
            found = self.yes
            for inside in part.parts:
                found = self.b.and_(found, self.truth(inside, self.b.and_(mask, found)))
            return found
        return self.true(self.value(part, mask))

    def value(self, part: Part, mask: ir.Value) -> ir.Value:
        match part.op:
            case "const":
                return self.number(part.number)
            case "absent":
                return self.number(nan)
            case "var":
                return self.slot(part.slot)
            case "local":
                return self.locals[part.slot]
            case "progn":
                return self.last(part.parts, mask)
            case "known":
                known = self.b.not_(self.unknown(self.value(part.parts[0], mask)))
                return self.b.select(known, self.number(1.0), self.number(0.0))
            case "let":
                count = int(part.number)
                found = [self.value(each, mask) for each in part.parts[:count]]
                self.locals.update({part.slot + i: value for i, value in enumerate(found)})
                return self.last(part.parts[count:], mask)
            case "set_local":
                value = self.value(part.parts[0], mask)
                self.locals[part.slot] = self.b.select(mask, value, self.locals[part.slot])
                return value
            case "set_user" | "write":
                return self._assign(part, mask)
            case "pure":
                return self._pure(part, [self.value(each, mask) for each in part.parts], mask)
            case _:
                ways = {"and": self._and, "or": self._or, "cond": self._cond, "if": self._if, "prob": self._prob}
                return ways[part.op](part, mask)

    def last(self, parts: Sequence[Part], mask: ir.Value) -> ir.Value:
        value = self.number(0.0)
        for part in parts:
            value = self.value(part, mask)
        return value

    def watched(self, part: Part, mask: ir.Value) -> None:
        if part.watch:
            self.matched = self.b.or_(self.matched, mask)

    def in_trouble(self, truth: ir.Value, mask: ir.Value) -> None:
        self.trouble = self.b.or_(self.trouble, self.b.and_(truth, mask))

    def _assign(self, part: Part, mask: ir.Value) -> ir.Value:
        value = self.value(part.parts[0], mask)
        if part.op == "write":
            self.in_trouble(self.unknown(value), mask)
            self.assigned.add(part.slot)
        self.values[part.slot] = self.b.select(mask, value, self.slot(part.slot))
        self.written[part.slot] = self.b.or_(self.written.get(part.slot, self.no), mask)
        return value

    def _and(self, part: Part, mask: ir.Value) -> ir.Value:
        found, holding = self.number(1.0), self.yes
        for place, inside in enumerate(part.parts):
            come = self.b.and_(mask, holding)
            if part.watch == place:
                self.watched(part, come)
            value = self.value(inside, come)
            found = self.b.select(holding, value, found)
            holding = self.b.and_(holding, self.true(value))
        if part.watch == len(part.parts):
            self.watched(part, self.b.and_(mask, holding))
        return found

    def _or(self, part: Part, mask: ir.Value) -> ir.Value:
        found, holds, unknown = self.number(0.0), self.no, self.no
        for inside in part.parts:
            open_rows = self.b.not_(holds)
            value = self.value(inside, self.b.and_(mask, open_rows))
            true = self.b.and_(open_rows, self.true(value))
            found = self.b.select(true, value, found)
            unknown = self.b.or_(unknown, self.b.and_(open_rows, self.unknown(value)))
            holds = self.b.or_(holds, true)
        return self.b.select(holds, found, self.b.select(unknown, self.number(nan), self.number(0.0)))

    def _cond(self, part: Part, mask: ir.Value) -> ir.Value:
        found, open_rows = self.number(0.0), mask
        for clause in part.parts:
            test, *body = clause.parts
            value = self.number(0.0) if body else self.value(test, open_rows)
            true = self.b.and_(open_rows, self.truth(test, open_rows) if body else self.true(value))
            self.watched(clause, true)
            found = self.b.select(true, self.last(body, true) if body else value, found)
            open_rows = self.b.and_(open_rows, self.b.not_(true))
        return found

    def _if(self, part: Part, mask: ir.Value) -> ir.Value:
        true = self.truth(part.parts[0], mask)
        taken, other = self.b.and_(mask, true), self.b.and_(mask, self.b.not_(true))
        self.watched(part, taken)
        value = self.value(part.parts[1], taken)
        return self.b.select(true, value, self.last(part.parts[2:], other))

    def _prob(self, part: Part, mask: ir.Value) -> ir.Value:
        chance = self.value(part.parts[0], mask)
        known = self.b.not_(self.unknown(chance))
        of_tick, first = self._draws()
        drawn = first if self.drawn is None else self.drawn
        golden, shift = self.i64(GOLDEN), self.i64(11)
        word = mixed(self.b, self.b.add(of_tick, self.b.mul(self.b.zext(drawn, self.i64), golden)))
        evenly = self.b.fmul(self.b.sitofp(self.b.lshr(word, shift), self.f64), self.number(UNIT))
        self.drawn = self.b.add(drawn, self.b.zext(self.b.and_(mask, known), self.i32))
        held = self.b.select(self.b.fcmp_ordered("<", evenly, chance), self.number(1.0), self.number(0.0))
        return self.b.select(known, held, self.number(nan))

    def _pure(self, part: Part, numbers: list[ir.Value], mask: ir.Value) -> ir.Value:
        name, b = part.function.name, self.b
        known = self.yes
        for number in numbers:
            known = b.and_(known, b.not_(self.unknown(number)))
        if name in ORDERED or name == "NOT":
            holds = self.yes
            for first, second in pairwise(numbers):
                holds = b.and_(holds, b.fcmp_ordered(ORDERED[name], first, second))
            if name == "NOT":
                holds = b.fcmp_ordered("==", numbers[0], self.number(0.0))
            return b.select(known, b.select(holds, self.number(1.0), self.number(0.0)), self.number(nan))
        found = self._compute(name, numbers)
        self.in_trouble(b.and_(known, self.unknown(b.fsub(found, found))), mask)
        return b.select(known, found, self.number(nan))

    def _compute(self, name: str, a: list[ir.Value]) -> ir.Value:
        """The function of known numbers; not finite where something is wrong."""
        b = self.b
        if name in ("+", "-", "*", "/"):
            fold = {"+": b.fadd, "-": b.fsub, "*": b.fmul, "/": b.fdiv}[name]
            if len(a) < 2:
                one = {"-": b.fneg, "/": lambda x: b.fdiv(self.number(1.0), x)}.get(name, lambda x: x)
                return one(a[0]) if a else self.number(1.0 if name == "*" else 0.0)
            total = a[0]
            for x in a[1:]:
                total = fold(total, x)
            return total
        if name in ("MIN", "MAX"):
            best = a[0]
            for x in a[1:]:
                best = b.select(b.fcmp_ordered("<" if name == "MIN" else ">", x, best), x, best)
            return best
        if name == "CLAMP":
            value, low, high = a
            above = b.select(b.fcmp_ordered(">", value, high), high, value)
            found = b.select(b.fcmp_ordered("<", value, low), low, above)
            return b.select(b.fcmp_ordered(">", low, high), self.number(nan), found)
        if name == "DIST":
            across, up = b.fsub(a[0], a[2]), b.fsub(a[1], a[3])
            a = [b.fadd(b.fmul(across, across), b.fmul(up, up))]
        intrinsic = b.module.declare_intrinsic("llvm.fabs" if name == "ABS" else "llvm.sqrt", [self.f64])
        return b.call(intrinsic, a)


def mixed(b: ir.IRBuilder, z: ir.Value) -> ir.Value:
    """The finaliser of SplitMix64, see `language.chance.mix`."""
    i64 = z.type
    z = b.mul(b.xor(z, b.lshr(z, i64(30))), i64(0xBF58_476D_1CE4_E5B9))
    z = b.mul(b.xor(z, b.lshr(z, i64(27))), i64(0x94D0_49BB_1331_11EB))
    return b.xor(z, b.lshr(z, i64(31)))


class Kernel:
    """The native code of one program: reads columns, writes columns of its own, says whether it ran into trouble."""

    def __init__(self, program: Program) -> None:
        from llvmlite import ir

        f64, i8, i32, i64 = ir.DoubleType(), ir.IntType(8), ir.IntType(32), ir.IntType(64)
        reads, writes = _slots(program)
        self.reads, self.writes = reads, writes
        self.chancy = any(part.op == "prob" for part in walk(program.root))
        pointers = [f64.as_pointer()] * (len(reads) + 1 + len(writes)) + [i8.as_pointer()] * (1 + len(writes))
        chance = [i64.as_pointer(), i32.as_pointer(), i32.as_pointer()]
        module = ir.Module("rule")
        kind = ir.FunctionType(i64, [i64, i64, *pointers, *chance])
        function = ir.Function(module, kind, "rule")
        for argument in function.args[2:]:
            argument.add_attribute("noalias")
        count, tick, *rest = function.args
        columns, rest = rest[: len(reads)], rest[len(reads) :]
        out, new, rest = rest[0], rest[1 : 1 + len(writes)], rest[1 + len(writes) :]
        matched, assigned, (keys, draws, drawn) = rest[0], rest[1 : 1 + len(writes)], rest[1 + len(writes) :]
        entry, loop, done = (function.append_basic_block(name) for name in ("entry", "loop", "done"))
        ir.IRBuilder(entry).branch(loop)
        b = ir.IRBuilder(loop)
        i, bad = b.phi(i64), b.phi(i64)
        i.add_incoming(i64(0), entry)
        bad.add_incoming(i64(0), entry)
        places = dict(zip(reads, columns, strict=True))

        def chances() -> Sequence[ir.Value]:
            of_tick = b.add(b.load(b.gep(keys, [i])), b.mul(tick, i64(GOLDEN)))
            return mixed(b, of_tick), b.load(b.gep(draws, [i]))

        low = Lowering(b, lambda slot: b.load(b.gep(places[slot], [i])), chances)
        low.matched = low.yes if program.test is None else low.no
        value = low.value(program.root, low.yes)
        b.store(value, b.gep(out, [i]))
        b.store(b.zext(low.true(value) if program.test is program else low.matched, i8), b.gep(matched, [i]))
        for slot, column, mask in zip(writes, new, assigned, strict=True):
            b.store(low.values[slot], b.gep(column, [i]))
            b.store(b.zext(low.written[slot], i8), b.gep(mask, [i]))
        if low.drawn is not None:
            b.store(low.drawn, b.gep(drawn, [i]))
        self.actuators = frozenset(low.assigned)
        following, worse = b.add(i, i64(1)), b.or_(bad, b.zext(low.trouble, i64))
        i.add_incoming(following, loop)
        bad.add_incoming(worse, loop)
        b.cbranch(b.icmp_signed("<", following, count), loop, done)
        ir.IRBuilder(done).ret(worse)
        self._call = _compiled(str(module), len(pointers) + len(chance))

    def run(self, memory: Evaluation, rows: Rows) -> Column | None:
        """Evaluate a run of robots; None, and nothing has happened, if it is out of the ordinary for any of them."""
        state, count = memory.state, rows.size
        tick = state.read(TICK, rows)
        if self.chancy and not isinstance(tick, float):
            return None
        inputs = [np.ascontiguousarray(spread(state.read(slot, rows), count)) for slot in self.reads]
        out, new = np.empty(count), [np.empty(count) for _ in self.writes]
        matched, masks = np.empty(count, np.bool_), [np.empty(count, np.bool_) for _ in self.writes]
        keys, draws = state.keys[rows.index], state.draws[rows.index]
        drawn = np.empty(count, np.int32) if self.chancy else draws
        arrays = (*inputs, out, *new, matched, *masks, keys, draws, drawn)
        if self._trouble(count, int(tick) if isinstance(tick, float) else 0, arrays):
            return None
        for slot, column, mask in zip(self.writes, new, masks, strict=True):
            if mask.any():
                state.assign(slot, rows, column)
                if slot in self.actuators:
                    state.assigned(slot)[rows.index] |= mask
        memory.matched[rows.index] = matched
        if self.chancy:
            state.draws[rows.index] = drawn
        return out

    def _trouble(self, count: int, tick: int, arrays: Sequence[NDArray[np.generic]]) -> bool:
        """Run the loop, many robots in two threads; gives whether it ran into trouble."""

        def part(start: int, stop: int) -> int:
            return self._call(stop - start, tick, *(array.ctypes.data + start * array.itemsize for array in arrays))

        if count < SPLIT:
            return bool(part(0, count))
        other = _HELPER.submit(part, count // 2, count)
        return bool(part(0, count // 2) | other.result())


def _slots(program: Program) -> tuple[list[int], list[int]]:
    """The slots that a program reads or keeps as they are, and those that it assigns."""
    parts = walk(program.root)
    writes = sorted({part.slot for part in parts if part.op in ("write", "set_user")})
    return sorted({part.slot for part in parts if part.op == "var"}.union(writes)), writes


def _compiled(text: str, pointers: int) -> Callable[..., int]:
    """The function in a module's text, optimised for this processor."""
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    host = binding.get_host_cpu_features().flatten()
    target = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=host, opt=2, jit=True
    )
    module = binding.parse_assembly(text)
    tuning = binding.PipelineTuningOptions(speed_level=2)
    tuning.loop_vectorization = True
    passes = binding.create_pass_builder(target, tuning)
    passes.getModulePassManager().run(module, passes)
    engine = binding.create_mcjit_compiler(module, target)
    engine.finalize_object()
    address = engine.get_function_address("rule")
    function = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * pointers)(address)

    def call(*arguments: int) -> int:
        return int(function(*arguments)) if engine else 0  # the engine owns the code, so it must live as long

    return call
