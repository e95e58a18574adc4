"""Sixteen at a time: `keep` packs the points in reach out of sixteen, and `pack` those that are marked, with one vector
instruction where the processor has it (AVX-512) and LLVM knows how to say it, else one by one; the outcome is the same.
"""

from __future__ import annotations

import numpy as np
from llvmlite import binding, ir
from numba.core import types
from numba.extending import intrinsic

from sleepcast.simulator.compiled import FASTMATH, inlined

LANES = 16
COMPRESS = "llvm.experimental.vector.compress"
KNOWN_BY = (19, 22)
"""Versions of LLVM, first and last tried, that know COMPRESS."""


@inlined
def _keep_one_by_one(x, y, first, last, own, px, py, co, si, limit, aslant, behind, mark, ahead, aside, number, n):
    for j in range(first, min(first + np.uint64(LANES), last)):
        dx, dy = np.float32(np.int32(x[j] - px)), np.float32(np.int32(y[j] - py))
        ahead[n], aside[n], number[n] = dx * co + dy * si, dy * co - dx * si, np.int32(j) + mark
        seen = (dx * dx + dy * dy < limit) & (ahead[n] + aslant * abs(aside[n]) > behind)
        n += np.uint64(seen & (j != own))
    return n


@intrinsic
def _keep_at_once(
    typing, x, y, first, last, own, px, py, co, si, limit, aslant, behind, mark, ahead, aside, number, n
):  # fmt: skip
    """The same in LLVM's words."""
    single, short = ir.FloatType(), ir.IntType(32)
    singles, shorts = ir.VectorType(single, LANES), ir.VectorType(short, LANES)
    bits = ir.VectorType(ir.IntType(1), LANES)
    flags = tuple(sorted(FASTMATH))

    def generate(context, build, signature, arguments):
        _, _, first, last, own, px, py, co, si, limit, aslant, behind, mark, _, _, _, n = arguments

        def place(number, index, vector):
            array = context.make_array(signature.args[number])(context, build, arguments[number])
            return build.bitcast(build.gep(array.data, [index]), vector.as_pointer())

        def every(value, vector):
            one = build.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(short, 0))
            return build.shuffle_vector(one, ir.Constant(vector, ir.Undefined), ir.Constant(shorts, [0] * LANES))

        def off(number, own_place):
            there = build.load(place(number, first, shorts), align=4)
            return build.sitofp(build.sub(there, every(own_place, shorts)), singles)

        def times(left, right):
            return build.fmul(left, right, flags=flags)

        dx, dy, co, si = off(0, px), off(1, py), every(co, singles), every(si, singles)
        along = build.fadd(times(dx, co), times(dy, si), flags=flags)
        across = build.fsub(times(dy, co), times(dx, si), flags=flags)
        square = build.fadd(times(dx, dx), times(dy, dy), flags=flags)
        lane = build.add(every(build.trunc(first, short), shorts), ir.Constant(shorts, list(range(LANES))))
        kept = build.fcmp_ordered("<", square, every(limit, singles), flags=flags)
        size = "llvm.fabs.v16f32"
        size = build.module.globals.get(size) or ir.Function(build.module, ir.FunctionType(singles, [singles]), size)
        forward = build.fadd(along, times(every(aslant, singles), build.call(size, [across])), flags=flags)
        kept = build.and_(kept, build.fcmp_ordered(">", forward, every(behind, singles), flags=flags))
        kept = build.and_(kept, build.icmp_signed("<", lane, every(build.trunc(last, short), shorts)))
        kept = build.and_(kept, build.icmp_signed("!=", lane, every(build.trunc(own, short), shorts)))
        marked = build.add(lane, every(mark, shorts))
        for target, value, vector, name in (
            *((13, along, singles, "v16f32"), (14, across, singles, "v16f32"), (15, marked, shorts, "v16i32")),
        ):
            shape = ir.FunctionType(vector, [vector, bits, vector])
            name = f"{COMPRESS}.{name}"
            compress = build.module.globals.get(name) or ir.Function(build.module, shape, name)
            packed = build.call(compress, [value, kept, ir.Constant(vector, ir.Undefined)])
            build.store(packed, place(target, n, vector), align=4)
        count = build.ctpop(build.bitcast(kept, ir.IntType(LANES)))
        return build.add(n, build.zext(count, ir.IntType(64)))

    long, whole, real = types.uint64, types.int32, types.float32
    numbers = long, long, long, whole, whole, real, real, real, real, real, whole
    return long(x, y, *numbers, ahead, aside, number, long), generate


