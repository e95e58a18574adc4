"""Memory by its address: what kernels that serve many worlds read and write where arrays would be too many, and calls
of functions of which only the address is known."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from itertools import count
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

WORD = ir.IntType(64)
_STORED = {
    types.float64: ir.DoubleType(),
    types.int64: WORD,
    types.int32: ir.IntType(32),
    types.uint16: ir.IntType(16),
    types.uint8: ir.IntType(8),
}


def _there(build: Any, address: Any, index: Any, stored: Any) -> Any:
    """Pointer to the element of this index in the memory at an address."""
    return build.gep(build.inttoptr(address, stored.as_pointer()), [index])


def _loads(kind: Any, narrow: Any = None) -> Any:
    """A function that reads an element of the memory at an address. narrow: its type there, if it is unsigned and
    widened to `kind`."""
    stored = _STORED[narrow or kind]

    def load(typing: Any, address: Any, index: Any) -> Any:
        def generate(context: Any, build: Any, signature: Any, given: Any) -> Any:
            address, index = given
            value = build.load(_there(build, address, index, stored), align=stored.width // 8 if narrow else 8)
            return build.zext(value, WORD) if narrow else value

        return kind(types.int64, types.int64), generate

    return intrinsic(load)


def _stores(kind: Any, narrow: Any = None) -> Any:
    """A function that writes such an element."""
    stored = _STORED[narrow or kind]

    def store(typing: Any, address: Any, index: Any, value: Any) -> Any:
        def generate(context: Any, build: Any, signature: Any, given: Any) -> Any:
            address, index, value = given
            value = build.trunc(value, stored) if narrow else value
            build.store(value, _there(build, address, index, stored), align=stored.width // 8 if narrow else 8)
            return context.get_dummy_value()

        return types.void(types.int64, types.int64, kind), generate

    return intrinsic(store)


real, put_real = _loads(types.float64), _stores(types.float64)
word, put_word = _loads(types.int64), _stores(types.int64)
byte, put_byte = _loads(types.int64, types.uint8), _stores(types.int64, types.uint8)
short = _loads(types.int64, types.uint16)
put_half = _stores(types.int64, types.int32)


@intrinsic
def bits_of(typing, number):
    """The bits of a real number as an integer."""
    return types.int64(types.float64), lambda context, build, signature, given: build.bitcast(given[0], WORD)


def calling(result: Any, arguments: tuple[Any, ...]) -> Any:
    """A function that calls a kernel by its address. result, arguments: the kernel's types.

    It takes the address, and that of a block of words: the arguments, each as few numbers as tell it (see
    `quiet.blocks.flat`).
    """

    def call(typing: Any, function: Any, block: Any) -> Any:
        def generate(context: Any, build: Any, signature: Any, given: Any) -> Any:
            convention = context.call_conv
            shape = convention.get_function_type(result, arguments)
            back, error, *wanted = shape.args
            value = cgutils.alloca_once(build, back.pointee, zfill=True)
            raised = cgutils.alloca_once(build, error.pointee, zfill=True)
            block = build.inttoptr(given[1], WORD.as_pointer())
            words = (build.load(build.gep(block, [WORD(i)])) for i in count())
            passed = [
                _as(build, word, kind)
                for word, kind in zip(_apart(context, build, words, arguments), wanted, strict=True)
            ]
            code = build.call(build.inttoptr(given[0], shape.as_pointer()), [value, raised, *passed])
            status = convention._get_return_status(build, code, build.load(raised))
            with cgutils.if_unlikely(build, status.is_error):
                convention.return_status_propagate(build, status)
            return context.get_dummy_value() if result == types.none else build.load(value)

        return result(types.int64, types.int64), generate

    return intrinsic(call)


def _apart(context: Any, build: Any, words: Iterator[Any], arguments: Any) -> Iterator[Any]:
    """The numbers that compiled functions pass for arguments. words: that tell them."""
    for each in arguments:
        if isinstance(each, types.BaseTuple):
            yield from _apart(context, build, words, each)
        elif isinstance(each, types.Array):
            data, shape = next(words), [next(words) for _ in range(each.ndim)]
            steps = [WORD(context.get_abi_sizeof(context.get_data_type(each.dtype)))]
            for size in reversed(shape):
                steps.insert(0, build.mul(size, steps[0]))
            yield from (WORD(0), WORD(0), reduce(build.mul, shape), steps[-1], data, *shape, *steps[1:])
        else:
            yield next(words)


def _as(build: Any, value: Any, wanted: Any) -> Any:
    """A word as an argument of this type."""
    if isinstance(wanted, ir.PointerType):
        return build.inttoptr(value, wanted)
    if isinstance(wanted, ir.DoubleType):
        return build.bitcast(value, wanted)
    return value if wanted == WORD else build.trunc(value, wanted)


@intrinsic
def call_round(typing, function, start, stop, count, table):
    """What a function of C of four words gives: that of rules, see `fleet.native.compiler`."""
    return types.int64(*[types.int64] * 5), _plain(WORD)


@intrinsic
def call_once(typing, function, context):
    """Call a function of C that gets one word, the address of its context."""
    return types.void(types.int64, types.int64), _plain(ir.VoidType())


def _plain(result: Any) -> Any:
    def generate(context: Any, build: Any, signature: Any, given: Any) -> Any:
        shape = ir.FunctionType(result, [WORD] * len(given[1:]))
        value = build.call(build.inttoptr(given[0], shape.as_pointer()), given[1:])
        return value if result == WORD else context.get_dummy_value()

    return generate
