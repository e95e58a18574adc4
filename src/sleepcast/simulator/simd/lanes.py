"""Loading and storing sixteen numbers at a time: contiguous, compressed, and past the caches.

Numbers are compressed with one vector instruction where the processor has it (AVX-512) and this LLVM supports it,
else one by one; the result is the same.
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding, ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from sleepcast.simulator.simd.formulas import LANES
from sleepcast.simulator.simd.vectors import LONG, REALS, Lanes, called, filled, vector_of

COMPRESS = "llvm.experimental.vector.compress"
KNOWN_BY = (19, 22)
"""Versions of LLVM, first and last tested, that support COMPRESS."""


def _place(context, build, its, array, index, vector):
    """Pointer to a vector in an array, from `index` on."""
    data = context.make_array(its)(context, build, array).data
    return build.bitcast(build.gep(data, [index]), vector.as_pointer())


@intrinsic
def at(typing, array, first):
    """The LANES numbers of a 1-d array from `first` on."""

    def generate(context, build, signature, given):
        vector = vector_of(array.dtype)
        return build.load(_place(context, build, array, *given, vector), align=array.dtype.bitwidth // 8)

    return Lanes(array.dtype)(array, LONG), generate


@intrinsic
def put(typing, array, first, values):
    """Write `values` into a 1-d array from `first` on."""

    def generate(context, build, signature, given):
        into, first, values = given
        build.store(values, _place(context, build, array, into, first, values.type), align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, LONG, values), generate


@intrinsic
def some(typing, array, first, most):
    """The numbers of a 1-d array from `first` on, at most `most` (None: LANES); the rest is 0."""

    def generate(context, build, signature, given):
        vector, size = vector_of(array.dtype), array.dtype.bitwidth // 8
        address = _place(context, build, array, *given[:2], vector)
        if most == types.none:
            return build.load(address, align=size)
        room = cgutils.alloca_once_value(build, ir.Constant(vector, [0] * LANES))
        cgutils.raw_memcpy(build, room, address, given[2], size)
        return build.load(room)

    return Lanes(array.dtype)(array, LONG, most), generate


@intrinsic
def put_some(typing, array, first, values, most):
    """Write `values`, at most `most` of them (None: all), into a 1-d array from `first` on."""

    def generate(context, build, signature, given):
        into, first, values, _ = given
        address, size = _place(context, build, array, into, first, values.type), array.dtype.bitwidth // 8
        if most == types.none:
            build.store(values, address, align=size)
        else:
            cgutils.raw_memcpy(build, address, cgutils.alloca_once_value(build, values), given[3], size)
        return context.get_dummy_value()

    return types.void(array, LONG, values, most), generate


@intrinsic
def put_pairs(typing, array, first, evens, odds):
    """Write `evens` and `odds` alternately into a 1-d array from `first` on."""

    def generate(context, build, signature, given):
        into, first, evens, odds = given
        order = [number for lane in range(LANES) for number in (lane, LANES + lane)]
        pairs = build.shuffle_vector(evens, odds, ir.Constant(ir.VectorType(ir.IntType(32), 2 * LANES), order))
        build.store(pairs, _place(context, build, array, into, first, pairs.type), align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, LONG, evens, odds), generate


@intrinsic
def pair_at(typing, array, first):
    """The two numbers of a 1-d array (float32) from `first` on, repeated."""

    def generate(context, build, signature, given):
        data = context.make_array(array)(context, build, given[0]).data
        both = ir.DoubleType().as_pointer()
        pair = build.load(build.bitcast(build.gep(data, [given[1]]), both), align=4)
        half = ir.VectorType(pair.type, LANES // 2)
        return build.bitcast(filled(build, pair, half), vector_of(types.float32))

    return Lanes(types.float32)(array, LONG), generate


@intrinsic
def put_turned(typing, table, row, column, last, into, first, step):
    """Transpose LANES rows of LANES numbers of a table into a 1-d array: the first column from `first` on, each other
    one `step` further. Rows behind the `last` one repeat it."""

    def generate(context, build, signature, given):
        table_, row, column, last, into_, first, step = given
        read, lanes = context.make_array(table)(context, build, table_), list(map(row.type, range(LANES)))
        way, vector, size = build.extract_value(read.strides, 0), vector_of(table.dtype), table.dtype.bitwidth // 8
        begin = build.gep(build.bitcast(read.data, ir.IntType(8).as_pointer()), [build.mul(row, way)])
        rest, rows = build.sub(last, row), []
        for lane in lanes:
            inside = build.icmp_signed("<", lane, rest)
            address = build.gep(begin, [build.select(inside, build.mul(lane, way), build.mul(rest, way))])
            address = build.gep(build.bitcast(address, read.data.type), [column])
            rows.append(build.load(build.bitcast(address, vector.as_pointer()), align=size))
        for lane, values in zip(lanes, _turned_over(build, rows), strict=True):
            address = _place(context, build, into, into_, build.add(first, build.mul(lane, step)), vector)
            build.store(values, address, align=size)
        return context.get_dummy_value()

    whole = types.int64
    return types.void(table, whole, whole, whole, into, whole, whole), generate


def _turned_over(build, rows):
    """Transpose LANES rows: first within quarters of vectors, which every processor can do, then whole quarters."""

    def shuffled(one, other, order):
        return build.shuffle_vector(one, other, ir.Constant(ir.VectorType(ir.IntType(32), LANES), order))

    def picked(one, other, pattern):
        """Shuffle within each quarter by this pattern; numbers from 4 on select from the other vector's quarter."""
        return shuffled(one, other, [4 * q + n % 4 + LANES * (n // 4) for q in range(4) for n in pattern])

    def quarters(one, other, pattern):
        """Shuffle whole quarters by this pattern; numbers from 4 on select from the other vector."""
        return shuffled(one, other, [4 * q + n for q in pattern for n in range(4)])

    low, high, pairs = (0, 4, 1, 5), (2, 6, 3, 7), ((0, 1, 4, 5), (2, 3, 6, 7))
    fours = []  # for every four rows: the q-th quarter of the j-th vector holds their column 4 q + j
    for a, b, c, d in zip(*(rows[n::4] for n in range(4)), strict=True):
        halves = [(picked(a, b, half), picked(c, d, half)) for half in (low, high)]
        fours.append([picked(*half, pattern) for half in halves for pattern in pairs])
    columns = [None] * LANES
    for j in range(4):
        a, b, c, d = (four[j] for four in fours)
        for part, pattern in enumerate(pairs):
            left, right = quarters(a, b, pattern), quarters(c, d, pattern)
            columns[8 * part + j] = quarters(left, right, (0, 2, 4, 6))
            columns[8 * part + 4 + j] = quarters(left, right, (1, 3, 5, 7))
    return columns


def at_once() -> bool:
    """Whether this processor and this LLVM can compress vectors."""
    known = KNOWN_BY[0] <= binding.llvm_version_info[0] <= KNOWN_BY[1]
    return known and bool(binding.get_host_cpu_features().get("avx512f"))


def packing(whole: bool, *, by_address: bool = False) -> Any:
    """The function `pack`, with one instruction or one by one; or `pack_at`."""

    def pack(typing, array, n, values, truths):
        kind = values.kind

        def beginning(context, build, into):
            if by_address:
                return build.inttoptr(into, context.get_data_type(kind).as_pointer())
            return context.make_array(array)(context, build, into).data

        def one_by_one(context, build, signature, given):
            into, n, values, truths = given
            data = beginning(context, build, into)
            for lane in map(ir.IntType(32), range(LANES)):
                build.store(build.extract_element(values, lane), build.gep(data, [n]))
                n = build.add(n, build.zext(build.extract_element(truths, lane), n.type))
            return context.get_dummy_value()

        def all_at_once(context, build, signature, given):
            into, n, values, truths = given
            name = f"{COMPRESS}.v{LANES}{'f' if kind in REALS else 'i'}{kind.bitwidth}"
            packed = called(build, name, values.type, [values, truths, ir.Constant(values.type, ir.Undefined)])
            place = build.bitcast(build.gep(beginning(context, build, into), [n]), values.type.as_pointer())
            build.store(packed, place, align=kind.bitwidth // 8)
            return context.get_dummy_value()

        place = types.int64 if by_address else array
        return types.void(place, LONG, values, truths), all_at_once if whole else one_by_one

    return intrinsic(pack)


pack = packing(at_once())
"""Write those of `values` whose `truths` are set, contiguously, into a 1-d array from `n` on. There must be room for
LANES more."""
pack_at = packing(at_once(), by_address=True)
"""The same into the array at an address."""


@intrinsic
def put_by(typing, array, row, column, values):
    """Write `values` into a row of `array` from `column` on, past the caches, which would first read the memory that is
    overwritten. The target must begin at a cache line."""

    def generate(context, build, signature, given):
        its, row, column, values = given
        table = context.make_array(array)(context, build, its)
        way = build.mul(row, build.extract_value(table.strides, 0))
        address = build.gep(build.bitcast(table.data, ir.IntType(8).as_pointer()), [way])
        address = build.gep(build.bitcast(address, table.data.type), [column])
        store = build.store(values, build.bitcast(address, values.type.as_pointer()), align=64)
        store.set_metadata("nontemporal", build.module.add_metadata([ir.IntType(32)(1)]))
        return context.get_dummy_value()

    return types.void(array, types.int64, types.int64, values), generate


@intrinsic
def all_passed(typing):
    """Memory fence: all writes past the caches complete before anything that follows."""

    def generate(context, build, signature, arguments):
        build.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), generate


@intrinsic
def forecast(typing, array, place):
    """Prefetch this number of an array into the first-level cache."""

    def generate(context, build, signature, given):
        data = context.make_array(array)(context, build, given[0]).data
        byte = build.bitcast(build.gep(data, [given[1]]), ir.IntType(8).as_pointer())
        reading, all_caches, its_data = (ir.IntType(32)(number) for number in (0, 3, 1))
        called(build, "llvm.prefetch.p0", ir.VoidType(), [byte, reading, all_caches, its_data])
        return context.get_dummy_value()

    return types.void(array, LONG), generate


# ---- single numbers, by the address of their array: for kernels that are told where everything lies in one table


def _loader(kind: Any) -> Any:
    """Loads the number of this kind at an index of the array at an address."""

    @intrinsic
    def load(typing, address, index):
        def generate(context, build, signature, given):
            pointer = build.inttoptr(given[0], context.get_data_type(kind).as_pointer())
            return build.load(build.gep(pointer, [given[1]]))

        return kind(types.int64, types.int64), generate

    return load


def _storer(kind: Any) -> Any:
    """Stores a number of this kind there."""

    @intrinsic
    def store(typing, address, index, value):
        def generate(context, build, signature, given):
            pointer = build.inttoptr(given[0], context.get_data_type(kind).as_pointer())
            build.store(given[2], build.gep(pointer, [given[1]]))
            return context.get_dummy_value()

        return types.void(types.int64, types.int64, kind), generate

    return store


def _lane_loader(kind: Any) -> Any:
    """Loads the LANES numbers of this kind from an index of the array at an address on."""

    @intrinsic
    def load(typing, address, index):
        def generate(context, build, signature, given):
            pointer = build.gep(build.inttoptr(given[0], context.get_data_type(kind).as_pointer()), [given[1]])
            return build.load(build.bitcast(pointer, vector_of(kind).as_pointer()), align=kind.bitwidth // 8)

        return Lanes(kind)(types.int64, types.int64), generate

    return load


@intrinsic
def put_reals(typing, address, index, values):
    """Write LANES reals from an index of the array at an address on."""

    def generate(context, build, signature, given):
        pointer = build.gep(build.inttoptr(given[0], given[2].type.element.as_pointer()), [given[1]])
        build.store(given[2], build.bitcast(pointer, given[2].type.as_pointer()), align=values.kind.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, values), generate


@intrinsic
def stack_room(typing, count):
    """The address of room for so many (a constant) 64-bit numbers, until the kernel ends."""
    size = count.literal_value if isinstance(count, types.IntegerLiteral) else None

    def generate(context, build, signature, given):
        room = cgutils.alloca_once(build, ir.ArrayType(ir.IntType(64), size))
        return build.ptrtoint(room, ir.IntType(64))

    return (types.int64(count), generate) if size else None


real_at, single_at, long_at, whole_at = map(_loader, (types.float64, types.float32, types.int64, types.int32))
put_real, put_single, put_long, put_whole = map(_storer, (types.float64, types.float32, types.int64, types.int32))
reals_at, singles_at, wholes_at = map(_lane_loader, (types.float64, types.float32, types.int32))