def at_once() -> bool:
    """Whether this processor and this LLVM can."""
    known = KNOWN_BY[0] <= binding.llvm_version_info[0] <= KNOWN_BY[1]
    return known and bool(binding.get_host_cpu_features().get("avx512f"))


keep = _keep_at_once if at_once() else _keep_one_by_one
"""Take those of LANES points x, y (int32) from `first` on, but not from `last` on and not `own`, that are in reach of
px, py, and ahead, or not too far behind; put how far they are ahead and aside of a direction, and their number plus
`mark`, into `ahead`, `aside` (float32) and `number` (int32) from `n` on; gives the new n. co, si: cosine and sine of
that direction, times the unit that is wanted; limit: the square of the reach; aslant, behind: how far one is ahead, and
`aslant` times how far it is aside, are together more than `behind`. Room for LANES more must be there, and LANES more
points."""


@inlined
def _pack_one_by_one(flags, first, kept, n):
    for lane in range(LANES):
        kept[n] = np.int32(first + np.uint64(lane))
        n += np.uint64(flags[lane] < np.float32(1))
    return n


@intrinsic
def _pack_at_once(typing, flags, first, kept, n):
    """The same in LLVM's words."""
    single, short = ir.FloatType(), ir.IntType(32)
    singles, shorts = ir.VectorType(single, LANES), ir.VectorType(short, LANES)
    bits = ir.VectorType(ir.IntType(1), LANES)

    def generate(context, build, signature, arguments):
        flags, first, kept, n = arguments
        read = context.make_array(signature.args[0])(context, build, flags).data
        write = context.make_array(signature.args[2])(context, build, kept).data
        numbers = build.insert_element(ir.Constant(shorts, ir.Undefined), build.trunc(first, short), short(0))
        numbers = build.shuffle_vector(numbers, ir.Constant(shorts, ir.Undefined), ir.Constant(shorts, [0] * LANES))
        numbers = build.add(numbers, ir.Constant(shorts, list(range(LANES))))
        loaded = build.load(build.bitcast(read, singles.as_pointer()), align=4)
        there = build.fcmp_ordered("<", loaded, ir.Constant(singles, [1.0] * LANES))
        shape = ir.FunctionType(shorts, [shorts, bits, shorts])
        name = f"{COMPRESS}.v16i32"
        compress = build.module.globals.get(name) or ir.Function(build.module, shape, name)
        packed = build.call(compress, [numbers, there, ir.Constant(shorts, ir.Undefined)])
        build.store(packed, build.bitcast(build.gep(write, [n]), shorts.as_pointer()), align=4)
        count = build.ctpop(build.bitcast(there, ir.IntType(LANES)))
        return build.add(n, build.zext(count, ir.IntType(64)))

    long = types.uint64
    return long(flags, long, kept, long), generate


pack = _pack_at_once if at_once() else _pack_one_by_one
"""Put the numbers, from `first` on, of those of sixteen `flags` (float32) that are less than 1 into `kept` (int32),
from `n` on; gives the new n. Room for LANES more must be there."""


@intrinsic
def pass_by(typing, values, first, array, row, column):
    """Write as many `values` as fill a line of the caches, from `first` on, into a row of `array` from `column` on,
    past the caches, which would have to read from memory what is overwritten. A line must begin there."""

    def generate(context, build, signature, arguments):
        read = context.make_array(signature.args[0])(context, build, arguments[0]).data
        found = context.make_array(signature.args[2])(context, build, arguments[2])
        kind = ir.VectorType(read.type.pointee, 512 // signature.args[0].dtype.bitwidth)
        way = build.mul(arguments[3], build.extract_value(found.strides, 0))
        place = build.gep(build.bitcast(found.data, ir.IntType(8).as_pointer()), [way])
        place = build.gep(build.bitcast(place, read.type), [arguments[4]])
        loaded = build.load(build.bitcast(build.gep(read, [arguments[1]]), kind.as_pointer()), align=4)
        store = build.store(loaded, build.bitcast(place, kind.as_pointer()), align=64)
        store.set_metadata("nontemporal", build.module.add_metadata([ir.IntType(32)(1)]))
        return context.get_dummy_value()

    return types.void(values, types.int64, array, types.int64, types.int64), generate


@intrinsic
def all_passed(typing):
    """Everything that was written past the caches has come to memory before anything that is done from here on."""

    def generate(context, build, signature, arguments):
        build.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), generate
